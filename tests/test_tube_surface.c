/* Tubes and their refinement as edits [M 5.2, appendix C]: after every ray and every slice the mesh equals one made
 * anew, vertices keep their numbers, and what changes is only what the new ray or slice meets. */
#include "centre.h"
#include "check.h"
#include "mesh.h"
#include "pixel_shapes.h"
#include "tube_surface.h"
#include <math.h>

enum { MOST_SLICES = 24, MOST_LEVELS = 6, VOXEL = 65536 };

static shape region;
static shape_loop loops[MOST_SLICES];
static lathe_tube_loop inputs[MOST_SLICES];

/* ---- triangles as sets ---- */

typedef struct triangles {
    uint32_t (*at)[3], count;
} triangles;
static int compare_triangles(const void *a, const void *b) {
    const uint32_t *p = a, *q = b;
    for (int k = 0; k < 3; k++)
        if (p[k] != q[k]) return p[k] < q[k] ? -1 : 1;
    return 0;
}
static void sort_triangles(triangles *t) {
    for (uint32_t i = 0; i < t->count; i++) {
        uint32_t *p = t->at[i];
        int least = p[0] <= p[1] && p[0] <= p[2] ? 0 : p[1] <= p[2] ? 1 : 2;
        uint32_t turned[3] = {p[least], p[(least + 1) % 3], p[(least + 2) % 3]};
        memcpy(p, turned, sizeof turned);
    }
    qsort(t->at, t->count, sizeof *t->at, compare_triangles);
}
static bool same_triangles(const triangles *a, const triangles *b) {
    return a->count == b->count && !memcmp(a->at, b->at, a->count * sizeof *a->at);
}
static uint32_t common(const triangles *a, const triangles *b) {
    uint32_t n = 0;
    for (uint32_t i = 0, j = 0; i < a->count && j < b->count;) {
        int order = compare_triangles(a->at[i], b->at[j]);
        n += order == 0;
        i += order <= 0;
        j += order >= 0;
    }
    return n;
}

/* ---- a mesh made anew ---- */

/* A contour at each number of rays, and per strip the level-1 edges of either side. */
typedef struct fresh_slice {
    lathe_ray_contour level[MOST_LEVELS];
    uint32_t *vertex; /* by index in the last level: the edited mesh's vertex */
} fresh_slice;
static fresh_slice fresh[MOST_SLICES];

static void descend(uint32_t *fine, const uint32_t *coarse, const lathe_ray_contour *f, const lathe_ray_contour *c,
                    lathe_arena *arena) {
    uint32_t *kept = LATHE_NEW(arena, uint32_t, f->count), found = 0;
    for (uint32_t i = 0; i < f->count; i++)
        if (f->crossings[i].ray % 2 == 0) kept[found++] = i;
    CHECK_EQ(found, c->count);
    for (uint32_t ray = 0; ray < c->rays; ray++) {
        uint32_t end = kept[coarse[ray] + 1 < c->count ? coarse[ray] + 1 : 0];
        fine[2 * ray] = kept[coarse[ray]];
        fine[2 * ray + 1] = end ? end - 1 : f->count - 1;
    }
}
static void add(triangles *t, uint32_t a, uint32_t b, uint32_t c) {
    uint32_t *p = t->at[t->count++];
    p[0] = a, p[1] = b, p[2] = c;
}
static double gap(lathe_point p, lathe_point q) { return hypot((double)p.x - q.x, (double)p.y - q.y); }

static void add_tiling(triangles *t, const lathe_tiling *tiling, const fresh_slice *lower, const fresh_slice *upper,
                       int level) {
    const lathe_ray_contour *a = &lower->level[level], *b = &upper->level[level];
    uint32_t i = tiling->start[0], j = tiling->start[1];
    for (uint32_t k = 0; k < tiling->count; k++) {
        uint8_t step = tiling->steps[k];
        uint32_t ni = (i + 1) % a->count, nj = (j + 1) % b->count, p = lower->vertex[i], np = lower->vertex[ni],
                 q = upper->vertex[j], nq = upper->vertex[nj];
        if (step == 1) add(t, p, np, q);
        if (step == 2) add(t, p, nq, q);
        if (step == 3 && gap(a->points[i], b->points[nj]) < gap(a->points[ni], b->points[j]))
            add(t, p, np, nq), add(t, p, nq, q);
        else if (step == 3)
            add(t, p, np, q), add(t, np, nq, q);
        if (step & 1) i = ni;
        if (step & 2) j = nj;
    }
}
static void add_strip(triangles *t, const fresh_slice *lower, const fresh_slice *upper, int levels,
                      lathe_arena *arena) {
    lathe_derivation d[2];
    lathe_tiling tiling;
    const fresh_slice *s[2] = {lower, upper};
    uint32_t *chain[2];
    CHECK(lathe__derive_pair(&d[0], &d[1], arena, &lower->level[0], &upper->level[0]) == LATHE_OK);
    for (int k = 0; k < 2; k++) {
        const lathe_ray_contour *c = &s[k]->level[0];
        chain[k] = LATHE_NEW(arena, uint32_t, c->rays);
        for (uint32_t i = 0; i < c->rays; i++) chain[k][i] = (d[k].start + d[k].main_edge[i]) % c->count;
        for (int l = 1; l < levels; l++) {
            uint32_t *fine = LATHE_NEW(arena, uint32_t, s[k]->level[l].rays);
            descend(fine, chain[k], &s[k]->level[l], &s[k]->level[l - 1], arena);
            chain[k] = fine;
        }
        CHECK(lathe__derive_chain(&d[k], arena, &s[k]->level[levels - 1], chain[k]) == LATHE_OK);
    }
    CHECK(lathe__walk_derivations(&tiling, NULL, arena, &lower->level[levels - 1], &d[0], &upper->level[levels - 1],
                                  &d[1]) == LATHE_OK);
    add_tiling(t, &tiling, lower, upper, levels - 1);
}
/* Of inputs[0 .. count) at first_rays << (levels - 1) rays, in the vertices of the edited tube. chosen_anew: strips by
 * lathe__tile_trees, whose level-1 edges are chosen at the last rays. */
static triangles make_anew(const lathe_tube_surface *tube, uint32_t count, uint32_t first_rays, int levels,
                           bool chosen_anew, lathe_arena *arena) {
    triangles t = {0};
    uint32_t edges = 0;
    for (uint32_t k = 0; k < count; k++) {
        const lathe_tube_loop *in = &inputs[k];
        for (int l = 0; l < levels; l++)
            CHECK(lathe__make_ray_contour(&fresh[k].level[l], arena, in->points, in->count, in->centre, first_rays << l,
                                          in->turn) == LATHE_OK);
        lathe_ray_contour edited;
        CHECK(lathe__edit_export(&edited, &fresh[k].vertex, arena, lathe__tube_contour(tube, k)) == LATHE_OK);
        if (!CHECK_EQ(edited.count, fresh[k].level[levels - 1].count)) return t;
        for (uint32_t i = 0; i < edited.count; i++)
            fresh[k].vertex[i] = lathe__tube_vertex(tube, k, fresh[k].vertex[i]);
        edges += edited.count;
    }
    t.at = lathe__arena_alloc(arena, 2 * (size_t)edges + 2, sizeof *t.at);
    for (uint32_t k = 0; k + 1 < count; k++) {
        lathe_tiling tiling;
        if (!chosen_anew)
            add_strip(&t, &fresh[k], &fresh[k + 1], levels, arena);
        else if (CHECK(lathe__tile_trees(&tiling, arena, &fresh[k].level[levels - 1],
                                         &fresh[k + 1].level[levels - 1]) == LATHE_OK))
            add_tiling(&t, &tiling, &fresh[k], &fresh[k + 1], levels - 1);
    }
    for (int end = 0; end < 2; end++) {
        uint32_t k = end ? count - 1 : 0, n = fresh[k].level[levels - 1].count,
                 apex = lathe__tube_vertex(tube, k, UINT32_MAX);
        for (uint32_t i = 0; i < n; i++) {
            uint32_t p = fresh[k].vertex[i], q = fresh[k].vertex[(i + 1) % n];
            add(&t, apex, end ? p : q, end ? q : p);
        }
    }
    sort_triangles(&t);
    return t;
}
static triangles triangles_of(const lathe_tube_surface *tube, lathe_arena *arena, bool star) {
    lathe_mesh mesh = {0};
    lathe_mesh_report report;
    triangles t = {0};
    if (!CHECK(lathe__tube_mesh(&mesh, tube) == LATHE_OK)) return t;
    CHECK(lathe__mesh_check(&report, &mesh, star) == LATHE_OK);
    CHECK_EQ(report.boundary_edges + report.nonmanifold_edges + report.misoriented_edges + report.nonmanifold_vertices +
                 report.bad_indices,
             0);
    CHECK_EQ(report.unused_vertices, 0);
    CHECK_EQ(report.euler, 2);
    if (star) CHECK_EQ(report.degenerate_triangles + report.duplicate_positions + report.self_intersections, 0);
    t.count = mesh.triangle_count;
    t.at = lathe__arena_alloc(arena, t.count, sizeof *t.at);
    memcpy(t.at, mesh.triangles, t.count * sizeof *t.at);
    lathe_mesh_free(&mesh);
    sort_triangles(&t);
    return t;
}

/* ---- shapes ---- */

/* A star-shaped loop that changes gently from slice to slice. */
static lathe_tube_loop star_loop(uint32_t store, double phase, double bumps, int32_t height) {
    shape_loop *l = &loops[store];
    l->count = 180;
    for (uint32_t i = 0; i < l->count; i++) {
        double a = 6.283185307179586 * i / l->count + 0.003,
               r = (10 + bumps * cos(5 * a + phase) + 1.5 * sin(2 * a - 2 * phase)) * VOXEL;
        l->points[i] = (lathe_point){(int32_t)lround(r * cos(a)), (int32_t)lround(r * sin(a))};
    }
    return (lathe_tube_loop){l->points, l->count, {0, 0}, height, 0};
}
static bool pixel_loop(uint32_t k, uint64_t *seed, int kind, int32_t height, lathe_arena *arena) {
    lathe_point centre;
    shape_make(&region, seed, kind);
    shape_trace(&loops[k], &region, seed, 1);
    if (lathe__loop_centre(&centre, arena, loops[k].points, loops[k].count)) return false;
    inputs[k] =
        (lathe_tube_loop){loops[k].points, loops[k].count, centre, height, (uint32_t)shape_below(seed, 3) * 777};
    return true;
}

/* ---- tests ---- */

static void check_equal_to_fresh(const lathe_tube_surface *tube, uint32_t count, uint32_t rays, int levels, bool star,
                                 lathe_arena *arena) {
    triangles edited = triangles_of(tube, arena, star), anew = make_anew(tube, count, rays, levels, false, arena);
    CHECK(same_triangles(&edited, &anew));
    if (!star) return;
    triangles chosen = make_anew(tube, count, rays, levels, true, arena);
    CHECK(same_triangles(&edited, &chosen));
}

/* New rays [5.2.1] and slices [5.2.2] in turn: 5 slices at 8 rays, 9 at 16, 17 at 32, as a hierarchy would grow. */
static void test_star(lathe_arena *arena) {
    enum { LAST = 17 };
    lathe_tube_surface *tube = NULL;
    for (uint32_t k = 0; k < 5; k++) inputs[k] = star_loop(k, 0.8 * k, 2, (int32_t)(8 * k) * VOXEL);
    if (!CHECK(lathe__tube_open(&tube, inputs, 5, 8) == LATHE_OK)) return;
    CHECK_EQ(lathe__tube_triangles(tube), 4 * 16 + 2 * 8);
    check_equal_to_fresh(tube, 5, 8, 1, true, arena);
    printf("| step | triangles after | kept | removed | added | rebuilt would be |\n| --- | --- | --- | --- | --- | "
           "--- |\n");
    uint32_t count = 5;
    for (int level = 1; level < 3; level++) {
        lathe_mesh before, after;
        CHECK(lathe__tube_mesh(&before, tube) == LATHE_OK);
        uint32_t triangles_before = lathe__tube_triangles(tube);
        lathe_tube_work w0 = lathe__tube_work_done(tube);
        CHECK(lathe__tube_double_rays(tube) == LATHE_OK);
        lathe_tube_work w1 = lathe__tube_work_done(tube);
        CHECK_EQ(w1.added - w1.removed + w0.removed - w0.added, lathe__tube_triangles(tube) - triangles_before);
        printf("| %u rays | %u | %u | %llu | %llu | %u |\n", 8u << level, lathe__tube_triangles(tube),
               (uint32_t)(triangles_before - (w1.removed - w0.removed)), (unsigned long long)(w1.removed - w0.removed),
               (unsigned long long)(w1.added - w0.added), lathe__tube_triangles(tube));
        check_equal_to_fresh(tube, count, 8, level + 1, true, arena);
        count = 2 * count - 1;
        w0 = lathe__tube_work_done(tube);
        for (uint32_t k = 1; k < count; k += 2) {
            uint32_t store = (uint32_t)level * 8 + k / 2; /* loops that are still in use stay */
            int32_t height = (int32_t)k * 32 / (int32_t)(count - 1) * VOXEL;
            lathe_tube_loop made = star_loop(store, 0.1 * height / VOXEL, 2, height);
            CHECK(lathe__tube_insert_slice(tube, &made) == LATHE_OK);
            lathe__arena_reset(arena);
        }
        w1 = lathe__tube_work_done(tube);
        printf("| %u slices | %u | %u | %llu | %llu | %u |\n", count, lathe__tube_triangles(tube),
               (uint32_t)(lathe__tube_triangles(tube) - (w1.added - w0.added)),
               (unsigned long long)(w1.removed - w0.removed), (unsigned long long)(w1.added - w0.added),
               lathe__tube_triangles(tube));
        CHECK_EQ(lathe__tube_slices(tube), count);
        for (uint32_t k = 0; k < count; k++) {
            const lathe_edit_contour *c = lathe__tube_contour(tube, k);
            inputs[k] = (lathe_tube_loop){c->loop, c->point_count, c->centre,
                                          (int32_t)k * 32 / (int32_t)(count - 1) * VOXEL, 0};
        }
        check_equal_to_fresh(tube, count, 8, level + 1, true, arena);
        CHECK(lathe__tube_mesh(&after, tube) == LATHE_OK);
        CHECK(before.vertex_count < after.vertex_count);
        CHECK(!memcmp(before.lattice, after.lattice, before.vertex_count * sizeof *before.lattice));
        lathe_mesh_free(&before);
        lathe_mesh_free(&after);
        lathe__arena_reset(arena);
    }
    CHECK_EQ(count, LAST);
    lathe_tube_work w0 = lathe__tube_work_done(tube);
    CHECK(lathe__tube_insert_ray(tube, 3, lathe__edit_middle_angle(lathe__tube_contour(tube, 0), 3)) == LATHE_OK);
    lathe_tube_work w1 = lathe__tube_work_done(tube);
    /* Two triangles of each strip and one of each fan become twice as many. */
    CHECK_EQ(w1.removed - w0.removed, 2 * (LAST - 1) + 2);
    CHECK_EQ(w1.added - w0.added, 4 * (LAST - 1) + 4);
    printf("| one ray more | %u | %u | %llu | %llu | %u |\n", lathe__tube_triangles(tube),
           (uint32_t)(lathe__tube_triangles(tube) - (w1.added - w0.added)),
           (unsigned long long)(w1.removed - w0.removed), (unsigned long long)(w1.added - w0.added),
           lathe__tube_triangles(tube));
    triangles_of(tube, arena, true);
    lathe__tube_close(&tube);
}

/* Loops with folds of every kind. */
static void test_folds(lathe_arena *arena) {
    uint64_t seed = 77, kept = 0, touched = 0;
    int done = 0;
    for (int round = 0; round < 400; round++) {
        lathe_tube_surface *tube = NULL;
        lathe__arena_reset(arena);
        uint32_t count = 2 + (uint32_t)shape_below(&seed, 3), made = 0;
        for (uint32_t k = 0; k < count + 1; k++)
            made += pixel_loop(k, &seed, shape_below(&seed, 4), (int32_t)k * VOXEL, arena);
        if (made != count + 1) continue;
        lathe_tube_loop all[8], late = inputs[1];
        memcpy(all, inputs, (count + 1) * sizeof *all);
        memmove(&inputs[1], &inputs[2], (count - 1) * sizeof *inputs);
        if (lathe__tube_open(&tube, inputs, count, 4)) continue;
        for (int level = 1; level < 4; level++) {
            CHECK(lathe__tube_double_rays(tube) == LATHE_OK);
            check_equal_to_fresh(tube, count, 4, level + 1, false, arena);
            if (level != 2) continue;
            CHECK(lathe__tube_insert_slice(tube, &late) == LATHE_OK);
            memcpy(inputs, all, sizeof *all * ++count);
            check_equal_to_fresh(tube, count, 4, level + 1, false, arena);
        }
        kept += lathe__tube_work_done(tube).kept;
        touched += lathe__tube_work_done(tube).removed;
        done++;
        lathe__tube_close(&tube);
    }
    CHECK(done >= 300);
    CHECK(kept > 0); /* folds that a new ray does not meet stay, though they are looked at */
    printf("%d stacks of random regions; of the triangles looked at for new rays and slices %.1f %% stayed\n", done,
           100.0 * (double)kept / (double)(kept + touched));
}

/* Appendix C: to four rays, r4 to r7 are added one after another. */
static void test_appendix_c(lathe_arena *arena) {
    static const lathe_point upper[] = {{9, -1}, {9, 3},  {4, 4},   {3, 9},   {-1, 9},  {-6, 7},
                                        {-4, 4}, {-8, 6}, {-9, -1}, {-5, -5}, {-1, -9}, {6, -7}};
    static const lathe_point lower[] = {{8, -1}, {7, 7}, {-1, 8}, {-7, 7}, {-8, -1}, {-7, -7}, {-1, -8}, {7, -7}};
    for (uint32_t k = 0; k < 2; k++) {
        loops[k].count = k ? 12 : 8;
        for (uint32_t i = 0; i < loops[k].count; i++) {
            lathe_point p = k ? upper[i] : lower[i];
            loops[k].points[i] = (lathe_point){p.x * VOXEL, p.y * VOXEL};
        }
        inputs[k] = (lathe_tube_loop){loops[k].points, loops[k].count, {0, 0}, (int32_t)k * 4 * VOXEL, 0};
    }
    lathe_tube_surface *tube = NULL;
    if (!CHECK(lathe__tube_open(&tube, inputs, 2, 4) == LATHE_OK)) return;
    for (uint32_t r = 4; r < 8; r++) {
        triangles before = triangles_of(tube, arena, false);
        uint32_t edges_before = lathe__tube_contour(tube, 0)->count + lathe__tube_contour(tube, 1)->count;
        lathe_tube_work w0 = lathe__tube_work_done(tube);
        CHECK(lathe__tube_insert_ray(tube, r - 4, (2 * (r - 4) + 1) * 8192) == LATHE_OK);
        triangles after = triangles_of(tube, arena, false);
        lathe_tube_work w1 = lathe__tube_work_done(tube);
        uint32_t refined = lathe__tube_contour(tube, 0)->refined_count + lathe__tube_contour(tube, 1)->refined_count;
        uint32_t edges = lathe__tube_contour(tube, 0)->count + lathe__tube_contour(tube, 1)->count;
        /* One triangle of the strip and one of a fan for each edge. */
        CHECK_EQ(after.count - before.count, 2 * (edges - edges_before));
        CHECK(w1.removed - w0.removed <= 2 * refined);
        CHECK_EQ(common(&before, &after), before.count - (w1.removed - w0.removed));
        CHECK_EQ(w1.vertices - w0.vertices, edges - edges_before);
    }
    check_equal_to_fresh(tube, 2, 4, 2, false, arena);
    /* A ray anywhere: behind the last, before the first. */
    CHECK(lathe__tube_insert_ray(tube, 7, 65000) == LATHE_OK);
    CHECK(lathe__tube_insert_ray(tube, 0, 5) == LATHE_OK);
    CHECK_EQ(lathe__tube_insert_ray(tube, 0, 6), LATHE_ERR_RANGE);
    triangles_of(tube, arena, false);
    lathe__tube_close(&tube);
}

static void test_errors(void) {
    lathe_tube_surface *tube = NULL;
    for (uint32_t k = 0; k < 3; k++) inputs[k] = star_loop(k, 0, 1, (int32_t)k * VOXEL);
    CHECK_EQ(lathe__tube_open(&tube, inputs, 1, 8), LATHE_ERR_RANGE);
    CHECK_EQ(lathe__tube_open(&tube, inputs, 3, 7), LATHE_ERR_RANGE);
    inputs[1].height = 0;
    CHECK_EQ(lathe__tube_open(&tube, inputs, 3, 8), LATHE_ERR_RANGE);
    inputs[1].height = VOXEL;
    inputs[1].centre = (lathe_point){90 * VOXEL, 0};
    CHECK_EQ(lathe__tube_open(&tube, inputs, 3, 8), LATHE_ERR_FORMAT);
    inputs[1].centre = (lathe_point){0, 0};
    if (!CHECK(lathe__tube_open(&tube, inputs, 3, 8) == LATHE_OK)) return;
    lathe_tube_loop slice = inputs[1];
    CHECK_EQ(lathe__tube_insert_slice(tube, &slice), LATHE_ERR_RANGE);
    slice.height = -1;
    CHECK_EQ(lathe__tube_insert_slice(tube, &slice), LATHE_ERR_RANGE);
    slice.height = 9 * VOXEL;
    CHECK_EQ(lathe__tube_insert_slice(tube, &slice), LATHE_ERR_RANGE);
    slice.height = 100;
    slice.centre.x = 90 * VOXEL;
    CHECK_EQ(lathe__tube_insert_slice(tube, &slice), LATHE_ERR_FORMAT);
    CHECK_EQ(lathe__tube_slices(tube), 3);
    slice.centre.x = 0;
    CHECK_EQ(lathe__tube_insert_slice(tube, &slice), LATHE_OK);
    CHECK_EQ(lathe__tube_slices(tube), 4);
    lathe__tube_close(&tube);
    CHECK(tube == NULL);
    lathe__tube_close(&tube);
}

int main(void) {
    lathe_arena arena = {0};
    test_errors();
    test_appendix_c(&arena);
    test_star(&arena);
    test_folds(&arena);
    lathe__arena_free(&arena);
    return check_end();
}
