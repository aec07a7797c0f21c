/* Levels of slices as a pyramid: a level knows the voxels on a raster whose strides are powers of two, one for each axis, and each
 * pass halves one stride. The surface of a level is that of its raster, a small mask. Decoder-safe. */
#ifndef LATHE_PYRAMID_H
#define LATHE_PYRAMID_H
#include "archive_format.h"
#include "level.h"
#include "occupancy.h"

/* Which axis each pass halves; from header parameters 2 .. (lathe__pyramid_read). Level 0 is the first raster, one pass of its own. */
typedef struct lathe_pyramid {
    uint32_t level_count;
    uint32_t passes[LATHE_MAX_LEVELS];  /* of levels 1 ..: two bits a pass, axis + 1, lowest first */
    int32_t start[3];                   /* strides of level 0 */
} lathe_pyramid;

enum { LATHE_PYRAMID_MOST_PASSES = 15, LATHE_PYRAMID_MOST_STRIDE = 4096 };

/* FORMAT if the parameters are no schedule, or a structure has another number of levels. */
lathe_status lathe__pyramid_read(lathe_pyramid *out, const lathe_header *header);
/* 1 for level 0. */
uint32_t lathe__pyramid_passes(const lathe_pyramid *pyramid, uint32_t level);
/* The axis that a pass of a level >= 1 halves: 0 u, 1 v, 2 w. */
static inline int lathe__pyramid_axis(const lathe_pyramid *pyramid, uint32_t level, uint32_t pass) {
    return (int)(pyramid->passes[level] >> 2 * pass & 3) - 1;
}
/* Strides behind the first `passes` passes of a level. */
void lathe__pyramid_strides(int32_t stride[3], const lathe_pyramid *pyramid, uint32_t level, uint32_t passes);

/* Samples of a box along each axis: numbers k * stride; in u and v up to one beyond the last pixel inside, so that a raster has the
 * margin that masks have. */
void lathe__pyramid_size(int32_t out[3], const int32_t box[3], const int32_t stride[3]);
/* The raster's mask of a whole one. */
lathe_status lathe__pyramid_sample(lathe_mask *out, const lathe_mask *whole, const int32_t stride[3]);
/* The raster of half the stride along an axis, with the old samples at even numbers and nothing yet at odd ones. size: of the new one. */
lathe_status lathe__pyramid_spread(lathe_mask *out, const lathe_mask *coarse, const int32_t size[3], int axis);
/* Planes across axis 0 or 1 as slices: (v, w) for each u, or (u, w) for each v, with a margin of one row below and above in w. */
lathe_status lathe__pyramid_turn(lathe_mask *out, const lathe_mask *raster, int axis);
/* And back, into a raster of the right size. */
void lathe__pyramid_turn_back(const lathe_mask *raster, const lathe_mask *planes, int axis);

/* What is known around plane c of `planes`, the next one being coded; axis: the one halved, -1 for the first raster. */
lathe_known lathe__pyramid_known(const lathe_mask *planes, int32_t c, int axis);
/* The planes that a pass codes: first, first + step, ... below end. */
typedef struct lathe_plane_range { int32_t first, step, end; } lathe_plane_range;
lathe_plane_range lathe__pyramid_planes(const lathe_mask *planes, int axis);

/* The surface of a raster in the frame of its box; of an empty one, the octahedron of the box. Cube by cube, with fractions within slices
 * and along w; or, if it is given, in the style of the last level of an overlay of slices. */
lathe_status lathe__pyramid_mesh(lathe_mesh *out, lathe_arena arena[2], const lathe_mask *raster, const int32_t stride[3],
                                 const int32_t box[3], const int fraction[2], const lathe_surface_style *overlay, lathe_surface_counts *counts);
#endif
