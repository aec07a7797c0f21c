/* Roberge's strip (1985), as [L] describes it: laid once along the direction to the first point that is far enough
 * away; a run ends with the last point inside. */
#include <math.h>
#include "strip.h"

static uint32_t first_beyond(const double *p, uint32_t start, uint32_t count, double squared, double *found,
                             lathe_strip_cost *cost) {
    for (uint32_t i = start + 1; i < count; i++) {
        double dx = p[2 * i] - p[2 * start], dy = p[2 * i + 1] - p[2 * start + 1];
        cost->multiplications += 2;
        if ((*found = dx * dx + dy * dy) > squared) return i;
    }
    return count;
}

void lathe__strip_roberge(uint32_t *breaks, uint32_t *break_count, const double *p, uint32_t count, double tolerance,
                          lathe_strip_cost *cost) {
    lathe_strip_cost spent = {0, 1};
    uint32_t n = 0, start = 0;
    breaks[n++] = 0;
    for (;;) {
        double length = 0;
        uint32_t i = first_beyond(p, start, count, tolerance * tolerance, &length, &spent);
        if (i == count) break;
        double f = tolerance / sqrt(length), dx = p[2 * i] - p[2 * start], dy = p[2 * i + 1] - p[2 * start + 1];
        double ex = dy * f, ey = dx * f, ux = p[2 * start] - ex, uy = p[2 * start + 1] + ey, lx = p[2 * start] + ex,
               ly = p[2 * start + 1] - ey;
        spent.square_roots++;
        spent.multiplications += 3;
        for (i++; i < count; i++) {
            spent.multiplications += 2;
            if (dx * (p[2 * i + 1] - uy) - dy * (p[2 * i] - ux) > 0) break;
            spent.multiplications += 2;
            if (dx * (p[2 * i + 1] - ly) - dy * (p[2 * i] - lx) < 0) break;
        }
        if (i == count) break;
        breaks[n++] = start = i - 1;
    }
    if (breaks[n - 1] != count - 1) breaks[n++] = count - 1;
    *break_count = n;
    if (cost) *cost = spent;
}
