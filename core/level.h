/* Levels: which slices a level shows, how many rays its loops cast, and the surface that results. Decoder-safe. */
#ifndef LATHE_LEVEL_H
#define LATHE_LEVEL_H
#include "mask.h"
#include "outline.h"
#include "overlay.h"

/* A structure of `slices` slices has level_count levels. Level n shows every 2^(level_count - 1 - n)-th slice, the first and the
 * last, and those that begin early. */
typedef struct lathe_level_plan {
    int32_t slices;
    uint32_t level_count;
    const uint8_t *early;      /* per slice: how many levels before its regular one it is shown, see lathe__slice_level; NULL: none */
} lathe_level_plan;

/* So many that the base shape has at most as many slices as there are slices between them; 2 .. LATHE_MAX_LEVELS. */
uint32_t lathe__choose_levels(int32_t slices);
static inline int32_t lathe__level_stride(const lathe_level_plan *plan, uint32_t level) {
    return (int32_t)1 << (plan->level_count - 1 - level);
}
/* The first level that shows a slice. */
uint32_t lathe__slice_level(const lathe_level_plan *plan, int32_t w);
/* The same without slices that begin early. */
uint32_t lathe__regular_level(const lathe_level_plan *plan, int32_t w);
/* The shown slices, ascending; *out is arena memory. */
lathe_status lathe__level_slices(int32_t **out, uint32_t *count, lathe_arena *arena, const lathe_level_plan *plan, uint32_t level);

/* Rays of a loop whose farthest vertex is `reach` lattice units from its centre: half as many for each level below the last
 * (coarseness), at least 8. The cap is reached at coarseness 0: neighbouring crossings are then at most one voxel apart. */
uint32_t lathe__choose_rays(int64_t reach, uint32_t coarseness);

/* refinement.c: the contour of a level: of each loop the vertices next to the crossings of its rays. A contour that would cross
 * itself or another one, or change sides with it, is refined by further vertices of its loop until it does not [H: expansion].
 * Vertices move by under 1/100 voxel (seed), so that no vertex lies on a line through two others. */
lathe_status lathe__refine_outline(lathe_outline *out, lathe_arena *arena, const lathe_outline *loops, uint32_t coarseness,
                                   uint32_t seed);
lathe_point lathe__jitter(lathe_point p, uint32_t seed);

/* What a stack of outlines became. */
typedef struct lathe_surface_counts {
    lathe_overlay_counts overlay;
    uint32_t rays;             /* most rays of any loop */
    uint64_t contour_vertices; /* vertices of all contours */
} lathe_surface_counts;

/* How a level is built. */
typedef struct lathe_surface_style {
    int fraction;              /* of border edges */
    uint32_t coarseness;       /* how many levels below the last: 0 keeps every vertex */
    const uint8_t *finer;      /* per shown slice: how much less its coarseness is; NULL: none */
    lathe_caps *caps;          /* NULL: half a voxel */
} lathe_surface_style;

/* One slab. As long as there is no room, vertices of the upper outline that are crowded move away from where the mesh still has them;
 * the last of many tries takes what there is. vertex: the mesh's vertex of each of the outlines', the upper one's behind the lower one's;
 * NULL: they begin at slab->base. scratch is left reset. */
lathe_status lathe__stack_slab(lathe_mesh_builder *builder, lathe_arena *scratch, lathe_slab *slab, const uint32_t *vertex,
                               lathe_overlay_counts *counts);
/* Closes a stack of outlines: slab by slab, air below the first and above the last. heights: slice numbers. */
lathe_status lathe__stack_outlines(lathe_mesh *out, lathe_arena *scratch, const lathe_outline *outlines, const int32_t *heights,
                                   uint32_t count, bool lattice, lathe_surface_counts *counts);
lathe_status lathe__stack_with_caps(lathe_mesh *out, lathe_arena *scratch, const lathe_outline *outlines, const int32_t *heights,
                                    uint32_t count, bool lattice, lathe_caps *caps, lathe_surface_counts *counts);

/* The surface of an exact level (n >= 1): slices of the mask traced, cast and stacked. coarseness = level_count - 1 - level. */
lathe_status lathe__build_surface(lathe_mesh *out, lathe_arena arena[2], const lathe_mask *mask, const int32_t *slices,
                                  uint32_t count, int fraction, uint32_t coarseness, lathe_surface_counts *counts);
/* The same, with its style. */
lathe_status lathe__build_styled(lathe_mesh *out, lathe_arena arena[2], const lathe_mask *mask, const int32_t *slices, uint32_t count,
                                 const lathe_surface_style *style, lathe_surface_counts *counts);
/* Its outlines alone, in arena[0]; arena[1] is scratch. */
lathe_status lathe__level_outlines(lathe_outline **out, lathe_arena arena[2], const lathe_mask *mask, const int32_t *slices,
                                   uint32_t count, const lathe_surface_style *style, lathe_surface_counts *counts);
#endif
