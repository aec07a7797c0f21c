/* What a picture needs beside positions: normals, and how much of a vertex' sky its own surface hides. */
#ifndef LATHE_WASM_SHADING_H
#define LATHE_WASM_SHADING_H
#include "lathe.h"

/* Four 16-bit values for each vertex, normalised to 32767: the unit normal (area-weighted mean of its triangles') and the
 * openness, 32767 for a vertex that sees nothing of the surface and about 0 deep in a narrow fold.
 * positions: 3 * vertex_count; indices: 3 * triangle_count. MEMORY if scratch cannot be had. */
lathe_status lathe__shade(int16_t *shading, const float *positions, uint32_t vertex_count, const uint32_t *indices,
                          uint32_t triangle_count);
#endif
