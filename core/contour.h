/* Contours: closed polygons in a slice, their rays and crossings, edge types and derivation trees. Decoder-safe: integers only. */
#ifndef LATHE_CONTOUR_H
#define LATHE_CONTOUR_H
#include "arena.h"
#include "lathe.h"

typedef struct lathe_point { int32_t x, y; } lathe_point;   /* in-plane lattice units */

/* One closed loop; its points are points[first .. first + count) of its set, region on the left (outer: counter-clockwise). */
typedef struct lathe_loop {
    uint32_t first, count;
    bool hole;
    lathe_point centre;        /* where its rays start, lattice units [M 3.1] */
    uint32_t rays;             /* cast at this level (a power of two, >= 8), or 0 if the polygon has no rays */
} lathe_loop;

/* All loops of one slice: the outline of its region. Arrays live in the arena that made them. */
typedef struct lathe_outline {
    uint32_t point_count, loop_count;
    lathe_point *points;
    lathe_loop *loops;
    int32_t *ray;              /* per point: index of the ray that meets the loop there, or -1 (between rays) */
} lathe_outline;

/* Helpers that are used in many places: fast where code may be large, shared where it must be small (wasm). */
#ifdef LATHE_SMALL
#define LATHE_HELPER __attribute__((weak, noinline))
int64_t lathe__turn(const lathe_point *at, uint32_t a, uint32_t b, uint32_t c);
#else
#define LATHE_HELPER static inline
#endif
/* Twice the area of the triangle a b c, positive if it is counter-clockwise. Exact: coordinates are below 2^29. */
static inline int64_t lathe__orient(lathe_point a, lathe_point b, lathe_point c) {
    return (int64_t)(b.x - a.x) * (c.y - a.y) - (int64_t)(b.y - a.y) * (c.x - a.x);
}
/* The square of a distance. */
static inline uint64_t lathe__distance2(lathe_point a, lathe_point b) {
    int64_t x = a.x - b.x, y = a.y - b.y;
    return (uint64_t)(x * x + y * y);
}
LATHE_HELPER int64_t lathe__turn(const lathe_point *at, uint32_t a, uint32_t b, uint32_t c) { return lathe__orient(at[a], at[b], at[c]); }

/* ray.c: directions from an integer table, so that all platforms agree: |direction| is about 2^14. rays: power of two <= 65536. */
enum { LATHE_RAY_LENGTH = 1 << 14 };
lathe_point lathe__ray_direction(uint32_t ray, uint32_t rays);
/* The sector of a vector: the i with direction(i) <= angle < direction(i+1), counter-clockwise; (0,0) is sector 0. Exact. */
uint32_t lathe__ray_sector(int64_t dx, int64_t dy, uint32_t rays);

/* crossing.c: where the rays from a centre meet a loop, in walking order: the contour [M 3.1].
 * A ray through a vertex passes to its left. The crossing on segment (i, i+1) is given as i. A segment that passes several
 * rays gives several crossings, in walking order. */
typedef struct lathe_crossing {
    uint32_t segment;          /* loop point index i (0 .. count): the crossing lies on (i, i + 1) */
    uint32_t ray;
    bool in_out;               /* the ray leaves the region */
    bool outward;              /* the next crossing of the walk lies further out (where it is on the same ray: UP, else DOWN) */
    int64_t numerator, denominator; /* position on the segment: i + numerator/denominator, 0 <= n < d */
} lathe_crossing;
/* a/b against c/d (b, d > 0): -1, 0 or 1. */
int lathe__compare_fractions(uint64_t a, uint64_t b, uint64_t c, uint64_t d);
/* Upper bound of crossings is not known beforehand: *out is arena memory. */
lathe_status lathe__cast_rays(lathe_crossing **out, uint32_t *count, lathe_arena *arena, const lathe_point *points,
                              uint32_t point_count, lathe_point centre, uint32_t rays);

/* contour.c: edge types [M definition 1 as repaired]: edge i joins crossing i to crossing i + 1 (cyclic). */
typedef enum lathe_edge_type { LATHE_FOR, LATHE_BACK, LATHE_UP_I, LATHE_UP_O, LATHE_DOWN_I, LATHE_DOWN_O } lathe_edge_type;
/* types: count bytes (lathe_edge_type). RANGE if two neighbouring crossings are on rays more than one apart. */
lathe_status lathe__classify_edges(uint8_t *types, const lathe_crossing *crossings, uint32_t count, uint32_t rays);

/* grammar.c: the repaired grammar, parsed with one counter in linear time from the record crossing of ray 0.
 *   S -> (E f)^(rays) E;  E -> nothing | o T;  T -> X | X o T;  X -> i | b T f */
typedef enum lathe_symbol { LATHE_SYM_S, LATHE_SYM_E, LATHE_SYM_T, LATHE_SYM_X, LATHE_SYM_LEAF } lathe_symbol;
typedef struct lathe_node {
    uint8_t symbol;            /* lathe_symbol */
    uint8_t edge;              /* lathe_edge_type of a leaf */
    uint32_t first, count;     /* the edges it spans: first (cyclic from the start crossing), count */
    uint32_t child, next;      /* first child, next sibling; UINT32_MAX: none */
} lathe_node;
typedef struct lathe_tree {
    uint32_t start;            /* crossing where the string begins: ray 0's record crossing */
    uint32_t rays, edge_count, node_count;
    lathe_node *nodes;         /* node 0 is S; arena memory; at most 4 * edge_count + 2 */
    uint32_t *main_edge;       /* rays entries: the string position of the i-th unmatched f, whose fold (E) precedes it */
} lathe_tree;
/* FORMAT if the string is not a contour of a loop around its centre (no winding of exactly one turn). */
lathe_status lathe__parse_contour(lathe_tree *out, lathe_arena *arena, const lathe_crossing *crossings, const uint8_t *types,
                                  uint32_t count, uint32_t rays);

/* tiling.c: walks two trees together [M 4.1-4.5]: corresponding edges advance both contours, corresponding vertices one.
 * steps[k]: 1 = one edge of a, 2 = one edge of b, 3 = corresponding edges (two triangles). The path starts at a.start, b.start
 * and uses every edge of both exactly once. steps has room for a.edge_count + b.edge_count bytes. */
lathe_status lathe__walk_trees(uint8_t *steps, uint32_t *step_count, const lathe_tree *a, const lathe_tree *b);
#endif
