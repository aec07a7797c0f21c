/* A closed mesh as a volume: so that a reconstructed contour set can be baked. */
#ifndef LATHE_VOXELISE_H
#define LATHE_VOXELISE_H
#include "lathe.h"

/* A grid of 0 and 1 over the mesh's box, with one voxel of margin on every side: 1 where the voxel's centre lies
 * inside. spacing: mm, one for all three directions. Inside is counted along the w direction by exact predicates,
 * corners and edges shared out by one rule: no column leaks. Columns lie on whole lattice positions nearest to the
 * voxel centres. The transform must be diagonal, as that of a contour set that was read. RANGE: spacing not
 * positive, or transform not diagonal; LIMIT: more than LATHE_MAX_DIM voxels along an axis or 2^28 in all; MEMORY. */
lathe_status lathe__voxelise(lathe_volume **out, const lathe_mesh *mesh, const lathe_transform *transform,
                             double spacing, lathe_error *err);
#endif
