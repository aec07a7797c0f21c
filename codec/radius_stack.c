/* The surface of tubes: their shown slices and rings, and slab by slab what joins them. */
#include <string.h>
#include "radius_stack.h"

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
            p.x &= ~1, p.y &= ~1;
            out->points[out->point_count++] = radii->plain ? p : lathe__jitter(p, seed);
        }
    }
    return LATHE_OK;
}

/* Every stride-th slice and the last; early ones, if asked for; of each tube the ends, and slices 1, 2, 4, ... from them: ends are round more often than not. */
static void mark_slices(bool *shown, const lathe_radii *radii, int32_t stride, bool early) {
    memset(shown, 0, (size_t)radii->slices * sizeof *shown);
    for (int32_t w = 0; w < radii->slices; w += stride) shown[w] = true;
    shown[radii->slices - 1] = true;
    for (int32_t w = 0; early && w < radii->slices; w++) shown[w] |= radii->early[w];
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
    mark_slices(mark, radii, stride, radii->early_level && radii->early_level == level + 1);
    for (int32_t w = 0; w < radii->slices; w++)
        if (mark[w]) slices[n++] = w;
    *out = slices;
    *count = n;
    uint32_t rays = (uint32_t)stride / 2 >> radii->tubes[0].map.ahead;
    *ray_stride = rays ? rays : 1;
    return LATHE_OK;
}

/* ---- rings ---- */

static void measure_ring(lathe_tube_ring *r, const lathe_tube_stack *s, uint32_t tube, int32_t row) {
    const lathe_radius_map *map = &s->map[tube];
    const int32_t *radius = map->radius + (size_t)row * map->rays;
    int32_t least = radius[0], most = least, jump = 0, before = radius[map->rays - s->stride[tube]];
    for (uint32_t i = 0; i < map->rays; before = radius[i], i += s->stride[tube]) {
        most = radius[i] > most ? radius[i] : most;
        if (LATHE_TUBES_ONLY || !s->group) continue;
        int32_t rise = radius[i] < before ? before - radius[i] : radius[i] - before;
        jump = rise > jump ? rise : jump;
        least = radius[i] < least ? radius[i] : least;
    }
    /* Directions are as long as LATHE_RAY_LENGTH but for less than a thousandth. */
    r->least = (double)least * (LATHE_LATTICE_ONE / LATHE_RADIUS_ONE - 1);
    r->most = (double)most * (LATHE_LATTICE_ONE / LATHE_RADIUS_ONE + 1);
    r->jump = (double)jump * (LATHE_LATTICE_ONE / LATHE_RADIUS_ONE);
    for (int k = 0; k < 2; k++) r->centre[k] = map->centre[row][k] * (LATHE_LATTICE_ONE / 2);
}

static void place_ring(lathe_tube_stack *s, uint32_t slice, uint32_t tube) {
    const lathe_tube_ring *r = &s->rings[slice][tube];
    int32_t(*v)[3] = s->builder.mesh.lattice + r->base, height = s->slices[slice] * LATHE_LATTICE_ONE;
    uint32_t n = s->rays[tube];
    /* Holes have the region on the left, too: they go round clockwise. */
    bool hole = s->radii->tubes[tube].hole;
    lathe__radius_ring(hole ? v + n - 1 : v, hole ? -1 : 1, &s->fans[tube], &s->map[tube], s->slices[slice] - s->radii->tubes[tube].first, s->stride[tube], height);
    for (; n; n--, v++) v[0][0] &= ~1, v[0][1] &= ~1;   /* middles stay on the lattice */
}

static lathe_status open_stack(lathe_tube_stack *s, uint32_t stride, lathe_radii *radii, uint32_t level) {
    size_t points = 0;
    s->rings = lathe__arena_alloc(s->keep, (size_t)s->count + 2, sizeof *s->rings);
    s->fans = LATHE_NEW(s->keep, lathe_ray_fan, radii->count);
    if (!s->rings || !s->fans) return LATHE_ERR_MEMORY;
    for (uint32_t t = 0; t < radii->count; t++) {
        s->fans[t].turn = UINT32_MAX;
        s->map[t] = lathe__tube_shown(&radii->tubes[t], lathe__passes_at(radii, &radii->tubes[t], level));
        s->stride[t] = stride_of(&s->map[t], stride);
        s->rays[t] = s->map[t].rays / s->stride[t];
        s->most += s->rays[t];
        if (s->rays[t] > s->counts->rays) s->counts->rays = s->rays[t];
    }
    s->rings++;                /* slice -1 has none */
    for (uint32_t i = 0; i < s->count + 2; i++)
        for (uint32_t t = 0; t < radii->count; t++) {
            lathe_tube_ring *r = &s->rings[(int32_t)i - 1][t];
            int32_t row = i && i <= s->count ? s->slices[i - 1] - radii->tubes[t].first : -1;
            *r = (lathe_tube_ring){.base = LATHE_NO_RING};
            if (row < 0 || row >= s->map[t].slices) continue;
            measure_ring(r, s, t, row);
            r->base = (uint32_t)points;
            points += s->rays[t];
        }
    if (points > UINT32_MAX / 16) return LATHE_ERR_LIMIT;
    s->counts->contour_vertices += points;
    lathe_status status = lathe__builder_reserve(&s->builder, points + points / 8 + 1024, points * 2 + points / 4 + 2048);
    if (status) return status;
    s->builder.mesh.vertex_count = (uint32_t)points;
    for (uint32_t i = 0; i < s->count; i++)
        for (uint32_t t = 0; t < radii->count; t++)
            if (s->rings[i][t].base != LATHE_NO_RING) place_ring(s, i, t);
    return LATHE_OK;
}

/* ---- slabs ---- */

static lathe_status find_groups(lathe_tube_stack *s) {
    s->group = lathe__arena_alloc(s->keep, (size_t)s->count + 2, sizeof *s->group);
    if (!s->group) return LATHE_ERR_MEMORY;
    memset(s->group, 0, ((size_t)s->count + 2) * sizeof *s->group);
    return LATHE_OK;
}

/* joints: see lathe__radii_joints. */
static lathe_status stack_tubes(lathe_mesh *out, lathe_arena arena[2], lathe_radii *radii, uint32_t level, const int32_t *slices, uint32_t count,
                                uint32_t stride, bool joints, lathe_surface_counts *counts) {
    lathe_tube_stack s = {.keep = &arena[0], .scratch = &arena[1], .radii = radii, .slices = slices, .count = count, .counts = counts};
    bool groups = !LATHE_TUBES_ONLY && (joints || !radii->plain);
    lathe_status status = groups ? find_groups(&s) : LATHE_OK;
    if (!status) status = open_stack(&s, stride, radii, level);
    for (uint32_t i = 0; groups && !status && i <= count; i++) lathe__group_slab(&s, i);
    for (uint32_t i = 0; !status && i <= count; i++)
        status = LATHE_TUBES_ONLY || radii->plain ? lathe__add_plain_slab(&s, i) : lathe__add_group_slab(&s, i);
    if (status) lathe_mesh_free(&s.builder.mesh);
    else *out = s.builder.mesh;
    return status;
}

bool lathe__radii_plain(const lathe_radii *radii) { return radii->simple || radii->plain || is_one_tube(radii); }

lathe_status lathe__radii_joints(lathe_mesh *out, lathe_arena arena[2], lathe_radii *radii, uint32_t level) {
    lathe_surface_counts counts = {0};
    int32_t *slices;
    uint32_t count, stride;
    lathe_status status = lathe__radii_slices(&slices, &count, &stride, &arena[0], radii, level);
    if (!status) status = stack_tubes(out, arena, radii, level, slices, count, stride, true, &counts);
    lathe__arena_reset(&arena[0]);
    lathe__arena_reset(&arena[1]);
    return status;
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
            status = stack_tubes(out, arena, radii, level, slices, count, stride, false, counts);
        }
    }
    lathe__arena_reset(&arena[0]);
    lathe__arena_reset(&arena[1]);
    return status;
}
