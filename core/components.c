/* The 6-connected components of a region: runs of pixels, joined with a union-find while the slices go by. */
#include "mask.h"
#include <stdlib.h>

typedef struct run {
    int32_t first, last;
    uint32_t part;
} run; /* inclusive */

/* The runs of one slice: those of row v are runs[row[v] .. row[v + 1]). */
typedef struct slice_runs {
    run *runs;
    size_t count, capacity;
    size_t *row;
} slice_runs;

/* Provisional components. The smaller index wins a union, so that a root is the component's first pixel in scan order. */
typedef struct parts {
    uint32_t *parent;
    lathe_component *of; /* valid at roots */
    size_t count, capacity;
} parts;

static uint32_t find_root(uint32_t *parent, uint32_t i) {
    while (parent[i] != i) i = parent[i] = parent[parent[i]];
    return i;
}

static uint32_t unite(parts *p, uint32_t a, uint32_t b) {
    a = find_root(p->parent, a);
    b = find_root(p->parent, b);
    if (a == b) return a;
    if (b < a) {
        uint32_t t = a;
        a = b;
        b = t;
    }
    p->parent[b] = a;
    lathe_component *to = &p->of[a];
    const lathe_component *from = &p->of[b];
    if (from->first_slice < to->first_slice) to->first_slice = from->first_slice;
    if (from->last_slice > to->last_slice) to->last_slice = from->last_slice;
    to->voxels += from->voxels;
    to->found |= from->found;
    return a;
}

static lathe_status add_part(parts *p, uint32_t *part, int32_t w) {
    if (p->count == p->capacity) {
        size_t capacity = p->capacity ? p->capacity * 2 : 1024;
        if (capacity > UINT32_MAX) return LATHE_ERR_LIMIT;
        uint32_t *parent = realloc(p->parent, capacity * sizeof *parent);
        if (parent) p->parent = parent;
        lathe_component *of = realloc(p->of, capacity * sizeof *of);
        if (of) p->of = of;
        if (!parent || !of) return LATHE_ERR_MEMORY;
        p->capacity = capacity;
    }
    *part = (uint32_t)p->count;
    p->parent[p->count] = *part;
    p->of[p->count++] = (lathe_component){.first_slice = w, .last_slice = w};
    return LATHE_OK;
}

/* ---- runs -------------------------------------------------------------------------------------------------------- */

static bool add_run(slice_runs *s, int32_t first, int32_t last) {
    if (s->count == s->capacity) {
        size_t capacity = s->capacity * 2;
        run *grown = realloc(s->runs, capacity * sizeof *grown);
        if (!grown) return false;
        s->runs = grown;
        s->capacity = capacity;
    }
    s->runs[s->count++] = (run){first, last, UINT32_MAX};
    return true;
}

/* Walks the changes between 0 and 1 of a row: every second one ends a run. */
static bool row_runs(slice_runs *s, const uint64_t *row, int32_t words) {
    int32_t start = -1;
    uint64_t carry = 0; /* the bit before the word */
    for (int32_t i = 0; i < words; i++) {
        uint64_t changes = row[i] ^ (row[i] << 1 | carry);
        carry = row[i] >> 63;
        for (; changes; changes &= changes - 1) {
            int32_t at = i * 64 + __builtin_ctzll(changes);
            if (start < 0)
                start = at;
            else {
                if (!add_run(s, start, at - 1)) return false;
                start = -1;
            }
        }
    }
    return start < 0 || add_run(s, start, words * 64 - 1);
}

static bool read_runs(slice_runs *s, const lathe_mask *mask, int32_t w) {
    const uint64_t *slice = lathe__mask_slice(mask, w);
    s->count = 0;
    for (int32_t v = 0; v < mask->size[1]; v++) {
        s->row[v] = s->count;
        if (!row_runs(s, slice + (size_t)v * (size_t)mask->row_words, mask->row_words)) return false;
    }
    s->row[mask->size[1]] = s->count;
    return true;
}

/* ---- joining ----------------------------------------------------------------------------------------------------- */

/* Joins every run of a with the runs of b that it overlaps; both are ascending. */
static void join_rows(parts *p, run *a, const run *a_end, const run *b, const run *b_end) {
    while (a < a_end && b < b_end) {
        if (a->first <= b->last && b->first <= a->last)
            a->part = a->part == UINT32_MAX ? find_root(p->parent, b->part) : unite(p, a->part, b->part);
        if (a->last < b->last)
            a++;
        else
            b++;
    }
}

static lathe_status join_slice(parts *p, slice_runs *here, const slice_runs *before, int32_t rows, int32_t w, const lathe_probe *probe) {
    for (int32_t v = 0; v < rows; v++) {
        run *first = here->runs + here->row[v], *end = here->runs + here->row[v + 1];
        if (first == end) continue;
        if (v) join_rows(p, first, end, here->runs + here->row[v - 1], first);
        if (before) join_rows(p, first, end, before->runs + before->row[v], before->runs + before->row[v + 1]);
        for (run *r = first; r < end; r++) {
            lathe_status status = r->part == UINT32_MAX ? add_part(p, &r->part, w) : LATHE_OK;
            if (status) return status;
            lathe_component *c = &p->of[find_root(p->parent, r->part)];
            c->voxels += r->last - r->first + 1;
            c->last_slice = w; /* slices come in order */
            if (probe && c->found != probe->all) c->found |= probe->look(probe->context, r->first, r->last, v, w);
        }
    }
    return LATHE_OK;
}

static lathe_status join_all(parts *p, slice_runs slices[2], const lathe_mask *mask, const lathe_probe *probe) {
    for (int32_t w = 0; w < mask->size[2]; w++) {
        slice_runs *here = &slices[w & 1], *before = w ? &slices[(w + 1) & 1] : NULL;
        if (!read_runs(here, mask, w)) return LATHE_ERR_MEMORY;
        lathe_status status = join_slice(p, here, before, mask->size[1], w, probe);
        if (status) return status;
    }
    return LATHE_OK;
}

static lathe_status collect(lathe_component **out, size_t *count, const parts *p) {
    size_t roots = 0;
    for (size_t i = 0; i < p->count; i++) roots += p->parent[i] == i;
    lathe_component *list = malloc((roots ? roots : 1) * sizeof *list);
    if (!list) return LATHE_ERR_MEMORY;
    size_t n = 0;
    for (size_t i = 0; i < p->count; i++)
        if (p->parent[i] == i) list[n++] = p->of[i];
    *out = list;
    *count = n;
    return LATHE_OK;
}

lathe_status lathe__mask_components(lathe_component **out, size_t *count, const lathe_mask *mask) {
    return lathe__find_components(out, count, mask, NULL);
}

lathe_status lathe__find_components(lathe_component **out, size_t *count, const lathe_mask *mask, const lathe_probe *probe) {
    size_t rows = (size_t)mask->size[1] + 1;
    parts p = {0};
    slice_runs slices[2] = {{0}};
    bool ready = true;
    for (int i = 0; i < 2; i++) {
        slices[i].capacity = 1024;
        slices[i].runs = malloc(slices[i].capacity * sizeof *slices[i].runs);
        slices[i].row = calloc(rows, sizeof *slices[i].row);
        ready = ready && slices[i].runs && slices[i].row;
    }
    lathe_status status = ready ? join_all(&p, slices, mask, probe) : LATHE_ERR_MEMORY;
    if (!status) status = collect(out, count, &p);
    for (int i = 0; i < 2; i++) {
        free(slices[i].runs);
        free(slices[i].row);
    }
    free(p.parent);
    free(p.of);
    return status;
}
