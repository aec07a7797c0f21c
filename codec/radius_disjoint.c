/* Do the polygons of a slice fit together? Then the overlay makes a sound surface of them. */
#include "radius_trace.h"

static bool meet(lathe_point a, lathe_point b, lathe_point c, lathe_point d) {
    int64_t s = lathe__orient(a, b, c), t = lathe__orient(a, b, d);
    if ((s > 0 && t > 0) || (s < 0 && t < 0)) return false;
    s = lathe__orient(c, d, a), t = lathe__orient(c, d, b);
    return !((s > 0 && t > 0) || (s < 0 && t < 0));
}

static bool encloses(const lathe_point *p, uint32_t count, lathe_point at) {
    bool odd = false;
    for (uint32_t i = 0; i < count; i++) {
        lathe_point a = p[i], b = p[i + 1 < count ? i + 1 : 0];
        if ((a.y > at.y) != (b.y > at.y) && (a.y < b.y ? lathe__orient(a, b, at) : lathe__orient(b, a, at)) > 0) odd = !odd;
    }
    return odd;
}

typedef struct rectangle { int32_t low[2], high[2]; } rectangle;

static rectangle around(lathe_point a, lathe_point b) {
    return (rectangle){{a.x < b.x ? a.x : b.x, a.y < b.y ? a.y : b.y}, {a.x > b.x ? a.x : b.x, a.y > b.y ? a.y : b.y}};
}

static bool apart(const rectangle *a, const rectangle *b) {
    return a->high[0] < b->low[0] || b->high[0] < a->low[0] || a->high[1] < b->low[1] || b->high[1] < a->low[1];
}

static rectangle edge_box(const lathe_point *p, uint32_t count, uint32_t i) { return around(p[i], p[i + 1 < count ? i + 1 : 0]); }

static rectangle loop_box(const lathe_point *p, uint32_t count) {
    rectangle box = around(p[0], p[0]);
    for (uint32_t i = 1; i < count; i++) {
        rectangle at = around(p[i], p[i]);
        for (int k = 0; k < 2; k++) {
            if (at.low[k] < box.low[k]) box.low[k] = at.low[k];
            if (at.high[k] > box.high[k]) box.high[k] = at.high[k];
        }
    }
    return box;
}

/* Edges of one that stay clear of the other's box meet nothing. */
static bool loops_meet(const lathe_point *p, uint32_t n, const lathe_point *q, uint32_t m) {
    rectangle p_box = loop_box(p, n), q_box = loop_box(q, m);
    if (q_box.high[0] - q_box.low[0] > p_box.high[0] - p_box.low[0]) return loops_meet(q, m, p, n);   /* the wider one has more such edges */
    for (uint32_t i = 0; i < n; i++) {
        rectangle edge = edge_box(p, n, i);
        if (apart(&edge, &q_box)) continue;
        for (uint32_t j = 0; j < m; j++) {
            rectangle other = edge_box(q, m, j);
            if (apart(&edge, &other)) continue;
            if (meet(p[i], p[i + 1 < n ? i + 1 : 0], q[j], q[j + 1 < m ? j + 1 : 0])) return true;
        }
    }
    return false;
}

bool lathe__loops_fit(const lathe_outline *o) {
    for (uint32_t l = 0; l < o->loop_count; l++) {
        const lathe_loop *own = &o->loops[l];
        const lathe_point *p = o->points + own->first;
        int depth = 0;
        for (uint32_t k = 0; k < o->loop_count; k++) {
            const lathe_loop *other = &o->loops[k];
            const lathe_point *q = o->points + other->first;
            if (k == l) continue;
            if (k < l && loops_meet(p, own->count, q, other->count)) return false;
            if (encloses(q, other->count, p[0])) depth += other->hole ? -1 : 1;
        }
        if (depth != own->hole) return false;
    }
    return true;
}

