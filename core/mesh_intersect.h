/* Self-intersections and exact signs on the integer lattice. */
#ifndef LATHE_MESH_INTERSECT_H
#define LATHE_MESH_INTERSECT_H
#include "lathe.h"

/* Sign of the volume of a, b, c, d: positive when d sees a, b, c clockwise. Exact for all int32 coordinates. */
int lathe__orient3d(const int32_t *a, const int32_t *b, const int32_t *c, const int32_t *d);
/* Repeated or collinear corners. Exact for all int32 coordinates. */
bool lathe__triangle_degenerate(const int32_t *a, const int32_t *b, const int32_t *c);
/* Do two triangles, neither degenerate, meet beyond the corners or the edge that they share by index? Exact. */
bool lathe__triangles_meet(const lathe_mesh *mesh, uint32_t first, uint32_t second);
/* Pairs of triangles that meet beyond the corners or the edge that they share by index. Triangles that are
 * degenerate or have an index out of range are left out. Near-linear unless many boxes overlap; fans about one
 * vertex may be of any size (mesh_fan.h). LIMIT: 2^31 triangles; MEMORY. */
lathe_status lathe__mesh_intersections(uint64_t *out, const lathe_mesh *mesh);
#endif
