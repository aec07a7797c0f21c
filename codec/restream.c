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

static lathe_status encode_alone(lathe_bytes packets[LATHE_MAX_LEVELS], const lathe_structure_state *decoded) {
    lathe_arena arena[2] = {{0}};
    lathe_models models = {.widest = {3, 3}};
    lathe_baked_structure baked = {.level_count = decoded->plan.level_count, .truth = decoded->radii};
    lathe_structure_state alone = {.mask = decoded->mask, .plan = decoded->plan, .fraction = decoded->fraction, .level = -1,
                                   .flags = decoded->flags & ~(uint32_t)LATHE_FLAG_SHARED, .exact_base = decoded->exact_base};
    lathe_radius_map map;
    lathe_status status = LATHE_OK;
    if (decoded->radii) alone.radii = &map;
    else if (!alone.exact_base) status = lathe__fit_stars(&alone, &arena[0]);
    for (uint32_t level = 0; !status && level < baked.level_count; level++)
        status = lathe__structure_encode_level(&baked, &alone, arena, &models, level, NULL);
    memcpy(packets, baked.packets, sizeof baked.packets);
    memset(baked.packets, 0, sizeof baked.packets);
    lathe__baked_free(&baked);
    lathe__mask_free(&alone.estimate);
    lathe__state_drop_occupancy(&alone);
    lathe__occupancy_free(&models.occupancy);
    lathe__arena_free(&alone.arena);
    lathe__arena_free(&arena[0]);
    lathe__arena_free(&arena[1]);
    return status;
}

lathe_status lathe__restream(lathe_bytes packets[LATHE_MAX_LEVELS], const lathe_model *model, uint32_t structure, uint32_t level_count) {
    lathe_decoder *decoder = NULL;
    lathe_status status = decode_all(&decoder, model, level_count - 1);
    if (!status) status = encode_alone(packets, lathe__decoder_state(decoder, structure));
    lathe_decoder_close(&decoder);
    return status;
}
