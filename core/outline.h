/* The outline of a slice: its region's loops, traced on the pixel lattice. Decoder-safe: integers only. */
#ifndef LATHE_OUTLINE_H
#define LATHE_OUTLINE_H
#include "contour.h"
#include "mask.h"

/* Fractions are positions on the segment from an inside pixel centre (0) to the outside one (64). Slices of even order use even
 * fractions, of odd order odd ones, so that outlines of neighbouring slices never share a vertex. */
enum { LATHE_FRACTION_ONE = 64, LATHE_FRACTION_MIN = 4, LATHE_FRACTION_MAX = 60, LATHE_FRACTION_BITS = 10 };

/* One slice of a level and its neighbours in that level. */
typedef struct lathe_slice_view {
    const uint64_t *pixels;
    const uint64_t *below, *above;     /* neighbouring slices of the level; NULL: air */
    int32_t width, height, row_words;  /* margin of one empty pixel included */
    int parity;                        /* order of the slice in its level, modulo 2 */
    int fraction;                      /* where no finer one is known: 1..63 */
    const uint8_t *fractions;          /* per border edge, in tracing order, or NULL */
    size_t fraction_count;             /* of fractions; border edges beyond it use `fraction` */
} lathe_slice_view;

enum { LATHE_NO_BORDER = -1 };
/* Traces every loop, region on the left. A vertex lies on each border edge (inside pixel, outside 4-neighbour); inside pixels
 * connect by edges only, so a diagonal touch separates. So that the overlap of two neighbouring outlines has the topology of the
 * overlap of their pixels:
 *  - where the neighbouring slice has inside and outside exchanged on a border edge, the vertex stays on its own side of the middle;
 *  - where two slices lack opposite corners of one pixel square, both get a dent: a vertex beyond the square's centre.
 * border: NULL, or gets per point pixel * 4 + direction (E N W S) of its border edge, or LATHE_NO_BORDER for a dent. Arena memory. */
lathe_status lathe__trace_outline(lathe_outline *out, int32_t **border, lathe_arena *arena, const lathe_slice_view *view);

/* Number of border edges of a slice, without tracing. */
size_t lathe__count_borders(const lathe_slice_view *view);
/* The same of all slices. */
size_t lathe__mask_borders(const lathe_mask *mask);
#endif
