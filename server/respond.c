/* Every reply: representations with their validators, ranges and encodings; errors as application/problem+json. */
#include "service.h"
#include <inttypes.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const char METHODS[] = "GET, HEAD, OPTIONS";
/* The page is one file: its scripts and styles are inline, its decoder is wasm run in a worker made from a blob. */
static const char PAGE_POLICY[] =
    "default-src 'none'; script-src 'self' 'unsafe-inline' 'wasm-unsafe-eval' blob:; worker-src blob:; style-src "
    "'unsafe-inline'; "
    "img-src 'self' data: blob:; connect-src 'self' data: blob:; base-uri 'none'; form-action 'none'";

static bool add(struct MHD_Response *response, const char *name, const char *value) {
    return MHD_add_response_header(response, name, value) == MHD_YES;
}

static bool add_open_access(struct MHD_Response *response) {
    return add(response, "Access-Control-Allow-Origin", "*") &&
           add(response, "Access-Control-Expose-Headers", "ETag, Content-Range, Content-Length, Accept-Ranges");
}

static enum MHD_Result queue(lathe_request *request, unsigned status, struct MHD_Response *response, uint64_t size) {
    request->status = status;
    request->bytes = !strcmp(request->method, "HEAD") ? 0 : size;
    if (request->peer) lathe__peer_reply(request->peer, request->bytes);
    return MHD_queue_response(request->connection, status, response);
}

/* ---- errors ---- */

static const char *title_of(unsigned status) {
    switch (status) {
    case 400: return "Bad Request";
    case 404: return "Not Found";
    case 405: return "Method Not Allowed";
    case 406: return "Not Acceptable";
    case 416: return "Range Not Satisfiable";
    case 503: return "Service Unavailable";
    default: return "Internal Server Error";
    }
}

static enum MHD_Result send_problem(lathe_request *request, unsigned status, const char *extra, const char *extra_value,
                                    const char *detail) {
    json_t *json = json_pack("{s:s, s:s, s:i, s:o}", "type", "about:blank", "title", title_of(status), "status",
                             (int)status, "detail", lathe__json_name(detail));
    char *text = json ? json_dumps(json, JSON_INDENT(2)) : NULL;
    json_decref(json);
    if (!text) return MHD_NO;
    size_t size = strlen(text);
    struct MHD_Response *response = MHD_create_response_from_buffer_with_free_callback(size, text, free);
    if (!response) {
        free(text);
        return MHD_NO;
    }
    bool fine = add(response, "Content-Type", "application/problem+json") &&
                add(response, "Cache-Control", "no-store") && add(response, "X-Content-Type-Options", "nosniff") &&
                add_open_access(response) && (!extra || add(response, extra, extra_value)) &&
                (!request->close || add(response, "Connection", "close"));
    enum MHD_Result result = fine ? queue(request, status, response, size) : MHD_NO;
    MHD_destroy_response(response);
    return result;
}

enum MHD_Result lathe__respond_problem(lathe_request *request, unsigned status, const char *format, ...) {
    char detail[600];
    va_list args;
    va_start(args, format);
    (void)vsnprintf(detail, sizeof detail, format, args);
    va_end(args);
    return send_problem(request, status, NULL, NULL, detail);
}

enum MHD_Result lathe__respond_not_allowed(lathe_request *request) {
    return send_problem(request, 405, "Allow", METHODS, "only GET, HEAD and OPTIONS are answered here");
}

enum MHD_Result lathe__respond_options(lathe_request *request) {
    struct MHD_Response *response = MHD_create_response_from_buffer(0, NULL, MHD_RESPMEM_PERSISTENT);
    if (!response) return MHD_NO;
    bool fine = add(response, "Allow", METHODS) && add_open_access(response) &&
                add(response, "Access-Control-Allow-Methods", METHODS) &&
                add(response, "Access-Control-Allow-Headers", "Range, If-Range, If-None-Match, Cache-Control") &&
                add(response, "Access-Control-Max-Age", "86400");
    enum MHD_Result result = fine ? queue(request, 204, response, 0) : MHD_NO;
    MHD_destroy_response(response);
    return result;
}

/* ---- representations ---- */

static bool add_validators(struct MHD_Response *response, const lathe_representation *r, bool versioned) {
    return add(response, "ETag", r->etag) &&
           add(response, "Cache-Control", versioned ? "public, max-age=31536000, immutable" : "no-cache") &&
           (!(r->traits & LATHE_COMPRESSIBLE) || add(response, "Vary", "Accept-Encoding")) &&
           (r->traits & LATHE_PAGE || add_open_access(response));
}

static bool add_description(struct MHD_Response *response, const lathe_representation *r) {
    char disposition[160];
    snprintf(disposition, sizeof disposition, "inline; filename=\"%s\"", r->file_name);
    return add(response, "Content-Type", r->type) && add(response, "X-Content-Type-Options", "nosniff") &&
           (!(r->traits & LATHE_RANGES) || add(response, "Accept-Ranges", "bytes")) &&
           (!r->file_name[0] || add(response, "Content-Disposition", disposition)) &&
           (!(r->traits & LATHE_PAGE) || (add(response, "Content-Security-Policy", PAGE_POLICY) &&
                                          add(response, "Referrer-Policy", "no-referrer"))) &&
           (r->encoding == LATHE_IDENTITY ||
            add(response, "Content-Encoding", r->encoding == LATHE_BROTLI ? "br" : "gzip"));
}

/* A response of bytes [offset, offset + size) that holds the body while it is being sent. */
static struct MHD_Response *body_response(lathe_body *body, size_t offset, size_t size) {
    atomic_fetch_add(&body->references, 1);
    struct MHD_Response *response = MHD_create_response_from_buffer_with_free_callback_cls(
        size, (void *)(uintptr_t)(body->bytes + offset), lathe__body_release, body);
    if (!response) lathe__body_release(body);
    return response;
}

bool lathe__representation_dress(lathe_representation *r) {
    for (int versioned = 0; versioned < 2; versioned++) {
        r->full[versioned] = body_response(r->body, 0, r->body->size);
        r->unchanged[versioned] = MHD_create_response_from_buffer(0, NULL, MHD_RESPMEM_PERSISTENT);
        if (!r->full[versioned] || !r->unchanged[versioned]) return false;
        if (!add_validators(r->full[versioned], r, versioned) || !add_description(r->full[versioned], r)) return false;
        if (!add_validators(r->unchanged[versioned], r, versioned)) return false;
    }
    return true;
}

/* If-None-Match: weak comparison, as RFC 9110 has it. */
static bool matches(const char *list, const char *etag) {
    size_t size = strlen(etag);
    for (const char *p = list; *p;) {
        p += strspn(p, " \t,");
        if (*p == '*') return true;
        if (!strncmp(p, "W/", 2)) p += 2;
        if (!strncmp(p, etag, size) && (!p[size] || strchr(" \t,", p[size]))) return true;
        const char *quote = *p == '"' ? strchr(p + 1, '"') : NULL;
        p = quote ? quote + 1 : p + strcspn(p, ",");
    }
    return false;
}

typedef struct range {
    uint64_t first, count;
} range;
typedef enum range_kind { WHOLE, PART, UNSATISFIABLE } range_kind;

static bool read_position(const char **p, uint64_t *value) {
    const char *start = *p;
    for (*value = 0; **p >= '0' && **p <= '9'; (*p)++) {
        if (*p - start > 17) return false;
        *value = *value * 10 + (uint64_t)(**p - '0');
    }
    return *p > start;
}

/* One range of bytes. What is malformed, of another unit, or several ranges is ignored, as RFC 9110 allows. */
static range_kind parse_range(const char *text, uint64_t size, range *out) {
    uint64_t first = 0, last = 0;
    if (!text || strncmp(text, "bytes=", 6) != 0) return WHOLE;
    const char *p = text + 6;
    bool has_first = read_position(&p, &first);
    if (*p++ != '-') return WHOLE;
    bool has_last = read_position(&p, &last);
    if (*p || (!has_first && !has_last) || (has_first && has_last && last < first)) return WHOLE;
    if (!has_first) {
        if (!last || !size) return UNSATISFIABLE;
        *out = (range){last < size ? size - last : 0, last < size ? last : size};
        return PART;
    }
    if (first >= size) return UNSATISFIABLE;
    if (!has_last || last >= size) last = size - 1;
    *out = (range){first, last - first + 1};
    return PART;
}

static range_kind wanted_range(const lathe_request *request, const lathe_representation *r, range *out) {
    if (!(r->traits & LATHE_RANGES) || strcmp(request->method, "GET") != 0) return WHOLE;
    const char *condition = lathe__request_header(request, "If-Range");
    if (condition && strcmp(condition, r->etag) != 0) return WHOLE;
    return parse_range(lathe__request_header(request, "Range"), r->body->size, out);
}

static enum MHD_Result send_part(lathe_request *request, lathe_representation *r, range part, bool versioned) {
    char content_range[80];
    snprintf(content_range, sizeof content_range, "bytes %" PRIu64 "-%" PRIu64 "/%zu", part.first,
             part.first + part.count - 1, r->body->size);
    struct MHD_Response *response = body_response(r->body, (size_t)part.first, (size_t)part.count);
    if (!response) return MHD_NO;
    bool fine = add_validators(response, r, versioned) && add_description(response, r) &&
                add(response, "Content-Range", content_range);
    enum MHD_Result result = fine ? queue(request, 206, response, part.count) : MHD_NO;
    MHD_destroy_response(response);
    return result;
}

static enum MHD_Result send_representation(lathe_request *request, lathe_representation *r) {
    /* Pages and JSON also change with the program, so only the model's own bytes are kept for ever. */
    bool versioned = (r->traits & LATHE_RANGES) && lathe__request_query(request, "v");
    const char *known = lathe__request_header(request, "If-None-Match");
    if (known && matches(known, r->etag)) return queue(request, 304, r->unchanged[versioned], 0);
    range part = {0};
    switch (wanted_range(request, r, &part)) {
    case PART: return send_part(request, r, part, versioned);
    case UNSATISFIABLE: {
        char content_range[40], detail[80];
        snprintf(content_range, sizeof content_range, "bytes */%zu", r->body->size);
        snprintf(detail, sizeof detail, "the representation has %zu bytes", r->body->size);
        return send_problem(request, 416, "Content-Range", content_range, detail);
    }
    case WHOLE: break;
    }
    return queue(request, 200, r->full[versioned], r->body->size);
}

enum MHD_Result lathe__respond(lathe_request *request, const lathe_recipe *recipe) {
    bool compressible = (recipe->traits & LATHE_COMPRESSIBLE) != 0;
    lathe_encoding encoding = lathe__negotiate(lathe__request_header(request, "Accept-Encoding"), compressible);
    if (encoding == LATHE_NONE_ACCEPTABLE)
        return lathe__respond_problem(request, 406,
                                      compressible ? "Accept-Encoding excludes br, gzip and identity: allow one"
                                                   : "Accept-Encoding excludes identity, and this is sent as it is");
    lathe_representation *r;
    lathe_error err = {""};
    lathe_status status = lathe__cache_get(&r, request->service->cache, recipe, encoding, &err);
    if (status)
        return lathe__respond_problem(request, status == LATHE_ERR_MEMORY ? 503 : 500,
                                      "this could not be built: %s%s%s", lathe_status_name(status),
                                      err.text[0] ? ": " : "", err.text);
    enum MHD_Result result = send_representation(request, r);
    lathe__cache_release(request->service->cache, r);
    return result;
}
