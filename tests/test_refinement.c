/* Contours of coarser levels: simple, nested in number of rays, on the loop's own vertices, turning as the loop does. */
#include <stdlib.h>
#include <string.h>
#include "check.h"
#include "level.h"
#include "pixel_shapes.h"

static lathe_arena arena, scratch;

/* ---- brute force ---- */

static int side(lathe_point a, lathe_point b, lathe_point c) {
    int64_t d = lathe__orient(a, b, c);
    return (d > 0) - (d < 0);
}

static bool between(int32_t a, int32_t b, int32_t x) { return a < b ? a <= x && x <= b : b <= x && x <= a; }
static bool on_segment(lathe_point a, lathe_point b, lathe_point p) {
    return !side(a, b, p) && between(a.x, b.x, p.x) && between(a.y, b.y, p.y);
}

static bool segments_meet(lathe_point a, lathe_point b, lathe_point c, lathe_point d) {
    if (on_segment(a, b, c) || on_segment(a, b, d) || on_segment(c, d, a) || on_segment(c, d, b)) return true;
    return side(a, b, c) * side(a, b, d) < 0 && side(c, d, a) * side(c, d, b) < 0;
}

typedef struct edge {
    lathe_point a, b;
    uint32_t from, to;         /* point numbers: neighbours share one */
} edge;

static edge *list_edges(const lathe_outline *o) {
    edge *edges = LATHE_NEW(&scratch, edge, o->point_count);
    uint32_t n = 0;
    for (uint32_t l = 0; l < o->loop_count; l++)
        for (uint32_t i = 0; i < o->loops[l].count; i++) {
            uint32_t from = o->loops[l].first + i, to = o->loops[l].first + (i + 1) % o->loops[l].count;
            edges[n++] = (edge){o->points[from], o->points[to], from, to};
        }
    CHECK_EQ(n, o->point_count);
    return edges;
}

static bool is_simple(const lathe_outline *o) {
    const edge *e = list_edges(o);
    for (uint32_t i = 0; i < o->point_count; i++)
        for (uint32_t k = i + 1; k < o->point_count; k++) {
            if (e[i].to == e[k].from ? on_segment(e[i].a, e[i].b, e[k].b) || on_segment(e[k].a, e[k].b, e[i].a)
                : e[k].to == e[i].from ? on_segment(e[k].a, e[k].b, e[i].b) || on_segment(e[i].a, e[i].b, e[k].a)
                                       : segments_meet(e[i].a, e[i].b, e[k].a, e[k].b))
                return false;
        }
    return true;
}

static double area_of(const lathe_outline *o, uint32_t l) {
    const lathe_point *p = o->points + o->loops[l].first;
    double area = 0;
    for (uint32_t i = 0, n = o->loops[l].count; i < n; i++) {
        lathe_point a = p[i], b = p[(i + 1) % n];
        area += (double)a.x * b.y - (double)a.y * b.x;
    }
    return area;
}

static bool encloses(const lathe_outline *o, uint32_t l, lathe_point at) {
    const lathe_point *p = o->points + o->loops[l].first;
    bool odd = false;
    for (uint32_t i = 0, n = o->loops[l].count; i < n; i++) {
        lathe_point a = p[i], b = p[(i + 1) % n];
        if ((a.y > at.y) == (b.y > at.y)) continue;
        if (a.y < b.y ? side(a, b, at) > 0 : side(b, a, at) > 0) odd = !odd;
    }
    return odd;
}

/* Which loops lie within which, as bits. */
static uint64_t nesting_of(const lathe_outline *o, uint32_t l) {
    uint64_t within = 0;
    for (uint32_t m = 0; m < o->loop_count; m++)
        if (m != l && encloses(o, m, o->points[o->loops[l].first])) within |= (uint64_t)1 << (m & 63);
    return within;
}

/* ---- what must hold of every refined outline ---- */

static int64_t gap(lathe_point a, lathe_point b) {
    int64_t dx = llabs((long long)a.x - b.x), dy = llabs((long long)a.y - b.y);
    return dx > dy ? dx : dy;
}

/* Vertices are the loop's own, in its order, once round. */
static bool follows(const lathe_outline *o, const lathe_outline *loops, uint32_t l) {
    const lathe_loop *fine = &loops->loops[l], *coarse = &o->loops[l];
    uint32_t at = 0, gone = 0;
    for (uint32_t i = 0; i < coarse->count; i++) {
        uint32_t steps = 0;
        while (steps < fine->count && gap(o->points[coarse->first + i], loops->points[fine->first + at]) > LATHE_LATTICE_ONE / 64) {
            at = (at + 1) % fine->count;
            steps++;
        }
        if (steps == fine->count) return false;
        gone += i ? steps : 0;
        if (i && !steps) return false;
    }
    return gone < fine->count;
}

static bool chosen_by_ray(const lathe_outline *o, uint32_t l, uint32_t ray) {
    for (uint32_t i = 0; i < o->loops[l].count; i++)
        if (o->ray[o->loops[l].first + i] == (int32_t)ray) return true;
    return false;
}

static void check_outline(const lathe_outline *o, const lathe_outline *loops, const char *what) {
    int ok = CHECK_EQ(o->loop_count, loops->loop_count) && CHECK(is_simple(o));
    for (uint32_t l = 0; ok && l < o->loop_count; l++) {
        const lathe_loop *loop = &o->loops[l];
        ok &= CHECK(loop->count >= 3 && loop->count <= loops->loops[l].count);
        ok &= CHECK(loop->rays >= 8 && !(loop->rays & (loop->rays - 1)));
        ok &= CHECK_EQ(loop->hole, loops->loops[l].hole);
        ok &= CHECK(loop->hole ? area_of(o, l) < 0 : area_of(o, l) > 0);
        ok &= CHECK(follows(o, loops, l));
        if (o->loop_count <= 64) ok &= CHECK(nesting_of(o, l) == nesting_of(loops, l));
        for (uint32_t i = 0; i < loop->count; i++) ok &= CHECK(o->ray[loop->first + i] >= -1 && o->ray[loop->first + i] < (int32_t)loop->rays);
    }
    if (!ok) fprintf(stderr, "  in %s\n", what);
}

/* From one level to the next rays double until the loop's cap is reached, the even ones go on, and the centre stays. */
static void check_levels(const lathe_outline *coarse, const lathe_outline *fine, const char *what) {
    for (uint32_t l = 0; l < coarse->loop_count; l++) {
        const lathe_loop *a = &coarse->loops[l], *b = &fine->loops[l];
        int ok = CHECK(b->rays == 2 * a->rays || (b->rays == 8 && a->rays == 8)) && CHECK(gap(a->centre, b->centre) == 0);
        for (uint32_t r = 0; ok && b->rays == 2 * a->rays && r < a->rays; r++)
            /* A vertex may stand for several rays and carries the last; its neighbours then do. */
            if (chosen_by_ray(coarse, l, r) && !chosen_by_ray(fine, l, 2 * r)) {
                bool kept = false;
                for (uint32_t i = 0; i < a->count && !kept; i++)
                    for (uint32_t k = 0; coarse->ray[a->first + i] == (int32_t)r && k < b->count && !kept; k++)
                        kept = gap(coarse->points[a->first + i], fine->points[b->first + k]) == 0;
                ok = CHECK(kept);
            }
        if (!ok) fprintf(stderr, "  in %s, loop %u: %u and %u rays\n", what, l, a->rays, b->rays);
    }
}

/* Every vertex that rays chose at a level is one at the next level, too. */
static void check_vertices(const lathe_outline *coarse, const lathe_outline *fine, const char *what) {
    for (uint32_t l = 0; l < coarse->loop_count; l++) {
        const lathe_loop *a = &coarse->loops[l], *b = &fine->loops[l];
        for (uint32_t i = 0; i < a->count; i++) {
            if (coarse->ray[a->first + i] < 0) continue;
            bool kept = false;
            for (uint32_t k = 0; k < b->count && !kept; k++) kept = gap(coarse->points[a->first + i], fine->points[b->first + k]) == 0;
            if (!CHECK(kept)) fprintf(stderr, "  in %s, loop %u, vertex %u\n", what, l, i);
        }
    }
}

/* ---- slices ---- */

static void trace(lathe_outline *loops, const shape *s, int fraction) {
    uint64_t rows[SHAPE_SIZE] = {0};
    for (int y = 0; y < SHAPE_SIZE; y++)
        for (int x = 0; x < SHAPE_SIZE; x++) rows[y] |= (uint64_t)s->at[y][x] << x;
    lathe_slice_view view = {.pixels = rows, .width = SHAPE_SIZE, .height = SHAPE_SIZE, .row_words = 1, .fraction = fraction};
    int32_t *border;
    if (lathe__trace_outline(loops, &border, &arena, &view)) abort();
}

static void check_slice(const shape *s, int fraction, uint32_t seed, const char *what) {
    lathe_outline loops, level[5];
    trace(&loops, s, fraction);
    for (uint32_t coarseness = 0; coarseness < 5; coarseness++) {
        if (!CHECK(lathe__refine_outline(&level[coarseness], &arena, &loops, coarseness, seed) == LATHE_OK)) return;
        check_outline(&level[coarseness], &loops, what);
        if (coarseness) check_levels(&level[coarseness], &level[coarseness - 1], what);
        if (coarseness) check_vertices(&level[coarseness], &level[coarseness - 1], what);
        lathe__arena_reset(&scratch);
    }
    lathe_outline again;
    CHECK(lathe__refine_outline(&again, &arena, &loops, 2, seed) == LATHE_OK);
    CHECK(again.point_count == level[2].point_count && !memcmp(again.points, level[2].points, again.point_count * sizeof *again.points));
    lathe__arena_reset(&arena);
}

static void random_slices(void) {
    static const char *const KIND[4] = {"blob", "C", "spiral", "noise"};
    uint64_t seed = 4;
    for (int i = 0; i < 800 && check_failed < 20; i++) {
        shape s;
        char what[64];
        shape_make(&s, &seed, i);
        snprintf(what, sizeof what, "%s %d", KIND[i & 3], i);
        check_slice(&s, 8 + shape_below(&seed, 48), (uint32_t)i & 1, what);
        /* The same with holes, islands and neighbours. */
        for (int k = 1 + shape_below(&seed, 60); k > 0; k--) s.at[1 + shape_below(&seed, SHAPE_SIZE - 2)][1 + shape_below(&seed, SHAPE_SIZE - 2)] ^= 1;
        snprintf(what, sizeof what, "%s %d with specks", KIND[i & 3], i);
        check_slice(&s, 8 + shape_below(&seed, 48), (uint32_t)i & 1, what);
    }
}

/* Rings within rings: eight rays of the outer ones would cut through the inner ones. */
static void nested_rings(void) {
    shape s = {{{0}}};
    for (int y = 1; y < SHAPE_SIZE - 1; y++)
        for (int x = 1; x < SHAPE_SIZE - 1; x++) {
            int dx = abs(x - 13), dy = abs(y - 13);
            s.at[y][x] = (dx > dy ? dx : dy) <= 10 && ((dx > dy ? dx : dy) & 1) == 0;
        }
    check_slice(&s, 32, 0, "nested rings");
    lathe_outline loops, coarse;
    trace(&loops, &s, 32);
    CHECK_EQ(loops.loop_count, 11);
    CHECK(lathe__refine_outline(&coarse, &arena, &loops, 4, 0) == LATHE_OK);
    for (uint32_t l = 0; l < coarse.loop_count; l++) CHECK_EQ(coarse.loops[l].rays, 8);
    lathe__arena_reset(&arena);
}

/* A disc of radius 11 has 128 rays at its finest, and 8 from coarseness 4 on: one vertex for each ray then. */
static void disc(void) {
    shape s = {{{0}}};
    for (int y = 1; y < SHAPE_SIZE - 1; y++)
        for (int x = 1; x < SHAPE_SIZE - 1; x++) s.at[y][x] = (x - 13) * (x - 13) + (y - 13) * (y - 13) <= 115;
    static const uint32_t RAYS[6] = {128, 64, 32, 16, 8, 8};
    for (uint32_t coarseness = 0; coarseness < 6; coarseness++) {
        lathe_outline loops, o;
        trace(&loops, &s, 32);
        CHECK(lathe__refine_outline(&o, &arena, &loops, coarseness, 0) == LATHE_OK);
        CHECK_EQ(o.loop_count, 1);
        CHECK_EQ(o.loops[0].rays, RAYS[coarseness]);
        if (coarseness > 1) CHECK_EQ(o.point_count, RAYS[coarseness]);
        lathe__arena_reset(&arena);
    }
}

static void nothing(void) {
    lathe_outline none = {0}, out = {.loop_count = 3};
    CHECK(lathe__refine_outline(&out, &arena, &none, 1, 0) == LATHE_OK);
    CHECK(out.loop_count == 0 && out.point_count == 0);
}

/* The jitter: even, under 1/64 voxel, the same every time, another in the next slice. */
static void jitter(void) {
    uint64_t seed = 8;
    uint32_t moved = 0;
    for (int i = 0; i < 10000; i++) {
        lathe_point p = {shape_below(&seed, 1 << 28), shape_below(&seed, 1 << 28)};
        lathe_point a = lathe__jitter(p, 0), b = lathe__jitter(p, 1), c = lathe__jitter(p, 0);
        CHECK(gap(p, a) <= 512 && gap(p, b) <= 512 && !((a.x ^ p.x) & 1) && !((a.y ^ p.y) & 1) && gap(a, c) == 0);
        moved += gap(a, b) != 0;
    }
    CHECK(moved > 9900);
}

static void levels_of_slices(void) {
    for (int32_t slices = 1; slices <= 300; slices++) {
        lathe_level_plan plan = {.slices = slices, .level_count = lathe__choose_levels(slices)};
        int32_t kept[2] = {slices / 3, slices / 2}, *before = NULL;
        uint32_t before_count = 0;
        uint8_t early[300] = {0};
        uint32_t kept_count = kept[0] < kept[1] ? 2 : 1;
        for (uint32_t k = 0; k < 2; k++) early[kept[k]] = (uint8_t)lathe__regular_level(&plan, kept[k]);
        plan.early = early;
        CHECK(plan.level_count >= 2 && plan.level_count <= LATHE_MAX_LEVELS);
        for (uint32_t level = 0; level < plan.level_count; level++) {
            int32_t *list;
            uint32_t count, found = 0, has_kept = 0;
            CHECK(lathe__level_slices(&list, &count, &arena, &plan, level) == LATHE_OK);
            bool ascending = list[0] == 0 && list[count - 1] == slices - 1;
            for (uint32_t i = 0; i < count; i++) {
                if (i && list[i] <= list[i - 1]) ascending = false;
                if (found < before_count && before[found] == list[i]) found++;
                for (uint32_t k = 0; k < kept_count; k++) has_kept += list[i] == kept[k];
            }
            if (!(CHECK(ascending) & CHECK_EQ(found, before_count) & CHECK_EQ(has_kept, kept_count))) fprintf(stderr, "  %d slices, level %u\n", slices, level);
            before = list;
            before_count = count;
        }
        CHECK_EQ(before_count, slices);
        lathe__arena_reset(&arena);
    }
}

int main(void) {
    nothing();
    jitter();
    levels_of_slices();
    disc();
    nested_rings();
    random_slices();
    lathe__arena_free(&arena);
    lathe__arena_free(&scratch);
    return check_end();
}
