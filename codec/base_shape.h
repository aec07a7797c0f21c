/* The base shape, level 0: a few slices, each with a few star-shaped loops: a centre and one radius for each ray. */
#ifndef LATHE_BASE_SHAPE_H
#define LATHE_BASE_SHAPE_H
#include "level.h"
#include "range_coder.h"

enum { LATHE_BASE_MAX_LOOPS = 64, LATHE_BASE_MIN_RAYS = 8, LATHE_BASE_MAX_RAYS = 128 };

typedef struct lathe_star {
    int32_t centre[2];         /* in pixels of the mask's frame */
    uint16_t rays;             /* a power of two */
    bool hole;
    uint8_t parent;            /* loop of the slice before that it continues, plus 1; 0: none */
    uint16_t *radius;          /* rays values, in radius steps, at least 1 */
} lathe_star;
typedef struct lathe_star_slice { uint32_t count; lathe_star *stars; } lathe_star_slice;

/* A radius step in lattice units: three eighths of the slice distance, at least one voxel. */
static inline int32_t lathe__radius_step(int32_t stride) {
    return stride < 4 ? LATHE_LATTICE_ONE : stride * (LATHE_LATTICE_ONE / 8 * 3);
}
/* The polygons of a slice's stars, as encoder and decoder both see them. Points get arena memory. */
lathe_status lathe__star_outline(lathe_outline *out, lathe_arena *arena, const lathe_star_slice *slice, int32_t step, uint32_t seed);

/* ---- adaptive numbers, shared by both directions ---- */
typedef struct lathe_bit_model { uint16_t p1; uint8_t count; } lathe_bit_model;
enum { LATHE_NUMBER_MODELS = 48 };
typedef struct lathe_number_model { lathe_bit_model bit[LATHE_NUMBER_MODELS]; } lathe_number_model;
static inline void lathe__bit_learn(lathe_bit_model *m, int bit) {
    /* Fast at first, then 1/32: small structures have few symbols. */
    int32_t p = m->p1, away = bit ? 65535 - p : p, move = away >> 5;
    if (m->count < 30) move = away / (m->count++ + 2);
    p = bit ? p + move : p - move;
    m->p1 = (uint16_t)(p < 512 ? 512 : p > 65023 ? 65023 : p);
}
/* A number of under 2^20 in magnitude: is it 0; its sign; the length of its magnitude in unary; its lower bits. */
void lathe__put_number(lathe_range_encoder *e, lathe_number_model *m, int32_t v);
int lathe__get_bit(lathe_range_decoder *d, lathe_bit_model *m);
int32_t lathe__get_number(lathe_range_decoder *d, lathe_number_model *m);
void lathe__put_bit(lathe_range_encoder *e, lathe_bit_model *m, int bit);
/* Contexts of a base shape's numbers. */
enum {
    LATHE_BASE_LOOPS, LATHE_BASE_PARENT, LATHE_BASE_HOLE, LATHE_BASE_RAYS, LATHE_BASE_CENTRE_NEW, LATHE_BASE_CENTRE,
    LATHE_BASE_RADIUS_FIRST, LATHE_BASE_RADIUS_ALONE, LATHE_BASE_RADIUS_PARENT, LATHE_BASE_MODELS
};
/* What is usual before anything is known: most stars go on from slice to slice, with radii and centres that differ little. */
void lathe__base_models(lathe_number_model models[LATHE_BASE_MODELS]);
/* What a radius is predicted to be: the star it continues tells, or the ray before. */
int32_t lathe__predict_radius(const lathe_star *star, const lathe_star *parent, uint32_t ray, int32_t start);

lathe_status lathe__base_encode(lathe_range_encoder *e, const lathe_star_slice *slices, uint32_t count, const lathe_mask *frame,
                                lathe_number_model models[LATHE_BASE_MODELS]);
/* Arena memory. FORMAT if the bytes end long before the stars do. frame: only its size is used. */
lathe_status lathe__base_decode(lathe_star_slice *slices, uint32_t count, lathe_arena *arena, lathe_range_decoder *d,
                                const lathe_mask *frame, lathe_number_model models[LATHE_BASE_MODELS]);

/* base_fit.c (encoder): the stars of a slice's loops: the large ones, pruned until they are disjoint. Arena memory. */
lathe_status lathe__base_fit(lathe_star_slice *out, lathe_arena *arena, const lathe_outline *loops, const lathe_star_slice *before,
                             int32_t stride, uint32_t seed);
#endif
