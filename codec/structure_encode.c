#include "structure_encode.h"
#include <stdlib.h>
#include <string.h>

void lathe__baked_free(lathe_baked_structure *baked) {
    for (int i = 0; i < LATHE_MAX_LEVELS; i++) {
        lathe__bytes_free(&baked->packets[i]);
        free(baked->finer[i]);
        baked->finer[i] = NULL;
    }
    lathe__cap_list_free(&baked->caps);
    lathe_mesh_free(&baked->last);
}

lathe_status lathe__encoded_mesh(lathe_mesh *out, lathe_arena arena[2], lathe_structure_state *state, lathe_baked_structure *baked,
                                 uint32_t level, lathe_surface_counts *counts, uint32_t *shown) {
    lathe_cap_list replay = baked->caps;
    replay.next = 0;
    state->level = (int32_t)level;
    state->finer = baked->finer[level];
    state->caps = replay.count ? &replay.caps : NULL;
    lathe_status status = LATHE_OK;
    if (state->pyramid) {
        lathe__pyramid_strides(state->stride, state->pyramid, level, level ? lathe__pyramid_passes(state->pyramid, level) : 0);
        if (level + 1 < state->pyramid->level_count) status = lathe__pyramid_sample(&state->raster, &state->mask, state->stride);
    }
    if (baked->last.vertex_count && level + 1 == baked->level_count) {
        *out = baked->last;
        *counts = baked->last_counts;
        *shown = (uint32_t)state->plan.slices;
        baked->last = (lathe_mesh){0};
    } else if (!status) {
        status = lathe__state_mesh(out, arena, state, counts, shown);
    }
    lathe__mask_free(&state->raster);
    state->finer = NULL;
    state->caps = NULL;
    return status;
}

lathe_status lathe__append_coded(lathe_bytes *out, lathe_range_encoder *e) {
    lathe__encoder_finish(e);
    if (!e->failed) lathe__emit(out, e->bytes, e->size);
    bool failed = e->failed || out->failed;
    lathe__encoder_free(e);
    return failed ? LATHE_ERR_MEMORY : LATHE_OK;
}

static void put_steps(lathe_range_encoder *e, const uint8_t *steps, uint32_t count, uint16_t start) {
    lathe_number_model m;
    lathe__number_start(&m, 1, start);
    for (uint32_t i = 0; i < count; i++) lathe__put_number(e, &m, steps[i]);
}

/* ---- level 0 ---- */

lathe_status lathe__fit_stars(lathe_structure_state *state, lathe_arena *scratch) {
    int32_t *slices, stride = lathe__level_stride(&state->plan, 0);
    uint32_t count;
    lathe__arena_free(&state->arena);
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
    return LATHE_OK;
}

/* Stars that have the topology of the last level, and something of each component, are the smaller base shape; else level 0 has
 * slices, too. */
static lathe_status choose_base(lathe_structure_state *state, lathe_arena arena[2]) {
    lathe_topology all;
    lathe_status status = lathe__mask_topology(&all, &state->mask, NULL);
    if (!status) status = lathe__fit_stars(state, &arena[0]);
    lathe_mesh mesh = {0};
    lathe_surface_counts counts;
    uint32_t shown;
    lathe_level_info levels[LATHE_MAX_LEVELS];
    bool keeps = false;
    state->level = 0;
    state->exact_base = false;
    if (!status) status = lathe__state_mesh(&mesh, arena, state, &counts, &shown);
    if (!status) status = lathe__mesh_keeps(&keeps, &mesh, &all);
    lathe_mesh_free(&mesh);
    if (!status) status = lathe__count_waiting(levels, state, &arena[0]);
    state->exact_base = !status && (!keeps || levels[0].components_waiting);
    return status;
}

static lathe_status choose_plan(lathe_structure_state *state, lathe_arena arena[2], const lathe_encode_source *source) {
    bool keep = state->flags & LATHE_FLAG_KEEP;
    lathe_status status = lathe__begin_early(state, keep ? 0 : source->slice_ratio);
    if (status || !keep) return status ? status : lathe__fit_stars(state, &arena[0]);
    status = choose_base(state, arena);   /* with few slices; then with as many as a level of slices needs */
    if (!status) status = lathe__keep_slices(state);
    return status || !state->exact_base ? status : choose_base(state, arena);
}

/* ---- the other levels ---- */

static lathe_status encode_slices(lathe_baked_structure *out, lathe_structure_state *state, lathe_arena arena[2], lathe_range_encoder *e,
                                  uint32_t level) {
    lathe_new_slice *list;
    int32_t *shown;
    uint32_t count;
    lathe_status status = LATHE_OK;
    if (state->flags & LATHE_FLAG_KEEP) {
        status = lathe__keep_outlines(&out->finer[level], state, arena, level);
        if (!status) status = lathe__level_slices(&shown, &count, &arena[0], &state->plan, level);
        if (!status) put_steps(e, out->finer[level], count, LATHE_NUMBER_START);
    }
    if (!status) status = lathe__occupancy_frame(state->occupancy, state->mask.size[0], state->mask.size[1]);
    if (!status) status = lathe__new_slices(&list, &count, &arena[0], state, level);
    for (uint32_t i = 0; !status && i < count; i++)
        status = lathe__occupancy_encode(state->occupancy, e, lathe__mask_slice(&state->mask, list[i].slice), &list[i].known);
    lathe__arena_reset(&arena[0]);
    return status;
}

static int32_t put_number(void *coder, lathe_number_model *model, int32_t number) {
    lathe__put_number(coder, model, number);
    return number;
}

static lathe_status encode_radii(lathe_range_encoder *e, lathe_structure_state *state, const lathe_radii *truth, uint32_t level) {
    if (!level) *state->radii = lathe__radii_frame(state);
    return lathe__radii_code(state->radii, truth, &state->arena, level, put_number, e);
}

static lathe_status encode_stars(lathe_range_encoder *e, lathe_structure_state *state, lathe_models *models) {
    lathe_number_model own[LATHE_BASE_MODELS], *base = models->base;
    int32_t *slices;
    uint32_t count;
    if (!(state->flags & LATHE_FLAG_SHARED)) lathe__base_models(base = own);
    lathe_status status = lathe__level_slices(&slices, &count, &state->arena, &state->plan, 0);
    return status ? status : lathe__base_encode(e, state->base, count, &state->mask, base);
}

lathe_status lathe__structure_encode_level(lathe_baked_structure *out, lathe_structure_state *state, lathe_arena arena[2],
                                           lathe_models *models, uint32_t level, const lathe_encode_source *source) {
    lathe_range_encoder e;
    lathe_status status = LATHE_OK;
    lathe__encoder_start(&e);
    if (level == 0 && !(state->flags & LATHE_FLAG_EXACT)) lathe__encode_bit(&e, LATHE_RADIUS_CHANCE, state->radii != NULL);
    if (state->radii) {
        status = encode_radii(&e, state, out->truth, level);
        lathe_status coded = lathe__append_coded(&out->packets[level], &e);
        return status ? status : coded;
    }
    if (level == 0) {
        put_steps(&e, state->plan.early, (uint32_t)state->plan.slices, LATHE_EARLY_START);
        if (state->flags & LATHE_FLAG_KEEP) lathe__encode_bit(&e, LATHE_NUMBER_START, state->exact_base);
    }
    if (level == lathe__first_exact(state)) {
        if (level) status = lathe__state_estimate(state, &arena[0]);
        lathe__arena_reset(&arena[0]);
        if (!status) status = lathe__state_start_occupancy(state, models);
    }
    if (!status) status = level < lathe__first_exact(state) ? encode_stars(&e, state, models) : encode_slices(out, state, arena, &e, level);
    if (level) lathe__mask_free(&state->estimate);
    if (!status && level + 1 == out->level_count && state->flags & LATHE_FLAG_CAPS) {
        status = lathe__choose_caps(out, state, arena, source);
        if (!status) lathe__encode_caps(&e, &out->caps);
    }
    lathe_status appended = lathe__append_coded(&out->packets[level], &e);
    if (level + 1 == out->level_count) lathe__state_drop_occupancy(state);
    return status ? status : appended;
}

lathe_status lathe__structure_plan(lathe_baked_structure *out, lathe_structure_state *state, lathe_arena arena[2],
                                   const lathe_encode_source *source) {
    state->plan.slices = state->mask.size[2];
    state->plan.level_count = lathe__choose_levels(state->plan.slices);
    out->level_count = state->plan.level_count;
    lathe_status status = choose_plan(state, arena, source);
    return status ? status : lathe__count_waiting(out->levels, state, &arena[0]);
}
