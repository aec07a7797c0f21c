/* The smooth composite surface of a mesh [P 4]: normals, edges, and points on the patches of smooth_patch.c. */
#include "smooth.h"
#include <stdlib.h>
#include <string.h>

typedef lathe_vector vec;
#define MAX_COUNT ((1u << 28) - 1)

struct lathe_smooth {
    lathe_smooth_source source;
    double *normals;          /* 3 for each vertex */
    uint32_t (*side_edge)[3]; /* of each triangle: the edge from corner e to corner e + 1 */
    uint32_t (*edges)[2];     /* lower vertex, higher vertex */
    uint32_t edge_count;
    lathe_smooth_counts counts;
};

static vec load(const double *array, uint32_t index) {
    const double *at = array + (size_t)3 * index;
    return lathe__vec(at[0], at[1], at[2]);
}
static void store(double *array, size_t index, vec v) {
    double *at = array + 3 * index;
    at[0] = v.x, at[1] = v.y, at[2] = v.z;
}

/* ---- vetting ---- */

static lathe_status vet(const lathe_smooth_source *s) {
    if (!s->triangle_count || !s->vertex_count || (unsigned)s->weight >= LATHE_WEIGHT_COUNT) return LATHE_ERR_RANGE;
    if (s->triangle_count > MAX_COUNT || s->vertex_count > MAX_COUNT) return LATHE_ERR_LIMIT;
    for (size_t i = 0; i < (size_t)3 * s->vertex_count; i++)
        if (!isfinite(s->positions[i])) return LATHE_ERR_RANGE;
    for (size_t i = 0; i < (size_t)3 * s->triangle_count; i++)
        if (s->triangles[i] >= s->vertex_count) return LATHE_ERR_RANGE;
    return LATHE_OK;
}

/* ---- normals ---- */

static double angle(vec a, vec b) {
    return atan2(lathe__vec_length(lathe__vec_cross(a, b)), lathe__vec_dot(a, b));
}

static double weigh(lathe_normal_weight weight, vec p, vec q, vec r, double area) {
    vec a = lathe__vec_sub(q, p), b = lathe__vec_sub(r, p), middle = lathe__vec_scale(0.5, lathe__vec_add(a, b));
    switch (weight) {
    case LATHE_WEIGHT_DISTANCE: return lathe__vec_dot(middle, middle);
    case LATHE_WEIGHT_INVERSE: return 1 / fmax(lathe__vec_dot(middle, middle), 1e-100);
    case LATHE_WEIGHT_AREA: return area;
    default: return angle(a, b);
    }
}

static void estimate_normals(lathe_smooth *s) {
    const lathe_smooth_source *source = &s->source;
    for (size_t t = 0; t < source->triangle_count; t++) {
        const uint32_t *index = source->triangles + 3 * t;
        vec p[3];
        for (int e = 0; e < 3; e++) p[e] = load(source->positions, index[e]);
        vec n = lathe__vec_cross(lathe__vec_sub(p[1], p[0]), lathe__vec_sub(p[2], p[0])), unit = lathe__vec_unit(n);
        for (int e = 0; e < 3; e++) {
            double w = weigh(source->weight, p[e], p[(e + 1) % 3], p[(e + 2) % 3], lathe__vec_length(n));
            store(s->normals, index[e], lathe__vec_add(load(s->normals, index[e]), lathe__vec_scale(w, unit)));
        }
    }
    for (uint32_t v = 0; v < source->vertex_count; v++) store(s->normals, v, lathe__vec_unit(load(s->normals, v)));
}

/* ---- edges ---- */

typedef struct side {
    uint32_t high, triangle, corner;
} side;

static int compare_sides(const void *left, const void *right) {
    const side *a = left, *b = right;
    return a->high < b->high ? -1 : a->high > b->high;
}

static uint32_t lower(const uint32_t *index, int e) {
    uint32_t a = index[e], b = index[(e + 1) % 3];
    return a < b ? a : b;
}

/* Sides in buckets by their lower vertex: first[v] .. first[v + 1]. */
static void sort_sides(side *sides, size_t *first, const lathe_smooth_source *source) {
    for (size_t t = 0; t < source->triangle_count; t++)
        for (int e = 0; e < 3; e++) first[(size_t)lower(source->triangles + 3 * t, e) + 2]++;
    for (size_t v = 0; v < source->vertex_count; v++) first[v + 2] += first[v + 1];
    for (size_t t = 0; t < source->triangle_count; t++)
        for (int e = 0; e < 3; e++) {
            const uint32_t *index = source->triangles + 3 * t;
            uint32_t low = lower(index, e), high = index[e] ^ index[(e + 1) % 3] ^ low;
            sides[first[(size_t)low + 1]++] = (side){high, (uint32_t)t, (uint32_t)e};
        }
}

/* Numbers the edges; with edges == NULL it only counts them. */
static uint32_t number_edges(lathe_smooth *s, uint32_t (*edges)[2], const side *sides, const size_t *first) {
    uint32_t count = 0;
    for (uint32_t v = 0; v < s->source.vertex_count; v++)
        for (size_t i = first[v]; i < first[v + 1]; i++) {
            bool begins = i == first[v] || sides[i].high != sides[i - 1].high;
            count += begins;
            if (!edges) continue;
            if (begins) edges[count - 1][0] = v, edges[count - 1][1] = sides[i].high;
            s->side_edge[sides[i].triangle][sides[i].corner] = count - 1;
        }
    return count;
}

static lathe_status find_edges(lathe_smooth *s) {
    size_t total = (size_t)3 * s->source.triangle_count;
    size_t *first = calloc((size_t)s->source.vertex_count + 2, sizeof *first);
    side *sides = malloc(total * sizeof *sides);
    lathe_status status = first && sides ? LATHE_OK : LATHE_ERR_MEMORY;
    if (!status) {
        sort_sides(sides, first, &s->source);
        for (size_t v = 0; v < s->source.vertex_count; v++)
            if (first[v + 1] - first[v] > 1)
                qsort(sides + first[v], first[v + 1] - first[v], sizeof *sides, compare_sides);
        s->edge_count = number_edges(s, NULL, sides, first);
        s->edges = malloc(s->edge_count * sizeof *s->edges);
        if (!s->edges) status = LATHE_ERR_MEMORY;
    }
    if (!status) number_edges(s, s->edges, sides, first);
    free(first);
    free(sides);
    return status;
}

static bool edge_flat(const lathe_smooth *s, uint32_t edge) {
    const uint32_t *end = s->edges[edge];
    return lathe__smooth_edge_flat(load(s->source.positions, end[0]), load(s->source.positions, end[1]),
                                   load(s->normals, end[0]), load(s->normals, end[1]));
}

static void count_flat(lathe_smooth *s) {
    s->counts.edges = s->edge_count;
    for (uint32_t e = 0; e < s->edge_count; e++) s->counts.flat_edges += edge_flat(s, e);
    for (uint32_t t = 0; t < s->source.triangle_count && s->counts.flat_edges; t++)
        s->counts.creased_triangles +=
            edge_flat(s, s->side_edge[t][0]) || edge_flat(s, s->side_edge[t][1]) || edge_flat(s, s->side_edge[t][2]);
}

/* ---- open, close ---- */

lathe_status lathe__smooth_open(lathe_smooth **out, const lathe_smooth_source *source) {
    lathe_status status = vet(source);
    if (status) return status;
    lathe_smooth *s = calloc(1, sizeof *s);
    if (!s) return LATHE_ERR_MEMORY;
    s->source = *source;
    s->normals = calloc(source->vertex_count, 3 * sizeof *s->normals);
    s->side_edge = malloc(source->triangle_count * sizeof *s->side_edge);
    status = s->normals && s->side_edge ? LATHE_OK : LATHE_ERR_MEMORY;
    if (!status) estimate_normals(s);
    if (!status) status = find_edges(s);
    if (!status) count_flat(s);
    if (status)
        lathe__smooth_close(&s);
    else
        *out = s;
    return status;
}

void lathe__smooth_close(lathe_smooth **smooth) {
    if (!smooth || !*smooth) return;
    free((*smooth)->normals);
    free((*smooth)->side_edge);
    free((*smooth)->edges);
    free(*smooth);
    *smooth = NULL;
}

lathe_smooth_counts lathe__smooth_count(const lathe_smooth *smooth) { return smooth->counts; }

const double *lathe__smooth_normals(const lathe_smooth *smooth) { return smooth->normals; }

void lathe__smooth_triangle(lathe_smooth_patch *out, const lathe_smooth *smooth, uint32_t triangle) {
    const uint32_t *index = smooth->source.triangles + (size_t)3 * triangle;
    vec corner[3], normal[3];
    for (int e = 0; e < 3; e++) {
        corner[e] = load(smooth->source.positions, index[e]);
        normal[e] = load(smooth->normals, index[e]);
    }
    lathe__smooth_patch(out, corner, normal);
}

/* ---- evaluation ---- */

lathe_status lathe__smooth_size(const lathe_smooth *smooth, uint32_t k, uint32_t *vertices, uint32_t *triangles) {
    if (k < 1 || k > LATHE_SMOOTH_MAX) return LATHE_ERR_RANGE;
    uint64_t faces = smooth->source.triangle_count, points = smooth->source.vertex_count;
    points += (uint64_t)smooth->edge_count * (k - 1) + faces * (k - 1) * (k - (k > 1 ? 2 : 1)) / 2;
    if (points > MAX_COUNT || faces * k * k > MAX_COUNT) return LATHE_ERR_LIMIT;
    *vertices = (uint32_t)points;
    *triangles = (uint32_t)(faces * k * k);
    return LATHE_OK;
}

/* One triangle being evaluated: point (i, j) has weights (k - i - j, i, j) / k. */
typedef struct sheet {
    const lathe_smooth *smooth;
    uint32_t k, triangle;
    uint32_t at[LATHE_SMOOTH_MAX + 1][LATHE_SMOOTH_MAX + 1]; /* [i][j]: vertex of the result */
    bool shared[LATHE_SMOOTH_MAX + 1][LATHE_SMOOTH_MAX + 1];
} sheet;

/* The vertex `step` pieces from corner e towards corner e + 1. Those of an edge are numbered from its lower vertex. */
static uint32_t edge_vertex(const sheet *s, int e, uint32_t step) {
    const lathe_smooth *smooth = s->smooth;
    const uint32_t *index = smooth->source.triangles + (size_t)3 * s->triangle;
    uint32_t edge = smooth->side_edge[s->triangle][e];
    if (index[e] != smooth->edges[edge][0]) step = s->k - step;
    return smooth->source.vertex_count + edge * (s->k - 1) + step - 1;
}

static void number_sheet(sheet *s) {
    const lathe_smooth *smooth = s->smooth;
    const uint32_t *index = smooth->source.triangles + (size_t)3 * s->triangle;
    uint32_t k = s->k;
    uint32_t inner = smooth->source.vertex_count + smooth->edge_count * (k - 1);
    if (k > 2) inner += s->triangle * ((k - 1) * (k - 2) / 2);
    for (uint32_t i = 0; i <= k; i++)
        for (uint32_t j = 0; i + j <= k; j++) {
            bool edge = !i || !j || i + j == k;
            s->shared[i][j] = edge;
            if (!edge)
                s->at[i][j] = inner++;
            else if (i == k || j == k || i + j == 0)
                s->at[i][j] = index[i == k ? 1 : j == k ? 2 : 0];
            else
                s->at[i][j] = !j ? edge_vertex(s, 0, i) : i + j == k ? edge_vertex(s, 1, j) : edge_vertex(s, 2, k - j);
        }
}

static vec flat_normal(const lathe_smooth *smooth, uint32_t triangle) {
    const uint32_t *index = smooth->source.triangles + (size_t)3 * triangle;
    vec p = load(smooth->source.positions, index[0]);
    vec a = lathe__vec_sub(load(smooth->source.positions, index[1]), p),
        b = lathe__vec_sub(load(smooth->source.positions, index[2]), p);
    return lathe__vec_unit(lathe__vec_cross(a, b));
}

/* Points on an edge are evaluated by every triangle there: the curve is the same for all, so which one writes last
 * moves them by rounding at most. Their normals are summed. */
static void evaluate_sheet(const sheet *s, double *positions, double *normals) {
    lathe_smooth_patch patch;
    lathe__smooth_triangle(&patch, s->smooth, s->triangle);
    vec flat = flat_normal(s->smooth, s->triangle);
    for (uint32_t i = 0; i <= s->k; i++)
        for (uint32_t j = 0; i + j <= s->k; j++) {
            double k = s->k, w[3] = {(k - i - j) / k, i / k, j / k};
            uint32_t at = s->at[i][j];
            vec point, normal;
            lathe__smooth_point(&point, &normal, &patch, w);
            if (at >= s->smooth->source.vertex_count) store(positions, at, point);
            if (!normals) continue;
            if (lathe__vec_dot(normal, normal) == 0) normal = flat;
            store(normals, at, s->shared[i][j] ? lathe__vec_add(load(normals, at), normal) : normal);
        }
}

static uint32_t *write_triangles(uint32_t *out, const sheet *s) {
    for (uint32_t i = 0; i < s->k; i++)
        for (uint32_t j = 0; i + j < s->k; j++) {
            *out++ = s->at[i][j], *out++ = s->at[i + 1][j], *out++ = s->at[i][j + 1];
            if (i + j + 1 >= s->k) continue;
            *out++ = s->at[i + 1][j], *out++ = s->at[i + 1][j + 1], *out++ = s->at[i][j + 1];
        }
    return out;
}

lathe_status lathe__smooth_evaluate(const lathe_smooth *smooth, uint32_t k, double *positions, double *normals,
                                    uint32_t *triangles) {
    uint32_t vertices, faces;
    lathe_status status = lathe__smooth_size(smooth, k, &vertices, &faces);
    if (status) return status;
    memcpy(positions, smooth->source.positions, (size_t)3 * smooth->source.vertex_count * sizeof *positions);
    if (normals) memset(normals, 0, (size_t)3 * vertices * sizeof *normals);
    sheet s = {.smooth = smooth, .k = k};
    for (s.triangle = 0; s.triangle < smooth->source.triangle_count; s.triangle++) {
        number_sheet(&s);
        evaluate_sheet(&s, positions, normals);
        triangles = write_triangles(triangles, &s);
    }
    for (uint32_t v = 0; normals && v < vertices; v++) {
        vec n = lathe__vec_unit(load(normals, v));
        /* Opposite sides of a crease can cancel, and a vertex may be in no triangle. */
        store(normals, v, lathe__vec_dot(n, n) > 0 ? n : lathe__vec(0, 0, 1));
    }
    return LATHE_OK;
}

/* ---- lattice meshes ---- */

lathe_status lathe__smooth_mesh_arrays(double **positions, uint32_t **triangles, const lathe_mesh *mesh,
                                       const lathe_transform *transform) {
    if (!mesh->vertex_count || !mesh->triangle_count) return LATHE_ERR_RANGE;
    double *at = malloc((size_t)mesh->vertex_count * 3 * sizeof *at);
    uint32_t *index = malloc((size_t)mesh->triangle_count * 3 * sizeof *index);
    if (!at || !index) {
        free(at);
        free(index);
        return LATHE_ERR_MEMORY;
    }
    for (size_t v = 0; v < mesh->vertex_count; v++)
        for (size_t i = 0; i < 3; i++) {
            const double *m = transform->m[i];
            const int32_t *p = mesh->lattice[v];
            at[3 * v + i] = m[0] * p[0] + m[1] * p[1] + m[2] * p[2] + m[3];
        }
    lathe_mesh_indices(mesh, transform, index);
    *positions = at;
    *triangles = index;
    return LATHE_OK;
}
