/* One-to-one links: the triangles that a slab ships are those of the walk over the two derivation trees. */
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "check.h"
#include "level.h"
#include "pixel_shapes.h"

static lathe_arena arena, scratch;

/* ---- one slab of two loops ---- */

typedef struct slab {
    lathe_outline side[2];
    lathe_mesh_builder builder;
    lathe_overlay_counts counts;
    lathe_tube tube;
} slab;

static void build(slab *s) {
    lathe_slab between = {.outline = {&s->side[0], &s->side[1]}, .height = {0, LATHE_LATTICE_ONE}, .base = 0,
                          .cap = LATHE_LATTICE_ONE / 2};
    s->builder = (lathe_mesh_builder){0};
    s->counts = (lathe_overlay_counts){0};
    if (lathe__builder_reserve(&s->builder, s->side[0].point_count + s->side[1].point_count, 0)) abort();
    for (int k = 0; k < 2; k++)
        for (uint32_t i = 0; i < s->side[k].point_count; i++) {
            int32_t *v = s->builder.mesh.lattice[s->builder.mesh.vertex_count++];
            v[0] = s->side[k].points[i].x, v[1] = s->side[k].points[i].y, v[2] = between.height[k];
        }
    CHECK(lathe__overlay_slab(&s->builder, &scratch, &between, &s->counts) == LATHE_OK);
    lathe__arena_reset(&scratch);
}

static void free_slab(slab *s) { lathe_mesh_free(&s->builder.mesh); }

/* Signed distance from b to a along a loop of n positions, in -n/2 .. n/2. */
static double around(double a, double b, double n) {
    double d = fmod(a - b, n);
    return d > n / 2 ? d - n : d < -n / 2 ? d + n : d;
}

/* ---- partners ---- */

/* Both ways they run round the other loop once, in order (a hole's too). */
static void check_partners(const slab *s, const char *what) {
    for (int k = 0; k < 2; k++) {
        uint32_t n = s->side[k].point_count, m = s->side[1 - k].point_count;
        double turn = 0;
        bool ordered = true;
        for (uint32_t i = 0; i < n; i++) {
            float p = s->tube.partner[k][i], q = s->tube.partner[k][(i + 1) % n];
            ordered &= p >= 0 && p < (float)m;
            /* Forward by less than the whole loop; backward not at all, but for float32 rounding. */
            double ahead = fmod((double)q - (double)p + (double)m, (double)m);
            if (ahead > m - 0.01) ahead -= m;
            turn += ahead;
        }
        if (!(CHECK(ordered) & CHECK(fabs(turn - m) < 0.5))) fprintf(stderr, "  in %s: %g of %u\n", what, turn, m);
    }
}

/* ---- triangles ---- */

/* A triangle on an edge of loop k (begin, begin + 1) with its third corner at position j of the other loop. */
typedef struct on_edge {
    int k;
    uint32_t begin, apex;
} on_edge;

/* False: not between the two loops (it has a meeting or a middle). */
static bool read_triangle(on_edge *out, const slab *s, const uint32_t *t) {
    uint32_t n[2] = {s->side[0].point_count, s->side[1].point_count};
    uint32_t place[3];
    int side[3], high = 0;
    for (int c = 0; c < 3; c++) {
        if (t[c] >= n[0] + n[1]) return false;
        side[c] = t[c] >= n[0];
        place[c] = t[c] - (side[c] ? n[0] : 0);
        high += side[c];
    }
    if (high == 0 || high == 3) return false;
    int alone = 0;
    while (side[alone] != (high == 1)) alone++;
    int k = high == 2;
    uint32_t a = place[(alone + 1) % 3], b = place[(alone + 2) % 3];
    *out = (on_edge){.k = k, .begin = (a + 1) % n[k] == b ? a : b, .apex = place[alone]};
    CHECK((a + 1) % n[k] == b || (b + 1) % n[k] == a);
    return true;
}

/* Does an edge of loop k meet the other loop? By brute force. */
static bool is_crossed(const slab *s, int k, uint32_t edge) {
    const lathe_outline *a = &s->side[k], *b = &s->side[1 - k];
    lathe_point p = a->points[edge], q = a->points[(edge + 1) % a->point_count];
    for (uint32_t i = 0; i < b->point_count; i++) {
        lathe_point c = b->points[i], d = b->points[(i + 1) % b->point_count];
        if ((lathe__orient(p, q, c) > 0) != (lathe__orient(p, q, d) > 0) && (lathe__orient(c, d, p) > 0) != (lathe__orient(c, d, q) > 0)) return true;
    }
    return false;
}

/* The third corner lies between the partners of the edge's ends. A corresponding edge's diagonal may go either way, so one position
 * on either side is allowed, and no more; unless the strip's chain ends there: then the partner lies beyond a meeting. */
static bool agrees(const slab *s, const on_edge *t) {
    uint32_t n = s->side[t->k].point_count, others = s->side[1 - t->k].point_count;
    double m = others, p = (double)s->tube.partner[t->k][t->begin], q = (double)s->tube.partner[t->k][(t->begin + 1) % n];
    double length = fmod(q - p + m, m);
    if (length > m - 0.01) length -= m;
    double off = around((double)t->apex, p + length / 2, m);   /* from the middle of the stretch p .. q */
    if (fabs(off) <= length / 2 + 1.001) return true;
    return is_crossed(s, 1 - t->k, off > 0 ? (t->apex + others - 1) % others : t->apex);
}

/* How many triangles between the loops there are, and how many stray from the trees. */
static void compare(const slab *s, uint32_t *between, uint32_t *strays) {
    *between = *strays = 0;
    for (uint32_t i = 0; i < s->builder.mesh.triangle_count; i++) {
        on_edge t;
        if (!read_triangle(&t, s, s->builder.mesh.triangles[i])) continue;
        ++*between;
        *strays += !agrees(s, &t);
    }
}

/* ---- loops ---- */

static lathe_outline trace(const uint8_t (*at)[SHAPE_SIZE], int parity, int fraction) {
    uint64_t rows[SHAPE_SIZE] = {0};
    for (int y = 0; y < SHAPE_SIZE; y++)
        for (int x = 0; x < SHAPE_SIZE; x++) rows[y] |= (uint64_t)at[y][x] << x;
    lathe_slice_view view = {.pixels = rows, .width = SHAPE_SIZE, .height = SHAPE_SIZE, .row_words = 1, .parity = parity, .fraction = fraction};
    lathe_outline loops, out;
    int32_t *border;
    if (lathe__trace_outline(&loops, &border, &arena, &view) || lathe__refine_outline(&out, &arena, &loops, 1, (uint32_t)parity)) abort();
    return out;
}

/* Only one loop of an outline. */
static lathe_outline only(const lathe_outline *o, bool hole) {
    lathe_outline one = {0};
    for (uint32_t l = 0; l < o->loop_count; l++) {
        if (o->loops[l].hole != hole) continue;
        one = (lathe_outline){.point_count = o->loops[l].count, .loop_count = 1, .points = o->points + o->loops[l].first,
                              .ray = o->ray + o->loops[l].first};
        one.loops = LATHE_NEW(&arena, lathe_loop, 1);
        one.loops[0] = o->loops[l];
        one.loops[0].first = 0;
    }
    return one;
}

static void disc(uint8_t (*at)[SHAPE_SIZE], double x0, double y0, double radius, int value) {
    for (int y = 1; y < SHAPE_SIZE - 1; y++)
        for (int x = 1; x < SHAPE_SIZE - 1; x++)
            if ((x - x0) * (x - x0) + (y - y0) * (y - y0) <= radius * radius) at[y][x] = (uint8_t)value;
}

typedef struct tally {
    uint64_t tubes, tree_strips, strips;
    uint64_t between;          /* triangles compared one by one */
    uint64_t mixed, strays;    /* triangles of slabs that the trees do not tile alone; those that differ from the trees */
} tally;

/* A slab of two single loops, and what must hold of it if they are linked one to one. */
static void check_slab(slab *s, tally *sum, const char *what) {
    build(s);
    if (lathe__match_loops(&s->tube, &arena, &s->side[0], 0, &s->side[1], 0) == LATHE_OK && s->counts.links[1] == 1) {
        uint32_t between, strays;
        check_partners(s, what);
        compare(s, &between, &strays);
        sum->tubes++;
        sum->tree_strips += s->counts.tree_strips;
        sum->strips += s->counts.strips;
        /* Strips that the trees could not tile without a fold are merged by the shorter diagonal, other cells are triangulated: where
         * neither is there, every triangle is the trees'. */
        if (s->counts.tree_strips == s->counts.strips && !s->counts.other_cells) {
            sum->between += between;
            if (!CHECK_EQ(strays, 0)) fprintf(stderr, "  in %s: of %u triangles\n", what, between);
        } else {
            sum->mixed += between;
            sum->strays += strays;
        }
    } else {
        CHECK_EQ(s->counts.tree_strips, 0);
    }
    free_slab(s);
}

/* ---- circles ---- */

/* One within the other: a ring strip, all of it by the trees. */
static void nested_discs(tally *sum) {
    for (int big = 7; big <= 11; big++)
        for (int small = 3; small <= big - 2; small++) {
            uint8_t at[2][SHAPE_SIZE][SHAPE_SIZE] = {{{0}}};
            disc(at[0], 12.5, 12.5, big + 0.3, 1);
            disc(at[1], 12.5, 12.5, small + 0.3, 1);
            for (int up = 0; up < 2; up++) {
                slab s = {.side = {trace((const uint8_t(*)[SHAPE_SIZE])at[up], 0, 32), trace((const uint8_t(*)[SHAPE_SIZE])at[1 - up], 1, 32)}};
                uint32_t points = s.side[0].point_count + s.side[1].point_count;
                tally one = {0};
                check_slab(&s, &one, "nested discs");
                CHECK_EQ(one.strips, 1);
                CHECK_EQ(one.tree_strips, 1);
                CHECK_EQ(one.between, points);
                sum->tree_strips += one.tree_strips;
                lathe__arena_reset(&arena);
            }
        }
}

/* Holes go the other way round; the triangles are those of the trees all the same. */
static void nested_holes(tally *sum) {
    for (int small = 3; small <= 6; small++) {
        uint8_t at[2][SHAPE_SIZE][SHAPE_SIZE] = {{{0}}};
        for (int k = 0; k < 2; k++) {
            disc(at[k], 12.5, 12.5, 11.3, 1);
            disc(at[k], 12.5, 12.5, k ? 8.3 : small + 0.3, 0);
        }
        slab s;
        for (int k = 0; k < 2; k++) {
            lathe_outline o = trace((const uint8_t(*)[SHAPE_SIZE])at[k], k, 32);
            CHECK_EQ(o.loop_count, 2);
            s.side[k] = only(&o, true);
        }
        CHECK(lathe__match_loops(&s.tube, &arena, &s.side[0], 0, &s.side[1], 0) == LATHE_OK);
        check_partners(&s, "holes");
        /* In one slab with their outer loops: the holes' ring is a strip of its own. */
        for (int k = 0; k < 2; k++) s.side[k] = trace((const uint8_t(*)[SHAPE_SIZE])at[k], k, 32);
        build(&s);
        CHECK_EQ(s.counts.links[1], 2);
        CHECK_EQ(s.counts.tree_strips, s.counts.strips);   /* the equal outer loops cross: theirs are more than one */
        CHECK(s.counts.strips >= 2);
        sum->tree_strips += s.counts.tree_strips;
        free_slab(&s);
        lathe__arena_reset(&arena);
    }
    /* A hole and an outer loop never correspond. */
    uint8_t at[SHAPE_SIZE][SHAPE_SIZE] = {{0}};
    disc(at, 12.5, 12.5, 11.3, 1);
    disc(at, 12.5, 12.5, 6.3, 0);
    lathe_outline o = trace((const uint8_t(*)[SHAPE_SIZE])at, 0, 32), outer = only(&o, false), inner = only(&o, true);
    lathe_tube tube;
    CHECK(lathe__match_loops(&tube, &arena, &outer, 0, &inner, 0) == LATHE_ERR_FORMAT);
    lathe__arena_reset(&arena);
}

/* The same contour twice, the upper one smaller: every edge corresponds to its own copy, so that two triangles go between each
 * pair of edges and every vertex is joined to its own copy. */
static void equal_contours(void) {
    uint8_t at[SHAPE_SIZE][SHAPE_SIZE] = {{0}};
    disc(at, 12.5, 12.5, 9.3, 1);
    lathe_outline low = trace((const uint8_t(*)[SHAPE_SIZE])at, 0, 32);
    for (int shrink = 4; shrink <= 16; shrink *= 2) {
        lathe_outline high = low;
        uint32_t n = low.point_count;
        const int32_t middle = 25 * (LATHE_LATTICE_ONE / 2);
        high.points = LATHE_NEW(&arena, lathe_point, n);
        for (uint32_t i = 0; i < n; i++) {
            high.points[i].x = low.points[i].x - (low.points[i].x - middle) / shrink / 2 * 2;
            high.points[i].y = low.points[i].y - (low.points[i].y - middle) / shrink / 2 * 2;
        }
        slab s = {.side = {low, high}};
        build(&s);
        CHECK(lathe__match_loops(&s.tube, &arena, &s.side[0], 0, &s.side[1], 0) == LATHE_OK);
        CHECK_EQ(s.counts.tree_strips, 1);
        CHECK_EQ(s.builder.mesh.triangle_count, 2 * n);
        uint32_t corresponding = 0;
        for (uint32_t i = 0; i < n; i++) corresponding += fabs(around((double)s.tube.partner[0][i], i, n)) < 0.001;
        CHECK_EQ(corresponding, n);
        for (uint32_t i = 0; i < s.builder.mesh.triangle_count; i++) {
            on_edge t;
            if (CHECK(read_triangle(&t, &s, s.builder.mesh.triangles[i]))) CHECK(t.apex == t.begin || t.apex == (t.begin + 1) % n);
        }
        free_slab(&s);
    }
    lathe__arena_reset(&arena);
}

/* ---- loops that cross: open strips ---- */

static void shifted_discs(tally *sum) {
    for (int dx = 0; dx <= 4; dx++)
        for (int dy = 0; dy <= 4; dy++) {
            uint8_t at[2][SHAPE_SIZE][SHAPE_SIZE] = {{{0}}};
            disc(at[0], 10.5, 10.5, 8.3, 1);
            disc(at[1], 10.5 + dx, 10.5 + dy, 8.3, 1);
            slab s = {.side = {trace((const uint8_t(*)[SHAPE_SIZE])at[0], 0, 32), trace((const uint8_t(*)[SHAPE_SIZE])at[1], 1, 32)}};
            char what[64];
            snprintf(what, sizeof what, "disc shifted by %d, %d", dx, dy);
            tally one = {0};
            check_slab(&s, &one, what);
            CHECK_EQ(one.tubes, 1);
            sum->tree_strips += one.tree_strips;
            lathe__arena_reset(&arena);
        }
}

/* Blobs, C shapes, spirals: the loop of one slice and that of the next, which has gained or lost some pixels. */
static void random_pairs(tally *sum) {
    uint64_t seed = 12;
    for (int i = 0; i < 3000 && check_failed < 20; i++) {
        shape a, b;
        char what[64];
        snprintf(what, sizeof what, "random pair %d", i);
        shape_make(&a, &seed, i);
        b = a;
        for (int y = 1; y < SHAPE_SIZE - 1; y++)
            for (int x = 1; x < SHAPE_SIZE - 1; x++)
                if ((a.at[y][x - 1] | a.at[y][x + 1] | a.at[y - 1][x] | a.at[y + 1][x]) && shape_below(&seed, 4 + i % 30) == 0) b.at[y][x] ^= 1;
        shape_keep_one(&b);
        lathe_outline low = trace((const uint8_t(*)[SHAPE_SIZE])a.at, 0, 32), high = trace((const uint8_t(*)[SHAPE_SIZE])b.at, 1, 32);
        slab s = {.side = {only(&low, false), only(&high, false)}};
        check_slab(&s, sum, what);
        lathe__arena_reset(&arena);
    }
}

int main(void) {
    tally sum = {0};
    nested_discs(&sum);
    nested_holes(&sum);
    equal_contours();
    shifted_discs(&sum);
    CHECK(sum.tree_strips > 20);
    random_pairs(&sum);
    printf("random pairs: %llu tubes, %llu of %llu strips by trees, %llu triangles compared; of %llu in mixed slabs %llu differ\n",
           (unsigned long long)sum.tubes, (unsigned long long)sum.tree_strips, (unsigned long long)sum.strips, (unsigned long long)sum.between,
           (unsigned long long)sum.mixed, (unsigned long long)sum.strays);
    CHECK(sum.tubes > 1000 && sum.between > 1000);
    lathe__arena_free(&arena);
    lathe__arena_free(&scratch);
    return check_end();
}
