/* Contour closing, exterior and interior polygons: areas, counts and hand-made shapes of the kinds of figures 3, 4, 7 to 11. */
#include "branching.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "adjacency.h"
#include "check.h"
#include "pixel_shapes.h"

static lathe_arena arena;

static double area2(const lathe_point *at, const uint32_t *nodes, uint32_t n) {
    double sum = 0;
    for (uint32_t i = 0; i < n; i++) {
        lathe_point p = at[nodes[i]], q = at[nodes[(i + 1) % n]];
        sum += (double)p.x * q.y - (double)p.y * q.x;
    }
    return sum;
}

/* All triangles turn left, and their areas add up: they cover what they should, once. */
static bool tiles(const lathe_triangles *list, const lathe_point *at, double want) {
    double sum = 0;
    for (uint32_t i = 0; i < list->count; i++) {
        int64_t a = lathe__turn(at, list->at[i][0], list->at[i][1], list->at[i][2]);
        if (a <= 0) return false;
        sum += (double)a;
    }
    return sum == want;
}

/* ---- closing ---- */

static void simple_closing(void) {
    /* A kite whose one diagonal is short: figure 3 b, not a. */
    static const lathe_point kite[4] = {{0, 0}, {100, -10}, {200, 0}, {100, 10}};
    static const uint32_t four[4] = {0, 1, 2, 3};
    lathe_triangles list = {0};
    CHECK(lathe__close_polygon(&list, &arena, kite, four, 4) == LATHE_OK);
    CHECK_EQ(list.count, 2);
    bool diagonal = false;
    for (int k = 0; k < 3; k++) {
        uint32_t a = list.at[0][k], b = list.at[0][(k + 1) % 3];
        diagonal |= (a == 1 && b == 3) || (a == 3 && b == 1);
    }
    CHECK(diagonal);
    CHECK(lathe__close_polygon(&list, &arena, kite, four, 2) == LATHE_ERR_RANGE);
    uint64_t seed = 5;
    for (int i = 0; i < 400; i++) {
        shape s;
        shape_loop loop;
        uint32_t nodes[SHAPE_SIZE * SHAPE_SIZE * 4];
        shape_make(&s, &seed, i);
        shape_trace(&loop, &s, &seed, 1);
        for (uint32_t k = 0; k < loop.count; k++) nodes[k] = k;
        lathe_triangles t = {0};
        int ok = CHECK(lathe__close_polygon(&t, &arena, loop.points, nodes, loop.count) == LATHE_OK);
        ok = ok && CHECK_EQ(t.count, loop.count - 2) && CHECK(tiles(&t, loop.points, area2(loop.points, nodes, loop.count)));
        lathe__arena_reset(&arena);
        if (!ok) return;
    }
}

static uint32_t ring(lathe_point *at, uint32_t first, int n, double x, double y, double r, double turn, int sign) {
    for (int i = 0; i < n; i++) {
        double t = turn + sign * 6.283185307179586 * i / n;
        at[first + (uint32_t)i] = (lathe_point){(int32_t)lround((x + r * cos(t)) * 1000), (int32_t)lround((y + r * sin(t)) * 1000)};
    }
    return first + (uint32_t)n;
}

static void closing_with_islands(void) {
    uint64_t seed = 3;
    for (int i = 0; i < 300; i++) {
        lathe_point at[400];
        uint32_t nodes[400], end[10], rings = 1, n = ring(at, 0, 5 + shape_below(&seed, 40), 0, 0, 100, 0.1 * shape_below(&seed, 60), 1);
        end[0] = n;
        /* Islands on the places of a grid, so that they are apart. */
        for (int k = 0; k < 9; k++) {
            if (shape_below(&seed, 2)) continue;
            double x = (k % 3 - 1) * 34 + shape_below(&seed, 7), y = (k / 3 - 1) * 34 + shape_below(&seed, 7);
            n = ring(at, n, 3 + shape_below(&seed, 12), x, y, 2 + shape_below(&seed, 10), 0.1 * shape_below(&seed, 60), -1);
            end[rings++] = n;
        }
        double want = 0;
        for (uint32_t k = 0; k < n; k++) nodes[k] = k;
        for (uint32_t k = 0; k < rings; k++) want += area2(at, nodes + (k ? end[k - 1] : 0), end[k] - (k ? end[k - 1] : 0));
        bool inside = true;
        for (uint32_t k = end[0]; k < n; k++) inside &= lathe__polygon_holds(at, nodes, end[0], at[k]);
        if (end[0] < 9 && !inside) continue;   /* a coarse outer ring may cut the grid's corners */
        lathe_polygon polygon = {at, nodes, end, rings};
        lathe_triangles t = {0};
        CHECK(lathe__close_with_islands(&t, &arena, &polygon) == LATHE_OK);
        CHECK_EQ(t.count, n + 2 * (rings - 1) - 2);
        if (!CHECK(tiles(&t, at, want))) fprintf(stderr, "  in islands %d, %u rings\n", i, rings);
        lathe__arena_reset(&arena);
        if (check_failed > 10) return;
    }
    /* One island in a square, near one side: the two bridges of the least total length go to that side's corners' neighbourhood. */
    lathe_point at[8] = {{0, 0}, {100, 0}, {100, 100}, {0, 100}, {40, 10}, {40, 20}, {60, 20}, {60, 10}};
    uint32_t nodes[8] = {0, 1, 2, 3, 4, 5, 6, 7}, end[2] = {4, 8};
    lathe_polygon polygon = {at, nodes, end, 2};
    lathe_triangles t = {0};
    CHECK(lathe__close_with_islands(&t, &arena, &polygon) == LATHE_OK);
    CHECK_EQ(t.count, 8);
    lathe_half_edges edges;
    CHECK(lathe__half_edges_build(&edges, &arena, (const uint32_t(*)[3])t.at, t.count) == LATHE_OK);
    CHECK(lathe__half_edge(&edges, 0, 4) != LATHE_NO_NEIGHBOUR);   /* bridges: lower left and lower right corners */
    CHECK(lathe__half_edge(&edges, 1, 7) != LATHE_NO_NEIGHBOUR);
    lathe__arena_reset(&arena);
}

/* ---- exterior and interior polygons ---- */

typedef struct found {
    uint32_t count, bridges, rings, taken;
    double own, outer, filled; /* twice the areas: of the many, of F, of the triangles */
} found;

static bool run(found *f, const lathe_point *at, const uint32_t *first, uint32_t count) {
    lathe_many many = {at, first, count};
    uint32_t *nodes, of[1000], all[1000];
    bool taken[64];
    lathe_triangles list = {0};
    memset(f, 0, sizeof *f);
    if (!CHECK(lathe__exterior_polygon(&nodes, &f->count, taken, &arena, &many) == LATHE_OK)) return false;
    if (!CHECK(lathe__close_interior(&list, &f->rings, &arena, &many, nodes, f->count, taken) == LATHE_OK)) return false;
    for (uint32_t k = 0; k < count; k++) {
        f->taken += taken[k];
        for (uint32_t v = first[k]; v < first[k + 1]; v++) of[v] = k, all[v] = v;
        f->own += area2(at, all + first[k], first[k + 1] - first[k]);
    }
    for (uint32_t i = 0; i < f->count; i++) f->bridges += of[nodes[i]] != of[nodes[(i + 1) % f->count]];
    f->outer = area2(at, nodes, f->count);
    for (uint32_t i = 0; i < list.count; i++) f->filled += (double)lathe__turn(at, list.at[i][0], list.at[i][1], list.at[i][2]);
    /* What F encloses is the many and what lies between them. */
    bool ok = CHECK(tiles(&list, at, f->outer - f->own));
    lathe__arena_reset(&arena);
    return ok;
}

static void exterior_polygons(void) {
    lathe_point at[400];
    uint32_t first[20] = {0};
    found f;
    /* Two squares side by side, corners turned towards each other: nearest pair (10, 0)-(20, 0); the edges of F go to the next
     * corners, above and below, as printed. */
    static const lathe_point two[8] = {{10, 0}, {0, 10}, {-10, 0}, {0, -10}, {20, 0}, {30, -10}, {40, 0}, {30, 10}};
    first[1] = 4, first[2] = 8;
    if (run(&f, two, first, 2)) {
        CHECK_EQ(f.count, 6);
        CHECK_EQ(f.bridges, 2);
        CHECK_EQ(f.rings, 1);
    }
    /* Figure 10: four, no island: four bridges, one interior polygon. */
    for (uint32_t k = 0; k < 4; k++) first[k + 1] = ring(at, first[k], 14, 8 * cos(k * 1.5708 + 0.3), 8 * sin(k * 1.5708 + 0.3), 3.5, 0.2, 1);
    if (run(&f, at, first, 4)) {
        CHECK_EQ(f.bridges, 4);
        CHECK_EQ(f.rings, 1);
        CHECK_EQ(f.taken, 4);
    }
    /* Figure 11: six around an island. */
    for (uint32_t k = 0; k < 6; k++) first[k + 1] = ring(at, first[k], 12, 10.5 * cos(k * 1.0472), 10.5 * sin(k * 1.0472), 3, 0, 1);
    first[7] = ring(at, first[6], 12, 0.4, 0.3, 3, 0, 1);
    if (run(&f, at, first, 7)) {
        CHECK_EQ(f.bridges, 6);
        CHECK_EQ(f.rings, 1);
        CHECK_EQ(f.taken, 6);
    }
    /* Figures 8 and 9: three in a row; the middle one is in F twice, so there are two interior polygons. */
    for (uint32_t k = 0; k < 3; k++) first[k + 1] = ring(at, first[k], 16, k * 14.0, 0, 4, 0, 1);
    if (run(&f, at, first, 3)) {
        CHECK_EQ(f.bridges, 4);
        CHECK_EQ(f.rings, 2);
        CHECK_EQ(f.taken, 3);
    }
    /* An island between two large ones, away from the hull: taken in, since the nearest pair's edge cuts it [P 3.5.1]. */
    first[1] = ring(at, 0, 40, -20, 0, 16, 0, 1);
    first[2] = ring(at, first[1], 40, 20, 0, 16, 0.01, 1);
    first[3] = ring(at, first[2], 10, 0, 0.3, 2, 0, 1);
    if (run(&f, at, first, 3)) CHECK_EQ(f.taken, 3);
    /* One that holds the other is not for this. */
    lathe_many nested = {at, first, 2};
    uint32_t *nodes, count;
    bool taken[2];
    first[1] = ring(at, 0, 12, 0, 0, 10, 0, 1);
    first[2] = ring(at, first[1], 12, 0, 0, 4, 0, 1);
    CHECK(lathe__exterior_polygon(&nodes, &count, taken, &arena, &nested) == LATHE_ERR_FORMAT);
    lathe__arena_reset(&arena);
}

static void random_exteriors(void) {
    uint64_t seed = 11;
    uint32_t refused = 0, tried = 0;
    for (int i = 0; i < 2000; i++) {
        lathe_point at[600];
        uint32_t first[30] = {0}, count = 0, side = 2 + (uint32_t)shape_below(&seed, 3);
        for (uint32_t k = 0; k < side * side && count < 12; k++) {
            if (shape_below(&seed, 3) == 0) continue;
            first[count + 1] = ring(at, first[count], 3 + shape_below(&seed, 14), (k % side) * 30 + shape_below(&seed, 9), (k / side) * 30 + shape_below(&seed, 9),
                                    1 + shape_below(&seed, 10), 0.1 * shape_below(&seed, 60), 1);
            count++;
        }
        if (count < 2) continue;
        lathe_many many = {at, first, count};
        uint32_t *nodes, n;
        bool taken[30];
        tried++;
        lathe_status status = lathe__exterior_polygon(&nodes, &n, taken, &arena, &many);
        lathe__arena_reset(&arena);
        CHECK(status == LATHE_OK || status == LATHE_ERR_FORMAT);
        refused += status != LATHE_OK;
        found f;
        if (!status && !run(&f, at, first, count)) fprintf(stderr, "  in random exterior %d\n", i);
        if (check_failed > 10) return;
    }
    fprintf(stderr, "exterior polygons: %u of %u sets gave none that is simple\n", refused, tried);
    CHECK(refused * 4 < tried);
}

/* ---- neighbour information [P 3.7] ---- */

static void neighbours(void) {
    static int32_t at[4][3] = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
    static uint32_t t[4][3] = {{0, 2, 1}, {0, 1, 3}, {1, 2, 3}, {2, 0, 3}};
    lathe_mesh mesh = {4, 4, at, t};
    uint32_t adt[4][3];
    CHECK(lathe__find_adjacency(adt, &mesh) == LATHE_OK);
    for (uint32_t i = 0; i < 4; i++)
        for (int k = 0; k < 3; k++) {
            uint32_t other = adt[i][k];
            if (!CHECK(other < 4 && other != i)) continue;
            /* Opposite the corner: the other triangle has the two other corners, not this one. */
            bool has[3] = {false, false, false}, back = false;
            for (int c = 0; c < 3; c++)
                for (int l = 0; l < 3; l++) has[c] |= t[other][l] == t[i][c];
            for (int l = 0; l < 3; l++) back |= adt[other][l] == i;
            CHECK(!has[k] && has[(k + 1) % 3] && has[(k + 2) % 3] && back);
        }
    mesh.triangle_count = 3;
    CHECK(lathe__find_adjacency(adt, &mesh) == LATHE_OK);
    CHECK_EQ(adt[0][2], LATHE_NO_NEIGHBOUR);   /* corner 2 is vertex 1; the triangle across from 0 to 2 is gone */
    CHECK_EQ(adt[0][1], 1);
    t[3][0] = 9;
    mesh.triangle_count = 4;
    CHECK(lathe__find_adjacency(adt, &mesh) == LATHE_ERR_FORMAT);
    memcpy(t[3], t[2], sizeof t[3]);
    CHECK(lathe__find_adjacency(adt, &mesh) == LATHE_ERR_FORMAT);
}

int main(void) {
    simple_closing();
    closing_with_islands();
    exterior_polygons();
    random_exteriors();
    neighbours();
    lathe__arena_free(&arena);
    return check_end();
}
