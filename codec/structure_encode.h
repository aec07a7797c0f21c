/* One structure of a bake: its packets, and what `info` says of its levels. */
#ifndef LATHE_STRUCTURE_ENCODE_H
#define LATHE_STRUCTURE_ENCODE_H
#include "archive_write.h"
#include "mesh.h"
#include "structure_state.h"

/* What an encoder knows of the volume beyond the mask. */
typedef struct lathe_encode_source {
    double slice_ratio;        /* slice distance^2 / pixel area: how many voxels a cube of one slice distance has */
    /* The grey value at a position of the mask's frame (u, v, w; also outside), larger inside; NULL: none. Outside is below iso. */
    double (*value)(const void *context, int32_t u, int32_t v, int32_t w);
    /* The same at u and u + 1 of v, then of v + 1, faster. NULL: value is asked. */
    void (*square)(const void *context, int32_t u, int32_t v, int32_t w, float out[4]);
    /* The surface that errors are measured against: made when first asked for, then kept by the context. NULL: make it for yourself. */
    lathe_status (*reference)(const void *context, const lathe_reference **out);
    const void *context;
    double iso;
} lathe_encode_source;

/* Shapes of the caps of a last level, in the order in which a mesh is built; as lathe_caps it gives them again and again. */
typedef struct lathe_cap_list {
    lathe_caps caps;
    struct lathe_cap { uint32_t first, vertices; uint8_t side, shape; } *list;   /* first: vertex of the mesh; owned */
    uint32_t count, capacity, next;
    int64_t *squares;          /* of the chords, cap by cap; owned */
    size_t square_count, square_capacity;
    bool failed;               /* memory is out */
} lathe_cap_list;

typedef struct lathe_baked_structure {
    uint32_t level_count;
    lathe_bytes packets[LATHE_MAX_LEVELS];
    lathe_level_info levels[LATHE_MAX_LEVELS];
    uint8_t *finer[LATHE_MAX_LEVELS]; /* of each level, if the topology is kept; owned */
    lathe_cap_list caps;
    lathe_mesh last;           /* of the last level, if it was built for its caps, until it is asked for; owned */
    lathe_surface_counts last_counts;
    const lathe_radii *truth;  /* of radius maps */
    double area_mm2;           /* of the reference surface; 0 when nothing was measured */
} lathe_baked_structure;
void lathe__baked_free(lathe_baked_structure *baked);

/* Takes a state whose mask is the whole structure, and its fraction and flags; chooses its plan, says what waits. */
lathe_status lathe__structure_plan(lathe_baked_structure *out, lathe_structure_state *state, lathe_arena arena[2],
                                   const lathe_encode_source *source);
/* Ends and frees the coder. */
lathe_status lathe__append_coded(lathe_bytes *out, lathe_range_encoder *e);
/* The base shape of the state's mask, with its plan. */
lathe_status lathe__fit_stars(lathe_structure_state *state, lathe_arena *scratch);
/* Fills the packet of a level: in ascending order; with SHARED models, level by level and structure by structure as they are sent.
 * The state then builds the mesh of each level n (lathe__encoded_mesh). */
lathe_status lathe__structure_encode_level(lathe_baked_structure *out, lathe_structure_state *state, lathe_arena arena[2],
                                           lathe_models *models, uint32_t level, const lathe_encode_source *source);
/* radius_choose.c: makes the state radius maps (state->radii, out->truth) if that is within 0.22 voxel RMS and 1 voxel anywhere, for
 * nine tenths of the bytes of slices. After the plan. */
lathe_status lathe__choose_radii(lathe_baked_structure *out, lathe_structure_state *state, lathe_arena arena[2], const lathe_volume *volume,
                                 lathe_axis axis, lathe_boundary boundary, const lathe_encode_source *source);
/* pyramid_encode.c: one pass of a structure into its packet: level by level, pass by pass; with SHARED models structure by structure. */
lathe_status lathe__pass_encode(lathe_range_encoder *e, lathe_structure_state *state, lathe_models *models, uint32_t level, uint32_t pass);
/* Writes the schedule into the header's parameters from 2 on. Passes halve the longest stride; spacing: of the permuted axes, in mm;
 * most: voxels of the largest structure; levels: at most so many, 0: by the size. */
void lathe__pyramid_plan(lathe_header *header, const double spacing[3], const int32_t most[3], uint32_t levels);
/* Bytes of all passes of a mask as a model of its own; no more passes than it takes to see that they are at least `enough`. */
lathe_status lathe__pyramid_cost(size_t *bytes, const lathe_mask *mask, const double spacing[3], size_t enough);
/* The mesh of a level, from the encoder's state. */
lathe_status lathe__encoded_mesh(lathe_mesh *out, lathe_arena arena[2], lathe_structure_state *state, lathe_baked_structure *baked,
                                 uint32_t level, lathe_surface_counts *counts, uint32_t *shown);

/* ---- structure_plan.c: which slices begin early ---- */

/* A component matters to a level if its volume is at least that of a ball whose diameter is the level's stride: the level's error
 * is about a quarter of the stride, so that ball's radius is twice the error. In voxels; slice_ratio as above. */
double lathe__matters(const lathe_level_plan *plan, uint32_t level, double slice_ratio);
/* Components show their first and last slice from the first level on that they matter to. Allocates plan.early. */
lathe_status lathe__begin_early(lathe_structure_state *state, double slice_ratio);
/* Fills components, waiting ones and their volume in voxels (as waiting_mm3) of each level. A component is shown if a shown slice
 * has voxels of it; at a level of stars, if the middle of a row of its pixels lies within the stars. */
lathe_status lathe__count_waiting(lathe_level_info *levels, const lathe_structure_state *state, lathe_arena *arena);

/* The same of a pyramid, whose levels show a component if a sample is in it. */
lathe_status lathe__pyramid_waiting(lathe_level_info *levels, const lathe_structure_state *state);

/* ---- structure_keep.c: every level with the topology of the last ---- */

/* Lets further slices begin early, until the stack of each level's slices has the topology of all slices. */
lathe_status lathe__keep_slices(lathe_structure_state *state);
/* Which slices of a level must be finer than the level, so that its surface has that topology. *finer is malloc'ed. */
lathe_status lathe__keep_outlines(uint8_t **finer, lathe_structure_state *state, lathe_arena arena[2], uint32_t level);
/* Has the mesh the components and the Euler characteristic of a surface of this region, without flaw? */
lathe_status lathe__mesh_keeps(bool *out, const lathe_mesh *mesh, const lathe_topology *topology);

/* ---- structure_caps.c: where the grey values say ---- */

/* Fills the list and the shapes, and out->last. */
lathe_status lathe__choose_caps(lathe_baked_structure *out, lathe_structure_state *state, lathe_arena arena[2],
                                const lathe_encode_source *source);
void lathe__encode_caps(lathe_range_encoder *e, const lathe_cap_list *list);
void lathe__cap_list_free(lathe_cap_list *list);
#endif
