/* The lifted overlay: hand-made outlines whose cells, links and triangles can be counted on paper. */
#include "overlay.h"
#include <stdlib.h>
#include <string.h>
#include "check.h"
#include "level.h"
#include "mesh.h"
#include "mesh_volume.h"
#include "pixel_shapes.h"

static lathe_arena arena;

/* ---- outlines by hand ---- */

enum { MOST_POINTS = 64, MOST_LOOPS = 8 };
typedef struct drawing {
    lathe_point points[MOST_POINTS];
    lathe_loop loops[MOST_LOOPS];
    lathe_outline outline;
} drawing;

static void add_loop(drawing *d, const int (*corner)[2], uint32_t count, bool hole) {
    lathe_outline *o = &d->outline;
    o->points = d->points;
    o->loops = d->loops;
    d->loops[o->loop_count++] = (lathe_loop){.first = o->point_count, .count = count, .hole = hole};
    for (uint32_t i = 0; i < count; i++) {
        uint32_t k = hole ? count - 1 - i : i;
        /* Sixteenths of a pixel. */
        d->points[o->point_count++] = (lathe_point){corner[k][0] * 4096, corner[k][1] * 4096};
    }
}

/* Corners (x0, y0) .. (x1, y1), counter-clockwise; a hole is turned round. */
static void add_square(drawing *d, int x0, int y0, int x1, int y1, bool hole) {
    const int corner[4][2] = {{x0, y0}, {x1, y0}, {x1, y1}, {x0, y1}};
    add_loop(d, corner, 4, hole);
}

static bool closed(const lathe_mesh_report *r) {
    return !r->boundary_edges && !r->nonmanifold_edges && !r->misoriented_edges && !r->nonmanifold_vertices && !r->degenerate_triangles &&
           !r->duplicate_positions && !r->unused_vertices && !r->bad_indices;
}

/* What the slab between two outlines must be, and the surface that air below and above closes. */
typedef struct expected {
    const char *name;
    uint64_t crossings, strips, other_cells, single_cells, links[4], components;
    int64_t euler;
} expected;

/* The middle slab alone: its counts. */
static lathe_overlay_counts slab_counts(const lathe_outline *low, const lathe_outline *high, uint32_t *triangles) {
    lathe_mesh_builder builder = {0};
    lathe_overlay_counts counts = {0};
    lathe_slab slab = {.outline = {low, high}, .height = {0, LATHE_LATTICE_ONE}, .base = 0, .cap = LATHE_LATTICE_ONE / 2};
    uint32_t points = low->point_count + high->point_count;
    if (lathe__builder_reserve(&builder, points, 0)) abort();
    builder.mesh.vertex_count = points;
    CHECK(lathe__overlay_slab(&builder, &arena, &slab, &counts) == LATHE_OK);
    *triangles = builder.mesh.triangle_count;
    lathe_mesh_free(&builder.mesh);
    lathe__arena_reset(&arena);
    return counts;
}

/* Closes the stack of both outlines and checks everything that must hold of it. Returns its volume in cubic pixels. */
static double check_stack(const lathe_outline *outlines, uint32_t count, lathe_mesh_report *r, const char *name) {
    lathe_mesh mesh = {0};
    lathe_surface_counts counts = {0};
    static const int32_t heights[4] = {0, 1, 2, 3};
    memset(r, 0, sizeof *r);
    if (!CHECK(lathe__stack_outlines(&mesh, &arena, outlines, heights, count, false, &counts) == LATHE_OK)) return 0;
    CHECK(lathe__mesh_check(r, &mesh, true) == LATHE_OK);
    if (!(CHECK(closed(r)) & CHECK_EQ(r->self_intersections, 0))) fprintf(stderr, "  in %s\n", name);
    double volume = mesh_volume(&mesh);
    lathe_mesh_free(&mesh);
    return volume;
}

static double check_pair(const drawing *low, const drawing *high, const expected *e) {
    uint32_t triangles;
    lathe_overlay_counts c = slab_counts(&low->outline, &high->outline, &triangles);
    int ok = CHECK_EQ(c.crossings, e->crossings) & CHECK_EQ(c.strips, e->strips) & CHECK_EQ(c.other_cells, e->other_cells) &
             CHECK_EQ(c.single_cells, e->single_cells);
    for (int i = 0; i < 4; i++) ok &= CHECK_EQ(c.links[i], e->links[i]);
    lathe_outline pair[2] = {low->outline, high->outline};
    lathe_mesh_report r;
    double volume = check_stack(pair, 2, &r, e->name);
    ok &= CHECK_EQ(r.components, e->components) & CHECK_EQ(r.euler, e->euler) & CHECK(volume > 0);
    if (!ok) fprintf(stderr, "  in %s\n", e->name);
    return volume;
}

/* A strip between chains of m and n edges has m + n triangles, less two where they meet; each crossing opens an upright triangle
 * on an edge of either outline. */
static void check_triangles(const drawing *low, const drawing *high, uint32_t expected_triangles) {
    uint32_t triangles;
    slab_counts(&low->outline, &high->outline, &triangles);
    CHECK_EQ(triangles, expected_triangles);
}

static void nested_squares(void) {
    drawing a = {0}, b = {0};
    add_square(&a, 16, 16, 80, 80, false);
    add_square(&b, 33, 33, 63, 63, false);
    double volume = check_pair(&a, &b, &(expected){.name = "nested", .strips = 1, .links = {0, 1, 0, 0}, .components = 1, .euler = 2});
    check_triangles(&a, &b, 8);
    CHECK(volume > (16.0 + 3.5) / 2);
    /* The other way up the ring has the lower outline within the upper one. */
    check_pair(&b, &a, &(expected){.name = "nested, upside down", .strips = 1, .links = {0, 1, 0, 0}, .components = 1, .euler = 2});
    check_triangles(&b, &a, 8);
}

static void crossing_squares(void) {
    drawing a = {0}, b = {0}, plus = {0}, tall = {0};
    add_square(&a, 16, 16, 64, 64, false);
    add_square(&b, 33, 33, 83, 83, false);
    /* Two L-shaped cells, each between three corners of one outline and one of the other: both strips. */
    check_pair(&a, &b, &(expected){.name = "corner to corner", .crossings = 2, .strips = 2, .links = {0, 1, 0, 0}, .components = 1, .euler = 2});
    /* With its two meetings an L has 6 corners: 4 triangles; four crossed edges have one upright each. */
    check_triangles(&a, &b, 12);
    add_square(&plus, 16, 32, 80, 64, false);
    add_square(&tall, 33, 17, 63, 79, false);
    /* A plus: four arms, each between a chain of three edges of one outline and a single edge of the other: not strips. */
    check_pair(&plus, &tall, &(expected){.name = "plus", .crossings = 4, .other_cells = 4, .links = {0, 1, 0, 0}, .components = 1, .euler = 2});
}

static void far_squares(void) {
    drawing a = {0}, b = {0};
    add_square(&a, 16, 16, 32, 32, false);
    add_square(&b, 65, 65, 91, 91, false);
    /* Air between: each is closed for itself. A square has one diagonal, split at mid-height: 4 triangles. */
    check_pair(&a, &b, &(expected){.name = "disjoint", .single_cells = 2, .links = {2, 0, 0, 0}, .components = 2, .euler = 4});
    check_triangles(&a, &b, 8);
}

static void one_above_two(void) {
    drawing a = {0}, b = {0}, c = {0};
    add_square(&a, 16, 16, 112, 48, false);
    add_square(&b, 23, 23, 41, 41, false);
    add_square(&b, 83, 23, 103, 41, false);
    double volume = check_pair(&a, &b, &(expected){.name = "one above two", .other_cells = 1, .links = {0, 0, 1, 0}, .components = 1, .euler = 2});
    CHECK(volume > 6);
    /* Two bars over two crossing bars: one block of all four. */
    add_square(&c, 20, 9, 36, 55, false);
    add_square(&c, 76, 9, 90, 55, false);
    drawing d = {0};
    add_square(&d, 9, 15, 101, 27, false);
    add_square(&d, 9, 33, 101, 47, false);
    uint32_t triangles;
    lathe_overlay_counts n = slab_counts(&c.outline, &d.outline, &triangles);
    CHECK_EQ(n.crossings, 16);
    CHECK_EQ(n.links[3], 1);
    lathe_outline pair[2] = {c.outline, d.outline};
    lathe_mesh_report r;
    check_stack(pair, 2, &r, "many to many");
    CHECK_EQ(r.components, 1);
    CHECK_EQ(r.euler, 0);   /* a frame: one handle */
}

static void holes(void) {
    drawing ring = {0}, plug = {0}, disc = {0}, ring2 = {0};
    add_square(&ring, 16, 16, 112, 112, false);
    add_square(&ring, 40, 40, 88, 88, true);
    add_square(&plug, 51, 51, 77, 77, false);
    /* A plug above the hole of a ring touches nothing: the ring is closed, and so is the plug. */
    check_pair(&ring, &plug, &(expected){.name = "plug above a hole", .single_cells = 2, .links = {2, 0, 0, 0}, .components = 2, .euler = 2});
    add_square(&disc, 11, 11, 119, 119, false);
    /* A disc above a ring: the outer loops form a tube, the hole is closed by the disc: a cup, still a ball. */
    check_pair(&ring, &disc, &(expected){.name = "disc above a ring", .strips = 1, .single_cells = 1, .links = {1, 1, 0, 0}, .components = 1, .euler = 2});
    add_square(&ring2, 11, 11, 119, 119, false);
    add_square(&ring2, 45, 45, 83, 83, true);
    /* Ring above ring: two tubes. */
    check_pair(&ring, &ring2, &(expected){.name = "ring above ring", .strips = 2, .links = {0, 2, 0, 0}, .components = 1, .euler = 0});
    check_triangles(&ring, &ring2, 16);
}

/* Outlines that lie on each other, edge on edge, as hostile or hand-made input can have them: closed in indices all the same. */
static void equal_squares(void) {
    drawing a = {0}, b = {0};
    add_square(&a, 16, 16, 48, 48, false);
    add_square(&b, 16, 16, 48, 48, false);
    lathe_outline pair[2] = {a.outline, b.outline};
    lathe_mesh mesh = {0};
    lathe_surface_counts counts = {0};
    static const int32_t heights[2] = {0, 1};
    lathe_mesh_report r;
    if (!CHECK(lathe__stack_outlines(&mesh, &arena, pair, heights, 2, false, &counts) == LATHE_OK)) return;
    CHECK(lathe__mesh_check(&r, &mesh, false) == LATHE_OK);
    CHECK_EQ(r.boundary_edges, 0);
    CHECK_EQ(r.bad_indices, 0);
    lathe_mesh_free(&mesh);
    /* Moved as refinement moves vertices, they are an ordinary pair. */
    for (uint32_t i = 0; i < 4; i++) a.points[i] = lathe__jitter(a.points[i], 0), b.points[i] = lathe__jitter(b.points[i], 1);
    double volume = check_stack(pair, 2, &r, "equal but for the jitter");
    CHECK_EQ(r.components, 1);
    CHECK_EQ(r.euler, 2);
    CHECK(volume > 4 && volume < 8);
}

static void air(void) {
    static const lathe_outline nothing = {0};
    drawing a = {0};
    uint32_t triangles;
    lathe_mesh_report r;
    lathe_overlay_counts c = slab_counts(&nothing, &nothing, &triangles);
    CHECK_EQ(triangles, 0);
    CHECK_EQ(c.single_cells, 0);
    const int corner[3][2] = {{16, 16}, {80, 17}, {33, 79}};
    add_loop(&a, corner, 3, false);
    /* A single triangle rises to a middle: three triangles below, three above. */
    slab_counts(&nothing, &a.outline, &triangles);
    CHECK_EQ(triangles, 3);
    double volume = check_stack(&a.outline, 1, &r, "one triangle");
    CHECK_EQ(r.components, 1);
    CHECK_EQ(r.euler, 2);
    /* Two pyramids of height 1/2 on an area of (64 * 63 - 1 * 17) / 2 / 256. */
    double area = (64.0 * 63 - 1.0 * 17) / 2 / 256;
    CHECK(volume > area / 3 * 0.999 && volume < area / 3 * 1.001);
    lathe_outline gap[3] = {a.outline, nothing, a.outline};
    check_stack(gap, 3, &r, "a slice of air between");
    CHECK_EQ(r.components, 2);
}

/* ---- single-valued: seen from above, a side cell's triangles neither vanish nor overlap ---- */

static double area2(const lathe_mesh *m, const uint32_t *t) {
    const int32_t *a = m->lattice[t[0]], *b = m->lattice[t[1]], *c = m->lattice[t[2]];
    return (double)(b[0] - a[0]) * (c[1] - a[1]) - (double)(b[1] - a[1]) * (c[0] - a[0]);
}

/* Of one slab between two outlines: facing up where the lower region has no upper one above it, down in the other case; upright
 * triangles have no area seen from above. The areas facing up and down are those of the region's differences. */
static void check_single_valued(const lathe_outline *low, const lathe_outline *high, const char *name) {
    lathe_mesh_builder builder = {0};
    lathe_overlay_counts counts = {0};
    lathe_slab slab = {.outline = {low, high}, .height = {0, LATHE_LATTICE_ONE}, .base = 0, .cap = LATHE_LATTICE_ONE / 2};
    if (lathe__builder_reserve(&builder, low->point_count + high->point_count, 0)) abort();
    for (int s = 0; s < 2; s++)
        for (uint32_t i = 0; i < slab.outline[s]->point_count; i++) {
            int32_t *v = builder.mesh.lattice[builder.mesh.vertex_count++];
            v[0] = slab.outline[s]->points[i].x, v[1] = slab.outline[s]->points[i].y, v[2] = slab.height[s];
        }
    CHECK(lathe__overlay_slab(&builder, &arena, &slab, &counts) == LATHE_OK);
    double sum = 0, region[2] = {0, 0};
    uint32_t flat = 0;
    for (uint32_t t = 0; t < builder.mesh.triangle_count; t++) {
        const uint32_t *v = builder.mesh.triangles[t];
        sum += area2(&builder.mesh, v);
        int32_t z0 = builder.mesh.lattice[v[0]][2];
        flat += builder.mesh.lattice[v[1]][2] == z0 && builder.mesh.lattice[v[2]][2] == z0 && (z0 == 0 || z0 == LATHE_LATTICE_ONE);
    }
    for (int s = 0; s < 2; s++)
        for (uint32_t l = 0; l < slab.outline[s]->loop_count; l++) {
            const lathe_loop *loop = &slab.outline[s]->loops[l];
            for (uint32_t i = 0; i < loop->count; i++) {
                lathe_point p = slab.outline[s]->points[loop->first + i], q = slab.outline[s]->points[loop->first + (i + 1) % loop->count];
                region[s] += (double)p.x * q.y - (double)p.y * q.x;
            }
        }
    /* The projections of all triangles add up to what the lower region has more of. Uprights through rounded crossings and middles
     * lie off their plane by under a lattice unit. */
    double slack = 16.0 * LATHE_LATTICE_ONE * (builder.mesh.triangle_count + 1.0);
    int ok = CHECK(sum - (region[0] - region[1]) < slack && sum - (region[0] - region[1]) > -slack) & CHECK_EQ(flat, 0);
    if (!ok) fprintf(stderr, "  in %s: %g, %g\n", name, sum, region[0] - region[1]);
    lathe_mesh_free(&builder.mesh);
    lathe__arena_reset(&arena);
}

static void copy_loop(drawing *d, const lathe_point *p, uint32_t n) {
    for (uint32_t i = 0; i < n; i++) d->points[i] = p[i];
    d->loops[0] = (lathe_loop){.count = n};
    d->outline = (lathe_outline){.points = d->points, .loops = d->loops, .point_count = n, .loop_count = 1};
}

/* Triangles and quadrilaterals anywhere: crossings of every kind. */
static void random_polygons(void) {
    uint64_t seed = 77;
    for (int i = 0; i < 3000; i++) {
        drawing d[2] = {{.points = {{0, 0}}}, {.points = {{0, 0}}}};
        for (int s = 0; s < 2; s++) {
            lathe_point p[12];
            uint32_t n = 3 + (uint32_t)shape_below(&seed, 9);
            /* A star around its centre is simple. */
            int cx = 100 + shape_below(&seed, 40), cy = 100 + shape_below(&seed, 40);
            for (uint32_t k = 0; k < n; k++) {
                lathe_point r = lathe__ray_direction((k * 65536 + 32768) / n, 65536);
                int64_t length = 4 + shape_below(&seed, 80);
                p[k] = lathe__jitter((lathe_point){(cx * 4096 + (int32_t)(r.x * length / 4)) & ~1, (cy * 4096 + (int32_t)(r.y * length / 4)) & ~1},
                                     (uint32_t)s);
            }
            copy_loop(&d[s], p, n);
        }
        char name[40];
        snprintf(name, sizeof name, "random polygons %d", i);
        lathe_outline pair[2] = {d[0].outline, d[1].outline};
        lathe_mesh_report r;
        double volume = check_stack(pair, 2, &r, name);
        CHECK(volume > 0 && r.components >= 1 && r.components <= 2 && r.euler <= 2 * (int64_t)r.components);
        check_single_valued(&d[0].outline, &d[1].outline, name);
        if (check_failed > 20) return;
    }
}

/* ---- a column of X-shaped section that turns from slice to slice ---- */

static void draw_x(drawing *d, uint32_t turn, uint32_t jitter) {
    lathe_point p[12];
    for (uint32_t k = 0; k < 12; k++) {
        /* Arms 6 pixels long and 2 wide: two corners at their end, one between them and the next arm. */
        static const int32_t angle[3] = {-1680, 1680, 8192}, length[3] = {24912, 24912, 5793};   /* 65536 to a turn; 1/4096 pixel */
        lathe_point r = lathe__ray_direction((turn + k / 3 * 16384 + (uint32_t)(angle[k % 3] + 65536)) & 65535, 65536);
        p[k] = lathe__jitter((lathe_point){(10 * 65536 + r.x * (length[k % 3] / 4) / 1024) & ~1, (10 * 65536 + r.y * (length[k % 3] / 4) / 1024) & ~1},
                             jitter);
    }
    copy_loop(d, p, 12);
}

static void twisted_column(void) {
    /* Turned by an eighth: eight crossings, no loop is alone, and it is a column. */
    for (uint32_t turn = 512; turn <= 16384; turn += 512) {
        drawing d[4];
        lathe_outline stack[4];
        lathe_mesh_report r;
        uint32_t triangles;
        for (uint32_t i = 0; i < 4; i++) {
            draw_x(&d[i], turn * i, i);
            stack[i] = d[i].outline;
        }
        lathe_overlay_counts c = slab_counts(&stack[0], &stack[1], &triangles);
        CHECK_EQ(c.links[1], 1);
        CHECK_EQ(c.links[0] + c.links[2] + c.links[3], 0);
        if (turn >= 3584 && turn <= 12800) CHECK_EQ(c.crossings, 8);
        check_stack(stack, 4, &r, "twisted column");
        CHECK_EQ(r.components, 1);
        CHECK_EQ(r.euler, 2);
        check_single_valued(&stack[0], &stack[1], "twisted column");
    }
}

int main(void) {
    nested_squares();
    crossing_squares();
    far_squares();
    one_above_two();
    holes();
    equal_squares();
    air();
    random_polygons();
    twisted_column();
    lathe__arena_free(&arena);
    return check_end();
}
