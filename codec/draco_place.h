/* Places of a delta's vertices: what outlines and the vertices between slices share. */
#ifndef LATHE_DRACO_PLACE_H
#define LATHE_DRACO_PLACE_H
#include "draco_rings.h"

typedef struct lathe_draco_place { int32_t u, v; } lathe_draco_place; /* eighths of a voxel edge */

/* The unit of steps, moves and rises at a vertex, eighths of a voxel edge: 1 to 2^11. */
static inline int32_t lathe__walk_grain(const lathe_draco_walk *w, uint32_t x) { return 1 << w->mesh->parts[w->part[x]].grain_log; }
/* A coordinate: FORMAT beyond 2^20. */
int32_t lathe__walk_bounded(lathe_draco_walk *walk, int64_t value);

/* Writing: is x there? tolerance: lattice units, for a grain of 1. */
bool lathe__place_within(const lathe_draco_walk *walk, uint32_t x, lathe_draco_place place, int64_t tolerance);
/* Writing: the place nearest to x in whole grains from another. */
lathe_draco_place lathe__place_nearest(const lathe_draco_walk *walk, uint32_t x, lathe_draco_place from);
/* Two signed numbers of grains from a place on. */
lathe_draco_place lathe__place_by_numbers(lathe_draco_walk *walk, uint32_t x, lathe_draco_place from);
/* The mean of a vertex's neighbours that have their places, at most 16 of them. */
lathe_draco_place lathe__place_expected(const lathe_draco_walk *walk, uint32_t x, lathe_draco_place otherwise);

/* draco_between.c: one vertex between slices. */
void lathe__place_between(lathe_draco_walk *walk, uint32_t x);
/* draco_partner.c: writing: old vertices that move. */
void lathe__walk_find_partners(lathe_draco_walk *walk);
#endif
