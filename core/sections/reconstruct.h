/* From a contour set to a closed surface [P]. */
#ifndef LATHE_RECONSTRUCT_H
#define LATHE_RECONSTRUCT_H
#include "slab_surface.h"

typedef struct lathe_reconstruct_options {
    lathe_slab_options slab;
    int32_t cap;               /* how far the caps of the first and last section rise beyond them, lattice units; 0:
                                * flat, in them */
    bool lattice;              /* every edge of every section lies within one pixel square: outlines as they were
                                * traced */
    const uint32_t *const *turns;   /* per section, per loop: where its first ray points, 1/65536 of a turn; NULL: 0 */
} lathe_reconstruct_options;
/* Links by regions, trees, overlays, no mid-slices, the paper's threshold; flat caps. */
void lathe_reconstruct_defaults(lathe_reconstruct_options *options);

typedef struct lathe_reconstruct_report {
    lathe_slab_counts blocks;
    uint32_t slabs;            /* one more than sections: beyond the ends, too */
    uint32_t overlaid;         /* slabs that fell back to the lifted overlay as a whole, and why: */
    uint32_t crossing, torn, flat;   /* triangles met; edges or fans were wrong; something was flat, degenerate or
                                      * twice there */
    uint32_t separated;        /* slabs in which nothing could be joined: each loop was closed for itself */
    uint32_t moved;            /* sections whose points were moved, because they touched their neighbour's */
    int32_t farthest;          /* by at most so many lattice units along each axis */
    uint32_t vertices, triangles;
} lathe_reconstruct_report;

/* The surface of a contour set: closed, 2-manifold, oriented outwards; no triangle without area, no two vertices at
 * one place, no self-intersection, whatever the options. Each slab is proved alone, with exact predicates; slabs at
 * fault become lifted overlays, are proved again, and if outlines touch or rounding folds the overlay, the points of
 * both sections are moved by a hash of their position (at first by at most 30 lattice units, less than half a
 * quantum of a set that was read) and all slabs about them are built anew. As a last resort the loops of a slab are
 * closed one by one.
 * out: owned by the caller, vertices of the sections first. report may be NULL.
 * EMPTY: no section has a loop; LIMIT: even the last resort failed (err names the sections), or too large; MEMORY;
 * RANGE. */
lathe_status lathe__reconstruct(lathe_mesh *out, lathe_reconstruct_report *report, const lathe_contour_set *set,
                                const lathe_reconstruct_options *options, lathe_error *err);
#endif
