/* lathe serve: archives over HTTP. Volumes among the files are baked first, into a folder that goes when the server
 * ends. */
#include "cli.h"
#include "server.h"
#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

typedef struct serve_setup {
    const char **paths;            /* what is served; those of baked volumes are owned (in `baked`) */
    size_t path_count;
    char **baked;
    size_t baked_count;
    char folder[64];               /* of the baked ones, "" if there is none */
} serve_setup;

static void release(serve_setup *setup) {
    for (size_t i = 0; i < setup->baked_count; i++) {
        unlink(setup->baked[i]);
        free(setup->baked[i]);
    }
    if (setup->folder[0]) rmdir(setup->folder);
    free(setup->baked);
    free((void *)setup->paths);
}

static int make_folder(serve_setup *setup) {
    if (setup->folder[0]) return LATHE_EXIT_OK;
    const char *temporary = getenv("TMPDIR");
    if (!temporary || strlen(temporary) > 40) temporary = "/tmp";
    char folder[sizeof setup->folder];
    snprintf(folder, sizeof folder, "%s/lathe-XXXXXX", temporary);
    if (!mkdtemp(folder))
        return lathe__input_error("serve: %s: %s: a volume is baked there: set TMPDIR", folder, strerror(errno));
    memcpy(setup->folder, folder, sizeof folder);
    return LATHE_EXIT_OK;
}

static bool name_taken(const serve_setup *setup, const char *path) {
    for (size_t i = 0; i < setup->baked_count; i++)
        if (strcmp(setup->baked[i], path) == 0) return true;
    return false;
}

/* The archive's place: a model is called as its file. Two volumes of one name get numbers. */
static char *baked_path(const serve_setup *setup, const char *volume) {
    char stem[128], path[256];
    lathe__volume_stem(stem, sizeof stem, volume);
    snprintf(path, sizeof path, "%s/%s.lathe", setup->folder, stem);
    for (unsigned i = 2; name_taken(setup, path); i++)
        snprintf(path, sizeof path, "%s/%s-%u.lathe", setup->folder, stem, i);
    return strdup(path);
}

static int bake_volume(serve_setup *setup, const char *volume, const char *iso, const char *labels) {
    int status = make_folder(setup);
    if (status) return status;
    char *path = baked_path(setup, volume);
    if (!path) return lathe__input_error("serve: out of memory");
    setup->baked[setup->baked_count++] = path;
    lathe_bake_arguments arguments;
    lathe__bake_arguments_defaults(&arguments);
    arguments.input = volume;
    arguments.output = path;
    arguments.iso = iso;
    arguments.labels = labels;
    setup->paths[setup->path_count++] = path;
    return lathe__bake_input(&lathe__command_serve, &arguments);
}

static int prepare(serve_setup *setup, size_t count, char **paths, const char *iso, const char *labels) {
    setup->paths = calloc(count + 1, sizeof *setup->paths);
    setup->baked = calloc(count + 1, sizeof *setup->baked);
    if (!setup->paths || !setup->baked) return lathe__input_error("serve: out of memory");
    for (size_t i = 0; i < count; i++) {
        if (!lathe__is_volume_path(paths[i])) {
            setup->paths[setup->path_count++] = paths[i];
            continue;
        }
        int status = bake_volume(setup, paths[i], iso, labels);
        if (status) return status;
    }
    return LATHE_EXIT_OK;
}

static int run(int argc, char **argv) {
    const lathe_command *command = &lathe__command_serve;
    lathe_serve_options serve;
    lathe_serve_defaults(&serve);
    const char *port = NULL, *iso = NULL, *labels = NULL;
    const lathe_option options[] = {
        LATHE_OPTION_TEXT("port", 'p', &port),       LATHE_OPTION_TEXT("bind", 'b', &serve.bind),
        LATHE_OPTION_TEXT("iso", 0, &iso),           LATHE_OPTION_TEXT("labels", 0, &labels),
        LATHE_OPTION_FLAG("quiet", &serve.quiet, true),
    };
    int count, status = lathe__parse_options(command, argc, argv, options, sizeof options / sizeof *options, &count);
    if (status != LATHE_PARSED) return status;
    int64_t number = serve.port;
    if (port && !lathe__option_integer(&number, port, 0, 65535))
        return lathe__usage_error(command, "--port %s: 0 to 65535", port);
    serve.port = (uint16_t)number;
    static char here[] = ".";
    char *current[] = {here};
    serve_setup setup;
    memset(&setup, 0, sizeof setup);
    status = prepare(&setup, count ? (size_t)count : 1, count ? argv + 1 : current, iso, labels);
    serve.paths = setup.paths;
    serve.path_count = setup.path_count;
    if (status == LATHE_EXIT_OK) status = lathe_serve(&serve) ? LATHE_EXIT_INPUT : LATHE_EXIT_OK;
    release(&setup);
    return status;
}

const lathe_command lathe__command_serve = {
    "serve", "serve archives, and a viewer for them, over HTTP",
    "Usage: lathe serve [DIR|FILE...] [--port P] [--bind ADDR] [--quiet]\n\n"
    "Serves the archives (.lathe) named or found in the directories named (default: the current one) until it is\n"
    "interrupted. A volume (.nii, .nii.gz, .json) is baked first; --iso and --labels are as for `lathe bake`.\n\n"
    "  -p, --port P      8080 by default; 0: any free one, which is printed\n"
    "  -b, --bind ADDR   127.0.0.1 by default: only this machine; 0.0.0.0: everyone who can reach it\n"
    "      --quiet       no access log\n\n"
    "Environment: LATHE_MAX_CONNECTIONS, LATHE_THREADS, LATHE_HEADER_SECONDS, LATHE_IDLE_SECONDS,\n"
    "LATHE_DRAIN_SECONDS, LATHE_CACHE_MB (docs/HTTP_API.md).\n",
    run};
