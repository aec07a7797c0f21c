#include "radius_trace.h"
#include <string.h>
#include "outline.h"
#include "structure_state.h"

/* The loops of one slice, each filled as pixels. */
typedef struct traced_slice {
    uint32_t count;
    uint32_t tube[LATHE_TUBES_MOST];
    lathe_outline outline;
    lathe_mask filled;         /* one slice for each loop */
} traced_slice;

static lathe_status trace_slice(traced_slice *out, lathe_arena *arena, const lathe_mask *mask, int32_t slice, int fraction) {
    lathe_slice_view view = {.pixels = lathe__mask_slice(mask, slice), .width = mask->size[0], .height = mask->size[1],
                             .row_words = mask->row_words, .fraction = fraction};
    int32_t *border;
    lathe_status status = lathe__trace_outline(&out->outline, &border, arena, &view);
    if (status) return status;
    out->count = out->outline.loop_count;
    if (out->count > LATHE_TUBES_MOST) return LATHE_ERR_EMPTY;
    memset(out->filled.bits, 0, out->count * lathe__mask_slice_words(mask) * sizeof *out->filled.bits);
    for (uint32_t i = 0; i < out->count; i++) {
        const lathe_loop *loop = &out->outline.loops[i];
        lathe__mark_polygon(&out->filled, (int32_t)i, out->outline.points + loop->first, loop->count);
        lathe__fill_slice(&out->filled, (int32_t)i);
    }
    return LATHE_OK;
}

static bool overlap(const traced_slice *a, uint32_t i, const traced_slice *b, uint32_t k) {
    const uint64_t *p = lathe__mask_slice(&a->filled, (int32_t)i), *q = lathe__mask_slice(&b->filled, (int32_t)k);
    if (a->outline.loops[i].hole != b->outline.loops[k].hole) return false;
    for (size_t w = 0; w < lathe__mask_slice_words(&a->filled); w++)
        if (p[w] & q[w]) return true;
    return false;
}

static lathe_status add_row(lathe_traced_tube *tube, lathe_arena *arena, const lathe_outline *outline, const lathe_loop *loop) {
    lathe_point *points = LATHE_NEW(arena, lathe_point, loop->count);
    if (!points) return LATHE_ERR_MEMORY;
    for (uint32_t i = 0; i < loop->count; i++) points[i] = outline->points[loop->first + (tube->hole ? loop->count - 1 - i : i)];
    tube->loops[tube->rows++] = (lathe_row_loop){points, loop->count};
    return LATHE_OK;
}

static lathe_status begin_tube(lathe_traced_tubes *out, lathe_arena *arena, int32_t first, int32_t slices, bool hole) {
    if (out->count == LATHE_TUBES_MOST) return LATHE_ERR_EMPTY;
    lathe_traced_tube *tube = &out->tubes[out->count++];
    *tube = (lathe_traced_tube){.first = first, .hole = hole, .loops = LATHE_NEW(arena, lathe_row_loop, slices - first)};
    return tube->loops ? LATHE_OK : LATHE_ERR_MEMORY;
}

static lathe_status join(lathe_traced_tubes *out, lathe_arena *arena, const lathe_mask *mask, int32_t slice, traced_slice *now, const traced_slice *before) {
    uint32_t upwards[LATHE_TUBES_MOST] = {0}, downwards[LATHE_TUBES_MOST] = {0}, from[LATHE_TUBES_MOST] = {0};
    for (uint32_t i = 0; i < before->count; i++)
        for (uint32_t k = 0; k < now->count; k++)
            if (overlap(before, i, now, k)) upwards[i]++, downwards[k]++, from[k] = i;
    for (uint32_t k = 0; k < now->count; k++) {
        const lathe_loop *loop = &now->outline.loops[k];
        now->tube[k] = before->tube[from[k]];
        if (downwards[k] != 1 || upwards[from[k]] != 1) {
            now->tube[k] = out->count;
            lathe_status status = begin_tube(out, arena, slice, mask->size[2], loop->hole);
            if (status) return status;
        }
        lathe_status status = add_row(&out->tubes[now->tube[k]], arena, &now->outline, loop);
        if (status) return status;
    }
    return LATHE_OK;
}

lathe_status lathe__radius_trace(lathe_traced_tubes *out, lathe_arena *arena, const lathe_mask *mask, int fraction) {
    traced_slice slices[2] = {{0}};
    lathe_arena scratch[2] = {{0}};
    int32_t size[3] = {mask->size[0], mask->size[1], LATHE_TUBES_MOST};
    out->count = 0;
    lathe_status status = lathe__mask_new(&slices[0].filled, size, mask->origin);
    if (!status) status = lathe__mask_new(&slices[1].filled, size, mask->origin);
    for (int32_t w = 0; !status && w < mask->size[2]; w++) {
        traced_slice *now = &slices[w & 1];
        lathe__arena_reset(&scratch[w & 1]);
        status = trace_slice(now, &scratch[w & 1], mask, w, fraction);
        if (!status) status = join(out, arena, mask, w, now, &slices[1 - (w & 1)]);
    }
    for (int i = 0; i < 2; i++) {
        lathe__mask_free(&slices[i].filled);
        lathe__arena_free(&scratch[i]);
    }
    return status;
}
