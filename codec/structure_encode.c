#include "structure_encode.h"
#include <stdlib.h>
#include <string.h>

void lathe__baked_free(lathe_baked_structure *baked) {
    for (int i = 0; i < LATHE_MAX_LEVELS; i++) lathe__bytes_free(&baked->packets[i]);
}

static int by_number(const void *a, const void *b) {
    int32_t p = *(const int32_t *)a, q = *(const int32_t *)b;
    return (p > q) - (p < q);
}

/* First and last slices of components with at least 1/32 of the voxels, so that no level cuts a large part short. */
static lathe_status keep_slices(lathe_structure_state *state) {
    lathe_component *components;
    size_t count, used = 0;
    lathe_status status = lathe__mask_components(&components, &count, &state->mask);
    if (status) return status;
    int64_t voxels = 0;
    for (size_t i = 0; i < count; i++) voxels += components[i].voxels;
    int32_t *kept = calloc(2 * 32 + 1, sizeof *kept);
    if (!kept) {
        free(components);
        return LATHE_ERR_MEMORY;
    }
    for (size_t i = 0; i < count; i++) {
        if (components[i].voxels * 32 < voxels || used + 2 > 64) continue;
        kept[used++] = components[i].first_slice;
        kept[used++] = components[i].last_slice;
    }
    free(components);
    qsort(kept, used, sizeof *kept, by_number);
    uint32_t n = 0;
    for (size_t i = 0; i < used; i++)
        /* The first and the last slice of the structure are always shown. */
        if (kept[i] > 0 && kept[i] < state->plan.slices - 1 && (!n || kept[n - 1] != kept[i])) kept[n++] = kept[i];
    state->plan.kept = kept;
    state->plan.kept_count = n;
    return LATHE_OK;
}

static lathe_status append_coded(lathe_bytes *out, lathe_range_encoder *e) {
    lathe__encoder_finish(e);
    if (!e->failed) lathe__emit(out, e->bytes, e->size);
    bool failed = e->failed || out->failed;
    lathe__encoder_free(e);
    return failed ? LATHE_ERR_MEMORY : LATHE_OK;
}

static lathe_status encode_base(lathe_bytes *out, lathe_structure_state *state, lathe_arena *scratch) {
    int32_t *slices, stride = lathe__level_stride(&state->plan, 0), at = -1;
    uint32_t count;
    lathe__emit_varint(out, state->plan.kept_count);
    for (uint32_t i = 0; i < state->plan.kept_count; i++) {
        lathe__emit_varint(out, (uint64_t)(state->plan.kept[i] - at - 1));
        at = state->plan.kept[i];
    }
    lathe_status status = lathe__level_slices(&slices, &count, &state->arena, &state->plan, 0);
    if (status) return status;
    state->base = LATHE_NEW(&state->arena, lathe_star_slice, count);
    if (!state->base) return LATHE_ERR_MEMORY;
    for (uint32_t i = 0; i < count; i++) {
        lathe_slice_view view = {.pixels = lathe__mask_slice(&state->mask, slices[i]), .width = state->mask.size[0],
                                 .height = state->mask.size[1], .row_words = state->mask.row_words, .parity = (int)(i & 1),
                                 .fraction = state->fraction};
        lathe_outline loops;
        int32_t *border;
        status = lathe__trace_outline(&loops, &border, scratch, &view);
        if (!status) status = lathe__base_fit(&state->base[i], &state->arena, &loops, i ? &state->base[i - 1] : NULL, stride, i);
        lathe__arena_reset(scratch);
        if (status) return status;
    }
    lathe_range_encoder e;
    lathe__encoder_start(&e);
    status = lathe__base_encode(&e, state->base, count, &state->mask);
    lathe_status appended = append_coded(out, &e);
    return status ? status : appended;
}

static lathe_status encode_slices(lathe_bytes *out, lathe_structure_state *state, lathe_arena *scratch, uint32_t level) {
    lathe_new_slice *list;
    uint32_t count;
    lathe_status status = lathe__new_slices(&list, &count, scratch, state, level);
    lathe_range_encoder e;
    lathe__encoder_start(&e);
    for (uint32_t i = 0; !status && i < count; i++)
        status = lathe__occupancy_encode(state->occupancy, &e, lathe__mask_slice(&state->mask, list[i].slice), &list[i].known);
    lathe__arena_reset(scratch);
    lathe_status appended = append_coded(out, &e);
    return status ? status : appended;
}

lathe_status lathe__structure_encode(lathe_baked_structure *out, lathe_structure_state *state, lathe_arena arena[2],
                                     lathe_occupancy **trained) {
    state->plan.slices = state->mask.size[2];
    state->plan.level_count = lathe__choose_levels(state->plan.slices);
    out->level_count = state->plan.level_count;
    lathe_status status = keep_slices(state);
    if (!status) status = encode_base(&out->packets[0], state, &arena[0]);
    if (!status) status = lathe__state_start_occupancy(state, trained);
    for (uint32_t level = 1; !status && level < out->level_count; level++)
        status = encode_slices(&out->packets[level], state, &arena[0], level);
    return status;
}
