/* Where the vertices between slices lie: where two outlines cross or in the middle of a diagonal, or of a raster's surface over a sample:
 * all of these the client finds by itself. */
#include "draco_place.h"
#include <math.h>
#include <stdlib.h>

enum { UNIT = LATHE_LATTICE_ONE / LATHE_DRACO_ONE, MOST_NEIGHBOURS = 16, MOST_CANDIDATES = 16, MOST_RISE = 511, CROSSING = -1 };
typedef lathe_draco_place place;

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
    return slice < 0 ? part->heights[0] - 2 : slice > last ? part->heights[last] + 2 : part->heights[slice];
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
    b->height = (height_of(part, slice) + height_of(part, slice + 1)) * (LATHE_DRACO_HEIGHT / 2);
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
    /* Within the edge, even where rounding has taken the crossing away; side by side: somewhere. */
    t = turn == 0 ? 0.5 : t / turn < 0.0625 ? 0.0625 : t / turn > 0.9375 ? 0.9375 : t / turn;
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

typedef struct lines { uint32_t count[2]; int32_t at[2][2 * MOST_NEIGHBOURS], near[2][2 * MOST_NEIGHBOURS]; } lines;

static void add_lines(lines *l, const int32_t at[2]) {
    for (int k = 0; k < 2; k++) {
        uint32_t i = 0;
        while (i < l->count[k] && l->at[k][i] != at[k]) i++;
        if (i == l->count[k]) l->at[k][i] = at[k], l->near[k][l->count[k]++] = 0;
        l->near[k][i]++;
    }
}

/* Over a sample run two lines on which neighbours lie, too, or fourth corners of parallelograms of such vertices: the more do, the likelier it is. */
static void list_samples(const lathe_draco_walk *w, uint32_t x, between *b) {
    lines l = {{0, 0}, {{0}}, {{0}}};
    const uint32_t *corners = w->c->triangles;
    for (uint32_t i = w->first[x]; i < w->first[x + 1] && i < w->first[x] + MOST_NEIGHBOURS; i++) {
        uint32_t base = w->corner[i] - w->corner[i] % 3, next = base + (w->corner[i] + 1) % 3, y = corners[next], z = corners[base + (w->corner[i] + 2) % 3];
        uint32_t beyond = w->twin[next], far = corners[beyond - beyond % 3 + (beyond + 2) % 3];
        if (w->id[y] == LATHE_DRACO_NONE) continue;
        add_lines(&l, at_of(w, y));
        if (!(w->half[y] & w->half[z] & w->half[far] & 1) || w->id[z] == LATHE_DRACO_NONE || w->id[far] == LATHE_DRACO_NONE) continue;
        const int32_t *p = at_of(w, y), *q = at_of(w, z), *r = at_of(w, far);
        add_lines(&l, (int32_t[]){p[0] + q[0] - r[0], p[1] + q[1] - r[1]});
    }
    for (uint32_t i = 0; i < l.count[0]; i++)
        for (uint32_t k = 0; k < l.count[1]; k++) {
            candidate c = {.at = {l.at[0][i], l.at[1][k]}, .length = -l.near[0][i] - l.near[1][k]};
            bool full = b->candidate_count == MOST_CANDIDATES;
            if (full && b->candidate[MOST_CANDIDATES - 1].length <= c.length) continue;
            b->candidate_count -= full;
            add_candidate(b, c);
        }
}

static int32_t candidate_of(int32_t value) { return value >> 10; }
static int32_t rise_of(int32_t value) { return (value & 1023) - 512; }

/* Writing: between rings, whose vertices may be farther from their places, twice as much. */
static int64_t tolerance_of(const lathe_draco_walk *w, uint32_t x) { return LATHE_DRACO_MIDDLE << (w->mesh->parts[w->part[x]].form.count > 0); }

static int64_t slide_of(const lathe_draco_walk *w, uint32_t x) { return LATHE_DRACO_SLIDE << (w->mesh->parts[w->part[x]].form.count ? 3 : 0); }

/* Writing: is a place near the edge of an outline, as it is without rounding? */
static bool is_beside(const lathe_draco_walk *w, place p, const uint32_t edge[2]) {
    const int32_t *a = w->truth->exact[edge[0]], *b = w->truth->exact[edge[1]];
    double du = b[0] - a[0], dv = b[1] - a[1], eu = (double)p.u * UNIT - a[0], ev = (double)p.v * UNIT - a[1], length = du * du + dv * dv;
    double t = length > 0 ? (eu * du + ev * dv) / length : 0;
    t = t < 0 ? 0 : t > 1 ? 1 : t;
    eu -= t * du, ev -= t * dv;
    double most = (double)tolerance_of(w, edge[0]) * lathe__walk_grain(w, edge[0]);
    return eu * eu + ev * ev <= most * most;
}

/* Writing: outlines that nearly run along each other cross farther away when they move a little, but beside both. */
static bool is_good(const lathe_draco_walk *w, const between *b, uint32_t x, uint32_t i) {
    const candidate *c = &b->candidate[i];
    if (lathe__place_within(w, x, c->at, tolerance_of(w, x))) return true;
    return c->length == CROSSING && lathe__place_within(w, x, c->at, slide_of(w, x)) && is_beside(w, c->at, c->lower) && is_beside(w, c->at, c->upper);
}

/* Writing: the first value in the context that is right. */
static int32_t find_between(const lathe_draco_walk *w, const between *b, uint32_t x, int32_t rise, lathe_rank_cursor cursor) {
    int32_t value;
    for (int32_t rank = 0; lathe__rank_next(&cursor, &value); rank++)
        if ((uint32_t)candidate_of(value) < b->candidate_count && rise_of(value) == rise && is_good(w, b, x, (uint32_t)candidate_of(value)))
            return rank;
    return -1;
}

/* The apex of a radius map's cap is over a centre. */
static place expect(const lathe_draco_walk *w, uint32_t x) {
    const lathe_draco_part *part = &w->mesh->parts[w->part[x]];
    const lathe_draco_tube *tube = part->rings.tubes;
    if (part->form.count != 1 || !tube->rows) return lathe__place_expected(w, x, (place){w->start[0], w->start[1]});
    const int32_t *centre = tube->centre[w->half[x] < 0 ? 0 : tube->rows - 1];
    return (place){centre[0] * (LATHE_DRACO_ONE / 2), centre[1] * (LATHE_DRACO_ONE / 2)};
}

static void between_by_numbers(lathe_draco_walk *w, const between *b, uint32_t x, int32_t *rise, place *p, int32_t *value) {
    uint32_t choice = 0;
    place expected = expect(w, x);
    for (uint32_t i = 0; w->truth && !choice && i < b->candidate_count; i++)
        if (is_good(w, b, x, i)) choice = i + 1;
    choice = lathe__walk_number(w, choice);
    if (choice > b->candidate_count) { lathe__walk_fail(w, LATHE_ERR_FORMAT); return; }
    *p = choice ? b->candidate[choice - 1].at : lathe__place_by_numbers(w, x, expected);
    *rise = lathe__walk_signed(w, *rise);
    bool ranked = choice && abs(*rise) <= MOST_RISE;
    *value = ranked ? (int32_t)(choice - 1) * 1024 + *rise + 512 : -1;
}

void lathe__place_between(lathe_draco_walk *w, uint32_t x) {
    between b = {0};
    if (!w->mesh->parts[w->part[x]].height_count) { lathe__walk_fail(w, LATHE_ERR_FORMAT); return; }
    gather(w, x, &b);
    if (w->mesh->parts[w->part[x]].samples) list_samples(w, x, &b);
    else list_candidates(w, x, &b);
    int32_t grain = lathe__walk_grain(w, x), *symbol = &w->c->value[1][x], value = -1;
    int32_t rise = w->truth ? (int32_t)lround((double)(w->truth->exact[x][2] - b.height * UNIT) / (grain * UNIT)) : 0;
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
    if (!w->failure) lathe__walk_add(w, x, p.u, p.v, lathe__walk_bounded(w, b.height + (int64_t)rise * grain));
    lathe_status status = value >= 0 && !w->failure ? lathe__rank_seen(&w->ranks, &key, 1, value) : LATHE_OK;
    if (status) lathe__walk_fail(w, status);
}

