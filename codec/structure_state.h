/* One structure while it is decoded level by level. The encoder keeps one, too, so that both build from the same state. */
#ifndef LATHE_STRUCTURE_STATE_H
#define LATHE_STRUCTURE_STATE_H
#include "archive_format.h"
#include "base_shape.h"
#include "level.h"
#include "occupancy.h"

typedef struct lathe_structure_state {
    lathe_mask mask;           /* bits are allocated with level 1 */
    lathe_level_plan plan;     /* kept: owned */
    int fraction;              /* of border edges, header parameter 0 */
    int32_t level;             /* -1: nothing decoded yet */
    lathe_arena arena;         /* of the base shape */
    lathe_star_slice *base;    /* one for each slice of level 0 */
    lathe_occupancy *occupancy;
} lathe_structure_state;

void lathe__state_free(lathe_structure_state *state);

/* The slices that a level adds to the ones before, in coding order, with what is then known around each. */
typedef struct lathe_new_slice { int32_t slice; lathe_known known; } lathe_new_slice;
lathe_status lathe__new_slices(lathe_new_slice **out, uint32_t *count, lathe_arena *arena, const lathe_structure_state *state,
                               uint32_t level);

/* The surface at state->level. arena: two scratch arenas, left reset. */
lathe_status lathe__state_mesh(lathe_mesh *out, lathe_arena arena[2], const lathe_structure_state *state,
                               lathe_surface_counts *counts, uint32_t *shown);

/* A fresh occupancy state for the structure; *trained is made on first use, so that training is done once for all structures. */
lathe_status lathe__state_start_occupancy(lathe_structure_state *state, lathe_occupancy **trained);

/* structure_decode.c: one packet: the state moves to `level` (its level + 1). */
lathe_status lathe__structure_decode(lathe_structure_state *state, lathe_arena *scratch, lathe_occupancy **trained, uint32_t level,
                                     const uint8_t *payload, size_t size, const char **fault);
#endif
