/* libFuzzer target: a stream as a decoder takes it, in portions, with right checksums, to meshes at every level. The first byte
 * chooses whether checksums are mended and how long the portions are. */
#include "lathe_codec.h"
#include "mend_stream.h"
#include <stdlib.h>

static void check_mesh(const lathe_mesh *mesh) {
    for (uint32_t i = 0; i < mesh->triangle_count; i++)
        for (int k = 0; k < 3; k++)
            if (mesh->triangles[i][k] >= mesh->vertex_count) abort();
}

static lathe_status step_all(lathe_decoder *decoder) {
    lathe_step step;
    lathe_status status;
    while ((status = lathe_decoder_step(decoder, &step)) == LATHE_OK) {
        const lathe_mesh *mesh = lathe_decoder_mesh(decoder, step.structure);
        if (mesh) check_mesh(mesh);
    }
    if (status < 0 && !lathe_decoder_error(decoder)[0]) abort();
    return status;
}

int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t size);
int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t size) {
    if (size < 2) return 0;
    uint8_t *copy = malloc(size - 1);
    lathe_decoder *decoder = NULL;
    if (!copy || lathe_decoder_open(&decoder)) return free(copy), 0;
    size_t count = size - 1, portion = bytes[0] & 127 ? (size_t)(bytes[0] & 127) * 8 : count;
    memcpy(copy, bytes + 1, count);
    if (!(bytes[0] & 128)) mend_stream(copy, count);
    lathe_status status = LATHE_MORE;
    for (size_t at = 0; at < count && status == LATHE_MORE; at += portion) {
        size_t n = count - at < portion ? count - at : portion;
        if (lathe_decoder_feed(decoder, copy + at, n) < 0) break;
        status = step_all(decoder);
    }
    lathe_decoder_close(&decoder);
    free(copy);
    return 0;
}
