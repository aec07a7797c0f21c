/* Radius maps in Draco deltas: a ring's vertices are told by one number each, how long its ray is; the client knows the rest. */
#ifndef LATHE_DRACO_RINGS_H
#define LATHE_DRACO_RINGS_H
#include "contour.h"
#include "draco_walk.h"

/* Where a ray ends, lattice units. centre: half voxels, below 2^15 in magnitude; radius: 1/64 voxel, below 2^19; angle: 1/65536 of a
 * full turn, row: how many slices above the first. As lathe__radius_place. */
lathe_point lathe__draco_ring_point(const int32_t centre[2], int32_t radius, uint32_t angle, int32_t turn, int32_t row);

/* What is told of a structure's tubes before anything else of them. */
void lathe__walk_ring_form(lathe_draco_walk *walk, uint32_t part);
/* The places of all vertices in slices of the structures that are radius maps. */
void lathe__walk_rings(lathe_draco_walk *walk);
#endif
