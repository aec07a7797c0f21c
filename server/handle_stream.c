/* /models/{m}/stream, /models/{m}/deltas/{n}.lathe, /models/{m}.lathe: the archive's own bytes. Of all structures they
 * are sent from the mapped file as they lie there. */
#include "service.h"
#include <stdio.h>

typedef struct stream {
    lathe_entry *entry;
    int64_t structure;
    uint32_t from, to;
} stream;

static void lend(lathe_body *body, lathe_entry *entry, size_t offset, size_t size) {
    size_t whole;
    body->entry = lathe__entry_retain(entry);
    body->bytes = lathe_model_bytes(entry->model, &whole) + offset;
    body->size = size;
}

static lathe_status build_stream(lathe_body *body, void *context, lathe_error *err) {
    const stream *s = context;
    body->bytes = (const uint8_t *)"";
    /* After the last level there is nothing: that is no error, since a client that has level n asks for n + 1. */
    if (s->from >= lathe__entry_levels(s->entry, s->structure)) return LATHE_OK;
    if (s->structure < 0) {
        size_t offset, size;
        lathe_model_stream_range(s->entry->model, s->from, s->to, &offset, &size);
        lend(body, s->entry, offset, size);
        return LATHE_OK;
    }
    lathe_buffer out = {0};
    (void)err;
    lathe_status status = lathe_model_stream(s->entry->model, s->structure, s->from, s->to, lathe__buffer_append, &out);
    if (status) {
        lathe__buffer_free(&out);
        return status;
    }
    body->owned = out.bytes;
    body->bytes = out.bytes;
    body->size = out.size;
    return LATHE_OK;
}

static enum MHD_Result reply(lathe_request *request, stream *s) {
    lathe_recipe recipe = {.type = "application/octet-stream",
                           .traits = LATHE_RANGES,
                           .entry = s->entry,
                           .build = build_stream,
                           .context = s};
    snprintf(recipe.key, sizeof recipe.key, "%s:%s:stream:%lld:%u:%u", s->entry->id, s->entry->hash,
             (long long)s->structure, s->from, s->to);
    return lathe__respond(request, &recipe);
}

/* A level out of the query: *level stays if it is not given. */
static bool query_level(lathe_request *request, const char *name, uint32_t last, uint32_t *out,
                        enum MHD_Result *result) {
    const char *text = lathe__request_query(request, name);
    if (!text || lathe__parse_number(text, out)) return true;
    *result = lathe__respond_problem(request, 400, "%s is not a level: the model has levels 0..%u", name, last);
    return false;
}

enum MHD_Result lathe__handle_stream(lathe_request *request) {
    enum MHD_Result result;
    stream s = {lathe__request_entry(request, &result), -1, 0, 0};
    if (!s.entry) return result;
    uint32_t last = lathe__entry_levels(s.entry, -1) - 1;
    if (query_level(request, "from", last, &s.from, &result) && query_level(request, "to", last, &s.to, &result) &&
        lathe__request_structure(request, s.entry, &s.structure, &result)) {
        if (s.to > last || !lathe__request_query(request, "to")) s.to = last;
        if (s.from > last + 1 || (s.from > s.to && s.from <= last))
            result =
                lathe__respond_problem(request, 400, "from must not be beyond to: the model has levels 0..%u", last);
        else
            result = reply(request, &s);
    }
    lathe__entry_release(s.entry);
    return result;
}

enum MHD_Result lathe__handle_delta(lathe_request *request) {
    enum MHD_Result result;
    stream s = {lathe__request_entry(request, &result), -1, 0, 0};
    if (!s.entry) return result;
    uint32_t last = lathe__entry_levels(s.entry, -1) - 1;
    if (!lathe__parse_number(request->captures[1], &s.from) || s.from > last)
        result = lathe__respond_problem(request, 404, "a delta is named {n}.lathe: the model has levels 0..%u", last);
    else if (lathe__request_structure(request, s.entry, &s.structure, &result)) {
        s.to = s.from;
        result = reply(request, &s);
    }
    lathe__entry_release(s.entry);
    return result;
}

static lathe_status build_archive(lathe_body *body, void *context, lathe_error *err) {
    lathe_entry *entry = context;
    size_t size;
    (void)err;
    lathe_model_bytes(entry->model, &size);
    lend(body, entry, 0, size);
    return LATHE_OK;
}

enum MHD_Result lathe__handle_archive(lathe_request *request) {
    enum MHD_Result result;
    lathe_entry *entry = lathe__request_entry(request, &result);
    if (!entry) return result;
    lathe_recipe recipe = {.type = "application/octet-stream",
                           .traits = LATHE_RANGES,
                           .entry = entry,
                           .build = build_archive,
                           .context = entry};
    snprintf(recipe.key, sizeof recipe.key, "%s:%s:archive", entry->id, entry->hash);
    snprintf(recipe.file_name, sizeof recipe.file_name, "%s.lathe", entry->id);
    result = lathe__respond(request, &recipe);
    lathe__entry_release(entry);
    return result;
}
