/* Refinement of contours as edits [M 5.1]: new rays are cast between the old ones, their crossings go into the contour
 * where they lie, and the leaves of derivation trees become subtrees. Nothing else is touched: crossings, edges and
 * nodes keep their numbers.
 *
 * An edge of a contour is what the loop does between two neighbouring crossings, so it lies in one sector between two
 * rays. A new ray in that sector is crossed by it as often as it changes sides:
 *
 *   f -> f (o i)* f      P2' F -> F F is the case without (o i), whose D and U otherwise lie between the two F
 *   b -> b (i o)* b      P3' B -> B B likewise
 *   o -> o | f o (i o)* b      property 3 [M 3.2] is the case of one o, which does not always hold: hence O -> f O R* b
 *   i -> i | b i (o i)* f      likewise I -> b I pair* f
 *
 * Leaves become subtrees, but for one case: an excursion O -> f O (I O)* b one of whose single i crosses the new ray,
 * too, is two on that ray (I -> b I (O I)* f likewise), and its children are divided between them.
 *
 * The trees are those of derivation.h. What they promise: after each new ray a tree equals, node for node, the one
 * that lathe__derive_chain makes of the finer contour, cast and classified anew, with level-1 edges that come from the
 * old level-1 edges: of the ray pairs (i, new) and (new, i + 1) the first and the last piece of the old one. (A tree
 * that chose its level-1 edges anew might take others: refinement keeps them, as the paper's does, so that what
 * corresponded goes on to correspond.) */
#ifndef LATHE_CONTOUR_EDIT_H
#define LATHE_CONTOUR_EDIT_H
#include "derivation.h"

typedef struct lathe_edit_ray {
    uint32_t angle;        /* 1/65536 of a full turn, counter-clockwise from the contour's turn */
    uint32_t first;        /* a crossing on it: the others follow by `beside` */
    uint32_t next, before; /* the rays counter-clockwise and clockwise of it */
} lathe_edit_ray;

typedef struct lathe_edit_crossing {
    lathe_crossing at;       /* as lathe__cast_rays gives it, but at.ray is a number in `rays` */
    uint32_t next;           /* in walking order */
    uint32_t beside;         /* another one on the same ray, or UINT32_MAX */
    uint32_t cast_segment;   /* where it was found: the segment before at.segment if it lies in that segment's end */
    uint64_t reach, divisor; /* distance from the centre: reach / divisor lengths of the ray's direction */
    uint8_t type;            /* lathe_edge_type of the edge that begins here */
    uint32_t split_by;       /* the last ray that split this edge, and the pieces behind the first: crossings */
    uint32_t split_first, split_count; /* split_first .. split_first + split_count, in walking order */
    lathe_point point;
    int64_t radius;
} lathe_edit_crossing;

/* How edges took new rays: not crossed (o and i only), split as P2', P3' and property 3 have it, or with folds of
 * their own. */
typedef enum lathe_split_kind {
    LATHE_SPLIT_NONE,
    LATHE_SPLIT_SIMPLE,
    LATHE_SPLIT_GENERAL,
    LATHE_SPLIT_KINDS
} lathe_split_kind;
typedef struct lathe_edit_counts {
    uint64_t edges[LATHE_DOWN_O + 1][LATHE_SPLIT_KINDS];
} lathe_edit_counts;

typedef struct lathe_edit_contour {
    const lathe_point *loop; /* the caller's, must stay */
    const lathe_point *cast; /* turned back */
    uint32_t point_count, turn;
    lathe_point centre;
    lathe_edit_ray *rays;
    lathe_edit_crossing *crossings;
    uint32_t *refined; /* the edges that the last ray split: numbers of the crossings where they begin */
    uint32_t ray_count, ray_capacity, count, capacity, refined_count, refined_capacity;
    uint32_t head; /* the first crossing in the order of lathe__cast_rays */
    lathe_edit_counts counts;
    lathe_arena arena; /* of `cast` */
} lathe_edit_contour;

/* The contour of a counter-clockwise loop at `rays` rays (a power of two in 4..65536), the first at `turn`; crossing i
 * is the i-th of lathe__cast_rays, ray i the i-th. FORMAT: it does not go round the centre once, or passes through it.
 * RANGE, LIMIT, MEMORY. Any loop is safe; on failure there is nothing to close. */
lathe_status lathe__edit_contour_open(lathe_edit_contour *out, const lathe_point *loop, uint32_t count,
                                      lathe_point centre, uint32_t rays, uint32_t turn);
void lathe__edit_contour_close(lathe_edit_contour *contour);
/* Casts one ray more, between ray `after` and the next one; its number is the old ray_count. Work: loop points and
 * crossings between these two rays. RANGE: the angle is not strictly between theirs. MEMORY, LIMIT: then the contour
 * must be closed. */
lathe_status lathe__edit_insert_ray(lathe_edit_contour *contour, uint32_t after, uint32_t angle);
/* Half way from ray `after` to the next; 0 if there is no direction between them. Ray 0 is at angle 0, so 0 is never
 * an answer. */
uint32_t lathe__edit_middle_angle(const lathe_edit_contour *contour, uint32_t after);
/* The contour as it is now, rays numbered by angle, beginning at ray 0. ids: NULL, or gets an arena array: which
 * crossing each one is. out->rays may be any number >= 4. MEMORY. */
lathe_status lathe__edit_export(lathe_ray_contour *out, uint32_t **ids, lathe_arena *arena,
                                const lathe_edit_contour *contour);

typedef struct lathe_edit_node {
    uint8_t symbol;       /* lathe_derivation_symbol */
    uint32_t edge;        /* of a leaf and of a level-1 node */
    uint32_t child, next; /* child of a level-1 node: its D part */
    uint32_t last;        /* last child; of a level-1 node: its U part */
} lathe_edit_node;

typedef struct lathe_edit_tree {
    lathe_edit_node *nodes;
    uint32_t *owner;  /* of an edge: the element whose leaf it is, or the level-1 node */
    uint32_t *level1; /* by ray number: the level-1 node of the edge that leads from it to the next */
    uint32_t *stack;  /* for walks: trees can be as deep as a contour is long */
    uint32_t node_count, node_capacity, owner_capacity, level1_capacity, stack_capacity;
    bool relabel; /* an element is now compared by its ends, and they say otherwise than its edge did */
} lathe_edit_tree;

/* The tree of the contour with these level-1 edges: chain[i], a crossing, leads from ray i to the next; i: number of a
 * ray. The contour must be as lathe__edit_contour_open left it. MEMORY; FORMAT. */
lathe_status lathe__edit_tree_open(lathe_edit_tree *out, const lathe_edit_contour *contour, const uint32_t *chain);
void lathe__edit_tree_close(lathe_edit_tree *tree);
/* After each lathe__edit_insert_ray: replaces the leaves of the edges that were split. MEMORY: then the tree must be
 * closed. */
lathe_status lathe__edit_tree_refine(lathe_edit_tree *tree, const lathe_edit_contour *contour);
/* As lathe__derive_chain would give it; edges are numbered as in lathe__edit_export. MEMORY. */
lathe_status lathe__edit_tree_export(lathe_derivation *out, lathe_arena *arena, lathe_edit_tree *tree,
                                     const lathe_edit_contour *contour);
/* The fold on one ray and the level-1 edge behind it alone, as a tree with one ray for lathe__walk_derivations, and
 * the points for it. ids: gets the crossings in order, the end of the level-1 edge last: points->count of them.
 * MEMORY. */
lathe_status lathe__edit_tree_fold(lathe_derivation *out, lathe_ray_contour *points, uint32_t **ids, lathe_arena *arena,
                                   lathe_edit_tree *tree, const lathe_edit_contour *contour, uint32_t ray);
#endif
