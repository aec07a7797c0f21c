/* Tubes side by side and within each other, straight, oblique, parting, ending: whatever fits together in every slice makes a closed
 * surface; what goes on alone is made of strips. The overlay's does not cross itself, that of plain tubes not if its joints do not. */
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "check.h"
#include "mesh.h"
#include "mesh_volume.h"
#include "mesh_shading.h"
#include "radius_trace.h"

enum { SIZE = 120, MOST_ROWS = 40 };
static const double FULL_TURN = 6.283185307179586;
static lathe_arena arena, mesh_arena[2];

static uint32_t seed = 11;
static double uniform(double low, double high) {
    seed = seed * 1664525u + 1013904223u;
    return low + (high - low) * (seed >> 8) / (1 << 24);
}
static int32_t whole(int32_t low, int32_t high) { return (int32_t)floor(uniform(low, high + 1)); }

static lathe_radii new_radii(int32_t slices, uint32_t level_count) {
    lathe_radii radii = {.slices = slices, .width = SIZE, .height = SIZE, .level_count = level_count};
    radii.tubes = LATHE_NEW(&arena, lathe_radius_tube, LATHE_TUBES_MOST);
    if (!radii.tubes) abort();
    memset(radii.tubes, 0, LATHE_TUBES_MOST * sizeof *radii.tubes);
    return radii;
}

typedef struct shape {
    double x, y, dx, dy;       /* centre, and how it moves from slice to slice */
    double radius, long_side;  /* ellipse: half axes are radius and radius * long_side */
    double bumps, grow;        /* share of the radius; from slice to slice */
} shape;

static void add_tube(lathe_radii *radii, int32_t first, int32_t rows, uint32_t rays, bool hole, int32_t turn, const shape *s) {
    lathe_radius_tube *t = &radii->tubes[radii->count++];
    t->first = first;
    t->hole = hole;
    t->map = (lathe_radius_map){.slices = rows, .rays = rays, .level_count = lathe__tube_passes(rows, radii->level_count), .tube = true, .turn = turn,
                                .apex = {4, 4}, .farthest = 2 * SIZE * LATHE_RADIUS_ONE};
    t->passes = t->map.level_count;
    t->map.radius = LATHE_NEW(&arena, int32_t, (size_t)rows * rays);
    t->map.centre = lathe__arena_alloc(&arena, (size_t)rows, sizeof *t->map.centre);
    if (!t->map.radius || !t->map.centre) abort();
    for (int32_t row = 0; row < rows; row++) {
        t->map.centre[row][0] = (int32_t)lround(2 * (s->x + row * s->dx));
        t->map.centre[row][1] = (int32_t)lround(2 * (s->y + row * s->dy));
        for (uint32_t i = 0; i < rays; i++) {
            double a = FULL_TURN * i / rays, r = s->radius * s->long_side / hypot(cos(a), s->long_side * sin(a));
            r *= (1 + s->bumps * sin(5 * a + row * 0.3)) * (1 + s->grow * row);
            t->map.radius[(size_t)row * rays + i] = (int32_t)lround(fmax(r, 0.25) * LATHE_RADIUS_ONE);
        }
    }
}

static bool fits(lathe_radii *radii, uint32_t level) {
    int32_t *slices;
    uint32_t count, stride;
    bool good = true;
    if (lathe__radii_slices(&slices, &count, &stride, &mesh_arena[0], radii, level)) abort();
    for (uint32_t i = 0; good && i < count; i++) {
        lathe_outline outline;
        if (lathe__radii_outline(&outline, &mesh_arena[0], radii, level, slices[i], stride, i)) abort();
        good = lathe__loops_fit(&outline);
    }
    lathe__arena_reset(&mesh_arena[0]);
    return good;
}

static lathe_mesh build(lathe_radii *radii, uint32_t level) {
    lathe_surface_counts counts = {0};
    lathe_mesh mesh = {0};
    uint32_t shown;
    CHECK(!lathe__radii_mesh(&mesh, mesh_arena, radii, level, &counts, &shown));
    return mesh;
}

static bool is_sound(const lathe_mesh *mesh, lathe_mesh_report *r) {
    if (lathe__mesh_check(r, mesh, true)) return false;
    return !r->boundary_edges && !r->nonmanifold_edges && !r->misoriented_edges && !r->nonmanifold_vertices && !r->degenerate_triangles &&
           !r->duplicate_positions && !r->self_intersections && !r->unused_vertices && !r->bad_indices;
}

enum { BOTTLE_RINGS = 30 * 64 + 12 * 32 + 20 * 32, BOTTLE_STRIPS = 2 * (29 * 64 + 11 * 32 + 19 * 32), BOTTLE_ENDS = 2 * (64 + 32 + 32) };

/* A closed bottle within a thick column, and a column beside it: topology and volume are known, all but the ends is strips. */
static lathe_mesh bottle(bool plain) {
    lathe_radii radii = new_radii(30, 3);
    radii.plain = plain;
    add_tube(&radii, 0, 30, 64, false, 0, &(shape){40, 60, 0, 0, 20, 1, 0, 0});
    add_tube(&radii, 8, 12, 32, true, 0, &(shape){42, 58, 0.2, 0, 8, 1, 0, 0});
    add_tube(&radii, 5, 20, 32, false, 0, &(shape){90, 60, 0, 0.3, 15, 1, 0, 0});
    CHECK_EQ(lathe__radii_plain(&radii), plain);
    lathe_mesh_report r;
    lathe_mesh mesh = build(&radii, 2);
    CHECK(is_sound(&mesh, &r));
    CHECK_EQ(r.components, 3);
    CHECK_EQ(r.euler, 6);
    /* Caps are about half a slice thick. */
    double pi = FULL_TURN / 2, wanted = pi * (20 * 20 * 30 - 8 * 8 * 12 + 15 * 15 * 20);
    CHECK(fabs(mesh_volume(&mesh) - wanted) < 0.02 * wanted);
    return mesh;
}

static void known(void) {
    lathe_mesh mesh = bottle(false);
    CHECK(mesh.vertex_count > BOTTLE_RINGS && mesh.vertex_count < BOTTLE_RINGS + BOTTLE_ENDS);
    CHECK(mesh.triangle_count > BOTTLE_STRIPS && mesh.triangle_count < BOTTLE_STRIPS + 3 * BOTTLE_ENDS);
    /* Rays go straight up, where the overlay's jitter is not: the middle of the column. */
    for (uint32_t i = 0; i < 64; i++) CHECK(mesh.lattice[2 * 64 + i][0] == mesh.lattice[3 * 64 + i][0]);
    lathe_mesh_free(&mesh);
    lathe__arena_reset(&arena);
}

/* Each end has a rim and one vertex more. */
static void plain_known(void) {
    lathe_mesh mesh = bottle(true);
    CHECK_EQ(mesh.vertex_count, BOTTLE_RINGS + BOTTLE_ENDS + 6);
    CHECK_EQ(mesh.triangle_count, BOTTLE_STRIPS + 3 * BOTTLE_ENDS);
    lathe_mesh_free(&mesh);
    lathe__arena_reset(&arena);
}

/* A solid that parts into three and becomes two again: the triangles of each joint follow from its rings, and so do a
 * bridge's two vertices and four triangles. */
static void plain_joints(void) {
    lathe_radii radii = new_radii(30, 3);
    radii.plain = true;
    add_tube(&radii, 0, 10, 64, false, 0, &(shape){60, 60, 0, 0, 20, 1, 0, 0});
    add_tube(&radii, 10, 10, 16, false, 0, &(shape){50, 60, -0.5, 0, 6, 1, 0, 0});
    add_tube(&radii, 10, 10, 32, false, 0, &(shape){66, 52, 0.2, -0.4, 6, 1, 0, 0});
    add_tube(&radii, 10, 20, 16, false, 0, &(shape){66, 68, 0.2, 0.4, 6, 1, 0, 0});
    add_tube(&radii, 20, 10, 32, false, 0, &(shape){57, 54, 0, 0, 8, 2, 0, 0});
    lathe_mesh_report r;
    lathe_mesh mesh = build(&radii, 2);
    CHECK(is_sound(&mesh, &r));
    CHECK_EQ(r.components, 1);
    CHECK_EQ(r.euler, 0);      /* the first two of the three meet again */
    uint32_t rings = 10 * 64 + 10 * 16 + 10 * 32 + 20 * 16 + 10 * 32, ends = 64 + 16 + 32;
    CHECK_EQ(mesh.vertex_count, rings + ends + 3 + 6);
    uint32_t strips = 2 * (9 * 64 + 9 * 16 + 9 * 32 + 19 * 16 + 9 * 32), joints = (64 + 16 + 32 + 16 + 2 * 6) + (16 + 32 + 32 + 6);
    CHECK_EQ(mesh.triangle_count, strips + joints + 3 * ends);
    lathe_mesh_free(&mesh);
    lathe__arena_reset(&arena);
}

/* A hole that opens at both ends, and one that turns with the column around it. */
static void pipes(bool plain) {
    for (int32_t turn = 0; turn <= 600; turn += 600) {
        lathe_radii radii = new_radii(20, 3);
        radii.plain = plain;
        add_tube(&radii, 0, 20, 64, false, turn, &(shape){60, 60, 0, 0, 30, 1.5, 0, 0});
        add_tube(&radii, 0, 20, 32, true, turn, &(shape){60, 60, 0, 0, 10, 1.2, 0, 0});
        lathe_mesh_report r;
        for (uint32_t level = 0; level < 3; level++) {
            lathe_mesh mesh = build(&radii, level);
            CHECK(is_sound(&mesh, &r));
            CHECK_EQ(r.components, 1);
            CHECK_EQ(r.euler, 0);
            lathe_mesh_free(&mesh);
        }
        lathe__arena_reset(&arena);
    }
}

static void random_tubes(lathe_radii *radii) {
    int32_t slices = radii->slices;
    shape trunk = {60, 60, uniform(-0.2, 0.2), uniform(-0.2, 0.2), uniform(20, 45), uniform(0.5, 1.2), uniform(0, 0.2), uniform(-0.01, 0.01)};
    add_tube(radii, 0, slices, 128, false, 0, &trunk);
    int32_t more = whole(1, 4);
    for (int32_t i = 0; i < more && radii->count < LATHE_TUBES_MOST; i++) {
        bool hole = uniform(0, 1) < 0.8;
        int32_t first = whole(0, slices - 2), rows = whole(1, slices - first);
        shape s = {uniform(hole ? 30 : 0, hole ? 90 : 119), uniform(hole ? 30 : 0, hole ? 90 : 119), uniform(-0.5, 0.5), uniform(-0.5, 0.5), uniform(0.5, 12), uniform(0.6, 1.5), uniform(0, 0.3),
                   uniform(-0.02, 0.03)};
        add_tube(radii, first, rows, 8u << whole(0, 4), hole, 0, &s);
        /* Half of them part into two, or go on as another one. */
        if (radii->count + 2 > LATHE_TUBES_MOST || first + rows + 2 > slices || uniform(0, 1) < 0.5) continue;
        for (int k = -1; k <= 1; k += 2) {
            shape part = {s.x + rows * s.dx + k * s.radius * 0.5, s.y + rows * s.dy, k * uniform(0, 0.6), 0, s.radius * 0.4, 1, 0, 0};
            add_tube(radii, first + rows, whole(1, slices - first - rows), 16, hole, 0, &part);
        }
    }
}

static void random_sets(void) {
    int tried = 0, made = 0;
    for (int i = 0; i < 2500 && made < 150; i++, tried++) {
        lathe_radii radii = new_radii(whole(3, MOST_ROWS), 3);
        random_tubes(&radii);
        for (uint32_t level = 0; level < 3; level++) {
            if (!fits(&radii, level)) continue;
            lathe_mesh mesh = build(&radii, level);
            lathe_mesh_report r;
            CHECK(is_sound(&mesh, &r));
            CHECK(mesh_volume(&mesh) > 0);
            lathe_mesh_free(&mesh);
            made++;
        }
        lathe__arena_reset(&arena);
    }
    CHECK(made >= 100);
}

/* Closed whatever they are; what the joints alone say of crossings holds for all of the surface. */
static void random_plain_sets(void) {
    int made = 0, crossed = 0;
    for (int i = 0; i < 2500 && (made < 80 || crossed < 20); i++) {
        lathe_radii radii = new_radii(whole(3, MOST_ROWS), 3);
        radii.plain = true;
        random_tubes(&radii);
        for (uint32_t level = 0; level < 3; level++) {
            lathe_mesh mesh = build(&radii, level), joints = {0};
            lathe_mesh_report r, alone;
            CHECK(!lathe__mesh_check(&r, &mesh, true));
            CHECK_EQ(r.boundary_edges, 0);
            CHECK_EQ(r.bad_indices, 0);
            if (fits(&radii, level) && CHECK(!lathe__radii_joints(&joints, mesh_arena, &radii, level)) && CHECK(!lathe__mesh_check(&alone, &joints, true))) {
                CHECK_EQ(!r.self_intersections, !alone.self_intersections);
                *(alone.self_intersections ? &crossed : &made) += 1;
            }
            lathe_mesh_free(&joints);
            lathe_mesh_free(&mesh);
        }
        lathe__arena_reset(&arena);
    }
    CHECK(made >= 80);
    CHECK(crossed >= 20);
}

/* ---- what a renderer takes ---- */

static void cross(double *out, const float *a, const float *b, const float *c) {
    for (int i = 0; i < 3; i++) {
        int j = (i + 1) % 3, k = (i + 2) % 3;
        out[i] = (double)(b[j] - a[j]) * (c[k] - a[k]) - (double)(b[k] - a[k]) * (c[j] - a[j]);
    }
}

/* Against the definition, triangle by triangle. */
static void check_shading(const lathe_mesh *mesh, const lathe_transform *transform, lathe_mesh_shading *s) {
    float *positions = malloc(mesh->vertex_count * 12 + 1);
    uint32_t *indices = malloc(mesh->triangle_count * 12 + 1);
    double *sums = calloc(mesh->vertex_count + 1, 24), worst = 0;
    lathe_mesh_positions(mesh, transform, positions);
    lathe_mesh_indices(mesh, transform, indices);
    if (!CHECK(!lathe__mesh_shade(s, mesh, transform))) return;
    CHECK(!memcmp(s->positions, positions, mesh->vertex_count * 12));
    CHECK(!memcmp(s->indices, indices, mesh->triangle_count * 12));
    for (uint32_t t = 0; t < mesh->triangle_count; t++) {
        const uint32_t *v = indices + 3 * (size_t)t;
        double n[3];
        cross(n, positions + 3 * (size_t)v[0], positions + 3 * (size_t)v[1], positions + 3 * (size_t)v[2]);
        for (int k = 0; k < 9; k++) sums[3 * (size_t)v[k / 3] + k % 3] += n[k % 3];
    }
    for (uint32_t i = 0; i < mesh->vertex_count; i++) {
        const double *n = sums + 3 * (size_t)i;
        double length = sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]);
        for (int k = 0; k < 3; k++) worst = fmax(worst, fabs(n[k] / length - s->normals[3 * (size_t)i + k]));
    }
    CHECK(worst < 1e-3);
    free(positions);
    free(indices);
    free(sums);
}

static void shading(void) {
    lathe_mesh_shading s = {0};
    lathe_transform plain = {{{1 / 65536.0, 0, 0, 5}, {0, 1 / 65536.0, 0, -3}, {0, 0, 2 / 65536.0, 7}}}, mirrored = plain;
    mirrored.m[0][0] *= -1;
    mirrored.m[1][2] = 1e-6;
    for (int i = 0; i < 2; i++) {
        lathe_radii radii = new_radii(20, 3);
        add_tube(&radii, 0, 20, 64, false, 0, &(shape){60, 60, 0.5, 0, 30, 1.5, 0.1, 0});
        add_tube(&radii, i, 19, 32, true, 0, &(shape){60, 60, 0, 0, 10, 1.2, 0.1, 0});
        if (i) radii.count = 1;   /* strips and fans alone */
        lathe_mesh mesh = build(&radii, 2);
        check_shading(&mesh, &plain, &s);
        check_shading(&mesh, &mirrored, &s);
        lathe_mesh_free(&mesh);
    }
    /* Two triangles back to back, one that is alone, a vertex without any. */
    int32_t lattice[5][3] = {{0, 0, 0}, {65536, 0, 0}, {0, 65536, 0}, {0, 0, 65536}, {1, 1, 1}};
    uint32_t triangles[3][3] = {{0, 1, 2}, {0, 2, 1}, {0, 1, 3}};
    lathe_mesh odd = {5, 3, lattice, triangles};
    CHECK(!lathe__mesh_shade(&s, &odd, &plain));
    CHECK(s.normals[3 * 4] == 0 && s.normals[3 * 4 + 1] == 0 && s.normals[3 * 4 + 2] == 0);
    CHECK(s.normals[3 * 3 + 1] < -0.999f);
    lathe__mesh_shading_free(&s);
    lathe__arena_reset(&arena);
}

int main(void) {
    known();
    plain_known();
    plain_joints();
    pipes(false);
    pipes(true);
    random_sets();
    random_plain_sets();
    shading();
    lathe__arena_free(&arena);
    for (int i = 0; i < 2; i++) lathe__arena_free(&mesh_arena[i]);
    return check_end();
}
