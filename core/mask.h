/* The voxels of one structure as bits, in the permuted frame (u, v, w), cropped to the structure's box. */
#ifndef LATHE_MASK_H
#define LATHE_MASK_H
#include "lathe.h"

/* Pixel (u, v) of slice w is bit u & 63 of bits[(w * size[1] + v) * row_words + (u >> 6)].
 * size[0] and size[1] include a margin of one empty pixel on every side; slices have none: slice 0 and the last are not empty.
 * Bits at u >= size[0] are zero. */
typedef struct lathe_mask {
    int32_t size[3];
    int32_t origin[3];         /* permuted voxel index of pixel (0, 0) of slice 0; -1 is possible because of the margin */
    int32_t row_words;         /* 64-bit words in a row: (size[0] + 63) / 64 */
    uint64_t *bits;            /* owned */
} lathe_mask;

/* Allocates an empty (all zero) mask; size as above. MEMORY or LIMIT (more than LATHE_MAX_DIM + 2 along an axis). */
lathe_status lathe__mask_new(lathe_mask *mask, const int32_t size[3], const int32_t origin[3]);
void lathe__mask_free(lathe_mask *mask);
static inline uint64_t *lathe__mask_slice(const lathe_mask *mask, int32_t w) {
    return mask->bits + (size_t)w * (size_t)mask->size[1] * (size_t)mask->row_words;
}
static inline bool lathe__slice_pixel(const uint64_t *slice, int32_t row_words, int32_t u, int32_t v) {
    return slice[(size_t)v * (size_t)row_words + ((uint32_t)u >> 6)] >> (u & 63) & 1;
}
/* Word i of a row whose pixels are each where the one before it was. */
static inline uint64_t lathe__row_next(const uint64_t *row, size_t i, size_t words) {
    return row[i] >> 1 | (i + 1 < words ? row[i + 1] << 63 : 0);
}
static inline size_t lathe__mask_slice_words(const lathe_mask *mask) {
    return (size_t)mask->size[1] * (size_t)mask->row_words;
}

/* The permutation of an axis: frame[0], frame[1] in-plane, frame[2] = axis, cyclic so that handedness is kept
 * (x: y z x; y: z x y; z: x y z). */
void lathe__axis_frame(lathe_axis axis, int32_t frame[3]);

/* Lattice coordinates of a mask's frame (pixel centre (u,v) of slice w at LATHE_LATTICE_ONE * (u, v, w)) -> world mm. */
lathe_transform lathe__mask_transform(const lathe_mask *mask, lathe_axis axis, const double affine[3][4]);

/* ---- region.c: structures of a volume ---- */
/* value >= iso. EMPTY if no voxel; the mask is cropped to its box. */
lathe_status lathe__region_threshold(lathe_mask *out, const lathe_volume *volume, lathe_axis axis, double iso, lathe_error *err);
/* value == label. EMPTY if none. */
lathe_status lathe__region_label(lathe_mask *out, const lathe_volume *volume, lathe_axis axis, int64_t label, lathe_error *err);

typedef struct lathe_label_box { int64_t label; int64_t voxels; int32_t low[3], high[3]; } lathe_label_box; /* inclusive, file axes */
/* All labels except 0, ascending, with their boxes, in one pass; *out is malloc'ed, owned by the caller.
 * UNSUPPORTED if the volume is not integer; LIMIT beyond 65535 labels; EMPTY if there is none. */
lathe_status lathe__region_labels(lathe_label_box **out, size_t *count, const lathe_volume *volume, lathe_error *err);
/* As lathe__region_label, but inside a known box (fast: an atlas visits each label once). */
lathe_status lathe__region_label_box(lathe_mask *out, const lathe_volume *volume, lathe_axis axis, const lathe_label_box *box,
                                     lathe_error *err);
/* The axis with the fewest slices across the structure's box in mm is not always best: auto takes the axis of the largest
 * spacing, and of equal spacings z. */
lathe_axis lathe__axis_auto(const lathe_volume *volume);

/* ---- components.c: what lies where, by 6-connectivity (background: 26) ---- */
typedef struct lathe_component { int32_t first_slice, last_slice; int64_t voxels; uint32_t found; } lathe_component;
/* The 6-connected components, in order of their first pixel (w, v, u); *out is malloc'ed. */
lathe_status lathe__mask_components(lathe_component **out, size_t *count, const lathe_mask *mask);

/* Asked for runs of pixels first .. last of row v; a component is found by what it says of any of its runs, bit by bit. It is not
 * asked again where all bits are found. */
typedef struct lathe_probe {
    uint32_t (*look)(const void *context, int32_t first, int32_t last, int32_t v, int32_t w);
    const void *context;
    uint32_t all;
} lathe_probe;
lathe_status lathe__find_components(lathe_component **out, size_t *count, const lathe_mask *mask, const lathe_probe *probe);

typedef struct lathe_topology {
    int64_t components;        /* 6-connected components of the region */
    int64_t cavities;          /* 26-connected components of the background that are enclosed */
    int64_t euler;             /* of the region as a cubical complex: voxels - faces + squares - cubes by 6-connectivity */
} lathe_topology;
/* Computed from the voxels alone, sharing no code with the surface. For a surface of this region that is right:
 * its components = components + cavities, its Euler characteristic = 2 * euler.
 * shown: NULL for all slices; else only slices w with shown[w] count, and neighbours are consecutive shown slices. */
lathe_status lathe__mask_topology(lathe_topology *out, const lathe_mask *mask, const bool *shown);
#endif
