/* From the loops of a tube to its radius map: the outermost crossing on each ray of each row's loop; then where the grey values say. */
#include <math.h>
#include <string.h>
#include "centre.h"
#include "radius_map.h"

static const double FULL_TURN = 6.283185307179586;

typedef struct fit {
    lathe_radius_map *map;
    lathe_arena *scratch;      /* of one row */
    const lathe_row_loop *loops;
    int32_t first;
    bool hole;
    const lathe_grey *grey;
    double (*direction)[2];    /* of each ray, before its row's turn */
    double back, area;         /* twice, lattice units squared */
} fit;

/* The ray of the last level that a vector's angle follows, turned back by the row's turn. */
static double ray_position(const fit *f, int32_t row, double x, double y) {
    double turned = atan2(y, x) / FULL_TURN - (double)f->map->turn * row / 65536;
    return (turned - floor(turned)) * f->map->rays;
}

/* Cosine and sine of a row's turn. */
static void row_turn(double out[2], const fit *f, int32_t row) {
    double angle = FULL_TURN * f->map->turn * row / 65536;
    out[0] = cos(angle), out[1] = sin(angle);
}

static void ray_direction(double out[2], const fit *f, const double turn[2], uint32_t ray) {
    const double *d = f->direction[ray];
    out[0] = d[0] * turn[0] - d[1] * turn[1];
    out[1] = d[1] * turn[0] + d[0] * turn[1];
}

/* How much of the loop goes back on its way round, as twice an area: 0 for a star. */
static double goes_back(const lathe_row_loop *loop, const int32_t centre[2]) {
    double cx = centre[0] * 0.5 * LATHE_LATTICE_ONE, cy = centre[1] * 0.5 * LATHE_LATTICE_ONE, back = 0;
    for (uint32_t i = 0; i < loop->count; i++) {
        lathe_point p = loop->points[i], q = loop->points[i + 1 < loop->count ? i + 1 : 0];
        double cross = (p.x - cx) * (q.y - cy) - (p.y - cy) * (q.x - cx);
        if (cross < 0) back -= cross;
    }
    return back;
}

/* The longest distance along each ray. */
static void cast_row(const fit *f, int32_t row) {
    const lathe_row_loop *loop = &f->loops[row];
    const int32_t *centre = f->map->centre[row];
    uint32_t rays = f->map->rays, n = loop->count;
    int32_t *radius = f->map->radius + (size_t)row * rays;
    double cx = centre[0] * 0.5 * LATHE_LATTICE_ONE, cy = centre[1] * 0.5 * LATHE_LATTICE_ONE, turn[2];
    row_turn(turn, f, row);
    for (uint32_t i = 0; i < rays; i++) radius[i] = LATHE_RADIUS_LEAST;
    double next = ray_position(f, row, loop->points[0].x - cx, loop->points[0].y - cy);
    for (uint32_t i = 0; i < n; i++) {
        lathe_point p = loop->points[i], q = loop->points[i + 1 < n ? i + 1 : 0];
        double px = p.x - cx, py = p.y - cy, qx = q.x - cx, qy = q.y - cy;
        double from = next, to = next = ray_position(f, row, qx, qy), cross = px * qy - py * qx;
        if (cross < 0 ? from < to : to < from) *(cross < 0 ? &from : &to) += rays;
        double low = cross < 0 ? to : from, high = cross < 0 ? from : to;
        for (double ray = ceil(low); ray <= high; ray++) {
            uint32_t index = (uint32_t)ray & (rays - 1);
            double d[2];
            ray_direction(d, f, turn, index);
            double across = (qx - px) * d[1] - (qy - py) * d[0];
            double length = fabs(across) < 1e-9 ? hypot(px, py) : ((qx - px) * -py - (qy - py) * -px) / -across;
            int32_t r = (int32_t)(length * LATHE_RADIUS_ONE / LATHE_LATTICE_ONE + 0.5);
            if (r > radius[index]) radius[index] = r;
        }
    }
}

static lathe_status middle(int32_t centre[2], const fit *f, int32_t row) {
    lathe_point c;
    lathe_status status = lathe__loop_centre(&c, f->scratch, f->loops[row].points, f->loops[row].count);
    centre[0] = (int32_t)lround(c.x * 2.0 / LATHE_LATTICE_ONE);
    centre[1] = (int32_t)lround(c.y * 2.0 / LATHE_LATTICE_ONE);
    lathe__arena_reset(f->scratch);
    return status;
}

static double depth(const fit *f, double u, double v, int32_t row) {
    double d = f->grey->value(f->grey->context, u, v, f->first + row) - f->grey->iso;
    return f->hole ? -d : d;
}

/* Where the grey values cross iso near a radius that the mask's outline has, radius units: from there half a pixel at a time until the
 * crossing lies between, then the line between; an end that stays counts half from then on. */
static int32_t grey_radius(const fit *f, int32_t row, const int32_t centre[2], const double d[2], int32_t radius) {
    enum { REACH = 3, TURNS = 8, EXACT = 256 };
    double low = radius / (double)LATHE_RADIUS_ONE, high = low, u = centre[0] * 0.5, v = centre[1] * 0.5;
    double inside = depth(f, u + low * d[0], v + low * d[1], row), outside = inside;
    for (int i = 0; inside < 0 && i < REACH && low > 0; i++) {
        high = low, outside = inside;
        low = low > 0.5 ? low - 0.5 : 0;
        inside = depth(f, u + low * d[0], v + low * d[1], row);
    }
    for (int i = 0; outside >= 0 && i < REACH; i++) {
        low = high, inside = outside;
        high += 0.5;
        outside = depth(f, u + high * d[0], v + high * d[1], row);
    }
    if (inside < 0 || outside >= 0) return radius;
    double enough = (inside - outside) / EXACT, at = low;
    for (int i = 0, side = 0; i < TURNS && high - low > 1.0 / EXACT; i++) {
        at = low + (high - low) * (inside / (inside - outside));
        double x = depth(f, u + at * d[0], v + at * d[1], row);
        if (fabs(x) < enough) break;
        if (x >= 0) low = at, inside = x, outside *= side > 0 ? 0.5 : 1, side = 1;
        else high = at, outside = x, inside *= side < 0 ? 0.5 : 1, side = -1;
    }
    return (int32_t)(at * LATHE_RADIUS_ONE + 0.5);
}

/* How far a cap rises where the grey values fall below iso above the centre, in eighths of a slice. */
static int32_t grey_apex(const fit *f, int32_t row, int side) {
    const int32_t *c = f->map->centre[row];
    double in = depth(f, c[0] * 0.5, c[1] * 0.5, row), out = depth(f, c[0] * 0.5, c[1] * 0.5, row + (side ? 1 : -1));
    if (in < 0 || out >= 0) return LATHE_APEX_ONE / 2;
    int32_t apex = (int32_t)lround(in / (in - out) * LATHE_APEX_ONE);
    return apex < 1 ? 1 : apex > LATHE_APEX_ONE - 1 ? LATHE_APEX_ONE - 1 : apex;
}

static double doubled_area(const lathe_row_loop *loop) {
    double area = 0;
    for (uint32_t i = 0; i < loop->count; i++) {
        lathe_point p = loop->points[i], q = loop->points[i + 1 < loop->count ? i + 1 : 0];
        area += (double)p.x * q.y - (double)p.y * q.x;
    }
    return area;
}

/* between: where the centre would be for nothing, or NULL. It is taken unless the loop's own sees more of it. */
static lathe_status fit_row(fit *f, int32_t row, const int32_t *between) {
    const lathe_row_loop *loop = &f->loops[row];
    int32_t *centre = f->map->centre[row];
    double back = between ? goes_back(loop, between) : 1;
    if (between) memcpy(centre, between, 2 * sizeof *centre);
    if (back > 0) {
        int32_t own[2];
        lathe_status status = middle(own, f, row);
        if (status) return status;
        double own_back = goes_back(loop, own);
        if (!between || own_back < back) memcpy(centre, own, sizeof own), back = own_back;
    }
    f->back += back;
    f->area += doubled_area(loop);
    cast_row(f, row);
    return LATHE_OK;
}

/* Rays about two voxels apart at the largest row: half of the box's diagonal is about as far as its loop reaches. */
static void choose_rays(lathe_radius_map *map, const lathe_row_loop *loops) {
    int64_t most = 0;
    for (int32_t row = 0; row < map->slices; row++) {
        lathe_point low = loops[row].points[0], high = low;
        for (uint32_t i = 1; i < loops[row].count; i++) {
            lathe_point p = loops[row].points[i];
            if (p.x < low.x) low.x = p.x;
            if (p.x > high.x) high.x = p.x;
            if (p.y < low.y) low.y = p.y;
            if (p.y > high.y) high.y = p.y;
        }
        int64_t wide = high.x - low.x, tall = high.y - low.y, reach = (wide > tall ? wide : tall) / 2;
        if (reach > most) most = reach;
    }
    uint32_t rays = lathe__choose_rays(most, 1);
    map->rays = rays < 16 ? 16 : rays > LATHE_RADIUS_MAX_RAYS ? LATHE_RADIUS_MAX_RAYS : rays;
}

static lathe_status aim(fit *f, lathe_arena *arena) {
    f->direction = lathe__arena_alloc(arena, f->map->rays, sizeof *f->direction);
    if (!f->direction) return LATHE_ERR_MEMORY;
    for (uint32_t i = 0; i < f->map->rays; i++) {
        double angle = FULL_TURN * i / f->map->rays;
        f->direction[i][0] = cos(angle), f->direction[i][1] = sin(angle);
    }
    return LATHE_OK;
}

lathe_status lathe__radius_fit(lathe_radius_map *map, lathe_arena *arena, lathe_arena *scratch, const lathe_row_loop *loops, double *back) {
    fit f = {.map = map, .scratch = scratch, .loops = loops};
    choose_rays(map, loops);
    lathe_status status = lathe__radius_map_start(map, arena);
    int32_t last = map->slices - 1;
    if (!status) status = aim(&f, arena);
    for (uint32_t level = 0; !status && level < map->level_count; level++) {
        int32_t stride = (int32_t)1 << (map->level_count - 1 - level);
        if (!level) {
            for (int32_t row = 0; !status && row < last; row += stride) status = fit_row(&f, row, NULL);
            if (!status) status = fit_row(&f, last, NULL);
            continue;
        }
        for (int32_t row = stride; !status && row < last; row += 2 * stride) {
            int32_t low = row - stride, high = row + stride < last ? row + stride : last, between[2];
            for (int k = 0; k < 2; k++) between[k] = lathe__centre_between(low, map->centre[low][k], high, map->centre[high][k], row);
            status = fit_row(&f, row, between);
        }
    }
    map->apex[0] = map->apex[1] = LATHE_APEX_ONE / 2;
    *back = f.area > 0 ? f.back / f.area : 1;
    return status;
}

lathe_status lathe__radius_turn(lathe_radius_map *map, lathe_arena *arena, const lathe_row_loop *loops, int32_t turn) {
    fit f = {.map = map, .loops = loops};
    map->turn = turn;
    map->radius = LATHE_NEW(arena, int32_t, (size_t)map->slices * map->rays);
    lathe_status status = map->radius ? aim(&f, arena) : LATHE_ERR_MEMORY;
    for (int32_t row = 0; !status && row < map->slices; row++) cast_row(&f, row);
    return status;
}

lathe_status lathe__radius_follow(lathe_radius_map *map, lathe_arena *arena, int32_t first, bool hole, const lathe_grey *grey) {
    fit f = {.map = map, .first = first, .hole = hole, .grey = grey};
    lathe_status status = aim(&f, arena);
    for (int32_t row = 0; !status && row < map->slices; row++) {
        int32_t *radius = map->radius + (size_t)row * map->rays;
        double turn[2], d[2];
        row_turn(turn, &f, row);
        for (uint32_t i = 0; i < map->rays; i++) {
            ray_direction(d, &f, turn, i);
            radius[i] = grey_radius(&f, row, map->centre[row], d, radius[i]);
            if (radius[i] < LATHE_RADIUS_LEAST) radius[i] = LATHE_RADIUS_LEAST;
        }
    }
    for (int side = 0; !status && side < 2; side++) map->apex[side] = grey_apex(&f, side ? map->slices - 1 : 0, side);
    return status;
}
