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

bool lathe__loops_fit(const lathe_outline *o) {
    for (uint32_t l = 0; l < o->loop_count; l++) {
        const lathe_loop *own = &o->loops[l];
        const lathe_point *p = o->points + own->first;
        int depth = 0;
        for (uint32_t k = 0; k < o->loop_count; k++) {
            const lathe_loop *other = &o->loops[k];
            const lathe_point *q = o->points + other->first;
            if (k == l) continue;
            for (uint32_t i = 0; k < l && i < own->count; i++)
                for (uint32_t j = 0; j < other->count; j++)
                    if (meet(p[i], p[i + 1 < own->count ? i + 1 : 0], q[j], q[j + 1 < other->count ? j + 1 : 0])) return false;
            if (encloses(q, other->count, p[0])) depth += other->hole ? -1 : 1;
        }
        if (depth != own->hole) return false;
    }
    return true;
}

