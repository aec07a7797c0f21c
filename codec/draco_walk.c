#include "draco_walk.h"
#include <stdlib.h>
#include <string.h>

/* ---- numbers: seven bits a byte, the lowest first ---- */

uint32_t lathe__walk_number(lathe_draco_walk *w, uint32_t value) {
    if (w->truth) {
        lathe__emit_varint(&w->numbers, value);
        return value;
    }
    uint64_t v = 0;
    for (int shift = 0; shift < 35; shift += 7) {
        if (w->read >= w->numbers.size) break;
        uint8_t byte = w->numbers.data[w->read++];
        v |= (uint64_t)(byte & 127) << shift;
        if (byte < 128 && v <= UINT32_MAX) return (uint32_t)v;
    }
    lathe__walk_fail(w, LATHE_ERR_FORMAT);
    return 0;
}

int32_t lathe__walk_signed(lathe_draco_walk *w, int32_t value) {
    uint32_t v = lathe__walk_number(w, (uint32_t)value << 1 ^ (uint32_t)(value >> 31));
    return (int32_t)(v >> 1 ^ (0u - (v & 1)));
}

/* ---- which triangles meet where ---- */

static bool list_corners(lathe_draco_walk *w) {
    const lathe_draco_carrier *c = w->c;
    size_t corners = (size_t)3 * c->triangle_count;
    w->first = LATHE_NEW(&w->arena, uint32_t, (size_t)c->vertex_count + 2);
    w->corner = LATHE_NEW(&w->arena, uint32_t, corners + 1);
    if (!w->first || !w->corner) return lathe__walk_fail(w, LATHE_ERR_MEMORY);
    memset(w->first, 0, ((size_t)c->vertex_count + 2) * sizeof *w->first);
    for (size_t i = 0; i < corners; i++) w->first[c->triangles[i] + 2]++;
    for (uint32_t v = 1; v <= c->vertex_count; v++) w->first[v + 1] += w->first[v];
    for (size_t i = 0; i < corners; i++) w->corner[w->first[c->triangles[i] + 1]++] = (uint32_t)i;
    for (uint32_t v = 0; v < c->vertex_count; v++)
        if (w->first[v] == w->first[v + 1]) return lathe__walk_fail(w, w->truth ? LATHE_ERR_UNSUPPORTED : LATHE_ERR_FORMAT);
    return true;
}

/* Every edge once each way: the mesh is closed. Edges are hashed, so that no hostile vertex makes it slow. */
static bool pair_edges(lathe_draco_walk *w) {
    const uint32_t *v = w->c->triangles;
    size_t corners = (size_t)3 * w->c->triangle_count, slots = 16;
    while (slots < 2 * corners) slots *= 2;
    uint32_t *table = LATHE_NEW(&w->arena, uint32_t, slots);
    w->twin = LATHE_NEW(&w->arena, uint32_t, corners + 1);
    if (!table || !w->twin) return lathe__walk_fail(w, LATHE_ERR_MEMORY);
    memset(table, 0xff, slots * sizeof *table);
    lathe_status wrong = w->truth ? LATHE_ERR_UNSUPPORTED : LATHE_ERR_FORMAT;
    for (int pass = 0; pass < 2; pass++)
        for (size_t i = 0; i < corners; i++) {
            uint32_t a = v[i], b = v[i - i % 3 + (i + 1) % 3];
            if (pass) { uint32_t swap = a; a = b; b = swap; }
            size_t slot = (((uint64_t)a << 32 | b) * 0x9E3779B97F4A7C15u >> 20) & (slots - 1);
            for (; table[slot] != LATHE_DRACO_NONE; slot = (slot + 1) & (slots - 1)) {
                uint32_t k = table[slot];
                if (v[k] == a && v[k - k % 3 + (k + 1) % 3] == b) break;
            }
            if ((table[slot] != LATHE_DRACO_NONE) != (pass == 1)) return lathe__walk_fail(w, wrong);
            if (pass) w->twin[i] = table[slot];
            else table[slot] = (uint32_t)i;
        }
    return true;
}

static bool prepare(lathe_draco_walk *w) {
    size_t n = w->c->vertex_count, old = w->mesh->vertex_count;
    uint32_t **arrays[4] = {&w->part, &w->next, &w->before, &w->id};
    for (int k = 0; k < 4; k++) {
        *arrays[k] = LATHE_NEW(&w->arena, uint32_t, n + 1);
        if (!*arrays[k]) return lathe__walk_fail(w, LATHE_ERR_MEMORY);
        memset(*arrays[k], 0xff, n * sizeof(uint32_t));
    }
    w->half = LATHE_NEW(&w->arena, int32_t, n + 1);
    w->used = LATHE_NEW(&w->arena, uint8_t, old + 1);
    if (!w->half || !w->used) return lathe__walk_fail(w, LATHE_ERR_MEMORY);
    for (size_t v = 0; v < n; v++) w->half[v] = LATHE_HALF_UNKNOWN;
    memset(w->used, 0, old);
    return list_corners(w) && pair_edges(w);
}

/* ---- numbers of vertices ---- */

/* Vertices between slices of the structures that change are gone, others were before: new ones take their numbers. */
static void list_free(lathe_draco_walk *w) {
    const lathe_draco_mesh *m = w->mesh;
    uint8_t *gone = LATHE_NEW(&w->arena, uint8_t, (size_t)m->vertex_count + 1);
    w->free = LATHE_NEW(&w->arena, uint32_t, (size_t)m->vertex_count + 1);
    if (!gone || !w->free) { lathe__walk_fail(w, LATHE_ERR_MEMORY); return; }
    memset(gone, 0, m->vertex_count);
    for (uint32_t i = 0; i < m->spare_count; i++) gone[m->spare[i]] = 1;
    for (uint32_t i = 0; i < w->touched_count; i++) {
        const lathe_draco_part *p = &m->parts[w->touched[i]];
        for (size_t k = 0; k < (size_t)3 * p->triangle_count; k++) gone[p->triangles[k / 3][k % 3]] = 1;
        for (uint32_t k = 0; k < p->contour_count; k++) gone[p->contour[k]] = 0;
    }
    for (uint32_t v = 0; v < m->vertex_count; v++)
        if (gone[v]) w->free[w->free_count++] = v;
}

void lathe__walk_add(lathe_draco_walk *w, uint32_t x, int32_t u, int32_t v, int32_t height) {
    lathe_draco_mesh *m = w->mesh;
    bool more = w->free_taken == w->free_count;
    if (more && m->vertex_count == m->capacity) {
        uint32_t room = m->capacity + m->capacity / 2 + 1024;
        void *at = realloc(m->at, (size_t)room * sizeof *m->at), *next = at ? realloc(m->next, (size_t)room * sizeof *m->next) : NULL;
        if (at) m->at = at;
        if (next) m->next = next;
        if (!next || room > INT32_MAX / 2) { lathe__walk_fail(w, LATHE_ERR_MEMORY); return; }
        m->capacity = room;
    }
    uint32_t id = w->id[x] = more ? m->vertex_count++ : w->free[w->free_taken++];
    m->next[id] = LATHE_DRACO_NONE;
    m->at[id][0] = u, m->at[id][1] = v, m->at[id][2] = height;
}

/* Old vertices that the delta has not met, and free numbers that it has not used. */
static void list_spare(lathe_draco_walk *w) {
    lathe_draco_mesh *m = w->mesh;
    uint8_t *taken = LATHE_NEW(&w->arena, uint8_t, (size_t)m->vertex_count + 1);
    uint32_t *spare = realloc(m->spare, ((size_t)m->vertex_count + 1) * sizeof *spare), count = 0;
    if (spare) m->spare = spare;
    if (!taken || !spare) { lathe__walk_fail(w, LATHE_ERR_MEMORY); return; }
    memset(taken, 0, m->vertex_count);
    for (uint32_t v = 0; v < w->c->vertex_count; v++) taken[w->id[v]] = 1;
    for (uint32_t i = w->free_taken; i < w->free_count; i++) taken[spare[count++] = w->free[i]] = 1;
    for (uint32_t i = 0; i < w->touched_count; i++) {
        const lathe_draco_part *p = &m->parts[w->touched[i]];
        for (uint32_t k = 0; k < p->contour_count; k++)
            if (!taken[p->contour[k]]++) spare[count++] = p->contour[k]; /* once, whatever hostile deltas did */
    }
    m->spare_count = count;
}

/* ---- the mesh that results ---- */

static void link_outlines(lathe_draco_walk *w) {
    for (uint32_t v = 0; v < w->c->vertex_count; v++)
        if (w->next[v] != LATHE_DRACO_NONE && !(w->half[v] & 1)) w->mesh->next[w->id[v]] = w->id[w->next[v]];
}

/* Room for the triangles and the outlines' vertices of each structure of the delta. */
static bool empty_parts(lathe_draco_walk *w) {
    for (uint32_t i = 0; i < w->touched_count; i++)
        w->mesh->parts[w->touched[i]].triangle_count = w->mesh->parts[w->touched[i]].contour_count = 0;
    for (uint32_t t = 0; t < w->c->triangle_count; t++) w->mesh->parts[w->part[w->c->triangles[(size_t)3 * t]]].triangle_count++;
    for (uint32_t v = 0; v < w->c->vertex_count; v++) w->mesh->parts[w->part[v]].contour_count += !(w->half[v] & 1);
    for (uint32_t i = 0; i < w->touched_count; i++) {
        lathe_draco_part *p = &w->mesh->parts[w->touched[i]];
        free(p->triangles);
        free(p->contour);
        p->triangles = malloc(((size_t)p->triangle_count + 1) * sizeof *p->triangles);
        p->contour = malloc(((size_t)p->contour_count + 1) * sizeof *p->contour);
        p->triangle_count = p->contour_count = 0;
        if (!p->triangles || !p->contour) return lathe__walk_fail(w, LATHE_ERR_MEMORY);
    }
    return true;
}

typedef struct by_height { int32_t height; uint32_t id; } by_height;
static int compare_height(const void *a, const void *b) {
    const by_height *x = a, *y = b;
    if (x->height != y->height) return x->height < y->height ? -1 : 1;
    return x->id < y->id ? -1 : x->id > y->id;
}

static bool fill_parts(lathe_draco_walk *w) {
    uint32_t n = w->c->vertex_count, count = 0;
    by_height *sorted = LATHE_NEW(&w->arena, by_height, n + 1);
    uint32_t *part_of = LATHE_NEW(&w->arena, uint32_t, (size_t)w->mesh->vertex_count + 1);
    if (!sorted || !part_of) return lathe__walk_fail(w, LATHE_ERR_MEMORY);
    for (uint32_t v = 0; v < n; v++) {
        part_of[w->id[v]] = w->part[v];
        if (!(w->half[v] & 1)) sorted[count++] = (by_height){w->mesh->at[w->id[v]][2], w->id[v]};
    }
    qsort(sorted, count, sizeof *sorted, compare_height);
    for (uint32_t i = 0; i < count; i++) {
        lathe_draco_part *p = &w->mesh->parts[part_of[sorted[i].id]];
        p->contour[p->contour_count++] = sorted[i].id;
    }
    for (uint32_t t = 0; t < w->c->triangle_count; t++) {
        const uint32_t *v = w->c->triangles + (size_t)3 * t;
        lathe_draco_part *p = &w->mesh->parts[w->part[v[0]]];
        uint32_t *out = p->triangles[p->triangle_count++];
        for (int k = 0; k < 3; k++) out[k] = w->id[v[k]];
    }
    return true;
}

/* Of the vertices' places and of all triangles: that writer and reader have taken the same way. */
static uint32_t check_sum(const lathe_draco_walk *w) {
    uint32_t hash = 2166136261u;
    for (uint32_t v = 0; v < w->c->vertex_count; v++)
        for (int k = 0; k < 3; k++) hash = (hash ^ (uint32_t)w->mesh->at[w->id[v]][k]) * 16777619u;
    for (size_t i = 0; i < (size_t)3 * w->c->triangle_count; i++) hash = (hash ^ w->id[w->c->triangles[i]]) * 16777619u;
    return hash;
}

static void finish(lathe_draco_walk *w) {
    uint32_t sum = check_sum(w);
    if (lathe__walk_number(w, sum) != sum) lathe__walk_fail(w, w->failure ? w->failure : LATHE_ERR_CHECKSUM);
    if (w->failure) return;
    list_spare(w);
    link_outlines(w);
    if (w->failure || !empty_parts(w) || !fill_parts(w)) return;
    w->mesh->level_count++;
}

/* Writing: the numbers become words, the last one filled with zeros. */
static lathe_status store_numbers(lathe_draco_walk *w) {
    while (w->numbers.size % 4) lathe__emit_u8(&w->numbers, 0);
    if (w->numbers.failed) return LATHE_ERR_MEMORY;
    w->c->words = malloc(w->numbers.size + 1);
    if (!w->c->words) return LATHE_ERR_MEMORY;
    memcpy(w->c->words, w->numbers.data, w->numbers.size);
    w->c->word_count = (uint32_t)(w->numbers.size / 4);
    return LATHE_OK;
}

/* A delta's statistics are a start for the next one's, that is soon outweighed. */
static void age(lathe_ranks *ranks) {
    for (uint32_t i = 0; i < ranks->slots; i++)
        for (uint32_t k = 0; k < ranks->contexts[i].count; k++) ranks->contexts[i].ranks[k].seen /= 64;
}

lathe_status lathe__draco_walk(lathe_draco_mesh *mesh, lathe_draco_carrier *carrier, const lathe_draco_truth *truth) {
    lathe_draco_walk w = {.mesh = mesh, .c = carrier, .truth = truth, .ranks = mesh->ranks[0]};
    if (!truth) w.numbers = (lathe_bytes){.data = (uint8_t *)carrier->words, .size = (size_t)4 * carrier->word_count};
    for (int k = 0; k < 2; k++) age(&mesh->ranks[k]);
    if (prepare(&w)) lathe__walk_slices(&w);
    mesh->ranks[0] = w.ranks;
    w.ranks = mesh->ranks[1];
    if (!w.failure) list_free(&w);
    if (!w.failure) lathe__walk_places(&w);
    if (!w.failure) finish(&w);
    if (!w.failure && truth) w.failure = store_numbers(&w);
    if (truth) lathe__bytes_free(&w.numbers);
    mesh->ranks[1] = w.ranks;
    lathe__arena_free(&w.arena);
    return w.failure;
}
