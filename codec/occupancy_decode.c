#include "occupancy_model.h"

lathe_status lathe__occupancy_decode(lathe_occupancy *state, lathe_range_decoder *d, uint64_t *slice,
                                     const lathe_known *known) {
    lathe__occupancy_walk(state, &(lathe_bit_coder){.decoder = d}, slice, known);
    return LATHE_OK;
}
