#include "branching.h"
#include "grid.h"
#include "relation.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { NONE = 0xffffffffu };

typedef struct exterior {
    const lathe_many *many;
    lathe_arena *arena;
    uint32_t *of;              /* node -> its polygon */
    bool *taken;
    uint32_t *nodes;           /* F so far */
    uint32_t count, capacity;
    uint32_t left;             /* improvements that may still be tried */
} exterior;

static uint32_t after(const exterior *x, uint32_t node) {
    uint32_t m = x->of[node];
    return node + 1 < x->many->first[m + 1] ? node + 1 : x->many->first[m];
}
static uint32_t before(const exterior *x, uint32_t node) {
    uint32_t m = x->of[node];
    return node > x->many->first[m] ? node - 1 : x->many->first[m + 1] - 1;
}

static lathe_status append(exterior *x, uint32_t node) {
    if (x->count == x->capacity) return LATHE_ERR_FORMAT;   /* a simple polygon has each node once */
    x->nodes[x->count++] = node;
    return LATHE_OK;
}

/* Behind the last node: the chain of its polygon up to `to`. */
static lathe_status append_chain(exterior *x, uint32_t to) {
    lathe_status status = LATHE_OK;
    while (!status && x->nodes[x->count - 1] != to) status = append(x, after(x, x->nodes[x->count - 1]));
    return status;
}

static double distance2(lathe_point a, lathe_point b) {
    double x = (double)a.x - b.x, y = (double)a.y - b.y;
    return x * x + y * y;
}

static double distance2_to_edge(lathe_point p, lathe_point a, lathe_point b) {
    double dx = (double)b.x - a.x, dy = (double)b.y - a.y, l = dx * dx + dy * dy;
    double t = l > 0 ? (((double)p.x - a.x) * dx + ((double)p.y - a.y) * dy) / l : 0;
    t = t < 0 ? 0 : t > 1 ? 1 : t;
    double x = a.x + t * dx - p.x, y = a.y + t * dy - p.y;
    return x * x + y * y;
}

static void nearest_pair(const exterior *x, uint32_t a, uint32_t b, uint32_t pair[2]) {
    const uint32_t *first = x->many->first;
    double least = INFINITY;
    for (uint32_t i = first[a]; i < first[a + 1]; i++)
        for (uint32_t j = first[b]; j < first[b + 1]; j++) {
            double d = distance2(x->many->at[i], x->many->at[j]);
            if (d < least) least = d, pair[0] = i, pair[1] = j;
        }
}

/* Does the edge between two nodes cross or touch any polygon, but at its own ends? */
static bool edge_meets(const exterior *x, uint32_t a, uint32_t b) {
    const lathe_point *at = x->many->at;
    for (uint32_t i = 0; i < x->many->first[x->many->count]; i++) {
        uint32_t j = after(x, i);
        if (i == a || i == b || j == a || j == b) continue;
        if (lathe__edges_meet(at[a], at[b], at[i], at[j])) return true;
    }
    return false;
}

/* Does the edge leave its end into the inside of that end's polygon? */
static bool edge_enters(const exterior *x, uint32_t node, uint32_t to) {
    const lathe_point *at = x->many->at;
    uint32_t p = before(x, node), n = after(x, node);
    int64_t a = lathe__turn(at, node, n, to), b = lathe__turn(at, p, node, to);
    return lathe__turn(at, p, node, n) > 0 ? a >= 0 && b >= 0 : a >= 0 || b >= 0;
}

static bool edge_is_free(const exterior *x, uint32_t a, uint32_t b) {
    return !edge_enters(x, a, b) && !edge_enters(x, b, a) && !edge_meets(x, a, b);
}

/* The ring between the edge s e of F and a pair further in: s .. ps along the one polygon, pe .. e along the other. */
static uint32_t ring_between(const exterior *x, uint32_t *ring, uint32_t s, uint32_t e, const uint32_t pair[2]) {
    uint32_t n = 0;
    for (uint32_t v = s;; v = after(x, v)) {
        ring[n++] = v;
        if (v == pair[0]) break;
    }
    for (uint32_t v = pair[1];; v = after(x, v)) {
        ring[n++] = v;
        if (v == e) break;
    }
    return n;
}

/* A third polygon that overlaps the ring, or is cut by the edge between the pair. It may be in F already, by another
 * side: the middle one of three in a row [P figure 9]. */
static uint32_t find_island(const exterior *x, const uint32_t *ring, uint32_t n, const uint32_t pair[2]) {
    const lathe_many *m = x->many;
    lathe_range box = lathe__range_of(m->at[ring[0]], m->at[ring[0]]);
    for (uint32_t i = 1; i < n; i++) lathe__range_add(&box, m->at[ring[i]].x, m->at[ring[i]].y);
    for (uint32_t k = 0; k < m->count; k++) {
        if (k == x->of[pair[0]] || k == x->of[pair[1]]) continue;
        for (uint32_t v = m->first[k]; v < m->first[k + 1]; v++) {
            lathe_point p = m->at[v];
            if (lathe__edges_meet(m->at[pair[0]], m->at[pair[1]], p, m->at[after(x, v)])) return k;
            if (p.x < box.x0 || p.x > box.x1 || p.y < box.y0 || p.y > box.y1) continue;
            if (n > 2 && lathe__polygon_holds(m->at, ring, n, p)) return k;
        }
    }
    return NONE;
}

static lathe_status improve(exterior *x, uint32_t s, uint32_t e);

/* Takes a polygon in: the edge s e becomes s c and c e, c its point nearest to that edge. */
static lathe_status take_in(exterior *x, uint32_t island, uint32_t s, uint32_t e) {
    const lathe_many *m = x->many;
    uint32_t c = m->first[island];
    double least = INFINITY;
    for (uint32_t v = m->first[island]; v < m->first[island + 1]; v++) {
        double d = distance2_to_edge(m->at[v], m->at[s], m->at[e]);
        if (d < least) least = d, c = v;
    }
    x->taken[island] = true;
    lathe_status status = improve(x, s, c);
    return status ? status : improve(x, c, e);
}

/* F ends with s; goes on to e, which belongs to another polygon. */
static lathe_status improve(exterior *x, uint32_t s, uint32_t e) {
    uint32_t pair[2] = {s, e}, *ring = LATHE_NEW(x->arena, uint32_t, x->capacity + 2);
    if (!ring) return LATHE_ERR_MEMORY;
    if (!x->left--) return LATHE_ERR_FORMAT;
    nearest_pair(x, x->of[s], x->of[e], pair);
    uint32_t n = ring_between(x, ring, s, e, pair), island = find_island(x, ring, n, pair);
    if (island != NONE) return take_in(x, island, s, e);
    /* The neighbours of the nearest pair; where that edge is not free, theirs, and so on out to s and e. */
    uint32_t from = pair[0], to = pair[1];
    do {
        if (from != s) from = before(x, from);
        if (to != e) to = after(x, to);
    } while (!edge_is_free(x, from, to) && (from != s || to != e));
    if (!edge_is_free(x, from, to)) from = pair[0], to = pair[1];
    lathe_status status = append_chain(x, from);
    if (!status) status = append(x, to);
    return status ? status : append_chain(x, e);
}

static bool is_simple(const exterior *x) {
    const lathe_point *at = x->many->at;
    uint32_t n = x->count;
    const uint32_t *v = x->nodes;
    if (n < 3) return false;
    bool *seen = LATHE_NEW(x->arena, bool, x->capacity);
    if (!seen) return false;
    memset(seen, 0, x->capacity * sizeof *seen);
    for (uint32_t i = 0; i < n; i++) {
        if (seen[v[i]]) return false;
        seen[v[i]] = true;
    }
    /* Chains are simple and disjoint: only edges between polygons can be at fault. */
    for (uint32_t i = 0; i < n; i++) {
        uint32_t i1 = i + 1 < n ? i + 1 : 0;
        if (x->of[v[i]] == x->of[v[i1]]) continue;
        if (edge_meets(x, v[i], v[i1])) return false;
        for (uint32_t k = 0; k < n; k++) {
            uint32_t k1 = k + 1 < n ? k + 1 : 0;
            if (k == i || k1 == i || k == i1) continue;
            if (lathe__edges_meet(at[v[i]], at[v[i1]], at[v[k]], at[v[k1]])) return false;
        }
    }
    return true;
}

/* The corners of the hull as nodes, in the hull's order. */
static lathe_status hull_nodes(exterior *x, uint32_t **out, uint32_t *count) {
    const lathe_many *m = x->many;
    uint32_t total = m->first[m->count];
    lathe_point *hull = LATHE_NEW(x->arena, lathe_point, total + 1);
    uint32_t *nodes = LATHE_NEW(x->arena, uint32_t, total + 1);
    if (!hull || !nodes) return LATHE_ERR_MEMORY;
    uint32_t n = lathe__convex_hull(hull, m->at, total);
    if (!n) return LATHE_ERR_MEMORY;
    for (uint32_t i = 0; i < n; i++) {
        nodes[i] = NONE;
        for (uint32_t v = 0; v < total; v++)
            if (m->at[v].x == hull[i].x && m->at[v].y == hull[i].y) nodes[i] = v;
    }
    *out = nodes;
    *count = n;
    return LATHE_OK;
}

lathe_status lathe__exterior_polygon(uint32_t **nodes, uint32_t *count, bool *taken, lathe_arena *arena,
                                     const lathe_many *many) {
    uint32_t total = many->first[many->count], *corner, corners, start = 0;
    exterior x = {.many = many, .arena = arena, .taken = taken, .of = LATHE_NEW(arena, uint32_t, total + 1),
                  .nodes = LATHE_NEW(arena, uint32_t, total + 2), .capacity = total + 1, .left = 4 * many->count + 16};
    if (!x.of || !x.nodes) return LATHE_ERR_MEMORY;
    for (uint32_t k = 0; k < many->count; k++) {
        taken[k] = false;
        for (uint32_t v = many->first[k]; v < many->first[k + 1]; v++) x.of[v] = k;
    }
    lathe_status status = hull_nodes(&x, &corner, &corners);
    if (status) return status;
    if (corners < 3) return LATHE_ERR_FORMAT;
    for (uint32_t i = 0; i < corners; i++) taken[x.of[corner[i]]] = true;
    /* Begin where F enters a polygon. */
    while (start < corners && x.of[corner[start]] == x.of[corner[(start + corners - 1) % corners]]) start++;
    if (start == corners) return LATHE_ERR_FORMAT;   /* one polygon holds all the others */
    status = append(&x, corner[start]);
    for (uint32_t i = 0; !status && i < corners; i++) {
        uint32_t s = corner[(start + i) % corners], e = corner[(start + i + 1) % corners];
        status = x.of[s] == x.of[e] ? append_chain(&x, e) : improve(&x, s, e);
    }
    if (status) return status;
    if (x.nodes[x.count - 1] == x.nodes[0]) x.count--;
    if (!is_simple(&x)) return LATHE_ERR_FORMAT;
    *nodes = x.nodes;
    *count = x.count;
    return LATHE_OK;
}

/* ---- interior polygons ---- */

typedef struct interior {
    exterior x;                /* for its walks */
    uint32_t *leave;           /* node -> the node of another polygon that F goes to from it, or NONE */
    bool *along;               /* node: F goes from it to the next one of its own polygon */
    bool *done;                /* node: its edge to another polygon has been walked */
} interior;

/* One interior polygon, from the edge that leaves `start`. */
static lathe_status walk(interior *in, uint32_t start, uint32_t *ring, uint32_t *count, uint32_t limit) {
    uint32_t v = start, n = 0;
    do {
        if (n == limit || in->leave[v] == NONE || in->done[v]) return LATHE_ERR_FORMAT;
        in->done[v] = true;
        ring[n++] = v;
        v = in->leave[v];
        /* Back along this polygon, unless F itself came along there: then F leaves it at once. */
        if (in->along[before(&in->x, v)]) continue;
        do {
            if (n == limit) return LATHE_ERR_FORMAT;
            ring[n++] = v;
            v = before(&in->x, v);
        } while (in->leave[v] == NONE);
    } while (v != start);
    *count = n;
    return LATHE_OK;
}

static lathe_status close_ring(lathe_triangles *list, lathe_arena *arena, const interior *in, const uint32_t *ring,
                               uint32_t count) {
    const lathe_many *m = in->x.many;
    uint32_t total = m->first[m->count], used = count;
    lathe_polygon polygon = {.at = m->at, .ring_count = 1, .nodes = LATHE_NEW(arena, uint32_t, (size_t)count + total),
                             .ring_end = LATHE_NEW(arena, uint32_t, m->count + 1)};
    if (!polygon.nodes || !polygon.ring_end) return LATHE_ERR_MEMORY;
    memcpy(polygon.nodes, ring, count * sizeof *ring);
    polygon.ring_end[0] = count;
    for (uint32_t k = 0; k < m->count; k++) {
        if (in->x.taken[k] || !lathe__polygon_holds(m->at, ring, count, m->at[m->first[k]])) continue;
        for (uint32_t v = m->first[k + 1]; v-- > m->first[k];) polygon.nodes[used++] = v;
        polygon.ring_end[polygon.ring_count++] = used;
    }
    return lathe__close_with_islands(list, arena, &polygon);
}

lathe_status lathe__close_interior(lathe_triangles *list, uint32_t *rings, lathe_arena *arena, const lathe_many *many,
                                   const uint32_t *nodes, uint32_t count, const bool *taken) {
    uint32_t total = many->first[many->count], limit = 2 * total + 2, *ring = LATHE_NEW(arena, uint32_t, limit), n;
    interior in = {
        .x = {.many = many, .of = LATHE_NEW(arena, uint32_t, total + 1), .taken = LATHE_NEW(arena, bool, many->count)},
        .leave = LATHE_NEW(arena, uint32_t, total + 1),
        .along = LATHE_NEW(arena, bool, total + 1),
        .done = LATHE_NEW(arena, bool, total + 1)};
    if (!ring || !in.x.of || !in.x.taken || !in.leave || !in.along || !in.done) return LATHE_ERR_MEMORY;
    for (uint32_t k = 0; k < many->count; k++) {
        in.x.taken[k] = taken[k];
        for (uint32_t v = many->first[k]; v < many->first[k + 1]; v++)
            in.x.of[v] = k, in.leave[v] = NONE, in.along[v] = in.done[v] = false;
    }
    for (uint32_t i = 0; i < count; i++) {
        uint32_t a = nodes[i], b = nodes[i + 1 < count ? i + 1 : 0];
        if (in.x.of[a] != in.x.of[b]) in.leave[a] = b;
        else if (b == after(&in.x, a)) in.along[a] = true;
        else return LATHE_ERR_FORMAT;
    }
    *rings = 0;
    for (uint32_t i = 0; i < count; i++) {
        if (in.leave[nodes[i]] == NONE || in.done[nodes[i]]) continue;
        lathe_status status = walk(&in, nodes[i], ring, &n, limit);
        if (!status && n >= 3) status = close_ring(list, arena, &in, ring, n);
        if (status) return status;
        *rings += n >= 3;
    }
    return LATHE_OK;
}
