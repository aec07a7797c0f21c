/* /models/{m}/deltas/{n}.drc: level n out of level n - 1 for stock Draco decoders; /draco/{m}: the page that applies
 * them. */
#include "service.h"
#include <ctype.h>
#include <stdio.h>

typedef struct delta {
    lathe_entry *entry;
    int64_t structure;
    uint32_t level;
} delta;

static lathe_status build_delta(lathe_body *body, void *context, lathe_error *err) {
    const delta *d = context;
    lathe_buffer out = {0};
    body->bytes = (const uint8_t *)"";
    lathe_status status =
        lathe_write_draco_delta(d->entry->model, d->structure, d->level, lathe__buffer_append, &out, err);
    if (status) {
        lathe__buffer_free(&out);
        return status;
    }
    if (!out.bytes) return LATHE_OK; /* the level changes nothing */
    body->owned = out.bytes;
    body->bytes = out.bytes;
    body->size = out.size;
    return LATHE_OK;
}

/* aal-Thalamus_L-delta-3.drc: what needs no quoting anywhere. */
static void name_file(lathe_recipe *recipe, const delta *d) {
    char structure[34] = "";
    if (d->structure >= 0) snprintf(structure, sizeof structure, "-%s", d->entry->info->structures[d->structure].name);
    for (char *p = structure; *p; p++)
        if (!isalnum((unsigned char)*p) && *p != '_') *p = '-';
    snprintf(recipe->file_name, sizeof recipe->file_name, "%s%s-delta-%u.drc", d->entry->id, structure, d->level);
}

enum MHD_Result lathe__handle_draco_delta(lathe_request *request) {
    enum MHD_Result result;
    delta d = {lathe__request_entry(request, &result), -1, 0};
    if (!d.entry) return result;
    uint32_t last = lathe__entry_levels(d.entry, -1) - 1;
    if (!lathe__parse_number(request->captures[1], &d.level) || d.level > last)
        result =
            lathe__respond_problem(request, 404, "a Draco delta is named {n}.drc: the model has levels 0..%u", last);
    else if (lathe__request_structure(request, d.entry, &d.structure, &result)) {
        lathe_recipe recipe = {.type = "application/octet-stream",
                               .traits = LATHE_RANGES,
                               .entry = d.entry,
                               .build = build_delta,
                               .context = &d};
        snprintf(recipe.key, sizeof recipe.key, "%s:%s:draco:%lld:%u", d.entry->id, d.entry->hash,
                 (long long)d.structure, d.level);
        name_file(&recipe, &d);
        result = lathe__respond(request, &recipe);
    }
    lathe__entry_release(d.entry);
    return result;
}

static lathe_status build_page(lathe_body *body, void *context, lathe_error *err) {
    (void)context, (void)err;
    body->bytes = lathe_draco_html;
    body->size = lathe_draco_html_size;
    return LATHE_OK;
}

/* The same for all models: it asks for what it needs. */
enum MHD_Result lathe__handle_draco_page(lathe_request *request) {
    enum MHD_Result result;
    lathe_entry *entry = lathe__request_entry(request, &result);
    if (!entry) return result;
    lathe__entry_release(entry);
    lathe_recipe recipe = {.key = "draco-page",
                           .type = "text/html; charset=utf-8",
                           .traits = LATHE_COMPRESSIBLE | LATHE_PAGE,
                           .build = build_page};
    return lathe__respond(request, &recipe);
}
