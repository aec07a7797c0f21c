/* Polygonal approximation of a curve in one pass: break points such that the points between two of them lie in a strip.
 * Lyu 1994 [L], with Roberge (1985) and Williams (1978) beside it for comparison. */
#ifndef LATHE_STRIP_H
#define LATHE_STRIP_H
#include "sections.h"

/* What a run cost, counted as [L] counts in its table 1. */
typedef struct lathe_strip_cost { uint64_t square_roots, multiplications; } lathe_strip_cost;

/* Each: points: 2 * count doubles (x, y), count >= 2, in any unit; tolerance: positive, in the same; breaks: room
 * for count indices, ascending, the first is 0 and the last count - 1; *break_count is written. cost may be NULL. */

/* [L]: two lines through fixed points U and L, each e beside the start, turn separately until they are parallel;
 * cross products only, updates deferred [L II.3]. Between two breaks every point is within tolerance of *some* line
 * near the start, which need not be the drawn chord: see lathe__strip_drawn. O(count). */
void lathe__strip_lyu(uint32_t *breaks, uint32_t *break_count, const double *points, uint32_t count, double tolerance,
                      lathe_strip_cost *cost);
/* Roberge: the strip does not turn. */
void lathe__strip_roberge(uint32_t *breaks, uint32_t *break_count, const double *points, uint32_t count,
                          double tolerance, lathe_strip_cost *cost);
/* Williams: the next point must lie in the intersection of the cones of all circles about the points so far. */
void lathe__strip_williams(uint32_t *breaks, uint32_t *break_count, const double *points, uint32_t count,
                           double tolerance, lathe_strip_cost *cost);

/* [L], and then every chord is checked: a run whose chord, as a segment, misses a point by more than tolerance is
 * split at the farthest point until none does. So the drawn polyline is within tolerance of every point. */
void lathe__strip_drawn(uint32_t *breaks, uint32_t *break_count, const double *points, uint32_t count,
                        double tolerance);

/* Distance of point p from the segment a b. */
double lathe__segment_distance(const double p[2], const double a[2], const double b[2]);

/* The polygon of each loop of a slice (traced pixel staircases, say) with the drawn chords within tolerance lattice
 * units of the loop and at least three vertices, all of them the loop's own. Loops stay simple, disjoint and nested:
 * pieces that would cross get vertices back. Arena memory. MEMORY, RANGE. */
lathe_status lathe__strip_outline(lathe_outline *out, lathe_arena *arena, const lathe_outline *loops,
                                  int32_t tolerance);
#endif
