#include "write_common.h"
#include <math.h>
#include <string.h>

void lathe__out_start(lathe_out *out, lathe_sink sink, void *context) {
    out->sink = sink;
    out->context = context;
    out->failed = false;
    out->filled = 0;
}

static void flush(lathe_out *out) {
    if (out->filled && !out->failed) out->failed = out->sink(out->context, out->buffer, out->filled) != 0;
    out->filled = 0;
}

void lathe__out_bytes(lathe_out *out, const void *bytes, size_t size) {
    const uint8_t *at = bytes;
    while (size) {
        size_t room = sizeof out->buffer - out->filled, n = size < room ? size : room;
        memcpy(out->buffer + out->filled, at, n);
        out->filled += n;
        at += n;
        size -= n;
        if (out->filled == sizeof out->buffer) flush(out);
    }
}

void lathe__out_u8(lathe_out *out, uint8_t v) { lathe__out_bytes(out, &v, 1); }

void lathe__out_u16(lathe_out *out, uint16_t v) {
    lathe__out_bytes(out, (uint8_t[]){(uint8_t)v, (uint8_t)(v >> 8)}, 2);
}

void lathe__out_u32(lathe_out *out, uint32_t v) {
    lathe__out_bytes(out, (uint8_t[]){(uint8_t)v, (uint8_t)(v >> 8), (uint8_t)(v >> 16), (uint8_t)(v >> 24)}, 4);
}

void lathe__out_f32(lathe_out *out, float v) {
    uint32_t bits;
    memcpy(&bits, &v, sizeof bits);
    lathe__out_u32(out, bits);
}

lathe_status lathe__out_finish(lathe_out *out) {
    flush(out);
    return out->failed ? LATHE_ERR_IO : LATHE_OK;
}

static bool part_fits(const lathe_world_mesh *mesh, const struct lathe_world_part *part) {
    if (part->first_vertex > mesh->vertex_count || part->vertex_count > mesh->vertex_count - part->first_vertex)
        return false;
    if (part->first_triangle > mesh->triangle_count) return false;
    if (part->triangle_count > mesh->triangle_count - part->first_triangle) return false;
    const uint32_t *index = mesh->indices + (size_t)3 * part->first_triangle;
    for (size_t i = 0; i < (size_t)3 * part->triangle_count; i++)
        if (index[i] < part->first_vertex || index[i] - part->first_vertex >= part->vertex_count) return false;
    return true;
}

lathe_status lathe__world_mesh_check(const lathe_world_mesh *mesh) {
    if (!mesh->vertex_count || !mesh->triangle_count || mesh->triangle_count > UINT32_MAX / 3) return LATHE_ERR_RANGE;
    for (size_t i = 0; i < (size_t)3 * mesh->vertex_count; i++)
        if (!isfinite(mesh->positions[i])) return LATHE_ERR_RANGE;
    for (size_t i = 0; i < (size_t)3 * mesh->triangle_count; i++)
        if (mesh->indices[i] >= mesh->vertex_count) return LATHE_ERR_RANGE;
    for (uint32_t i = 0; i < mesh->structure_count; i++)
        if (!part_fits(mesh, &mesh->parts[i])) return LATHE_ERR_RANGE;
    return LATHE_OK;
}

const lathe_structure_info *lathe__part_info(const lathe_world_mesh *mesh, const lathe_write_options *options,
                                             uint32_t part) {
    if (!options || !options->model || part >= mesh->structure_count) return NULL;
    uint32_t structure = mesh->parts[part].structure;
    return structure < options->model->structure_count ? &options->model->structures[structure] : NULL;
}
