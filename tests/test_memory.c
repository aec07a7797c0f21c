/* The bounds of docs/FORMAT.md, "Memory": streams and files made to take the most are decoded while every allocation is counted.
 * Each case also takes a good part of its bound: a bound that nothing comes near would not be tested. */
#include <malloc.h>
#include <stdlib.h>
#include <string.h>
#include "archive_write.h"
#include "base_shape.h"
#include "check.h"
#include "raster_surface.h"
#include "structure_state.h"

#if defined(__SANITIZE_ADDRESS__)
#define SANITIZED 1
#elif defined(__has_feature)
#if __has_feature(address_sanitizer)
#define SANITIZED 1
#endif
#endif

/* ---- counting: what is allocated now, and the most there was ---- */

static size_t held, most;
static void count_more(size_t size) {
    held += size;
    if (held > most) most = held;
}
static void count_less(size_t size) { held -= size < held ? size : held; }

#ifdef SANITIZED
int __sanitizer_install_malloc_and_free_hooks(void (*on_malloc)(const volatile void *, size_t), void (*on_free)(const volatile void *));
size_t __sanitizer_get_allocated_size(const volatile void *p);
static void on_malloc(const volatile void *p, size_t size) { (void)p, count_more(size); }
static void on_free(const volatile void *p) { if (p) count_less(__sanitizer_get_allocated_size(p)); }
static void start_counting(void) { CHECK(__sanitizer_install_malloc_and_free_hooks(on_malloc, on_free) > 0); }
#else
void *__libc_malloc(size_t size);
void *__libc_calloc(size_t count, size_t size);
void *__libc_realloc(void *p, size_t size);
void __libc_free(void *p);
void *malloc(size_t size) {
    void *p = __libc_malloc(size);
    count_more(p ? malloc_usable_size(p) : 0);
    return p;
}
void *calloc(size_t count, size_t size) {
    void *p = __libc_calloc(count, size);
    count_more(p ? malloc_usable_size(p) : 0);
    return p;
}
/* As if it always moved: both blocks are there at once. */
void *realloc(void *p, size_t size) {
    size_t before = p ? malloc_usable_size(p) : 0;
    void *q = __libc_realloc(p, size);
    if (q || !size) count_more(q ? malloc_usable_size(q) : 0), count_less(before);
    return q;
}
void free(void *p) {
    if (p) count_less(malloc_usable_size(p));
    __libc_free(p);
}
static void start_counting(void) {}
#endif

/* ---- streams ---- */

/* passes: of a pyramid's second level; 0: no pyramid */
static void emit_header_of(lathe_bytes *out, lathe_header_structure *structures, uint32_t count, uint32_t flags, uint32_t passes) {
    lathe_header header = {.axis = LATHE_AXIS_Z, .affine = {{1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, 0}}, .parameter_count = passes ? 3 : 2,
                           .parameters = {32, flags, passes}, .structure_count = count, .structures = structures};
    const char *fault = "";
    if (lathe__header_check(&header, &fault)) abort();
    lathe__emit_header(out, &header, 0, count);
}

static void emit_header(lathe_bytes *out, lathe_header_structure *structures, uint32_t count, uint32_t flags) {
    emit_header_of(out, structures, count, flags, 0);
}

static void emit_level(lathe_bytes *out, uint32_t level, const lathe_bytes *payload, uint32_t count) {
    uint32_t *sizes = malloc(count * sizeof *sizes);
    if (!sizes) abort();
    for (uint32_t i = 0; i < count; i++) sizes[i] = (uint32_t)payload->size;
    lathe__emit_level_head(out, &(lathe_level_head){.level = level, .error_rms_mm = -1, .error_max_mm = -1, .count = count, .sizes = sizes});
    for (uint32_t i = 0; i < count; i++) {
        size_t start = out->size;
        lathe__emit(out, payload->data, payload->size);
        lathe__emit_checksum(out, start);
    }
    free(sizes);
}

static lathe_header_structure box(int32_t width, int32_t height, int32_t slices, uint8_t levels) {
    return (lathe_header_structure){.level_count = levels, .origin = {-1, -1, 0}, .size = {width, height, slices}};
}

/* A payload that decodes to zeros, about `size` bytes of them: the code stays one below the range. */
static void emit_zeros(lathe_bytes *out, size_t size) {
    out->size = 0;
    for (size_t i = 0; i < size; i++) lathe__emit_u8(out, i == 3 ? 0xFE : 0xFF);
}

/* ---- decoding ---- */

/* Feeds a stream in portions, decodes all there is; what was held at most beyond what was held before. `steps`: packets decoded. */
static size_t peak_of(const lathe_bytes *stream, size_t portion, uint32_t *steps, bool last_mesh) {
    size_t before = most = held;
    lathe_decoder *decoder;
    lathe_step step;
    lathe_status status = LATHE_MORE;
    if (lathe_decoder_open(&decoder)) abort();
    lathe_decoder_build_meshes(decoder, false);
    *steps = 0;
    for (size_t at = 0; at < stream->size && status == LATHE_MORE; at += portion) {
        size_t n = stream->size - at < portion ? stream->size - at : portion;
        if (lathe_decoder_feed(decoder, stream->data + at, n)) abort();
        while (!(status = lathe_decoder_step(decoder, &step))) ++*steps;
    }
    if (!CHECK_EQ(status, LATHE_MORE)) fprintf(stderr, "%s\n", lathe_decoder_error(decoder));
    if (last_mesh) CHECK(lathe_decoder_mesh(decoder, 0) != NULL);
    lathe_decoder_close(&decoder);
    CHECK(held == before);
    return most - before;
}

/* At most the bound, and at least the given part of it. */
static void check_bound(const char *what, size_t peak, size_t bound, double part) {
    printf("%-24s %10zu of %10zu bytes\n", what, peak, bound);
    if (!CHECK(peak <= bound) || !CHECK((double)peak >= part * (double)bound)) fprintf(stderr, "%s\n", what);
}

/* For the bytes that wait, and while their buffer grows. */
static size_t waiting(size_t size) { return size * 5 / 2 + 1024; }

static void many_structures(void) {
    enum { COUNT = LATHE_MAX_STRUCTURES };
    lathe_header_structure *list = malloc(COUNT * sizeof *list);
    lathe_bytes stream = {0}, nothing = {0};
    uint32_t steps;
    if (!list) abort();
    for (uint32_t i = 0; i < COUNT; i++) list[i] = box(3, 3, 1, 1);
    emit_header(&stream, list, COUNT, LATHE_FLAG_EXACT);
    check_bound("header", peak_of(&stream, stream.size, &steps, false), 100 * stream.size + waiting(stream.size), 0.5);
    size_t header = stream.size;
    emit_level(&stream, 0, &nothing, COUNT);
    stream.size = header + COUNT + 20;   /* the head only */
    check_bound("level record's head", peak_of(&stream, 4096, &steps, false), 100 * header + 4 * (size_t)COUNT + waiting(stream.size), 0.5);
    CHECK_EQ(steps, 0);
    free(list);
    lathe__bytes_free(&stream);
}

/* All of a large packet but its last byte is there. */
static void waiting_packet(void) {
    lathe_header_structure one = box(3, 3, 1, 1);
    lathe_bytes stream = {0}, payload = {0};
    uint32_t steps;
    for (int i = 0; i < 3000000; i++) lathe__emit_u8(&payload, (uint8_t)i);
    emit_header(&stream, &one, 1, LATHE_FLAG_EXACT);
    emit_level(&stream, 0, &payload, 1);
    stream.size--;
    check_bound("waiting for a packet", peak_of(&stream, 1000, &steps, false), waiting(stream.size), 0.5);
    CHECK_EQ(steps, 0);
    lathe__bytes_free(&stream);
    lathe__bytes_free(&payload);
}

/* 64 stars of 8 rays in every slice, each bit the likely one. */
static void cheap_stars(void) {
    enum { SLICES = LATHE_MAX_DIM };
    static lathe_star_slice slices[SLICES];
    static lathe_star stars[LATHE_BASE_MAX_LOOPS];
    static uint16_t radii[LATHE_BASE_MAX_LOOPS][8];
    lathe_header_structure one = box(40, 40, SLICES, 1);
    lathe_mask frame = {.size = {40, 40, SLICES}};
    for (int i = 0; i < LATHE_BASE_MAX_LOOPS; i++) {
        stars[i] = (lathe_star){.centre = {20, 20}, .rays = 8, .parent = 0, .radius = radii[i]};
        for (int k = 0; k < 8; k++) radii[i][k] = 16;
    }
    lathe_range_encoder e;
    lathe_number_model early, models[LATHE_BASE_MODELS];
    lathe_bytes stream = {0}, payload = {0};
    uint32_t steps;
    lathe__encoder_start(&e);
    lathe__number_start(&early, 1, LATHE_EARLY_START);
    lathe__base_models(models);
    for (int i = 0; i < SLICES; i++) lathe__put_number(&e, &early, 0);
    slices[0] = (lathe_star_slice){LATHE_BASE_MAX_LOOPS, stars};
    static lathe_star next[LATHE_BASE_MAX_LOOPS];
    for (int i = 0; i < LATHE_BASE_MAX_LOOPS; i++) next[i] = stars[i], next[i].parent = (uint8_t)(i + 1);
    for (int i = 1; i < SLICES; i++) slices[i] = (lathe_star_slice){LATHE_BASE_MAX_LOOPS, next};
    if (lathe__base_encode(&e, slices, SLICES, &frame, models)) abort();
    lathe__encoder_finish(&e);
    lathe__emit(&payload, e.bytes, e.size);
    lathe__encoder_free(&e);
    emit_header(&stream, &one, 1, LATHE_FLAG_EXACT);
    emit_level(&stream, 0, &payload, 1);
    size_t plan = SLICES * (1 + sizeof(int32_t) + sizeof(lathe_star_slice));
    check_bound("stars", peak_of(&stream, stream.size, &steps, false), 4400 * payload.size + (8 << 10) + plan + waiting(stream.size) + 1024, 0.4);
    CHECK_EQ(steps, 1);
    lathe__bytes_free(&stream);
    lathe__bytes_free(&payload);
}

/* One small packet each: 4 KiB for each structure. */
static void many_stars(void) {
    enum { COUNT = 2000 };
    static lathe_header_structure list[COUNT];
    lathe_bytes stream = {0}, payload = {0};
    uint32_t steps;
    for (uint32_t i = 0; i < COUNT; i++) list[i] = box(9, 9, 1, 1);
    emit_zeros(&payload, 8);   /* one star like the first guess */
    emit_header(&stream, list, COUNT, LATHE_FLAG_EXACT);
    emit_level(&stream, 0, &payload, COUNT);
    check_bound("many base shapes", peak_of(&stream, stream.size, &steps, false), COUNT * ((4 << 10) + 600) + waiting(stream.size), 0.9);
    CHECK_EQ(steps, COUNT);
    lathe__bytes_free(&stream);
    lathe__bytes_free(&payload);
}

static int32_t put(void *coder, lathe_number_model *model, int32_t number) {
    lathe__put_number(coder, model, number);
    return number;
}

/* The largest map there can be, whose radii are all as predicted, and its mesh. */
static void largest_radius_map(void) {
    enum { SLICES = LATHE_MAX_DIM, RAYS = LATHE_RADIUS_MAX_RAYS, LEVELS = 3 };
    lathe_header_structure one = box(80, 80, SLICES, LEVELS);
    lathe_arena arena = {0};
    lathe_radius_tube tube = {.map = {.slices = SLICES, .level_count = LEVELS, .rays = RAYS, .step = 16, .fall = 6, .apex = {4, 4}}};
    lathe_radii truth = {.slices = SLICES, .width = 80, .height = 80, .level_count = LEVELS, .simple = true, .count = 1, .tubes = &tube}, coded = truth;
    if (lathe__radius_map_start(&tube.map, &arena)) abort();
    for (int32_t w = 0; w < SLICES; w++) tube.map.centre[w][0] = tube.map.centre[w][1] = 80;
    for (size_t i = 0; i < (size_t)SLICES * RAYS; i++) tube.map.radius[i] = 1024;
    lathe_bytes stream = {0}, payload[LEVELS] = {{0}};
    emit_header(&stream, &one, 1, 0);
    for (uint32_t level = 0; level < LEVELS; level++) {
        lathe_range_encoder e;
        lathe__encoder_start(&e);
        if (!level) lathe__encode_bit(&e, LATHE_RADIUS_CHANCE, 1);
        if (lathe__radii_code(&coded, &truth, &arena, level, put, &e)) abort();
        lathe__encoder_finish(&e);
        lathe__emit(&payload[level], e.bytes, e.size);
        lathe__encoder_free(&e);
        emit_level(&stream, level, &payload[level], 1);
        lathe__bytes_free(&payload[level]);
    }
    lathe__arena_free(&arena);
    uint32_t steps;
    size_t samples = (size_t)SLICES * RAYS, map = 5 * samples + 8 * SLICES + (72 << 10);
    check_bound("radius map", peak_of(&stream, stream.size, &steps, false), map + waiting(stream.size), 0.8);
    CHECK_EQ(steps, LEVELS);
    check_bound("radius map's mesh", peak_of(&stream, stream.size, &steps, true), map + 36 * samples + waiting(stream.size) + 1024, 0.8);
    lathe__bytes_free(&stream);
}

/* Large boxes: nothing of them before the slices come, then the box, its estimates and the models. */
static void empty_slices(void) {
    lathe_header_structure large = box(4098, 4098, 500, 3), one = box(1026, 1024, 128, 2);
    lathe_bytes stream = {0}, payload = {0};
    uint32_t steps;
    emit_zeros(&payload, 512);   /* a star in each slice */
    emit_header(&stream, &large, 1, LATHE_FLAG_EXACT);
    emit_level(&stream, 0, &payload, 1);
    check_bound("a box not yet there", peak_of(&stream, stream.size, &steps, false), 48 << 10, 0.3);
    CHECK_EQ(steps, 1);
    lathe__bytes_free(&stream);
    emit_header(&stream, &one, 1, LATHE_FLAG_EXACT);
    emit_level(&stream, 0, &payload, 1);
    emit_zeros(&payload, 20000);   /* and no pixel */
    emit_level(&stream, 1, &payload, 1);
    /* Every second slice of a level 0 with two levels has an estimate. */
    size_t slice = 17 * 8 * 1024, shown = 65, models = (4 << 20) + 2 * ((512 << 10) + (32 << 10)) + (400 << 10);
    check_bound("slices", peak_of(&stream, stream.size, &steps, false), (128 + shown) * slice + models + waiting(stream.size), 0.6);
    CHECK_EQ(steps, 2);
    lathe__bytes_free(&stream);
    lathe__bytes_free(&payload);
}

/* Three rows of pixels: the planes across u have a word for each of their rows, which have three samples. */
static void padded_planes(void) {
    lathe_header_structure one = box(1026, 3, 1024, 2);
    lathe_bytes stream = {0}, payload = {0};
    uint32_t steps;
    emit_header_of(&stream, &one, 1, LATHE_FLAG_PYRAMID, 1);
    emit_zeros(&payload, 4000);
    emit_level(&stream, 0, &payload, 1);
    emit_level(&stream, 1, &payload, 1);
    size_t before = 9 * 8 * 3 * 1024, behind = 17 * 8 * 3 * 1024, planes = (size_t)8 * 1026 * 1026, models = 3 * ((512 << 10) + (32 << 10)) + (400 << 10);
    check_bound("planes", peak_of(&stream, stream.size, &steps, false), before + behind + planes + models + waiting(stream.size), 0.6);
    CHECK_EQ(steps, 2);
    lathe__bytes_free(&stream);
    lathe__bytes_free(&payload);
}

/* The surface of a checkerboard: a vertex on every edge between samples, triangles in every cube. */
static void cubes(void) {
    lathe_mask mask;
    if (lathe__mask_new(&mask, (int32_t[]){194, 194, 48}, (int32_t[]){-1, -1, 0})) abort();
    for (int32_t w = 0; w < 48; w++)
        for (int32_t v = 1; v < 193; v++)
            for (int32_t u = 1; u < 193; u++)
                if ((u + v + w) & 1)
                    lathe__mask_slice(&mask, w)[(size_t)v * (size_t)mask.row_words + (size_t)(u >> 6)] |= (uint64_t)1 << (u & 63);
    lathe_arena scratch = {0};
    lathe_mesh mesh;
    size_t before = most = held;
    CHECK_EQ(lathe__raster_surface(&mesh, &scratch, &mask, (const int[]){32, 32}), LATHE_OK);
    CHECK(mesh.vertex_count > 5000000);
    /* Growing, an array is there twice, the new one half as large again. */
    size_t bound = (size_t)20 * 194 * 194 + ((size_t)mesh.vertex_count + mesh.triangle_count) * 12 * 5 / 2 + (64 << 10);
    check_bound("cubes", most - before, bound, 0.4);
    lathe_mesh_free(&mesh);
    lathe__arena_free(&scratch);
    lathe__mask_free(&mask);
}

/* ---- whole files ---- */

static int append(void *context, const void *bytes, size_t size) {
    lathe__emit(context, bytes, size);
    return 0;
}

/* As many structures as there can be, with names as short as they can be. */
static void largest_archive(void) {
    enum { COUNT = LATHE_MAX_STRUCTURES };
    lathe_header_structure *list = malloc(COUNT * sizeof *list);
    lathe_packet *packets = calloc(COUNT, sizeof *packets);
    const lathe_level_info **levels = malloc(COUNT * sizeof *levels);
    static const lathe_level_info level = {.rays = 1, .slices = 1, .error_rms_mm = -1, .error_max_mm = -1, .components = 1};
    lathe_header header = {.axis = LATHE_AXIS_Z, .affine = {{1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, 0}}, .structure_count = COUNT, .structures = list};
    lathe_bytes file = {0};
    lathe_archive_writer *writer;
    lathe_error err = {""};
    if (!list || !packets || !levels) abort();
    for (uint32_t i = 0; i < COUNT; i++) {
        list[i] = box(3, 3, 1, 1);
        snprintf(list[i].name, sizeof list[i].name, "%05x", i);
        levels[i] = &level;
    }
    if (lathe__archive_begin(&writer, &header, append, &file, &err) || lathe__archive_level(writer, -1, -1, packets, COUNT) ||
        lathe__archive_finish(writer, &(lathe_archive_stats){.iso = 0, .levels = &level, .structures = levels})) abort();
    lathe__archive_close(&writer);
    free(list), free(packets), free(levels);
    size_t before = most = held, footer_end = file.size - LATHE_TRAILER_SIZE;
    lathe_reader trailer = lathe__reader(file.data + footer_end, LATHE_TRAILER_SIZE), reader;
    size_t footer = (size_t)lathe__read_u64(&trailer);
    reader = lathe__reader(file.data, footer);
    if (lathe__header_parse(&header, &reader)) abort();
    size_t header_bytes = (size_t)(reader.at - file.data);
    lathe__header_free(&header);
    lathe_model *model;
    CHECK(!lathe_model_parse(&model, file.data, file.size, &err));
    lathe_model_close(&model);
    CHECK(held == before);
    check_bound("archive", most - before, 24 * header_bytes + (4 + 16) * (size_t)COUNT + 5 * (footer_end - footer) + 8192, 0.6);
    lathe__bytes_free(&file);
}

int main(void) {
    start_counting();
    many_structures();
    waiting_packet();
    cheap_stars();
    many_stars();
    largest_radius_map();
    empty_slices();
    padded_planes();
    cubes();
    largest_archive();
    return check_end();
}
