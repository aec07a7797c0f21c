/* Polygons at a slab's middle height: copies of the many [P 3.5], one around many and many [P 3.6]. */
#include "relation.h"
#include "slab_build.h"
#include <math.h>

double lathe__slab_box_side(const lathe_slab_build *s, const lathe_slab_nodes *list, uint32_t count,
                            lathe_point *middle) {
    int32_t low[2] = {INT32_MAX, INT32_MAX}, high[2] = {INT32_MIN, INT32_MIN};
    for (uint32_t k = 0; k < count; k++)
        for (uint32_t i = 0; i < list[k].count; i++)
            for (int a = 0; a < 2; a++) {
                int32_t x = s->b.mesh.lattice[list[k].at[i]][a];
                if (x < low[a]) low[a] = x;
                if (x > high[a]) high[a] = x;
            }
    *middle = (lathe_point){(int32_t)(((int64_t)low[0] + high[0]) / 2), (int32_t)(((int64_t)low[1] + high[1]) / 2)};
    return fmax((double)high[0] - low[0], (double)high[1] - low[1]);
}

static double area_of(const lathe_slab_build *s, const lathe_slab_nodes *n) {
    double sum = 0;
    for (uint32_t i = 2; i < n->count; i++)
        sum += (double)lathe__orient(lathe__slab_point(s, n->at[0]), lathe__slab_point(s, n->at[i - 1]),
                                     lathe__slab_point(s, n->at[i]));
    return fabs(sum) / 2;
}

/* The many once more at the middle height, between their own place and size and the one's [P 3.5], with walls up to
 * them. The copies are similar to the originals as a group: so they are disjoint as these are. */
lathe_status lathe__slab_copy_many(lathe_slab_build *s, lathe_slab_nodes *copies, const lathe_slab_nodes *one,
                                   const lathe_slab_nodes *many, uint32_t count, bool many_above, bool flip) {
    lathe_point from, to;
    double own = 0;
    lathe__slab_box_side(s, many, count, &from);
    lathe__slab_box_side(s, one, 1, &to);
    for (uint32_t k = 0; k < count; k++) own += area_of(s, &many[k]);
    /* Never so large that copies of far parts leave the one's neighbourhood, never vanishing. */
    double scale = (1 + fmin(fmax(sqrt(area_of(s, one) / fmax(own, 1)), 0.5), 1.25)) / 2;
    for (uint32_t k = 0; k < count; k++) {
        copies[k] = (lathe_slab_nodes){LATHE_NEW(s->arena, uint32_t, many[k].count), many[k].count};
        if (!copies[k].at) return LATHE_ERR_MEMORY;
        for (uint32_t i = 0; i < many[k].count; i++) {
            lathe_point p = lathe__slab_point(s, many[k].at[i]);
            lathe_status status = lathe__slab_add_vertex(
                s, &copies[k].at[i], (int32_t)lround((from.x + (double)to.x) / 2 + (p.x - (double)from.x) * scale),
                (int32_t)lround((from.y + (double)to.y) / 2 + (p.y - (double)from.y) * scale), lathe__slab_middle(s));
            if (status) return status;
        }
        /* Copy and original have corresponding points: one-to-one needs no search. */
        for (uint32_t i = 0; i < many[k].count; i++) {
            uint32_t j = (i + 1) % many[k].count;
            const lathe_slab_nodes *low = many_above ? &copies[k] : &many[k],
                                   *high = many_above ? &many[k] : &copies[k];
            lathe_status status = lathe__slab_emit(s, low->at[i], low->at[j], high->at[i], flip);
            if (!status) status = lathe__slab_emit(s, low->at[j], high->at[j], high->at[i], flip);
            if (status) return status;
        }
    }
    return LATHE_OK;
}

/* The polygon that goes between many and many [P 3.6]: the hull of both hulls, at the middle height; edges longer than
 * the longest allowed one, twice the mean edge of the block, get points. */
lathe_status lathe__slab_middle_polygon(lathe_slab_build *s, lathe_slab_nodes *out, const lathe_slab_nodes *list,
                                        uint32_t count) {
    uint32_t total = 0, used = 0;
    double length = 0;
    for (uint32_t k = 0; k < count; k++) total += list[k].count;
    lathe_point *at = LATHE_NEW(s->arena, lathe_point, total), *hull = LATHE_NEW(s->arena, lathe_point, total + 1);
    if (!at || !hull) return LATHE_ERR_MEMORY;
    for (uint32_t k = 0; k < count; k++)
        for (uint32_t i = 0; i < list[k].count; i++) {
            at[used++] = lathe__slab_point(s, list[k].at[i]);
            length +=
                sqrt(lathe__slab_distance2(at[used - 1], lathe__slab_point(s, list[k].at[(i + 1) % list[k].count])));
        }
    uint32_t n = lathe__convex_hull(hull, at, total);
    if (!n) return LATHE_ERR_MEMORY;
    double longest = fmax(2 * length / total, 4), around = 0;
    for (uint32_t i = 0; i < n; i++) around += sqrt(lathe__slab_distance2(hull[i], hull[(i + 1) % n]));
    if (around / longest > (double)total * 4) longest = around / (total * 4.0);
    *out = (lathe_slab_nodes){LATHE_NEW(s->arena, uint32_t, (size_t)total * 4 + 2 * (size_t)n + 8), 0};
    if (!out->at) return LATHE_ERR_MEMORY;
    for (uint32_t i = 0; i < n; i++) {
        lathe_point a = hull[i], b = hull[(i + 1) % n];
        uint32_t parts = (uint32_t)ceil(sqrt(lathe__slab_distance2(a, b)) / longest);
        for (uint32_t k = 0; k < (parts ? parts : 1); k++) {
            double t = (double)k / (parts ? parts : 1);
            lathe_status status =
                lathe__slab_add_vertex(s, &out->at[out->count++], (int32_t)lround(a.x + ((double)b.x - a.x) * t),
                                       (int32_t)lround(a.y + ((double)b.y - a.y) * t), lathe__slab_middle(s));
            if (status) return status;
        }
    }
    return LATHE_OK;
}
