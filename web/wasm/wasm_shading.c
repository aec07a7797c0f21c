#include "wasm_shading.h"
#include <math.h>
#include <stdlib.h>

enum { GRID = 80 };            /* most cells along the longest side of the model */

/* Surface area by cell, then blurred: how much surface is near a point. */
typedef struct density {
    float *cells;
    float low[3], step;        /* corner of cell 0, edge of a cell, mm */
    int32_t size[3];
    size_t stride[3];
} density;

/* Twice the area-weighted normals. */
static void sum_normals(float *normals, const float *positions, const uint32_t *indices, uint32_t triangle_count) {
    for (uint32_t t = 0; t < triangle_count; t++) {
        const uint32_t *corner = indices + 3 * (size_t)t;
        const float *a = positions + 3 * (size_t)corner[0], *b = positions + 3 * (size_t)corner[1],
                    *c = positions + 3 * (size_t)corner[2];
        float p[3], q[3];
        for (int i = 0; i < 3; i++) p[i] = b[i] - a[i], q[i] = c[i] - a[i];
        for (int i = 0; i < 3; i++) {
            int j = (i + 1) % 3, k = (i + 2) % 3;
            float n = p[j] * q[k] - p[k] * q[j];
            for (int at = 0; at < 3; at++) normals[3 * (size_t)corner[at] + i] += n;
        }
    }
}

static float length_of(const float *v) { return sqrtf(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]); }

/* Cells as fine as the triangles allow, so that a coarse level's few vertices do not show as spots. */
static bool open_density(density *d, const float *positions, uint32_t vertex_count, const float *normals) {
    float high[3], longest = 0;
    double area = 0;
    for (int i = 0; i < 3; i++) d->low[i] = high[i] = positions[i];
    for (uint32_t v = 0; v < vertex_count; v++) {
        area += length_of(normals + 3 * (size_t)v);
        for (int i = 0; i < 3; i++) {
            float x = positions[3 * (size_t)v + i];
            if (x < d->low[i]) d->low[i] = x;
            if (x > high[i]) high[i] = x;
        }
    }
    for (int i = 0; i < 3; i++)
        if (high[i] - d->low[i] > longest) longest = high[i] - d->low[i];
    float triangle = 1.2f * sqrtf((float)area / (float)vertex_count);
    d->step = longest / GRID > triangle ? longest / GRID : triangle;
    if (!(d->step > 0)) return false;
    size_t cells = 1;
    for (int i = 0; i < 3; i++) {
        d->low[i] -= 3 * d->step;
        d->size[i] = (int32_t)((high[i] - d->low[i]) / d->step) + 5;
        d->stride[i] = cells;
        cells *= (size_t)d->size[i];
    }
    d->cells = calloc(cells, sizeof *d->cells);
    return d->cells != NULL;
}

/* Adds to the eight cells around a point by their nearness; returns their mean before. The point lies at least one cell inside
 * the grid. */
static float visit(const density *d, const float *point, float add) {
    float part[3], mean = 0, *corner = d->cells;
    for (int i = 0; i < 3; i++) {
        float x = (point[i] - d->low[i]) / d->step;
        if (!(x > 0)) x = 0;
        int32_t at = (int32_t)x;
        if (at > d->size[i] - 2) at = d->size[i] - 2;
        part[i] = x - (float)at;
        corner += d->stride[i] * (size_t)at;
    }
    for (int k = 0; k < 8; k++) {
        float *cell = corner, weight = 1;
        for (int i = 0; i < 3; i++) {
            bool far = k >> i & 1;
            weight *= far ? part[i] : 1 - part[i];
            if (far) cell += d->stride[i];
        }
        mean += *cell * weight;
        *cell += add * weight;
    }
    return mean;
}

/* (1 2 1) / 4 along one axis, in place. */
static void blur_axis(const density *d, int axis) {
    int a = (axis + 1) % 3, b = (axis + 2) % 3;
    size_t stride = d->stride[axis];
    for (int32_t i = 0; i < d->size[a]; i++)
        for (int32_t j = 0; j < d->size[b]; j++) {
            float *at = d->cells + d->stride[a] * (size_t)i + d->stride[b] * (size_t)j, before = 0;
            for (int32_t k = 1; k < d->size[axis]; k++, at += stride) {
                float here = *at;
                *at = (before + 2 * here + at[stride]) * 0.25f;
                before = here;
            }
        }
}

static int16_t to_short(float value) { return (int16_t)(value * 32767.0f); }

lathe_status lathe__shade(int16_t *shading, const float *positions, uint32_t vertex_count, const uint32_t *indices,
                          uint32_t triangle_count) {
    if (!vertex_count) return LATHE_OK;
    float *normals = calloc(vertex_count, 3 * sizeof *normals);
    if (!normals) return LATHE_ERR_MEMORY;
    sum_normals(normals, positions, indices, triangle_count);
    density d;
    if (!open_density(&d, positions, vertex_count, normals)) {
        free(normals);
        return LATHE_ERR_MEMORY;
    }
    for (uint32_t v = 0; v < vertex_count; v++) {
        float cells = length_of(normals + 3 * (size_t)v) / (6 * d.step * d.step);
        visit(&d, positions + 3 * (size_t)v, cells < 1 ? cells : 1);   /* what a fan has beyond that lies elsewhere */
    }
    for (int axis = 0; axis < 3; axis++) blur_axis(&d, axis);
    for (uint32_t v = 0; v < vertex_count; v++) {
        float *n = normals + 3 * (size_t)v, length = length_of(n), ahead[3];
        for (int i = 0; i < 3; i++) {
            n[i] = length > 0 ? n[i] / length : 0;
            ahead[i] = positions[3 * (size_t)v + i] + 1.5f * d.step * n[i];
            shading[4 * (size_t)v + i] = to_short(n[i]);
        }
        float near = visit(&d, ahead, 0);
        shading[4 * (size_t)v + 3] = to_short(1 / (1 + near * near));
    }
    free(d.cells);
    free(normals);
    return LATHE_OK;
}
