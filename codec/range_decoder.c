#include "range_coder.h"

static uint32_t next_byte(lathe_range_decoder *d) {
    if (d->at != d->end) return *d->at++;
    if (d->overrun != UINT32_MAX) d->overrun++;
    return 0;
}

void lathe__decoder_start(lathe_range_decoder *d, const uint8_t *bytes, size_t size) {
    *d = (lathe_range_decoder){.at = bytes, .end = size ? bytes + size : bytes, .range = UINT32_MAX};
    for (int i = 0; i < 4; i++) d->code = d->code << 8 | next_byte(d);
}

void lathe__decoder_refill(lathe_range_decoder *d) {
    for (; d->range < 1u << 24; d->range <<= 8) d->code = d->code << 8 | next_byte(d);
}

int lathe__decode_bit(lathe_range_decoder *d, uint32_t p1) {
    int bit = lathe__decoder_split(d, p1);
    lathe__decoder_refill(d);
    return bit;
}
