/* One-to-many branching in the plane of the many: exterior polygon and interior polygons [P 3.5]. */
#ifndef LATHE_BRANCHING_H
#define LATHE_BRANCHING_H
#include "closing.h"

/* The many: polygons M_0 .. M_(count-1), each counter-clockwise, disjoint and none inside another; M_i has the nodes
 * first[i] .. first[i + 1) of `at`. */
typedef struct lathe_many {
    const lathe_point *at;
    const uint32_t *first;     /* count + 1 */
    uint32_t count;
} lathe_many;

/* The exterior polygon F [P 3.5.1]: nodes, counter-clockwise, arena memory; a node of M_i is followed by the next
 * one of M_i or by a node of another polygon. It begins as the convex hull of all, with the chains of each polygon
 * between its corners; then each edge between two polygons is moved inwards, to the *neighbours* of the nearest pair
 * of their points (as the paper prints it); where a further polygon would be cut, that polygon is taken in. An edge
 * that touches anything gives way to the next ones further out. taken[i]: M_i takes part. Others are islands. FORMAT
 * if no simple polygon comes out; MEMORY. */
lathe_status lathe__exterior_polygon(uint32_t **nodes, uint32_t *count, bool *taken, lathe_arena *arena,
                                     const lathe_many *many);

/* The interior polygons [P 3.5.2]: what F encloses but no M_i covers, with the islands in it, in triangles (contour
 * closing). They are found by walking: along an edge of F between two polygons, then back along the second polygon
 * to where F leaves it, and so on. That gives what splitting F at polygons that occur twice gives. rings: how many
 * interior polygons there were. FORMAT if F is not of lathe__exterior_polygon; MEMORY. */
lathe_status lathe__close_interior(lathe_triangles *list, uint32_t *rings, lathe_arena *arena, const lathe_many *many,
                                   const uint32_t *nodes, uint32_t count, const bool *taken);
#endif
