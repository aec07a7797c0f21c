/* Self-intersections and exact signs on the integer lattice. */
#ifndef LATHE_MESH_INTERSECT_H
#define LATHE_MESH_INTERSECT_H
#include "lathe.h"

/* Sign of the volume of a, b, c, d: positive when d sees a, b, c clockwise. Exact for all int32 coordinates. */
int lathe__orient3d(const int32_t *a, const int32_t *b, const int32_t *c, const int32_t *d);
/* Repeated or collinear corners. Exact for all int32 coordinates. */
bool lathe__triangle_degenerate(const int32_t *a, const int32_t *b, const int32_t *c);
/* Pairs of triangles that meet beyond the corners or the edge that they share by index. Triangles that are degenerate or have
 * an index out of range are left out. MEMORY. */
lathe_status lathe__mesh_intersections(uint64_t *out, const lathe_mesh *mesh);
#endif
