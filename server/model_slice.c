#include "model_slice.h"
#include "outline.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

/* ---- decoding ---- */

typedef struct feeding {
    lathe_decoder *decoder;
    lathe_status status;
} feeding;

static int feed(void *context, const void *bytes, size_t size) {
    feeding *f = context;
    f->status = lathe_decoder_feed(f->decoder, bytes, size);
    return f->status != LATHE_OK;
}

/* A decoder that has taken the levels up to `level`, and decoded `packets` of them. */
static lathe_status run(lathe_decoder **out, const lathe_model *model, int64_t structure, uint32_t level,
                        uint32_t packets, lathe_error *err) {
    lathe_decoder *decoder = NULL;
    lathe_status status = lathe_decoder_open(&decoder);
    if (status) return lathe_fail(err, status, "out of memory");
    feeding f = {decoder, LATHE_OK};
    lathe_decoder_build_meshes(decoder, false);
    status = lathe_model_stream(model, structure, 0, level, feed, &f);
    if (f.status) status = f.status;
    lathe_step step;
    while (!status && packets--) status = lathe_decoder_step(decoder, &step);
    if (status == LATHE_OK || status == LATHE_MORE) {
        *out = decoder;
        return LATHE_OK;
    }
    const char *text = lathe_decoder_error(decoder);
    lathe_fail(err, status, "%s", *text ? text : lathe_status_name(status));
    lathe_decoder_close(&decoder);
    return status;
}

static size_t words_of(const lathe_voxels *v) {
    return v->bits ? (size_t)v->size[1] * (size_t)v->size[2] * (size_t)v->row_words : 0;
}

lathe_status lathe__slices_decode(uint8_t **bytes, size_t *size, const lathe_model *model, int64_t structure,
                                  lathe_error *err) {
    const lathe_model_info *info = lathe_model_describe(model);
    lathe_decoder *decoder;
    lathe_status status = run(&decoder, model, structure, info->level_count, UINT32_MAX, err);
    if (status) return status;
    lathe_voxels voxels;
    uint32_t count = lathe_decoder_structures(decoder);
    size_t words = 0, head = sizeof(size_t) * 2 + count * sizeof(lathe_slice_structure);
    for (uint32_t i = 0; i < count; i++)
        if (lathe_decoder_voxels(decoder, i, &voxels)) words += words_of(&voxels);
    head = (head + 7) / 8 * 8;
    uint8_t *block = words < SIZE_MAX / 16 ? calloc(1, head + words * sizeof(uint64_t)) : NULL;
    if (!block) {
        lathe_decoder_close(&decoder);
        return lathe_fail(err, LATHE_ERR_MEMORY, "out of memory");
    }
    size_t place[2] = {count, head}, at = 0;
    memcpy(block, place, sizeof place);
    lathe_slice_structure *s = (lathe_slice_structure *)(void *)(block + sizeof place);
    for (uint32_t i = 0; i < count && lathe_decoder_voxels(decoder, i, &voxels); i++) {
        size_t own = words_of(&voxels);
        s[i] = (lathe_slice_structure){.structure = structure < 0 ? i : (uint32_t)structure,
                                       .row_words = voxels.row_words,
                                       .fraction = voxels.fraction,
                                       .transform = *lathe_decoder_transform(decoder, i),
                                       .words = at};
        memcpy(s[i].size, voxels.size, sizeof s[i].size);
        memcpy(s[i].origin, voxels.origin, sizeof s[i].origin);
        if (own) memcpy(block + head + at * sizeof(uint64_t), voxels.bits, own * sizeof(uint64_t));
        else s[i].size[2] = 0;
        at += own;
    }
    lathe_decoder_close(&decoder);
    *bytes = block;
    *size = head + words * sizeof(uint64_t);
    return LATHE_OK;
}

lathe_slices lathe__slices_view(const uint8_t *bytes) {
    size_t place[2];
    memcpy(place, bytes, sizeof place);
    return (lathe_slices){place[0], (const lathe_slice_structure *)(const void *)(bytes + sizeof place),
                          (const uint64_t *)(const void *)(bytes + place[1])};
}

/* ---- the frame ---- */

static void measure_frame(lathe_slice_frame *f, const lathe_transform *transform, const int32_t origin[3]) {
    double length[2] = {0, 0}, dot = 0;
    for (int i = 0; i < 3; i++) {
        f->matrix[i][3] = transform->m[i][3];
        for (int k = 0; k < 3; k++) {
            f->matrix[i][k] = transform->m[i][k] * LATHE_LATTICE_ONE;
            f->matrix[i][3] -= f->matrix[i][k] * origin[k];
        }
        for (int k = 0; k < 2; k++) length[k] += f->matrix[i][k] * f->matrix[i][k];
        dot += f->matrix[i][0] * f->matrix[i][1];
    }
    /* The larger singular value of the two columns. */
    double half = (length[0] + length[1]) / 2, rest = (length[0] - length[1]) / 2;
    f->stretch = sqrt(half + sqrt(rest * rest + dot * dot)) / LATHE_LATTICE_ONE;
    for (int k = 0; k < 2; k++) f->spacing[k] = sqrt(length[k]);
    f->pixel_mm = f->spacing[0] < f->spacing[1] ? f->spacing[0] : f->spacing[1];
    double side[2], most = 0;
    for (int k = 0; k < 2; k++) {
        side[k] = (f->high[k] - f->low[k] + 1) * f->spacing[k];
        if (side[k] > most) most = side[k];
    }
    if (!(f->pixel_mm > most / LATHE_MAX_DIM)) f->pixel_mm = most / LATHE_MAX_DIM;
    f->width = (uint32_t)fmax(1, lround(side[0] / f->pixel_mm));
    f->height = (uint32_t)fmax(1, lround(side[1] / f->pixel_mm));
}

lathe_status lathe__slice_frame(lathe_slice_frame *out, const lathe_model *model, int64_t structure, lathe_error *err) {
    lathe_decoder *decoder;
    lathe_status status = run(&decoder, model, structure, 0, 1, err);
    if (status) return status;
    lathe_slice_frame f = {.low = {INT32_MAX, INT32_MAX, INT32_MAX}, .high = {INT32_MIN, INT32_MIN, INT32_MIN}};
    lathe_voxels v;
    for (uint32_t i = 0; lathe_decoder_voxels(decoder, i, &v); i++)
        for (int k = 0; k < 3; k++) {
            int32_t margin = k < 2, low = v.origin[k] + margin, high = v.origin[k] + v.size[k] - 1 - margin;
            if (low < f.low[k]) f.low[k] = low;
            if (high > f.high[k]) f.high[k] = high;
        }
    if (f.low[2] > f.high[2] || f.low[0] > f.high[0] || f.low[1] > f.high[1] || !lathe_decoder_voxels(decoder, 0, &v))
        status = lathe_fail(err, LATHE_ERR_FORMAT, "the model has no slice");
    else measure_frame(&f, lathe_decoder_transform(decoder, 0), v.origin);
    lathe_decoder_close(&decoder);
    if (!status) *out = f;
    return status;
}

/* Permuted voxel coordinates of a place in the picture: voxel i covers i - 1/2 .. i + 1/2. */
static void place_of(double place[2], const lathe_slice_frame *f, double x, double y) {
    place[0] = f->low[0] - 0.5 + x * (f->high[0] - f->low[0] + 1) / f->width;
    place[1] = f->high[1] + 0.5 - y * (f->high[1] - f->low[1] + 1) / f->height;
}

void lathe__slice_place(double world[3], const lathe_slice_frame *f, int32_t slice, double x, double y) {
    double p[2];
    place_of(p, f, x, y);
    for (int i = 0; i < 3; i++)
        world[i] = f->matrix[i][0] * p[0] + f->matrix[i][1] * p[1] + f->matrix[i][2] * slice + f->matrix[i][3];
}

/* ---- one slice ---- */

static const uint64_t *slice_words(const lathe_slices *slices, const lathe_slice_structure *s, int32_t slice) {
    int32_t w = slice - s->origin[2];
    if (w < 0 || w >= s->size[2]) return NULL;
    return slices->words + s->words + (size_t)w * (size_t)s->size[1] * (size_t)s->row_words;
}

static void draw_structure(uint8_t *rgba, const lathe_slice_frame *f, const lathe_slice_structure *s,
                           const uint64_t *words, const uint8_t rgb[3]) {
    for (uint32_t y = 0; y < f->height; y++) {
        double p[2];
        place_of(p, f, 0.5, y + 0.5);
        int32_t v = (int32_t)lround(p[1]) - s->origin[1];
        if (v < 0 || v >= s->size[1]) continue;
        for (uint32_t x = 0; x < f->width; x++) {
            place_of(p, f, x + 0.5, y + 0.5);
            int32_t u = (int32_t)lround(p[0]) - s->origin[0];
            if (u < 0 || u >= s->size[0] ||
                !(words[(size_t)v * (size_t)s->row_words + ((uint32_t)u >> 6)] >> (u & 63) & 1))
                continue;
            uint8_t *pixel = rgba + ((size_t)y * f->width + x) * 4;
            memcpy(pixel, rgb, 3);
            pixel[3] = 255;
        }
    }
}

void lathe__slice_draw(uint8_t *rgba, const lathe_slice_frame *frame, const lathe_slices *slices,
                       const lathe_model_info *info, int32_t slice) {
    for (size_t i = 0; i < slices->count; i++) {
        const lathe_slice_structure *s = &slices->structures[i];
        const uint64_t *words = slice_words(slices, s, slice);
        if (words) draw_structure(rgba, frame, s, words, info->structures[s->structure].rgb);
    }
}

lathe_status lathe__slice_outline(lathe_outline *out, lathe_arena *arena, const lathe_slices *slices, size_t index,
                                  int32_t slice) {
    const lathe_slice_structure *s = &slices->structures[index];
    *out = (lathe_outline){0};
    int32_t *border;
    lathe_slice_view view = {.pixels = slice_words(slices, s, slice), .below = slice_words(slices, s, slice - 1),
                             .above = slice_words(slices, s, slice + 1), .width = s->size[0], .height = s->size[1],
                             .row_words = s->row_words, .parity = (slice - s->origin[2]) & 1, .fraction = s->fraction};
    return view.pixels ? lathe__trace_outline(out, &border, arena, &view) : LATHE_OK;
}

void lathe__slice_point(double world[3], const lathe_slice_structure *s, int32_t slice, lathe_point p) {
    double w = (double)(slice - s->origin[2]) * LATHE_LATTICE_ONE;
    for (int i = 0; i < 3; i++)
        world[i] =
            s->transform.m[i][0] * p.x + s->transform.m[i][1] * p.y + s->transform.m[i][2] * w + s->transform.m[i][3];
}
