/* The slices of a model: the voxels of its structures, decoded once, and what is drawn from one slice of them. */
#ifndef LATHE_MODEL_SLICE_H
#define LATHE_MODEL_SLICE_H
#include "arena.h"
#include "lathe_codec.h"
#include "sections.h"

/* The voxels of several structures in one block of memory, so that a cache can hold them: a count, then the
 * structures, then their words. Only this program reads it. */
typedef struct lathe_slice_structure {
    uint32_t structure;        /* of the model */
    int32_t size[3], origin[3], row_words;
    int fraction;
    lathe_transform transform; /* of its lattice */
    size_t words;              /* where its words begin, counted from the block's first */
} lathe_slice_structure;
typedef struct lathe_slices {
    size_t count;
    const lathe_slice_structure *structures;
    const uint64_t *words;
} lathe_slices;
/* Decodes one structure, or all (-1). *bytes is malloc'ed, the caller's. Errors of the decoder, MEMORY. */
lathe_status lathe__slices_decode(uint8_t **bytes, size_t *size, const lathe_model *model, int64_t structure,
                                  lathe_error *err);
lathe_slices lathe__slices_view(const uint8_t *bytes);

/* What the structures cover, and how it is drawn: pixels are square in mm, u to the right, v up. */
typedef struct lathe_slice_frame {
    int32_t low[3], high[3];   /* permuted voxel indices, inclusive */
    double spacing[2];         /* mm, along u and v */
    double stretch;            /* mm: how much longer a vector can get from the lattice to the world, at most, for
                                * each lattice unit */
    double pixel_mm;
    uint32_t width, height;
    double matrix[3][4];       /* permuted voxel index -> world mm */
} lathe_slice_frame;
/* The same from the header alone, which is fast. Errors of the decoder, MEMORY. */
lathe_status lathe__slice_frame(lathe_slice_frame *out, const lathe_model *model, int64_t structure, lathe_error *err);
/* World mm of a place in the picture, (0, 0) being its left upper corner and (1, 1) the opposite corner of that
 * pixel. */
void lathe__slice_place(double world[3], const lathe_slice_frame *frame, int32_t slice, double x, double y);

/* width * height pixels of 4 bytes (red, green, blue, opacity), zeroed by the caller, from the top. */
void lathe__slice_draw(uint8_t *rgba, const lathe_slice_frame *frame, const lathe_slices *slices,
                       const lathe_model_info *info, int32_t slice);
/* The whole outline of a structure in a slice as the last level has it, lattice units of the structure; empty if it
 * is not there. Arena memory. LIMIT, MEMORY. */
lathe_status lathe__slice_outline(lathe_outline *out, lathe_arena *arena, const lathe_slices *slices, size_t index,
                                  int32_t slice);
/* World mm of a point of such an outline. */
void lathe__slice_point(double world[3], const lathe_slice_structure *structure, int32_t slice, lathe_point point);
#endif
