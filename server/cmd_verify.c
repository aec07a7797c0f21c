/* lathe verify: every level of every structure is a surface without flaws, and the last one has the topology of its
 * voxels. */
#include "cli.h"
#include "mask.h"
#include "mesh.h"
#include "rebake.h"
#include <inttypes.h>
#include <jansson.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

typedef struct level_result {
    bool seen;
    bool topology;                 /* must be that of the voxels: the last level, and every level of an archive that
                                    * keeps it */
    lathe_mesh_report report;
    uint64_t float_duplicates;
    bool counts_match;             /* vertices and triangles are those of the index */
    uint64_t hash;                 /* of the mesh */
    bool encoded_differs;          /* from the mesh that a second bake of the volume gives */
} level_result;

typedef struct structure_result {
    level_result *levels;
    bool compared;                 /* with the voxels */
    int64_t expected_components, expected_euler;
} structure_result;

typedef struct verification {
    const lathe_model_info *info;
    const lathe_model *model;
    structure_result *structures;
    uint64_t failures;
    bool intersections;            /* --no-intersections skips the only slow check */
    bool rebake;                   /* --no-rebake: the archive is of another version of Lathe */
} verification;

/* ---- what must hold ---- */

static uint64_t edge_flaws(const lathe_mesh_report *r) {
    return r->boundary_edges + r->nonmanifold_edges + r->misoriented_edges;
}

static uint64_t shape_flaws(const level_result *level) {
    const lathe_mesh_report *r = &level->report;
    return r->nonmanifold_vertices + r->degenerate_triangles + r->duplicate_positions + r->unused_vertices +
           r->bad_indices + level->float_duplicates;
}

static bool topology_matches(const structure_result *structure, const level_result *level) {
    return (int64_t)level->report.components == structure->expected_components &&
           level->report.euler == structure->expected_euler;
}

static bool level_passes(const structure_result *structure, const level_result *level) {
    if (!level->seen || !level->counts_match || level->encoded_differs) return false;
    if (edge_flaws(&level->report) || shape_flaws(level)) return false;
    if (level->topology && structure->compared && !topology_matches(structure, level)) return false;
    return !level->report.self_intersections;
}

/* ---- gathering ---- */

static void release(verification *v) {
    for (uint32_t i = 0; v->structures && i < v->info->structure_count; i++) free(v->structures[i].levels);
    free(v->structures);
    v->structures = NULL;
}

static lathe_status prepare(verification *v) {
    uint32_t count = v->info->structure_count;
    v->structures = calloc(count ? count : 1, sizeof *v->structures);
    if (!v->structures) return LATHE_ERR_MEMORY;
    for (uint32_t i = 0; i < count; i++) {
        uint32_t levels = v->info->structures[i].level_count;
        v->structures[i].levels = calloc(levels ? levels : 1, sizeof(level_result));
        if (!v->structures[i].levels) return LATHE_ERR_MEMORY;
        for (uint32_t n = 0; n < levels; n++)
            v->structures[i].levels[n].topology = v->info->keep_topology || n + 1 == levels;
    }
    return LATHE_OK;
}

static lathe_status check_step(verification *v, lathe_decoder *decoder, const lathe_step *step, lathe_error *err) {
    if (step->structure >= v->info->structure_count || step->level >= v->info->structures[step->structure].level_count)
        return lathe_fail(err, LATHE_ERR_FORMAT, "the stream has structure %u at level %u, the index has not",
                          step->structure, step->level);
    const lathe_mesh *mesh = lathe_decoder_mesh(decoder, step->structure);
    if (!mesh) return lathe_fail(err, LATHE_ERR_FORMAT, "%s", lathe_decoder_error(decoder));
    level_result *level = &v->structures[step->structure].levels[step->level];
    const lathe_level_info *stated = &v->info->structures[step->structure].levels[step->level];
    lathe_status status = lathe__mesh_check(&level->report, mesh, v->intersections);
    if (!status)
        status = lathe__mesh_float_duplicates(&level->float_duplicates, mesh,
                                              lathe_decoder_transform(decoder, step->structure));
    if (status)
        return lathe_fail(err, status, "structure %u, level %u: %s", step->structure, step->level,
                          lathe_status_name(status));
    level->counts_match = mesh->vertex_count == stated->vertices && mesh->triangle_count == stated->triangles;
    level->hash = lathe__hash_mesh(LATHE_FNV_START, mesh);
    level->seen = true;
    return LATHE_OK;
}

static lathe_status check_levels(verification *v, lathe_error *err) {
    size_t size, done = 0;
    const uint8_t *stream = lathe__whole_stream(v->model, &size);
    uint64_t total = 0;
    for (uint32_t i = 0; i < v->info->structure_count; i++) total += v->info->structures[i].level_count;
    lathe_decoder *decoder = NULL;
    lathe_status status = lathe_decoder_open(&decoder);
    if (status) return status;
    lathe_progress progress;
    lathe__progress_begin(&progress, "verify", false);
    status = lathe_decoder_feed(decoder, stream, size);
    while (!status) {
        lathe_step step;
        status = lathe_decoder_step(decoder, &step);
        if (status < 0) lathe_fail(err, status, "%s", lathe_decoder_error(decoder));
        if (status) break;
        status = check_step(v, decoder, &step, err);
        if (lathe__progress_step(&progress, "levels", (double)++done / (double)(total ? total : 1)))
            status = lathe_fail(err, LATHE_ERR_IO, "interrupted");
    }
    lathe__progress_end(&progress);
    lathe_decoder_close(&decoder);
    return status == LATHE_MORE ? LATHE_OK : status;
}

/* ---- the voxels ---- */

typedef struct voxel_source {
    const lathe_volume *volume;
    lathe_label_box *boxes;        /* ascending labels; NULL for a threshold */
    size_t box_count;
} voxel_source;

static const lathe_label_box *find_box(const voxel_source *source, int64_t label) {
    for (size_t i = 0; i < source->box_count; i++)
        if (source->boxes[i].label == label) return &source->boxes[i];
    return NULL;
}

static lathe_status region_of(lathe_mask *mask, const voxel_source *source, const lathe_model_info *info, int64_t label,
                              lathe_error *err) {
    if (label < 0) return lathe__region_threshold(mask, source->volume, info->axis, info->iso, err);
    const lathe_label_box *box = find_box(source, label);
    if (!box) return LATHE_ERR_EMPTY;
    return lathe__region_label_box(mask, source->volume, info->axis, box, err);
}

/* A structure that the volume has not is expected to have no component, so that it fails. */
static lathe_status compare_structure(structure_result *structure, const lathe_structure_info *info,
                                      const verification *v, const voxel_source *source, lathe_error *err) {
    lathe_mask mask;
    memset(&mask, 0, sizeof mask);
    lathe_status status = region_of(&mask, source, v->info, info->label, err);
    structure->compared = !status || status == LATHE_ERR_EMPTY;
    if (status) return status == LATHE_ERR_EMPTY ? LATHE_OK : status;
    lathe_topology topology;
    status = lathe__mask_topology(&topology, &mask, NULL);
    lathe__mask_free(&mask);
    if (status) return lathe_fail(err, status, "%s", lathe_status_name(status));
    structure->expected_components = topology.components + topology.cavities;
    structure->expected_euler = 2 * topology.euler;
    return LATHE_OK;
}

static lathe_status compare_with_volume(verification *v, const lathe_volume *volume, lathe_error *err) {
    voxel_source source = {.volume = volume};
    lathe_status status = LATHE_OK;
    if (isnan(v->info->iso)) status = lathe__region_labels(&source.boxes, &source.box_count, volume, err);
    for (uint32_t i = 0; !status && i < v->info->structure_count; i++)
        status = compare_structure(&v->structures[i], &v->info->structures[i], v, &source, err);
    free(source.boxes);
    return status;
}

/* ---- what was encoded ---- */

static lathe_status compare_step(verification *v, lathe_decoder *decoder, const lathe_step *step) {
    const lathe_mesh *mesh = lathe_decoder_mesh(decoder, step->structure);
    if (!mesh || step->structure >= v->info->structure_count) return LATHE_ERR_FORMAT;
    if (step->level >= v->info->structures[step->structure].level_count) return LATHE_ERR_FORMAT;
    level_result *level = &v->structures[step->structure].levels[step->level];
    level->encoded_differs = lathe__hash_mesh(LATHE_FNV_START, mesh) != level->hash;
    return LATHE_OK;
}

static lathe_status compare_meshes(verification *v, const lathe_model *encoded) {
    size_t size;
    const uint8_t *stream = lathe__whole_stream(encoded, &size);
    lathe_decoder *decoder = NULL;
    lathe_status status = lathe_decoder_open(&decoder);
    if (status) return status;
    status = lathe_decoder_feed(decoder, stream, size);
    while (!status) {
        lathe_step step;
        status = lathe_decoder_step(decoder, &step);
        if (!status) status = compare_step(v, decoder, &step);
    }
    lathe_decoder_close(&decoder);
    return status == LATHE_MORE ? LATHE_OK : status;
}

static void expect_nothing(verification *v) {
    for (uint32_t i = 0; i < v->info->structure_count; i++)
        for (uint32_t n = 0; n < v->info->structures[i].level_count; n++)
            v->structures[i].levels[n].encoded_differs = true;
}

/* A volume that cannot be baked so is another one: every level differs. Levels that the second bake has not, differ
 * too. */
static lathe_status compare_with_encoded(verification *v, const lathe_volume *volume, lathe_error *err) {
    expect_nothing(v);
    lathe_rebaked bytes = {NULL, 0, 0};
    lathe_status status = lathe__rebake(&bytes, v->info, volume, err);
    if (status) return status == LATHE_ERR_MEMORY ? status : LATHE_OK;
    lathe_model *encoded = NULL;
    status = lathe_model_parse(&encoded, bytes.bytes, bytes.size, err);
    if (!status && compare_meshes(v, encoded)) expect_nothing(v);
    lathe_model_close(&encoded);
    free(bytes.bytes);
    return status;
}

static void count_failures(verification *v) {
    for (uint32_t i = 0; i < v->info->structure_count; i++)
        for (uint32_t n = 0; n < v->info->structures[i].level_count; n++)
            if (!level_passes(&v->structures[i], &v->structures[i].levels[n])) v->failures++;
}

/* ---- saying it ---- */

typedef struct level_sum {
    uint64_t structures, passed, edges, shapes, intersections, mismatches, components, triangles;
    int64_t euler;
} level_sum;

static level_sum sum_level(const verification *v, uint32_t n) {
    level_sum sum;
    memset(&sum, 0, sizeof sum);
    for (uint32_t i = 0; i < v->info->structure_count; i++) {
        if (n >= v->info->structures[i].level_count) continue;
        const structure_result *s = &v->structures[i];
        const level_result *level = &s->levels[n];
        sum.structures++;
        sum.passed += level_passes(s, level);
        sum.edges += edge_flaws(&level->report);
        sum.shapes += shape_flaws(level);
        sum.intersections += level->report.self_intersections;
        sum.mismatches += !level->seen || !level->counts_match || level->encoded_differs ||
                          (level->topology && s->compared && !topology_matches(s, level));
        sum.components += level->report.components;
        sum.euler += level->report.euler;
        sum.triangles += v->info->structures[i].levels[n].triangles;
    }
    return sum;
}

static void print_flaw(const verification *v, uint32_t i, uint32_t n) {
    const structure_result *s = &v->structures[i];
    const level_result *level = &s->levels[n];
    const lathe_mesh_report *r = &level->report;
    char name[128];
    printf("FAILED  %s, level %u:", lathe__printable(name, sizeof name, v->info->structures[i].name), n);
    if (!level->seen) { puts(" not in the stream"); return; }
    if (!level->counts_match) printf(" vertices or triangles are not those of the index;");
    if (level->encoded_differs) printf(" not the mesh that the volume gives;");
    if (edge_flaws(r))
        printf(" %" PRIu64 " open, %" PRIu64 " non-manifold, %" PRIu64 " misoriented edges;", r->boundary_edges,
               r->nonmanifold_edges, r->misoriented_edges);
    if (shape_flaws(level))
        printf(" %" PRIu64 " non-manifold vertices, %" PRIu64 " degenerate triangles, %" PRIu64 " (float32: %" PRIu64
               ") duplicate positions, %" PRIu64 " unused vertices, %" PRIu64 " bad indices;",
               r->nonmanifold_vertices, r->degenerate_triangles, r->duplicate_positions, level->float_duplicates,
               r->unused_vertices, r->bad_indices);
    if (r->self_intersections) printf(" %" PRIu64 " self-intersections;", r->self_intersections);
    if (level->topology && s->compared && !topology_matches(s, level))
        printf(" %" PRIu64 " components and Euler characteristic %" PRId64 ", the voxels have %" PRId64 " and %" PRId64
               ";",
               r->components, r->euler, s->expected_components, s->expected_euler);
    putchar('\n');
}

static void print_table(const verification *v, bool with_volume) {
    printf("%5s %10s %10s %10s %10s %10s %14s %10s %8s\n", "level", "structures", "triangles", "edge flaws", "other",
           "mismatches", "intersections", "components", "euler");
    for (uint32_t n = 0; n < v->info->level_count; n++) {
        level_sum s = sum_level(v, n);
        printf("%5u %6" PRIu64 "/%-3" PRIu64 " %10" PRIu64 " %10" PRIu64 " %10" PRIu64 " %10" PRIu64 " ", n, s.passed,
               s.structures, s.triangles, s.edges, s.shapes, s.mismatches);
        if (v->intersections) printf("%14" PRIu64, s.intersections);
        else printf("%14s", "not counted");
        printf(" %10" PRIu64 " %8" PRId64 "\n", s.components, s.euler);
    }
    for (uint32_t i = 0; i < v->info->structure_count; i++)
        for (uint32_t n = 0; n < v->info->structures[i].level_count; n++)
            if (!level_passes(&v->structures[i], &v->structures[i].levels[n])) print_flaw(v, i, n);
    printf("checksums right; %s; %s\n",
           !with_volume             ? "no volume to compare with"
           : v->info->keep_topology ? "topology of every level compared with the voxels"
                                    : "topology of each last level compared with the voxels",
           v->failures ? "FAILED" : "passed");
}

static json_t *json_level_result(const structure_result *s, const level_result *level, uint32_t n) {
    const lathe_mesh_report *r = &level->report;
    return json_pack(
        "{s:I, s:b, s:I, s:I, s:I, s:I, s:I, s:I, s:I, s:I, s:I}", "level", (json_int_t)n, "passed",
        level_passes(s, level), "open_edges", (json_int_t)r->boundary_edges, "nonmanifold_edges",
        (json_int_t)r->nonmanifold_edges, "misoriented_edges", (json_int_t)r->misoriented_edges, "nonmanifold_vertices",
        (json_int_t)r->nonmanifold_vertices, "degenerate_triangles", (json_int_t)r->degenerate_triangles,
        "duplicate_positions", (json_int_t)(r->duplicate_positions + level->float_duplicates), "self_intersections",
        (json_int_t)r->self_intersections, "components", (json_int_t)r->components, "euler", (json_int_t)r->euler);
}

static json_t *json_structure_result(const verification *v, uint32_t i) {
    const structure_result *s = &v->structures[i];
    json_t *levels = json_array(), *name = json_string(v->info->structures[i].name);
    for (uint32_t n = 0; n < v->info->structures[i].level_count; n++)
        json_array_append_new(levels, json_level_result(s, &s->levels[n], n));
    json_t *object = json_pack("{s:o, s:o}", "name", name ? name : json_string("?"), "levels", levels);
    if (object && s->compared)
        json_object_set_new(object, "voxels",
                            json_pack("{s:I, s:I}", "components", (json_int_t)s->expected_components, "euler",
                                      (json_int_t)s->expected_euler));
    return object;
}

static void print_json(const verification *v) {
    json_t *structures = json_array();
    for (uint32_t i = 0; i < v->info->structure_count; i++)
        json_array_append_new(structures, json_structure_result(v, i));
    json_t *root = json_pack("{s:b, s:b, s:o}", "passed", v->failures == 0, "self_intersections_counted",
                             v->intersections, "structures", structures);
    json_dumpf(root, stdout, JSON_INDENT(1));
    putchar('\n');
    json_decref(root);
}

/* ---- the command ---- */

static int verify_model(verification *v, const char *path, const char *volume_path, bool json) {
    lathe_error err = {{0}};
    lathe_status status = lathe_model_check(v->model, &err);
    if (!status) status = prepare(v);
    if (!status) status = check_levels(v, &err);
    if (status) return lathe__status_error("verify", path, status, &err);
    if (volume_path) {
        lathe_volume *volume = NULL;
        status = lathe_volume_open(&volume, volume_path, &err);
        if (!status) status = compare_with_volume(v, volume, &err);
        if (!status && v->rebake) status = compare_with_encoded(v, volume, &err);
        lathe_volume_close(&volume);
        if (status) return lathe__status_error("verify", volume_path, status, &err);
    }
    count_failures(v);
    if (json) print_json(v);
    else print_table(v, volume_path != NULL);
    return v->failures ? LATHE_EXIT_INPUT : LATHE_EXIT_OK;
}

static int run(int argc, char **argv) {
    bool json = false, intersections = true, rebake = true;
    const lathe_option options[] = {LATHE_OPTION_FLAG("json", &json, true),
                                    LATHE_OPTION_FLAG("no-intersections", &intersections, false),
                                    LATHE_OPTION_FLAG("no-rebake", &rebake, false)};
    int count, status = lathe__parse_options(&lathe__command_verify, argc, argv, options, 3, &count);
    if (status != LATHE_PARSED) return status;
    if (count < 1 || count > 2) return lathe__usage_error(&lathe__command_verify, "FILE and perhaps VOLUME are needed");
    lathe_model *model = NULL;
    lathe_error err = {{0}};
    lathe_status opened = lathe_model_open(&model, argv[1], &err);
    if (opened) return lathe__status_error("verify", argv[1], opened, &err);
    verification v = {
        .info = lathe_model_describe(model), .model = model, .intersections = intersections, .rebake = rebake};
    status = verify_model(&v, argv[1], count == 2 ? argv[2] : NULL, json);
    release(&v);
    lathe_model_close(&model);
    return status;
}

const lathe_command lathe__command_verify = {
    "verify", "check every level of an archive",
    "Usage: lathe verify [--json] [--no-intersections] [--no-rebake] FILE [VOLUME]\n\n"
    "Checks the checksums of FILE (.lathe), decodes it, and checks every level of every structure: closed,\n"
    "2-manifold, oriented, no degenerate triangle, no two vertices at one position, no two triangles that intersect,\n"
    "vertices and triangles as the index says. With the VOLUME it was baked from: components and Euler\n"
    "characteristic of the last level (with --topology keep: of every level) are those of the voxels, which are\n"
    "counted independently; and the meshes are those that the volume gives when it is baked again.\n"
    "Exit status 1 when a check fails.\n\n"
    "  --json               every level of every structure\n"
    "  --no-intersections   do not count self-intersections (the only slow check)\n"
    "  --no-rebake          do not bake VOLUME again (for archives of another version of Lathe)\n",
    run};
