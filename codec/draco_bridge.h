/* The only C++ of Lathe: calls into libdraco. No exception leaves it. */
#ifndef LATHE_DRACO_BRIDGE_H
#define LATHE_DRACO_BRIDGE_H
#include "lathe.h"
#ifdef __cplusplus
extern "C" {
#endif
/* Edgebreaker, compression level 10. positions: 3 * vertex_count floats; indices: 3 * triangle_count, all <
 * vertex_count. *out is malloc'ed, owned by the caller. LIMIT beyond Draco's 31-bit counts; UNSUPPORTED if Draco
 * refuses the mesh. */
lathe_status lathe__draco_encode(uint8_t **out, size_t *size, const float *positions, uint32_t vertex_count,
                                 const uint32_t *indices, uint32_t triangle_count, int quantization_bits);

/* ---- draco_delta.c: connectivity with two whole numbers for each vertex, and a list of 32-bit words as metadata ---- */

/* A Draco mesh with two attributes of one component, without prediction: POSITION (it always is the one whose values
 * tell vertices apart) and GENERIC. */
typedef struct lathe_draco_carrier {
    uint32_t vertex_count, triangle_count, word_count;
    uint32_t *triangles; /* 3 * triangle_count */
    int32_t *value[2];   /* of each vertex; [0] the POSITION, [1] the GENERIC one */
    int32_t *words;      /* "lathe", may be none */
    double *affine;      /* "affine", 12 numbers, or NULL */
} lathe_draco_carrier;   /* all owned (malloc), zeroed: empty */
void lathe__draco_carrier_free(lathe_draco_carrier *carrier);
/* Edgebreaker, compression level 10. *out is malloc'ed. Every vertex must have a triangle. Errors as above. */
lathe_status lathe__draco_pack(uint8_t **out, size_t *size, const lathe_draco_carrier *carrier);
/* What Draco's decoder makes of it: vertices and triangles come in another order. Hostile bytes are FORMAT; more than
 * 256 vertices for each byte are LIMIT. */
lathe_status lathe__draco_unpack(lathe_draco_carrier *out, const uint8_t *bytes, size_t size);
#ifdef __cplusplus
}
#endif
#endif
