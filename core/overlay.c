/* The lifted overlay of a slab, in four steps:
 *   1. meetings: where the lower outline (side 0) crosses the upper one (side 1), ordered along each edge;
 *   2. cycles: boundaries of the cells of the symmetric difference. A cell of side P lies inside P and outside Q: it has P's
 *      outline forward outside Q and Q's outline backward inside P, and changes between them at every meeting;
 *   3. cells: cycles that bound one cell, an outer one and its holes; loops that share a cell are linked;
 *   4. triangles: strips between two chains are merged linearly, other cells triangulated; diagonals between two vertices of one
 *      outline are split at mid-height; an upright fan closes each edge that is crossed.
 * The surface is a graph over the plane plus uprights, so it cannot cross itself. Every outline edge is left with one triangle
 * in the slab, directed forward for side 0 and backward for side 1, so neighbouring slabs close.
 *
 * Everything is numbered in one row: vertices, the edges that begin in them and loops count on from side 0 to side 1; nodes are
 * the vertices, then the meetings, then what is added within cells. */
#include "overlay.h"
#include "grid.h"
#include <string.h>

enum { NONE = 0xffffffffu };
enum { ROOM = 64, SPACING = 8 }; /* lattice units: what rounding cannot bridge */
#ifdef LATHE_SMALL
enum { COUNTED = 0 };          /* nobody asks a small decoder how its joints turned out */
#else
enum { COUNTED = 1 };
#endif

typedef struct cycle {
    uint32_t first, count;     /* its nodes */
    uint32_t meetings;
    uint32_t loop;             /* one that it bounds a part of */
    uint64_t area;             /* twice, modulo 2^64: exact as a signed number */
    uint32_t parent;           /* cell: the cycle that stands for it */
    uint32_t next_hole;        /* chain of the holes of an outer cycle */
    uint8_t of;                /* P: the side the cell lies inside of */
    bool hole;
} cycle;

typedef struct overlay {
    const lathe_slab *slab;
    lathe_mesh_builder *builder;
    lathe_arena *arena;
    lathe_overlay_counts *counts;
    uint32_t upper, vertices;  /* side 1's first vertex; of both sides */
    uint32_t loops0, loops;    /* side 1's first loop; of both sides */
    lathe_point *at;           /* vertices and meetings -> position */
    uint32_t *next, *prev;     /* vertex -> vertex along its loop */
    uint32_t *loop;            /* vertex -> loop */
    uint32_t *loop_first;      /* loop -> first vertex; one more than there are */
    uint32_t *first;           /* edge -> its first meeting in `on`; one more than there are */
    uint32_t *on;              /* meetings edge by edge, in order */
    uint32_t *cycle;           /* sub-edge (edge + first[edge] + rank) -> the cycle it bounds, or NONE */
    lathe_grid rows;           /* edges by pixel row, horizontal ones left out. Of lattice outlines, */
    uint32_t *row, *row_chain; /* whose edges lie in one row each: row -> its first edge, edge -> the next one, or NONE */
    int32_t row0;              /* of row[0] */
    lathe_meeting *meetings;
    uint32_t meeting_count, meeting_capacity;
    uint32_t *nodes;           /* of all cycles */
    uint32_t nodes_used;
    cycle *cycles;
    uint32_t cycle_count;
    uint32_t *block;           /* loop -> a loop of its block */
    uint32_t *members;         /* block: how many loops of side 0, of side 1 */
    lathe_tube *tubes;         /* block: matched loops, once asked for */
    uint8_t *matched;          /* block: 0 not tried, 1 there is a tube, 2 there is none */
    uint32_t extra;            /* mesh index of the first meeting */
    uint32_t shift[2];         /* of vertices and of other nodes: mesh index less node, modulo 2^32 */
    bool harmed;               /* something is crowded */
} overlay;

static int side_of(const overlay *o, uint32_t vertex) { return vertex >= o->upper; }

/* ---- 1. meetings ---- */

static lathe_status link_vertices(overlay *o) {
    const lathe_outline *const *outline = o->slab->outline;
    uint32_t v = 0, l = 0, n = outline[0]->point_count + outline[1]->point_count;
    o->at = LATHE_NEW(o->arena, lathe_point, n);
    o->next = LATHE_NEW(o->arena, uint32_t, n);
    o->prev = LATHE_NEW(o->arena, uint32_t, n);
    o->loop = LATHE_NEW(o->arena, uint32_t, n);
    o->loop_first = LATHE_NEW(o->arena, uint32_t, outline[0]->loop_count + outline[1]->loop_count + 1);
    if (!o->at || !o->next || !o->prev || !o->loop || !o->loop_first) return LATHE_ERR_MEMORY;
    for (int s = 0; s < 2; s++) {
        o->upper = v;
        o->loops0 = l;
        if (outline[s]->point_count) memcpy(o->at + v, outline[s]->points, outline[s]->point_count * sizeof *o->at);
        for (uint32_t k = 0; k < outline[s]->loop_count; k++) {
            uint32_t begin = v;
            o->loop_first[l] = begin;
            for (uint32_t i = 0; i < outline[s]->loops[k].count; i++, v++) {
                o->next[v] = v + 1;
                o->prev[v] = v - 1;
                o->loop[v] = l;
            }
            o->next[v - 1] = begin;
            o->prev[begin] = v - 1;
            l++;
        }
    }
    o->loop_first[l] = o->vertices = v;
    o->loops = l;
    return LATHE_OK;
}

static lathe_status add_meeting(overlay *o, uint32_t a, uint32_t b, int64_t d1, int64_t d2, int64_t e1, int64_t e2) {
    if (o->meeting_count == o->meeting_capacity) {
        uint32_t capacity = o->meeting_capacity * 2 + 64;
        lathe_meeting *more = LATHE_NEW(o->arena, lathe_meeting, capacity);
        if (!more) return LATHE_ERR_MEMORY;
        if (o->meeting_count) memcpy(more, o->meetings, o->meeting_count * sizeof *more);
        o->meetings = more;
        o->meeting_capacity = capacity;
    }
    /* All coordinates are even and lattice ones multiples of 512: products stay below 2^53 within 512 pixels, and are exact. */
    double n0 = (double)(e1 < 0 ? -e1 : e1), n1 = (double)(d1 < 0 ? -d1 : d1);
    o->meetings[o->meeting_count++] = (lathe_meeting){
        .edge = {a, b}, .enters = e1 <= 0, .numerator = {n0, n1},
        .denominator = {n0 + (double)(e2 < 0 ? -e2 : e2), n1 + (double)(d2 < 0 ? -d2 : d2)},
    };
    return LATHE_OK;
}

static int32_t imin(int32_t a, int32_t b) { return a < b ? a : b; }
static int32_t imax(int32_t a, int32_t b) { return a > b ? a : b; }

/* Marks edge b of the upper outline. */
static void mark_crowded(overlay *o, uint32_t b) {
    uint8_t *crowded = o->slab->crowded - o->upper;
    crowded[b] = crowded[o->next[b]] = o->harmed = true;
}

/* Do edge a and edge b of the upper outline leave each other room? */
static bool have_room(const overlay *o, uint32_t a, uint32_t b) {
    uint32_t a1 = o->next[a], b1 = o->next[b];
    if (a == b) return true;
    if (b != a1 && lathe__comes_close(o->at, b, a, a1, ROOM)) return false;
    if (a != b1 && lathe__comes_close(o->at, a, b, b1, ROOM)) return false;
    return a < o->upper || b == a1 || a == b1 || !lathe__segments_meet(o->at, a, a1, b, b1);
}

static lathe_status test_edges(overlay *o, uint32_t a, uint32_t b) {
    uint32_t a1 = o->next[a], b1 = o->next[b];
    if (o->slab->crowded && !have_room(o, a, b)) mark_crowded(o, b);
    if (a >= o->upper) return LATHE_OK;
    int64_t d1 = lathe__turn(o->at, a, a1, b), d2 = lathe__turn(o->at, a, a1, b1);
    if ((d1 > 0) == (d2 > 0)) return LATHE_OK;
    int64_t e1 = lathe__turn(o->at, b, b1, a), e2 = lathe__turn(o->at, b, b1, a1);
    if ((e1 > 0) == (e2 > 0)) return LATHE_OK;
    if (COUNTED && (!d1 || !d2 || !e1 || !e2)) o->counts->contacts++;
    return add_meeting(o, a, b, d1, d2, e1, e2);
}

/* Both sides' edges as boxes, for `rows` (whole rows, without horizontal edges) or to find meetings. Where room is looked for, boxes have
 * it around them. */
static lathe_range *list_ranges(const overlay *o, bool rows) {
    lathe_range *ranges = LATHE_NEW(o->arena, lathe_range, o->vertices);
    for (uint32_t e = 0; ranges && e < o->vertices; e++) {
        lathe_range r = lathe__range_of(o->at[e], o->at[o->next[e]]);
        if (rows) {
            r.x0 = r.x1 = 0;
            if (r.y0 == r.y1) r.y1 -= LATHE_LATTICE_ONE;
        } else if (o->slab->crowded) {
            r.x0 -= ROOM, r.y0 -= ROOM, r.x1 += ROOM, r.y1 += ROOM;
        }
        ranges[e] = r;
    }
    return ranges;
}

/* The pixel square that a lattice outline's edge lies in. */
static lathe_point square_of(const overlay *o, uint32_t e) {
    lathe_point p = o->at[e], q = o->at[o->next[e]];
    return (lathe_point){imin(p.x, q.x) >> LATHE_LATTICE_BITS, imin(p.y, q.y) >> LATHE_LATTICE_BITS};
}

static uint32_t square_hash(lathe_point square, int bits) {
    return ((uint32_t)square.x * 0x9E3779B1u + (uint32_t)square.y * 0x85EBCA77u) >> (32 - bits);
}

/* The same for lattice outlines: an edge lies in one square, so the lower outline's edges are chained by a hash of their squares. */
static lathe_status find_lattice_meetings(overlay *o) {
    if (!o->upper || o->upper == o->vertices) return LATHE_OK;
    int bits = 32 - __builtin_clz(o->upper);
    lathe_point *square = LATHE_NEW(o->arena, lathe_point, o->upper);
    uint32_t *chain = LATHE_NEW(o->arena, uint32_t, o->upper), *head = LATHE_NEW(o->arena, uint32_t, (size_t)1 << bits);
    if (!square || !chain || !head) return LATHE_ERR_MEMORY;
    memset(head, 0xff, sizeof *head << bits);
    for (uint32_t e = o->upper; e--;) {   /* so that chains ascend */
        square[e] = square_of(o, e);
        uint32_t *first = &head[square_hash(square[e], bits)];
        chain[e] = *first;
        *first = e;
    }
    for (uint32_t f = o->upper; f < o->vertices; f++) {
        lathe_point p = square_of(o, f);
        for (uint32_t e = head[square_hash(p, bits)]; e != NONE; e = chain[e]) {
            if (square[e].x != p.x || square[e].y != p.y) continue;
            lathe_status status = test_edges(o, e, f);
            if (status) return status;
        }
    }
    return LATHE_OK;
}

static lathe_status find_meetings(overlay *o) {
    if (o->slab->lattice) return find_lattice_meetings(o);
    uint32_t below = o->slab->crowded ? o->vertices : o->upper;   /* what the upper outline is held against */
    if (!below || o->upper == o->vertices) return LATHE_OK;
    lathe_grid grid;
    const lathe_range *ranges = list_ranges(o, false);
    if (!ranges) return LATHE_ERR_MEMORY;
    lathe_status status = lathe__grid_build(&grid, o->arena, ranges, below, 4 * (uint64_t)below);
    if (status) return status;
    for (uint32_t f = o->upper; f < o->vertices; f++) {
        lathe_range b = lathe__cells_of(&ranges[f], grid.shift);
        for (int32_t y = imax(b.y0, grid.cells.y0); y <= imin(b.y1, grid.cells.y1); y++)
            for (int32_t x = imax(b.x0, grid.cells.x0); x <= imin(b.x1, grid.cells.x1); x++) {
                size_t c = lathe__cell_at(&grid, x, y);
                for (uint32_t i = grid.first[c]; i < grid.first[c + 1]; i++) {
                    uint32_t e = grid.entry[i];
                    if (!lathe__ranges_meet(&ranges[e], &ranges[f])) continue;
                    lathe_range a = lathe__cells_of(&ranges[e], grid.shift);
                    /* A pair that shares several cells is tested in the first of them. */
                    if (x != imax(a.x0, b.x0) || y != imax(a.y0, b.y0)) continue;
                    status = test_edges(o, e, f);
                    if (status) return status;
                }
            }
    }
    return o->harmed ? LATHE_ERR_RANGE : LATHE_OK;
}

/* Is meeting m before n on its edge of side s? */
static bool before(const lathe_meeting *m, const lathe_meeting *n, int s) {
    return lathe__compare_fractions((uint64_t)m->numerator[s], (uint64_t)m->denominator[s], (uint64_t)n->numerator[s],
                                    (uint64_t)n->denominator[s]) < 0;
}

/* Between two meetings of one edge rounding must not close a gap either: a spike's tip may be narrow where it is crossed. */
static void test_spacing(overlay *o, uint32_t m, uint32_t n) {
    lathe_range r = lathe__range_of(o->at[o->vertices + m], o->at[o->vertices + n]);
    if (r.x1 - r.x0 + r.y1 - r.y0 >= SPACING) return;
    mark_crowded(o, o->meetings[m].edge[1]);
    mark_crowded(o, o->meetings[n].edge[1]);
}

static lathe_status order_meetings(overlay *o) {
    uint32_t n = o->vertices, subs = n + 2 * o->meeting_count;
    o->first = LATHE_NEW(o->arena, uint32_t, n + 2);
    o->on = LATHE_NEW(o->arena, uint32_t, 2 * o->meeting_count);
    o->cycle = LATHE_NEW(o->arena, uint32_t, subs);
    if (!o->first || !o->on || !o->cycle) return LATHE_ERR_MEMORY;
    memset(o->first, 0, (n + 2) * sizeof *o->first);
    memset(o->cycle, 0xff, subs * sizeof *o->cycle);
    for (uint32_t i = 0; i < 2 * o->meeting_count; i++) o->first[o->meetings[i / 2].edge[i % 2] + 2]++;
    for (uint32_t e = 2; e < n + 2; e++) o->first[e] += o->first[e - 1];
    for (uint32_t i = 0; i < 2 * o->meeting_count; i++) o->on[o->first[o->meetings[i / 2].edge[i % 2] + 1]++] = i / 2;
    for (uint32_t begin = 0, end; begin < 2 * o->meeting_count; begin = end) {
        int s = begin >= o->meeting_count;   /* each meeting has an edge of either side */
        end = o->first[o->meetings[o->on[begin]].edge[s] + 1];
        for (uint32_t i = begin + 1; i < end; i++) {
            uint32_t m = o->on[i], j = i;
            for (; j > begin && before(&o->meetings[m], &o->meetings[o->on[j - 1]], s); j--) o->on[j] = o->on[j - 1];
            o->on[j] = m;
        }
        for (uint32_t i = begin; i < end; i++) {
            o->meetings[o->on[i]].rank[s] = i - begin;
            if (o->slab->crowded && i > begin) test_spacing(o, o->on[i - 1], o->on[i]);
        }
    }
    if (!o->harmed) return LATHE_OK;
    o->builder->mesh.vertex_count = o->extra;
    return LATHE_ERR_RANGE;
}

static lathe_status add_vertex(overlay *o, int32_t x, int32_t y, int32_t z) {
    lathe_status status = lathe__builder_reserve(o->builder, 1, 0);
    if (status) return status;
    int32_t *v = o->builder->mesh.lattice[o->builder->mesh.vertex_count++];
    v[0] = x, v[1] = y, v[2] = z;
    return LATHE_OK;
}

static int32_t mid_height(const overlay *o) { return o->slab->height[0] + (o->slab->height[1] - o->slab->height[0]) / 2; }

/* a + (b - a) * t, rounded to the nearest. */
static int32_t between(int32_t a, int32_t b, double t) {
    const int64_t shift = 1 << 30;   /* so that truncation rounds down */
    return a + (int32_t)((int64_t)((double)(b - a) * t + (double)shift + 0.5) - shift);
}

static lathe_status place_meetings(overlay *o) {
    lathe_point *at = LATHE_NEW(o->arena, lathe_point, (size_t)o->vertices + o->meeting_count);
    if (!at) return LATHE_ERR_MEMORY;
    memcpy(at, o->at, o->vertices * sizeof *at);
    o->at = at;
    o->extra = o->builder->mesh.vertex_count;
    o->shift[0] = o->slab->base;
    o->shift[1] = o->extra - o->vertices;
    for (uint32_t i = 0; i < o->meeting_count; i++) {
        const lathe_meeting *m = &o->meetings[i];
        lathe_point p = at[m->edge[0]], q = at[o->next[m->edge[0]]], *r = &at[o->vertices + i];
        double t = m->numerator[0] / m->denominator[0];
        r->x = between(p.x, q.x, t);
        r->y = between(p.y, q.y, t);
        lathe_status status = add_vertex(o, r->x, r->y, mid_height(o));
        if (status) return status;
    }
    return LATHE_OK;
}

/* ---- locating loops that meet nothing ---- */

/* The edge nearest to the left of a vertex, just above its height, or NONE. sides: bit s allows edges of side s. The vertex's
 * own edges do not count. */
static uint32_t nearest_left(const overlay *o, uint32_t vertex, int sides) {
    lathe_point at = o->at[vertex];
    uint32_t best = NONE;
    lathe_left nearest = LATHE_NOTHING_LEFT;
    int32_t y = at.y >> LATHE_LATTICE_BITS;
    bool chained = o->row;
    const uint32_t *first = chained ? NULL : o->rows.first + (y - o->rows.cells.y0);
    for (uint32_t i = chained ? o->row[y - o->row0] : first[0]; chained ? i != NONE : i < first[1]; i = chained ? o->row_chain[i] : i + 1) {
        uint32_t e = chained ? i : o->rows.entry[i];
        if (e == vertex || e == o->prev[vertex] || !(sides >> side_of(o, e) & 1)) continue;
        if (lathe__is_nearer_left(&nearest, at, o->at[e], o->at[o->next[e]])) best = e;
    }
    return best;
}

static bool goes_down(const overlay *o, uint32_t e) { return o->at[o->next[e]].y < o->at[e].y; }

static lathe_status chain_rows(overlay *o) {
    int32_t low = o->at[0].y, high = low;
    for (uint32_t e = 1; e < o->vertices; e++) low = imin(low, o->at[e].y), high = imax(high, o->at[e].y);
    low >>= LATHE_LATTICE_BITS, high >>= LATHE_LATTICE_BITS;
    size_t rows = (size_t)(high - low) + 1;
    o->row_chain = LATHE_NEW(o->arena, uint32_t, o->vertices);
    o->row = LATHE_NEW(o->arena, uint32_t, rows);
    o->row0 = low;
    if (!o->row || !o->row_chain) return LATHE_ERR_MEMORY;
    memset(o->row, 0xff, rows * sizeof *o->row);
    for (uint32_t e = o->vertices; e--;) {   /* so that chains ascend */
        int32_t y0 = o->at[e].y, y1 = o->at[o->next[e]].y;
        if (y0 == y1) continue;
        uint32_t *first = &o->row[(imin(y0, y1) >> LATHE_LATTICE_BITS) - low];
        o->row_chain[e] = *first;
        *first = e;
    }
    return LATHE_OK;
}

static lathe_status list_rows(overlay *o) {
    if (o->slab->lattice) return chain_rows(o);
    const lathe_range *ranges = list_ranges(o, true);
    return ranges ? lathe__grid_build(&o->rows, o->arena, ranges, o->vertices, UINT64_MAX) : LATHE_ERR_MEMORY;
}

/* Does a loop begin within the other region? */
static bool begins_inside(const overlay *o, uint32_t loop) {
    uint32_t begin = o->loop_first[loop], meeting = o->first[begin];
    if (meeting != o->first[o->loop_first[loop + 1]]) return o->meetings[o->on[meeting]].enters == (loop >= o->loops0);
    uint32_t e = nearest_left(o, begin, loop < o->loops0 ? 2 : 1);
    return e != NONE && goes_down(o, e);
}

/* ---- 2. cycles ---- */

/* Twice the area of the triangle with the origin. */
static uint64_t doubled(lathe_point a, lathe_point b) { return (uint64_t)((int64_t)a.x * b.y - (int64_t)a.y * b.x); }

/* Walks the boundary of a cell of side p from the sub-edge (edge, rank): forward if it is of p, else back. */
static void walk_cycle(overlay *o, int p, bool back, uint32_t edge, uint32_t rank) {
    uint32_t id = o->cycle_count++;
    cycle *c = &o->cycles[id];
    *c = (cycle){.first = o->nodes_used, .parent = id, .next_hole = NONE, .of = (uint8_t)p, .loop = o->loop[edge]};
    const uint32_t *first = o->first, *on = o->on;
    uint32_t *node = o->nodes + c->first;
    lathe_point last = {0, 0};
    for (;;) {
        uint32_t i = first[edge] + rank, *mark = &o->cycle[edge + i], meeting = NONE;
        if (*mark != NONE) break;
        *mark = id;
        if (back) {
            *node = i < first[edge + 1] ? o->vertices + on[i] : o->next[edge];
            if (rank) meeting = on[i - 1];
            else edge = o->prev[edge], rank = first[edge + 1] - first[edge];
        } else {
            *node = rank ? o->vertices + on[i - 1] : edge;
            if (i < first[edge + 1]) meeting = on[i];
            else edge = o->next[edge], rank = 0;
        }
        lathe_point here = o->at[*node++];
        c->area += doubled(last, here);
        last = here;
        if (meeting == NONE) continue;
        int other = !side_of(o, edge);
        back = !back;
        edge = o->meetings[meeting].edge[other];
        rank = o->meetings[meeting].rank[other] + !back;
        c->meetings++;
    }
    o->nodes_used = (uint32_t)(node - o->nodes);
    c->count = o->nodes_used - c->first;
    c->area += doubled(last, o->at[o->nodes[c->first]]);
}

static lathe_status find_cycles(overlay *o) {
    o->nodes = LATHE_NEW(o->arena, uint32_t, o->vertices + 2 * o->meeting_count);
    o->cycles = LATHE_NEW(o->arena, cycle, o->loops + o->meeting_count + 1);
    if (!o->nodes || !o->cycles) return LATHE_ERR_MEMORY;
    lathe_status status = list_rows(o);
    if (status) return status;
    for (uint32_t l = 0; l < o->loops; l++) {
        /* One cycle before the loop's first meeting, one behind each; inside and outside take turns. */
        bool inside = begins_inside(o, l);
        uint32_t edge = o->loop_first[l], rank = 0, meeting = o->first[edge], last = o->first[o->loop_first[l + 1]];
        int side = l >= o->loops0;
        for (;; meeting++) {
            if (o->cycle[edge + o->first[edge] + rank] == NONE) walk_cycle(o, side ^ inside, inside, edge, rank);
            if (meeting == last) break;
            edge = o->meetings[o->on[meeting]].edge[side];
            rank = o->meetings[o->on[meeting]].rank[side] + 1;
            inside = !inside;
        }
    }
    return LATHE_OK;
}

/* ---- 3. cells ---- */

static uint32_t find(uint32_t *parent, uint32_t i) {
    while (parent[i] != i) i = parent[i] = parent[parent[i]];
    return i;
}

static void unite(uint32_t *parent, uint32_t a, uint32_t b) {
    a = find(parent, a), b = find(parent, b);
    if (a < b) parent[b] = a;
    else parent[a] = b;
}

static uint32_t cell_of(const overlay *o, uint32_t c) {
    while (o->cycles[c].parent != c) c = o->cycles[c].parent;
    return c;
}

/* Does edge f, where it crosses e, go on upwards to the right of it? */
static bool passes_right(const overlay *o, uint32_t e, uint32_t f) {
    lathe_point a = o->at[e], b = o->at[o->next[e]], c = o->at[f], d = o->at[o->next[f]];
    int64_t turn = (int64_t)(b.x - a.x) * (d.y - c.y) - (int64_t)(b.y - a.y) * (d.x - c.x);
    return d.y != c.y && (turn < 0) == ((b.y < a.y) == (d.y < c.y));
}

/* The cycle that a hole shares its cell with: the one that bounds the sub-edge to its left. */
static uint32_t left_of_hole(const overlay *o, const cycle *c) {
    uint32_t leftmost = NONE;
    for (uint32_t i = 0; i < c->count; i++) {
        uint32_t n = o->nodes[c->first + i];
        if (n < o->vertices && (leftmost == NONE || o->at[n].x < o->at[leftmost].x)) leftmost = n;
    }
    uint32_t edge = leftmost == NONE ? NONE : nearest_left(o, leftmost, 3);
    if (edge == NONE) return NONE;
    /* At the very height of a meeting rounding hides which edge comes first: above it, the one to the right. */
    for (uint32_t i = o->first[edge]; i < o->first[edge + 1]; i++) {
        uint32_t other = o->meetings[o->on[i]].edge[!side_of(o, edge)];
        if (o->at[o->vertices + o->on[i]].y != o->at[leftmost].y || !passes_right(o, edge, other)) continue;
        edge = other;
        break;
    }
    bool down = goes_down(o, edge);
    uint32_t sub = edge + o->first[edge];
    for (uint32_t i = o->first[edge]; i < o->first[edge + 1]; i++)
        sub += (o->at[o->vertices + o->on[i]].y > o->at[leftmost].y) == down;
    return o->cycle[sub];
}

static lathe_status group_cells(overlay *o) {
    for (uint32_t i = 0; i < o->cycle_count; i++) {
        cycle *c = &o->cycles[i];
        c->hole = (int64_t)c->area < 0;
        if (!c->hole) continue;
        uint32_t other = left_of_hole(o, c);
        if (other != NONE && o->cycles[other].of == c->of && cell_of(o, other) != i) c->parent = other;
    }
    for (uint32_t i = 0; i < o->cycle_count; i++) {
        uint32_t cell = cell_of(o, i);
        o->cycles[i].parent = cell;
        if (cell == i) continue;
        o->cycles[i].next_hole = o->cycles[cell].next_hole;
        o->cycles[cell].next_hole = i;
    }
    return LATHE_OK;
}

/* Links [Park & Kim 3.1, by overlap of the regions]: loops that bound a common cell, or meet, belong to one block. */
static lathe_status link_loops(overlay *o) {
    uint32_t loops = o->loops;
    o->block = LATHE_NEW(o->arena, uint32_t, loops);
    uint32_t *members = o->members = LATHE_NEW(o->arena, uint32_t, (size_t)loops * 2);
    o->tubes = LATHE_NEW(o->arena, lathe_tube, loops);
    o->matched = LATHE_NEW(o->arena, uint8_t, loops);
    if (!o->block || !members || !o->tubes || !o->matched) return LATHE_ERR_MEMORY;
    memset(o->matched, 0, loops);
    memset(members, 0, (size_t)loops * 2 * sizeof *members);
    for (uint32_t i = 0; i < loops; i++) o->block[i] = i;
    /* A cycle changes from loop to loop at meetings only. */
    for (uint32_t m = 0; m < o->meeting_count; m++)
        unite(o->block, o->loop[o->meetings[m].edge[0]], o->loop[o->meetings[m].edge[1]]);
    for (uint32_t i = 0; i < o->cycle_count; i++) unite(o->block, o->cycles[i].loop, o->cycles[o->cycles[i].parent].loop);
    for (uint32_t i = 0; i < loops; i++) members[find(o->block, i) * 2 + (i >= o->loops0)]++;
    for (uint32_t i = 0; COUNTED && i < loops; i++) {
        uint32_t a = members[i * 2], b = members[i * 2 + 1];
        if (a + b) o->counts->links[a + b == 1 || !a || !b ? 0 : a == 1 && b == 1 ? 1 : a == 1 || b == 1 ? 2 : 3]++;
    }
    return LATHE_OK;
}

/* ---- 4. triangles ---- */

static uint32_t mesh_vertex(const overlay *o, uint32_t node) { return node + o->shift[node >= o->vertices]; }

/* side of a node: 0, 1, or 2 for a meeting */
static int node_side(const overlay *o, uint32_t node) { return (node >= o->upper) + (node >= o->vertices); }

/* A triangle of nodes, counter-clockwise in the plane; p: the side its cell is inside of. */
static void emit(overlay *o, int p, uint32_t a, uint32_t b, uint32_t c) {
    uint32_t *t = o->builder->mesh.triangles[o->builder->mesh.triangle_count++];
    t[0] = mesh_vertex(o, a);
    t[1 + p] = mesh_vertex(o, b);
    t[2 - p] = mesh_vertex(o, c);
}

typedef struct strip {
    uint32_t *p, *q;           /* nodes of the chains, in the same direction, the cell on the left of p */
    uint32_t m, n;             /* last index of each chain; closed chains end with the node they begin with */
    const float *target;       /* per index of p: the index of q that the trees match it with; NULL: the shorter diagonal decides */
} strip;

/* Merges two chains by the shorter diagonal; false if some triangle would not be counter-clockwise (nothing is kept then).
 * All counter-clockwise and bounded by the cell's boundary: then they tile the cell. */
static bool merge_strip(overlay *o, int side, const strip *s, bool open) {
    uint32_t *count = &o->builder->mesh.triangle_count, keep = *count;
    const uint32_t *p = s->p, *q = s->q, *last_p = p + s->m, *last_q = q + s->n;
    const lathe_point *at = o->at;
    if (open) {
        /* Both chains begin at one meeting and end at another. */
        if (lathe__turn(at, p[0], p[1], q[1]) <= 0 || lathe__turn(at, last_p[-1], *last_p, last_q[-1]) <= 0) return false;
        emit(o, side, p[0], p[1], q[1]);
        emit(o, side, last_p[-1], *last_p, last_q[-1]);
        p++, q++, last_p--, last_q--;
    }
    const float *target = s->target ? s->target + (p - s->p) : NULL;
    lathe_point a = at[*p], b = at[*q];
    while (p < last_p || q < last_q) {
        lathe_point next_a = at[p < last_p ? p[1] : *p], next_b = at[q < last_q ? q[1] : *q];
        bool can_p = lathe__orient(a, next_a, b) > 0, can_q = lathe__orient(a, next_b, b) > 0;   /* a chain's end does not turn */
        if (target && p < last_p && q < last_q) {
            /* Corresponding edges leave the choice of their diagonal; a corresponding vertex waits. */
            float j = (float)(q - s->q);
            if (target[1] <= j) can_q = false;
            else if (target[1] > j + 1 || target[0] >= j + 1) can_p = false;
        }
        if (can_p && can_q) can_p = lathe__distance2(next_a, b) <= lathe__distance2(a, next_b);
        if (can_p) {
            emit(o, side, *p, p[1], *q);
            p++;
            if (target) target++;
            a = next_a;
        } else if (can_q) {
            emit(o, side, *p, q[1], *q);
            q++;
            b = next_b;
        } else {
            *count = keep;
            return false;
        }
    }
    return true;
}

/* The tube of a one-to-one link, or NULL: then some other link, or a contour without a tree. */
static const lathe_tube *tube_of(overlay *o, uint32_t node) {
    uint32_t block = find(o->block, o->loop[node]);
    if (o->members[block * 2] != 1 || o->members[block * 2 + 1] != 1) return NULL;
    if (!o->matched[block]) {
        uint32_t other = o->loops0;
        while (find(o->block, other) != block) other++;
        lathe_status status = lathe__match_loops(&o->tubes[block], o->arena, o->slab->outline[0], block, o->slab->outline[1], other - o->loops0);
        o->matched[block] = status ? 2 : 1;
    }
    return o->matched[block] == 1 ? &o->tubes[block] : NULL;
}

/* Position of a vertex within its loop, and the size of that loop. */
static uint32_t place_in_loop(const overlay *o, uint32_t node, uint32_t *size) {
    const uint32_t *first = &o->loop_first[o->loop[node]];
    *size = first[1] - first[0];
    return node - first[0];
}

static float partner_of(const overlay *o, const lathe_tube *tube, uint32_t node) {
    uint32_t size, place = place_in_loop(o, node, &size);
    return tube->partner[side_of(o, node)][place];
}

/* For each vertex of p (begin .. end) the index along q of its partner; q[from] is a vertex. backward: both chains run against their
 * loops. */
static float *tree_targets(overlay *o, const lathe_tube *tube, const strip *s, uint32_t begin, uint32_t end, uint32_t from, bool closed,
                           bool backward) {
    float *target = LATHE_NEW(o->arena, float, s->m + 2);
    if (!target) return NULL;
    uint32_t other, origin = place_in_loop(o, s->q[from], &other);
    for (uint32_t i = 0; i <= s->m; i++) target[i] = i < begin ? 0 : (float)s->n;
    for (uint32_t i = begin; i < end; i++) {
        float t = partner_of(o, tube, s->p[i]) - (float)origin;
        if (backward) t = -t;
        if (t < 0) t += (float)other;
        /* A partner outside of this strip's chain: before its begin or behind its end, whichever is nearer. */
        if (closed ? i <= s->m / 4 && t > (float)other * 0.75f : t > ((float)s->n + (float)other) / 2) t = 0;
        if (closed && i >= s->m - s->m / 4 && t < (float)other * 0.25f) t = (float)other;
        target[i] = t + (float)from;
    }
    return target;
}

/* Fills a strip: by the trees if its link is one-to-one, else by the shorter diagonals; false: nothing was emitted.
 * ends: how many nodes at either end of a chain are no vertices (1: an open strip, 0: a ring). */
static bool fill_strip(overlay *o, int p, strip *s, uint32_t ends) {
    const lathe_tube *tube = tube_of(o, s->p[ends]);
    if (tube) {
        s->target = tree_targets(o, tube, s, ends, s->m, ends, !ends, side_of(o, s->p[ends]) != p);
        if (s->target && merge_strip(o, p, s, ends)) {
            o->counts->tree_strips += COUNTED;
            return true;
        }
        s->target = NULL;
    }
    return merge_strip(o, p, s, ends);
}

static bool new_strip(strip *s, lathe_arena *arena, uint32_t m, uint32_t n) {
    *s = (strip){.p = LATHE_NEW(arena, uint32_t, m + n + 2), .m = m, .n = n};
    s->q = s->p + m + 1;
    return s->p;
}

/* A cell between one chain of each side, from meeting to meeting. */
static bool try_open_strip(overlay *o, const cycle *c) {
    const uint32_t *n = o->nodes + c->first;
    uint32_t first = NONE, second = NONE;
    for (uint32_t i = 0; i < c->count; i++)
        if (n[i] >= o->vertices) {
            if (first == NONE) first = i;
            else second = i;
        }
    if (second == NONE) return false;
    /* Two chains in walking order: first..second and second..first; the second one is taken backwards. */
    uint32_t m = second - first, k = c->count - m;
    strip s;
    if (m < 2 || k < 2 || !new_strip(&s, o->arena, m, k)) return false;
    for (uint32_t i = 0; i <= m; i++) s.p[i] = n[first + i];
    for (uint32_t i = 0; i <= k; i++) s.q[i] = n[(second + k - i) % c->count];
    return fill_strip(o, c->of, &s, 1);
}

/* A ring between a loop of each side that do not meet. */
static bool try_ring_strip(overlay *o, const cycle *outer, const cycle *hole) {
    const uint32_t *p = o->nodes + outer->first, *q = o->nodes + hole->first;
    uint32_t from = 0, size;
    uint64_t least = UINT64_MAX;
    const lathe_tube *tube = tube_of(o, p[0]);
    if (tube) {
        /* Begin where the trees do: at the partner of the outer loop's first vertex. */
        float partner = partner_of(o, tube, p[0]);
        uint32_t want = (uint32_t)partner;
        if (side_of(o, p[0]) != outer->of && (float)want < partner) want = want + 1 < hole->count ? want + 1 : 0;
        while (from < hole->count && place_in_loop(o, q[from], &size) != want) from++;
        if (from == hole->count) from = 0;
        else least = 0;
    }
    for (uint32_t i = 0; least != 0 && i < hole->count; i++) {
        uint64_t d = lathe__distance2(o->at[p[0]], o->at[q[i]]);
        if (d < least) { least = d; from = i; }
    }
    strip s;
    if (!new_strip(&s, o->arena, outer->count, hole->count)) return false;
    for (uint32_t i = 0; i <= s.m; i++) s.p[i] = p[i % s.m];
    for (uint32_t i = 0; i <= s.n; i++) s.q[i] = q[(from + s.n - i) % s.n];
    return fill_strip(o, outer->of, &s, 0);
}

/* Corners a b c with middles on some edges (NONE: none), split so that no triangle lies flat in a slice. */
static void emit_split(overlay *o, int p, const uint32_t v[3], const uint32_t mid[3]) {
    int count = (mid[0] != NONE) + (mid[1] != NONE) + (mid[2] != NONE), k = 0;
    if (count == 3) {
        for (; k < 3; k++) emit(o, p, v[k], mid[k], mid[(k + 2) % 3]);
        emit(o, p, mid[0], mid[1], mid[2]);
        return;
    }
    /* The only edge that is split, or the only one that is not: from a to b; c is opposite. */
    while (count && (mid[k] != NONE) != (count == 1)) k++;
    uint32_t a = v[k], b = v[(k + 1) % 3], c = v[(k + 2) % 3], bc = mid[(k + 1) % 3], ca = mid[(k + 2) % 3];
    if (count == 0) {
        emit(o, p, a, b, c);
    } else if (count == 1) {
        emit(o, p, a, mid[k], c);
        emit(o, p, mid[k], b, c);
    } else {
        emit(o, p, ca, bc, c);
        emit(o, p, a, b, bc);
        emit(o, p, a, bc, ca);
    }
}

static uint32_t next_node(const overlay *o) { return o->vertices + o->builder->mesh.vertex_count - o->extra; }

/* Height of the middle of a chord; sides: of the cell's nodes. Over a single outline a cap of some shape, else half way. */
static int32_t height_over(const overlay *o, uint32_t sides, uint32_t shape, uint32_t a, uint32_t b) {
    int32_t rise = o->slab->cap;
    if (o->slab->caps) {
        int64_t x = o->at[a].x - o->at[b].x, y = o->at[a].y - o->at[b].y;
        rise = lathe__cap_rise(shape, x * x + y * y);
        if (COUNTED && sides < 3 && o->slab->caps->chord) o->slab->caps->chord(o->slab->caps, x * x + y * y);
    }
    return sides == 1 ? o->slab->height[0] + rise : sides == 2 ? o->slab->height[1] - rise : mid_height(o);
}

static lathe_status triangulate_cell(overlay *o, uint32_t id) {
    int p = o->cycles[id].of;
    uint32_t total = 0, rings = 0, sides = 0;
    for (uint32_t c = id; c != NONE; c = o->cycles[c].next_hole, rings++) total += o->cycles[c].count;
    lathe_polygon polygon = {.at = o->at, .ring_count = rings};
    polygon.nodes = LATHE_NEW(o->arena, uint32_t, total);
    polygon.ring_end = LATHE_NEW(o->arena, uint32_t, rings);
    if (!polygon.nodes || !polygon.ring_end) return LATHE_ERR_MEMORY;
    total = rings = 0;
    for (uint32_t c = id; c != NONE; c = o->cycles[c].next_hole) {
        for (uint32_t i = 0; i < o->cycles[c].count; i++) {
            uint32_t n = polygon.nodes[total++] = o->nodes[o->cycles[c].first + i];
            sides |= 1u << node_side(o, n);
        }
        polygon.ring_end[rings++] = total;
    }
    bool single = sides == 1 || sides == 2;
    if (COUNTED) ++*(single ? &o->counts->single_cells : &o->counts->other_cells);
    uint32_t(*t)[3], *neighbour, count;
    lathe_status status = lathe__triangulate(&t, &neighbour, &count, o->arena, &polygon);
    if (status) return status;
    const uint32_t *corner = (const uint32_t *)t;
    uint32_t *mid = LATHE_NEW(o->arena, uint32_t, (size_t)count * 3);
    if (!mid) return LATHE_ERR_MEMORY;
    memset(mid, 0xff, (size_t)count * 3 * sizeof *mid);
    status = lathe__builder_reserve(o->builder, 0, (size_t)count * 4);
    if (status) return status;
    uint32_t shape = 0;
    if (single && o->slab->caps) /* 3T - 2I edges bound the cell */
        shape = o->slab->caps->shape(o->slab->caps, &o->builder->mesh, count > 1 ? (count * 3 - total) / 2 : 1, sides >> 1);
    for (uint32_t i = 0; i < count * 3; i++) {
        uint32_t j = neighbour[i];
        if (j == NONE || j < i) continue;
        uint32_t a = corner[i], b = corner[i % 3 == 2 ? i - 2 : i + 1];
        if (a >= o->vertices || node_side(o, a) != node_side(o, b)) continue;
        mid[i] = mid[j] = next_node(o);
        status = add_vertex(o, (o->at[a].x + o->at[b].x) / 2, (o->at[a].y + o->at[b].y) / 2, height_over(o, sides, shape, a, b));
        if (status) return status;
    }
    for (uint32_t i = 0; i < count; i++) {
        const uint32_t *v = t[i];
        if (count > 1 || !single) {
            emit_split(o, p, v, mid + 3 * (size_t)i);
            continue;
        }
        /* A cell of one triangle of one outline has no diagonal: its centroid keeps it from lying flat. */
        uint32_t centre = next_node(o);
        int64_t x = 0, y = 0;
        for (int k = 0; k < 3; k++) {
            emit(o, p, v[k], v[(k + 1) % 3], centre);
            x += o->at[v[k]].x;
            y += o->at[v[k]].y;
        }
        return add_vertex(o, (int32_t)(x / 3), (int32_t)(y / 3), height_over(o, sides, shape, v[0], v[1]));
    }
    return LATHE_OK;
}

static lathe_status tile_cell(overlay *o, uint32_t id) {
    const cycle *c = &o->cycles[id], *hole = c->next_hole == NONE ? NULL : &o->cycles[c->next_hole];
    lathe_status status = lathe__builder_reserve(o->builder, 0, c->count + (hole ? hole->count : 0));
    if (status) return status;
    bool done = false;
    if (c->hole) {
        /* Only rounding folds a cell so. */
    } else if (!hole) {
        done = c->meetings == 2 && try_open_strip(o, c);
    } else if (!c->meetings && !hole->meetings && hole->next_hole == NONE &&
               side_of(o, o->nodes[c->first]) != side_of(o, o->nodes[hole->first])) {
        done = try_ring_strip(o, c, hole);
    }
    o->counts->strips += done * COUNTED;
    return done ? LATHE_OK : triangulate_cell(o, id);
}

/* One upright fan for each edge that is crossed: from its first end over the meetings to its other end. */
static lathe_status close_uprights(overlay *o) {
    lathe_status status = lathe__builder_reserve(o->builder, 0, 2 * (size_t)o->meeting_count);
    if (status) return status;
    for (uint32_t e = 0; e < o->vertices; e++) {
        uint32_t far = o->next[e];
        for (uint32_t i = o->first[e + 1]; i-- > o->first[e];) {
            uint32_t near = o->vertices + o->on[i];
            emit(o, side_of(o, e), e, far, near);
            far = near;
        }
    }
    return LATHE_OK;
}

lathe_status lathe__overlay_slab(lathe_mesh_builder *builder, lathe_arena *arena, const lathe_slab *slab, lathe_overlay_counts *counts) {
    overlay o = {.slab = slab, .builder = builder, .arena = arena, .counts = counts};
    lathe_status status = link_vertices(&o);
    if (status || !o.vertices) return status;
    static lathe_status (*const step[])(overlay *) = {find_meetings, place_meetings, order_meetings, find_cycles};
    for (size_t i = 0; i < sizeof step / sizeof *step; i++)
        if ((status = step[i](&o)) != LATHE_OK) return status;
    counts->crossings += o.meeting_count * COUNTED;
    if ((status = group_cells(&o)) != LATHE_OK || (status = link_loops(&o)) != LATHE_OK) return status;
    for (uint32_t i = 0; i < o.cycle_count; i++)
        if (o.cycles[i].parent == i && (status = tile_cell(&o, i)) != LATHE_OK) return status;
    return close_uprights(&o);
}
