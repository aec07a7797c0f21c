/* A tube: the surface through one loop of each slice, tiled pairwise by derivation trees [M 4], closed by a fan at
 * either end; and its refinement as edits of the mesh [M 5.2]. Vertices and triangles keep their numbers while others
 * come and go.
 *
 *   one ray more [5.2.1]    in each strip, only the triangles at edges between the two old rays are looked at: those
 * of the level-1 edge, and
 *                           of the folds on either ray; those that stay the same stay
 *   one slice more [5.2.2]  the strip between its neighbours goes, two new ones come
 *
 * What is promised: after any sequence of edits the triangles are those of a mesh made anew from the finer contours.
 * Level-1 edges are chosen (ambiguous case 1) at the first rays, where a strip is begun, and come down to new rays as
 * contour_edit.h says.
 *
 * Closed and manifold always, as far as corners go. As a shape it is proper for star-shaped loops; a loop with folds
 * can make strips and fans that cross themselves (reconstruct.h is for those). */
#ifndef LATHE_TUBE_SURFACE_H
#define LATHE_TUBE_SURFACE_H
#include "contour_edit.h"

typedef struct lathe_tube_loop {
    const lathe_point *points; /* counter-clockwise; the caller's, must stay */
    uint32_t count;
    lathe_point centre;
    int32_t height; /* ascending from loop to loop */
    uint32_t turn;  /* of its first ray, 1/65536 of a full turn */
} lathe_tube_loop;

/* What edits did; counts grow from call to call. */
typedef struct lathe_tube_work {
    uint64_t kept; /* triangles that were looked at and stayed */
    uint64_t removed, added;
    uint64_t vertices; /* added */
} lathe_tube_work;

typedef struct lathe_tube_surface lathe_tube_surface;
/* At `rays` rays (a power of two in 4..65536). RANGE: fewer than two loops, or heights that do not ascend; FORMAT: a
 * loop that does not go round its centre once at these rays; LIMIT; MEMORY. Any loops are safe. */
lathe_status lathe__tube_open(lathe_tube_surface **out, const lathe_tube_loop *loops, uint32_t count, uint32_t rays);
void lathe__tube_close(lathe_tube_surface **tube); /* NULL and a pointer to NULL are fine */

/* One ray more in every slice, between ray `after` and the next, at an angle in 1/65536 turn; it gets the next number.
 * RANGE: the angle is not between theirs. After any other failure the tube can only be closed. */
lathe_status lathe__tube_insert_ray(lathe_tube_surface *tube, uint32_t after, uint32_t angle);
/* A ray half way between each two neighbours. RANGE beyond 65536 rays. */
lathe_status lathe__tube_double_rays(lathe_tube_surface *tube);
/* One slice more; its height lies strictly between two of the tube's (else RANGE). It is brought to the tube's rays.
 * FORMAT as above: the tube is as it was. After MEMORY or LIMIT it can only be closed. */
lathe_status lathe__tube_insert_slice(lathe_tube_surface *tube, const lathe_tube_loop *loop);

uint32_t lathe__tube_slices(const lathe_tube_surface *tube);
uint32_t lathe__tube_triangles(const lathe_tube_surface *tube);
lathe_tube_work lathe__tube_work_done(const lathe_tube_surface *tube);
/* The contour of the k-th slice from below. */
const lathe_edit_contour *lathe__tube_contour(const lathe_tube_surface *tube, uint32_t slice);
/* The mesh's vertex at a crossing of the k-th slice; crossing UINT32_MAX: the apex of an end's fan. */
uint32_t lathe__tube_vertex(const lathe_tube_surface *tube, uint32_t slice, uint32_t crossing);
/* The mesh as it is: vertices in the order in which they came, triangles counter-clockwise from outside. Owned by the
 * caller. MEMORY. */
lathe_status lathe__tube_mesh(lathe_mesh *out, const lathe_tube_surface *tube);
#endif
