#include "voxelise.h"
#include "contour.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

typedef struct grid {
    int32_t dims[3];
    double origin[3], step[3]; /* lattice units: of voxel 0's centre, between centres */
    float *values;
} grid;

static int32_t centre_of(const grid *g, int axis, int32_t i) {
    return (int32_t)lround(g->origin[axis] + g->step[axis] * i);
}

/* Is the column at p within the triangle, seen along w? A column on an edge belongs to the triangle on one side of
 * it: to that on the left of the edge directed upwards (or, if level, to the left). */
static bool column_meets(const lathe_point t[3], lathe_point p) {
    bool turned = lathe__orient(t[0], t[1], t[2]) < 0;
    for (int k = 0; k < 3; k++) {
        lathe_point a = t[turned ? (k + 1) % 3 : k], b = t[turned ? k : (k + 1) % 3];
        int64_t s = lathe__orient(a, b, p);
        if (s < 0 || (s == 0 && !(b.y > a.y || (b.y == a.y && b.x < a.x)))) return false;
    }
    return true;
}

/* Turns over the voxels of one column above a height. */
static void toggle(grid *g, int32_t x, int32_t y, double height) {
    double first = ceil((height - g->origin[2]) / g->step[2]);
    for (int32_t z = first < 0 ? 0 : (int32_t)first; z < g->dims[2]; z++) {
        float *v = &g->values[((size_t)z * (size_t)g->dims[1] + (size_t)y) * (size_t)g->dims[0] + (size_t)x];
        *v = 1 - *v;
    }
}

static void clip_range(const grid *g, int axis, int32_t low, int32_t high, int32_t *first, int32_t *last) {
    *first = (int32_t)fmax(floor((low - g->origin[axis]) / g->step[axis]) - 1, 0);
    *last = (int32_t)fmin(ceil((high - g->origin[axis]) / g->step[axis]) + 1, g->dims[axis] - 1);
}

static void add_triangle(grid *g, const int32_t (*at)[3], const uint32_t v[3]) {
    lathe_point t[3];
    int32_t low[2] = {INT32_MAX, INT32_MAX}, high[2] = {INT32_MIN, INT32_MIN}, from[2], to[2];
    for (int k = 0; k < 3; k++) {
        t[k] = (lathe_point){at[v[k]][0], at[v[k]][1]};
        for (int a = 0; a < 2; a++) {
            if (at[v[k]][a] < low[a]) low[a] = at[v[k]][a];
            if (at[v[k]][a] > high[a]) high[a] = at[v[k]][a];
        }
    }
    int64_t area = lathe__orient(t[0], t[1], t[2]);
    if (!area) return;         /* upright: no column crosses it */
    for (int a = 0; a < 2; a++) clip_range(g, a, low[a], high[a], &from[a], &to[a]);
    for (int32_t y = from[1]; y <= to[1]; y++)
        for (int32_t x = from[0]; x <= to[0]; x++) {
            lathe_point p = {centre_of(g, 0, x), centre_of(g, 1, y)};
            if (!column_meets(t, p)) continue;
            double height = 0;
            for (int k = 0; k < 3; k++)
                height += (double)lathe__orient(p, t[(k + 1) % 3], t[(k + 2) % 3]) / (double)area *
                          ((double)at[v[k]][2] - at[v[0]][2]);
            toggle(g, x, y, height + at[v[0]][2]);
        }
}

lathe_status lathe__voxelise(lathe_volume **out, const lathe_mesh *mesh, const lathe_transform *transform,
                             double spacing, lathe_error *err) {
    grid g = {.values = NULL};
    double low[3], spacings[3] = {spacing, spacing, spacing}, voxels = 1;
    if (!(spacing > 0) || !isfinite(spacing))
        return lathe_fail(err, LATHE_ERR_RANGE, "the spacing is not a positive number of mm");
    for (int a = 0; a < 3; a++) {
        int32_t least = INT32_MAX, most = INT32_MIN;
        for (uint32_t v = 0; v < mesh->vertex_count; v++) {
            if (mesh->lattice[v][a] < least) least = mesh->lattice[v][a];
            if (mesh->lattice[v][a] > most) most = mesh->lattice[v][a];
        }
        double scale = transform->m[a][a];
        if (!(scale > 0) || transform->m[a][(a + 1) % 3] != 0 || transform->m[a][(a + 2) % 3] != 0)
            return lathe_fail(err, LATHE_ERR_RANGE, "the lattice is turned against the world");
        g.step[a] = spacing / scale;
        double count = ceil(((double)most - least) / g.step[a]) + 2;
        if (count > LATHE_MAX_DIM)
            return lathe_fail(err, LATHE_ERR_LIMIT, "more than %d voxels of %g mm along an axis", LATHE_MAX_DIM,
                              spacing);
        g.dims[a] = (int32_t)count;
        g.origin[a] = ((double)most + least) / 2 - g.step[a] * (count - 1) / 2;
        low[a] = scale * g.origin[a] + transform->m[a][3];
        voxels *= count;
    }
    if (voxels > 1 << 28) return lathe_fail(err, LATHE_ERR_LIMIT, "more than 2^28 voxels of %g mm", spacing);
    g.values = calloc((size_t)voxels, sizeof *g.values);
    if (!g.values) return lathe_fail(err, LATHE_ERR_MEMORY, "out of memory");
    for (uint32_t i = 0; i < mesh->triangle_count; i++)
        add_triangle(&g, (const int32_t(*)[3])mesh->lattice, mesh->triangles[i]);
    lathe_status status = lathe_volume_wrap(out, g.dims, spacings, g.values, err);
    if (!status)
        for (int a = 0; a < 3; a++) (*out)->affine[a][3] = low[a];
    free(g.values);
    return status;
}
