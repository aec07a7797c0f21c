/* The surface of a raster of samples: what lies between neighbouring samples, one inside and one outside. Decoder-safe. */
#ifndef LATHE_RASTER_SURFACE_H
#define LATHE_RASTER_SURFACE_H
#include "arena.h"
#include "mask.h"

/* Rays run along the raster's lines, in all three directions; a vertex lies in each of their crossings, `fraction` 64ths (along u and v,
 * and along w) of the way from the sample inside to the one outside; it is limited to 4 .. 60. Eight neighbouring samples are a cube, in
 * which a table (cube_table.h) joins the vertices, so that samples inside are connected along edges only, samples outside also across
 * diagonals. Lattice units; samples are LATHE_LATTICE_ONE apart; outside of the mask is air. Always closed, 2-manifold, consistently
 * oriented, free of self-intersection, and of the topology of the samples (docs/ARCHITECTURE.md says why).
 * *out is malloc'ed. MEMORY, LIMIT. */
lathe_status lathe__raster_surface(lathe_mesh *out, lathe_arena *scratch, const lathe_mask *mask, const int fraction[2]);
#endif
