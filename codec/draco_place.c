/* Where the vertices of a delta lie. Outlines are walked from vertex to vertex: the next one is the next of the old outline, or
 * lies one step on; which, depends on the step before and on where the next old vertex waits. Vertices between slices are
 * where two outlines cross or in the middle of a diagonal, both of which the client finds by itself. */
#include "draco_walk.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { UNIT = LATHE_LATTICE_ONE / LATHE_DRACO_ONE, MOST_SKIPPED = 4, NEAR = 24, FAR = 100, NOWHERE = 99, MOST_NEIGHBOURS = 16,
       MOST_CANDIDATES = 16, MOST_RISE = 511, CROSSING = -1 };
#define OLD_VERTEX INT32_MIN /* and how many of the old outline are skipped */
#define MOST_WORK ((uint64_t)1 << 32)

typedef struct place { int32_t u, v; } place;

static bool is_within(const lathe_draco_walk *w, uint32_t x, place p, int64_t tolerance) {
    int64_t du = (int64_t)p.u * UNIT - w->truth->exact[x][0], dv = (int64_t)p.v * UNIT - w->truth->exact[x][1];
    return du * du + dv * dv <= tolerance * tolerance;
}
static bool is_near(const lathe_draco_walk *w, uint32_t x, place p) { return is_within(w, x, p, LATHE_DRACO_TOLERANCE); }

static int32_t rounded(int32_t lattice) {
    int32_t up = lattice + UNIT / 2;
    return up < 0 ? -((-up + UNIT - 1) / UNIT) : up / UNIT;
}
static place nearest_place(const lathe_draco_walk *w, uint32_t x) {
    return (place){rounded(w->truth->exact[x][0]), rounded(w->truth->exact[x][1])};
}

/* A sum that hostile numbers may drive out of the range of coordinates. */
static int32_t bounded(lathe_draco_walk *w, int64_t v) {
    if (v >= -(1 << 20) && v <= 1 << 20) return (int32_t)v;
    lathe__walk_fail(w, LATHE_ERR_FORMAT);
    return 0;
}

static place old_place(const lathe_draco_walk *w, uint32_t id) { return (place){w->mesh->at[id][0], w->mesh->at[id][1]}; }

static void add_vertex(lathe_draco_walk *w, uint32_t x, place p, int32_t height) {
    lathe_draco_mesh *m = w->mesh;
    if (m->vertex_count == m->capacity) {
        uint32_t more = m->capacity + m->capacity / 2 + 1024;
        void *at = realloc(m->at, (size_t)more * sizeof *m->at), *next = at ? realloc(m->next, (size_t)more * sizeof *m->next) : NULL;
        if (at) m->at = at;
        if (next) m->next = next;
        if (!next || more > INT32_MAX / 2) { lathe__walk_fail(w, LATHE_ERR_MEMORY); return; }
        m->capacity = more;
    }
    w->id[x] = m->vertex_count++;
    m->next[w->id[x]] = LATHE_DRACO_NONE;
    m->at[w->id[x]][0] = p.u, m->at[w->id[x]][1] = p.v, m->at[w->id[x]][2] = height;
}

/* ---- old vertices of a slice, by their distance from a place ---- */

static uint32_t first_at(const lathe_draco_walk *w, const lathe_draco_part *part, int32_t height) {
    uint32_t low = 0, high = part->contour_count;
    while (low < high) {
        uint32_t middle = (low + high) / 2;
        if (w->mesh->at[part->contour[middle]][2] < height) low = middle + 1;
        else high = middle;
    }
    return low;
}

static const uint32_t *old_of_slice(lathe_draco_walk *w, uint32_t x, uint32_t *count) {
    const lathe_draco_part *part = &w->mesh->parts[w->part[x]];
    int32_t height = part->heights[w->half[x] / 2] * LATHE_DRACO_ONE;
    uint32_t first = first_at(w, part, height);
    *count = first_at(w, part, height + 1) - first;
    w->work += *count;
    if (w->work > MOST_WORK) lathe__walk_fail(w, LATHE_ERR_LIMIT);
    return part->contour + first;
}

static int64_t distance(const lathe_draco_walk *w, uint32_t id, place p) {
    int64_t du = (int64_t)w->mesh->at[id][0] - p.u, dv = (int64_t)w->mesh->at[id][1] - p.v;
    return du * du + dv * dv;
}

/* The free old vertex that x is nearest to, within the tolerance. */
static uint32_t match(lathe_draco_walk *w, uint32_t x) {
    uint32_t count, best = LATHE_DRACO_NONE;
    const uint32_t *list = old_of_slice(w, x, &count);
    int64_t least = INT64_MAX;
    for (uint32_t i = 0; i < count; i++) {
        if (w->used[list[i]] || !is_near(w, x, old_place(w, list[i]))) continue;
        int64_t du = (int64_t)w->mesh->at[list[i]][0] * UNIT - w->truth->exact[x][0];
        int64_t dv = (int64_t)w->mesh->at[list[i]][1] * UNIT - w->truth->exact[x][1];
        if (du * du + dv * dv >= least) continue;
        least = du * du + dv * dv;
        best = list[i];
    }
    return best;
}

/* How many of the slice's old vertices come before one, by distance from p, then by number. */
static uint32_t rank_of(lathe_draco_walk *w, uint32_t x, uint32_t id, place p) {
    uint32_t count, rank = 0;
    const uint32_t *list = old_of_slice(w, x, &count);
    int64_t own = distance(w, id, p);
    for (uint32_t i = 0; i < count; i++) {
        int64_t d = distance(w, list[i], p);
        rank += d < own || (d == own && list[i] < id);
    }
    return rank;
}

typedef struct by_distance { int64_t distance; uint32_t id; } by_distance;
static int compare_distance(const void *a, const void *b) {
    const by_distance *x = a, *y = b;
    if (x->distance != y->distance) return x->distance < y->distance ? -1 : 1;
    return x->id < y->id ? -1 : x->id > y->id;
}

static uint32_t of_rank(lathe_draco_walk *w, uint32_t x, uint32_t rank, place p) {
    uint32_t count, id = LATHE_DRACO_NONE;
    const uint32_t *list = old_of_slice(w, x, &count);
    w->work += 16 * (uint64_t)count;
    if (rank >= count) lathe__walk_fail(w, LATHE_ERR_FORMAT);
    if (w->failure) return id;
    by_distance *sorted = malloc(count * sizeof *sorted);
    if (!sorted) { lathe__walk_fail(w, LATHE_ERR_MEMORY); return id; }
    for (uint32_t i = 0; i < count; i++) sorted[i] = (by_distance){distance(w, list[i], p), list[i]};
    qsort(sorted, count, sizeof *sorted, compare_distance);
    id = sorted[rank].id;
    free(sorted);
    return id;
}

/* ---- outlines ---- */

typedef struct outline_walk {
    uint32_t old;              /* the latest old vertex, or NONE */
    place at, step;            /* of the latest vertex; how it was reached */
    int32_t height;
} outline_walk;

static void keys_of(const lathe_draco_walk *w, const outline_walk *o, uint64_t keys[3]) {
    int32_t wait[2] = {NOWHERE, NOWHERE};
    uint32_t next = o->old == LATHE_DRACO_NONE ? LATHE_DRACO_NONE : w->mesh->next[o->old];
    if (next != LATHE_DRACO_NONE) {
        int32_t du = w->mesh->at[next][0] - o->at.u, dv = w->mesh->at[next][1] - o->at.v;
        int32_t most = abs(du) > abs(dv) ? abs(du) : abs(dv);
        wait[0] = most > NEAR ? FAR + du * 4 / most : du;
        wait[1] = most > NEAR ? FAR + dv * 4 / most : dv;
    }
    uint64_t step = (uint64_t)(uint16_t)o->step.u << 16 | (uint16_t)o->step.v;
    keys[0] = (uint64_t)1 << 62 | step << 16 | (uint64_t)(uint8_t)wait[0] << 8 | (uint8_t)wait[1];
    keys[1] = (uint64_t)2 << 62 | step;
    keys[2] = (uint64_t)3 << 62;
}

/* The vertex of the old outline that a value stands for. */
static uint32_t skip(const lathe_draco_walk *w, uint32_t old, int32_t skipped) {
    for (; skipped >= 0 && old != LATHE_DRACO_NONE; skipped--) old = w->mesh->next[old];
    return old;
}

static bool is_old(int32_t value) { return value < OLD_VERTEX + MOST_SKIPPED; }
static place stepped(place p, int32_t value) { return (place){p.u + (value >> 16), p.v + (int16_t)(value & 0xffff)}; }
static bool has_value(place step) { return abs(step.u) < 32767 && abs(step.v) < 32767; }
static int32_t value_of(place step) { return (int32_t)((uint32_t)step.u << 16 | (uint16_t)step.v); }

/* Writing: what the next vertex of an outline is. */
static bool choose_old(const lathe_draco_walk *w, const outline_walk *o, uint32_t x, int32_t *value) {
    for (int32_t k = 0; k < MOST_SKIPPED && o->old != LATHE_DRACO_NONE; k++) {
        uint32_t id = skip(w, o->old, k);
        if (id == LATHE_DRACO_NONE || w->used[id] || !is_near(w, x, old_place(w, id)) || w->mesh->at[id][2] != o->height) continue;
        *value = OLD_VERTEX + k;
        return true;
    }
    return false;
}

static int32_t find_rank(lathe_rank_cursor cursor, int32_t value) {
    int32_t seen, rank = 0;
    for (; lathe__rank_next(&cursor, &seen); rank++)
        if (seen == value) return rank;
    return -1;
}

/* The first step that ends near enough. */
static int32_t find_step(const lathe_draco_walk *w, const outline_walk *o, uint32_t x, lathe_rank_cursor cursor, int32_t *value) {
    for (int32_t rank = 0; lathe__rank_next(&cursor, value); rank++)
        if (!is_old(*value) && is_near(w, x, stepped(o->at, *value))) return rank;
    return -1;
}

static void take(lathe_draco_walk *w, outline_walk *o, uint32_t x, uint32_t old, place p) {
    if (old != LATHE_DRACO_NONE) {
        p = old_place(w, old);
        w->id[x] = o->old = old;
        if (w->used[old]) lathe__walk_fail(w, LATHE_ERR_FORMAT);
        w->used[old] = 1;
    } else {
        p = (place){bounded(w, p.u), bounded(w, p.v)};
        add_vertex(w, x, p, o->height);
    }
    o->step = (place){p.u - o->at.u, p.v - o->at.v};
    o->at = p;
}

/* Small differences as one symbol, in shells around zero. */
static uint32_t zigzag(int32_t v) { return (uint32_t)v << 1 ^ (uint32_t)(v >> 31); }
static int32_t unzigzag(uint32_t v) { return (int32_t)(v >> 1 ^ (0u - (v & 1))); }
static bool is_pair(place d) { return zigzag(d.u) < LATHE_PAIR_SIDE && zigzag(d.v) < LATHE_PAIR_SIDE; }
static int32_t pair_of(place d) {
    uint32_t a = zigzag(d.u), b = zigzag(d.v);
    return (int32_t)(a >= b ? a * a + a + b : b * b + a);
}
static place of_pair(int32_t pair) {
    int32_t side = 0;
    while ((side + 1) * (side + 1) <= pair) side++;
    int32_t rest = pair - side * side;
    return rest < side ? (place){unzigzag((uint32_t)rest), unzigzag((uint32_t)side)} : (place){unzigzag((uint32_t)side), unzigzag((uint32_t)(rest - side))};
}

/* A vertex by numbers: 1 + rank of an old one, or 0 and how far it is from where it was expected. */
static void take_numbers(lathe_draco_walk *w, outline_walk *o, uint32_t x, place expected) {
    uint32_t old = w->truth ? match(w, x) : LATHE_DRACO_NONE;
    uint32_t rank = lathe__walk_number(w, old == LATHE_DRACO_NONE ? 0 : 1 + rank_of(w, x, old, expected));
    if (rank && !w->truth) old = of_rank(w, x, rank - 1, expected);
    place p = {0, 0};
    if (!rank) {
        if (w->truth) p = nearest_place(w, x);
        int32_t du = lathe__walk_signed(w, p.u - expected.u), dv = lathe__walk_signed(w, p.v - expected.v);
        p = (place){bounded(w, (int64_t)expected.u + du), bounded(w, (int64_t)expected.v + dv)};
    }
    if (!w->failure) take(w, o, x, old, p);
}

/* Symbol and value of the next vertex; the value is good if the symbol is a rank. */
static void take_next(lathe_draco_walk *w, outline_walk *o, uint32_t x) {
    uint64_t keys[3];
    keys_of(w, o, keys);
    lathe_rank_cursor cursor = lathe__rank_cursor(&w->ranks, keys, 3);
    place expected = {o->at.u + o->step.u, o->at.v + o->step.v};
    int32_t *symbol = &w->c->value[1][x], value = 0;
    if (w->truth) {
        int32_t rank = -1;
        if (choose_old(w, o, x, &value)) rank = find_rank(cursor, value);
        else if (match(w, x) == LATHE_DRACO_NONE) rank = find_step(w, o, x, cursor, &value);
        *symbol = rank < 0 ? LATHE_SYMBOL_NUMBERS : LATHE_SYMBOL_RANK + rank;
        if (rank < 0 && match(w, x) == LATHE_DRACO_NONE) {
            place p = nearest_place(w, x), d = {p.u - expected.u, p.v - expected.v};
            if (is_pair(d)) *symbol = LATHE_SYMBOL_PAIR + pair_of(d);
        }
    }
    bool ranked = *symbol >= LATHE_SYMBOL_RANK;
    if (*symbol >= LATHE_SYMBOL_PAIR) {
        if (*symbol >= LATHE_SYMBOL_PAIR + LATHE_PAIR_SIDE * LATHE_PAIR_SIDE) { lathe__walk_fail(w, LATHE_ERR_FORMAT); return; }
        place d = of_pair(*symbol - LATHE_SYMBOL_PAIR);
        take(w, o, x, LATHE_DRACO_NONE, (place){expected.u + d.u, expected.v + d.v});
        value = value_of(o->step);
        ranked = has_value(o->step);
    } else if (ranked) {
        for (int32_t rank = *symbol - LATHE_SYMBOL_RANK; rank >= 0; rank--)
            if (!lathe__rank_next(&cursor, &value)) { lathe__walk_fail(w, LATHE_ERR_FORMAT); return; }
        uint32_t old = is_old(value) ? skip(w, o->old, value - OLD_VERTEX) : LATHE_DRACO_NONE;
        if (is_old(value) && (o->old == LATHE_DRACO_NONE || old == LATHE_DRACO_NONE)) { lathe__walk_fail(w, LATHE_ERR_FORMAT); return; }
        take(w, o, x, old, is_old(value) ? o->at : stepped(o->at, value));
    } else if (*symbol == LATHE_SYMBOL_NUMBERS) {
        uint32_t before = o->old;
        take_numbers(w, o, x, expected);
        value = value_of(o->step);
        ranked = w->id[x] >= w->old_count && has_value(o->step);
        /* An old one that could have been told by its place in the outline. */
        for (int32_t k = 0; !ranked && before != LATHE_DRACO_NONE && k < MOST_SKIPPED; k++)
            if (skip(w, before, k) == w->id[x]) { value = OLD_VERTEX + k; ranked = true; }
    } else lathe__walk_fail(w, LATHE_ERR_FORMAT);
    if (w->failure || !ranked) return;
    lathe_status status = lathe__rank_seen(&w->ranks, keys, 3, value);
    if (status) lathe__walk_fail(w, status);
}

/* The mean of a vertex's neighbours that have their places, at most MOST_NEIGHBOURS of them. */
static place expect(const lathe_draco_walk *w, uint32_t x, place otherwise) {
    int64_t u = 0, v = 0;
    int32_t n = 0;
    for (uint32_t i = w->first[x]; i < w->first[x + 1] && i < w->first[x] + MOST_NEIGHBOURS; i++) {
        uint32_t corner = w->corner[i], y = w->c->triangles[corner - corner % 3 + (corner + 1) % 3];
        if (w->id[y] == LATHE_DRACO_NONE) continue;
        u += w->mesh->at[w->id[y]][0];
        v += w->mesh->at[w->id[y]][1];
        n++;
    }
    return n ? (place){(int32_t)(u / n), (int32_t)(v / n)} : otherwise;
}

/* Where a walk begins: writing, at a vertex that is an old one if there is any; reading, where the symbol says so. */
static uint32_t find_start(lathe_draco_walk *w, uint32_t from) {
    uint32_t x = from;
    do {
        if (w->truth ? match(w, x) != LATHE_DRACO_NONE : w->c->value[1][x] == LATHE_SYMBOL_START) return x;
        x = w->next[x];
    } while (x != from);
    if (!w->truth) lathe__walk_fail(w, LATHE_ERR_FORMAT);
    return from;
}

/* Each vertex of an outline has one before it, so that following `next` leads back. */
static bool is_outline(lathe_draco_walk *w, uint32_t x) {
    const lathe_draco_part *part = &w->mesh->parts[w->part[x]];
    uint32_t next = w->next[x];
    if (w->half[x] < 0 || (uint32_t)w->half[x] / 2 >= part->height_count || next == LATHE_DRACO_NONE || w->before[x] == LATHE_DRACO_NONE ||
        w->before[next] != x || w->next[w->before[x]] != x)
        return lathe__walk_fail(w, w->truth ? LATHE_ERR_UNSUPPORTED : LATHE_ERR_FORMAT);
    return true;
}

static void walk_outline(lathe_draco_walk *w, uint32_t from) {
    uint32_t x = find_start(w, from), start = x;
    if (w->failure) return;
    outline_walk o = {.old = LATHE_DRACO_NONE, .height = w->mesh->parts[w->part[x]].heights[w->half[x] / 2] * LATHE_DRACO_ONE};
    w->c->value[1][x] = LATHE_SYMBOL_START;
    take_numbers(w, &o, x, expect(w, x, (place){w->start[0], w->start[1]}));
    w->start[0] = o.at.u, w->start[1] = o.at.v;
    o.step = (place){0, 0};
    for (x = w->next[x]; x != start && !w->failure; x = w->next[x]) take_next(w, &o, x);
}

/* ---- between slices ---- */

typedef struct candidate {
    place at;
    int64_t length;            /* by which they are sorted; CROSSING for those */
    uint32_t lower[2], upper[2]; /* the edges that cross */
} candidate;

typedef struct between {
    uint32_t count, candidate_count;
    uint32_t neighbour[MOST_NEIGHBOURS]; /* in slices */
    candidate candidate[MOST_CANDIDATES];
    int32_t height;
    uint64_t key;
} between;

static int32_t height_of(const lathe_draco_part *part, int32_t slice) {
    int32_t last = (int32_t)part->height_count - 1;
    return slice < 0 ? part->heights[0] - 1 : slice > last ? part->heights[last] + 1 : part->heights[slice];
}

static void gather(const lathe_draco_walk *w, uint32_t x, between *b) {
    uint64_t side[2] = {0, 0};
    uint32_t first = w->first[x], end = w->first[x + 1];
    for (uint32_t i = first; i < end && b->count < MOST_NEIGHBOURS; i++) {
        uint32_t corner = w->corner[i], y = w->c->triangles[corner - corner % 3 + (corner + 1) % 3];
        if (w->half[y] & 1) continue;
        b->neighbour[b->count++] = y;
        side[w->half[y] > w->half[x]]++;
    }
    b->key = (end - first < 15 ? end - first : 15) << 16 | side[0] << 8 | side[1];
    const lathe_draco_part *part = &w->mesh->parts[w->part[x]];
    int32_t slice = (w->half[x] - 1) / 2;
    b->height = (height_of(part, slice) + height_of(part, slice + 1)) * (LATHE_DRACO_ONE / 2);
}

static const int32_t *at_of(const lathe_draco_walk *w, uint32_t x) { return w->mesh->at[w->id[x]]; }

static void add_candidate(between *b, candidate c) {
    if (b->candidate_count == MOST_CANDIDATES) return;
    uint32_t i = b->candidate_count++;
    for (; i && b->candidate[i - 1].length > c.length; i--) b->candidate[i] = b->candidate[i - 1];
    b->candidate[i] = c;
}

/* Where edges of two outlines cross. Whole numbers below 2^53, then one division: all clients find the same. */
static void add_crossing(const lathe_draco_walk *w, between *b, const uint32_t *p, const uint32_t *q) {
    const int32_t *a = at_of(w, p[0]), *c = at_of(w, q[0]);
    double du = at_of(w, p[1])[0] - a[0], dv = at_of(w, p[1])[1] - a[1], eu = at_of(w, q[1])[0] - c[0], ev = at_of(w, q[1])[1] - c[1];
    double turn = du * ev - dv * eu, t = (c[0] - a[0]) * ev - (c[1] - a[1]) * eu;
    if (turn == 0) return;
    /* Within the edge, even where rounding has taken the crossing away. */
    t = t / turn < 0.0625 ? 0.0625 : t / turn > 0.9375 ? 0.9375 : t / turn;
    add_candidate(b, (candidate){.at = {(int32_t)floor(a[0] + du * t + 0.5), (int32_t)floor(a[1] + dv * t + 0.5)},
                                 .length = CROSSING, .lower = {p[0], p[1]}, .upper = {q[0], q[1]}});
}

static bool are_linked(const lathe_draco_walk *w, uint32_t a, uint32_t b) { return w->next[a] == b || w->next[b] == a; }

/* Crossings of edges of the lower and the upper outline, then middles of diagonals, the shortest first. */
static void list_candidates(const lathe_draco_walk *w, uint32_t x, between *b) {
    const uint32_t *n = b->neighbour;
    for (uint32_t i = 0; i < b->count; i++)
        for (uint32_t k = 0; k < b->count; k++) {
            if (w->half[n[i]] > w->half[x] || w->next[n[i]] != n[k]) continue;
            for (uint32_t p = 0; p < b->count; p++)
                for (uint32_t q = 0; q < b->count; q++)
                    if (w->half[n[p]] > w->half[x] && w->next[n[p]] == n[q])
                        add_crossing(w, b, (uint32_t[]){n[i], n[k]}, (uint32_t[]){n[p], n[q]});
        }
    for (uint32_t i = 0; i < b->count; i++)
        for (uint32_t k = i + 1; k < b->count; k++) {
            if (w->half[n[i]] != w->half[n[k]] || are_linked(w, n[i], n[k])) continue;
            const int32_t *p = at_of(w, n[i]), *q = at_of(w, n[k]);
            int64_t du = p[0] - q[0], dv = p[1] - q[1];
            add_candidate(b, (candidate){.at = {(p[0] + q[0]) >> 1, (p[1] + q[1]) >> 1}, .length = du * du + dv * dv});
        }
}

static int32_t candidate_of(int32_t value) { return value >> 10; }
static int32_t rise_of(int32_t value) { return (value & 1023) - 512; }

/* Writing: is a place near the edge of an outline, as it is without rounding? */
static bool is_beside(const lathe_draco_walk *w, place p, const uint32_t edge[2]) {
    const int32_t *a = w->truth->exact[edge[0]], *b = w->truth->exact[edge[1]];
    double du = b[0] - a[0], dv = b[1] - a[1], eu = (double)p.u * UNIT - a[0], ev = (double)p.v * UNIT - a[1], length = du * du + dv * dv;
    double t = length > 0 ? (eu * du + ev * dv) / length : 0;
    t = t < 0 ? 0 : t > 1 ? 1 : t;
    eu -= t * du, ev -= t * dv;
    return eu * eu + ev * ev <= (double)LATHE_DRACO_MIDDLE * LATHE_DRACO_MIDDLE;
}

/* Writing: outlines that nearly run along each other cross farther away when they move a little, but beside both. */
static bool is_good(const lathe_draco_walk *w, const between *b, uint32_t x, uint32_t i) {
    const candidate *c = &b->candidate[i];
    if (is_within(w, x, c->at, LATHE_DRACO_MIDDLE)) return true;
    return c->length == CROSSING && is_within(w, x, c->at, LATHE_DRACO_SLIDE) && is_beside(w, c->at, c->lower) && is_beside(w, c->at, c->upper);
}

/* Writing: the first value in the context that is right. */
static int32_t find_between(const lathe_draco_walk *w, const between *b, uint32_t x, int32_t rise, lathe_rank_cursor cursor) {
    int32_t value;
    for (int32_t rank = 0; lathe__rank_next(&cursor, &value); rank++)
        if ((uint32_t)candidate_of(value) < b->candidate_count && rise_of(value) == rise && is_good(w, b, x, (uint32_t)candidate_of(value)))
            return rank;
    return -1;
}

static void between_by_numbers(lathe_draco_walk *w, const between *b, uint32_t x, int32_t *rise, place *p, int32_t *value) {
    uint32_t choice = 0;
    place expected = expect(w, x, (place){w->start[0], w->start[1]});
    for (uint32_t i = 0; w->truth && !choice && i < b->candidate_count; i++)
        if (is_good(w, b, x, i)) choice = i + 1;
    choice = lathe__walk_number(w, choice);
    if (choice > b->candidate_count) { lathe__walk_fail(w, LATHE_ERR_FORMAT); return; }
    if (w->truth && !choice) *p = nearest_place(w, x);
    if (!choice) {
        int32_t du = lathe__walk_signed(w, p->u - expected.u), dv = lathe__walk_signed(w, p->v - expected.v);
        *p = (place){bounded(w, (int64_t)expected.u + du), bounded(w, (int64_t)expected.v + dv)};
    } else *p = b->candidate[choice - 1].at;
    *rise = lathe__walk_signed(w, *rise);
    bool ranked = choice && abs(*rise) <= MOST_RISE;
    *value = ranked ? (int32_t)(choice - 1) * 1024 + *rise + 512 : -1;
}

static void place_between(lathe_draco_walk *w, uint32_t x) {
    between b = {0};
    if (!w->mesh->parts[w->part[x]].height_count) { lathe__walk_fail(w, LATHE_ERR_FORMAT); return; }
    gather(w, x, &b);
    list_candidates(w, x, &b);
    int32_t rise = w->truth ? rounded(w->truth->exact[x][2]) - b.height : 0, *symbol = &w->c->value[1][x], value = -1;
    uint64_t key = b.key;
    place p = {0, 0};
    lathe_rank_cursor cursor = lathe__rank_cursor(&w->ranks, &key, 1);
    if (w->truth) {
        int32_t rank = find_between(w, &b, x, rise, cursor);
        *symbol = rank < 0 ? LATHE_SYMBOL_NUMBERS : LATHE_SYMBOL_RANK + rank;
    }
    if (*symbol >= LATHE_SYMBOL_RANK) {
        for (int32_t rank = *symbol - LATHE_SYMBOL_RANK; rank >= 0; rank--)
            if (!lathe__rank_next(&cursor, &value)) { lathe__walk_fail(w, LATHE_ERR_FORMAT); return; }
        if ((uint32_t)candidate_of(value) >= b.candidate_count) { lathe__walk_fail(w, LATHE_ERR_FORMAT); return; }
        p = b.candidate[candidate_of(value)].at;
        rise = rise_of(value);
    } else if (*symbol == LATHE_SYMBOL_NUMBERS) between_by_numbers(w, &b, x, &rise, &p, &value);
    else lathe__walk_fail(w, LATHE_ERR_FORMAT);
    if (!w->failure) add_vertex(w, x, p, bounded(w, (int64_t)b.height + rise));
    lathe_status status = value >= 0 && !w->failure ? lathe__rank_seen(&w->ranks, &key, 1, value) : LATHE_OK;
    if (status) lathe__walk_fail(w, status);
}

void lathe__walk_places(lathe_draco_walk *w) {
    uint32_t n = w->c->vertex_count;
    for (uint32_t x = 0; x < n && !w->failure; x++)
        if (!(w->half[x] & 1)) is_outline(w, x);
    for (uint32_t x = 0; x < n && !w->failure; x++)
        if (!(w->half[x] & 1) && w->id[x] == LATHE_DRACO_NONE) walk_outline(w, x);
    for (uint32_t x = 0; x < n && !w->failure; x++)
        if (w->half[x] & 1) place_between(w, x);
}
