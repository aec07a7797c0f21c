/* Polygons with holes: holes are bridged, ears clipped, diagonals flipped towards Delaunay. A grid finds what may lie in the way,
 * and cutting an ear changes its two neighbours only, so the time grows about as the number of vertices does. Exact for simple
 * polygons; it ends also where rounding has folded one. */
#include <string.h>
#include "grid.h"
#include "overlay.h"

enum { NONE = 0xffffffffu, BRIDGE = 0x80000000u, PLACES_PER_CELL = 4, FLIP_TURNS = 48 };
enum { FEW = 16 };             /* so many places need no grid: most polygons of a slab have fewer */

typedef struct ring {
    uint32_t *node, *next, *prev;  /* places of one doubly linked ring */
    uint32_t *end;                 /* where the edge that begins in a place ended before there were bridges */
    uint32_t *twin;                /* next place of the same node, cyclically: bridges begin and end in places of their own */
    uint32_t *across;              /* what lies beyond the edge that begins in a place: a corner of a triangle; BRIDGE + the place where
                                    * the same bridge begins on its other side; NONE */
    uint32_t *neighbour;           /* of corners */
    lathe_point *at;               /* place -> position */
    uint32_t places;
    const lathe_point *positions;  /* node -> position */
    lathe_grid grid;               /* of the rings' edges, each numbered as its first place; not if there are few */
    bool few;
    uint32_t rim;                  /* places of the rings; behind them two for each bridge */
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
    r->twin[r->places] = r->places;
    r->across[r->places] = NONE;
    r->at[r->places] = r->positions[node];
    return r->places++;
}

static uint32_t add_twin(ring *r, uint32_t place) {
    uint32_t twin = add_place(r, r->node[place]);
    r->twin[twin] = r->twin[place];
    return r->twin[place] = twin;
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
        uint32_t end = r->end[first + i] = first + (i + 1) % count;
        link_places(r, first + i, end);
        if (r->at[first + i].x < r->at[leftmost].x) leftmost = first + i;
    }
    return leftmost;
}

static lathe_status build_grid(ring *r, lathe_arena *arena) {
    lathe_range *ranges = LATHE_NEW(arena, lathe_range, r->places);
    if (!ranges) return LATHE_ERR_MEMORY;
    for (uint32_t i = 0; i < r->places; i++) ranges[i] = lathe__range_of(r->at[i], r->at[r->next[i]]);
    return lathe__grid_build(&r->grid, arena, ranges, r->places, r->places / PLACES_PER_CELL + 1);
}

/* The edge or bridge that a ray from a hole's leftmost place to the left meets first, or NONE. */
static uint32_t first_on_the_left(const ring *r, uint32_t hole) {
    lathe_point h = r->at[hole];
    lathe_left nearest = LATHE_NOTHING_LEFT;
    uint32_t best = NONE;
    const lathe_grid *grid = &r->grid;
    int32_t y = h.y >> grid->shift;
    for (uint32_t i = r->rim; i < r->places; i += 2)
        if (lathe__is_nearer_left(&nearest, h, r->at[i], r->at[i + 1])) best = i;
    for (int32_t x = h.x >> grid->shift; x >= grid->cells.x0 && nearest.x < ((double)x + 1) * (1 << grid->shift); x--) {
        size_t cell = lathe__cell_at(grid, x, y);
        for (uint32_t k = grid->first[cell]; k < grid->first[cell + 1]; k++) {
            uint32_t i = grid->entry[k];
            if (i != hole && r->end[i] != hole && lathe__is_nearer_left(&nearest, h, r->at[i], r->at[r->end[i]])) best = i;
        }
    }
    return best;
}

/* A place that the hole's leftmost place sees: the edge that lies to its left has one end not to the right of it; whatever hides that
 * end lies in the triangle between, and of it the place nearest to the ray is seen. What lies to the left is joined already. */
static uint32_t place_to_bridge(const ring *r, uint32_t hole) {
    uint32_t edge = first_on_the_left(r, hole);
    if (edge == NONE) return 0;    /* only where rounding has folded the polygon */
    uint32_t end = r->end[edge], best = r->at[edge].x < r->at[end].x ? edge : end, place;
    int side = lathe__turn(r->at, edge, end, hole) > 0 ? 1 : -1;
    lathe_point h = r->at[hole], p = r->at[best];
    int up = p.y >= h.y ? 1 : -1;
    lathe_range box = lathe__range_of(h, p), c = lathe__cells_of(&box, r->grid.shift);
    for (int32_t y = c.y0; y <= c.y1; y++)
        for (int32_t x = c.x0; x <= c.x1; x++) {
            size_t cell = lathe__cell_at(&r->grid, x, y);
            for (uint32_t k = r->grid.first[cell]; k < r->grid.first[cell + 1]; k++) {
                uint32_t i = r->grid.entry[k];
                lathe_point q = r->at[i];
                if (q.x >= h.x || (q.y - h.y) * up < 0 || lathe__turn(r->at, edge, end, i) * side <= 0) continue;
                int64_t turn = lathe__turn(r->at, hole, best, i) * up;
                if (turn > 0 || (turn == 0 && q.x > r->at[best].x)) best = i;
            }
        }
    for (place = r->twin[best]; place != best && !in_cone(r, place, hole);) place = r->twin[place];
    return place;
}

/* Joins a hole to the ring. */
static void bridge_hole(ring *r, uint32_t leftmost) {
    uint32_t place = place_to_bridge(r, leftmost), left2 = add_twin(r, leftmost), place2 = add_twin(r, place);
    uint32_t after = r->next[place], before = r->prev[leftmost];
    link_places(r, place, leftmost);
    link_places(r, before, left2);
    link_places(r, left2, place2);
    link_places(r, place2, after);
    r->end[left2] = place2;
    uint32_t beyond = r->across[place];
    if (beyond != NONE) r->across[beyond - BRIDGE] = BRIDGE + place2;
    r->across[place2] = beyond;
    r->across[place] = BRIDGE + left2;
    r->across[left2] = BRIDGE + place;
}

static int32_t least(int32_t a, int32_t b) { return a < b ? a : b; }
static int32_t most(int32_t a, int32_t b) { return a > b ? a : b; }

static bool is_within(const lathe_range *box, lathe_point q) {
    return !((q.x < box->x0) | (q.x > box->x1) | (q.y < box->y0) | (q.y > box->y1));
}

/* Does place i, in the box of the triangle of another one and its neighbours, lie within the triangle? */
static bool hides(const ring *r, uint32_t p, uint32_t place, uint32_t n, uint32_t i) {
    if (same(r, i, p) || same(r, i, place) || same(r, i, n)) return false;
    return lathe__turn(r->at, p, place, i) >= 0 && lathe__turn(r->at, place, n, i) >= 0 && lathe__turn(r->at, n, p, i) >= 0;
}

static bool is_ear(const ring *r, uint32_t place) {
    uint32_t p = r->prev[place], n = r->next[place];
    if (lathe__turn(r->at, p, place, n) <= 0) return false;
    lathe_point a = r->at[p], b = r->at[place], d = r->at[n];
    lathe_range box = {least(least(a.x, b.x), d.x), least(least(a.y, b.y), d.y), most(most(a.x, b.x), d.x), most(most(a.y, b.y), d.y)};
    if (r->few) {
        for (uint32_t i = 0; i < r->rim; i++)
            if (is_within(&box, r->at[i]) && hides(r, p, place, n, i)) return false;
        return true;
    }
    lathe_range c = lathe__cells_of(&box, r->grid.shift);
    for (int32_t y = c.y0; y <= c.y1; y++)
        for (int32_t x = c.x0; x <= c.x1; x++) {
            size_t cell = lathe__cell_at(&r->grid, x, y);
            for (uint32_t k = r->grid.first[cell]; k < r->grid.first[cell + 1]; k++) {
                uint32_t i = r->grid.entry[k];
                if (is_within(&box, r->at[i]) && hides(r, p, place, n, i)) return false;
            }
        }
    return true;
}

/* A node twice in a ring (a bridge) must not become a triangle with a repeated corner. */
static bool proper(const ring *r, uint32_t place) {
    uint32_t a = r->node[r->prev[place]], b = r->node[place], c = r->node[r->next[place]];
    return a != b && b != c && c != a;
}

static void join(uint32_t *neighbour, uint32_t a, uint32_t b) {
    neighbour[a] = b;
    if (b != NONE) neighbour[b] = a;
}

/* The edge that begins in a place becomes one of a triangle, from this corner to the next. */
static void use_edge(ring *r, uint32_t place, uint32_t corner) {
    uint32_t beyond = r->across[place];
    if (beyond < BRIDGE || beyond == NONE) join(r->neighbour, corner, beyond);
    else r->across[beyond - BRIDGE] = corner;
}

/* Cuts off a place's triangle. */
static void cut(ring *r, uint32_t place, uint32_t (*triangles)[3], uint32_t index) {
    uint32_t p = r->prev[place], n = r->next[place], *t = triangles[index];
    t[0] = r->node[p];
    t[1] = r->node[place];
    t[2] = r->node[n];
    use_edge(r, p, index * 3);
    use_edge(r, place, index * 3 + 1);
    r->across[p] = index * 3 + 2;
    link_places(r, p, n);
    r->next[place] = NONE;
}

/* No ear anywhere: rounding has folded the polygon. Any convex place serves, else any proper one. */
static uint32_t least_bad(const ring *r, uint32_t place, uint32_t left) {
    uint32_t choice = place;
    for (uint32_t i = 0; i < left; i++, place = r->next[place]) {
        if (!proper(r, place)) continue;
        choice = place;
        if (lathe__turn(r->at, r->prev[place], place, r->next[place]) > 0) break;
    }
    return choice;
}

/* queue: room for three times as many as there are places. Returns the number of triangles; 0 if a hole could not be joined: only
 * outlines that cross themselves have such. */
static uint32_t clip_ears(ring *r, uint32_t *queue, uint32_t (*triangles)[3]) {
    uint32_t count = 0, left = r->places, head = 0, tail = 0, alive = 0;
    /* Every second place, then those between: that spreads the ears and avoids fans of slivers. */
    for (uint32_t i = 0; i < left; i += 2) queue[tail++] = i;
    for (uint32_t i = 1; i < left; i += 2) queue[tail++] = i;
    while (left > 3) {
        uint32_t place;
        if (head < tail) {
            place = queue[head++];
            if (r->next[place] == NONE || !is_ear(r, place)) continue;
        } else {
            place = least_bad(r, alive, left);
        }
        uint32_t p = r->prev[place], n = r->next[place];
        if (p == n) return 0;
        cut(r, place, triangles, count++);
        queue[tail++] = p;
        queue[tail++] = alive = n;
        left--;
    }
    uint32_t last = r->next[alive];
    if (r->next[last] != r->prev[alive] || r->next[last] == alive) return 0;
    cut(r, r->prev[last], triangles, count);
    use_edge(r, last, count * 3 + 2);
    return count + 1;
}

/* ---- Delaunay flips ---- */

/* The next corner of the same triangle: corners are numbered 3 * triangle + k. */
static uint32_t turned(uint32_t corner) { return corner % 3 == 2 ? corner - 2 : corner + 1; }

/* d inside the circle of the counter-clockwise triangle a b c? Doubles in a fixed order: the same on every platform. */
static bool in_circle(lathe_point a, lathe_point b, lathe_point c, lathe_point d) {
    double ax = (double)a.x - d.x, ay = (double)a.y - d.y, bx = (double)b.x - d.x, by = (double)b.y - d.y;
    double cx = (double)c.x - d.x, cy = (double)c.y - d.y;
    double aa = ax * ax + ay * ay, bb = bx * bx + by * by, cc = cx * cx + cy * cy;
    double det = ax * (by * cc - cy * bb) - ay * (bx * cc - cx * bb) + aa * (bx * cy - cx * by);
    double size = aa * bb + bb * cc + cc * aa;
    return det > size * 1e-9;
}

/* settled: of corners, zeroed: their edge was left as it is, and neither of its triangles has changed since. */
static void flip(uint32_t *corner, uint32_t *neighbour, uint8_t *settled, const lathe_point *at, uint32_t count) {
    bool changed = count > 1;
    for (int turns = 0; changed && turns < FLIP_TURNS; turns++) {
        changed = false;
        for (uint32_t i = 0; i < count * 3; i++) {
            if (settled[i]) continue;
            settled[i] = 1;
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
            const uint32_t beside[4] = {ca, ad, db, bc};
            for (int k = 0; k < 3; k++) settled[p + k] = settled[q + k] = 0;
            for (int k = 0; k < 4; k++)
                if (beside[k] != NONE) settled[beside[k]] = 0;
            changed = true;
        }
    }
}

/* By leftmost x: to the left of a hole lies only what is already joined. */
static void sort_holes(const ring *r, uint32_t *hole, uint32_t count) {
    for (uint32_t gap = count / 2; gap; gap /= 2)
        for (uint32_t i = gap; i < count; i++) {
            uint32_t moved = hole[i], j = i;
            for (; j >= gap && r->at[hole[j - gap]].x > r->at[moved].x; j -= gap) hole[j] = hole[j - gap];
            hole[j] = moved;
        }
}

lathe_status lathe__triangulate(uint32_t (**triangles)[3], uint32_t **neighbour, uint32_t *count, lathe_arena *arena,
                                const lathe_polygon *polygon) {
    uint32_t nodes = polygon->ring_end[polygon->ring_count - 1], holes = polygon->ring_count - 1;
    uint32_t places = nodes + 2 * holes, want = places - 2;
    ring r = {.positions = polygon->at};
    r.at = LATHE_NEW(arena, lathe_point, places);
    uint32_t *room = LATHE_NEW(arena, uint32_t, (size_t)places * 9 + holes + 1);
    *triangles = lathe__arena_alloc(arena, want, sizeof **triangles);
    *neighbour = LATHE_NEW(arena, uint32_t, (size_t)want * 3);
    if (!r.at || !room || !*triangles || !*neighbour) return LATHE_ERR_MEMORY;
    r.node = room;
    r.next = room + places;
    r.prev = room + 2 * (size_t)places;
    r.end = room + 3 * (size_t)places;
    r.twin = room + 4 * (size_t)places;
    r.across = room + 5 * (size_t)places;
    r.neighbour = *neighbour;
    uint32_t *queue = room + 6 * (size_t)places, *hole = room + 9 * (size_t)places;
    for (uint32_t i = 0, begin = 0; i <= holes; begin = polygon->ring_end[i++])
        hole[i] = add_ring(&r, polygon->nodes + begin, polygon->ring_end[i] - begin);
    r.rim = nodes;
    r.few = !holes && nodes <= FEW;
    lathe_status status = r.few ? LATHE_OK : build_grid(&r, arena);
    if (status) return status;
    sort_holes(&r, hole + 1, holes);
    for (uint32_t i = 1; i <= holes; i++) bridge_hole(&r, hole[i]);
    *count = clip_ears(&r, queue, *triangles);
    if (!*count) return LATHE_ERR_FORMAT;
    /* The queue has served: it has more bytes than there are corners. */
    memset(queue, 0, (size_t)*count * 3);
    flip(**triangles, *neighbour, (uint8_t *)queue, polygon->at, *count);
    return LATHE_OK;
}
