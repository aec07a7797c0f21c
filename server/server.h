/* The HTTP server as the command line sees it. docs/HTTP_API.md describes what it answers. */
#ifndef LATHE_SERVER_H
#define LATHE_SERVER_H
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

typedef struct lathe_serve_options {
    const char *bind;              /* address or host name; NULL: 127.0.0.1 */
    uint16_t port;                 /* 0: any free port, which the `listening` line names */
    const char *const *paths;      /* archives, and directories whose *.lathe are served */
    size_t path_count;             /* 0: an empty list, which is allowed */
    bool quiet;                    /* no access log */
    /* 0 in any of these: the default, or the environment variable named beside it */
    unsigned max_connections;      /* LATHE_MAX_CONNECTIONS, 1024 */
    unsigned threads;              /* LATHE_THREADS, one for each core */
    unsigned header_seconds;       /* LATHE_HEADER_SECONDS, 10: from connecting to the end of the first request's
                                    * headers */
    unsigned idle_seconds;         /* LATHE_IDLE_SECONDS, 30: from a reply to the end of the next request's headers */
    unsigned drain_seconds;        /* LATHE_DRAIN_SECONDS, 10: what a running reply gets after SIGTERM */
    size_t cache_megabytes;        /* LATHE_CACHE_MB, 256: built representations kept in memory */
} lathe_serve_options;

/* 127.0.0.1:8080 and zeros. */
void lathe_serve_defaults(lathe_serve_options *options);
/* Serves until SIGINT or SIGTERM, then drains and returns 0; a second signal ends at once. Prints `listening on
 * http://ADDR:PORT` on stdout when ready, problems and the access log on stderr. 1: a path or the port cannot be
 * used. */
int lathe_serve(const lathe_serve_options *options);
#endif
