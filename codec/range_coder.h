/* Adaptive binary range coder: 32-bit low/range as in LZMA (the encoder propagates carries), 16-bit probabilities. Encoder and
 * decoder share only this header.
 *
 * A bit with P(1) = p1 / 65536 splits the range at bound = range * p1 / 65536 (64-bit product, rounded down); 1 takes the part
 * below. Both sides renormalise to range >= 2^24, so that bound is at least 256 and less than range for every legal p1. */
#ifndef LATHE_RANGE_CODER_H
#define LATHE_RANGE_CODER_H
#include "lathe.h"

/* ---- encoder ---- */
typedef struct lathe_range_encoder {
    uint8_t *bytes; size_t size, capacity;    /* owned */
    uint64_t low; uint32_t range; uint8_t cache; uint64_t pending;
    bool failed;                               /* an allocation failed: what was written is useless */
} lathe_range_encoder;
void lathe__encoder_start(lathe_range_encoder *e);
/* Codes bit with P(bit = 1) = p1 / 65536, 1 <= p1 <= 65535. */
void lathe__encode_bit(lathe_range_encoder *e, uint32_t p1, int bit);
/* Ends the stream with the fewest bytes; the decoder reads zeros beyond the end. */
void lathe__encoder_finish(lathe_range_encoder *e);
void lathe__encoder_free(lathe_range_encoder *e);

/* ---- decoder ---- */
typedef struct lathe_range_decoder { const uint8_t *at, *end; uint32_t code, range; uint32_t overrun; } lathe_range_decoder;
/* Reads zeros beyond the end; overrun counts them: more than 8 means that the packet was truncated or damaged. */
void lathe__decoder_start(lathe_range_decoder *d, const uint8_t *bytes, size_t size);
void lathe__decoder_refill(lathe_range_decoder *d);   /* makes range >= 2^24 */
/* The bit, and the part of the range that it stands for; a refill must follow. */
static inline int lathe__decoder_split(lathe_range_decoder *d, uint32_t p1) {
    uint32_t bound = (uint32_t)((uint64_t)d->range * p1 >> 16);
    int bit = d->code < bound;
    if (bit) {
        d->range = bound;
    } else {
        d->code -= bound;
        d->range -= bound;
    }
    return bit;
}
int lathe__decode_bit(lathe_range_decoder *d, uint32_t p1);
/* The same where bits come by the million; a small decoder has it once. */
static inline int lathe__decode_bit_inline(lathe_range_decoder *d, uint32_t p1) {
#ifdef LATHE_SMALL
    return lathe__decode_bit(d, p1);
#else
    int bit = lathe__decoder_split(d, p1);
    if (d->range < 1u << 24) lathe__decoder_refill(d);
    return bit;
#endif
}
#endif
