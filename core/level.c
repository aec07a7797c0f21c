#include "level.h"
#include <stdlib.h>
#include <string.h>

enum { TRIES = 100 };          /* to find room; few are ever used */

uint32_t lathe__choose_levels(int32_t slices) {
    uint32_t levels = 2;
    while (levels < LATHE_MAX_LEVELS && slices > (int32_t)1 << 2 * (levels - 1)) levels++;
    return levels;
}

uint32_t lathe__regular_level(const lathe_level_plan *plan, int32_t w) {
    uint32_t level = w && w < plan->slices - 1 ? plan->level_count - 1 : 0;
    for (; level && !(w & 1); w >>= 1) level--;
    return level;
}

uint32_t lathe__slice_level(const lathe_level_plan *plan, int32_t w) {
    uint32_t level = lathe__regular_level(plan, w), early = plan->early ? plan->early[w] : 0;
    return level > early ? level - early : 0;
}

lathe_status lathe__level_slices(int32_t **out, uint32_t *count, lathe_arena *arena, const lathe_level_plan *plan, uint32_t level) {
    int32_t *list = LATHE_NEW(arena, int32_t, plan->slices);
    if (!list) return LATHE_ERR_MEMORY;
    uint32_t n = 0;
    for (int32_t w = 0; w < plan->slices; w++)
        if (lathe__slice_level(plan, w) <= level) list[n++] = w;
    *out = list;
    *count = n;
    return LATHE_OK;
}

uint32_t lathe__choose_rays(int64_t reach, uint32_t coarseness) {
    uint32_t cap = 8;
    /* 2 pi reach in voxels, rounded up to a power of two. */
    while (cap < 65536 && (int64_t)cap * LATHE_LATTICE_ONE < reach * 44 / 7) cap *= 2;
    uint32_t rays = coarseness < 16 ? cap >> coarseness : 0;
    return rays < 8 ? 8 : rays;
}

lathe_status lathe__stack_outlines(lathe_mesh *out, lathe_arena *scratch, const lathe_outline *outlines, const int32_t *heights,
                                   uint32_t count, bool lattice, lathe_surface_counts *counts) {
    return lathe__stack_with_caps(out, scratch, outlines, heights, count, lattice, NULL, counts);
}

lathe_status lathe__stack_slab(lathe_mesh_builder *builder, lathe_arena *scratch, lathe_slab *slab, const uint32_t *vertex,
                               lathe_overlay_counts *counts) {
    const lathe_outline *upper = slab->outline[1];
    uint32_t below = slab->outline[0]->point_count;
    for (uint32_t tries = slab->lattice ? 0 : TRIES;; tries--) {
        slab->crowded = NULL;
        if (tries) {
            slab->crowded = LATHE_NEW(scratch, uint8_t, upper->point_count + 1);
            if (!slab->crowded) return LATHE_ERR_MEMORY;
            memset(slab->crowded, 0, upper->point_count);
        }
        lathe_status status = lathe__overlay_slab(builder, scratch, slab, counts);
        for (uint32_t i = 0; tries && i < upper->point_count; i++) {
            int32_t *v = builder->mesh.lattice[vertex ? vertex[below + i] : slab->base + below + i];
            lathe_point *p = &upper->points[i];
            if (status != LATHE_ERR_RANGE) v[0] = p->x, v[1] = p->y;
            else if (slab->crowded[i]) *p = lathe__jitter((lathe_point){v[0], v[1]}, tries);
        }
        lathe__arena_reset(scratch);
        if (status != LATHE_ERR_RANGE) return status;
    }
}

lathe_status lathe__stack_with_caps(lathe_mesh *out, lathe_arena *scratch, const lathe_outline *outlines, const int32_t *heights,
                                    uint32_t count, bool lattice, lathe_caps *caps, lathe_surface_counts *counts) {
    static const lathe_outline air = {0};
    lathe_mesh_builder builder = {0};
    size_t points = 0;
    for (uint32_t i = 0; i < count; i++) points += outlines[i].point_count;
    lathe_status status = lathe__builder_reserve(&builder, points + points / 4, points * 5 / 2);
    uint32_t base = 0;
    for (uint32_t i = 0; !status && i < count; i++)
        for (uint32_t j = 0; j < outlines[i].point_count; j++) {
            int32_t *v = builder.mesh.lattice[builder.mesh.vertex_count++];
            v[0] = outlines[i].points[j].x, v[1] = outlines[i].points[j].y, v[2] = heights[i] * LATHE_LATTICE_ONE;
        }
    for (uint32_t i = 0; !status && i <= count; i++) {
        uint32_t above = i ? base + outlines[i - 1].point_count : 0;
        lathe_slab slab = {.outline = {i ? &outlines[i - 1] : &air, i < count ? &outlines[i] : &air},
                           .height = {(i ? heights[i - 1] : heights[0] - 1) * LATHE_LATTICE_ONE,
                                      (i < count ? heights[i] : heights[count - 1] + 1) * LATHE_LATTICE_ONE},
                           .base = base, .cap = LATHE_LATTICE_ONE / 2, .caps = caps, .lattice = lattice};
        status = lathe__stack_slab(&builder, scratch, &slab, NULL, &counts->overlay);
        base = above;
    }
    if (status) {
        lathe_mesh_free(&builder.mesh);
        return status;
    }
    *out = builder.mesh;
    return LATHE_OK;
}

/* A whole loop has as many rays as meet every vertex: the cap. */
static uint32_t rays_of_whole_loop(const lathe_outline *outline, const lathe_loop *loop) {
    const lathe_point *p = outline->points + loop->first;
    lathe_point low = p[0], high = p[0];
    for (uint32_t i = 1; i < loop->count; i++) {
        if (p[i].x < low.x) low.x = p[i].x;
        if (p[i].x > high.x) high.x = p[i].x;
        if (p[i].y < low.y) low.y = p[i].y;
        if (p[i].y > high.y) high.y = p[i].y;
    }
    int64_t dx = (high.x - low.x) / 2, dy = (high.y - low.y) / 2;
    return lathe__choose_rays(dx > dy ? dx : dy, 0);
}

lathe_status lathe__build_surface(lathe_mesh *out, lathe_arena arena[2], const lathe_mask *mask, const int32_t *slices,
                                  uint32_t count, int fraction, uint32_t coarseness, lathe_surface_counts *counts) {
    lathe_surface_style style = {.fraction = fraction, .coarseness = coarseness};
    return lathe__build_styled(out, arena, mask, slices, count, &style, counts);
}

lathe_status lathe__level_outlines(lathe_outline **out, lathe_arena arena[2], const lathe_mask *mask, const int32_t *slices,
                                   uint32_t count, const lathe_surface_style *style, lathe_surface_counts *counts) {
    lathe_arena *keep = &arena[0], *scratch = &arena[1];
    lathe_outline *outlines = *out = LATHE_NEW(keep, lathe_outline, count);
    if (!outlines) return LATHE_ERR_MEMORY;
    for (uint32_t i = 0; i < count; i++) {
        lathe_slice_view view = {.pixels = lathe__mask_slice(mask, slices[i]),
                                 .below = i ? lathe__mask_slice(mask, slices[i - 1]) : NULL,
                                 .above = i + 1 < count ? lathe__mask_slice(mask, slices[i + 1]) : NULL,
                                 .width = mask->size[0], .height = mask->size[1], .row_words = mask->row_words,
                                 .parity = (int)(i & 1), .fraction = style->fraction};
        uint32_t coarseness = style->coarseness - (style->finer ? style->finer[i] : 0);
        lathe_status status;
        if (coarseness) {
            lathe_outline loops;
            status = lathe__trace_outline(&loops, NULL, scratch, &view);
            if (!status) status = lathe__refine_outline(&outlines[i], keep, &loops, coarseness, i);
            lathe__arena_reset(scratch);
        } else {
            status = lathe__trace_outline(&outlines[i], NULL, keep, &view);
        }
        if (status) return status;
        counts->contour_vertices += outlines[i].point_count;
        for (uint32_t l = 0; l < outlines[i].loop_count; l++) {
            lathe_loop *loop = &outlines[i].loops[l];
            if (!coarseness) loop->rays = rays_of_whole_loop(&outlines[i], loop);
            if (loop->rays > counts->rays) counts->rays = loop->rays;
        }
    }
    return LATHE_OK;
}

lathe_status lathe__build_styled(lathe_mesh *out, lathe_arena arena[2], const lathe_mask *mask, const int32_t *slices, uint32_t count,
                                 const lathe_surface_style *style, lathe_surface_counts *counts) {
    lathe_outline *outlines;
    lathe_status status = lathe__level_outlines(&outlines, arena, mask, slices, count, style, counts);
    if (!status) status = lathe__stack_with_caps(out, &arena[1], outlines, slices, count, !style->coarseness, style->caps, counts);
    lathe__arena_reset(&arena[0]);
    return status;
}
