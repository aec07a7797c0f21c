/* Refinement by edits [M 5.1] against contours and trees made anew: random regions over several doublings, single rays
 * in any order and place, the paper's figures 14 and 15, and what property 3 does and does not hold for. */
#include "centre.h"
#include "check.h"
#include "contour_edit.h"
#include "pixel_shapes.h"

enum { REGIONS = 6000, DOUBLINGS = 5, FIRST_RAYS = 4, ODD_REGIONS = 240, FINE = 512, ODD_RAYS = 40 };

static shape region;
static shape_loop loop;

/* ---- comparing ---- */

static bool same_crossing(const lathe_crossing *a, const lathe_crossing *b) {
    return a->segment == b->segment && a->ray == b->ray && a->in_out == b->in_out && a->outward == b->outward &&
           a->numerator == b->numerator && a->denominator == b->denominator;
}
static bool same_contour(const lathe_ray_contour *a, const lathe_ray_contour *b) {
    if (a->count != b->count || a->rays != b->rays || a->turn != b->turn) return false;
    for (uint32_t i = 0; i < a->count; i++)
        if (!same_crossing(&a->crossings[i], &b->crossings[i]) || a->types[i] != b->types[i] ||
            a->radius[i] != b->radius[i] || a->points[i].x != b->points[i].x || a->points[i].y != b->points[i].y)
            return false;
    return true;
}
static bool same_tree(const lathe_derivation *a, const lathe_derivation *b) {
    if (a->start != b->start || a->rays != b->rays || a->edge_count != b->edge_count || a->node_count != b->node_count)
        return false;
    for (uint32_t i = 0; i < a->node_count; i++) {
        const lathe_derivation_node *p = &a->nodes[i], *q = &b->nodes[i];
        if (p->symbol != q->symbol || p->edge != q->edge || p->first != q->first || p->count != q->count ||
            p->child != q->child || p->next != q->next)
            return false;
    }
    for (uint32_t i = 0; i < a->rays; i++)
        if (a->level1[i] != b->level1[i] || a->main_edge[i] != b->main_edge[i]) return false;
    return true;
}

/* Level-1 edges of a finer contour: kept[k] says which of its crossings the k-th of the coarser one is; a new ray
 * splits the pair (i, i + 1) into two. is_new: by ray of the finer contour. */
static void descend(uint32_t *fine, const uint32_t *coarse, const lathe_ray_contour *f, const uint32_t *kept,
                    uint32_t coarse_count, const bool *is_new) {
    for (uint32_t ray = 0, i = 0; ray < f->rays; ray++) {
        if (!is_new[ray]) {
            fine[ray] = kept[coarse[i++]];
            continue;
        }
        uint32_t before = coarse[i - 1], end = kept[before + 1 < coarse_count ? before + 1 : 0];
        fine[ray] = end ? end - 1 : f->count - 1;
    }
}

static bool equal_to_fresh(const lathe_edit_contour *c, lathe_edit_tree *t, const lathe_ray_contour *fresh,
                           const uint32_t *chain, lathe_arena *arena, uint64_t *alone) {
    lathe_ray_contour edited;
    lathe_derivation edited_tree, fresh_tree, records;
    if (!CHECK(lathe__edit_export(&edited, NULL, arena, c) == LATHE_OK) || !CHECK(same_contour(&edited, fresh)))
        return false;
    if (!CHECK(lathe__edit_tree_export(&edited_tree, arena, t, c) == LATHE_OK)) return false;
    if (!CHECK(lathe__derive_chain(&fresh_tree, arena, fresh, chain) == LATHE_OK)) return false;
    if (!CHECK(same_tree(&edited_tree, &fresh_tree))) return false;
    if (lathe__derive_alone(&records, arena, fresh)) return true;
    *alone += same_tree(&edited_tree, &records);
    return true;
}

/* ---- doublings ---- */

static lathe_edit_counts total;
static uint64_t compared, same_as_alone;

static void add_counts(const lathe_edit_counts *c) {
    for (int t = 0; t <= LATHE_DOWN_O; t++)
        for (int k = 0; k < LATHE_SPLIT_KINDS; k++) total.edges[t][k] += c->edges[t][k];
}

static lathe_status double_rays(lathe_edit_contour *c, lathe_edit_tree *t) {
    for (uint32_t ray = 0, n = c->ray_count; n > 0; n--) {
        uint32_t next = c->rays[ray].next;
        lathe_status status = lathe__edit_insert_ray(c, ray, lathe__edit_middle_angle(c, ray));
        if (!status) status = lathe__edit_tree_refine(t, c);
        if (status) return status;
        ray = next;
    }
    return LATHE_OK;
}

/* One region over all doublings. The first level-1 edges: those of the record chain, or chosen towards a round
 * neighbour. */
static bool refine_region(lathe_arena *arena, lathe_point centre, uint32_t turn, bool towards_circle) {
    lathe_edit_contour c;
    lathe_edit_tree t;
    lathe_ray_contour coarse, circle;
    lathe_derivation d, other;
    if (lathe__edit_contour_open(&c, loop.points, loop.count, centre, FIRST_RAYS, turn)) return false;
    CHECK(lathe__make_ray_contour(&coarse, arena, loop.points, loop.count, centre, FIRST_RAYS, turn) == LATHE_OK);
    lathe_point round[64];
    for (uint32_t i = 0; i < 64; i++) {
        lathe_point p = lathe__ray_direction(i * 1024 + 77, 65536);
        round[i] = (lathe_point){centre.x + p.x * 30, centre.y + p.y * 30};
    }
    CHECK(lathe__make_ray_contour(&circle, arena, round, 64, centre, FIRST_RAYS, 0) == LATHE_OK);
    lathe_status status = towards_circle ? lathe__derive_pair(&d, &other, arena, &coarse, &circle)
                                         : lathe__derive_alone(&d, arena, &coarse);
    bool ok = CHECK(status == LATHE_OK);
    uint32_t *chain = LATHE_NEW(arena, uint32_t, FIRST_RAYS);
    for (uint32_t i = 0; ok && i < FIRST_RAYS; i++) chain[i] = (d.start + d.main_edge[i]) % coarse.count;
    ok = ok && CHECK(lathe__edit_tree_open(&t, &c, chain) == LATHE_OK);
    for (int k = 0; ok && k < DOUBLINGS; k++) {
        lathe_ray_contour fine;
        uint32_t rays = FIRST_RAYS << (k + 1), *fine_chain = LATHE_NEW(arena, uint32_t, rays);
        ok = CHECK(double_rays(&c, &t) == LATHE_OK) &&
             CHECK(lathe__make_ray_contour(&fine, arena, loop.points, loop.count, centre, rays, turn) == LATHE_OK);
        if (!ok) break;
        uint32_t *kept = LATHE_NEW(arena, uint32_t, fine.count), found = 0;
        bool *is_new = LATHE_NEW(arena, bool, rays);
        for (uint32_t i = 0; i < fine.count; i++)
            if (fine.crossings[i].ray % 2 == 0) kept[found++] = i;
        for (uint32_t i = 0; i < rays; i++) is_new[i] = i % 2 == 1;
        if (!CHECK_EQ(found, coarse.count)) break;
        descend(fine_chain, chain, &fine, kept, coarse.count, is_new);
        ok = equal_to_fresh(&c, &t, &fine, fine_chain, arena, &same_as_alone);
        compared++;
        coarse = fine;
        chain = fine_chain;
    }
    add_counts(&c.counts);
    if (status == LATHE_OK) lathe__edit_tree_close(&t);
    lathe__edit_contour_close(&c);
    return ok;
}

static void test_doublings(lathe_arena *arena) {
    uint64_t seed = 20030811, done = 0, refused = 0;
    for (int i = 0; i < REGIONS; i++) {
        shape_make(&region, &seed, i);
        shape_trace(&loop, &region, &seed, i & 4);
        lathe__arena_reset(arena);
        lathe_point centre;
        if (!CHECK(lathe__loop_centre(&centre, arena, loop.points, loop.count) == LATHE_OK)) continue;
        if (refine_region(arena, centre, i & 8 ? 1 + (uint32_t)shape_below(&seed, 65535) : 0, i & 16))
            done++;
        else
            refused++;
    }
    CHECK(done >= 1000);
    CHECK_EQ(compared, done * DOUBLINGS);
    printf("%llu regions (%llu without a contour at %d rays), %llu doublings equal; all level-1 edges those of the "
           "record chain in %.1f %%\n",
           (unsigned long long)done, (unsigned long long)refused, FIRST_RAYS, (unsigned long long)compared,
           100.0 * (double)same_as_alone / (double)compared);
    static const char *const names[] = {"FOR", "BACK", "UP_I", "UP_O", "DOWN_I", "DOWN_O"};
    printf(
        "| edge | kept | as P2', P3', property 3 | with folds | simple of split |\n| --- | --- | --- | --- | --- |\n");
    for (int t = 0; t <= LATHE_DOWN_O; t++) {
        uint64_t *k = total.edges[t], split = k[LATHE_SPLIT_SIMPLE] + k[LATHE_SPLIT_GENERAL];
        printf("| %s | %llu | %llu | %llu | %.1f %% |\n", names[t], (unsigned long long)k[0], (unsigned long long)k[1],
               (unsigned long long)k[2], split ? 100.0 * (double)k[LATHE_SPLIT_SIMPLE] / (double)split : 100.0);
        CHECK(k[LATHE_SPLIT_SIMPLE] > 0);
    }
    CHECK_EQ(total.edges[LATHE_FOR][LATHE_SPLIT_NONE] + total.edges[LATHE_BACK][LATHE_SPLIT_NONE], 0);
    CHECK(total.edges[LATHE_UP_I][LATHE_SPLIT_GENERAL] > 0); /* property 3 does not always hold */
}

/* Slits narrower than a lattice unit: the ends of an edge are equally far out once rounded. As long as it is one edge
 * its type says which way it leads, as an excursion its ends say so: names change, and with them the division of
 * folds. */
static void test_slits(lathe_arena *arena) {
    uint32_t changed = 0;
    for (int i = 0; i < 400; i++) {
        int32_t low = 20000 + i % 20 * 2900, high = 90000 + i / 20 * 1000;
        loop.count = 8;
        memcpy(loop.points,
               (lathe_point[]){{100000, -low},
                               {70000, high},
                               {100001, -low},
                               {105000, 10},
                               {80000, 120000},
                               {-100000, 100000},
                               {-100000, -100000},
                               {1000, -100000}},
               8 * sizeof *loop.points);
        lathe__arena_reset(arena);
        lathe_ray_contour c;
        CHECK(lathe__make_ray_contour(&c, arena, loop.points, loop.count, (lathe_point){0, 0}, FIRST_RAYS, 0) ==
              LATHE_OK);
        for (uint32_t e = 0; e < c.count; e++)
            changed += c.types[e] == LATHE_UP_O && c.radius[e] == c.radius[e + 1 < c.count ? e + 1 : 0];
        CHECK(refine_region(arena, (lathe_point){0, 0}, 0, i & 1));
    }
    CHECK(changed >= 20);
}

/* The tip of a spike on a new ray, which its flanks just miss: both crossings lie in one vertex. Outwards, and a
 * notch. */
static void test_spikes(lathe_arena *arena) {
    static const lathe_point spike[] = {{12, -1}, {13, 6}, {10, 10}, {8, 5}, {3, 12}, {-10, -1}, {-1, -10}};
    static const lathe_point notch[] = {{12, -1}, {8, 5}, {10, 10}, {13, 6}, {20, 21}, {3, 12}, {-10, -1}, {-1, -10}};
    for (int i = 0; i < 2; i++) {
        lathe_ray_contour c;
        loop.count = i ? 8 : 7;
        for (uint32_t k = 0; k < loop.count; k++) {
            lathe_point p = i ? notch[k] : spike[k];
            loop.points[k] = (lathe_point){p.x * 65536, p.y * 65536};
        }
        lathe__arena_reset(arena);
        CHECK(lathe__make_ray_contour(&c, arena, loop.points, loop.count, (lathe_point){0, 0}, 8, 0) == LATHE_OK);
        uint32_t same = 0;
        for (uint32_t e = 0; e < c.count; e++) {
            uint32_t n = e + 1 < c.count ? e + 1 : 0;
            same += c.points[e].x == c.points[n].x && c.points[e].y == c.points[n].y;
        }
        CHECK_EQ(same, 1);
        CHECK(refine_region(arena, (lathe_point){0, 0}, 0, i));
    }
}

/* ---- single rays, anywhere, in any order: against a cast at FINE rays of which the others are left out ---- */

static bool outward(const lathe_point centre, const lathe_crossing *a, const lathe_crossing *b, uint32_t ray) {
    double r[2];
    const lathe_crossing *x[2] = {a, b};
    lathe_point d = lathe__ray_direction(ray, FINE);
    for (int k = 0; k < 2; k++) {
        lathe_point p = loop.points[x[k]->segment], q = loop.points[(x[k]->segment + 1) % loop.count];
        double t = (double)x[k]->numerator / (double)x[k]->denominator;
        r[k] = (p.x + ((double)q.x - p.x) * t - centre.x) * d.x + (p.y + ((double)q.y - p.y) * t - centre.y) * d.y;
    }
    return r[1] > r[0];
}
/* keep: by fine ray. */
static bool thin_out(lathe_ray_contour *out, lathe_arena *arena, const lathe_ray_contour *all, const bool *keep) {
    uint32_t rank[FINE], rays = 0;
    for (uint32_t i = 0; i < FINE; i++) rank[i] = keep[i] ? rays++ : 0;
    *out = (lathe_ray_contour){.centre = all->centre, .rays = rays, .turn = all->turn};
    out->crossings = LATHE_NEW(arena, lathe_crossing, all->count);
    out->points = LATHE_NEW(arena, lathe_point, all->count);
    out->radius = LATHE_NEW(arena, int64_t, all->count);
    out->types = LATHE_NEW(arena, uint8_t, all->count);
    uint32_t *fine_ray = LATHE_NEW(arena, uint32_t, all->count);
    for (uint32_t i = 0; i < all->count; i++) {
        uint32_t ray = all->crossings[i].ray;
        if (!keep[ray]) continue;
        out->crossings[out->count] = all->crossings[i];
        out->crossings[out->count].ray = rank[ray];
        out->points[out->count] = all->points[i];
        out->radius[out->count] = all->radius[i];
        fine_ray[out->count++] = ray;
    }
    for (uint32_t i = 0; i < out->count; i++) {
        uint32_t n = i + 1 < out->count ? i + 1 : 0;
        out->crossings[i].outward =
            fine_ray[i] == fine_ray[n] && outward(all->centre, &out->crossings[i], &out->crossings[n], fine_ray[i]);
    }
    return lathe__classify_edges(out->types, out->crossings, out->count, rays) == LATHE_OK;
}

static bool refine_anywhere(lathe_arena *arena, uint64_t *seed) {
    lathe_point centre;
    lathe_edit_contour c;
    lathe_edit_tree t;
    lathe_ray_contour all, coarse;
    lathe_derivation d;
    if (lathe__loop_centre(&centre, arena, loop.points, loop.count)) return false;
    if (lathe__edit_contour_open(&c, loop.points, loop.count, centre, FIRST_RAYS, 0)) return false;
    bool keep[FINE] = {0}, ok = true;
    uint32_t number[FINE] = {0}, chain[FINE], next_chain[FINE];
    for (uint32_t i = 0; i < FIRST_RAYS; i++) keep[i * (FINE / FIRST_RAYS)] = true, number[i * (FINE / FIRST_RAYS)] = i;
    ok = CHECK(lathe__make_ray_contour(&all, arena, loop.points, loop.count, centre, FINE, 0) == LATHE_OK);
    ok =
        ok && CHECK(thin_out(&coarse, arena, &all, keep)) && CHECK(lathe__derive_alone(&d, arena, &coarse) == LATHE_OK);
    for (uint32_t i = 0; ok && i < FIRST_RAYS; i++) chain[i] = (d.start + d.main_edge[i]) % coarse.count;
    bool has_tree = ok && CHECK(lathe__edit_tree_open(&t, &c, chain) == LATHE_OK);
    for (int k = 0; has_tree && ok && k < ODD_RAYS; k++) {
        uint32_t at = (uint32_t)shape_below(seed, FINE), before = at;
        if (keep[at]) continue;
        while (!keep[before]) before--;
        ok = CHECK(lathe__edit_insert_ray(&c, number[before], at * (65536 / FINE)) == LATHE_OK) &&
             CHECK(lathe__edit_tree_refine(&t, &c) == LATHE_OK);
        number[at] = c.ray_count - 1;
        lathe_ray_contour fine;
        bool was[FINE], is_new[FINE] = {0};
        memcpy(was, keep, sizeof was);
        keep[at] = true;
        ok = ok && CHECK(thin_out(&fine, arena, &all, keep));
        if (!ok) break;
        uint32_t *kept = LATHE_NEW(arena, uint32_t, fine.count), found = 0, rank = 0;
        for (uint32_t i = 0; i < at; i++) rank += keep[i];
        is_new[rank] = true;
        for (uint32_t i = 0; i < fine.count; i++)
            if (fine.crossings[i].ray != rank) kept[found++] = i;
        descend(next_chain, chain, &fine, kept, coarse.count, is_new);
        uint64_t ignored = 0;
        ok = CHECK_EQ(found, coarse.count) && equal_to_fresh(&c, &t, &fine, next_chain, arena, &ignored);
        memcpy(chain, next_chain, sizeof chain);
        coarse = fine;
    }
    if (has_tree) lathe__edit_tree_close(&t);
    lathe__edit_contour_close(&c);
    return ok;
}
static void test_anywhere(lathe_arena *arena) {
    uint64_t seed = 4711, done = 0;
    for (int i = 0; i < ODD_REGIONS; i++) {
        shape_make(&region, &seed, i);
        shape_trace(&loop, &region, &seed, 1);
        lathe__arena_reset(arena);
        done += refine_anywhere(arena, &seed);
    }
    CHECK(done >= ODD_REGIONS / 2);
}

/* ---- figures 14 and 15, and what may go wrong ---- */

static void take(const lathe_point *points, uint32_t count) {
    loop.count = count;
    for (uint32_t i = 0; i < count; i++) loop.points[i] = (lathe_point){points[i].x * 65536, points[i].y * 65536};
}
/* The types of the edges from ray 0's first crossing on, after one ray at 45 degrees, as letters. */
static void types_after(char *text, size_t size) {
    lathe_arena arena = {0};
    lathe_edit_contour c;
    lathe_ray_contour r;
    static const char *const letters[] = {"f", "b", "ui ", "uo ", "di ", "do "};
    size_t used = 0;
    text[0] = 0;
    if (CHECK(lathe__edit_contour_open(&c, loop.points, loop.count, (lathe_point){0, 0}, 4, 0) == LATHE_OK)) {
        CHECK(lathe__edit_insert_ray(&c, 0, 8192) == LATHE_OK);
        CHECK(lathe__edit_export(&r, NULL, &arena, &c) == LATHE_OK);
        for (uint32_t i = 0; i < r.count; i++)
            used += (size_t)snprintf(text + used, size - used, "%s", letters[r.types[i]]);
        lathe__edit_contour_close(&c);
    }
    lathe__arena_free(&arena);
}
static void test_figures(void) {
    char text[256];
    /* 14 (b): a FOR edge into two. */
    take((lathe_point[]){{10, -1}, {10, 2}, {-1, 10}, {-10, -1}, {1, -10}}, 5);
    types_after(text, sizeof text);
    CHECK(!strcmp(text, "fffff"));
    /* 14 (c), mirrored: a FOR edge into two with a fold between them, on the new ray at 45 degrees. */
    take((lathe_point[]){{10, -1}, {20, 17}, {17, 20}, {8, 6}, {6, 8}, {10, 16}, {-1, 10}, {-10, -1}, {1, -10}}, 9);
    types_after(text, sizeof text);
    CHECK(!strcmp(text, "fdi do ffff") || !strcmp(text, "fdi uo ffff") || !strcmp(text, "fdi ui ffff"));
    /* 15 (c): UP_O into FOR, UP_O, BACK. The walk leaves ray 0, turns round beyond the new ray and comes back further
     * out. */
    take(
        (lathe_point[]){
            {5, -1}, {5, 1}, {3, 6}, {6, 9}, {20, 1}, {20, -1}, {30, -1}, {30, 5}, {1, 40}, {-10, -1}, {1, -10}},
        11);
    types_after(text, sizeof text);
    CHECK(!strcmp(text, "fuo bui fffff") || !strcmp(text, "fuo bui ffff"));
}
static void test_errors(void) {
    lathe_edit_contour c;
    take((lathe_point[]){{10, -1}, {10, 2}, {-1, 10}, {-10, -1}, {1, -10}}, 5);
    CHECK_EQ(lathe__edit_contour_open(&c, loop.points, 2, (lathe_point){0, 0}, 4, 0), LATHE_ERR_RANGE);
    CHECK_EQ(lathe__edit_contour_open(&c, loop.points, 5, (lathe_point){0, 0}, 5, 0), LATHE_ERR_RANGE);
    CHECK_EQ(lathe__edit_contour_open(&c, loop.points, 5, (lathe_point){65536 * 90, 0}, 4, 0), LATHE_ERR_FORMAT);
    CHECK_EQ(lathe__edit_contour_open(&c, loop.points, 5, loop.points[2], 4, 0), LATHE_ERR_FORMAT);
    take((lathe_point[]){{10, 0}, {0, 10}, {-10, 0}}, 3); /* its third side passes through the centre */
    CHECK_EQ(lathe__edit_contour_open(&c, loop.points, 3, (lathe_point){0, 0}, 4, 0), LATHE_ERR_FORMAT);
    take((lathe_point[]){{10, -1}, {10, 2}, {-1, 10}, {-10, -1}, {1, -10}}, 5);
    if (!CHECK(lathe__edit_contour_open(&c, loop.points, 5, (lathe_point){0, 0}, 4, 0) == LATHE_OK)) return;
    CHECK_EQ(lathe__edit_insert_ray(&c, 4, 100), LATHE_ERR_RANGE);
    CHECK_EQ(lathe__edit_insert_ray(&c, 0, 0), LATHE_ERR_RANGE);
    CHECK_EQ(lathe__edit_insert_ray(&c, 0, 16384), LATHE_ERR_RANGE);
    CHECK_EQ(lathe__edit_insert_ray(&c, 3, 65536), LATHE_ERR_RANGE);
    CHECK_EQ(lathe__edit_insert_ray(&c, 3, 65535), LATHE_OK);
    CHECK_EQ(lathe__edit_insert_ray(&c, 3, 65535), LATHE_ERR_RANGE); /* there is one now */
    CHECK_EQ(lathe__edit_middle_angle(&c, 4), 0);
    CHECK_EQ(lathe__edit_middle_angle(&c, 0), 8192);
    lathe__edit_contour_close(&c);
}

int main(void) {
    lathe_arena arena = {0};
    test_figures();
    test_errors();
    test_doublings(&arena);
    test_slits(&arena);
    test_spikes(&arena);
    test_anywhere(&arena);
    lathe__arena_free(&arena);
    return check_end();
}
