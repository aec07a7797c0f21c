/* The daemon: socket, threads, deadlines, shutdown. One thread for each core with epoll and shared responses in memory
 * measured as fast as a web server that only sends files; the main thread keeps the clock. */
#include "service.h"
#include <errno.h>
#include <limits.h>
#include <netdb.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <time.h>
#include <unistd.h>

enum { MEMORY_LIMIT = 16384, INACTIVITY_SECONDS = 120, GRACE_MS = 200, REFRESH_MS = 2000 };

void lathe_serve_defaults(lathe_serve_options *options) {
    *options = (lathe_serve_options){.bind = "127.0.0.1", .port = 8080};
}

/* What is given, else the environment's, else the default. */
static unsigned choose(unsigned given, const char *variable, unsigned otherwise, unsigned most) {
    const char *text = getenv(variable);
    char *end;
    if (given) return given < most ? given : most;
    if (!text || !*text) return otherwise;
    unsigned long value = strtoul(text, &end, 10);
    if (*end || !value || value > most || text[0] == '-') {
        fprintf(stderr, "lathe: %s=%s is ignored: it must be a whole number from 1 to %u\n", variable, text, most);
        return otherwise;
    }
    return (unsigned)value;
}

static void complete_options(lathe_serve_options *o) {
    long cores = sysconf(_SC_NPROCESSORS_ONLN);
    if (!o->bind) o->bind = "127.0.0.1";
    o->max_connections = choose(o->max_connections, "LATHE_MAX_CONNECTIONS", 1024, 100000);
    o->threads = choose(o->threads, "LATHE_THREADS", cores > 1 ? (unsigned)(cores < 256 ? cores : 256) : 2, 256);
    o->header_seconds = choose(o->header_seconds, "LATHE_HEADER_SECONDS", 10, 3600);
    o->idle_seconds = choose(o->idle_seconds, "LATHE_IDLE_SECONDS", 30, 3600);
    o->drain_seconds = choose(o->drain_seconds, "LATHE_DRAIN_SECONDS", 10, 3600);
    o->cache_megabytes = choose((unsigned)(o->cache_megabytes < UINT_MAX ? o->cache_megabytes : UINT_MAX),
                                "LATHE_CACHE_MB", 256, 1u << 20);
    if (o->max_connections < o->threads) o->max_connections = o->threads;
}

/* A file descriptor for each connection, and some for files. */
static void raise_file_limit(unsigned connections) {
    struct rlimit limit;
    rlim_t want = connections + 256;
    if (getrlimit(RLIMIT_NOFILE, &limit) || limit.rlim_cur >= want) return;
    limit.rlim_cur = limit.rlim_max < want ? limit.rlim_max : want;
    setrlimit(RLIMIT_NOFILE, &limit);
}

/* ---- socket ---- */

static int bind_address(const struct addrinfo *at) {
    int fd = socket(at->ai_family, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0), yes = 1;
    if (fd < 0) return -1;
    setsockopt(fd, SOL_SOCKET, SO_REUSEADDR, &yes, sizeof yes);
    if (!bind(fd, at->ai_addr, at->ai_addrlen) && !listen(fd, SOMAXCONN)) return fd;
    int error = errno;
    close(fd);
    errno = error;
    return -1;
}

static int open_socket(const lathe_serve_options *options) {
    struct addrinfo hints = {.ai_family = AF_UNSPEC, .ai_socktype = SOCK_STREAM, .ai_flags = AI_PASSIVE}, *list;
    char port[8];
    snprintf(port, sizeof port, "%u", options->port);
    int problem = getaddrinfo(options->bind, port, &hints, &list);
    if (problem) {
        fprintf(stderr, "lathe: cannot bind to `%s`: %s\n", options->bind, gai_strerror(problem));
        return -1;
    }
    int fd = -1;
    for (const struct addrinfo *at = list; at && fd < 0; at = at->ai_next) fd = bind_address(at);
    int error = errno;
    freeaddrinfo(list);
    if (fd >= 0) return fd;
    if (error == EADDRINUSE)
        fprintf(stderr, "lathe: port %u on %s is in use by another program: stop it or choose another with --port\n",
                options->port, options->bind);
    else
        fprintf(stderr, "lathe: cannot listen on port %u of %s: %s\n", options->port, options->bind, strerror(error));
    return -1;
}

static void announce(int fd) {
    struct sockaddr_storage address = {0};
    socklen_t size = sizeof address;
    char host[NI_MAXHOST] = "?", port[NI_MAXSERV] = "?";
    if (!getsockname(fd, (struct sockaddr *)&address, &size))
        getnameinfo((struct sockaddr *)&address, size, host, sizeof host, port, sizeof port,
                    NI_NUMERICHOST | NI_NUMERICSERV);
    bool six = address.ss_family == AF_INET6;
    printf("listening on http://%s%s%s:%s\n", six ? "[" : "", host, six ? "]" : "", port);
    fflush(stdout);
}

/* ---- daemon ---- */

/* Paths and queries are decoded by us, once, after they have been cut. */
static size_t leave_escaped(void *context, struct MHD_Connection *connection, char *text) {
    (void)context, (void)connection;
    return strlen(text);
}

static struct MHD_Daemon *start_daemon(lathe_service *service, int fd) {
    unsigned flags = MHD_USE_EPOLL_INTERNAL_THREAD | MHD_USE_ITC;
    const struct MHD_OptionItem threads[] = {{MHD_OPTION_THREAD_POOL_SIZE, (intptr_t)service->options.threads, NULL},
                                             {MHD_OPTION_END, 0, NULL}};
    /* A pool of one is refused by the library, which then has one thread anyway. */
    return MHD_start_daemon(flags, 0, NULL, NULL, lathe__route, service, MHD_OPTION_LISTEN_SOCKET, fd, MHD_OPTION_ARRAY,
                            service->options.threads > 1 ? threads : threads + 1, MHD_OPTION_CONNECTION_LIMIT,
                            service->options.max_connections, MHD_OPTION_CONNECTION_MEMORY_LIMIT, (size_t)MEMORY_LIMIT,
                            MHD_OPTION_CONNECTION_TIMEOUT, (unsigned)INACTIVITY_SECONDS, MHD_OPTION_STRICT_FOR_CLIENT,
                            1, MHD_OPTION_UNESCAPE_CALLBACK, leave_escaped, NULL, MHD_OPTION_URI_LOG_CALLBACK,
                            lathe__request_begin, service, MHD_OPTION_NOTIFY_COMPLETED, lathe__request_end, service,
                            MHD_OPTION_NOTIFY_CONNECTION, lathe__peer_event, service, MHD_OPTION_END);
}

/* A signal within the time, or 0. */
static int wait_signal(const sigset_t *signals, int milliseconds) {
    struct timespec time = {milliseconds / 1000, (long)(milliseconds % 1000) * 1000000};
    int signal = sigtimedwait(signals, NULL, &time);
    return signal > 0 ? signal : 0;
}

static void run(lathe_service *service, const sigset_t *signals) {
    int64_t refreshed = lathe__now_ms();
    while (!wait_signal(signals, 250)) {
        lathe__peers_reap(service, false, false);
        if (lathe__now_ms() - refreshed < REFRESH_MS) continue;
        lathe__store_refresh(service->store, service->cache);
        refreshed = lathe__now_ms();
    }
}

/* No new connections; requests under way, and those that arrive within a moment, are answered; then the rest is cut. */
static void drain(lathe_service *service, struct MHD_Daemon *daemon, const sigset_t *signals) {
    int fd = MHD_quiesce_daemon(daemon);
    if (fd >= 0) shutdown(fd, SHUT_RDWR); /* refuses connections; closed later, since threads may still name it */
    int64_t started = lathe__now_ms(), end = started + (int64_t)service->options.drain_seconds * 1000;
    atomic_store(&service->draining, true);
    while (lathe__peers_reap(service, lathe__now_ms() - started > GRACE_MS, false) && lathe__now_ms() < end)
        if (wait_signal(signals, 20)) break;
    lathe__peers_reap(service, false, true);
    MHD_stop_daemon(daemon);
    if (fd >= 0) close(fd);
}

static int serve(lathe_service *service, const sigset_t *signals) {
    int fd = open_socket(&service->options);
    if (fd < 0) return 1;
    struct MHD_Daemon *daemon = start_daemon(service, fd);
    if (!daemon) {
        fprintf(stderr, "lathe: the server does not start: %s\n", strerror(errno));
        close(fd);
        return 1;
    }
    announce(fd);
    run(service, signals);
    drain(service, daemon, signals);
    return 0;
}

static int prepare(lathe_service *service) {
    lathe_error err = {""};
    const lathe_serve_options *o = &service->options;
    lathe_status status = lathe__cache_open(&service->cache, o->cache_megabytes << 20);
    if (!status) status = lathe__store_open(&service->store, o->paths, o->path_count, &err);
    if (!status) return 0;
    fprintf(stderr, "lathe: %s\n", err.text[0] ? err.text : lathe_status_name(status));
    return 1;
}

int lathe_serve(const lathe_serve_options *options) {
    lathe_service service = {.options = *options, .peers_lock = PTHREAD_MUTEX_INITIALIZER};
    sigset_t signals, before;
    complete_options(&service.options);
    raise_file_limit(service.options.max_connections);
    /* Blocked before threads exist, so that only the main thread takes them, when it waits. */
    sigemptyset(&signals);
    sigaddset(&signals, SIGINT);
    sigaddset(&signals, SIGTERM);
    pthread_sigmask(SIG_BLOCK, &signals, &before);
    signal(SIGPIPE, SIG_IGN);
    int code = prepare(&service);
    if (!code) code = serve(&service, &signals);
    lathe__cache_close(&service.cache);
    lathe__store_close(&service.store);
    pthread_sigmask(SIG_SETMASK, &before, NULL);
    return code;
}
