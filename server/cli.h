/* What the commands of the command line share: options, complaints, progress, output that notices a full disk. */
#ifndef LATHE_CLI_H
#define LATHE_CLI_H
#include "lathe.h"
#include "lathe_codec.h"
#include <stdio.h>

#define LATHE_VERSION "0.1.0"

enum { LATHE_EXIT_OK = 0, LATHE_EXIT_INPUT = 1, LATHE_EXIT_USAGE = 2 };

typedef struct lathe_command {
    const char *name, *summary;    /* summary: NULL hides the command from `lathe --help` */
    const char *usage;             /* printed by --help */
    int (*run)(int argc, char **argv);   /* argv[0] is the command's name; returns an exit status */
} lathe_command;

extern const lathe_command lathe__command_bake, lathe__command_serve, lathe__command_info, lathe__command_export,
    lathe__command_verify, lathe__command_bench, lathe__command_hash, lathe__command_draw, lathe__command_reconstruct;

/* ---- options ---- */
typedef struct lathe_option {
    const char *name;              /* without the dashes */
    char letter;                   /* 0: none */
    const char **text;             /* takes a value, stored here (the last one counts); NULL: a flag */
    bool *flag;                    /* set to on */
    bool on;
} lathe_option;
#define LATHE_OPTION_TEXT(name, letter, target) {name, letter, target, NULL, false}
#define LATHE_OPTION_FLAG(name, target, on) {name, 0, NULL, target, on}
enum { LATHE_PARSED = -1 };
/* Parses argv[1..): `--name value`, `--name=value`, `-o value`, `-ovalue`, `--` ends options. The other arguments
 * are moved to argv[1..*argument_count]. Returns LATHE_PARSED, or an exit status (--help was answered, or the usage
 * is wrong and said). */
int lathe__parse_options(const lathe_command *command, int argc, char **argv, const lathe_option *options,
                         size_t option_count, int *argument_count);
bool lathe__option_number(double *out, const char *text);                       /* finite, the whole text */
bool lathe__option_integer(int64_t *out, const char *text, int64_t low, int64_t high);

/* ---- complaints: one line on stderr, "lathe: what: where: what to do" ---- */
int lathe__usage_error(const lathe_command *command, const char *format, ...) __attribute__((format(printf, 2, 3)));
int lathe__input_error(const char *format, ...) __attribute__((format(printf, 1, 2)));
/* What failed, on which file; the detail of err when it has one, else the name of the status. */
int lathe__status_error(const char *what, const char *path, lathe_status status, const lathe_error *err);

/* ---- output ---- */
/* Text that comes from a file, for a terminal: control characters become '?'. Returns buffer, always terminated. */
const char *lathe__printable(char *buffer, size_t size, const char *text);
/* Flushes and closes stdout; complains and returns LATHE_EXIT_INPUT if anything was lost, else returns status. */
int lathe__finish_output(int status);

/* ---- progress.c: a bar on stderr when it is a terminal; Ctrl-C cancels the bake and leaves no file behind ---- */
typedef struct lathe_progress {
    const char *what;
    bool shown;
    double last_drawn;             /* seconds */
    int last_percent;
} lathe_progress;
void lathe__progress_begin(lathe_progress *progress, const char *what, bool quiet);
int lathe__progress_step(void *progress, const char *stage, double fraction);   /* for lathe_bake_options */
void lathe__progress_end(lathe_progress *progress);
bool lathe__interrupted(void);

/* ---- shared by bake and serve ---- */
typedef struct lathe_bake_arguments {
    const char *input, *output, *name;
    const char *iso, *label, *labels, *axis, *boundary, *topology, *spacing, *levels;
    bool errors, draco, quiet, exact, independent;
    int (*progress)(void *context, const char *stage, double fraction);   /* NULL: a bar on a terminal */
    void *progress_context;
} lathe_bake_arguments;
void lathe__bake_arguments_defaults(lathe_bake_arguments *arguments);
/* command is for complaints about usage. Returns an exit status. */
int lathe__bake_input(const lathe_command *command, const lathe_bake_arguments *arguments);
/* contour_bake.c: a volume; or a contour set, reconstructed and put on a grid of a->spacing mm. NULL spacing: the
 * median of the distances of its sections, but 64 to 384 voxels along the longest side; said on stderr unless quiet. */
lathe_status lathe__open_bake_input(lathe_volume **out, const lathe_bake_arguments *a, lathe_error *err);
/* "dir/a.nii.gz" -> "a": the file's name without its volume suffix, cut to size. */
void lathe__volume_stem(char *out, size_t size, const char *path);
bool lathe__is_volume_path(const char *path);

/* ---- shared by info and bake ---- */
int lathe__print_info_json(const lathe_model *model);

/* ---- shared by bench and hash: FNV-1a, 64 bit, over the bytes of every structure's positions, then triangles ---- */
#define LATHE_FNV_START 0xcbf29ce484222325u
uint64_t lathe__hash_mesh(uint64_t hash, const lathe_mesh *mesh);
/* The whole stream of an archive; a view into the model. */
const uint8_t *lathe__whole_stream(const lathe_model *model, size_t *size);

#endif
