/* The tiling between two polygons by the chosen method; that of the trees is drawn out to the loops' own vertices. */
#include "centre.h"
#include "level.h"
#include "slab_build.h"
#include <stdlib.h>

/* The vertex next to the i-th crossing. */
static uint32_t vertex_at(const lathe_ray_contour *c, uint32_t i, uint32_t size) {
    const lathe_crossing *x = &c->crossings[i % c->count];
    uint32_t v = x->segment + ((double)x->numerator * 2 >= (double)x->denominator);
    return v < size ? v : v - size;
}

static uint32_t ahead(uint32_t from, uint32_t to, uint32_t size) { return to >= from ? to - from : to + size - from; }

/* The trees walk from crossing to crossing; each step is drawn out to the loops' own vertices next to them, shorter
 * diagonal first. */
static lathe_status draw_out(lathe_tiling *out, const lathe_tiling *trees, lathe_arena *arena,
                             const lathe_ray_contour c[2], const lathe_point *const p[2], const uint32_t size[2]) {
    uint32_t i[2] = {trees->start[0], trees->start[1]}, v[2], n = 0, total = size[0] + size[1];
    uint8_t *steps = LATHE_NEW(arena, uint8_t, total);
    if (!steps) return LATHE_ERR_MEMORY;
    for (int k = 0; k < 2; k++) out->start[k] = v[k] = vertex_at(&c[k], i[k], size[k]);
    for (uint32_t step = 0; step < trees->count; step++) {
        uint32_t left[2];
        for (int k = 0; k < 2; k++) {
            i[k] += trees->steps[step] >> k & 1;
            left[k] = ahead(v[k], vertex_at(&c[k], i[k], size[k]), size[k]);
        }
        while (left[0] || left[1]) {
            if (n == total) return LATHE_ERR_FORMAT;
            int k = !left[0];
            if (left[0] && left[1])
                k = lathe__slab_distance2(p[0][(v[0] + 1) % size[0]], p[1][v[1]]) >
                    lathe__slab_distance2(p[0][v[0]], p[1][(v[1] + 1) % size[1]]);
            v[k] = (v[k] + 1) % size[k];
            left[k]--;
            steps[n++] = (uint8_t)(1 << k);
        }
    }
    out->steps = steps;
    out->count = n;
    return LATHE_OK;
}

/* How far a loop goes from a point along the axes. */
static int64_t reach_from(lathe_point centre, const lathe_point *p, uint32_t size) {
    int64_t reach = 0;
    for (uint32_t i = 0; i < size; i++) {
        int64_t dx = llabs((int64_t)p[i].x - centre.x), dy = llabs((int64_t)p[i].y - centre.y);
        if (dx > reach) reach = dx;
        if (dy > reach) reach = dy;
    }
    return reach;
}

static lathe_status tile_by_trees(lathe_tiling *out, lathe_slab_build *s, const lathe_point *const p[2],
                                  const uint32_t size[2], const uint32_t turn[2]) {
    lathe_ray_contour c[2];
    lathe_point centre[2];
    int64_t reach = 0;
    for (int k = 0; k < 2; k++) {
        lathe_status status = lathe__loop_centre(&centre[k], s->arena, p[k], size[k]);
        if (status) return status;
        int64_t further = reach_from(centre[k], p[k], size[k]);
        if (further > reach) reach = further;
    }
    uint32_t rays = s->options->rays, fewer = size[0] < size[1] ? size[0] : size[1];
    if (!rays) {
        rays = lathe__choose_rays(reach, 0);
        while (rays > 8 && rays > fewer) rays /= 2;
    }
    for (int k = 0; k < 2; k++) {
        lathe_status status = lathe__make_ray_contour(&c[k], s->arena, p[k], size[k], centre[k], rays, turn[k]);
        if (status) return status;
    }
    lathe_tiling trees;
    lathe_status status = lathe__tile_trees(&trees, s->arena, &c[0], &c[1]);
    return status ? status : draw_out(out, &trees, s->arena, c, p, size);
}

/* Each edge of both exactly once? */
static bool is_whole(const lathe_tiling *t, const uint32_t size[2]) {
    uint32_t a = 0, b = 0;
    if (t->start[0] >= size[0] || t->start[1] >= size[1]) return false;
    for (uint32_t i = 0; i < t->count; i++) {
        if (t->steps[i] < 1 || t->steps[i] > 3) return false;
        a += t->steps[i] & 1;
        b += t->steps[i] >> 1;
    }
    return a == size[0] && b == size[1];
}

lathe_status lathe__slab_choose_tiling(lathe_tiling *out, lathe_slab_build *s, const lathe_point *const p[2],
                                       const uint32_t size[2], const uint32_t turn[2], int32_t rise) {
    lathe_status status = LATHE_ERR_FORMAT;
    switch (s->options->tiling) {
    case LATHE_TILING_TREES: status = tile_by_trees(out, s, p, size, turn); break;
    case LATHE_TILING_TOROIDAL: status = lathe__tile_toroidal(out, s->arena, p[0], size[0], p[1], size[1], rise); break;
    case LATHE_TILING_CHRISTIANSEN:
        status = lathe__tile_christiansen(out, s->arena, p[0], size[0], p[1], size[1], rise);
        break;
    case LATHE_TILING_SHORTEST: status = lathe__tile_shortest(out, s->arena, p[0], size[0], p[1], size[1], rise); break;
    }
    if (s->options->tiling == LATHE_TILING_TREES && status != LATHE_ERR_MEMORY && (status || !is_whole(out, size))) {
        s->counts->treeless++;
        status = lathe__tile_shortest(out, s->arena, p[0], size[0], p[1], size[1], rise);
    }
    return status || is_whole(out, size) ? status : LATHE_ERR_FORMAT;
}
