/* lathe: scanned volumes as surfaces that refine while they arrive. The commands are in cmd_*.c. */
#include "cli.h"
#include <fcntl.h>
#ifdef __GLIBC__
#include <malloc.h>
#endif
#include <signal.h>
#include <string.h>
#include <unistd.h>

static const lathe_command *const commands[] = {
    &lathe__command_bake,   &lathe__command_serve,  &lathe__command_info, &lathe__command_export,
    &lathe__command_verify, &lathe__command_bench,  &lathe__command_hash,
    &lathe__command_draw, &lathe__command_reconstruct,
};
enum { COMMAND_COUNT = sizeof commands / sizeof commands[0] };

static void print_help(FILE *out) {
    fputs("Usage: lathe COMMAND [options]\n\n"
          "Turns a scanned or labelled volume into a surface that arrives in a browser pass by pass.\n\n", out);
    for (size_t i = 0; i < COMMAND_COUNT; i++)
        if (commands[i]->summary) fprintf(out, "  %-11s %s\n", commands[i]->name, commands[i]->summary);
    fputs("\n`lathe COMMAND --help` tells more about one; `lathe --version` prints the version.\n"
          "Exit status: 0 done, 1 bad input or a failed check, 2 wrong usage.\n", out);
}

/* A file opened later must not become standard input, output or error: closed ones are taken, so that writing to
 * them fails. */
static void occupy_standard_files(void) {
    for (int fd = open("/dev/null", O_RDONLY); fd >= 0; fd = open("/dev/null", O_RDONLY))
        if (fd > STDERR_FILENO) {
            close(fd);
            return;
        }
}

/* Whoever decodes one model after the other gets the same memory each time: fresh pages, which the kernel has to clear, took a tenth of
 * the time that decoding takes. */
static void keep_memory(void) {
#ifdef __GLIBC__
    mallopt(M_MMAP_THRESHOLD, 32 << 20);
    mallopt(M_TRIM_THRESHOLD, 64 << 20);
#endif
}

static int run_command(int argc, char **argv) {
    if (argc < 2) {
        print_help(stderr);
        return LATHE_EXIT_USAGE;
    }
    if (strcmp(argv[1], "--help") == 0 || strcmp(argv[1], "-h") == 0 || strcmp(argv[1], "help") == 0) {
        print_help(stdout);
        return LATHE_EXIT_OK;
    }
    if (strcmp(argv[1], "--version") == 0 || strcmp(argv[1], "-V") == 0) {
        puts("lathe " LATHE_VERSION);
        return LATHE_EXIT_OK;
    }
    for (size_t i = 0; i < COMMAND_COUNT; i++)
        if (strcmp(argv[1], commands[i]->name) == 0) return commands[i]->run(argc - 1, argv + 1);
    char name[64];
    fprintf(stderr, "lathe: %s: no such command (see: lathe --help)\n", lathe__printable(name, sizeof name, argv[1]));
    return LATHE_EXIT_USAGE;
}

int main(int argc, char **argv) {
    occupy_standard_files();
    keep_memory();
    signal(SIGPIPE, SIG_IGN);      /* a closed pipe is an error that each writer sees */
    return lathe__finish_output(run_command(argc, argv));
}
