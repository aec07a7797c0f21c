/* A smooth surface through the vertices of a triangle mesh [P 4]: three quartic triangular Bezier patches for each
 * triangle, tangent planes continuous (VC1). Not in the decoder.
 *
 * Units are those of the positions given (world mm in Lathe's own use). Arrays of positions and normals are 3
 * doubles for each vertex. Everything is computed in double; hostile geometry (zero edges, opposed normals,
 * non-manifold meshes) is safe.
 *
 * Where the printed condition differs: R_i = p L_i + q C_i + r C_(i+1) with p, q, r constant along an edge asks both
 * its ends for the same p and r. But there the four points lie in the tangent planes and follow from the corners'
 * own tangents (else the three patches of a triangle would not join): two ends give four equations for two unknowns.
 * Even on regular solids, where p = -1 by symmetry, r is (1 + cos a) 2/3 at one end and 2 less that at the other, a
 * the angle between neighbouring edges: 1 at both only for six triangles around a vertex in a plane. So p, q and r
 * are linear along the edge here, as in Chiyokura and Kimura (1983): both sides' derivatives across an edge lie in
 * the planes of two fields that depend on the edge alone. tests/test_smooth.c has an octahedron where no constants
 * do. */
#ifndef LATHE_SMOOTH_H
#define LATHE_SMOOTH_H
#include "lathe.h"
#include <math.h>

#define LATHE_SMOOTH_MAX 16    /* most pieces of an edge */

typedef struct lathe_vector { double x, y, z; } lathe_vector;
static inline lathe_vector lathe__vec(double x, double y, double z) { return (lathe_vector){x, y, z}; }
static inline lathe_vector lathe__vec_add(lathe_vector a, lathe_vector b) {
    return lathe__vec(a.x + b.x, a.y + b.y, a.z + b.z);
}
static inline lathe_vector lathe__vec_sub(lathe_vector a, lathe_vector b) {
    return lathe__vec(a.x - b.x, a.y - b.y, a.z - b.z);
}
static inline lathe_vector lathe__vec_scale(double s, lathe_vector a) { return lathe__vec(s * a.x, s * a.y, s * a.z); }
static inline double lathe__vec_dot(lathe_vector a, lathe_vector b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
static inline lathe_vector lathe__vec_cross(lathe_vector a, lathe_vector b) {
    return lathe__vec(a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x);
}
static inline double lathe__vec_length(lathe_vector a) { return sqrt(lathe__vec_dot(a, a)); }
/* Of length 1, or zero if a is too short to have a direction. */
static inline lathe_vector lathe__vec_unit(lathe_vector a) {
    double length = lathe__vec_length(a);
    return length > 1e-150 && isfinite(length) ? lathe__vec_scale(1 / length, a) : lathe__vec(0, 0, 0);
}

/* ---- smooth_patch.c: one triangle ---- */

/* Points of a quartic patch by rows from the edge to the split: row r has 5 - r points, from corner e to corner e +
 * 1. */
enum { LATHE_ROW0 = 0, LATHE_ROW1 = 5, LATHE_ROW2 = 9, LATHE_ROW3 = 12, LATHE_ROW4 = 14, LATHE_PATCH_POINTS = 15 };
typedef struct lathe_smooth_patch {
    lathe_vector at[3][LATHE_PATCH_POINTS]; /* patch e lies at the edge from corner e to corner e + 1 (figure 12) */
    bool flat[3];                           /* edge e is straight, because its normals allow no curve: no VC1 along
                                             * it */
} lathe_smooth_patch;
/* corner: counter-clockwise; normal: unit vectors outwards (zero: none, its edges stay straight). */
void lathe__smooth_patch(lathe_smooth_patch *out, const lathe_vector corner[3], const lathe_vector normal[3]);
/* Is the edge between these two straight for want of better? The same for both directions. */
bool lathe__smooth_edge_flat(lathe_vector p, lathe_vector q, lathe_vector np, lathe_vector nq);
/* The point at barycentric coordinates (w[0] + w[1] + w[2] = 1, none negative) and the patch's normal there: a unit
 * vector, or zero where the patch has none. */
void lathe__smooth_point(lathe_vector *point, lathe_vector *normal, const lathe_smooth_patch *patch, const double w[3]);
/* The same inside patch e alone, at weights of corner e, corner e + 1 and the split. */
void lathe__smooth_piece(lathe_vector *point, lathe_vector *normal, const lathe_smooth_patch *patch, int e,
                         const double w[3]);

/* ---- smooth.c: a mesh ---- */

/* How a vertex's triangles share in its normal. Against a sphere's own normals, an octahedron three times halved and
 * moved about: printed 2.6 degrees RMS, area 2.0, angle 0.77, inverse 0.38: the print probably lost a "reciprocal".
 * On the voxels' slivers the order turns, as tiny triangles with any normal weigh most: the inverse moves ch2bet's
 * level 3 farthest (0.127 mm RMS; angle 0.111, printed 0.091) and straightens three times as many edges as the angle
 * does (1,449 against 418; printed 1,473), which is why the exports use the angle. */
typedef enum lathe_normal_weight {
    LATHE_WEIGHT_ANGLE,        /* the triangle's angle there */
    LATHE_WEIGHT_DISTANCE,     /* as printed: squared distance to the middle of the opposite edge */
    LATHE_WEIGHT_AREA,
    LATHE_WEIGHT_INVERSE,      /* its reciprocal */
    LATHE_WEIGHT_COUNT
} lathe_normal_weight;

typedef struct lathe_smooth_source {
    uint32_t vertex_count, triangle_count;
    const double *positions;   /* 3 * vertex_count, finite */
    const uint32_t *triangles; /* 3 * triangle_count, counter-clockwise from outside */
    lathe_normal_weight weight;
} lathe_smooth_source;

typedef struct lathe_smooth lathe_smooth;
/* Estimates normals and finds edges: 3 doubles for each vertex, 12 bytes for each triangle and 8 for each edge stay
 * allocated, 12 bytes for each vertex and 24 for each triangle more while it runs. The source's arrays stay the
 * caller's and must outlive the result. RANGE: no triangle, an index out of bounds, a position that is not finite;
 * LIMIT: more than 2^28 - 1 triangles; MEMORY. */
lathe_status lathe__smooth_open(lathe_smooth **out, const lathe_smooth_source *source);
void lathe__smooth_close(lathe_smooth **smooth);   /* NULL and a pointer to NULL are fine */

typedef struct lathe_smooth_counts {
    uint32_t edges, flat_edges;   /* flat: straight, since the normals at their ends allow no curve */
    uint32_t creased_triangles;   /* that have a flat edge: tangent planes may break along their edges, and along no
                                   * others */
} lathe_smooth_counts;
lathe_smooth_counts lathe__smooth_count(const lathe_smooth *smooth);
/* 3 doubles for each vertex of the source, units; valid until close. */
const double *lathe__smooth_normals(const lathe_smooth *smooth);
void lathe__smooth_triangle(lathe_smooth_patch *out, const lathe_smooth *smooth, uint32_t triangle);

/* Every edge in k pieces, every triangle in k * k: what evaluation writes. RANGE: k outside 1 .. 16; LIMIT: more
 * than 2^28 - 1 of either. */
lathe_status lathe__smooth_size(const lathe_smooth *smooth, uint32_t k, uint32_t *vertices, uint32_t *triangles);
/* Fills arrays of that size: 3 doubles for each vertex, 3 indices for each triangle. Vertices of the source come
 * first, in their order and at their places, then those on edges (shared by all triangles at it: the mesh is closed
 * and manifold if the source is), then inner ones. Normals are the patches' own; across a crease they are the mean.
 * normals may be NULL. */
lathe_status lathe__smooth_evaluate(const lathe_smooth *smooth, uint32_t k, double *positions, double *normals,
                                    uint32_t *triangles);

/* A lattice mesh at its transform as a source: positions and triangles are malloc'ed, the caller's, winding right.
 * MEMORY, RANGE. */
lathe_status lathe__smooth_mesh_arrays(double **positions, uint32_t **triangles, const lathe_mesh *mesh,
                                       const lathe_transform *transform);
#endif
