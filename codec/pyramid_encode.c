/* Passes of a pyramid from the whole mask, and the schedule of a model. */
#include <string.h>
#include "structure_encode.h"

/* The even bits, together in the lower half. */
static uint64_t squeeze_bits(uint64_t x) {
    x &= UINT64_C(0x5555555555555555);
    x = (x | x >> 1) & UINT64_C(0x3333333333333333);
    x = (x | x >> 2) & UINT64_C(0x0f0f0f0f0f0f0f0f);
    x = (x | x >> 4) & UINT64_C(0x00ff00ff00ff00ff);
    x = (x | x >> 8) & UINT64_C(0x0000ffff0000ffff);
    return (x | x >> 16) & UINT64_C(0xffffffff);
}

/* Every stride-th pixel of a row; row has room for the whole one. */
static void sample_row(uint64_t *row, const uint64_t *from, int32_t words, int32_t stride) {
    int32_t all = words;
    memcpy(row, from, (size_t)words * sizeof *row);
    for (; stride > 1; stride /= 2) {
        for (int32_t i = 0; i < words; i += 2)
            row[i / 2] = squeeze_bits(row[i]) | (i + 1 < words ? squeeze_bits(row[i + 1]) << 32 : 0);
        words = (words + 1) / 2;
    }
    memset(row + words, 0, (size_t)(all - words) * sizeof *row);
}

lathe_status lathe__pyramid_sample(lathe_mask *out, const lathe_mask *whole, const int32_t stride[3]) {
    int32_t size[3];
    uint64_t row[(LATHE_MAX_DIM + 2 + 63) / 64];
    lathe__pyramid_size(size, whole->size, stride);
    lathe_status status = lathe__mask_new(out, size, whole->origin);
    if (status) return status;
    size_t bytes = (size_t)(out->row_words < whole->row_words ? out->row_words : whole->row_words) * sizeof *row;
    for (int32_t w = 0; w < size[2]; w++)
        for (int32_t v = 0; v < size[1] && v * stride[1] < whole->size[1]; v++) {
            const uint64_t *from = lathe__mask_slice(whole, w * stride[2]) + (size_t)(v * stride[1]) * (size_t)whole->row_words;
            sample_row(row, from, whole->row_words, stride[0]);
            memcpy(lathe__mask_slice(out, w) + (size_t)v * (size_t)out->row_words, row, bytes);
        }
    return LATHE_OK;
}

static lathe_status encode_planes(lathe_structure_state *state, lathe_range_encoder *e, const lathe_mask *planes, int axis) {
    lathe_plane_range range = lathe__pyramid_planes(planes, axis);
    lathe_status status = lathe__occupancy_frame(state->occupancy, planes->size[0], planes->size[1]);
    for (int32_t c = range.first; !status && c < range.end; c += range.step) {
        lathe_known known = lathe__pyramid_known(planes, c, axis);
        status = lathe__occupancy_encode(state->occupancy, e, lathe__mask_slice(planes, c), &known);
    }
    return status;
}

lathe_status lathe__pass_encode(lathe_range_encoder *e, lathe_structure_state *state, lathe_models *models, uint32_t level, uint32_t pass) {
    int32_t stride[3];
    lathe_mask raster, planes;
    int axis = level ? lathe__pyramid_axis(state->pyramid, level, pass) : -1;
    lathe__pyramid_strides(stride, state->pyramid, level, pass + 1);
    lathe_status status = level ? LATHE_OK : lathe__state_start_occupancy(state, models);
    if (!status) status = lathe__pyramid_sample(&raster, &state->mask, stride);
    if (status) return status;
    if (axis == 0 || axis == 1) {
        status = lathe__pyramid_turn(&planes, &raster, axis);
        lathe__mask_free(&raster);
        if (status) return status;
        raster = planes;
    }
    status = encode_planes(state, e, &raster, axis);
    lathe__mask_free(&raster);
    return status;
}

/* ---- schedule ---- */

/* Octaves: so many that the first raster has about as many samples along an axis as there are voxels between two of them. */
static uint32_t octaves(const double voxels[3]) {
    double product = voxels[0] * voxels[1] * voxels[2];
    uint32_t n = 1;
    while (n < 10 && product > (double)((uint64_t)1 << 6 * (n + 1))) n++;
    return n;
}

void lathe__pyramid_plan(lathe_header *header, const double spacing[3], const int32_t most[3], uint32_t levels) {
    static const int ties[3] = {1, 0, 2};   /* halved last, so merged first: v, u, w */
    double finest = spacing[0], voxels[3], distance[3];
    for (int k = 1; k < 3; k++) if (spacing[k] < finest) finest = spacing[k];
    for (int k = 0; k < 3; k++) {
        voxels[k] = most[k] * spacing[k] / finest;
        distance[k] = spacing[k];
    }
    int axes[3 * 10];
    /* From the last level back: one pass, two, then three each. */
    uint32_t wanted = 3 * octaves(voxels), count = 0;
    if (levels) wanted = levels < 3 ? levels - 1 : levels < LATHE_MAX_LEVELS && 3 * (levels - 2) < wanted ? 3 * (levels - 2) : wanted;
    for (; count < wanted; count++) {
        int least = -1;
        for (int i = 0; i < 3; i++) {
            bool more = distance[ties[i]] < most[ties[i]] * spacing[ties[i]];   /* else one sample is left */
            if (more && (least < 0 || distance[ties[i]] < distance[least] * 0.999)) least = ties[i];
        }
        if (least < 0) break;
        distance[least] *= 2;
        axes[count] = least;
    }
    header->parameter_count = 2;
    for (uint32_t left = count; left;) {
        uint32_t done = count - left, passes = done == 0 ? 1 : done == 1 ? 2 : 3, code = 0;
        if (passes > left) passes = left;
        for (uint32_t i = 0; i < passes; i++) code = code << 2 | (uint32_t)(axes[done + i] + 1);
        header->parameters[header->parameter_count++] = code;
        left -= passes;
    }
    for (uint32_t i = 2, k = header->parameter_count - 1; i < k; i++, k--) {
        uint32_t swap = header->parameters[i];
        header->parameters[i] = header->parameters[k];
        header->parameters[k] = swap;
    }
}

lathe_status lathe__pyramid_cost(size_t *bytes, const lathe_mask *mask, const double spacing[3], size_t enough) {
    lathe_header_structure structure = {.level_count = 0};
    lathe_header header = {.structure_count = 1, .structures = &structure};
    int32_t most[3] = {mask->size[0] - 2, mask->size[1] - 2, mask->size[2]};
    lathe_pyramid pyramid;
    lathe_models models = {.widest = {3, 3}};
    lathe_structure_state state = {.mask = *mask, .pyramid = &pyramid, .flags = LATHE_FLAG_SURE};
    lathe__pyramid_plan(&header, spacing, most, 0);
    structure.level_count = (uint8_t)(header.parameter_count - 1);
    lathe_status status = lathe__pyramid_read(&pyramid, &header);
    lathe_range_encoder e;
    lathe_bytes all = {0};
    lathe__encoder_start(&e);
    for (uint32_t level = 0; !status && level < pyramid.level_count; level++)
        for (uint32_t pass = 0; !status && e.size < enough && pass < lathe__pyramid_passes(&pyramid, level); pass++)
            status = lathe__pass_encode(&e, &state, &models, level, pass);
    lathe_status coded = lathe__append_coded(&all, &e);
    *bytes = all.size;
    lathe__bytes_free(&all);
    lathe__state_drop_occupancy(&state);
    lathe__occupancy_free(&models.occupancy);
    return status ? status : coded;
}
