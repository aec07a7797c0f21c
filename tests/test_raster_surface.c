/* The surface of a raster: the table of cubes by its rules, every cube alone, random rasters against their voxels' topology, and the
 * contours that it has in its slices. */
#include <stdlib.h>
#include <string.h>
#include "check.h"
#include "cube_table.h"
#include "mesh.h"
#include "mesh_volume.h"
#include "phantom.h"
#include "raster_surface.h"

static uint32_t seed = 1;
static uint32_t below(uint32_t n) { return (phantom_random(&seed) >> 8) % n; }

/* ---- the table ---- */

static void ends_of(int edge, int corner[2]) {
    int axis = edge / 4, low = (edge & 1) << (axis + 1) % 3 | (edge >> 1 & 1) << (axis + 2) % 3;
    corner[0] = low;
    corner[1] = low | 1 << axis;
}

/* The face that two edges lie in, 2 * axis + side, or -1. */
static int face_of(int a, int b) {
    int p[2], q[2];
    ends_of(a, p), ends_of(b, q);
    for (int axis = 0; axis < 3; axis++)
        for (int side = 0; side < 2; side++)
            if ((p[0] >> axis & 1) == side && (p[1] >> axis & 1) == side && (q[0] >> axis & 1) == side && (q[1] >> axis & 1) == side)
                return 2 * axis + side;
    return -1;
}

/* In each face: as many segments as runs of inside corners, from a vertex to one that the same run ends in; elsewhere each edge of a
 * triangle has its opposite; triangles use all edges that are crossed, and no other. */
static void test_table(void) {
    const lathe_cube_case *table = lathe__cube_table();
    for (int inside = 0; inside < 256; inside++) {
        int used[LATHE_CUBE_EDGES][LATHE_CUBE_EDGES] = {{0}}, seen = 0, segments[6] = {0}, wrong = 0;
        for (int t = 0; t < table[inside].count; t++)
            for (int k = 0; k < 3; k++) {
                int a = table[inside].corner[t][k], b = table[inside].corner[t][(k + 1) % 3];
                seen |= 1 << a;
                wrong += a == b || used[a][b]++;
            }
        for (int e = 0; e < LATHE_CUBE_EDGES; e++) {
            int c[2];
            ends_of(e, c);
            wrong += (seen >> e & 1) != ((inside >> c[0] ^ inside >> c[1]) & 1);
            for (int f = 0; f < LATHE_CUBE_EDGES; f++) {
                if (!used[e][f]) continue;
                int face = face_of(e, f);
                if (face < 0) wrong += !used[f][e];
                else wrong += used[f][e], segments[face]++;
            }
        }
        for (int face = 0; face < 6; face++) {
            int axis = face / 2, base = (face & 1) << axis, u = 1 << (axis + 1) % 3, v = 1 << (axis + 2) % 3;
            const int ring[4] = {base, base | u, base | u | v, base | v};
            int runs = 0;
            for (int k = 0; k < 4; k++) runs += (inside >> ring[k] & 1) && !(inside >> ring[(k + 1) % 4] & 1);
            wrong += runs != segments[face];
        }
        if (!CHECK_EQ(wrong, 0)) printf("  corners %02x\n", (unsigned)inside);
    }
}

/* ---- rasters ---- */

static lathe_mask new_mask(int32_t width, int32_t height, int32_t slices) {
    lathe_mask m;
    if (lathe__mask_new(&m, (int32_t[]){width, height, slices}, (int32_t[]){-1, -1, 0})) abort();
    return m;
}

static bool get(const lathe_mask *m, int32_t u, int32_t v, int32_t w) {
    return u >= 0 && v >= 0 && w >= 0 && u < m->size[0] && v < m->size[1] && w < m->size[2] &&
           lathe__slice_pixel(lathe__mask_slice(m, w), m->row_words, u, v);
}

static void set(lathe_mask *m, int32_t u, int32_t v, int32_t w) {
    lathe__mask_slice(m, w)[(size_t)v * (size_t)m->row_words + (size_t)(u >> 6)] |= (uint64_t)1 << (u & 63);
}

/* Every crossing of a line through samples has its vertex, at the fraction from the inside, and there is no other vertex. */
static bool has_crossings(const lathe_mesh *mesh, const lathe_mask *m, const int fraction[2]) {
    uint64_t expected = 0, found = 0;
    for (int32_t w = -1; w < m->size[2]; w++)
        for (int32_t v = -1; v < m->size[1]; v++)
            for (int32_t u = -1; u < m->size[0]; u++)
                for (int k = 0; k < 3; k++) expected += get(m, u, v, w) != get(m, u + (k == 0), v + (k == 1), w + (k == 2));
    for (uint32_t i = 0; i < mesh->vertex_count; i++) {
        const int32_t *p = mesh->lattice[i];
        int32_t at[3], along = 0, axis = -1;
        for (int k = 0; k < 3; k++) {
            int32_t rest = p[k] & (LATHE_LATTICE_ONE - 1);
            at[k] = (p[k] - rest) / LATHE_LATTICE_ONE;
            if (rest) { along = rest / (LATHE_LATTICE_ONE / 64); axis = axis < 0 ? k : 3; }
        }
        if (axis < 0 || axis > 2) return false;
        bool low = get(m, at[0], at[1], at[2]), high = get(m, at[0] + (axis == 0), at[1] + (axis == 1), at[2] + (axis == 2));
        found += low != high && along == (low ? fraction[axis == 2] : 64 - fraction[axis == 2]);
    }
    return expected == mesh->vertex_count && found == expected;
}

static bool check_raster(const lathe_mask *m, const int fraction[2], const char *what, int number) {
    lathe_arena arena = {0};
    lathe_mesh mesh = {0};
    lathe_mesh_report r;
    lathe_topology topology;
    if (!CHECK_EQ(lathe__raster_surface(&mesh, &arena, m, fraction), LATHE_OK)) return false;
    CHECK_EQ(lathe__mesh_check(&r, &mesh, true), LATHE_OK);
    CHECK_EQ(lathe__mask_topology(&topology, m, NULL), LATHE_OK);
    bool closed = !r.boundary_edges && !r.nonmanifold_edges && !r.misoriented_edges && !r.nonmanifold_vertices && !r.degenerate_triangles &&
                  !r.duplicate_positions && !r.unused_vertices && !r.bad_indices;
    bool right = CHECK(closed) & CHECK_EQ(r.self_intersections, 0) & CHECK_EQ(r.components, topology.components + topology.cavities) &
                 CHECK_EQ(r.euler, 2 * topology.euler) & CHECK(!topology.components || mesh_volume(&mesh) > 0) &
                 CHECK(has_crossings(&mesh, m, fraction));
    if (!right) printf("  %s %d, fractions %d %d\n", what, number, fraction[0], fraction[1]);
    lathe_mesh_free(&mesh);
    lathe__arena_free(&arena);
    return right;
}

/* Each of the 256 cubes alone, with every fraction. */
static void test_cubes(void) {
    for (int inside = 1; inside < 256; inside++)
        for (int f = 4; f <= 60; f++) {
            lathe_mask m = new_mask(4, 4, 2);
            for (int c = 0; c < 8; c++)
                if (inside >> c & 1) set(&m, 1 + (c & 1), 1 + (c >> 1 & 1), c >> 2);
            check_raster(&m, (const int[]){f, f}, "cube", inside);
            check_raster(&m, (const int[]){f, 4 + (int)below(57)}, "cube", inside);
            lathe__mask_free(&m);
        }
}

static void test_noise(void) {
    for (int i = 0; i < 1500; i++) {
        int32_t width = i % 10 ? 3 + (int32_t)below(10) : 60 + (int32_t)below(12);   /* rows of one word and of two */
        lathe_mask m = new_mask(width, 3 + (int32_t)below(9), 1 + (int32_t)below(8));
        uint32_t percent = 5 + below(91);
        for (int32_t w = 0; w < m.size[2]; w++)
            for (int32_t v = 1; v < m.size[1] - 1; v++)
                for (int32_t u = 1; u < width - 1; u++)
                    if (below(100) < percent) set(&m, u, v, w);
        if (!check_raster(&m, (const int[]){4 + (int)below(57), 4 + (int)below(57)}, "noise", i)) i = 1500;
        lathe__mask_free(&m);
    }
}

/* A ball's surface: its volume, and no vertex off by more than the fraction allows. */
static void test_ball(void) {
    enum { SIZE = 44, RADIUS = 20 };
    lathe_mask m = new_mask(SIZE, SIZE, SIZE - 2);
    double voxels = 0;
    for (int32_t w = 0; w < m.size[2]; w++)
        for (int32_t v = 1; v < SIZE - 1; v++)
            for (int32_t u = 1; u < SIZE - 1; u++) {
                double x = u - 21.5, y = v - 21.5, z = w - 20.5;
                if (x * x + y * y + z * z <= RADIUS * RADIUS) set(&m, u, v, w), voxels++;
            }
    lathe_arena arena = {0};
    lathe_mesh mesh;
    CHECK_EQ(lathe__raster_surface(&mesh, &arena, &m, (const int[]){32, 32}), LATHE_OK);
    double volume = mesh_volume(&mesh);
    CHECK(volume > voxels * 0.97 && volume < voxels * 1.01);
    lathe_mesh_free(&mesh);
    lathe__arena_free(&arena);
    lathe__mask_free(&m);
}

int main(void) {
    test_table();
    test_cubes();
    test_noise();
    test_ball();
    return check_end();
}
