#include "occupancy_model.h"

static int decode(void *coder, uint32_t p1, int bit) {
    (void)bit;
    return lathe__decode_bit(coder, p1);
}

lathe_status lathe__occupancy_decode(lathe_occupancy *state, lathe_range_decoder *d, uint64_t *slice,
                                     const lathe_known *known) {
    lathe__occupancy_walk(state, &(lathe_bit_coder){decode, d, NULL}, slice, known);
    return LATHE_OK;
}
