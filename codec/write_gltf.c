/* Binary glTF 2.0: one mesh, material and node for each part under a root node that turns scanner space into glTF's.
 *
 * World space is right-anterior-superior in millimetres. glTF is right-handed in metres, +Y up, and the front of an
 * asset faces +Z: x = -right, y = superior, z = anterior, a half turn about (0, 1, 1). Positions stay those of the
 * other formats.
 *
 * Parts without triangles are left out, so with a model each mesh says in its extras which structure it is.
 *
 * Binary chunk: all positions, all normals, all indices (relative to their part's first vertex). */
#include "archive_write.h"
#include "write_common.h"
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { VEC3 = 12, GLB_HEADER = 12, CHUNK_HEADER = 8 };
enum { FLOAT_TYPE = 5126, UINT_TYPE = 5125, VERTEX_TARGET = 34962, INDEX_TARGET = 34963 };
#define GLB_MAGIC 0x46546C67u /* "glTF" */
#define CHUNK_JSON 0x4E4F534Au
#define CHUNK_BIN 0x004E4942u

typedef struct glb {
    const lathe_world_mesh *mesh;
    const lathe_write_options *options;
    struct lathe_world_part whole;         /* the only part of a mesh that has none */
    const struct lathe_world_part **parts; /* those with triangles */
    uint32_t *origin;                      /* of each of them: its index in mesh->parts */
    uint32_t part_count;
    uint64_t index_total; /* of all parts */
    lathe_bytes json;
} glb;

/* ---- JSON ---- */

static void json_text(glb *g, const char *text) { lathe__emit(&g->json, text, strlen(text)); }

#ifdef __GNUC__
__attribute__((format(printf, 2, 3)))
#endif
static void
json_format(glb *g, const char *format, ...) {
    char text[256];
    va_list args;
    va_start(args, format);
    (void)vsnprintf(text, sizeof text, format, args);
    va_end(args);
    json_text(g, text);
}

/* 9 digits give a float back exactly; the locale's decimal point must not show. */
static void json_number(glb *g, double v) {
    char text[40];
    snprintf(text, sizeof text, "%.9g", v == 0 ? 0 : v);
    for (char *c = text; *c; c++)
        if (!strchr("+-.0123456789e", *c)) *c = '.';
    json_text(g, text);
}

static void json_string(glb *g, const char *s) {
    char clean[1024];
    lathe__name_clean(clean, sizeof clean, s);
    json_text(g, "\"");
    for (const char *c = clean; *c; c++) {
        if (*c == '"' || *c == '\\') json_text(g, "\\");
        lathe__emit_u8(&g->json, (uint8_t)*c);
    }
    json_text(g, "\"");
}

static const char *part_name(const glb *g, uint32_t part) {
    const lathe_structure_info *info = lathe__part_info(g->mesh, g->options, g->origin[part]);
    if (info) return info->name;
    return g->options && g->options->name ? g->options->name : "surface";
}

static void json_structure(glb *g, uint32_t part) {
    if (lathe__part_info(g->mesh, g->options, g->origin[part]))
        json_format(g, ",\"extras\":{\"structure\":%u}", g->mesh->parts[g->origin[part]].structure);
}

static double linear_from_srgb(uint8_t v) {
    double c = v / 255.0;
    return c <= 0.04045 ? c / 12.92 : pow((c + 0.055) / 1.055, 2.4);
}

static void json_nodes(glb *g) {
    json_text(g, "\"scene\":0,\"scenes\":[{\"nodes\":[0]}],\"nodes\":[{\"name\":");
    json_string(g, g->options ? g->options->name : NULL);
    json_text(
        g, ",\"rotation\":[0,0.70710678118654752,0.70710678118654752,0],\"scale\":[0.001,0.001,0.001],\"children\":[");
    for (uint32_t p = 0; p < g->part_count; p++) json_format(g, "%s%u", p ? "," : "", p + 1);
    json_text(g, "]}");
    for (uint32_t p = 0; p < g->part_count; p++) {
        json_format(g, ",{\"mesh\":%u,\"name\":", p);
        json_string(g, part_name(g, p));
        json_text(g, "}");
    }
    json_text(g, "]");
}

static void json_meshes(glb *g) {
    json_text(g, ",\"meshes\":[");
    for (uint32_t p = 0; p < g->part_count; p++) {
        json_text(g, p ? ",{\"name\":" : "{\"name\":");
        json_string(g, part_name(g, p));
        json_structure(g, p);
        json_format(
            g, ",\"primitives\":[{\"attributes\":{\"POSITION\":%u,\"NORMAL\":%u},\"indices\":%u,\"material\":%u}]}",
            3 * p, 3 * p + 1, 3 * p + 2, p);
    }
    json_text(g, "]");
}

static void json_materials(glb *g) {
    static const uint8_t bone[3] = {227, 218, 201};
    json_text(g, ",\"materials\":[");
    for (uint32_t p = 0; p < g->part_count; p++) {
        const lathe_structure_info *info = lathe__part_info(g->mesh, g->options, g->origin[p]);
        const uint8_t *rgb = info ? info->rgb : bone;
        json_text(g, p ? ",{\"name\":" : "{\"name\":");
        json_string(g, part_name(g, p));
        json_text(g, ",\"pbrMetallicRoughness\":{\"baseColorFactor\":[");
        for (int i = 0; i < 3; i++) {
            json_number(g, linear_from_srgb(rgb[i]));
            json_text(g, ",");
        }
        json_text(g, "1],\"metallicFactor\":0,\"roughnessFactor\":0.6}}");
    }
    json_text(g, "]");
}

static void json_bounds(glb *g, const struct lathe_world_part *part, const char *key, bool upper) {
    json_format(g, ",\"%s\":[", key);
    for (size_t i = 0; i < 3; i++) {
        const float *at = g->mesh->positions + (size_t)3 * part->first_vertex + i;
        float best = at[0];
        for (size_t v = 1; v < part->vertex_count; v++)
            if (upper ? at[3 * v] > best : at[3 * v] < best) best = at[3 * v];
        if (i) json_text(g, ",");
        json_number(g, (double)best);
    }
    json_text(g, "]");
}

static void json_accessors(glb *g) {
    uint64_t vertices = 0, indices = 0;
    json_text(g, ",\"accessors\":[");
    for (uint32_t p = 0; p < g->part_count; p++) {
        const struct lathe_world_part *part = g->parts[p];
        for (int view = 0; view < 2; view++) {
            json_format(
                g, "%s{\"bufferView\":%d,\"byteOffset\":%llu,\"componentType\":%d,\"count\":%u,\"type\":\"VEC3\"",
                p || view ? "," : "", view, (unsigned long long)(vertices * VEC3), FLOAT_TYPE, part->vertex_count);
            if (view == 0) {
                json_bounds(g, part, "min", false);
                json_bounds(g, part, "max", true);
            }
            json_text(g, "}");
        }
        json_format(g,
                    ",{\"bufferView\":2,\"byteOffset\":%llu,\"componentType\":%d,\"count\":%llu,\"type\":\"SCALAR\"}",
                    (unsigned long long)(indices * 4), UINT_TYPE, 3ull * part->triangle_count);
        vertices += part->vertex_count;
        indices += 3ull * part->triangle_count;
    }
    json_text(g, "]");
}

static void json_buffer(glb *g, uint64_t vector_bytes) {
    unsigned long long vectors = vector_bytes, indices = 4 * g->index_total;
    json_format(g, ",\"bufferViews\":[{\"buffer\":0,\"byteLength\":%llu,\"byteStride\":%d,\"target\":%d}", vectors,
                VEC3, VERTEX_TARGET);
    json_format(g, ",{\"buffer\":0,\"byteOffset\":%llu,\"byteLength\":%llu,\"byteStride\":%d,\"target\":%d}", vectors,
                vectors, VEC3, VERTEX_TARGET);
    json_format(g, ",{\"buffer\":0,\"byteOffset\":%llu,\"byteLength\":%llu,\"target\":%d}]", 2 * vectors, indices,
                INDEX_TARGET);
    json_format(g, ",\"buffers\":[{\"byteLength\":%llu}]", 2 * vectors + indices);
}

static void build_json(glb *g, uint64_t vector_bytes) {
    json_text(g, "{\"asset\":{\"version\":\"2.0\",\"generator\":\"Lathe\"},");
    json_nodes(g);
    json_meshes(g);
    json_materials(g);
    json_accessors(g);
    json_buffer(g, vector_bytes);
    json_text(g, "}");
    while (g->json.size % 4 && !g->json.failed) json_text(g, " ");
}

/* ---- normals ---- */

static void add_triangle(double *sums, const float *positions, const uint32_t *index) {
    double u[3], v[3];
    for (size_t i = 0; i < 3; i++) {
        u[i] = (double)positions[(size_t)3 * index[1] + i] - (double)positions[(size_t)3 * index[0] + i];
        v[i] = (double)positions[(size_t)3 * index[2] + i] - (double)positions[(size_t)3 * index[0] + i];
    }
    for (size_t i = 0; i < 3; i++) {
        double n = u[(i + 1) % 3] * v[(i + 2) % 3] - u[(i + 2) % 3] * v[(i + 1) % 3];
        for (int k = 0; k < 3; k++) sums[(size_t)3 * index[k] + i] += n;
    }
}

/* Area-weighted: the cross product is twice the area. 3 doubles for each vertex, not normalised. */
static double *normal_sums(const lathe_world_mesh *mesh) {
    double *sums = calloc(mesh->vertex_count, 3 * sizeof *sums);
    for (size_t t = 0; sums && t < mesh->triangle_count; t++)
        add_triangle(sums, mesh->positions, mesh->indices + 3 * t);
    return sums;
}

/* glTF wants unit vectors without exception. */
static void write_normal(lathe_out *out, const double *n) {
    double length = sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]);
    bool usable = length > 1e-300 && isfinite(length);
    for (int i = 0; i < 3; i++) lathe__out_f32(out, usable ? (float)(n[i] / length) : (float)(i == 2));
}

static void write_normals(const glb *g, const struct lathe_world_part *part, const double *sums, lathe_out *out) {
    for (size_t v = part->first_vertex; v < (size_t)part->first_vertex + part->vertex_count && !out->failed; v++) {
        const float *own = g->mesh->normals + (sums ? 0 : 3 * v);
        write_normal(out, sums ? sums + 3 * v : (double[]){(double)own[0], (double)own[1], (double)own[2]});
    }
}

/* ---- file ---- */

static void write_binary(const glb *g, const double *sums, lathe_out *out) {
    for (uint32_t p = 0; p < g->part_count; p++) {
        const float *at = g->mesh->positions + (size_t)3 * g->parts[p]->first_vertex;
        for (size_t i = 0; i < (size_t)3 * g->parts[p]->vertex_count && !out->failed; i++) lathe__out_f32(out, at[i]);
    }
    for (uint32_t p = 0; p < g->part_count; p++) write_normals(g, g->parts[p], sums, out);
    for (uint32_t p = 0; p < g->part_count; p++) {
        const uint32_t *at = g->mesh->indices + (size_t)3 * g->parts[p]->first_triangle;
        for (size_t i = 0; i < (size_t)3 * g->parts[p]->triangle_count && !out->failed; i++)
            lathe__out_u32(out, at[i] - g->parts[p]->first_vertex);
    }
}

static lathe_status write_file(const glb *g, uint64_t binary_bytes, lathe_sink sink, void *context) {
    uint64_t total = GLB_HEADER + 2 * CHUNK_HEADER + (uint64_t)g->json.size + binary_bytes;
    if (total > UINT32_MAX) return LATHE_ERR_LIMIT;
    double *sums = g->mesh->normals ? NULL : normal_sums(g->mesh);
    if (!sums && !g->mesh->normals) return LATHE_ERR_MEMORY;
    lathe_out out;
    lathe__out_start(&out, sink, context);
    lathe__out_u32(&out, GLB_MAGIC);
    lathe__out_u32(&out, 2);
    lathe__out_u32(&out, (uint32_t)total);
    lathe__out_u32(&out, (uint32_t)g->json.size);
    lathe__out_u32(&out, CHUNK_JSON);
    lathe__out_bytes(&out, g->json.data, g->json.size);
    lathe__out_u32(&out, (uint32_t)binary_bytes);
    lathe__out_u32(&out, CHUNK_BIN);
    write_binary(g, sums, &out);
    free(sums);
    return lathe__out_finish(&out);
}

/* Parts without triangles are left out: an accessor must not be empty. */
static lathe_status choose_parts(glb *g) {
    const lathe_world_mesh *mesh = g->mesh;
    size_t room = (size_t)mesh->structure_count + 1;
    g->parts = malloc(room * sizeof *g->parts);
    g->origin = malloc(room * sizeof *g->origin);
    if (!g->parts || !g->origin) return LATHE_ERR_MEMORY;
    g->whole = (struct lathe_world_part){0, 0, mesh->vertex_count, 0, mesh->triangle_count};
    if (!mesh->structure_count) {
        g->origin[0] = UINT32_MAX;
        g->parts[g->part_count++] = &g->whole;
    }
    for (uint32_t i = 0; i < mesh->structure_count; i++) {
        if (!mesh->parts[i].triangle_count) continue;
        g->origin[g->part_count] = i;
        g->parts[g->part_count++] = &mesh->parts[i];
    }
    return g->part_count ? LATHE_OK : LATHE_ERR_RANGE;
}

lathe_status lathe_write_glb(const lathe_world_mesh *mesh, const lathe_write_options *options, lathe_sink sink,
                             void *context) {
    lathe_status status = lathe__world_mesh_check(mesh);
    if (status) return status;
    glb g = {.mesh = mesh, .options = options};
    status = choose_parts(&g);
    uint64_t vector_bytes = 0;
    for (uint32_t p = 0; p < g.part_count; p++) {
        vector_bytes += (uint64_t)VEC3 * g.parts[p]->vertex_count;
        g.index_total += 3ull * g.parts[p]->triangle_count;
    }
    uint64_t binary_bytes = 2 * vector_bytes + 4 * g.index_total;
    if (!status) build_json(&g, vector_bytes);
    if (!status && g.json.failed) status = LATHE_ERR_MEMORY;
    if (!status) status = write_file(&g, binary_bytes, sink, context);
    lathe__bytes_free(&g.json);
    free(g.parts);
    free(g.origin);
    return status;
}
