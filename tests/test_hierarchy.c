/* The hierarchy of [H]: at every tolerance that gives an outline of its own, that outline is compared by brute force with what
 * is promised of it. The checks here share no code with the hierarchy. */
#include "check.h"
#include "hierarchy.h"
#include "octangle.h"
#include "section_shapes.h"

enum { ONE = LATHE_LATTICE_ONE };

/* ---- brute force ---- */

static int turn_of(lathe_point a, lathe_point b, lathe_point c) {
    __int128 t = (__int128)((int64_t)b.x - a.x) * ((int64_t)c.y - a.y) - (__int128)((int64_t)b.y - a.y) * ((int64_t)c.x - a.x);
    return (t > 0) - (t < 0);
}
static bool on_segment(lathe_point a, lathe_point b, lathe_point p) {
    return !turn_of(a, b, p) && p.x >= (a.x < b.x ? a.x : b.x) && p.x <= (a.x > b.x ? a.x : b.x) && p.y >= (a.y < b.y ? a.y : b.y) &&
           p.y <= (a.y > b.y ? a.y : b.y);
}
static bool touch(lathe_point a, lathe_point b, lathe_point c, lathe_point d) {
    if (on_segment(a, b, c) || on_segment(a, b, d) || on_segment(c, d, a) || on_segment(c, d, b)) return true;
    return turn_of(a, b, c) * turn_of(a, b, d) < 0 && turn_of(c, d, a) * turn_of(c, d, b) < 0;
}
static lathe_point point_of(const lathe_outline *o, const lathe_loop *loop, uint32_t i) {
    return o->points[loop->first + i % loop->count];
}

/* How many pairs of edges have more in common than the vertex between neighbours. */
static uint64_t count_meetings(const lathe_outline *o) {
    uint64_t found = 0;
    for (uint32_t k = 0; k < o->loop_count; k++)
        for (uint32_t l = k; l < o->loop_count; l++) {
            const lathe_loop *p = &o->loops[k], *q = &o->loops[l];
            for (uint32_t i = 0; i < p->count; i++)
                for (uint32_t j = k == l ? i + 1 : 0; j < q->count; j++) {
                    lathe_point a = point_of(o, p, i), b = point_of(o, p, i + 1), c = point_of(o, q, j), d = point_of(o, q, j + 1);
                    if (k == l && j == i + 1) found += on_segment(a, b, d) || on_segment(c, d, a);
                    else if (k == l && (j + 1) % q->count == i) found += on_segment(a, b, c) || on_segment(c, d, b);
                    else found += touch(a, b, c, d);
                }
        }
    return found;
}

/* By the winding number, with quadrants instead of rays. */
static bool holds(const lathe_outline *o, const lathe_loop *loop, lathe_point p) {
    int quarters = 0;
    for (uint32_t i = 0; i < loop->count; i++) {
        lathe_point a = point_of(o, loop, i), b = point_of(o, loop, i + 1);
        int u = a.y >= p.y ? (a.x >= p.x ? 0 : 1) : a.x < p.x ? 2 : 3, v = b.y >= p.y ? (b.x >= p.x ? 0 : 1) : b.x < p.x ? 2 : 3;
        int step = (v - u + 4) & 3;
        quarters += step == 3 ? -1 : step == 2 ? 2 * turn_of(a, b, p) : step;
    }
    return quarters != 0;
}
static int direction_of(const lathe_outline *o, const lathe_loop *loop) {
    __int128 area = 0;
    for (uint32_t i = 0; i < loop->count; i++) {
        lathe_point a = point_of(o, loop, i), b = point_of(o, loop, i + 1);
        area += (__int128)a.x * b.y - (__int128)a.y * b.x;
    }
    return (area > 0) - (area < 0);
}
static long double distance_of(lathe_point p, lathe_point a, lathe_point b) {
    long double dx = b.x - a.x, dy = b.y - a.y, px = p.x - a.x, py = p.y - a.y, t = (px * dx + py * dy) / (dx * dx + dy * dy);
    t = t < 0 ? 0 : t > 1 ? 1 : t;
    return hypotl(px - dx * t, py - dy * t);
}

/* The largest distance of a vertex of the whole loop from the chord that stands for it; -1 if the points are no subsequence. */
static double worst_distance(const lathe_outline *whole, const lathe_outline *o, uint32_t l) {
    const lathe_loop *all = &whole->loops[l], *kept = &o->loops[l];
    long double worst = 0;
    uint32_t at = 0, begin;
    while (at < all->count && memcmp(&whole->points[all->first + at], &o->points[kept->first], sizeof(lathe_point))) at++;
    begin = at;
    for (uint32_t i = 0; i < kept->count; i++) {
        lathe_point a = point_of(o, kept, i), b = point_of(o, kept, i + 1);
        do {
            long double d = distance_of(point_of(whole, all, at), a, b);
            if (d > worst) worst = d;
            if (++at > begin + all->count) return -1;
        } while (memcmp(&whole->points[all->first + at % all->count], &b, sizeof b));
    }
    return at == begin + all->count ? (double)worst : -1;
}

/* ---- what is promised ---- */

static bool same_nesting(const lathe_outline *whole, const lathe_outline *o) {
    for (uint32_t k = 0; k < o->loop_count; k++) {
        if (direction_of(o, &o->loops[k]) != direction_of(whole, &whole->loops[k])) return false;
        for (uint32_t l = 0; l < o->loop_count; l++)
            if (k != l && holds(o, &o->loops[k], o->points[o->loops[l].first]) !=
                              holds(whole, &whole->loops[k], whole->points[whole->loops[l].first]))
                return false;
    }
    return true;
}

static void check_outline(const lathe_outline *whole, const lathe_outline *o, double tolerance) {
    CHECK_EQ(count_meetings(o), 0);
    CHECK(same_nesting(whole, o));
    bool near = true, three = true;
    for (uint32_t l = 0; l < o->loop_count; l++) {
        three = three && o->loops[l].count >= 3;
        double d = worst_distance(whole, o, l);
        near = near && d >= 0 && d <= tolerance * (1 + 1e-12);
    }
    CHECK(near);
    CHECK(three);
}

/* Every tolerance, and numbers between them. most: check only about so many. */
static lathe_hierarchy_counts check_all(const char *name, const lathe_outline *whole, uint32_t most) {
    lathe_arena arena = {0}, scratch = {0};
    lathe_hierarchy h;
    lathe_hierarchy_counts none = {0};
    CHECK_EQ(count_meetings(whole), 0);
    if (!CHECK_EQ(lathe__hierarchy_build(&h, &arena, whole), LATHE_OK)) return none;
    uint32_t count, before = whole->point_count + 1;
    const double *tolerances = lathe__hierarchy_tolerances(&count, &h);
    uint32_t step = count / most + 1;
    for (uint32_t i = 0; i < count; i++) {
        lathe_outline o, between;
        CHECK_EQ(lathe__hierarchy_outline(&o, &scratch, &h, tolerances[i]), LATHE_OK);
        CHECK(o.point_count < before);      /* each is different from the one before */
        before = o.point_count;
        if (i % step == 0 || i + 1 == count) check_outline(whole, &o, tolerances[i]);
        double further = i + 1 < count ? tolerances[i] + (tolerances[i + 1] - tolerances[i]) * 0.999 : tolerances[i] * 1e6 + 1e9;
        CHECK_EQ(lathe__hierarchy_outline(&between, &scratch, &h, further), LATHE_OK);
        CHECK_EQ(between.point_count, o.point_count);
        if (i == 0) {
            CHECK_EQ(o.point_count, whole->point_count);
            CHECK(!memcmp(o.points, whole->points, o.point_count * sizeof *o.points));
        }
        lathe__arena_reset(&scratch);
    }
    CHECK(!h.counts.gave_up);
    CHECK_EQ(h.counts.resolved, count);
    CHECK(h.counts.adjusted <= h.counts.plain);
    /* Every attribute is some piece's error. (It can be more than `adjusted`: a parent that inherits more no longer lowers a
     * child of greater error to its own.) */
    CHECK(h.counts.resolved <= h.counts.plain);
    none = h.counts;
    if (getenv("VERBOSE"))
        printf("%-22s %5u points %3u loops: %4u plain %4u adjusted %4u resolved, last has %u points; %llu pairs\n", name, whole->point_count,
               whole->loop_count, none.plain, none.adjusted, none.resolved, before, (unsigned long long)none.octangle_tests);
    lathe__arena_free(&arena);
    lathe__arena_free(&scratch);
    return none;
}

/* Does plain Douglas-Peucker cross itself here at all? Else there would be nothing to resolve. */
static void needs_resolving(lathe_hierarchy_counts counts) { CHECK(counts.inherited > 0); }

static void test_spirals(void) {
    lathe_arena arena = {0};
    lathe_outline one = section_outline(&arena, 1000, 1), two = section_outline(&arena, 1000, 2), thin = section_outline(&arena, 2000, 1);
    section_spiral(&one, 150, 4, 10 * ONE, 2 * ONE, 0, ONE);
    needs_resolving(check_all("spiral", &one, 1000));
    section_spiral(&two, 120, 3.5, 10 * ONE, 1.5 * ONE, 0, 0.5 * ONE);
    section_spiral(&two, 120, 3.5, 10 * ONE, 1.5 * ONE, SECTION_PI, 0.5 * ONE);
    needs_resolving(check_all("two spirals", &two, 1000));
    section_spiral(&thin, 400, 9, 10 * ONE, 4.2 * ONE, 1, 0.3 * ONE);
    needs_resolving(check_all("tight spiral", &thin, 200));
    lathe__arena_free(&arena);
}

static void test_coasts(void) {
    lathe_arena arena = {0};
    lathe_outline koch = section_outline(&arena, 3 * 256, 1), coast = section_outline(&arena, 600, 1);
    section_koch(&koch, 4, 200 * ONE, 0.15);
    check_all("Koch", &koch, 1000);
    section_coast(&coast, 600, 100 * ONE, 0.9);
    check_all("fractal radius", &coast, 1000);
    drawing d = draw_coast(60, 90, 7, 0.55);
    lathe_outline islands = draw_trace(&d, &arena, false);
    check_all("islands and lakes", &islands, 150);
    CHECK(islands.loop_count > 5);
    lathe__arena_free(&arena);
}

static void test_animals(void) {
    lathe_arena arena = {0};
    static drawing (*const animals[])(int) = {draw_spider, draw_scorpion, draw_bird};
    static const char *const names[] = {"spider", "scorpion", "bird"};
    for (int i = 0; i < 3; i++) {
        drawing d = animals[i](70);
        lathe_outline o = draw_trace(&d, &arena, false);
        check_all(names[i], &o, 300);
        lathe__arena_reset(&arena);
    }
    lathe__arena_free(&arena);
}

/* Teeth of two combs in turn: whatever steps over a tooth of its own comb steps over one of the other's. */
static void test_combs(void) {
    lathe_arena arena = {0};
    lathe_outline o = section_outline(&arena, 400, 2);
    section_comb(&o, 20, 10 * ONE, 3 * ONE, 100 * ONE, 0, false);
    section_comb(&o, 20, 10 * ONE, 3 * ONE, 100 * ONE, 5 * ONE, true);
    needs_resolving(check_all("combs", &o, 1000));
    lathe__arena_free(&arena);
}

/* Rings one in another, so near that every corner of one is needed to get round the next; with small loops in between. */
static void test_nesting(void) {
    lathe_arena arena = {0};
    lathe_outline o = section_outline(&arena, 4000, 200);
    for (int k = 0; k < 6; k++) {
        section_begin(&o, k & 1);
        for (int i = 0; i < 60; i++) {
            double a = (k & 1 ? -i : i) * 2 * SECTION_PI / 60, r = (60 - k * 4) * ONE + ONE * sin(7 * a);
            section_add(&o, r * cos(a), r * sin(a));
        }
    }
    check_all("rings", &o, 1000);
    /* A bay with islands in it: the chord over its mouth would put them inside. */
    lathe_outline bay = section_outline(&arena, 400, 20);
    section_begin(&bay, false);
    for (int i = 0; i <= 40; i++) section_add(&bay, (i < 20 ? -60 + i : 40 + (i - 20)) * ONE, (i % 2 ? 0.3 : 0) * ONE - (i == 19 || i == 20 ? 50 : 0) * ONE);
    for (int i = 0; i <= 10; i++) section_add(&bay, (60 - 12 * i) * ONE, -80 * ONE + (i & 1) * ONE);
    for (int k = 0; k < 5; k++) {
        section_begin(&bay, false);
        for (int i = 0; i < 8; i++) section_add(&bay, (-30 + 12 * k + 2 * cos(i * SECTION_PI / 4)) * ONE, (-12 - 6 * (k & 1) + 2 * sin(i * SECTION_PI / 4)) * ONE);
    }
    lathe_outline first;
    lathe_hierarchy h;
    check_all("bay with islands", &bay, 1000);
    CHECK_EQ(lathe__hierarchy_build(&h, &arena, &bay), LATHE_OK);
    CHECK_EQ(lathe__hierarchy_outline(&first, &arena, &h, 1e12), LATHE_OK);
    CHECK(first.loops[0].count > 3);       /* the bay has to stay */
    for (uint32_t l = 1; l < first.loop_count; l++) CHECK_EQ(first.loops[l].count, 3);
    lathe__arena_free(&arena);
}

/* Many small random slices with all that tracing gives. */
static void test_random_slices(void) {
    lathe_arena arena = {0};
    for (uint32_t seed = 0; seed < 60; seed++) {
        drawing d = draw_coast(22, 22, seed * 977 + 3, 0.1 + 0.02 * (seed % 40));
        lathe_outline o = draw_trace(&d, &arena, false);
        if (o.loop_count) check_all("random", &o, 40);
        lathe__arena_reset(&arena);
    }
    lathe__arena_free(&arena);
}

/* The errors of a plain Douglas-Peucker recursion with the same first three vertices, by brute force, on a shape where nothing
 * needs resolving: every tolerance must keep what that keeps. */
static void keep_plainly(const lathe_outline *o, uint32_t from, uint32_t to, double tolerance, uint8_t *kept) {
    lathe_point a = o->points[from], b = o->points[to % o->point_count];
    long double most = -1;
    uint32_t best = from + 1;
    for (uint32_t v = from + 1; v < to; v++) {
        long double d = distance_of(o->points[v], a, b);
        if (d > most) most = d, best = v;
    }
    if (most <= tolerance) return;
    kept[best] = 1;
    keep_plainly(o, from, best, tolerance, kept);
    keep_plainly(o, best, to, tolerance, kept);
}
static void test_same_as_plain(void) {
    lathe_arena arena = {0};
    lathe_outline o = section_outline(&arena, 3000, 1);
    section_begin(&o, false);
    for (int i = 0; i < 3000; i++) {       /* all but convex, no two distances equal; point 0 is the lowest */
        double a = i * 2 * SECTION_PI / 3000 - SECTION_PI / 2;
        section_add(&o, 300 * ONE * cos(a) + section_noise((uint32_t)i, 4) * 20, 200 * ONE * sin(a));
    }
    lathe_hierarchy h;
    CHECK_EQ(lathe__hierarchy_build(&h, &arena, &o), LATHE_OK);
    CHECK_EQ(h.counts.resolved, h.counts.adjusted);
    CHECK_EQ(h.counts.inherited, 0);
    for (double tolerance = 0.001 * ONE; tolerance < 100 * ONE; tolerance *= 1.7) {
        uint8_t kept[3000] = {0};
        for (uint32_t v = 0; v < 3000; v++) kept[v] = h.attribute[v] == INFINITY;
        uint32_t corner[4], n = 0;
        for (uint32_t v = 0; v < 3000; v++)
            if (kept[v] && n < 3) corner[n++] = v;
        CHECK_EQ(n, 3);
        CHECK_EQ(corner[0], 0);
        corner[3] = 3000;
        for (int k = 0; k < 3; k++) keep_plainly(&o, corner[k], corner[k + 1], tolerance, kept);
        lathe_outline at;
        uint32_t count = 0, wrong = 0;
        CHECK_EQ(lathe__hierarchy_outline(&at, &arena, &h, tolerance), LATHE_OK);
        for (uint32_t v = 0; v < 3000; v++) {
            count += kept[v];
            wrong += kept[v] != (h.attribute[v] > tolerance);
        }
        CHECK_EQ(at.point_count, count);
        CHECK_EQ(wrong, 0);
    }
    lathe__arena_free(&arena);
}

static lathe_status build(const lathe_point *points, uint32_t count) {
    lathe_arena arena = {0};
    lathe_loop loop = {.count = count};
    lathe_outline o = {.points = (lathe_point *)(uintptr_t)points, .loops = &loop, .point_count = count, .loop_count = 1};
    lathe_hierarchy h;
    lathe_status status = lathe__hierarchy_build(&h, &arena, &o);
    lathe__arena_free(&arena);
    return status;
}
static void test_degenerate(void) {
    const lathe_point two[] = {{0, 0}, {5, 5}}, flat[] = {{0, 0}, {9, 0}, {4, 0}, {2, 0}}, eight[] = {{0, 0}, {10, 10}, {10, 0}, {0, 12}},
                      spike[] = {{0, 0}, {10, 0}, {10, 10}, {20, 20}, {10, 10}, {0, 9}}, far[] = {{0, 0}, {1 << 29, 0}, {0, 5}},
                      same[] = {{0, 0}, {9, 0}, {9, 9}, {9, 9}, {0, 9}}, all_same[] = {{3, 3}, {3, 3}, {3, 3}},
                      line[] = {{0, 0}, {3, 0}, {6, 0}, {9, 0}, {9, 9}, {0, 9}};
    CHECK_EQ(build(two, 2), LATHE_ERR_FORMAT);
    CHECK_EQ(build(flat, 4), LATHE_ERR_FORMAT);
    CHECK_EQ(build(eight, 4), LATHE_ERR_FORMAT);
    CHECK_EQ(build(spike, 6), LATHE_ERR_FORMAT);
    CHECK_EQ(build(far, 3), LATHE_ERR_RANGE);
    CHECK_EQ(build(same, 5), LATHE_ERR_FORMAT);
    CHECK_EQ(build(all_same, 3), LATHE_ERR_FORMAT);
    CHECK_EQ(build(line, 6), LATHE_OK);
    lathe_arena arena = {0};
    lathe_outline none = {0}, out;
    lathe_hierarchy h;
    uint32_t count;
    CHECK_EQ(lathe__simplify_section(&out, &arena, &none, 5), LATHE_OK);
    CHECK_EQ(out.point_count, 0);
    CHECK_EQ(lathe__hierarchy_build(&h, &arena, &none), LATHE_OK);
    CHECK(lathe__hierarchy_tolerances(&count, &h)[0] == 0);
    CHECK_EQ(count, 1);
    /* Random points: almost never a simple loop, and never a crash. */
    for (uint32_t seed = 0; seed < 300; seed++) {
        lathe_point random[40];
        for (uint32_t i = 0; i < 40; i++)
            random[i] = (lathe_point){(int32_t)(section_noise(i, seed) * 8), (int32_t)(section_noise(i + 50, seed) * 8)};
        lathe_status status = build(random, 3 + seed % 38);
        CHECK(status == LATHE_OK || status == LATHE_ERR_FORMAT);
    }
    lathe__arena_free(&arena);
}

/* Vertices on a line go first, and in no other order of magnitude. */
static void test_simplify(void) {
    lathe_arena arena = {0};
    lathe_outline o = section_outline(&arena, 400, 2), out;
    section_begin(&o, false);
    for (int i = 0; i < 400; i++) {
        int side = i / 100, k = i % 100;
        const double x[4] = {k, 100, 100 - k, 0}, y[4] = {0, k, 100, 100 - k};
        section_add(&o, x[side] * ONE, y[side] * ONE);
    }
    CHECK_EQ(lathe__simplify_section(&out, &arena, &o, 0), LATHE_OK);
    CHECK_EQ(out.point_count, 400);
    CHECK_EQ(lathe__simplify_section(&out, &arena, &o, 0.001), LATHE_OK);
    CHECK_EQ(out.point_count, 4);
    CHECK_EQ(lathe__simplify_section(&out, &arena, &o, 1000.0 * ONE), LATHE_OK);
    CHECK_EQ(out.point_count, 3);
    lathe__arena_free(&arena);
}

/* Against all pairs of corners of small octangles. */
static void test_octangles(void) {
    uint32_t wrong = 0, apart = 0;
    for (uint32_t seed = 0; seed < 4000; seed++) {
        lathe_octangle o[2];
        lathe_point corner[2][8];
        for (uint32_t k = 0; k < 2; k++) {
            for (uint32_t i = 0; i < 4; i++) {
                lathe_point p = {(int32_t)(section_noise(seed * 8 + i, k) * 9), (int32_t)(section_noise(seed * 8 + i, k + 5) * 9)};
                p.x += (int32_t)k * 9;
                if (!i) o[k] = lathe__octangle_of(p, p);
                lathe__octangle_add(&o[k], p);
                wrong += !lathe__octangle_holds(&o[k], p);
            }
            lathe__octangle_corners(corner[k], &o[k]);
            for (int i = 0; i < 8; i++) wrong += !lathe__octangle_holds(&o[k], corner[k][i]);
        }
        bool meet = lathe__octangle_holds(&o[0], corner[1][0]) || lathe__octangle_holds(&o[1], corner[0][0]);
        for (int i = 0; i < 8; i++)
            for (int j = 0; j < 8; j++)
                meet = meet || touch(corner[0][i], corner[0][(i + 1) & 7], corner[1][j], corner[1][(j + 1) & 7]);
        wrong += meet != lathe__octangles_overlap(&o[0], &o[1]);
        apart += !meet;
    }
    CHECK_EQ(wrong, 0);
    CHECK(apart > 500 && apart < 3500);
}

/* What costs Douglas-Peucker a quadratic time, and what octangles do not separate: it must end soon, and hold what is promised. */
static void test_hostile(void) {
    lathe_arena arena = {0};
    enum { TEETH = 3000 };
    lathe_outline saw = section_outline(&arena, 2 * TEETH + 2, 1), out;
    section_begin(&saw, false);
    for (int i = 0; i < 2 * TEETH; i++) section_add(&saw, i * 8000.0, (i & 1 ? i * 20000.0 : 0) + 400000.0);
    section_add(&saw, TEETH * 16000.0, 0);
    section_add(&saw, 0, 0);
    CHECK_EQ(lathe__simplify_section(&out, &arena, &saw, 100 * ONE), LATHE_OK);
    CHECK(out.point_count < saw.point_count);
    CHECK_EQ(count_meetings(&out), 0);
    lathe_outline slanted = section_outline(&arena, 2 * TEETH + 2, 1);
    section_begin(&slanted, false);
    for (int i = 0; i < 2 * TEETH; i++) section_add(&slanted, i * 8000.0 + (i & 1 ? 60000000.0 : 0), (i & 1 ? 150000000.0 : 0) + section_noise((uint32_t)i, 3) * 900);
    section_add(&slanted, TEETH * 16000.0, -2000000.0);
    section_add(&slanted, 0, -2000000.0);
    CHECK_EQ(lathe__simplify_section(&out, &arena, &slanted, 100 * ONE), LATHE_OK);
    CHECK_EQ(count_meetings(&out), 0);
    lathe__arena_free(&arena);
}

/* Out of time at any moment: fewer tolerances, the same promises. */
static void test_giving_up(void) {
    lathe_arena arena = {0}, scratch = {0};
    lathe_outline o = section_outline(&arena, 400, 2);
    lathe_hierarchy h;
    uint32_t gave_up = 0, before = 0;
    section_comb(&o, 8, 10 * ONE, 3 * ONE, 100 * ONE, 0, false);
    section_comb(&o, 8, 10 * ONE, 3 * ONE, 100 * ONE, 5 * ONE, true);
    for (uint64_t most = 0; most < 1000; most += 7, lathe__arena_reset(&scratch)) {
        CHECK_EQ(lathe__hierarchy_build_within(&h, &scratch, &o, most), LATHE_OK);
        gave_up += h.counts.gave_up;
        CHECK(h.tolerance_count >= before);
        before = h.tolerance_count;
        for (uint32_t i = 0; i < h.tolerance_count; i++) {
            lathe_outline at;
            CHECK_EQ(lathe__hierarchy_outline(&at, &scratch, &h, h.tolerances[i]), LATHE_OK);
            check_outline(&o, &at, h.tolerances[i]);
        }
    }
    CHECK(gave_up > 10 && !h.counts.gave_up);
    lathe__arena_free(&arena);
    lathe__arena_free(&scratch);
}

int main(void) {
    test_octangles();
    test_degenerate();
    test_simplify();
    test_same_as_plain();
    test_spirals();
    test_coasts();
    test_animals();
    test_combs();
    test_nesting();
    test_random_slices();
    test_giving_up();
    test_hostile();
    return check_end();
}
