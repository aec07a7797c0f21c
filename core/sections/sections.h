/* Reconstruction from planar cross-sections by the papers' own methods, on polygons: what its files share.
 *
 *   contour set (JSON) or slices of a mask -> sections -> [strip, hierarchy: fewer points] -> rays -> ray contours
 *        -> trees -> links -> per block: tiling | closing | branching -> slabs, proved one by one -> mesh
 *        -> [smooth patches]
 *
 * The decoder's own pipeline (core/level.c) is the lifted overlay of traced outlines; it is what a slab falls back to
 * here. */
#ifndef LATHE_SECTIONS_H
#define LATHE_SECTIONS_H
#include "contour.h"
#include "outline.h"

/* One slice plane and its loops (region on the left: outer loops counter-clockwise, holes clockwise). */
typedef struct lathe_section {
    int32_t height;            /* lattice units, ascending from section to section */
    lathe_outline outline;
} lathe_section;

/* Memory of everything in it is the arena's. */
typedef struct lathe_contour_set {
    lathe_section *sections;
    uint32_t count;
    lathe_transform transform; /* lattice -> world mm */
    lathe_arena arena;
} lathe_contour_set;

/* ray_contour.c: the contour of one loop at some number of rays, with the crossings themselves as its points
 * [M 3.1]. */
typedef struct lathe_ray_contour {
    lathe_point centre;
    uint32_t rays;             /* a power of two, >= 4 */
    uint32_t turn;             /* theta_0 in 1/65536 of a full turn, counter-clockwise */
    uint32_t count;            /* crossings = points = edges; edge i joins point i to point i + 1 (cyclic) */
    lathe_crossing *crossings; /* in walking order; segment indexes the loop that was given */
    lathe_point *points;       /* the crossings, rounded to the lattice */
    int64_t *radius;           /* distance of point i from the centre along its ray, lattice units, rounded */
    uint8_t *types;            /* lathe_edge_type of edge i */
} lathe_ray_contour;
/* Casts `rays` rays from the centre, the first at `turn`. Counter-clockwise loops only (pass a hole reversed).
 * Arrays are the arena's. RANGE (rays, or neighbouring crossings more than one ray apart), MEMORY. */
lathe_status lathe__make_ray_contour(lathe_ray_contour *out, lathe_arena *arena, const lathe_point *loop,
                                     uint32_t count, lathe_point centre, uint32_t rays, uint32_t turn);
/* What that does: the loop turned back about the centre (the loop itself where turn is 0; else arena memory); the
 * place of a crossing on the unturned loop, rounded to the lattice, and its distance from the centre. */
lathe_status lathe__turn_loop(const lathe_point **out, lathe_arena *arena, const lathe_point *loop, uint32_t count,
                              lathe_point centre, uint32_t turn);
lathe_point lathe__crossing_point(int64_t *radius, const lathe_crossing *crossing, const lathe_point *loop,
                                  uint32_t count, lathe_point centre);
/* Unit vector of ray i, in double: for drawing and measuring. */
void lathe__ray_vector(double out[2], uint32_t ray, uint32_t rays, uint32_t turn);

/* A tiling of the strip between two closed polygons (both counter-clockwise): it starts with the span (start[0],
 * start[1]) and each step advances along one polygon or both: 1 = one edge of a (triangle a_i a_i+1 b_j), 2 = one
 * edge of b, 3 = corresponding edges, that is two triangles (split by the shorter diagonal). Every edge of both is
 * used exactly once. */
typedef struct lathe_tiling {
    uint32_t start[2];
    uint32_t count;
    uint8_t *steps;            /* arena memory */
} lathe_tiling;

typedef enum lathe_tiling_method {
    LATHE_TILING_TREES,        /* Min-Lee: left and right derivation trees; needs ray contours [M 4] */
    LATHE_TILING_TOROIDAL,     /* minimum area in the toroidal graph (Keppel 1975; Fuchs, Kedem, Uselton 1977) */
    LATHE_TILING_CHRISTIANSEN, /* greedy shorter diagonal after mapping both to one unit square (Christiansen,
                                * Sederberg 1978) */
    LATHE_TILING_SHORTEST      /* shortest span after bringing the centroids together [P 3.4] */
} lathe_tiling_method;

/* Tilers on plain polygons: at[0..count), counter-clockwise, lattice units; rise: height of b above a, lattice units.
 * RANGE for fewer than 3 points; LIMIT where a method needs too much memory (toroidal: counts' product); MEMORY. */
lathe_status lathe__tile_toroidal(lathe_tiling *out, lathe_arena *arena, const lathe_point *a, uint32_t a_count,
                                  const lathe_point *b, uint32_t b_count, int32_t rise);       /* tile_toroidal.c */
lathe_status lathe__tile_christiansen(lathe_tiling *out, lathe_arena *arena, const lathe_point *a, uint32_t a_count,
                                      const lathe_point *b, uint32_t b_count, int32_t rise);   /* tile_christiansen.c */
lathe_status lathe__tile_shortest(lathe_tiling *out, lathe_arena *arena, const lathe_point *a, uint32_t a_count,
                                  const lathe_point *b, uint32_t b_count, int32_t rise);       /* tile_shortest.c */
/* Min-Lee's own: the right tree of a (towards b) against the left tree of b (towards a) [M 4.3-4.5], ambiguous cases
 * decided by geometry. Integer comparisons only. Both contours have the same number of rays (else RANGE).
 * tile_trees.c */
lathe_status lathe__tile_trees(lathe_tiling *out, lathe_arena *arena, const lathe_ray_contour *a,
                               const lathe_ray_contour *b);

/* How good a tiling is. tiling_measure.c */
typedef struct lathe_tiling_measure {
    uint32_t triangles, vertices;
    double mean_edge;          /* mean length of all distinct edges, lattice units */
    double area;               /* of the strip, square lattice units */
} lathe_tiling_measure;
lathe_status lathe__measure_tiling(lathe_tiling_measure *out, const lathe_tiling *tiling, const lathe_point *a,
                                   uint32_t a_count, const lathe_point *b, uint32_t b_count, int32_t rise);
#endif
