/* Deltas for stock Draco decoders: level n out of level n - 1 by a Draco mesh whose vertices carry two small numbers.
 * docs/DRACO_DELTAS.md says what they mean, and web/src/draco_delta.js reads them. */
#ifndef LATHE_DRACO_DELTA_H
#define LATHE_DRACO_DELTA_H
#include "draco_bridge.h"
#include "lathe_codec.h"

enum {
    LATHE_DRACO_ONE = 8,          /* units of a voxel edge */
    LATHE_DRACO_TOLERANCE = 5800, /* lattice units, 0.0885 voxel: how far a vertex may lie from its place within its slice */
    LATHE_DRACO_MIDDLE = 9830,    /* and a middle of two others, 0.15 voxel */
    LATHE_DRACO_SLIDE = 65536,    /* and one where two outlines cross, along them */
};
#define LATHE_DRACO_NONE UINT32_MAX

/* One structure as a client has it. */
typedef struct lathe_draco_part {
    uint32_t height_count, triangle_count, contour_count;
    int32_t *heights;          /* of the shown slices, voxels, ascending */
    uint32_t (*triangles)[3];  /* counter-clockwise in world space */
    uint32_t *contour;         /* the vertices in shown slices, by slice, then by number */
} lathe_draco_part;

/* What a client keeps. Vertices are only ever added: one that a level has keeps its number and its place. */
typedef struct lathe_draco_mesh {
    uint32_t vertex_count, capacity, part_count, level_count; /* level_count: deltas that were applied */
    int32_t (*at)[3];          /* eighths of a voxel edge, in the permuted frame (u, v, w) of the volume */
    uint32_t *next;            /* along its outline, or LATHE_DRACO_NONE */
    lathe_draco_part *parts;   /* by the number of the structure in its model */
    double affine[12];         /* eighths of voxels -> world mm, rows x, y, z; from delta 0 */
} lathe_draco_mesh;            /* owned; zeroed: nothing yet */
void lathe__draco_mesh_free(lathe_draco_mesh *mesh);

/* Applies the next delta; no bytes: nothing changes. Hostile bytes are safe: FORMAT or LIMIT, or CHECKSUM if the result is
 * not what the writer had; the mesh is then of no more use. */
lathe_status lathe__draco_delta_apply(lathe_draco_mesh *mesh, const uint8_t *bytes, size_t size);

/* What the writer knows of a delta's vertices, in the order in which Draco gives them back. */
typedef struct lathe_draco_truth {
    const int32_t (*exact)[3]; /* lattice units */
    const int32_t *half;       /* 2 i: in shown slice i of its structure; odd: between */
    const uint32_t *part;
    struct lathe_draco_heights { uint32_t count; const int32_t *at; } const *heights; /* of each structure */
} lathe_draco_truth;
/* draco_walk.c: both directions. With truth the carrier's triangles are given, and its values and words are made; without,
 * everything is given. The mesh moves to the next level. */
lathe_status lathe__draco_walk(lathe_draco_mesh *mesh, lathe_draco_carrier *carrier, const lathe_draco_truth *truth);

#endif
