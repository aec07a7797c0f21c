/* A contour and its derivation tree as a picture for teaching [M figures 4, 7, 9]: SVG. */
#ifndef LATHE_DRAW_CONTOUR_H
#define LATHE_DRAW_CONTOUR_H
#include "derivation.h"
#include "outline.h"

enum { LATHE_DRAW_MAX_EDGES = 20000 };

typedef struct lathe_drawing {
    const uint64_t *pixels;           /* the slice's region (as in lathe_mask), or NULL */
    int32_t width, height, row_words; /* of pixels */
    const lathe_outline *outline;     /* all loops of the slice, drawn thin, or NULL */
    uint32_t loop;                    /* which of them the contour is of */
    const lathe_ray_contour *contour;
    const lathe_derivation *tree; /* of that contour */
    const char *title;            /* plain text */
} lathe_drawing;

/* Left: region, loops, centre, rays, crossings (IN-OUT filled, OUT-IN hollow), edges in four colours, level-1 edges
 * thicker. Right: the derivation tree with figure 9's nodes (root: double circle, level-1: square, internal: diamond,
 * leaf: circle), level-1 nodes in rows. Below: what the signs mean. Each edge of the contour is one <line> of class
 * for, back, up or down; each leaf of the tree one <circle> of class leaf. *svg is malloc'ed, zero-terminated, the
 * caller's. LIMIT: more than LATHE_DRAW_MAX_EDGES edges. MEMORY. */
lathe_status lathe__draw_contour(char **svg, size_t *size, const lathe_drawing *drawing);
#endif
