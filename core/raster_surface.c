/* The surface of a raster, layer by layer: vertices where the rays along the raster's lines cross, triangles from a table. */
#include "raster_surface.h"
#include <string.h>
#include "cube_table.h"
#include "outline.h"
#include "overlay.h"

typedef struct surface {
    lathe_mesh_builder builder;
    const lathe_mask *mask;
    int32_t out[2];            /* from the sample inside to a vertex along u and v, and along w, lattice units */
    size_t area;
    uint32_t *ids;             /* vertices of the edges that begin in each pixel: along u, along v, in even and in odd slices; along w */
    const lathe_cube_case *table;
} surface;

/* Which plane of ids, and how many pixels further. */
static size_t place_of(const surface *s, int edge, int odd) {
    int axis = edge / 4, first = edge & 1, second = edge >> 1 & 1;
    size_t width = (size_t)s->mask->size[0];
    if (axis == 0) return (size_t)(odd ^ second) * s->area + (size_t)first * width;
    if (axis == 1) return (size_t)(2 + (odd ^ first)) * s->area + (size_t)second;
    return 4 * s->area + (size_t)first + (size_t)second * width;
}

/* Of the 64 samples from (u, v, w) on; ids: of row v. */
static lathe_status add_vertices(surface *s, uint64_t crossed, uint64_t inside, int axis, uint32_t *ids, int32_t u, int32_t v,
                                 int32_t w) {
    if (!crossed) return LATHE_OK;
    lathe_status status = lathe__builder_reserve(&s->builder, 64, 0);
    if (status) return status;
    lathe_mesh *mesh = &s->builder.mesh;
    for (; crossed; crossed &= crossed - 1) {
        int bit = __builtin_ctzll(crossed);
        ids[u + bit] = mesh->vertex_count;
        int32_t *p = mesh->lattice[mesh->vertex_count++];
        p[0] = (u + bit) * LATHE_LATTICE_ONE, p[1] = v * LATHE_LATTICE_ONE, p[2] = w * LATHE_LATTICE_ONE;
        p[axis] += inside >> bit & 1 ? s->out[axis == 2] : LATHE_LATTICE_ONE - s->out[axis == 2];
    }
    return LATHE_OK;
}

static const uint64_t *row_at(const lathe_mask *mask, const uint64_t *air, int32_t v, int32_t w) {
    return w < 0 || w >= mask->size[2] ? air : lathe__mask_slice(mask, w) + (size_t)v * (size_t)mask->row_words;
}

/* Vertices on edges within a slice. */
static lathe_status slice_vertices(surface *s, int32_t w) {
    const lathe_mask *mask = s->mask;
    int32_t words = mask->row_words;
    uint32_t *along_u = s->ids + (size_t)(w & 1) * s->area, *along_v = along_u + 2 * s->area;
    for (int32_t v = 0; v + 1 < mask->size[1]; v++) {
        const uint64_t *row = lathe__mask_slice(mask, w) + (size_t)v * (size_t)words;
        for (int32_t i = 0; i < words; i++) {
            uint64_t next = lathe__row_next(row, (size_t)i, (size_t)words);
            size_t at = (size_t)v * (size_t)mask->size[0];
            lathe_status status = add_vertices(s, row[i] ^ next, row[i], 0, along_u + at, i * 64, v, w);
            if (!status) status = add_vertices(s, row[i] ^ row[i + words], row[i], 1, along_v + at, i * 64, v, w);
            if (status) return status;
        }
    }
    return LATHE_OK;
}

/* Vertices between slice w and the next. */
static lathe_status upright_vertices(surface *s, const uint64_t *air, int32_t w) {
    const lathe_mask *mask = s->mask;
    for (int32_t v = 0; v < mask->size[1]; v++) {
        const uint64_t *low = row_at(mask, air, v, w), *high = row_at(mask, air, v, w + 1);
        for (int32_t i = 0; i < mask->row_words; i++) {
            uint32_t *ids = s->ids + 4 * s->area + (size_t)v * (size_t)mask->size[0];
            lathe_status status = add_vertices(s, low[i] ^ high[i], low[i], 2, ids, i * 64, v, w);
            if (status) return status;
        }
    }
    return LATHE_OK;
}

static lathe_status layer_cubes(surface *s, const uint64_t *air, int32_t w) {
    const lathe_mask *mask = s->mask;
    int32_t words = mask->row_words;
    size_t place[LATHE_CUBE_EDGES];
    for (int e = 0; e < LATHE_CUBE_EDGES; e++) place[e] = place_of(s, e, w & 1);
    for (int32_t v = 0; v + 1 < mask->size[1]; v++) {
        const uint64_t *row[4] = {row_at(mask, air, v, w), row_at(mask, air, v + 1, w),
                                  row_at(mask, air, v, w + 1), row_at(mask, air, v + 1, w + 1)};
        for (int32_t i = 0; i < words; i++) {
            uint64_t here[4], next[4], any = 0, all = ~(uint64_t)0;
            for (int k = 0; k < 4; k++) {
                here[k] = row[k][i];
                next[k] = lathe__row_next(row[k], (size_t)i, (size_t)words);
                any |= here[k] | next[k];
                all &= here[k] & next[k];
            }
            uint64_t mixed = any & ~all;
            if (!mixed) continue;
            lathe_status status = lathe__builder_reserve(&s->builder, 0, 64 * LATHE_CUBE_TRIANGLES);
            if (status) return status;
            uint32_t(*out)[3] = s->builder.mesh.triangles + s->builder.mesh.triangle_count;
            const uint32_t *ids = s->ids + (size_t)v * (size_t)mask->size[0] + (size_t)i * 64;
            for (; mixed; mixed &= mixed - 1) {
                int bit = __builtin_ctzll(mixed);
                uint32_t inside = 0;
                for (int k = 0; k < 4; k++) inside |= (uint32_t)((here[k] >> bit & 1) | (next[k] >> bit & 1) << 1) << 2 * k;
                const lathe_cube_case *c = &s->table[inside];
                for (uint32_t t = 0; t < c->count; t++, out++)
                    for (int k = 0; k < 3; k++) (*out)[k] = ids[(size_t)bit + place[c->corner[t][k]]];
            }
            s->builder.mesh.triangle_count = (uint32_t)(out - s->builder.mesh.triangles);
        }
    }
    return LATHE_OK;
}

static int limited(int fraction) {
    return fraction < LATHE_FRACTION_MIN ? LATHE_FRACTION_MIN : fraction > LATHE_FRACTION_MAX ? LATHE_FRACTION_MAX : fraction;
}

lathe_status lathe__raster_surface(lathe_mesh *out, lathe_arena *scratch, const lathe_mask *mask, const int fraction[2]) {
    surface s = {.mask = mask, .area = (size_t)mask->size[0] * (size_t)mask->size[1],
                 .table = lathe__cube_table()};
    for (int k = 0; k < 2; k++) s.out[k] = limited(fraction[k]) * (LATHE_LATTICE_ONE / LATHE_FRACTION_ONE);
    s.ids = LATHE_NEW(scratch, uint32_t, 5 * s.area);
    uint64_t *air = LATHE_NEW(scratch, uint64_t, mask->row_words);
    if (!s.ids || !air) return LATHE_ERR_MEMORY;
    memset(air, 0, (size_t)mask->row_words * sizeof *air);
    lathe_status status = LATHE_OK;
    for (int32_t w = -1; !status && w < mask->size[2]; w++) {
        if (w + 1 < mask->size[2]) status = slice_vertices(&s, w + 1);
        if (!status) status = upright_vertices(&s, air, w);
        if (!status) status = layer_cubes(&s, air, w);
    }
    if (status) lathe_mesh_free(&s.builder.mesh);
    else *out = s.builder.mesh;
    return status;
}
