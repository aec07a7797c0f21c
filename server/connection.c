/* Deadlines of connections. libmicrohttpd's own timeout is one of inactivity: a client that drips a byte now and then
 * would stay for ever. Here every phase has an absolute end, and past it the socket is shut down; the library's thread
 * sees the end of the stream and frees the connection as if the client had left. */
#include "service.h"
#include <stdlib.h>
#include <sys/socket.h>
#include <time.h>

enum { REPLY_MS = 30000, SLOWEST_BYTES_PER_MS = 4 }; /* a reply may take 30 s and 1 s more for each 4 KB */

int64_t lathe__now_ms(void) {
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (int64_t)now.tv_sec * 1000 + now.tv_nsec / 1000000;
}

static void add_peer(lathe_service *service, struct MHD_Connection *connection, void **socket_context) {
    const union MHD_ConnectionInfo *info = MHD_get_connection_info(connection, MHD_CONNECTION_INFO_CONNECTION_FD);
    lathe_peer *peer = calloc(1, sizeof *peer);
    *socket_context = peer;
    if (!info) {
        free(peer);
        *socket_context = NULL;
        return;
    }
    if (!peer) { /* without a deadline nobody is let in */
        shutdown(info->connect_fd, SHUT_RDWR);
        return;
    }
    peer->service = service;
    peer->fd = info->connect_fd;
    atomic_init(&peer->deadline, lathe__now_ms() + (int64_t)service->options.header_seconds * 1000);
    atomic_init(&peer->busy, false);
    pthread_mutex_lock(&service->peers_lock);
    peer->next = service->peers;
    if (peer->next) peer->next->previous = peer;
    service->peers = peer;
    pthread_mutex_unlock(&service->peers_lock);
}

/* Called before the socket is closed, so its number still is this peer's while the lock is held. */
static void remove_peer(lathe_service *service, lathe_peer *peer) {
    pthread_mutex_lock(&service->peers_lock);
    if (peer->previous)
        peer->previous->next = peer->next;
    else
        service->peers = peer->next;
    if (peer->next) peer->next->previous = peer->previous;
    pthread_mutex_unlock(&service->peers_lock);
    free(peer);
}

void lathe__peer_event(void *service, struct MHD_Connection *connection, void **socket_context,
                       enum MHD_ConnectionNotificationCode code) {
    if (code == MHD_CONNECTION_NOTIFY_STARTED)
        add_peer(service, connection, socket_context);
    else if (*socket_context) {
        remove_peer(service, *socket_context);
        *socket_context = NULL;
    }
}

lathe_peer *lathe__peer_of(struct MHD_Connection *connection) {
    const union MHD_ConnectionInfo *info = MHD_get_connection_info(connection, MHD_CONNECTION_INFO_SOCKET_CONTEXT);
    return info ? info->socket_context : NULL;
}

void lathe__peer_begin(lathe_peer *peer) {
    atomic_store(&peer->busy, true);
    atomic_store(&peer->deadline, 0);
}

void lathe__peer_reply(lathe_peer *peer, uint64_t size) {
    atomic_store(&peer->deadline, lathe__now_ms() + REPLY_MS + (int64_t)(size / SLOWEST_BYTES_PER_MS));
}

void lathe__peer_end(lathe_peer *peer) {
    atomic_store(&peer->deadline, lathe__now_ms() + (int64_t)peer->service->options.idle_seconds * 1000);
    atomic_store(&peer->busy, false);
    if (atomic_load(&peer->service->draining)) shutdown(peer->fd, SHUT_RDWR);
}

size_t lathe__peers_reap(lathe_service *service, bool idle, bool all) {
    int64_t now = lathe__now_ms();
    size_t count = 0;
    pthread_mutex_lock(&service->peers_lock);
    for (lathe_peer *peer = service->peers; peer; peer = peer->next, count++) {
        int64_t deadline = atomic_load(&peer->deadline);
        if (all || (idle && !atomic_load(&peer->busy)) || (deadline && deadline < now)) shutdown(peer->fd, SHUT_RDWR);
    }
    pthread_mutex_unlock(&service->peers_lock);
    return count;
}
