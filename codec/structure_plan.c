/* Which slices begin early, by the components' volume against the level's error, and which components wait. */
#include <stdlib.h>
#include <string.h>
#include "structure_encode.h"

double lathe__matters(const lathe_level_plan *plan, uint32_t level, double slice_ratio) {
    double stride = lathe__level_stride(plan, level);
    return 3.14159265358979323846 / 6 * stride * stride * stride * slice_ratio;
}

static void show_from(uint8_t *early, const lathe_level_plan *plan, int32_t w, uint32_t level) {
    uint32_t regular = lathe__regular_level(plan, w);
    if (regular > level + early[w]) early[w] = (uint8_t)(regular - level);
}

lathe_status lathe__begin_early(lathe_structure_state *state, double slice_ratio) {
    lathe_component *components;
    size_t count;
    uint8_t *early = calloc((size_t)state->plan.slices, 1);
    if (!early) return LATHE_ERR_MEMORY;
    state->plan.early = early;
    lathe_status status = lathe__mask_components(&components, &count, &state->mask);
    if (status) return status;
    for (size_t i = 0; i < count; i++) {
        uint32_t level = 0;
        while (level + 1 < state->plan.level_count &&
               (double)components[i].voxels < lathe__matters(&state->plan, level, slice_ratio)) level++;
        show_from(early, &state->plan, components[i].first_slice, level);
        show_from(early, &state->plan, components[i].last_slice, level);
    }
    free(components);
    return LATHE_OK;
}

/* ---- what waits ---- */

typedef struct star_probe {
    lathe_outline *outlines;
    int32_t *outline_of;       /* slice -> outline, or -1 */
} star_probe;

/* The middle of the run. */
static uint32_t within_stars(const void *context, int32_t first, int32_t last, int32_t v, int32_t w) {
    const star_probe *probe = context;
    if (probe->outline_of[w] < 0) return 0;
    int32_t u = first + (last - first) / 2;
    const lathe_outline *o = &probe->outlines[probe->outline_of[w]];
    lathe_point at = {u * LATHE_LATTICE_ONE, v * LATHE_LATTICE_ONE};
    bool odd = false;
    for (uint32_t l = 0; l < o->loop_count; l++)
        for (uint32_t i = 0, n = o->loops[l].count; i < n; i++) {
            lathe_point a = o->points[o->loops[l].first + i], b = o->points[o->loops[l].first + (i + 1 < n ? i + 1 : 0)];
            if ((a.y > at.y) != (b.y > at.y) && (a.y < b.y ? lathe__orient(a, b, at) : lathe__orient(b, a, at)) > 0) odd = !odd;
        }
    return odd;
}

static lathe_status make_probe(star_probe *probe, const lathe_structure_state *state, lathe_arena *arena) {
    int32_t *slices, step = lathe__radius_step(lathe__level_stride(&state->plan, 0));
    uint32_t count;
    lathe_status status = lathe__level_slices(&slices, &count, arena, &state->plan, 0);
    if (status) return status;
    probe->outlines = LATHE_NEW(arena, lathe_outline, count);
    probe->outline_of = LATHE_NEW(arena, int32_t, state->plan.slices);
    if (!probe->outlines || !probe->outline_of) return LATHE_ERR_MEMORY;
    memset(probe->outline_of, 0xff, (size_t)state->plan.slices * sizeof *probe->outline_of);
    for (uint32_t i = 0; i < count && !status; i++) {
        probe->outline_of[slices[i]] = (int32_t)i;
        status = lathe__star_outline(&probe->outlines[i], arena, &state->base[i], step, i);
    }
    return status;
}

/* next[w]: the first shown slice from w on. */
static void count_level(lathe_level_info *info, const lathe_structure_state *state, const lathe_component *components, size_t count,
                                uint32_t level, int32_t *next) {
    for (int32_t w = state->plan.slices, first = w; w-- > 0;) next[w] = first = lathe__slice_level(&state->plan, w) <= level ? w : first;
    info->components = info->components_waiting = 0;
    info->waiting_mm3 = 0;
    for (size_t i = 0; i < count; i++) {
        bool shown = level < lathe__first_exact(state) ? components[i].found : next[components[i].first_slice] <= components[i].last_slice;
        info->components += shown;
        info->components_waiting += !shown;
        if (!shown) info->waiting_mm3 += (double)components[i].voxels;
    }
}

lathe_status lathe__count_waiting(lathe_level_info *levels, const lathe_structure_state *state, lathe_arena *arena) {
    star_probe stars = {NULL, NULL};
    lathe_probe probe = {within_stars, &stars, 1};
    lathe_component *components = NULL;
    size_t count = 0;
    int32_t *next = LATHE_NEW(arena, int32_t, state->plan.slices);
    lathe_status status = !next ? LATHE_ERR_MEMORY : lathe__first_exact(state) ? make_probe(&stars, state, arena) : LATHE_OK;
    if (!status) status = lathe__find_components(&components, &count, &state->mask, lathe__first_exact(state) ? &probe : NULL);
    for (uint32_t level = 0; !status && level < state->plan.level_count; level++)
        count_level(&levels[level], state, components, count, level, next);
    free(components);
    lathe__arena_reset(arena);
    return status;
}

/* ---- the same of a pyramid ---- */

/* A bit for each level whose raster has a pixel of the run. */
static uint32_t on_rasters(const void *context, int32_t first, int32_t last, int32_t v, int32_t w) {
    const lathe_pyramid *pyramid = context;
    uint32_t found = 0;
    for (uint32_t level = 0; level < pyramid->level_count; level++) {
        int32_t stride[3];
        lathe__pyramid_strides(stride, pyramid, level, level ? lathe__pyramid_passes(pyramid, level) : 0);
        if (v % stride[1] || w % stride[2] || (first + stride[0] - 1) / stride[0] * stride[0] > last) continue;
        found |= 1u << level;
    }
    return found;
}

lathe_status lathe__pyramid_waiting(lathe_level_info *levels, const lathe_structure_state *state) {
    const lathe_pyramid *pyramid = state->pyramid;
    lathe_probe probe = {on_rasters, pyramid, (1u << pyramid->level_count) - 1};
    lathe_component *components;
    size_t count;
    lathe_status status = lathe__find_components(&components, &count, &state->mask, &probe);
    if (status) return status;
    for (uint32_t level = 0; level < pyramid->level_count; level++) {
        lathe_level_info *info = &levels[level];
        info->components = info->components_waiting = 0;
        info->waiting_mm3 = 0;
        for (size_t i = 0; i < count; i++) {
            bool shown = components[i].found >> level & 1;
            info->components += shown;
            info->components_waiting += !shown;
            if (!shown) info->waiting_mm3 += (double)components[i].voxels;
        }
    }
    free(components);
    return LATHE_OK;
}
