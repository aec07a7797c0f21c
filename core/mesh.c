/* The mesh itself: memory, and the way from the lattice to the world. Decoder-safe: needs nothing of libc but free. */
#include "lathe.h"
#include <stdlib.h>

void lathe_mesh_free(lathe_mesh *mesh) {
    if (!mesh) return;
    free(mesh->lattice);
    free(mesh->triangles);
    *mesh = (lathe_mesh){0};
}

bool lathe_transform_mirrors(const lathe_transform *transform) {
    const double(*m)[4] = transform->m;
    double determinant = m[0][0] * (m[1][1] * m[2][2] - m[1][2] * m[2][1]) -
                         m[0][1] * (m[1][0] * m[2][2] - m[1][2] * m[2][0]) +
                         m[0][2] * (m[1][0] * m[2][1] - m[1][1] * m[2][0]);
    return determinant < 0;
}

void lathe_mesh_positions(const lathe_mesh *mesh, const lathe_transform *transform, float *positions) {
    for (size_t k = 0; k < mesh->vertex_count; k++) {
        double u = mesh->lattice[k][0], v = mesh->lattice[k][1], w = mesh->lattice[k][2];
        for (int i = 0; i < 3; i++) {
            const double *row = transform->m[i];
            positions[3 * k + (size_t)i] = (float)(((row[0] * u + row[1] * v) + row[2] * w) + row[3]);
        }
    }
}

void lathe_mesh_indices(const lathe_mesh *mesh, const lathe_transform *transform, uint32_t *indices) {
    int swap = lathe_transform_mirrors(transform);
    for (size_t k = 0; k < mesh->triangle_count; k++) {
        indices[3 * k] = mesh->triangles[k][0];
        indices[3 * k + 1] = mesh->triangles[k][1 + swap];
        indices[3 * k + 2] = mesh->triangles[k][2 - swap];
    }
}
