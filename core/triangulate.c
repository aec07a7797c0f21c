/* Polygons with holes: holes are bridged, ears clipped, diagonals flipped towards Delaunay. Small ears first: they leave little to
 * flip, and little may lie in their way. What may is a corner that is not convex, found by a grid; cutting an ear changes its two
 * neighbours only, so the time grows about as the number of vertices does. Not for thousands of holes, as each looks at the bridges before
 * it, nor for a comb of thousands of teeth: 1 s for 25,000 of either. Exact for simple polygons; it ends also where rounding has folded one. */
#include <string.h>
#include "grid.h"
#include "overlay.h"

enum { NONE = 0xffffffffu, BRIDGE = 0x80000000u, PLACES_PER_CELL = 2, FLIP_TURNS = 48 };
enum { FEW = 32 };             /* so many places need no grid: most polygons of a slab have fewer */
enum { SMALL_EAR = 4 };        /* square of the length of the diagonals cut first, in those of a mean edge */

typedef struct place {
    lathe_point at;
    uint32_t node, next, prev;     /* places of one doubly linked ring; next is NONE once it is cut off */
    uint32_t end;                  /* where the edge that begins here ended before there were bridges */
    uint32_t twin;                 /* next place of the same node, cyclically: bridges begin and end in places of their own */
    uint32_t across;               /* what lies beyond the edge that begins here: a corner of a triangle; BRIDGE + the place where
                                    * the same bridge begins on its other side; NONE */
} place;

typedef struct ring {
    place *place;
    uint8_t *convex;               /* per place; 0 also if it has twins */
    uint32_t places;
    uint32_t *neighbour;           /* of corners */
    const lathe_point *positions;  /* node -> position */
    lathe_grid grid;               /* of the rings' edges, each numbered as its first place; without holes of places; if not few */
    bool few;
    uint32_t rim;                  /* places of the rings; behind them two for each bridge */
} ring;

static int64_t turn(const ring *r, uint32_t a, uint32_t b, uint32_t c) {
    return lathe__orient(r->place[a].at, r->place[b].at, r->place[c].at);
}

/* Does the place see another one through its interior angle? */
static bool in_cone(const ring *r, uint32_t at, uint32_t to) {
    uint32_t p = r->place[at].prev, n = r->place[at].next;
    int64_t s = turn(r, at, n, to), t = turn(r, p, at, to);
    return turn(r, p, at, n) > 0 ? s >= 0 && t >= 0 : s >= 0 || t >= 0;
}

static uint32_t add_place(ring *r, uint32_t node) {
    r->place[r->places] = (place){.at = r->positions[node], .node = node, .twin = r->places, .across = NONE};
    return r->places++;
}

static uint32_t add_twin(ring *r, uint32_t of) {
    uint32_t twin = add_place(r, r->place[of].node);
    r->place[twin].twin = r->place[of].twin;
    return r->place[of].twin = twin;
}

static void link_places(ring *r, uint32_t a, uint32_t b) {
    r->place[a].next = b;
    r->place[b].prev = a;
}

/* Returns the leftmost place of the new ring. */
static uint32_t add_ring(ring *r, const uint32_t *nodes, uint32_t count) {
    uint32_t first = r->places, leftmost = first;
    for (uint32_t i = 0; i < count; i++) {
        uint32_t at = add_place(r, nodes[i]), end = i + 1 < count ? at + 1 : first;
        r->place[at].next = r->place[at].end = end;
        r->place[at].prev = i ? at - 1 : first + count - 1;
        if (r->place[at].at.x < r->place[leftmost].at.x) leftmost = at;
    }
    return leftmost;
}

static lathe_status build_grid(ring *r, lathe_arena *arena, bool holes) {
    lathe_range *ranges = LATHE_NEW(arena, lathe_range, r->rim);
    if (!ranges) return LATHE_ERR_MEMORY;
    for (uint32_t i = 0; i < r->rim; i++) ranges[i] = lathe__range_of(r->place[i].at, r->place[holes ? r->place[i].next : i].at);
    return lathe__grid_build(&r->grid, arena, ranges, r->rim, r->rim / PLACES_PER_CELL + 1);
}

/* The edge or bridge that a ray from a hole's leftmost place to the left meets first, or NONE. */
static uint32_t first_on_the_left(const ring *r, uint32_t hole) {
    lathe_point h = r->place[hole].at;
    lathe_left nearest = LATHE_NOTHING_LEFT;
    uint32_t best = NONE;
    const lathe_grid *grid = &r->grid;
    int32_t y = h.y >> grid->shift;
    for (uint32_t i = r->rim; i < r->places; i += 2)
        if (lathe__is_nearer_left(&nearest, h, r->place[i].at, r->place[i + 1].at)) best = i;
    for (int32_t x = h.x >> grid->shift; x >= grid->cells.x0 && nearest.x < ((double)x + 1) * (1 << grid->shift); x--) {
        size_t cell = lathe__cell_at(grid, x, y);
        for (uint32_t k = grid->first[cell]; k < grid->first[cell + 1]; k++) {
            uint32_t i = grid->entry[k];
            if (i != hole && r->place[i].end != hole && lathe__is_nearer_left(&nearest, h, r->place[i].at, r->place[r->place[i].end].at)) best = i;
        }
    }
    return best;
}

/* A place that the hole's leftmost place sees: the edge that lies to its left has one end not to the right of it; whatever hides that
 * end lies in the triangle between, and of it the place nearest to the ray is seen. What lies to the left is joined already. */
static uint32_t place_to_bridge(const ring *r, uint32_t hole) {
    uint32_t edge = first_on_the_left(r, hole);
    if (edge == NONE) return 0;    /* only where rounding has folded the polygon */
    uint32_t end = r->place[edge].end, best = r->place[edge].at.x < r->place[end].at.x ? edge : end, seen;
    int side = turn(r, edge, end, hole) > 0 ? 1 : -1;
    lathe_point h = r->place[hole].at, p = r->place[best].at;
    int up = p.y >= h.y ? 1 : -1;
    lathe_range box = lathe__range_of(h, p), c = lathe__cells_of(&box, r->grid.shift);
    for (int32_t y = c.y0; y <= c.y1; y++)
        for (int32_t x = c.x0; x <= c.x1; x++) {
            size_t cell = lathe__cell_at(&r->grid, x, y);
            for (uint32_t k = r->grid.first[cell]; k < r->grid.first[cell + 1]; k++) {
                uint32_t i = r->grid.entry[k];
                lathe_point q = r->place[i].at;
                if (q.x >= h.x || (q.y - h.y) * up < 0 || turn(r, edge, end, i) * side <= 0) continue;
                int64_t side_of_best = turn(r, hole, best, i) * up;
                if (side_of_best > 0 || (side_of_best == 0 && q.x > r->place[best].at.x)) best = i;
            }
        }
    for (seen = r->place[best].twin; seen != best && !in_cone(r, seen, hole);) seen = r->place[seen].twin;
    return seen;
}

/* Joins a hole to the ring. */
static void bridge_hole(ring *r, uint32_t leftmost) {
    uint32_t at = place_to_bridge(r, leftmost), left2 = add_twin(r, leftmost), at2 = add_twin(r, at);
    uint32_t after = r->place[at].next, before = r->place[leftmost].prev;
    link_places(r, at, leftmost);
    link_places(r, before, left2);
    link_places(r, left2, at2);
    link_places(r, at2, after);
    r->place[left2].end = at2;
    uint32_t beyond = r->place[at].across;
    if (beyond != NONE) r->place[beyond - BRIDGE].across = BRIDGE + at2;
    r->place[at2].across = beyond;
    r->place[at].across = BRIDGE + left2;
    r->place[left2].across = BRIDGE + at;
}

static int32_t least(int32_t a, int32_t b) { return a < b ? a : b; }
static int32_t most(int32_t a, int32_t b) { return a > b ? a : b; }

static bool is_within(const lathe_range *box, lathe_point q) {
    return !((q.x < box->x0) | (q.x > box->x1) | (q.y < box->y0) | (q.y > box->y1));
}

static bool is_convex(const ring *r, uint32_t at) { return turn(r, r->place[at].prev, at, r->place[at].next) > 0; }

static bool same(lathe_point a, lathe_point b) { return a.x == b.x && a.y == b.y; }

/* Does place i lie within the triangle of another one and its neighbours, in whose box it is? */
static bool hides(const ring *r, uint32_t p, uint32_t at, uint32_t n, uint32_t i) {
    if (turn(r, n, p, i) < 0 || turn(r, p, at, i) < 0 || turn(r, at, n, i) < 0) return false;
    lathe_point q = r->place[i].at;
    return !same(q, r->place[p].at) && !same(q, r->place[at].at) && !same(q, r->place[n].at);
}

/* A convex place: does nothing lie in the triangle with its neighbours? What might must not be convex itself, nor cut off. */
static bool is_ear(const ring *r, uint32_t at) {
    uint32_t p = r->place[at].prev, n = r->place[at].next;
    lathe_point a = r->place[p].at, b = r->place[at].at, d = r->place[n].at;
    lathe_range box = {least(least(a.x, b.x), d.x), least(least(a.y, b.y), d.y), most(most(a.x, b.x), d.x), most(most(a.y, b.y), d.y)};
    if (r->few) {
        for (uint32_t i = 0; i < r->rim; i++)
            if (!r->convex[i] && is_within(&box, r->place[i].at) && hides(r, p, at, n, i)) return false;
        return true;
    }
    lathe_range c = lathe__cells_of(&box, r->grid.shift);
    for (int32_t y = c.y0; y <= c.y1; y++)
        for (int32_t x = c.x0; x <= c.x1; x++) {
            size_t cell = lathe__cell_at(&r->grid, x, y);
            for (uint32_t k = r->grid.first[cell]; k < r->grid.first[cell + 1]; k++) {
                uint32_t i = r->grid.entry[k];
                if (!r->convex[i] && is_within(&box, r->place[i].at) && hides(r, p, at, n, i)) return false;
            }
        }
    return true;
}

/* A node twice in a ring (a bridge) must not become a triangle with a repeated corner. */
static bool proper(const ring *r, uint32_t at) {
    uint32_t a = r->place[r->place[at].prev].node, b = r->place[at].node, c = r->place[r->place[at].next].node;
    return a != b && b != c && c != a;
}

static void join(uint32_t *neighbour, uint32_t a, uint32_t b) {
    neighbour[a] = b;
    if (b != NONE) neighbour[b] = a;
}

/* The edge that begins in a place becomes one of a triangle, from this corner to the next. */
static void use_edge(ring *r, uint32_t at, uint32_t corner) {
    uint32_t beyond = r->place[at].across;
    if (beyond < BRIDGE || beyond == NONE) join(r->neighbour, corner, beyond);
    else r->place[beyond - BRIDGE].across = corner;
}

/* Cuts off a place's triangle. */
static void cut(ring *r, uint32_t at, uint32_t (*triangles)[3], uint32_t index) {
    uint32_t p = r->place[at].prev, n = r->place[at].next, *t = triangles[index];
    t[0] = r->place[p].node;
    t[1] = r->place[at].node;
    t[2] = r->place[n].node;
    use_edge(r, p, index * 3);
    use_edge(r, at, index * 3 + 1);
    r->place[p].across = index * 3 + 2;
    link_places(r, p, n);
    r->place[at].next = NONE;
    if (r->place[at].twin == at) r->convex[at] = 1;   /* in nobody's way any more */
    if (r->place[p].twin == p) r->convex[p] = is_convex(r, p);
    if (r->place[n].twin == n) r->convex[n] = is_convex(r, n);
}

/* No ear anywhere: rounding has folded the polygon. Any convex place serves, else any proper one. */
static uint32_t least_bad(const ring *r, uint32_t at, uint32_t left) {
    uint32_t choice = at;
    for (uint32_t i = 0; i < left; i++, at = r->place[at].next) {
        if (!proper(r, at)) continue;
        choice = at;
        if (is_convex(r, at)) break;
    }
    return choice;
}

/* The square of an edge's mean length, or about. */
static uint64_t mean_edge2(const ring *r) {
    uint64_t sum = 0;
    for (uint32_t i = 0; i < r->rim; i++) sum += lathe__distance2(r->place[i].at, r->place[r->place[i].end].at) / r->rim;
    return sum;
}

/* queue: room for three times as many as there are places. Returns the number of triangles; 0 if a hole could not be joined: only
 * outlines that cross themselves have such. */
static uint32_t clip_ears(ring *r, uint32_t *queue, uint32_t (*triangles)[3]) {
    uint32_t count = 0, left = r->places, alive = 0;
    for (uint64_t limit = SMALL_EAR * mean_edge2(r) + 1; left > 3; limit = limit > UINT64_MAX / 4 ? UINT64_MAX : limit * 4) {
        uint32_t head = 0, tail = 0, before = left;
        /* Every second place, then those between: that spreads the ears and avoids fans of slivers. */
        for (uint32_t odd = 0; odd < 2; odd++)
            for (uint32_t i = odd, at = odd ? r->place[alive].next : alive; i < left; i += 2, at = r->place[r->place[at].next].next)
                queue[tail++] = at;
        while (left > 3 && head < tail) {
            uint32_t at = queue[head++], p = r->place[at].prev, n = r->place[at].next;
            if (n == NONE || lathe__distance2(r->place[p].at, r->place[n].at) > limit || !is_convex(r, at) || !is_ear(r, at)) continue;
            if (p == n) return 0;
            cut(r, at, triangles, count++);
            queue[tail++] = p;
            queue[tail++] = alive = n;
            left--;
        }
        if (left < before || left == 3 || limit < UINT64_MAX) continue;
        uint32_t at = least_bad(r, alive, left);
        if (r->place[at].prev == r->place[at].next) return 0;
        alive = r->place[at].next;
        cut(r, at, triangles, count++);
        left--;
    }
    uint32_t last = r->place[alive].next;
    if (r->place[last].next != r->place[alive].prev || r->place[last].next == alive) return 0;
    cut(r, r->place[last].prev, triangles, count);
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

typedef struct edge_stack {
    uint32_t *corner, count;
    uint8_t *waits;                /* per corner: it is in the stack */
} edge_stack;

static void push(edge_stack *stack, const uint32_t *neighbour, uint32_t i) {
    uint32_t j = neighbour[i];
    if (j == NONE || stack->waits[i] || stack->waits[j]) return;
    stack->waits[i] = 1;
    stack->corner[stack->count++] = i;
}

/* stack: room for every corner, nothing waits. */
static void flip(uint32_t *corner, uint32_t *neighbour, edge_stack *stack, const lathe_point *at, uint32_t count) {
    for (uint32_t i = count * 3; i--;) push(stack, neighbour, i);
    for (uint64_t turns = (uint64_t)count * FLIP_TURNS; stack->count && turns; turns--) {
        uint32_t i = stack->corner[--stack->count], j = neighbour[i], p = i - i % 3, q = j - j % 3;
        stack->waits[i] = 0;
        if (j == NONE || p == q) continue;
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
        for (uint32_t k = 0; k < 2; k++) {
            push(stack, neighbour, p + k);
            push(stack, neighbour, q + k);
        }
    }
}

/* By leftmost x: to the left of a hole lies only what is already joined. */
static void sort_holes(const ring *r, uint32_t *hole, uint32_t count) {
    for (uint32_t gap = count / 2; gap; gap /= 2)
        for (uint32_t i = gap; i < count; i++) {
            uint32_t moved = hole[i], j = i;
            for (; j >= gap && r->place[hole[j - gap]].at.x > r->place[moved].at.x; j -= gap) hole[j] = hole[j - gap];
            hole[j] = moved;
        }
}

lathe_status lathe__triangulate(uint32_t (**triangles)[3], uint32_t **neighbour, uint32_t *count, lathe_arena *arena,
                                const lathe_polygon *polygon) {
    uint32_t nodes = polygon->ring_end[polygon->ring_count - 1], holes = polygon->ring_count - 1;
    uint32_t places = nodes + 2 * holes, want = places - 2;
    ring r = {.positions = polygon->at, .rim = nodes, .few = !holes && nodes <= FEW};
    uint32_t *room = LATHE_NEW(arena, uint32_t, (size_t)places * 3 + holes + 1), *hole = room + 3 * (size_t)places;
    r.place = LATHE_NEW(arena, place, places);
    r.convex = LATHE_NEW(arena, uint8_t, (size_t)places * 3);
    *triangles = lathe__arena_alloc(arena, want, sizeof **triangles);
    *neighbour = LATHE_NEW(arena, uint32_t, (size_t)want * 3);
    if (!room || !r.place || !r.convex || !*triangles || !*neighbour) return LATHE_ERR_MEMORY;
    r.neighbour = *neighbour;
    for (uint32_t i = 0, begin = 0; i <= holes; begin = polygon->ring_end[i++])
        hole[i] = add_ring(&r, polygon->nodes + begin, polygon->ring_end[i] - begin);
    lathe_status status = r.few ? LATHE_OK : build_grid(&r, arena, holes);
    if (status) return status;
    sort_holes(&r, hole + 1, holes);
    for (uint32_t i = 1; i <= holes; i++) bridge_hole(&r, hole[i]);
    for (uint32_t i = 0; i < places; i++) r.convex[i] = r.place[i].twin == i && is_convex(&r, i);
    *count = clip_ears(&r, room, *triangles);
    if (!*count) return LATHE_ERR_FORMAT;
    /* Queue and marks have served: they have room for every corner. */
    edge_stack stack = {.corner = room, .waits = r.convex};
    memset(stack.waits, 0, (size_t)*count * 3);
    flip(**triangles, *neighbour, &stack, polygon->at, *count);
    return LATHE_OK;
}
