#include "pyramid.h"
#include "raster_surface.h"
#include <string.h>

/* ---- schedule ---- */

uint32_t lathe__pyramid_passes(const lathe_pyramid *pyramid, uint32_t level) {
    uint32_t n = 0;
    if (!level) return 1;
    while (n < LATHE_PYRAMID_MOST_PASSES && pyramid->passes[level] >> 2 * n) n++;
    return n;
}

lathe_status lathe__pyramid_read(lathe_pyramid *out, const lathe_header *header) {
    *out = (lathe_pyramid){.level_count = header->parameter_count - 1, .start = {1, 1, 1}};
    if (header->parameter_count < 2 || out->level_count > LATHE_MAX_LEVELS) return LATHE_ERR_FORMAT;
    for (uint32_t i = 0; i < header->structure_count; i++)
        if (header->structures[i].level_count != out->level_count) return LATHE_ERR_FORMAT;
    for (uint32_t level = 1; level < out->level_count; level++) {
        out->passes[level] = header->parameters[level + 1];
        uint32_t passes = lathe__pyramid_passes(out, level);
        if (!passes || out->passes[level] >> 30) return LATHE_ERR_FORMAT;
        for (uint32_t pass = 0; pass < passes; pass++) {
            int axis = lathe__pyramid_axis(out, level, pass);
            if (axis < 0 || (out->start[axis] *= 2) > LATHE_PYRAMID_MOST_STRIDE) return LATHE_ERR_FORMAT;
        }
    }
    return LATHE_OK;
}

void lathe__pyramid_strides(int32_t stride[3], const lathe_pyramid *pyramid, uint32_t level, uint32_t passes) {
    memcpy(stride, pyramid->start, sizeof pyramid->start);
    for (uint32_t l = 1; l <= level; l++)
        for (uint32_t pass = 0, n = l < level ? lathe__pyramid_passes(pyramid, l) : passes; pass < n; pass++)
            stride[lathe__pyramid_axis(pyramid, l, pass)] /= 2;
}

/* ---- rasters ---- */

void lathe__pyramid_size(int32_t out[3], const int32_t box[3], const int32_t stride[3]) {
    for (int k = 0; k < 2; k++) out[k] = (box[k] - 2 + stride[k]) / stride[k] + 1;
    out[2] = (box[2] - 1) / stride[2] + 1;
}

static uint64_t *row_of(const lathe_mask *mask, int32_t v, int32_t w) {
    return lathe__mask_slice(mask, w) + (size_t)v * (size_t)mask->row_words;
}

/* Every other bit of a word's lower half apart: 0b1011 becomes 0b1000101. */
static uint64_t spread_bits(uint64_t x) {
    x &= UINT64_C(0xffffffff);
    x = (x | x << 16) & UINT64_C(0x0000ffff0000ffff);
    x = (x | x << 8) & UINT64_C(0x00ff00ff00ff00ff);
    x = (x | x << 4) & UINT64_C(0x0f0f0f0f0f0f0f0f);
    x = (x | x << 2) & UINT64_C(0x3333333333333333);
    return (x | x << 1) & UINT64_C(0x5555555555555555);
}

lathe_status lathe__pyramid_spread(lathe_mask *out, const lathe_mask *coarse, const int32_t size[3], int axis) {
    lathe_status status = lathe__mask_new(out, size, coarse->origin);
    if (status) return status;
    for (int32_t w = 0; w < coarse->size[2]; w++)
        for (int32_t v = 0; v < coarse->size[1] && (axis != 1 || 2 * v < size[1]); v++) {
            const uint64_t *from = row_of(coarse, v, w);
            uint64_t *to = row_of(out, axis == 1 ? 2 * v : v, axis == 2 ? 2 * w : w);
            for (int32_t i = 0; i < out->row_words; i++) to[i] = axis ? from[i] : spread_bits(from[i / 2] >> (i & 1) * 32);
        }
    return LATHE_OK;
}

/* Bit i of word k and bit k of word i change places, for all below n, a power of two. Blocks of j x j do, half their size each time. */
static void transpose(uint64_t m[64], int n) {
    uint64_t mask = ~UINT64_C(0) >> (64 - n);
    for (int j = n / 2; j; j /= 2) {
        mask ^= mask << j;
        for (uint64_t *block = m; block < m + n; block += 2 * j)
            for (uint64_t *at = block; at < block + j; at++) {
                uint64_t t = (*at >> j ^ at[j]) & mask;
                *at ^= t << j;
                at[j] ^= t;
            }
    }
}

/* Columns of one slice as rows of planes, or back: blocks of up to 64 x 64 bits. */
static void turn_slice(const lathe_mask *raster, const lathe_mask *planes, int32_t w, bool back) {
    int32_t row_words = raster->row_words, plane_words = (int32_t)lathe__mask_slice_words(planes);
    for (int32_t bv = 0; bv < raster->size[1]; bv += 64)
        for (int32_t bu = 0; bu < raster->size[0]; bu += 64) {
            uint64_t m[64] = {0}, any = 0;
            uint64_t *row = row_of(raster, bv, w) + (bu >> 6), *column = row_of(planes, w + 1, bu) + (bv >> 6);
            int32_t nv = raster->size[1] - bv < 64 ? raster->size[1] - bv : 64, nu = raster->size[0] - bu < 64 ? raster->size[0] - bu : 64;
            const uint64_t *from = back ? column : row;
            uint64_t *to = back ? row : column;
            int32_t from_step = back ? plane_words : row_words, to_step = back ? row_words : plane_words;
            int32_t from_count = back ? nu : nv, to_count = back ? nv : nu, n = 64;
            for (int32_t k = 0; k < from_count; k++) any |= m[k] = from[(size_t)k * (size_t)from_step];
            if (!any) continue;   /* the target is empty, too */
            while (n > 1 && nu <= n / 2 && nv <= n / 2) n /= 2;
            transpose(m, n);
            for (int32_t k = 0; k < to_count; k++) to[(size_t)k * (size_t)to_step] = m[k];
        }
}

static void turn_rows(const lathe_mask *raster, const lathe_mask *planes, int32_t w, bool back) {
    for (int32_t v = 0; v < raster->size[1]; v++) {
        uint64_t *row = row_of(raster, v, w), *plane = row_of(planes, w + 1, v);
        memcpy(back ? row : plane, back ? plane : row, (size_t)raster->row_words * sizeof *row);
    }
}

static void turn(const lathe_mask *raster, const lathe_mask *planes, int axis, bool back) {
    for (int32_t w = 0; w < raster->size[2]; w++) {
        if (axis) turn_rows(raster, planes, w, back);
        else turn_slice(raster, planes, w, back);
    }
}

lathe_status lathe__pyramid_turn(lathe_mask *out, const lathe_mask *raster, int axis) {
    int32_t size[3] = {raster->size[axis ? 0 : 1], raster->size[2] + 2, raster->size[axis]};
    lathe_status status = lathe__mask_new(out, size, raster->origin);
    if (!status) turn(raster, out, axis, false);
    return status;
}

void lathe__pyramid_turn_back(const lathe_mask *raster, const lathe_mask *planes, int axis) { turn(raster, planes, axis, true); }

/* ---- planes ---- */

lathe_known lathe__pyramid_known(const lathe_mask *planes, int32_t c, int axis) {
    /* Contexts that tell axes or strides apart learn more slowly than they gain (docs/EXPERIMENTS.md). */
    lathe_known known = {.gap_below = 1, .gap_above = 1};
    if (c) known.below = lathe__mask_slice(planes, c - 1);
    if (axis >= 0 && c + 1 < planes->size[2]) known.above = lathe__mask_slice(planes, c + 1);
    return known;
}

lathe_plane_range lathe__pyramid_planes(const lathe_mask *planes, int axis) {
    int32_t count = planes->size[2];
    if (axis < 0) return (lathe_plane_range){0, 1, count};
    return (lathe_plane_range){1, 2, axis == 2 ? count : count - 1};   /* the last plane in u and v is margin */
}

/* ---- surface ---- */

static bool is_empty(const lathe_mask *mask) {
    const uint64_t *bits = mask->bits, *end = bits + lathe__mask_slice_words(mask) * (size_t)mask->size[2];
    while (bits < end && !*bits) bits++;
    return bits == end;
}

static lathe_status octahedron(lathe_mesh *out, const int32_t box[3]) {
    static const uint8_t faces[8][3] = {{0, 2, 4}, {2, 1, 4}, {1, 3, 4}, {3, 0, 4}, {2, 0, 5}, {1, 2, 5}, {3, 1, 5}, {0, 3, 5}};
    lathe_mesh_builder builder = {0};
    lathe_status status = lathe__builder_reserve(&builder, 6, 8);
    if (status) return status;
    lathe_mesh *mesh = &builder.mesh;
    for (; mesh->vertex_count < 6; mesh->vertex_count++) {
        int axis = (int)mesh->vertex_count / 2;
        for (int k = 0; k < 3; k++) mesh->lattice[mesh->vertex_count][k] = (box[k] - 1) * (LATHE_LATTICE_ONE / 2);
        int32_t half = (box[axis] - (axis < 2 ? 2 : 0)) * (LATHE_LATTICE_ONE / 2);
        mesh->lattice[mesh->vertex_count][axis] += mesh->vertex_count & 1 ? -half : half;
    }
    for (; mesh->triangle_count < 8; mesh->triangle_count++)
        for (int k = 0; k < 3; k++) mesh->triangles[mesh->triangle_count][k] = faces[mesh->triangle_count][k];
    *out = *mesh;
    return LATHE_OK;
}

static lathe_status overlaid(lathe_mesh *out, lathe_arena arena[2], const lathe_mask *raster, const lathe_surface_style *style,
                             lathe_surface_counts *counts) {
    lathe_arena list = {0};
    uint32_t count = (uint32_t)raster->size[2];
    int32_t *slices = LATHE_NEW(&list, int32_t, count);
    lathe_status status = slices ? LATHE_OK : LATHE_ERR_MEMORY;
    for (uint32_t i = 0; !status && i < count; i++) slices[i] = (int32_t)i;
    if (!status) status = lathe__build_styled(out, arena, raster, slices, count, style, counts);
    lathe__arena_free(&list);
    return status;
}

lathe_status lathe__pyramid_mesh(lathe_mesh *out, lathe_arena arena[2], const lathe_mask *raster, const int32_t stride[3],
                                 const int32_t box[3], const int fraction[2], const lathe_surface_style *overlay, lathe_surface_counts *counts) {
    if (is_empty(raster)) return octahedron(out, box);
    lathe_status status;
    if (!overlay || LATHE_RASTERS_ONLY) {
        status = lathe__raster_surface(out, &arena[0], raster, fraction);
        counts->rays = (uint32_t)(raster->size[0] + raster->size[1] - 4);
    } else {
        status = overlaid(out, arena, raster, overlay, counts);
    }
    for (uint32_t i = 0; !status && i < out->vertex_count; i++)
        for (int k = 0; k < 3; k++) out->lattice[i][k] *= stride[k];
    return status;
}
