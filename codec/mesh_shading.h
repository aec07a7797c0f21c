/* What a renderer takes of a mesh: world positions, unit normals of the vertices, indices. Arrays are kept from mesh to mesh. */
#ifndef LATHE_MESH_SHADING_H
#define LATHE_MESH_SHADING_H
#include "lathe.h"

typedef struct lathe_mesh_shading {
    float *positions, *normals;        /* 3 for each vertex: mm; of length 1, the sum of the triangles' by area, or 0 if there is none */
    uint32_t *indices;                 /* 3 for each triangle, counter-clockwise from outside in the world */
    struct lathe_vertex_sum *sums;     /* scratch */
    size_t vertices, triangles;        /* room for so many */
} lathe_mesh_shading;

/* Start from {0}. MEMORY: the arrays are as they were. The mesh's indices are trusted. */
lathe_status lathe__mesh_shade(lathe_mesh_shading *out, const lathe_mesh *mesh, const lathe_transform *transform);
void lathe__mesh_shading_free(lathe_mesh_shading *shading);
#endif
