/* libFuzzer target: the packets of one structure of 20 x 20 x 6 voxels, without a container around them. The first two bytes say
 * where the input is cut into the packets of levels 0, 1 and 2, the third one is the header's flags (caps, topology kept, a pyramid
 * with two passes a level, sure pixels); after each packet, the mesh that a viewer would show is built. */
#include <stdlib.h>
#include "structure_state.h"

static void check_mesh(const lathe_mesh *mesh) {
    for (uint32_t i = 0; i < mesh->triangle_count; i++)
        for (int k = 0; k < 3; k++)
            if (mesh->triangles[i][k] >= mesh->vertex_count) abort();
}

/* The passes of a level, one behind the other in one range coder. */
static lathe_status decode_passes(lathe_structure_state *state, lathe_models *models, uint32_t level, const uint8_t *bytes, size_t size,
                                  const char **fault) {
    lathe_range_decoder d;
    lathe_status status = LATHE_OK;
    lathe__decoder_start(&d, bytes, size);
    for (uint32_t pass = 0; !status && pass < lathe__pyramid_passes(state->pyramid, level); pass++)
        status = lathe__pass_decode(state, &d, models, level, fault);
    return status;
}

int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t size);
int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t size) {
    /* Of both kinds; training takes longer than everything else here. */
    static lathe_models both[2] = {{.widest = {3, 3}}, {.widest = {3, 3}}};
    if (size < 3) return 0;
    lathe_models *models = &both[bytes[2] & LATHE_FLAG_PYRAMID && bytes[2] & LATHE_FLAG_SURE];
    size_t left = size - 3, first = left * bytes[0] / 255, second = (left - first) * bytes[1] / 255;
    size_t begin[4] = {3, 3 + first, 3 + first + second, size};
    lathe_structure_state state = {.mask = {.size = {20, 20, 6}, .row_words = 1}, .fraction = 28, .flags = bytes[2], .level = -1};
    lathe_arena arena[2] = {{0}, {0}};
    static const lathe_pyramid pyramid = {3, {0, 3 | 1 << 2, 2 | 1 << 2}, {4, 2, 2}};
    if (bytes[2] & LATHE_FLAG_PYRAMID) {
        state.pyramid = &pyramid;
        state.flags &= ~(uint32_t)LATHE_FLAG_SHARED;
    }
    state.plan = (lathe_level_plan){.slices = 6, .level_count = 3};
    for (uint32_t level = 0; level < 3; level++) {
        const char *fault = "";
        const uint8_t *packet = bytes + begin[level];
        size_t packet_size = begin[level + 1] - begin[level];
        lathe_status status = state.pyramid ? decode_passes(&state, models, level, packet, packet_size, &fault)
                                            : lathe__structure_decode(&state, &arena[0], models, level, packet, packet_size, &fault);
        if (status > 0 || (status && !fault[0])) abort();
        if (status) break;
        lathe_mesh mesh = {0};
        lathe_surface_counts counts;
        uint32_t shown;
        lathe__arena_reset(&arena[0]);
        if (lathe__state_mesh(&mesh, arena, &state, &counts, &shown) == LATHE_OK) check_mesh(&mesh);
        lathe_mesh_free(&mesh);
    }
    lathe__state_free(&state);
    lathe__arena_free(&arena[0]);
    lathe__arena_free(&arena[1]);
    return 0;
}
