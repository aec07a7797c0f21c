/* The radius map: a tube of star-shaped loops, one in each of its slices, as an image r(slice, ray). Refined dyadically in slices and
 * in rays: a new radius is predicted from known ones on both sides, what is left is quantised and coded. So that every sample stays
 * within half a step of the truth plus a dead zone, prediction sees what the decoder has (closed loop). Shared by both directions;
 * integers only. radius_tubes.h makes structures of them. */
#ifndef LATHE_RADIUS_MAP_H
#define LATHE_RADIUS_MAP_H
#include "base_shape.h"

enum {
    LATHE_RADIUS_ONE = 64,     /* radius units in a voxel */
    LATHE_RADIUS_LEAST = 16,   /* no radius is smaller: neighbouring crossings stay apart */
    LATHE_RADIUS_MAX_RAYS = 1024, LATHE_RADIUS_CLASSES = 9, LATHE_RADIUS_KINDS = 3,
    LATHE_APEX_ONE = 8,
    LATHE_RADIUS_MOST_AHEAD = 12
};

/* A small decoder only reads. */
#ifdef LATHE_SMALL
enum { LATHE_RADII_ENCODE = 0 };
#else
enum { LATHE_RADII_ENCODE = 1 };
#endif

typedef struct lathe_radius_models {
    lathe_number_model radius[LATHE_RADIUS_KINDS][LATHE_RADIUS_CLASSES], centres, starts;
} lathe_radius_models;

typedef struct lathe_radius_map {
    int32_t slices;            /* rows */
    uint32_t level_count;      /* of the walk, one pass each; those of the structure only if the map is a simple one */
    uint32_t rays;             /* of the last level: a power of two, 8 to LATHE_RADIUS_MAX_RAYS */
    int32_t step;              /* of the last level, radius units */
    uint32_t fall;             /* eighths of it that each level below has */
    uint32_t fine_from;        /* from this level on, steps fall towards lower ones from another one: */
    int32_t fine_step;         /* 0: there is no such level */
    bool tube;                 /* not a simple map: */
    uint32_t ahead;            /* rays are as dense as they would be so many levels later */
    const bool *early;         /* of each row: level early_with codes it already, if the next one would as a new row; NULL: none */
    uint32_t early_with;
    int32_t start[3];          /* what the first centre and the first radius are predicted to be */
    int32_t turn;              /* of a slice's rays against those of the slice below, 1/65536 of a full turn, counter-clockwise */
    int32_t apex[2];           /* how far the caps rise below the first and above the last slice, 1/8 of a slice: 1 to 7 */
    int32_t farthest;          /* largest radius allowed */
    int32_t (*centre)[2];      /* of a row, half pixels */
    int32_t *radius;           /* rays of each row, radius units */
    uint8_t *left;             /* how much was left of each radius, in steps: contexts of later ones; NULL: radii pass no coder */
    const bool *wanted;        /* with left NULL: which rows are predicted, and those that they need; NULL: all */
    lathe_radius_models *models;
} lathe_radius_map;

/* Allocates the arrays, and the models if there are none; slices, level_count, rays are set. Arena memory. LIMIT, MEMORY. */
lathe_status lathe__radius_map_start(lathe_radius_map *map, lathe_arena *arena);

/* Stride of a level's rays among those of the last. */
uint32_t lathe__radius_ray_stride(const lathe_radius_map *map, uint32_t level);

/* One walk over the numbers of a level serves encoding and decoding. `code` gets the number that `truth` asks for and returns the
 * one that counts; NULL: `coder` is a lathe_range_decoder, and numbers are read from there; if that is NULL, too, all are 0. truth:
 * the map to be coded (encoder), or NULL. FORMAT: a number out of range. */
typedef int32_t lathe_number_code(void *coder, lathe_number_model *model, int32_t number);
typedef struct lathe_number_coder {
    lathe_number_code *code;
    void *coder;
    const lathe_radius_map *truth;
} lathe_number_coder;
int32_t lathe__code_number(const lathe_number_coder *coder, lathe_number_model *model, int32_t number);
lathe_status lathe__radius_walk(lathe_radius_map *map, uint32_t level, const lathe_number_coder *coder);

/* What a row's centre is predicted to be from two known ones; rows low < row < high. */
int32_t lathe__centre_between(int32_t low, int32_t at_low, int32_t high, int32_t at_high, int32_t row);

/* radius_mesh.c: where a ray of the last level ends, in lattice units; with a centre and a radius of its own. */
lathe_point lathe__radius_place(const lathe_radius_map *map, const int32_t centre[2], int32_t row, uint32_t ray, int32_t radius);
lathe_point lathe__radius_point(const lathe_radius_map *map, int32_t row, uint32_t ray);
/* The surface at a level: strips between the shown rows, ray by ray, and two fans. radius_mesh.c */
lathe_status lathe__radius_mesh(lathe_mesh *out, const lathe_radius_map *map, uint32_t level);

/* Grey values at a place of the mask's frame, in pixels and slices, linear between; 0 and more above iso is inside. */
typedef struct lathe_grey {
    double (*value)(void *context, double u, double v, int32_t w);
    void *context;
    double iso;
} lathe_grey;

/* radius_fit.c (encoder): one row of a tube: its loop, counter-clockwise. */
typedef struct lathe_row_loop { const lathe_point *points; uint32_t count; } lathe_row_loop;
/* The map of the loops of all rows. slices, level_count, turn and farthest are set; rays are chosen. Arena memory.
 * *back: how much of the loops turns back as seen from their centres, as a share of their area: 0 if all are stars. */
lathe_status lathe__radius_fit(lathe_radius_map *map, lathe_arena *arena, lathe_arena *scratch, const lathe_row_loop *loops, double *back);
/* The radii again, in an array of their own, with rays that turn. */
lathe_status lathe__radius_turn(lathe_radius_map *map, lathe_arena *arena, const lathe_row_loop *loops, int32_t turn);
/* Moves radii and caps to where grey values near by cross iso; row 0 is slice `first`. hole: inside is where they are below iso. */
lathe_status lathe__radius_follow(lathe_radius_map *map, lathe_arena *arena, int32_t first, bool hole, const lathe_grey *grey);
#endif
