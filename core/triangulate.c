/* Polygons with holes: holes are bridged, ears clipped, diagonals flipped towards Delaunay.
 * Ear clipping is quadratic, but cells that are not strips are small; it always ends, also where rounding has folded a sliver. */
#include "overlay.h"

typedef struct ring {
    uint32_t *node, *next, *prev;  /* places of one doubly linked ring */
    uint32_t places;
    const lathe_point *at;
} ring;

static int64_t orient3(const ring *r, uint32_t a, uint32_t b, uint32_t c) {
    return lathe__orient(r->at[r->node[a]], r->at[r->node[b]], r->at[r->node[c]]);
}

/* Does the place see `to` through its interior angle? */
static bool in_cone(const ring *r, uint32_t place, lathe_point to) {
    lathe_point p = r->at[r->node[r->prev[place]]], v = r->at[r->node[place]], n = r->at[r->node[r->next[place]]];
    if (lathe__orient(p, v, n) > 0) return lathe__orient(v, n, to) >= 0 && lathe__orient(p, v, to) >= 0;
    return !(lathe__orient(v, n, to) < 0 && lathe__orient(p, v, to) < 0);
}

static bool same(lathe_point a, lathe_point b) { return a.x == b.x && a.y == b.y; }

static bool segments_meet(lathe_point a, lathe_point b, lathe_point c, lathe_point d) {
    if (same(a, c) || same(a, d) || same(b, c) || same(b, d)) return false;
    int64_t s = lathe__orient(a, b, c), t = lathe__orient(a, b, d);
    if ((s > 0 && t > 0) || (s < 0 && t < 0)) return false;
    s = lathe__orient(c, d, a), t = lathe__orient(c, d, b);
    return !((s > 0 && t > 0) || (s < 0 && t < 0));
}

static uint32_t add_place(ring *r, uint32_t node) {
    r->node[r->places] = node;
    return r->places++;
}

static void link_places(ring *r, uint32_t a, uint32_t b) {
    r->next[a] = b;
    r->prev[b] = a;
}

/* Returns the leftmost place of the new ring. */
static uint32_t add_ring(ring *r, const uint32_t *nodes, uint32_t count) {
    uint32_t first = r->places, leftmost = first;
    for (uint32_t i = 0; i < count; i++) add_place(r, nodes[i]);
    for (uint32_t i = 0; i < count; i++) {
        link_places(r, first + i, first + (i + 1) % count);
        if (r->at[nodes[i]].x < r->at[r->node[leftmost]].x) leftmost = first + i;
    }
    return leftmost;
}

static double distance2(lathe_point a, lathe_point b) {
    double x = (double)a.x - b.x, y = (double)a.y - b.y;
    return x * x + y * y;
}

static bool bridge_is_free(const ring *r, uint32_t place, uint32_t hole) {
    lathe_point a = r->at[r->node[place]], b = r->at[r->node[hole]];
    if (!in_cone(r, place, b) || !in_cone(r, hole, a)) return false;
    for (uint32_t i = 0; i < r->places; i++)
        if (segments_meet(a, b, r->at[r->node[i]], r->at[r->node[r->next[i]]])) return false;
    return true;
}

/* Joins a hole to the ring of `start` by the shortest free bridge from the hole's leftmost place. If no bridge is free
 * (positions folded by rounding), the nearest place serves. */
static void bridge_hole(ring *r, uint32_t start, uint32_t leftmost) {
    uint32_t place;
    lathe_point h = r->at[r->node[leftmost]];
    /* Nearest first: each try takes the nearest place beyond the last one tried. */
    double beyond = -1;
    uint32_t best = UINT32_MAX, nearest = UINT32_MAX;
    for (int tries = 0; tries < 64 && best == UINT32_MAX; tries++) {
        uint32_t candidate = UINT32_MAX;
        double least = 0;
        place = start;
        do {
            double d = distance2(r->at[r->node[place]], h);
            if (d > beyond && (candidate == UINT32_MAX || d < least)) { candidate = place; least = d; }
            place = r->next[place];
        } while (place != start);
        if (candidate == UINT32_MAX) break;
        if (nearest == UINT32_MAX) nearest = candidate;
        /* Bridged places share a position: each is tried, one of them has the cone. */
        place = start;
        do {
            if (distance2(r->at[r->node[place]], h) == least && bridge_is_free(r, place, leftmost)) { best = place; break; }
            place = r->next[place];
        } while (place != start);
        beyond = least;
    }
    if (best == UINT32_MAX) best = nearest;
    uint32_t best2 = add_place(r, r->node[best]), left2 = add_place(r, r->node[leftmost]);
    uint32_t after = r->next[best], before = r->prev[leftmost];
    link_places(r, best, leftmost);
    link_places(r, before, left2);
    link_places(r, left2, best2);
    link_places(r, best2, after);
}

/* loose: vertices on the new diagonal are let pass. */
static bool is_ear(const ring *r, uint32_t place, bool loose) {
    uint32_t p = r->prev[place], n = r->next[place];
    if (orient3(r, p, place, n) <= 0) return false;
    lathe_point a = r->at[r->node[p]], b = r->at[r->node[place]], c = r->at[r->node[n]];
    int32_t x0 = a.x < b.x ? a.x : b.x, x1 = a.x > b.x ? a.x : b.x, y0 = a.y < b.y ? a.y : b.y, y1 = a.y > b.y ? a.y : b.y;
    if (c.x < x0) x0 = c.x;
    if (c.x > x1) x1 = c.x;
    if (c.y < y0) y0 = c.y;
    if (c.y > y1) y1 = c.y;
    for (uint32_t i = r->next[n]; i != p; i = r->next[i]) {
        lathe_point q = r->at[r->node[i]];
        if (q.x < x0 || q.x > x1 || q.y < y0 || q.y > y1 || same(q, a) || same(q, b) || same(q, c)) continue;
        if (lathe__orient(a, b, q) < loose || lathe__orient(b, c, q) < loose || lathe__orient(c, a, q) < loose) continue;
        return false;
    }
    return true;
}

/* A node twice in a ring (a bridge) must not become a triangle with a repeated corner. */
static bool proper(const ring *r, uint32_t place) {
    uint32_t a = r->node[r->prev[place]], b = r->node[place], c = r->node[r->next[place]];
    return a != b && b != c && c != a;
}

static uint32_t clip_ears(ring *r, uint32_t start, uint32_t left, uint32_t (*triangles)[3]) {
    uint32_t count = 0, place = start, failures = 0;
    while (left > 3) {
        bool ear = is_ear(r, place, failures > left);
        if (!ear && failures <= 2 * left) {
            place = r->next[place];
            failures++;
            continue;
        }
        if (!ear) {
            /* No ear anywhere: rounding has folded the polygon. Any convex place serves, else any proper one. */
            uint32_t choice = UINT32_MAX;
            for (uint32_t i = 0; i < left; i++, place = r->next[place]) {
                if (!proper(r, place)) continue;
                if (choice == UINT32_MAX) choice = place;
                if (orient3(r, r->prev[place], place, r->next[place]) > 0) { choice = place; break; }
            }
            if (choice != UINT32_MAX) place = choice;
        }
        uint32_t p = r->prev[place], n = r->next[place];
        triangles[count][0] = r->node[p], triangles[count][1] = r->node[place], triangles[count][2] = r->node[n];
        count++;
        link_places(r, p, n);
        left--;
        failures = 0;
        /* Going on behind the next place spreads the ears and avoids fans of slivers. */
        place = r->next[n];
    }
    triangles[count][0] = r->node[r->prev[place]], triangles[count][1] = r->node[place], triangles[count][2] = r->node[r->next[place]];
    return count + 1;
}

/* ---- Delaunay flips ---- */

static bool find_neighbours(uint32_t *neighbour, lathe_arena *arena, uint32_t (*t)[3], uint32_t count) {
    uint32_t size = 16;
    while (size < count * 6) size *= 2;
    uint32_t *table = LATHE_NEW(arena, uint32_t, size);
    if (!table) return false;
    for (uint32_t i = 0; i < size; i++) table[i] = UINT32_MAX;
    for (uint32_t i = 0; i < count * 3; i++) neighbour[i] = UINT32_MAX;
    for (uint32_t i = 0; i < count * 3; i++) {
        uint32_t a = t[i / 3][i % 3], b = t[i / 3][(i + 1) % 3], low = a < b ? a : b, high = a < b ? b : a;
        uint32_t h = (low * 2654435761u ^ high * 2246822519u);
        for (h = (h ^ h >> 15) & (size - 1);; h = (h + 1) & (size - 1)) {
            uint32_t other = table[h];
            if (other == UINT32_MAX) { table[h] = i; break; }
            if (t[other / 3][other % 3] == b && t[other / 3][(other + 1) % 3] == a && neighbour[other] == UINT32_MAX) {
                neighbour[other] = i;
                neighbour[i] = other;
                break;
            }
        }
    }
    return true;
}

/* d inside the circle of the counter-clockwise triangle a b c? Doubles in a fixed order: the same on every platform. */
static bool in_circle(lathe_point a, lathe_point b, lathe_point c, lathe_point d) {
    double ax = (double)a.x - d.x, ay = (double)a.y - d.y, bx = (double)b.x - d.x, by = (double)b.y - d.y;
    double cx = (double)c.x - d.x, cy = (double)c.y - d.y;
    double aa = ax * ax + ay * ay, bb = bx * bx + by * by, cc = cx * cx + cy * cy;
    double det = ax * (by * cc - cy * bb) - ay * (bx * cc - cx * bb) + aa * (bx * cy - cx * by);
    double size = aa * bb + bb * cc + cc * aa;
    return det > size * 1e-9;
}

static void flip(uint32_t (*t)[3], uint32_t *neighbour, const lathe_point *at, uint32_t count) {
    uint32_t budget = count * 12;
    bool changed = true;
    while (changed && budget) {
        changed = false;
        for (uint32_t i = 0; i < count * 3 && budget; i++) {
            uint32_t j = neighbour[i];
            if (j == UINT32_MAX || j / 3 == i / 3) continue;
            uint32_t p = i / 3, k = i % 3, q = j / 3, l = j % 3;
            uint32_t a = t[p][k], b = t[p][(k + 1) % 3], c = t[p][(k + 2) % 3], d = t[q][(l + 2) % 3];
            if (c == d || !in_circle(at[a], at[b], at[c], at[d])) continue;
            if (lathe__orient(at[c], at[a], at[d]) <= 0 || lathe__orient(at[d], at[b], at[c]) <= 0) continue;
            /* p: c a d, q: d b c */
            uint32_t ca = neighbour[p * 3 + (k + 2) % 3], bc = neighbour[p * 3 + (k + 1) % 3];
            uint32_t ad = neighbour[q * 3 + (l + 1) % 3], db = neighbour[q * 3 + (l + 2) % 3];
            t[p][0] = c, t[p][1] = a, t[p][2] = d;
            t[q][0] = d, t[q][1] = b, t[q][2] = c;
            neighbour[p * 3] = ca, neighbour[p * 3 + 1] = ad, neighbour[p * 3 + 2] = q * 3 + 2;
            neighbour[q * 3] = db, neighbour[q * 3 + 1] = bc, neighbour[q * 3 + 2] = p * 3 + 2;
            if (ca != UINT32_MAX) neighbour[ca] = p * 3;
            if (ad != UINT32_MAX) neighbour[ad] = p * 3 + 1;
            if (db != UINT32_MAX) neighbour[db] = q * 3;
            if (bc != UINT32_MAX) neighbour[bc] = q * 3 + 1;
            changed = true;
            budget--;
        }
    }
}

lathe_status lathe__triangulate(uint32_t (**triangles)[3], uint32_t **neighbour, uint32_t *count, lathe_arena *arena,
                                const lathe_polygon *polygon) {
    uint32_t nodes = polygon->ring_end[polygon->ring_count - 1], holes = polygon->ring_count - 1;
    uint32_t places = nodes + 2 * holes, want = places - 2;
    ring r = {.at = polygon->at};
    r.node = LATHE_NEW(arena, uint32_t, places);
    r.next = LATHE_NEW(arena, uint32_t, places);
    r.prev = LATHE_NEW(arena, uint32_t, places);
    *triangles = lathe__arena_alloc(arena, want, sizeof **triangles);
    *neighbour = LATHE_NEW(arena, uint32_t, (size_t)want * 3);
    uint32_t *hole = LATHE_NEW(arena, uint32_t, holes + 1);
    if (!r.node || !r.next || !r.prev || !*triangles || !*neighbour || !hole) return LATHE_ERR_MEMORY;
    uint32_t start = 0;
    for (uint32_t i = 0, begin = 0; i <= holes; begin = polygon->ring_end[i++])
        hole[i] = add_ring(&r, polygon->nodes + begin, polygon->ring_end[i] - begin);
    /* By leftmost x: to the left of a hole lies only what is already joined. */
    for (uint32_t i = 1; i <= holes; i++)
        for (uint32_t j = i; j > 1; j--) {
            lathe_point a = polygon->at[r.node[hole[j - 1]]], b = polygon->at[r.node[hole[j]]];
            if (a.x <= b.x) break;
            uint32_t swap = hole[j];
            hole[j] = hole[j - 1];
            hole[j - 1] = swap;
        }
    for (uint32_t i = 1; i <= holes; i++) bridge_hole(&r, start, hole[i]);
    *count = clip_ears(&r, start, places, *triangles);
    if (!find_neighbours(*neighbour, arena, *triangles, *count)) return LATHE_ERR_MEMORY;
    flip(*triangles, *neighbour, polygon->at, *count);
    return LATHE_OK;
}
