/* Volumes with known answers, computed in memory. Spacing 1 mm unless said; the caller closes them; NULL when memory is out.
 *
 * GREY: roughly the signed distance to the surface in voxels, positive inside, clamped to -3 .. 3: threshold at PHANTOM_ISO
 * (no voxel of the curved phantoms lies exactly there unless its centre does). LABEL: 1 inside, 0 outside; the same voxels.
 * `voxel`-like phantoms (specks, voxel, slice, diagonals, full) are 1 inside and -1 (GREY) or 0 (LABEL) outside. */
#ifndef LATHE_PHANTOM_H
#define LATHE_PHANTOM_H
#include "lathe.h"

typedef enum phantom_kind { PHANTOM_GREY, PHANTOM_LABEL } phantom_kind;
#define PHANTOM_ISO 0.0

lathe_volume *phantom_sphere(int n, double radius, phantom_kind kind); /* n^3, centred slightly off the lattice */
lathe_volume *phantom_torus(int n, double major, double minor, phantom_kind kind); /* axis z */
/* Two legs that run together into one trunk along z: two loops in the low slices, one in the high ones. */
lathe_volume *phantom_branch(int n, phantom_kind kind);
/* A ball inside a cavity inside a ball: 2 components, 1 cavity. n >= 24. */
lathe_volume *phantom_shells(int n, phantom_kind kind);
/* A column with an X-shaped section that turns by `turn` radians from the first slice to the last. */
lathe_volume *phantom_column(int n, double turn, phantom_kind kind);
/* `count` single voxels, no two of which touch even at a corner: count components (fewer if they do not fit). */
lathe_volume *phantom_specks(int n, int count, uint32_t seed, phantom_kind kind);
lathe_volume *phantom_voxel(int n, phantom_kind kind); /* one voxel in the middle */
lathe_volume *phantom_slice(int n, phantom_kind kind); /* n x n x 1: a disc with a hole */
/* (x + y + z) even: only corners and edges touch. */
lathe_volume *phantom_diagonals(int n, phantom_kind kind);
lathe_volume *phantom_blobs(int n, int count, uint32_t seed, phantom_kind kind); /* random balls joined and cut */
lathe_volume *phantom_full(int nx, int ny, int nz, phantom_kind kind);           /* every voxel inside */
/* Every voxel 1 with probability percent / 100: any topology. */
lathe_volume *phantom_noise(int nx, int ny, int nz, int percent, uint32_t seed, phantom_kind kind);

/* A small generator: the same numbers everywhere. */
uint32_t phantom_random(uint32_t *state);
#endif
