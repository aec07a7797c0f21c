#include "occupancy_model.h"

static void encode(void *coder, uint32_t p1, int bit) { lathe__encode_bit(coder, p1, bit); }

lathe_status lathe__occupancy_encode(lathe_occupancy *state, lathe_range_encoder *e, const uint64_t *slice,
                                     const lathe_known *known) {
    lathe__occupancy_walk(state, &(lathe_bit_coder){.code = encode, .coder = e, .truth = slice}, NULL, known);
    return e->failed ? LATHE_ERR_MEMORY : LATHE_OK;
}
