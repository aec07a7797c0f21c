/* One structure while it is decoded level by level. The encoder keeps one, too, so that both build from the same state. */
#ifndef LATHE_STRUCTURE_STATE_H
#define LATHE_STRUCTURE_STATE_H
#include "archive_format.h"
#include "base_shape.h"
#include "level.h"
#include "occupancy.h"
#include "pyramid.h"
#include "radius_tubes.h"

/* What adapts while packets are coded. One for a model if it is SHARED; else the occupancy is a template, and each structure starts
 * from it. */
typedef struct lathe_models {
    int32_t widest[2];         /* of the slices to come, set before anything is coded; {3, 3} for a template */
    lathe_occupancy *occupancy; /* made on first use; owned */
    lathe_number_model base[LATHE_BASE_MODELS];
} lathe_models;
/* Of a model whose structures have these frames. */
void lathe__models_start(lathe_models *models, const lathe_header *header);

typedef struct lathe_structure_state {
    lathe_mask mask;           /* bits are allocated with the first level of slices */
    lathe_level_plan plan;     /* early: owned */
    int fraction, upright;     /* of border edges, and of a raster's edges along w; header parameter 0 */
    uint32_t flags;            /* header parameter 1 */
    bool exact_base;           /* level 0 has slices, too, and no stars */
    int32_t level;             /* -1: nothing decoded yet */
    uint8_t *finer;            /* of the level's shown slices, if the topology is kept; owned */
    lathe_arena arena;         /* of the base shape, then of the caps */
    lathe_star_slice *base;    /* one for each slice of level 0 */
    lathe_occupancy *occupancy; /* owned, unless SHARED */
    lathe_mask estimate;       /* the base shape's slices as pixels, while level 1 is coded */
    const lathe_pyramid *pyramid; /* levels are rasters: `mask` has bits when the last one is whole. NULL: levels of slices */
    lathe_mask raster;        /* what is known, unless it is all */
    int32_t stride[3];         /* of the raster */
    uint32_t pass;             /* passes known of level + 1 */
    lathe_radii *radii;        /* in the arena: the structure is made of radius maps, and has neither mask nor base */
    lathe_range_decoder cap_code; /* the last packet from its caps on */
    uint8_t *cap_bytes;        /* in the arena; NULL: caps rise half a voxel */
    lathe_caps *caps;          /* instead of the code: an encoder's */
} lathe_structure_state;

/* Is there anything to show? */
static inline bool lathe__state_known(const lathe_structure_state *state) { return state->level >= 0 || state->raster.bits; }
void lathe__state_free(lathe_structure_state *state);
/* What it is made of: a small decoder knows. */
static inline bool lathe__is_pyramid(const lathe_structure_state *state) { return LATHE_RASTERS_ONLY || (!LATHE_TUBES_ONLY && state->pyramid); }
static inline bool lathe__is_radii(const lathe_structure_state *state) { return LATHE_TUBES_ONLY || (!LATHE_RASTERS_ONLY && state->radii); }

/* The first level whose packet has slices. */
static inline uint32_t lathe__first_exact(const lathe_structure_state *state) { return !state->exact_base; }

/* ---- adaptive numbers beside stars and pixels ---- */
/* Slices that begin early are rare in most structures; slices finer than their level are alike. */
enum { LATHE_EARLY_START = 4 << 8, LATHE_NUMBER_START = 128 << 8 };
/* Fresh contexts; zero: the chance that the first one's number is not 0, in 65536ths. */
void lathe__number_start(lathe_number_model *models, int count, uint16_t zero);

/* A cap's shape is 7 minus a number, in a context by the size of its cell. */
enum { LATHE_CAP_MODELS = 4 };
static inline int lathe__cap_context(uint32_t vertices) { return vertices >= 8 ? 3 : vertices >= 4 ? 2 : vertices >= 2; }

/* The slices that a level adds to the ones before, in coding order, with what is then known around each. */
typedef struct lathe_new_slice { int32_t slice; lathe_known known; } lathe_new_slice;
lathe_status lathe__new_slices(lathe_new_slice **out, uint32_t *count, lathe_arena *arena, const lathe_structure_state *state,
                               uint32_t level);

/* The slices that the surface shows now, ascending; *out is arena memory. */
lathe_status lathe__state_slices(int32_t **out, uint32_t *count, lathe_arena *arena, const lathe_structure_state *state);
/* The surface at state->level. arena: two scratch arenas, left reset. */
lathe_status lathe__state_mesh(lathe_mesh *out, lathe_arena arena[2], const lathe_structure_state *state,
                               lathe_surface_counts *counts, uint32_t *shown);

/* The structure's occupancy model: its own copy, or the shared one. */
lathe_status lathe__state_start_occupancy(lathe_structure_state *state, lathe_models *models);
void lathe__state_drop_occupancy(lathe_structure_state *state);
/* Pixels of polygons: each polygon of a slice is marked, then the slice is filled; even-odd, pixels whose middle is inside. */
void lathe__mark_polygon(const lathe_mask *mask, int32_t slice, const lathe_point *polygon, uint32_t count);
void lathe__fill_slice(const lathe_mask *mask, int32_t slice);
/* Fills `estimate` from the base shape. */
lathe_status lathe__state_estimate(lathe_structure_state *state, lathe_arena *scratch);
/* That a structure is made of radius maps, of 65536. */
enum { LATHE_RADIUS_CHANCE = 1 << 13 };
/* What is known of them before their first packet. */
static inline lathe_radii lathe__radii_frame(const lathe_structure_state *state) {
    return (lathe_radii){.slices = state->plan.slices, .width = state->mask.size[0], .height = state->mask.size[1],
                         .level_count = state->plan.level_count};
}

/* pyramid_decode.c: one pass of level `level` (the state's level + 1, and its next pass). The level is the state's after its last one. */
lathe_status lathe__pass_decode(lathe_structure_state *state, lathe_range_decoder *d, lathe_models *models, uint32_t level,
                                const char **fault);
/* structure_decode.c: the rest of a packet is the shapes of its caps. */
lathe_status lathe__keep_caps(lathe_structure_state *state, const lathe_range_decoder *d);
/* structure_decode.c: one packet: the state moves to `level` (its level + 1). */
lathe_status lathe__structure_decode(lathe_structure_state *state, lathe_arena *scratch, lathe_models *models, uint32_t level,
                                     const uint8_t *payload, size_t size, const char **fault);
#endif
