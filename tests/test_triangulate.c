/* Triangles of polygons with holes, and how the time grows with their size. */
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include "check.h"
#include "overlay.h"

static lathe_arena arena;

typedef struct polygon {
    lathe_point *at;
    uint32_t *nodes, *ring_end, count, rings;
    double area2;              /* twice the area, holes taken off */
} polygon;

static polygon new_polygon(uint32_t most) {
    polygon p = {.at = malloc(most * sizeof *p.at), .nodes = malloc(most * sizeof *p.nodes), .ring_end = malloc(most * sizeof *p.ring_end)};
    if (!p.at || !p.nodes || !p.ring_end) abort();
    return p;
}
static void add(polygon *p, int32_t x, int32_t y) {
    p->at[p->count] = (lathe_point){x, y};
    p->nodes[p->count] = p->count;
    p->count++;
}
static void end_ring(polygon *p) {
    uint32_t first = p->rings ? p->ring_end[p->rings - 1] : 0;
    for (uint32_t i = first; i < p->count; i++) {
        lathe_point a = p->at[i], b = p->at[i + 1 < p->count ? i + 1 : first];
        p->area2 += (double)a.x * b.y - (double)a.y * b.x;
    }
    p->ring_end[p->rings++] = p->count;
}
static void release(polygon *p) {
    free(p->at);
    free(p->nodes);
    free(p->ring_end);
}

/* Every triangle counter-clockwise, their areas that of the polygon, neighbours mutual, and as many open edges as boundary edges:
 * together they tile it. Returns CPU seconds of the fastest of three. */
static double check_polygon(const polygon *p, const char *what) {
    double best = 1e9;
    for (int turn = 0; turn < 3; turn++) {
        lathe_polygon in = {p->at, p->nodes, p->ring_end, p->rings};
        uint32_t(*t)[3], *neighbour, count, open = 0, wrong = 0;
        clock_t start = clock();
        if (!CHECK(lathe__triangulate(&t, &neighbour, &count, &arena, &in) == LATHE_OK)) return 0;
        double seconds = (double)(clock() - start) / CLOCKS_PER_SEC, area2 = 0;
        best = seconds < best ? seconds : best;
        for (uint32_t i = 0; i < count * 3; i++) {
            uint32_t j = neighbour[i];
            open += j == UINT32_MAX;
            if (j != UINT32_MAX) wrong += neighbour[j] != i || t[j / 3][j % 3] != t[i / 3][(i + 1) % 3] || t[j / 3][(j + 1) % 3] != t[i / 3][i % 3];
            if (i % 3) continue;
            int64_t a = lathe__turn(p->at, t[i / 3][0], t[i / 3][1], t[i / 3][2]);
            wrong += a <= 0;
            area2 += (double)a;
        }
        int ok = CHECK_EQ(count, p->count + 2 * (p->rings - 1) - 2) & CHECK_EQ(open, p->count) & CHECK_EQ(wrong, 0) & CHECK(area2 == p->area2);
        if (!ok) fprintf(stderr, "  in %s: area %g, %g\n", what, area2, p->area2);
        lathe__arena_reset(&arena);
    }
    return best;
}

enum { ONE = 65536 };

/* A square of n x n fields, each with a square hole, turned a little so that no two coordinates agree by chance. */
static polygon sieve(uint32_t n) {
    polygon p = new_polygon(4 * n * n + 4);
    int32_t side = (int32_t)n * ONE;
    add(&p, 0, 0), add(&p, side, 0), add(&p, side, side), add(&p, 0, side);
    end_ring(&p);
    for (uint32_t i = 0; i < n * n; i++) {
        int32_t x = (int32_t)(i % n) * ONE + 20000 + (int32_t)(i * 7919 % 9001), y = (int32_t)(i / n) * ONE + 20000 + (int32_t)(i * 104729 % 9001);
        add(&p, x, y), add(&p, x + 3000, y + 15000), add(&p, x + 18000, y + 12000), add(&p, x + 15000, y - 3000);
        end_ring(&p);
    }
    return p;
}

/* A comb of n teeth, the hard case for ears that are sought from the beginning again; as wide as coordinates may be. */
static polygon comb(uint32_t n) {
    polygon p = new_polygon(4 * n + 4);
    const int32_t pitch = ONE / 4;
    add(&p, 0, 0), add(&p, (int32_t)n * pitch, 0);
    for (uint32_t i = n; i-- > 0;) {
        int32_t x = (int32_t)i * pitch;
        add(&p, x + 10000, 30000), add(&p, x + 9750, 20 * ONE + (int32_t)(i * 7919 % 9001)), add(&p, x + 5250, 20 * ONE), add(&p, x + 5000, 30000);
    }
    end_ring(&p);
    return p;
}

int main(void) {
#ifdef NDEBUG
    const int sizes = 3;
#else
    const int sizes = 2;       /* under sanitizers time says nothing */
#endif
    static polygon (*const draw[2])(uint32_t) = {sieve, comb};
    static const uint32_t size[2][3] = {{16, 50, 158}, {250, 2500, 25000}};   /* 1,028, 10,004, 99,860 vertices; 1,002, 10,002, 100,002 */
    static const char *const name[2] = {"sieve", "comb"};
    for (int kind = 0; kind < 2; kind++) {
        for (int i = 0; i < sizes; i++) {
            polygon p = draw[kind](size[kind][i]);
            double seconds = check_polygon(&p, name[kind]);
            fprintf(stderr, "%s of %u vertices: %.4f s\n", name[kind], p.count, seconds);
            release(&p);
        }
    }
    lathe__arena_free(&arena);
    return check_end();
}
