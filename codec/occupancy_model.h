/* The context model that the occupancy encoder and decoder share. Integers only: every platform computes the same bits. */
#ifndef LATHE_OCCUPANCY_MODEL_H
#define LATHE_OCCUPANCY_MODEL_H
#include "occupancy.h"

/* The rows around a pixel that contexts read: of this slice the current one and 1 to 3 before it, of the slices below and above
 * -1 to 1. The slices beyond those were tried: they did not help. */
enum {
    CUR3, CUR2, CUR1, CUR0,
    BELOW0, BELOW1, BELOW2, ABOVE0, ABOVE1, ABOVE2,
    LINES
};
enum {
    INPUTS = 6, INPUTS_SURE = 5,
    SLOT_BITS_TRAINED = 17, SLOT_BITS_SURE = 18, SLOT_BITS_MAX = 20,   /* hashed contexts share one table: 512 KB, 1 MB or 4 MB */
    MODES = 8,                 /* 0: no slice known, 1: one side, 2..5: both, gap 1, 2, 4, 8 and more; 6, 7: an estimate above */
    KEY_BITS = 13, SURE_MODES = 4, SURE_SLOTS = SURE_MODES << KEY_BITS,   /* 128 KB; modes 3 and more are one */
    SURE = 4096,               /* a sure pixel's probability is below this, or 65536 minus this and more, */
    SURE_COUNT = 30,           /* and its context has been seen so often */
    BY_SEEN = 0, BY_NEAR = 8, BY_SIDE = 16,   /* which weights: 8 classes, 8 neighbourhoods, then mode and pixels beside */
    CENTRE = 4,                /* bit of the pixel itself in a window */
    LOGIT_ONE = 256, LOGIT_MAX = 12 * LOGIT_ONE - 1,
    WEIGHT_ONE = 65536,
    LEARN_FAST = 10, LEARN_SLOW = 4, FAST_PIXELS = 1 << 15,   /* sixteenths; the first pixels learn faster */
    LEARN_SURE = 20,
    COUNT_MASK = 1023, COUNT_MAX = 254, COUNT_MAX_SURE = 192, COUNT_TRAINING = 4,
    LENGTH_CLASSES = 16
};

/* A probability that learns: of 1 in the upper 22 bits, how often it was seen in the lower 10. */
typedef uint32_t slot;

struct lathe_occupancy {
    int32_t width, height, row_words;
    uint32_t count_max, pixels;
    int32_t slot_bits;
    bool sure;
    /* The rows that contexts read, and which of their pixels have a neighbourhood of all 0, of all 1. Each has row_words words and
     * one of padding on either side. */
    uint64_t *memory, *line[LINES], *calm[2];
    struct learned {
        /* An input's weight is a sum: by how often its slot was seen, by the causal neighbours, by mode and the pixels below
         * and above. */
        int32_t weight[BY_SIDE + MODES * 4][INPUTS];
        slot run[MODES + 4][8][LENGTH_CLASSES];   /* of calm runs: is there a surprise; the last four: where */
        int16_t logit[4096];       /* of a 12-bit probability */
        uint16_t chance[2 * LOGIT_MAX + 1];   /* 16-bit probability of a logit */
        uint32_t rate[COUNT_MAX + 1];
        uint8_t seen_class[COUNT_MAX + 1];
        uint64_t threes[1024];     /* bits k to k + 2 of the index in byte k */
    } m;
    slot slots[];              /* SURE_SLOTS if the state is sure, then 1 << slot_bits */
};

/* How many slots come before the hashed ones. */
static inline bool lathe__is_sure(const lathe_occupancy *s) { return LATHE_RASTERS_ONLY || s->sure; }
static inline size_t lathe__small_slots(bool sure) { return LATHE_RASTERS_ONLY || sure ? SURE_SLOTS : 0; }
static inline uint32_t lathe__floor_log2(uint32_t x) { return 31 - (uint32_t)__builtin_clz(x | 1); }

/* One walk over the pixels serves decoding, encoding and training. */
typedef struct lathe_bit_coder {
    lathe_range_decoder *decoder;   /* says what the bits are; NULL: truth does */
    void (*code)(void *coder, uint32_t p1, int bit);   /* is told each bit of truth and its probability of being 1, or NULL */
    void *coder;
    const uint64_t *truth;
} lathe_bit_coder;

/* out: receives the slice, margins empty; NULL when encoding. */
void lathe__occupancy_walk(lathe_occupancy *state, const lathe_bit_coder *coder, uint64_t *out, const lathe_known *known);
#endif
