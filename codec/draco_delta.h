/* Deltas for stock Draco decoders: level n out of level n - 1 by a Draco mesh whose vertices carry two small numbers.
 * docs/DRACO_DELTAS.md says what they mean, and web/src/draco_delta.js reads them. */
#ifndef LATHE_DRACO_DELTA_H
#define LATHE_DRACO_DELTA_H
#include "draco_bridge.h"
#include "draco_rank.h"
#include "lathe_codec.h"

enum {
    LATHE_DRACO_ONE = 8,          /* units of a voxel edge */
    LATHE_DRACO_HEIGHT = 4,       /* and of what heights of slices are told in, half a voxel */
    LATHE_DRACO_TOLERANCE = 5800, /* lattice units, 0.0885 voxel: how far a vertex may lie from its place within its slice */
    LATHE_DRACO_MIDDLE = 9830,    /* and a middle of two others, 0.15 voxel */
    LATHE_DRACO_SLIDE = 65536,    /* and one where two outlines cross, along them */
    LATHE_DRACO_RING = 9830,      /* and one of a radius map, 0.15 voxel */
};
#define LATHE_DRACO_NONE UINT32_MAX
enum { LATHE_DRACO_TUBES = 8 }; /* of one structure, at most */

/* A tube of a radius map: one ring in each of its shown slices; arrays by row, then ray. */
typedef struct lathe_draco_tube {
    uint32_t rows, rays;       /* a power of two */
    bool clockwise;            /* the outline goes from ray to ray before */
    int32_t *height;           /* half voxels, ascending */
    int32_t (*centre)[2];      /* half voxels */
    int32_t *radius;           /* 1/64 voxel */
    uint32_t *id;              /* vertex numbers; a writer's: NULL */
} lathe_draco_tube;            /* owned; zeroed: none */
typedef struct lathe_draco_rings { uint32_t count; lathe_draco_tube *tubes; } lathe_draco_rings;
void lathe__draco_rings_free(lathe_draco_rings *rings);

/* One structure as a client has it. */
typedef struct lathe_draco_part {
    uint32_t height_count, triangle_count, contour_count;
    int32_t *heights;          /* of the shown slices, half voxels, ascending */
    uint32_t (*triangles)[3];  /* counter-clockwise in world space */
    uint32_t *contour;         /* the vertices in shown slices, by slice, then by number */
    bool samples;              /* vertices between slices lie over samples */
    uint32_t grain_log;        /* log2 of the unit of its steps, moves and rises, in eighths of a voxel edge */
    lathe_draco_rings rings;   /* of the latest delta */
    lathe_draco_rings form;    /* a delta's tubes, with rays and direction alone; none: it is no radius map */
    int32_t turn, step;        /* its: of a slice's rays against those of the slice below, 1/65536 of a full turn; of its radii */
} lathe_draco_part;

/* What a client keeps. A vertex in a slice keeps its number as long as its structure has it; others are added. */
typedef struct lathe_draco_mesh {
    uint32_t vertex_count, capacity, part_count, level_count; /* level_count: deltas that were applied */
    int32_t (*at)[3];          /* eighths of a voxel edge, in the permuted frame (u, v, w) of the volume */
    uint32_t *next;            /* along its outline, or LATHE_DRACO_NONE */
    lathe_draco_part *parts;   /* by the number of the structure in its model */
    double affine[12];         /* eighths of voxels -> world mm, rows x, y, z; from delta 0 */
    uint32_t *spare, spare_count; /* numbers that no vertex has */
    lathe_ranks ranks[2];      /* what its deltas have seen: slices; places */
} lathe_draco_mesh;            /* owned; zeroed: nothing yet */
void lathe__draco_mesh_free(lathe_draco_mesh *mesh);

/* Applies the next delta; no bytes: nothing changes. Hostile bytes are safe: FORMAT or LIMIT, or CHECKSUM if the result is
 * not what the writer had; the mesh is then of no more use. */
lathe_status lathe__draco_delta_apply(lathe_draco_mesh *mesh, const uint8_t *bytes, size_t size);

/* ---- writing ---- */

/* What the writer knows of a structure at a level, in the volume's permuted frame. */
typedef struct lathe_draco_shape {
    uint32_t height_count;
    int32_t *heights;          /* of the shown slices, half voxels, ascending; owned */
    int32_t origin[2];         /* voxel of the box's pixel (0, 0) */
    int32_t stride[2];         /* along u, v, if the surface is that of a lattice of samples origin + k stride; 0: it is not */
    bool samples;              /* and vertices between slices lie over samples */
    int32_t before[2];         /* the same at the level before; 0: its vertices stay where they are */
    lathe_draco_rings rings;   /* of a radius map: slice by slice, then tube by tube, they are the mesh's first vertices; owned */
    int32_t turn;
} lathe_draco_shape;
void lathe__draco_shape_free(lathe_draco_shape *shape);

/* The structures that change at a level in one mesh. */
typedef struct lathe_draco_level {
    uint32_t vertex_count, triangle_count, vertex_room, triangle_room;
    int32_t (*exact)[3];       /* of the volume's frame, lattice units */
    int32_t *half;             /* 2 i: in shown slice i of its structure; odd: between */
    uint32_t *part;            /* structure */
    uint32_t *ring;            /* of a radius map's vertex: tube << 28 | row * rays + ray, or NONE */
    uint32_t (*triangles)[3];
} lathe_draco_level;           /* owned; zeroed: empty */
void lathe__draco_level_free(lathe_draco_level *level);
/* Adds a structure. mesh: of its box, whose pixel (0, 0) of slice 0 is voxel origin; its shape may lose its radius map, if that
 * is not what the mesh has. MEMORY, LIMIT. */
lathe_status lathe__draco_level_add(lathe_draco_level *level, const lathe_mesh *mesh, uint32_t structure, lathe_draco_shape *shape,
                                    const int32_t origin[3], bool mirrored);
/* Moves the mesh, which has the level before, to the level. *out (malloc'ed) may be NULL: not wanted. shapes: by structure.
 * affine: for delta 0, else NULL. UNSUPPORTED if the level is no stack of slabs. */
lathe_status lathe__draco_delta_write(uint8_t **out, size_t *size, lathe_draco_mesh *mesh, const lathe_draco_level *level,
                                      const lathe_draco_shape *shapes, double *affine);

/* What the writer knows of a delta's vertices, in the order in which Draco gives them back. */
typedef struct lathe_draco_truth {
    const int32_t (*exact)[3];
    const int32_t *half;
    const uint32_t *part, *ring;
    const lathe_draco_shape *shapes; /* of each structure */
} lathe_draco_truth;
/* draco_walk.c: both directions. With truth the carrier's triangles are given, and its values and words are made; without,
 * everything is given. The mesh moves to the next level. */
lathe_status lathe__draco_walk(lathe_draco_mesh *mesh, lathe_draco_carrier *carrier, const lathe_draco_truth *truth);

#endif
