/* The surface of tubes: their polygons in each shown slice, stacked by the overlay, which joins and parts them, closes their ends and
 * cannot cross itself. A tube that is all of its structure is made of strips, as a simple map is: faster, and to the same end. */
#include <string.h>
#include "radius_tubes.h"

static bool is_one_tube(const lathe_radii *radii) {
    return radii->count == 1 && !radii->tubes[0].hole && !radii->tubes[0].first && radii->tubes[0].map.slices == radii->slices;
}

static uint32_t stride_of(const lathe_radius_map *map, uint32_t stride) { return map->rays / stride < 8 ? map->rays / 8 : stride; }

lathe_status lathe__radii_outline(lathe_outline *out, lathe_arena *arena, lathe_radii *radii, uint32_t level, int32_t slice,
                                  uint32_t stride, uint32_t seed) {
    size_t points = 0;
    *out = (lathe_outline){0};
    for (uint32_t i = 0; i < radii->count; i++) points += radii->tubes[i].map.rays / stride_of(&radii->tubes[i].map, stride);
    out->points = LATHE_NEW(arena, lathe_point, points);
    out->ray = LATHE_NEW(arena, int32_t, points);
    out->loops = LATHE_NEW(arena, lathe_loop, radii->count);
    if (!out->points || !out->ray || !out->loops) return LATHE_ERR_MEMORY;
    for (uint32_t i = 0; i < radii->count; i++) {
        lathe_radius_tube *tube = &radii->tubes[i];
        int32_t row = slice - tube->first;
        if (row < 0 || row >= tube->map.slices) continue;
        lathe_radius_map map = lathe__tube_shown(tube, lathe__passes_at(radii, tube, level));
        uint32_t q = stride_of(&map, stride), rays = map.rays / q;
        const int32_t *c = map.centre[row], *r = map.radius + (size_t)row * map.rays;
        out->loops[out->loop_count++] = (lathe_loop){.first = out->point_count, .count = rays, .hole = tube->hole, .rays = rays,
                                                     .centre = {c[0] * (LATHE_LATTICE_ONE / 2), c[1] * (LATHE_LATTICE_ONE / 2)}};
        for (uint32_t k = 0; k < rays; k++) {
            uint32_t ray = tube->hole ? rays - 1 - k : k;   /* holes have the region on the left, too */
            lathe_point p = lathe__radius_place(&map, c, row, ray * q, r[ray * q]);
            out->ray[out->point_count] = (int32_t)ray;
            out->points[out->point_count++] = lathe__jitter((lathe_point){p.x & ~1, p.y & ~1}, seed);
        }
    }
    return LATHE_OK;
}

/* Every stride-th slice and the last; of each tube the ends, and slices 1, 2, 4, ... from them: ends are round more often than not. */
static void mark_slices(bool *shown, const lathe_radii *radii, int32_t stride) {
    memset(shown, 0, (size_t)radii->slices * sizeof *shown);
    for (int32_t w = 0; w < radii->slices; w += stride) shown[w] = true;
    shown[radii->slices - 1] = true;
    for (uint32_t i = 0; i < radii->count; i++) {
        int32_t first = radii->tubes[i].first, last = first + radii->tubes[i].map.slices - 1;
        shown[first] = shown[last] = true;
        for (int32_t k = 1; k < stride && first + k < last; k *= 2) shown[first + k] = shown[last - k] = true;
    }
}

/* Rays are shown twice as dense as they have been coded: what is predicted between them is better than an edge. */
lathe_status lathe__radii_slices(int32_t **out, uint32_t *count, uint32_t *ray_stride, lathe_arena *arena, const lathe_radii *radii,
                                 uint32_t level) {
    int32_t stride = (int32_t)1 << (radii->level_count - 1 - level), *slices = LATHE_NEW(arena, int32_t, radii->slices);
    bool *mark = LATHE_NEW(arena, bool, radii->slices);
    uint32_t n = 0;
    if (!mark || !slices) return LATHE_ERR_MEMORY;
    mark_slices(mark, radii, stride);
    for (int32_t w = 0; w < radii->slices; w++)
        if (mark[w]) slices[n++] = w;
    *out = slices;
    *count = n;
    *ray_stride = stride > 1 ? (uint32_t)stride / 2 : 1;
    return LATHE_OK;
}

static lathe_status stack(lathe_mesh *out, lathe_arena arena[2], lathe_radii *radii, uint32_t level, const int32_t *slices, uint32_t count,
                          uint32_t stride, lathe_surface_counts *counts) {
    lathe_outline *outlines = LATHE_NEW(&arena[0], lathe_outline, count);
    if (!outlines) return LATHE_ERR_MEMORY;
    for (uint32_t i = 0; i < count; i++) {
        lathe_status status = lathe__radii_outline(&outlines[i], &arena[0], radii, level, slices[i], stride, i);
        if (status) return status;
        counts->contour_vertices += outlines[i].point_count;
        for (uint32_t k = 0; k < outlines[i].loop_count; k++)
            if (outlines[i].loops[k].rays > counts->rays) counts->rays = outlines[i].loops[k].rays;
    }
    return lathe__stack_outlines(out, &arena[1], outlines, slices, count, false, counts);
}

lathe_status lathe__radii_mesh(lathe_mesh *out, lathe_arena arena[2], lathe_radii *radii, uint32_t level,
                               lathe_surface_counts *counts, uint32_t *shown) {
    if (radii->simple) {
        int32_t stride = (int32_t)1 << (radii->level_count - 1 - level);
        const lathe_radius_map *map = &radii->tubes[0].map;
        counts->rays = map->rays / lathe__radius_ray_stride(map, level);
        *shown = (uint32_t)((radii->slices - 1 + stride - 1) / stride) + 1;
        counts->contour_vertices = (uint64_t)counts->rays * *shown;
        return lathe__radius_mesh(out, map, level);
    }
    int32_t *slices;
    uint32_t count, stride;
    lathe_status status = lathe__radii_slices(&slices, &count, &stride, &arena[0], radii, level);
    if (!status) {
        *shown = count;
        if (is_one_tube(radii)) {
            lathe_radius_map map = lathe__tube_shown(&radii->tubes[0], lathe__passes_at(radii, &radii->tubes[0], level));
            uint32_t q = stride_of(&map, stride);
            counts->rays = map.rays / q;
            counts->contour_vertices = (uint64_t)counts->rays * count;
            status = lathe__radius_strips(out, &map, slices, count, q);
        } else {
            status = stack(out, arena, radii, level, slices, count, stride, counts);
        }
    }
    lathe__arena_reset(&arena[0]);
    lathe__arena_reset(&arena[1]);
    return status;
}
