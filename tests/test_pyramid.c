/* Pyramids: the schedule, rasters against a pixel by pixel computation, round trips, the surface behind every pass. */
#include <stdlib.h>
#include <string.h>
#include "check.h"
#include "lathe_codec.h"
#include "mesh.h"
#include "mesh_volume.h"
#include "phantom.h"
#include "restream.h"
#include "structure_encode.h"

static uint32_t seed = 1;
static int32_t below(uint32_t n) { return (int32_t)((phantom_random(&seed) >> 8) % n); }

static bool pixel(const lathe_mask *m, int32_t u, int32_t v, int32_t w) {
    if (u < 0 || v < 0 || w < 0 || u >= m->size[0] || v >= m->size[1] || w >= m->size[2]) return false;
    return lathe__slice_pixel(lathe__mask_slice(m, w), m->row_words, u, v);
}

/* Random pixels within the margin. */
static lathe_mask noise(int32_t width, int32_t height, int32_t slices, uint32_t percent) {
    lathe_mask m;
    if (lathe__mask_new(&m, (int32_t[]){width, height, slices}, (int32_t[]){-1, -1, 0})) abort();
    for (int32_t w = 0; w < slices; w++)
        for (int32_t v = 1; v < height - 1; v++)
            for (int32_t u = 1; u < width - 1; u++)
                if (below(100) < (int32_t)percent)
                    lathe__mask_slice(&m, w)[(size_t)v * (size_t)m.row_words + (size_t)(u >> 6)] |= (uint64_t)1 << (u & 63);
    return m;
}

/* ---- schedule ---- */

static lathe_header schedule(const double spacing[3], const int32_t most[3], uint32_t levels, lathe_header_structure *s) {
    lathe_header header = {.structure_count = 1, .structures = s};
    lathe__pyramid_plan(&header, spacing, most, levels);
    s->level_count = (uint8_t)(header.parameter_count - 1);
    return header;
}

static void test_schedule(void) {
    lathe_header_structure s = {.level_count = 0};
    lathe_pyramid p;
    lathe_header h = schedule((double[]){1, 1, 1}, (int32_t[]){145, 180, 152}, 0, &s);
    CHECK_EQ(lathe__pyramid_read(&p, &h), LATHE_OK);
    CHECK_EQ(p.level_count, 5);
    for (int k = 0; k < 3; k++) CHECK_EQ(p.start[k], 8);
    static const int order[] = {2, 0, 1, 2, 0, 1, 2, 0, 1};
    static const uint32_t passes[] = {1, 3, 3, 2, 1};
    for (uint32_t level = 0, at = 0; level < 5; level++) {
        CHECK_EQ(lathe__pyramid_passes(&p, level), passes[level]);
        for (uint32_t pass = 0; level && pass < passes[level]; pass++) CHECK_EQ(lathe__pyramid_axis(&p, level, pass), order[at++]);
    }
    /* Thick slices: u and v are coarse until their samples are as far apart. */
    h = schedule((double[]){0.5, 0.5, 4}, (int32_t[]){200, 200, 20}, 0, &s);
    CHECK_EQ(lathe__pyramid_read(&p, &h), LATHE_OK);
    CHECK(p.start[0] >= 8 && p.start[0] <= 2 * 8 * p.start[2] && p.start[1] == p.start[0]);
    /* Whatever the size, all strides end at 1, and no axis is halved more often than it has samples. */
    for (int i = 0; i < 3000; i++) {
        double spacing[3];
        int32_t most[3];
        for (int k = 0; k < 3; k++) spacing[k] = 0.1 * (1 + below(60)), most[k] = 1 + below(i % 3 ? 40 : 4000);
        uint32_t levels = (uint32_t)below(LATHE_MAX_LEVELS + 1);
        h = schedule(spacing, most, levels, &s);
        if (!CHECK_EQ(lathe__pyramid_read(&p, &h), LATHE_OK)) break;
        CHECK(!levels || p.level_count <= levels);
        int32_t stride[3];
        lathe__pyramid_strides(stride, &p, p.level_count - 1, p.level_count > 1 ? lathe__pyramid_passes(&p, p.level_count - 1) : 0);
        for (int k = 0; k < 3; k++) CHECK(stride[k] == 1 && p.start[k] < 2 * most[k]);
    }
}

static void test_wrong_schedules(void) {
    lathe_header_structure s = {.level_count = 2};
    lathe_pyramid p;
    static const uint32_t wrong[] = {0, 1 | 0 << 2 | 2 << 4, UINT32_MAX, 0x55555555, 1 << 30};
    for (size_t i = 0; i < sizeof wrong / sizeof *wrong; i++) {
        lathe_header h = {.structure_count = 1, .structures = &s, .parameter_count = 3, .parameters = {32, LATHE_FLAG_PYRAMID, wrong[i]}};
        CHECK_EQ(lathe__pyramid_read(&p, &h), LATHE_ERR_FORMAT);
    }
    lathe_header h = {.structure_count = 1, .structures = &s, .parameter_count = 3, .parameters = {32, LATHE_FLAG_PYRAMID, 0x15555555}};
    CHECK_EQ(lathe__pyramid_read(&p, &h), LATHE_ERR_FORMAT);   /* fifteen halvings of u: a stride of 32768 */
    h.parameters[2] = 0x155555;
    CHECK_EQ(lathe__pyramid_read(&p, &h), LATHE_OK);           /* eleven: 2048 */
    CHECK_EQ(p.start[0], 2048);
    s.level_count = 3;
    CHECK_EQ(lathe__pyramid_read(&p, &h), LATHE_ERR_FORMAT);
    h.parameter_count = 1;
    CHECK_EQ(lathe__pyramid_read(&p, &h), LATHE_ERR_FORMAT);
}

/* ---- rasters ---- */

static int32_t random_width(void) {
    static const int32_t hard[] = {3, 4, 63, 64, 65, 66, 127, 128, 129, 130};
    return below(2) ? hard[below(10)] : 3 + below(40);
}

static void test_rasters(void) {
    for (int i = 0; i < 150; i++) {
        int32_t width = random_width(), height = random_width(), slices = 1 + below(9), size[3], finer[3], stride[3], half[3];
        lathe_mask whole = noise(width, height, slices, 40), coarse, fine, planes, back;
        for (int k = 0; k < 3; k++) stride[k] = half[k] = 2 << below(3);
        int axis = below(3);
        half[axis] /= 2;
        lathe__pyramid_size(size, whole.size, stride);
        lathe__pyramid_size(finer, whole.size, half);
        CHECK((size[0] - 1) * stride[0] >= width - 1 && (size[0] - 2) * stride[0] < width - 1);
        CHECK((size[2] - 1) * stride[2] < slices && size[2] * stride[2] >= slices);
        if (lathe__pyramid_sample(&coarse, &whole, stride) || lathe__pyramid_spread(&fine, &coarse, finer, axis)) abort();
        uint32_t wrong = memcmp(coarse.size, size, sizeof size) || memcmp(fine.size, finer, sizeof finer);
        for (int32_t w = 0; w < finer[2]; w++)
            for (int32_t v = 0; v < finer[1]; v++)
                for (int32_t u = 0; u < finer[0]; u++) {
                    int32_t at[3] = {u, v, w};
                    bool known = !(at[axis] & 1), is = pixel(&whole, u * half[0], v * half[1], w * half[2]);
                    wrong += pixel(&fine, u, v, w) != (known && is);
                    at[axis] /= 2;
                    if (known) wrong += pixel(&coarse, at[0], at[1], at[2]) != is;
                }
        lathe__mask_free(&fine);
        if (lathe__pyramid_sample(&fine, &whole, half)) abort();
        if (axis < 2) {
            if (lathe__pyramid_turn(&planes, &fine, axis) || lathe__mask_new(&back, finer, whole.origin)) abort();
            for (int32_t w = 0; w < finer[2]; w++)
                for (int32_t v = 0; v < finer[1]; v++)
                    for (int32_t u = 0; u < finer[0]; u++)
                        wrong += pixel(&fine, u, v, w) != pixel(&planes, axis ? u : v, w + 1, axis ? v : u);
            lathe__pyramid_turn_back(&back, &planes, axis);
            wrong += memcmp(back.bits, fine.bits, lathe__mask_slice_words(&fine) * (size_t)finer[2] * sizeof *fine.bits) != 0;
            lathe__mask_free(&planes);
            lathe__mask_free(&back);
        }
        CHECK_EQ(wrong, 0);
        lathe__mask_free(&whole);
        lathe__mask_free(&coarse);
        lathe__mask_free(&fine);
    }
}

/* ---- passes ---- */

static bool flawless(const lathe_mesh *mesh, const lathe_topology *topology) {
    lathe_mesh_report r;
    if (lathe__mesh_check(&r, mesh, true)) return false;
    return !r.boundary_edges && !r.nonmanifold_edges && !r.misoriented_edges && !r.nonmanifold_vertices && !r.degenerate_triangles &&
           !r.duplicate_positions && !r.unused_vertices && !r.bad_indices && !r.self_intersections &&
           r.components == (uint64_t)(topology->components + topology->cavities) && r.euler == 2 * topology->euler;
}

/* What a decoder has behind a pass is what the whole mask has on that raster, and its surface is right. */
static void check_pass(const lathe_structure_state *state, const lathe_mask *whole, const lathe_mesh *mesh) {
    const lathe_mask *raster = state->raster.bits ? &state->raster : &state->mask;
    lathe_mask expected;
    if (lathe__pyramid_sample(&expected, whole, state->stride)) abort();
    size_t bytes = lathe__mask_slice_words(&expected) * (size_t)expected.size[2] * sizeof(uint64_t);
    CHECK(!memcmp(expected.size, raster->size, sizeof expected.size) && !memcmp(expected.bits, raster->bits, bytes));
    lathe_topology topology = {.components = 0};
    CHECK_EQ(lathe__mask_topology(&topology, &expected, NULL), LATHE_OK);
    if (!topology.components) topology = (lathe_topology){1, 0, 1};   /* the octahedron */
    CHECK(mesh && flawless(mesh, &topology) && mesh_volume(mesh) > 0);
    lathe__mask_free(&expected);
}

static int append(void *context, const void *bytes, size_t size) {
    lathe__emit(context, bytes, size);
    return 0;
}

/* Slices are along z, so the frame's u, v, w are x, y, z. */
static lathe_mask mask_of(const lathe_volume *volume, int64_t label) {
    lathe_mask mask;
    lathe_status status = label < 0 ? lathe__region_threshold(&mask, volume, LATHE_AXIS_Z, PHANTOM_ISO, NULL)
                                    : lathe__region_label(&mask, volume, LATHE_AXIS_Z, label, NULL);
    if (status) abort();
    return mask;
}

static void round_trip(lathe_volume *volume, const int64_t *labels, size_t count, bool independent) {
    lathe_bake_structure structures[8];
    lathe_mask masks[8];
    lathe_bake_options options;
    lathe_bake_defaults(&options);
    options.iso = PHANTOM_ISO;
    options.exact = true;
    options.independent = independent;
    options.measure = options.draco = false;
    for (size_t i = 0; i < count; i++) {
        structures[i] = (lathe_bake_structure){.label = labels[i]};
        snprintf(structures[i].name, sizeof structures[i].name, "part %zu", i);
        masks[i] = mask_of(volume, labels[i]);
    }
    if (labels[0] >= 0) options.structures = structures, options.structure_count = count;
    lathe_bytes archive = {0};
    lathe_error err = {""};
    if (!CHECK(lathe_bake(volume, &options, append, &archive, &err) == LATHE_OK)) fprintf(stderr, "%s\n", err.text);
    lathe_model *model = NULL;
    CHECK_EQ(lathe_model_parse(&model, archive.data, archive.size, &err), LATHE_OK);
    lathe_decoder *at_once, *slowly;
    lathe_step step, same;
    size_t offset, size, fed = 0;
    lathe_model_stream_range(model, 0, LATHE_MAX_LEVELS, &offset, &size);
    if (lathe_decoder_open(&at_once) || lathe_decoder_open(&slowly) || lathe_decoder_feed(at_once, archive.data, size)) abort();
    lathe_decoder_every_pass(at_once, true);
    lathe_decoder_every_pass(slowly, true);
    lathe_decoder_build_meshes(slowly, false);
    lathe_status status;
    while (!(status = lathe_decoder_step(at_once, &step))) {
        const lathe_mesh *mesh = lathe_decoder_mesh(at_once, step.structure);
        check_pass(lathe__decoder_state(at_once, step.structure), &masks[step.structure], mesh);
        lathe_status late;
        while ((late = lathe_decoder_step(slowly, &same)) == LATHE_MORE && fed < size) late = lathe_decoder_feed(slowly, archive.data + fed++, 1);
        CHECK(late == LATHE_OK && same.structure == step.structure && same.level == step.level && same.passes_left == step.passes_left);
        const lathe_mesh *other = lathe_decoder_mesh(slowly, step.structure);
        CHECK(other && mesh && other->vertex_count == mesh->vertex_count && other->triangle_count == mesh->triangle_count &&
              !memcmp(other->lattice, mesh->lattice, mesh->vertex_count * sizeof *mesh->lattice) &&
              !memcmp(other->triangles, mesh->triangles, mesh->triangle_count * sizeof *mesh->triangles));
    }
    CHECK_EQ(status, LATHE_MORE);
    CHECK_EQ(fed, size);
    for (size_t i = 0; i < count; i++) lathe__mask_free(&masks[i]);
    lathe_decoder_close(&at_once);
    lathe_decoder_close(&slowly);
    lathe_model_close(&model);
    lathe__bytes_free(&archive);
    lathe_volume_close(&volume);
}

static void test_round_trips(void) {
    static const int64_t grey[] = {-1}, one[] = {1};
    round_trip(phantom_sphere(30, 11.3, PHANTOM_GREY), grey, 1, false);
    round_trip(phantom_shells(32, PHANTOM_GREY), grey, 1, false);
    round_trip(phantom_branch(28, PHANTOM_LABEL), one, 1, false);
    round_trip(phantom_specks(20, 12, 3, PHANTOM_LABEL), one, 1, false);
    round_trip(phantom_voxel(9, PHANTOM_GREY), grey, 1, false);
    round_trip(phantom_slice(40, PHANTOM_GREY), grey, 1, false);
    round_trip(phantom_full(70, 5, 3, PHANTOM_LABEL), one, 1, false);
    for (uint32_t i = 0; i < 12; i++) {
        int nx = 1 + below(30), ny = 4 + below(30), nz = 2 + below(20);
        round_trip(phantom_noise(nx, ny, nz, 20 + 5 * (int)i, i + 1, i & 1 ? PHANTOM_GREY : PHANTOM_LABEL), i & 1 ? grey : one, 1, false);
        round_trip(phantom_blobs(26, 9, i + 1, PHANTOM_GREY), grey, 1, false);
    }
    round_trip(phantom_noise(130, 9, 7, 45, 99, PHANTOM_GREY), grey, 1, false);
}

/* Labels: a blob, its shell of noise, a speck; with one model for all and with one each. */
static void test_structures(void) {
    static const int64_t labels[] = {1, 2, 5};
    for (int independent = 0; independent < 2; independent++) {
        enum { N = 26 };
        lathe_volume *volume = phantom_blobs(N, 7, 5, PHANTOM_LABEL);
        for (size_t i = 0; i < (size_t)N * N * N; i++)
            if (volume->values[i] <= 0 && below(4) == 0) volume->values[i] = 2;
        volume->values[N * N * 3 + N * 4 + 5] = volume->max = 5;
        round_trip(volume, labels, 3, independent);
    }
}

/* Any bytes as the passes of a structure: a status or a raster, and its surface closes. */
static void test_garbage(void) {
    lathe_header_structure s = {.level_count = 0};
    lathe_models models = {.widest = {3, 3}};
    lathe_pyramid p;
    uint32_t refused = 0, taken = 0;
    for (int i = 0; i < 200; i++) {
        lathe_header h = schedule((double[]){1, 1, 1 + i % 3}, (int32_t[]){18, 16, 9}, 0, &s);
        if (lathe__pyramid_read(&p, &h)) abort();
        lathe_structure_state state = {.mask = {.size = {20, 18, 9}, .row_words = 1}, .fraction = 28, .level = -1, .pyramid = &p};
        lathe_arena arena[2] = {{0}, {0}};
        lathe_status status = LATHE_OK;
        for (uint32_t level = 0; !status && level < p.level_count; level++)
            for (uint32_t pass = 0; !status && pass < lathe__pyramid_passes(&p, level); pass++) {
                uint8_t bytes[64];
                const char *fault = "";
                lathe_range_decoder d;
                size_t size = (size_t)below(i % 4 ? 64 : 4);
                for (size_t k = 0; k < size; k++) bytes[k] = (uint8_t)below(256);
                lathe__decoder_start(&d, bytes, size);
                status = lathe__pass_decode(&state, &d, &models, level, &fault);
                CHECK(!status || (status == LATHE_ERR_FORMAT && *fault));
                lathe_mesh mesh = {0};
                lathe_surface_counts counts;
                uint32_t shown;
                if (lathe__state_known(&state) && !lathe__state_mesh(&mesh, arena, &state, &counts, &shown)) {
                    lathe_mesh_report r;
                    CHECK(!lathe__mesh_check(&r, &mesh, false) && !r.boundary_edges && !r.nonmanifold_edges && !r.bad_indices);
                }
                lathe_mesh_free(&mesh);
            }
        refused += status != LATHE_OK;
        taken += status == LATHE_OK;
        lathe__state_free(&state);
        lathe__arena_free(&arena[0]);
        lathe__arena_free(&arena[1]);
    }
    CHECK(refused > 20);
    printf("garbage: %u refused, %u taken\n", refused, taken);
    lathe__occupancy_free(&models.occupancy);
}

int main(void) {
    test_schedule();
    test_wrong_schedules();
    test_rasters();
    test_round_trips();
    test_structures();
    test_garbage();
    return check_end();
}
