/* The topology of a region from its voxels alone. This is the judge of the surfaces and of `components.c`: it shares no code
 * with either, floods instead of joining runs, and prefers being plain to being fast. */
#include "mask.h"
#include <stdlib.h>
#include <string.h>

/* The shown slices as neighbours, with an empty slice before the first and after the last; rows have an empty one on either
 * side too. Row v of slice w is bits[((w + 1) * (size[1] + 2) + v + 1) * words], -1 <= v <= size[1], -1 <= w <= size[2]. */
typedef struct field {
    int32_t size[3], words;
    uint64_t *bits;
} field;

static inline uint64_t *field_row(const field *f, int32_t v, int32_t w) {
    return f->bits + ((size_t)(w + 1) * (size_t)(f->size[1] + 2) + (size_t)(v + 1)) * (size_t)f->words;
}

static lathe_status field_new(field *f, const lathe_mask *mask, const bool *shown) {
    *f = (field){.size = {mask->size[0], mask->size[1], 0}, .words = mask->row_words};
    for (int32_t w = 0; w < mask->size[2]; w++) f->size[2] += !shown || shown[w];
    size_t rows = (size_t)(f->size[1] + 2) * (size_t)(f->size[2] + 2);
    f->bits = calloc(rows * (size_t)f->words, sizeof *f->bits);
    if (!f->bits) return LATHE_ERR_MEMORY;
    int32_t next = 0;
    for (int32_t w = 0; w < mask->size[2]; w++)
        if (!shown || shown[w])
            memcpy(field_row(f, 0, next++), lathe__mask_slice(mask, w),
                   lathe__mask_slice_words(mask) * sizeof(uint64_t));
    return LATHE_OK;
}

/* Every bit that was 0 becomes 1 and the reverse, the empty rows and slices around included. */
static void field_invert(field *f) {
    for (int32_t w = -1; w <= f->size[2]; w++)
        for (int32_t v = -1; v <= f->size[1]; v++) {
            uint64_t *row = field_row(f, v, w);
            for (int32_t i = 0; i < f->words; i++) row[i] = ~row[i];
            if (f->size[0] % 64) row[f->words - 1] &= ((uint64_t)1 << (f->size[0] % 64)) - 1;
        }
}

/* ---- Euler characteristic ---------------------------------------------------------------------------------------- */

/* Voxels are the vertices, pairs of neighbours the edges, full 2 x 2 blocks the squares, full 2 x 2 x 2 blocks the cubes.
 * a: a row; b: its neighbour in v; c: in w; d: in both. The next voxel in u of bit i is bit i + 1. */
static int64_t row_euler(const uint64_t *a, const uint64_t *b, const uint64_t *c, const uint64_t *d, int32_t words) {
    int64_t sum = 0;
    for (int32_t i = 0; i < words; i++) {
        bool more = i + 1 < words;
#define NEXT(row) ((row)[i] >> 1 | (more ? (row)[i + 1] << 63 : 0))
        uint64_t a1 = a[i] & NEXT(a), b1 = b[i] & NEXT(b), c1 = c[i] & NEXT(c), d1 = d[i] & NEXT(d);
#undef NEXT
        sum += __builtin_popcountll(a[i]);
        sum -= __builtin_popcountll(a1) + __builtin_popcountll(a[i] & b[i]) + __builtin_popcountll(a[i] & c[i]);
        sum += __builtin_popcountll(a1 & b1) + __builtin_popcountll(a1 & c1) +
               __builtin_popcountll(a[i] & b[i] & c[i] & d[i]);
        sum -= __builtin_popcountll(a1 & b1 & c1 & d1);
    }
    return sum;
}

static int64_t field_euler(const field *f) {
    int64_t euler = 0;
    for (int32_t w = 0; w < f->size[2]; w++)
        for (int32_t v = 0; v < f->size[1]; v++)
            euler += row_euler(field_row(f, v, w), field_row(f, v + 1, w), field_row(f, v, w + 1),
                               field_row(f, v + 1, w + 1), f->words);
    return euler;
}

/* ---- flooding ---------------------------------------------------------------------------------------------------- */

typedef struct seed {
    int32_t u, v, w;
} seed;
typedef struct seeds {
    seed *list;
    size_t count, capacity;
} seeds;

static lathe_status push(seeds *s, int32_t u, int32_t v, int32_t w) {
    if (s->count == s->capacity) {
        size_t capacity = s->capacity ? s->capacity * 2 : 1024;
        seed *grown = realloc(s->list, capacity * sizeof *grown);
        if (!grown) return LATHE_ERR_MEMORY;
        s->list = grown;
        s->capacity = capacity;
    }
    s->list[s->count++] = (seed){u, v, w};
    return LATHE_OK;
}

static inline bool bit_at(const uint64_t *row, int32_t u) { return row[u >> 6] >> (u & 63) & 1; }
static void clear_bits(uint64_t *row, int32_t from, int32_t to) {
    for (; from <= to; from = (from | 63) + 1) {
        uint64_t bits = ~(uint64_t)0 << (from & 63);
        if (to < (from | 63)) bits &= ~(uint64_t)0 >> (63 - (to & 63));
        row[from >> 6] &= ~bits;
    }
}

/* The first u of the run of 1 that u is in. */
static int32_t run_start(const uint64_t *row, int32_t u) {
    for (;;) {
        uint64_t gaps = ~row[u >> 6] << (63 - (u & 63));   /* up to u, which is the highest bit */
        if (gaps) return u - __builtin_clzll(gaps) + 1;
        u = (u & ~63) - 1;
        if (u < 0) return 0;
    }
}

/* The first u in from .. to whose bit is `wanted`, or to + 1. Whole words are skipped. */
static int32_t seek(const uint64_t *row, int32_t from, int32_t to, bool wanted) {
    while (from <= to) {
        uint64_t word = (wanted ? row[from >> 6] : ~row[from >> 6]) >> (from & 63);
        if (word) {
            int32_t at = from + __builtin_ctzll(word);
            return at <= to ? at : to + 1;
        }
        from = (from | 63) + 1;
    }
    return to + 1;
}

/* One seed for each run of 1 that meets from .. to. */
static lathe_status push_runs(seeds *s, const field *f, int32_t from, int32_t to, int32_t v, int32_t w) {
    if (v < -1 || w < -1 || v > f->size[1] || w > f->size[2]) return LATHE_OK;
    const uint64_t *row = field_row(f, v, w);
    for (int32_t u = seek(row, from, to, true); u <= to; u = seek(row, u, to, true)) {
        lathe_status status = push(s, u, v, w);
        if (status) return status;
        u = seek(row, u, to, false);
    }
    return LATHE_OK;
}

/* Clears the run through the seed and pushes its neighbours: by faces (6), or by faces, edges and corners (26). */
static lathe_status flood_run(seeds *s, const field *f, seed at, bool corners) {
    uint64_t *row = field_row(f, at.v, at.w);
    if (!bit_at(row, at.u)) return LATHE_OK; /* another seed was faster */
    int32_t from = run_start(row, at.u), to = seek(row, at.u, f->size[0] - 1, false) - 1;
    clear_bits(row, from, to);
    int32_t low = corners && from > 0 ? from - 1 : from, high = corners && to + 1 < f->size[0] ? to + 1 : to;
    for (int32_t dw = -1; dw <= 1; dw++)
        for (int32_t dv = -1; dv <= 1; dv++) {
            if ((!dv && !dw) || (!corners && dv && dw)) continue;
            lathe_status status = push_runs(s, f, low, high, at.v + dv, at.w + dw);
            if (status) return status;
        }
    return LATHE_OK;
}

static lathe_status flood(seeds *s, const field *f, seed from, bool corners) {
    s->count = 0;
    lathe_status status = push(s, from.u, from.v, from.w);
    while (!status && s->count) status = flood_run(s, f, s->list[--s->count], corners);
    return status;
}

/* Floods every component; the field is empty afterwards. */
static lathe_status count_parts(int64_t *parts, seeds *s, const field *f, bool corners) {
    *parts = 0;
    for (int32_t w = -1; w <= f->size[2]; w++)
        for (int32_t v = -1; v <= f->size[1]; v++) {
            const uint64_t *row = field_row(f, v, w);
            int32_t last = f->size[0] - 1;
            for (int32_t u = seek(row, 0, last, true); u <= last; u = seek(row, u, last, true)) {
                lathe_status status = flood(s, f, (seed){u, v, w}, corners);
                if (status) return status;
                ++*parts;
            }
        }
    return LATHE_OK;
}

lathe_status lathe__mask_topology(lathe_topology *out, const lathe_mask *mask, const bool *shown) {
    field f;
    lathe_status status = field_new(&f, mask, shown);
    if (status) return status;
    seeds s = {0};
    lathe_topology t = {.euler = field_euler(&f)};
    field background = {.bits = NULL};
    status = field_new(&background, mask, shown);
    if (!status) status = count_parts(&t.components, &s, &f, false);
    if (!status) {
        field_invert(&background);
        status = count_parts(&t.cavities, &s, &background, true);
        t.cavities--; /* the outside: all that touches the rim is one, through the empty rows and slices */
    }
    free(s.list);
    free(f.bits);
    free(background.bits);
    if (!status) *out = t;
    return status;
}
