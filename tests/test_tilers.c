/* Tilings of the strip between two polygons: the toroidal optimum against all tilings there are, and what holds for each method. */
#include <math.h>
#include "check.h"
#include "sections.h"

static uint32_t seed = 11;
static uint32_t next_random(void) {
    seed = seed * 1664525u + 1013904223u;
    return seed >> 8;
}

enum { MAX = 64, RISE = LATHE_LATTICE_ONE };
static lathe_point a[MAX], b[MAX];
static uint32_t n, m;
static uint8_t steps[2 * MAX];
static double least;

static void try_all(lathe_tiling *t, uint32_t i, uint32_t j) {
    if (i == n && j == m) {
        lathe_tiling_measure measure;
        t->count = n + m;
        t->steps = steps;
        CHECK(!lathe__measure_tiling(&measure, t, a, n, b, m, RISE));
        if (measure.area < least) least = measure.area;
        return;
    }
    if (i < n) steps[i + j] = 1, try_all(t, i + 1, j);
    if (j < m) steps[i + j] = 2, try_all(t, i, j + 1);
}

static void make_star(lathe_point *p, uint32_t count, double shift) {
    for (uint32_t i = 0; i < count; i++) {
        double r = LATHE_LATTICE_ONE * (1.0 + next_random() % 400 / 100.0), t = 6.283185307 * i / count + shift;
        p[i] = (lathe_point){(int32_t)(r * cos(t) + shift * 30000), (int32_t)(r * sin(t))};
    }
}

typedef lathe_status tiler(lathe_tiling *, lathe_arena *, const lathe_point *, uint32_t, const lathe_point *, uint32_t, int32_t);
static tiler *const TILERS[3] = {lathe__tile_toroidal, lathe__tile_christiansen, lathe__tile_shortest};

/* Every edge of both is used exactly once; returns the strip's area. */
static double check_tiling(tiler *run, lathe_arena *arena) {
    lathe_tiling t;
    lathe_tiling_measure measure = {0};
    uint32_t of_a = 0, of_b = 0;
    if (!CHECK(!run(&t, arena, a, n, b, m, RISE))) return 0;
    for (uint32_t k = 0; k < t.count; k++) of_a += t.steps[k] & 1, of_b += t.steps[k] >> 1;
    CHECK(of_a == n && of_b == m);
    CHECK(!lathe__measure_tiling(&measure, &t, a, n, b, m, RISE));
    CHECK_EQ(measure.triangles, n + m);
    return measure.area;
}

int main(void) {
    lathe_arena arena = {0};
    for (int round = 0; round < 60; round++) {
        n = 3 + next_random() % 3, m = 3 + next_random() % 3;
        make_star(a, n, 0);
        make_star(b, m, 0.3);
        least = INFINITY;
        for (uint32_t k = 0; k < n * m; k++) try_all(&(lathe_tiling){.start = {k % n, k / n}}, 0, 0);
        for (int k = 0; k < 3; k++) {
            double area = check_tiling(TILERS[k], &arena);
            CHECK(area >= least * (1 - 1e-12));
            if (!k) CHECK(area <= least * (1 + 1e-9));
        }
        lathe__arena_reset(&arena);
    }
    for (int round = 0; round < 60; round++) {
        n = 3 + next_random() % (MAX - 3), m = 3 + next_random() % (MAX - 3);
        make_star(a, n, 0);
        make_star(b, m, 0.7);
        double best = check_tiling(TILERS[0], &arena);
        for (int k = 1; k < 3; k++) CHECK(check_tiling(TILERS[k], &arena) >= best * (1 - 1e-12));
        lathe__arena_reset(&arena);
    }
    /* The same polygon twice: straight walls are the optimum. */
    n = m = 24;
    for (uint32_t i = 0; i < n; i++) a[i] = b[i] = (lathe_point){(int32_t)(9e5 * cos(i * 6.283185307 / n)), (int32_t)(9e5 * sin(i * 6.283185307 / n))};
    double wall = 0;
    for (uint32_t i = 0; i < n; i++) wall += hypot(a[i].x - (double)a[(i + 1) % n].x, a[i].y - (double)a[(i + 1) % n].y) * RISE;
    CHECK(fabs(check_tiling(TILERS[0], &arena) - wall) < wall * 1e-9);
    lathe_tiling t;
    CHECK_EQ(lathe__tile_toroidal(&t, &arena, a, 2, b, m, RISE), LATHE_ERR_RANGE);
    CHECK_EQ(lathe__tile_christiansen(&t, &arena, a, n, b, 2, RISE), LATHE_ERR_RANGE);
    CHECK_EQ(lathe__tile_shortest(&t, &arena, a, 2, b, m, RISE), LATHE_ERR_RANGE);
    lathe__arena_free(&arena);
    return check_end();
}
