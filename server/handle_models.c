/* /models: which models there are. /models/{m}: the manifest of one. */
#include "service.h"
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

typedef struct listing {
    lathe_entry **entries;
    size_t count;
    uint64_t generation;
} listing;

static bool open_listing(lathe_request *request, listing *list) {
    list->entries = lathe__store_list(request->service->store, &list->count, &list->generation);
    return list->entries != NULL;
}

static void close_listing(listing *list) {
    for (size_t i = 0; i < list->count; i++) lathe__entry_release(list->entries[i]);
    free(list->entries);
}

static void own(lathe_body *body, lathe_buffer *buffer) {
    body->owned = buffer->bytes;
    body->bytes = buffer->bytes;
    body->size = buffer->size;
}

static lathe_status write_json(lathe_body *body, json_t *json) {
    lathe_buffer buffer = {0};
    lathe_status status = lathe__json_write(&buffer, json);
    json_decref(json);
    if (status)
        lathe__buffer_free(&buffer);
    else
        own(body, &buffer);
    return status;
}

static lathe_status build_models(lathe_body *body, void *context, lathe_error *err) {
    const listing *list = context;
    json_t *models = json_array();
    (void)err;
    for (size_t i = 0; models && i < list->count; i++) {
        const lathe_entry *e = list->entries[i];
        size_t size;
        lathe_model_bytes(e->model, &size);
        json_array_append_new(models, json_pack("{s:s, s:o, s:s, s:i, s:i, s:I}", "id", e->id, "name",
                                                lathe__json_name(e->info->name ? e->info->name : e->id), "hash",
                                                e->hash, "structures", (int)e->info->structure_count, "levels",
                                                (int)e->info->level_count, "bytes", (json_int_t)size));
    }
    return write_json(body, json_pack("{s:o}", "models", models));
}

enum MHD_Result lathe__handle_models(lathe_request *request) {
    listing list;
    if (!open_listing(request, &list)) return lathe__respond_problem(request, 503, "out of memory");
    lathe_recipe recipe = {
        .type = "application/json", .traits = LATHE_COMPRESSIBLE, .build = build_models, .context = &list};
    snprintf(recipe.key, sizeof recipe.key, "models:%" PRIu64, list.generation);
    enum MHD_Result result = lathe__respond(request, &recipe);
    close_listing(&list);
    return result;
}

static lathe_status build_manifest(lathe_body *body, void *context, lathe_error *err) {
    (void)err;
    return write_json(body, lathe__manifest(context));
}

enum MHD_Result lathe__handle_manifest(lathe_request *request) {
    enum MHD_Result result;
    lathe_entry *entry = lathe__request_entry(request, &result);
    if (!entry) return result;
    lathe_recipe recipe = {.type = "application/json",
                           .traits = LATHE_COMPRESSIBLE,
                           .entry = entry,
                           .build = build_manifest,
                           .context = entry};
    snprintf(recipe.key, sizeof recipe.key, "%s:%s:manifest", entry->id, entry->hash);
    result = lathe__respond(request, &recipe);
    lathe__entry_release(entry);
    return result;
}
