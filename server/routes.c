/* The route table. A star matches one segment, or with a suffix one segment that ends in it; matches are captured in
 * order. The first pattern that fits wins. */
#include "service.h"
#include <string.h>

typedef struct route {
    const char *segments[6];
    lathe_handler handle;
} route;
static const route ROUTES[] = {
    {{0}, lathe__handle_index},
    {{"m", "*"}, lathe__handle_page},
    {{"models"}, lathe__handle_models},
    {{"models", "*.lathe"}, lathe__handle_archive},
    {{"models", "*"}, lathe__handle_manifest},
    {{"models", "*", "levels", "*"}, lathe__handle_level},
    {{"models", "*", "deltas", "*.lathe"}, lathe__handle_delta},
    {{"models", "*", "deltas", "*.drc"}, lathe__handle_draco_delta},
    {{"draco", "*"}, lathe__handle_draco_page},
    {{"extras.js"}, lathe__handle_extras},
    {{"models", "*", "stream"}, lathe__handle_stream},
    {{"models", "*", "slices", "*.png"}, lathe__handle_slice_picture},
    {{"models", "*", "slices", "*", "outline"}, lathe__handle_slice_outline},
    {{"models", "*", "slices", "*", "contour"}, lathe__handle_slice_contour},
    {{"healthz"}, lathe__handle_health},
};

/* Does the pattern segment fit? A captured text loses the pattern's suffix only when the whole route is taken. */
static bool fits(const char *pattern, const char *text) {
    if (pattern[0] != '*') return !strcmp(pattern, text);
    size_t suffix = strlen(pattern + 1), size = strlen(text);
    return size > suffix && !strcmp(text + size - suffix, pattern + 1);
}

static void capture(lathe_request *request, const route *taken) {
    unsigned captured = 0;
    for (unsigned i = 0; i < request->segment_count; i++) {
        const char *pattern = taken->segments[i];
        if (pattern[0] != '*') continue;
        char *text = request->segments[i];
        text[strlen(text) - strlen(pattern + 1)] = 0;
        request->captures[captured++] = text;
    }
}

static const route *find_route(lathe_request *request) {
    for (size_t k = 0; k < sizeof ROUTES / sizeof *ROUTES; k++) {
        unsigned count = 0;
        while (ROUTES[k].segments[count]) count++;
        if (count != request->segment_count) continue;
        unsigned i = 0;
        while (i < count && fits(ROUTES[k].segments[i], request->segments[i])) i++;
        if (i < count) continue;
        capture(request, &ROUTES[k]);
        return &ROUTES[k];
    }
    return NULL;
}

/* What is wrong with the request as a message is answered before its body is read: the library then closes the
 * connection, so that nothing that follows can be taken for a request. */
static enum MHD_Result begin(lathe_request *request, const char *version) {
    const char *why = "";
    unsigned status = lathe__request_vet(request, version, &why);
    if (!status && !request->close) {
        request->vetted = true;
        return MHD_YES;
    }
    request->close = true;
    return status ? lathe__respond_problem(request, status, "%s", why) : lathe__respond_not_allowed(request);
}

static enum MHD_Result answer(lathe_request *request) {
    const char *why = "";
    bool options = !strcmp(request->method, "OPTIONS");
    if (options && request->target && !strcmp(request->target, "*")) return lathe__respond_options(request);
    unsigned status = lathe__request_parse(request, &why);
    if (status) return lathe__respond_problem(request, status, "%s", why);
    const route *route = find_route(request);
    if (!route)
        return lathe__respond_problem(request, 404,
                                      "there is nothing at this address: docs/HTTP_API.md has the routes");
    if (options) return lathe__respond_options(request);
    if (strcmp(request->method, "GET") != 0 && strcmp(request->method, "HEAD") != 0)
        return lathe__respond_not_allowed(request);
    return route->handle(request);
}

/* The library calls this when the headers are in, and again when the body, which is empty, has been read: only a reply
 * queued then leaves the connection open for the next request. */
enum MHD_Result lathe__route(void *service, struct MHD_Connection *connection, const char *url, const char *method,
                             const char *version, const char *upload, size_t *upload_size, void **pointer) {
    lathe_request *request = *pointer;
    (void)service, (void)url, (void)upload, (void)connection, (void)upload_size;
    if (!request || !request->peer) return MHD_NO;
    if (request->vetted) return answer(request);
    request->method = method;
    lathe__peer_begin(request->peer);
    return begin(request, version);
}
