/* Bit masks: memory, the axis permutation and the way back to world coordinates. */
#include "mask.h"
#include <stdlib.h>

lathe_status lathe__mask_new(lathe_mask *mask, const int32_t size[3], const int32_t origin[3]) {
    for (int k = 0; k < 3; k++) {
        if (size[k] < 1) return LATHE_ERR_RANGE;
        if (size[k] > LATHE_MAX_DIM + 2) return LATHE_ERR_LIMIT;
    }
    int32_t row_words = (size[0] + 63) / 64;
    /* At most 65 * 4098 * 4098 words: no overflow in 64 bits. */
    uint64_t words = (uint64_t)row_words * (uint64_t)size[1] * (uint64_t)size[2];
    if (words > SIZE_MAX / sizeof(uint64_t)) return LATHE_ERR_LIMIT;
    uint64_t *bits = calloc((size_t)words, sizeof *bits);
    if (!bits) return LATHE_ERR_MEMORY;
    *mask = (lathe_mask){
        .size = {size[0], size[1], size[2]},
        .origin = {origin[0], origin[1], origin[2]},
        .row_words = row_words,
        .bits = bits,
    };
    return LATHE_OK;
}

void lathe__mask_free(lathe_mask *mask) {
    free(mask->bits);
    *mask = (lathe_mask){0};
}

void lathe__axis_frame(lathe_axis axis, int32_t frame[3]) {
    frame[0] = ((int32_t)axis + 1) % 3;
    frame[1] = ((int32_t)axis + 2) % 3;
    frame[2] = (int32_t)axis;
}

lathe_transform lathe__mask_transform(const lathe_mask *mask, lathe_axis axis, const double affine[3][4]) {
    int32_t frame[3];
    lathe__axis_frame(axis, frame);
    lathe_transform t;
    for (int i = 0; i < 3; i++) {
        t.m[i][3] = affine[i][3];
        for (int k = 0; k < 3; k++) {
            t.m[i][k] = affine[i][frame[k]] / LATHE_LATTICE_ONE; /* exact: a power of two */
            t.m[i][3] += affine[i][frame[k]] * mask->origin[k];
        }
    }
    return t;
}
