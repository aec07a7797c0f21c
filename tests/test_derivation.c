/* Derivation trees and the tiling that walks them: the paper's figures 10 and 11 and its case 3, random contours of
 * pixel regions (each tree derived again by code of the test's own), work counts up to 10^6 crossings; and the drawing
 * of both. */
#include "centre.h"
#include "check.h"
#include "derivation.h"
#include "draw_contour.h"
#include "long_contour.h"
#include "mend.h"
#include "pixel_shapes.h"
#include <math.h>

#define NONE UINT32_MAX
enum { PAIRS = 10000, ROOM = 1 << 16 };

/* ---- contours given as rays and radii, in walking order ---- */
typedef struct polar {
    uint32_t ray;
    int radius;
} polar;

static bool contour_of(lathe_ray_contour *c, lathe_arena *arena, const polar *list, uint32_t count, uint32_t rays) {
    *c = (lathe_ray_contour){.rays = rays, .count = count};
    c->crossings = LATHE_NEW(arena, lathe_crossing, count);
    c->points = LATHE_NEW(arena, lathe_point, count);
    c->radius = LATHE_NEW(arena, int64_t, count);
    c->types = LATHE_NEW(arena, uint8_t, count);
    for (uint32_t i = 0; i < count; i++) {
        double v[2], r = list[i].radius * 1000.0;
        int inner = 0;
        lathe__ray_vector(v, list[i].ray, rays, 0);
        for (uint32_t k = 0; k < count; k++) inner += list[k].ray == list[i].ray && list[k].radius < list[i].radius;
        const polar *next = &list[(i + 1) % count];
        c->points[i] = (lathe_point){(int32_t)lround(v[0] * r), (int32_t)lround(v[1] * r)};
        c->radius[i] = (int64_t)r;
        c->crossings[i] = (lathe_crossing){i, list[i].ray, inner % 2 == 0, next->radius > list[i].radius, 0, 1};
    }
    return lathe__classify_edges(c->types, c->crossings, count, rays) == LATHE_OK;
}

/* ---- every tree derives its string, by the productions of derivation.h ---- */
typedef struct reading {
    const lathe_derivation *tree;
    const uint8_t *types;
    uint32_t at, visited;
    bool ok;
} reading;

static bool type_is_o(int t) { return t == LATHE_UP_O || t == LATHE_DOWN_I; }
static bool type_is_i(int t) { return t == LATHE_UP_I || t == LATHE_DOWN_O; }
static bool o_symbol(int s) { return s == LATHE_DER_D_I || s == LATHE_DER_U_O; }
static bool i_symbol(int s) { return s == LATHE_DER_D_O || s == LATHE_DER_U_I; }
static bool r_symbol(int s) { return s == LATHE_DER_D_R || s == LATHE_DER_U_R; }
static bool du_symbol(int s) { return s == LATHE_DER_D || s == LATHE_DER_U; }
static int symbol(const reading *r, uint32_t node) {
    return node >= r->tree->node_count ? -1 : r->tree->nodes[node].symbol;
}
static uint32_t next_of(const reading *r, uint32_t node) { return node == NONE ? NONE : r->tree->nodes[node].next; }
static int read_leaf(reading *r, uint32_t node) {
    if (symbol(r, node) != LATHE_DER_LEAF) return r->ok = false, -1;
    const lathe_derivation_node *n = &r->tree->nodes[node];
    r->ok &= n->first == r->at && n->count == 1 && n->child == NONE &&
             n->edge == r->types[(r->tree->start + r->at) % r->tree->edge_count];
    r->visited++;
    r->at++;
    return n->edge;
}
static void read_group(reading *r, uint32_t node, bool o_first);

/* O -> o | f O R* b, I -> i | b I pair* f */
static void read_element(reading *r, uint32_t node, bool o) {
    if (node == NONE || !(o ? o_symbol(symbol(r, node)) : i_symbol(symbol(r, node)))) {
        r->ok = false;
        return;
    }
    const lathe_derivation_node *n = &r->tree->nodes[node];
    uint32_t begin = r->at, child = n->child;
    r->visited++;
    int type = read_leaf(r, child);
    child = next_of(r, child);
    if (!r->ok) return;
    if (type == LATHE_FOR || type == LATHE_BACK) {
        r->ok &= type == (o ? LATHE_FOR : LATHE_BACK);
        read_element(r, child, o);
        if (!r->ok) return;
        for (child = next_of(r, child); o ? r_symbol(symbol(r, child)) : du_symbol(symbol(r, child));
             child = next_of(r, child)) {
            read_group(r, child, !o);
            if (!r->ok) return;
        }
        r->ok &= read_leaf(r, child) == (o ? LATHE_BACK : LATHE_FOR);
        child = next_of(r, child);
    } else
        r->ok &= o ? type_is_o(type) : type_is_i(type);
    r->ok &= child == NONE && n->first == begin && n->count == r->at - begin;
}
/* pair -> O I, R -> I O; or a part: two or more pairs. */
static void read_group(reading *r, uint32_t node, bool o_first) {
    const lathe_derivation_node *n = &r->tree->nodes[node];
    uint32_t begin = r->at, child = n->child, pairs = 0;
    r->visited++;
    for (; du_symbol(n->symbol) && du_symbol(symbol(r, child)) && r->ok; child = next_of(r, child), pairs++)
        read_group(r, child, true);
    if (!r->ok) return;
    if (!pairs) {
        read_element(r, child, o_first);
        if (!r->ok) return;
        child = next_of(r, child);
        read_element(r, child, !o_first);
        if (!r->ok) return;
        child = next_of(r, child);
    }
    r->ok &= pairs != 1 && child == NONE && n->first == begin && n->count == r->at - begin;
}
/* S -> F^rays, F -> [D] f [U] */
static bool derives(const lathe_derivation *t, const lathe_ray_contour *c) {
    reading r = {t, c->types, 0, 1, true};
    uint32_t child = t->nodes[0].child;
    if (t->nodes[0].symbol != LATHE_DER_S || t->nodes[0].count != c->count || t->node_count > 3 * c->count + 2)
        return false;
    for (uint32_t i = 0; i < t->rays; i++, child = next_of(&r, child)) {
        if (symbol(&r, child) != LATHE_DER_F || t->level1[i] != child) return false;
        const lathe_derivation_node *n = &t->nodes[child];
        uint32_t begin = r.at, part = n->child;
        r.visited++;
        if (part != NONE && t->nodes[part].first < t->main_edge[i]) {
            if (symbol(&r, part) != LATHE_DER_D) return false;
            read_group(&r, part, true);
            if (!r.ok) return false;
            part = next_of(&r, part);
        }
        uint32_t edge = (t->start + r.at) % c->count;
        if (t->main_edge[i] != r.at || c->types[edge] != LATHE_FOR || c->crossings[edge].ray != i) return false;
        r.at++;
        if (part != NONE) {
            if (symbol(&r, part) != LATHE_DER_U) return false;
            read_group(&r, part, true);
            if (!r.ok) return false;
            part = next_of(&r, part);
        }
        if (part != NONE || n->first != begin || n->count != r.at - begin) return false;
    }
    return child == NONE && r.at == c->count && r.visited == t->node_count;
}

/* Every edge of both once; corresponding edges have one type; level-1 edges correspond. */
static bool tiles(const lathe_tiling *t, const lathe_ray_contour *a, const lathe_derivation *right,
                  const lathe_ray_contour *b, const lathe_derivation *left) {
    uint32_t i = t->start[0], j = t->start[1], done[2] = {0, 0}, main_pairs = 0;
    if (i >= a->count || j >= b->count) return false;
    for (uint32_t k = 0; k < t->count; k++) {
        uint8_t step = t->steps[k];
        if (step < 1 || step > 3) return false;
        if (step == 3 && a->types[i] != b->types[j]) return false;
        if (step == 3 && a->types[i] == LATHE_FOR && a->crossings[i].ray == b->crossings[j].ray) {
            uint32_t ray = a->crossings[i].ray;
            main_pairs += (right->start + right->main_edge[ray]) % a->count == i &&
                          (left->start + left->main_edge[ray]) % b->count == j;
        }
        if (step & 1) i = (i + 1) % a->count, done[0]++;
        if (step & 2) j = (j + 1) % b->count, done[1]++;
    }
    return done[0] == a->count && done[1] == b->count && main_pairs == a->rays;
}

/* ---- the paper's figures ---- */

/* The steps as text, from the crossing of a with this ray and radius on; at most `size` - 1 of them. */
static void steps_from(char *text, size_t size, const lathe_tiling *t, const lathe_ray_contour *a, const polar *list,
                       polar from) {
    uint32_t i = t->start[0];
    size_t used = 0;
    bool on = false;
    for (uint32_t k = 0; k < 2 * t->count && used + 1 < size; k++) {
        if (list[i].ray == from.ray && list[i].radius == from.radius) on = true;
        if (on) text[used++] = (char)('0' + t->steps[k % t->count]);
        if (t->steps[k % t->count] & 1) i = (i + 1) % a->count;
    }
    text[used] = 0;
}

static const polar TWO_FORS[] = {{0, 6}, {1, 9}, {2, 9}, {2, 5}, {1, 5}, {1, 3},
                                 {2, 3}, {3, 6}, {4, 6}, {5, 6}, {6, 6}, {7, 6}};
static const polar OUTER[] = {{0, 6}, {1, 9}, {2, 9}, {3, 6}, {4, 6}, {5, 6}, {6, 6}, {7, 6}};
static const polar INNER[] = {{0, 6}, {1, 3}, {2, 3}, {3, 6}, {4, 6}, {5, 6}, {6, 6}, {7, 6}};

/* Figure 10: two FOR edges between r1 and r2; towards one neighbour the outer, towards the other the inner is level-1.
 * */
static void test_figure_10(void) {
    lathe_arena arena = {0};
    lathe_ray_contour middle, outer, inner;
    lathe_derivation tree, other;
    lathe_tiling tiling;
    CHECK(contour_of(&middle, &arena, TWO_FORS, 12, 8));
    CHECK(contour_of(&outer, &arena, OUTER, 8, 8));
    CHECK(contour_of(&inner, &arena, INNER, 8, 8));
    CHECK_EQ(lathe__derive_pair(&other, &tree, &arena, &outer, &middle), LATHE_OK);
    CHECK_EQ((tree.start + tree.main_edge[1]) % 12, 1); /* (1, 9) - (2, 9) */
    CHECK(derives(&tree, &middle));
    CHECK_EQ(tree.nodes[tree.nodes[tree.level1[2]].child].symbol, LATHE_DER_D);
    CHECK_EQ(lathe__walk_derivations(&tiling, NULL, &arena, &outer, &other, &middle, &tree), LATHE_OK);
    CHECK(tiles(&tiling, &outer, &other, &middle, &tree));
    CHECK_EQ(lathe__derive_pair(&tree, &other, &arena, &middle, &inner), LATHE_OK);
    CHECK_EQ((tree.start + tree.main_edge[1]) % 12, 5); /* (1, 3) - (2, 3) */
    CHECK(derives(&tree, &middle));
    /* The fold lies on r1 now: f d_i b d_o, an excursion D_I -> f d_i b and a D_O. */
    const lathe_derivation_node *d = &tree.nodes[tree.nodes[tree.level1[1]].child], *o = &tree.nodes[d->child];
    CHECK_EQ(d->symbol, LATHE_DER_D);
    CHECK_EQ(o->symbol, LATHE_DER_D_I);
    CHECK_EQ(o->count, 3);
    CHECK_EQ(tree.nodes[o->next].symbol, LATHE_DER_D_O);
    CHECK_EQ(lathe__walk_derivations(&tiling, NULL, &arena, &middle, &tree, &inner, &other), LATHE_OK);
    CHECK(tiles(&tiling, &middle, &tree, &inner, &other));
    CHECK_EQ(tiling.count, 12);
    lathe__arena_free(&arena);
}

static void check_steps(const polar *a_list, uint32_t a_count, const polar *b_list, uint32_t b_count, polar from,
                        const char *expected) {
    lathe_arena arena = {0};
    lathe_ray_contour a, b;
    lathe_derivation right, left;
    lathe_tiling tiling;
    char text[16];
    CHECK(contour_of(&a, &arena, a_list, a_count, 4));
    CHECK(contour_of(&b, &arena, b_list, b_count, 4));
    CHECK_EQ(lathe__derive_pair(&right, &left, &arena, &a, &b), LATHE_OK);
    CHECK(derives(&right, &a));
    CHECK(derives(&left, &b));
    CHECK_EQ(lathe__walk_derivations(&tiling, NULL, &arena, &a, &right, &b, &left), LATHE_OK);
    CHECK(tiles(&tiling, &a, &right, &b, &left));
    steps_from(text, strlen(expected) + 1, &tiling, &a, a_list, from);
    if (!CHECK(!strcmp(text, expected))) fprintf(stderr, "    steps %s, expected %s\n", text, expected);
    lathe__arena_free(&arena);
}

/* Figure 11: u_o u_i u_o u_i on one ray; the neighbours have one u_o u_i, one near the lower, one near the upper pair.
 * */
static void test_figure_11(void) {
    static const polar middle[] = {{0, 5}, {1, 2}, {1, 4}, {1, 6}, {1, 8}, {1, 10}, {2, 5}, {3, 5}};
    static const polar low[] = {{0, 5}, {1, 2}, {1, 4}, {1, 6}, {2, 5}, {3, 5}};
    static const polar high[] = {{0, 5}, {1, 6}, {1, 8}, {1, 10}, {2, 5}, {3, 5}};
    check_steps(middle, 8, low, 6, (polar){1, 2}, "33113");
    check_steps(middle, 8, high, 6, (polar){1, 2}, "11333");
}

/* Case 3: u_o u_i d_i d_o is a U towards u_o u_i and a D towards d_i d_o; towards both it is U and D. */
static void test_case_3(void) {
    static const polar middle[] = {{0, 5}, {1, 2}, {1, 4}, {1, 10}, {1, 8}, {1, 6}, {2, 5}, {3, 5}};
    static const polar up[] = {{0, 5}, {1, 2}, {1, 4}, {1, 6}, {2, 5}, {3, 5}};
    static const polar down[] = {{0, 5}, {1, 10}, {1, 8}, {1, 6}, {2, 5}, {3, 5}};
    check_steps(middle, 8, up, 6, (polar){1, 2}, "33113");
    check_steps(middle, 8, down, 6, (polar){1, 2}, "11333");
    lathe_arena arena = {0};
    lathe_ray_contour m, n;
    lathe_derivation tree, other;
    CHECK(contour_of(&m, &arena, middle, 8, 4));
    for (int k = 0; k < 3; k++) {
        CHECK(contour_of(&n, &arena, k == 0 ? up : k == 1 ? down : middle, k == 2 ? 8 : 6, 4));
        CHECK_EQ(lathe__derive_pair(&tree, &other, &arena, &m, &n), LATHE_OK);
        const lathe_derivation_node *u = &tree.nodes[tree.level1[0]], *d = &tree.nodes[tree.level1[1]];
        CHECK_EQ(u->child != NONE, k != 1);
        CHECK_EQ(d->child != NONE, k != 0);
        if (k == 0) CHECK_EQ(tree.nodes[u->child].symbol, LATHE_DER_U);
        if (k == 1) CHECK_EQ(tree.nodes[d->child].symbol, LATHE_DER_D);
    }
    lathe__arena_free(&arena);
}

/* ---- random regions ---- */
typedef struct failures {
    int status, derivation, tiling, equal, same, work;
} failures;

static void check_pair(failures *f, lathe_arena *arena, const lathe_ray_contour *a, const lathe_ray_contour *b,
                       long *corresponding) {
    lathe_derivation right, left;
    lathe_tiling tiling, again;
    uint64_t work;
    if (lathe__derive_pair(&right, &left, arena, a, b) ||
        lathe__walk_derivations(&tiling, &work, arena, a, &right, b, &left) || lathe__tile_trees(&again, arena, a, b)) {
        f->status++;
        return;
    }
    f->derivation += !derives(&right, a) || !derives(&left, b);
    f->tiling += !tiles(&tiling, a, &right, b, &left);
    f->same += again.count != tiling.count || memcmp(again.steps, tiling.steps, tiling.count) != 0;
    f->work += right.work > 24 * (uint64_t)a->count || left.work > 24 * (uint64_t)b->count ||
               work > 40 * ((uint64_t)a->count + b->count);
    for (uint32_t k = 0; k < tiling.count; k++) *corresponding += tiling.steps[k] == 3;
}

static bool random_contour(lathe_ray_contour *c, shape_loop *loop, lathe_arena *arena, uint64_t *seed, int kind,
                           uint32_t rays) {
    static shape s;
    lathe_point o;
    shape_make(&s, seed, kind);
    shape_trace(loop, &s, seed, kind & 4);
    return lathe__loop_centre(&o, arena, loop->points, loop->count) == LATHE_OK &&
           lathe__make_ray_contour(c, arena, loop->points, loop->count, o, rays,
                                   kind & 8 ? (uint32_t)shape_below(seed, 65536) : 0) == LATHE_OK;
}

static void test_regions(void) {
    static shape_loop loop;
    lathe_arena arena = {0};
    uint64_t seed = 31;
    failures f = {0};
    long corresponding = 0, edges = 0;
    for (int i = 0; i < PAIRS; i++) {
        lathe_ray_contour a, b;
        uint32_t rays = 4u << shape_below(&seed, 5);
        f.status += !random_contour(&a, &loop, &arena, &seed, shape_below(&seed, 16), rays);
        f.status += !random_contour(&b, &loop, &arena, &seed, shape_below(&seed, 16), rays);
        check_pair(&f, &arena, &a, &b, &corresponding);
        edges += a.count < b.count ? a.count : b.count;
        lathe_tiling equal;
        f.status += lathe__tile_trees(&equal, &arena, &b, &b) != LATHE_OK;
        f.equal += equal.count != b.count || equal.start[0] != equal.start[1];
        lathe__arena_reset(&arena);
    }
    lathe__arena_free(&arena);
    CHECK_EQ(f.status, 0);
    CHECK_EQ(f.derivation, 0);
    CHECK_EQ(f.tiling, 0);
    CHECK_EQ(f.equal, 0);
    CHECK_EQ(f.same, 0);
    CHECK_EQ(f.work, 0);
    CHECK(corresponding > edges / 3 && edges > 300000);
}

/* ---- contours that overlap themselves ---- */

/* Whether any two edges of the polygon cross properly, or two edges on one ray share more than a point: by brute
 * force. */
static bool overlaps(const lathe_ray_contour *c) {
    for (uint32_t i = 0; i < c->count; i++)
        for (uint32_t j = 0; j < i; j++) {
            uint32_t i2 = (i + 1) % c->count, j2 = (j + 1) % c->count;
            if (c->crossings[i].ray == c->crossings[i2].ray) {
                if (c->crossings[j].ray != c->crossings[j2].ray || c->crossings[i].ray != c->crossings[j].ray) continue;
                int64_t a = c->radius[i], b = c->radius[i2], d = c->radius[j], e = c->radius[j2];
                int64_t low = (a < b ? a : b) > (d < e ? d : e) ? (a < b ? a : b) : d < e ? d : e;
                int64_t high = (a > b ? a : b) < (d > e ? d : e) ? (a > b ? a : b) : d > e ? d : e;
                if (low < high) return true;
                continue;
            }
            if (c->crossings[j].ray == c->crossings[j2].ray) continue;
            bool swap = c->types[i] != c->types[j];
            if (c->crossings[i].ray != c->crossings[swap ? j2 : j].ray ||
                c->crossings[i2].ray != c->crossings[swap ? j : j2].ray)
                continue;
            int64_t first = c->radius[i] - c->radius[swap ? j2 : j], second = c->radius[i2] - c->radius[swap ? j : j2];
            if ((first < 0 && second > 0) || (first > 0 && second < 0)) return true;
        }
    return false;
}

/* Figure 6(a): UP and DOWN edges overlap on r1; 6(c) takes two of them out; 6(b) casts more rays. */
static void test_figure_6(void) {
    static const polar list[] = {{0, 6}, {1, 2}, {1, 4}, {1, 12}, {1, 10}, {1, 6}, {2, 6}, {3, 6}};
    lathe_arena arena = {0};
    lathe_ray_contour c, mended;
    uint32_t found, removed;
    CHECK(contour_of(&c, &arena, list, 8, 4));
    CHECK_EQ(lathe__count_overlaps(&found, &arena, &c), LATHE_OK);
    CHECK_EQ(found, 1); /* u_i from 4 to 12 lies over d_i and d_o between 12 and 6 */
    CHECK(overlaps(&c));
    CHECK_EQ(lathe__mend_by_pruning(&mended, &removed, &arena, &c), LATHE_OK);
    CHECK_EQ(removed, 2);
    CHECK(!overlaps(&mended));
    CHECK_EQ(mended.count, 6);
    /* As a polygon: an arm from the left reaches over one from the right. More rays part the two. */
    static const lathe_point loop[] = {{6000, -3000}, {6000, 6000},  {-2000, 6000},  {-2000, 4000},
                                       {5000, 4000},  {5000, 2000},  {-5000, 2000},  {-5000, 8000},
                                       {3000, 8000},  {3000, 10000}, {-6000, 10000}, {-6000, -3000}};
    CHECK_EQ(lathe__make_ray_contour(&c, &arena, loop, 12, (lathe_point){-1, -1}, 4, 0), LATHE_OK);
    CHECK(overlaps(&c));
    CHECK_EQ(lathe__mend_by_rays(&mended, &found, &arena, loop, 12, (lathe_point){-1, -1}, 4, 0, 4), LATHE_OK);
    CHECK(found > 0 && mended.rays == 4);
    CHECK_EQ(lathe__mend_by_rays(&mended, &found, &arena, loop, 12, (lathe_point){-1, -1}, 4, 0, 1024), LATHE_OK);
    CHECK_EQ(found, 0);
    CHECK(mended.rays > 4 && !overlaps(&mended));
    lathe__arena_free(&arena);
}

static void test_mending(void) {
    static shape_loop loop;
    lathe_arena arena = {0};
    uint64_t seed = 6;
    int status = 0, wrong = 0, bad = 0, left = 0, overlapping = 0, by_rays = 0, derivation = 0;
    long edges = 0, gone = 0;
    for (int i = 0; i < 4000; i++) {
        lathe_ray_contour c, pruned, finer;
        uint32_t rays = 4u << shape_below(&seed, 3), found, removed, rest;
        status += !random_contour(&c, &loop, &arena, &seed, i & 15, rays);
        status += lathe__count_overlaps(&found, &arena, &c) != LATHE_OK;
        wrong += (found > 0) != overlaps(&c);
        overlapping += found > 0;
        status += lathe__mend_by_pruning(&pruned, &removed, &arena, &c) != LATHE_OK;
        bad += overlaps(&pruned) || (found == 0) != (removed == 0) || pruned.count < rays;
        lathe_derivation tree;
        derivation += lathe__derive_alone(&tree, &arena, &pruned) != LATHE_OK || !derives(&tree, &pruned);
        if (found) {
            status += lathe__mend_by_rays(&finer, &rest, &arena, loop.points, loop.count, c.centre, rays, c.turn,
                                          1024) != LATHE_OK;
            bad += rest == 0 && overlaps(&finer);
            by_rays += rest == 0;
            edges += c.count;
            gone += removed;
        }
        left += found && rest;
        lathe__arena_reset(&arena);
    }
    lathe__arena_free(&arena);
    CHECK_EQ(status, 0);
    CHECK_EQ(wrong, 0);
    CHECK_EQ(bad, 0);
    CHECK_EQ(derivation, 0);
    CHECK(overlapping > 100);
    printf("%d of 4000 contours overlap; up to 1024 rays mend %d, not %d; pruning mends all and takes %.0f %% of their "
           "edges\n",
           overlapping, by_rays, left, 100.0 * (double)gone / (double)edges);
}

/* ---- pictures ---- */
static uint32_t occurrences(const char *text, const char *word) {
    uint32_t n = 0;
    for (text = strstr(text, word); text; text = strstr(text + 1, word)) n++;
    return n;
}
/* Tags are balanced, attributes quoted, no bare & in text: enough of XML for what is written here. */
static bool well_formed(const char *at) {
    char open[32][16];
    int depth = 0, roots = 0;
    while (*at) {
        if (*at == '&' && at[1] != '#') return false;
        if (*at != '<') {
            if (*at == '>' || (!depth && *at != '\n')) return false;
            at++;
            continue;
        }
        bool closing = at[1] == '/';
        char name[16] = {0};
        int used = 0, quotes = 0;
        for (at += closing ? 2 : 1; *at && !strchr(" />\n", *at); at++)
            if (used < 15) name[used++] = *at;
        for (; *at && (*at != '>' || quotes % 2); at++) {
            quotes += *at == '"';
            if (*at == '<') return false;
        }
        if (!*at || quotes % 2) return false;
        bool alone = at[-1] == '/';
        at++;
        if (closing) {
            if (!depth || strcmp(open[--depth], name)) return false;
        } else if (!alone) {
            roots += depth == 0;
            if (depth == 32) return false;
            strcpy(open[depth++], name);
        }
    }
    return depth == 0 && roots == 1;
}
static bool draws(const lathe_ray_contour *c, lathe_arena *arena) {
    static const char *const lines[4] = {"<line class=\"for\"", "<line class=\"back\"", "<line class=\"up\"",
                                         "<line class=\"down\""};
    lathe_derivation tree;
    if (lathe__derive_alone(&tree, arena, c)) return false;
    lathe_drawing d = {.contour = c, .tree = &tree, .title = "a <b> & \"c\""};
    char *svg;
    size_t size;
    if (lathe__draw_contour(&svg, &size, &d)) return false;
    uint32_t counts[4] = {0}, in_out = 0;
    for (uint32_t i = 0; i < c->count; i++) {
        int t = c->types[i];
        counts[t == LATHE_FOR ? 0 : t == LATHE_BACK ? 1 : t == LATHE_UP_I || t == LATHE_UP_O ? 2 : 3]++;
        in_out += c->crossings[i].in_out;
    }
    bool ok = strlen(svg) == size && well_formed(svg);
    for (int k = 0; k < 4; k++) ok &= occurrences(svg, lines[k]) == counts[k];
    ok &= occurrences(svg, "class=\"in-out\"") == in_out && occurrences(svg, "class=\"out-in\"") == c->count - in_out;
    ok &= occurrences(svg, "class=\"leaf\"") == c->count - c->rays && occurrences(svg, "class=\"level-1\"") == c->rays;
    ok &= occurrences(svg, "class=\"root\"") == 1 && occurrences(svg, "class=\"ray\"") == c->rays;
    ok &= occurrences(svg, "class=\"internal\"") == tree.node_count - 1 - c->count;
    free(svg);
    return ok;
}
static void test_drawing(void) {
    static shape_loop loop;
    lathe_arena arena = {0};
    uint64_t seed = 12;
    int bad = 0;
    for (int i = 0; i < 300; i++) {
        lathe_ray_contour c;
        bad += !random_contour(&c, &loop, &arena, &seed, i & 15, 4u << (i % 5)) || !draws(&c, &arena);
        lathe__arena_reset(&arena);
    }
    CHECK_EQ(bad, 0);
    CHECK(!well_formed("<a><b></a>") && !well_formed("<a>&</a>") && well_formed("<a x=\"1\"><b/></a>"));
    lathe_ray_contour big = {.count = LATHE_DRAW_MAX_EDGES + 1};
    lathe_drawing d = {.contour = &big};
    char *svg;
    size_t size;
    CHECK_EQ(lathe__draw_contour(&svg, &size, &d), LATHE_ERR_LIMIT);
    lathe__arena_free(&arena);
}

/* Linear: the same number of steps for each crossing from 10^3 to 10^6 crossings. */
static void test_work(void) {
    lathe_arena arena = {0};
    double first_trees = 0, first_walk = 0;
    for (uint32_t n = 1000; n <= 1000000; n *= 10) {
        lathe_ray_contour a, b;
        lathe_derivation right, left;
        lathe_tiling tiling;
        uint64_t work = 0;
        CHECK_EQ(long_contour(&a, &arena, n, 0), LATHE_OK);
        CHECK_EQ(long_contour(&b, &arena, n, 1), LATHE_OK);
        CHECK(a.count > n / 2 && a.count < 2 * n);
        CHECK_EQ(lathe__derive_pair(&right, &left, &arena, &a, &b), LATHE_OK);
        CHECK_EQ(lathe__walk_derivations(&tiling, &work, &arena, &a, &right, &b, &left), LATHE_OK);
        CHECK(tiles(&tiling, &a, &right, &b, &left));
        double crossings = (double)a.count + b.count, trees = (double)(right.work + left.work) / crossings,
               walk = (double)work / crossings;
        if (n == 1000) first_trees = trees, first_walk = walk;
        CHECK(trees < 1.1 * first_trees && walk < 1.25 * first_walk);
        printf("%u crossings: %.2f steps each for the trees, %.2f to tile\n", a.count, trees, walk);
        lathe__arena_reset(&arena);
    }
    lathe__arena_free(&arena);
}

int main(void) {
    test_drawing();
    test_work();
    test_figure_6();
    test_mending();
    test_figure_10();
    test_figure_11();
    test_case_3();
    test_regions();
    return check_end();
}
