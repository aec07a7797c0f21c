/* lathe bench: how fast an archive decodes. lathe hash: one number for the last meshes, to compare platforms. */
#include "bench.h"
#include "mesh_shading.h"
#include <stdlib.h>
#include <string.h>
#include <time.h>

static uint64_t hash_word(uint64_t hash, uint32_t word) {
    for (int shift = 0; shift < 32; shift += 8) hash = (hash ^ (word >> shift & 0xff)) * 0x100000001b3u;
    return hash;
}

uint64_t lathe__hash_mesh(uint64_t hash, const lathe_mesh *mesh) {
    for (uint32_t i = 0; i < mesh->vertex_count; i++)
        for (int k = 0; k < 3; k++) hash = hash_word(hash, (uint32_t)mesh->lattice[i][k]);
    for (uint32_t i = 0; i < mesh->triangle_count; i++)
        for (int k = 0; k < 3; k++) hash = hash_word(hash, mesh->triangles[i][k]);
    return hash;
}

const uint8_t *lathe__whole_stream(const lathe_model *model, size_t *size) {
    size_t offset, total;
    const uint8_t *bytes = lathe_model_bytes(model, &total);
    lathe_model_stream_range(model, 0, LATHE_MAX_LEVELS, &offset, size);
    return bytes + offset;
}

/* Decodes the stream. Every level's mesh is built if all_levels, else only each structure's last. */
typedef struct decode_result { uint64_t triangles, vertices, last_triangles, hash; double seconds; } decode_result;

double lathe__cpu_seconds(void) {
    struct timespec now;
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
    return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

static lathe_status step_through(lathe_decoder *decoder, bool all_levels, decode_result *result) {
    for (;;) {
        lathe_step step;
        lathe_status status = lathe_decoder_step(decoder, &step);
        if (status == LATHE_MORE) return LATHE_OK;
        if (status) return status;
        if (!all_levels) continue;
        const lathe_mesh *mesh = lathe_decoder_mesh(decoder, step.structure);
        if (!mesh) return LATHE_ERR_FORMAT;
        result->triangles += mesh->triangle_count;
    }
}

/* What to do with the last meshes, once they are built. */
typedef enum hashing { HASH_NONE, HASH_ALL, HASH_EACH } hashing;

/* shading: also what a renderer needs besides, there; or NULL: only the meshes */
static lathe_status last_meshes(lathe_decoder *decoder, hashing hash, lathe_mesh_shading *shading, decode_result *result) {
    uint32_t count = lathe_decoder_structures(decoder);
    result->hash = LATHE_FNV_START;
    for (uint32_t i = 0; i < count; i++) {
        const lathe_mesh *mesh = lathe_decoder_mesh(decoder, i);
        if (!mesh) return LATHE_ERR_FORMAT;
        result->last_triangles += mesh->triangle_count;
        result->vertices += mesh->vertex_count;
        if (hash == HASH_ALL) result->hash = lathe__hash_mesh(result->hash, mesh);
        if (shading && lathe__mesh_shade(shading, mesh, lathe_decoder_transform(decoder, i))) return LATHE_ERR_MEMORY;
        if (hash == HASH_EACH) printf("%016llx\n", (unsigned long long)lathe__hash_mesh(LATHE_FNV_START, mesh));
    }
    return LATHE_OK;
}

static lathe_status decode_once(decode_result *out, const uint8_t *stream, size_t size, bool all_levels, hashing hash,
                                lathe_mesh_shading *shading, lathe_error *err) {
    decode_result result;
    memset(&result, 0, sizeof result);
    double start = lathe__cpu_seconds();
    lathe_decoder *decoder = NULL;
    lathe_status status = lathe_decoder_open(&decoder);
    if (status) return status;
    lathe_decoder_build_meshes(decoder, all_levels);
    status = lathe_decoder_feed(decoder, stream, size);
    if (!status) status = step_through(decoder, all_levels, &result);
    if (!status) status = last_meshes(decoder, hash, shading, &result);
    if (status) lathe_fail(err, status, "%s", lathe_decoder_error(decoder));
    result.seconds = lathe__cpu_seconds() - start;
    lathe_decoder_close(&decoder);
    if (!status) *out = result;
    return status;
}

/* The fastest of several runs: the one least disturbed. */
static lathe_status decode_best(decode_result *out, const uint8_t *stream, size_t size, bool all_levels, int repeats,
                                lathe_error *err) {
    for (int i = 0; i < repeats; i++) {
        decode_result result;
        lathe_status status = decode_once(&result, stream, size, all_levels, HASH_NONE, NULL, err);
        if (status) return status;
        if (i == 0 || result.seconds < out->seconds) *out = result;
    }
    return LATHE_OK;
}

static lathe_status measure(decode_result *last, decode_result *all, const lathe_model *model, int repeats,
                            lathe_error *err) {
    size_t size;
    const uint8_t *stream = lathe__whole_stream(model, &size);
    decode_result hashed;
    lathe_status status = decode_once(&hashed, stream, size, false, HASH_ALL, NULL, err);
    if (!status) status = decode_best(last, stream, size, false, repeats, err);
    if (!status) status = decode_best(all, stream, size, true, repeats, err);
    if (!status) last->hash = hashed.hash;
    return status;
}

lathe_status lathe__measure_decoding(lathe__decode_speed *out, const lathe_model *model, int repeats,
                                     lathe_error *err) {
    size_t size;
    const uint8_t *stream = lathe__whole_stream(model, &size);
    lathe_mesh_shading shading = {0};
    lathe_status status = LATHE_OK;
    for (int i = 0; !status && i < repeats; i++) {
        decode_result plain, shaded;
        status = decode_once(&plain, stream, size, false, HASH_NONE, NULL, err);
        if (!status) status = decode_once(&shaded, stream, size, false, HASH_NONE, &shading, err);
        if (status) break;
        out->triangles = plain.last_triangles;
        if (i == 0 || plain.seconds < out->seconds) out->seconds = plain.seconds;
        if (i == 0 || shaded.seconds < out->with_normals) out->with_normals = shaded.seconds;
    }
    lathe__mesh_shading_free(&shading);
    return status;
}

static double per_second(uint64_t triangles, double seconds) { return seconds > 0 ? (double)triangles / seconds : 0; }

static void print_speed(const decode_result *last, const decode_result *all, bool json) {
    if (json) {
        printf("{\"triangles\": %llu, \"vertices\": %llu, \"seconds\": %.6f, \"triangles_per_second\": %.0f, "
               "\"all_levels_triangles\": %llu, \"all_levels_seconds\": %.6f, \"hash\": \"%016llx\"}\n",
               (unsigned long long)last->last_triangles, (unsigned long long)last->vertices, last->seconds,
               per_second(last->last_triangles, last->seconds), (unsigned long long)all->triangles, all->seconds,
               (unsigned long long)last->hash);
        return;
    }
    printf("last level only: %llu triangles in %.3f s CPU: %.2f M triangles/s\n",
           (unsigned long long)last->last_triangles, last->seconds,
           1e-6 * per_second(last->last_triangles, last->seconds));
    printf("every level:     %llu triangles in %.3f s CPU: %.2f M triangles/s\n", (unsigned long long)all->triangles,
           all->seconds, 1e-6 * per_second(all->triangles, all->seconds));
    printf("hash of the last meshes: %016llx\n", (unsigned long long)last->hash);
}

static int run_bench(int argc, char **argv) {
    const lathe_command *command = &lathe__command_bench;
    if (argc > 1 && strcmp(argv[1], "bytes") == 0) return lathe__bench_bytes(argc, argv);
    bool json = false;
    const char *repeat = NULL;
    const lathe_option options[] = {LATHE_OPTION_FLAG("json", &json, true), LATHE_OPTION_TEXT("repeat", 'r', &repeat)};
    int count, status = lathe__parse_options(command, argc, argv, options, 2, &count);
    if (status != LATHE_PARSED) return status;
    if (count != 2 || strcmp(argv[1], "decode") != 0)
        return lathe__usage_error(command, "`decode FILE` or `bytes FILE` is needed");
    int64_t repeats = 5;
    if (repeat && !lathe__option_integer(&repeats, repeat, 1, 1000))
        return lathe__usage_error(command, "--repeat %s: 1 to 1000", repeat);
    lathe_model *model = NULL;
    lathe_error err = {{0}};
    decode_result last, all;
    lathe_status result = lathe_model_open(&model, argv[2], &err);
    if (!result) result = measure(&last, &all, model, (int)repeats, &err);
    lathe_model_close(&model);
    if (result) return lathe__status_error("bench", argv[2], result, &err);
    print_speed(&last, &all, json);
    return LATHE_EXIT_OK;
}

static int run_hash(int argc, char **argv) {
    bool each = false;
    const lathe_option options[] = {LATHE_OPTION_FLAG("each", &each, true)};
    int count, status = lathe__parse_options(&lathe__command_hash, argc, argv, options, 1, &count);
    if (status != LATHE_PARSED) return status;
    if (count != 1) return lathe__usage_error(&lathe__command_hash, "one FILE is needed");
    lathe_model *model = NULL;
    lathe_error err = {{0}};
    decode_result decoded;
    lathe_status result = lathe_model_open(&model, argv[1], &err);
    if (!result) {
        size_t size;
        const uint8_t *stream = lathe__whole_stream(model, &size);
        result = decode_once(&decoded, stream, size, false, each ? HASH_EACH : HASH_ALL, NULL, &err);
    }
    lathe_model_close(&model);
    if (result) return lathe__status_error("hash", argv[1], result, &err);
    if (!each) printf("%016llx\n", (unsigned long long)decoded.hash);
    return LATHE_EXIT_OK;
}

const lathe_command lathe__command_bench = {
    "bench", "measure how fast an archive decodes and what its levels cost",
    "Usage: lathe bench decode FILE [--repeat N] [--json]\n"
    "       lathe bench bytes FILE|VOLUME [bake options] [--repeat N] [--meshes DIR] [-o OUT.lathe] [--json]\n\n"
    "Decodes FILE (.lathe) to meshes, joints included, N times (5), and prints the CPU time of the fastest run: once\n"
    "with only the last level's meshes built, once with those of every level; and the hash of the last meshes.\n\n"
    "bytes: for each level of FILE (.lathe) the bytes of its packets, of what is fetched with them, of the level in\n"
    "Draco, and its two-sided RMS and largest error in voxels. A VOLUME is baked first, and the CPU time of each\n"
    "stage of the bake printed; the options are those of `lathe bake`. --meshes DIR writes each level's mesh there.\n"
    "--json also lists every packet.\n"
    "`make bench-bytes` compares with other coders.\n",
    run_bench};

const lathe_command lathe__command_hash = {
    "hash", NULL,
    "Usage: lathe hash [--each] FILE\n\n"
    "Prints the FNV-1a hash (64 bit) of every structure's last mesh: positions (int32), then triangles (uint32),\n"
    "little-endian. With --each one number for each structure, each begun anew.\n",
    run_hash};
