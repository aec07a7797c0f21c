/* See mesh_fan.h. All that the planes decide is certain: doubles with a bound of their error. */
#include "mesh_fan.h"
#include "box_tree.h"
#include "mesh_intersect.h"

enum { BIG = 64 }; /* up to here pairs by boxes are as fast */

/* ---- gathering ---- */

static uint32_t busiest_corner(const uint32_t *degree, const uint32_t t[3]) {
    uint32_t v = t[0];
    for (int k = 1; k < 3; k++)
        if (degree[t[k]] > degree[v] || (degree[t[k]] == degree[v] && t[k] < v)) v = t[k];
    return v;
}

static const int32_t *opposite(const lathe_fan *fan, uint32_t triangle, int which) {
    const uint32_t *t = fan->mesh->triangles[triangle];
    int k = t[0] == fan->apex ? 0 : t[1] == fan->apex ? 1 : 2;
    return fan->mesh->lattice[t[(k + 1 + which) % 3]];
}

static lathe_status sort_edges(lathe_fan *fan) {
    size_t n = fan->count;
    float(*middle)[3] = malloc(n * sizeof *middle);
    uint32_t *order = malloc(n * sizeof *order), *sorted = malloc(n * sizeof *sorted);
    lathe_status status = middle && order && sorted ? LATHE_OK : LATHE_ERR_MEMORY;
    lathe_box all = lathe__box_empty();
    for (size_t k = 0; !status && k < n; k++) {
        const int32_t *p = opposite(fan, fan->triangles[k], 0), *q = opposite(fan, fan->triangles[k], 1);
        for (int i = 0; i < 3; i++) middle[k][i] = ((float)p[i] + (float)q[i]) / 2;
        lathe__box_add(&all, middle[k]);
    }
    if (!status) {
        lathe_curve curve = lathe__curve_through(&all);
        status = lathe__curve_order(order, NULL, (const float(*)[3])middle, fan->count, &curve);
    }
    for (size_t k = 0; !status && k < n; k++) sorted[k] = fan->triangles[order[k]];
    if (!status) memcpy(fan->triangles, sorted, n * sizeof *sorted);
    free(middle);
    free(order);
    free(sorted);
    return status;
}

static void add_box(lathe_fan_box *box, const lathe_fan_box *more) {
    for (int i = 0; i < 3; i++) {
        if (more->low[i] < box->low[i]) box->low[i] = more->low[i];
        if (more->high[i] > box->high[i]) box->high[i] = more->high[i];
    }
}

static lathe_fan_box box_of_edge(const lathe_fan *fan, uint32_t triangle) {
    const int32_t *p = opposite(fan, triangle, 0), *q = opposite(fan, triangle, 1);
    lathe_fan_box box = {{p[0], p[1], p[2]}, {p[0], p[1], p[2]}}, end = {{q[0], q[1], q[2]}, {q[0], q[1], q[2]}};
    add_box(&box, &end);
    return box;
}

static size_t size_of_level(const lathe_fan *fan, uint32_t level) {
    size_t n = fan->count;
    for (; level; level--) n = (n + 3) / 4;
    return n;
}

static lathe_status build_tree(lathe_fan *fan) {
    size_t total = 0, n = fan->count;
    for (fan->level_count = 0;; n = (n + 3) / 4) {
        fan->first[fan->level_count++] = total;
        total += n;
        if (n == 1) break;
    }
    fan->boxes = malloc(total * sizeof *fan->boxes);
    if (!fan->boxes) return LATHE_ERR_MEMORY;
    for (uint32_t k = 0; k < fan->count; k++) fan->boxes[k] = box_of_edge(fan, fan->triangles[k]);
    for (uint32_t level = 1; level < fan->level_count; level++) {
        const lathe_fan_box *from = fan->boxes + fan->first[level - 1];
        lathe_fan_box *to = fan->boxes + fan->first[level];
        n = size_of_level(fan, level - 1);
        for (size_t k = 0; k < n; k++) {
            if (k % 4)
                add_box(&to[k / 4], &from[k]);
            else
                to[k / 4] = from[k];
        }
    }
    return LATHE_OK;
}

/* Sorts the triangles by their fans: those of no fan stay in the list. start: vertex -> where its fan begins. */
static void deal(lathe_fans *out, const lathe_mesh *mesh, const uint32_t *degree, uint32_t *start, uint32_t *triangles,
                 uint32_t *count) {
    uint32_t sum = 0, kept = 0;
    for (uint32_t k = 0; k < *count; k++) {
        uint32_t v = busiest_corner(degree, mesh->triangles[triangles[k]]);
        if (degree[v] > BIG) out->count += !start[v]++;
    }
    for (uint32_t v = 0; v < mesh->vertex_count; v++) {
        uint32_t n = start[v];
        start[v] = sum;
        sum += n;
    }
    for (uint32_t k = 0; k < *count; k++) {
        uint32_t v = busiest_corner(degree, mesh->triangles[triangles[k]]);
        if (degree[v] > BIG)
            out->triangles[start[v]++] = triangles[k];
        else
            triangles[kept++] = triangles[k];
    }
    *count = kept;
}

/* end: vertex -> where its fan ends. */
static lathe_status build_fans(lathe_fans *out, const lathe_mesh *mesh, const uint32_t *end) {
    uint32_t made = 0, from = 0;
    out->fans = calloc((size_t)out->count + 1, sizeof *out->fans);
    if (!out->fans) return LATHE_ERR_MEMORY;
    for (uint32_t v = 0; v < mesh->vertex_count; v++) {
        if (end[v] == from) continue;
        lathe_fan *fan = &out->fans[made++];
        *fan = (lathe_fan){.mesh = mesh, .apex = v, .count = end[v] - from, .triangles = out->triangles + from};
        from = end[v];
        lathe_status status = sort_edges(fan);
        if (!status) status = build_tree(fan);
        if (status) return status;
    }
    return LATHE_OK;
}

lathe_status lathe__fans_gather(lathe_fans *out, const lathe_mesh *mesh, uint32_t *triangles, uint32_t *count) {
    lathe_fans fans = {0};
    lathe_status status = LATHE_OK;
    uint32_t *degree = calloc((size_t)mesh->vertex_count + 1, sizeof *degree), *start = NULL;
    bool any = false;
    *out = fans;
    if (!degree) return LATHE_ERR_MEMORY;
    for (uint32_t k = 0; k < *count; k++)
        for (int i = 0; i < 3; i++) any |= ++degree[mesh->triangles[triangles[k]][i]] > BIG;
    if (any) {
        start = calloc((size_t)mesh->vertex_count + 1, sizeof *start);
        fans.triangles = malloc((size_t)*count * sizeof *fans.triangles);
        status = start && fans.triangles ? LATHE_OK : LATHE_ERR_MEMORY;
        if (!status) deal(&fans, mesh, degree, start, triangles, count);
        if (!status) status = build_fans(&fans, mesh, start);
    }
    free(degree);
    free(start);
    if (status)
        lathe__fans_free(&fans);
    else
        *out = fans;
    return status;
}

void lathe__fans_free(lathe_fans *fans) {
    for (uint32_t k = 0; fans->fans && k < fans->count; k++) free(fans->fans[k].boxes);
    free(fans->fans);
    free(fans->triangles);
    *fans = (lathe_fans){0};
}

/* ---- planes ---- */

/* A vector with, for each component, a bound of the sum of the sizes of the products it was computed from: each
 * rounding is within 2^-53 of that, and there are at most a dozen. */
typedef struct vector {
    double at[3], size[3];
} vector;
/* Through a point, with its normal: what lies behind it (strictly, for certain) need not be looked at. */
typedef struct plane {
    double through[3];
    vector normal;
} plane;
typedef struct query {
    const lathe_fan *fan;
    lathe_fan_box box; /* of the triangle */
    plane planes[4];
    int plane_count;
    uint32_t triangle;
    size_t from; /* the first place in the tree that counts */
    uint64_t found;
} query;

/* Differences of int32 are exact. */
static vector between(const int32_t *from, const int32_t *to) {
    vector v;
    for (int i = 0; i < 3; i++) {
        v.at[i] = (double)to[i] - from[i];
        v.size[i] = fabs(v.at[i]);
    }
    return v;
}

static vector cross(const vector *p, const vector *q) {
    vector v;
    for (int i = 0; i < 3; i++) {
        int j = i == 2 ? 0 : i + 1, k = 3 - i - j;
        v.at[i] = p->at[j] * q->at[k] - p->at[k] * q->at[j];
        v.size[i] = p->size[j] * q->size[k] + p->size[k] * q->size[j];
    }
    return v;
}

static const double ROUNDING = 0x1p-48; /* a dozen roundings, and those of the bound itself */

/* The certain sign of a scalar product; 0: not certain. */
static int sign_of(const vector *p, const vector *q) {
    double sum = 0, size = 0;
    for (int i = 0; i < 3; i++) {
        sum += p->at[i] * q->at[i];
        size += p->size[i] * q->size[i];
    }
    return fabs(sum) > ROUNDING * size ? (sum > 0 ? 1 : -1) : 0;
}

static bool is_behind(const plane *p, const lathe_fan_box *box) {
    double most = 0, size = 0;
    for (int i = 0; i < 3; i++) {
        double low = box->low[i] - p->through[i], high = box->high[i] - p->through[i], n = p->normal.at[i];
        most += n * (n > 0 ? high : low);
        size += p->normal.size[i] * (fabs(low) > fabs(high) ? fabs(low) : fabs(high));
    }
    return most + ROUNDING * size < 0;
}

static void add_plane(query *q, const int32_t *through, const vector *normal, int sign) {
    plane *p = &q->planes[q->plane_count++];
    *p = (plane){{through[0], through[1], through[2]}, *normal};
    for (int i = 0; i < 3; i++) p->normal.at[i] *= sign;
}

/* The triangle has the apex as a corner: its own plane, from both sides, and those across it along both sides. A
 * part of the fan behind one of them has only the apex on it. */
static void planes_of_neighbour(query *q, const int32_t *apex, const int32_t *b, const int32_t *c) {
    vector ab = between(apex, b), ac = between(apex, c), normal = cross(&ab, &ac);
    vector beside_b = cross(&normal, &ab), beside_c = cross(&ac, &normal);
    add_plane(q, apex, &normal, 1);
    add_plane(q, apex, &normal, -1);
    add_plane(q, apex, &beside_b, 1);
    add_plane(q, apex, &beside_c, 1);
}

/* The apex is beside the triangle's plane: that plane, and those through the apex and a side. */
static void planes_of_pyramid(query *q, const int32_t *apex, const int32_t *const p[3], const vector *normal,
                              int side) {
    add_plane(q, p[0], normal, -side);
    for (int k = 0; k < 3; k++) {
        vector u = between(apex, p[k]), v = between(apex, p[(k + 1) % 3]), across = cross(&u, &v);
        add_plane(q, apex, &across, -side);
    }
}

/* The apex is in the triangle's plane, as far as is certain: the planes across it through the apex and a corner that
 * has both others on one side. */
static void planes_of_tangents(query *q, const int32_t *apex, const int32_t *const p[3], const vector *normal) {
    for (int k = 0; k < 3; k++) {
        vector to = between(apex, p[k]), across = cross(normal, &to);
        vector u = between(apex, p[(k + 1) % 3]), v = between(apex, p[(k + 2) % 3]);
        int side = sign_of(&across, &u);
        if (side && side == sign_of(&across, &v)) add_plane(q, apex, &across, side);
    }
}

/* Does the triangle's box touch that of a part of the fan, apex included? */
static bool touches(const query *q, const lathe_fan_box *box) {
    const int32_t *apex = q->fan->mesh->lattice[q->fan->apex];
    for (int i = 0; i < 3; i++) {
        if (q->box.high[i] < box->low[i] && q->box.high[i] < apex[i]) return false;
        if (q->box.low[i] > box->high[i] && q->box.low[i] > apex[i]) return false;
    }
    return true;
}

static void look(query *q, uint32_t level, size_t at) {
    const lathe_fan *fan = q->fan;
    const lathe_fan_box *box = &fan->boxes[fan->first[level] + at];
    if ((at + 1) << 2 * level <= q->from || !touches(q, box)) return;
    for (int k = 0; k < q->plane_count; k++)
        if (is_behind(&q->planes[k], box)) return;
    if (!level) {
        q->found += lathe__triangles_meet(fan->mesh, q->triangle, fan->triangles[at]);
        return;
    }
    size_t below = 4 * at, end = below + 4, n = size_of_level(fan, level - 1);
    for (; below < end && below < n; below++) look(q, level - 1, below);
}

static uint64_t ask(const lathe_fan *fan, uint32_t triangle, size_t from) {
    query q = {.fan = fan, .triangle = triangle, .from = from};
    const uint32_t *t = fan->mesh->triangles[triangle];
    const int32_t *apex = fan->mesh->lattice[fan->apex], *p[3];
    for (int k = 0; k < 3; k++) {
        p[k] = fan->mesh->lattice[t[k]];
        lathe_fan_box corner = {{p[k][0], p[k][1], p[k][2]}, {p[k][0], p[k][1], p[k][2]}};
        if (k)
            add_box(&q.box, &corner);
        else
            q.box = corner;
    }
    int at = t[0] == fan->apex ? 0 : t[1] == fan->apex ? 1 : t[2] == fan->apex ? 2 : -1;
    if (at >= 0) {
        planes_of_neighbour(&q, apex, p[(at + 1) % 3], p[(at + 2) % 3]);
    } else {
        vector u = between(p[0], p[1]), v = between(p[0], p[2]), normal = cross(&u, &v), to = between(p[0], apex);
        int side = sign_of(&normal, &to);
        if (side)
            planes_of_pyramid(&q, apex, p, &normal, side);
        else
            planes_of_tangents(&q, apex, p, &normal);
    }
    look(&q, fan->level_count - 1, 0);
    return q.found;
}

uint64_t lathe__fan_meetings(const lathe_fan *fan, uint32_t triangle) { return ask(fan, triangle, 0); }

uint64_t lathe__fan_own_meetings(const lathe_fan *fan) {
    uint64_t found = 0;
    for (uint32_t k = 0; k < fan->count; k++) found += ask(fan, fan->triangles[k], (size_t)k + 1);
    return found;
}
