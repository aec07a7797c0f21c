/* One structure of a model whose structures share their models (LATHE_FLAG_SHARED), coded again to stand alone: its slices or radii
 * are decoded from the whole stream and encoded as a structure of its own. The same surface comes out. */
#include <stdlib.h>
#include <string.h>
#include "restream.h"
#include "structure_encode.h"

/* A decoder that has seen every level of the structure, or NULL. */
static lathe_status decode_all(lathe_decoder **out, const lathe_model *model, uint32_t last_level) {
    size_t size, offset, length;
    const uint8_t *bytes = lathe_model_bytes(model, &size);
    lathe_model_stream_range(model, 0, last_level, &offset, &length);
    lathe_decoder *decoder;
    lathe_status status = lathe_decoder_open(&decoder);
    if (status) return status;
    lathe_decoder_build_meshes(decoder, false);
    status = lathe_decoder_feed(decoder, bytes + offset, length);
    lathe_step step;
    while (!status) status = lathe_decoder_step(decoder, &step);
    if (status == LATHE_MORE) *out = decoder;
    else lathe_decoder_close(&decoder);
    return status == LATHE_MORE ? LATHE_OK : status;
}

static lathe_status encode_passes(lathe_packet_list *packets, lathe_structure_state *alone, lathe_models *models, uint32_t level) {
    lathe_status status = LATHE_OK;
    for (uint32_t pass = 0; !status && pass < lathe__pyramid_passes(alone->pyramid, level); pass++) {
        lathe_range_encoder e;
        lathe_bytes packet = {0};
        lathe__encoder_start(&e);
        status = lathe__pass_encode(&e, alone, models, level, pass);
        lathe_status coded = lathe__append_coded(&packet, &e);
        if (!status) status = coded;
        if (!status) status = lathe__packets_add(packets, &packet);
        lathe__bytes_free(&packet);
    }
    return status;
}

static lathe_status encode_alone(lathe_packet_list packets[LATHE_MAX_LEVELS], const lathe_structure_state *decoded, uint32_t level_count) {
    lathe_arena arena[2] = {{0}};
    lathe_models models = {.widest = {3, 3}};
    lathe_baked_structure baked = {.level_count = level_count, .truth = decoded->radii};
    lathe_structure_state alone = {.mask = decoded->mask, .plan = decoded->plan, .fraction = decoded->fraction, .upright = decoded->upright, .level = -1,
                                   .flags = decoded->flags & ~(uint32_t)LATHE_FLAG_SHARED, .exact_base = decoded->exact_base,
                                   .pyramid = decoded->pyramid};
    lathe_radii radii;
    lathe_status status = LATHE_OK;
    if (decoded->radii) alone.radii = &radii;
    else if (!alone.exact_base && !alone.pyramid) status = lathe__fit_stars(&alone, &arena[0]);
    for (uint32_t level = 0; !status && level < level_count; level++) {
        if (alone.pyramid) {
            status = encode_passes(&packets[level], &alone, &models, level);
            continue;
        }
        status = lathe__structure_encode_level(&baked, &alone, arena, &models, level, NULL);
        if (!status) status = lathe__packets_add(&packets[level], &baked.packets[level]);
    }
    lathe__baked_free(&baked);
    lathe__mask_free(&alone.estimate);
    lathe__state_drop_occupancy(&alone);
    lathe__occupancy_free(&models.occupancy);
    lathe__arena_free(&alone.arena);
    lathe__arena_free(&arena[0]);
    lathe__arena_free(&arena[1]);
    return status;
}

lathe_status lathe__restream(lathe_packet_list packets[LATHE_MAX_LEVELS], const lathe_model *model, uint32_t structure, uint32_t level_count) {
    lathe_decoder *decoder = NULL;
    lathe_status status = decode_all(&decoder, model, level_count - 1);
    if (!status) status = encode_alone(packets, lathe__decoder_state(decoder, structure), level_count);
    lathe_decoder_close(&decoder);
    return status;
}
