/* [L]: with U and L fixed beside the start S, the strip's upper line turns about U and its lower one about L. U_min
 * is the vector from U to the point that limits the upper line, L_max that from L to the point that limits the lower
 * one; a point x goes on with the run while L_max x U_x <= 0 and U_min x L_x >= 0 (a x b: cross product). The
 * products are kept up incrementally with the step dP from point to point (equations 26 to 29, the signs of 28 and
 * 29 put right: L_max changes if L_max x L_x < 0, U_min if U_min x U_x > 0).
 *
 * A line that changes needs its product anew. When both do, each product is the other's negative: one computation.
 * When one does, the product waits [L II.3]: a line only changes at a point between the two lines and ahead of S,
 * where U_x x L_x > 0, and as long as the next step turns the same line on, or goes straight on along it, the
 * product stays that way. So it is computed only when a step turns back. (As printed, 31 => 32, the deferral asks
 * the other line and misses points; tests/test_strip.c compares with 15 to 19 as they are.) */
#include "strip.h"
#include <math.h>

typedef struct vec { double x, y; } vec;

static vec at(const double *points, uint32_t i) { return (vec){points[2 * i], points[2 * i + 1]}; }
static vec minus(vec a, vec b) { return (vec){a.x - b.x, a.y - b.y}; }
static double cross(vec a, vec b, lathe_strip_cost *cost) {
    cost->multiplications += 2;
    return a.x * b.y - a.y * b.x;
}

typedef struct strip {
    const double *points;
    uint32_t count;
    double tolerance, squared;
    lathe_strip_cost cost;
    vec upper, lower;          /* U, L */
    vec upper_min, lower_max;
    /* L_max x U_x, U_min x L_x, L_max x L_x, U_min x U_x of the point in hand. */
    double low_up, up_low, low_low, up_up;
    bool low_waits, up_waits;  /* low_up, up_low are not known, but on the right side */
} strip;

/* The first point farther than the tolerance from the start; count if there is none. */
static uint32_t find_first(strip *s, uint32_t start, double *squared) {
    for (uint32_t i = start + 1; i < s->count; i++) {
        vec d = minus(at(s->points, i), at(s->points, start));
        *squared = d.x * d.x + d.y * d.y;
        s->cost.multiplications += 2;
        if (*squared > s->squared) return i;
    }
    return s->count;
}

/* The reference strip: U and L beside the start, across the direction to point i (equations 1 to 7, e_x and e_y put
 * right). */
static void lay(strip *s, uint32_t start, uint32_t i, double squared) {
    vec from = at(s->points, start), d = minus(at(s->points, i), from);
    double f = s->tolerance / sqrt(squared), ex = d.y * f, ey = d.x * f;
    s->cost.square_roots++;
    s->cost.multiplications += 3;
    s->upper = (vec){from.x - ex, from.y + ey};
    s->lower = (vec){from.x + ex, from.y - ey};
    s->upper_min = minus(at(s->points, i), s->upper);
    s->lower_max = minus(at(s->points, i), s->lower);
    s->low_up = cross(s->lower_max, s->upper_min, &s->cost);
    s->up_low = -s->low_up;
    s->low_low = s->up_up = 0;
    s->low_waits = s->up_waits = false;
}

/* The lower line's side of "does point i go on with the run?". */
static bool low_goes_on(strip *s, uint32_t i, vec step) {
    double low = cross(s->lower_max, step, &s->cost);
    s->low_low += low;
    if (s->low_waits && low <= 0) return true;
    if (s->low_waits) s->low_up = cross(s->lower_max, minus(at(s->points, i - 1), s->upper), &s->cost);
    s->low_waits = false;
    s->low_up += low;
    return s->low_up <= 0;
}

static bool up_goes_on(strip *s, uint32_t i, vec step) {
    double up = cross(s->upper_min, step, &s->cost);
    s->up_up += up;
    if (s->up_waits && up >= 0) return true;
    if (s->up_waits) s->up_low = cross(s->upper_min, minus(at(s->points, i - 1), s->lower), &s->cost);
    s->up_waits = false;
    s->up_low += up;
    return s->up_low >= 0;
}

static bool goes_on(strip *s, uint32_t i) {
    vec step = minus(at(s->points, i), at(s->points, i - 1));
    return low_goes_on(s, i, step) && up_goes_on(s, i, step);
}

static void turn(strip *s, uint32_t i) {
    bool low = s->low_low < 0, up = s->up_up > 0;
    vec here = at(s->points, i);
    if (low) s->lower_max = minus(here, s->lower), s->low_low = 0, s->low_waits = true;
    if (up) s->upper_min = minus(here, s->upper), s->up_up = 0, s->up_waits = true;
    if (!low || !up) return;
    s->low_up = cross(s->lower_max, s->upper_min, &s->cost);
    s->up_low = -s->low_up;
    s->low_waits = s->up_waits = false;
}

void lathe__strip_lyu(uint32_t *breaks, uint32_t *break_count, const double *points, uint32_t count, double tolerance,
                      lathe_strip_cost *cost) {
    strip s = {
        .points = points, .count = count, .tolerance = tolerance, .squared = tolerance * tolerance, .cost = {0, 1}};
    uint32_t n = 0, start = 0;
    breaks[n++] = 0;
    for (;;) {
        double squared = 0;
        uint32_t i = find_first(&s, start, &squared);
        if (i == count) break;
        lay(&s, start, i, squared);
        for (i++; i < count && goes_on(&s, i); i++) turn(&s, i);
        if (i == count) break;
        breaks[n++] = start = i - 1;
    }
    if (breaks[n - 1] != count - 1) breaks[n++] = count - 1;
    *break_count = n;
    if (cost) *cost = s.cost;
}

/* ---- chords as they are drawn ---- */

double lathe__segment_distance(const double p[2], const double a[2], const double b[2]) {
    double dx = b[0] - a[0], dy = b[1] - a[1], px = p[0] - a[0], py = p[1] - a[1], length = dx * dx + dy * dy;
    double t = length > 0 ? (px * dx + py * dy) / length : 0;
    t = t < 0 ? 0 : t > 1 ? 1 : t;
    return hypot(px - t * dx, py - t * dy);
}

/* The point between that is farthest from the chord, if it is too far; else 0. */
static uint32_t worst(const double *points, uint32_t from, uint32_t to, double tolerance) {
    uint32_t found = 0;
    double most = tolerance;
    for (uint32_t i = from + 1; i < to; i++) {
        double d = lathe__segment_distance(points + 2 * i, points + 2 * from, points + 2 * to);
        if (d > most) most = d, found = i;
    }
    return found;
}

static uint32_t split_runs(uint32_t *breaks, const double *points, uint32_t count, double strip, double tolerance) {
    uint32_t n;
    lathe__strip_lyu(breaks, &n, points, count, strip, NULL);
    /* From the back: the runs still to be checked stay where they are, those that are done gather at the far end. */
    uint32_t done = count;
    while (n > 1) {
        uint32_t split = worst(points, breaks[n - 2], breaks[n - 1], tolerance);
        if (split) breaks[n] = breaks[n - 1], breaks[n - 1] = split, n++;
        else breaks[--done] = breaks[--n];
    }
    for (uint32_t i = done; i < count; i++) breaks[n++] = breaks[i];
    return n;
}

void lathe__strip_drawn(uint32_t *breaks, uint32_t *break_count, const double *points, uint32_t count,
                        double tolerance) {
    /* A chord is off by 1.44 tolerances on a circle, more on hairpins: a narrower strip needs fewer splits. */
    static const double STRIPS[] = {1, 0.7, 0.5};
    int best = 0;
    uint32_t fewest = UINT32_MAX;
    for (int k = 0; k < 3; k++) {
        uint32_t n = split_runs(breaks, points, count, STRIPS[k] * tolerance, tolerance);
        if (n < fewest) fewest = n, best = k;
    }
    *break_count = split_runs(breaks, points, count, STRIPS[best] * tolerance, tolerance);
}
