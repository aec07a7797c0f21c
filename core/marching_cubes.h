/* Marching cubes of one structure, as loose triangles: the reference that meshes are measured against. */
#ifndef LATHE_MARCHING_CUBES_H
#define LATHE_MARCHING_CUBES_H
#include "box_tree.h"
#include "mask.h"

/* Four triangles side by side: coordinate i of corner c of all four is corner[c][i]. */
typedef struct lathe_packet {
    lathe_f4 corner[3][3];
} lathe_packet;

static inline void lathe__packet_put(lathe_packet *packets, size_t triangle, int corner, const float p[3]) {
    for (int i = 0; i < 3; i++) ((float *)&packets[triangle / 4].corner[corner][i])[triangle % 4] = p[i];
}

/* What is inside: bits of the mask; where the surface lies between two voxels: at iso of the values, or in the middle. */
typedef struct lathe_field {
    const lathe_mask *mask;
    const lathe_volume *volume; /* NULL: in the middle */
    lathe_axis axis;
    double iso;
} lathe_field;

/* Loose triangles along a curve. Both arrays are malloc'ed; places of the last packet from count on are not filled. */
typedef struct lathe_soup {
    uint32_t count;
    lathe_packet *packets;
    uint32_t *key; /* where on the curve each packet begins: ascending */
} lathe_soup;

/* The surface in the order of the curve through its cells, closed: outside of the mask is empty, outside of the volume its
 * minimum. voxel_to_world: from voxels of the mask's frame. MEMORY, LIMIT (more than 2^31 triangles), EMPTY. */
lathe_status lathe__marching_cubes(lathe_soup *out, const lathe_field *field, const float voxel_to_world[3][4],
                                   const lathe_curve *curve);
#endif
