/* The functions that the viewer calls. One decoder for each wasm instance, so the instance is the handle. */
#include "lathe.h"
#include "lathe_codec.h"
#include "wasm_shading.h"
#include <stdlib.h>
#include <string.h>

#define EXPORT(name) __attribute__((export_name(#name))) name

/* What the last step and the last mesh gave; the viewer reads it as 32-bit words. */
static struct {
    lathe_step step;           /* words 0-6: structure, level, rms, max (floats), rays, slices, passes left */
    uint32_t vertex_count, triangle_count;
    void *mesh;                /* word 9: 3 floats, then 4 int16 for each vertex, then 3 uint32 for each triangle */
} report;
_Static_assert(sizeof report == 40, "the viewer counts on the words of the report");

static lathe_decoder *decoder;
static uint8_t *input_bytes;
static uint32_t input_size;

void *EXPORT(report_words)(void) { return &report; }

/* Where the next portion of the stream is to be written; 0 if memory is out. */
uint8_t *EXPORT(input)(uint32_t size) {
    if (size > input_size || !input_bytes) {
        free(input_bytes);
        input_bytes = malloc(size);
        input_size = input_bytes ? size : 0;
    }
    return input_bytes;
}

/* Takes the first size bytes of the input. */
lathe_status EXPORT(feed)(uint32_t size) {
    if (size > input_size) return LATHE_ERR_RANGE;
    if (!decoder) {
        lathe_status status = lathe_decoder_open(&decoder);
        if (status) return status;
        lathe_decoder_build_meshes(decoder, false);   /* mesh() asks for those that are shown */
    }
    return lathe_decoder_feed(decoder, input_bytes, size);
}

/* From now on steps stop behind every pass; before the first portion they do not. */
void EXPORT(every_pass)(void) { if (decoder) lathe_decoder_every_pass(decoder, true); }

lathe_status EXPORT(step)(void) { return decoder ? lathe_decoder_step(decoder, &report.step) : LATHE_MORE; }

lathe_status EXPORT(mesh)(uint32_t structure) {
    const lathe_mesh *mesh = decoder ? lathe_decoder_mesh(decoder, structure) : NULL;
    const lathe_transform *transform = mesh ? lathe_decoder_transform(decoder, structure) : NULL;
    if (!transform) return LATHE_ERR_FORMAT;
    free(report.mesh);
    report.mesh = NULL;
    uint64_t size = (uint64_t)mesh->vertex_count * 20 + (uint64_t)mesh->triangle_count * 12;
    if (size > INT32_MAX || !(report.mesh = malloc((size_t)size))) return LATHE_ERR_MEMORY;
    float *positions = report.mesh;
    int16_t *shading = (int16_t *)(positions + 3 * (size_t)mesh->vertex_count);
    uint32_t *indices = (uint32_t *)(shading + 4 * (size_t)mesh->vertex_count);
    lathe_mesh_positions(mesh, transform, positions);
    lathe_mesh_indices(mesh, transform, indices);
    report.vertex_count = mesh->vertex_count;
    report.triangle_count = mesh->triangle_count;
    return lathe__shade(shading, positions, mesh->vertex_count, indices, mesh->triangle_count);
}

/* Builds a structure's mesh and nothing else: what is measured. */
lathe_status EXPORT(build)(uint32_t structure) { return decoder && lathe_decoder_mesh(decoder, structure) ? LATHE_OK : LATHE_ERR_FORMAT; }

const char *EXPORT(error_text)(void) { return decoder ? lathe_decoder_error(decoder) : ""; }
uint32_t EXPORT(structures)(void) { return decoder ? lathe_decoder_structures(decoder) : 0; }

static uint64_t hash_bytes(uint64_t hash, const void *bytes, size_t size) {
    const uint8_t *at = bytes;
    for (; size; size--) hash = (hash ^ *at++) * UINT64_C(0x100000001b3);
    return hash;
}

/* FNV-1a of the mesh's lattice positions, then its triangles, as little-endian words: tests compare it with the native build. */
uint64_t EXPORT(mesh_hash)(uint32_t structure) {
    const lathe_mesh *mesh = decoder ? lathe_decoder_mesh(decoder, structure) : NULL;
    if (!mesh) return 0;
    uint64_t hash = hash_bytes(UINT64_C(0xcbf29ce484222325), mesh->lattice, mesh->vertex_count * sizeof *mesh->lattice);
    return hash_bytes(hash, mesh->triangles, mesh->triangle_count * sizeof *mesh->triangles);
}
