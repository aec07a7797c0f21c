/* Where the vertices of a delta's outlines lie. They are walked from vertex to vertex: the next one is the next of the old outline,
 * where it was or moved a little, or a new one a step on; which, depends on the step before and on where the next old vertex waits. */
#include "draco_place.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { UNIT = LATHE_LATTICE_ONE / LATHE_DRACO_ONE, MOST_SKIPPED = 4, NEAR = 24, FAR = 100, NOWHERE = 99, MOST_NEIGHBOURS = 16,
       MOVE_SIDE = 128 };
#define OLD_VERTEX INT32_MIN /* and how many of the old outline are skipped, and how it moves */
#define MOST_WORK ((uint64_t)1 << 32)

typedef lathe_draco_place place;

bool lathe__place_within(const lathe_draco_walk *w, uint32_t x, place p, int64_t tolerance) {
    int64_t du = (int64_t)p.u * UNIT - w->truth->exact[x][0], dv = (int64_t)p.v * UNIT - w->truth->exact[x][1];
    tolerance *= lathe__walk_grain(w, x);
    return du * du + dv * dv <= tolerance * tolerance;
}
static bool is_near(const lathe_draco_walk *w, uint32_t x, place p) { return lathe__place_within(w, x, p, LATHE_DRACO_TOLERANCE); }

/* A multiple of the grain from a place on. */
place lathe__place_nearest(const lathe_draco_walk *w, uint32_t x, place from) {
    int32_t grain = lathe__walk_grain(w, x);
    return (place){from.u + grain * (int32_t)lround((double)(w->truth->exact[x][0] - from.u * UNIT) / (grain * UNIT)),
                   from.v + grain * (int32_t)lround((double)(w->truth->exact[x][1] - from.v * UNIT) / (grain * UNIT))};
}

/* A sum that hostile numbers may drive out of the range of coordinates. */
int32_t lathe__walk_bounded(lathe_draco_walk *w, int64_t v) {
    if (v >= -(1 << 20) && v <= 1 << 20) return (int32_t)v;
    lathe__walk_fail(w, LATHE_ERR_FORMAT);
    return 0;
}

place lathe__place_by_numbers(lathe_draco_walk *w, uint32_t x, place from) {
    place p = w->truth ? lathe__place_nearest(w, x, from) : from;
    int64_t grain = lathe__walk_grain(w, x);
    int32_t du = lathe__walk_signed(w, (int32_t)((p.u - from.u) / grain)), dv = lathe__walk_signed(w, (int32_t)((p.v - from.v) / grain));
    return (place){lathe__walk_bounded(w, from.u + du * grain), lathe__walk_bounded(w, from.v + dv * grain)};
}

static place old_place(const lathe_draco_walk *w, uint32_t id) { return (place){w->mesh->at[id][0], w->mesh->at[id][1]}; }

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
    int32_t height = part->heights[w->half[x] / 2] * LATHE_DRACO_HEIGHT;
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
    place at, step;            /* of the latest vertex; how it was reached, in grains */
    int32_t height, grain;
} outline_walk;

static void keys_of(const lathe_draco_walk *w, const outline_walk *o, uint64_t keys[3]) {
    int32_t wait[2] = {NOWHERE, NOWHERE};
    uint32_t next = o->old == LATHE_DRACO_NONE ? LATHE_DRACO_NONE : w->mesh->next[o->old];
    if (next != LATHE_DRACO_NONE) {
        int32_t du = (w->mesh->at[next][0] - o->at.u) / o->grain, dv = (w->mesh->at[next][1] - o->at.v) / o->grain;
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

static bool is_old(int32_t value) { return value < OLD_VERTEX + MOST_SKIPPED * MOVE_SIDE * MOVE_SIDE; }
static uint32_t old_of(const lathe_draco_walk *w, const outline_walk *o, int32_t value) {
    return skip(w, o->old, (value - OLD_VERTEX) % MOST_SKIPPED);
}
/* Where a value leads: old is the vertex that it stands for, or NONE. */
static place place_of(const lathe_draco_walk *w, const outline_walk *o, uint32_t old, int32_t value) {
    int32_t g = o->grain;
    if (!is_old(value)) return (place){o->at.u + (value >> 16) * g, o->at.v + (int16_t)(value & 0xffff) * g};
    uint32_t move = (uint32_t)(value - OLD_VERTEX) / MOST_SKIPPED;
    return (place){w->mesh->at[old][0] + lathe__unzigzag(move % MOVE_SIDE) * g, w->mesh->at[old][1] + lathe__unzigzag(move / MOVE_SIDE) * g};
}
static bool has_value(place step) { return abs(step.u) < 32767 && abs(step.v) < 32767; }
static int32_t value_of(place step) { return (int32_t)((uint32_t)step.u << 16 | (uint16_t)step.v); }
static bool is_move(place move) { return lathe__zigzag(move.u) < MOVE_SIDE && lathe__zigzag(move.v) < MOVE_SIDE; }
static int32_t value_of_old(int32_t skipped, place move) {
    return OLD_VERTEX + skipped + MOST_SKIPPED * (int32_t)(lathe__zigzag(move.u) + MOVE_SIDE * lathe__zigzag(move.v));
}

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

/* The first value that ends near enough: a step, if old is NONE, or a move of that vertex. */
static int32_t find_value(const lathe_draco_walk *w, const outline_walk *o, uint32_t x, uint32_t old, lathe_rank_cursor cursor, int32_t *value) {
    for (int32_t rank = 0; lathe__rank_next(&cursor, value); rank++) {
        if (is_old(*value) != (old != LATHE_DRACO_NONE) || (is_old(*value) && old_of(w, o, *value) != old)) continue;
        if (is_near(w, x, place_of(w, o, old, *value))) return rank;
    }
    return -1;
}

static void take(lathe_draco_walk *w, outline_walk *o, uint32_t x, uint32_t old, place p) {
    p = (place){lathe__walk_bounded(w, p.u), lathe__walk_bounded(w, p.v)};
    if (old != LATHE_DRACO_NONE) {
        w->id[x] = o->old = old;
        if (w->used[old]) lathe__walk_fail(w, LATHE_ERR_FORMAT);
        w->used[old] = 1;
        w->mesh->at[old][0] = p.u, w->mesh->at[old][1] = p.v;
    } else lathe__walk_add(w, x, p.u, p.v, o->height);
    o->step = (place){(p.u - o->at.u) / o->grain, (p.v - o->at.v) / o->grain};
    o->at = p;
}

/* Small differences as one symbol, in shells around zero. */
static bool is_pair(place d) { return lathe__zigzag(d.u) < LATHE_PAIR_SIDE && lathe__zigzag(d.v) < LATHE_PAIR_SIDE; }
static int32_t pair_of(place d) {
    uint32_t a = lathe__zigzag(d.u), b = lathe__zigzag(d.v);
    return (int32_t)(a >= b ? a * a + a + b : b * b + a);
}
static place of_pair(int32_t pair) {
    int32_t side = 0;
    while ((side + 1) * (side + 1) <= pair) side++;
    int32_t rest = pair - side * side;
    return rest < side ? (place){lathe__unzigzag((uint32_t)rest), lathe__unzigzag((uint32_t)side)} : (place){lathe__unzigzag((uint32_t)side), lathe__unzigzag((uint32_t)(rest - side))};
}

/* Writing: the old vertex that x is, if it is one; it may have to move. */
static uint32_t find_old(lathe_draco_walk *w, uint32_t x) {
    uint32_t old = match(w, x);
    if (old != LATHE_DRACO_NONE) return old;
    old = w->partner ? w->partner[x] : LATHE_DRACO_NONE;
    return old == LATHE_DRACO_NONE || w->used[old] ? LATHE_DRACO_NONE : old;
}

/* A vertex by numbers: a form, and what follows it. */
enum { FORM_NEW, FORM_OLD, FORM_RANK, FORM_PAIR = FORM_RANK + LATHE_RANK_MOST, MOST_RANK = 64 };
static const uint64_t NUMBERS_KEY = (uint64_t)3 << 62 | 1;

/* Which old vertex by its distance, and how it moves; -1: more than a value can hold. */
static int32_t value_of_rank(uint32_t rank, place move) {
    if (rank >= MOST_RANK || !is_move(move)) return -1;
    return (int32_t)(rank + MOST_RANK * (lathe__zigzag(move.u) + MOVE_SIDE * lathe__zigzag(move.v)));
}

static void take_old_by_numbers(lathe_draco_walk *w, outline_walk *o, uint32_t x, uint32_t form, uint32_t rank, place expected, place *move) {
    lathe_rank_cursor cursor = lathe__rank_cursor(&w->ranks, &NUMBERS_KEY, 1);
    int32_t value = -1;
    if (form == FORM_OLD) {
        rank = lathe__walk_number(w, rank);
        move->u = lathe__walk_signed(w, move->u);
        move->v = lathe__walk_signed(w, move->v);
        value = value_of_rank(rank, *move);
    } else {
        for (uint32_t i = FORM_RANK; i <= form; i++)
            if (!lathe__rank_next(&cursor, &value)) { lathe__walk_fail(w, LATHE_ERR_FORMAT); return; }
        rank = (uint32_t)value % MOST_RANK;
        uint32_t m = (uint32_t)value / MOST_RANK;
        *move = (place){lathe__unzigzag(m % MOVE_SIDE), lathe__unzigzag(m / MOVE_SIDE)};
    }
    uint32_t old = of_rank(w, x, rank, expected);
    if (w->failure) return;
    place p = old_place(w, old);
    p.u = lathe__walk_bounded(w, p.u + (int64_t)move->u * o->grain);
    p.v = lathe__walk_bounded(w, p.v + (int64_t)move->v * o->grain);
    take(w, o, x, old, p);
    lathe_status status = value < 0 ? LATHE_OK : lathe__rank_seen(&w->ranks, &NUMBERS_KEY, 1, value);
    if (status) lathe__walk_fail(w, status);
}

static void take_numbers(lathe_draco_walk *w, outline_walk *o, uint32_t x, place expected, place *move) {
    uint32_t old = w->truth ? find_old(w, x) : LATHE_DRACO_NONE, form = FORM_NEW, rank = 0;
    *move = (place){0, 0};
    if (old != LATHE_DRACO_NONE) {
        place from = old_place(w, old), p = is_near(w, x, from) ? from : lathe__place_nearest(w, x, from);
        *move = (place){(p.u - from.u) / o->grain, (p.v - from.v) / o->grain};
        rank = rank_of(w, x, old, expected);
        int32_t found = find_rank(lathe__rank_cursor(&w->ranks, &NUMBERS_KEY, 1), value_of_rank(rank, *move));
        form = found < 0 ? FORM_OLD : FORM_RANK + (uint32_t)found;
    } else if (w->truth) {
        place p = lathe__place_nearest(w, x, expected), d = {(p.u - expected.u) / o->grain, (p.v - expected.v) / o->grain};
        if (is_pair(d)) form = FORM_PAIR + (uint32_t)pair_of(d);
    }
    form = lathe__walk_number(w, form);
    if (form >= FORM_PAIR + LATHE_PAIR_SIDE * LATHE_PAIR_SIDE) lathe__walk_fail(w, LATHE_ERR_FORMAT);
    if (w->failure) return;
    if (form == FORM_NEW) take(w, o, x, LATHE_DRACO_NONE, lathe__place_by_numbers(w, x, expected));
    else if (form >= FORM_PAIR) {
        place d = of_pair((int32_t)form - FORM_PAIR);
        take(w, o, x, LATHE_DRACO_NONE, (place){expected.u + d.u * o->grain, expected.v + d.v * o->grain});
    } else take_old_by_numbers(w, o, x, form, rank, expected, move);
}

/* Writing: symbol and value of the next vertex. */
static int32_t choose_symbol(lathe_draco_walk *w, const outline_walk *o, uint32_t x, place expected, lathe_rank_cursor cursor, int32_t *value) {
    int32_t rank = -1;
    if (choose_old(w, o, x, value)) rank = find_rank(cursor, *value);
    else {
        uint32_t old = find_old(w, x);
        rank = find_value(w, o, x, old, cursor, value);
        place p = lathe__place_nearest(w, x, expected), d = {(p.u - expected.u) / o->grain, (p.v - expected.v) / o->grain};
        if (rank < 0 && old == LATHE_DRACO_NONE && is_pair(d)) return LATHE_SYMBOL_PAIR + pair_of(d);
    }
    return rank < 0 ? LATHE_SYMBOL_NUMBERS : LATHE_SYMBOL_RANK + rank;
}

static bool take_rank(lathe_draco_walk *w, outline_walk *o, uint32_t x, lathe_rank_cursor cursor, int32_t rank, int32_t *value) {
    for (; rank >= 0; rank--)
        if (!lathe__rank_next(&cursor, value)) return lathe__walk_fail(w, LATHE_ERR_FORMAT);
    uint32_t old = is_old(*value) ? old_of(w, o, *value) : LATHE_DRACO_NONE;
    if (is_old(*value) && old == LATHE_DRACO_NONE) return lathe__walk_fail(w, LATHE_ERR_FORMAT);
    take(w, o, x, old, place_of(w, o, old, *value));
    return true;
}

/* The value is good if the vertex could have been told by it. */
static bool take_symbol(lathe_draco_walk *w, outline_walk *o, uint32_t x, place expected, lathe_rank_cursor cursor, int32_t *value) {
    int32_t symbol = w->c->value[1][x];
    if (symbol >= LATHE_SYMBOL_PAIR + LATHE_PAIR_SIDE * LATHE_PAIR_SIDE || symbol < LATHE_SYMBOL_NUMBERS) return lathe__walk_fail(w, LATHE_ERR_FORMAT);
    if (symbol >= LATHE_SYMBOL_RANK && symbol < LATHE_SYMBOL_PAIR) return take_rank(w, o, x, cursor, symbol - LATHE_SYMBOL_RANK, value);
    uint32_t before = o->old;
    place move;
    if (symbol >= LATHE_SYMBOL_PAIR) {
        place d = of_pair(symbol - LATHE_SYMBOL_PAIR);
        take(w, o, x, LATHE_DRACO_NONE, (place){expected.u + d.u * o->grain, expected.v + d.v * o->grain});
    } else take_numbers(w, o, x, expected, &move);
    if (w->failure) return false;
    if (w->id[x] != o->old) {
        *value = value_of(o->step);
        return has_value(o->step);
    }
    for (int32_t k = 0; before != LATHE_DRACO_NONE && k < MOST_SKIPPED; k++)
        if (skip(w, before, k) == w->id[x] && is_move(move)) {
            *value = value_of_old(k, move);
            return true;
        }
    return false;
}

static void take_next(lathe_draco_walk *w, outline_walk *o, uint32_t x) {
    uint64_t keys[3];
    keys_of(w, o, keys);
    lathe_rank_cursor cursor = lathe__rank_cursor(&w->ranks, keys, 3);
    place expected = {o->at.u + o->step.u * o->grain, o->at.v + o->step.v * o->grain};
    int32_t value = 0;
    if (w->truth) w->c->value[1][x] = choose_symbol(w, o, x, expected, cursor, &value);
    bool ranked = take_symbol(w, o, x, expected, cursor, &value);
    if (w->failure || !ranked) return;
    lathe_status status = lathe__rank_seen(&w->ranks, keys, 3, value);
    if (status) lathe__walk_fail(w, status);
}

/* The mean of a vertex's neighbours that have their places, at most MOST_NEIGHBOURS of them. */
place lathe__place_expected(const lathe_draco_walk *w, uint32_t x, place otherwise) {
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
        if (w->truth ? find_old(w, x) != LATHE_DRACO_NONE : w->c->value[1][x] == LATHE_SYMBOL_START) return x;
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
    outline_walk o = {.old = LATHE_DRACO_NONE, .height = w->mesh->parts[w->part[x]].heights[w->half[x] / 2] * LATHE_DRACO_HEIGHT,
                      .grain = lathe__walk_grain(w, x)};
    place move;
    w->c->value[1][x] = LATHE_SYMBOL_START;
    take_numbers(w, &o, x, lathe__place_expected(w, x, (place){w->start[0], w->start[1]}), &move);
    w->start[0] = o.at.u, w->start[1] = o.at.v;
    o.step = (place){0, 0};
    for (x = w->next[x]; x != start && !w->failure; x = w->next[x]) take_next(w, &o, x);
}

void lathe__walk_places(lathe_draco_walk *w) {
    uint32_t n = w->c->vertex_count;
    for (uint32_t x = 0; x < n && !w->failure; x++)
        if (!(w->half[x] & 1)) is_outline(w, x);
    if (!w->failure) lathe__walk_rings(w);
    if (!w->failure && w->truth) lathe__walk_find_partners(w);
    for (uint32_t x = 0; x < n && !w->failure; x++)
        if (!(w->half[x] & 1) && w->id[x] == LATHE_DRACO_NONE) walk_outline(w, x);
    for (uint32_t x = 0; x < n && !w->failure; x++)
        if (w->half[x] & 1) lathe__place_between(w, x);
}
