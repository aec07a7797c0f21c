#include "structure_state.h"
#include <stdlib.h>

void lathe__state_free(lathe_structure_state *state) {
    lathe__mask_free(&state->mask);
    free((void *)(uintptr_t)state->plan.early);
    free(state->finer);
    lathe__arena_free(&state->arena);
    lathe__occupancy_free(&state->occupancy);
}

void lathe__number_start(lathe_number_model *models, int count, uint16_t zero) {
    lathe_bit_model *bit = models->bit, *end = models[count].bit;
    for (; bit < end; bit++) *bit = (lathe_bit_model){LATHE_NUMBER_START, 2};
    models->bit[0].p1 = zero;
}

/* Reads the shapes of caps while a mesh is built, each time from the first one. */
typedef struct cap_reader {
    lathe_caps caps;
    lathe_range_decoder code;
    lathe_number_model models[LATHE_CAP_MODELS];
} cap_reader;

static uint32_t read_shape(lathe_caps *caps, const lathe_mesh *mesh, uint32_t vertices, uint32_t side) {
    cap_reader *r = (cap_reader *)caps;
    (void)mesh, (void)side;
    return (7 - (uint32_t)lathe__get_number(&r->code, &r->models[lathe__cap_context(vertices)])) & 7;
}

lathe_status lathe__state_start_occupancy(lathe_structure_state *state, lathe_occupancy **trained) {
    lathe_status status = *trained ? LATHE_OK : lathe__occupancy_new(trained, 3, 3);
    return status ? status : lathe__occupancy_copy(&state->occupancy, *trained, state->mask.size[0], state->mask.size[1]);
}

static bool contains(const int32_t *list, uint32_t count, int32_t w) {
    uint32_t low = 0, high = count;
    while (low < high) {
        uint32_t middle = (low + high) / 2;
        if (list[middle] < w) low = middle + 1;
        else high = middle;
    }
    return low < count && list[low] == w;
}

/* A slice is known to a later one of the same level if it lies below: levels are coded upwards. */
lathe_status lathe__new_slices(lathe_new_slice **out, uint32_t *count, lathe_arena *arena, const lathe_structure_state *state,
                               uint32_t level) {
    int32_t *now, *before = NULL;
    uint32_t now_count, before_count = 0, n = 0;
    lathe_status status = lathe__level_slices(&now, &now_count, arena, &state->plan, level);
    if (!status && level > lathe__first_exact(state)) status = lathe__level_slices(&before, &before_count, arena, &state->plan, level - 1);
    if (status) return status;
    lathe_new_slice *list = LATHE_NEW(arena, lathe_new_slice, now_count);
    if (!list) return LATHE_ERR_MEMORY;
    for (uint32_t i = 0; i < now_count; i++) {
        if (contains(before, before_count, now[i])) continue;
        lathe_new_slice *s = &list[n++];
        *s = (lathe_new_slice){.slice = now[i]};
        if (i > 0) { s->known.below = lathe__mask_slice(&state->mask, now[i - 1]); s->known.gap_below = now[i] - now[i - 1]; }
        for (uint32_t k = i + 1; k < now_count; k++) {
            if (!contains(before, before_count, now[k])) continue;
            s->known.above = lathe__mask_slice(&state->mask, now[k]);
            s->known.gap_above = now[k] - now[i];
            break;
        }
    }
    *out = list;
    *count = n;
    return LATHE_OK;
}

static lathe_status base_mesh(lathe_mesh *out, lathe_arena arena[2], const lathe_structure_state *state, const int32_t *slices,
                              uint32_t count, lathe_surface_counts *counts) {
    int32_t step = lathe__radius_step(lathe__level_stride(&state->plan, 0));
    lathe_outline *outlines = LATHE_NEW(&arena[0], lathe_outline, count);
    if (!outlines) return LATHE_ERR_MEMORY;
    for (uint32_t i = 0; i < count; i++) {
        lathe_status status = lathe__star_outline(&outlines[i], &arena[0], &state->base[i], step, i);
        if (status) return status;
        for (uint32_t k = 0; k < state->base[i].count; k++)
            if (state->base[i].stars[k].rays > counts->rays) counts->rays = state->base[i].stars[k].rays;
        counts->contour_vertices += outlines[i].point_count;
    }
    return lathe__stack_outlines(out, &arena[1], outlines, slices, count, false, counts);
}

lathe_status lathe__state_mesh(lathe_mesh *out, lathe_arena arena[2], const lathe_structure_state *state,
                               lathe_surface_counts *counts, uint32_t *shown) {
    int32_t *slices;
    *counts = (lathe_surface_counts){0};
    if (state->level < 0) return LATHE_ERR_RANGE;
    lathe_arena list = {0};
    lathe_status status = lathe__level_slices(&slices, shown, &list, &state->plan, (uint32_t)state->level);
    if (!status) {
        cap_reader reader = {.caps = {read_shape}, .code = state->cap_code};
        lathe__number_start(reader.models, LATHE_CAP_MODELS, LATHE_NUMBER_START);
        bool last = (uint32_t)state->level + 1 == state->plan.level_count;
        lathe_surface_style style = {.fraction = state->fraction, .coarseness = state->plan.level_count - 1 - (uint32_t)state->level,
                                     .finer = state->finer, .caps = !last ? NULL : state->cap_bytes ? &reader.caps : state->caps};
        if (!state->level && !state->exact_base) status = base_mesh(out, arena, state, slices, *shown, counts);
        else status = lathe__build_styled(out, arena, &state->mask, slices, *shown, &style, counts);
    }
    lathe__arena_reset(&arena[0]);
    lathe__arena_reset(&arena[1]);
    lathe__arena_free(&list);
    return status;
}
