/* The region of a structure as a mask. Voxels become bits in file order first (64 comparisons a word, one pass over the
 * values); cropping and the permutation of the axes then only move bits, an eighth of a 32nd of the data. */
#include "mask.h"
#include "volume_internal.h"
#include <float.h>
#include <limits.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#ifdef __SSE2__
#include <emmintrin.h>
#endif

enum { LABEL_LIMIT = 1 << 24, MAX_LABELS = 65535, PAGE = 1 << 12, PAGES = 2 * LABEL_LIMIT / PAGE };

/* ---- 64 comparisons ---------------------------------------------------------------------------------------------- */

/* How a voxel is compared: value >= wanted, or value == wanted. */
typedef struct predicate {
    bool equal;
    float wanted;
} predicate;

#ifdef __SSE2__
static inline uint64_t at_least64(const float *v, float wanted) {
    uint64_t word = 0;
    const __m128 w = _mm_set1_ps(wanted);
    for (int i = 0; i < 16; i++) word |= (uint64_t)_mm_movemask_ps(_mm_cmpge_ps(_mm_loadu_ps(v + 4 * i), w)) << (4 * i);
    return word;
}
static inline uint64_t equal64(const float *v, float wanted) {
    uint64_t word = 0;
    const __m128 w = _mm_set1_ps(wanted);
    for (int i = 0; i < 16; i++) word |= (uint64_t)_mm_movemask_ps(_mm_cmpeq_ps(_mm_loadu_ps(v + 4 * i), w)) << (4 * i);
    return word;
}
/* Bit i: v[i] differs from v[i - 1]. */
static inline uint64_t changes64(const float *v) {
    uint64_t word = 0;
    for (int i = 0; i < 16; i++)
        word |= (uint64_t)_mm_movemask_ps(_mm_cmpneq_ps(_mm_loadu_ps(v + 4 * i), _mm_loadu_ps(v + 4 * i - 1)))
                << (4 * i);
    return word;
}
#else
static inline uint64_t at_least64(const float *v, float wanted) {
    uint64_t word = 0;
    for (int i = 0; i < 64; i++) word |= (uint64_t)(v[i] >= wanted) << i;
    return word;
}
static inline uint64_t equal64(const float *v, float wanted) {
    uint64_t word = 0;
    for (int i = 0; i < 64; i++) word |= (uint64_t)(v[i] == wanted) << i;
    return word;
}
static inline uint64_t changes64(const float *v) {
    uint64_t word = 0;
    for (int i = 0; i < 64; i++) word |= (uint64_t)(v[i] != v[i - 1]) << i;
    return word;
}
#endif

static void compare_row(uint64_t *words, const float *v, int32_t count, predicate p) {
    int32_t i = 0;
    if (p.equal)
        for (; i + 64 <= count; i += 64) words[i / 64] = equal64(v + i, p.wanted);
    else
        for (; i + 64 <= count; i += 64) words[i / 64] = at_least64(v + i, p.wanted);
    if (i == count) return;
    uint64_t word = 0;
    for (int32_t k = i; k < count; k++) word |= (uint64_t)(p.equal ? v[k] == p.wanted : v[k] >= p.wanted) << (k - i);
    words[i / 64] = word;
}

/* ---- bits in file order ------------------------------------------------------------------------------------------ */

/* A box of voxels as bits, x fastest; low is its corner in the volume. */
typedef struct grid {
    int32_t size[3], low[3], row_words;
    uint64_t *bits;
} grid;

static inline uint64_t *grid_row(const grid *g, int32_t y, int32_t z) {
    return g->bits + ((size_t)z * (size_t)g->size[1] + (size_t)y) * (size_t)g->row_words;
}

static lathe_status fill_grid(grid *g, const lathe_volume *volume, const int32_t low[3], const int32_t high[3],
                              predicate p) {
    for (int k = 0; k < 3; k++) g->low[k] = low[k], g->size[k] = high[k] - low[k] + 1;
    g->row_words = (g->size[0] + 63) / 64;
    size_t words = (size_t)g->row_words * (size_t)g->size[1] * (size_t)g->size[2];
    if (!(g->bits = malloc(words * sizeof *g->bits))) return LATHE_ERR_MEMORY;
    size_t nx = (size_t)volume->dims[0], ny = (size_t)volume->dims[1];
    for (int32_t z = 0; z < g->size[2]; z++)
        for (int32_t y = 0; y < g->size[1]; y++) {
            const float *row = volume->values + ((size_t)(z + low[2]) * ny + (size_t)(y + low[1])) * nx + low[0];
            compare_row(grid_row(g, y, z), row, g->size[0], p);
        }
    return LATHE_OK;
}

static void widen(int32_t *low, int32_t *high, int32_t at) {
    if (at < *low) *low = at;
    if (at > *high) *high = at;
}

/* The smallest box of the set bits, relative to the grid; false if none is set. */
static bool find_box(const grid *g, int32_t low[3], int32_t high[3]) {
    uint64_t columns[(LATHE_MAX_DIM + 63) / 64] = {0};
    for (int k = 0; k < 3; k++) low[k] = INT32_MAX, high[k] = -1;
    for (int32_t z = 0; z < g->size[2]; z++)
        for (int32_t y = 0; y < g->size[1]; y++) {
            const uint64_t *row = grid_row(g, y, z);
            uint64_t any = 0;
            for (int32_t i = 0; i < g->row_words; i++) columns[i] |= row[i], any |= row[i];
            if (!any) continue;
            widen(&low[1], &high[1], y);
            widen(&low[2], &high[2], z);
        }
    for (int32_t i = 0; i < g->row_words; i++) {
        if (!columns[i]) continue;
        widen(&low[0], &high[0], i * 64 + __builtin_ctzll(columns[i]));
        widen(&low[0], &high[0], i * 64 + 63 - __builtin_clzll(columns[i]));
    }
    return high[2] >= 0;
}

/* 64 bits of a row from bit `from` on; bits beyond the row are 0. */
static inline uint64_t take64(const uint64_t *row, int32_t row_words, int32_t from) {
    int32_t i = from / 64, shift = from % 64;
    uint64_t word = i < row_words ? row[i] >> shift : 0;
    if (shift && i + 1 < row_words) word |= row[i + 1] << (64 - shift);
    return word;
}

/* Transposes 64 x 64 bits in six rounds of swaps (Warren, Hacker's Delight, 7-3, for bit 0 first). */
static void transpose64(uint64_t a[64]) {
    uint64_t mask = 0x00000000ffffffffu;
    for (int j = 32; j; j >>= 1, mask ^= mask << j)
        for (int k = 0; k < 64; k = (k + j + 1) & ~j) {
            uint64_t swap = ((a[k] >> j) ^ a[k + j]) & mask;
            a[k] ^= swap << j;
            a[k + j] ^= swap;
        }
}

/* Ors the low `count` bits of word into a row at bit `at` (they were 0). */
static inline void put_bits(uint64_t *row, int32_t at, uint64_t word, int32_t count) {
    if (count < 64) word &= ((uint64_t)1 << count) - 1;
    int32_t shift = at % 64;
    row[at / 64] |= word << shift;
    if (shift && word >> (64 - shift)) row[at / 64 + 1] |= word >> (64 - shift);
}

static inline uint64_t *mask_row(const lathe_mask *mask, int32_t v, int32_t w) {
    return lathe__mask_slice(mask, w) + (size_t)v * (size_t)mask->row_words;
}

/* Slices along z: rows stay rows. */
static void arrange_rows(lathe_mask *mask, const grid *g, const int32_t low[3], const int32_t count[3]) {
    for (int32_t z = 0; z < count[2]; z++)
        for (int32_t y = 0; y < count[1]; y++) {
            const uint64_t *from = grid_row(g, y + low[1], z + low[2]);
            uint64_t *to = mask_row(mask, y + 1, z);
            for (int32_t x = 0; x < count[0]; x += 64) {
                int32_t left = count[0] - x < 64 ? count[0] - x : 64;
                put_bits(to, x + 1, take64(from, g->row_words, low[0] + x), left);
            }
        }
}

/* Slices along x (u = y, v = z) or y (u = z, v = x): bits along x turn into bits along u, 64 x 64 at a time. */
static void arrange_turned(lathe_mask *mask, const grid *g, const int32_t low[3], const int32_t count[3],
                           lathe_axis axis) {
    int along = axis == LATHE_AXIS_X ? 1 : 2, across = 3 - along; /* file axis of u; the one that is neither x nor u */
    uint64_t block[64];
    for (int32_t c = 0; c < count[across]; c++)
        for (int32_t u = 0; u < count[along]; u += 64)
            for (int32_t x = 0; x < count[0]; x += 64) {
                int32_t rows = count[along] - u < 64 ? count[along] - u : 64,
                        bits = count[0] - x < 64 ? count[0] - x : 64;
                uint64_t any = 0;
                for (int32_t i = 0; i < rows; i++) {
                    int32_t y = low[1] + (along == 1 ? u + i : c), z = low[2] + (along == 2 ? u + i : c);
                    any |= block[i] = take64(grid_row(g, y, z), g->row_words, low[0] + x);
                }
                if (!any) continue;
                memset(block + rows, 0, (size_t)(64 - rows) * sizeof *block);
                transpose64(block);
                for (int32_t i = 0; i < bits; i++)
                    put_bits(axis == LATHE_AXIS_X ? mask_row(mask, c + 1, x + i) : mask_row(mask, x + i + 1, c), u + 1,
                             block[i], rows);
            }
}

static lathe_status arrange(lathe_mask *out, const grid *g, lathe_axis axis, const int32_t low[3],
                            const int32_t high[3]) {
    int32_t frame[3], count[3], size[3], origin[3];
    lathe__axis_frame(axis, frame);
    for (int k = 0; k < 3; k++) count[k] = high[k] - low[k] + 1;
    for (int k = 0; k < 3; k++) {
        int32_t margin = k < 2;
        size[k] = count[frame[k]] + 2 * margin;
        origin[k] = g->low[frame[k]] + low[frame[k]] - margin;
    }
    lathe_status status = lathe__mask_new(out, size, origin);
    if (status) return status;
    if (axis == LATHE_AXIS_Z)
        arrange_rows(out, g, low, count);
    else
        arrange_turned(out, g, low, count, axis);
    return LATHE_OK;
}

/* ---- structures -------------------------------------------------------------------------------------------------- */

static lathe_status build(lathe_mask *out, const lathe_volume *volume, lathe_axis axis, const int32_t low[3],
                          const int32_t high[3], predicate p) {
    grid g = {.bits = NULL};
    lathe_status status = fill_grid(&g, volume, low, high, p);
    int32_t tight_low[3], tight_high[3];
    if (!status && !find_box(&g, tight_low, tight_high)) status = LATHE_ERR_EMPTY;
    if (!status) status = arrange(out, &g, axis, tight_low, tight_high);
    free(g.bits);
    return status;
}

static lathe_status build_all(lathe_mask *out, const lathe_volume *volume, lathe_axis axis, predicate p) {
    const int32_t low[3] = {0, 0, 0}, high[3] = {volume->dims[0] - 1, volume->dims[1] - 1, volume->dims[2] - 1};
    return build(out, volume, axis, low, high, p);
}

static lathe_status check_axis(lathe_axis axis, lathe_error *err) {
    if (axis == LATHE_AXIS_X || axis == LATHE_AXIS_Y || axis == LATHE_AXIS_Z) return LATHE_OK;
    return lathe_fail(err, LATHE_ERR_RANGE, "axis %d is none of x, y, z", (int)axis);
}

/* The smallest float that is not below iso, so that comparing floats is comparing with iso. */
static float float_at_least(double iso) {
    if (iso <= -FLT_MAX) return -FLT_MAX;
    float f = (float)iso;
    return (double)f < iso ? nextafterf(f, INFINITY) : f;
}

lathe_status lathe__region_threshold(lathe_mask *out, const lathe_volume *volume, lathe_axis axis, double iso,
                                     lathe_error *err) {
    lathe_status status = check_axis(axis, err);
    if (status) return status;
    if (isnan(iso)) return lathe_fail(err, LATHE_ERR_RANGE, "the threshold is not a number");
    status = iso > volume->max
                 ? LATHE_ERR_EMPTY
                 : build_all(out, volume, axis, (predicate){.equal = false, .wanted = float_at_least(iso)});
    if (status == LATHE_ERR_EMPTY)
        return lathe_fail(err, status, "no voxel is >= %g: the values go from %g to %g", iso, (double)volume->min,
                          (double)volume->max);
    return status ? lathe_fail(err, status, "no memory for the region") : LATHE_OK;
}

static lathe_status check_label(const lathe_volume *volume, lathe_axis axis, int64_t label, lathe_error *err) {
    lathe_status status = check_axis(axis, err);
    if (status) return status;
    if (!volume->integer)
        return lathe_fail(err, LATHE_ERR_UNSUPPORTED,
                          "the volume has values that are not whole numbers below 2^24: it has no labels");
    if (label <= -LABEL_LIMIT || label >= LABEL_LIMIT || (float)label < volume->min || (float)label > volume->max)
        return lathe_fail(err, LATHE_ERR_EMPTY, "no voxel has label %lld: the values go from %g to %g",
                          (long long)label, (double)volume->min, (double)volume->max);
    return LATHE_OK;
}

static lathe_status finish_label(lathe_status status, int64_t label, lathe_error *err) {
    if (!status) return LATHE_OK;
    if (status == LATHE_ERR_EMPTY) return lathe_fail(err, status, "no voxel has label %lld", (long long)label);
    return lathe_fail(err, status, "no memory for label %lld", (long long)label);
}

lathe_status lathe__region_label(lathe_mask *out, const lathe_volume *volume, lathe_axis axis, int64_t label,
                                 lathe_error *err) {
    lathe_status status = check_label(volume, axis, label, err);
    if (status) return status;
    return finish_label(build_all(out, volume, axis, (predicate){.equal = true, .wanted = (float)label}), label, err);
}

lathe_status lathe__region_label_box(lathe_mask *out, const lathe_volume *volume, lathe_axis axis,
                                     const lathe_label_box *box, lathe_error *err) {
    lathe_status status = check_label(volume, axis, box->label, err);
    if (status) return status;
    for (int k = 0; k < 3; k++)
        if (box->low[k] < 0 || box->low[k] > box->high[k] || box->high[k] >= volume->dims[k])
            return lathe_fail(err, LATHE_ERR_RANGE, "the box of label %lld is not inside the volume",
                              (long long)box->label);
    predicate p = {.equal = true, .wanted = (float)box->label};
    return finish_label(build(out, volume, axis, box->low, box->high, p), box->label, err);
}

/* ---- all labels -------------------------------------------------------------------------------------------------- */

/* From a label to its place in a growing list: a table of two levels, so that no choice of labels makes it slow. */
typedef struct label_index {
    uint16_t *pages[PAGES]; /* place + 1, 0 if the label has none */
    lathe_label_box *boxes;
    size_t count, capacity;
} label_index;

static lathe_status add_label(label_index *index, int32_t label, uint16_t *slot) {
    if (index->count == MAX_LABELS) return LATHE_ERR_LIMIT;
    if (index->count == index->capacity) {
        size_t capacity = index->capacity ? index->capacity * 2 : 256;
        lathe_label_box *grown = realloc(index->boxes, capacity * sizeof *grown);
        if (!grown) return LATHE_ERR_MEMORY;
        index->boxes = grown;
        index->capacity = capacity;
    }
    index->boxes[index->count] =
        (lathe_label_box){.label = label, .low = {INT32_MAX, INT32_MAX, INT32_MAX}, .high = {-1, -1, -1}};
    *slot = (uint16_t)++index->count;
    return LATHE_OK;
}

static lathe_status find_label(lathe_label_box **box, label_index *index, int32_t label) {
    uint32_t key = (uint32_t)(label + LABEL_LIMIT);
    uint16_t **page = &index->pages[key / PAGE];
    if (!*page && !(*page = calloc(PAGE, sizeof **page))) return LATHE_ERR_MEMORY;
    uint16_t *slot = &(*page)[key % PAGE];
    lathe_status status = *slot ? LATHE_OK : add_label(index, label, slot);
    if (!status) *box = &index->boxes[*slot - 1];
    return status;
}

static lathe_status add_run(label_index *index, float value, int32_t from, int32_t to, int32_t y, int32_t z) {
    if (value == 0) return LATHE_OK;
    lathe_label_box *box = NULL;
    lathe_status status = find_label(&box, index, (int32_t)value);
    if (status) return status;
    box->voxels += to - from;
    widen(&box->low[0], &box->high[0], from);
    widen(&box->low[0], &box->high[0], to - 1);
    widen(&box->low[1], &box->high[1], y);
    widen(&box->low[2], &box->high[2], z);
    return LATHE_OK;
}

/* Splits a row into runs of one value. */
static lathe_status index_row(label_index *index, const float *row, int32_t count, int32_t y, int32_t z) {
    int32_t start = 0, i = 1;
    lathe_status status = LATHE_OK;
    for (; i + 64 <= count; i += 64)
        for (uint64_t changes = changes64(row + i); changes && !status; changes &= changes - 1) {
            int32_t end = i + __builtin_ctzll(changes);
            status = add_run(index, row[start], start, end, y, z);
            start = end;
        }
    for (; i < count && !status; i++) {
        if (row[i] == row[i - 1]) continue;
        status = add_run(index, row[start], start, i, y, z);
        start = i;
    }
    return status ? status : add_run(index, row[start], start, count, y, z);
}

static lathe_status index_volume(label_index *index, const lathe_volume *volume) {
    const float *row = volume->values;
    for (int32_t z = 0; z < volume->dims[2]; z++)
        for (int32_t y = 0; y < volume->dims[1]; y++, row += volume->dims[0]) {
            lathe_status status = index_row(index, row, volume->dims[0], y, z);
            if (status) return status;
        }
    return index->count ? LATHE_OK : LATHE_ERR_EMPTY;
}

static int compare_boxes(const void *a, const void *b) {
    int64_t x = ((const lathe_label_box *)a)->label, y = ((const lathe_label_box *)b)->label;
    return (x > y) - (x < y);
}

lathe_status lathe__region_labels(lathe_label_box **out, size_t *count, const lathe_volume *volume, lathe_error *err) {
    if (!volume->integer)
        return lathe_fail(err, LATHE_ERR_UNSUPPORTED,
                          "the volume has values that are not whole numbers below 2^24: it has no labels");
    label_index *index = calloc(1, sizeof *index);
    if (!index) return lathe_fail(err, LATHE_ERR_MEMORY, "no memory for the labels");
    lathe_status status = index_volume(index, volume);
    if (!status) {
        qsort(index->boxes, index->count, sizeof *index->boxes, compare_boxes);
        *out = index->boxes;
        *count = index->count;
    } else {
        free(index->boxes);
    }
    for (size_t i = 0; i < PAGES; i++) free(index->pages[i]);
    free(index);
    if (status == LATHE_ERR_LIMIT) return lathe_fail(err, status, "the volume has more than %d labels", MAX_LABELS);
    if (status == LATHE_ERR_EMPTY) return lathe_fail(err, status, "every voxel is 0: the volume has no labels");
    return status ? lathe_fail(err, status, "no memory for the labels") : LATHE_OK;
}

lathe_axis lathe__axis_auto(const lathe_volume *volume) {
    lathe_axis best = LATHE_AXIS_Z;
    /* Spacings that come out of a matrix product differ in the last digits: those are equal. */
    for (int k = 1; k >= 0; k--)
        if (volume->spacing[k] > volume->spacing[best] * (1 + 1e-6)) best = (lathe_axis)k;
    return best;
}
