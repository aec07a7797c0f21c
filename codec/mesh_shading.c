/* Normals by area. Most of our triangles come in strips, as quadrangles between two chains of vertices, each next to the one before:
 * what a vertex gets from one strip is summed in registers, so that no sum waits for the one just stored. Vectors of four lanes, which
 * gcc and clang have on any machine. */
#include "mesh_shading.h"
#include <stdlib.h>
#include <string.h>

typedef float four __attribute__((vector_size(16)));
typedef double wide __attribute__((vector_size(32)));
typedef int32_t four_words __attribute__((vector_size(16)));
struct lathe_vertex_sum { four at, normal; };   /* the fourth is 0; x y z of a normal come as z x y */
typedef struct lathe_vertex_sum vertex_sum;

void lathe__mesh_shading_free(lathe_mesh_shading *s) {
    free(s->positions);
    free(s->normals);
    free(s->indices);
    free(s->sums);
    *s = (lathe_mesh_shading){0};
}

static lathe_status make_room(lathe_mesh_shading *s, const lathe_mesh *mesh) {
    if ((size_t)mesh->vertex_count + 4 <= s->vertices && mesh->triangle_count < s->triangles) return LATHE_OK;
    size_t vertices = s->vertices > (size_t)mesh->vertex_count + 4 ? s->vertices : (size_t)mesh->vertex_count + 4;
    size_t triangles = s->triangles > mesh->triangle_count ? s->triangles : (size_t)mesh->triangle_count + 1;
    lathe_mesh_shading fresh = {.positions = malloc(vertices * 12), .normals = malloc(vertices * 12), .indices = malloc(triangles * 12),
                                .sums = aligned_alloc(32, vertices * sizeof *fresh.sums), .vertices = vertices, .triangles = triangles};
    if (!fresh.positions || !fresh.normals || !fresh.indices || !fresh.sums) {
        lathe__mesh_shading_free(&fresh);
        return LATHE_ERR_MEMORY;
    }
    lathe__mesh_shading_free(s);
    *s = fresh;
    return LATHE_OK;
}

/* As lathe_mesh_positions has them: the same operations in the same order. */
static void place(lathe_mesh_shading *s, const lathe_mesh *mesh, const lathe_transform *transform) {
    const double(*m)[4] = transform->m;
    const wide x = {m[0][0], m[1][0], m[2][0], 0}, y = {m[0][1], m[1][1], m[2][1], 0}, z = {m[0][2], m[1][2], m[2][2], 0},
               o = {m[0][3], m[1][3], m[2][3], 0};
    float *p = s->positions;
    for (uint32_t i = 0; i < mesh->vertex_count; i++, p += 3) {
        const int32_t *v = mesh->lattice[i];
        wide at = ((x * (double)v[0] + y * (double)v[1]) + z * (double)v[2]) + o;
        four f = __builtin_convertvector(at, four);
        s->sums[i] = (vertex_sum){f, {0}};
        p[0] = f[0], p[1] = f[1], p[2] = f[2];
    }
}

static four turned(four v) {
#ifdef __clang__
    return __builtin_shufflevector(v, v, 1, 2, 0, 3);
#else
    return __builtin_shuffle(v, (four_words){1, 2, 0, 3});
#endif
}

/* z x y of the cross product. */
static four cross(four p, four q) { return p * turned(q) - turned(p) * q; }

static four where(four_words mask, four v) { return (four)(mask & (four_words)v); }

/* Triangles a b c, a c d or a b d, b c d, in this order. */
static bool is_quadrangle(const uint32_t (*t)[3]) {
    uint32_t a = t[0][0], b = t[0][1], c = t[1][1], d = t[1][2];
    bool from_a = (t[0][2] == c) & (t[1][0] == a), from_b = (t[0][2] == d) & (t[1][0] == b);   /* no branch tells which */
    return (from_a | from_b) & (a != c) & (b != d);
}

/* Adds the normals of the quadrangles that these triangles begin with, each next to the one before: its a and d were that one's b and c.
 * Returns how many triangles that was; 0: the first two are no quadrangle. */
static uint32_t add_strip(vertex_sum *sums, const uint32_t (*t)[3], uint32_t count) {
    if (count < 2 || !is_quadrangle(t)) return 0;
    uint32_t a = t[0][0], d = t[1][2], i = 0;
    four at_a = sums[a].at, at_d = sums[d].at, sum_a = sums[a].normal, sum_d = sums[d].normal;
    do {
        uint32_t b = t[0][1], c = t[1][1];
        bool along = t[0][2] == c;
        four at_b = sums[b].at, at_c = sums[c].at;
        four both = cross(at_c - at_a, at_d - at_b), first = cross(at_b - at_a, sums[t[0][2]].at - at_a), second = both - first;
        int32_t all = -(int32_t)along;
        four_words mask = {all, all, all, all};
        four one = where(mask, second), other = where(mask, first);
        sums[a].normal = sum_a + (first + one);
        sums[d].normal = sum_d + (both - other);
        sum_a = sums[b].normal + (both - one);
        sum_d = sums[c].normal + (second + other);
        a = b, d = c, at_a = at_b, at_d = at_c;
        i += 2, t += 2;
    } while (i + 1 < count && t[0][0] == a && t[1][2] == d && is_quadrangle(t));
    sums[a].normal = sum_a;
    sums[d].normal = sum_d;
    return i;
}

static void add_triangle(vertex_sum *sums, const uint32_t *t) {
    vertex_sum *a = &sums[t[0]], *b = &sums[t[1]], *c = &sums[t[2]];
    four n = cross(b->at - a->at, c->at - a->at);
    a->normal += n;
    b->normal += n;
    c->normal += n;
}

/* Indices are written where triangles have just been read. */
static void add_normals(lathe_mesh_shading *s, const lathe_mesh *mesh, bool mirrored) {
    const uint32_t(*t)[3] = (const uint32_t(*)[3])mesh->triangles;
    uint32_t *out = s->indices;
    for (uint32_t left = mesh->triangle_count; left;) {
        uint32_t n = add_strip(s->sums, t, left);
        if (!n) {
            add_triangle(s->sums, *t);
            n = 1;
        }
        left -= n;
        if (!mirrored) {
            memcpy(out, t, n * sizeof *t);
            t += n, out += 3 * (size_t)n;
        }
        for (; mirrored && n; n--, t++, out += 3) out[0] = t[0][0], out[1] = t[0][2], out[2] = t[0][1];
    }
}

/* 1 / sqrt(x) to 1e-7 of it; finite for 0. Newton's method from a guess by halving the exponent. */
static four inverse_root(four x) {
    four y = (four)(0x5f3759df - ((four_words)x >> 1)), half = x * 0.5f;
    for (int i = 0; i < 3; i++) y *= 1.5f - half * y * y;
    return y;
}

static void put_unit(float *normal, four n, float scale) {
    n *= scale;
    normal[0] = n[1], normal[1] = n[2], normal[2] = n[0];
}

/* Four at a time; there is room for four behind the last. */
static void make_unit(float *normals, const vertex_sum *sums, uint32_t count, float sign) {
    for (uint32_t i = 0; i < count; i += 4, sums += 4, normals += 12) {
        four a = sums[0].normal, b = sums[1].normal, c = sums[2].normal, d = sums[3].normal;
        four x = {a[0], b[0], c[0], d[0]}, y = {a[1], b[1], c[1], d[1]}, z = {a[2], b[2], c[2], d[2]};
        four scale = inverse_root(x * x + y * y + z * z) * sign;
        put_unit(normals, a, scale[0]);
        put_unit(normals + 3, b, scale[1]);
        put_unit(normals + 6, c, scale[2]);
        put_unit(normals + 9, d, scale[3]);
    }
}

lathe_status lathe__mesh_shade(lathe_mesh_shading *out, const lathe_mesh *mesh, const lathe_transform *transform) {
    lathe_status status = make_room(out, mesh);
    if (status) return status;
    bool mirrored = lathe_transform_mirrors(transform);
    memset(out->sums + mesh->vertex_count, 0, 4 * sizeof *out->sums);
    place(out, mesh, transform);
    add_normals(out, mesh, mirrored);
    make_unit(out->normals, out->sums, mesh->vertex_count, mirrored ? -1 : 1);
    return LATHE_OK;
}
