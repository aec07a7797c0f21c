#include "cli.h"
#include <errno.h>
#include <math.h>
#include <stdarg.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

static const lathe_option *find_long(const lathe_option *options, size_t count, const char *name, size_t length) {
    for (size_t i = 0; i < count; i++)
        if (strlen(options[i].name) == length && memcmp(options[i].name, name, length) == 0) return &options[i];
    return NULL;
}

static const lathe_option *find_letter(const lathe_option *options, size_t count, char letter) {
    for (size_t i = 0; i < count; i++)
        if (options[i].letter == letter) return &options[i];
    return NULL;
}

/* Splits one argument that begins with '-' into its option and, if it is there, the value in the same argument. */
static const lathe_option *split_argument(const char **value, const lathe_option *options, size_t count,
                                          const char *argument) {
    *value = NULL;
    if (argument[1] == '-') {
        const char *name = argument + 2, *equals = strchr(name, '=');
        if (equals) *value = equals + 1;
        return find_long(options, count, name, equals ? (size_t)(equals - name) : strlen(name));
    }
    const lathe_option *option = find_letter(options, count, argument[1]);
    if (option && argument[2]) *value = argument + 2;
    return option;
}

int lathe__parse_options(const lathe_command *command, int argc, char **argv, const lathe_option *options,
                         size_t option_count, int *argument_count) {
    int kept = 0;
    bool ended = false;
    for (int i = 1; i < argc; i++) {
        char *argument = argv[i];
        if (ended || argument[0] != '-' || argument[1] == 0) { argv[++kept] = argument; continue; }
        if (strcmp(argument, "--") == 0) { ended = true; continue; }
        if (strcmp(argument, "--help") == 0 || strcmp(argument, "-h") == 0) {
            fputs(command->usage, stdout);
            return LATHE_EXIT_OK;
        }
        const char *value;
        const lathe_option *option = split_argument(&value, options, option_count, argument);
        if (!option) return lathe__usage_error(command, "unknown option %s", argument);
        if (!option->text) {
            if (value) return lathe__usage_error(command, "--%s takes no value", option->name);
            *option->flag = option->on;
            continue;
        }
        if (!value) {
            if (i + 1 >= argc) return lathe__usage_error(command, "--%s needs a value", option->name);
            value = argv[++i];
        }
        *option->text = value;
    }
    *argument_count = kept;
    return LATHE_PARSED;
}

bool lathe__option_number(double *out, const char *text) {
    char *end;
    errno = 0;
    double value = strtod(text, &end);
    if (end == text || *end || errno == ERANGE || !isfinite(value)) return false;
    *out = value;
    return true;
}

bool lathe__option_integer(int64_t *out, const char *text, int64_t low, int64_t high) {
    char *end;
    errno = 0;
    long long value = strtoll(text, &end, 10);
    if (end == text || *end || errno == ERANGE || value < low || value > high) return false;
    *out = value;
    return true;
}

int lathe__usage_error(const lathe_command *command, const char *format, ...) {
    va_list list;
    va_start(list, format);
    fprintf(stderr, "lathe: %s: ", command->name);
    vfprintf(stderr, format, list);
    fprintf(stderr, " (see: lathe %s --help)\n", command->name);
    va_end(list);
    return LATHE_EXIT_USAGE;
}

int lathe__input_error(const char *format, ...) {
    va_list list;
    va_start(list, format);
    fputs("lathe: ", stderr);
    vfprintf(stderr, format, list);
    fputc('\n', stderr);
    va_end(list);
    return LATHE_EXIT_INPUT;
}

int lathe__status_error(const char *what, const char *path, lathe_status status, const lathe_error *err) {
    char place[512], detail[sizeof err->text];
    bool said = err && err->text[0];
    lathe__printable(place, sizeof place, path);
    lathe__printable(detail, sizeof detail, said ? err->text : lathe_status_name(status));
    /* A detail that names the file itself needs no second naming. */
    if (said && strstr(detail, place)) return lathe__input_error("%s: %s", what, detail);
    return lathe__input_error("%s: %s: %s", what, place, detail);
}

const char *lathe__printable(char *buffer, size_t size, const char *text) {
    size_t n = 0;
    for (; text[n] && n + 1 < size; n++) {
        unsigned char c = (unsigned char)text[n];
        buffer[n] = c < 0x20 || c == 0x7f ? '?' : (char)c;
    }
    buffer[n] = 0;
    return buffer;
}

int lathe__finish_output(int status) {
    bool lost = ferror(stdout) != 0;
    if (fclose(stdout) != 0) lost = true;
    if (!lost) return status;
    int code = errno;
    /* The reader has gone and knows it. */
    if (code == EPIPE) return status == LATHE_EXIT_OK ? LATHE_EXIT_INPUT : status;
    lathe__input_error("standard output: %s: the output is not complete", code ? strerror(code) : "write error");
    return status == LATHE_EXIT_OK ? LATHE_EXIT_INPUT : status;
}
