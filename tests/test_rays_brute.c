/* Centre, rays and crossings against brute force, identical on 100,000 random small regions. The brute force shares
 * nothing with the library but the ray directions: areas and stretches by counting pixels, crossings by intersecting
 * every ray with every segment in exact fractions, IN-OUT by sorting each ray's crossings, ties by a ray turned a
 * little clockwise. */
#include "centre.h"
#include "check.h"
#include "pixel_shapes.h"

enum { REGIONS = 100000, SIZE = 14, ROOM = 4096, ONE = 65536, HALF = ONE / 2 };
typedef struct grid {
    uint8_t at[SIZE][SIZE];
} grid; /* [y][x]; the margin stays empty */
typedef struct ring {
    lathe_point at[ROOM];
    uint32_t count;
} ring;
typedef struct meeting {
    uint32_t segment, ray;
    bool in_out;
    __int128 along, length, near[2], far[2];
} meeting;
typedef struct failures {
    int status, centre, count, place, ray, in_out, outward;
    long crossings, ties, moved;
} failures;

/* ---- regions ---- */

/* 4-connected to the first pixel, then holes filled: what is 4-connected to the margin is outside. */
static void spread(grid *g, int x, int y, uint8_t from, uint8_t to) {
    if (x < 0 || y < 0 || x >= SIZE || y >= SIZE || g->at[y][x] != from) return;
    g->at[y][x] = to;
    spread(g, x + 1, y, from, to);
    spread(g, x - 1, y, from, to);
    spread(g, x, y + 1, from, to);
    spread(g, x, y - 1, from, to);
}
static void random_region(grid *g, uint64_t *seed) {
    memset(g, 0, sizeof *g);
    int size = 2 + shape_below(seed, SIZE - 4), density = 45 + shape_below(seed, 50), x = 0, y = 1;
    for (int v = 1; v <= size; v++)
        for (int u = 1; u <= size; u++) g->at[v][u] = shape_below(seed, 100) < density;
    g->at[1 + size / 2][1 + size / 2] = 1;
    if (shape_below(seed, 3) == 0 && size > 4) /* a C: its centre of area lies in the gap */
        for (int v = 1; v <= size; v++)
            for (int u = 1; u <= size; u++) g->at[v][u] = u < 3 || v < 3 || v > size - 1 - shape_below(seed, 2);
    for (y = 1; !g->at[y][x];)
        if (++x == SIZE) x = 0, y++;
    if (g->at[1 + size / 2][1 + size / 2]) x = y = 1 + size / 2;
    spread(g, x, y, 1, 2);
    for (int v = 0; v < SIZE; v++)
        for (int u = 0; u < SIZE; u++) g->at[v][u] = g->at[v][u] == 2;
    spread(g, 0, 0, 0, 3);
    for (int v = 0; v < SIZE; v++)
        for (int u = 0; u < SIZE; u++) g->at[v][u] = g->at[v][u] != 3;
}
static bool inside(const grid *g, int x, int y) { return x >= 0 && y >= 0 && x < SIZE && y < SIZE && g->at[y][x]; }

/* The outer loop along pixel borders, counter-clockwise, turning left where two ways are open (two pixels that touch
 * in a corner: the loop then meets itself there). Corner (x, y) is the lower left one of pixel (x, y). */
static void trace_borders(ring *r, const grid *g) {
    static const int dx[4] = {1, 0, -1, 0}, dy[4] = {0, 1, 0, -1};
    int x = 0, y = 0;
    while (!g->at[y][x])
        if (++x == SIZE) x = 0, y++;
    int x0 = x, y0 = y, d = 0;
    r->count = 0;
    do {
        r->at[r->count++] = (lathe_point){x * ONE - HALF, y * ONE - HALF};
        x += dx[d], y += dy[d];
        for (int turn = 1; turn >= -1; turn--) {
            int e = (d + turn) & 3;
            /* pixels to the left and right of the border that leaves (x, y) in direction e */
            int lx = x - (e == 1 || e == 2), ly = y - (e == 2 || e == 3), rx = x - (e == 2 || e == 3),
                ry = y - (e == 0 || e == 3);
            if (!inside(g, lx, ly) || inside(g, rx, ry)) continue;
            d = e;
            break;
        }
    } while (x != x0 || y != y0 || d != 0);
}

/* ---- the centre, by pixels ---- */
static bool pixel(const grid *g, bool rows, int along, int across) {
    return rows ? g->at[along][across] : g->at[across][along];
}
/* The least lattice coordinate with at least half of the area before it, made odd. */
static int32_t brute_median(const grid *g, bool rows) {
    int64_t total = 0, before = 0;
    for (int i = 0; i < SIZE; i++)
        for (int k = 0; k < SIZE; k++) total += pixel(g, rows, i, k);
    for (int i = 0;; i++) {
        int64_t here = 0;
        for (int k = 0; k < SIZE; k++) here += pixel(g, rows, i, k);
        if (2 * (before + here) < total) {
            before += here;
            continue;
        }
        /* 2 * (before * ONE + here * offset) >= total * ONE */
        int64_t missing = total * ONE - 2 * before * ONE, offset = (missing + 2 * here - 1) / (2 * here);
        return (int32_t)(i * ONE - HALF + offset) | 1;
    }
}
/* The middle of the nearest stretch of the column that is inside (of two as near the upper one), if (x, y) is not. */
static lathe_point brute_centre(const grid *g, long *moved) {
    int32_t x = brute_median(g, false), y = brute_median(g, true), column = (x + HALF) / ONE;
    if (g->at[(y + HALF) / ONE][column]) return (lathe_point){x, y};
    int64_t best = INT64_MAX;
    int32_t found = 0;
    for (int v = 0; v < SIZE; v++) {
        if (!g->at[v][column] || g->at[v - 1][column]) continue;
        int end = v;
        while (g->at[end][column]) end++;
        int32_t low = v * ONE - HALF, high = end * ONE - HALF;
        int64_t distance = low >= y ? low - y : y - high;
        if (distance > best) continue;
        best = distance;
        found = low + (high - low) / 2;
    }
    ++*moved;
    return (lathe_point){x, found};
}

/* ---- crossings ---- */
static __int128 cross(__int128 ax, __int128 ay, __int128 bx, __int128 by) { return ax * by - ay * bx; }
static int sign(__int128 v) { return v < 0 ? -1 : v > 0; }
static int compare(const __int128 a[2], const __int128 b[2]) { return sign(a[0] * b[1] - b[0] * a[1]); }

/* Where the line through the centre along d meets segment p q, as a multiple of d: numerator / denominator > 0. */
static void reach(__int128 out[2], int64_t px, int64_t py, int64_t qx, int64_t qy, int64_t dx, int64_t dy) {
    out[0] = cross(px, py, qx - px, qy - py);
    out[1] = cross(dx, dy, qx - px, qy - py);
    if (out[1] < 0) out[0] = -out[0], out[1] = -out[1];
}
static bool meet(meeting *m, const ring *r, uint32_t segment, lathe_point o, uint32_t ray, uint32_t rays) {
    lathe_point a = r->at[segment], b = r->at[(segment + 1) % r->count], d = lathe__ray_direction(ray, rays);
    int64_t px = (int64_t)a.x - o.x, py = (int64_t)a.y - o.y, qx = (int64_t)b.x - o.x, qy = (int64_t)b.y - o.y;
    __int128 at_p = cross(d.x, d.y, px, py), at_q = cross(d.x, d.y, qx, qy);
    if ((at_p >= 0) == (at_q >= 0)) return false; /* on the ray counts as to its left */
    *m = (meeting){.segment = segment, .ray = ray, .along = at_p < 0 ? -at_p : at_p};
    m->length = m->along + (at_q < 0 ? -at_q : at_q);
    reach(m->near, px, py, qx, qy, d.x, d.y);
    if (m->near[0] <= 0) return false; /* on the other side of the centre */
    reach(m->far, px, py, qx, qy, d.x * ((int64_t)1 << 20) + d.y, d.y * ((int64_t)1 << 20) - d.x);
    return true;
}
/* By radius; where both pass one vertex, as the ray turned clockwise by 2^-20 meets them. */
static int compare_reach(const meeting *a, const meeting *b) {
    int order = compare(a->near, b->near);
    return order ? order : compare(a->far, b->far);
}

/* All crossings in walking order. */
static uint32_t brute_crossings(meeting *out, const ring *r, lathe_point o, uint32_t rays) {
    uint32_t count = 0;
    for (uint32_t s = 0; s < r->count; s++) {
        uint32_t first = count;
        for (uint32_t ray = 0; ray < rays; ray++) {
            meeting m;
            if (!meet(&m, r, s, o, ray, rays)) continue;
            uint32_t at = count++;
            for (; at > first && m.along * out[at - 1].length < out[at - 1].along * m.length; at--)
                out[at] = out[at - 1];
            out[at] = m;
        }
    }
    for (uint32_t k = 0; k < count; k++) {
        uint32_t nearer = 0;
        for (uint32_t i = 0; i < count; i++)
            if (i != k && out[i].ray == out[k].ray) nearer += compare_reach(&out[i], &out[k]) < 0;
        out[k].in_out = nearer % 2 == 0;
    }
    return count;
}

static void check_crossings(failures *f, lathe_arena *arena, const ring *r, lathe_point o, uint32_t rays,
                            bool alternates) {
    static meeting brute[ROOM];
    lathe_crossing *c;
    uint32_t count, expected = brute_crossings(brute, r, o, rays), shift = 0;
    if (lathe__cast_rays(&c, &count, arena, r->at, r->count, o, rays) != LATHE_OK) {
        f->status++;
        return;
    }
    f->count += count != expected;
    if (count != expected) return;
    f->crossings += count;
    /* A crossing at the end of the last segment is given as vertex 0, in front. */
    if (count && brute[count - 1].along == brute[count - 1].length && brute[count - 1].segment + 1 == r->count)
        shift = count - 1;
    for (uint32_t k = 0; k < count; k++) {
        const meeting *m = &brute[(k + shift) % count], *next = &brute[(k + shift + 1) % count];
        bool at_end = m->along == m->length;
        f->ties += at_end;
        f->ray += c[k].ray != m->ray;
        f->place += c[k].segment != (m->segment + at_end) % r->count;
        f->place += c[k].numerator < 0 || c[k].numerator >= c[k].denominator ||
                    (at_end ? c[k].numerator != 0 : c[k].numerator * m->length != m->along * c[k].denominator);
        if (alternates) f->in_out += c[k].in_out != m->in_out;
        if (m->ray == next->ray && count > 1) f->outward += c[k].outward != (compare_reach(m, next) < 0);
    }
}

static void copy_loop(ring *out, const grid *g, uint64_t *seed) {
    static shape s;
    static shape_loop loop;
    memset(&s, 0, sizeof s);
    for (int y = 0; y < SIZE; y++)
        for (int x = 0; x < SIZE; x++) s.at[y][x] = g->at[y][x];
    shape_trace(&loop, &s, seed, 1);
    out->count = loop.count;
    memcpy(out->at, loop.points, loop.count * sizeof *loop.points);
}

static void test_regions(void) {
    static ring r;
    lathe_arena arena = {0};
    uint64_t seed = 41;
    failures f = {0};
    for (int i = 0; i < REGIONS; i++) {
        grid g;
        random_region(&g, &seed);
        trace_borders(&r, &g);
        lathe_point brute = brute_centre(&g, &f.moved), o;
        f.status += lathe__loop_centre(&o, &arena, r.at, r.count) != LATHE_OK;
        f.centre += o.x != brute.x || o.y != brute.y;
        uint32_t rays = 4u << shape_below(&seed, 5);
        /* From a pixel's centre diagonal rays pass corners. */
        if (i & 1) o = (lathe_point){(o.x + HALF) / ONE * ONE, (o.y + HALF) / ONE * ONE};
        if (i % 4 == 3) copy_loop(&r, &g, &seed);
        check_crossings(&f, &arena, &r, o, rays, true);
        lathe__arena_reset(&arena);
    }
    lathe__arena_free(&arena);
    CHECK_EQ(f.status, 0);
    CHECK_EQ(f.centre, 0);
    CHECK_EQ(f.count, 0);
    CHECK_EQ(f.ray, 0);
    CHECK_EQ(f.place, 0);
    CHECK_EQ(f.in_out, 0);
    CHECK_EQ(f.outward, 0);
    CHECK(f.crossings > REGIONS * 8 && f.ties > REGIONS / 4 && f.moved > REGIONS / 20);
    printf("%d regions, %ld crossings, %ld in vertices, %ld centres moved inside\n", REGIONS, f.crossings, f.ties,
           f.moved);
}

int main(void) {
    test_regions();
    return check_end();
}
