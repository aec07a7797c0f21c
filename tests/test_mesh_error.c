/* Distances with answers known from geometry: spheres, boxes and far points, in every frame; and the marching cubes below. */
#include "../core/marching_cubes.h"
#include "../core/mesh.h"
#include "check.h"
#include <stdlib.h>

static const double pi = 3.14159265358979323846;

/* A ball of radius r mm around the middle of a volume whose values fall linearly with the distance: its isosurface at 100. */
typedef struct ball {
    lathe_volume volume;
    lathe_mask mask;
    lathe_axis axis;
    double r, middle[3];
} ball;

static double distance_at(const ball *b, const int32_t voxel[3]) {
    double sum = 0;
    for (int i = 0; i < 3; i++) {
        double d = b->volume.affine[i][3] - b->middle[i];
        for (int j = 0; j < 3; j++) d += b->volume.affine[i][j] * voxel[j];
        sum += d * d;
    }
    return sqrt(sum);
}

/* The mask of value >= iso, cropped to its box. */
static void make_mask(lathe_mask *mask, const lathe_volume *volume, lathe_axis axis, double iso) {
    int32_t frame[3], low[3] = {9999, 9999, 9999}, high[3] = {-1, -1, -1}, x[3];
    lathe__axis_frame(axis, frame);
    for (int pass = 0; pass < 2; pass++) {
        size_t at = 0;
        for (x[2] = 0; x[2] < volume->dims[2]; x[2]++)
            for (x[1] = 0; x[1] < volume->dims[1]; x[1]++)
                for (x[0] = 0; x[0] < volume->dims[0]; x[0]++) {
                    int32_t p[3];
                    if (!((double)volume->values[at++] >= iso)) continue;
                    for (int i = 0; i < 3; i++) {
                        p[i] = x[frame[i]];
                        low[i] = p[i] < low[i] ? p[i] : low[i];
                        high[i] = p[i] > high[i] ? p[i] : high[i];
                    }
                    if (!pass) continue;
                    int32_t u = p[0] - mask->origin[0], v = p[1] - mask->origin[1], w = p[2] - mask->origin[2];
                    lathe__mask_slice(mask, w)[v * mask->row_words + (u >> 6)] |= (uint64_t)1 << (u & 63);
                }
        if (pass) return;
        const int32_t size[3] = {high[0] - low[0] + 3, high[1] - low[1] + 3, high[2] - low[2] + 1};
        const int32_t origin[3] = {low[0] - 1, low[1] - 1, low[2]};
        if (lathe__mask_new(mask, size, origin) != LATHE_OK) abort();
    }
}

static ball make_ball(double r, const int32_t dims[3], const double affine[3][4], lathe_axis axis) {
    ball b = {.axis = axis, .r = r};
    size_t at = 0;
    for (int i = 0; i < 3; i++) {
        b.volume.dims[i] = dims[i];
        for (int j = 0; j < 4; j++) b.volume.affine[i][j] = affine[i][j];
        b.middle[i] = affine[i][3];
        for (int j = 0; j < 3; j++) b.middle[i] += affine[i][j] * (0.5 * (dims[j] - 1) + 0.123 * (j + 1));
    }
    for (int j = 0; j < 3; j++)
        b.volume.spacing[j] =
            sqrt(affine[0][j] * affine[0][j] + affine[1][j] * affine[1][j] + affine[2][j] * affine[2][j]);
    b.volume.values = malloc(sizeof(float) * (size_t)dims[0] * (size_t)dims[1] * (size_t)dims[2]);
    if (!b.volume.values) abort();
    for (int32_t z = 0; z < dims[2]; z++)
        for (int32_t y = 0; y < dims[1]; y++)
            for (int32_t x = 0; x < dims[0]; x++)
                b.volume.values[at++] = (float)(100 + r - distance_at(&b, (int32_t[3]){x, y, z}));
    b.volume.min = b.volume.values[0];
    make_mask(&b.mask, &b.volume, axis, 100);
    return b;
}

static void free_ball(ball *b) {
    free(b->volume.values);
    lathe__mask_free(&b->mask);
}

/* World mm -> lattice of the mask, by Cramer's rule. */
static void to_lattice(int32_t out[3], const ball *b, const double p[3]) {
    lathe_transform t = lathe__mask_transform(&b->mask, b->axis, (const double(*)[4])b->volume.affine);
    double m[3][3], d = 0;
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) {
            int k = (i + 1) % 3, l = (i + 2) % 3, n = (j + 1) % 3, o = (j + 2) % 3;
            m[j][i] = t.m[k][n] * t.m[l][o] - t.m[k][o] * t.m[l][n];
        }
    for (int j = 0; j < 3; j++) d += t.m[0][j] * m[j][0];
    for (int j = 0; j < 3; j++) {
        double x = 0;
        for (int i = 0; i < 3; i++) x += m[j][i] / d * (p[i] - t.m[i][3]);
        out[j] = (int32_t)lrint(x);
    }
}

/* A sphere as an n x 2n grid of latitudes and longitudes: closed but for its pinched poles, which do not matter here. */
static lathe_mesh make_sphere(const ball *b, double r, const double shift[3], uint32_t n) {
    lathe_mesh mesh = {(n + 1) * 2 * n, 4 * n * n, NULL, NULL};
    mesh.lattice = malloc(mesh.vertex_count * sizeof *mesh.lattice);
    mesh.triangles = malloc(mesh.triangle_count * sizeof *mesh.triangles);
    if (!mesh.lattice || !mesh.triangles) abort();
    for (uint32_t i = 0, t = 0; i <= n; i++)
        for (uint32_t k = 0; k < 2 * n; k++) {
            double a = pi * i / n, o = pi * k / n, p[3] = {sin(a) * cos(o), sin(a) * sin(o), cos(a)};
            for (int c = 0; c < 3; c++) p[c] = b->middle[c] + r * p[c] + shift[c];
            to_lattice(mesh.lattice[i * 2 * n + k], b, p);
            if (i == n) continue;
            uint32_t q = i * 2 * n + k, s = i * 2 * n + (k + 1) % (2 * n);
            uint32_t both[2][3] = {{q, q + 2 * n, s}, {s, q + 2 * n, s + 2 * n}};
            for (int c = 0; c < 6; c++) mesh.triangles[t + (uint32_t)c / 3][c % 3] = both[c / 3][c % 3];
            t += 2;
        }
    return mesh;
}

static lathe_metrics measure(const ball *b, const lathe_reference *reference, double r, double shift, uint32_t n,
                             size_t samples) {
    lathe_mesh mesh = make_sphere(b, r, (const double[3]){shift * 0.6, 0, shift * 0.8}, n);
    lathe_metrics m = {-1, -1, -1};
    CHECK_EQ(lathe__reference_measure(&m, reference, &mesh, samples), LATHE_OK);
    double rms[2] = {-1, -1};
    bool within[2] = {false, true};
    for (int i = 0; i < 2; i++)
        CHECK_EQ(lathe__reference_within(&within[i], &rms[i], reference, &mesh, samples, m.max_mm * (i ? 0.999 : 1.001)), LATHE_OK);
    CHECK(within[0] && !within[1] && rms[0] == m.rms_mm && rms[1] == m.rms_mm);
    lathe_mesh_free(&mesh);
    return m;
}

static void near_to(double value, double expected, double tolerance) {
    if (!CHECK(fabs(value - expected) <= tolerance))
        fprintf(stderr, "  %g, expected %g +- %g\n", value, expected, tolerance);
}

static void test_ball(const int32_t dims[3], const double affine[3][4], double r, double voxel, lathe_axis axis) {
    ball b = make_ball(r, dims, affine, axis);
    lathe_reference *reference = NULL;
    CHECK_EQ(lathe__reference_build(&reference, &b.volume, axis, &b.mask, LATHE_BOUNDARY_ISO, 100), LATHE_OK);
    if (!CHECK(reference)) return;
    lathe_metrics m = measure(&b, reference, r, 0, 80, 20000);
    near_to(m.area_mm2, 4 * pi * r * r, 0.01 * 4 * pi * r * r);
    CHECK(m.rms_mm < 0.03 * voxel && m.max_mm < 0.15 * voxel);
    m = measure(&b, reference, r + 2 * voxel, 0, 80, 20000);
    near_to(m.rms_mm, 2 * voxel, 0.04 * voxel);
    near_to(m.max_mm, 2 * voxel, 0.12 * voxel);
    /* A shift by d is seen as d cos: RMS d / sqrt(3) to first order, at most d. */
    m = measure(&b, reference, r, voxel, 80, 20000);
    near_to(m.rms_mm, voxel / sqrt(3), 0.02 * voxel);
    near_to(m.max_mm, voxel, 0.12 * voxel);
    /* A speck far away: from the sphere to it the mean square is r^2 + d^2, the farthest point r + d. */
    double d = 2.5 * r;
    m = measure(&b, reference, 0.01 * r, d, 2, 2000);
    near_to(m.rms_mm, sqrt(r * r + d * d), 0.015 * d);
    near_to(m.max_mm, r + d, 0.015 * d);
    /* A speck in the middle: r everywhere. Few samples: every triangle is a candidate. */
    m = measure(&b, reference, 0.001 * r, 0, 2, 200);
    near_to(m.rms_mm, r, 0.005 * r);
    near_to(m.max_mm, r, 0.005 * r + 0.05 * voxel);
    lathe__reference_free(&reference);
    CHECK(!reference);
    free_ball(&b);
}

static void test_balls(void) {
    static const double plain[3][4] = {{1, 0, 0, -50}, {0, 1, 0, 7}, {0, 0, 1, 1000}};
    static const double slabs[3][4] = {{0.5, 0, 0, 0}, {0, 0.5, 0, 0}, {0, 0, 1.25, 0}};
    static const double turned[3][4] = {{0, -0.0012, 0.0016, 3}, {0.003, 0, 0, 4}, {0, -0.0016, -0.0012, 5}};
    for (int axis = 0; axis < 3; axis++) {
        test_ball((const int32_t[3]){44, 47, 50}, plain, 18.3, 1, (lathe_axis)axis);
        test_ball((const int32_t[3]){80, 84, 34}, slabs, 16.1, 1.25, (lathe_axis)axis);
        test_ball((const int32_t[3]){24, 44, 46}, turned, 0.029, 0.003, (lathe_axis)axis);
    }
}

/* ---- edges: a box of k^3 voxels ---- */

static void test_box(void) {
    enum { K = 6 };
    ball b = {.axis = LATHE_AXIS_Y};
    for (int i = 0; i < 3; i++) {
        b.volume.dims[i] = K;
        b.volume.spacing[i] = b.volume.affine[i][i] = 2;
    }
    float values[K * K * K];
    for (int k = 0; k < K * K * K; k++) values[k] = 9;
    b.volume.values = values;
    b.volume.min = 9;
    make_mask(&b.mask, &b.volume, b.axis, 9);
    lathe_reference *reference = NULL;
    CHECK_EQ(lathe__reference_build(&reference, &b.volume, b.axis, &b.mask, LATHE_BOUNDARY_EDGE, 0), LATHE_OK);
    int32_t lattice[8][3];
    uint32_t t[12][3] = {{0, 1, 3}, {0, 3, 2}, {4, 7, 5}, {4, 6, 7}, {0, 5, 1}, {0, 4, 5},
                         {2, 3, 7}, {2, 7, 6}, {0, 2, 6}, {0, 6, 4}, {1, 5, 7}, {1, 7, 3}};
    for (int k = 0; k < 8; k++)
        for (int i = 0; i < 3; i++)
            to_lattice(lattice[k], &b, (const double[3]){k & 1 ? 11 : -1, k & 2 ? 11 : -1, k & 4 ? 11 : -1});
    lathe_mesh mesh = {8, 12, lattice, t};
    lathe_metrics m = {0};
    CHECK_EQ(lathe__reference_measure(&m, reference, &mesh, 20000), LATHE_OK);
    /* Flat faces of (K - 1)^2, twelve bevels and eight corners cut off: the box's corner is 1/sqrt(3) voxel from its cut. */
    near_to(m.area_mm2, 4 * (6 * (K - 1) * (K - 1) + 12 * (K - 1) * sqrt(0.5) + 8 * sqrt(3) / 8), 1e-3);
    near_to(m.max_mm, 2 / sqrt(3), 1e-4);
    CHECK(m.rms_mm > 0.05 && m.rms_mm < 0.5);
    uint32_t bad[1][3] = {{0, 1, 8}};
    lathe_mesh wrong = {8, 1, lattice, bad}, none = {8, 0, lattice, t};
    CHECK_EQ(lathe__reference_measure(&m, reference, &wrong, 10), LATHE_ERR_RANGE);
    CHECK_EQ(lathe__reference_measure(&m, reference, &none, 10), LATHE_ERR_EMPTY);
    CHECK_EQ(lathe__reference_measure(&m, reference, &mesh, 0), LATHE_OK);
    lathe__reference_free(&reference);
    /* Grey values without a fall at the border of the volume: in the middle as well. */
    CHECK_EQ(lathe__reference_build(&reference, &b.volume, b.axis, &b.mask, LATHE_BOUNDARY_ISO, 5), LATHE_OK);
    CHECK_EQ(lathe__reference_measure(&m, reference, &mesh, 100), LATHE_OK);
    near_to(m.max_mm, 2 / sqrt(3), 1e-4);
    lathe__reference_free(&reference);
    lathe__reference_free(&reference);
    lathe__reference_free(NULL);
    lathe__mask_free(&b.mask);
    const int32_t size[3] = {3, 3, 1}, origin[3] = {0, 0, 0};
    if (!CHECK_EQ(lathe__mask_new(&b.mask, size, origin), LATHE_OK)) return;
    CHECK_EQ(lathe__reference_build(&reference, &b.volume, b.axis, &b.mask, LATHE_BOUNDARY_EDGE, 0), LATHE_ERR_EMPTY);
    lathe__mask_free(&b.mask);
}

/* ---- marching cubes are closed and hold the right volume, whatever the mask ---- */

typedef struct welded {
    lathe_mesh mesh;
    double volume;
} welded;

static int compare_points(const void *a, const void *b) {
    const int32_t *p = a, *q = b;
    for (int i = 0; i < 3; i++)
        if (p[i] != q[i]) return p[i] < q[i] ? -1 : 1;
    return 0;
}

static welded weld(const lathe_soup *soup) {
    size_t n = 3 * (size_t)soup->count, kept = 0;
    int32_t(*points)[3] = malloc(n * sizeof *points);
    uint32_t(*triangles)[3] = malloc(soup->count * sizeof *triangles);
    if (!points || !triangles) abort();
    int32_t(*all)[3] = malloc(n * sizeof *all);
    if (!all) abort();
    welded w = {.volume = 0};
    for (size_t k = 0; k < soup->count; k++) {
        double p[3][3];
        for (int c = 0; c < 3; c++)
            for (int i = 0; i < 3; i++) {
                p[c][i] = (double)soup->packets[k / 4].corner[c][i][k % 4];
                all[3 * k + (size_t)c][i] = points[3 * k + (size_t)c][i] =
                    (int32_t)(p[c][i] * 2); /* middles of edges: exact */
            }
        for (int i = 0; i < 3; i++) {
            int j = (i + 1) % 3, l = (i + 2) % 3;
            w.volume += p[0][i] * (p[1][j] * p[2][l] - p[1][l] * p[2][j]) / 6;
        }
    }
    qsort(points, n, sizeof *points, compare_points);
    for (size_t k = 0; k < n; k++)
        if (!k || compare_points(points[k], points[kept - 1])) {
            for (int i = 0; i < 3; i++) points[kept][i] = points[k][i];
            kept++;
        }
    for (size_t k = 0; k < n; k++) {
        int32_t(*at)[3] = bsearch(all[k], points, kept, sizeof *points, compare_points);
        triangles[k / 3][k % 3] = (uint32_t)(at - points);
    }
    free(all);
    w.mesh = (lathe_mesh){(uint32_t)kept, soup->count, points, triangles};
    return w;
}

static welded surface_of(const lathe_mask *mask) {
    static const float same[3][4] = {{1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, 0}};
    const lathe_curve curve = lathe__curve_through(&(lathe_box){{-1, -1, -1}, {80, 80, 80}});
    const lathe_field field = {mask, NULL, LATHE_AXIS_Z, 0};
    lathe_soup soup = {0};
    if (!CHECK_EQ(lathe__marching_cubes(&soup, &field, same, &curve), LATHE_OK)) abort();
    for (size_t k = 1; k < (soup.count + 3) / 4; k++)
        if (soup.key[k] < soup.key[k - 1]) CHECK(!"keys ascend");
    welded w = weld(&soup);
    free(soup.packets);
    free(soup.key);
    return w;
}

static void test_cubes(void) {
    const int32_t size[3] = {70, 6, 4}, origin[3] = {0, 0, 0};
    uint32_t seed = 7;
    for (int round = 0; round < 60; round++) {
        lathe_mask mask;
        if (!CHECK_EQ(lathe__mask_new(&mask, size, origin), LATHE_OK)) return;
        for (int32_t w = 0; w < 4; w++)
            for (int32_t v = 1; v < 5; v++)
                for (int32_t u = 1; u < 69; u++) {
                    seed = seed * 1664525 + 1013904223;
                    if (seed >> 16 < 1100u * (uint32_t)(round + 1) || (u == 5 && v == 2))
                        lathe__mask_slice(&mask, w)[v * mask.row_words + (u >> 6)] |= (uint64_t)1 << (u & 63);
                }
        welded s = surface_of(&mask);
        lathe_mesh_report r;
        CHECK_EQ(lathe__mesh_check(&r, &s.mesh, false), LATHE_OK);
        CHECK_EQ(r.boundary_edges + r.misoriented_edges + r.degenerate_triangles + r.bad_indices, 0);
        lathe_mesh_free(&s.mesh);
        lathe__mask_free(&mask);
    }
}

/* Two voxels that touch at an edge only are two octahedra; with a hole the same way the background is one. */
static void test_diagonals(void) {
    const int32_t size[3] = {6, 6, 2}, origin[3] = {0, 0, 0};
    lathe_mask mask;
    if (!CHECK_EQ(lathe__mask_new(&mask, size, origin), LATHE_OK)) return;
    lathe__mask_slice(&mask, 0)[2] |= 1 << 2;
    lathe__mask_slice(&mask, 1)[3] |= 1 << 2;
    welded s = surface_of(&mask);
    lathe_mesh_report r;
    CHECK_EQ(lathe__mesh_check(&r, &s.mesh, true), LATHE_OK);
    CHECK_EQ(s.mesh.triangle_count, 16);
    CHECK_EQ(r.components, 2);
    CHECK_EQ(r.euler, 4);
    CHECK_EQ(r.boundary_edges + r.nonmanifold_edges + r.misoriented_edges + r.nonmanifold_vertices, 0);
    near_to(s.volume, 2 * 1.0 / 6, 1e-6); /* outward: the octahedra's volume, positive */
    lathe_mesh_free(&s.mesh);
    lathe__mask_free(&mask);
}

int main(void) {
    test_balls();
    test_box();
    test_cubes();
    test_diagonals();
    return check_end();
}
