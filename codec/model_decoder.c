/* Which of the browser's decoders a model needs: rasters say so in the header, tubes in their first packets. */
#include "restream.h"

static int feed_decoder(void *context, const void *bytes, size_t size) { return lathe_decoder_feed(context, bytes, size); }

/* Is every structure made of what the decoder of tubes joins? */
static bool has_only_tubes(const lathe_model *model, uint32_t count) {
    lathe_decoder *decoder;
    lathe_step step;
    bool tubes = false;
    if (lathe_decoder_open(&decoder)) return false;
    lathe_decoder_build_meshes(decoder, false);
    if (!lathe_model_stream(model, -1, 0, 0, feed_decoder, decoder)) {
        tubes = true;
        for (uint32_t i = 0; i < count && tubes; i++) {
            tubes = !lathe_decoder_step(decoder, &step);
            const lathe_structure_state *state = tubes ? lathe__decoder_state(decoder, step.structure) : NULL;
            tubes = tubes && state->radii && lathe__radii_plain(state->radii);
        }
    }
    lathe_decoder_close(&decoder);
    return tubes;
}

lathe_small_decoder lathe_model_decoder(const lathe_model *model) {
    const lathe_model_info *info = lathe_model_describe(model);
    if (info->rasters_only) return LATHE_DECODER_RASTERS;
    return !info->pyramid && !info->exact && has_only_tubes(model, info->structure_count) ? LATHE_DECODER_TUBES : LATHE_DECODER_WHOLE;
}
