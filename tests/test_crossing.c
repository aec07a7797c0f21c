/* Ray casting against brute force (all rays x all segments), axiom 1, nesting, and the centre, on 20,000 random pixel
 * regions. */
#include "centre.h"
#include "check.h"
#include "pixel_shapes.h"

enum { SHAPES = 20000, ROOM = 1 << 16 };

typedef struct failures {
    int position, order, count, axiom, up, nesting, winding, outside, unbalanced, status;
} failures;

static int64_t cross(int64_t ax, int64_t ay, int64_t bx, int64_t by) { return ax * by - ay * bx; }

/* Segment (p, q) meets the ray of direction d, with points on the ray's line to its left: 1 counter-clockwise, -1, or
 * 0. */
static int meets(int64_t px, int64_t py, int64_t qx, int64_t qy, lathe_point d) {
    int left_p = cross(d.x, d.y, px, py) >= 0, left_q = cross(d.x, d.y, qx, qy) >= 0;
    if (left_p == left_q) return 0;
    int64_t side = cross(px, py, qx, qy);
    return left_q ? (side > 0 ? 1 : 0) : (side < 0 ? -1 : 0);
}

/* Each crossing is where it says, and there are as many on each ray as brute force finds. */
static void check_brute(failures *f, const lathe_crossing *c, uint32_t count, const shape_loop *loop, lathe_point o,
                        uint32_t rays) {
    uint32_t k = 0, total = 0;
    static uint32_t segment_hits[SHAPE_POINTS + 1];
    memset(segment_hits, 0, sizeof segment_hits);
    for (uint32_t i = 0; i < loop->count; i++)
        for (uint32_t r = 0; r < rays; r++) {
            lathe_point p = loop->points[i], q = loop->points[(i + 1) % loop->count], d = lathe__ray_direction(r, rays);
            if (!meets(p.x - o.x, p.y - o.y, q.x - o.x, q.y - o.y, d)) continue;
            total++;
            bool at_end = cross(d.x, d.y, q.x - o.x, q.y - o.y) == 0;
            segment_hits[(i + at_end) % loop->count]++;
        }
    f->count += total != count;
    for (; k < count; k++) {
        lathe_point p = loop->points[c[k].segment], q = loop->points[(c[k].segment + 1) % loop->count];
        lathe_point d = lathe__ray_direction(c[k].ray, rays);
        __int128 n = c[k].numerator, m = c[k].denominator;
        if (n < 0 || n >= m) {
            f->position++;
            continue;
        }
        __int128 x = (p.x - o.x) * m + (q.x - p.x) * n, y = (p.y - o.y) * m + (q.y - p.y) * n;
        f->position += d.x * y - d.y * x != 0 || d.x * x + d.y * y <= 0;
        segment_hits[c[k].segment]--;
        if (!k) continue;
        f->order += c[k].segment < c[k - 1].segment;
        if (c[k].segment == c[k - 1].segment) f->order += (__int128)c[k - 1].numerator * m > n * c[k - 1].denominator;
    }
    for (uint32_t i = 0; i < loop->count; i++) f->count += segment_hits[i] != 0;
}

/* Radius of a crossing as (numerator, denominator), in units of 1 / |d|^2. */
static __int128 reach(const lathe_crossing *c, const shape_loop *loop, lathe_point o, uint32_t rays) {
    lathe_point p = loop->points[c->segment], q = loop->points[(c->segment + 1) % loop->count],
                d = lathe__ray_direction(c->ray, rays);
    __int128 x = (__int128)(p.x - o.x) * c->denominator + (__int128)(q.x - p.x) * c->numerator;
    __int128 y = (__int128)(p.y - o.y) * c->denominator + (__int128)(q.y - p.y) * c->numerator;
    return d.x * x + d.y * y;
}
static int compare_reach(__int128 a, const lathe_crossing *ca, __int128 b, const lathe_crossing *cb) {
    __int128 left = a * cb->denominator, right = b * ca->denominator;
    return left < right ? -1 : left > right;
}

/* Odd on each ray, IN-OUT first, alternating; UP and DOWN as the radii say, also in the two crossings of a spike's
 * tip. */
static void check_axiom(failures *f, const lathe_crossing *c, uint32_t count, const shape_loop *loop, lathe_point o,
                        uint32_t rays) {
    static uint32_t order[ROOM];
    static __int128 radius[ROOM];
    for (uint32_t k = 0; k < count; k++) radius[k] = reach(&c[k], loop, o, rays);
    for (uint32_t k = 0; k < count; k++) {
        uint32_t next = (k + 1) % count;
        if (c[k].ray != c[next].ray) continue;
        int sign = compare_reach(radius[k], &c[k], radius[next], &c[next]);
        f->up += sign && c[k].outward != (sign < 0);
    }
    for (uint32_t r = 0; r < rays; r++) {
        uint32_t used = 0;
        for (uint32_t k = 0; k < count; k++) {
            if (c[k].ray != r) continue;
            uint32_t at = used++;
            for (; at > 0; at--) {
                uint32_t other = order[at - 1];
                int sign = compare_reach(radius[other], &c[other], radius[k], &c[k]);
                bool tie_goes_in = other + 1 == k ? !c[other].outward : k == count - 1 && other == 0 && c[k].outward;
                if (sign < 0 || (sign == 0 && !tie_goes_in)) break;
                order[at] = other;
            }
            order[at] = k;
        }
        f->axiom += used % 2 == 0;
        for (uint32_t k = 0; k < used; k++) f->axiom += c[order[k]].in_out != (k % 2 == 0);
    }
}

/* Crossings at 2n rays restricted to even rays are those at n. */
static void check_nesting(failures *f, lathe_arena *arena, const lathe_crossing *coarse, uint32_t count,
                          const shape_loop *loop, lathe_point o, uint32_t rays) {
    lathe_crossing *fine;
    uint32_t fine_count, k = 0;
    f->status += lathe__cast_rays(&fine, &fine_count, arena, loop->points, loop->count, o, 2 * rays) != LATHE_OK;
    for (uint32_t i = 0; i < fine_count; i++) {
        if (fine[i].ray & 1) continue;
        const lathe_crossing *a = &fine[i], *b = &coarse[k++];
        if (k > count) break;
        f->nesting += a->segment != b->segment || a->ray != 2 * b->ray || a->in_out != b->in_out ||
                      (__int128)a->numerator * b->denominator != (__int128)b->numerator * a->denominator;
    }
    f->nesting += k != count;
}

/* Winding number by brute force, and 0 for points on the loop. */
static int winding(const shape_loop *loop, lathe_point o) {
    int turns = 0;
    for (uint32_t i = 0; i < loop->count; i++) {
        lathe_point p = loop->points[i], q = loop->points[(i + 1) % loop->count];
        int64_t side = cross((int64_t)p.x - o.x, (int64_t)p.y - o.y, (int64_t)q.x - o.x, (int64_t)q.y - o.y);
        int64_t along = (int64_t)(p.x - o.x) * (q.x - o.x) + (int64_t)(p.y - o.y) * (q.y - o.y);
        if (side == 0 && along <= 0) return 0;
        if ((p.y <= o.y) != (q.y <= o.y)) turns += p.y <= o.y ? (side > 0) : -(side < 0);
    }
    return turns;
}

/* The share of the loop's area on one side of a line, in 1/1000, by clipping in doubles. */
static int share(const shape_loop *loop, double at, int rows) {
    double part = 0, total = 0;
    for (uint32_t i = 0; i < loop->count; i++) {
        lathe_point a = loop->points[i], b = loop->points[(i + 1) % loop->count];
        double x0 = rows ? a.y : a.x, y0 = rows ? a.x : a.y, x1 = rows ? b.y : b.x, y1 = rows ? b.x : b.y;
        total += (y0 + y1) * (x1 - x0);
        double c0 = x0 < at ? x0 : at, c1 = x1 < at ? x1 : at;
        if (x0 == x1) continue;
        double h0 = y0 + (y1 - y0) * (c0 - x0) / (x1 - x0), h1 = y0 + (y1 - y0) * (c1 - x0) / (x1 - x0);
        part += (h0 + h1) * (c1 - c0);
    }
    return (int)(1000 * part / total + 0.5);
}

static void reverse(shape_loop *loop) {
    for (uint32_t i = 0, j = loop->count - 1; i < j; i++, j--) {
        lathe_point swap = loop->points[i];
        loop->points[i] = loop->points[j];
        loop->points[j] = swap;
    }
}

static void check_centre(failures *f, lathe_arena *arena, lathe_point *o, shape_loop *loop) {
    lathe_point again;
    f->status += lathe__loop_centre(o, arena, loop->points, loop->count) != LATHE_OK;
    f->outside += winding(loop, *o) != 1;
    f->unbalanced += abs(share(loop, o->x, 0) - 500) > 1;
    reverse(loop);
    f->status += lathe__loop_centre(&again, arena, loop->points, loop->count) != LATHE_OK;
    reverse(loop);
    f->unbalanced += abs(again.x - o->x) > 2;
}

static void test_shapes(void) {
    static shape s;
    static shape_loop loop;
    uint64_t seed = 3;
    lathe_arena arena = {0};
    failures f = {0};
    long ties = 0, crossings = 0;
    for (int i = 0; i < SHAPES; i++) {
        shape_make(&s, &seed, i);
        shape_trace(&loop, &s, &seed, i & 4);
        lathe_point o;
        check_centre(&f, &arena, &o, &loop);
        /* Pixel centres put many vertices on rays: the nearest one that is inside. */
        lathe_point pixel = {(o.x + 32768) / 65536 * 65536, (o.y + 32768) / 65536 * 65536};
        if (i & 8 && winding(&loop, pixel) == 1) o = pixel;
        uint32_t rays = 4u << shape_below(&seed, 4), count;
        lathe_crossing *c;
        f.status += lathe__cast_rays(&c, &count, &arena, loop.points, loop.count, o, rays) != LATHE_OK;
        check_brute(&f, c, count, &loop, o, rays);
        check_axiom(&f, c, count, &loop, o, rays);
        check_nesting(&f, &arena, c, count, &loop, o, rays);
        for (uint32_t k = 0; k < count; k++) ties += c[k].numerator == 0;
        crossings += count;
        lathe__arena_reset(&arena);
    }
    lathe__arena_free(&arena);
    CHECK_EQ(f.status, 0);
    CHECK_EQ(f.outside, 0);
    CHECK_EQ(f.unbalanced, 0);
    CHECK_EQ(f.position, 0);
    CHECK_EQ(f.order, 0);
    CHECK_EQ(f.count, 0);
    CHECK_EQ(f.axiom, 0);
    CHECK_EQ(f.up, 0);
    CHECK_EQ(f.nesting, 0);
    CHECK(crossings > 400000);
    CHECK(ties > 20000); /* the tie-break was exercised */
}

/* Triangles a few lattice units wide (doubled area at least 160): the centre stays strictly inside. */
static void test_tiny_centres(void) {
    static shape_loop loop;
    lathe_arena arena = {0};
    uint64_t seed = 21;
    int outside = 0, tried = 0;
    while (tried < 20000) {
        for (int k = 0; k < 3; k++)
            loop.points[k] = (lathe_point){shape_below(&seed, 41) - 20, shape_below(&seed, 41) - 20};
        lathe_point *p = loop.points, o;
        if (cross(p[1].x - p[0].x, p[1].y - p[0].y, p[2].x - p[0].x, p[2].y - p[0].y) < 160) continue;
        loop.count = 3;
        tried++;
        outside += lathe__loop_centre(&o, &arena, p, 3) != LATHE_OK || winding(&loop, o) != 1;
        lathe__arena_reset(&arena);
    }
    CHECK_EQ(outside, 0);
    lathe__arena_free(&arena);
}

/* A square around its centre: known crossings, and the same square walked as a hole, then reversed. */
static void test_square(void) {
    lathe_point square[4] = {{-10, -10}, {10, -10}, {10, 10}, {-10, 10}}, centre;
    lathe_arena arena = {0};
    lathe_crossing *c;
    uint32_t count;
    CHECK_EQ(lathe__cast_rays(&c, &count, &arena, square, 4, (lathe_point){0, 0}, 8), LATHE_OK);
    CHECK_EQ(count, 8);
    for (uint32_t k = 0; k < count && count == 8; k++) {
        CHECK(c[k].in_out);
        CHECK_EQ(c[k].ray, (k + 5) % 8);
        CHECK_EQ(c[k].segment, k / 2);
        CHECK_EQ(2 * c[k].numerator, k % 2 * c[k].denominator);
    }
    for (uint32_t i = 0; i < 2; i++) {
        lathe_point swap = square[i];
        square[i] = square[3 - i];
        square[3 - i] = swap;
    }
    CHECK_EQ(lathe__cast_rays(&c, &count, &arena, square, 4, (lathe_point){0, 0}, 8), LATHE_OK);
    CHECK_EQ(count, 8);
    CHECK(!c[0].in_out);
    CHECK_EQ(lathe__loop_centre(&centre, &arena, square, 4), LATHE_OK);
    CHECK(abs(centre.x) <= 1 && abs(centre.y) <= 1);
    lathe__arena_free(&arena);
}

/* Anything may come from a file: no crash, no hang, statuses. */
static void test_hostile(void) {
    lathe_arena arena = {0};
    lathe_crossing *c;
    lathe_point centre, big[3] = {{(LATHE_MAX_DIM + 2) * LATHE_LATTICE_ONE, 0}, {0, 1}, {0, 0}}, same[3] = {{5, 5}, {5, 5}, {5, 5}},
                        line[2] = {{-9, 0}, {9, 0}};
    uint32_t count;
    CHECK_EQ(lathe__cast_rays(&c, &count, &arena, big, 3, (lathe_point){0, 0}, 8), LATHE_ERR_RANGE);
    CHECK_EQ(lathe__cast_rays(&c, &count, &arena, same, 3, (lathe_point){0, 0}, 12), LATHE_ERR_RANGE);
    CHECK_EQ(lathe__cast_rays(&c, &count, &arena, same, 3, (lathe_point){0, 0}, 0), LATHE_ERR_RANGE);
    CHECK_EQ(lathe__cast_rays(&c, &count, &arena, same, 0, (lathe_point){0, 0}, 8), LATHE_OK);
    CHECK_EQ(count, 0);
    CHECK_EQ(lathe__cast_rays(&c, &count, &arena, same, 3, (lathe_point){5, 5}, 8), LATHE_OK);
    CHECK_EQ(lathe__cast_rays(&c, &count, &arena, line, 2, (lathe_point){0, 0}, 65536), LATHE_OK);
    CHECK_EQ(count, 65536);
    CHECK_EQ(lathe__loop_centre(&centre, &arena, same, 0), LATHE_ERR_RANGE);
    CHECK_EQ(lathe__loop_centre(&centre, &arena, big, 3), LATHE_ERR_RANGE);
    CHECK_EQ(lathe__loop_centre(&centre, &arena, same, 3), LATHE_OK);
    CHECK_EQ(lathe__loop_centre(&centre, &arena, line, 2), LATHE_OK);
    uint64_t seed = 9;
    int bad = 0;
    for (int i = 0; i < 20000; i++) {
        lathe_point p[12];
        uint32_t n = 1 + (uint32_t)shape_below(&seed, 12);
        int32_t range = i & 1 ? 4 : ((LATHE_MAX_DIM + 2) * LATHE_LATTICE_ONE) - 1;
        for (uint32_t k = 0; k < n; k++)
            p[k] = (lathe_point){shape_below(&seed, 2 * range + 1) - range, shape_below(&seed, 2 * range + 1) - range};
        bad += lathe__loop_centre(&centre, &arena, p, n) != LATHE_OK;
        lathe_point o = i & 2 ? p[0] : i & 4 ? centre : (lathe_point){range, -range};
        bad += lathe__cast_rays(&c, &count, &arena, p, n, o, 16) != LATHE_OK;
        for (uint32_t k = 0; k < count; k++)
            bad += c[k].segment >= n || c[k].numerator < 0 || c[k].numerator >= c[k].denominator ||
                   (k && c[k].segment < c[k - 1].segment);
        uint8_t types[16 * 12];
        bad += lathe__classify_edges(types, c, count, 16) != LATHE_OK;
        lathe__arena_reset(&arena);
    }
    CHECK_EQ(bad, 0);
    lathe__arena_free(&arena);
}

int main(void) {
    test_square();
    test_shapes();
    test_tiny_centres();
    test_hostile();
    return check_end();
}
