#include <stdlib.h>
#include <string.h>
#include "structure_state.h"

/* No ray reaches farther than the frame is wide and high together: what a packet may cost is bounded by its frame. */
static bool stars_fit(const lathe_structure_state *state, uint32_t count) {
    int64_t step = lathe__radius_step(lathe__level_stride(&state->plan, 0));
    int64_t farthest = (int64_t)(state->mask.size[0] + state->mask.size[1]) * LATHE_LATTICE_ONE + step;
    for (uint32_t i = 0; i < count; i++)
        for (uint32_t k = 0; k < state->base[i].count; k++)
            for (uint32_t ray = 0; ray < state->base[i].stars[k].rays; ray++)
                if (state->base[i].stars[k].radius[ray] * step > farthest) return false;
    return true;
}

/* A small number for each slice, at most `most`; NULL if memory is out. */
static uint8_t *read_steps(uint32_t count, lathe_range_decoder *d, uint16_t start, uint32_t most) {
    uint8_t *steps = malloc(count);
    lathe_number_model m;
    lathe__number_start(&m, 1, start);
    for (uint32_t i = 0; steps && i < count; i++) {
        uint32_t v = (uint32_t)lathe__get_number(d, &m);
        steps[i] = (uint8_t)(v > most ? most : v);
    }
    return steps;
}

static lathe_status decode_stars(lathe_structure_state *state, lathe_range_decoder *d, lathe_models *models) {
    lathe_number_model own[LATHE_BASE_MODELS], *base = models->base;
    if (!(state->flags & LATHE_FLAG_SHARED)) lathe__base_models(base = own);
    int32_t *slices;
    uint32_t count;
    lathe_status status = lathe__level_slices(&slices, &count, &state->arena, &state->plan, 0);
    if (status) return status;
    state->base = LATHE_NEW(&state->arena, lathe_star_slice, count);
    if (!state->base) return LATHE_ERR_MEMORY;
    status = lathe__base_decode(state->base, count, &state->arena, d, &state->mask, base);
    if (!status && !stars_fit(state, count)) status = LATHE_ERR_FORMAT;
    return status;
}

/* The shapes of the caps are read when the mesh is built: only then it is known which caps there are. */
lathe_status lathe__keep_caps(lathe_structure_state *state, const lathe_range_decoder *d) {
    size_t size = (size_t)(d->end - d->at);
    uint8_t *bytes = state->cap_bytes = LATHE_NEW(&state->arena, uint8_t, size + 1);
    if (!bytes) return LATHE_ERR_MEMORY;
    memcpy(bytes, d->at, size);
    state->cap_code = *d;
    state->cap_code.at = bytes;
    state->cap_code.end = bytes + size;
    return LATHE_OK;
}

static lathe_status decode_slices(lathe_structure_state *state, lathe_arena *scratch, lathe_models *models, uint32_t level,
                                  lathe_range_decoder *d) {
    if (level == lathe__first_exact(state)) {
        lathe_mask frame = state->mask;
        lathe_status status = level ? lathe__state_estimate(state, scratch) : LATHE_OK;
        if (!status) status = lathe__mask_new(&state->mask, frame.size, frame.origin);
        if (!status) status = lathe__state_start_occupancy(state, models);
        if (status) return status;
        lathe__arena_free(&state->arena);
        state->base = NULL;
    }
    lathe_new_slice *list;
    int32_t *shown;
    uint32_t count;
    lathe_status status = lathe__level_slices(&shown, &count, scratch, &state->plan, level);
    if (!status) status = lathe__occupancy_frame(state->occupancy, state->mask.size[0], state->mask.size[1]);
    if (!status && state->flags & LATHE_FLAG_KEEP) {
        free(state->finer);
        state->finer = read_steps(count, d, LATHE_NUMBER_START, state->plan.level_count - 1 - level);
        if (!state->finer) status = LATHE_ERR_MEMORY;
    }
    if (!status) status = lathe__new_slices(&list, &count, scratch, state, level);
    for (uint32_t i = 0; !status && i < count; i++) {
        status = lathe__occupancy_decode(state->occupancy, d, lathe__mask_slice(&state->mask, list[i].slice), &list[i].known);
        if (d->overrun > 8) status = LATHE_ERR_FORMAT;
    }
    lathe__mask_free(&state->estimate);
    if (level + 1 < state->plan.level_count) return status;
    lathe__state_drop_occupancy(state);
    return status || !(state->flags & LATHE_FLAG_CAPS) ? status : lathe__keep_caps(state, d);
}

static lathe_status decode_radii(lathe_structure_state *state, lathe_range_decoder *d, uint32_t level) {
    if (!level) {
        state->radii = LATHE_NEW(&state->arena, lathe_radii, 1);
        if (!state->radii) return LATHE_ERR_MEMORY;
        *state->radii = lathe__radii_frame(state);
    }
    lathe_status status = lathe__radii_code(state->radii, NULL, &state->arena, level, NULL, d);
    if (!status && (d->overrun > 8 || (LATHE_TUBES_ONLY && !lathe__radii_plain(state->radii)))) return LATHE_ERR_FORMAT;
    return status;
}

lathe_status lathe__structure_decode(lathe_structure_state *state, lathe_arena *scratch, lathe_models *models, uint32_t level,
                                     const uint8_t *payload, size_t size, const char **fault) {
    *fault = LATHE_FAULT("levels out of order");
    if (state->level + 1 != (int32_t)level || level >= state->plan.level_count) return LATHE_ERR_FORMAT;
    lathe_range_decoder d;
    lathe__decoder_start(&d, payload, size);
    lathe_status status;
    bool radii = level ? state->radii != NULL : !(state->flags & LATHE_FLAG_EXACT) && lathe__decode_bit(&d, LATHE_RADIUS_CHANCE);
    *fault = LATHE_OTHERS;
    if (LATHE_TUBES_ONLY && !radii) return LATHE_ERR_FORMAT;
    if (level == 0 && !radii) {
        state->plan.early = read_steps((uint32_t)state->plan.slices, &d, LATHE_EARLY_START, LATHE_MAX_LEVELS);
        if (!state->plan.early) return LATHE_ERR_MEMORY;
        state->exact_base = state->flags & LATHE_FLAG_KEEP && lathe__decode_bit(&d, LATHE_NUMBER_START);
    }
    if (radii) {
        *fault = LATHE_TUBES_ONLY ? LATHE_OTHERS : LATHE_FAULT("radius map");
        status = decode_radii(state, &d, level);
    } else if (level < lathe__first_exact(state)) {
        *fault = LATHE_FAULT("base shape: stars");
        status = decode_stars(state, &d, models);
    } else {
        *fault = LATHE_FAULT("slices: the packet is damaged or ends before them");
        status = decode_slices(state, scratch, models, level, &d);
        lathe__arena_reset(scratch);
    }
    if (!status) state->level = (int32_t)level;
    return status;
}
