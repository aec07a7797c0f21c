#include "cli.h"
#include <signal.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

static volatile sig_atomic_t interrupted;

static void note_interrupt(int signal_number) { interrupted = signal_number; }

bool lathe__interrupted(void) { return interrupted != 0; }

/* The first signal asks the bake to stop; the handler is reset, so that the second one kills. */
static void catch_interrupts(void) {
    struct sigaction action;
    memset(&action, 0, sizeof action);
    action.sa_handler = note_interrupt;
    action.sa_flags = (int)SA_RESETHAND;
    sigemptyset(&action.sa_mask);
    sigaction(SIGINT, &action, NULL);
    sigaction(SIGTERM, &action, NULL);
    sigaction(SIGHUP, &action, NULL);
}

static void release_interrupts(void) {
    signal(SIGINT, SIG_DFL);
    signal(SIGTERM, SIG_DFL);
    signal(SIGHUP, SIG_DFL);
}

static double seconds_now(void) {
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

void lathe__progress_begin(lathe_progress *progress, const char *what, bool quiet) {
    memset(progress, 0, sizeof *progress);
    progress->what = what;
    progress->shown = !quiet && isatty(STDERR_FILENO);
    progress->last_percent = -1;
    catch_interrupts();
}

int lathe__progress_step(void *context, const char *stage, double fraction) {
    enum { WIDTH = 32 };
    static const char full[] = "################################", empty[] = "................................";
    const double interval = 0.1;   /* seconds */
    lathe_progress *progress = context;
    if (!progress->shown) return interrupted != 0;
    if (!(fraction >= 0)) fraction = 0;
    if (fraction > 1) fraction = 1;
    int percent = (int)(fraction * 100), done = (int)(fraction * WIDTH);
    double now = seconds_now();
    if (percent != progress->last_percent && now - progress->last_drawn >= interval) {
        fprintf(stderr, "\r%s [%.*s%.*s] %3d %% %s\033[K", progress->what, done, full, WIDTH - done, empty, percent,
                stage ? stage : "");
        fflush(stderr);
        progress->last_percent = percent;
        progress->last_drawn = now;
    }
    return interrupted != 0;
}

void lathe__progress_end(lathe_progress *progress) {
    if (progress->shown && progress->last_percent >= 0) fputs("\r\033[K", stderr);
    release_interrupts();
}
