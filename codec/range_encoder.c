#include "range_coder.h"
#include <stdlib.h>

enum { TOP_BITS = 24, MAX_OVERRUN = 8, LOOK_AHEAD = 4 };

void lathe__encoder_start(lathe_range_encoder *e) { *e = (lathe_range_encoder){.range = UINT32_MAX}; }

static bool grow(lathe_range_encoder *e) {
    size_t capacity = e->capacity ? e->capacity * 2 : 256;
    uint8_t *bytes = capacity > e->capacity ? realloc(e->bytes, capacity) : NULL;
    if (!bytes) return false;
    e->bytes = bytes;
    e->capacity = capacity;
    return true;
}

static void put(lathe_range_encoder *e, uint8_t byte) {
    if (e->failed) return;
    if (e->size == e->capacity && !grow(e)) e->failed = true;
    else e->bytes[e->size++] = byte;
}

/* Moves the top byte of low out. Bytes that a carry can still change are held: `cache`, then 0xFF `pending - 1` times.
 * Nothing is held at first, since low stays below one: no carry ever leaves the first byte. */
static void shift_low(lathe_range_encoder *e) {
    uint8_t carry = (uint8_t)(e->low >> 32);
    if (carry || e->low < 0xFF000000u || !e->pending) {   /* a first byte of 0xFF is held as the cache itself */
        if (e->pending) put(e, (uint8_t)(e->cache + carry));
        for (; e->pending > 1; e->pending--) put(e, (uint8_t)(0xFF + carry));
        e->pending = 0;
        e->cache = (uint8_t)(e->low >> 24);
    }
    e->pending++;
    e->low = (e->low & 0xFFFFFF) << 8;
}

void lathe__encode_bit(lathe_range_encoder *e, uint32_t p1, int bit) {
    uint32_t bound = (uint32_t)((uint64_t)e->range * p1 >> 16);
    if (bit) {
        e->range = bound;
    } else {
        e->low += bound;
        e->range -= bound;
    }
    for (; e->range < 1u << TOP_BITS; e->range <<= 8) shift_low(e);
}

void lathe__encoder_finish(lathe_range_encoder *e) {
    /* The number of the final interval with the most zero bits at its end. */
    uint64_t last = e->low + e->range - 1, value = 0;
    for (int bits = 32; bits >= 0; bits--) {
        uint64_t mask = ((uint64_t)1 << bits) - 1;
        value = (e->low + mask) & ~mask;
        if (value <= last) break;
    }
    e->low = value;
    size_t shifted = e->size + (size_t)e->pending;
    for (int i = 0; i < LOOK_AHEAD + 1; i++) shift_low(e);
    /* The decoder reads shifted + LOOK_AHEAD bytes; its count of missing ones must not look like damage. */
    size_t fewest = shifted > MAX_OVERRUN - LOOK_AHEAD ? shifted - (MAX_OVERRUN - LOOK_AHEAD) : 0;
    while (e->size > fewest && !e->bytes[e->size - 1]) e->size--;
}

void lathe__encoder_free(lathe_range_encoder *e) {
    free(e->bytes);
    *e = (lathe_range_encoder){0};
}
