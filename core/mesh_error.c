/* Two-sided distance between a mesh and the isosurface: points spread evenly over each surface look for the nearest triangle of
 * the other. Coordinates are world voxels from the middle of the structure, in float; four triangles are tried at once. */
#include "marching_cubes.h"
#include "mesh.h"

/* Triangles along a curve, ready to be searched and sampled. */
typedef struct surface {
    lathe_soup soup;
    uint32_t packet_count;
    lathe_box_tree tree; /* its items are the packets */
    float *area;         /* of each packet */
    double total_area;
} surface;

/* All lengths are in units of the smallest spacing, so that no scan is too small or too large for float. */
struct lathe_reference {
    lathe_transform to_world; /* lattice -> world, from the middle */
    double unit_mm;
    lathe_curve curve; /* of both surfaces: where a point lies on it tells where to look first */
    surface surface;
};

static void surface_free(surface *s) {
    free(s->soup.packets);
    free(s->soup.key);
    free(s->area);
    lathe__box_tree_free(&s->tree);
    *s = (surface){0};
}

/* ---- four triangles at once ---- */

typedef struct vector4 {
    lathe_f4 x, y, z;
} vector4;

static inline vector4 load(const lathe_f4 corner[3]) { return (vector4){corner[0], corner[1], corner[2]}; }
static inline vector4 minus(vector4 a, vector4 b) { return (vector4){a.x - b.x, a.y - b.y, a.z - b.z}; }
static inline lathe_f4 dot(vector4 a, vector4 b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
static inline vector4 cross(vector4 a, vector4 b) {
    return (vector4){a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}

/* Squared distance from the origin to the segment from a along e. */
static inline lathe_f4 segment_distance(vector4 a, vector4 e, lathe_f4 length2) {
    lathe_f4 t = -dot(a, e) / lathe__max4(length2, lathe__f4(1e-30f));
    t = lathe__min4(lathe__max4(t, lathe__f4(0)), lathe__f4(1));
    vector4 d = {a.x + e.x * t, a.y + e.y * t, a.z + e.z * t};
    return dot(d, d);
}

/* Squared distances from p. A triangle whose height is below 1e-4 of its longest edge counts as its edges: its normal would
 * be noise, and its inside is no farther than that height. */
static inline lathe_f4 packet_distance(const lathe_packet *packet, const lathe_f4 p[3]) {
    vector4 at = load(p);
    vector4 a = minus(load(packet->corner[0]), at), b = minus(load(packet->corner[1]), at),
            c = minus(load(packet->corner[2]), at);
    vector4 ab = minus(b, a), bc = minus(c, b), ca = minus(a, c), n = cross(ab, bc);
    lathe_f4 lab = dot(ab, ab), lbc = dot(bc, bc), lca = dot(ca, ca), n2 = dot(n, n);
    lathe_f4 longest = lathe__max4(lab, lathe__max4(lbc, lca));
    lathe_f4 edges = lathe__min4(segment_distance(a, ab, lab), segment_distance(b, bc, lbc));
    edges = lathe__min4(edges, segment_distance(c, ca, lca));
    lathe_f4 zero = lathe__f4(0), height = dot(n, a);
    /* The origin's shadow is within when it lies to the left of each edge, seen along n: (edge x corner) . n >= 0. */
    lathe_i4 inside = (lathe_i4)(dot(cross(a, ab), n) >= zero) & (lathe_i4)(dot(cross(b, bc), n) >= zero) &
                      (lathe_i4)(dot(cross(c, ca), n) >= zero) & (lathe_i4)(n2 > 1e-8f * longest * longest);
    return lathe__select(inside, height * height / lathe__max4(n2, lathe__f4(1e-37f)), edges);
}

static inline float least(lathe_f4 x) {
    float a = x[0] < x[1] ? x[0] : x[1], b = x[2] < x[3] ? x[2] : x[3];
    return a < b ? a : b;
}

static inline lathe_f4 box_distance(const lathe_box_node *node, const lathe_f4 p[3]) {
    lathe_f4 sum = lathe__f4(0);
    for (int i = 0; i < 3; i++) {
        lathe_f4 d = lathe__max4(lathe__max4(node->low[i] - p[i], p[i] - node->high[i]), lathe__f4(0));
        sum += d * d;
    }
    return sum;
}

/* ---- the nearest triangle ---- */

/* Level 0: a packet; l: a node of the tree's level l - 1. */
typedef struct place {
    float distance;
    uint32_t level, index;
} place;
enum { STACK = 4 * LATHE_BOX_TREE_LEVELS };

/* Puts the children nearer than best on the stack, the nearest on top. Their memory is asked for now: on a large surface most
 * of the time goes into waiting for it. */
static inline int push_children(place *stack, int top, const surface *s, place of, const lathe_f4 p[3], float best) {
    const lathe_box_node *node = &s->tree.nodes[s->tree.first[of.level - 1] + of.index];
    lathe_f4 distance = box_distance(node, p);
    float d[4], lowest = INFINITY;
    int nearest_at = top;
    memcpy(d, &distance, sizeof d);
    for (int bits = lathe__bits4((lathe_i4)(distance < lathe__f4(best))); bits; bits &= bits - 1) {
        uint32_t k = (uint32_t)__builtin_ctz((unsigned)bits);
        place child = {d[k], of.level - 1, 4 * of.index + k};
        const char *memory = child.level ? (const char *)&s->tree.nodes[s->tree.first[child.level - 1] + child.index]
                                         : (const char *)&s->soup.packets[child.index];
        __builtin_prefetch(memory);
        __builtin_prefetch(memory + 64);
        if (!child.level) __builtin_prefetch(memory + 128);
        if (d[k] < lowest) {
            lowest = d[k];
            nearest_at = top;
        }
        stack[top++] = child;
    }
    if (nearest_at + 1 < top) {
        place swap = stack[top - 1];
        stack[top - 1] = stack[nearest_at];
        stack[nearest_at] = swap;
    }
    return top;
}

static inline float try_packet(const surface *s, uint32_t index, const lathe_f4 p[3], float best) {
    float d = least(packet_distance(&s->soup.packets[index], p));
    return d < best ? d : best;
}

/* along: the packet at the last point's place on the curve. */
typedef struct search {
    const surface *in;
    const lathe_curve *curve;
    uint32_t along;
} search;

/* The last packet that begins at or before the point's key, or the first: by doubling steps from the last search's, since
 * neighbours in space can be far apart on the curve. */
static inline uint32_t follow_curve(search *q, const float at[3]) {
    const uint32_t *key = q->in->soup.key;
    uint32_t want = lathe__curve_key(q->curve, at), low = q->along, high = low, step = 1, end = q->in->packet_count;
    while (low && key[low] > want) {
        high = low;
        low = low > step ? low - step : 0;
        step *= 2;
    }
    if (high == low)
        for (high++; high < end && key[high] <= want; step *= 2) {
            low = high;
            high = end - high > step ? high + step : end;
        }
    while (high - low > 1) {
        uint32_t middle = low + (high - low) / 2;
        if (key[middle] <= want)
            low = middle;
        else
            high = middle;
    }
    return q->along = low;
}

static inline void prefetch(const void *memory, size_t size) {
    for (size_t k = 0; k < size; k += 64) __builtin_prefetch((const char *)memory + k);
}

/* Squared distance from a point to the surface. along: its packet by follow_curve. A distance of at most enough may be returned
 * in place of a smaller one. */
static float nearest(const surface *s, const float at[3], uint32_t along, float enough) {
    lathe_f4 p[3] = {lathe__f4(at[0]), lathe__f4(at[1]), lathe__f4(at[2])};
    float best = try_packet(s, along, p, INFINITY);
    if (best > enough && along + 1 < s->packet_count) best = try_packet(s, along + 1, p, best);
    if (best > enough && along) best = try_packet(s, along - 1, p, best);
    place stack[STACK];
    int top = 0;
    stack[top++] = (place){0, s->tree.level_count, 0};
    while (top && best > enough) {
        place next = stack[--top];
        if (!(next.distance < best)) continue;
        if (next.level)
            top = push_children(stack, top, s, next, p, best);
        else
            best = try_packet(s, next.index, p, best);
    }
    return best;
}

/* ---- surfaces ---- */

/* packets are filled up to count: repeats the last triangle to the end of its packet, then measures and builds the tree. */
static lathe_status surface_finish(surface *s) {
    s->packet_count = (s->soup.count + 3) / 4;
    for (size_t k = s->soup.count; k % 4; k++)
        for (int c = 0; c < 3; c++)
            for (int i = 0; i < 3; i++) {
                float *row = (float *)&s->soup.packets[k / 4].corner[c][i];
                row[k % 4] = row[(s->soup.count - 1) % 4];
            }
    s->area = malloc(s->packet_count * sizeof *s->area);
    lathe_box *boxes = malloc(s->packet_count * sizeof *boxes);
    lathe_status status = s->area && boxes ? LATHE_OK : LATHE_ERR_MEMORY;
    for (uint32_t k = 0; status == LATHE_OK && k < s->packet_count; k++) {
        const lathe_packet *q = &s->soup.packets[k];
        vector4 a = load(q->corner[0]), n = cross(minus(load(q->corner[1]), a), minus(load(q->corner[2]), a));
        lathe_f4 n2 = dot(n, n);
        s->area[k] = 0;
        for (uint32_t i = 0; i < 4 && 4 * k + i < s->soup.count; i++) s->area[k] += sqrtf(n2[i]) / 2;
        s->total_area += (double)s->area[k];
        lathe_box_node node;
        for (int i = 0; i < 3; i++) {
            node.low[i] = lathe__min4(q->corner[0][i], lathe__min4(q->corner[1][i], q->corner[2][i]));
            node.high[i] = lathe__max4(q->corner[0][i], lathe__max4(q->corner[1][i], q->corner[2][i]));
        }
        boxes[k] = lathe__box_of_node(&node);
    }
    if (status == LATHE_OK) status = lathe__box_tree_build(&s->tree, boxes, s->packet_count);
    free(boxes);
    return status;
}

static void mesh_points(float (*out)[3], const lathe_mesh *mesh, const lathe_transform *to) {
    for (size_t k = 0; k < mesh->vertex_count; k++)
        for (int i = 0; i < 3; i++) {
            const double *m = to->m[i];
            out[k][i] =
                (float)(m[0] * mesh->lattice[k][0] + m[1] * mesh->lattice[k][1] + m[2] * mesh->lattice[k][2] + m[3]);
        }
}

static lathe_status surface_from_mesh(surface *s, const lathe_mesh *mesh, const float (*points)[3],
                                      const lathe_curve *curve) {
    size_t count = mesh->triangle_count;
    lathe_status status = LATHE_ERR_MEMORY;
    uint32_t *order = malloc(count * sizeof *order), *key = malloc(count * sizeof *key);
    float(*middle)[3] = malloc(count * sizeof *middle);
    s->soup.packets = malloc((count + 3) / 4 * sizeof *s->soup.packets);
    s->soup.key = malloc((count + 3) / 4 * sizeof *s->soup.key);
    if (!order || !key || !middle || !s->soup.packets || !s->soup.key) goto cleanup;
    s->soup.count = mesh->triangle_count;
    for (size_t k = 0; k < count; k++) {
        const uint32_t *t = mesh->triangles[k];
        for (int i = 0; i < 3; i++) middle[k][i] = (points[t[0]][i] + points[t[1]][i] + points[t[2]][i]) / 3;
    }
    if ((status = lathe__curve_order(order, key, (const float(*)[3])middle, s->soup.count, curve)) != LATHE_OK)
        goto cleanup;
    for (size_t k = 0; k < count; k += 4) s->soup.key[k / 4] = key[k];
    for (size_t k = 0; k < count; k++)
        for (int c = 0; c < 3; c++) lathe__packet_put(s->soup.packets, k, c, points[mesh->triangles[order[k]][c]]);
    status = surface_finish(s);
cleanup:
    free(order);
    free(key);
    free(middle);
    return status;
}

/* ---- sampling ---- */

typedef struct tally {
    double sum2;
    float max2;
} tally;

static float triangle_area(const lathe_packet *q, uint32_t k) {
    float u[3], v[3];
    for (int i = 0; i < 3; i++) {
        u[i] = q->corner[1][i][k] - q->corner[0][i][k];
        v[i] = q->corner[2][i][k] - q->corner[0][i][k];
    }
    float x = u[1] * v[2] - u[2] * v[1], y = u[2] * v[0] - u[0] * v[2], z = u[0] * v[1] - u[1] * v[0];
    return sqrtf(x * x + y * y + z * z) / 2;
}

/* A point of triangle k of the packet, evenly spread for 0 <= a, b < 1. */
static void triangle_point(float p[3], const lathe_packet *q, uint32_t k, double a, double b) {
    float root = (float)sqrt(a), s = 1 - root, t = root * (float)b;
    for (int i = 0; i < 3; i++) {
        float o = q->corner[0][i][k];
        p[i] = o + s * (q->corner[1][i][k] - o) + t * (q->corner[2][i][k] - o);
    }
}

/* Every (area / samples)-th point along the curve; within the triangles by the additive sequence of the plastic number. */
typedef struct walk {
    const surface *on;
    double step, before;
    size_t n;
    uint32_t packet;
} walk;

static void next_point(walk *w, float p[3]) {
    const surface *s = w->on;
    double want = ((double)w->n + 0.5) * w->step, turns = (double)(w->n & 0xFFFFFF);
    double a = turns * 0.7548776662466927, b = turns * 0.5698402909980532;
    while (w->packet + 1 < s->packet_count && w->before + (double)s->area[w->packet] <= want)
        w->before += (double)s->area[w->packet++];
    const lathe_packet *q = &s->soup.packets[w->packet];
    uint32_t k = 0, last = 4 * w->packet + 3 < s->soup.count ? 3 : s->soup.count - 1 - 4 * w->packet;
    for (double rest = want - w->before; k < last; k++) {
        rest -= (double)triangle_area(q, k);
        if (rest < 0) break;
    }
    triangle_point(p, q, k, a - floor(a), b - floor(b));
    w->n++;
}

/* Points are looked up in batches, so that the memory of a batch's first packets comes in together. */
enum { BATCH = 16 };

static void look_up(search *to, uint32_t along[BATCH], const float (*points)[3], size_t count) {
    for (size_t k = 0; k < count; k++) {
        along[k] = follow_curve(to, points[k]);
        prefetch(&to->in->soup.packets[along[k]], sizeof(lathe_packet));
        prefetch(&to->in->tree.nodes[along[k] / 4], sizeof(lathe_box_node));
    }
}

static tally sample_distances(const surface *from, search to, size_t samples) {
    tally t = {0};
    walk w = {from, from->total_area / (double)samples, 0, 0, 0};
    while (w.n < samples) {
        float p[BATCH][3];
        uint32_t along[BATCH], count = 0;
        for (; count < BATCH && w.n < samples; count++) next_point(&w, p[count]);
        look_up(&to, along, (const float(*)[3])p, count);
        for (uint32_t k = 0; k < count; k++) {
            float d = nearest(to.in, p[k], along[k], 0);
            t.sum2 += (double)d;
            t.max2 = d > t.max2 ? d : t.max2;
        }
    }
    return t;
}

/* Only the largest is asked for, so a search ends as soon as it cannot be that: mostly at the first packet. */
static float farthest_point(search to, const float (*points)[3], size_t count, float max2) {
    for (size_t k = 0; k < count; k += BATCH) {
        uint32_t along[BATCH];
        size_t n = count - k < BATCH ? count - k : BATCH;
        look_up(&to, along, points + k, n);
        for (size_t i = 0; i < n; i++) {
            float d = nearest(to.in, points[k + i], along[i], max2);
            max2 = d > max2 ? d : max2;
        }
    }
    return max2;
}

/* ---- the reference ---- */

static bool has_good_triangles(const lathe_mesh *mesh) {
    uint32_t n = mesh->vertex_count;
    for (size_t k = 0; k < mesh->triangle_count; k++) {
        const uint32_t *t = mesh->triangles[k];
        if (t[0] >= n || t[1] >= n || t[2] >= n) return false;
    }
    return true;
}

void lathe__reference_free(lathe_reference **reference) {
    if (!reference || !*reference) return;
    surface_free(&(*reference)->surface);
    free(*reference);
    *reference = NULL;
}

static void set_frame(lathe_reference *reference, const lathe_volume *volume, lathe_axis axis, const lathe_mask *mask) {
    lathe_transform *t = &reference->to_world;
    double unit = volume->spacing[0], extent = 0;
    for (int i = 1; i < 3; i++) unit = volume->spacing[i] < unit ? volume->spacing[i] : unit;
    *t = lathe__mask_transform(mask, axis, volume->affine);
    for (int i = 0; i < 3; i++) {
        double half = 0;
        t->m[i][3] = 0;
        for (int j = 0; j < 3; j++) {
            t->m[i][j] /= unit;
            double along = t->m[i][j] * LATHE_LATTICE_ONE * (mask->size[j] + 1) / 2;
            t->m[i][3] -= t->m[i][j] * LATHE_LATTICE_ONE * (mask->size[j] - 1) / 2;
            half += fabs(along);
        }
        extent = half > extent ? half : extent;
    }
    float e = (float)extent;
    reference->unit_mm = unit;
    reference->curve = lathe__curve_through(&(lathe_box){{-e, -e, -e}, {e, e, e}});
}

lathe_status lathe__reference_build(lathe_reference **out, const lathe_volume *volume, lathe_axis axis,
                                    const lathe_mask *mask, lathe_boundary boundary, double iso) {
    lathe_reference *reference = calloc(1, sizeof *reference);
    if (!reference) return LATHE_ERR_MEMORY;
    set_frame(reference, volume, axis, mask);
    float to_world[3][4];
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 4; j++)
            to_world[i][j] = (float)(reference->to_world.m[i][j] * (j < 3 ? LATHE_LATTICE_ONE : 1));
    lathe_field field = {mask, boundary == LATHE_BOUNDARY_ISO ? volume : NULL, axis, iso};
    surface *s = &reference->surface;
    const lathe_curve *curve = &reference->curve;
    lathe_status status = lathe__marching_cubes(&s->soup, &field, (const float(*)[4])to_world, curve);
    if (status == LATHE_OK) status = surface_finish(s);
    if (status == LATHE_OK)
        *out = reference;
    else
        lathe__reference_free(&reference);
    return status;
}

/* least2: what the largest squared distance of a vertex counts as at least. */
static lathe_status measure(lathe_metrics *out, const lathe_reference *reference, const lathe_mesh *mesh, size_t samples, float least2) {
    if (!mesh->triangle_count) return LATHE_ERR_EMPTY;
    if (!has_good_triangles(mesh)) return LATHE_ERR_RANGE;
    if (!samples) samples = 1;
    surface made = {0};
    float(*points)[3] = malloc((size_t)mesh->vertex_count * sizeof *points);
    if (!points) return LATHE_ERR_MEMORY;
    mesh_points(points, mesh, &reference->to_world);
    lathe_status status = surface_from_mesh(&made, mesh, (const float(*)[3])points, &reference->curve);
    if (status == LATHE_OK) {
        search to_reference = {&reference->surface, &reference->curve, 0}, to_mesh = {&made, &reference->curve, 0};
        tally there = sample_distances(&made, to_reference, samples);
        tally back = sample_distances(&reference->surface, to_mesh, samples);
        float max2 = there.max2 > back.max2 ? there.max2 : back.max2;
        max2 = max2 > least2 ? max2 : least2;
        max2 = farthest_point(to_reference, (const float(*)[3])points, mesh->vertex_count, max2);
        const double unit = reference->unit_mm;
        out->rms_mm = unit * sqrt((there.sum2 > back.sum2 ? there.sum2 : back.sum2) / (double)samples);
        out->max_mm = unit * sqrt((double)max2);
        out->area_mm2 = unit * unit * reference->surface.total_area;
    }
    surface_free(&made);
    free(points);
    return status;
}

lathe_status lathe__reference_measure(lathe_metrics *out, const lathe_reference *reference, const lathe_mesh *mesh,
                                      size_t samples) {
    return measure(out, reference, mesh, samples, 0);
}

lathe_status lathe__reference_within(bool *within, double *rms_mm, const lathe_reference *reference, const lathe_mesh *mesh, size_t samples,
                                     double limit_mm) {
    lathe_metrics m;
    float limit = (float)(limit_mm / reference->unit_mm);
    lathe_status status = measure(&m, reference, mesh, samples, limit * limit);
    if (status) return status;
    *rms_mm = m.rms_mm;
    *within = m.max_mm <= reference->unit_mm * sqrt((double)(limit * limit));
    return LATHE_OK;
}
