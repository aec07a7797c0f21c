/* Contour closing: a polygon, or what lies between it and its islands, in triangles [P 3.3]. */
#ifndef LATHE_CLOSING_H
#define LATHE_CLOSING_H
#include "overlay.h"

/* A growing list of node triples in arena memory. */
typedef struct lathe_triangles {
    uint32_t (*at)[3];
    uint32_t count, capacity;
} lathe_triangles;
lathe_status lathe__add_triangle(lathe_triangles *list, lathe_arena *arena, uint32_t a, uint32_t b, uint32_t c);

/* Simple contour closing [P 3.3.1]: again and again the cheapest ear, its cost CV_i being the length of the edge
 * that it leaves. A triangle is valid if it turns left and no point of the polygon lies in it or on its new edge
 * (then that edge is inside). Exact. nodes: the polygon counter-clockwise, places in `at`; a node may occur twice
 * where an interior polygon touches itself. At most quadratic in time for each cut that uncovers others; beyond
 * 20,000 nodes, or where no ear is left (a polygon that crosses itself), lathe__triangulate does the rest. Adds
 * count - 2 counter-clockwise triangles. */
lathe_status lathe__close_polygon(lathe_triangles *list, lathe_arena *arena, const lathe_point *at,
                                  const uint32_t *nodes, uint32_t count);

/* Contour closing with islands [P 3.3.2]: the island with the best pair of bridges (two different edges from the
 * polygon to it that cross nothing, of the least total length) is merged in, which leaves two polygons; both again,
 * until no island is left. polygon: ring 0 counter-clockwise, islands clockwise. Pairs without a common end are
 * preferred as such: only they are taken. Where there is none, or islands and polygon have more than 2^18 possible
 * bridges, lathe__triangulate does it (one bridge for each). */
lathe_status lathe__close_with_islands(lathe_triangles *list, lathe_arena *arena, const lathe_polygon *polygon);

/* Do the closed segments a b and c d have a point in common? Exact, for collinear ones too (lathe__segments_meet
 * says yes to all of those). */
bool lathe__edges_meet(lathe_point a, lathe_point b, lathe_point c, lathe_point d);

/* Even-odd: is p inside? Points on the polygon are decided as if moved right and up by nothing at all: one way or
 * the other. */
bool lathe__polygon_holds(const lathe_point *at, const uint32_t *nodes, uint32_t count, lathe_point p);
#endif
