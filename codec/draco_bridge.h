/* The only C++ of Lathe: one call into libdraco. No exception leaves it. */
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
#ifdef __cplusplus
}
#endif
#endif
