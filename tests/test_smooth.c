/* The smooth surface: through all vertices, with their normals; tangent planes that agree along every edge and within every triangle. */
#include <stdlib.h>
#include <string.h>
#include "check.h"
#include "lathe_codec.h"
#include "level.h"
#include "mesh.h"
#include "smooth.h"

static uint32_t seed = 5;
static uint32_t next_random(void) {
    seed = seed * 1664525u + 1013904223u;
    return seed >> 8;
}
static double noise(void) { return (next_random() % 20001) / 10000.0 - 1; }

enum { MOST = 20000 };
static double positions[3 * MOST];
static uint32_t triangles[3 * 2 * MOST], vertex_count, triangle_count;

static void add_triangle(uint32_t a, uint32_t b, uint32_t c) {
    uint32_t *t = triangles + 3 * triangle_count++;
    t[0] = a, t[1] = b, t[2] = c;
}

/* A torus of n times m quadrilaterals, its vertices moved at random. */
static void make_torus(uint32_t n, uint32_t m, double disorder) {
    vertex_count = n * m, triangle_count = 0;
    for (uint32_t i = 0; i < n; i++)
        for (uint32_t k = 0; k < m; k++) {
            double u = 6.283185307179586 * i / n, v = 6.283185307179586 * k / m, *p = positions + 3 * (i * m + k);
            p[0] = (3 + cos(v)) * cos(u) + disorder * noise();
            p[1] = (3 + cos(v)) * sin(u) + disorder * noise();
            p[2] = sin(v) + disorder * noise();
            uint32_t a = i * m + k, b = (i + 1) % n * m + k, c = (i + 1) % n * m + (k + 1) % m, d = i * m + (k + 1) % m;
            add_triangle(a, b, c);
            add_triangle(a, c, d);
        }
}

static void make_octahedron(void) {
    static const double P[18] = {1, 0, 0, -1, 0, 0, 0, 1, 0, 0, -1, 0, 0, 0, 1, 0, 0, -1};
    static const uint32_t T[24] = {0, 2, 4, 2, 1, 4, 1, 3, 4, 3, 0, 4, 2, 0, 5, 1, 2, 5, 3, 1, 5, 0, 3, 5};
    memcpy(positions, P, sizeof P);
    memcpy(triangles, T, sizeof T);
    vertex_count = 6, triangle_count = 8;
}

static lathe_vector corner(uint32_t v) { return lathe__vec(positions[3 * v], positions[3 * v + 1], positions[3 * v + 2]); }

/* Sine of the angle between the planes of two normals; NAN if one is missing. */
static double between(lathe_vector a, lathe_vector b) {
    if (!(lathe__vec_length(a) > 0.5) || !(lathe__vec_length(b) > 0.5)) return NAN;
    return lathe__vec_length(lathe__vec_cross(a, b));
}

/* Which corner of a triangle a vertex is, or 3. */
static uint32_t corner_of(uint32_t t, uint32_t v) {
    uint32_t k = 0;
    while (k < 3 && triangles[3 * t + k] != v) k++;
    return k;
}

/* An edge whose normals allow no curve is straight, and then tangent planes may break along its triangles' edges. */
static bool creased(const lathe_smooth_patch *p) { return p->flat[0] || p->flat[1] || p->flat[2]; }

static void check_edge(const lathe_smooth *smooth, uint32_t t, uint32_t other, uint32_t u, uint32_t v, double tolerance) {
    lathe_smooth_patch a, b;
    lathe__smooth_triangle(&a, smooth, t);
    lathe__smooth_triangle(&b, smooth, other);
    if (creased(&a) || creased(&b)) return;
    double worst = 0, apart = 0;
    for (int k = 1; k < 8; k++) {
        double wa[3] = {0, 0, 0}, wb[3] = {0, 0, 0};
        wa[corner_of(t, u)] = wb[corner_of(other, u)] = k / 8.0;
        wa[corner_of(t, v)] = wb[corner_of(other, v)] = 1 - k / 8.0;
        lathe_vector p, q, np, nq;
        lathe__smooth_point(&p, &np, &a, wa);
        lathe__smooth_point(&q, &nq, &b, wb);
        double d = between(np, nq);
        if (d > worst) worst = d;
        apart = fmax(apart, lathe__vec_length(lathe__vec_sub(p, q)));
    }
    CHECK(apart < 1e-12 * 100);
    CHECK(worst < tolerance);
}

/* Every pair of triangles with a common edge, and the three patches of each triangle. */
static void check_continuity(const char *what, double tolerance) {
    lathe_smooth *smooth;
    lathe_smooth_source source = {vertex_count, triangle_count, positions, triangles, LATHE_WEIGHT_ANGLE};
    int before = check_failed;
    if (!CHECK(!lathe__smooth_open(&smooth, &source))) return;
    for (uint32_t t = 0; t < triangle_count; t++)
        for (uint32_t o = t + 1; o < triangle_count; o++)
            for (int k = 0; k < 3; k++) {
                uint32_t u = triangles[3 * t + (uint32_t)k], v = triangles[3 * t + (uint32_t)(k + 1) % 3];
                if (corner_of(o, u) < 3 && corner_of(o, v) < 3) check_edge(smooth, t, o, u, v, tolerance);
            }
    lathe_smooth_counts counts = lathe__smooth_count(smooth);
    CHECK_EQ(counts.edges, triangle_count * 3 / 2);
    CHECK(counts.creased_triangles * 20 <= triangle_count);
    for (uint32_t t = 0; t < triangle_count; t++) {
        lathe_smooth_patch p;
        lathe__smooth_triangle(&p, smooth, t);
        double worst = 0, off = 0;
        for (int e = 0; e < 3; e++)
            for (int k = 1; k < 6; k++) {
                /* From corner e + 1 to the split, on both sides of the line between patch e and patch e + 1. */
                double w = k / 6.0, here[3] = {0, w, 1 - w}, there[3] = {w, 0, 1 - w};
                lathe_vector x, y, nx, ny;
                lathe__smooth_piece(&x, &nx, &p, e, here);
                lathe__smooth_piece(&y, &ny, &p, (e + 1) % 3, there);
                off = fmax(off, lathe__vec_length(lathe__vec_sub(x, y)));
                double d = between(nx, ny);
                if (d > worst) worst = d;
            }
        CHECK(off < 1e-10 && worst < tolerance);
        for (int k = 0; k < 3; k++) {   /* through the corners, with their normals */
            double w[3] = {0, 0, 0};
            uint32_t v = triangles[3 * t + (uint32_t)k];
            lathe_vector x, n;
            w[k] = 1;
            lathe__smooth_point(&x, &n, &p, w);
            const double *vn = lathe__smooth_normals(smooth) + 3 * v;
            CHECK(lathe__vec_length(lathe__vec_sub(x, corner(v))) < 1e-12);
            double d = between(n, lathe__vec(vn[0], vn[1], vn[2]));
            CHECK(creased(&p) || !(d > tolerance));
        }
    }
    if (check_failed > before) fprintf(stderr, "  in %s\n", what);
    lathe__smooth_close(&smooth);
}

/* Evaluated, each edge is used once in each direction, and vertices of the source come first, where they were. */
static void check_evaluation(uint32_t k) {
    lathe_smooth *smooth;
    lathe_smooth_source source = {vertex_count, triangle_count, positions, triangles, LATHE_WEIGHT_ANGLE};
    uint32_t n, m;
    if (!CHECK(!lathe__smooth_open(&smooth, &source) && !lathe__smooth_size(smooth, k, &n, &m))) return;
    CHECK_EQ(m, triangle_count * k * k);
    CHECK_EQ((int64_t)n - m / 2, (int64_t)vertex_count - triangle_count / 2);   /* the Euler characteristic stays */
    double *p = malloc(3 * (size_t)n * sizeof *p), *normals = malloc(3 * (size_t)n * sizeof *normals);
    uint32_t *t = malloc(3 * (size_t)m * sizeof *t);
    if (!p || !normals || !t) abort();
    CHECK(!lathe__smooth_evaluate(smooth, k, p, normals, t));
    CHECK(!memcmp(p, positions, 3 * (size_t)vertex_count * sizeof *p));
    lathe_mesh mesh = {.vertex_count = n, .triangle_count = m, .lattice = malloc(n * sizeof *mesh.lattice), .triangles = (uint32_t(*)[3])t};
    if (!mesh.lattice) abort();
    for (size_t i = 0; i < 3 * (size_t)n; i++) mesh.lattice[i / 3][i % 3] = (int32_t)lround(p[i] * (1 << 24));
    lathe_mesh_report r;
    CHECK(!lathe__mesh_check(&r, &mesh, false));
    CHECK(!r.boundary_edges && !r.nonmanifold_edges && !r.misoriented_edges && !r.nonmanifold_vertices);
    double longest = 0;
    for (uint32_t i = 0; i < n; i++) longest = fmax(longest, fabs(lathe__vec_length(lathe__vec(normals[3 * i], normals[3 * i + 1], normals[3 * i + 2])) - 1));
    CHECK(longest < 1e-9);
    free(mesh.lattice);
    free(p);
    free(normals);
    free(t);
    lathe__smooth_close(&smooth);
}

/* Farthest that a sphere's smooth surface is from the sphere. */
static double sphere_error(uint32_t k) {
    lathe_smooth *smooth;
    lathe_smooth_source source = {vertex_count, triangle_count, positions, triangles, LATHE_WEIGHT_ANGLE};
    uint32_t n, m;
    double worst = 0;
    if (lathe__smooth_open(&smooth, &source) || lathe__smooth_size(smooth, k, &n, &m)) abort();
    double *p = malloc(3 * (size_t)n * sizeof *p);
    uint32_t *t = malloc(3 * (size_t)m * sizeof *t);
    if (!p || !t || lathe__smooth_evaluate(smooth, k, p, NULL, t)) abort();
    for (uint32_t i = 0; i < n; i++) worst = fmax(worst, fabs(lathe__vec_length(lathe__vec(p[3 * i], p[3 * i + 1], p[3 * i + 2])) - 1));
    free(p);
    free(t);
    lathe__smooth_close(&smooth);
    return worst;
}

/* Each triangle in four, on the unit sphere; then moved about on it. */
static void divide_sphere(double disorder) {
    lathe_smooth *smooth;
    lathe_smooth_source source = {vertex_count, triangle_count, positions, triangles, LATHE_WEIGHT_ANGLE};
    uint32_t n, m;
    if (lathe__smooth_open(&smooth, &source) || lathe__smooth_size(smooth, 2, &n, &m) || n > MOST) abort();
    double *p = malloc(3 * (size_t)n * sizeof *p);
    uint32_t *t = malloc(3 * (size_t)m * sizeof *t);
    if (!p || !t || lathe__smooth_evaluate(smooth, 2, p, NULL, t)) abort();
    memcpy(triangles, t, 3 * (size_t)m * sizeof *t);
    for (uint32_t v = 0; v < n; v++) {
        lathe_vector at = lathe__vec(p[3 * v] + disorder * noise(), p[3 * v + 1] + disorder * noise(), p[3 * v + 2] + disorder * noise());
        at = lathe__vec_unit(at);
        positions[3 * v] = at.x, positions[3 * v + 1] = at.y, positions[3 * v + 2] = at.z;
    }
    vertex_count = n, triangle_count = m;
    free(p);
    free(t);
    lathe__smooth_close(&smooth);
}

/* Mean square of the angles between estimated normals and the sphere's. */
static double normal_error(lathe_normal_weight weight) {
    lathe_smooth *smooth;
    lathe_smooth_source source = {vertex_count, triangle_count, positions, triangles, weight};
    double sum = 0;
    if (lathe__smooth_open(&smooth, &source)) abort();
    for (uint32_t v = 0; v < vertex_count; v++) {
        const double *n = lathe__smooth_normals(smooth) + 3 * v;
        double d = lathe__vec_length(lathe__vec_cross(corner(v), lathe__vec(n[0], n[1], n[2])));
        sum += d * d;
    }
    lathe__smooth_close(&smooth);
    return sum / vertex_count;
}

/* Farthest that the flat triangles are inside the unit sphere. */
static double flat_error(void) {
    double worst = 0;
    for (uint32_t t = 0; t < triangle_count; t++) {
        lathe_vector a = corner(triangles[3 * t]), b = corner(triangles[3 * t + 1]), c = corner(triangles[3 * t + 2]);
        worst = fmax(worst, 1 - lathe__vec_length(lathe__vec_scale(1.0 / 3, lathe__vec_add(a, lathe__vec_add(b, c)))));
    }
    return worst;
}

static void spheres(void) {
    make_octahedron();
    for (int i = 0; i < 3; i++) {
        divide_sphere(0);
        CHECK(sphere_error(6) < flat_error() / 8);
    }
    make_octahedron();
    for (int i = 0; i < 3; i++) {
        divide_sphere(0.15 / (2 << i));
        CHECK(sphere_error(6) < flat_error() / 4);
        CHECK(normal_error(LATHE_WEIGHT_ANGLE) < normal_error(LATHE_WEIGHT_AREA));
        CHECK(normal_error(LATHE_WEIGHT_ANGLE) < normal_error(LATHE_WEIGHT_DISTANCE));
        CHECK(normal_error(LATHE_WEIGHT_INVERSE) < normal_error(LATHE_WEIGHT_ANGLE));
    }
    check_continuity("a sphere in disorder", 1e-8);
}

/* A plane, its points moved within it, open at its rim: nothing leaves it. */
static void planes(void) {
    enum { N = 9 };
    vertex_count = N * N, triangle_count = 0;
    for (uint32_t i = 0; i < N; i++)
        for (uint32_t k = 0; k < N; k++) {
            double *p = positions + 3 * (i * N + k), x = i + 0.3 * noise(), y = k + 0.3 * noise();
            p[0] = x, p[1] = y, p[2] = 0.5 * x - 0.25 * y + 3;
            if (i && k) {
                uint32_t d = i * N + k;
                add_triangle(d - N - 1, d - 1, d);
                add_triangle(d - N - 1, d, d - N);
            }
        }
    lathe_smooth *smooth;
    lathe_smooth_source source = {vertex_count, triangle_count, positions, triangles, LATHE_WEIGHT_ANGLE};
    uint32_t n, m;
    if (!CHECK(!lathe__smooth_open(&smooth, &source) && !lathe__smooth_size(smooth, 5, &n, &m))) return;
    double *p = malloc(3 * (size_t)n * sizeof *p), *normals = malloc(3 * (size_t)n * sizeof *normals), off = 0, tilt = 0;
    uint32_t *t = malloc(3 * (size_t)m * sizeof *t);
    if (!p || !normals || !t || lathe__smooth_evaluate(smooth, 5, p, normals, t)) abort();
    lathe_vector up = lathe__vec_unit(lathe__vec(-0.5, 0.25, 1));
    for (uint32_t i = 0; i < n; i++) {
        off = fmax(off, fabs(p[3 * i + 2] - 0.5 * p[3 * i] + 0.25 * p[3 * i + 1] - 3));
        tilt = fmax(tilt, lathe__vec_length(lathe__vec_sub(up, lathe__vec(normals[3 * i], normals[3 * i + 1], normals[3 * i + 2]))));
    }
    CHECK(off < 1e-12 && tilt < 1e-9);
    CHECK_EQ(lathe__smooth_count(smooth).flat_edges, 0);
    free(p);
    free(normals);
    free(t);
    lathe__smooth_close(&smooth);
}

/* No spikes: a point stays within a share of its triangle's longest edge of where it would be on the flat one. */
static double worst_lift(void) {
    lathe_smooth *smooth;
    lathe_smooth_source source = {vertex_count, triangle_count, positions, triangles, LATHE_WEIGHT_ANGLE};
    double worst = 0;
    if (lathe__smooth_open(&smooth, &source)) abort();
    for (uint32_t t = 0; t < triangle_count; t++) {
        lathe_smooth_patch patch;
        lathe_vector c[3];
        double longest = 0, lift = 0;
        lathe__smooth_triangle(&patch, smooth, t);
        for (uint32_t k = 0; k < 3; k++) c[k] = corner(triangles[3 * t + k]);
        for (int k = 0; k < 3; k++) longest = fmax(longest, lathe__vec_length(lathe__vec_sub(c[k], c[(k + 1) % 3])));
        for (int i = 0; i <= 6; i++)
            for (int k = 0; i + k <= 6; k++) {
                double w[3] = {i / 6.0, k / 6.0, (6 - i - k) / 6.0};
                lathe_vector p, n, flat = lathe__vec(0, 0, 0);
                lathe__smooth_point(&p, &n, &patch, w);
                for (int e = 0; e < 3; e++) flat = lathe__vec_add(flat, lathe__vec_scale(w[e], c[e]));
                lift = fmax(lift, lathe__vec_length(lathe__vec_sub(p, flat)));
            }
        worst = fmax(worst, longest > 0 ? lift / longest : lift);
    }
    lathe__smooth_close(&smooth);
    return worst;
}

/* How far the four R_i of an edge are from any p L_i + q C_i + r C_(i+1) with constants p + q + r = 1: least squares for p and r in
 * R_i - C_i = p (L_i - C_i) + r (C_(i+1) - C_i). The edge is the first of a and runs the other way as edge `e` of b. */
static double printed_residual(const lathe_smooth_patch *a, const lathe_smooth_patch *b, int e) {
    double ll = 0, ls = 0, ss = 0, rl = 0, rs = 0, residual = 0;
    lathe_vector l[4], s[4], r[4];
    for (int i = 0; i < 4; i++) {
        lathe_vector c = a->at[0][LATHE_ROW0 + i];
        l[i] = lathe__vec_sub(a->at[0][LATHE_ROW1 + i], c);
        s[i] = lathe__vec_sub(a->at[0][LATHE_ROW0 + i + 1], c);
        r[i] = lathe__vec_sub(b->at[e][LATHE_ROW1 + 3 - i], c);
        ll += lathe__vec_dot(l[i], l[i]), ls += lathe__vec_dot(l[i], s[i]), ss += lathe__vec_dot(s[i], s[i]);
        rl += lathe__vec_dot(r[i], l[i]), rs += lathe__vec_dot(r[i], s[i]);
    }
    double det = ll * ss - ls * ls, p = (rl * ss - rs * ls) / det, q = (rs * ll - rl * ls) / det;
    for (int i = 0; i < 4; i++) {
        lathe_vector fit = lathe__vec_add(lathe__vec_scale(p, l[i]), lathe__vec_scale(q, s[i]));
        residual = fmax(residual, lathe__vec_length(lathe__vec_sub(r[i], fit)));
    }
    return residual;
}

/* The printed condition holds in a plane of equilateral triangles, and not on an octahedron, whose tangent planes agree all the same. */
static void printed_condition(void) {
    double h = sqrt(3) / 2;
    lathe_vector up = lathe__vec(0, 0, 1), a[3] = {lathe__vec(0, 0, 0), lathe__vec(1, 0, 0), lathe__vec(0.5, h, 0)};
    lathe_vector b[3] = {a[1], a[0], lathe__vec(0.5, -h, 0)}, ups[3] = {up, up, up};
    lathe_smooth_patch left, right;
    lathe__smooth_patch(&left, a, ups);
    lathe__smooth_patch(&right, b, ups);
    CHECK(printed_residual(&left, &right, 0) < 1e-14);
    lathe_vector x = lathe__vec(1, 0, 0), y = lathe__vec(0, 1, 0), down = lathe__vec(0, 0, -1), over[3] = {x, y, up}, under[3] = {y, x, down};
    lathe__smooth_patch(&left, over, over);
    lathe__smooth_patch(&right, under, under);
    CHECK(printed_residual(&left, &right, 0) > 0.01);
}

/* Repeated corners, equal positions, edges of three triangles, normals that cancel, huge and tiny numbers: nothing breaks. */
static void hostile(void) {
    static const double scales[4] = {1, 1e-160, 1e150, 1e307};
    for (int round = 0; round < 400; round++) {
        vertex_count = 3 + next_random() % 8, triangle_count = 1 + next_random() % 24;
        for (uint32_t i = 0; i < 3 * vertex_count; i++) positions[i] = scales[round % 4] * ((int)(next_random() % 5) - 2);
        for (uint32_t i = 0; i < 3 * triangle_count; i++) triangles[i] = next_random() % vertex_count;
        lathe_smooth *smooth;
        lathe_smooth_source source = {vertex_count, triangle_count, positions, triangles, (lathe_normal_weight)(next_random() % LATHE_WEIGHT_COUNT)};
        uint32_t k = 1 + next_random() % 16, n, m, bad = 0;
        if (!CHECK(!lathe__smooth_open(&smooth, &source) && !lathe__smooth_size(smooth, k, &n, &m))) return;
        double *p = malloc(3 * (size_t)n * sizeof *p), *normals = malloc(3 * (size_t)n * sizeof *normals);
        uint32_t *t = malloc(3 * (size_t)m * sizeof *t);
        if (!p || !normals || !t || lathe__smooth_evaluate(smooth, k, p, normals, t)) abort();
        for (uint32_t i = 0; i < 3 * m; i++) bad += t[i] >= n;
        for (uint32_t i = 0; i < 3 * n; i++) bad += round % 4 < 3 ? !isfinite(p[i]) || !isfinite(normals[i]) : 0;
        CHECK_EQ(bad, 0);
        lathe_smooth_counts counts = lathe__smooth_count(smooth);
        CHECK(counts.flat_edges <= counts.edges && counts.creased_triangles <= triangle_count);
        free(p);
        free(normals);
        free(t);
        lathe__smooth_close(&smooth);
    }
}

/* The surface of a small random solid, as levels have them: slivers and all. */
static void make_voxels(void) {
    int32_t size[3] = {12, 12, 6}, origin[3] = {0, 0, 0}, slices[6] = {0, 1, 2, 3, 4, 5};
    lathe_mask mask;
    lathe_arena arena[2] = {{0}, {0}};
    lathe_mesh mesh = {0};
    lathe_surface_counts counts = {0};
    if (lathe__mask_new(&mask, size, origin)) abort();
    for (int w = 0; w < 6; w++)
        for (int v = 1; v < 11; v++)
            for (int u = 1; u < 11; u++)
                if (hypot(u - 5.5, v - 5.5) < 2.5 + w * 0.3 + noise()) lathe__mask_slice(&mask, w)[(size_t)v * (size_t)mask.row_words] |= (uint64_t)1 << u;
    if (lathe__build_surface(&mesh, arena, &mask, slices, 6, 30, 0, &counts) || mesh.vertex_count > MOST) abort();
    vertex_count = mesh.vertex_count, triangle_count = mesh.triangle_count;
    for (uint32_t i = 0; i < 3 * vertex_count; i++) positions[i] = mesh.lattice[i / 3][i % 3] / 65536.0;
    memcpy(triangles, mesh.triangles, triangle_count * sizeof *mesh.triangles);
    lathe_mesh_free(&mesh);
    lathe__mask_free(&mask);
    lathe__arena_free(&arena[0]);
    lathe__arena_free(&arena[1]);
}

/* Two octahedra as parts of one mesh, radius 1 and 2: each its own surface, with the patches' normals. */
static void worlds(void) {
    lathe_world_mesh world;
    memset(&world, 0, sizeof world);
    CHECK_EQ(lathe_world_mesh_smooth(&world, 17), LATHE_ERR_RANGE);
    make_octahedron();
    world = (lathe_world_mesh){.vertex_count = 12, .triangle_count = 16, .structure_count = 2};
    world.positions = malloc(36 * sizeof *world.positions);
    world.indices = malloc(48 * sizeof *world.indices);
    world.parts = calloc(2, sizeof *world.parts);
    if (!world.positions || !world.indices || !world.parts) abort();
    for (uint32_t i = 0; i < 36; i++) world.positions[i] = (float)positions[i % 18] * (i < 18 ? 1 : 2);
    for (uint32_t i = 0; i < 48; i++) world.indices[i] = triangles[i % 24] + (i < 24 ? 0 : 6);
    for (uint32_t i = 0; i < 2; i++) world.parts[i] = (struct lathe_world_part){7 + i, 6 * i, 6, 8 * i, 8};
    CHECK_EQ(lathe_world_mesh_smooth(&world, 0), LATHE_ERR_RANGE);
    CHECK(world.vertex_count == 12 && !world.normals);
    CHECK_EQ(lathe_world_mesh_smooth(&world, 4), LATHE_OK);
    const uint32_t n = 6 + 12 * 3 + 8 * 3, m = 8 * 16;
    CHECK(world.vertex_count == 2 * n && world.triangle_count == 2 * m && world.structure_count == 2);
    if (!CHECK(world.normals != NULL)) abort();
    double worst = 0, off = 0;
    for (uint32_t v = 0; v < 2 * n; v++) {
        const float *p = world.positions + 3 * v, *normal = world.normals + 3 * v;
        lathe_vector at = lathe__vec((double)p[0], (double)p[1], (double)p[2]);
        lathe_vector up = lathe__vec((double)normal[0], (double)normal[1], (double)normal[2]);
        worst = fmax(worst, acos(fmin(1, lathe__vec_dot(lathe__vec_unit(at), up))));
        off = fmax(off, fabs(lathe__vec_length(at) - (v < n ? 1 : 2)));
    }
    CHECK(worst < 0.2 && off < 0.1);   /* almost spheres */
    for (uint32_t i = 0; i < 2; i++) {
        const struct lathe_world_part *part = &world.parts[i];
        CHECK(part->structure == 7 + i && part->first_vertex == n * i && part->vertex_count == n);
        CHECK(part->first_triangle == m * i && part->triangle_count == m);
        for (uint32_t c = 3 * m * i; c < 3 * m * (i + 1); c++)
            if (world.indices[c] / n != i) CHECK(!"an index of the other part");
    }
    lathe_world_mesh_free(&world);
}

static void refused(void) {
    lathe_smooth *smooth = NULL;
    make_octahedron();
    lathe_smooth_source source = {vertex_count, 0, positions, triangles, LATHE_WEIGHT_ANGLE};
    CHECK_EQ(lathe__smooth_open(&smooth, &source), LATHE_ERR_RANGE);
    source.triangle_count = 8;
    triangles[5] = 6;
    CHECK_EQ(lathe__smooth_open(&smooth, &source), LATHE_ERR_RANGE);
    make_octahedron();
    positions[4] = NAN;
    CHECK_EQ(lathe__smooth_open(&smooth, &source), LATHE_ERR_RANGE);
    make_octahedron();
    if (!CHECK(!lathe__smooth_open(&smooth, &source))) return;
    uint32_t n, m;
    CHECK_EQ(lathe__smooth_size(smooth, 0, &n, &m), LATHE_ERR_RANGE);
    CHECK_EQ(lathe__smooth_size(smooth, 17, &n, &m), LATHE_ERR_RANGE);
    lathe__smooth_close(&smooth);
}

int main(void) {
    make_octahedron();
    check_continuity("the octahedron", 1e-9);
    double flat = sphere_error(1), coarse = 1 - sqrt(1.0 / 3), smooth = sphere_error(6);
    CHECK(flat < 1e-12);               /* the corners themselves */
    CHECK(smooth < coarse / 6);        /* the flat triangles' middles are 0.42 inside the sphere */
    check_evaluation(4);
    make_torus(12, 8, 0);
    check_continuity("the torus", 1e-9);
    for (int i = 0; i < 6; i++) {
        make_torus(9, 7, 0.1 + 0.04 * i);
        check_continuity("a torus in disorder", 1e-7);
        check_evaluation(3);
        CHECK(worst_lift() < 0.5);
    }
    for (int i = 0; i < 3; i++) {
        make_voxels();
        check_continuity("voxels", 1e-5);
        check_evaluation(2);
        CHECK(worst_lift() < 0.5);
    }
    spheres();
    planes();
    printed_condition();
    hostile();
    worlds();
    refused();
    return check_end();
}
