/* The contour of a level [M 5.1]: rays choose vertices of each loop, more rays choose more. Few rays can give a polygon that
 * crosses itself, a neighbour, or steps over a small loop [M figure 6]; the cure is that of Ho, Kim & Kim: the piece of loop that
 * an offending edge stands for is expanded at its farthest vertex, until nothing offends. Whole loops are simple, so it ends. */
#include <string.h>
#include "centre.h"
#include "grid.h"
#include "level.h"

enum { NONE = 0xffffffffu, CELLS_PER_PIECE = 2 };
/* Pieces keep 1/32 voxel from each other, and angles above 1/8: so that vertices may yet move for the sake of a neighbouring slice. */
enum { MARGIN = 2048, SPIKE = 8 };

typedef struct piece {         /* an edge of the contour, from a kept vertex to the next one kept */
    uint32_t from, to;         /* vertices of the loops; to comes after from in the loop, cyclically */
    uint32_t loop;
    bool split;                /* to be expanded in this round */
} piece;

typedef struct refinement {
    lathe_arena *arena;
    const lathe_outline *loops;
    lathe_point *at;           /* jittered positions of the loops' vertices */
    uint8_t *kept;
    int32_t *ray;
    piece *pieces;
    uint32_t piece_count;
    uint32_t added;
} refinement;

lathe_point lathe__jitter(lathe_point p, uint32_t seed) {
    uint32_t h = (uint32_t)p.x * 2654435761u ^ (uint32_t)p.y * 2246822519u ^ (seed + 1) * 3266489917u;
    h = (h ^ h >> 15) * 2246822519u;
    h ^= h >> 13;
    /* Even offsets of under 1/128 voxel: middles stay on the lattice. */
    return (lathe_point){p.x + (int32_t)(h & 0x1fe) * 2 - 510, p.y + (int32_t)(h >> 16 & 0x1fe) * 2 - 510};
}

static uint32_t after(const lathe_loop *loop, uint32_t v) { return v + 1 < loop->first + loop->count ? v + 1 : loop->first; }

/* The vertices next to the crossings of a loop's rays. */
static lathe_status choose_vertices(refinement *r, lathe_loop *loop, uint32_t coarseness) {
    const lathe_point *points = r->loops->points + loop->first;
    lathe_status status = lathe__loop_centre(&loop->centre, r->arena, points, loop->count);
    if (status) return status;
    int64_t reach = 0;
    for (uint32_t i = 0; i < loop->count; i++) {
        int64_t dx = points[i].x - loop->centre.x, dy = points[i].y - loop->centre.y;
        dx = dx < 0 ? -dx : dx, dy = dy < 0 ? -dy : dy;
        /* An upper bound of the length within 8 %, without a root. */
        int64_t length = dx > dy ? dx + dy * 3 / 8 : dy + dx * 3 / 8;
        if (length > reach) reach = length;
    }
    loop->rays = lathe__choose_rays(reach, coarseness);
    lathe_crossing *crossings;
    uint32_t count;
    status = lathe__cast_rays(&crossings, &count, r->arena, points, loop->count, loop->centre, loop->rays);
    if (status) return status;
    uint32_t chosen = 0;
    for (uint32_t i = 0; i < count; i++) {
        uint32_t v = crossings[i].segment + (crossings[i].numerator * 2 >= crossings[i].denominator);
        v = loop->first + (v < loop->count ? v : 0);
        chosen += !r->kept[v];
        r->kept[v] = 1;
        r->ray[v] = (int32_t)crossings[i].ray;
    }
    if (chosen < 4)
        for (uint32_t i = 0; i < 4; i++) r->kept[loop->first + (uint32_t)((uint64_t)loop->count * i / 4)] = 1;
    return LATHE_OK;
}

static uint32_t list_pieces(refinement *r) {
    uint32_t n = 0;
    for (uint32_t l = 0; l < r->loops->loop_count; l++) {
        const lathe_loop *loop = &r->loops->loops[l];
        uint32_t first = loop->first, end = loop->first + loop->count;
        while (first < end && !r->kept[first]) first++;
        for (uint32_t v = first, begin = n; v < end; v++) {
            if (!r->kept[v]) continue;
            if (n > begin) r->pieces[n - 1].to = v;
            r->pieces[n++] = (piece){.from = v, .to = first, .loop = l};
        }
    }
    return r->piece_count = n;
}

/* Does a piece come too close to the beginning of another one, or turn back into it as a narrow spike? */
static bool crowds(const refinement *r, const piece *p, const piece *q) {
    const lathe_point *at = r->at;
    if (p->to != q->from) return p->from != q->from && lathe__comes_close(at, q->from, p->from, p->to, MARGIN);
    int64_t turn = lathe__turn(at, p->from, p->to, q->to), dot =
        (int64_t)(at[p->from].x - at[p->to].x) * (at[q->to].x - at[p->to].x) + (int64_t)(at[p->from].y - at[p->to].y) * (at[q->to].y - at[p->to].y);
    return (turn < 0 ? -turn : turn) * SPIKE < dot;
}

static bool pieces_meet(const refinement *r, const piece *p, const piece *q) {
    if (crowds(r, p, q) || crowds(r, q, p)) return true;
    if (p->from == q->from || p->from == q->to || p->to == q->from || p->to == q->to) return false;
    return lathe__segments_meet(r->at, p->from, p->to, q->from, q->to);
}

/* Marks the pieces that meet another one, or nearly. */
static lathe_status mark_meetings(refinement *r, bool *found) {
    lathe_range *ranges = LATHE_NEW(r->arena, lathe_range, r->piece_count);
    if (!ranges) return LATHE_ERR_MEMORY;
    for (uint32_t i = 0; i < r->piece_count; i++) {
        lathe_range box = lathe__range_of(r->at[r->pieces[i].from], r->at[r->pieces[i].to]);
        ranges[i] = (lathe_range){box.x0 - MARGIN, box.y0 - MARGIN, box.x1 + MARGIN, box.y1 + MARGIN};
    }
    lathe_grid grid;
    lathe_status status = lathe__grid_build(&grid, r->arena, ranges, r->piece_count, CELLS_PER_PIECE * (uint64_t)r->piece_count);
    if (status) return status;
    const uint32_t *first = grid.first, *end = first + lathe__cell_at(&grid, grid.cells.x1, grid.cells.y1) + 1;
    for (; first < end; first++)
        for (uint32_t i = first[0]; i < first[1]; i++)
            for (uint32_t k = i + 1; k < first[1]; k++) {
                piece *p = &r->pieces[grid.entry[i]], *q = &r->pieces[grid.entry[k]];
                if (!lathe__ranges_meet(&ranges[grid.entry[i]], &ranges[grid.entry[k]])) continue;
                if (pieces_meet(r, p, q)) p->split = q->split = *found = true;
            }
    return LATHE_OK;
}

/* Is a point between a piece and the part of the loop it stands for? */
static bool cuts_off(const refinement *r, const piece *p, uint32_t vertex) {
    const lathe_loop *loop = &r->loops->loops[p->loop];
    const lathe_point *at = r->at;
    bool odd = false;
    for (uint32_t u = p->to, v = p->from;; u = v, v = after(loop, v)) {
        bool up = at[v].y > at[vertex].y;
        if ((at[u].y > at[vertex].y) != up && lathe__turn(at, up ? u : v, up ? v : u, vertex) > 0) odd = !odd;
        if (v == p->to) return odd;
    }
}

static bool is_hidden(const refinement *r, const piece *p) { return after(&r->loops->loops[p->loop], p->from) != p->to; }

/* Marks pieces that step over a vertex of another loop, and loops that have turned inside out. */
static void mark_nesting(refinement *r, bool *found) {
    for (uint32_t i = 0, begin = 0; i <= r->piece_count; i++) {
        if (i < r->piece_count && r->pieces[i].loop == r->pieces[begin].loop) continue;
        double area = 0;
        for (uint32_t k = begin; k < i; k++) {
            lathe_point a = r->at[r->pieces[k].from], b = r->at[r->pieces[k].to];
            area += (double)a.x * b.y - (double)a.y * b.x;
        }
        if (r->loops->loops[r->pieces[begin].loop].hole ? area >= 0 : area <= 0)
            for (uint32_t k = begin; k < i; k++) r->pieces[k].split = *found = true;
        begin = i;
    }
    for (uint32_t i = 0; i < r->piece_count; i++) {
        piece *p = &r->pieces[i];
        if (!is_hidden(r, p)) continue;
        const lathe_loop *own = &r->loops->loops[p->loop];
        lathe_range box = lathe__range_of(r->at[p->from], r->at[p->to]);
        for (uint32_t v = p->from; v != p->to; v = after(own, v)) lathe__range_add(&box, r->at[v].x, r->at[v].y);
        for (uint32_t l = 0; l < r->loops->loop_count && !p->split; l++) {
            if (l == p->loop) continue;
            uint32_t v = r->loops->loops[l].first;
            while (!r->kept[v]) v++;   /* one of its contour: others may lie beyond the piece without harm, or the other way round */
            lathe_point a = r->at[v];
            if (a.x < box.x0 || a.x > box.x1 || a.y < box.y0 || a.y > box.y1) continue;
            if (cuts_off(r, p, v)) p->split = *found = true;
        }
    }
}

/* Keeps the farthest vertex of each marked piece; with `whole`, all of them. */
static void expand(refinement *r, bool whole) {
    for (uint32_t i = 0; i < r->piece_count; i++) {
        const piece *p = &r->pieces[i];
        const lathe_loop *loop = &r->loops->loops[p->loop];
        if (!p->split) continue;
        uint32_t farthest = NONE;
        int64_t most = -1;
        for (uint32_t v = after(loop, p->from); v != p->to; v = after(loop, v)) {
            int64_t d = lathe__turn(r->at, p->from, p->to, v);
            if (d < 0) d = -d;
            if (whole) { r->added += !r->kept[v]; r->kept[v] = 1; }
            else if (d > most) { most = d; farthest = v; }
        }
        if (farthest != NONE) { r->kept[farthest] = 1; r->added++; }
    }
}

static lathe_status write_outline(refinement *r, lathe_outline *out, lathe_arena *arena) {
    uint32_t n = r->piece_count;
    *out = (lathe_outline){.loop_count = r->loops->loop_count};
    out->points = LATHE_NEW(arena, lathe_point, n);
    out->ray = LATHE_NEW(arena, int32_t, n);
    out->loops = LATHE_NEW(arena, lathe_loop, r->loops->loop_count);
    if (!out->points || !out->ray || !out->loops) return LATHE_ERR_MEMORY;
    for (uint32_t l = 0; l < r->loops->loop_count; l++) {
        out->loops[l] = r->loops->loops[l];
        out->loops[l].count = 0;
    }
    for (uint32_t i = 0; i < n; i++) {
        lathe_loop *loop = &out->loops[r->pieces[i].loop];
        if (!loop->count++) loop->first = i;
        out->points[i] = r->at[r->pieces[i].from];
        out->ray[i] = r->ray[r->pieces[i].from];
    }
    out->point_count = n;
    return LATHE_OK;
}

lathe_status lathe__refine_outline(lathe_outline *out, lathe_arena *arena, const lathe_outline *loops, uint32_t coarseness,
                                   uint32_t seed) {
    lathe_arena scratch = {0}, round = {0};
    uint32_t n = loops->point_count;
    refinement r = {.arena = &scratch, .loops = loops};
    lathe_status status = LATHE_ERR_MEMORY;
    *out = (lathe_outline){0};
    if (!n) return LATHE_OK;
    r.at = LATHE_NEW(&scratch, lathe_point, n);
    r.kept = LATHE_NEW(&scratch, uint8_t, n);
    r.ray = LATHE_NEW(&scratch, int32_t, n);
    r.pieces = LATHE_NEW(&scratch, piece, n);
    if (!r.at || !r.kept || !r.ray || !r.pieces) goto cleanup;
    memset(r.kept, 0, n);
    memset(r.ray, 0xff, n * sizeof *r.ray);
    for (uint32_t i = 0; i < n; i++) r.at[i] = lathe__jitter(loops->points[i], seed);
    r.arena = &round;
    for (uint32_t l = 0; l < loops->loop_count; l++) {
        status = choose_vertices(&r, &loops->loops[l], coarseness);
        if (status) goto cleanup;
        lathe__arena_reset(&round);
    }
    for (int turn = 0;; turn++) {
        bool found = false;
        list_pieces(&r);
        status = mark_meetings(&r, &found);
        lathe__arena_reset(&round);
        if (status) goto cleanup;
        uint32_t added = r.added;
        if (found) expand(&r, turn > 20);
        if (r.added > added) continue;
        /* Pieces that are close in the whole loops stay so; whether one steps over a loop is asked all the same. */
        mark_nesting(&r, &found);
        if (found) expand(&r, turn > 20);
        if (r.added == added) break;
    }
    status = write_outline(&r, out, arena);
cleanup:
    lathe__arena_free(&round);
    lathe__arena_free(&scratch);
    return status;
}
