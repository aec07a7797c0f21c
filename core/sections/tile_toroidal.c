/* The tiling of least area: a shortest path in the toroidal graph of spans (Keppel 1975), found by the divide and
 * conquer of Fuchs, Kedem and Uselton (1977). Node (i, j) is the span a_i b_j; an edge to the right (i + 1) is a
 * triangle on an edge of a, an edge upwards (j + 1) one on an edge of b. A tiling is a path from (k, 0) to (k + a,
 * b) for some k; shortest paths of different k do not cross, so the path of the middle k need only be sought between
 * those of its neighbours: O(a b log a) time. */
#include <math.h>
#include <string.h>
#include "sections.h"

enum { MOST_NODES = 1 << 28 };

typedef struct graph {
    const lathe_point *a, *b;
    uint32_t n, m;
    double rise;
    double *cost;              /* (m + 1) * (2 n + 1): of the best path to a node */
    uint8_t *came;             /* 1: from the left, 2: from below */
    int32_t *low, *high;       /* of the search in hand: a row's first and last column */
} graph;

static double area(const lathe_point *p, double pz, const lathe_point *q, const lathe_point *r, double qz) {
    /* p in one plane, the edge q r in the other. */
    double ux = (double)q->x - p->x, uy = (double)q->y - p->y, uz = qz - pz, vx = (double)r->x - p->x,
           vy = (double)r->y - p->y;
    double x = uz * (uy - vy), y = uz * (vx - ux), z = ux * vy - uy * vx;
    return sqrt(x * x + y * y + z * z) / 2;
}
static double right_cost(const graph *g, uint32_t i, uint32_t j) {
    return area(&g->b[j % g->m], g->rise, &g->a[i % g->n], &g->a[(i + 1) % g->n], 0);
}
static double up_cost(const graph *g, uint32_t i, uint32_t j) {
    return area(&g->a[i % g->n], 0, &g->b[j % g->m], &g->b[(j + 1) % g->m], g->rise);
}

/* The best path from (k, 0) to (k + n, m) within low..high of each row; its steps go to `steps` (n + m bytes). */
static double search(const graph *g, uint32_t k, uint8_t *steps) {
    uint32_t width = 2 * g->n + 1;
    for (uint32_t j = 0; j <= g->m; j++)
        for (int32_t i = g->low[j]; i <= g->high[j]; i++) {
            size_t at = (size_t)j * width + (uint32_t)i;
            bool is_start = !j && (uint32_t)i == k;
            double best = is_start ? 0 : INFINITY;
            uint8_t came = 0;
            if (!is_start && i > g->low[j] && (uint32_t)i > k) {
                double c = g->cost[at - 1] + right_cost(g, (uint32_t)i - 1, j);
                if (c < best) best = c, came = 1;
            }
            if (j && i >= g->low[j - 1] && i <= g->high[j - 1]) {
                double c = g->cost[at - width] + up_cost(g, (uint32_t)i, j - 1);
                if (c < best) best = c, came = 2;
            }
            g->cost[at] = best;
            g->came[at] = came;
        }
    uint32_t i = k + g->n, j = g->m;
    double total = g->cost[(size_t)j * width + i];
    for (uint32_t s = g->n + g->m; s > 0 && total < INFINITY; s--) {
        steps[s - 1] = g->came[(size_t)j * width + i];
        if (steps[s - 1] == 1) i--;
        else j--;
    }
    return total;
}

/* The first and last column of a path in each row. */
static void columns(const graph *g, uint32_t k, const uint8_t *steps, int32_t *first, int32_t *last) {
    int32_t i = (int32_t)k;
    uint32_t j = 0;
    first[0] = i;
    for (uint32_t s = 0; s < g->n + g->m; s++) {
        if (steps[s] == 1) i++;
        else last[j++] = i, first[j] = i;
    }
    last[j] = i;
}

typedef struct band {
    uint32_t low, high;        /* starts whose paths are known */
    uint8_t *below, *above;    /* their steps */
} band;

lathe_status lathe__tile_toroidal(lathe_tiling *out, lathe_arena *arena, const lathe_point *a, uint32_t a_count,
                                  const lathe_point *b, uint32_t b_count, int32_t rise) {
    if (a_count < 3 || b_count < 3) return LATHE_ERR_RANGE;
    uint64_t nodes = ((uint64_t)b_count + 1) * (2 * (uint64_t)a_count + 1);
    if (nodes > MOST_NODES) return LATHE_ERR_LIMIT;
    graph g = {.a = a, .b = b, .n = a_count, .m = b_count, .rise = rise};
    uint32_t length = a_count + b_count, rows = b_count + 1;
    /* Depth first: the stack holds at most two bands for each halving. */
    uint32_t depth = 3;
    for (uint32_t n = a_count; n; n /= 2) depth++;
    g.cost = LATHE_NEW(arena, double, nodes);
    g.came = LATHE_NEW(arena, uint8_t, nodes);
    g.low = LATHE_NEW(arena, int32_t, 4 * (size_t)rows);
    uint8_t *paths = LATHE_NEW(arena, uint8_t, length), *best = LATHE_NEW(arena, uint8_t, length);
    band *stack = LATHE_NEW(arena, band, 2 * (size_t)depth);
    if (!g.cost || !g.came || !g.low || !paths || !best || !stack) return LATHE_ERR_MEMORY;
    g.high = g.low + rows;
    int32_t *first = g.high + rows, *last = first + rows;
    for (uint32_t j = 0; j < rows; j++) g.low[j] = 0, g.high[j] = (int32_t)a_count;
    double least = search(&g, 0, paths);
    memcpy(best, paths, length);
    uint32_t best_k = 0, top = 0;
    stack[top++] = (band){0, a_count, paths, paths};   /* the path of start n is that of start 0, shifted by n */
    while (top) {
        band r = stack[--top];
        if (r.high - r.low < 2) continue;
        uint32_t k = (r.low + r.high) / 2;
        columns(&g, r.low, r.below, first, last);
        memcpy(g.low, first, rows * sizeof *first);
        columns(&g, r.high, r.above, first, last);
        memcpy(g.high, last, rows * sizeof *last);
        uint8_t *steps = LATHE_NEW(arena, uint8_t, length);
        if (!steps) return LATHE_ERR_MEMORY;
        double total = search(&g, k, steps);
        if (total < least) least = total, best_k = k, memcpy(best, steps, length);
        stack[top++] = (band){r.low, k, r.below, steps};
        stack[top++] = (band){k, r.high, steps, r.above};
    }
    *out = (lathe_tiling){.start = {best_k % a_count, 0}, .count = length, .steps = best};
    return LATHE_OK;
}
