/* lathe bake: a volume becomes an archive. */
#include "cli.h"
#include "label_table.h"
#include "mask.h"
#include <stdlib.h>
#include <string.h>
#include <strings.h>

/* ---- names of files ---- */

static const char *volume_suffix(const char *path) {
    static const char *const suffixes[] = {".nii.gz", ".nii", ".json"};
    size_t length = strlen(path);
    for (size_t i = 0; i < sizeof suffixes / sizeof *suffixes; i++) {
        size_t n = strlen(suffixes[i]);
        if (length > n && strcasecmp(path + length - n, suffixes[i]) == 0) return path + length - n;
    }
    return NULL;
}

bool lathe__is_volume_path(const char *path) { return volume_suffix(path) != NULL; }

void lathe__volume_stem(char *out, size_t size, const char *path) {
    const char *slash = strrchr(path, '/'), *start = slash ? slash + 1 : path, *end = volume_suffix(start);
    size_t length = end ? (size_t)(end - start) : strlen(start);
    if (length >= size) length = size - 1;
    memcpy(out, start, length);
    out[length] = 0;
}

/* ---- which structures ---- */

typedef struct label_choice {
    lathe_bake_structure *structures;
    size_t count, capacity;
} label_choice;

static bool chosen_already(const label_choice *choice, int64_t label) {
    for (size_t i = 0; i < choice->count; i++)
        if (choice->structures[i].label == label) return true;
    return false;
}

static lathe_status add_label(label_choice *choice, const lathe_label_table *table, int64_t label) {
    if (choice->count == choice->capacity) {
        size_t capacity = choice->capacity ? 2 * choice->capacity : 128;
        lathe_bake_structure *more = realloc(choice->structures, capacity * sizeof *more);
        if (!more) return LATHE_ERR_MEMORY;
        choice->structures = more;
        choice->capacity = capacity;
    }
    lathe_label known;
    lathe_label_table_find(table, label, &known);
    lathe_bake_structure *s = &choice->structures[choice->count++];
    memset(s, 0, sizeof *s);
    s->label = label;
    snprintf(s->name, sizeof s->name, "%s", known.name);
    memcpy(s->rgb, known.rgb, sizeof s->rgb);
    return LATHE_OK;
}

static lathe_status add_all_labels(label_choice *choice, const lathe_label_table *table, const lathe_volume *volume,
                                   lathe_error *err) {
    lathe_label_box *boxes = NULL;
    size_t count = 0;
    lathe_status status = lathe__region_labels(&boxes, &count, volume, err);
    for (size_t i = 0; !status && i < count; i++) status = add_label(choice, table, boxes[i].label);
    free(boxes);
    return status;
}

/* "all", or numbers with commas between. The text was checked before. */
static lathe_status choose_labels(label_choice *choice, const lathe_bake_arguments *arguments,
                                  const lathe_volume *volume, lathe_error *err) {
    lathe_label_table *table = NULL;
    lathe_status status = lathe_label_table_open(&table, arguments->input, err);
    if (status) return status;
    const char *list = arguments->labels ? arguments->labels : arguments->label;
    if (strcmp(list, "all") == 0) status = add_all_labels(choice, table, volume, err);
    else
        for (const char *at = list; !status && *at;) {
            char *end;
            int64_t label = strtoll(at, &end, 10);
            if (!chosen_already(choice, label)) status = add_label(choice, table, label);
            at = *end == ',' ? end + 1 : end;
        }
    lathe_label_table_close(&table);
    return status;
}

/* ---- the arguments ---- */

void lathe__bake_arguments_defaults(lathe_bake_arguments *arguments) {
    memset(arguments, 0, sizeof *arguments);
    arguments->errors = arguments->draco = true;
}

static bool label_list_valid(const char *list) {
    if (strcmp(list, "all") == 0) return true;
    char number[24];
    int64_t label;
    for (;;) {
        size_t length = strcspn(list, ",");
        if (length == 0 || length >= sizeof number) return false;
        memcpy(number, list, length);
        number[length] = 0;
        if (!lathe__option_integer(&label, number, -(1 << 24), 1 << 24)) return false;
        if (!list[length]) return true;
        list += length + 1;
    }
}

/* What --axis, --boundary and --topology say; axis -1: auto. */
typedef struct bake_settings {
    int axis, boundary;
    double iso;
    bool iso_given, labels, keep;
    uint32_t levels;
} bake_settings;

static int parse_settings(bake_settings *out, const lathe_command *command, const lathe_bake_arguments *a) {
    static const char *const axes[] = {"x", "y", "z"};
    bake_settings s = {
        .axis = -1, .boundary = -1, .iso = 0, .iso_given = a->iso != NULL, .labels = a->label || a->labels};
    if ((a->iso != NULL) + (a->label != NULL) + (a->labels != NULL) > 1)
        return lathe__usage_error(command, "only one of --iso, --label and --labels");
    if (a->iso && !lathe__option_number(&s.iso, a->iso))
        return lathe__usage_error(command, "--iso %s: a number is needed", a->iso);
    int64_t label;
    if (a->label && !lathe__option_integer(&label, a->label, -(1 << 24), 1 << 24))
        return lathe__usage_error(command, "--label %s: a whole number is needed", a->label);
    if (a->labels && !label_list_valid(a->labels))
        return lathe__usage_error(command, "--labels %s: `all`, or whole numbers with commas between", a->labels);
    if (a->axis && strcmp(a->axis, "auto") != 0) {
        for (int i = 0; i < 3; i++)
            if (strcmp(a->axis, axes[i]) == 0) s.axis = i;
        if (s.axis < 0) return lathe__usage_error(command, "--axis %s: it is one of x, y, z, auto", a->axis);
    }
    if (a->boundary) {
        if (strcmp(a->boundary, "edge") == 0) s.boundary = LATHE_BOUNDARY_EDGE;
        else if (strcmp(a->boundary, "iso") == 0) s.boundary = LATHE_BOUNDARY_ISO;
        else return lathe__usage_error(command, "--boundary %s: it is one of edge, iso", a->boundary);
    }
    int64_t levels = 0;
    if (a->levels && !lathe__option_integer(&levels, a->levels, 1, LATHE_MAX_LEVELS))
        return lathe__usage_error(command, "--levels %s: 1 to %d", a->levels, LATHE_MAX_LEVELS);
    s.levels = (uint32_t)levels;
    s.keep = a->topology && strcmp(a->topology, "keep") == 0;
    if (a->topology && !s.keep && strcmp(a->topology, "own") != 0)
        return lathe__usage_error(command, "--topology %s: it is one of own, keep", a->topology);
    if (s.keep && s.levels) return lathe__usage_error(command, "--levels: not with --topology keep");
    *out = s;
    return LATHE_PARSED;
}

/* ---- baking ---- */

static int bake_volume(const lathe_volume *volume, const bake_settings *settings, const lathe_bake_arguments *a,
                       const label_choice *choice) {
    char stem[128];
    lathe__volume_stem(stem, sizeof stem, a->input);
    lathe_bake_options options;
    lathe_bake_defaults(&options);
    options.axis = settings->axis < 0 ? lathe__axis_auto(volume) : (lathe_axis)settings->axis;
    options.boundary = settings->boundary;
    options.iso = settings->iso;
    options.keep_topology = settings->keep;
    options.exact = a->exact;
    options.independent = a->independent;
    options.levels = settings->levels;
    options.structures = choice->structures;
    options.structure_count = choice->count;
    options.name = a->name ? a->name : stem;
    options.measure = a->errors;
    options.draco = a->draco;
    lathe_progress progress;
    options.progress = a->progress ? a->progress : lathe__progress_step;
    options.progress_context = a->progress ? a->progress_context : &progress;
    lathe_error err = {{0}};
    lathe__progress_begin(&progress, options.name, a->quiet);
    lathe_status status = lathe_bake_file(volume, &options, a->output, &err);
    lathe__progress_end(&progress);
    if (status && lathe__interrupted()) return lathe__input_error("bake: interrupted: %s was not written", a->output);
    return status ? lathe__status_error("bake", a->input, status, &err) : LATHE_EXIT_OK;
}

static int bake_settled(bake_settings *settings, const lathe_bake_arguments *a, const lathe_volume *volume) {
    label_choice choice = {0};
    if (settings->labels) {
        lathe_error err = {{0}};
        lathe_status status = choose_labels(&choice, a, volume, &err);
        if (status) {
            free(choice.structures);
            return lathe__status_error("bake", a->input, status, &err);
        }
    } else if (!settings->iso_given) {
        settings->iso = lathe_volume_otsu(volume);
        if (!a->quiet)
            fprintf(stderr, "lathe: threshold %g chosen by Otsu's method (--iso sets another)\n", settings->iso);
    }
    int result = bake_volume(volume, settings, a, &choice);
    free(choice.structures);
    return result;
}

int lathe__bake_input(const lathe_command *command, const lathe_bake_arguments *a) {
    bake_settings settings = {0};
    int status = parse_settings(&settings, command, a);
    if (status != LATHE_PARSED) return status;
    lathe_volume *volume = NULL;
    lathe_error err = {{0}};
    lathe_status opened = lathe__open_bake_input(&volume, a, &err);
    if (opened) return lathe__status_error("bake", a->input, opened, &err);
    status = bake_settled(&settings, a, volume);
    lathe_volume_close(&volume);
    return status;
}

static int print_result(const lathe_bake_arguments *a, bool json) {
    lathe_model *model = NULL;
    lathe_error err = {{0}};
    lathe_status status = lathe_model_open(&model, a->output, &err);
    if (status) return lathe__status_error("bake", a->output, status, &err);
    int result = LATHE_EXIT_OK;
    if (json) result = lathe__print_info_json(model);
    else if (!a->quiet) {
        const lathe_model_info *info = lathe_model_describe(model);
        size_t size;
        lathe_model_bytes(model, &size);
        printf("%s: %u structure%s, %u levels, %zu bytes\n", a->output, info->structure_count,
               info->structure_count == 1 ? "" : "s", info->level_count, size);
    }
    lathe_model_close(&model);
    return result;
}

static int run(int argc, char **argv) {
    lathe_bake_arguments a;
    lathe__bake_arguments_defaults(&a);
    bool json = false;
    const lathe_option options[] = {
        LATHE_OPTION_TEXT("output", 'o', &a.output),   LATHE_OPTION_TEXT("iso", 0, &a.iso),
        LATHE_OPTION_TEXT("label", 0, &a.label),       LATHE_OPTION_TEXT("labels", 0, &a.labels),
        LATHE_OPTION_TEXT("axis", 0, &a.axis),         LATHE_OPTION_TEXT("boundary", 0, &a.boundary),
        LATHE_OPTION_TEXT("topology", 0, &a.topology), LATHE_OPTION_TEXT("spacing", 0, &a.spacing),
        LATHE_OPTION_TEXT("levels", 0, &a.levels),
        LATHE_OPTION_TEXT("name", 0, &a.name),         LATHE_OPTION_FLAG("no-errors", &a.errors, false),
        LATHE_OPTION_FLAG("draco", &a.draco, true),    LATHE_OPTION_FLAG("no-draco", &a.draco, false),
        LATHE_OPTION_FLAG("exact", &a.exact, true),    LATHE_OPTION_FLAG("independent", &a.independent, true),
        LATHE_OPTION_FLAG("quiet", &a.quiet, true),    LATHE_OPTION_FLAG("json", &json, true),
    };
    int count, status = lathe__parse_options(&lathe__command_bake, argc, argv, options,
                                             sizeof options / sizeof *options, &count);
    if (status != LATHE_PARSED) return status;
    if (count != 1) return lathe__usage_error(&lathe__command_bake, "one INPUT is needed");
    a.input = argv[1];
    char stem[128], output[sizeof stem + 8];
    if (!a.output) {
        lathe__volume_stem(stem, sizeof stem, a.input);
        snprintf(output, sizeof output, "%s.lathe", stem);
        a.output = output;
    }
    status = lathe__bake_input(&lathe__command_bake, &a);
    return status == LATHE_EXIT_OK ? print_result(&a, json) : status;
}

const lathe_command lathe__command_bake = {
    "bake", "turn a volume into an archive",
    "Usage: lathe bake INPUT [options] [-o OUT.lathe]\n\n"
    "INPUT is NIfTI (.nii, .nii.gz) or the .json sidecar of a raw file. OUT appears when it is complete, or not\n"
    "at all; default: INPUT's name with .lathe, in the current directory.\n\n"
    "  --iso V            the surface around value >= V; default: Otsu's threshold, which is printed\n"
    "  --label N          the surface of one label\n"
    "  --labels all|N,N   one surface for each label; names and colours from the table beside INPUT (as aal.nii.txt)\n"
    "  --axis A           slices across x, y, z or auto (default: the axis of the largest spacing, else z)\n"
    "  --boundary B       edge (middle of pixel borders; default for labels) or iso (between grey values; default\n"
    "                     else)\n"
    "  --topology T       own: each level has that of its slices, small components wait (default); keep: every level\n"
    "                     has the components, cavities and tunnels of the last, which takes more bytes at the start\n"
    "  --levels N         at most N levels, never a radius map; default: by the size, 3 to 12\n"
    "  --spacing MM       of the grid that a contour set (.json with \"sections\") is put on; default: its sections'\n"
    "                     spacing\n"
    "  --name NAME        of the model; default: INPUT's name\n"
    "  --no-errors        do not measure the levels' errors (faster)\n"
    "  --no-draco         do not measure the levels' size in Draco (faster)\n"
    "  --exact            every voxel as it is; else a star-shaped structure may become a radius map, if that is\n"
    "                     within 0.22 voxel RMS and 1 voxel anywhere for 9/10 of the bytes\n"
    "  --independent      each structure can be decoded alone (range requests), for about an eighth more bytes\n"
    "  --quiet            no progress bar, no summary\n"
    "  --json             print what `lathe info --json` prints\n",
    run};
