/* lathe bench bytes: what each level of an archive costs, and the error it leaves. */
#include "archive_format.h"
#include "bench.h"
#include <errno.h>
#include <jansson.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

/* ---- the stages of a bake ---- */

enum { MOST_STAGES = 8 };
typedef struct stage_clock {
    struct { char name[40]; double seconds; } stages[MOST_STAGES];
    int count;
    double last;
} stage_clock;

static void add_stage(stage_clock *clock, const char *name) {
    double now = lathe__cpu_seconds();
    int i = 0;
    while (i < clock->count && strcmp(clock->stages[i].name, name) != 0) i++;
    if (i < MOST_STAGES) {
        if (i == clock->count) snprintf(clock->stages[clock->count++].name, sizeof clock->stages[0].name, "%s", name);
        clock->stages[i].seconds += now - clock->last;
    }
    clock->last = now;
}

/* A bake tells the name of a stage when a part of it is done. */
static int stage_done(void *context, const char *stage, double fraction) {
    (void)fraction;
    add_stage(context, stage);
    return lathe__interrupted();
}

static int bake_timed(stage_clock *clock, lathe_bake_arguments *a, const char *path) {
    a->output = path;
    a->quiet = true;
    a->draco = false;
    a->progress = stage_done;
    a->progress_context = clock;
    clock->last = lathe__cpu_seconds();
    int status = lathe__bake_input(&lathe__command_bench, a);
    add_stage(clock, "writing");
    return status;
}

/* ---- what a level costs ---- */

typedef struct level_row {
    const lathe_level_info *info;
    uint64_t payload, fetched;     /* bytes of packets alone; with header, record head and checksums */
    uint64_t draco, draco_delta;   /* of the whole level; from the level before */
    bool delta_failed;
    uint32_t packets;
} level_row;

typedef struct bytes_report {
    const lathe_model_info *info;
    double voxel;                  /* mm: the smallest spacing */
    uint32_t level_count;
    level_row levels[LATHE_MAX_LEVELS];
    json_t *passes;                /* NULL, or [[level, pass, payload, bytes of the stream up to its end], ...] */
} bytes_report;

static double smallest_spacing(const double affine[3][4]) {
    double least = INFINITY;
    for (int k = 0; k < 3; k++) {
        double length = sqrt(affine[0][k] * affine[0][k] + affine[1][k] * affine[1][k] + affine[2][k] * affine[2][k]);
        if (length < least) least = length;
    }
    return least;
}

static void list_pass(bytes_report *report, uint32_t level, uint32_t pass, uint64_t payload, uint64_t end) {
    if (!report->passes) return;
    json_array_append_new(report->passes, json_pack("[I, I, I, I]", (json_int_t)level, (json_int_t)pass,
                                                    (json_int_t)payload, (json_int_t)end));
}

/* Where a client may stop with all structures alike: behind each pass of a pyramid's level, else behind the level. */
static uint32_t packets_of_pass(const lathe_header *header, uint32_t level) {
    uint32_t flags = lathe__header_flags(header);
    if (flags & LATHE_FLAG_PYRAMID && flags & LATHE_FLAG_SHARED) return 1;
    return lathe__header_present(header, level);
}

static lathe_status walk_packets(bytes_report *report, lathe_reader *reader, const lathe_header *header,
                                 const uint8_t *start) {
    for (uint32_t level = 0; level < header->level_count; level++) {
        lathe_level_head head;
        lathe_status status = lathe__level_parse(&head, reader, header);
        if (status) return status;
        uint32_t each = packets_of_pass(header, level);
        uint64_t payload = 0;
        for (uint32_t packet = 0; !status && packet < head.count; packet++) {
            if (!lathe__packet_parse(reader, head.sizes[packet])) status = reader->status;
            report->levels[level].payload += head.sizes[packet];
            payload += head.sizes[packet];
            if ((packet + 1) % each) continue;
            list_pass(report, level, packet / each, payload, (uint64_t)(reader->at - start));
            payload = 0;
        }
        report->levels[level].packets = head.count;
        lathe__level_head_free(&head);
        if (status) return status;
    }
    return LATHE_OK;
}

static lathe_status count_packets(bytes_report *report, const lathe_model *model, lathe_error *err) {
    size_t size;
    const uint8_t *stream = lathe__whole_stream(model, &size);
    lathe_reader reader = lathe__reader(stream, size);
    lathe_header header;
    lathe_status status = lathe__header_parse(&header, &reader);
    if (!status) {
        report->voxel = smallest_spacing(header.affine);
        status = walk_packets(report, &reader, &header, stream);
        lathe__header_free(&header);
    }
    return status ? lathe_fail(err, status, "%s", reader.fault) : LATHE_OK;
}

static int count_sink(void *context, const void *bytes, size_t size) {
    (void)bytes;
    *(uint64_t *)context += size;
    return 0;
}

/* ---- the mesh behind each pass, as `--meshes FOLDER` wants them ---- */

typedef struct whole_mesh { float (*positions)[3]; uint32_t (*indices)[3]; uint32_t counts[2]; } whole_mesh;

/* All structures as they stand. */
static lathe_status gather(whole_mesh *out, lathe_decoder *decoder) {
    for (uint32_t s = 0; s < lathe_decoder_structures(decoder); s++) {
        const lathe_mesh *mesh = lathe_decoder_mesh(decoder, s);
        if (!mesh) return LATHE_ERR_FORMAT;
        float(*positions)[3] =
            realloc(out->positions, ((size_t)out->counts[0] + mesh->vertex_count + 1) * sizeof *positions);
        if (positions) out->positions = positions;
        uint32_t(*indices)[3] =
            realloc(out->indices, ((size_t)out->counts[1] + mesh->triangle_count + 1) * sizeof *indices);
        if (indices) out->indices = indices;
        if (!positions || !indices) return LATHE_ERR_MEMORY;
        const lathe_transform *transform = lathe_decoder_transform(decoder, s);
        lathe_mesh_positions(mesh, transform, &positions[out->counts[0]][0]);
        lathe_mesh_indices(mesh, transform, &indices[out->counts[1]][0]);
        for (uint32_t i = 0; i < mesh->triangle_count; i++)
            for (int k = 0; k < 3; k++) indices[out->counts[1] + i][k] += out->counts[0];
        out->counts[0] += mesh->vertex_count;
        out->counts[1] += mesh->triangle_count;
    }
    return LATHE_OK;
}

static bool dump_mesh(const whole_mesh *mesh, const char *folder, uint32_t level, uint32_t pass) {
    char path[4096];
    if ((size_t)snprintf(path, sizeof path, "%s/level%u.pass%u.mesh", folder, level, pass) >= sizeof path) return false;
    FILE *file = fopen(path, "wb");
    if (!file) return false;
    bool good = fwrite(mesh->counts, sizeof mesh->counts, 1, file) == 1 &&
                fwrite(mesh->positions, 12, mesh->counts[0], file) == mesh->counts[0] &&
                fwrite(mesh->indices, 12, mesh->counts[1], file) == mesh->counts[1];
    return fclose(file) == 0 && good;
}

static lathe_status dump_passes(const lathe_model *model, const char *folder, lathe_error *err) {
    size_t size;
    const uint8_t *stream = lathe__whole_stream(model, &size);
    lathe_decoder *decoder;
    lathe_step step;
    uint32_t level = UINT32_MAX, pass = 0;
    lathe_status status = lathe_decoder_open(&decoder);
    if (status) return lathe_fail(err, status, "out of memory");
    lathe_decoder_build_meshes(decoder, false);
    lathe_decoder_every_pass(decoder, true);
    status = lathe_decoder_feed(decoder, stream, size);
    while (!status && !(status = lathe_decoder_step(decoder, &step))) {
        bool last = true;
        for (uint32_t s = step.structure + 1; s < lathe_decoder_structures(decoder); s++)
            if (lathe_model_describe(model)->structures[s].level_count > step.level) last = false;
        if (!last) continue;
        pass = step.level == level ? pass + 1 : 0;
        level = step.level;
        whole_mesh mesh = {NULL, NULL, {0, 0}};
        status = gather(&mesh, decoder);
        if (!status && !dump_mesh(&mesh, folder, level, pass)) {
            lathe_fail(err, LATHE_ERR_IO, "%s/level%u.pass%u.mesh: %s", folder, level, pass, strerror(errno));
            status = LATHE_ERR_IO;
        }
        free(mesh.positions);
        free(mesh.indices);
    }
    lathe_decoder_close(&decoder);
    return status == LATHE_MORE ? LATHE_OK : status;
}

static lathe_status measure_level(bytes_report *report, const lathe_model *model, uint32_t level, lathe_error *err) {
    level_row *row = &report->levels[level];
    lathe_world_mesh mesh;
    memset(&mesh, 0, sizeof mesh);
    row->info = &report->info->levels[level];
    row->fetched = lathe_model_stream_size(model, -1, level, level);
    lathe_status status = lathe_model_mesh(&mesh, model, -1, level, err);
    if (status) return status;
    status = lathe_write_drc(&mesh, 0, count_sink, &row->draco);
    lathe_world_mesh_free(&mesh);
    /* A model without Draco deltas still has all the other figures. */
    if (!status && lathe_write_draco_delta(model, -1, level, count_sink, &row->draco_delta, err)) {
        fprintf(stderr, "lathe: bench: level %u: its Draco delta: %s\n", level, err->text);
        row->delta_failed = true;
    }
    return status;
}

static lathe_status measure(bytes_report *report, const lathe_model *model, const char *folder, lathe_error *err) {
    report->info = lathe_model_describe(model);
    report->level_count = report->info->level_count;
    lathe_status status = count_packets(report, model, err);
    for (uint32_t level = 0; !status && level < report->level_count; level++)
        status = measure_level(report, model, level, err);
    return status || !folder ? status : dump_passes(model, folder, err);
}

/* ---- printing ---- */

static int64_t new_vertices(const bytes_report *report, uint32_t level) {
    return (int64_t)report->levels[level].info->vertices -
           (level ? (int64_t)report->levels[level - 1].info->vertices : 0);
}

/* Bits of packets for each vertex that the level before had not; negative: there is none. */
static double bits_each(const bytes_report *report, uint32_t level) {
    int64_t more = new_vertices(report, level);
    return more > 0 ? 8 * (double)report->levels[level].payload / (double)more : -1;
}

static void number_or_dash(char out[16], double value, const char *format) {
    if (value < 0) strcpy(out, "-");
    else snprintf(out, 16, format, value);
}

static void print_text(const bytes_report *report, const stage_clock *clock, const lathe__decode_speed *speed) {
    printf("%5s %9s %9s %9s %11s %11s %9s %9s %8s %8s\n", "level", "polar B", "+headers", "stream B", "Draco delta",
           "Draco whole", "triangles", "bit/new v", "RMS", "max");
    uint64_t stream = 0;
    for (uint32_t i = 0; i < report->level_count; i++) {
        const level_row *row = &report->levels[i];
        char bits[16], rms[16], most[16], delta[16];
        number_or_dash(bits, bits_each(report, i), "%.3f");
        number_or_dash(rms, (double)row->info->error_rms_mm / report->voxel, "%.3f");
        number_or_dash(most, (double)row->info->error_max_mm / report->voxel, "%.3f");
        number_or_dash(delta, row->delta_failed ? -1 : (double)row->draco_delta, "%.0f");
        stream += row->fetched;
        printf("%5u %9llu %9llu %9llu %11s %11llu %9u %9s %8s %8s\n", i, (unsigned long long)row->payload,
               (unsigned long long)(row->fetched - row->payload), (unsigned long long)stream, delta,
               (unsigned long long)row->draco, row->info->triangles, bits, rms, most);
    }
    printf(
        "errors: two-sided, the worse direction, in voxels of %g mm, against the trilinear isosurface, as the bake "
           "measured them\n",
        report->voxel);
    printf("decode with normals: %.2f M triangles/s, without: %.2f\n",
           1e-6 * (double)speed->triangles / speed->with_normals, 1e-6 * (double)speed->triangles / speed->seconds);
    for (int i = 0; i < clock->count; i++)
        printf("%s%s %.3f s", i ? ", " : "bake, CPU: ", clock->stages[i].name, clock->stages[i].seconds);
    if (clock->count) putchar('\n');
}

static json_t *error_or_null(float mm, double voxel) { return mm >= 0 ? json_real((double)mm / voxel) : json_null(); }

static json_t *json_row(const bytes_report *report, uint32_t i) {
    const level_row *row = &report->levels[i];
    double bits = bits_each(report, i);
    return json_pack("{s:I, s:I, s:I, s:I, s:I, s:o, s:I, s:I, s:I, s:o, s:o, s:o}", "level", (json_int_t)i, "packets",
                     (json_int_t)row->packets, "payload", (json_int_t)row->payload, "fetched", (json_int_t)row->fetched,
                     "draco", (json_int_t)row->draco, "draco_delta",
                     row->delta_failed ? json_null() : json_integer((json_int_t)row->draco_delta), "vertices",
                     (json_int_t)row->info->vertices, "new_vertices", (json_int_t)new_vertices(report, i), "triangles",
                     (json_int_t)row->info->triangles, "bits_per_new_vertex", bits < 0 ? json_null() : json_real(bits),
                     "rms", error_or_null(row->info->error_rms_mm, report->voxel), "max",
                     error_or_null(row->info->error_max_mm, report->voxel));
}

static int print_json(const bytes_report *report, const stage_clock *clock, const lathe__decode_speed *speed) {
    json_t *levels = json_array(), *stages = json_object();
    for (uint32_t i = 0; i < report->level_count; i++) json_array_append_new(levels, json_row(report, i));
    for (int i = 0; i < clock->count; i++)
        json_object_set_new(stages, clock->stages[i].name, json_real(clock->stages[i].seconds));
    json_t *decode = json_pack("{s:I, s:f, s:f}", "triangles", (json_int_t)speed->triangles, "seconds", speed->seconds,
                               "seconds_with_normals", speed->with_normals);
    json_t *all = json_pack("{s:f, s:o, s:O, s:o, s:o}", "voxel_mm", report->voxel, "levels", levels, "passes",
                            report->passes, "decode", decode, "bake_cpu_seconds", stages);
    int failed = all ? json_dumpf(all, stdout, JSON_COMPACT | JSON_REAL_PRECISION(9)) : -1;
    if (!failed) putchar('\n');
    json_decref(all);
    return failed ? lathe__input_error("bench: out of memory") : LATHE_EXIT_OK;
}

/* ---- the command ---- */

static int report_archive(const char *path, const stage_clock *clock, bool json, const char *folder, int repeats) {
    lathe_model *model = NULL;
    lathe_error err = {{0}};
    bytes_report report;
    lathe__decode_speed speed;
    memset(&report, 0, sizeof report);
    report.passes = json ? json_array() : NULL;
    lathe_status status = lathe_model_open(&model, path, &err);
    if (!status) status = measure(&report, model, folder, &err);
    if (!status) status = lathe__measure_decoding(&speed, model, repeats, &err);
    int result = LATHE_EXIT_OK;
    if (status) result = lathe__status_error("bench", path, status, &err);
    else if (json) result = print_json(&report, clock, &speed);
    else print_text(&report, clock, &speed);
    json_decref(report.passes);
    lathe_model_close(&model);
    return result;
}

/* The archive of a volume lives in a temporary file, which is gone when this returns; or where --output says. */
static int bake_and_report(lathe_bake_arguments *a, bool json, const char *folder, int repeats) {
    const char *temporary = getenv("TMPDIR");
    char place[4096];
    if ((size_t)snprintf(place, sizeof place, "%s/lathe-bench-XXXXXX", temporary ? temporary : "/tmp") >= sizeof place)
        return lathe__input_error("bench: TMPDIR is too long");
    if (!mkdtemp(place)) return lathe__input_error("bench: %s: %s", place, strerror(errno));
    char path[sizeof place + 16];
    snprintf(path, sizeof path, "%s/bench.lathe", place);
    const char *output = a->output ? a->output : path;
    stage_clock clock;
    memset(&clock, 0, sizeof clock);
    int status = bake_timed(&clock, a, output);
    if (status == LATHE_EXIT_OK) status = report_archive(output, &clock, json, folder, repeats);
    unlink(path);
    rmdir(place);
    return status;
}

int lathe__bench_bytes(int argc, char **argv) {
    const lathe_command *command = &lathe__command_bench;
    lathe_bake_arguments a;
    lathe__bake_arguments_defaults(&a);
    bool json = false;
    const char *folder = NULL, *repeat = NULL;
    const lathe_option options[] = {
        LATHE_OPTION_TEXT("output", 'o', &a.output),
        LATHE_OPTION_TEXT("iso", 0, &a.iso),
        LATHE_OPTION_TEXT("label", 0, &a.label),
        LATHE_OPTION_TEXT("labels", 0, &a.labels),
        LATHE_OPTION_TEXT("axis", 0, &a.axis),
        LATHE_OPTION_TEXT("boundary", 0, &a.boundary),
        LATHE_OPTION_TEXT("topology", 0, &a.topology),
        LATHE_OPTION_TEXT("spacing", 0, &a.spacing),
        LATHE_OPTION_FLAG("no-errors", &a.errors, false),
        LATHE_OPTION_FLAG("exact", &a.exact, true),
        LATHE_OPTION_FLAG("independent", &a.independent, true),
        LATHE_OPTION_TEXT("levels", 0, &a.levels),
        LATHE_OPTION_TEXT("meshes", 0, &folder),
        LATHE_OPTION_TEXT("repeat", 'r', &repeat),
        LATHE_OPTION_FLAG("json", &json, true),
    };
    int count, status = lathe__parse_options(command, argc, argv, options, sizeof options / sizeof *options, &count);
    if (status != LATHE_PARSED) return status;
    if (count != 2) return lathe__usage_error(command, "`bytes FILE` is needed");
    int64_t repeats = 5;
    if (repeat && !lathe__option_integer(&repeats, repeat, 1, 10000))
        return lathe__usage_error(command, "--repeat %s: 1 to 10000", repeat);
    a.input = argv[2];
    if (lathe__is_volume_path(a.input)) return bake_and_report(&a, json, folder, (int)repeats);
    stage_clock none;
    memset(&none, 0, sizeof none);
    return report_archive(a.input, &none, json, folder, (int)repeats);
}
