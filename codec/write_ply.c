/* Binary little-endian PLY in world mm. With a model's colours each vertex has that of its structure. */
#include "write_common.h"
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* One line: a line break in a name would end the comment and begin a header line of the name's own. */
static void write_comment(lathe_out *out, const char *name) {
    static const char begin[] = "comment ";
    if (!name || !*name) return;
    lathe__out_bytes(out, begin, sizeof begin - 1);
    for (; *name; name++) lathe__out_u8(out, (unsigned char)*name < 32 || *name == 127 ? '_' : (uint8_t)*name);
    lathe__out_u8(out, '\n');
}

static void write_text(lathe_out *out, const char *text) { lathe__out_bytes(out, text, strlen(text)); }

static void write_header(lathe_out *out, const lathe_world_mesh *mesh, const char *name, bool colours) {
    char line[64];
    write_text(out, "ply\nformat binary_little_endian 1.0\ncomment Lathe, millimetres\n");
    write_comment(out, name);
    snprintf(line, sizeof line, "element vertex %lu\n", (unsigned long)mesh->vertex_count);
    write_text(out, line);
    write_text(out, "property float x\nproperty float y\nproperty float z\n");
    if (colours) write_text(out, "property uchar red\nproperty uchar green\nproperty uchar blue\n");
    snprintf(line, sizeof line, "element face %lu\n", (unsigned long)mesh->triangle_count);
    write_text(out, line);
    write_text(out, "property list uchar uint vertex_indices\nend_header\n");
}

/* 3 bytes for each vertex; grey where no part says more. */
static uint8_t *vertex_colours(const lathe_world_mesh *mesh, const lathe_write_options *options) {
    uint8_t *rgb = malloc((size_t)3 * mesh->vertex_count);
    if (!rgb) return NULL;
    memset(rgb, 204, (size_t)3 * mesh->vertex_count);
    for (uint32_t p = 0; p < mesh->structure_count; p++) {
        const lathe_structure_info *info = lathe__part_info(mesh, options, p);
        uint8_t *at = rgb + (size_t)3 * mesh->parts[p].first_vertex;
        for (uint32_t i = 0; info && i < mesh->parts[p].vertex_count; i++) memcpy(at + (size_t)3 * i, info->rgb, 3);
    }
    return rgb;
}

lathe_status lathe_write_ply(const lathe_world_mesh *mesh, const lathe_write_options *options, lathe_sink sink,
                             void *context) {
    lathe_status status = lathe__world_mesh_check(mesh);
    if (status) return status;
    bool colours = options && options->model;
    uint8_t *rgb = colours ? vertex_colours(mesh, options) : NULL;
    if (colours && !rgb) return LATHE_ERR_MEMORY;
    lathe_out out;
    lathe__out_start(&out, sink, context);
    write_header(&out, mesh, options ? options->name : NULL, colours);
    for (size_t v = 0; v < mesh->vertex_count && !out.failed; v++) {
        for (int i = 0; i < 3; i++) lathe__out_f32(&out, mesh->positions[3 * v + (size_t)i]);
        if (rgb) lathe__out_bytes(&out, rgb + 3 * v, 3);
    }
    free(rgb);
    for (size_t t = 0; t < mesh->triangle_count && !out.failed; t++) {
        lathe__out_u8(&out, 3);
        for (int k = 0; k < 3; k++) lathe__out_u32(&out, mesh->indices[3 * t + (size_t)k]);
    }
    return lathe__out_finish(&out);
}
