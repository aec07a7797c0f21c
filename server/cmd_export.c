/* lathe export: one level as a file for other programs. */
#include "cli.h"
#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

typedef enum mesh_format { FORMAT_STL, FORMAT_PLY, FORMAT_GLB, FORMAT_DRC, FORMAT_COUNT } mesh_format;
static const char *const format_names[FORMAT_COUNT] = {"stl", "ply", "glb", "drc"};

static bool find_format(mesh_format *out, const char *name) {
    for (int i = 0; i < FORMAT_COUNT; i++)
        if (strcasecmp(name, format_names[i]) == 0) {
            *out = (mesh_format)i;
            return true;
        }
    return false;
}

static lathe_status write_mesh(const lathe_world_mesh *mesh, mesh_format format, const lathe_write_options *options,
                               int bits, lathe_sink sink, void *context) {
    switch (format) {
    case FORMAT_STL: return lathe_write_stl(mesh, options, sink, context);
    case FORMAT_PLY: return lathe_write_ply(mesh, options, sink, context);
    case FORMAT_GLB: return lathe_write_glb(mesh, options, sink, context);
    case FORMAT_DRC: return lathe_write_drc(mesh, bits, sink, context);
    default: return LATHE_ERR_RANGE;
    }
}

static int write_stdout(void *context, const void *bytes, size_t size) {
    (void)context;
    return fwrite(bytes, 1, size, stdout) == size ? 0 : -1;
}

typedef struct export_job {
    const char *input, *output;
    mesh_format format;
    int bits;
    int64_t smooth;            /* pieces of an edge; 0: flat triangles */
    bool delta;                /* what a Draco client lacks of the level; there is no mesh then */
    const lathe_model *model;
    int64_t structure, level;
} export_job;

static lathe_status write_job(const export_job *job, const lathe_world_mesh *mesh, const lathe_write_options *options,
                              lathe_sink sink, void *context, lathe_error *err) {
    if (job->delta)
        return lathe_write_draco_delta(job->model, job->structure, (uint32_t)job->level, sink, context, err);
    return write_mesh(mesh, job->format, options, job->bits, sink, context);
}

static int write_output(const export_job *job, const lathe_world_mesh *mesh, const lathe_model_info *info) {
    lathe_write_options options = {.model = info, .name = info->name};
    if (strcmp(job->output, "-") == 0) {
        lathe_error err = {{0}};
        lathe_status status = write_job(job, mesh, &options, write_stdout, NULL, &err);
        if (status == LATHE_OK || ferror(stdout)) return LATHE_EXIT_OK;   /* main says what happened to stdout */
        return lathe__status_error("export", "standard output", status, *err.text ? &err : NULL);
    }
    lathe_error err = {{0}};
    lathe_atomic_file *file = NULL;
    lathe_status status = lathe_atomic_open(&file, job->output, &err);
    if (status) return lathe__status_error("export", job->output, status, &err);
    status = write_job(job, mesh, &options, lathe_atomic_write, file, &err);
    /* A commit after a failed write fails as well, and knows why. */
    if (status == LATHE_OK || status == LATHE_ERR_IO) {
        lathe_status committed = lathe_atomic_commit(&file, &err);
        if (status == LATHE_OK || committed) status = committed;
    }
    lathe_atomic_abandon(&file);
    return status ? lathe__status_error("export", job->output, status, &err) : LATHE_EXIT_OK;
}

static int export_level(export_job *job, const lathe_model *model, const char *structure_name, const char *level_text) {
    const lathe_model_info *info = lathe_model_describe(model);
    int64_t structure = -1, level = (int64_t)info->level_count - 1;
    if (structure_name) {
        structure = lathe_model_find(model, structure_name);
        if (structure < 0)
            return lathe__input_error("export: %s: no structure \"%s\": `lathe info` lists them", job->input,
                                      structure_name);
    }
    if (level_text && strcmp(level_text, "last") != 0) {
        int64_t last = level;
        if (!lathe__option_integer(&level, level_text, 0, INT32_MAX))
            return lathe__usage_error(&lathe__command_export, "--level %s: a level is a number from 0, or `last`",
                                      level_text);
        if (level > last)
            return lathe__input_error("export: %s: level %s: the last one is %lld", job->input, level_text,
                                      (long long)last);
    }
    lathe_world_mesh mesh;
    lathe_error err = {{0}};
    memset(&mesh, 0, sizeof mesh);
    job->model = model, job->structure = structure, job->level = level;
    if (job->delta) return write_output(job, &mesh, info);
    lathe_status status = lathe_model_mesh(&mesh, model, structure, (uint32_t)level, &err);
    if (!status && job->smooth) {
        status = lathe_world_mesh_smooth(&mesh, (uint32_t)job->smooth);
        if (status) lathe_fail(&err, status, "smoothing: %s", lathe_status_name(status));
    }
    int result = status ? lathe__status_error("export", job->input, status, &err) : write_output(job, &mesh, info);
    lathe_world_mesh_free(&mesh);
    return result;
}

static int run(int argc, char **argv) {
    const lathe_command *command = &lathe__command_export;
    const char *output = NULL, *level = NULL, *structure = NULL, *format = NULL, *bits = NULL, *smooth = NULL,
               *delta = NULL;
    const lathe_option options[] = {
        LATHE_OPTION_TEXT("output", 'o', &output),       LATHE_OPTION_TEXT("level", 'l', &level),
        LATHE_OPTION_TEXT("structure", 's', &structure), LATHE_OPTION_TEXT("format", 'f', &format),
        LATHE_OPTION_TEXT("bits", 0, &bits),             LATHE_OPTION_TEXT("smooth", 0, &smooth),
        LATHE_OPTION_TEXT("delta", 'd', &delta),
    };
    int count, status = lathe__parse_options(command, argc, argv, options, sizeof options / sizeof *options, &count);
    if (status != LATHE_PARSED) return status;
    if (count != 1) return lathe__usage_error(command, "one FILE is needed");
    if (!output) return lathe__usage_error(command, "-o OUT is needed");
    export_job job = {.input = argv[1], .output = output};
    if (!format) {
        const char *dot = strrchr(output, '.');
        format = dot ? dot + 1 : "";
        if (!find_format(&job.format, format))
            return lathe__usage_error(command, "--format stl, ply, glb or drc is needed: \"%s\" does not tell it",
                                      output);
    } else if (!find_format(&job.format, format)) {
        return lathe__usage_error(command, "--format %s: it is one of stl, ply, glb, drc", format);
    }
    if (delta && (level || bits || smooth || job.format != FORMAT_DRC))
        return lathe__usage_error(command, "--delta N is a Draco file, without --level, --bits or --smooth");
    job.delta = delta != NULL;
    if (delta) level = delta;
    int64_t bit_count = 0;
    if (bits && !lathe__option_integer(&bit_count, bits, 1, 30))
        return lathe__usage_error(command, "--bits %s: 1 to 30", bits);
    job.bits = (int)bit_count;
    if (smooth && !lathe__option_integer(&job.smooth, smooth, 1, 16))
        return lathe__usage_error(command, "--smooth %s: 1 to 16", smooth);
    lathe_model *model = NULL;
    lathe_error err = {{0}};
    lathe_status opened = lathe_model_open(&model, job.input, &err);
    if (opened) return lathe__status_error("export", job.input, opened, &err);
    status = export_level(&job, model, structure, level);
    lathe_model_close(&model);
    return status;
}

const lathe_command lathe__command_export = {
    "export", "write one level as STL, PLY, GLB or Draco",
    "Usage: lathe export FILE [--level N | --delta N] [--structure NAME] [--format stl|ply|glb|drc] [--smooth K]\n"
    "                    -o OUT\n\n"
    "Writes one whole level of FILE (.lathe), in world mm (GLB: metres). OUT appears when it is complete, or not\n"
    "at all.\n\n"
    "  -l, --level N          0 is the base shape; default: `last`, the finest\n"
    "  -s, --structure NAME   only this one; default: all in one file\n"
    "  -f, --format F         default: what OUT ends with\n"
    "      --smooth K         the smooth surface through the vertices, every edge in K pieces (1 to 16)\n"
    "  -d, --delta N          drc: not the level but what a client lacks of it that has the one before\n"
    "                         (docs/DRACO_DELTAS.md)\n"
    "      --bits N           drc: bits of a coordinate, 11 by default\n"
    "  -o, --output OUT       `-` is standard output\n",
    run};
