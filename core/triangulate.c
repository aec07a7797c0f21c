/* Polygons with holes: holes are bridged, ears clipped, diagonals flipped towards Delaunay.
 * Ear clipping is quadratic, but cells that are not strips are small; it always ends, also where rounding has folded a sliver. */
#include "grid.h"
#include "overlay.h"

typedef struct ring {
    uint32_t *node, *next, *prev;  /* places of one doubly linked ring */
    lathe_point *at;               /* place -> position */
    uint32_t places;
    const lathe_point *positions;  /* node -> position */
} ring;

/* Does the place see another one through its interior angle? */
static bool in_cone(const ring *r, uint32_t place, uint32_t to) {
    uint32_t p = r->prev[place], n = r->next[place];
    int64_t s = lathe__turn(r->at, place, n, to), t = lathe__turn(r->at, p, place, to);
    return lathe__turn(r->at, p, place, n) > 0 ? s >= 0 && t >= 0 : s >= 0 || t >= 0;
}

static bool same(const ring *r, uint32_t a, uint32_t b) { return r->at[a].x == r->at[b].x && r->at[a].y == r->at[b].y; }

static uint32_t add_place(ring *r, uint32_t node) {
    r->node[r->places] = node;
    r->at[r->places] = r->positions[node];
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
        if (r->at[first + i].x < r->at[leftmost].x) leftmost = first + i;
    }
    return leftmost;
}

static double distance2(lathe_point a, lathe_point b) {
    double x = (double)a.x - b.x, y = (double)a.y - b.y;
    return x * x + y * y;
}

static bool bridge_is_free(const ring *r, uint32_t place, uint32_t hole) {
    if (!in_cone(r, place, hole) || !in_cone(r, hole, place)) return false;
    for (uint32_t i = 0; i < r->places; i++) {
        uint32_t n = r->next[i];
        if (same(r, place, i) || same(r, place, n) || same(r, hole, i) || same(r, hole, n)) continue;
        if (lathe__segments_meet(r->at, place, hole, i, n)) return false;
    }
    return true;
}

/* Joins a hole to the ring of `start` by the shortest free bridge from the hole's leftmost place. If no bridge is free
 * (positions folded by rounding), the nearest place serves. */
static void bridge_hole(ring *r, uint32_t start, uint32_t leftmost) {
    uint32_t place;
    lathe_point h = r->at[leftmost];
    /* Nearest first: each try takes the nearest place beyond the last one tried. */
    double beyond = -1;
    uint32_t best = UINT32_MAX, nearest = UINT32_MAX;
    for (int tries = 0; tries < 64 && best == UINT32_MAX; tries++) {
        uint32_t candidate = UINT32_MAX;
        double least = 0;
        place = start;
        do {
            double d = distance2(r->at[place], h);
            if (d > beyond && (candidate == UINT32_MAX || d < least)) { candidate = place; least = d; }
            place = r->next[place];
        } while (place != start);
        if (candidate == UINT32_MAX) break;
        if (nearest == UINT32_MAX) nearest = candidate;
        /* Bridged places share a position: each is tried, one of them has the cone. */
        place = start;
        do {
            if (distance2(r->at[place], h) == least && bridge_is_free(r, place, leftmost)) { best = place; break; }
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
    if (lathe__turn(r->at, p, place, n) <= 0) return false;
    lathe_range box = lathe__range_of(r->at[p], r->at[place]);
    lathe__range_add(&box, r->at[n].x, r->at[n].y);
    for (uint32_t i = r->next[n]; i != p; i = r->next[i]) {
        lathe_point q = r->at[i];
        if (q.x < box.x0 || q.x > box.x1 || q.y < box.y0 || q.y > box.y1 || same(r, i, p) || same(r, i, place) || same(r, i, n)) continue;
        if (lathe__turn(r->at, p, place, i) < loose || lathe__turn(r->at, place, n, i) < loose || lathe__turn(r->at, n, p, i) < loose) continue;
        return false;
    }
    return true;
}

/* A node twice in a ring (a bridge) must not become a triangle with a repeated corner. */
static bool proper(const ring *r, uint32_t place) {
    uint32_t a = r->node[r->prev[place]], b = r->node[place], c = r->node[r->next[place]];
    return a != b && b != c && c != a;
}

/* Cuts off a place's triangle. */
static void cut(const ring *r, uint32_t place, uint32_t triangle[3]) {
    triangle[0] = r->node[r->prev[place]];
    triangle[1] = r->node[place];
    triangle[2] = r->node[r->next[place]];
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
                if (lathe__turn(r->at, r->prev[place], place, r->next[place]) > 0) { choice = place; break; }
            }
            if (choice != UINT32_MAX) place = choice;
        }
        uint32_t p = r->prev[place], n = r->next[place];
        cut(r, place, triangles[count++]);
        link_places(r, p, n);
        left--;
        failures = 0;
        /* Going on behind the next place spreads the ears and avoids fans of slivers. */
        place = r->next[n];
    }
    cut(r, place, triangles[count++]);
    return count;
}

/* ---- Delaunay flips ---- */

/* The next corner of the same triangle: corners are numbered 3 * triangle + k. */
static uint32_t turned(uint32_t corner) { return corner % 3 == 2 ? corner - 2 : corner + 1; }

static void join(uint32_t *neighbour, uint32_t a, uint32_t b) {
    neighbour[a] = b;
    if (b != UINT32_MAX) neighbour[b] = a;
}

static bool find_neighbours(uint32_t *neighbour, lathe_arena *arena, const uint32_t *corner, uint32_t count) {
    uint32_t size = 16;
    while (size < count * 6) size *= 2;
    uint32_t *table = LATHE_NEW(arena, uint32_t, size);
    if (!table) return false;
    for (uint32_t i = 0; i < size; i++) table[i] = UINT32_MAX;
    for (uint32_t i = 0; i < count * 3; i++) neighbour[i] = UINT32_MAX;
    for (uint32_t i = 0; i < count * 3; i++) {
        uint32_t a = corner[i], b = corner[turned(i)], low = a < b ? a : b, high = a < b ? b : a;
        uint32_t h = (low * 2654435761u ^ high * 2246822519u);
        for (h = (h ^ h >> 15) & (size - 1);; h = (h + 1) & (size - 1)) {
            uint32_t other = table[h];
            if (other == UINT32_MAX) { table[h] = i; break; }
            if (corner[other] == b && corner[turned(other)] == a && neighbour[other] == UINT32_MAX) {
                join(neighbour, i, other);
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

static void flip(uint32_t *corner, uint32_t *neighbour, const lathe_point *at, uint32_t count) {
    uint32_t budget = count * 12;
    bool changed = true;
    while (changed && budget) {
        changed = false;
        for (uint32_t i = 0; i < count * 3 && budget; i++) {
            uint32_t j = neighbour[i], p = i - i % 3, q = j - j % 3;
            if (j == UINT32_MAX || p == q) continue;
            uint32_t i1 = turned(i), i2 = turned(i1), j1 = turned(j), j2 = turned(j1);
            uint32_t a = corner[i], b = corner[i1], c = corner[i2], d = corner[j2];
            if (c == d || !in_circle(at[a], at[b], at[c], at[d])) continue;
            if (lathe__turn(at, c, a, d) <= 0 || lathe__turn(at, d, b, c) <= 0) continue;
            uint32_t ca = neighbour[i2], bc = neighbour[i1], ad = neighbour[j1], db = neighbour[j2];
            corner[p] = corner[q + 2] = c;
            corner[p + 1] = a;
            corner[p + 2] = corner[q] = d;
            corner[q + 1] = b;
            join(neighbour, p, ca);
            join(neighbour, p + 1, ad);
            join(neighbour, p + 2, q + 2);
            join(neighbour, q, db);
            join(neighbour, q + 1, bc);
            changed = true;
            budget--;
        }
    }
}

lathe_status lathe__triangulate(uint32_t (**triangles)[3], uint32_t **neighbour, uint32_t *count, lathe_arena *arena,
                                const lathe_polygon *polygon) {
    uint32_t nodes = polygon->ring_end[polygon->ring_count - 1], holes = polygon->ring_count - 1;
    uint32_t places = nodes + 2 * holes, want = places - 2;
    ring r = {.positions = polygon->at};
    r.at = LATHE_NEW(arena, lathe_point, places);
    r.node = LATHE_NEW(arena, uint32_t, places);
    r.next = LATHE_NEW(arena, uint32_t, places);
    r.prev = LATHE_NEW(arena, uint32_t, places);
    *triangles = lathe__arena_alloc(arena, want, sizeof **triangles);
    *neighbour = LATHE_NEW(arena, uint32_t, (size_t)want * 3);
    uint32_t *hole = LATHE_NEW(arena, uint32_t, holes + 1);
    if (!r.at || !r.node || !r.next || !r.prev || !*triangles || !*neighbour || !hole) return LATHE_ERR_MEMORY;
    uint32_t start = 0;
    for (uint32_t i = 0, begin = 0; i <= holes; begin = polygon->ring_end[i++])
        hole[i] = add_ring(&r, polygon->nodes + begin, polygon->ring_end[i] - begin);
    /* By leftmost x: to the left of a hole lies only what is already joined. */
    for (uint32_t i = 1; i <= holes; i++)
        for (uint32_t j = i; j > 1; j--) {
            lathe_point a = r.at[hole[j - 1]], b = r.at[hole[j]];
            if (a.x <= b.x) break;
            uint32_t swap = hole[j];
            hole[j] = hole[j - 1];
            hole[j - 1] = swap;
        }
    for (uint32_t i = 1; i <= holes; i++) bridge_hole(&r, start, hole[i]);
    *count = clip_ears(&r, start, places, *triangles);
    if (!find_neighbours(*neighbour, arena, **triangles, *count)) return LATHE_ERR_MEMORY;
    flip(**triangles, *neighbour, polygon->at, *count);
    return LATHE_OK;
}
