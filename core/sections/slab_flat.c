/* No triangle and no inner edge may lie in a slice plane, where the slab beyond could have the same one: such an edge
 * gets a raised middle, such a triangle a raised centroid. */
#include "adjacency.h"
#include "slab_build.h"
#include <string.h>

static bool is_flat_edge(const lathe_slab_build *s, uint32_t a, uint32_t b) {
    int side = lathe__slab_side(s, a);
    if (side == 2 || lathe__slab_side(s, b) != side) return false;
    /* Loops are few against vertices, and both ends of an outline edge are neighbours in the numbering but at a loop's
     * seam. */
    uint32_t low = a < b ? a : b, high = a < b ? b : a;
    const lathe_outline *o = s->in->outline[side];
    uint32_t base = side ? s->upper : 0, i = 0, j = o->loop_count;
    while (j - i > 1) {
        uint32_t m = (i + j) / 2;
        if (o->loops[m].first + base <= low)
            i = m;
        else
            j = m;
    }
    uint32_t first = o->loops[i].first + base, last = first + o->loops[i].count - 1;
    return !(high <= last && (high == low + 1 || (low == first && high == last)));
}

static int32_t raised(const lathe_slab_build *s, uint32_t v, int32_t rise) {
    return lathe__slab_side(s, v) ? s->in->height[1] - rise : s->in->height[0] + rise;
}

/* mid: half-edge -> its raised middle, or NONE. */
static lathe_status raise_edges(uint32_t *mid, lathe_slab_build *s, const uint32_t (*t)[3], uint32_t count,
                                int32_t rise) {
    lathe_half_edges edges;
    lathe_status status = lathe__half_edges_build(&edges, s->arena, t, count);
    memset(mid, 0xff, (size_t)count * 3 * sizeof *mid);
    for (uint32_t i = 0; !status && i < count * 3; i++) {
        uint32_t a = t[i / 3][i % 3], b = t[i / 3][(i + 1) % 3];
        if (mid[i] != LATHE_SLAB_NONE || !is_flat_edge(s, a, b)) continue;
        lathe_point p = lathe__slab_point(s, a), q = lathe__slab_point(s, b);
        status = lathe__slab_add_vertex(s, &mid[i], (int32_t)(((int64_t)p.x + q.x) / 2),
                                        (int32_t)(((int64_t)p.y + q.y) / 2), raised(s, a, rise));
        uint32_t twin = lathe__half_edge(&edges, b, a);
        if (twin != LATHE_NO_NEIGHBOUR) mid[twin] = mid[i];
    }
    return status;
}

/* A triangle with no edge raised: if it is flat, it gets a centroid. */
static lathe_status raise_triangle(lathe_slab_build *s, const uint32_t v[3], int32_t rise) {
    int side = lathe__slab_side(s, v[0]);
    if (side == 2 || side != lathe__slab_side(s, v[1]) || side != lathe__slab_side(s, v[2]))
        return lathe__slab_emit(s, v[0], v[1], v[2], false);
    int64_t x = 0, y = 0;
    uint32_t centre;
    for (int c = 0; c < 3; c++) x += lathe__slab_point(s, v[c]).x, y += lathe__slab_point(s, v[c]).y;
    lathe_status status = lathe__slab_add_vertex(s, &centre, (int32_t)(x / 3), (int32_t)(y / 3), raised(s, v[0], rise));
    for (int c = 0; !status && c < 3; c++) status = lathe__slab_emit(s, v[c], v[(c + 1) % 3], centre, false);
    return status;
}

/* v with middles m on one to three of its edges. */
static lathe_status split_triangle(lathe_slab_build *s, const uint32_t v[3], const uint32_t m[3], int split) {
    lathe_status status = LATHE_OK;
    int k = 0;
    if (split == 3) {
        for (; !status && k < 3; k++) status = lathe__slab_emit(s, v[k], m[k], m[(k + 2) % 3], false);
        return status ? status : lathe__slab_emit(s, m[0], m[1], m[2], false);
    }
    /* The only edge that is split, or the only one that is not: from a to b; c is opposite. */
    while ((m[k] != LATHE_SLAB_NONE) != (split == 1)) k++;
    uint32_t a = v[k], b = v[(k + 1) % 3], c = v[(k + 2) % 3], bc = m[(k + 1) % 3], ca = m[(k + 2) % 3];
    if (split == 1) {
        status = lathe__slab_emit(s, a, m[k], c, false);
        return status ? status : lathe__slab_emit(s, m[k], b, c, false);
    }
    status = lathe__slab_emit(s, ca, bc, c, false);
    if (!status) status = lathe__slab_emit(s, a, b, bc, false);
    return status ? status : lathe__slab_emit(s, a, bc, ca, false);
}

lathe_status lathe__slab_raise_flat(lathe_slab_build *s, uint32_t from, int32_t rise) {
    uint32_t count = s->b.mesh.triangle_count - from;
    uint32_t(*t)[3] = lathe__arena_alloc(s->arena, count + 1, sizeof *t),
    *mid = LATHE_NEW(s->arena, uint32_t, (size_t)count * 3 + 1);
    if (!t || !mid) return LATHE_ERR_MEMORY;
    if (!count) return LATHE_OK;
    memcpy(t, s->b.mesh.triangles + from, count * sizeof *t);
    lathe_status status = raise_edges(mid, s, (const uint32_t(*)[3])t, count, rise);
    s->b.mesh.triangle_count = from;
    for (uint32_t i = 0; !status && i < count; i++) {
        const uint32_t *m = mid + 3 * (size_t)i;
        int split = (m[0] != LATHE_SLAB_NONE) + (m[1] != LATHE_SLAB_NONE) + (m[2] != LATHE_SLAB_NONE);
        status = split ? split_triangle(s, t[i], m, split) : raise_triangle(s, t[i], rise);
    }
    return status;
}
