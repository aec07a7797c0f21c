/* Derivation trees of contours towards a neighbour [M 4.2-4.4], on a grammar that has a tree for every contour.
 *
 *   S -> F^(rays)                       the level-1 nodes, each with the FOR edge from ray i to ray i + 1
 *   F -> [D] f [U]                      D: fold on ray i before f; U: fold on ray i + 1 behind it (as the paper's P2)
 *   D, U -> pair pair+ | pair           pair -> O I         (P4, P7, with DOWN and UP mixed freely: nodes D or U)
 *   O -> o | f O R* b                   (P5, P9)            nodes D_I, U_O
 *   I -> i | b I pair* f                (P6, P8)            nodes D_O, U_I
 *   R -> I O                            (P10, P11)          nodes D_R, U_R
 *
 * Why it always works: for *any* choice of one FOR edge for each ray pair, in walking order, what lies between two of
 * them begins and ends at IN-OUT crossings of one ray. Cut such a walk wherever it comes back to the ray's level: the
 * pieces are single UP or DOWN edges, excursions f ... b (which turn IN-OUT into OUT-IN, as an o does) and b ... f (as
 * an i does), in turn O, I, O, I; inside an excursion the same holds one level on. So the choice of the level-1 edges
 * is free, and ambiguous case 1 can be decided by geometry. (core/grammar.c is the special case of the record chain,
 * where f ... b does not occur.) */
#ifndef LATHE_DERIVATION_H
#define LATHE_DERIVATION_H
#include "sections.h"

typedef enum lathe_derivation_symbol {
    LATHE_DER_S, /* root */
    LATHE_DER_F, /* level-1 */
    LATHE_DER_D, /* a fold's part, or one pair of it */
    LATHE_DER_U,
    LATHE_DER_D_R, /* R */
    LATHE_DER_U_R,
    LATHE_DER_D_I, /* O */
    LATHE_DER_U_O,
    LATHE_DER_D_O, /* I */
    LATHE_DER_U_I,
    LATHE_DER_LEAF
} lathe_derivation_symbol;

typedef struct lathe_derivation_node {
    uint8_t symbol;        /* lathe_derivation_symbol */
    uint8_t edge;          /* lathe_edge_type of a leaf; LATHE_FOR at a level-1 node */
    uint32_t first, count; /* the string positions it spans */
    uint32_t child, next;  /* first child, next sibling; UINT32_MAX: none */
} lathe_derivation_node;

typedef struct lathe_derivation {
    uint32_t start; /* crossing (and edge) at string position 0 */
    uint32_t rays, edge_count, node_count;
    /* Node 0 is the root; preorder, so leaves come in string order; at most 3 * edge_count + 2. */
    lathe_derivation_node *nodes;
    uint32_t *level1;    /* rays entries: the level-1 node of the FOR edge from ray i to ray i + 1 */
    uint32_t *main_edge; /* rays entries: string position of that edge */
    uint64_t work;       /* steps done to build it; at most a constant times edge_count */
} lathe_derivation;

/* The right tree of a (towards b) and the left tree of b (towards a); the same number of rays. Arena memory.
 *
 * Ambiguous case 1: of the FOR edges of a ray pair the level-1 one is chosen so that the sum of the distances between
 * the two contours' level-1 edges is small. b's record chain is the first guess; then a, b and a choose in turn, each
 * the best chain through its anchor (its nearest edge where a ray pair has the fewest), in one pass over the edges.
 *
 * Ambiguous case 3: a fold that could be a D as well as a U takes the symbol of the neighbour's fold on that ray; where
 * that has both or none, its leading U pairs are the U of the level-1 node before, the rest is the D of the one behind.
 *
 * (Case 2 is decided where two trees meet: lathe__tile_trees.) Equal contours get equal trees.
 * RANGE: different ray counts. FORMAT: not a contour that goes round its centre once. MEMORY. Linear time. */
lathe_status lathe__derive_pair(lathe_derivation *right, lathe_derivation *left, lathe_arena *arena,
                                const lathe_ray_contour *a, const lathe_ray_contour *b);
/* The tree of a contour without a neighbour: level-1 edges are those of the record chain. */
lathe_status lathe__derive_alone(lathe_derivation *out, lathe_arena *arena, const lathe_ray_contour *contour);

/* The same with given level-1 edges, one for each ray pair (i, i + 1), in walking order (not checked). */
lathe_status lathe__derive_chain(lathe_derivation *out, lathe_arena *arena, const lathe_ray_contour *contour,
                                 const uint32_t *chain);

/* Symbol as text: "S", "F", "D", "D_I", ... */
const char *lathe__derivation_symbol_name(uint8_t symbol);

/* tile_trees.c: lathe__tile_trees on trees that are there; *work, if not NULL, counts comparisons and steps. */
lathe_status lathe__walk_derivations(lathe_tiling *out, uint64_t *work, lathe_arena *arena, const lathe_ray_contour *a,
                                     const lathe_derivation *right, const lathe_ray_contour *b,
                                     const lathe_derivation *left);
/* |dx| + |dy|: how far apart two points are where only comparing matters. */
static inline int64_t lathe__point_gap(lathe_point p, lathe_point q) {
    int64_t dx = (int64_t)p.x - q.x, dy = (int64_t)p.y - q.y;
    return (dx < 0 ? -dx : dx) + (dy < 0 ? -dy : dy);
}
#endif
