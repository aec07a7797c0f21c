/* The lifted overlay of a slab, in four steps:
 *   1. meetings: where the lower outline (side 0) crosses the upper one (side 1), ordered along each edge;
 *   2. cycles: boundaries of the cells of the symmetric difference. A cell of side P lies inside P and outside Q: it has P's
 *      outline forward outside Q and Q's outline backward inside P, and changes between them at every meeting;
 *   3. cells: cycles that bound one cell, an outer one and its holes; loops that share a cell are linked;
 *   4. triangles: strips between two chains are merged linearly, other cells triangulated; diagonals between two vertices of one
 *      outline are split at mid-height; an upright fan closes each edge that is crossed.
 * The surface is a graph over the plane plus uprights, so it cannot cross itself. Every outline edge is left with one triangle
 * in the slab, directed forward for side 0 and backward for side 1, so neighbouring slabs close. */
#include "overlay.h"
#include <string.h>

enum { NONE = 0xffffffffu };

typedef struct side {
    const lathe_outline *outline;
    uint32_t *next, *prev;     /* vertex -> vertex along its loop */
    uint32_t *loop;            /* vertex -> loop */
    uint32_t *first;           /* edge -> its first meeting in `on`; first[count] ends */
    uint32_t *on;              /* meetings edge by edge, in order */
    uint32_t *cycle;           /* sub-edge (edge + first[edge] + rank) -> the cycle it bounds, or NONE */
    uint8_t *inside;           /* sub-edge: within the other region? */
    uint32_t *row_first, *row_edges;   /* edges by pixel row, built when a loop without meetings must be located */
} side;

typedef struct cycle {
    uint32_t first, count;     /* its nodes */
    uint32_t meetings;
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
    side side[2];
    uint32_t count[2];         /* vertices of each side */
    lathe_meeting *meetings;
    uint32_t meeting_count, meeting_capacity;
    lathe_point *at;           /* node -> position; nodes: side 0, side 1, meetings, then middles */
    uint32_t node_count;
    uint32_t *nodes;           /* of all cycles */
    uint32_t nodes_used;
    cycle *cycles;
    uint32_t cycle_count;
    uint32_t *block;           /* loop (side 0, then side 1) -> a loop of its block */
    uint32_t *members;         /* block: how many loops of side 0, of side 1 */
    lathe_tube *tubes;         /* block: matched loops, once asked for */
    uint8_t *matched;          /* block: 0 not tried, 1 there is a tube, 2 there is none */
    int32_t row0;
    uint32_t rows;
    uint32_t extra;            /* mesh index of the first meeting */
} overlay;

/* ---- 1. meetings ---- */

static lathe_status link_vertices(overlay *o, int s) {
    const lathe_outline *outline = o->slab->outline[s];
    side *d = &o->side[s];
    uint32_t n = outline->point_count;
    d->outline = outline;
    o->count[s] = n;
    d->next = LATHE_NEW(o->arena, uint32_t, n);
    d->prev = LATHE_NEW(o->arena, uint32_t, n);
    d->loop = LATHE_NEW(o->arena, uint32_t, n);
    if (n && (!d->next || !d->prev || !d->loop)) return LATHE_ERR_MEMORY;
    for (uint32_t l = 0; l < outline->loop_count; l++) {
        uint32_t first = outline->loops[l].first, count = outline->loops[l].count;
        for (uint32_t i = 0; i < count; i++) {
            d->next[first + i] = first + (i + 1 < count ? i + 1 : 0);
            d->prev[first + i] = first + (i ? i - 1 : count - 1);
            d->loop[first + i] = l;
        }
    }
    return LATHE_OK;
}

typedef struct box { int32_t x0, x1, y0, y1; } box;   /* grid cells, inclusive */

static int32_t imin(int32_t a, int32_t b) { return a < b ? a : b; }
static int32_t imax(int32_t a, int32_t b) { return a > b ? a : b; }

/* The grid cells an edge touches. In a lattice outline an edge lies within one pixel square, so a cell is enough. */
static box edge_box(const overlay *o, int s, uint32_t e, int shift) {
    lathe_point a = o->side[s].outline->points[e], b = o->side[s].outline->points[o->side[s].next[e]];
    int32_t less = o->slab->lattice ? 1 : 0;
    box r = {imin(a.x, b.x) >> shift, (imax(a.x, b.x) - less) >> shift, imin(a.y, b.y) >> shift, (imax(a.y, b.y) - less) >> shift};
    if (r.x1 < r.x0) r.x1 = r.x0;
    if (r.y1 < r.y0) r.y1 = r.y0;
    return r;
}

static double rounded(double v) { return (double)(int64_t)(v + 0.5); }

static lathe_status add_meeting(overlay *o, uint32_t a, uint32_t b, int64_t d1, int64_t d2, int64_t e1, int64_t e2) {
    if (o->meeting_count == o->meeting_capacity) {
        uint32_t capacity = o->meeting_capacity ? o->meeting_capacity * 2 : 64;
        lathe_meeting *more = LATHE_NEW(o->arena, lathe_meeting, capacity);
        if (!more) return LATHE_ERR_MEMORY;
        if (o->meeting_count) memcpy(more, o->meetings, o->meeting_count * sizeof *more);
        o->meetings = more;
        o->meeting_capacity = capacity;
    }
    lathe_point p = o->side[0].outline->points[a], q = o->side[0].outline->points[o->side[0].next[a]];
    lathe_meeting *m = &o->meetings[o->meeting_count++];
    m->edge[0] = a;
    m->edge[1] = b;
    /* All coordinates are even and lattice ones multiples of 512: products stay below 2^53 within 512 pixels, and are exact. */
    m->numerator[0] = (double)(e1 < 0 ? -e1 : e1);
    m->denominator[0] = m->numerator[0] + (double)(e2 < 0 ? -e2 : e2);
    m->numerator[1] = (double)(d1 < 0 ? -d1 : d1);
    m->denominator[1] = m->numerator[1] + (double)(d2 < 0 ? -d2 : d2);
    m->enters = e1 <= 0;
    double t = m->numerator[0] / m->denominator[0];
    m->x = p.x + (int32_t)(rounded((double)(q.x - p.x) * t + 1073741824.0) - 1073741824.0);
    m->y = p.y + (int32_t)(rounded((double)(q.y - p.y) * t + 1073741824.0) - 1073741824.0);
    return LATHE_OK;
}

static lathe_status test_edges(overlay *o, uint32_t a, uint32_t b) {
    const lathe_point *pa = o->side[0].outline->points, *pb = o->side[1].outline->points;
    lathe_point a0 = pa[a], a1 = pa[o->side[0].next[a]], b0 = pb[b], b1 = pb[o->side[1].next[b]];
    int64_t d1 = lathe__orient(a0, a1, b0), d2 = lathe__orient(a0, a1, b1);
    if ((d1 > 0) == (d2 > 0)) return LATHE_OK;
    int64_t e1 = lathe__orient(b0, b1, a0), e2 = lathe__orient(b0, b1, a1);
    if ((e1 > 0) == (e2 > 0)) return LATHE_OK;
    if (!d1 || !d2 || !e1 || !e2) o->counts->contacts++;
    return add_meeting(o, a, b, d1, d2, e1, e2);
}

static lathe_status find_meetings(overlay *o) {
    if (!o->count[0] || !o->count[1]) return LATHE_OK;
    int32_t x0 = INT32_MAX, y0 = INT32_MAX, x1 = INT32_MIN, y1 = INT32_MIN;
    const lathe_point *p = o->side[0].outline->points;
    for (uint32_t i = 0; i < o->count[0]; i++) {
        x0 = imin(x0, p[i].x), x1 = imax(x1, p[i].x), y0 = imin(y0, p[i].y), y1 = imax(y1, p[i].y);
    }
    int shift = LATHE_LATTICE_BITS;
    if (!o->slab->lattice)
        while (shift < 24 && (uint64_t)(((x1 - x0) >> shift) + 1) * (uint64_t)(((y1 - y0) >> shift) + 1) > 4 * (uint64_t)o->count[0])
            shift++;
    int32_t gx = x0 >> shift, gy = y0 >> shift, width = (x1 >> shift) - gx + 1, height = (y1 >> shift) - gy + 1;
    size_t cells = (size_t)width * (size_t)height, entries = 0;
    uint32_t *cell = LATHE_NEW(o->arena, uint32_t, cells + 2);
    if (!cell) return LATHE_ERR_MEMORY;
    memset(cell, 0, (cells + 2) * sizeof *cell);
    for (uint32_t e = 0; e < o->count[0]; e++) {
        box b = edge_box(o, 0, e, shift);
        for (int32_t y = b.y0; y <= b.y1; y++)
            for (int32_t x = b.x0; x <= b.x1; x++, entries++) cell[(size_t)(y - gy) * (size_t)width + (size_t)(x - gx) + 2]++;
    }
    if (entries > UINT32_MAX) return LATHE_ERR_LIMIT;
    for (size_t i = 2; i < cells + 2; i++) cell[i] += cell[i - 1];
    uint32_t *entry = LATHE_NEW(o->arena, uint32_t, entries);
    if (!entry) return LATHE_ERR_MEMORY;
    for (uint32_t e = 0; e < o->count[0]; e++) {
        box b = edge_box(o, 0, e, shift);
        for (int32_t y = b.y0; y <= b.y1; y++)
            for (int32_t x = b.x0; x <= b.x1; x++) entry[cell[(size_t)(y - gy) * (size_t)width + (size_t)(x - gx) + 1]++] = e;
    }
    for (uint32_t f = 0; f < o->count[1]; f++) {
        box b = edge_box(o, 1, f, shift);
        for (int32_t y = imax(b.y0, gy); y <= imin(b.y1, gy + height - 1); y++)
            for (int32_t x = imax(b.x0, gx); x <= imin(b.x1, gx + width - 1); x++) {
                size_t c = (size_t)(y - gy) * (size_t)width + (size_t)(x - gx);
                for (uint32_t i = cell[c]; i < cell[c + 1]; i++) {
                    box a = edge_box(o, 0, entry[i], shift);
                    /* A pair that shares several cells is tested in the first of them. */
                    if (x != imax(a.x0, b.x0) || y != imax(a.y0, b.y0)) continue;
                    lathe_status status = test_edges(o, entry[i], f);
                    if (status) return status;
                }
            }
    }
    return LATHE_OK;
}

/* Is meeting m before n on its edge of side s? */
static bool before(const lathe_meeting *m, const lathe_meeting *n, int s) {
    double l = m->numerator[s] * n->denominator[s], r = n->numerator[s] * m->denominator[s];
    double size = m->denominator[s] * n->denominator[s];
    if (l - r > size * 1e-14 || r - l > size * 1e-14) return l < r;
    return (__int128)(int64_t)m->numerator[s] * (int64_t)n->denominator[s] < (__int128)(int64_t)n->numerator[s] * (int64_t)m->denominator[s];
}

static lathe_status order_meetings(overlay *o, int s) {
    side *d = &o->side[s];
    uint32_t n = o->count[s];
    d->first = LATHE_NEW(o->arena, uint32_t, n + 2);
    d->on = LATHE_NEW(o->arena, uint32_t, o->meeting_count);
    d->cycle = LATHE_NEW(o->arena, uint32_t, n + o->meeting_count);
    d->inside = LATHE_NEW(o->arena, uint8_t, n + o->meeting_count);
    if (!d->first || !d->on || !d->cycle || !d->inside) return LATHE_ERR_MEMORY;
    memset(d->first, 0, (n + 2) * sizeof *d->first);
    memset(d->cycle, 0xff, (n + o->meeting_count) * sizeof *d->cycle);
    for (uint32_t m = 0; m < o->meeting_count; m++) d->first[o->meetings[m].edge[s] + 2]++;
    for (uint32_t e = 2; e < n + 2; e++) d->first[e] += d->first[e - 1];
    for (uint32_t m = 0; m < o->meeting_count; m++) d->on[d->first[o->meetings[m].edge[s] + 1]++] = m;
    for (uint32_t e = 0; e < n; e++) {
        uint32_t begin = d->first[e], end = d->first[e + 1];
        for (uint32_t i = begin + 1; i < end; i++) {
            uint32_t m = d->on[i], j = i;
            for (; j > begin && before(&o->meetings[m], &o->meetings[d->on[j - 1]], s); j--) d->on[j] = d->on[j - 1];
            d->on[j] = m;
        }
        for (uint32_t i = begin; i < end; i++) o->meetings[d->on[i]].rank[s] = i - begin;
    }
    return LATHE_OK;
}

/* ---- locating loops that meet nothing ---- */

static lathe_status index_rows(overlay *o) {
    int32_t low = INT32_MAX, high = INT32_MIN;
    for (int s = 0; s < 2; s++)
        for (uint32_t i = 0; i < o->count[s]; i++) {
            int32_t y = o->side[s].outline->points[i].y >> LATHE_LATTICE_BITS;
            low = imin(low, y), high = imax(high, y);
        }
    o->row0 = low;
    o->rows = (uint32_t)(high - low) + 1;
    for (int s = 0; s < 2; s++) {
        side *d = &o->side[s];
        const lathe_point *p = d->outline->points;
        d->row_first = LATHE_NEW(o->arena, uint32_t, o->rows + 2);
        if (!d->row_first) return LATHE_ERR_MEMORY;
        memset(d->row_first, 0, (o->rows + 2) * sizeof *d->row_first);
        size_t total = 0;
        for (int pass = 0; pass < 2; pass++) {
            for (uint32_t e = 0; e < o->count[s]; e++) {
                int32_t a = p[e].y, b = p[d->next[e]].y;
                if (a == b) continue;
                for (int32_t y = imin(a, b) >> LATHE_LATTICE_BITS; y <= imax(a, b) >> LATHE_LATTICE_BITS; y++) {
                    uint32_t *slot = &d->row_first[y - low + (pass ? 1 : 2)];
                    if (pass) d->row_edges[*slot] = e;
                    ++*slot;
                    total++;
                }
            }
            if (pass) break;
            if (total > UINT32_MAX) return LATHE_ERR_LIMIT;
            for (uint32_t i = 2; i < o->rows + 2; i++) d->row_first[i] += d->row_first[i - 1];
            d->row_edges = LATHE_NEW(o->arena, uint32_t, total);
            if (!d->row_edges) return LATHE_ERR_MEMORY;
        }
    }
    return LATHE_OK;
}

/* The edge of side s nearest to the left of a point, just above its height; NONE if there is none. skip: a vertex whose own edges
 * do not count. *x, *slope: where it is, for comparing sides. */
static uint32_t nearest_left(const overlay *o, int s, lathe_point at, uint32_t skip, double *x, double *slope) {
    const side *d = &o->side[s];
    uint32_t best = NONE;
    int32_t row = (at.y >> LATHE_LATTICE_BITS) - o->row0;
    if (row < 0 || (uint32_t)row >= o->rows) return NONE;
    for (uint32_t i = d->row_first[row]; i < d->row_first[row + 1]; i++) {
        uint32_t e = d->row_edges[i];
        if (skip != NONE && (e == skip || e == d->prev[skip])) continue;
        lathe_point a = d->outline->points[e], b = d->outline->points[d->next[e]];
        if (a.y > b.y) { lathe_point swap = a; a = b; b = swap; }
        if (at.y < a.y || at.y >= b.y || imin(a.x, b.x) > at.x) continue;
        double m = (double)(b.x - a.x) / (double)(b.y - a.y), ex = a.x + m * (double)(at.y - a.y);
        if (ex > at.x) continue;
        if (best == NONE || ex > *x || (ex == *x && m > *slope)) { best = e; *x = ex; *slope = m; }
    }
    return best;
}

static bool goes_down(const side *d, uint32_t e) { return d->outline->points[d->next[e]].y < d->outline->points[e].y; }

/* Is a vertex of side s within the region of the other side? */
static bool within_other(const overlay *o, int s, uint32_t vertex) {
    double x = 0, slope = 0;
    uint32_t e = nearest_left(o, 1 - s, o->side[s].outline->points[vertex], NONE, &x, &slope);
    return e != NONE && goes_down(&o->side[1 - s], e);
}

static lathe_status mark_inside(overlay *o, int s) {
    side *d = &o->side[s];
    for (uint32_t l = 0; l < d->outline->loop_count; l++) {
        uint32_t begin = d->outline->loops[l].first, end = begin + d->outline->loops[l].count;
        bool now;
        if (d->first[begin] != d->first[end]) {
            const lathe_meeting *m = &o->meetings[d->on[d->first[begin]]];
            now = m->enters == (s == 1);
        } else {
            if (o->count[1 - s] && !d->row_first) {
                lathe_status status = index_rows(o);
                if (status) return status;
            }
            now = o->count[1 - s] && within_other(o, s, begin);
        }
        for (uint32_t e = begin; e < end; e++) {
            uint32_t sub = e + d->first[e], last = e + d->first[e + 1];
            d->inside[sub] = now;
            while (sub++ < last) d->inside[sub] = now = !now;
        }
    }
    return LATHE_OK;
}

/* ---- 2. cycles ---- */

static uint32_t vertex_node(const overlay *o, int s, uint32_t v) { return s ? o->count[0] + v : v; }
static uint32_t meeting_node(const overlay *o, uint32_t m) { return o->count[0] + o->count[1] + m; }

/* Walks the boundary of a cell of side p from the forward sub-edge (edge, rank) of p, or, if `back`, from the backward sub-edge of
 * the other side. */
static void walk_cycle(overlay *o, int p, bool back, uint32_t edge, uint32_t rank) {
    uint32_t id = o->cycle_count++;
    cycle *c = &o->cycles[id];
    *c = (cycle){.first = o->nodes_used, .parent = id, .next_hole = NONE, .of = (uint8_t)p};
    for (;;) {
        int s = back ? 1 - p : p;
        side *d = &o->side[s];
        uint32_t *mark = &d->cycle[edge + d->first[edge] + rank];
        if (*mark != NONE) break;
        *mark = id;
        uint32_t meetings = d->first[edge + 1] - d->first[edge];
        if (!back) {
            o->nodes[o->nodes_used++] = rank ? meeting_node(o, d->on[d->first[edge] + rank - 1]) : vertex_node(o, s, edge);
            if (rank == meetings) { edge = d->next[edge]; rank = 0; continue; }
            const lathe_meeting *m = &o->meetings[d->on[d->first[edge] + rank]];
            back = true;
            edge = m->edge[1 - s];
            rank = m->rank[1 - s];
            c->meetings++;
        } else {
            o->nodes[o->nodes_used++] = rank < meetings ? meeting_node(o, d->on[d->first[edge] + rank]) : vertex_node(o, s, d->next[edge]);
            if (rank == 0) {
                edge = d->prev[edge];
                rank = d->first[edge + 1] - d->first[edge];
                continue;
            }
            const lathe_meeting *m = &o->meetings[d->on[d->first[edge] + rank - 1]];
            back = false;
            edge = m->edge[1 - s];
            rank = m->rank[1 - s] + 1;
            c->meetings++;
        }
    }
    c->count = o->nodes_used - c->first;
}

static lathe_status find_cycles(overlay *o) {
    size_t subs = (size_t)o->count[0] + o->count[1] + 2 * (size_t)o->meeting_count;
    o->nodes = LATHE_NEW(o->arena, uint32_t, subs);
    o->cycles = LATHE_NEW(o->arena, cycle, o->slab->outline[0]->loop_count + o->slab->outline[1]->loop_count + o->meeting_count + 1);
    if (!o->nodes || !o->cycles) return LATHE_ERR_MEMORY;
    for (int s = 0; s < 2; s++) {
        side *d = &o->side[s];
        for (uint32_t e = 0; e < o->count[s]; e++)
            for (uint32_t r = 0; r <= d->first[e + 1] - d->first[e]; r++) {
                uint32_t sub = e + d->first[e] + r;
                if (d->cycle[sub] == NONE) walk_cycle(o, d->inside[sub] ? 1 - s : s, d->inside[sub], e, r);
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

static bool turns_right(const overlay *o, const cycle *c) {
    const uint32_t *n = o->nodes + c->first;
    lathe_point p = o->at[n[0]];
    double area = 0;
    for (uint32_t i = 1; i + 1 < c->count; i++) {
        lathe_point a = o->at[n[i]], b = o->at[n[i + 1]];
        area += (double)(a.x - p.x) * (double)(b.y - p.y) - (double)(a.y - p.y) * (double)(b.x - p.x);
    }
    return area < 0;
}

/* The cycle that a hole shares its cell with: the one that bounds the sub-edge to its left. */
static uint32_t left_of_hole(const overlay *o, const cycle *c) {
    uint32_t base1 = o->count[0], outlines = base1 + o->count[1], leftmost = NONE;
    for (uint32_t i = 0; i < c->count; i++) {
        uint32_t n = o->nodes[c->first + i];
        if (n < outlines && (leftmost == NONE || o->at[n].x < o->at[leftmost].x)) leftmost = n;
    }
    if (leftmost == NONE) return NONE;
    lathe_point at = o->at[leftmost];
    int own = leftmost >= base1;
    double x[2] = {0, 0}, slope[2] = {0, 0};
    uint32_t edge[2];
    for (int s = 0; s < 2; s++) edge[s] = nearest_left(o, s, at, s == own ? leftmost - (own ? base1 : 0) : NONE, &x[s], &slope[s]);
    int s = edge[0] == NONE || (edge[1] != NONE && (x[1] > x[0] || (x[1] == x[0] && slope[1] > slope[0])));
    if (edge[s] == NONE) return NONE;
    const side *d = &o->side[s];
    bool down = goes_down(d, edge[s]);
    uint32_t rank = 0, meetings = d->first[edge[s] + 1] - d->first[edge[s]];
    for (uint32_t i = 0; i < meetings; i++) {
        int32_t y = o->meetings[d->on[d->first[edge[s]] + i]].y;
        rank += down ? y > at.y : y <= at.y;
    }
    return d->cycle[edge[s] + d->first[edge[s]] + rank];
}

static lathe_status group_cells(overlay *o) {
    for (uint32_t i = 0; i < o->cycle_count; i++) o->cycles[i].hole = turns_right(o, &o->cycles[i]);
    for (uint32_t i = 0; i < o->cycle_count; i++) {
        if (!o->cycles[i].hole) continue;
        if (!o->side[0].row_first) {
            lathe_status status = index_rows(o);
            if (status) return status;
        }
        uint32_t other = left_of_hole(o, &o->cycles[i]);
        if (other != NONE && o->cycles[other].of == o->cycles[i].of && cell_of(o, other) != i) o->cycles[i].parent = other;
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

static uint32_t node_loop(const overlay *o, uint32_t n) {
    uint32_t a = o->count[0];
    return n < a ? o->side[0].loop[n] : o->slab->outline[0]->loop_count + o->side[1].loop[n - a];
}

/* Links [Park & Kim 3.1, by overlap of the regions]: loops that bound a common cell, or meet, belong to one block. */
static lathe_status link_loops(overlay *o) {
    uint32_t loops0 = o->slab->outline[0]->loop_count, loops = loops0 + o->slab->outline[1]->loop_count;
    o->block = LATHE_NEW(o->arena, uint32_t, loops);
    uint32_t *members = o->members = LATHE_NEW(o->arena, uint32_t, (size_t)loops * 2);
    o->tubes = LATHE_NEW(o->arena, lathe_tube, loops);
    o->matched = LATHE_NEW(o->arena, uint8_t, loops);
    if (!o->block || !members || !o->tubes || !o->matched) return LATHE_ERR_MEMORY;
    memset(o->matched, 0, loops);
    for (uint32_t i = 0; i < loops; i++) o->block[i] = i;
    uint32_t outlines = o->count[0] + o->count[1];
    for (uint32_t i = 0; i < o->cycle_count; i++) {
        uint32_t seen = NONE;
        for (uint32_t c = o->cycles[i].parent == i ? i : NONE; c != NONE; c = o->cycles[c].next_hole)
            for (uint32_t k = 0; k < o->cycles[c].count; k++) {
                uint32_t n = o->nodes[o->cycles[c].first + k];
                if (n >= outlines) continue;
                uint32_t loop = node_loop(o, n);
                if (seen != NONE && loop != seen) unite(o->block, loop, seen);
                seen = loop;
            }
    }
    /* A cell between a chain and a single crossed edge has no vertex of that edge's loop. */
    for (uint32_t m = 0; m < o->meeting_count; m++)
        unite(o->block, o->side[0].loop[o->meetings[m].edge[0]], loops0 + o->side[1].loop[o->meetings[m].edge[1]]);
    memset(members, 0, (size_t)loops * 2 * sizeof *members);
    for (uint32_t i = 0; i < loops; i++) members[find(o->block, i) * 2 + (i >= loops0)]++;
    for (uint32_t i = 0; i < loops; i++) {
        uint32_t a = members[i * 2], b = members[i * 2 + 1];
        if (a + b) o->counts->links[a + b == 1 || !a || !b ? 0 : a == 1 && b == 1 ? 1 : a == 1 || b == 1 ? 2 : 3]++;
    }
    return LATHE_OK;
}

/* ---- 4. triangles ---- */

static uint32_t mesh_vertex(const overlay *o, uint32_t node) {
    uint32_t a = o->count[0], b = a + o->count[1];
    if (node < a) return o->slab->base[0] + node;
    if (node < b) return o->slab->base[1] + (node - a);
    return o->extra + (node - b);
}

/* side of a node: 0, 1, or 2 for a meeting */
static int node_side(const overlay *o, uint32_t node) {
    return node < o->count[0] ? 0 : node < o->count[0] + o->count[1] ? 1 : 2;
}

static void emit(overlay *o, int p, uint32_t a, uint32_t b, uint32_t c) {
    lathe_mesh *mesh = &o->builder->mesh;
    uint32_t *t = mesh->triangles[mesh->triangle_count++];
    t[0] = a;
    t[1] = p ? c : b;
    t[2] = p ? b : c;
}

static lathe_status add_vertex(overlay *o, int32_t x, int32_t y, int32_t z, uint32_t *index) {
    lathe_status status = lathe__builder_reserve(o->builder, 1, 0);
    if (status) return status;
    lathe_mesh *mesh = &o->builder->mesh;
    *index = mesh->vertex_count;
    int32_t *v = mesh->lattice[mesh->vertex_count++];
    v[0] = x, v[1] = y, v[2] = z;
    return LATHE_OK;
}

typedef struct strip {
    const uint32_t *p, *q;     /* nodes of the chains, in the same direction, the cell on the left of p */
    int64_t p_step, q_step;    /* 1 or -1: how to walk the array */
    uint32_t m, n;             /* last index of each chain */
    uint32_t p_size, q_size;   /* closed chains: modulus of the index; 0: open */
    const float *target;       /* per index of p: the index of q that the trees match it with; NULL: the shorter diagonal decides */
} strip;

static uint32_t strip_node(const uint32_t *nodes, int64_t step, uint32_t size, uint32_t i) {
    if (size && i >= size) i -= size;
    return nodes[step * (int64_t)i];
}

/* Merges two chains by the shorter diagonal; false if some triangle would not be counter-clockwise (nothing is kept then).
 * All counter-clockwise and bounded by the cell's boundary: then they tile the cell. */
static bool merge_strip(overlay *o, int p, const strip *s, bool open) {
    lathe_mesh *mesh = &o->builder->mesh;
    uint32_t keep = mesh->triangle_count, i = 0, j = 0, last_i = s->m, last_j = s->n;
    const lathe_point *at = o->at;
#define P(k) strip_node(s->p, s->p_step, s->p_size, k)
#define Q(k) strip_node(s->q, s->q_step, s->q_size, k)
    if (open) {
        /* Both chains begin at one meeting and end at another. */
        if (lathe__orient(at[P(0)], at[P(1)], at[Q(1)]) <= 0 || lathe__orient(at[P(s->m - 1)], at[P(s->m)], at[Q(s->n - 1)]) <= 0) return false;
        emit(o, p, mesh_vertex(o, P(0)), mesh_vertex(o, P(1)), mesh_vertex(o, Q(1)));
        emit(o, p, mesh_vertex(o, P(s->m - 1)), mesh_vertex(o, P(s->m)), mesh_vertex(o, Q(s->n - 1)));
        i = j = 1;
        last_i--;
        last_j--;
    }
    uint32_t a = P(i), b = Q(j);
    while (i < last_i || j < last_j) {
        uint32_t a1 = i < last_i ? P(i + 1) : a, b1 = j < last_j ? Q(j + 1) : b;
        bool can_p = i < last_i && lathe__orient(at[a], at[a1], at[b]) > 0;
        bool can_q = j < last_j && lathe__orient(at[a], at[b1], at[b]) > 0;
        if (s->target && i < last_i && j < last_j) {
            /* Corresponding edges leave the choice of their diagonal; a corresponding vertex waits. */
            float t = s->target[i + 1];
            if (t <= (float)j) can_q = false;
            else if (t > (float)(j + 1) || s->target[i] >= (float)(j + 1)) can_p = false;
        }
        if (can_p && can_q) {
            double dx = (double)at[a1].x - at[b].x, dy = (double)at[a1].y - at[b].y;
            double ex = (double)at[a].x - at[b1].x, ey = (double)at[a].y - at[b1].y;
            if (dx * dx + dy * dy <= ex * ex + ey * ey) can_q = false;
            else can_p = false;
        }
        if (can_p) {
            emit(o, p, mesh_vertex(o, a), mesh_vertex(o, a1), mesh_vertex(o, b));
            a = a1;
            i++;
        } else if (can_q) {
            emit(o, p, mesh_vertex(o, a), mesh_vertex(o, b1), mesh_vertex(o, b));
            b = b1;
            j++;
        } else {
            mesh->triangle_count = keep;
            return false;
        }
    }
#undef P
#undef Q
    return true;
}

/* The tube of a one-to-one link, or NULL: then some other link, or a contour without a tree. */
static const lathe_tube *tube_of(overlay *o, uint32_t node) {
    uint32_t block = find(o->block, node_loop(o, node));
    if (o->members[block * 2] != 1 || o->members[block * 2 + 1] != 1) return NULL;
    if (!o->matched[block]) {
        uint32_t loops0 = o->slab->outline[0]->loop_count, other = block;
        for (uint32_t l = loops0; l < loops0 + o->slab->outline[1]->loop_count; l++)
            if (find(o->block, l) == block) { other = l; break; }
        lathe_status status = lathe__match_loops(&o->tubes[block], o->arena, o->slab->outline[0], block, o->slab->outline[1], other - loops0);
        o->matched[block] = status ? 2 : 1;
    }
    return o->matched[block] == 1 ? &o->tubes[block] : NULL;
}

/* Position of a vertex node within its loop, and the size of that loop. */
static uint32_t place_in_loop(const overlay *o, uint32_t node, uint32_t *size) {
    int s = node >= o->count[0];
    uint32_t vertex = node - (s ? o->count[0] : 0);
    const lathe_loop *loop = &o->slab->outline[s]->loops[o->side[s].loop[vertex]];
    *size = loop->count;
    return vertex - loop->first;
}

static float partner_of(const overlay *o, const lathe_tube *tube, uint32_t node) {
    uint32_t size, place = place_in_loop(o, node, &size);
    return tube->partner[node >= o->count[0]][place];
}

/* For each vertex of p (begin .. end) the index along q of its partner; q[from] is a vertex. backward: both chains run against their
 * loops. */
static float *tree_targets(overlay *o, const lathe_tube *tube, const strip *s, uint32_t begin, uint32_t end, uint32_t from, bool closed,
                           bool backward) {
    float *target = LATHE_NEW(o->arena, float, s->m + 2);
    if (!target) return NULL;
    uint32_t other, origin = place_in_loop(o, strip_node(s->q, s->q_step, s->q_size, from), &other);
    for (uint32_t i = 0; i <= s->m; i++) target[i] = i < begin ? 0 : (float)s->n;
    for (uint32_t i = begin; i < end; i++) {
        float t = partner_of(o, tube, strip_node(s->p, s->p_step, s->p_size, i)) - (float)origin;
        if (backward) t = -t;
        if (t < 0) t += (float)other;
        /* A partner outside of this strip's chain: before its begin or behind its end, whichever is nearer. */
        if (closed ? i <= s->m / 4 && t > (float)other * 0.75f : t > ((float)s->n + (float)other) / 2) t = 0;
        if (closed && i >= s->m - s->m / 4 && t < (float)other * 0.25f) t = (float)other;
        target[i] = t + (float)from;
    }
    return target;
}

/* Walks the strip by the trees, if its link is one-to-one; false: nothing was emitted. */
static bool merge_by_trees(overlay *o, int p, strip *s, uint32_t begin, uint32_t end, uint32_t from, bool open) {
    uint32_t node = strip_node(s->p, s->p_step, s->p_size, begin);
    const lathe_tube *tube = tube_of(o, node);
    if (!tube) return false;
    s->target = tree_targets(o, tube, s, begin, end, from, !open, node_side(o, node) != p);
    if (s->target && merge_strip(o, p, s, open)) {
        o->counts->tree_strips++;
        return true;
    }
    s->target = NULL;
    return false;
}

/* A cell between one chain of each side, from meeting to meeting. */
static bool try_open_strip(overlay *o, const cycle *c) {
    const uint32_t *n = o->nodes + c->first;
    uint32_t first = NONE, second = NONE;
    for (uint32_t i = 0; i < c->count; i++)
        if (node_side(o, n[i]) == 2) {
            if (first == NONE) first = i;
            else second = i;
        }
    if (second == NONE) return false;
    /* Two chains in walking order: first..second and second..first; the second one is taken backwards. */
    uint32_t m = second - first, k = c->count - m;
    uint32_t *chain = LATHE_NEW(o->arena, uint32_t, c->count + 2);
    if (!chain) return false;
    for (uint32_t i = 0; i <= m; i++) chain[i] = n[first + i];
    for (uint32_t i = 0; i <= k; i++) chain[m + 1 + i] = n[(second + i) % c->count];
    strip s = {.p = chain, .q = chain + m + 1 + k, .p_step = 1, .q_step = -1, .m = m, .n = k};
    if (m < 2 || k < 2) return false;
    return merge_by_trees(o, c->of, &s, 1, m, 1, true) || merge_strip(o, c->of, &s, true);
}

/* A ring between a loop of each side that do not meet. */
static bool try_ring_strip(overlay *o, const cycle *outer, const cycle *hole) {
    const uint32_t *p = o->nodes + outer->first, *q = o->nodes + hole->first;
    uint32_t from = 0, size;
    double least = -1;
    const lathe_tube *tube = tube_of(o, p[0]);
    if (tube) {
        /* Begin where the trees do: at the partner of the outer loop's first vertex. */
        float partner = partner_of(o, tube, p[0]);
        uint32_t want = (uint32_t)partner;
        if (node_side(o, p[0]) != outer->of && (float)want < partner) want = want + 1 < hole->count ? want + 1 : 0;
        while (from < hole->count && place_in_loop(o, q[from], &size) != want) from++;
        if (from == hole->count) from = 0;
        else least = 0;
    }
    for (uint32_t i = 0; least != 0 && i < hole->count; i++) {
        double x = (double)o->at[p[0]].x - o->at[q[i]].x, y = (double)o->at[p[0]].y - o->at[q[i]].y;
        if (least < 0 || x * x + y * y < least) { least = x * x + y * y; from = i; }
    }
    uint32_t *chain = LATHE_NEW(o->arena, uint32_t, hole->count);
    if (!chain) return false;
    for (uint32_t i = 0; i < hole->count; i++) chain[i] = q[(from + hole->count - i) % hole->count];
    strip s = {.p = p, .q = chain, .p_step = 1, .q_step = 1, .m = outer->count, .n = hole->count, .p_size = outer->count, .q_size = hole->count};
    return merge_by_trees(o, outer->of, &s, 0, outer->count, 0, false) || merge_strip(o, outer->of, &s, false);
}

/* Corners a b c with middles on some edges (NONE: none), split so that no triangle lies flat in a slice. */
static void emit_split(overlay *o, int p, const uint32_t v[3], const uint32_t mid[3]) {
    int count = (mid[0] != NONE) + (mid[1] != NONE) + (mid[2] != NONE);
    if (count == 0) {
        emit(o, p, v[0], v[1], v[2]);
    } else if (count == 3) {
        for (int k = 0; k < 3; k++) emit(o, p, v[k], mid[k], mid[(k + 2) % 3]);
        emit(o, p, mid[0], mid[1], mid[2]);
    } else if (count == 1) {
        int k = mid[0] != NONE ? 0 : mid[1] != NONE ? 1 : 2;
        emit(o, p, v[k], mid[k], v[(k + 2) % 3]);
        emit(o, p, mid[k], v[(k + 1) % 3], v[(k + 2) % 3]);
    } else {
        int k = mid[0] == NONE ? 0 : mid[1] == NONE ? 1 : 2;   /* the edge left whole, from a to b; c is opposite */
        uint32_t a = v[k], b = v[(k + 1) % 3], c = v[(k + 2) % 3], bc = mid[(k + 1) % 3], ca = mid[(k + 2) % 3];
        emit(o, p, ca, bc, c);
        emit(o, p, a, b, bc);
        emit(o, p, a, bc, ca);
    }
}

static lathe_status triangulate_cell(overlay *o, uint32_t id) {
    const cycle *outer = &o->cycles[id];
    uint32_t total = 0, rings = 0, sides = 0;
    for (uint32_t c = id; c != NONE; c = o->cycles[c].next_hole) {
        total += o->cycles[c].count;
        rings++;
        if (o->cycles[c].meetings) sides |= 4;
        for (uint32_t i = 0; i < o->cycles[c].count; i++) sides |= 1u << node_side(o, o->nodes[o->cycles[c].first + i]);
    }
    bool single = sides == 1 || sides == 2;
    if (single) o->counts->single_cells++;
    else o->counts->other_cells++;
    lathe_polygon polygon = {.at = o->at, .ring_count = rings};
    polygon.nodes = LATHE_NEW(o->arena, uint32_t, total);
    polygon.ring_end = LATHE_NEW(o->arena, uint32_t, rings);
    if (!polygon.nodes || !polygon.ring_end) return LATHE_ERR_MEMORY;
    uint32_t used = 0, r = 0;
    for (uint32_t c = id; c != NONE; c = o->cycles[c].next_hole) {
        memcpy(polygon.nodes + used, o->nodes + o->cycles[c].first, o->cycles[c].count * sizeof *polygon.nodes);
        used += o->cycles[c].count;
        polygon.ring_end[r++] = used;
    }
    uint32_t(*t)[3], *neighbour, count;
    lathe_status status = lathe__triangulate(&t, &neighbour, &count, o->arena, &polygon);
    if (status) return status;
    uint32_t *mid = LATHE_NEW(o->arena, uint32_t, (size_t)count * 3);
    if (!mid) return LATHE_ERR_MEMORY;
    memset(mid, 0xff, (size_t)count * 3 * sizeof *mid);
    status = lathe__builder_reserve(o->builder, (size_t)count * 3 + 1, (size_t)count * 4);
    if (status) return status;
    const int32_t *h = o->slab->height;
    int32_t z = h[0] + (h[1] - h[0]) / 2;
    if (single) z = sides == 1 ? imin(z, h[0] + o->slab->cap) : imax(z, h[1] - o->slab->cap);
    for (uint32_t i = 0; i < count * 3; i++) {
        uint32_t a = t[i / 3][i % 3], b = t[i / 3][(i + 1) % 3], j = neighbour[i];
        if (j == NONE || mid[i] != NONE || node_side(o, a) == 2 || node_side(o, a) != node_side(o, b)) continue;
        status = add_vertex(o, (o->at[a].x + o->at[b].x) / 2, (o->at[a].y + o->at[b].y) / 2, z, &mid[i]);
        if (status) return status;
        mid[j] = mid[i];
    }
    for (uint32_t i = 0; i < count; i++) {
        uint32_t v[3] = {mesh_vertex(o, t[i][0]), mesh_vertex(o, t[i][1]), mesh_vertex(o, t[i][2])};
        if (count > 1 || !single) {
            emit_split(o, outer->of, v, mid + 3 * (size_t)i);
            continue;
        }
        /* A cell of one triangle of one outline has no diagonal: its centroid keeps it from lying flat. */
        uint32_t centre;
        int32_t x = (int32_t)(((int64_t)o->at[t[i][0]].x + o->at[t[i][1]].x + o->at[t[i][2]].x) / 3);
        int32_t y = (int32_t)(((int64_t)o->at[t[i][0]].y + o->at[t[i][1]].y + o->at[t[i][2]].y) / 3);
        status = add_vertex(o, x, y, z, &centre);
        if (status) return status;
        for (int k = 0; k < 3; k++) emit(o, outer->of, v[k], v[(k + 1) % 3], centre);
    }
    return LATHE_OK;
}

static lathe_status tile_cell(overlay *o, uint32_t id) {
    const cycle *c = &o->cycles[id];
    lathe_status status = lathe__builder_reserve(o->builder, 0, c->count + (c->next_hole != NONE ? o->cycles[c->next_hole].count : 0));
    if (status) return status;
    bool done = false;
    if (!c->hole && c->next_hole == NONE && c->meetings == 2) done = try_open_strip(o, c);
    else if (!c->hole && c->next_hole != NONE && !c->meetings) {
        const cycle *hole = &o->cycles[c->next_hole];
        if (hole->next_hole == NONE && !hole->meetings && node_side(o, o->nodes[c->first]) != node_side(o, o->nodes[hole->first]))
            done = try_ring_strip(o, c, hole);
    }
    if (done) o->counts->strips++;
    return done ? LATHE_OK : triangulate_cell(o, id);
}

/* One upright fan for each edge that is crossed: from its first end over the meetings to its other end. */
static lathe_status close_uprights(overlay *o, int s) {
    const side *d = &o->side[s];
    lathe_status status = lathe__builder_reserve(o->builder, 0, o->meeting_count);
    if (status) return status;
    for (uint32_t e = 0; e < o->count[s]; e++) {
        if (d->first[e] == d->first[e + 1]) continue;
        uint32_t apex = mesh_vertex(o, vertex_node(o, s, e)), far = mesh_vertex(o, vertex_node(o, s, d->next[e]));
        for (uint32_t i = d->first[e + 1]; i-- > d->first[e];) {
            uint32_t near = mesh_vertex(o, meeting_node(o, d->on[i]));
            emit(o, s, apex, far, near);
            far = near;
        }
    }
    return LATHE_OK;
}

static lathe_status place_nodes(overlay *o) {
    uint32_t a = o->count[0], b = o->count[1];
    o->at = LATHE_NEW(o->arena, lathe_point, (size_t)a + b + o->meeting_count);
    if (!o->at) return LATHE_ERR_MEMORY;
    if (a) memcpy(o->at, o->side[0].outline->points, a * sizeof *o->at);
    if (b) memcpy(o->at + a, o->side[1].outline->points, b * sizeof *o->at);
    lathe_status status = lathe__builder_reserve(o->builder, o->meeting_count, 0);
    if (status) return status;
    o->extra = o->builder->mesh.vertex_count;
    int32_t z = o->slab->height[0] + (o->slab->height[1] - o->slab->height[0]) / 2;
    for (uint32_t m = 0; m < o->meeting_count; m++) {
        uint32_t index;
        o->at[a + b + m] = (lathe_point){o->meetings[m].x, o->meetings[m].y};
        status = add_vertex(o, o->meetings[m].x, o->meetings[m].y, z, &index);
        if (status) return status;
    }
    return LATHE_OK;
}

lathe_status lathe__overlay_slab(lathe_mesh_builder *builder, lathe_arena *arena, const lathe_slab *slab, lathe_overlay_counts *counts) {
    overlay o = {.slab = slab, .builder = builder, .arena = arena, .counts = counts};
    lathe_status status;
    for (int s = 0; s < 2; s++)
        if ((status = link_vertices(&o, s)) != LATHE_OK) return status;
    if ((status = find_meetings(&o)) != LATHE_OK) return status;
    for (int s = 0; s < 2; s++)
        if ((status = order_meetings(&o, s)) != LATHE_OK) return status;
    for (int s = 0; s < 2; s++)
        if ((status = mark_inside(&o, s)) != LATHE_OK) return status;
    counts->crossings += o.meeting_count;
    if ((status = place_nodes(&o)) != LATHE_OK || (status = find_cycles(&o)) != LATHE_OK || (status = group_cells(&o)) != LATHE_OK ||
        (status = link_loops(&o)) != LATHE_OK)
        return status;
    for (uint32_t i = 0; i < o.cycle_count; i++)
        if (o.cycles[i].parent == i && (status = tile_cell(&o, i)) != LATHE_OK) return status;
    for (int s = 0; s < 2; s++)
        if ((status = close_uprights(&o, s)) != LATHE_OK) return status;
    return LATHE_OK;
}
