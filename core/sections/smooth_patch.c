/* Three quartic triangular Bezier patches for one triangle, from its corners and their normals [P 4, figures 12 and
 * 13].
 *
 * Each edge is a cubic, raised to degree four. Derivatives across it are k(t) V(t) + h(t) S(t): S the edge's own
 * derivative (quadratic), V the direction across it (linear, from end to end), k and h linear, fixed by the corners.
 * As S and V depend on the edge and its normals alone, the patches at both sides have the same tangent planes.
 * Inside, each point is the mean of three: derivatives are continuous. */
#include "smooth.h"
#include <string.h>

typedef lathe_vector vec;
#define add lathe__vec_add
#define sub lathe__vec_sub
#define scale lathe__vec_scale
#define dot lathe__vec_dot
#define cross lathe__vec_cross

static const int ROW[5] = {LATHE_ROW0, LATHE_ROW1, LATHE_ROW2, LATHE_ROW3, LATHE_ROW4};

static vec mean3(vec a, vec b, vec c) { return scale(1.0 / 3, add(a, add(b, c))); }
static vec mean2(vec a, vec b) { return scale(0.5, add(a, b)); }

/* ---- edges ---- */

/* Below this sine between edge and normal the edge has no direction in the tangent plane worth following (about 6
 * degrees). */
#define MIN_PROJECTION 0.1
/* Below this cosine between the directions across an edge at its ends, the direction between them is lost. */
#define MIN_ACROSS (-0.7)

/* The curve leaves along the edge's projection on the tangent plane (Piper). Its first control point lies as far
 * along as for the circular arc that makes this angle with its chord: 2 c / (3 (1 + cos)), between c/3 and 2c/3. The
 * projection's own third, which shrinks to nothing as the edge gets steep, leaves an octahedron three times as far
 * from its sphere. */
static vec tangent(vec edge, vec normal) {
    double chord = lathe__vec_length(edge);
    vec flat = sub(edge, scale(dot(edge, normal), normal));
    double length = lathe__vec_length(flat);
    if (!(length > MIN_PROJECTION * chord) || dot(normal, normal) == 0) return lathe__vec(0, 0, 0);
    double cosine = length / chord;
    return scale(2 * chord / (3 * (1 + (cosine < 1 ? cosine : 1))) / length, flat);
}

/* What both triangles at an edge know of it. */
typedef struct edge {
    vec c[4];      /* cubic */
    vec across[2]; /* units at its ends: normal x direction; zero when flat */
    bool flat;
} edge;

static void make_edge(edge *out, vec p, vec q, vec np, vec nq) {
    vec d = sub(q, p), t0 = tangent(d, np), t1 = tangent(scale(-1, d), nq);
    out->across[0] = lathe__vec_unit(cross(np, t0));
    out->across[1] = lathe__vec_unit(cross(t1, nq));
    out->flat = dot(t0, t0) == 0 || dot(t1, t1) == 0 || dot(out->across[0], out->across[1]) < MIN_ACROSS;
    if (out->flat) {
        t0 = scale(1.0 / 3, d);
        t1 = scale(-1, t0);
        out->across[0] = out->across[1] = lathe__vec(0, 0, 0);
    }
    out->c[0] = p;
    out->c[1] = add(p, t0);
    out->c[2] = add(q, t1);
    out->c[3] = q;
}

bool lathe__smooth_edge_flat(vec p, vec q, vec np, vec nq) {
    edge e;
    make_edge(&e, p, q, np, nq);
    return e.flat;
}

static void elevate(vec out[5], const vec c[4]) {
    out[0] = c[0];
    for (int i = 1; i < 4; i++) out[i] = add(scale(i / 4.0, c[i - 1]), scale(1 - i / 4.0, c[i]));
    out[4] = c[3];
}

/* ---- tangent points ---- */

/* v = k * across + h * along, along not a unit; what is left over (at flat edges only) is lost. */
static void split(double *k, double *h, vec v, vec across, vec along) {
    double length = dot(along, along);
    *k = dot(v, across);
    *h = length > 0 ? dot(v, along) / length : 0;
}

/* At a flat edge each side takes the direction of its own plane. */
static vec own_across(vec d, vec along) {
    double length = dot(along, along);
    return length > 0 ? lathe__vec_unit(sub(d, scale(dot(d, along) / length, along))) : lathe__vec(0, 0, 0);
}

/* The two middle points of row 1, its ends being there. Products in Bernstein form: linear times quadratic is cubic. */
static void tangent_points(vec *at, const edge *e) {
    const vec *c = at + LATHE_ROW0;
    vec *row = at + LATHE_ROW1, s[3], v[3];
    for (int i = 0; i < 3; i++) s[i] = scale(0.75, sub(e->c[i + 1], e->c[i]));
    vec d0 = sub(row[0], c[0]), d3 = sub(row[3], c[3]);
    v[0] = e->flat ? own_across(d0, s[0]) : e->across[0];
    v[2] = e->flat ? own_across(d3, s[2]) : e->across[1];
    v[1] = mean2(v[0], v[2]);
    double k0, k1, h0, h1;
    split(&k0, &h0, d0, v[0], s[0]);
    split(&k1, &h1, d3, v[2], s[2]);
    vec d1 = add(add(scale(k1, v[0]), scale(2 * k0, v[1])), add(scale(h1, s[0]), scale(2 * h0, s[1])));
    vec d2 = add(add(scale(2 * k1, v[1]), scale(k0, v[2])), add(scale(2 * h1, s[1]), scale(h0, s[2])));
    row[1] = add(c[1], scale(1.0 / 3, d1));
    row[2] = add(c[2], scale(1.0 / 3, d2));
}

/* ---- inside ---- */

/* The middle points of row 2 are free. They are those of one quartic triangle over all three patches, whose own
 * inner points are the mean of what its two edges ask for: so a surface that is one quartic comes out exactly. */
static void middle_points(lathe_smooth_patch *out) {
    vec inner[3];
    for (int e = 0; e < 3; e++) {
        const vec *next = out->at[e], *before = out->at[(e + 2) % 3];
        vec a = sub(scale(3, next[LATHE_ROW1 + 1]), add(next[1], next[2]));
        vec b = sub(scale(3, before[LATHE_ROW1 + 2]), add(before[2], before[3]));
        inner[e] = mean2(a, b);
    }
    vec centre = mean3(inner[0], inner[1], inner[2]);
    for (int e = 0; e < 3; e++)
        out->at[e][LATHE_ROW2 + 1] = mean3(out->at[e][LATHE_ROW1 + 1], out->at[e][LATHE_ROW1 + 2], centre);
}

/* On the line from corner e to the split, which patch e - 1 (at its right end) and patch e (at its left end) share. */
static void set_spoke(lathe_smooth_patch *out, int e, int row, vec p) {
    out->at[e][ROW[row]] = p;
    out->at[(e + 2) % 3][ROW[row] + 4 - row] = p;
}

static void spokes(lathe_smooth_patch *out, int row) {
    vec p[3];
    for (int e = 0; e < 3; e++) {
        const vec *next = out->at[e] + ROW[row - 1], *before = out->at[(e + 2) % 3] + ROW[row - 1];
        p[e] = mean3(next[0], next[1], before[4 - row]);
    }
    for (int e = 0; e < 3; e++) set_spoke(out, e, row, p[e]);
}

void lathe__smooth_patch(lathe_smooth_patch *out, const vec corner[3], const vec normal[3]) {
    edge edges[3];
    for (int e = 0; e < 3; e++) {
        int n = (e + 1) % 3;
        make_edge(&edges[e], corner[e], corner[n], normal[e], normal[n]);
        elevate(out->at[e] + LATHE_ROW0, edges[e].c);
        out->flat[e] = edges[e].flat;
    }
    spokes(out, 1);
    for (int e = 0; e < 3; e++) tangent_points(out->at[e], &edges[e]);
    spokes(out, 2);
    middle_points(out);
    spokes(out, 3);
    vec middle = mean3(out->at[0][LATHE_ROW3], out->at[1][LATHE_ROW3], out->at[2][LATHE_ROW3]);
    for (int e = 0; e < 3; e++) out->at[e][LATHE_ROW4] = middle;
}

/* ---- evaluation ---- */

/* de Casteljau; the last three points span the tangent plane. */
void lathe__smooth_piece(vec *point, vec *normal, const lathe_smooth_patch *patch, int e, const double w[3]) {
    vec b[5][5];
    for (int r = 0; r < 5; r++) memcpy(b[r], patch->at[e] + ROW[r], (size_t)(5 - r) * sizeof(vec));
    for (int degree = 4; degree > 1; degree--)
        for (int r = 0; r < degree; r++)
            for (int i = 0; i < degree - r; i++)
                b[r][i] = add(add(scale(w[0], b[r][i]), scale(w[1], b[r][i + 1])), scale(w[2], b[r + 1][i]));
    *normal = lathe__vec_unit(cross(sub(b[0][1], b[0][0]), sub(b[1][0], b[0][0])));
    *point = add(add(scale(w[0], b[0][0]), scale(w[1], b[0][1])), scale(w[2], b[1][0]));
}

void lathe__smooth_point(vec *point, vec *normal, const lathe_smooth_patch *patch, const double w[3]) {
    int far = w[0] < w[1] ? (w[0] < w[2] ? 0 : 2) : (w[1] < w[2] ? 1 : 2), e = (far + 1) % 3;
    double inside[3] = {w[e] - w[far], w[(e + 1) % 3] - w[far], 3 * w[far]};
    lathe__smooth_piece(point, normal, patch, e, inside);
}
