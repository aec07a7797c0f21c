/* From a mask to a radius map: the outermost crossing on each ray of each slice's only loop. */
#include <math.h>
#include <string.h>
#include "centre.h"
#include "radius_map.h"

typedef struct fit {
    lathe_radius_map *map;
    lathe_arena *scratch;      /* of one row */
    const lathe_mask *mask;
    int fraction;
    const lathe_grey *grey;    /* NULL: the outline is the truth */
} fit;

static lathe_status trace_row(lathe_outline *out, const fit *f, int32_t row) {
    lathe_slice_view view = {.pixels = lathe__mask_slice(f->mask, row), .width = f->mask->size[0], .height = f->mask->size[1],
                             .row_words = f->mask->row_words, .fraction = f->fraction};
    int32_t *border;
    lathe_status status = lathe__trace_outline(out, &border, f->scratch, &view);
    return status ? status : out->loop_count == 1 && !out->loops[0].hole ? LATHE_OK : LATHE_ERR_EMPTY;
}

/* The ray of the last level that a vector's angle follows, turned back by the row's turn. */
static double ray_position(const fit *f, int32_t row, double x, double y) {
    double turned = atan2(y, x) / 6.283185307179586 - (double)f->map->turn * row / 65536;
    return (turned - floor(turned)) * f->map->rays;
}

/* Longest distance along each ray; counts how often the loop goes back on its way round: 0 for a star. */
static double cast_row(int32_t *radius, const fit *f, const lathe_outline *outline, int32_t row, const int32_t centre[2]) {
    uint32_t rays = f->map->rays, n = outline->point_count;
    double cx = centre[0] * 0.5 * LATHE_LATTICE_ONE, cy = centre[1] * 0.5 * LATHE_LATTICE_ONE, back = 0;
    if (radius) memset(radius, 0, rays * sizeof *radius);
    for (uint32_t i = 0; i < n; i++) {
        lathe_point p = outline->points[i], q = outline->points[i + 1 < n ? i + 1 : 0];
        double px = p.x - cx, py = p.y - cy, qx = q.x - cx, qy = q.y - cy;
        double from = ray_position(f, row, px, py), to = ray_position(f, row, qx, qy), cross = px * qy - py * qx;
        if (cross < 0) back -= cross;
        if (cross < 0 ? from < to : to < from) *(cross < 0 ? &from : &to) += rays;
        double low = cross < 0 ? to : from, high = cross < 0 ? from : to;
        for (double ray = ceil(low); radius && ray <= high; ray++) {
            uint32_t index = (uint32_t)ray & (rays - 1);
            double angle = 6.283185307179586 * (index / (double)rays + (double)f->map->turn * row / 65536);
            double dx = cos(angle), dy = sin(angle), across = (qx - px) * dy - (qy - py) * dx;
            double length = fabs(across) < 1e-9 ? hypot(px, py) : ((qx - px) * -py - (qy - py) * -px) / -across;
            int32_t r = (int32_t)lround(length * LATHE_RADIUS_ONE / LATHE_LATTICE_ONE);
            if (r > radius[index]) radius[index] = r;
        }
    }
    return back;
}

static lathe_status middle(int32_t centre[2], const fit *f, const lathe_outline *outline) {
    lathe_point c;
    lathe_status status = lathe__loop_centre(&c, f->scratch, outline->points, outline->point_count);
    centre[0] = (int32_t)lround(c.x * 2.0 / LATHE_LATTICE_ONE);
    centre[1] = (int32_t)lround(c.y * 2.0 / LATHE_LATTICE_ONE);
    return status;
}

/* Where the grey values cross iso near a radius that the mask's outline has, radius units. */
static int32_t grey_radius(const fit *f, int32_t row, const int32_t centre[2], uint32_t ray, int32_t radius) {
    double angle = 6.283185307179586 * (ray / (double)f->map->rays + (double)f->map->turn * row / 65536), near = radius / (double)LATHE_RADIUS_ONE;
    double low = near > 1.5 ? near - 1.5 : 0, high = near + 1.5, value[2];
    for (int turn = 0; turn < 12; turn++) {
        double middle = turn == 0 ? low : turn == 1 ? high : (low + high) / 2;
        double v = f->grey->value(f->grey->context, centre[0] * 0.5 + middle * cos(angle), centre[1] * 0.5 + middle * sin(angle), row) - f->grey->iso;
        if (turn < 2) value[turn] = v;
        if (turn == 1 && (value[0] < 0 || value[1] >= 0)) return radius;
        if (turn > 1) *(v >= 0 ? &low : &high) = middle;
    }
    return (int32_t)lround((low + high) / 2 * LATHE_RADIUS_ONE);
}

/* How far a cap rises where the grey values fall below iso above the centre, in eighths of a slice. */
static int32_t grey_apex(const fit *f, int32_t row, int side) {
    const int32_t *c = f->map->centre[row];
    if (!f->grey) return LATHE_APEX_ONE / 2;
    double in = f->grey->value(f->grey->context, c[0] * 0.5, c[1] * 0.5, row) - f->grey->iso;
    double out = f->grey->value(f->grey->context, c[0] * 0.5, c[1] * 0.5, row + (side ? 1 : -1)) - f->grey->iso;
    if (in < 0 || out >= 0) return LATHE_APEX_ONE / 2;
    int32_t apex = (int32_t)lround(in / (in - out) * LATHE_APEX_ONE);
    return apex < 1 ? 1 : apex > LATHE_APEX_ONE - 1 ? LATHE_APEX_ONE - 1 : apex;
}

/* between: where the centre would be for nothing, or NULL. It is taken unless the loop's own sees more of it. */
static lathe_status fit_row(const fit *f, int32_t row, const int32_t *between) {
    lathe_outline outline;
    lathe_status status = trace_row(&outline, f, row);
    int32_t *centre = f->map->centre[row], *radius = f->map->radius + (size_t)row * f->map->rays;
    if (!status) status = middle(centre, f, &outline);
    if (status) return status;
    if (between && cast_row(NULL, f, &outline, row, between) <= cast_row(NULL, f, &outline, row, centre))
        memcpy(centre, between, 2 * sizeof *centre);
    cast_row(radius, f, &outline, row, centre);
    for (uint32_t i = 0; i < f->map->rays; i++) {
        if (f->grey) radius[i] = grey_radius(f, row, centre, i, radius[i]);
        if (radius[i] < LATHE_RADIUS_LEAST) radius[i] = LATHE_RADIUS_LEAST;
    }
    lathe__arena_reset(f->scratch);
    return LATHE_OK;
}

/* Rays about two voxels apart at the largest row. */
static lathe_status choose_rays(lathe_radius_map *map, const fit *f) {
    double most = 0;
    for (int32_t row = 0; row < map->slices; row++) {
        lathe_outline outline;
        lathe_status status = trace_row(&outline, f, row);
        if (status) return status;
        int32_t c[2];
        status = middle(c, f, &outline);
        if (status) return status;
        for (uint32_t i = 0; i < outline.point_count; i++) {
            double r = hypot(outline.points[i].x - c[0] * 32768.0, outline.points[i].y - c[1] * 32768.0);
            if (r > most) most = r;
        }
        lathe__arena_reset(f->scratch);
    }
    uint32_t rays = lathe__choose_rays((int64_t)most, 1);
    map->rays = rays < 16 ? 16 : rays > LATHE_RADIUS_MAX_RAYS ? LATHE_RADIUS_MAX_RAYS : rays;
    return LATHE_OK;
}

lathe_status lathe__radius_fit(lathe_radius_map *truth, lathe_arena *arena, lathe_arena *scratch, const lathe_mask *mask, int fraction,
                               const lathe_grey *grey, uint32_t level_count, int32_t turn) {
    lathe_radius_map map = {.slices = mask->size[2], .level_count = level_count, .turn = turn, .farthest = (mask->size[0] + mask->size[1]) * LATHE_RADIUS_ONE};
    fit f = {.map = &map, .scratch = scratch, .mask = mask, .fraction = fraction, .grey = grey};
    lathe_status status = choose_rays(&map, &f);
    if (!status) status = lathe__radius_map_start(&map, arena);
    int32_t last = map.slices - 1;
    for (uint32_t level = 0; !status && level < level_count; level++) {
        int32_t stride = (int32_t)1 << (level_count - 1 - level);
        if (!level) {
            for (int32_t row = 0; !status && row < last; row += stride) status = fit_row(&f, row, NULL);
            if (!status) status = fit_row(&f, last, NULL);
            continue;
        }
        for (int32_t row = stride; !status && row < last; row += 2 * stride) {
            int32_t low = row - stride, high = row + stride < last ? row + stride : last, between[2];
            for (int k = 0; k < 2; k++) between[k] = lathe__centre_between(low, map.centre[low][k], high, map.centre[high][k], row);
            status = fit_row(&f, row, between);
        }
    }
    for (int side = 0; !status && side < 2; side++) map.apex[side] = grey_apex(&f, side ? last : 0, side);
    if (!status) *truth = map;
    return status;
}
