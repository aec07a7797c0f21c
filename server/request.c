/* A request: what the library leaves unchecked, the target cut into segments and parameters, and common arguments. */
#include "service.h"
#include <arpa/inet.h>
#include <ctype.h>
#include <netinet/in.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

/* 0.9.75 cuts the query into parameters, 60 bytes of the connection's memory for each `&`, and hangs when that is used
 * up. We cut it ourselves, from a copy, and leave the library one parameter: the buffer is its own and writable. */
static void join_query(const char *target) {
    for (char *p = (char *)(uintptr_t)target; *p; p++)
        if (*p == '&') *p = ' ';
}

void *lathe__request_begin(void *service, const char *target, struct MHD_Connection *connection) {
    lathe_request *request = calloc(1, sizeof *request);
    if (!request) return NULL;
    request->service = service;
    request->connection = connection;
    request->peer = lathe__peer_of(connection);
    request->target_address = (uintptr_t)target;
    request->target = strdup(target);
    request->logged = strdup(target);
    join_query(target);
    request->method = "";
    request->started = lathe__now_ms();
    return request;
}

static void client_address(char *out, size_t size, struct MHD_Connection *connection) {
    const union MHD_ConnectionInfo *info = MHD_get_connection_info(connection, MHD_CONNECTION_INFO_CLIENT_ADDRESS);
    const struct sockaddr *address = info ? info->client_addr : NULL;
    const void *host = NULL;
    if (address && address->sa_family == AF_INET) host = &((const struct sockaddr_in *)(const void *)address)->sin_addr;
    if (address && address->sa_family == AF_INET6)
        host = &((const struct sockaddr_in6 *)(const void *)address)->sin6_addr;
    if (!host || !inet_ntop(address->sa_family, host, out, (socklen_t)size)) snprintf(out, size, "-");
}

/* One line for each request. What the client wrote is shown without anything that could forge a line. */
static void log_request(const lathe_request *request, struct MHD_Connection *connection) {
    char address[64], target[400], method[16];
    const union MHD_ConnectionInfo *sent = MHD_get_connection_info(connection, MHD_CONNECTION_INFO_HTTP_STATUS);
    unsigned status = request->status ? request->status : sent ? sent->http_status : 0;
    client_address(address, sizeof address, connection);
    size_t n = 0;
    for (const char *p = request->logged ? request->logged : "-"; *p && n < sizeof target - 5; p++) {
        if (*p > ' ' && *p < 127 && *p != '"' && *p != '\\')
            target[n++] = *p;
        else
            n += (size_t)snprintf(target + n, 5, "\\x%02x", (unsigned char)*p);
    }
    target[n] = 0;
    for (n = 0; n < sizeof method - 1 && isalpha((unsigned char)request->method[n]); n++)
        method[n] = request->method[n];
    method[n] = 0;
    fprintf(stderr, "%s \"%s %s\" %u %llu %lldms\n", address, n ? method : "-", target, status,
            (unsigned long long)request->bytes, (long long)(lathe__now_ms() - request->started));
}

void lathe__request_end(void *service, struct MHD_Connection *connection, void **pointer,
                        enum MHD_RequestTerminationCode code) {
    lathe_request *request = *pointer;
    (void)code;
    if (!request) return;
    if (!((lathe_service *)service)->options.quiet) log_request(request, connection);
    if (request->peer) lathe__peer_end(request->peer);
    free(request->target);
    free(request->logged);
    free(request);
    *pointer = NULL;
}

/* ---- vetting ---- */

typedef struct framing {
    unsigned hosts, lengths, encodings;
    bool body, bad_name;
} framing;

/* `Transfer-Encoding : chunked` must not pass for another header. */
static bool is_token(const char *text) {
    static const char allowed[] = "!#$%&'*+-.^_`|~0123456789abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ";
    return *text && !text[strspn(text, allowed)];
}

static enum MHD_Result count_header(void *context, enum MHD_ValueKind kind, const char *name, const char *value) {
    framing *f = context;
    (void)kind;
    if (!is_token(name)) f->bad_name = true;
    if (!strcasecmp(name, "Host"))
        f->hosts++;
    else if (!strcasecmp(name, "Transfer-Encoding"))
        f->encodings++;
    else if (!strcasecmp(name, "Content-Length")) {
        f->lengths++;
        if (!value || strcmp(value, "0") != 0) f->body = true;
    }
    return MHD_YES;
}

/* A NUL in the request line ends the library's strings early, so two readers of the same bytes could disagree. In
 * 0.9.7x method, target and version stand in one buffer, one blank (overwritten by zero) between; where another release
 * keeps them elsewhere, they are farther apart, and nothing is checked. */
static bool has_gap(uintptr_t text, size_t size, uintptr_t next) {
    return next > text && next - text <= 16384 && next - text != size + 1;
}

static bool has_nul(const lathe_request *request, const char *version) {
    return has_gap((uintptr_t)request->method, strlen(request->method), request->target_address) ||
           has_gap(request->target_address, strlen(request->logged), (uintptr_t)version);
}

unsigned lathe__request_vet(lathe_request *request, const char *version, const char **why) {
    framing f = {0};
    MHD_get_connection_values(request->connection, MHD_HEADER_KIND, count_header, &f);
    bool body = f.body || f.encodings || f.lengths > 1;
    request->close = body || f.bad_name;
    if (f.bad_name) return *why = "a malformed header name", 400;
    if (f.lengths > 1) return *why = "more than one Content-Length", 400;
    if (f.lengths && f.encodings) return *why = "both Content-Length and Transfer-Encoding", 400;
    if (f.hosts > 1) return *why = "more than one Host", 400;
    if (!request->logged) return *why = "out of memory", 503;
    if (has_nul(request, version)) return *why = "a NUL or a superfluous blank in the request line", 400;
    bool reads =
        !strcmp(request->method, "GET") || !strcmp(request->method, "HEAD") || !strcmp(request->method, "OPTIONS");
    if (body && reads) return *why = "this server takes no request bodies: send the request without one", 400;
    return 0;
}

/* ---- parsing ---- */

static int hex_digit(char c) {
    if (c >= '0' && c <= '9') return c - '0';
    c = (char)(c | 32);
    return c >= 'a' && c <= 'f' ? c - 'a' + 10 : -1;
}

/* Percent-decodes in place; false if malformed or if it yields a NUL. */
static bool decode(char *text, bool plus_is_blank) {
    char *out = text;
    for (char *p = text; *p; p++) {
        if (*p == '%') {
            int high = hex_digit(p[1]), low = high < 0 ? -1 : hex_digit(p[2]);
            if (low < 0 || !(high | low)) return false;
            *out++ = (char)(high << 4 | low);
            p += 2;
        } else
            *out++ = plus_is_blank && *p == '+' ? ' ' : *p;
    }
    *out = 0;
    return true;
}

static bool cut_query(lathe_request *request, char *query, const char **why) {
    for (char *part = query, *next; part && *part; part = next) {
        next = strchr(part, '&');
        if (next) *next++ = 0;
        if (!*part) continue;
        char *value = strchr(part, '=');
        if (value) *value++ = 0;
        if (!decode(part, true) || (value && !decode(value, true)))
            return *why = "a malformed percent escape in the query", false;
        if (request->query_count == LATHE_MAX_QUERY) return *why = "more than 16 query parameters", false;
        request->query[request->query_count].name = part;
        request->query[request->query_count++].value = value ? value : "";
    }
    static const char *const once[] = {"structure", "from", "to", "v", "tolerance", "smooth", "rays"};
    for (size_t k = 0; k < sizeof once / sizeof *once; k++) {
        unsigned seen = 0;
        for (unsigned i = 0; i < request->query_count; i++) seen += !strcmp(request->query[i].name, once[k]);
        if (seen > 1) return *why = "a query parameter is given twice", false;
    }
    return true;
}

/* Segments are cut before they are decoded: an escaped slash or dot never becomes structure. */
static bool cut_path(lathe_request *request, char *path, const char **why) {
    for (char *at = path + 1, *next; at; at = next) {
        next = strchr(at, '/');
        if (next) *next++ = 0;
        if (!decode(at, false)) return *why = "a malformed percent escape in the path", false;
        if (request->segment_count < LATHE_MAX_SEGMENTS) request->segments[request->segment_count] = at;
        request->segment_count++;
    }
    return true;
}

unsigned lathe__request_parse(lathe_request *request, const char **why) {
    char *target = request->target;
    if (!target) return *why = "out of memory", 503;
    for (const char *p = target; *p; p++)
        if (*p <= ' ' || *p >= 127 || *p == '#')
            return *why = "a character in the request target that must be escaped", 400;
    if (!strncasecmp(target, "http://", 7) || !strncasecmp(target, "https://", 8)) {
        target = strchr(target, ':') + 3;
        target += strcspn(target, "/?");
        if (!*target) return 0; /* the root, as no segment */
    }
    char *query = strchr(target, '?');
    if (query) *query++ = 0;
    if (!*target && request->target != target)
        target = NULL;
    else if (*target != '/')
        return *why = "the request target must begin with a slash", 400;
    if (target && target[1] && !cut_path(request, target, why)) return 400;
    return query && !cut_query(request, query, why) ? 400 : 0;
}

const char *lathe__request_header(const lathe_request *request, const char *name) {
    return MHD_lookup_connection_value(request->connection, MHD_HEADER_KIND, name);
}

const char *lathe__request_query(const lathe_request *request, const char *name) {
    for (unsigned i = 0; i < request->query_count; i++)
        if (!strcmp(request->query[i].name, name)) return request->query[i].value;
    return NULL;
}

bool lathe__parse_number(const char *text, uint32_t *number) {
    size_t size = strlen(text);
    if (!size || size > 4 || strspn(text, "0123456789") != size || (size > 1 && text[0] == '0')) return false;
    *number = (uint32_t)strtoul(text, NULL, 10);
    return true;
}

/* ---- arguments that several handlers take ---- */

lathe_entry *lathe__request_entry(lathe_request *request, enum MHD_Result *result) {
    lathe_entry *entry = lathe__store_find(request->service->store, request->captures[0]);
    if (!entry) {
        *result = lathe__respond_problem(request, 404, "there is no such model here: GET /models lists those that are");
        return NULL;
    }
    const char *version = lathe__request_query(request, "v");
    if (version && strcmp(version, entry->hash) != 0) {
        *result = lathe__respond_problem(
            request, 404, "this version of the model is not served: its manifest has the hash %s", entry->hash);
        lathe__entry_release(entry);
        return NULL;
    }
    return entry;
}

bool lathe__request_structure(lathe_request *request, const lathe_entry *entry, int64_t *structure,
                              enum MHD_Result *result) {
    const char *name = lathe__request_query(request, "structure");
    *structure = -1;
    if (!name) return true;
    if (!*name) {
        *result = lathe__respond_problem(request, 400, "structure= needs a name; leave it out for all structures");
        return false;
    }
    *structure = lathe_model_find(entry->model, name);
    if (*structure >= 0) return true;
    *result = lathe__respond_problem(request, 404,
                                     "the model has no structure of this name: /models/%s lists its %u structures",
                                     entry->id, entry->info->structure_count);
    return false;
}
