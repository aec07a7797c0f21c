/* The volume that a closed mesh encloses. */
#ifndef LATHE_MESH_VOLUME_H
#define LATHE_MESH_VOLUME_H
#include "lathe.h"

/* In voxels; positive if triangles are counter-clockwise from outside. */
static inline double mesh_volume(const lathe_mesh *mesh) {
    double six = 0;
    for (uint32_t t = 0; t < mesh->triangle_count; t++) {
        double p[3][3];
        for (int k = 0; k < 3; k++)
            for (int i = 0; i < 3; i++) p[k][i] = mesh->lattice[mesh->triangles[t][k]][i] / (double)LATHE_LATTICE_ONE;
        six += p[0][0] * (p[1][1] * p[2][2] - p[1][2] * p[2][1]) - p[0][1] * (p[1][0] * p[2][2] - p[1][2] * p[2][0]) +
               p[0][2] * (p[1][0] * p[2][1] - p[1][1] * p[2][0]);
    }
    return six / 6;
}
#endif
