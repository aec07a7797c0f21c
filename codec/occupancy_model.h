/* The context model that the occupancy encoder and decoder share. Integers only: every platform computes the same bits. */
#ifndef LATHE_OCCUPANCY_MODEL_H
#define LATHE_OCCUPANCY_MODEL_H
#include "occupancy.h"

/* One walk over the pixels serves encoding and decoding. `code` gets the probability of a 1 and the bit that `truth` asks for,
 * and returns the bit that counts: the same one (encoder) or the decoded one (decoder, whose truth is NULL). */
typedef struct lathe_bit_coder {
    int (*code)(void *coder, uint32_t p1, int bit);
    void *coder;
    const uint64_t *truth;
} lathe_bit_coder;

/* out: receives the slice, margins empty; NULL when encoding. */
void lathe__occupancy_walk(lathe_occupancy *state, const lathe_bit_coder *coder, uint64_t *out, const lathe_known *known);
#endif
