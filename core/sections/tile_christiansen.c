/* The greedy tiling of Christiansen and Sederberg (1978): both polygons are mapped into one unit square (their
 * bounding boxes become it); from the closest pair of points on, the shorter of the two next diagonals is taken. O(a
 * + b) after the closest partner of a's first point is found. */
#include <math.h>
#include "sections.h"

typedef struct square {
    double low[2], scale[2];
} square;

static square map_of(const lathe_point *p, uint32_t n) {
    lathe_point low = p[0], high = p[0];
    for (uint32_t i = 1; i < n; i++) {
        if (p[i].x < low.x) low.x = p[i].x;
        if (p[i].x > high.x) high.x = p[i].x;
        if (p[i].y < low.y) low.y = p[i].y;
        if (p[i].y > high.y) high.y = p[i].y;
    }
    double w = (double)high.x - low.x, h = (double)high.y - low.y;
    return (square){{low.x, low.y}, {w > 0 ? 1 / w : 1, h > 0 ? 1 / h : 1}};
}

static double gap(const lathe_point *p, const square *s, const lathe_point *q, const square *t) {
    double x = (p->x - s->low[0]) * s->scale[0] - (q->x - t->low[0]) * t->scale[0];
    double y = (p->y - s->low[1]) * s->scale[1] - (q->y - t->low[1]) * t->scale[1];
    return x * x + y * y;
}

lathe_status lathe__tile_christiansen(lathe_tiling *out, lathe_arena *arena, const lathe_point *a, uint32_t a_count,
                                      const lathe_point *b, uint32_t b_count, int32_t rise) {
    (void)rise;   /* the same for every span */
    if (a_count < 3 || b_count < 3) return LATHE_ERR_RANGE;
    lathe_tiling t = {.count = a_count + b_count, .steps = LATHE_NEW(arena, uint8_t, (size_t)a_count + b_count)};
    if (!t.steps) return LATHE_ERR_MEMORY;
    square sa = map_of(a, a_count), sb = map_of(b, b_count);
    for (uint32_t j = 1; j < b_count; j++)
        if (gap(&a[0], &sa, &b[j], &sb) < gap(&a[0], &sa, &b[t.start[1]], &sb)) t.start[1] = j;
    uint32_t i = 0, j = t.start[1], done_a = 0, done_b = 0;
    for (uint32_t k = 0; k < t.count; k++) {
        uint32_t next_i = i + 1 < a_count ? i + 1 : 0, next_j = j + 1 < b_count ? j + 1 : 0;
        bool first = done_b == b_count ||
                     (done_a < a_count && gap(&a[next_i], &sa, &b[j], &sb) <= gap(&a[i], &sa, &b[next_j], &sb));
        t.steps[k] = first ? 1 : 2;
        if (first) i = next_i, done_a++;
        else j = next_j, done_b++;
    }
    *out = t;
    return LATHE_OK;
}
