/* Checks of meshes with known faults, and self-intersections against brute force by separating axes. */
#include "../core/mesh.h"
#include "../core/mesh_intersect.h"
#include "check.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

typedef struct vec {
    int64_t x, y, z;
} vec;

static uint64_t seed = 1;
static uint32_t chance(uint32_t n) {
    seed = seed * 6364136223846793005u + 1442695040888963407u;
    return (uint32_t)(seed >> 33) % n;
}

static lathe_mesh_report check_mesh(int32_t (*lattice)[3], uint32_t vertices, uint32_t (*triangles)[3],
                                    uint32_t count) {
    lathe_mesh mesh = {vertices, count, lattice, triangles};
    lathe_mesh_report report;
    memset(&report, 0xAA, sizeof report);
    CHECK_EQ(lathe__mesh_check(&report, &mesh, true), LATHE_OK);
    return report;
}

static uint64_t faults(const lathe_mesh_report *r) {
    return r->boundary_edges + r->nonmanifold_edges + r->misoriented_edges + r->nonmanifold_vertices +
           r->degenerate_triangles + r->duplicate_positions + r->unused_vertices + r->bad_indices +
           r->self_intersections;
}

static int32_t corners[9][3] = {{0, 0, 0},   {10, 0, 0},  {0, 10, 0},  {0, 0, 10}, {-10, 0, 0},
                                {0, -10, 0}, {0, 0, -10}, {3, -20, 1}, {0, 0, 10}};

static void test_faults(void) {
    uint32_t t[12][3] = {{0, 2, 1}, {0, 1, 3}, {1, 2, 3}, {0, 3, 2}};
    lathe_mesh_report r = check_mesh(corners, 4, t, 4);
    CHECK_EQ(faults(&r), 0);
    CHECK_EQ(r.components, 1);
    CHECK_EQ(r.euler, 2);
    r = check_mesh(corners, 4, t, 3);
    CHECK_EQ(r.boundary_edges, 3);
    CHECK_EQ(r.nonmanifold_vertices, 3);
    CHECK_EQ(r.euler, 1);
    r = check_mesh(corners, 5, t, 4);
    CHECK_EQ(r.unused_vertices, 1);
    CHECK_EQ(faults(&r), 1);
    r = check_mesh(corners, 9, t, 4);
    CHECK_EQ(r.duplicate_positions, 1);
    CHECK_EQ(r.unused_vertices, 5);
    uint32_t flipped[4][3] = {{0, 1, 2}, {0, 1, 3}, {1, 2, 3}, {0, 3, 2}};
    r = check_mesh(corners, 4, flipped, 4);
    CHECK_EQ(r.misoriented_edges, 3);
    CHECK_EQ(r.boundary_edges + r.nonmanifold_edges, 0);
    uint32_t bad[5][3] = {{0, 2, 1}, {0, 1, 3}, {1, 2, 3}, {0, 3, 2}, {0, 4, 4000000000u}};
    r = check_mesh(corners, 4, bad, 5);
    CHECK_EQ(r.bad_indices, 1);
    CHECK_EQ(faults(&r), 1);
    uint32_t flat[2][3] = {{0, 1, 1}, {0, 1, 4}};
    r = check_mesh(corners, 5, flat, 2);
    CHECK_EQ(r.degenerate_triangles, 2);
}

/* Two tetrahedra that share corner 0; then edge 0-1; and a triangle used twice. */
static void test_contacts(void) {
    uint32_t at_corner[8][3] = {{0, 2, 1}, {0, 1, 3}, {1, 2, 3}, {0, 3, 2}, {0, 5, 4}, {0, 4, 6}, {4, 5, 6}, {0, 6, 5}};
    lathe_mesh_report r = check_mesh(corners, 7, at_corner, 8);
    CHECK_EQ(r.nonmanifold_vertices, 1);
    CHECK_EQ(faults(&r), 1);
    CHECK_EQ(r.components, 2);
    CHECK_EQ(r.euler, 3);
    uint32_t at_edge[8][3] = {{0, 2, 1}, {0, 1, 3}, {1, 2, 3}, {0, 3, 2}, {0, 5, 1}, {0, 1, 6}, {1, 5, 6}, {0, 6, 5}};
    r = check_mesh(corners, 7, at_edge, 8);
    CHECK_EQ(r.nonmanifold_edges, 1);
    CHECK_EQ(r.nonmanifold_vertices, 2);
    CHECK_EQ(r.components, 1);
    uint32_t twice[2][3] = {{0, 1, 2}, {2, 1, 0}};
    r = check_mesh(corners, 3, twice, 2);
    CHECK_EQ(r.self_intersections, 1);
    CHECK_EQ(r.boundary_edges, 0);
    r = check_mesh(corners, 0, twice, 0);
    CHECK_EQ(faults(&r), 0);
    CHECK_EQ(r.components, 0);
}

/* A double cone over a ring of n: its two apexes have n triangles each. */
static void test_large_fan(void) {
    enum { N = 400 };
    int32_t(*lattice)[3] = calloc(N + 2, sizeof *lattice);
    uint32_t(*t)[3] = calloc(2 * N, sizeof *t);
    if (!CHECK(lattice && t)) return;
    for (int32_t k = 0; k < N; k++) { /* a diamond: convex, its sides straight */
        int32_t side = k / (N / 4), s = k % (N / 4), rest = N / 4 - s;
        lattice[k][0] = side == 0 ? rest : side == 1 ? -s : side == 2 ? -rest : s;
        lattice[k][1] = side == 0 ? s : side == 1 ? rest : side == 2 ? -s : -rest;
        uint32_t after = (uint32_t)(k + 1) % N;
        memcpy(t[2 * k], ((uint32_t[3]){N, (uint32_t)k, after}), sizeof *t);
        memcpy(t[2 * k + 1], ((uint32_t[3]){N + 1, after, (uint32_t)k}), sizeof *t);
    }
    lattice[N][2] = 777;
    lattice[N + 1][2] = -777;
    lathe_mesh_report r = check_mesh(lattice, N + 2, t, 2 * N);
    CHECK_EQ(faults(&r), 0);
    CHECK_EQ(r.euler, 2);
    CHECK_EQ(r.components, 1);
    lattice[N + 1][2] = 778; /* now the lower apex is above the upper one: all touch or cross */
    r = check_mesh(lattice, N + 2, t, 2 * N);
    CHECK_EQ(r.self_intersections, 0);
    lattice[N + 1][2] = 777;
    r = check_mesh(lattice, N + 2, t, 2 * N);
    CHECK(r.self_intersections >= N);
    CHECK_EQ(r.duplicate_positions, 1);
    free(lattice);
    free(t);
}

static void test_float_duplicates(void) {
    int32_t lattice[4][3] = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 5}};
    lathe_mesh mesh = {4, 0, lattice, NULL};
    lathe_transform fine = {{{1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, 0}}},
                    coarse = {{{1, 0, 0, 1e9}, {0, 1, 0, 0}, {0, 0, -0.0, 0}}};
    uint64_t count = 99;
    CHECK_EQ(lathe__mesh_float_duplicates(&count, &mesh, &fine), LATHE_OK);
    CHECK_EQ(count, 0);
    CHECK_EQ(lathe__mesh_float_duplicates(&count, &mesh, &coarse), LATHE_OK);
    CHECK_EQ(count, 2);
}

static void test_world(void) {
    lathe_transform mirror = {{{0, -2, 0, 10}, {-3, 0, 0, 20}, {0, 0, 4, 30}}},
                    plain = {{{2, 0, 0, 0}, {0, 2, 0, 0}, {0, 0, 2, 0}}};
    int32_t lattice[1][3] = {{1, 2, 3}};
    uint32_t t[1][3] = {{0, 1, 2}}, indices[3];
    float p[3];
    lathe_mesh mesh = {1, 1, lattice, t};
    CHECK(lathe_transform_mirrors(&mirror) != lathe_transform_mirrors(&plain));
    lathe_mesh_positions(&mesh, &mirror, p);
    CHECK(p[0] == 6 && p[1] == 17 && p[2] == 42);
    lathe_mesh_indices(&mesh, &plain, indices);
    CHECK(indices[0] == 0 && indices[1] == 1 && indices[2] == 2);
    lathe_mesh_indices(&mesh, &mirror, indices);
    CHECK(lathe_transform_mirrors(&mirror) && indices[0] == 0 && indices[1] == 2 && indices[2] == 1);
}

/* ---- brute force ---- */

static vec make(const int32_t p[3]) { return (vec){p[0], p[1], p[2]}; }
static vec minus(vec a, vec b) { return (vec){a.x - b.x, a.y - b.y, a.z - b.z}; }
static int64_t dot(vec a, vec b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
static vec cross(vec a, vec b) { return (vec){a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x}; }
static bool is_zero(vec a) { return !a.x && !a.y && !a.z; }

static bool separates(vec axis, const vec p[3], const vec q[3]) {
    int64_t pl = dot(axis, p[0]), ph = pl, ql = dot(axis, q[0]), qh = ql;
    for (int k = 1; k < 3; k++) {
        int64_t a = dot(axis, p[k]), b = dot(axis, q[k]);
        pl = a < pl ? a : pl;
        ph = a > ph ? a : ph;
        ql = b < ql ? b : ql;
        qh = b > qh ? b : qh;
    }
    return ph < ql || qh < pl;
}

static bool apart(const vec p[3], const vec q[3]) {
    vec n = cross(minus(p[1], p[0]), minus(p[2], p[0])), m = cross(minus(q[1], q[0]), minus(q[2], q[0]));
    if (separates(n, p, q) || separates(m, p, q)) return true;
    for (int i = 0; i < 3; i++) {
        vec e = minus(p[(i + 1) % 3], p[i]), f = minus(q[(i + 1) % 3], q[i]);
        if (separates(cross(n, e), p, q) || separates(cross(m, f), p, q)) return true;
        for (int k = 0; k < 3; k++)
            if (separates(cross(e, minus(q[(k + 1) % 3], q[k])), p, q)) return true;
    }
    return false;
}

/* Direction d in the plane of b, c (normal n) lies in the wedge from b to c. */
static bool in_wedge(vec d, vec b, vec c, vec n) { return dot(cross(b, d), n) >= 0 && dot(cross(d, c), n) >= 0; }

static bool wedges_meet(vec b, vec c, vec d, vec e) {
    vec n = cross(b, c), m = cross(d, e), l = cross(n, m), k = {-l.x, -l.y, -l.z};
    if (!is_zero(l))
        return (in_wedge(l, b, c, n) && in_wedge(l, d, e, m)) || (in_wedge(k, b, c, n) && in_wedge(k, d, e, m));
    return in_wedge(d, b, c, n) || in_wedge(e, b, c, n) || in_wedge(b, d, e, m) || in_wedge(c, d, e, m);
}

static bool brute_meet(const lathe_mesh *mesh, uint32_t first, uint32_t second) {
    vec p[3], q[3];
    uint32_t *s = mesh->triangles[first], *t = mesh->triangles[second];
    int shared = 0, common[3], other_s = 0, other_t = 0;
    for (int k = 0; k < 3; k++) {
        p[k] = make(mesh->lattice[s[k]]);
        q[k] = make(mesh->lattice[t[k]]);
    }
    if (is_zero(cross(minus(p[1], p[0]), minus(p[2], p[0]))) || is_zero(cross(minus(q[1], q[0]), minus(q[2], q[0]))))
        return false;
    for (int k = 0; k < 3; k++) {
        if (s[k] == t[0] || s[k] == t[1] || s[k] == t[2])
            common[shared++] = k;
        else
            other_s = k;
        if (t[k] != s[0] && t[k] != s[1] && t[k] != s[2]) other_t = k;
    }
    if (shared == 3) return true;
    if (shared == 0) return !apart(p, q);
    vec a = p[common[0]];
    if (shared == 2) {
        vec ab = minus(p[common[1]], a), n = cross(ab, minus(p[other_s], a)), m = cross(ab, minus(q[other_t], a));
        return is_zero(cross(n, m)) && dot(n, m) > 0;
    }
    int k = common[0], l = t[0] == s[k] ? 0 : t[1] == s[k] ? 1 : 2;
    return wedges_meet(minus(p[(k + 1) % 3], a), minus(p[(k + 2) % 3], a), minus(q[(l + 1) % 3], a),
                       minus(q[(l + 2) % 3], a));
}

/* The same mesh at several scales: within 16 voxels, beyond, and at the ends of int32, where doubles no longer
 * suffice. */
static void test_intersections(void) {
    static const int64_t scales[4] = {1, 65536 * 5 + 1, 1 << 27, (1 << 29) - 1};
    uint64_t total = 0, wrong = 0;
    for (int round = 0; round < 6000; round++) {
        int32_t lattice[14][3], large[14][3];
        uint32_t triangles[24][3], n = 4 + chance(11), count = 2 + chance(23), span = 2 + chance(4);
        for (uint32_t k = 0; k < n; k++)
            for (int i = 0; i < 3; i++) lattice[k][i] = (int32_t)chance(i == 2 && round % 3 == 0 ? 2 : span);
        for (uint32_t k = 0; k < count; k++)
            for (int i = 0; i < 3; i++) triangles[k][i] = chance(n);
        lathe_mesh mesh = {n, count, lattice, triangles};
        uint64_t expected = 0, found = 99999;
        for (uint32_t a = 0; a < count; a++)
            for (uint32_t b = a + 1; b < count; b++) expected += brute_meet(&mesh, a, b);
        total += expected;
        mesh.lattice = large;
        for (int k = 0; k < 4; k++) {
            for (uint32_t v = 0; v < n; v++)
                for (int i = 0; i < 3; i++) large[v][i] = (int32_t)((lattice[v][i] - 2) * scales[k]);
            wrong += lathe__mesh_intersections(&found, &mesh) != LATHE_OK || found != expected;
        }
    }
    CHECK_EQ(wrong, 0);
    CHECK(total > 10000);
}

/* ---- large fans ---- */

static bool is_flat(const lathe_mesh *mesh, uint32_t k) {
    const uint32_t *t = mesh->triangles[k];
    return lathe__triangle_degenerate(mesh->lattice[t[0]], mesh->lattice[t[1]], mesh->lattice[t[2]]);
}

static uint64_t brute_count(const lathe_mesh *mesh, bool axes) {
    uint64_t found = 0;
    for (uint32_t a = 0; a < mesh->triangle_count; a++)
        for (uint32_t b = a + 1; !is_flat(mesh, a) && b < mesh->triangle_count; b++)
            found += axes ? brute_meet(mesh, a, b) : !is_flat(mesh, b) && lathe__triangles_meet(mesh, a, b);
    return found;
}

/* Few places, so that all that can coincide does: fans whose triangles overlap, apexes at one place, other triangles
 * through them. */
static void test_random_fans(void) {
    uint64_t total = 0, wrong = 0;
    for (int round = 0; round < 250; round++) {
        int32_t lattice[40][3], large[40][3];
        uint32_t triangles[170][3], count = 0, span = 2 + chance(6), apexes = 1 + chance(2), flat = chance(3);
        for (uint32_t k = 0; k < 40; k++)
            for (int i = 0; i < 3; i++) lattice[k][i] = i == 2 && !flat ? 0 : (int32_t)chance(i == 2 ? flat : span);
        for (uint32_t a = 0; a < apexes; a++)
            for (uint32_t k = 0, n = 66 + chance(10); k < n; k++) {
                uint32_t *t = triangles[count++], turn = chance(3);
                t[turn] = a;
                t[(turn + 1) % 3] = 2 + chance(38);
                t[(turn + 2) % 3] = chance(3) ? 2 + chance(38) : t[(turn + 1) % 3] ^ 1;
            }
        while (count < 160) {
            for (int i = 0; i < 3; i++) triangles[count][i] = chance(40);
            count++;
        }
        lathe_mesh mesh = {40, count, lattice, triangles};
        uint64_t expected = brute_count(&mesh, true), found = 0;
        total += expected;
        mesh.lattice = large;
        for (int k = 0; k < 3; k++) {
            int64_t scale = k == 0 ? 1 : k == 1 ? 65536 * 3 + 1 : (1 << 28) - 1;
            for (uint32_t v = 0; v < 40; v++)
                for (int i = 0; i < 3; i++) large[v][i] = (int32_t)((lattice[v][i] - 3) * scale);
            wrong += lathe__mesh_intersections(&found, &mesh) != LATHE_OK || found != expected;
        }
    }
    CHECK_EQ(wrong, 0);
    CHECK(total > 100000);
}

typedef struct cone_mesh {
    lathe_mesh mesh;
    uint32_t n;
} cone_mesh;

/* Fans from several apexes to one ring each, or to the same one; the ring is a flower with petals, tilted. */
static cone_mesh make_cones(uint32_t n, int cones, const double apex[][3], bool one_ring, int petals, double tilt) {
    uint32_t rings = one_ring ? 1 : (uint32_t)cones;
    cone_mesh c = {{n * rings + (uint32_t)cones, n * (uint32_t)cones, NULL, NULL}, n};
    c.mesh.lattice = calloc(c.mesh.vertex_count, sizeof *c.mesh.lattice);
    c.mesh.triangles = calloc(c.mesh.triangle_count, sizeof *c.mesh.triangles);
    if (!c.mesh.lattice || !c.mesh.triangles) abort();
    for (uint32_t r = 0; r < rings; r++)
        for (uint32_t k = 0; k < n; k++) {
            double a = 2 * 3.14159265358979323846 * k / n, size = 4e8 * (1 + 0.4 * sin(petals * a)) / (1 + r);
            int32_t *v = c.mesh.lattice[r * n + k];
            v[0] = (int32_t)(size * cos(a));
            v[1] = (int32_t)(size * sin(a));
            v[2] = (int32_t)(tilt * v[0] + tilt / 3 * v[1]) + (int32_t)r * 1000;
        }
    for (int a = 0; a < cones; a++) {
        uint32_t at = n * rings + (uint32_t)a, ring = one_ring ? 0 : (uint32_t)a * n;
        for (int i = 0; i < 3; i++) c.mesh.lattice[at][i] = (int32_t)apex[a][i];
        for (uint32_t k = 0; k < n; k++) {
            uint32_t *t = c.mesh.triangles[(uint32_t)a * n + k], after = ring + (k + 1) % n;
            t[0] = at;
            t[1 + a % 2] = ring + k;
            t[2 - a % 2] = after;
        }
    }
    return c;
}

static void free_cones(cone_mesh *c) {
    free(c->mesh.lattice);
    free(c->mesh.triangles);
}

/* As all pairs find it: apexes above, below, in the ring's plane, on it, at one place; beside the axis, so that cones
 * cross themselves and each other. */
static void test_cones(void) {
    static const double apexes[][3][3] = {{{0, 0, 3e8}, {0, 0, -3e8}, {0, 0, 1e8}},
                                          {{0, 0, 3e8}, {0, 0, 0}, {3e8, 1e8, 0}},
                                          {{0, 0, 2e9}, {1e5, 7, 2e9}, {0, 0, 2e9}},
                                          {{7e8, 2e8, 1e5}, {7e8, -2e8, -1e5}, {4e8, 0, 0}},
                                          {{2e8, 0, 0}, {-2e8, 0, 0}, {0, 5e7, 0}}};
    uint64_t total = 0;
    for (int k = 0; k < 40; k++) {
        cone_mesh c = make_cones(70 + chance(300), 1 + k % 3, apexes[k % 5], k & 8, (int)chance(6), k & 16 ? 0.3 : 0);
        uint64_t found = 0, expected = brute_count(&c.mesh, false);
        CHECK_EQ(lathe__mesh_intersections(&found, &c.mesh), LATHE_OK);
        CHECK_EQ(found, expected);
        total += expected;
        free_cones(&c);
    }
    CHECK(total > 1000);
}

/* A double cone of 200,000 triangles, and one whose apexes are both below and above: known by construction, and within
 * seconds only if not every pair is looked at (2 * 10^10 of them: minutes). */
static void test_huge_fan(void) {
    static const double outside[2][3] = {{0, 0, 6e8}, {1e7, 3e7, -2e8}}, same[2][3] = {{0, 0, 6e8}, {0, 0, 2e8}};
    for (int petals = 0; petals < 6; petals += 5)
        for (int k = 0; k < 2; k++) {
            cone_mesh c = make_cones(100000, 2, k ? same : outside, true, petals, k ? 0 : 0.25);
            lathe_mesh_report r;
            memset(&r, 0, sizeof r);
            CHECK_EQ(lathe__mesh_check(&r, &c.mesh, true), LATHE_OK);
            CHECK_EQ(faults(&r), 0);
            CHECK_EQ(r.euler, 2);
            free_cones(&c);
        }
}

/* Signs of nearly flat volumes at the ends of the range, known from the construction: d = c + e in the plane, then
 * one off. */
static void test_orientation(void) {
    int wrong = 0;
    for (int round = 0; round < 100000; round++) {
        int32_t a[3], b[3], c[3], d[3];
        for (int i = 0; i < 3; i++) {
            a[i] = (int32_t)chance(1u << 29) - (1 << 28);
            b[i] = (int32_t)chance(1u << 29) - (1 << 28);
            c[i] = (int32_t)chance(1u << 29) - (1 << 28);
            d[i] = b[i] + c[i] - a[i];
        }
        wrong += lathe__orient3d(a, b, c, d) != 0;
        vec n = cross(minus(make(b), make(a)), minus(make(c), make(a)));
        d[2]++;
        int sign = (n.z < 0) - (n.z > 0); /* seen from above, counter-clockwise a, b, c: negative */
        wrong += lathe__orient3d(a, b, c, d) != sign || lathe__orient3d(b, a, c, d) != -sign ||
                 lathe__orient3d(b, c, a, d) != sign;
    }
    CHECK_EQ(wrong, 0);
}

int main(void) {
    test_faults();
    test_contacts();
    test_large_fan();
    test_float_duplicates();
    test_world();
    test_orientation();
    test_intersections();
    test_random_fans();
    test_cones();
    test_huge_fan();
    return check_end();
}
