#include "wasm_shading.h"
#include <math.h>
#include <stdlib.h>

enum { GRID = 80 };            /* most cells along the longest side of the model */

/* Surface area by cell, then blurred: how much surface is near a point. */
typedef struct density {
    float *cells;
    float low[3], step;        /* corner of cell 0, edge of a cell, mm */
    int32_t size[3];
} density;

/* Twice the area-weighted normals. */
static void sum_normals(float *normals, const float *positions, const uint32_t *indices, uint32_t triangle_count) {
    for (uint32_t t = 0; t < triangle_count; t++) {
        const uint32_t *corner = indices + 3 * (size_t)t;
        const float *a = positions + 3 * (size_t)corner[0], *b = positions + 3 * (size_t)corner[1],
                    *c = positions + 3 * (size_t)corner[2];
        float p[3], q[3];
        for (int i = 0; i < 3; i++) p[i] = b[i] - a[i], q[i] = c[i] - a[i];
        float n[3] = {p[1] * q[2] - p[2] * q[1], p[2] * q[0] - p[0] * q[2], p[0] * q[1] - p[1] * q[0]};
        for (int k = 0; k < 3; k++)
            for (int i = 0; i < 3; i++) normals[3 * (size_t)corner[k] + i] += n[i];
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
        cells *= (size_t)d->size[i];
    }
    d->cells = calloc(cells, sizeof *d->cells);
    return d->cells != NULL;
}

/* The eight cells around a point with their weights. The point lies at least one cell inside the grid. */
static void cells_around(const density *d, const float *point, size_t *cell, float *weight) {
    float part[3];
    int32_t at[3];
    for (int i = 0; i < 3; i++) {
        float x = (point[i] - d->low[i]) / d->step;
        if (!(x > 0)) x = 0;
        at[i] = (int32_t)x;
        if (at[i] > d->size[i] - 2) at[i] = d->size[i] - 2;
        part[i] = x - (float)at[i];
    }
    for (int k = 0; k < 8; k++) {
        int u = k & 1, v = k >> 1 & 1, w = k >> 2;
        cell[k] = ((size_t)(at[2] + w) * (size_t)d->size[1] + (size_t)(at[1] + v)) * (size_t)d->size[0] + (size_t)(at[0] + u);
        weight[k] = (u ? part[0] : 1 - part[0]) * (v ? part[1] : 1 - part[1]) * (w ? part[2] : 1 - part[2]);
    }
}

/* (1 2 1) / 4 along one axis, in place. */
static void blur_axis(const density *d, int axis) {
    size_t stride[3] = {1, (size_t)d->size[0], (size_t)d->size[0] * (size_t)d->size[1]};
    int a = (axis + 1) % 3, b = (axis + 2) % 3;
    for (int32_t i = 0; i < d->size[a]; i++)
        for (int32_t j = 0; j < d->size[b]; j++) {
            float *at = d->cells + stride[a] * (size_t)i + stride[b] * (size_t)j, before = 0;
            for (int32_t k = 1; k < d->size[axis]; k++, at += stride[axis]) {
                float here = *at;
                *at = (before + 2 * here + at[stride[axis]]) * 0.25f;
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
    size_t cell[8];
    float weight[8];
    for (uint32_t v = 0; v < vertex_count; v++) {
        cells_around(&d, positions + 3 * (size_t)v, cell, weight);
        float area = length_of(normals + 3 * (size_t)v) / (6 * d.step * d.step);
        for (int k = 0; k < 8; k++) d.cells[cell[k]] += area * weight[k];
    }
    for (int axis = 0; axis < 3; axis++) blur_axis(&d, axis);
    for (uint32_t v = 0; v < vertex_count; v++) {
        float *n = normals + 3 * (size_t)v, length = length_of(n), ahead[3], near = 0;
        for (int i = 0; i < 3; i++) {
            n[i] = length > 0 ? n[i] / length : 0;
            ahead[i] = positions[3 * (size_t)v + i] + 1.5f * d.step * n[i];
            shading[4 * (size_t)v + i] = to_short(n[i]);
        }
        cells_around(&d, ahead, cell, weight);
        for (int k = 0; k < 8; k++) near += d.cells[cell[k]] * weight[k];
        shading[4 * (size_t)v + 3] = to_short(1 / (1 + near * near));
    }
    free(d.cells);
    free(normals);
    return LATHE_OK;
}
