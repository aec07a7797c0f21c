/* Where grey values cross a threshold between neighbouring voxels. Not in the decoder. */
#ifndef LATHE_GREY_CROSSING_H
#define LATHE_GREY_CROSSING_H
#include "mask.h"

/* The voxel at a place of a mask's permuted frame (u, v, w), see lathe__axis_frame; outside of the volume its least value. */
float lathe__frame_value(const lathe_volume *volume, const int32_t frame[3], int32_t u, int32_t v, int32_t w);
/* Between an inside pixel of a mask and an outside one next to it, on average, within slices or (upright) from slice to slice: 8..56 of
 * LATHE_FRACTION_ONE from the inside one's centre, half of it where nothing is known. Looks at every few slices. */
int lathe__mean_fraction(const lathe_mask *mask, const lathe_volume *volume, lathe_axis axis, double iso, bool upright);
#endif
