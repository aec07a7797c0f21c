/* Williams' cone intersection (1978): seen from the start, the circle of radius tolerance about each point fills a
 * cone; the next point goes on with the run while it lies in the intersection of all cones, so that the line from
 * the start to it meets every circle. */
#include <math.h>
#include "strip.h"

typedef struct cone { double left[2], right[2]; bool open; } cone;   /* directions; open: still the whole plane */

static double cross(const double a[2], const double b[2], lathe_strip_cost *cost) {
    cost->multiplications += 2;
    return a[0] * b[1] - a[1] * b[0];
}

/* Narrows by the circle about d; false if d is outside. A point within the tolerance of the start narrows nothing. */
static bool narrow(cone *c, const double d[2], double tolerance, lathe_strip_cost *cost) {
    double squared = d[0] * d[0] + d[1] * d[1] - tolerance * tolerance;
    cost->multiplications += 2;
    if (!c->open && (cross(d, c->left, cost) < 0 || cross(c->right, d, cost) < 0)) return false;
    if (squared <= 0) return true;
    /* The tangents from the start, times the distance. */
    double t = sqrt(squared), left[2] = {d[0] * t - d[1] * tolerance, d[1] * t + d[0] * tolerance};
    double right[2] = {d[0] * t + d[1] * tolerance, d[1] * t - d[0] * tolerance};
    cost->square_roots++;
    cost->multiplications += 4;
    if (c->open || cross(left, c->left, cost) > 0) c->left[0] = left[0], c->left[1] = left[1];
    if (c->open || cross(c->right, right, cost) > 0) c->right[0] = right[0], c->right[1] = right[1];
    c->open = false;
    return true;
}

void lathe__strip_williams(uint32_t *breaks, uint32_t *break_count, const double *p, uint32_t count, double tolerance,
                           lathe_strip_cost *cost) {
    lathe_strip_cost spent = {0, 1};
    uint32_t n = 0, start = 0;
    breaks[n++] = 0;
    while (start + 1 < count) {
        cone c = {.open = true};
        uint32_t i = start + 1;
        for (; i < count; i++) {
            double d[2] = {p[2 * i] - p[2 * start], p[2 * i + 1] - p[2 * start + 1]};
            if (!narrow(&c, d, tolerance, &spent)) break;
        }
        if (i == count) break;
        breaks[n++] = start = i - 1;
    }
    if (breaks[n - 1] != count - 1) breaks[n++] = count - 1;
    *break_count = n;
    if (cost) *cost = spent;
}
