/* Base contours that overlap themselves [M 3.1, figure 6]: an UP or DOWN edge lies along its ray, so with few rays it
 * can lie over other crossings of the ray. Mended by more rays (figure 6b), or by taking edges out (figure 6c) where
 * rays do not help. */
#ifndef LATHE_MEND_H
#define LATHE_MEND_H
#include "sections.h"

/* How many edges do not lie free: UP and DOWN edges with a crossing of their ray strictly between their ends, and
 * neighbours among the FOR and BACK edges of a ray pair (in order along the rays) that cross. 0: the contour is a
 * simple polygon, up to rounding to the lattice. Contours straight from lathe__make_ray_contour have only the first
 * kind. Scratch in the arena. MEMORY. */
lathe_status lathe__count_overlaps(uint32_t *overlaps, lathe_arena *arena, const lathe_ray_contour *contour);

/* Figure 6(b): casts `rays` rays at the loop, then twice as many, until nothing overlaps or max_rays is reached;
 * *overlaps says what is left then. Arguments otherwise as lathe__make_ray_contour. */
lathe_status lathe__mend_by_rays(lathe_ray_contour *out, uint32_t *overlaps, lathe_arena *arena,
                                 const lathe_point *loop, uint32_t count, lathe_point centre, uint32_t rays,
                                 uint32_t turn, uint32_t max_rays);

/* Figure 6(c): takes out of folds the smallest pairs of pieces (D, U, D_R, U_R nodes of the derivation tree) that hold
 * an edge at fault, until nothing overlaps. Every ray keeps its record crossing; a contour with nothing left but those
 * is star-shaped, so this ends. *removed: edges taken out. Time: count log count for each round; rounds are few.
 * FORMAT as lathe__derive_alone. MEMORY. */
lathe_status lathe__mend_by_pruning(lathe_ray_contour *out, uint32_t *removed, lathe_arena *arena,
                                    const lathe_ray_contour *contour);
#endif
