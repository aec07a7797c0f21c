/* Self-intersections: a tree of boxes finds the pairs, but within large fans (mesh_fan.h); exact predicates decide. */
#include "mesh_intersect.h"
#include "box_tree.h"
#include "mesh_fan.h"

__extension__ typedef __int128 int128;
typedef const int32_t *point; /* three lattice coordinates */

static int sign128(int128 x) { return (x > 0) - (x < 0); }
static int sign64(int64_t x) { return (x > 0) - (x < 0); }

/* Differences of int32 have 33 bits: minors have 67, the determinant 102. */
static int orient3d_exact(const int64_t a[3], const int64_t b[3], const int64_t c[3]) {
    int128 x = (int128)b[1] * c[2] - (int128)b[2] * c[1];
    int128 y = (int128)b[2] * c[0] - (int128)b[0] * c[2];
    int128 z = (int128)b[0] * c[1] - (int128)b[1] * c[0];
    return sign128(a[0] * x + a[1] * y + a[2] * z);
}

/* The differences are exact doubles, so each of the six triple products errs by at most (1 + 2^-53)^5 - 1 of its
 * size (product, minor, product, two sums): 8 * 2^-53 of the sum of their sizes covers it, and the rounding of that
 * sum too. */
static int orient3d_filtered(const int64_t a[3], const int64_t b[3], const int64_t c[3]) {
    double p[3], size = 0, det = 0;
    for (int i = 0; i < 3; i++) {
        int j = i == 2 ? 0 : i + 1, k = 3 - i - j;
        double f = (double)b[j] * (double)c[k], g = (double)b[k] * (double)c[j];
        p[i] = (double)a[i] * (f - g);
        size += fabs((double)a[i]) * (fabs(f) + fabs(g));
    }
    det = (p[0] + p[1]) + p[2];
    if (fabs(det) > 0x1p-50 * size) return det > 0 ? 1 : -1;
    return orient3d_exact(a, b, c);
}

int lathe__orient3d(point a, point b, point c, point d) {
    int64_t p[3], q[3], r[3];
    uint64_t bits = 0;
    for (int i = 0; i < 3; i++) {
        p[i] = (int64_t)a[i] - d[i];
        q[i] = (int64_t)b[i] - d[i];
        r[i] = (int64_t)c[i] - d[i];
        bits |= (uint64_t)(p[i] ^ p[i] >> 63) | (uint64_t)(q[i] ^ q[i] >> 63) | (uint64_t)(r[i] ^ r[i] >> 63);
    }
    /* Within 16 voxels, as nearly always: minors below 2^41, three products below 2^61. */
    if (bits >> 20) return orient3d_filtered(p, q, r);
    return sign64(p[0] * (q[1] * r[2] - q[2] * r[1]) + p[1] * (q[2] * r[0] - q[0] * r[2]) +
                  p[2] * (q[0] * r[1] - q[1] * r[0]));
}

/* Sign of the area of a, b, c in the plane of the axes i and j. */
static int orient2d(point a, point b, point c, int i, int j) {
    int64_t x = (int64_t)b[i] - a[i], y = (int64_t)b[j] - a[j], z = (int64_t)c[i] - a[i], t = (int64_t)c[j] - a[j];
    uint64_t bits = (uint64_t)(x ^ x >> 63) | (uint64_t)(y ^ y >> 63) | (uint64_t)(z ^ z >> 63) | (uint64_t)(t ^ t >> 63);
    return bits >> 31 ? sign128((int128)x * t - (int128)y * z) : sign64(x * t - y * z);
}

bool lathe__triangle_degenerate(point a, point b, point c) {
    for (int i = 0; i < 3; i++) {
        int j = (i + 1) % 3;
        uint64_t x = (uint64_t)((int64_t)b[i] - a[i]), y = (uint64_t)((int64_t)b[j] - a[j]);
        uint64_t z = (uint64_t)((int64_t)c[i] - a[i]), t = (uint64_t)((int64_t)c[j] - a[j]);
        /* Not 0 modulo 2^64 is not 0; only the rest needs 128 bits. */
        if (x * t != y * z || orient2d(a, b, c, i, j) != 0) return false;
    }
    return true;
}

/* ---- coplanar: in the projection along an axis where the triangle keeps its area ---- */

typedef struct plane {
    int i, j;
} plane;

static plane projection(point a, point b, point c) {
    for (int i = 0; i < 2; i++)
        if (orient2d(a, b, c, i, i + 1)) return (plane){i, i + 1};
    return (plane){2, 0};
}

static bool between(point s, point t, point p, plane in) {
    for (int k = 0; k < 2; k++) {
        int i = k ? in.j : in.i;
        int32_t low = s[i] < t[i] ? s[i] : t[i], high = s[i] < t[i] ? t[i] : s[i];
        if (p[i] < low || p[i] > high) return false;
    }
    return true;
}

static bool segments_meet(point a, point b, point c, point d, plane in) {
    int oc = orient2d(a, b, c, in.i, in.j), od = orient2d(a, b, d, in.i, in.j);
    int oa = orient2d(c, d, a, in.i, in.j), ob = orient2d(c, d, b, in.i, in.j);
    if (oc * od < 0 && oa * ob < 0) return true;
    return (!oc && between(a, b, c, in)) || (!od && between(a, b, d, in)) || (!oa && between(c, d, a, in)) ||
           (!ob && between(c, d, b, in));
}

static bool triangle_holds(point a, point b, point c, point p, plane in) {
    int x = orient2d(a, b, p, in.i, in.j), y = orient2d(b, c, p, in.i, in.j), z = orient2d(c, a, p, in.i, in.j);
    return (x >= 0 && y >= 0 && z >= 0) || (x <= 0 && y <= 0 && z <= 0);
}

static bool coplanar_segment_meets(point s, point t, const point q[3]) {
    plane in = projection(q[0], q[1], q[2]);
    if (triangle_holds(q[0], q[1], q[2], s, in)) return true;
    return segments_meet(s, t, q[0], q[1], in) || segments_meet(s, t, q[1], q[2], in) ||
           segments_meet(s, t, q[2], q[0], in);
}

/* ---- in space ---- */

/* The closed segment s, t and the closed triangle q; os and ot are the sides of q's plane that s and t lie on. */
static bool segment_meets(point s, point t, int os, int ot, const point q[3]) {
    if (os * ot > 0) return false;
    if (!os && !ot) return coplanar_segment_meets(s, t, q);
    int x = lathe__orient3d(s, t, q[0], q[1]), y = lathe__orient3d(s, t, q[1], q[2]);
    if (x * y < 0) return false;
    int z = lathe__orient3d(s, t, q[2], q[0]);
    return x * z >= 0 && y * z >= 0;
}

/* On which side of q's plane do some points lie, as lathe__orient3d(q, point) says? Its normal serves for all; filtered as above. */
static void find_sides(int *side, const point *p, int count, const point q[3]) {
    double u[3], v[3], normal[3], size[3];
    for (int i = 0; i < 3; i++) u[i] = (double)q[1][i] - q[0][i], v[i] = (double)q[2][i] - q[0][i];
    for (int i = 0; i < 3; i++) {
        int j = i == 2 ? 0 : i + 1, k = 3 - i - j;
        double f = u[j] * v[k], g = u[k] * v[j];
        normal[i] = f - g;
        size[i] = fabs(f) + fabs(g);
    }
    for (int n = 0; n < count; n++) {
        double x = (double)p[n][0] - q[0][0], y = (double)p[n][1] - q[0][1], z = (double)p[n][2] - q[0][2];
        double det = (normal[0] * x + normal[1] * y) + normal[2] * z;
        bool sure = fabs(det) > 0x1p-50 * (size[0] * fabs(x) + size[1] * fabs(y) + size[2] * fabs(z));
        side[n] = !sure ? lathe__orient3d(q[0], q[1], q[2], p[n]) : det < 0 ? 1 : -1;
    }
}

static bool sides(int side[3], const point p[3], const point q[3]) {
    find_sides(side, p, 3, q);
    return !((side[0] > 0 && side[1] > 0 && side[2] > 0) || (side[0] < 0 && side[1] < 0 && side[2] < 0));
}

/* In one plane: does an edge of p have all of q strictly on its other side? */
static bool edge_parts(const point p[3], const point q[3], plane in) {
    int own = orient2d(p[0], p[1], p[2], in.i, in.j);
    for (int k = 0; k < 3; k++) {
        const point a = p[k], b = p[k == 2 ? 0 : k + 1];
        int n = 0;
        while (n < 3 && orient2d(a, b, q[n], in.i, in.j) * own < 0) n++;
        if (n == 3) return true;
    }
    return false;
}

static bool coplanar_meet(const point p[3], const point q[3]) {
    plane in = projection(p[0], p[1], p[2]);
    return !edge_parts(p, q, in) && !edge_parts(q, p, in);
}

/* No shared corner: two triangles meet just when an edge of one meets the other, or if they are in one plane and no edge parts them. */
static bool apart_meet(const point p[3], const point q[3]) {
    int ps[3], qs[3];
    if (!sides(ps, p, q) || !sides(qs, q, p)) return false;
    if (!ps[0] && !ps[1] && !ps[2]) return coplanar_meet(p, q);
    for (int k = 0; k < 3; k++) {
        int l = k == 2 ? 0 : k + 1;
        if (segment_meets(p[k], p[l], ps[k], ps[l], q) || segment_meets(q[k], q[l], qs[k], qs[l], p)) return true;
    }
    return false;
}

/* Corner 0 of both is shared. What they share beyond it reaches along a ray from it to the opposite edge of one of
 * them. */
static bool at_corner_meet(const point p[3], const point q[3]) {
    int ps[2], qs[2];
    find_sides(ps, p + 1, 2, q);
    if (ps[0] * ps[1] > 0) return false;
    find_sides(qs, q + 1, 2, p);
    if (qs[0] * qs[1] > 0) return false;
    return segment_meets(p[1], p[2], ps[0], ps[1], q) || segment_meets(q[1], q[2], qs[0], qs[1], p);
}

/* Edge a, b is shared: they overlap when c and d lie in one plane, on one side. */
static bool at_edge_meet(point a, point b, point c, point d) {
    if (lathe__orient3d(a, b, c, d)) return false;
    plane in = projection(a, b, c);
    return orient2d(a, b, c, in.i, in.j) == orient2d(a, b, d, in.i, in.j);
}

static bool triangles_meet(const lathe_mesh *mesh, uint32_t first, uint32_t second) {
    const uint32_t *s = mesh->triangles[first], *t = mesh->triangles[second];
    int shared = 0, at_s[3] = {0}, at_t[3] = {0};
    for (int k = 0; k < 3; k++)
        for (int l = 0; l < 3; l++)
            if (s[k] == t[l]) {
                at_s[shared] = k;
                at_t[shared++] = l;
            }
    if (shared == 3) return true;
    point p[3], q[3];
    int k = at_s[0], l = at_t[0];
    if (shared == 2) {
        k = 3 - at_s[0] - at_s[1];
        l = 3 - at_t[0] - at_t[1];
    }
    for (int i = 0; i < 3; i++) {
        p[i] = mesh->lattice[s[(k + i) % 3]];
        q[i] = mesh->lattice[t[(l + i) % 3]];
    }
    return shared == 2 ? at_edge_meet(p[1], p[2], p[0], q[0]) : shared == 1 ? at_corner_meet(p, q) : apart_meet(p, q);
}

bool lathe__triangles_meet(const lathe_mesh *mesh, uint32_t first, uint32_t second) {
    return triangles_meet(mesh, first, second);
}

/* ---- all pairs whose boxes touch ---- */

/* An item is a triangle in no fan, or the mesh's triangle_count plus the number of a fan. */
typedef struct join {
    const lathe_mesh *mesh;
    lathe_fans fans;
    uint32_t *items, count; /* triangles, then fans */
    const lathe_box_tree *tree;
    const uint32_t *order; /* the items as they are in the tree */
    uint64_t found;
} join;

static uint64_t fans_meet(const lathe_fan *a, const lathe_fan *b) {
    uint64_t found = 0;
    if (a->count < b->count) return fans_meet(b, a);
    for (uint32_t k = 0; k < b->count; k++) found += lathe__fan_meetings(a, b->triangles[k]);
    return found;
}

static uint64_t items_meet(const join *j, uint32_t a, uint32_t b) {
    uint32_t first = j->mesh->triangle_count;
    if (a < first && b < first) return triangles_meet(j->mesh, a, b);
    if (a < first) return lathe__fan_meetings(&j->fans.fans[b - first], a);
    if (b < first) return lathe__fan_meetings(&j->fans.fans[a - first], b);
    return fans_meet(&j->fans.fans[a - first], &j->fans.fans[b - first]);
}

static int touching(const lathe_box_node *a, int child, const lathe_box_node *b) {
    lathe_i4 mask = {-1, -1, -1, -1};
    for (int i = 0; i < 3; i++) {
        lathe_f4 low = lathe__f4(((const float *)&a->low[i])[child]),
                 high = lathe__f4(((const float *)&a->high[i])[child]);
        mask &= (lathe_i4)(low <= b->high[i]) & (lathe_i4)(high >= b->low[i]);
    }
    return lathe__bits4(mask);
}

/* Pairs of items below node a and node b >= a of one level; each once. */
static void join_nodes(join *j, uint32_t level, size_t a, size_t b) {
    const lathe_box_node *nodes = j->tree->nodes + j->tree->first[level];
    for (int i = 0; i < 4; i++) {
        int hits = touching(&nodes[a], i, &nodes[b]);
        if (a == b) hits &= level ? 15 << i : 14 << i;
        for (int k = 0; k < 4; k++) {
            if (!(hits >> k & 1)) continue;
            size_t first = 4 * a + (size_t)i, second = 4 * b + (size_t)k;
            if (level)
                join_nodes(j, level - 1, first, second);
            else
                j->found += items_meet(j, j->order[first], j->order[second]);
        }
    }
}

static bool is_sound(const lathe_mesh *mesh, const uint32_t t[3]) {
    uint32_t n = mesh->vertex_count;
    return t[0] < n && t[1] < n && t[2] < n &&
           !lathe__triangle_degenerate(mesh->lattice[t[0]], mesh->lattice[t[1]], mesh->lattice[t[2]]);
}

/* Rounding to float is monotone: boxes that touch on the lattice still touch. */
static void add_triangle(lathe_box *box, const lathe_mesh *mesh, const uint32_t t[3]) {
    for (int k = 0; k < 3; k++) {
        const int32_t *p = mesh->lattice[t[k]];
        lathe__box_add(box, (float[3]){(float)p[0], (float)p[1], (float)p[2]});
    }
}

static lathe_box item_box(const join *j, uint32_t item) {
    const lathe_mesh *mesh = j->mesh;
    lathe_box box = lathe__box_empty();
    if (item < mesh->triangle_count) {
        add_triangle(&box, mesh, mesh->triangles[item]);
        return box;
    }
    const lathe_fan *fan = &j->fans.fans[item - mesh->triangle_count];
    for (uint32_t k = 0; k < fan->count; k++) add_triangle(&box, mesh, mesh->triangles[fan->triangles[k]]);
    return box;
}

static lathe_curve box_middles(const join *j, float (*middle)[3]) {
    lathe_box all = lathe__box_empty();
    for (uint32_t k = 0; k < j->count; k++) {
        lathe_box box = item_box(j, j->items[k]);
        for (int i = 0; i < 3; i++) middle[k][i] = (box.low[i] + box.high[i]) / 2;
        lathe__box_add(&all, middle[k]);
    }
    return lathe__curve_through(&all);
}

static lathe_status join_items(join *j) {
    lathe_box_tree tree = {0};
    size_t n = j->count;
    uint32_t *order = malloc(n * sizeof *order);
    float(*middle)[3] = malloc(n * sizeof *middle);
    lathe_box *boxes = malloc(n * sizeof *boxes);
    lathe_status status = order && middle && boxes ? LATHE_OK : LATHE_ERR_MEMORY;
    if (!status) {
        lathe_curve curve = box_middles(j, middle);
        status = lathe__curve_order(order, NULL, (const float(*)[3])middle, j->count, &curve);
    }
    for (size_t k = 0; !status && k < n; k++) {
        order[k] = j->items[order[k]];
        boxes[k] = item_box(j, order[k]);
    }
    if (!status) status = lathe__box_tree_build(&tree, boxes, j->count);
    if (!status) {
        j->tree = &tree;
        j->order = order;
        join_nodes(j, tree.level_count - 1, 0, 0);
    }
    free(order);
    free(middle);
    free(boxes);
    lathe__box_tree_free(&tree);
    return status;
}

lathe_status lathe__mesh_intersections(uint64_t *out, const lathe_mesh *mesh) {
    join j = {.mesh = mesh};
    if (mesh->triangle_count > UINT32_MAX / 2) return LATHE_ERR_LIMIT;
    j.items = malloc(((size_t)mesh->triangle_count + 1) * sizeof *j.items);
    if (!j.items) return LATHE_ERR_MEMORY;
    for (uint32_t k = 0; k < mesh->triangle_count; k++)
        if (is_sound(mesh, mesh->triangles[k])) j.items[j.count++] = k;
    lathe_status status = lathe__fans_gather(&j.fans, mesh, j.items, &j.count);
    for (uint32_t k = 0; !status && k < j.fans.count; k++) {
        j.items[j.count++] = mesh->triangle_count + k; /* there is room: a fan took at least one triangle out */
        j.found += lathe__fan_own_meetings(&j.fans.fans[k]);
    }
    if (!status && j.count) status = join_items(&j);
    if (!status) *out = j.found;
    free(j.items);
    lathe__fans_free(&j.fans);
    return status;
}
