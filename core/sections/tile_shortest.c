/* One-to-one branching by shortest spans [P 3.4]: a moves so that the centroids lie above each other; from each
 * point of a a list of spans goes round both polygons, always taking the shorter of the two next spans; the list of
 * least total length wins. O(a * (a + b)): m lists of m + n spans each. */
#include <math.h>
#include "sections.h"

typedef struct strip {
    const lathe_point *a, *b;
    uint32_t n, m;
    double shift[2], rise;     /* of a; of b above a */
} strip;

static void centroid(double out[2], const lathe_point *p, uint32_t n) {
    double area = 0, x = 0, y = 0;
    for (uint32_t i = 0; i < n; i++) {
        /* Relative to the first point: lattice coordinates squared would lose digits. */
        double ax = p[i].x - (double)p[0].x, ay = p[i].y - (double)p[0].y;
        double bx = p[(i + 1) % n].x - (double)p[0].x, by = p[(i + 1) % n].y - (double)p[0].y, c = ax * by - ay * bx;
        area += c, x += c * (ax + bx), y += c * (ay + by);
    }
    out[0] = p[0].x + (area != 0 ? x / (3 * area) : 0);
    out[1] = p[0].y + (area != 0 ? y / (3 * area) : 0);
}

static double span(const strip *s, uint32_t i, uint32_t j) {
    double x = s->a[i].x + s->shift[0] - s->b[j].x, y = s->a[i].y + s->shift[1] - s->b[j].y;
    return sqrt(x * x + y * y + s->rise * s->rise);
}

/* The list that starts at (i, j); its total length, given up when it exceeds `most`. steps: NULL or n + m bytes. */
static double follow(const strip *s, uint32_t i, uint32_t j, double most, uint8_t *steps) {
    double total = 0;
    for (uint32_t done_a = 0, done_b = 0; done_a + done_b < s->n + s->m && total <= most;) {
        uint32_t next_i = i + 1 < s->n ? i + 1 : 0, next_j = j + 1 < s->m ? j + 1 : 0;
        double along_a = done_a < s->n ? span(s, next_i, j) : INFINITY,
               along_b = done_b < s->m ? span(s, i, next_j) : INFINITY;
        bool first = along_a <= along_b;
        if (steps) steps[done_a + done_b] = first ? 1 : 2;
        if (first) i = next_i, done_a++;
        else j = next_j, done_b++;
        total += first ? along_a : along_b;
    }
    return total;
}

lathe_status lathe__tile_shortest(lathe_tiling *out, lathe_arena *arena, const lathe_point *a, uint32_t a_count,
                                  const lathe_point *b, uint32_t b_count, int32_t rise) {
    if (a_count < 3 || b_count < 3) return LATHE_ERR_RANGE;
    strip s = {.a = a, .b = b, .n = a_count, .m = b_count, .rise = rise};
    double from[2], to[2], best = INFINITY;
    centroid(from, a, a_count);
    centroid(to, b, b_count);
    for (int k = 0; k < 2; k++) s.shift[k] = to[k] - from[k];
    lathe_tiling t = {.count = a_count + b_count, .steps = LATHE_NEW(arena, uint8_t, (size_t)a_count + b_count)};
    if (!t.steps) return LATHE_ERR_MEMORY;
    for (uint32_t i = 0; i < a_count; i++) {
        uint32_t nearest = 0;
        for (uint32_t j = 1; j < b_count; j++)
            if (span(&s, i, j) < span(&s, i, nearest)) nearest = j;
        double total = follow(&s, i, nearest, best, NULL);
        if (total < best) best = total, t.start[0] = i, t.start[1] = nearest;
    }
    follow(&s, t.start[0], t.start[1], INFINITY, t.steps);
    *out = t;
    return LATHE_OK;
}
