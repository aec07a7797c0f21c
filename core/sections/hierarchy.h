/* Outlines at any tolerance that never intersect [H]: Douglas-Peucker's tree, adjusted until every tolerance gives
 * simple loops. */
#ifndef LATHE_HIERARCHY_H
#define LATHE_HIERARCHY_H
#include "sections.h"

/* What it took. */
typedef struct lathe_hierarchy_counts {
    uint32_t plain;            /* possible representations by Douglas-Peucker's errors alone: distinct ones, and the
                                * whole outline */
    uint32_t adjusted;         /* with no child's attribute above its parent's ("natural") */
    uint32_t resolved;         /* without intersections; = tolerance_count */
    uint32_t printed;          /* the same if the children of early pieces inherited, too, as RESOLVE_TREE has it in
                                * print [H 2.3] */
    uint32_t inherited;        /* pieces expanded earlier than by their own error */
    uint64_t octangle_tests;   /* pairs of pieces whose octangles were compared */
    uint64_t chord_tests;      /* pairs whose chords were compared as well */
    uint32_t most_links;       /* cross-links at the worst moment */
    bool gave_up;              /* see lathe__hierarchy_build */
} lathe_hierarchy_counts;

/* All loops of an outline, jointly. A vertex is part of the outline at a tolerance if its attribute is greater. */
typedef struct lathe_hierarchy {
    const lathe_outline *outline;   /* as it was given */
    double *attribute;         /* per point of the outline, lattice units; INFINITY: in every representation */
    double *tolerances;        /* ascending, different: 0, and each at which vertices go */
    uint32_t tolerance_count;
    lathe_hierarchy_counts counts;
} lathe_hierarchy;

/* A vertex on the straight line between its neighbours goes at this tolerance: no other distance is as small. */
#define LATHE_HIERARCHY_LEAST (1.0 / 4294967296.0)

/* Builds the hierarchy. At *every* tolerance, for an outline whose loops neither cross nor touch:
 *  - no loop crosses or touches itself or another, none vanishes (three vertices remain), none turns over;
 *  - every loop lies inside the same other loops as before;
 *  - the distance between each loop and its simplification is at most the tolerance, both ways (Hausdorff; computed in
 *    double);
 *  - a greater tolerance keeps a subset of the vertices.
 * Predicates are exact; points must be below 2^29. The outline must outlive the hierarchy, whose arrays are the
 * arena's. Time is about n log n for natural shapes. Memory while it builds: some 130 bytes a point and 28 a
 * cross-link; afterwards at most 16 bytes a point. Where octangles overlap more than they separate (long slanted teeth
 * by the thousand), it gives up after 2^24 + 256 n pairs, or 2^22 + 8 n cross-links: all vertices that would go at
 * smaller tolerances than the ones reached then go together (counts.gave_up); what is promised above holds all the
 * same.
 * FORMAT: a loop with fewer than three points or without area, or loops that touch (found unless it gave up). RANGE:
 * coordinates. LIMIT: 2^30 points. MEMORY. */
lathe_status lathe__hierarchy_build(lathe_hierarchy *out, lathe_arena *arena, const lathe_outline *outline);
/* The same with another number of pairs after which it gives up. */
lathe_status lathe__hierarchy_build_within(lathe_hierarchy *out, lathe_arena *arena, const lathe_outline *outline,
                                           uint64_t most_tests);

/* The outline at a tolerance, in lattice units; 0 or less, or NaN: the whole one. Loops and points keep their order.
 * Arrays are the arena's; `ray` is NULL if the outline's is. MEMORY. */
lathe_status lathe__hierarchy_outline(lathe_outline *out, lathe_arena *arena, const lathe_hierarchy *hierarchy,
                                      double tolerance);
/* All distinct representable tolerances, ascending from 0: each gives another outline, and no other tolerance gives
 * a further one. */
const double *lathe__hierarchy_tolerances(uint32_t *count, const lathe_hierarchy *hierarchy);

/* Both in one: fewer points within a tolerance (lattice units), with the promises above. Errors as
 * lathe__hierarchy_build. */
lathe_status lathe__simplify_section(lathe_outline *out, lathe_arena *arena, const lathe_outline *outline,
                                     double tolerance);
#endif
