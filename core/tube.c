/* One-to-one links: both loops are cast with the same rays, each from its own centre; their contours' trees are walked together. */
#include <string.h>
#include "centre.h"
#include "level.h"
#include "overlay.h"

typedef struct contour {
    uint32_t points;           /* of the loop */
    lathe_crossing *crossings;
    uint32_t count;
    lathe_tree tree;
} contour;

static int64_t reach_of(const lathe_point *p, uint32_t count, lathe_point centre) {
    int64_t reach = 0;
    for (uint32_t i = 0; i < count; i++) {
        int64_t dx = p[i].x - centre.x, dy = p[i].y - centre.y;
        dx = dx < 0 ? -dx : dx, dy = dy < 0 ? -dy : dy;
        if ((dx > dy ? dx : dy) > reach) reach = dx > dy ? dx : dy;
    }
    return reach;
}

/* Holes are walked clockwise; their contours are read backwards, so that both kinds have one grammar. */
static lathe_status read_contour(contour *c, lathe_arena *arena, const lathe_point *points, lathe_point centre, uint32_t rays) {
    lathe_status status = lathe__cast_rays(&c->crossings, &c->count, arena, points, c->points, centre, rays);
    if (status) return status;
    uint8_t *types = LATHE_NEW(arena, uint8_t, c->count + 1);
    if (!types) return LATHE_ERR_MEMORY;
    status = lathe__classify_edges(types, c->crossings, c->count, rays);
    if (!status) status = lathe__parse_contour(&c->tree, arena, c->crossings, types, c->count, rays);
    return status;
}

/* The vertex next to the i-th crossing of the string that the tree parses. */
static uint32_t vertex_at(const contour *c, uint32_t i) {
    const lathe_crossing *x = &c->crossings[(c->tree.start + i) % c->count];
    uint32_t v = x->segment + (x->numerator * 2 >= x->denominator);
    return v < c->points ? v : v - c->points;
}

static uint32_t ahead(uint32_t from, uint32_t to, uint32_t size) { return to >= from ? to - from : to + size - from; }

/* Fills partner for the vertices from a0 (excluded) to a1 (included) of a loop of `size`, going with b0 to b1 of the other. */
static void share(float *partner, uint32_t a0, uint32_t a1, uint32_t size, uint32_t b0, uint32_t b1, uint32_t other) {
    uint32_t n = ahead(a0, a1, size), m = ahead(b0, b1, other);
    for (uint32_t k = 1; k <= n; k++) {
        float at = (float)b0 + (float)m * (float)k / (float)n;
        uint32_t v = a0 + k < size ? a0 + k : a0 + k - size;
        partner[v] = at < (float)other ? at : at - (float)other;
    }
}

static void fill(lathe_tube *out, const contour *a, const contour *b, const uint8_t *steps, uint32_t count) {
    uint32_t i = 0, j = 0, va = vertex_at(a, 0), vb = vertex_at(b, 0);
    out->partner[0][va] = (float)vb;
    out->partner[1][vb] = (float)va;
    for (uint32_t k = 0; k < count; k++) {
        i += steps[k] & 1;
        j += steps[k] >> 1;
        uint32_t na = vertex_at(a, i % a->count), nb = vertex_at(b, j % b->count);
        share(out->partner[0], va, na, a->points, vb, nb, b->points);
        share(out->partner[1], vb, nb, b->points, va, na, a->points);
        va = na;
        vb = nb;
    }
}

static void reverse_points(lathe_point *out, const lathe_point *in, uint32_t count) {
    for (uint32_t i = 0; i < count; i++) out[i] = in[count - 1 - i];
}

static void reverse_partner(float *partner, uint32_t count, uint32_t other) {
    for (uint32_t i = 0; i < count; i++) {
        float at = (float)(other - 1) - partner[i];
        partner[i] = at < 0 ? at + (float)other : at;
    }
    for (uint32_t i = 0; i < count / 2; i++) {
        float swap = partner[i];
        partner[i] = partner[count - 1 - i];
        partner[count - 1 - i] = swap;
    }
}

lathe_status lathe__match_loops(lathe_tube *out, lathe_arena *arena, const lathe_outline *a, uint32_t loop_a, const lathe_outline *b,
                                uint32_t loop_b) {
    const lathe_loop *loop[2] = {&a->loops[loop_a], &b->loops[loop_b]};
    const lathe_point *source[2] = {a->points + loop[0]->first, b->points + loop[1]->first};
    lathe_point *points[2], centre[2];
    contour c[2] = {{.points = loop[0]->count}, {.points = loop[1]->count}};
    int64_t reach = 0;
    if (loop[0]->hole != loop[1]->hole) return LATHE_ERR_FORMAT;
    for (int s = 0; s < 2; s++) {
        uint32_t n = c[s].points;
        points[s] = LATHE_NEW(arena, lathe_point, n);
        out->partner[s] = LATHE_NEW(arena, float, n);
        if (!points[s] || !out->partner[s]) return LATHE_ERR_MEMORY;
        if (loop[s]->hole) reverse_points(points[s], source[s], n);
        else memcpy(points[s], source[s], n * sizeof *points[s]);
        lathe_status status = lathe__loop_centre(&centre[s], arena, points[s], n);
        if (status) return status;
        int64_t r = reach_of(points[s], n, centre[s]);
        if (r > reach) reach = r;
        for (uint32_t i = 0; i < n; i++) out->partner[s][i] = -1;
    }
    /* As many rays as the larger loop asks for at its finest, but no more than there are vertices to choose from. */
    uint32_t rays = lathe__choose_rays(reach, 0), fewer = c[0].points < c[1].points ? c[0].points : c[1].points;
    while (rays > 8 && rays > fewer) rays /= 2;
    for (int s = 0; s < 2; s++) {
        lathe_status status = read_contour(&c[s], arena, points[s], centre[s], rays);
        if (status) return status;
    }
    uint8_t *steps = LATHE_NEW(arena, uint8_t, c[0].tree.edge_count + c[1].tree.edge_count + 1);
    uint32_t count;
    if (!steps) return LATHE_ERR_MEMORY;
    lathe_status status = lathe__walk_trees(steps, &count, &c[0].tree, &c[1].tree);
    if (status) return status;
    fill(out, &c[0], &c[1], steps, count);
    for (int s = 0; s < 2; s++) {
        for (uint32_t i = 0; i < c[s].points; i++)
            if (out->partner[s][i] < 0) return LATHE_ERR_FORMAT;   /* a string that does not go round once */
        if (loop[s]->hole) reverse_partner(out->partner[s], c[s].points, c[1 - s].points);
    }
    return LATHE_OK;
}
