#include "structure_state.h"
#include <stdlib.h>

void lathe__state_free(lathe_structure_state *state) {
    lathe__mask_free(&state->mask);
    lathe__mask_free(&state->estimate);
    lathe__mask_free(&state->raster);
    free((void *)(uintptr_t)state->plan.early);
    free(state->finer);
    state->plan.early = NULL;
    state->finer = NULL;
    lathe__arena_free(&state->arena);
    lathe__state_drop_occupancy(state);
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

void lathe__models_start(lathe_models *models, const lathe_header *header) {
    bool shared = header->parameter_count > 1 && header->parameters[1] & LATHE_FLAG_SHARED;
    int64_t most = 0;
    models->widest[0] = models->widest[1] = 3;
    if (!LATHE_RASTERS_ONLY && !LATHE_TUBES_ONLY) lathe__base_models(models->base);
    for (uint32_t i = 0; shared && i < header->structure_count; i++) {
        const int32_t *size = header->structures[i].size;
        if ((int64_t)size[0] * size[1] <= most) continue;
        most = (int64_t)size[0] * size[1];
        models->widest[0] = size[0];
        models->widest[1] = size[1];
    }
}

lathe_status lathe__state_start_occupancy(lathe_structure_state *state, lathe_models *models) {
    lathe_status status = LATHE_OK;
    bool sure = LATHE_RASTERS_ONLY || (lathe__is_pyramid(state) && state->flags & LATHE_FLAG_SURE);
    if (!models->occupancy) status = lathe__occupancy_new(&models->occupancy, models->widest[0], models->widest[1], sure);
    if (status) return status;
    if (!(state->flags & LATHE_FLAG_SHARED))
        return lathe__occupancy_copy(&state->occupancy, models->occupancy, state->mask.size[0], state->mask.size[1]);
    state->occupancy = models->occupancy;
    return LATHE_OK;
}

void lathe__state_drop_occupancy(lathe_structure_state *state) {
    if (state->flags & LATHE_FLAG_SHARED) state->occupancy = NULL;
    else lathe__occupancy_free(&state->occupancy);
}

/* ---- estimates of level 1's slices ---- */

/* Marks where a row's pixels change from outside to inside or back. */
void lathe__mark_polygon(const lathe_mask *mask, int32_t slice, const lathe_point *p, uint32_t n) {
    for (uint32_t i = 0; i < n; i++) {
        lathe_point a = p[i], b = p[i + 1 < n ? i + 1 : 0];
        if (a.y > b.y) { lathe_point swap = a; a = b; b = swap; }
        int32_t v = a.y <= 0 ? 1 : (a.y + LATHE_LATTICE_ONE - 1) >> LATHE_LATTICE_BITS;
        for (; v < mask->size[1] - 1 && v * LATHE_LATTICE_ONE < b.y; v++) {
            int64_t x = a.x + (int64_t)(b.x - a.x) * (v * LATHE_LATTICE_ONE - a.y) / (b.y - a.y);
            uint64_t *row = lathe__mask_slice(mask, slice) + (size_t)v * (size_t)mask->row_words;
            int64_t u = (x + LATHE_LATTICE_ONE - 1) >> LATHE_LATTICE_BITS;
            if (u < 1) u = 1;
            if (u < mask->size[0]) row[u >> 6] ^= (uint64_t)1 << (u & 63);
        }
    }
}

/* Each pixel: the parity of the marks up to it. */
void lathe__fill_slice(const lathe_mask *mask, int32_t slice) {
    uint64_t *word = lathe__mask_slice(mask, slice), inside = 0;
    for (size_t i = 0; i < lathe__mask_slice_words(mask); i++) {
        if (i % (size_t)mask->row_words == 0) inside = 0;
        uint64_t x = word[i];
        for (int k = 1; k < 64; k *= 2) x ^= x << k;
        word[i] = x ^ inside;
        inside = word[i] >> 63 ? ~(uint64_t)0 : 0;
    }
}

lathe_status lathe__state_estimate(lathe_structure_state *state, lathe_arena *scratch) {
    int32_t *slices, step = lathe__radius_step(lathe__level_stride(&state->plan, 0));
    uint32_t count;
    lathe_status status = lathe__level_slices(&slices, &count, scratch, &state->plan, 0);
    if (status) return status;
    int32_t size[3] = {state->mask.size[0], state->mask.size[1], (int32_t)count};
    status = lathe__mask_new(&state->estimate, size, state->mask.origin);
    for (uint32_t i = 0; !status && i < count; i++) {
        lathe_outline outline;
        status = lathe__star_outline(&outline, scratch, &state->base[i], step, i);
        for (uint32_t l = 0; !status && l < outline.loop_count; l++)
            lathe__mark_polygon(&state->estimate, (int32_t)i, outline.points + outline.loops[l].first, outline.loops[l].count);
        if (!status) lathe__fill_slice(&state->estimate, (int32_t)i);
    }
    return status;
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
    int32_t *base = NULL;
    uint32_t base_count = 0;
    if (!status && state->estimate.bits) status = lathe__level_slices(&base, &base_count, arena, &state->plan, 0);
    if (!status && level > lathe__first_exact(state)) status = lathe__level_slices(&before, &before_count, arena, &state->plan, level - 1);
    if (status) return status;
    lathe_new_slice *list = LATHE_NEW(arena, lathe_new_slice, now_count);
    if (!list) return LATHE_ERR_MEMORY;
    for (uint32_t i = 0; i < now_count; i++) {
        if (contains(before, before_count, now[i])) continue;
        lathe_new_slice *s = &list[n++];
        *s = (lathe_new_slice){.slice = now[i]};
        if (i > 0) { s->known.below = lathe__mask_slice(&state->mask, now[i - 1]); s->known.gap_below = now[i] - now[i - 1]; }
        for (uint32_t k = 0; k < base_count; k++) {
            if (base[k] < now[i]) continue;
            s->known.above = lathe__mask_slice(&state->estimate, (int32_t)k);
            s->known.estimate = base[k] == now[i] ? 1 : 2;
            break;
        }
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

lathe_status lathe__state_slices(int32_t **out, uint32_t *count, lathe_arena *arena, const lathe_structure_state *state) {
    if (!state->pyramid) return lathe__level_slices(out, count, arena, &state->plan, (uint32_t)state->level);
    int32_t stride = state->stride[2];
    *count = (uint32_t)((state->mask.size[2] - 1) / stride) + 1;
    *out = LATHE_NEW(arena, int32_t, *count);
    for (uint32_t i = 0; *out && i < *count; i++) (*out)[i] = (int32_t)i * stride;
    return *out ? LATHE_OK : LATHE_ERR_MEMORY;
}

/* Vertices lie where the grey values cross on average; where strides are larger than a voxel, that is the middle. */
static lathe_status raster_mesh(lathe_mesh *out, lathe_arena arena[2], const lathe_structure_state *state, lathe_caps *caps,
                                lathe_surface_counts *counts, uint32_t *shown) {
    const lathe_mask *raster = state->raster.bits ? &state->raster : &state->mask;
    bool whole = raster == &state->mask;
    int fraction[2] = {LATHE_FRACTION_ONE / 2, LATHE_FRACTION_ONE / 2};
    if (whole) fraction[0] = state->fraction, fraction[1] = state->upright ? state->upright : state->fraction;
    lathe_surface_style overlay = {.fraction = fraction[0], .caps = whole ? caps : NULL};
    *shown = (uint32_t)raster->size[2];
    return lathe__pyramid_mesh(out, arena, raster, state->stride, state->mask.size, fraction, state->flags & LATHE_FLAG_CUBES ? NULL : &overlay, counts);
}

/* A level of whole slices, or of stars. */
static lathe_status slices_mesh(lathe_mesh *out, lathe_arena arena[2], const lathe_structure_state *state, lathe_caps *caps,
                                lathe_surface_counts *counts, uint32_t *shown) {
    lathe_arena list = {0};
    int32_t *slices;
    lathe_status status = lathe__state_slices(&slices, shown, &list, state);
    bool last = (uint32_t)state->level + 1 == state->plan.level_count;
    lathe_surface_style style = {.fraction = state->fraction, .coarseness = state->plan.level_count - 1 - (uint32_t)state->level,
                                 .finer = state->finer, .caps = last ? caps : NULL};
    if (!status && !state->level && !state->exact_base) status = base_mesh(out, arena, state, slices, *shown, counts);
    else if (!status) status = lathe__build_styled(out, arena, &state->mask, slices, *shown, &style, counts);
    lathe__arena_free(&list);
    return status;
}

lathe_status lathe__state_mesh(lathe_mesh *out, lathe_arena arena[2], const lathe_structure_state *state,
                               lathe_surface_counts *counts, uint32_t *shown) {
    *counts = (lathe_surface_counts){0};
    if (!lathe__state_known(state)) return LATHE_ERR_RANGE;
    if (lathe__is_radii(state)) return lathe__radii_mesh(out, arena, state->radii, (uint32_t)state->level, counts, shown);
    lathe_status status;
    if (LATHE_RASTERS_ONLY) {
        status = raster_mesh(out, arena, state, NULL, counts, shown);
    } else {
        cap_reader reader = {.caps = {read_shape, NULL}, .code = state->cap_code};
        lathe__number_start(reader.models, LATHE_CAP_MODELS, LATHE_NUMBER_START);
        lathe_caps *caps = state->cap_bytes ? &reader.caps : state->caps;
        status = state->pyramid ? raster_mesh(out, arena, state, caps, counts, shown) : slices_mesh(out, arena, state, caps, counts, shown);
    }
    lathe__arena_reset(&arena[0]);
    lathe__arena_reset(&arena[1]);
    return status;
}
