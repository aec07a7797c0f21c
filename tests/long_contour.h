/* Contours with as many crossings as asked for, full of folds: a curve that swings forward and backward while it goes
 * round once. It crosses itself, which parsing and tiling do not mind. */
#ifndef LATHE_LONG_CONTOUR_H
#define LATHE_LONG_CONTOUR_H
#include "sections.h"
#include <math.h>

static inline uint32_t long_contour_rays(uint32_t crossings) {
    uint32_t rays = 64;
    while (rays < 65536 && rays * 16 < crossings) rays *= 2;
    return rays;
}
/* About `crossings` crossings at long_contour_rays(crossings) rays; variant changes the radii and the swings a little.
 * */
static inline lathe_status long_contour(lathe_ray_contour *out, lathe_arena *arena, uint32_t crossings, int variant) {
    uint32_t rays = long_contour_rays(crossings), swings = rays / 32, count = swings * 64;
    double width = 8.0 * crossings / rays; /* of a swing, in rays */
    lathe_point *points = LATHE_NEW(arena, lathe_point, count);
    if (!points) return LATHE_ERR_MEMORY;
    for (uint32_t i = 0; i < count; i++) {
        double t = (double)i / count, swing = 6.283185307179586 * swings * t;
        double angle = 6.283185307179586 * (t + width / rays * sin(swing + 0.3 * variant));
        double radius = 1e8 * (0.6 + 0.2 * sin(18.8 * t) + 0.1 * cos(swing / 3 + variant) + 0.05 * sin(2 * swing));
        points[i] = (lathe_point){(int32_t)lround(radius * cos(angle)), (int32_t)lround(radius * sin(angle))};
    }
    return lathe__make_ray_contour(out, arena, points, count, (lathe_point){0, 0}, rays, 0);
}
#endif
