/* A loop's contour at a number of rays [M 3.1], with turned rays [M 6.1]. Turning the rays is turning the loop the
 * other way about its centre: the crossings keep their segments and fractions. */
#include <math.h>
#include "sections.h"

static int64_t round_shift(int64_t value, int bits) { return (value + ((int64_t)1 << (bits - 1))) >> bits; }

static lathe_point turned_back(lathe_point p, lathe_point centre, lathe_point direction) {
    int64_t dx = p.x - centre.x, dy = p.y - centre.y;
    return (lathe_point){centre.x + (int32_t)round_shift(dx * direction.x + dy * direction.y, 14),
                         centre.y + (int32_t)round_shift(dy * direction.x - dx * direction.y, 14)};
}

static int32_t between(int32_t a, int32_t b, double t) {
    return (int32_t)lround((double)a + ((double)b - (double)a) * t);
}

lathe_status lathe__turn_loop(const lathe_point **out, lathe_arena *arena, const lathe_point *loop, uint32_t count,
                              lathe_point centre, uint32_t turn) {
    *out = loop;
    if (!(turn & 65535)) return LATHE_OK;
    lathe_point direction = lathe__ray_direction(turn & 65535, 65536), *copy = LATHE_NEW(arena, lathe_point, count);
    if (!copy) return LATHE_ERR_MEMORY;
    for (uint32_t i = 0; i < count; i++) copy[i] = turned_back(loop[i], centre, direction);
    *out = copy;
    return LATHE_OK;
}

lathe_point lathe__crossing_point(int64_t *radius, const lathe_crossing *x, const lathe_point *loop, uint32_t count,
                                  lathe_point centre) {
    lathe_point p = loop[x->segment], q = loop[x->segment + 1 < count ? x->segment + 1 : 0];
    double t = (double)x->numerator / (double)x->denominator;
    lathe_point at = {between(p.x, q.x, t), between(p.y, q.y, t)};
    *radius = llround(hypot((double)at.x - centre.x, (double)at.y - centre.y));
    return at;
}

lathe_status lathe__make_ray_contour(lathe_ray_contour *out, lathe_arena *arena, const lathe_point *loop,
                                     uint32_t count, lathe_point centre, uint32_t rays, uint32_t turn) {
    lathe_ray_contour c = {.centre = centre, .rays = rays, .turn = turn & 65535};
    const lathe_point *cast;
    lathe_status status = lathe__turn_loop(&cast, arena, loop, count, centre, turn);
    if (!status) status = lathe__cast_rays(&c.crossings, &c.count, arena, cast, count, centre, rays);
    if (status) return status;
    c.points = LATHE_NEW(arena, lathe_point, c.count);
    c.radius = LATHE_NEW(arena, int64_t, c.count);
    c.types = LATHE_NEW(arena, uint8_t, c.count);
    if (!c.points || !c.radius || !c.types) return LATHE_ERR_MEMORY;
    for (uint32_t i = 0; i < c.count; i++)
        c.points[i] = lathe__crossing_point(&c.radius[i], &c.crossings[i], loop, count, centre);
    status = lathe__classify_edges(c.types, c.crossings, c.count, rays);
    if (status) return status;
    *out = c;
    return LATHE_OK;
}

void lathe__ray_vector(double out[2], uint32_t ray, uint32_t rays, uint32_t turn) {
    double angle = 6.283185307179586 * ((double)ray / rays + turn / 65536.0);
    out[0] = cos(angle);
    out[1] = sin(angle);
}
