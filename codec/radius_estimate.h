/* Encoder: how far a level of tubes lies from what they stand for, from the maps alone: no mesh, no volume. */
#ifndef LATHE_RADIUS_ESTIMATE_H
#define LATHE_RADIUS_ESTIMATE_H
#include "radius_tubes.h"

typedef struct lathe_estimate_tube {
    float *facing;             /* of each sample: cosine between its ray and the surface's normal */
    float *share;              /* of each sample: of the surface, in any unit */
    float *direction;          /* of each ray, before its row's turn: all cosines, then all sines */
    float *worst;              /* of each row: its largest error at the level that was estimated last, pixels */
} lathe_estimate_tube;

typedef struct lathe_radius_estimate {
    const lathe_radii *truth;
    double slice;              /* distance of two slices, pixels */
    int32_t every;             /* only so manieth rows are looked at */
    double shares;             /* of all samples */
    lathe_estimate_tube tubes[LATHE_TUBES_MOST];
} lathe_radius_estimate;

lathe_status lathe__estimate_start(lathe_radius_estimate *out, lathe_arena *arena, const lathe_radii *truth, double slice);
/* Of a level that radii have coded: at every sample of the truth, the distance along the ray to the strip between the shown slices and
 * rays, seen from the surface's normal; pixels. Caps and joints are left out. What the tubes show is overwritten. */
lathe_status lathe__estimate_error(double *rms, double *most, const lathe_radius_estimate *estimate, lathe_arena *scratch,
                                   lathe_radii *radii, uint32_t level);
#endif
