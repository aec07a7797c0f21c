/* Encoder: how far a level of tubes lies from what they stand for, from the maps alone: no mesh, no volume. */
#ifndef LATHE_RADIUS_ESTIMATE_H
#define LATHE_RADIUS_ESTIMATE_H
#include "radius_tubes.h"

typedef struct lathe_radius_estimate {
    const lathe_radii *truth;
    double slice;              /* distance of two slices, pixels */
    float *facing[LATHE_TUBES_MOST];   /* of each sample: cosine between its ray and the surface's normal */
} lathe_radius_estimate;

lathe_status lathe__estimate_start(lathe_radius_estimate *out, lathe_arena *arena, const lathe_radii *truth, double slice);
/* Of a level that radii have coded: at every sample of the truth, the distance along the ray to the strip between the shown slices and
 * rays, seen from the surface's normal; pixels. Caps and joints are left out. */
lathe_status lathe__estimate_error(double *rms, double *most, const lathe_radius_estimate *estimate, lathe_arena *scratch,
                                   lathe_radii *radii, uint32_t level);
#endif
