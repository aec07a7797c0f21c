/* Reconstruction from contour sets: shapes of the kinds that figures 6 to 17 of Park and Kim show, and thousands of random stacks
 * through every combination of methods. What a solid must be is said beside each: a slab's solid has the homotopy type of both
 * sections' regions joined over their overlap, so Euler characteristics of regions add and those of overlaps are taken off. */
#include "reconstruct.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "check.h"
#include "contour_set.h"
#include "mesh.h"

/* ---- sets by hand ---- */

enum { MOST_POINTS = 4096, MOST_POLYGONS = 128, MOST_SECTIONS = 16 };
typedef struct drawing {
    double points[MOST_POINTS][2];
    lathe_raw_polygon polygons[MOST_POLYGONS];
    lathe_raw_section sections[MOST_SECTIONS];
    uint32_t point_count, polygon_count, section_count;
} drawing;

static drawing d;

static void begin(void) { d.point_count = d.polygon_count = d.section_count = 0; }

static void section(double z) { d.sections[d.section_count++] = (lathe_raw_section){z, d.polygon_count, 0}; }

static void polygon(void) {
    d.polygons[d.polygon_count++] = (lathe_raw_polygon){d.point_count, 0};
    d.sections[d.section_count - 1].count++;
}

static void point(double x, double y) {
    d.points[d.point_count][0] = x;
    d.points[d.point_count++][1] = y;
    d.polygons[d.polygon_count - 1].count++;
}

static void circle(double x, double y, double r, int n) {
    polygon();
    for (int i = 0; i < n; i++) point(x + r * cos(6.283185307179586 * i / n), y + r * sin(6.283185307179586 * i / n));
}

static void box(double x0, double y0, double x1, double y1) {
    polygon();
    point(x0, y0), point(x1, y0), point(x1, y1), point(x0, y1);
}

/* A sector of a ring, from angle a to b (degrees). */
static void arc(double x, double y, double r0, double r1, double a, double b, int n) {
    polygon();
    for (int side = 0; side < 2; side++)
        for (int i = 0; i <= n; i++) {
            double t = (side ? b + (a - b) * i / n : a + (b - a) * i / n) * 3.14159265358979 / 180, r = side ? r0 : r1;
            point(x + r * cos(t), y + r * sin(t));
        }
}

static bool build(lathe_contour_set *set) {
    lathe_raw_set raw = {(const double(*)[2])d.points, d.polygons, d.sections, d.point_count, d.polygon_count, d.section_count};
    lathe_error err = {{0}};
    bool ok = CHECK(lathe__contour_set_build(set, NULL, &raw, &err) == LATHE_OK);
    if (!ok) fprintf(stderr, "  %s\n", err.text);
    return ok;
}

/* ---- guarantees ---- */

static int closed(const lathe_mesh_report *r) {
    return !r->boundary_edges && !r->nonmanifold_edges && !r->misoriented_edges && !r->nonmanifold_vertices && !r->degenerate_triangles &&
           !r->duplicate_positions && !r->unused_vertices && !r->bad_indices && !r->self_intersections;
}

static double volume_of(const lathe_mesh *m, const lathe_transform *t) {
    double six = 0;
    for (uint32_t i = 0; i < m->triangle_count; i++) {
        double p[3][3];
        for (int k = 0; k < 3; k++)
            for (int a = 0; a < 3; a++) p[k][a] = m->lattice[m->triangles[i][k]][a] * t->m[a][a] + t->m[a][3];
        six += p[0][0] * (p[1][1] * p[2][2] - p[1][2] * p[2][1]) - p[0][1] * (p[1][0] * p[2][2] - p[1][2] * p[2][0]) +
               p[0][2] * (p[1][0] * p[2][1] - p[1][1] * p[2][0]);
    }
    return six / 6;
}

static lathe_reconstruct_report sum;   /* over everything that was built */

static bool reconstruct(const lathe_contour_set *set, const lathe_reconstruct_options *o, const char *what, lathe_mesh_report *r,
                        lathe_reconstruct_report *report, double *volume) {
    lathe_mesh mesh = {0};
    lathe_error err = {{0}};
    memset(r, 0, sizeof *r);
    memset(report, 0, sizeof *report);
    if (!CHECK(lathe__reconstruct(&mesh, report, set, o, &err) == LATHE_OK)) {
        fprintf(stderr, "  in %s: %s\n", what, err.text);
        return false;
    }
    CHECK(lathe__mesh_check(r, &mesh, true) == LATHE_OK);
    int ok = CHECK(closed(r));
    *volume = volume_of(&mesh, &set->transform);
    ok &= CHECK(*volume > 0);
    if (!ok)
        fprintf(stderr, "  in %s: boundary %llu edges %llu/%llu fans %llu degenerate %llu twice %llu unused %llu crossings %llu\n", what,
                (unsigned long long)r->boundary_edges, (unsigned long long)r->nonmanifold_edges, (unsigned long long)r->misoriented_edges,
                (unsigned long long)r->nonmanifold_vertices, (unsigned long long)r->degenerate_triangles,
                (unsigned long long)r->duplicate_positions, (unsigned long long)r->unused_vertices, (unsigned long long)r->self_intersections);
    sum.slabs += report->slabs, sum.overlaid += report->overlaid, sum.separated += report->separated, sum.moved += report->moved;
    sum.crossing += report->crossing, sum.torn += report->torn, sum.flat += report->flat;
    sum.blocks.tubes += report->blocks.tubes, sum.blocks.branched += report->blocks.branched, sum.blocks.closed += report->blocks.closed;
    sum.blocks.overlaid += report->blocks.overlaid, sum.blocks.refused += report->blocks.refused, sum.blocks.crossed += report->blocks.crossed;
    sum.blocks.treeless += report->blocks.treeless, sum.blocks.copied += report->blocks.copied;
    lathe_mesh_free(&mesh);
    return ok;
}

static const char *const tilings[] = {"trees", "toroidal", "christiansen", "shortest"};

/* Every combination of methods: components and Euler characteristic must be as said. */
typedef struct expected {
    const char *name;
    int64_t components, euler;
    uint64_t links[4];         /* by regions */
    bool branches;             /* paper's branching must do at least one block without falling back */
} expected;

static void check_drawing(const expected *e) {
    lathe_contour_set set;
    if (!build(&set)) return;
    for (int i = 0; i < 32; i++) {
        lathe_reconstruct_options o;
        lathe_mesh_report r;
        lathe_reconstruct_report report;
        double volume;
        char what[120];
        lathe_reconstruct_defaults(&o);
        o.slab.tiling = (lathe_tiling_method)(i & 3);
        o.slab.branching = i & 4 ? LATHE_BRANCHING_PAPER : LATHE_BRANCHING_OVERLAY;
        o.slab.links = i & 8 ? LATHE_LINKS_PAPER : LATHE_LINKS_REGIONS;
        o.slab.mid_slices = i & 16;
        snprintf(what, sizeof what, "%s: %s, %s%s%s", e->name, tilings[i & 3], i & 4 ? "paper's branching" : "overlay", i & 8 ? ", paper's links" : "",
                 i & 16 ? ", mid-slices" : "");
        if (!reconstruct(&set, &o, what, &r, &report, &volume)) continue;
        if (i & 8) continue;   /* a threshold may link otherwise */
        int ok = CHECK_EQ(r.components, e->components) & CHECK_EQ(r.euler, e->euler);
        for (int k = 0; k < 4; k++) ok &= CHECK_EQ(report.blocks.links[k], e->links[k]);
        if (e->branches && (i & 4)) ok &= CHECK(report.blocks.branched > 0);
        ok &= CHECK_EQ(report.separated, 0);
        if (!ok) fprintf(stderr, "  in %s: %llu branched, %llu refused, %llu crossed, %u overlaid\n", what, (unsigned long long)report.blocks.branched,
                         (unsigned long long)report.blocks.refused, (unsigned long long)report.blocks.crossed, report.overlaid);
    }
    lathe__contour_set_free(&set);
}

/* Links count the closings of the first and of the last section, too. */

static void figure_6(void) {   /* one-to-one, polygons of different shape */
    begin();
    section(0);
    circle(0, 0, 10, 24);
    section(8);
    box(-7, -8, 8, 7);
    check_drawing(&(expected){"figure 6", 1, 2, {2, 1, 0, 0}, false});
}

static void figures_7_to_11(void) {
    begin();   /* one to two */
    section(0);
    circle(0, 0, 12, 32);
    section(6);
    circle(-7, 0, 4, 16);
    circle(7, 0, 4, 16);
    check_drawing(&(expected){"one to two", 1, 2, {3, 0, 1, 0}, true});
    begin();   /* figure 10: one to four, no island; wide */
    section(0);
    circle(0, 0, 14, 40);
    section(14);
    for (int i = 0; i < 4; i++) circle(8 * cos(i * 1.5708 + 0.3), 8 * sin(i * 1.5708 + 0.3), 3.5, 14);
    check_drawing(&(expected){"figure 10", 1, 2, {5, 0, 1, 0}, true});
    begin();   /* figure 11: an island amid six; turned over */
    section(12);
    circle(0, 0, 16, 48);
    section(0);
    for (int i = 0; i < 6; i++) circle(10.5 * cos(i * 1.0472), 10.5 * sin(i * 1.0472), 3, 12);
    circle(0.4, 0.3, 3, 12);
    check_drawing(&(expected){"figure 11", 1, 2, {8, 0, 1, 0}, true});
    begin();   /* figures 8 and 9: the middle one of three in a row occurs twice in the exterior polygon */
    section(0);
    box(-20, -6, 20, 6);
    section(5);
    circle(-14, 0, 4, 16);
    circle(0, 0, 4, 16);
    circle(14, 0, 4, 16);
    check_drawing(&(expected){"figure 9", 1, 2, {4, 0, 1, 0}, true});
}

static void many_to_many(void) {
    begin();   /* two bars across two bars: a frame */
    section(0);
    box(-10, -8, 10, -4);
    box(-10.5, 4, 10.5, 8);
    section(6);
    box(-8, -10, -4, 10);
    box(4, -10.5, 8, 10.5);
    /* As a solid by regions: 2 + 2 - 4 overlaps = 0. The paper's mid-slice polygon fills the frame: a ball. So with links by regions
     * the block is the overlay's. */
    lathe_contour_set set;
    if (!build(&set)) return;
    for (int i = 0; i < 16; i++) {
        lathe_reconstruct_options o;
        lathe_mesh_report r;
        lathe_reconstruct_report report;
        double volume;
        lathe_reconstruct_defaults(&o);
        o.slab.tiling = (lathe_tiling_method)(i & 3);
        o.slab.branching = i & 4 ? LATHE_BRANCHING_PAPER : LATHE_BRANCHING_OVERLAY;
        o.slab.links = i & 8 ? LATHE_LINKS_PAPER : LATHE_LINKS_REGIONS;
        if (i & 8) o.slab.threshold = 0.1;
        if (!reconstruct(&set, &o, "many to many", &r, &report, &volume)) continue;
        CHECK_EQ(r.components, 1);
        CHECK_EQ(report.blocks.links[LATHE_LINK_MANY_TO_MANY], 1);
        CHECK_EQ(r.euler, (i & 12) == 12 ? 2 : 0);
        CHECK_EQ(report.blocks.branched, (i & 12) == 12);
        CHECK_EQ(report.blocks.handles, !(i & 8));
    }
    lathe__contour_set_free(&set);
}

static void figure_16(void) {   /* holes perpendicular to the slices */
    begin();
    section(0);
    circle(0, 0, 12, 32);
    circle(0, 0, 5, 16);
    section(9);
    circle(1, 0, 11, 28);
    circle(0, 1, 4, 20);
    check_drawing(&(expected){"figure 16 a", 1, 0, {2, 2, 0, 0}, false});   /* a tube: as a torus */
    begin();
    section(0);
    circle(0, 0, 12, 32);
    circle(-5, 0, 3, 16);
    circle(5, 0, 3, 16);
    section(9);
    circle(1, 0, 12, 28);
    circle(-5, 0.5, 3, 14);
    circle(5, 0.5, 3, 14);
    check_drawing(&(expected){"figure 16 b", 1, -2, {2, 3, 0, 0}, false});   /* two holes: region 1 - 2 = -1, surface -2 */
    begin();   /* outer one-to-two, hole one-to-one: chi = (1 - 1) + (0 + 1) - (0 + 1) = 0 */
    section(0);
    box(-16, -8, 16, 8);
    circle(-8, 0, 3, 16);
    section(9);
    circle(-8, 0, 6.5, 24);
    circle(-8, 0, 2.5, 12);
    circle(8, 0, 5, 20);
    check_drawing(&(expected){"figure 16 c", 1, 0, {3, 1, 1, 0}, true});
    begin();   /* the hole parts in two: region 0 - overlap; outer one-to-one, hole one-to-two: 0 + (-1) - (-1): overlap has two holes */
    section(0);
    circle(0, 0, 16, 40);
    circle(-5, 0, 3, 14);
    circle(5, 0, 3, 14);
    section(8);
    circle(0, 0, 15, 36);
    box(-10, -4, 10, 4);
    /* Overlap: the section with the large hole, chi 0: -1 + 0 - 0 = -1. Bottom is closed around two holes, top around one. */
    check_drawing(&(expected){"a hole that parts", 1, -2, {2, 1, 1, 0}, true});
}

static void figure_17(void) {   /* holes through the side */
    begin();   /* a: a ring over a C. chi = 0 + 1 - 1 = 0 */
    section(0);
    arc(0, 0, 6, 10, 30, 330, 20);
    section(5);
    circle(0, 0, 10.2, 32);
    circle(0, 0, 5.8, 24);
    check_drawing(&(expected){"figure 17 a", 1, 0, {2, 0, 1, 0}, false});
    begin();   /* window all through: ring, C, ring. 0 + 1 + 0 - 1 - 1 = -1 */
    section(0);
    circle(0, 0, 10, 32);
    circle(0, 0, 6, 24);
    section(5);
    arc(0, 0, 6.1, 9.9, 30, 330, 20);
    section(10);
    circle(0, 0, 10, 32);
    circle(0, 0, 6, 24);
    check_drawing(&(expected){"a window", 1, -2, {2, 0, 2, 0}, false});
    begin();   /* b: two holes open to the side (an E) below a plate with two holes. chi = 1 + (-1) - 1 = -1 */
    section(0);
    polygon();
    point(0, 0), point(20, 0), point(20, 5), point(6, 5), point(6, 9), point(20, 9), point(20, 14), point(6, 14), point(6, 18), point(20, 18);
    point(20, 23), point(0, 23);
    section(5);
    box(-0.5, -0.5, 20.5, 23.5);
    box(6.5, 5.3, 16, 8.7);
    box(6.5, 14.3, 16, 17.7);
    check_drawing(&(expected){"figure 17 b", 1, -2, {2, 0, 1, 0}, false});
    begin();   /* c: a ring over two arcs. chi = 0 + 2 - 2 = 0 */
    section(0);
    arc(0, 0, 6, 10, 20, 160, 16);
    arc(0, 0, 6, 10, 200, 340, 16);
    section(5);
    circle(0, 0, 10.2, 32);
    circle(0, 0, 5.8, 24);
    check_drawing(&(expected){"figure 17 c", 1, 0, {3, 0, 0, 1}, false});
    begin();   /* any number: eight arcs between two rings. 0 + 8 + 0 - 8 - 8 = -8 */
    section(0);
    circle(0, 0, 10, 64);
    circle(0, 0, 6, 48);
    section(5);
    for (int i = 0; i < 8; i++) arc(0, 0, 6.1, 9.9, i * 45 + 5, i * 45 + 40, 6);
    section(10);
    circle(0, 0, 10, 64);
    circle(0, 0, 6, 48);
    check_drawing(&(expected){"eight windows", 1, -16, {2, 0, 0, 2}, false});
}

/* ---- ends, copies, volumes known from geometry ---- */

static void prism(void) {
    begin();
    for (int i = 0; i < 5; i++) {   /* the same square five times: outlines on each other */
        section(i * 2.5);
        box(0, 0, 10, 10);
    }
    lathe_contour_set set;
    if (!build(&set)) return;
    for (int i = 0; i < 8; i++) {
        lathe_reconstruct_options o;
        lathe_mesh_report r;
        lathe_reconstruct_report report;
        double volume;
        lathe_reconstruct_defaults(&o);
        o.slab.tiling = (lathe_tiling_method)(i & 3);
        o.slab.links = i & 4 ? LATHE_LINKS_PAPER : LATHE_LINKS_REGIONS;
        if (!reconstruct(&set, &o, "prism", &r, &report, &volume)) continue;
        CHECK_EQ(r.components, 1);
        CHECK_EQ(r.euler, 2);
        CHECK_EQ(report.separated, 0);
        CHECK_EQ(report.blocks.tubes, 4);
        /* Flat ends, as the paper closes them: a prism, but for the move of points by under half of 1/2^20 of its side. */
        CHECK(fabs(volume - 1000) < 0.01);
        CHECK(report.farthest <= 30);
        CHECK_EQ(r.euler, 2);
        CHECK_EQ(report.triangles, 4 * 8 + 2 * 2);
    }
    lathe__contour_set_free(&set);
}

/* ---- random stacks ---- */

static uint32_t seed = 1;
static uint32_t next_random(void) {
    seed = seed * 1664525u + 1013904223u;
    return seed >> 8;
}

static void set_pixel(lathe_mask *m, int u, int v, int w) {
    lathe__mask_slice(m, w)[(size_t)v * (size_t)m->row_words + (size_t)(u >> 6)] |= (uint64_t)1 << (u & 63);
}

/* Discs, rings and noise: branching, nesting, pixels that touch at corners. */
static void random_mask(lathe_mask *m, int size, int slices, int kind) {
    int32_t dims[3] = {size + 2, size + 2, slices}, origin[3] = {0, 0, 0};
    if (lathe__mask_new(m, dims, origin)) abort();
    for (int w = 0; w < slices; w++) {
        int discs = 1 + (int)(next_random() % 4), x[4], y[4], r1[4], r0[4], density = 20 + (int)(next_random() % 70);
        for (int k = 0; k < discs; k++) {
            x[k] = (int)(next_random() % (uint32_t)size), y[k] = (int)(next_random() % (uint32_t)size);
            r1[k] = 1 + (int)(next_random() % (uint32_t)(size / 2)), r0[k] = next_random() % 2 ? r1[k] / 2 : -1;
        }
        for (int v = 0; v < size; v++)
            for (int u = 0; u < size; u++) {
                bool in = false;
                for (int k = 0; k < discs; k++) {
                    int q = (u - x[k]) * (u - x[k]) + (v - y[k]) * (v - y[k]);
                    in |= q <= r1[k] * r1[k] && (r0[k] < 0 || q >= r0[k] * r0[k]);
                }
                if (kind == 0) in = (int)(next_random() % 100) < density;
                if (kind == 2 && next_random() % 12 == 0) in = !in;
                if (in) set_pixel(m, u + 1, v + 1, w);
            }
        set_pixel(m, 1 + (int)(next_random() % (uint32_t)size), 1 + (int)(next_random() % (uint32_t)size), w);
    }
}

static void check_mask(const lathe_mask *m, int methods, const char *name, bool exact) {
    static const lathe_transform unit = {.m = {{1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, 0}}};
    lathe_contour_set set;
    if (!CHECK(lathe__contour_set_of_mask(&set, m, &unit, 28) == LATHE_OK)) return;
    lathe_reconstruct_options o;
    lathe_mesh_report r;
    lathe_reconstruct_report report;
    double volume;
    char what[200];
    lathe_reconstruct_defaults(&o);
    o.slab.tiling = (lathe_tiling_method)(methods & 3);
    o.slab.branching = methods & 4 ? LATHE_BRANCHING_PAPER : LATHE_BRANCHING_OVERLAY;
    o.slab.links = methods & 8 ? LATHE_LINKS_PAPER : LATHE_LINKS_REGIONS;
    o.slab.mid_slices = methods & 16;
    o.cap = methods & 32 ? 0 : LATHE_LATTICE_ONE / 2;
    o.lattice = true;
    snprintf(what, sizeof what, "%s, methods %d", name, methods);
    if (reconstruct(&set, &o, what, &r, &report, &volume) && exact && !(methods & 12)) {
        /* Linked by regions, with overlays for joints: the topology of the voxels. */
        lathe_topology t;
        CHECK(lathe__mask_topology(&t, m, NULL) == LATHE_OK);
        int ok = CHECK_EQ(r.components, t.components + t.cavities) & CHECK_EQ(r.euler, 2 * t.euler);
        if (!ok) fprintf(stderr, "  in %s\n", what);
    }
    lathe__contour_set_free(&set);
}

static void random_masks(int count) {
    for (int i = 0; i < count; i++) {
        lathe_mask m;
        char name[80];
        int size = 3 + (int)(next_random() % 14), slices = 2 + (int)(next_random() % 2), kind = (int)(next_random() % 3);
        random_mask(&m, size, slices, kind);
        snprintf(name, sizeof name, "random mask %d: size %d, kind %d", i, size, kind);
        check_mask(&m, i & 63, name, true);
        lathe__mask_free(&m);
        if (check_failed > 20) return;
    }
}

/* Stars here and there, of few long edges; the same again in the next section now and then. */
static void random_polygons(int count) {
    for (int i = 0; i < count; i++) {
        begin();
        int sections = 2 + (int)(next_random() % 2);
        for (int s = 0; s < sections; s++) {
            section(s * (1 + next_random() % 20));
            int cells = 1 + (int)(next_random() % 3);
            for (int k = 0; k < cells * cells; k++) {
                if (next_random() % 4 == 0 && k) continue;
                double x = 24.0 / cells * (k % cells), y = 24.0 / cells * (k / cells), room = 11.0 / cells, turn = next_random() % 100 * 0.06;
                int n = 3 + (int)(next_random() % 9), rings = 1 + (next_random() % 3 == 0);
                for (int ring = 0; ring < rings; ring++) {
                    polygon();
                    for (int p = 0; p < n; p++) {
                        double t = turn + 6.28318530718 * p / n, r = room * (ring ? 0.15 : 0.4 + (next_random() % 60) * 0.01);
                        if (n == 3) r = ring ? room * 0.1 : room * 0.9;
                        point(x + r * cos(t), y + r * sin(t));
                    }
                }
            }
            if (s && next_random() % 6 == 0) {   /* a copy of the section below */
                lathe_raw_section *below = &d.sections[s - 1];
                d.polygon_count = d.sections[s].first;
                d.sections[s].count = below->count;
                for (uint32_t k = 0; k < below->count; k++) d.polygons[d.polygon_count++] = d.polygons[below->first + k];
            }
            if (d.sections[s].z <= (s ? d.sections[s - 1].z : -1)) d.sections[s].z = d.sections[s - 1].z + 1;
        }
        lathe_contour_set set;
        lathe_raw_set raw = {(const double(*)[2])d.points, d.polygons, d.sections, d.point_count, d.polygon_count, d.section_count};
        if (lathe__contour_set_build(&set, NULL, &raw, NULL)) continue;   /* a star may cross its hole */
        lathe_reconstruct_options o;
        lathe_mesh_report r;
        lathe_reconstruct_report report;
        double volume;
        char what[60];
        lathe_reconstruct_defaults(&o);
        o.slab.tiling = (lathe_tiling_method)(i & 3);
        o.slab.branching = i & 4 ? LATHE_BRANCHING_PAPER : LATHE_BRANCHING_OVERLAY;
        o.slab.links = i & 8 ? LATHE_LINKS_PAPER : LATHE_LINKS_REGIONS;
        o.slab.mid_slices = i & 16;
        snprintf(what, sizeof what, "random polygons %d", i);
        reconstruct(&set, &o, what, &r, &report, &volume);
        lathe__contour_set_free(&set);
        if (check_failed > 20) return;
    }
}

static void print_sum(const char *what) {
    fprintf(stderr, "%s: %u slabs: %llu tubes (%llu treeless), %llu branched (%llu copied), %llu closed, %llu overlaid (%llu refused, %llu crossed); "
            "whole slabs overlaid %u (crossing %u, torn %u, flat %u), separated %u; sections moved %u\n", what, sum.slabs,
            (unsigned long long)sum.blocks.tubes, (unsigned long long)sum.blocks.treeless, (unsigned long long)sum.blocks.branched,
            (unsigned long long)sum.blocks.copied, (unsigned long long)sum.blocks.closed, (unsigned long long)sum.blocks.overlaid,
            (unsigned long long)sum.blocks.refused, (unsigned long long)sum.blocks.crossed, sum.overlaid, sum.crossing, sum.torn, sum.flat, sum.separated,
            sum.moved);
    memset(&sum, 0, sizeof sum);
}

/* test_reconstruct [STACKS [SEED]]: how many random stacks, from which seed. */
int main(int argc, char **argv) {
    int stacks = argc > 1 ? atoi(argv[1]) : 3000;
    if (argc > 2) seed = (uint32_t)atoi(argv[2]);
    figure_6();
    figures_7_to_11();
    many_to_many();
    figure_16();
    figure_17();
    prism();
    print_sum("figures");
    random_polygons(stacks / 3);
    print_sum("random polygons");
    random_masks(stacks * 2 / 3);
    print_sum("random masks");
    return check_end();
}
