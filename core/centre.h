/* The centre of a loop [M 3.1]: where its rays start. Decoder-safe: integers only. */
#ifndef LATHE_CENTRE_H
#define LATHE_CENTRE_H
#include "arena.h"
#include "contour.h"

/* The point whose column and row each halve the area that the loop encloses (holes inside it count as filled; a hole's
 * own centre is asked for with the hole's loop, in either direction). Where that point is not inside the loop: the
 * middle of the nearest stretch of its column that is. Strictly inside every simple loop, unless it is thinner than
 * three lattice units all about that column; for such and other degenerate loops some point near it, and parsing its
 * contour then says FORMAT. Areas are exact up to the rounding of cut points to the lattice; O(points) for loops of
 * short segments, O(points * 29) at worst. Odd coordinates are preferred: traced outlines have even ones, so that no
 * vertex lies on a ray along the axes. RANGE: no points, or coordinates not below 4098 pixels. MEMORY. */
lathe_status lathe__loop_centre(lathe_point *centre, lathe_arena *arena, const lathe_point *points, uint32_t count);
#endif
