#include "closing.h"
#include "grid.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { NONE = 0xffffffffu, MOST_EARS = 20000, MOST_BRIDGES = 1 << 18, MOST_TESTS = 1 << 14, MOST_ISLANDS = 256 };

lathe_status lathe__add_triangle(lathe_triangles *list, lathe_arena *arena, uint32_t a, uint32_t b, uint32_t c) {
    if (list->count == list->capacity) {
        uint32_t capacity = list->capacity * 2 + 64;
        uint32_t(*more)[3] = lathe__arena_alloc(arena, capacity, sizeof *more);
        if (!more) return LATHE_ERR_MEMORY;
        if (list->count) memcpy(more, list->at, list->count * sizeof *more);
        list->at = more;
        list->capacity = capacity;
    }
    uint32_t *t = list->at[list->count++];
    t[0] = a, t[1] = b, t[2] = c;
    return LATHE_OK;
}

bool lathe__polygon_holds(const lathe_point *at, const uint32_t *nodes, uint32_t count, lathe_point p) {
    bool odd = false;
    for (uint32_t i = 0, j = count - 1; i < count; j = i++) {
        lathe_point a = at[nodes[j]], b = at[nodes[i]];
        bool up = b.y > p.y;
        if ((a.y > p.y) != up && lathe__orient(up ? a : b, up ? b : a, p) > 0) odd = !odd;
    }
    return odd;
}

static bool ranges_apart(int32_t a, int32_t b, int32_t c, int32_t d) {
    int32_t low = a < b ? a : b, high = a < b ? b : a;
    return (c < low && d < low) || (c > high && d > high);
}

bool lathe__edges_meet(lathe_point a, lathe_point b, lathe_point c, lathe_point d) {
    if (ranges_apart(a.x, b.x, c.x, d.x) || ranges_apart(a.y, b.y, c.y, d.y)) return false;
    return lathe__segments_meet((const lathe_point[]){a, b, c, d}, 0, 1, 2, 3);
}

static double length_of(lathe_point a, lathe_point b) { return hypot((double)a.x - b.x, (double)a.y - b.y); }

static bool equal(lathe_point a, lathe_point b) { return a.x == b.x && a.y == b.y; }

/* ---- simple contour closing ---- */

enum { VALID = NONE, BENT = NONE - 1 };   /* of a blocker: none; the place does not turn left */

typedef struct ears {
    lathe_point *at;           /* place -> position */
    uint32_t *next, *prev;     /* the polygon that is left; prev of a cut place is NONE */
    uint32_t *blocker;         /* place -> a place that lies in its triangle */
    double *cost;              /* CV_i */
} ears;

static uint32_t find_blocker(const ears *e, uint32_t place) {
    lathe_point p = e->at[e->prev[place]], q = e->at[place], n = e->at[e->next[place]];
    if (lathe__orient(p, q, n) <= 0) return BENT;
    lathe_range box = lathe__range_of(p, q);
    lathe__range_add(&box, n.x, n.y);
    for (uint32_t i = e->next[e->next[place]]; i != e->prev[place]; i = e->next[i]) {
        lathe_point r = e->at[i];
        if (r.x < box.x0 || r.x > box.x1 || r.y < box.y0 || r.y > box.y1 || equal(r, p) || equal(r, q) || equal(r, n))
            continue;
        if (lathe__orient(p, q, r) >= 0 && lathe__orient(q, n, r) >= 0 && lathe__orient(n, p, r) >= 0) return i;
    }
    return VALID;
}

static void price(ears *e, uint32_t place) {
    e->cost[place] = length_of(e->at[e->prev[place]], e->at[e->next[place]]);
    e->blocker[place] = find_blocker(e, place);
}

/* The cheapest valid place, or NONE. Places whose blocker has been cut are looked at again. */
static uint32_t cheapest(ears *e, uint32_t start) {
    uint32_t best = NONE, place = start;
    do {
        uint32_t b = e->blocker[place];
        if (b < BENT && e->prev[b] == NONE) e->blocker[place] = find_blocker(e, place);
        if (e->blocker[place] == VALID && (best == NONE || e->cost[place] < e->cost[best])) best = place;
        place = e->next[place];
    } while (place != start);
    return best;
}

/* What ear cutting cannot do. */
static lathe_status triangulate(lathe_triangles *list, lathe_arena *arena, const lathe_polygon *polygon) {
    uint32_t(*t)[3], *neighbour, count;
    lathe_status status = lathe__triangulate(&t, &neighbour, &count, arena, polygon);
    for (uint32_t i = 0; !status && i < count; i++)
        status = lathe__add_triangle(list, arena, t[i][0], t[i][1], t[i][2]);
    return status;
}

lathe_status lathe__close_polygon(lathe_triangles *list, lathe_arena *arena, const lathe_point *at,
                                  const uint32_t *nodes, uint32_t count) {
    if (count < 3) return LATHE_ERR_RANGE;
    uint32_t left = count, start = 0, *rest = LATHE_NEW(arena, uint32_t, count);
    ears e = {LATHE_NEW(arena, lathe_point, count), LATHE_NEW(arena, uint32_t, count),
              LATHE_NEW(arena, uint32_t, count), LATHE_NEW(arena, uint32_t, count), LATHE_NEW(arena, double, count)};
    if (!rest || !e.at || !e.next || !e.prev || !e.blocker || !e.cost) return LATHE_ERR_MEMORY;
    for (uint32_t i = 0; i < count; i++) {
        e.at[i] = at[nodes[i]];
        e.next[i] = i + 1 < count ? i + 1 : 0;
        e.prev[i] = i ? i - 1 : count - 1;
    }
    for (uint32_t i = 0; i < count && count <= MOST_EARS; i++) price(&e, i);
    while (left > 3 && count <= MOST_EARS) {
        uint32_t place = cheapest(&e, start);
        if (place == NONE) break;
        uint32_t p = e.prev[place], n = e.next[place];
        lathe_status status = lathe__add_triangle(list, arena, nodes[p], nodes[place], nodes[n]);
        if (status) return status;
        e.next[p] = n;
        e.prev[n] = p;
        e.prev[place] = NONE;
        left--;
        start = n;
        price(&e, p);
        price(&e, n);
    }
    for (uint32_t i = 0, place = start; i < left; i++, place = e.next[place]) rest[i] = nodes[place];
    if (left == 3) return lathe__add_triangle(list, arena, rest[0], rest[1], rest[2]);
    lathe_polygon polygon = {.at = at, .nodes = rest, .ring_end = &left, .ring_count = 1};
    return triangulate(list, arena, &polygon);
}

/* ---- with islands ---- */

typedef struct bridge {
    double length;
    uint32_t from, ring, to;   /* place of ring 0; ring and place of an island */
    bool free;
} bridge;

typedef struct region {
    const lathe_point *at;
    uint32_t **ring;           /* ring 0 the polygon, then islands: nodes */
    uint32_t *count;
    uint32_t rings;
} region;

static int compare_bridges(const void *a, const void *b) {
    const bridge *p = a, *q = b;
    if (p->length != q->length) return p->length < q->length ? -1 : 1;
    if (p->from != q->from) return p->from < q->from ? -1 : 1;
    if (p->ring != q->ring) return p->ring < q->ring ? -1 : 1;
    return (p->to > q->to) - (p->to < q->to);
}

static lathe_point corner(const region *r, uint32_t ring, uint32_t place) {
    return r->at[r->ring[ring][place % r->count[ring]]];
}

/* Does the way from a place to a point start inside the region? */
static bool in_cone(const region *r, uint32_t ring, uint32_t place, lathe_point to) {
    uint32_t n = r->count[ring];
    lathe_point p = corner(r, ring, place + n - 1), q = corner(r, ring, place), s = corner(r, ring, place + 1);
    int64_t a = lathe__orient(q, s, to), b = lathe__orient(p, q, to);
    return lathe__orient(p, q, s) > 0 ? a > 0 && b > 0 : a > 0 || b > 0;
}

static bool is_free(const region *r, const bridge *b) {
    lathe_point s[4] = {corner(r, 0, b->from), corner(r, b->ring, b->to)};
    if (!in_cone(r, 0, b->from, s[1]) || !in_cone(r, b->ring, b->to, s[0])) return false;
    for (uint32_t k = 0; k < r->rings; k++)
        for (uint32_t i = 0; i < r->count[k]; i++) {
            s[2] = corner(r, k, i), s[3] = corner(r, k, i + 1);
            if (equal(s[2], s[0]) || equal(s[3], s[0]) || equal(s[2], s[1]) || equal(s[3], s[1])) continue;
            if (lathe__edges_meet(s[0], s[1], s[2], s[3])) return false;
        }
    return true;
}

static bool pair_crosses(const region *r, const bridge *a, const bridge *b) {
    lathe_point s[4] = {corner(r, 0, a->from), corner(r, a->ring, a->to), corner(r, 0, b->from),
                        corner(r, b->ring, b->to)};
    return equal(s[0], s[2]) || equal(s[1], s[3]) || lathe__edges_meet(s[0], s[1], s[2], s[3]);
}

/* The pair of free bridges of least total length to any one island; false: none found. */
static lathe_status best_pair(bridge pair[2], bool *found, lathe_arena *arena, const region *r) {
    size_t n = 0, bridges = 0;
    for (uint32_t k = 1; k < r->rings; k++) bridges += (size_t)r->count[0] * r->count[k];
    *found = false;
    if (bridges > MOST_BRIDGES) return LATHE_OK;
    bridge *all = LATHE_NEW(arena, bridge, bridges);
    if (!all) return LATHE_ERR_MEMORY;
    for (uint32_t k = 1; k < r->rings; k++)
        for (uint32_t i = 0; i < r->count[0]; i++)
            for (uint32_t j = 0; j < r->count[k]; j++)
                all[n++] = (bridge){length_of(corner(r, 0, i), corner(r, k, j)), i, k, j, false};
    qsort(all, n, sizeof *all, compare_bridges);
    double best = INFINITY, shortest = -1;
    for (size_t j = 0, tests = 0; j < n && tests < MOST_TESTS && (shortest < 0 || all[j].length + shortest < best);
         j++, tests++) {
        all[j].free = is_free(r, &all[j]);
        if (!all[j].free) continue;
        if (shortest < 0) shortest = all[j].length;
        for (size_t i = 0; i < j && all[i].length + all[j].length < best; i++) {
            if (!all[i].free || all[i].ring != all[j].ring || pair_crosses(r, &all[i], &all[j])) continue;
            best = all[i].length + all[j].length;
            pair[0] = all[i];
            pair[1] = all[j];
            *found = true;
        }
    }
    return LATHE_OK;
}

/* Nodes of ring from place a to place b, both included, behind what is in out. */
static uint32_t copy_chain(uint32_t *out, uint32_t used, const region *r, uint32_t ring, uint32_t a, uint32_t b) {
    uint32_t n = r->count[ring];
    for (;; a = a + 1 < n ? a + 1 : 0) {
        out[used++] = r->ring[ring][a];
        if (a == b) return used;
    }
}

/* The polygon from bridge a on around to bridge b, back along the island; with the islands that lie in it. */
static lathe_status split(region *out, lathe_arena *arena, const region *r, const bridge *a, const bridge *b) {
    *out = (region){.at = r->at,
                    .ring = LATHE_NEW(arena, uint32_t *, r->rings),
                    .count = LATHE_NEW(arena, uint32_t, r->rings),
                    .rings = 1};
    uint32_t *nodes = LATHE_NEW(arena, uint32_t, r->count[0] + r->count[a->ring] + 2);
    if (!out->ring || !out->count || !nodes) return LATHE_ERR_MEMORY;
    uint32_t n = copy_chain(nodes, 0, r, 0, a->from, b->from);
    n = copy_chain(nodes, n, r, a->ring, b->to, a->to);
    out->ring[0] = nodes;
    out->count[0] = n;
    for (uint32_t k = 1; k < r->rings; k++) {
        if (k == a->ring || !lathe__polygon_holds(r->at, nodes, n, corner(r, k, 0))) continue;
        out->ring[out->rings] = r->ring[k];
        out->count[out->rings++] = r->count[k];
    }
    return LATHE_OK;
}

static lathe_status triangulate_region(lathe_triangles *list, lathe_arena *arena, const region *r) {
    lathe_polygon polygon = {.at = r->at, .ring_end = LATHE_NEW(arena, uint32_t, r->rings), .ring_count = r->rings};
    size_t total = 0, used = 0;
    for (uint32_t k = 0; k < r->rings; k++) total += r->count[k];
    polygon.nodes = LATHE_NEW(arena, uint32_t, total);
    if (!polygon.nodes || !polygon.ring_end) return LATHE_ERR_MEMORY;
    for (uint32_t k = 0; k < r->rings; k++) {
        memcpy(polygon.nodes + used, r->ring[k], r->count[k] * sizeof *polygon.nodes);
        polygon.ring_end[k] = (uint32_t)(used += r->count[k]);
    }
    return triangulate(list, arena, &polygon);
}

/* At most MOST_ISLANDS deep: each split takes an island away. */
static lathe_status close_region(lathe_triangles *list, lathe_arena *arena, const region *r) {
    if (r->rings == 1) return lathe__close_polygon(list, arena, r->at, r->ring[0], r->count[0]);
    bridge pair[2];
    bool found;
    lathe_status status = best_pair(pair, &found, arena, r);
    if (status) return status;
    if (!found) return triangulate_region(list, arena, r);
    for (int i = 0; i < 2 && !status; i++) {
        region part;
        status = split(&part, arena, r, &pair[i], &pair[1 - i]);
        if (!status) status = close_region(list, arena, &part);
    }
    return status;
}

lathe_status lathe__close_with_islands(lathe_triangles *list, lathe_arena *arena, const lathe_polygon *polygon) {
    if (polygon->ring_count > MOST_ISLANDS) return triangulate(list, arena, polygon);
    region r = {.at = polygon->at, .ring = LATHE_NEW(arena, uint32_t *, polygon->ring_count),
                .count = LATHE_NEW(arena, uint32_t, polygon->ring_count), .rings = polygon->ring_count};
    if (!r.ring || !r.count) return LATHE_ERR_MEMORY;
    for (uint32_t k = 0, begin = 0; k < r.rings; begin = polygon->ring_end[k++]) {
        r.ring[k] = polygon->nodes + begin;
        r.count[k] = polygon->ring_end[k] - begin;
    }
    return close_region(list, arena, &r);
}
