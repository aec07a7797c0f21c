/* Checks and measures of meshes. None of this is linked into the decoder. */
#ifndef LATHE_MESH_H
#define LATHE_MESH_H
#include "lathe.h"
#include "mask.h"

/* mesh_check.c: exact, on the integer lattice. */
typedef struct lathe_mesh_report {
    uint64_t boundary_edges, nonmanifold_edges, misoriented_edges; /* edges not used exactly once in each direction */
    uint64_t nonmanifold_vertices;                                 /* whose triangles are not one fan */
    uint64_t degenerate_triangles;                                 /* repeated corner or zero area */
    uint64_t duplicate_positions;                                  /* vertices that share a lattice position with an earlier one */
    uint64_t unused_vertices, bad_indices;
    uint64_t self_intersections;                                   /* pairs of triangles that meet beyond a shared corner or edge */
    uint64_t components;                                           /* of the surface, by shared edges */
    int64_t euler;                                                 /* V - E + F */
} lathe_mesh_report;
/* intersections: also count self-intersecting pairs (exact predicates in __int128 behind a floating filter, uniform grid). */
lathe_status lathe__mesh_check(lathe_mesh_report *out, const lathe_mesh *mesh, bool intersections);
/* Vertices that share a float32 world position with an earlier vertex. */
lathe_status lathe__mesh_float_duplicates(uint64_t *out, const lathe_mesh *mesh, const lathe_transform *transform);

/* mesh_error.c: two-sided distance to the isosurface of the padded volume. */
typedef struct lathe_metrics { double rms_mm, max_mm, area_mm2; } lathe_metrics;   /* worse direction; area of the reference */
typedef struct lathe_reference lathe_reference;
/* Marching cubes of the structure in its own box padded by one voxel: with BOUNDARY_ISO of the grey values at iso (outside
 * the volume is the minimum), with BOUNDARY_EDGE of the 0/1 mask at 1/2. */
lathe_status lathe__reference_build(lathe_reference **out, const lathe_volume *volume, lathe_axis axis, const lathe_mask *mask,
                                    lathe_boundary boundary, double iso);
void lathe__reference_free(lathe_reference **reference);
/* samples: points on each surface (area-uniform, deterministic); vertices of the mesh count for the maximum too. */
lathe_status lathe__reference_measure(lathe_metrics *out, const lathe_reference *reference, const lathe_mesh *mesh,
                                      size_t samples);
/* The same RMS, and whether nothing that is looked at is farther away than a limit: faster than to know how far it is. */
lathe_status lathe__reference_within(bool *within, double *rms_mm, const lathe_reference *reference, const lathe_mesh *mesh, size_t samples,
                                     double limit_mm);
#endif
