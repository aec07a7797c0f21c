/* /m/{model}: the viewer on one model in one response. The page as it was built has one placeholder, which becomes the
 * manifest, the base shape and the smallest decoder that reads them, so that the first bytes a browser gets are all it
 * needs to draw. / : the same page without a model; it then lists those there are. */
#include "service.h"
#include <stdio.h>
#include <string.h>

static const char PLACEHOLDER[] = "<!--LATHE_MODEL-->";
typedef struct page {
    lathe_entry *entry;
    int64_t structure;
} page; /* entry NULL: no model */

/* The stream's beginning, as JSON text in base64; NULL: *status says why. */
static json_t *base_json(const page *p, lathe_status *status) {
    lathe_buffer base = {0}, text = {0};
    *status = lathe_model_stream(p->entry->model, p->structure, 0, 0, lathe__buffer_append, &base);
    bool coded = !*status && !lathe__buffer_base64(&text, base.bytes, base.size);
    json_t *json = coded ? json_stringn((const char *)text.bytes, text.size) : NULL;
    if (!json && !*status) *status = LATHE_ERR_MEMORY;
    lathe__buffer_free(&base);
    lathe__buffer_free(&text);
    return json;
}

/* What the viewer has to know of the model, and its base shape. */
static lathe_status write_manifest(lathe_buffer *out, const page *p) {
    lathe_status status;
    json_t *base = base_json(p, &status), *manifest = base ? lathe__page_manifest(p->entry, p->structure) : NULL;
    if (!manifest) {
        json_decref(base);
        return status ? status : LATHE_ERR_MEMORY;
    }
    status = json_object_set_new(manifest, "base", base) ? LATHE_ERR_MEMORY : lathe__json_write(out, manifest);
    json_decref(manifest);
    return status;
}

static lathe_status write_decoder(lathe_buffer *out, lathe_small_decoder which) {
    if (which == LATHE_DECODER_RASTERS) return lathe__buffer_append(out, lathe_rasters_text, lathe_rasters_text_size) ? LATHE_ERR_MEMORY : LATHE_OK;
    if (which == LATHE_DECODER_TUBES) return lathe__buffer_append(out, lathe_tubes_text, lathe_tubes_text_size) ? LATHE_ERR_MEMORY : LATHE_OK;
    return lathe__buffer_append(out, lathe_decoder_text, lathe_decoder_text_size) ? LATHE_ERR_MEMORY : LATHE_OK;
}

static lathe_status write_model(lathe_buffer *out, const page *p) {
    lathe_status status = LATHE_OK;
    if (lathe__buffer_text(out, "<script type=\"text/plain\" id=\"model\">")) status = LATHE_ERR_MEMORY;
    if (!status) status = write_manifest(out, p);
    if (!status && lathe__buffer_text(out, "</script><script type=\"text/plain\" id=\"wasm\">")) status = LATHE_ERR_MEMORY;
    if (!status) status = write_decoder(out, lathe_model_decoder(p->entry->model));
    if (!status && lathe__buffer_text(out, "</script>")) status = LATHE_ERR_MEMORY;
    return status;
}

static lathe_status build_page(lathe_body *body, void *context, lathe_error *err) {
    const page *p = context;
    const unsigned char *at = memmem(lathe_viewer_html, lathe_viewer_html_size, PLACEHOLDER, sizeof PLACEHOLDER - 1);
    if (!at)
        return lathe_fail(err, LATHE_ERR_FORMAT, "the viewer page was built without its placeholder: run `make web`");
    size_t before = (size_t)(at - lathe_viewer_html), skipped = before + sizeof PLACEHOLDER - 1;
    lathe_buffer out = {0};
    lathe_status status = lathe__buffer_append(&out, lathe_viewer_html, before) ? LATHE_ERR_MEMORY : LATHE_OK;
    if (!status && p->entry) status = write_model(&out, p);
    if (!status && lathe__buffer_append(&out, lathe_viewer_html + skipped, lathe_viewer_html_size - skipped))
        status = LATHE_ERR_MEMORY;
    if (status) {
        lathe__buffer_free(&out);
        return status;
    }
    body->owned = out.bytes;
    body->bytes = out.bytes;
    body->size = out.size;
    return LATHE_OK;
}

enum MHD_Result lathe__handle_index(lathe_request *request) {
    page none = {NULL, -1};
    lathe_recipe recipe = {.key = "index",
                           .type = "text/html; charset=utf-8",
                           .traits = LATHE_COMPRESSIBLE | LATHE_PAGE,
                           .build = build_page,
                           .context = &none};
    return lathe__respond(request, &recipe);
}

enum MHD_Result lathe__handle_page(lathe_request *request) {
    enum MHD_Result result;
    page p = {lathe__request_entry(request, &result), -1};
    if (!p.entry) return result;
    if (lathe__request_structure(request, p.entry, &p.structure, &result)) {
        lathe_recipe recipe = {.type = "text/html; charset=utf-8",
                               .traits = LATHE_COMPRESSIBLE | LATHE_PAGE,
                               .entry = p.entry,
                               .build = build_page,
                               .context = &p};
        snprintf(recipe.key, sizeof recipe.key, "%s:%s:page:%lld", p.entry->id, p.entry->hash, (long long)p.structure);
        result = lathe__respond(request, &recipe);
    }
    lathe__entry_release(p.entry);
    return result;
}

static lathe_status build_extras(lathe_body *body, void *context, lathe_error *err) {
    (void)context, (void)err;
    body->bytes = lathe_extras_js;
    body->size = lathe_extras_js_size;
    return LATHE_OK;
}

enum MHD_Result lathe__handle_extras(lathe_request *request) {
    lathe_recipe recipe = {
        .key = "extras", .type = "text/javascript; charset=utf-8", .traits = LATHE_COMPRESSIBLE, .build = build_extras};
    return lathe__respond(request, &recipe);
}
