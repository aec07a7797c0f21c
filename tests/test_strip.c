/* Polygonal approximation: the counts of the paper's table, and the bounds that are promised. */
#include <math.h>
#include <stdlib.h>
#include "check.h"
#include "closing.h"
#include "mask.h"
#include "strip.h"

enum { POINTS = 1001 };
static double points[2 * POINTS];
static uint32_t breaks[POINTS], n;
static uint32_t seed = 3;

static uint32_t next_random(void) {
    seed = seed * 1664525u + 1013904223u;
    return seed >> 8;
}

static void make_curve(int spiral) {
    for (int i = 0; i < POINTS; i++) {
        double t = spiral ? 18.244 + (0.924 - 18.244) * i / 1000 : 2 * 3.14159265358979323846 * i / 1000,
               r = spiral ? 1 / t : 1;
        points[2 * i] = r * cos(t);
        points[2 * i + 1] = (spiral ? -1 : 1) * r * sin(t);
    }
}

/* [L] table 1: break points of the proposed method; square roots are one fewer; multiplications where no point lies
 * within e. */
static void table(void) {
    static const unsigned LYU[2][5] = {{1001, 201, 60, 20, 7}, {762, 214, 64, 21, 6}},
                          ROBERGE[5] = {1001, 501, 144, 45, 14};
    static const unsigned MULTIPLICATIONS[3] = {8999, 5399, 5002};
    for (int spiral = 0; spiral < 2; spiral++) {
        double e = 1e-5;
        make_curve(spiral);
        for (int k = 0; k < 5; k++, e *= 10) {
            lathe_strip_cost cost;
            lathe__strip_lyu(breaks, &n, points, POINTS, e, &cost);
            CHECK_EQ(n, LYU[spiral][k]);
            CHECK_EQ(cost.square_roots, n - 1);
            if (!spiral && k < 3) CHECK_EQ(cost.multiplications, MULTIPLICATIONS[k]);
        }
    }
    make_curve(0);
    double e = 1e-5;
    for (int k = 0; k < 5; k++, e *= 10) {
        lathe__strip_roberge(breaks, &n, points, POINTS, e, NULL);
        CHECK_EQ(n, ROBERGE[k]);
    }
    lathe__strip_williams(breaks, &n, points, POINTS, 1e-4, NULL);
    CHECK_EQ(n, 251);
    lathe__strip_williams(breaks, &n, points, POINTS, 1e-3, NULL);
    CHECK_EQ(n, 73);
}

/* A walk in eight directions that mostly goes on as before. */
static uint32_t make_chain(uint32_t count) {
    static const int DX[8] = {1, 1, 0, -1, -1, -1, 0, 1}, DY[8] = {0, 1, 1, 1, 0, -1, -1, -1};
    uint32_t direction = next_random() % 8;
    double x = 0, y = 0;
    for (uint32_t i = 0; i < count; i++) {
        points[2 * i] = x;
        points[2 * i + 1] = y;
        if (next_random() % 3 == 0) direction = (direction + next_random() % 3 + 7) % 8;
        x += DX[direction];
        y += DY[direction];
    }
    return count;
}

/* Small steps, mostly ahead, sometimes back: hairpins, points within e, and no ties. */
static uint32_t make_walk(uint32_t count) {
    double x = 0, y = 0, angle = next_random() % 6283 / 1000.0, noise = (1 + next_random() % 40) / 10.0;
    for (uint32_t i = 0; i < count; i++) {
        points[2 * i] = x;
        points[2 * i + 1] = y;
        angle += ((next_random() % 2001) / 1000.0 - 1) * noise * noise / 8;
        double step = (1 + next_random() % 1000) / 500.0;
        x += step * cos(angle);
        y += step * sin(angle);
    }
    return count;
}

static double cross_of(const double a[2], const double b[2]) { return a[0] * b[1] - a[1] * b[0]; }

/* Equations 1 to 7 and 15 to 19 as they are, every product from its vectors: what the incremental form must find. */
static uint32_t run_as_defined(uint32_t start, uint32_t count, double e) {
    const double *s = points + 2 * start;
    uint32_t i = start + 1;
    while (i < count && hypot(points[2 * i] - s[0], points[2 * i + 1] - s[1]) <= e) i++;
    if (i == count) return count;
    double dx = points[2 * i] - s[0], dy = points[2 * i + 1] - s[1], f = e / hypot(dx, dy);
    double upper[2] = {s[0] - dy * f, s[1] + dx * f}, lower[2] = {s[0] + dy * f, s[1] - dx * f};
    double up_min[2] = {points[2 * i] - upper[0], points[2 * i + 1] - upper[1]};
    double low_max[2] = {points[2 * i] - lower[0], points[2 * i + 1] - lower[1]};
    for (i++; i < count; i++) {
        double up[2] = {points[2 * i] - upper[0], points[2 * i + 1] - upper[1]};
        double low[2] = {points[2 * i] - lower[0], points[2 * i + 1] - lower[1]};
        if (cross_of(low_max, up) > 0 || cross_of(up_min, low) < 0) break;
        if (cross_of(low_max, low) < 0) low_max[0] = low[0], low_max[1] = low[1];
        if (cross_of(up_min, up) > 0) up_min[0] = up[0], up_min[1] = up[1];
    }
    return i;
}

static void as_defined(void) {
    uint64_t runs = 0;
    for (int round = 0; round < 3000; round++) {
        uint32_t count = make_walk(5 + next_random() % 200), start = 0, k = 0;
        double e = 0.05 + (next_random() % 4000) / 1000.0;
        lathe__strip_lyu(breaks, &n, points, count, e, NULL);
        int same = 1;
        for (uint32_t end = 0; same && (end = run_as_defined(start, count, e)) < count; start = end - 1, runs++)
            same = ++k < n && breaks[k] == end - 1;
        CHECK(same && k + (breaks[n - 2] < count - 1 && start != count - 1) == n - 1);
    }
    CHECK(runs > 20000);
}

/* Is there a line within e of the start to which all points of a run are within e? Directions are tried finely. */
static int some_line(uint32_t from, uint32_t to, double e) {
    double best = INFINITY;
    for (int k = 0; k < 2048; k++) {
        double c = cos(3.14159265358979 * k / 2048), s = sin(3.14159265358979 * k / 2048), low = 0, high = 0;
        for (uint32_t i = from; i <= to; i++) {
            double d = (points[2 * i] - points[2 * from]) * s - (points[2 * i + 1] - points[2 * from + 1]) * c;
            if (d < low) low = d;
            if (d > high) high = d;
        }
        if ((high - low) / 2 < best) best = (high - low) / 2;
    }
    return best <= e * 1.001 + 0.01;
}

static void bounds(void) {
    for (int round = 0; round < 300; round++) {
        uint32_t count = make_chain(20 + next_random() % 300);
        double e = 0.3 + (next_random() % 300) / 100.0;
        lathe__strip_lyu(breaks, &n, points, count, e, NULL);
        CHECK(breaks[0] == 0 && breaks[n - 1] == count - 1);
        int lines = 1, rising = 1, drawn = 1;
        for (uint32_t i = 0; i + 1 < n; i++) {
            rising &= breaks[i] < breaks[i + 1];
            if (round < 40) lines &= some_line(breaks[i], breaks[i + 1], e);
        }
        CHECK(rising && lines);
        lathe__strip_drawn(breaks, &n, points, count, e);
        CHECK(breaks[0] == 0 && breaks[n - 1] == count - 1);
        for (uint32_t i = 0; i + 1 < n; i++)
            for (uint32_t k = breaks[i]; k <= breaks[i + 1]; k++)
                drawn &=
                    lathe__segment_distance(points + 2 * k, points + 2 * breaks[i], points + 2 * breaks[i + 1]) <= e;
        CHECK(drawn);
    }
}

static void small_inputs(void) {
    double two[4] = {0, 0, 1, 0}, same[8] = {0, 0, 0, 0, 0, 0, 0, 0};
    lathe__strip_lyu(breaks, &n, two, 2, 10, NULL);
    CHECK(n == 2 && breaks[1] == 1);
    lathe__strip_drawn(breaks, &n, same, 4, 0.5);
    CHECK(n == 2 && breaks[1] == 3);
    lathe__strip_williams(breaks, &n, same, 4, 0.5, NULL);
    CHECK(n == 2 && breaks[1] == 3);
    /* A hairpin past the end: the strip takes it, the chord does not. */
    double hairpin[6] = {0, 0, 10, 0, 1, 0};
    lathe__strip_lyu(breaks, &n, hairpin, 3, 0.5, NULL);
    CHECK_EQ(n, 2);
    lathe__strip_drawn(breaks, &n, hairpin, 3, 0.5);
    CHECK_EQ(n, 3);
}

/* ---- outlines of pixel regions ---- */

static void random_slice(lathe_mask *mask, int size, uint32_t density) {
    int32_t dims[3] = {size + 2, size + 2, 1}, origin[3] = {0, 0, 0};
    if (lathe__mask_new(mask, dims, origin)) abort();
    for (int v = 1; v <= size; v++)
        for (int u = 1; u <= size; u++) {
            /* Rings and blobs with noisy borders. */
            double x = u - size / 2.0, y = v - size / 2.0,
                   r = hypot(x, y) + (next_random() % 100) / 100.0 * density / 30;
            if (fmod(r, 7) < 4 || next_random() % 100 < density / 10)
                mask->bits[(size_t)v * (size_t)mask->row_words + (size_t)(u >> 6)] |= (uint64_t)1 << (u & 63);
        }
}

static int within(const lathe_outline *o, lathe_point p) {
    int odd = 0;
    for (uint32_t l = 0; l < o->loop_count; l++)
        for (uint32_t i = 0, k = o->loops[l].count - 1; i < o->loops[l].count; k = i++) {
            lathe_point a = o->points[o->loops[l].first + i], b = o->points[o->loops[l].first + k];
            if ((a.y > p.y) != (b.y > p.y) && (double)(b.x - a.x) * (p.y - a.y) / (b.y - a.y) + a.x > p.x) odd ^= 1;
        }
    return odd;
}

static int simple_outline(const lathe_outline *o) {
    for (uint32_t l = 0; l < o->loop_count; l++)
        for (uint32_t i = 0; i < o->loops[l].count; i++)
            for (uint32_t m = l; m < o->loop_count; m++)
                for (uint32_t k = m == l ? i + 1 : 0; k < o->loops[m].count; k++) {
                    uint32_t n1 = o->loops[l].count, n2 = o->loops[m].count;
                    if (m == l && ((i + 1) % n1 == k || (k + 1) % n2 == i)) continue;
                    const lathe_point *p = o->points + o->loops[l].first, *q = o->points + o->loops[m].first;
                    if (lathe__edges_meet(p[i], p[(i + 1) % n1], q[k], q[(k + 1) % n2])) return 0;
                }
    return 1;
}

static double distance_to_loop(const lathe_outline *o, uint32_t l, lathe_point p) {
    double best = INFINITY, at[2] = {p.x, p.y};
    for (uint32_t i = 0, k = o->loops[l].count - 1; i < o->loops[l].count; k = i++) {
        lathe_point a = o->points[o->loops[l].first + i], b = o->points[o->loops[l].first + k];
        best = fmin(best, lathe__segment_distance(at, (double[]){a.x, a.y}, (double[]){b.x, b.y}));
    }
    return best;
}

static void outlines(void) {
    lathe_arena arena = {0};
    uint64_t before = 0, later = 0;
    for (int round = 0; round < 400; round++) {
        lathe_mask mask;
        lathe_outline whole, less;
        int32_t *border, tolerance = (int32_t)(LATHE_LATTICE_ONE * (0.3 + (next_random() % 200) / 100.0));
        random_slice(&mask, 8 + (int)(next_random() % 24), next_random() % 100);
        lathe_slice_view view = {.pixels = mask.bits,
                                 .width = mask.size[0],
                                 .height = mask.size[1],
                                 .row_words = mask.row_words,
                                 .fraction = 32};
        CHECK(!lathe__trace_outline(&whole, &border, &arena, &view));
        if (CHECK(!lathe__strip_outline(&less, &arena, &whole, tolerance)) && whole.loop_count) {
            double most = 0;
            int same = 1;
            for (uint32_t l = 0; l < whole.loop_count; l++)
                for (uint32_t i = 0; i < whole.loops[l].count; i++)
                    most = fmax(most, distance_to_loop(&less, l, whole.points[whole.loops[l].first + i]));
            /* Just beside each loop's first edge, on its left: inside in both. */
            for (uint32_t l = 0; l < less.loop_count; l++) {
                lathe_point a = less.points[less.loops[l].first], b = less.points[less.loops[l].first + 1];
                double dx = b.x - (double)a.x, dy = b.y - (double)a.y, d = hypot(dx, dy);
                same &= within(&less, (lathe_point){(int32_t)((a.x + b.x) / 2.0 - dy / d * 40),
                                                    (int32_t)((a.y + b.y) / 2.0 + dx / d * 40)});
            }
            CHECK(most <= tolerance + 1 && same && simple_outline(&less));
            before += whole.point_count;
            later += less.point_count;
        }
        lathe__mask_free(&mask);
        lathe__arena_reset(&arena);
    }
    CHECK(later * 2 < before);
    lathe__arena_free(&arena);
}

int main(void) {
    table();
    outlines();
    as_defined();
    bounds();
    small_inputs();
    return check_end();
}
