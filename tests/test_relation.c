/* Links between sections: overlap degrees known from geometry, figures 1 and 2 of Park and Kim, rank order clustering against
 * connected components. */
#include "relation.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "check.h"

static lathe_arena arena;

static uint64_t seed = 7;
static uint32_t below(uint32_t n) {
    seed = seed * 6364136223846793005u + 1442695040888963407u;
    return (uint32_t)((seed >> 33) % n);
}

/* ---- hulls and overlap ---- */

static double degree(const lathe_point *p, uint32_t n, const lathe_point *q, uint32_t m) {
    double scratch[256];
    return lathe__overlap_degree(p, n, q, m, scratch);
}

static bool near(double a, double b) { return fabs(a - b) < 1e-9; }

static void squares(void) {
    lathe_point a[4] = {{0, 0}, {8, 0}, {8, 8}, {0, 8}}, b[4] = {{4, 0}, {12, 0}, {12, 8}, {4, 8}};
    lathe_point c[4] = {{2, 2}, {6, 2}, {6, 6}, {2, 6}}, d[4] = {{8, 0}, {9, 0}, {9, 8}, {8, 8}}, e[4] = {{40, 0}, {48, 0}, {48, 8}, {40, 8}};
    CHECK(near(degree(a, 4, a, 4), 1));
    CHECK(near(degree(a, 4, b, 4), 0.5));
    CHECK(near(degree(b, 4, a, 4), 0.5));
    CHECK(near(degree(a, 4, c, 4), 0.5 * 16 / 64 + 0.5));   /* one inside the other */
    CHECK(near(degree(a, 4, d, 4), 0));                      /* a common edge */
    CHECK(near(degree(a, 4, e, 4), 0));
    CHECK(near(degree(a, 4, a, 2), 0));
    lathe_point t[3] = {{0, 0}, {8, 0}, {0, 8}};
    CHECK(near(degree(a, 4, t, 3), 0.5 * 32 / 64 + 0.5));
}

static void hulls(void) {
    for (int i = 0; i < 2000; i++) {
        lathe_point p[40], hull[41];
        uint32_t n = 3 + below(38), span = 2 + below(30);
        for (uint32_t k = 0; k < n; k++) p[k] = (lathe_point){(int32_t)below(span), (int32_t)below(span)};
        uint32_t m = lathe__convex_hull(hull, p, n);
        int ok = CHECK(m >= 1 && m <= n);
        for (uint32_t k = 0; k < m && m >= 3; k++) {
            lathe_point a = hull[k], b = hull[(k + 1) % m];
            ok &= lathe__orient(a, b, hull[(k + 2) % m]) > 0;
            for (uint32_t v = 0; v < n; v++) ok &= lathe__orient(a, b, p[v]) >= 0;
        }
        if (!CHECK(ok)) return;
    }
}

/* Against counting points of a fine grid. */
static void degrees(void) {
    for (int i = 0; i < 60; i++) {
        lathe_point p[2][12], hull[2][13];
        uint32_t n[2];
        double in[2] = {0, 0}, both = 0;
        for (int s = 0; s < 2; s++) {
            for (int k = 0; k < 12; k++) p[s][k] = (lathe_point){(int32_t)below(4000) + s * 900, (int32_t)below(4000)};
            n[s] = lathe__convex_hull(hull[s], p[s], 12);
        }
        for (int y = 5; y < 5000; y += 10)
            for (int x = 5; x < 5000; x += 10) {
                bool is[2] = {true, true};
                for (int s = 0; s < 2; s++)
                    for (uint32_t k = 0; k < n[s]; k++)
                        is[s] &= lathe__orient(hull[s][k], hull[s][(k + 1) % n[s]], (lathe_point){x, y}) > 0;
                in[0] += is[0], in[1] += is[1], both += is[0] && is[1];
            }
        CHECK(fabs(degree(hull[0], n[0], hull[1], n[1]) - (0.5 * both / in[0] + 0.5 * both / in[1])) < 0.01);
    }
}

/* ---- figures 1 and 2 ---- */

/* Boxes: contour i of a section. */
static void boxes(lathe_point *at, uint32_t *first, const int (*box)[4], uint32_t count) {
    for (uint32_t i = 0; i <= count; i++) first[i] = 4 * i;
    for (uint32_t i = 0; i < count; i++) {
        const int *b = box[i];
        at[4 * i] = (lathe_point){b[0], b[1]}, at[4 * i + 1] = (lathe_point){b[2], b[1]};
        at[4 * i + 2] = (lathe_point){b[2], b[3]}, at[4 * i + 3] = (lathe_point){b[0], b[3]};
    }
}

/* The kinds of figure 1 in one pair of sections, in an order that figure 2 has to rearrange. */
static void figures_1_and_2(void) {
    static const int a[][4] = {{0, 0, 10, 10}, {100, 0, 110, 10}, {20, 0, 40, 10}, {60, 0, 70, 10}, {72, 0, 82, 10}};
    static const int b[][4] = {{20, 0, 29, 10}, {1, 1, 11, 10}, {200, 0, 210, 10}, {30, 0, 40, 10}, {60, 0, 77, 10}, {66, 0, 83, 10}};
    lathe_point pa[20], pb[24];
    uint32_t fa[6], fb[7];
    lathe_relation r;
    lathe_clustering c;
    boxes(pa, fa, a, 5);
    boxes(pb, fb, b, 6);
    CHECK(lathe__relate(&r, &arena, pa, fa, 5, pb, fb, 6, 0.3) == LATHE_OK);
    static const uint8_t want[5][6] = {{0, 1, 0, 0, 0, 0}, {0, 0, 0, 0, 0, 0}, {1, 0, 0, 1, 0, 0}, {0, 0, 0, 0, 1, 1}, {0, 0, 0, 0, 1, 1}};
    for (int i = 0; i < 5; i++)
        for (int j = 0; j < 6; j++) CHECK_EQ(r.link[i * 6 + j], want[i][j]);
    CHECK(near(r.overlap[0 * 6 + 1], 0.5 * 81 / 100 + 0.5 * 81 / 90));
    CHECK(lathe__cluster(&c, &arena, &r) == LATHE_OK);
    uint32_t kinds[4] = {0};
    for (uint32_t i = 0; i < c.block_count; i++) kinds[c.blocks[i].kind]++;
    CHECK_EQ(c.block_count, 5);
    CHECK_EQ(kinds[LATHE_LINK_SELF], 2);
    CHECK_EQ(kinds[LATHE_LINK_ONE_TO_ONE], 1);
    CHECK_EQ(kinds[LATHE_LINK_ONE_TO_MANY], 1);
    CHECK_EQ(kinds[LATHE_LINK_MANY_TO_MANY], 1);
    CHECK(!c.repaired);
    /* Binary numbers: A_2 has 100100, A_0 010000, A_3 and A_4 000011, A_1 none. */
    static const uint32_t rows[5] = {2, 0, 3, 4, 1};
    for (int i = 0; i < 5; i++) CHECK_EQ(c.row_order[i], rows[i]);
    /* The paper's own threshold lets go what overlaps less. */
    CHECK(lathe__relate(&r, &arena, pa, fa, 5, pb, fb, 6, LATHE_LINK_THRESHOLD) == LATHE_OK);
    CHECK_EQ(r.link[2 * 6 + 0], 1);
    CHECK_EQ(r.link[3 * 6 + 5], 0);   /* 40 of 100 and of 170 */
}

/* ---- clustering against components ---- */

static uint32_t root(uint32_t *parent, uint32_t i) { return parent[i] == i ? i : (parent[i] = root(parent, parent[i])); }

static bool is_block_diagonal(const lathe_relation *r, const lathe_clustering *c) {
    for (uint32_t i = 0; i < r->rows; i++)
        for (uint32_t j = 0; j < r->columns; j++) {
            if (!r->link[(size_t)c->row_order[i] * r->columns + c->column_order[j]]) continue;
            bool in = false;
            for (uint32_t b = 0; b < c->block_count; b++)
                in |= i - c->blocks[b].row < c->blocks[b].row_count && j - c->blocks[b].column < c->blocks[b].column_count;
            if (!in) return false;
        }
    return true;
}

static bool is_permutation(const uint32_t *order, uint32_t n) {
    bool *seen = calloc(n + 1, 1), ok = true;
    for (uint32_t i = 0; i < n; i++) {
        ok &= order[i] < n && !seen[order[i]];
        if (order[i] < n) seen[order[i]] = true;
    }
    free(seen);
    return ok;
}

static void random_relations(void) {
    uint32_t repaired = 0, many = 0, rounds = 0;
    for (int i = 0; i < 20000; i++) {
        lathe_relation r = {.rows = 1 + below(14), .columns = 1 + below(14)};
        if (i % 500 == 0) r.rows = 70 + below(60), r.columns = 70 + below(60);   /* more than a machine word of columns */
        uint32_t lines = r.rows + r.columns, parent[300], pieces = 0, density = 1 + below(i % 500 ? 40 : 3);
        r.link = malloc((size_t)r.rows * r.columns);
        for (uint32_t k = 0; k < lines; k++) parent[k] = k;
        for (uint32_t k = 0; k < r.rows * r.columns; k++) {
            r.link[k] = below(100) < density;
            if (r.link[k]) parent[root(parent, k / r.columns)] = root(parent, r.rows + k % r.columns);
        }
        for (uint32_t k = 0; k < lines; k++) pieces += root(parent, k) == k;
        lathe_clustering c;
        int ok = CHECK(lathe__cluster(&c, &arena, &r) == LATHE_OK) && CHECK(is_block_diagonal(&r, &c));
        ok = ok && CHECK(is_permutation(c.row_order, r.rows)) && CHECK(is_permutation(c.column_order, r.columns));
        CHECK_EQ(c.block_count, pieces);   /* no block can be parted further */
        repaired += c.repaired;
        many += pieces > 1;
        if (c.rounds > rounds) rounds = c.rounds;
        lathe__arena_reset(&arena);
        free(r.link);
        if (!ok) return;
    }
    fprintf(stderr, "rank order clustering left blocks in pieces in %u of %u relations with several; at most %u rounds\n", repaired, many, rounds);
    CHECK_EQ(repaired, 0);   /* relation.h says why */
    CHECK(many > 10000 && rounds > 2);
}

int main(void) {
    squares();
    hulls();
    degrees();
    figures_1_and_2();
    random_relations();
    lathe__arena_free(&arena);
    return check_end();
}
