/* The lifted overlay of two outlines: the surface between two neighbouring slices (Barequet and others, 2004), in integers.
 * Decoder-safe. */
#ifndef LATHE_OVERLAY_H
#define LATHE_OVERLAY_H
#include "contour.h"

/* A growing mesh. Vertices of outlines are put in by the caller; slabs append theirs behind. */
typedef struct lathe_mesh_builder {
    lathe_mesh mesh;
    uint32_t vertex_capacity, triangle_capacity;
} lathe_mesh_builder;
lathe_status lathe__builder_reserve(lathe_mesh_builder *builder, size_t vertices, size_t triangles);

/* One outline crossing another, in the plane of projection. */
typedef struct lathe_meeting {
    uint32_t edge[2];          /* of the lower [0] and the upper [1] outline */
    uint32_t rank[2];          /* order along each edge */
    double numerator[2], denominator[2];   /* exact whole numbers below 2^53 where ranks need them, see overlay.c */
    bool enters;               /* the lower outline enters the upper region here */
} lathe_meeting;

enum { LATHE_RISE_MIN = LATHE_LATTICE_ONE / 64, LATHE_RISE_MAX = LATHE_LATTICE_ONE - LATHE_RISE_MIN };
/* The shape of the caps: asked for each cell of a single outline, in the order in which a mesh is built. */
typedef struct lathe_caps {
    /* vertices: how many are about to be added, behind mesh->vertex_count; side: 0 they rise from the lower slice, 1 fall from the
     * upper one. 0 .. 3: all by (2 * shape + 1) / 8 of a slice distance; 4 .. 7: the middle of a chord of c pixels by
     * c * c / 2^(2 * shape - 7), as on a paraboloid. */
    uint32_t (*shape)(struct lathe_caps *caps, const lathe_mesh *mesh, uint32_t vertices, uint32_t side);
    /* NULL, or told of the chord below each of these vertices, in order: its length squared. Not by a small decoder. */
    void (*chord)(struct lathe_caps *caps, int64_t square);
} lathe_caps;
/* How far a vertex over such a chord rises, lattice units. */
static inline int32_t lathe__cap_rise(uint32_t shape, int64_t square) {
    int64_t bow = square >> (LATHE_LATTICE_BITS - 7 + 2 * shape);
    if (shape < 4) bow = (int64_t)(2 * shape + 1) * (LATHE_LATTICE_ONE / 8);
    return bow < LATHE_RISE_MIN ? LATHE_RISE_MIN : bow > LATHE_RISE_MAX ? LATHE_RISE_MAX : (int32_t)bow;
}

typedef struct lathe_slab {
    const lathe_outline *outline[2];   /* lower, upper; an outline without points is air */
    int32_t height[2];                 /* of the two slices, lattice units, height[0] < height[1] */
    uint32_t base;                     /* where their vertices begin in the mesh, the upper one's behind the lower one's */
    int32_t cap;                       /* how far a cell of a single outline rises from its slice, lattice units, */
    lathe_caps *caps;                  /* or of its own shape; NULL: cap */
    bool lattice;                      /* every edge lies within one pixel square */
    uint8_t *crowded;                  /* per vertex of the upper outline, zeroed; NULL (always if lattice): room is not looked for */
} lathe_slab;

/* How the tubes and joints of a slab turned out; sums over slabs. */
typedef struct lathe_overlay_counts {
    uint64_t crossings, strips, other_cells, single_cells, tree_strips;
    uint64_t links[4];         /* blocks of loops: self, one-to-one, one-to-many, many-to-many */
    uint64_t contacts;         /* places where a vertex of one outline lies on an edge of the other */
} lathe_overlay_counts;

/* Appends the triangles of one slab. Scratch comes from the arena; the caller resets it.
 * RANGE, with `crowded` only: rounding could harm the surface, as a vertex lies within 1/1024 voxel of an edge that does not end
 * there, or the upper outline crosses itself. Vertices of the upper outline that should move are marked; the mesh is as before. */
lathe_status lathe__overlay_slab(lathe_mesh_builder *builder, lathe_arena *arena, const lathe_slab *slab,
                                 lathe_overlay_counts *counts);

/* tube.c: which vertices of two linked loops correspond, by walking the derivation trees of their contours [M 4.1-4.5].
 * partner[0][i]: position along loop b (0 <= position < b's count) that vertex i of loop a (counted from its first) goes with;
 * partner[1]: the other way. Corresponding edges that stand for several vertices share them out evenly. */
typedef struct lathe_tube { float *partner[2]; } lathe_tube;
/* FORMAT if a contour has no tree (its rays do not go round its centre once). Result and scratch are arena memory. */
lathe_status lathe__match_loops(lathe_tube *out, lathe_arena *arena, const lathe_outline *a, uint32_t loop_a, const lathe_outline *b,
                                uint32_t loop_b);

/* triangulate.c */
typedef struct lathe_polygon {
    const lathe_point *at;     /* position of a node */
    uint32_t *nodes;           /* rings one behind the other: the outer ring counter-clockwise, then holes clockwise */
    uint32_t *ring_end;        /* end of each ring in nodes */
    uint32_t ring_count;
} lathe_polygon;
/* Triangles of a polygon with holes, counter-clockwise, as node triples; flipped towards Delaunay. *triangles is arena memory
 * with nodes + 2 * holes - 2 triples. neighbour[3 * t + k]: the triangle across the edge from corner k to k + 1, as 3 * t' + k',
 * or UINT32_MAX on the boundary. Always ends with a topological disk with holes, whatever the positions are. */
lathe_status lathe__triangulate(uint32_t (**triangles)[3], uint32_t **neighbour, uint32_t *count, lathe_arena *arena,
                                const lathe_polygon *polygon);
#endif
