/* Rays choose the base shape: on each ray the outermost crossing, averaged over the neighbouring directions that no ray is cast in. */
#include <stdlib.h>
#include <string.h>
#include "centre.h"
#include "base_shape.h"

enum { FINER = 4 };            /* directions looked at for each ray */

static int64_t distance(lathe_point a, lathe_point b) {
    int64_t dx = (int64_t)a.x - b.x, dy = (int64_t)a.y - b.y, square = dx * dx + dy * dy, root = dx < 0 ? -dx : dx;
    if ((dy < 0 ? -dy : dy) > root) root = dy < 0 ? -dy : dy;
    for (int i = 0; i < 5 && root; i++) root = (root + square / root) / 2;
    return root;
}

static lathe_status fit_radii(lathe_star *star, lathe_arena *arena, const lathe_point *points, uint32_t count, int32_t step) {
    uint32_t fine = (uint32_t)star->rays * FINER, crossing_count;
    lathe_point centre = {star->centre[0] * LATHE_LATTICE_ONE, star->centre[1] * LATHE_LATTICE_ONE};
    int64_t *outermost = LATHE_NEW(arena, int64_t, fine);
    star->radius = LATHE_NEW(arena, uint16_t, star->rays);
    if (!outermost || !star->radius) return LATHE_ERR_MEMORY;
    memset(outermost, 0, fine * sizeof *outermost);
    lathe_crossing *crossing;
    lathe_status status = lathe__cast_rays(&crossing, &crossing_count, arena, points, count, centre, fine);
    if (status) return status;
    for (uint32_t i = 0; i < crossing_count; i++) {
        lathe_point a = points[crossing[i].segment], b = points[(crossing[i].segment + 1) % count];
        double t = (double)crossing[i].numerator / (double)crossing[i].denominator;
        lathe_point at = {a.x + (int32_t)((double)(b.x - a.x) * t), a.y + (int32_t)((double)(b.y - a.y) * t)};
        int64_t d = distance(at, centre);
        if (d > outermost[crossing[i].ray]) outermost[crossing[i].ray] = d;
    }
    for (uint32_t i = 0; i < star->rays; i++) {
        int64_t sum = 0, weight = 0;
        for (int k = 1 - FINER; k < FINER; k++) {
            int64_t d = outermost[(i * FINER + fine + (uint32_t)k) % fine], w = FINER - (k < 0 ? -k : k);
            if (d) { sum += d * w; weight += w; }
        }
        int64_t r = weight ? (sum / weight + step / 2) / step : 1;
        star->radius[i] = (uint16_t)(r < 1 ? 1 : r > 32767 ? 32767 : r);
    }
    return LATHE_OK;
}

/* ---- does the last loop of an outline fit in with the others? ---- */

static bool meet(lathe_point a, lathe_point b, lathe_point c, lathe_point d) {
    int64_t s = lathe__orient(a, b, c), t = lathe__orient(a, b, d);
    if ((s > 0 && t > 0) || (s < 0 && t < 0)) return false;
    s = lathe__orient(c, d, a), t = lathe__orient(c, d, b);
    return !((s > 0 && t > 0) || (s < 0 && t < 0));
}

static bool encloses(const lathe_point *p, uint32_t count, lathe_point at) {
    bool odd = false;
    for (uint32_t i = 0; i < count; i++) {
        lathe_point a = p[i], b = p[(i + 1) % count];
        if ((a.y > at.y) == (b.y > at.y)) continue;
        if (a.y < b.y ? lathe__orient(a, b, at) > 0 : lathe__orient(b, a, at) > 0) odd = !odd;
    }
    return odd;
}

static bool last_fits(const lathe_outline *o) {
    const lathe_loop *own = &o->loops[o->loop_count - 1];
    const lathe_point *p = o->points + own->first;
    int depth = 0;
    for (uint32_t l = 0; l + 1 < o->loop_count; l++) {
        const lathe_loop *other = &o->loops[l];
        const lathe_point *q = o->points + other->first;
        for (uint32_t i = 0; i < own->count; i++)
            for (uint32_t k = 0; k < other->count; k++)
                if (meet(p[i], p[(i + 1) % own->count], q[k], q[(k + 1) % other->count])) return false;
        if (encloses(q, other->count, p[0])) depth += other->hole ? -1 : 1;
        if (encloses(p, own->count, q[0])) return false;
    }
    return depth == (own->hole ? 1 : 0);
}

/* ---- which loops ---- */

typedef struct candidate { uint32_t loop; int64_t area; } candidate;

static int by_area(const void *a, const void *b) {
    const candidate *p = a, *q = b;
    return p->area != q->area ? (p->area < q->area ? 1 : -1) : (p->loop > q->loop) - (p->loop < q->loop);
}

static int64_t loop_area(const lathe_outline *o, uint32_t l, int64_t *reach, lathe_point centre) {
    const lathe_point *p = o->points + o->loops[l].first;
    double area = 0;
    *reach = 0;
    for (uint32_t i = 0, n = o->loops[l].count; i < n; i++) {
        lathe_point a = p[i], b = p[i + 1 < n ? i + 1 : 0];
        area += ((double)(a.x - p[0].x) * (double)(b.y - p[0].y) - (double)(a.y - p[0].y) * (double)(b.x - p[0].x)) / 8589934592.0;
        int64_t d = distance(a, centre);
        if (d > *reach) *reach = d;
    }
    return (int64_t)(area < 0 ? -area * 16 : area * 16);   /* sixteenths of a pixel */
}

/* The star of the slice before whose centre lies nearest, if it is near and free. */
static uint8_t find_parent(const lathe_star *star, const lathe_star_slice *before, uint64_t taken, int64_t reach) {
    uint8_t best = 0;
    int64_t least = 2 * reach / LATHE_LATTICE_ONE;
    for (uint32_t i = 0; before && i < before->count; i++) {
        const lathe_star *other = &before->stars[i];
        int64_t dx = star->centre[0] - other->centre[0], dy = star->centre[1] - other->centre[1];
        int64_t d = (dx < 0 ? -dx : dx) + (dy < 0 ? -dy : dy);
        if (other->hole == star->hole && !(taken >> i & 1) && d < least) { least = d; best = (uint8_t)(i + 1); }
    }
    return best;
}

lathe_status lathe__base_fit(lathe_star_slice *out, lathe_arena *arena, const lathe_outline *loops, const lathe_star_slice *before,
                             int32_t stride, uint32_t seed) {
    int32_t step = lathe__radius_step(stride);
    candidate *order = LATHE_NEW(arena, candidate, loops->loop_count);
    out->stars = LATHE_NEW(arena, lathe_star, LATHE_BASE_MAX_LOOPS);
    out->count = 0;
    if (!order || !out->stars) return LATHE_ERR_MEMORY;
    int64_t reach;
    for (uint32_t l = 0; l < loops->loop_count; l++)
        order[l] = (candidate){l, loop_area(loops, l, &reach, loops->points[loops->loops[l].first])};
    qsort(order, loops->loop_count, sizeof *order, by_area);
    uint64_t taken = 0;
    for (uint32_t i = 0; i < loops->loop_count && out->count < LATHE_BASE_MAX_LOOPS; i++) {
        const lathe_loop *loop = &loops->loops[order[i].loop];
        /* A loop narrower than the distance of two base slices is left to the next level. */
        if (out->count && order[i].area < (int64_t)stride * stride * 4) break;
        lathe_star *star = &out->stars[out->count];
        lathe_point centre;
        lathe_status status = lathe__loop_centre(&centre, arena, loops->points + loop->first, loop->count);
        if (status) return status;
        loop_area(loops, order[i].loop, &reach, centre);
        *star = (lathe_star){.centre = {(centre.x + LATHE_LATTICE_ONE / 2) / LATHE_LATTICE_ONE, (centre.y + LATHE_LATTICE_ONE / 2) / LATHE_LATTICE_ONE},
                             .hole = loop->hole};
        uint32_t rays = LATHE_BASE_MIN_RAYS;
        while (rays < LATHE_BASE_MAX_RAYS && (int64_t)rays * stride * LATHE_LATTICE_ONE < reach * 22 / 7) rays *= 2;
        star->rays = (uint16_t)rays;
        status = fit_radii(star, arena, loops->points + loop->first, loop->count, step);
        if (status) return status;
        out->count++;
        lathe_outline outline;
        status = lathe__star_outline(&outline, arena, out, step, seed);
        if (status) return status;
        if (!last_fits(&outline)) { out->count--; continue; }
        star->parent = find_parent(star, before, taken, reach);
        if (star->parent) taken |= (uint64_t)1 << (star->parent - 1);
    }
    return LATHE_OK;
}
