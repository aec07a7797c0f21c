/* Pixel staircases to polygons [L], all loops of a slice together: each loop is approximated alone, then pieces that
 * meet another one, or step over another loop, get their farthest vertex back until nothing offends and all are
 * within the tolerance. Whole loops are simple, so it ends. */
#include <stdlib.h>
#include <string.h>
#include "closing.h"
#include "grid.h"
#include "strip.h"

typedef struct piece {         /* an edge of the polygon and the points of its loop that it stands for */
    uint32_t from, to, loop;
    bool split;
} piece;

typedef struct section {
    const lathe_outline *loops;
    lathe_arena *arena;        /* of one round */
    uint8_t *kept;             /* per point */
    piece *pieces;
    uint32_t count;
} section;

static uint32_t after(const lathe_loop *loop, uint32_t v) {
    return v + 1 < loop->first + loop->count ? v + 1 : loop->first;
}

/* The loop from its leftmost point on, which every approximation keeps, round to it again. */
static lathe_status approximate(section *s, const lathe_loop *loop, double tolerance) {
    const lathe_point *p = s->loops->points;
    uint32_t n = loop->count, start = loop->first, chosen;
    for (uint32_t v = start + 1; v < loop->first + n; v++)
        if (p[v].x < p[start].x || (p[v].x == p[start].x && p[v].y < p[start].y)) start = v;
    double *points = LATHE_NEW(s->arena, double, 2 * ((size_t)n + 1));
    uint32_t *breaks = LATHE_NEW(s->arena, uint32_t, (size_t)n + 1);
    if (!points || !breaks) return LATHE_ERR_MEMORY;
    for (uint32_t i = 0, v = start; i <= n; i++, v = after(loop, v)) points[2 * i] = p[v].x, points[2 * i + 1] = p[v].y;
    lathe__strip_drawn(breaks, &chosen, points, n + 1, tolerance);
    for (uint32_t i = 0; i + 1 < chosen; i++) s->kept[loop->first + (start - loop->first + breaks[i]) % n] = 1;
    if (chosen < 4)            /* both ends are one point: fewer than three vertices */
        for (uint32_t k = 0; k < 3; k++) s->kept[loop->first + (start - loop->first + n * k / 3) % n] = 1;
    return LATHE_OK;
}

static void list_pieces(section *s) {
    s->count = 0;
    for (uint32_t l = 0; l < s->loops->loop_count; l++) {
        const lathe_loop *loop = &s->loops->loops[l];
        uint32_t begin = s->count, end = loop->first + loop->count;
        for (uint32_t v = loop->first; v < end; v++) {
            if (!s->kept[v]) continue;
            if (s->count > begin) s->pieces[s->count - 1].to = v;
            s->pieces[s->count++] = (piece){.from = v, .loop = l};
        }
        s->pieces[s->count - 1].to = s->pieces[begin].from;
    }
}

/* Neighbours may share their end, but not fold back onto each other. */
static bool meets(const section *s, const piece *a, const piece *b) {
    const lathe_point *p = s->loops->points;
    if (a->to == b->from || b->to == a->from) {
        if (b->to == a->from) { const piece *swap = a; a = b; b = swap; }
        lathe_point u = p[a->from], v = p[a->to], w = p[b->to];
        return !lathe__orient(u, v, w) && ((int64_t)(u.x - v.x) * (w.x - v.x) + (int64_t)(u.y - v.y) * (w.y - v.y)) > 0;
    }
    return lathe__edges_meet(p[a->from], p[a->to], p[b->from], p[b->to]);
}

static lathe_status mark_meetings(section *s, bool *found) {
    lathe_range *ranges = LATHE_NEW(s->arena, lathe_range, s->count);
    lathe_grid grid;
    if (!ranges) return LATHE_ERR_MEMORY;
    for (uint32_t i = 0; i < s->count; i++)
        ranges[i] = lathe__range_of(s->loops->points[s->pieces[i].from], s->loops->points[s->pieces[i].to]);
    lathe_status status = lathe__grid_build(&grid, s->arena, ranges, s->count, 4 * (uint64_t)s->count);
    if (status) return status;
    size_t cells = lathe__cell_at(&grid, grid.cells.x1, grid.cells.y1) + 1;
    for (size_t c = 0; c < cells; c++)
        for (uint32_t i = grid.first[c]; i < grid.first[c + 1]; i++)
            for (uint32_t k = i + 1; k < grid.first[c + 1]; k++) {
                piece *a = &s->pieces[grid.entry[i]], *b = &s->pieces[grid.entry[k]];
                if (meets(s, a, b)) a->split = b->split = *found = true;
            }
    return LATHE_OK;
}

/* Is a point between a piece and the part of the loop that it stands for? */
static bool cuts_off(const section *s, const piece *p, lathe_point at) {
    const lathe_point *points = s->loops->points;
    bool odd = false;
    for (uint32_t u = p->to, v = p->from;; u = v, v = after(&s->loops->loops[p->loop], v)) {
        bool up = points[v].y > at.y;
        if ((points[u].y > at.y) != up && lathe__orient(up ? points[u] : points[v], up ? points[v] : points[u], at) > 0)
            odd = !odd;
        if (v == p->to) return odd;
    }
}

static void mark_steps(section *s, bool *found) {
    for (uint32_t i = 0; i < s->count; i++) {
        piece *p = &s->pieces[i];
        const lathe_loop *own = &s->loops->loops[p->loop];
        if (after(own, p->from) == p->to) continue;
        lathe_range box = lathe__range_of(s->loops->points[p->from], s->loops->points[p->to]);
        for (uint32_t v = p->from; v != p->to; v = after(own, v))
            lathe__range_add(&box, s->loops->points[v].x, s->loops->points[v].y);
        for (uint32_t l = 0; l < s->loops->loop_count && !p->split; l++) {
            lathe_point at = s->loops->points[s->loops->loops[l].first];
            if (l == p->loop || at.x < box.x0 || at.x > box.x1 || at.y < box.y0 || at.y > box.y1) continue;
            if (cuts_off(s, p, at)) p->split = *found = true;
        }
    }
}

/* A loop that has turned inside out, or has no area left, is split everywhere. */
static void mark_turned(section *s, bool *found) {
    const lathe_point *at = s->loops->points;
    for (uint32_t begin = 0, end; begin < s->count; begin = end) {
        double area = 0;
        for (end = begin; end < s->count && s->pieces[end].loop == s->pieces[begin].loop; end++) {
            lathe_point a = at[s->pieces[end].from], b = at[s->pieces[end].to], o = at[s->pieces[begin].from];
            area += ((double)a.x - o.x) * ((double)b.y - o.y) - ((double)a.y - o.y) * ((double)b.x - o.x);
        }
        if (s->loops->loops[s->pieces[begin].loop].hole ? area < 0 : area > 0) continue;
        for (uint32_t i = begin; i < end; i++) s->pieces[i].split = *found = true;
    }
}

/* A piece that was split is two chords, each of which may miss what the one chord did not; so may the chords of a loop
 * that was left with two vertices. */
static void mark_far(section *s, double tolerance, bool *found) {
    const lathe_point *at = s->loops->points;
    for (uint32_t i = 0; i < s->count; i++) {
        piece *p = &s->pieces[i];
        const lathe_loop *loop = &s->loops->loops[p->loop];
        double from[2] = {at[p->from].x, at[p->from].y}, to[2] = {at[p->to].x, at[p->to].y};
        for (uint32_t v = after(loop, p->from); v != p->to && !p->split; v = after(loop, v)) {
            double here[2] = {at[v].x, at[v].y};
            if (lathe__segment_distance(here, from, to) > tolerance) p->split = *found = true;
        }
    }
}

static bool expand(section *s, bool whole) {
    bool added = false;
    const lathe_point *at = s->loops->points;
    for (uint32_t i = 0; i < s->count; i++) {
        const piece *p = &s->pieces[i];
        const lathe_loop *loop = &s->loops->loops[p->loop];
        if (!p->split) continue;
        uint32_t farthest = p->to;
        int64_t most = -1;
        for (uint32_t v = after(loop, p->from); v != p->to; v = after(loop, v)) {
            int64_t d = llabs(lathe__orient(at[p->from], at[p->to], at[v]));
            if (d > most) most = d, farthest = v;
            if (whole) s->kept[v] = 1, added = true;
        }
        if (farthest != p->to) s->kept[farthest] = 1, added = true;
    }
    return added;
}

static lathe_status write_polygons(lathe_outline *out, lathe_arena *arena, const section *s) {
    const lathe_outline *in = s->loops;
    *out = (lathe_outline){.loop_count = in->loop_count};
    out->points = LATHE_NEW(arena, lathe_point, s->count);
    out->ray = LATHE_NEW(arena, int32_t, s->count);
    out->loops = LATHE_NEW(arena, lathe_loop, in->loop_count);
    if (!out->points || !out->ray || !out->loops) return LATHE_ERR_MEMORY;
    memcpy(out->loops, in->loops, in->loop_count * sizeof *out->loops);
    memset(out->ray, 0xff, s->count * sizeof *out->ray);
    for (uint32_t l = 0; l < in->loop_count; l++) out->loops[l].count = 0;
    for (uint32_t i = 0; i < s->count; i++) {
        lathe_loop *loop = &out->loops[s->pieces[i].loop];
        if (!loop->count++) loop->first = i;
        out->points[out->point_count++] = in->points[s->pieces[i].from];
    }
    return LATHE_OK;
}

lathe_status lathe__strip_outline(lathe_outline *out, lathe_arena *arena, const lathe_outline *loops,
                                  int32_t tolerance) {
    lathe_arena scratch = {0}, round = {0};
    uint32_t n = loops->point_count;
    section s = {.loops = loops, .arena = &round};
    lathe_status status = tolerance > 0 ? LATHE_OK : LATHE_ERR_RANGE;
    for (uint32_t l = 0; l < loops->loop_count; l++)
        if (loops->loops[l].count < 3) status = LATHE_ERR_RANGE;
    if (status) return status;
    if (!n) {
        *out = (lathe_outline){0};
        return LATHE_OK;
    }
    s.kept = LATHE_NEW(&scratch, uint8_t, n);
    s.pieces = LATHE_NEW(&scratch, piece, n);
    if (!s.kept || !s.pieces) status = LATHE_ERR_MEMORY;
    else memset(s.kept, 0, n);
    for (uint32_t l = 0; !status && l < loops->loop_count; l++) {
        status = approximate(&s, &loops->loops[l], tolerance);
        lathe__arena_reset(&round);
    }
    for (int turn = 0; !status; turn++) {
        bool found = false;
        list_pieces(&s);
        status = mark_meetings(&s, &found);
        lathe__arena_reset(&round);
        if (!status && !found) mark_far(&s, tolerance, &found);
        if (!status && !found) mark_steps(&s, &found);
        if (!status && !found) mark_turned(&s, &found);
        if (!found || !expand(&s, turn > 20)) break;
    }
    if (!status) status = write_polygons(out, arena, &s);
    lathe__arena_free(&scratch);
    lathe__arena_free(&round);
    return status;
}
