/* libFuzzer target: a whole archive with right checksums: parsed, described, checked, streamed, its last level built. */
#include "lathe_codec.h"
#include "mend_stream.h"
#include <stdlib.h>

static int count_bytes(void *context, const void *bytes, size_t size) {
    (void)bytes;
    *(uint64_t *)context += size;
    return 0;
}

static void use_model(const lathe_model *model) {
    const lathe_model_info *info = lathe_model_describe(model);
    if (!info->structure_count || !info->level_count) abort();
    lathe_error err = {{0}};
    if (lathe_model_check(model, &err) && !err.text[0]) abort();
    /* Where structures share a model, each is decoded with all before it and coded again. */
    uint32_t most = info->independent ? 8 : 1;
    for (uint32_t i = 0; i < info->structure_count && i < most; i++) {
        if (lathe_model_find(model, info->structures[i].name) != (int64_t)i) abort();
        uint64_t size = 0;
        if (!lathe_model_stream(model, i, 0, LATHE_MAX_LEVELS, count_bytes, &size) && info->independent &&
            size != lathe_model_stream_size(model, i, 0, LATHE_MAX_LEVELS)) abort();
    }
    lathe_world_mesh mesh;
    if (lathe_model_mesh(&mesh, model, 0, info->level_count - 1, &err) == LATHE_OK) lathe_world_mesh_free(&mesh);
}

int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t size);
int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t size) {
    uint8_t *copy = malloc(size + 1);
    if (!copy) return 0;
    if (size) memcpy(copy, bytes, size);
    mend_archive(copy, size);
    lathe_model *model = NULL;
    lathe_error err = {{0}};
    lathe_status status = lathe_model_parse(&model, copy, size, &err);
    if ((status == LATHE_OK) != (model != NULL) || (status && !err.text[0])) abort();
    if (model) use_model(model);
    lathe_model_close(&model);
    free(copy);
    return 0;
}
