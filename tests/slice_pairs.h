/* Random pairs of slices that are hard on a surface: branching, nesting, pixels that touch. For test_surface.c and soak.c.
 * Every pair follows from its number alone. */
#ifndef SLICE_PAIRS_H
#define SLICE_PAIRS_H
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "level.h"
#include "mesh.h"

enum { PAIR_NOISE, PAIR_BLOBS, PAIR_COMBS, PAIR_RINGS, PAIR_DIAGONAL, PAIR_NEARLY_EQUAL, PAIR_KINDS };
static const char *const pair_kind_name[PAIR_KINDS] = {"noise", "blobs", "combs", "rings in rings", "diagonal touching", "nearly equal"};

typedef struct pair_random { uint64_t state; } pair_random;
static inline uint32_t pair_next(pair_random *r, uint32_t below) {
    r->state = r->state * 6364136223846793005u + 1442695040888963407u;
    return (uint32_t)(((r->state >> 33) * below) >> 31);
}

typedef struct slice_pair {
    lathe_mask mask;
    int kind, size, slices, fraction;
    uint32_t coarseness;       /* of the coarse surface */
} slice_pair;

static inline void pair_set(lathe_mask *m, int u, int v, int w, bool on) {
    if (u < 1 || v < 1 || u > m->size[0] - 2 || v > m->size[1] - 2) return;
    uint64_t *word = &lathe__mask_slice(m, w)[(size_t)v * (size_t)m->row_words + (size_t)(u >> 6)], bit = (uint64_t)1 << (u & 63);
    *word = on ? *word | bit : *word & ~bit;
}
static inline bool pair_get(const lathe_mask *m, int u, int v, int w) {
    if (u < 1 || v < 1 || u > m->size[0] - 2 || v > m->size[1] - 2) return false;
    return lathe__slice_pixel(lathe__mask_slice(m, w), m->row_words, u, v);
}

static inline void pair_noise(lathe_mask *m, int w, int size, pair_random *r) {
    uint32_t density = 5 + pair_next(r, 90), turns = pair_next(r, 3);
    for (int v = 1; v <= size; v++)
        for (int u = 1; u <= size; u++) pair_set(m, u, v, w, pair_next(r, 100) < density);
    for (uint32_t k = 0; k < turns * (uint32_t)(size * size); k++) {   /* a few pixels join the majority around them */
        int u = 1 + (int)pair_next(r, (uint32_t)size), v = 1 + (int)pair_next(r, (uint32_t)size), sum = 0;
        for (int i = 0; i < 9; i++) sum += pair_get(m, u + i % 3 - 1, v + i / 3 - 1, w);
        pair_set(m, u, v, w, sum > 4);
    }
}

static inline void pair_disc(lathe_mask *m, int w, int size, int cu, int cv, int radius2, bool on) {
    for (int v = 1; v <= size; v++)
        for (int u = 1; u <= size; u++)
            if ((u - cu) * (u - cu) + (v - cv) * (v - cv) <= radius2) pair_set(m, u, v, w, on);
}

/* Discs put in and taken out. */
static inline void pair_blobs(lathe_mask *m, int w, int size, pair_random *r) {
    for (uint32_t k = 2 + pair_next(r, 6); k > 0; k--) {
        int radius = 1 + (int)pair_next(r, (uint32_t)size / 2);
        pair_disc(m, w, size, 1 + (int)pair_next(r, (uint32_t)size), 1 + (int)pair_next(r, (uint32_t)size), radius * radius - 1,
                  pair_next(r, 3) != 0);
    }
}

/* A back with teeth, along u or v. */
static inline void pair_comb(lathe_mask *m, int w, int size, pair_random *r) {
    int pitch = 2 + (int)pair_next(r, 4), width = 1 + (int)pair_next(r, (uint32_t)pitch - 1), shift = (int)pair_next(r, (uint32_t)pitch);
    int back = 1 + (int)pair_next(r, (uint32_t)size);
    bool turned = pair_next(r, 2);
    for (int a = 1; a <= size; a++) {
        int length = 1 + (int)pair_next(r, (uint32_t)size);
        for (int b = 1; b <= size; b++)
            if (a == back || ((a + shift) % pitch < width && b <= length)) pair_set(m, turned ? a : b, turned ? b : a, w, true);
    }
}

static inline void pair_rings(lathe_mask *m, int w, int size, pair_random *r) {
    int cu = size / 2 + (int)pair_next(r, 3), cv = size / 2 + (int)pair_next(r, 3), radius = 1 + size / 2;
    bool round = pair_next(r, 2), on = true;
    for (; radius > 0; radius -= 1 + (int)pair_next(r, 3), on = !on) {
        if (round) {
            pair_disc(m, w, size, cu, cv, radius * radius, on);
        } else {
            for (int v = cv - radius; v <= cv + radius; v++)
                for (int u = cu - radius; u <= cu + radius; u++) pair_set(m, u, v, w, on);
        }
    }
    for (uint32_t k = pair_next(r, 4); k > 0; k--)   /* broken here and there */
        pair_set(m, 1 + (int)pair_next(r, (uint32_t)size), 1 + (int)pair_next(r, (uint32_t)size), w, pair_next(r, 2));
}

static inline void pair_diagonal(lathe_mask *m, int w, int size, pair_random *r) {
    uint32_t flips = pair_next(r, 30), phase = pair_next(r, 2), block = 1 + pair_next(r, 3);
    for (int v = 1; v <= size; v++)
        for (int u = 1; u <= size; u++)
            pair_set(m, u, v, w, (((uint32_t)u / block + (uint32_t)v / block + phase) % 2 != 0) != (pair_next(r, 100) < flips));
}

/* The slice below with a few pixels changed, perhaps shifted by one. */
static inline void pair_repeat(lathe_mask *m, int w, int size, pair_random *r) {
    int du = (int)pair_next(r, 3) - 1, dv = (int)pair_next(r, 3) - 1;
    for (int v = 1; v <= size; v++)
        for (int u = 1; u <= size; u++) pair_set(m, u, v, w, pair_get(m, u + du, v + dv, w - 1));
    for (uint32_t k = pair_next(r, 6); k > 0; k--) {
        int u = 1 + (int)pair_next(r, (uint32_t)size), v = 1 + (int)pair_next(r, (uint32_t)size);
        pair_set(m, u, v, w, !pair_get(m, u, v, w));
    }
}

static inline void pair_fill(lathe_mask *m, int kind, int w, int size, pair_random *r) {
    switch (kind) {
    case PAIR_NOISE: pair_noise(m, w, size, r); break;
    case PAIR_BLOBS: pair_blobs(m, w, size, r); break;
    case PAIR_COMBS: pair_comb(m, w, size, r); break;
    case PAIR_RINGS: pair_rings(m, w, size, r); break;
    case PAIR_DIAGONAL: pair_diagonal(m, w, size, r); break;
    default:
        if (w) pair_repeat(m, w, size, r);
        else pair_fill(m, (int)pair_next(r, PAIR_DIAGONAL + 1), w, size, r);
    }
}

/* Two slices of one kind, or now and then of two; never empty. */
static inline slice_pair pair_draw(uint64_t number, uint64_t seed) {
    pair_random r = {number * 0x9E3779B97F4A7C15u ^ seed * 0xBF58476D1CE4E5B9u};
    for (int i = 0; i < 4; i++) pair_next(&r, 2);
    slice_pair p = {.kind = (int)(number % PAIR_KINDS), .size = 2 + (int)pair_next(&r, 15)};
    int32_t dims[3] = {p.size + 2, p.size + 2, 2}, origin[3] = {0, 0, 0};
    if (pair_next(&r, 100) == 0) dims[0] = dims[1] = 2 + (p.size = 16 + (int)pair_next(&r, 48));
    if (lathe__mask_new(&p.mask, dims, origin)) abort();
    bool mixed = pair_next(&r, 4) == 0;
    for (int w = 0; w < 2; w++) {
        pair_fill(&p.mask, mixed ? (int)pair_next(&r, PAIR_KINDS) : p.kind, w, p.size, &r);
        pair_set(&p.mask, 1 + (int)pair_next(&r, (uint32_t)p.size), 1 + (int)pair_next(&r, (uint32_t)p.size), w, true);
    }
    p.fraction = pair_next(&r, 2) ? 32 : 1 + (int)pair_next(&r, 63);
    p.coarseness = 1 + pair_next(&r, 3);
    return p;
}

static inline bool pair_closed(const lathe_mesh_report *r) {
    return !r->boundary_edges && !r->nonmanifold_edges && !r->misoriented_edges && !r->nonmanifold_vertices && !r->degenerate_triangles &&
           !r->duplicate_positions && !r->unused_vertices && !r->bad_indices;
}

/* Builds the surface of a pair, exact or coarse, and says what is wrong with it: "" if nothing is. */
static inline const char *pair_fault(const slice_pair *p, lathe_arena arena[2], bool exact) {
    static const int32_t slices[2] = {0, 1};
    lathe_mesh mesh = {0};
    lathe_surface_counts counts = {0};
    lathe_mesh_report r;
    lathe_topology t;
    if (lathe__build_surface(&mesh, arena, &p->mask, slices, 2, p->fraction, exact ? 0 : p->coarseness, &counts)) return "is not built";
    lathe_status status = lathe__mesh_check(&r, &mesh, true);
    lathe_mesh_free(&mesh);
    if (status) return "cannot be checked";
    if (!pair_closed(&r)) return "is not closed and manifold";
    if (r.self_intersections) return "intersects itself";
    if (!exact) return "";
    if (lathe__mask_topology(&t, &p->mask, NULL)) return "cannot be compared";
    if ((int64_t)r.components != t.components + t.cavities || r.euler != 2 * t.euler) return "has not the topology of the voxels";
    return "";
}
#endif
