/* lathe info: what is in an archive, for people and for programs. */
#include "cli.h"
#include <jansson.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

/* Names are UTF-8 by format; of a damaged archive only the ASCII part is kept. */
static json_t *json_name(const char *name) {
    json_t *value = json_string(name);
    if (value) return value;
    char ascii[256];
    lathe__printable(ascii, sizeof ascii, name);
    for (char *c = ascii; *c; c++)
        if ((unsigned char)*c >= 0x80) *c = '?';
    return json_string(ascii);
}

static json_t *json_error(float mm) { return mm >= 0 && isfinite(mm) ? json_real((double)mm) : json_null(); }

static json_t *json_level(const lathe_level_info *level, uint32_t index) {
    return json_pack("{s:I, s:I, s:I, s:I, s:I, s:I, s:I, s:o, s:o, s:I, s:I, s:f}", "level", (json_int_t)index, "rays",
                     (json_int_t)level->rays, "slices", (json_int_t)level->slices, "vertices",
                     (json_int_t)level->vertices, "triangles", (json_int_t)level->triangles, "polar_bytes",
                     (json_int_t)level->polar_bytes, "draco_bytes", (json_int_t)level->draco_bytes, "error_max_mm",
                     json_error(level->error_max_mm), "error_rms_mm", json_error(level->error_rms_mm), "components",
                     (json_int_t)level->components, "components_waiting", (json_int_t)level->components_waiting,
                     "waiting_mm3", level->waiting_mm3);
}

static json_t *json_levels(const lathe_level_info *levels, uint32_t count) {
    json_t *list = json_array();
    for (uint32_t i = 0; list && i < count; i++) json_array_append_new(list, json_level(&levels[i], i));
    return list;
}

static json_t *json_structures(const lathe_model_info *info) {
    json_t *list = json_array();
    for (uint32_t i = 0; list && i < info->structure_count; i++) {
        const lathe_structure_info *s = &info->structures[i];
        json_array_append_new(list, json_pack("{s:o, s:o}", "name", json_name(s->name), "levels",
                                              json_levels(s->levels, s->level_count)));
    }
    return list;
}

static const char *decoder_name(const lathe_model *model) {
    static const char *const names[] = {[LATHE_DECODER_WHOLE] = "whole", [LATHE_DECODER_RASTERS] = "rasters", [LATHE_DECODER_TUBES] = "tubes"};
    return names[lathe_model_decoder(model)];
}

int lathe__print_info_json(const lathe_model *model) {
    const lathe_model_info *info = lathe_model_describe(model);
    json_t *root = json_pack("{s:o, s:o, s:s, s:s, s:o}", "structures", json_structures(info), "name", json_name(info->name),
                             "topology", info->keep_topology ? "keep" : "own", "decoder", decoder_name(model), "levels",
                             json_levels(info->levels, info->level_count));
    if (!root) return lathe__input_error("info: out of memory");
    json_dumpf(root, stdout, JSON_INDENT(1) | JSON_REAL_PRECISION(9));
    putchar('\n');
    json_decref(root);
    return LATHE_EXIT_OK;
}

static void print_error_mm(float mm) {
    if (mm >= 0) printf(" %9.4f", (double)mm);
    else printf(" %9s", "-");
}

static void print_level(uint32_t index, const lathe_level_info *level) {
    printf("  %5u %6u %7u %9u %10u %11llu", index, level->rays, level->slices, level->vertices, level->triangles,
           (unsigned long long)level->polar_bytes);
    if (level->draco_bytes) printf(" %11llu", (unsigned long long)level->draco_bytes);
    else printf(" %11s", "-");
    print_error_mm(level->error_rms_mm);
    print_error_mm(level->error_max_mm);
    char shown[32];
    snprintf(shown, sizeof shown, "%u/%u", level->components, level->components + level->components_waiting);
    printf(" %11s %10.4g\n", shown, level->waiting_mm3);
}

static void print_table(const char *name, const lathe_level_info *levels, uint32_t count) {
    printf("\n%s\n  %5s %6s %7s %9s %10s %11s %11s %9s %9s %11s %10s\n", name, "level", "rays", "slices", "vertices",
           "triangles", "polar bytes", "draco bytes", "rms mm", "max mm", "components", "waits mm3");
    for (uint32_t i = 0; i < count; i++) print_level(i, &levels[i]);
}

static void print_info(const lathe_model *model) {
    static const char axes[] = "xyz";
    const lathe_model_info *info = lathe_model_describe(model);
    size_t size;
    lathe_model_bytes(model, &size);
    char name[256];
    printf("%s: %u structure%s, %u levels, %zu bytes; slices across %c, boundary %s",
           lathe__printable(name, sizeof name, info->name), info->structure_count,
           info->structure_count == 1 ? "" : "s", info->level_count, size,
           (unsigned)info->axis < 3 ? axes[info->axis] : '?', info->boundary == LATHE_BOUNDARY_ISO ? "iso" : "edge");
    if (!isnan(info->iso)) printf(", iso %g", info->iso);
    printf(", topology %s", info->keep_topology ? "of the last level" : "of each level's own");
    printf("; decoder: %s\n", decoder_name(model));
    if (info->structure_count != 1) print_table("all structures", info->levels, info->level_count);
    for (uint32_t i = 0; i < info->structure_count; i++) {
        const lathe_structure_info *s = &info->structures[i];
        print_table(lathe__printable(name, sizeof name, s->name), s->levels, s->level_count);
    }
}

static int run(int argc, char **argv) {
    bool json = false;
    const lathe_option options[] = {LATHE_OPTION_FLAG("json", &json, true)};
    int count, status = lathe__parse_options(&lathe__command_info, argc, argv, options, 1, &count);
    if (status != LATHE_PARSED) return status;
    if (count != 1) return lathe__usage_error(&lathe__command_info, "one FILE is needed");
    lathe_model *model = NULL;
    lathe_error err = {{0}};
    lathe_status opened = lathe_model_open(&model, argv[1], &err);
    if (opened) return lathe__status_error("info", argv[1], opened, &err);
    if (json) status = lathe__print_info_json(model);
    else {
        print_info(model);
        status = LATHE_EXIT_OK;
    }
    lathe_model_close(&model);
    return status;
}

const lathe_command lathe__command_info = {
    "info", "print the structures and levels of an archive",
    "Usage: lathe info [--json] FILE\n\n"
    "Prints what each level of each structure of FILE (.lathe) has: rays, slices, vertices, triangles, the bytes\n"
    "a client fetches for it, the bytes of the whole level in Draco, its error against the isosurface, how\n"
    "many of the region's components it shows and the volume of those that wait for a later level.\n\n"
    "  --json   as {\"structures\": [{\"name\", \"levels\": [{\"level\", \"rays\", \"slices\", ...}]}]};\n"
    "           an error that was not measured is null\n",
    run};
