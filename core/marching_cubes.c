/* Marching cubes with a table made from one rule: on each face of a cube every run of inside corners is cut off by one segment.
 * So inside corners that touch only across a face are apart, seen from both cubes alike: 6-connected inside, closed surface. */
#include "marching_cubes.h"

/* Corner k of a cube lies at (k & 1, k >> 1 & 1, k >> 2). Edge 4a + o runs along axis a; bit 0 of o is its offset along axis
 * a + 1, bit 1 that along axis a + 2 (cyclic). */
typedef struct cube_case {
    uint8_t triangles, edge[10][3];
    uint16_t used;
} cube_case;

static int edge_between(int corner, int other) {
    int axis = (corner ^ other) >> 1, low = corner & other; /* 1, 2, 4 -> 0, 1, 2 */
    return 4 * axis + (low >> (axis + 1) % 3 & 1) + 2 * (low >> (axis + 2) % 3 & 1);
}

/* next[e]: the edge that the segment from e leads to, walking each face counter-clockwise seen from outside: inside lies on its
 * left, so a loop of segments is clockwise seen from where the surface is outside. */
static void link_face(int8_t next[12], int inside, int axis, int side) {
    static const uint8_t walk[2][4] = {{0, 2, 3, 1}, {0, 1, 3, 2}};
    int ring[4];
    for (int i = 0; i < 4; i++) {
        int b = walk[side][i] & 1, c = walk[side][i] >> 1;
        ring[i] = side << axis | b << (axis + 1) % 3 | c << (axis + 2) % 3;
    }
    for (int i = 0; i < 4; i++) {
        int last = ring[i], after = ring[(i + 1) & 3], j = i;
        if (!(inside >> last & 1) || inside >> after & 1) continue;
        while (inside >> ring[(j + 3) & 3] & 1) j = (j + 3) & 3;
        next[edge_between(last, after)] = (int8_t)edge_between(ring[(j + 3) & 3], ring[j]);
    }
}

static void make_case(cube_case *out, int inside) {
    int8_t next[12];
    memset(next, -1, sizeof next);
    *out = (cube_case){0};
    for (int face = 0; face < 6; face++) link_face(next, inside, face / 2, face % 2);
    for (int start = 0; start < 12; start++) {
        if (next[start] < 0) continue;
        int at = next[start], after = next[at];
        next[start] = -1;
        out->used |= (uint16_t)(1 << start | 1 << at);
        while (at != start) {
            next[at] = -1;
            out->used |= (uint16_t)(1 << after);
            if (after != start) {
                uint8_t *t = out->edge[out->triangles++];
                t[0] = (uint8_t)start;
                t[1] = (uint8_t)after;
                t[2] = (uint8_t)at;
            }
            at = after;
            after = at == start ? start : next[at];
        }
    }
}

/* ---- the cells that the surface passes ---- */

typedef struct cell {
    uint16_t u, v, w;
    uint8_t inside;
} cell; /* low corner; w counts from the empty slice before slice 0 */
typedef struct cells {
    cell *list;
    size_t count, triangles;
    const cube_case *table;
} cells;
typedef struct rows {
    const uint64_t *row[4];
} rows; /* (v, w), (v + 1, w), (v, w + 1), (v + 1, w + 1) */

/* Cells 64k .. 64k + 63 of the row whose corners are not all alike. */
static uint64_t passed(const rows *r, int32_t k, int32_t words) {
    uint64_t any = 0, all = UINT64_MAX;
    for (int i = 0; i < 4; i++) {
        uint64_t here = r->row[i][k], right = lathe__row_next(r->row[i], (size_t)k, (size_t)words);
        any |= here | right;
        all &= here & right;
    }
    return any & ~all;
}

static void take_cell(cells *to, const rows *r, int32_t words, int32_t u, int32_t v, int32_t w) {
    int inside = 0;
    for (int i = 0; i < 4; i++) {
        uint64_t pair = r->row[i][u >> 6] >> (u & 63) & 1;
        if (u + 1 < words * 64) pair |= (r->row[i][(u + 1) >> 6] >> ((u + 1) & 63) & 1) << 1;
        inside |= (int)pair << 2 * i;
    }
    to->list[to->count++] = (cell){(uint16_t)u, (uint16_t)v, (uint16_t)(w + 1), (uint8_t)inside};
    to->triangles += to->table[inside].triangles;
}

/* Counts the cells; takes them as well when to->list is there. */
static size_t visit_cells(cells *to, const lathe_mask *mask, const uint64_t *empty) {
    int32_t words = mask->row_words;
    size_t count = 0;
    for (int32_t w = -1; w < mask->size[2]; w++) {
        const uint64_t *low = w < 0 ? empty : lathe__mask_slice(mask, w);
        const uint64_t *high = w + 1 == mask->size[2] ? empty : lathe__mask_slice(mask, w + 1);
        for (int32_t v = 0; v + 1 < mask->size[1]; v++, low += words, high += words) {
            rows r = {{low, low + words, high, high + words}};
            for (int32_t k = 0; k < words; k++) {
                uint64_t bits = passed(&r, k, words);
                count += (size_t)__builtin_popcountll(bits);
                for (; to->list && bits; bits &= bits - 1)
                    take_cell(to, &r, words, 64 * k + __builtin_ctzll(bits), v, w);
            }
        }
    }
    return count;
}

static lathe_status find_cells(cells *to, const lathe_mask *mask) {
    uint64_t *empty = calloc(lathe__mask_slice_words(mask) + 1, sizeof *empty);
    if (!empty) return LATHE_ERR_MEMORY;
    size_t count = visit_cells(to, mask, empty);
    lathe_status status = count == 0 ? LATHE_ERR_EMPTY : count >= INT32_MAX ? LATHE_ERR_LIMIT : LATHE_OK;
    if (status == LATHE_OK) {
        to->list = malloc(count * sizeof *to->list);
        if (to->list)
            visit_cells(to, mask, empty);
        else
            status = LATHE_ERR_MEMORY;
    }
    free(empty);
    return status;
}

static inline float transformed(const float row[4], const float p[3]) {
    return row[0] * p[0] + row[1] * p[1] + row[2] * p[2] + row[3];
}

static lathe_status sort_cells(uint32_t *order, uint32_t *key, const cells *from, const float to_world[3][4],
                               const lathe_curve *curve) {
    float(*points)[3] = malloc(from->count * sizeof *points);
    if (!points) return LATHE_ERR_MEMORY;
    for (size_t k = 0; k < from->count; k++) {
        const cell *c = &from->list[k];
        float middle[3] = {(float)c->u + 0.5f, (float)c->v + 0.5f, (float)c->w - 0.5f};
        for (int i = 0; i < 3; i++) points[k][i] = transformed(to_world[i], middle);
    }
    lathe_status status = lathe__curve_order(order, key, (const float(*)[3])points, (uint32_t)from->count, curve);
    free(points);
    return status;
}

/* ---- their triangles ---- */

typedef struct sampler {
    const lathe_volume *volume;
    int frame[3];      /* file axis of u, v, w */
    int64_t stride[3]; /* in values, along u, v, w */
    int32_t origin[3]; /* voxel of the mask's (0, 0, 0), along u, v, w */
    double iso;
    const float (*to_world)[4];
} sampler;

static sampler make_sampler(const lathe_field *field, const float to_world[3][4]) {
    sampler s = {.volume = field->volume, .iso = field->iso, .to_world = to_world};
    int32_t frame[3];
    lathe__axis_frame(field->axis, frame);
    for (int i = 0; i < 3; i++) {
        s.frame[i] = frame[i];
        s.origin[i] = field->mask->origin[i];
        if (s.volume)
            s.stride[i] = frame[i] == 0   ? 1
                          : frame[i] == 1 ? s.volume->dims[0]
                                          : (int64_t)s.volume->dims[0] * s.volume->dims[1];
    }
    return s;
}

static void corner_values(float value[8], const sampler *s, const int32_t low[3]) {
    bool within = true;
    int64_t at = 0;
    for (int i = 0; i < 3; i++) {
        within = within && low[i] >= 0 && low[i] + 1 < s->volume->dims[s->frame[i]];
        at += low[i] * s->stride[i];
    }
    for (int k = 0; k < 8; k++) {
        bool here = true;
        for (int i = 0; i < 3 && !within; i++) {
            int32_t x = low[i] + (k >> i & 1);
            here = here && x >= 0 && x < s->volume->dims[s->frame[i]];
        }
        int64_t offset = (k & 1 ? s->stride[0] : 0) + (k & 2 ? s->stride[1] : 0) + (k & 4 ? s->stride[2] : 0);
        value[k] = here ? s->volume->values[at + offset] : s->volume->min;
    }
}

/* Equal values on both sides of a border can only lie at the border of the volume. */
static float crossing(double iso, double from, double to) {
    double t = (iso - from) / (to - from);
    if (from == to) return 0.5f;
    return t > 0 ? t < 1 ? (float)t : 1 : 0;
}

static void cell_points(float point[12][3], const sampler *s, const cell *c, const cube_case *shape) {
    float value[8];
    int32_t base[3] = {c->u, c->v, c->w - 1};
    if (s->volume)
        corner_values(value, s, (int32_t[3]){base[0] + s->origin[0], base[1] + s->origin[1], base[2] + s->origin[2]});
    for (uint32_t bits = shape->used; bits; bits &= bits - 1) {
        int e = __builtin_ctz(bits), a = e >> 2, b = (a + 1) % 3, d = (a + 2) % 3;
        int corner = (e & 1) << b | (e >> 1 & 1) << d;
        float p[3];
        p[a] = (float)base[a] + (s->volume ? crossing(s->iso, value[corner], value[corner | 1 << a]) : 0.5f);
        p[b] = (float)(base[b] + (e & 1));
        p[d] = (float)(base[d] + (e >> 1 & 1));
        for (int i = 0; i < 3; i++) point[e][i] = transformed(s->to_world[i], p);
    }
}

static void emit_triangles(lathe_soup *soup, const cells *from, const uint32_t *order, const uint32_t *key,
                           const sampler *s) {
    size_t n = 0;
    float point[12][3];
    for (size_t k = 0; k < from->count; k++) {
        const cell *c = &from->list[order[k]];
        const cube_case *shape = &from->table[c->inside];
        cell_points(point, s, c, shape);
        for (int t = 0; t < shape->triangles; t++, n++) {
            for (int i = 0; i < 3; i++) lathe__packet_put(soup->packets, n, i, point[shape->edge[t][i]]);
            if (n % 4 == 0) soup->key[n / 4] = key[k];
        }
    }
}

lathe_status lathe__marching_cubes(lathe_soup *out, const lathe_field *field, const float voxel_to_world[3][4],
                                   const lathe_curve *curve) {
    cube_case table[256];
    for (int k = 0; k < 256; k++) make_case(&table[k], k);
    cells found = {.table = table};
    uint32_t *order = NULL, *key = NULL;
    lathe_soup made = {0};
    lathe_status status = find_cells(&found, field->mask);
    if (status == LATHE_OK && found.triangles > INT32_MAX) status = LATHE_ERR_LIMIT;
    if (status != LATHE_OK) goto cleanup;
    size_t packets = (found.triangles + 3) / 4;
    order = malloc(found.count * sizeof *order);
    key = malloc(found.count * sizeof *key);
    made.count = (uint32_t)found.triangles;
    made.packets = malloc(packets * sizeof *made.packets);
    made.key = malloc(packets * sizeof *made.key);
    status = LATHE_ERR_MEMORY;
    if (order && key && made.packets && made.key) status = sort_cells(order, key, &found, voxel_to_world, curve);
    if (status != LATHE_OK) goto cleanup;
    sampler s = make_sampler(field, voxel_to_world);
    emit_triangles(&made, &found, order, key, &s);
    *out = made;
    made = (lathe_soup){0};
cleanup:
    free(found.list);
    free(order);
    free(key);
    free(made.packets);
    free(made.key);
    return status;
}
