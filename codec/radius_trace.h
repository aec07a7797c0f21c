/* Encoder: the loops of all slices, grouped into tubes. */
#ifndef LATHE_RADIUS_TRACE_H
#define LATHE_RADIUS_TRACE_H
#include "mask.h"
#include "radius_tubes.h"

typedef struct lathe_traced_tube { int32_t first, rows; bool hole; lathe_row_loop *loops; } lathe_traced_tube;
typedef struct lathe_traced_tubes { uint32_t count; lathe_traced_tube tubes[LATHE_TUBES_MOST]; } lathe_traced_tubes;

/* A tube goes on where a loop and one of the next slice overlap and neither overlaps another of its kind. Arena memory, loops
 * counter-clockwise. EMPTY: more than LATHE_TUBES_MOST tubes, as soon as that is known. */
lathe_status lathe__radius_trace(lathe_traced_tubes *out, lathe_arena *arena, const lathe_mask *mask, int fraction);

/* radius_disjoint.c: whether polygons, each simple, are disjoint, outer ones within nothing, holes within one outer one. Each pair of
 * edges is looked at. */
bool lathe__loops_fit(const lathe_outline *outline);
#endif
