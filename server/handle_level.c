/* /models/{m}/levels/{n}.{drc,glb,stl,ply}: a whole level as a mesh. */
#include "service.h"
#include <ctype.h>
#include <stdio.h>
#include <string.h>

typedef struct format {
    const char *suffix, *type;
} format;
static const format FORMATS[] = {{"drc", "application/octet-stream"},
                                 {"glb", "model/gltf-binary"},
                                 {"stl", "model/stl"},
                                 {"ply", "application/octet-stream"}};
enum { DRC, GLB, STL, PLY, FORMAT_COUNT };
enum { MOST_SMOOTH = 8 };
typedef struct level {
    lathe_entry *entry;
    int64_t structure;
    uint32_t level, smooth;    /* smooth: pieces of an edge, 0: flat triangles */
    int format;
} level;

static lathe_status write_mesh(lathe_buffer *out, const lathe_world_mesh *mesh, const level *l) {
    const lathe_model_info *info = l->entry->info;
    const char *name = l->structure < 0 ? info->name : info->structures[l->structure].name;
    lathe_write_options options = {info, name};
    switch (l->format) {
    case DRC: return lathe_write_drc(mesh, 0, lathe__buffer_append, out);
    case GLB: return lathe_write_glb(mesh, &options, lathe__buffer_append, out);
    case STL: return lathe_write_stl(mesh, &options, lathe__buffer_append, out);
    default: return lathe_write_ply(mesh, &options, lathe__buffer_append, out);
    }
}

static lathe_status build_level(lathe_body *body, void *context, lathe_error *err) {
    const level *l = context;
    lathe_world_mesh mesh = {0};
    lathe_buffer out = {0};
    lathe_status status = lathe_model_mesh(&mesh, l->entry->model, l->structure, l->level, err);
    if (!status && l->smooth && (status = lathe_world_mesh_smooth(&mesh, l->smooth)) != LATHE_OK)
        lathe_world_mesh_free(&mesh);
    if (!status) {
        status = write_mesh(&out, &mesh, l);
        lathe_world_mesh_free(&mesh);
    }
    if (status) {
        lathe__buffer_free(&out);
        return status;
    }
    body->owned = out.bytes;
    body->bytes = out.bytes;
    body->size = out.size;
    return LATHE_OK;
}

/* `3.glb` */
static bool parse_name(const char *name, uint32_t *number, int *kind) {
    char digits[8];
    const char *dot = strchr(name, '.');
    if (!dot || dot - name >= (int)sizeof digits) return false;
    memcpy(digits, name, (size_t)(dot - name));
    digits[dot - name] = 0;
    for (*kind = 0; *kind < FORMAT_COUNT && strcmp(dot + 1, FORMATS[*kind].suffix) != 0; ++*kind) continue;
    return *kind < FORMAT_COUNT && lathe__parse_number(digits, number);
}

/* aal-Thalamus_L-3.glb: what needs no quoting anywhere. */
static void name_file(lathe_recipe *recipe, const level *l) {
    const char *id = l->entry->id, *suffix = FORMATS[l->format].suffix;
    char structure[34] = "";
    if (l->structure >= 0) snprintf(structure, sizeof structure, "-%s", l->entry->info->structures[l->structure].name);
    for (char *p = structure; *p; p++)
        if (!isalnum((unsigned char)*p) && *p != '_') *p = '-';
    snprintf(recipe->file_name, sizeof recipe->file_name, "%s%s-%u.%s", id, structure, l->level, suffix);
}

static enum MHD_Result reply(lathe_request *request, level *l) {
    uint32_t last = lathe__entry_levels(l->entry, -1) - 1;
    if (l->level > last) return lathe__respond_problem(request, 404, "the model has levels 0..%u", last);
    /* A structure that is complete earlier stays at its last level. */
    uint32_t own_last = lathe__entry_levels(l->entry, l->structure) - 1;
    if (l->level > own_last) l->level = own_last;
    lathe_recipe recipe = {
        .type = FORMATS[l->format].type, .traits = LATHE_RANGES, .entry = l->entry, .build = build_level, .context = l};
    snprintf(recipe.key, sizeof recipe.key, "%s:%s:level:%lld:%u:%d:%u", l->entry->id, l->entry->hash,
             (long long)l->structure, l->level, l->format, l->smooth);
    name_file(&recipe, l);
    return lathe__respond(request, &recipe);
}

/* ?smooth=K; false: *result is the complaint. */
static bool query_smooth(lathe_request *request, uint32_t *out, enum MHD_Result *result) {
    const char *text = lathe__request_query(request, "smooth");
    if (!text || (lathe__parse_number(text, out) && *out >= 1 && *out <= MOST_SMOOTH)) return true;
    *result = lathe__respond_problem(request, 400, "smooth must be 1 to %d: how many pieces an edge is cut into",
                                     MOST_SMOOTH);
    return false;
}

enum MHD_Result lathe__handle_level(lathe_request *request) {
    enum MHD_Result result;
    level l = {lathe__request_entry(request, &result), -1, 0, 0, 0};
    if (!l.entry) return result;
    if (!parse_name(request->captures[1], &l.level, &l.format))
        result =
            lathe__respond_problem(request, 404, "a level is named {n}.drc, {n}.glb, {n}.stl or {n}.ply, n in 0..%u",
                                   lathe__entry_levels(l.entry, -1) - 1);
    else if (query_smooth(request, &l.smooth, &result) &&
             lathe__request_structure(request, l.entry, &l.structure, &result))
        result = reply(request, &l);
    lathe__entry_release(l.entry);
    return result;
}
