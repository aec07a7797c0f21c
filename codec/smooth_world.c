/* The smooth surface of a world mesh [P 4], structure by structure. */
#include <stdlib.h>
#include <string.h>
#include "lathe_codec.h"
#include "smooth.h"

typedef struct part_arrays {
    double *positions, *smooth, *normals;
    uint32_t *triangles;
} part_arrays;

static void free_arrays(part_arrays *a) {
    free(a->positions);
    free(a->smooth);
    free(a->normals);
    free(a->triangles);
}

/* The part's own arrays, indices from 0. */
static lathe_status take_part(part_arrays *a, const lathe_world_mesh *mesh, const struct lathe_world_part *part) {
    size_t vertices = 3 * (size_t)part->vertex_count, corners = 3 * (size_t)part->triangle_count;
    a->positions = malloc(vertices * sizeof *a->positions + 1);
    a->triangles = malloc(corners * sizeof *a->triangles + 1);
    if (!a->positions || !a->triangles) return LATHE_ERR_MEMORY;
    for (size_t i = 0; i < vertices; i++) a->positions[i] = (double)mesh->positions[3 * (size_t)part->first_vertex + i];
    for (size_t i = 0; i < corners; i++) a->triangles[i] = mesh->indices[3 * (size_t)part->first_triangle + i] - part->first_vertex;
    return LATHE_OK;
}

/* Room for so many more. */
static lathe_status grow(lathe_world_mesh *out, uint32_t vertices, uint32_t triangles) {
    size_t v = (size_t)out->vertex_count + vertices, t = (size_t)out->triangle_count + triangles;
    if (v > UINT32_MAX || t > UINT32_MAX / 3) return LATHE_ERR_LIMIT;
    float *positions = realloc(out->positions, 3 * v * sizeof *positions);
    if (!positions) return LATHE_ERR_MEMORY;
    out->positions = positions;
    float *normals = realloc(out->normals, 3 * v * sizeof *normals);
    if (!normals) return LATHE_ERR_MEMORY;
    out->normals = normals;
    uint32_t *indices = realloc(out->indices, 3 * t * sizeof *indices);
    if (!indices) return LATHE_ERR_MEMORY;
    out->indices = indices;
    return LATHE_OK;
}

static lathe_status append(lathe_world_mesh *out, const lathe_world_mesh *mesh, const struct lathe_world_part *part, uint32_t k) {
    part_arrays a = {0};
    lathe_smooth *smooth = NULL;
    uint32_t vertices, triangles;
    lathe_status status = take_part(&a, mesh, part);
    lathe_smooth_source source = {part->vertex_count, part->triangle_count, a.positions, a.triangles, LATHE_WEIGHT_ANGLE};
    if (!status) status = lathe__smooth_open(&smooth, &source);
    if (!status) status = lathe__smooth_size(smooth, k, &vertices, &triangles);
    if (!status) status = grow(out, vertices, triangles);
    if (!status) {
        a.smooth = malloc(3 * (size_t)vertices * sizeof *a.smooth);
        a.normals = malloc(3 * (size_t)vertices * sizeof *a.normals);
        if (!a.smooth || !a.normals) status = LATHE_ERR_MEMORY;
    }
    if (!status) {
        uint32_t *indices = out->indices + 3 * (size_t)out->triangle_count;
        float *positions = out->positions + 3 * (size_t)out->vertex_count, *normals = out->normals + 3 * (size_t)out->vertex_count;
        status = lathe__smooth_evaluate(smooth, k, a.smooth, a.normals, indices);
        for (size_t i = 0; i < 3 * (size_t)vertices; i++) positions[i] = (float)a.smooth[i], normals[i] = (float)a.normals[i];
        for (size_t i = 0; i < 3 * (size_t)triangles; i++) indices[i] += out->vertex_count;
        out->parts[out->structure_count++] =
            (struct lathe_world_part){part->structure, out->vertex_count, vertices, out->triangle_count, triangles};
        out->vertex_count += vertices;
        out->triangle_count += triangles;
    }
    lathe__smooth_close(&smooth);
    free_arrays(&a);
    return status;
}

lathe_status lathe_world_mesh_smooth(lathe_world_mesh *mesh, uint32_t k) {
    lathe_world_mesh out;
    memset(&out, 0, sizeof out);
    if (k < 1 || k > LATHE_SMOOTH_MAX) return LATHE_ERR_RANGE;
    out.parts = calloc((size_t)mesh->structure_count + 1, sizeof *out.parts);
    lathe_status status = out.parts ? LATHE_OK : LATHE_ERR_MEMORY;
    for (uint32_t i = 0; !status && i < mesh->structure_count; i++)
        if (mesh->parts[i].triangle_count) status = append(&out, mesh, &mesh->parts[i], k);
    if (status) {
        lathe_world_mesh_free(&out);
        return status;
    }
    lathe_world_mesh_free(mesh);
    *mesh = out;
    return LATHE_OK;
}
