#include "structure_state.h"

static lathe_status decode_planes(lathe_structure_state *state, lathe_range_decoder *d, const lathe_mask *planes, int axis) {
    lathe_plane_range range = lathe__pyramid_planes(planes, axis);
    lathe_status status = lathe__occupancy_frame(state->occupancy, planes->size[0], planes->size[1]);
    for (int32_t c = range.first; !status && c < range.end; c += range.step) {
        lathe_known known = lathe__pyramid_known(planes, c, axis);
        status = lathe__occupancy_decode(state->occupancy, d, lathe__mask_slice(planes, c), &known);
        if (d->overrun > 8) status = LATHE_ERR_FORMAT;
    }
    return status;
}

/* Halves the stride of an axis: `fine` becomes the state's raster, also on failure. */
static lathe_status decode_axis(lathe_structure_state *state, lathe_range_decoder *d, int axis) {
    int32_t size[3];
    lathe_mask fine, planes;
    state->stride[axis] /= 2;
    lathe__pyramid_size(size, state->mask.size, state->stride);
    lathe_status status = lathe__pyramid_spread(&fine, &state->raster, size, axis);
    if (status) return status;
    lathe__mask_free(&state->raster);
    state->raster = fine;
    if (axis == 2) return decode_planes(state, d, &fine, axis);
    status = lathe__pyramid_turn(&planes, &fine, axis);
    if (status) return status;
    status = decode_planes(state, d, &planes, axis);
    lathe__pyramid_turn_back(&fine, &planes, axis);
    lathe__mask_free(&planes);
    return status;
}

static lathe_status decode_first(lathe_structure_state *state, lathe_range_decoder *d, lathe_models *models) {
    int32_t size[3];
    lathe__pyramid_strides(state->stride, state->pyramid, 0, 0);
    lathe__pyramid_size(size, state->mask.size, state->stride);
    lathe_status status = lathe__mask_new(&state->raster, size, state->mask.origin);
    if (!status) status = lathe__state_start_occupancy(state, models);
    return status ? status : decode_planes(state, d, &state->raster, -1);
}

lathe_status lathe__pass_decode(lathe_structure_state *state, lathe_range_decoder *d, lathe_models *models, uint32_t level,
                                const char **fault) {
    const lathe_pyramid *pyramid = state->pyramid;
    *fault = LATHE_FAULT("levels out of order");
    if (state->level + 1 != (int32_t)level || level >= pyramid->level_count) return LATHE_ERR_FORMAT;
    *fault = LATHE_FAULT("voxels: the packet is damaged or ends before them");
    lathe_status status = level ? decode_axis(state, d, lathe__pyramid_axis(pyramid, level, state->pass)) : decode_first(state, d, models);
    if (status || ++state->pass < lathe__pyramid_passes(pyramid, level)) return status;
    state->pass = 0;
    state->level = (int32_t)level;
    if (level + 1 < pyramid->level_count) return LATHE_OK;
    lathe__state_drop_occupancy(state);
    state->mask.bits = state->raster.bits;   /* of one size: the last strides are 1 */
    state->raster.bits = NULL;
    return !LATHE_RASTERS_ONLY && state->flags & LATHE_FLAG_CAPS && !(state->flags & LATHE_FLAG_SHARED) ? lathe__keep_caps(state, d) : LATHE_OK;
}
