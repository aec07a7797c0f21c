/* lathe bench: how fast an archive decodes. lathe hash: one number for the last meshes, to compare platforms. */
#include "bench.h"
#include <math.h>
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

/* ---- with what a renderer needs besides ---- */

/* Where a renderer wants it; kept from mesh to mesh, and from run to run. */
typedef struct dress {
    float *positions, *normals;    /* 3 a vertex: mm; of length 1 */
    uint32_t *indices;
    struct vertex_sum *sums;
    size_t vertices, triangles;    /* room for so many */
} dress;

typedef float four __attribute__((vector_size(16)));
typedef struct vertex_sum { four at, normal; } vertex_sum;   /* the fourth is 0 */

static void free_dress(dress *d) {
    free(d->positions);
    free(d->normals);
    free(d->indices);
    free(d->sums);
    *d = (dress){0};
}

static lathe_status make_room(dress *d, const lathe_mesh *mesh) {
    if (mesh->vertex_count <= d->vertices && mesh->triangle_count <= d->triangles && d->sums) return LATHE_OK;
    size_t vertices = d->vertices > mesh->vertex_count ? d->vertices : (size_t)mesh->vertex_count + 1;
    size_t triangles = d->triangles > mesh->triangle_count ? d->triangles : (size_t)mesh->triangle_count + 1;
    free_dress(d);
    d->positions = malloc(vertices * 12);
    d->normals = malloc(vertices * 12);
    d->indices = malloc(triangles * 12);
    d->sums = aligned_alloc(32, vertices * sizeof *d->sums);
    if (!d->positions || !d->normals || !d->indices || !d->sums) return LATHE_ERR_MEMORY;
    d->vertices = vertices;
    d->triangles = triangles;
    return LATHE_OK;
}

/* Indices, and of each vertex the sum of its triangles' normals, by area. */
static void add_normals(vertex_sum *sums, uint32_t *indices, const lathe_mesh *mesh, bool mirrored) {
    int second = 1 + mirrored, third = 2 - mirrored;
    for (uint32_t i = 0; i < mesh->triangle_count; i++, indices += 3) {
        const uint32_t *t = mesh->triangles[i];
        indices[0] = t[0], indices[1] = t[second], indices[2] = t[third];
        vertex_sum *a = &sums[indices[0]], *b = &sums[indices[1]], *c = &sums[indices[2]];
        four p = b->at - a->at, q = c->at - a->at;
        four n = {p[1] * q[2] - p[2] * q[1], p[2] * q[0] - p[0] * q[2], p[0] * q[1] - p[1] * q[0], 0};
        a->normal += n;
        b->normal += n;
        c->normal += n;
    }
}

static void make_unit(float *normals, const vertex_sum *sums, uint32_t vertex_count) {
    for (uint32_t i = 0; i < vertex_count; i++, normals += 3) {
        four n = sums[i].normal, square = n * n;
        float length = sqrtf(square[0] + square[1] + square[2]), scale = length > 0 ? 1 / length : 0;
        for (int k = 0; k < 3; k++) normals[k] = n[k] * scale;
    }
}

static lathe_status dress_mesh(dress *d, const lathe_mesh *mesh, const lathe_transform *transform) {
    lathe_status status = make_room(d, mesh);
    if (status) return status;
    lathe_mesh_positions(mesh, transform, d->positions);
    for (uint32_t i = 0; i < mesh->vertex_count; i++) {
        const float *p = d->positions + 3 * (size_t)i;
        d->sums[i] = (vertex_sum){.at = {p[0], p[1], p[2], 0}};
    }
    add_normals(d->sums, d->indices, mesh, lathe_transform_mirrors(transform));
    make_unit(d->normals, d->sums, mesh->vertex_count);
    return LATHE_OK;
}

/* What to do with the last meshes, once they are built. */
typedef enum hashing { HASH_NONE, HASH_ALL, HASH_EACH } hashing;

/* clothes: of positions in mm, indices and normals, or NULL: only the meshes */
static lathe_status last_meshes(lathe_decoder *decoder, hashing hash, dress *clothes, decode_result *result) {
    uint32_t count = lathe_decoder_structures(decoder);
    result->hash = LATHE_FNV_START;
    for (uint32_t i = 0; i < count; i++) {
        const lathe_mesh *mesh = lathe_decoder_mesh(decoder, i);
        if (!mesh) return LATHE_ERR_FORMAT;
        result->last_triangles += mesh->triangle_count;
        result->vertices += mesh->vertex_count;
        if (hash == HASH_ALL) result->hash = lathe__hash_mesh(result->hash, mesh);
        if (clothes && dress_mesh(clothes, mesh, lathe_decoder_transform(decoder, i))) return LATHE_ERR_MEMORY;
        if (hash == HASH_EACH) printf("%016llx\n", (unsigned long long)lathe__hash_mesh(LATHE_FNV_START, mesh));
    }
    return LATHE_OK;
}

static lathe_status decode_once(decode_result *out, const uint8_t *stream, size_t size, bool all_levels, hashing hash,
                                dress *clothes, lathe_error *err) {
    decode_result result;
    memset(&result, 0, sizeof result);
    double start = lathe__cpu_seconds();
    lathe_decoder *decoder = NULL;
    lathe_status status = lathe_decoder_open(&decoder);
    if (status) return status;
    lathe_decoder_build_meshes(decoder, all_levels);
    status = lathe_decoder_feed(decoder, stream, size);
    if (!status) status = step_through(decoder, all_levels, &result);
    if (!status) status = last_meshes(decoder, hash, clothes, &result);
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
    dress clothes = {0};
    lathe_status status = LATHE_OK;
    for (int i = 0; !status && i < repeats; i++) {
        decode_result plain, dressed;
        status = decode_once(&plain, stream, size, false, HASH_NONE, NULL, err);
        if (!status) status = decode_once(&dressed, stream, size, false, HASH_NONE, &clothes, err);
        if (status) break;
        out->triangles = plain.last_triangles;
        if (i == 0 || plain.seconds < out->seconds) out->seconds = plain.seconds;
        if (i == 0 || dressed.seconds < out->with_normals) out->with_normals = dressed.seconds;
    }
    free_dress(&clothes);
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
