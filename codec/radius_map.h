/* The radius map: a structure that is one tube of star-shaped loops, as an image r(slice, ray). Refined dyadically in slices and in
 * rays: a new radius is predicted from known ones on both sides, what is left is quantised and coded. So that every sample stays
 * within half a step of the truth plus a dead zone, prediction sees what the decoder has (closed loop). Shared by both directions;
 * integers only. */
#ifndef LATHE_RADIUS_MAP_H
#define LATHE_RADIUS_MAP_H
#include "base_shape.h"

enum {
    LATHE_RADIUS_ONE = 64,     /* radius units in a voxel */
    LATHE_RADIUS_LEAST = 16,   /* no radius is smaller: neighbouring crossings stay apart */
    LATHE_RADIUS_MAX_RAYS = 1024, LATHE_RADIUS_CLASSES = 9, LATHE_RADIUS_KINDS = 3,
    LATHE_APEX_ONE = 8
};

typedef struct lathe_radius_map {
    int32_t slices;            /* rows */
    uint32_t level_count;
    uint32_t rays;             /* of the last level: a power of two, 8 to LATHE_RADIUS_MAX_RAYS */
    int32_t step;              /* of the last level, radius units; three quarters of it for each level below */
    int32_t turn;              /* of a slice's rays against those of the slice below, 1/65536 of a full turn, counter-clockwise */
    int32_t apex[2];           /* how far the caps rise below the first and above the last slice, 1/8 of a slice: 1 to 7 */
    int32_t farthest;          /* largest radius allowed */
    int32_t (*centre)[2];      /* of a row, half pixels */
    int32_t *radius;           /* rays of each row, radius units */
    int8_t *left;              /* what was left of each radius, in steps: contexts of later ones */
    lathe_number_model models[LATHE_RADIUS_KINDS][LATHE_RADIUS_CLASSES], centres;
} lathe_radius_map;

/* Allocates the arrays and starts the models; slices, level_count, rays are set. Arena memory. LIMIT, MEMORY. */
lathe_status lathe__radius_map_start(lathe_radius_map *map, lathe_arena *arena);

/* Stride of a level's rays among those of the last. */
uint32_t lathe__radius_ray_stride(const lathe_radius_map *map, uint32_t level);

/* One walk over the numbers of a level serves encoding and decoding. `code` gets the number that `truth` asks for and returns the
 * one that counts. truth: the map to be coded (encoder), or NULL. FORMAT: a number out of range. */
typedef struct lathe_number_coder {
    int32_t (*code)(void *coder, lathe_number_model *model, int32_t number);
    void *coder;
    const lathe_radius_map *truth;
} lathe_number_coder;
lathe_status lathe__radius_walk(lathe_radius_map *map, uint32_t level, const lathe_number_coder *coder);

/* What a row's centre is predicted to be from two known ones; rows low < row < high. */
int32_t lathe__centre_between(int32_t low, int32_t at_low, int32_t high, int32_t at_high, int32_t row);

/* Where a ray of the last level ends, in lattice units. radius_mesh.c */
lathe_point lathe__radius_point(const lathe_radius_map *map, int32_t row, uint32_t ray);
/* The surface at a level: strips between the shown rows, ray by ray, and two fans. radius_mesh.c */
lathe_status lathe__radius_mesh(lathe_mesh *out, const lathe_radius_map *map, uint32_t level);

/* Grey values at a place of the mask's frame, in pixels and slices, linear between; 0 and more above iso is inside. */
typedef struct lathe_grey {
    double (*value)(void *context, double u, double v, int32_t w);
    void *context;
    double iso;
} lathe_grey;

/* radius_fit.c (encoder): the map of a mask whose every slice is one loop without holes; EMPTY if it is not such a mask.
 * grey: radii follow these values, or NULL: the mask's outline. turn: of the rays from slice to slice. */
lathe_status lathe__radius_fit(lathe_radius_map *truth, lathe_arena *arena, lathe_arena *scratch, const lathe_mask *mask, int fraction,
                               const lathe_grey *grey, uint32_t level_count, int32_t turn);
#endif
