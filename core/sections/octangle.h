/* Octangles: the least polygon that holds some points and whose sides have one of eight directions, 45 degrees apart
 * [H 2.1]. */
#ifndef LATHE_OCTANGLE_H
#define LATHE_OCTANGLE_H
#include "contour.h"

/* low[k] <= value <= high[k] for x, y, x + y, x - y. Exact: coordinates are below 2^29. Each side touches one of the
 * points. */
typedef struct lathe_octangle { int32_t low[4], high[4]; } lathe_octangle;

lathe_octangle lathe__octangle_of(lathe_point p, lathe_point q);
void lathe__octangle_add(lathe_octangle *octangle, lathe_point p);
void lathe__octangle_join(lathe_octangle *octangle, const lathe_octangle *other);
/* Corners, counter-clockwise; some may coincide. All lie in the box of the points. */
void lathe__octangle_corners(lathe_point corners[8], const lathe_octangle *octangle);

/* Do two octangles have a point in common? Exact: of two such polygons that do not, one has a side that separates
 * them. */
static inline bool lathe__octangles_overlap(const lathe_octangle *a, const lathe_octangle *b) {
    for (int k = 0; k < 4; k++)
        if (a->low[k] > b->high[k] || b->low[k] > a->high[k]) return false;
    return true;
}
static inline bool lathe__octangle_holds(const lathe_octangle *a, lathe_point p) {
    int32_t sum = p.x + p.y, difference = p.x - p.y;
    return p.x >= a->low[0] && p.x <= a->high[0] && p.y >= a->low[1] && p.y <= a->high[1] && sum >= a->low[2] &&
           sum <= a->high[2] && difference >= a->low[3] && difference <= a->high[3];
}
#endif
