/* [L]: with U and L fixed beside the start S, the strip's upper line turns about U and its lower one about L. U_min is the vector
 * from U to the point that limits the upper line, L_max that from L to the point that limits the lower one; a point x goes on with
 * the run while L_max x U_x <= 0 and U_min x L_x >= 0 (a x b: cross product); then L_max becomes L_x if L_max x L_x < 0, U_min
 * becomes U_x if U_min x U_x > 0 (equations 15 to 18, the signs of 17 and 18 put right). The products are kept up with the step dP
 * from point to point (26 to 29), two multiplications a line.
 * A line that changes needs its products anew, two multiplications more. So its change waits [L II.3]: while the step turns the
 * waiting line further (the previous point's U_x x dP > 0, L_x x dP < 0; the paper's 31 does not imply its 32) the line just goes
 * on to the next point, which needs no product at all: U_x x L_x > 0 for each point that changes a line, as these lie in front of U
 * and L, and the step only adds to it. */
#include "strip.h"
#include <math.h>

typedef struct vec { double x, y; } vec;

static vec at(const double *points, uint32_t i) { return (vec){points[2 * i], points[2 * i + 1]}; }
static vec minus(vec a, vec b) { return (vec){a.x - b.x, a.y - b.y}; }
static double cross(vec a, vec b, lathe_strip_cost *cost) {
    cost->multiplications += 2;
    return a.x * b.y - a.y * b.x;
}

/* One of the two lines. What is said of the upper one holds for the lower one with the sign of all products changed. */
typedef struct line {
    vec pivot;                 /* U, L */
    vec limit;                 /* U_min, L_max; not up to date while the line is waiting */
    double across, own;        /* sign * limit x (vector from the other line's pivot, from its own, to the point in hand) */
    double sign;
    bool waiting;              /* limit is the vector to the point in hand */
} line;

typedef struct strip {
    const double *points;
    uint32_t count;
    double tolerance, squared;
    lathe_strip_cost cost;
    line upper, lower;
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

/* The reference strip: U and L beside the start, across the direction to point i (equations 1 to 7, e_x and e_y put right). */
static void lay(strip *s, uint32_t start, uint32_t i, double squared) {
    vec from = at(s->points, start), to = at(s->points, i), d = minus(to, from);
    double f = s->tolerance / sqrt(squared), ex = d.y * f, ey = d.x * f;
    s->cost.square_roots++;
    s->cost.multiplications += 3;
    s->upper = (line){.pivot = {from.x - ex, from.y + ey}, .sign = 1};
    s->lower = (line){.pivot = {from.x + ex, from.y - ey}, .sign = -1};
    s->upper.limit = minus(to, s->upper.pivot);
    s->lower.limit = minus(to, s->lower.pivot);
    s->upper.across = s->lower.across = cross(s->upper.limit, s->lower.limit, &s->cost);
}

/* Takes a line on from `before` by a step; false if the strip cannot turn so far. */
static bool advance(line *l, const line *other, vec before, vec step, lathe_strip_cost *cost) {
    if (!l->waiting) {
        double change = l->sign * cross(l->limit, step, cost);
        l->across += change;
        l->own += change;
        l->waiting = l->own > 0;
        return l->across >= 0;
    }
    vec last = minus(before, l->pivot);
    double change = l->sign * cross(last, step, cost);
    if (change > 0) return true;
    l->waiting = false;
    l->limit = last;
    l->own = change;
    l->across = l->sign * cross(last, minus(before, other->pivot), cost) + change;
    return l->across >= 0;
}

/* Does point i go on with the run? */
static bool goes_on(strip *s, uint32_t i) {
    vec before = at(s->points, i - 1), step = minus(at(s->points, i), before);
    return advance(&s->lower, &s->upper, before, step, &s->cost) && advance(&s->upper, &s->lower, before, step, &s->cost);
}

void lathe__strip_lyu(uint32_t *breaks, uint32_t *break_count, const double *points, uint32_t count, double tolerance,
                      lathe_strip_cost *cost) {
    strip s = {.points = points, .count = count, .tolerance = tolerance, .squared = tolerance * tolerance, .cost = {0, 1}};
    uint32_t n = 0, start = 0;
    breaks[n++] = 0;
    for (;;) {
        double squared = 0;
        uint32_t i = find_first(&s, start, &squared);
        if (i == count) break;
        lay(&s, start, i, squared);
        for (i++; i < count && goes_on(&s, i);) i++;
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

void lathe__strip_drawn(uint32_t *breaks, uint32_t *break_count, const double *points, uint32_t count, double tolerance) {
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
