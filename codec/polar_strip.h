/* The paper's own compression [M 6.2], as the baseline that Lathe's coding is compared with: a centre for each contour
 * and one signed value for each vertex. No triangle is stored: the decoder parses the contours and walks their trees,
 * which gives the strips.
 *
 * The paper's value is a r', a in {-1, 0, 1} the step from the ray of the vertex before (BACK; UP or DOWN; FOR), r' in
 * (0, 1) the radius: that loses r' where a is 0. Here each a has a band of its own. Radii are quantised to R steps of
 * `farthest` / R, and
 *     16 bits: u16 (a + 1) R + r, R = 21845       32 bits: float a + r / R, R = 2^22, exact: r / R = value -
 * floor(value)
 *
 * Bytes, little-endian: u32 magic "LPS1", u8 bits (16, 32), u8 log2 rays, u16 0, u32 contours, u32 farthest (lattice
 * units); then per contour i32 centre x, y, height, u16 turn, u16 0, u32 vertices, and its values. A contour begins
 * with a vertex on ray 0 where the ray leaves the region; the a of its first vertex is that of the edge from its last
 * one. */
#ifndef LATHE_POLAR_STRIP_H
#define LATHE_POLAR_STRIP_H
#include "sections.h"

enum { LATHE_POLAR_HEAD = 20, LATHE_POLAR_CONTOUR_HEAD = 20, LATHE_POLAR_MOST_EDGES = 1 << 24 };

typedef struct lathe_polar_contour {
    lathe_ray_contour contour; /* crossings: ray, in_out, outward; segment i, numerator 0, denominator 1 */
    int32_t height;
    uint32_t *steps; /* radius in steps of farthest / R */
} lathe_polar_contour;
typedef struct lathe_polar_stack {
    uint32_t count, rays, bits, farthest;
    lathe_polar_contour *contours;
} lathe_polar_stack;

/* The contours as a decoder will have them: radii quantised, types and points from those. Arena memory. bits: 16 or 32.
 * heights: count lattice units, ascending. RANGE: bits, no contour, different ray counts, no power of two in 4..65536;
 * LIMIT: more than 2^24 edges; FORMAT: a contour that does not go round its centre once; MEMORY. */
lathe_status lathe__polar_quantise(lathe_polar_stack *out, lathe_arena *arena, const lathe_ray_contour *contours,
                                   const int32_t *heights, uint32_t count, uint32_t bits);
size_t lathe__polar_size(const lathe_polar_stack *stack);
/* Writes lathe__polar_size bytes. */
void lathe__polar_encode(uint8_t *bytes, const lathe_polar_stack *stack);
/* Hostile bytes are safe: memory is bounded by their number. FORMAT: not such bytes, or contours that do not go round
 * their centre once, each value in range; every byte must be used. Decoding what was encoded gives the same stack. */
lathe_status lathe__polar_decode(lathe_polar_stack *out, lathe_arena *arena, const uint8_t *bytes, size_t size);
/* The surface: strips between neighbouring contours by their trees, open at both ends. Owned by the caller. LIMIT,
 * MEMORY. */
lathe_status lathe__polar_mesh(lathe_mesh *out, const lathe_polar_stack *stack);
#endif
