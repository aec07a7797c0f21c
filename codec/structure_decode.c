#include <stdlib.h>
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

static lathe_status decode_base(lathe_structure_state *state, lathe_reader *reader, const char **fault) {
    uint32_t kept = lathe__read_varint(reader), count;
    *fault = LATHE_FAULT("base shape: list of kept slices");
    if (reader->status || kept > (uint32_t)state->plan.slices || kept > lathe__reader_left(reader)) return LATHE_ERR_FORMAT;
    int32_t *list = calloc(kept + 1, sizeof *list);
    if (!list) return LATHE_ERR_MEMORY;
    state->plan.kept = list;
    state->plan.kept_count = kept;
    int64_t w = -1;
    for (uint32_t i = 0; i < kept; i++) {
        w += (int64_t)lathe__read_varint(reader) + 1;
        if (reader->status || w >= state->plan.slices) return LATHE_ERR_FORMAT;
        list[i] = (int32_t)w;
    }
    int32_t *slices;
    lathe_status status = lathe__level_slices(&slices, &count, &state->arena, &state->plan, 0);
    if (status) return status;
    state->base = LATHE_NEW(&state->arena, lathe_star_slice, count);
    if (!state->base) return LATHE_ERR_MEMORY;
    lathe_range_decoder d;
    lathe__decoder_start(&d, reader->at, lathe__reader_left(reader));
    *fault = LATHE_FAULT("base shape: stars");
    status = lathe__base_decode(state->base, count, &state->arena, &d, &state->mask);
    if (!status && !stars_fit(state, count)) status = LATHE_ERR_FORMAT;
    return status;
}

static lathe_status decode_slices(lathe_structure_state *state, lathe_arena *scratch, lathe_occupancy **trained, uint32_t level,
                                  const uint8_t *payload, size_t size, const char **fault) {
    if (level == 1) {
        lathe_mask frame = state->mask;
        lathe_status status = lathe__mask_new(&state->mask, frame.size, frame.origin);
        if (!status) status = lathe__state_start_occupancy(state, trained);
        if (status) return status;
        lathe__arena_free(&state->arena);
        state->base = NULL;
    }
    lathe_new_slice *list;
    uint32_t count;
    lathe_status status = lathe__new_slices(&list, &count, scratch, state, level);
    lathe_range_decoder d;
    lathe__decoder_start(&d, payload, size);
    for (uint32_t i = 0; !status && i < count; i++) {
        status = lathe__occupancy_decode(state->occupancy, &d, lathe__mask_slice(&state->mask, list[i].slice), &list[i].known);
        if (d.overrun > 8) {
            *fault = LATHE_FAULT("occupancy: the packet ends before its slices");
            status = LATHE_ERR_FORMAT;
        }
    }
    lathe__arena_reset(scratch);
    if (level + 1 == state->plan.level_count) lathe__occupancy_free(&state->occupancy);
    return status;
}

lathe_status lathe__structure_decode(lathe_structure_state *state, lathe_arena *scratch, lathe_occupancy **trained, uint32_t level,
                                     const uint8_t *payload, size_t size, const char **fault) {
    *fault = LATHE_FAULT("levels out of order");
    if (state->level + 1 != (int32_t)level || level >= state->plan.level_count) return LATHE_ERR_FORMAT;
    lathe_status status;
    if (level == 0) {
        lathe_reader reader = lathe__reader(payload, size);
        status = decode_base(state, &reader, fault);
    } else {
        *fault = LATHE_FAULT("occupancy");
        status = decode_slices(state, scratch, trained, level, payload, size, fault);
    }
    if (!status) state->level = (int32_t)level;
    return status;
}
