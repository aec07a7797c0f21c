/* A level of a model as one mesh in world mm: runs the decoder over the stream up to that level. */
#include "lathe_codec.h"
#include <stdlib.h>
#include <string.h>

void lathe_world_mesh_free(lathe_world_mesh *mesh) {
    free(mesh->positions);
    free(mesh->indices);
    free(mesh->parts);
    free(mesh->normals);
    memset(mesh, 0, sizeof *mesh);
}

typedef struct feeding {
    lathe_decoder *decoder;
    lathe_status status;
} feeding;

static int feed(void *context, const void *bytes, size_t size) {
    feeding *f = context;
    f->status = lathe_decoder_feed(f->decoder, bytes, size);
    return f->status != LATHE_OK;
}

static lathe_status decoder_failure(const lathe_decoder *decoder, lathe_status status, lathe_error *err) {
    const char *text = lathe_decoder_error(decoder);
    return lathe_fail(err, status, "%s", *text ? text : lathe_status_name(status));
}

static lathe_status decode(lathe_decoder *decoder, const lathe_model *model, int64_t structure, uint32_t level,
                           lathe_error *err) {
    feeding f = {decoder, LATHE_OK};
    lathe_decoder_build_meshes(decoder, false);
    lathe_status status = lathe_model_stream(model, structure, 0, level, feed, &f);
    if (f.status) return decoder_failure(decoder, f.status, err);
    if (status) return lathe_fail(err, status, "the stream could not be read: %s", lathe_status_name(status));
    lathe_step step;
    do status = lathe_decoder_step(decoder, &step);
    while (status == LATHE_OK);
    return status == LATHE_MORE ? LATHE_OK : decoder_failure(decoder, status, err);
}

/* ---- gathering ---- */

typedef struct capacity {
    size_t vertices, triangles;
} capacity;

/* *array = at least need elements. */
static bool grow(void **array, size_t *room, size_t need, size_t element) {
    if (need <= *room && *array) return true;
    size_t want = need + need / 2 + 16;
    if (want < need || want > SIZE_MAX / element) return false;
    void *bigger = realloc(*array, want * element);
    if (!bigger) return false;
    *array = bigger;
    *room = want;
    return true;
}

static lathe_status reserve(lathe_world_mesh *out, capacity *room, const lathe_mesh *mesh) {
    size_t vertices = (size_t)out->vertex_count + mesh->vertex_count;
    size_t triangles = (size_t)out->triangle_count + mesh->triangle_count;
    if (vertices > UINT32_MAX || triangles > UINT32_MAX / 3) return LATHE_ERR_LIMIT;
    void *positions = out->positions, *indices = out->indices;
    bool grown = grow(&positions, &room->vertices, vertices, 3 * sizeof(float));
    out->positions = positions;
    grown = grown && grow(&indices, &room->triangles, triangles, 3 * sizeof(uint32_t));
    out->indices = indices;
    return grown ? LATHE_OK : LATHE_ERR_MEMORY;
}

static lathe_status append(lathe_world_mesh *out, capacity *room, const lathe_mesh *mesh,
                           const lathe_transform *transform, uint32_t structure) {
    lathe_status status = reserve(out, room, mesh);
    if (status) return status;
    uint32_t *indices = out->indices + (size_t)3 * out->triangle_count;
    lathe_mesh_positions(mesh, transform, out->positions + (size_t)3 * out->vertex_count);
    lathe_mesh_indices(mesh, transform, indices);
    for (size_t i = 0; i < (size_t)3 * mesh->triangle_count; i++) indices[i] += out->vertex_count;
    out->parts[out->structure_count++] = (struct lathe_world_part){
        .structure = structure,
        .first_vertex = out->vertex_count,
        .vertex_count = mesh->vertex_count,
        .first_triangle = out->triangle_count,
        .triangle_count = mesh->triangle_count,
    };
    out->vertex_count += mesh->vertex_count;
    out->triangle_count += mesh->triangle_count;
    return LATHE_OK;
}

/* whole: the decoder has seen all structures, else the one as its only one. */
static lathe_status gather(lathe_world_mesh *out, lathe_decoder *decoder, int64_t structure, bool whole, lathe_error *err) {
    uint32_t count = lathe_decoder_structures(decoder);
    capacity room = {0, 0};
    out->parts = calloc((size_t)count + 1, sizeof *out->parts);
    if (!out->parts) return lathe_fail(err, LATHE_ERR_MEMORY, "out of memory");
    for (uint32_t i = 0; i < count; i++) {
        if (whole && structure >= 0 && i != (uint32_t)structure) continue;
        const lathe_mesh *mesh = lathe_decoder_mesh(decoder, i);
        if (!mesh) return decoder_failure(decoder, LATHE_ERR_FORMAT, err);
        lathe_status status =
            append(out, &room, mesh, lathe_decoder_transform(decoder, i), structure < 0 ? i : (uint32_t)structure);
        if (status) return lathe_fail(err, status, "the mesh is too large: %s", lathe_status_name(status));
    }
    return LATHE_OK;
}

lathe_status lathe_model_mesh(lathe_world_mesh *out, const lathe_model *model, int64_t structure, uint32_t level,
                              lathe_error *err) {
    const lathe_model_info *info = lathe_model_describe(model);
    if (structure >= info->structure_count)
        return lathe_fail(err, LATHE_ERR_RANGE, "structure %lld: the model has %u", (long long)structure,
                          info->structure_count);
    lathe_decoder *decoder = NULL;
    lathe_status status = lathe_decoder_open(&decoder);
    if (status) return lathe_fail(err, status, "out of memory");
    lathe_world_mesh mesh;
    memset(&mesh, 0, sizeof mesh);
    /* The whole stream saves coding a structure again that cannot be decoded alone. */
    bool whole = structure < 0 || !info->independent;
    status = decode(decoder, model, whole ? -1 : structure, level, err);
    if (!status) status = gather(&mesh, decoder, structure, whole, err);
    lathe_decoder_close(&decoder);
    if (status)
        lathe_world_mesh_free(&mesh);
    else
        *out = mesh;
    return status;
}
