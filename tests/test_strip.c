/* Polygonal approximation: the counts of the paper's table, and the bounds that are promised. */
#include <math.h>
#include <stdlib.h>
#include "check.h"
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
        double t = spiral ? 18.244 + (0.924 - 18.244) * i / 1000 : 2 * 3.14159265358979323846 * i / 1000, r = spiral ? 1 / t : 1;
        points[2 * i] = r * cos(t);
        points[2 * i + 1] = (spiral ? -1 : 1) * r * sin(t);
    }
}

/* [L] table 1: break points of the proposed method; square roots are one fewer; multiplications where no point lies within e. */
static void table(void) {
    static const unsigned LYU[2][4] = {{1001, 201, 60, 20}, {762, 214, 64, 21}}, ROBERGE[5] = {1001, 501, 144, 45, 14};
    static const unsigned MULTIPLICATIONS[3] = {8999, 5399, 5002};
    for (int spiral = 0; spiral < 2; spiral++) {
        double e = 1e-5;
        make_curve(spiral);
        for (int k = 0; k < 4; k++, e *= 10) {
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
    lathe__strip_lyu(breaks, &n, points, POINTS, 0.1, NULL);
    CHECK_EQ(n, 7);
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
                drawn &= lathe__segment_distance(points + 2 * k, points + 2 * breaks[i], points + 2 * breaks[i + 1]) <= e;
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

int main(void) {
    table();
    bounds();
    small_inputs();
    return check_end();
}
