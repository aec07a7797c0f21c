/* /models/{m}/slices/{k}.png, .../{k}/outline, .../{k}/contour: one slice, drawn from the voxels that the last level
 * has. */
#include "centre.h"
#include "hierarchy.h"
#include "model_slice.h"
#include "png_picture.h"
#include "service.h"
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { MIN_RAYS = 4, DEFAULT_RAYS = 64, MAX_RAYS = 4096 };

typedef struct slice {
    lathe_request *request;
    lathe_entry *entry;
    int64_t structure;
    int32_t number;
    lathe_slice_frame frame;
    double tolerance;
    uint32_t rays;
} slice;
/* What a reply is written from. */
typedef struct writing {
    const slice *slice;
    lathe_slices slices;
    lathe_buffer out;
    lathe_arena arena;
    bool began;                /* a loop has been written: the next one needs a comma */
} writing;

/* ---- frame and voxels, kept in the cache as representations of their own ---- */

static lathe_status build_frame(lathe_body *body, void *context, lathe_error *err) {
    const slice *s = context;
    lathe_slice_frame *frame = calloc(1, sizeof *frame);
    if (!frame) return LATHE_ERR_MEMORY;
    body->owned = (uint8_t *)frame;
    body->bytes = body->owned;
    body->size = sizeof *frame;
    return lathe__slice_frame(frame, s->entry->model, s->structure, err);
}

static lathe_status build_voxels(lathe_body *body, void *context, lathe_error *err) {
    const slice *s = context;
    lathe_status status = lathe__slices_decode(&body->owned, &body->size, s->entry->model, s->structure, err);
    body->bytes = body->owned;
    return status;
}

/* To be released. */
static lathe_status get(lathe_representation **out, slice *s, const char *what, lathe_build build, lathe_error *err) {
    lathe_recipe recipe = {.type = "application/octet-stream", .entry = s->entry, .build = build, .context = s};
    snprintf(recipe.key, sizeof recipe.key, "%s:%s:%s:%lld", s->entry->id, s->entry->hash, what,
             (long long)s->structure);
    return lathe__cache_get(out, s->request->service->cache, &recipe, LATHE_IDENTITY, err);
}

static lathe_status get_frame(slice *s, lathe_error *err) {
    lathe_representation *frame;
    lathe_status status = get(&frame, s, "frame", build_frame, err);
    if (status) return status;
    memcpy(&s->frame, frame->body->bytes, sizeof s->frame);
    lathe__cache_release(s->request->service->cache, frame);
    return LATHE_OK;
}

/* ---- text ---- */

__attribute__((format(printf, 2, 3))) static lathe_status put(writing *w, const char *format, ...) {
    char text[256];
    va_list list;
    va_start(list, format);
    vsnprintf(text, sizeof text, format, list);
    va_end(list);
    return lathe__buffer_text(&w->out, text) ? LATHE_ERR_MEMORY : LATHE_OK;
}

/* Nine digits: far finer than the lattice, in any unit. */
static lathe_status put_place(writing *w, const double p[3]) { return put(w, "[%.9g,%.9g,%.9g]", p[0], p[1], p[2]); }

static lathe_status put_points(writing *w, const lathe_slice_structure *s, const lathe_point *points, uint32_t count) {
    lathe_status status = put(w, "\"points\":[");
    for (uint32_t i = 0; i < count && !status; i++) {
        double world[3];
        lathe__slice_point(world, s, w->slice->number, points[i]);
        status = i ? put(w, ",") : LATHE_OK;
        if (!status) status = put_place(w, world);
    }
    return status ? status : put(w, "]");
}

static lathe_status put_name(writing *w, const lathe_slice_structure *s, bool hole) {
    json_t *name = lathe__json_name(w->slice->entry->info->structures[s->structure].name);
    char *text = name ? json_dumps(name, JSON_ENCODE_ANY) : NULL;
    lathe_status status = put(w, "%s\n{\"structure\":", w->began ? "," : "");
    if (!text || (!status && lathe__buffer_text(&w->out, text))) status = LATHE_ERR_MEMORY;
    w->began = true;
    free(text);
    json_decref(name);
    return status ? status : put(w, ",\"hole\":%s,", hole ? "true" : "false");
}

/* Where the picture lies: its left upper corner, and the way from one pixel to the next. */
static lathe_status put_picture(writing *w) {
    const lathe_slice_frame *f = &w->slice->frame;
    double corner[3], right[3], down[3];
    lathe__slice_place(corner, f, w->slice->number, 0, 0);
    lathe__slice_place(right, f, w->slice->number, 1, 0);
    lathe__slice_place(down, f, w->slice->number, 0, 1);
    for (int k = 0; k < 3; k++) right[k] -= corner[k], down[k] -= corner[k];
    lathe_status status = put(w, "\"picture\":{\"width\":%u,\"height\":%u,\"corner\":", f->width, f->height);
    if (!status) status = put_place(w, corner);
    if (!status) status = put(w, ",\"right\":");
    if (!status) status = put_place(w, right);
    if (!status) status = put(w, ",\"down\":");
    if (!status) status = put_place(w, down);
    return status ? status : put(w, "},");
}

/* ---- what the three write ---- */

static lathe_status write_picture(writing *w) {
    const slice *s = w->slice;
    uint8_t *rgba = calloc((size_t)s->frame.width * s->frame.height, 4);
    if (!rgba) return LATHE_ERR_MEMORY;
    lathe__slice_draw(rgba, &s->frame, &w->slices, s->entry->info, s->number);
    lathe_status status =
        lathe__png_write(&w->out.bytes, &w->out.size, rgba, s->frame.width, s->frame.height, s->frame.pixel_mm);
    free(rgba);
    return status;
}

static lathe_status put_loops(writing *w, const lathe_slice_structure *s, const lathe_outline *outline) {
    lathe_status status = LATHE_OK;
    for (uint32_t l = 0; l < outline->loop_count && !status; l++) {
        const lathe_loop *loop = &outline->loops[l];
        status = put_name(w, s, loop->hole);
        if (!status) status = put_points(w, s, outline->points + loop->first, loop->count);
        if (!status) status = put(w, "}");
    }
    return status;
}

static lathe_status write_outline(writing *w) {
    const slice *s = w->slice;
    double tolerance = s->frame.stretch > 0 ? s->tolerance / s->frame.stretch : 0;
    lathe_status status = put(w, "{\"slice\":%d,\"tolerance_mm\":%.9g,", s->number, s->tolerance);
    if (!status) status = put_picture(w);
    if (!status) status = put(w, "\"loops\":[");
    for (size_t i = 0; i < w->slices.count && !status; i++) {
        lathe_outline whole, outline;
        status = lathe__slice_outline(&whole, &w->arena, &w->slices, i, s->number);
        outline = whole;
        if (!status && whole.loop_count && tolerance > 0)
            status = lathe__simplify_section(&outline, &w->arena, &whole, tolerance);
        if (!status) status = put_loops(w, &w->slices.structures[i], &outline);
        lathe__arena_reset(&w->arena);
    }
    return status ? status : put(w, "]}\n");
}

static lathe_status put_crossings(writing *w, const lathe_ray_contour *c) {
    static const char *const names[] = {"f", "b", "ui", "uo", "di", "do"};
    lathe_status status = put(w, ",\"rays\":[");
    for (uint32_t i = 0; i < c->count && !status; i++) status = put(w, "%s%u", i ? "," : "", c->crossings[i].ray);
    if (!status) status = put(w, "],\"in_out\":[");
    for (uint32_t i = 0; i < c->count && !status; i++)
        status = put(w, "%s%s", i ? "," : "", c->crossings[i].in_out ? "true" : "false");
    if (!status) status = put(w, "],\"edges\":[");
    for (uint32_t i = 0; i < c->count && !status; i++)
        status = put(w, "%s\"%s\"", i ? "," : "", names[c->types[i] % 6]);
    return status ? status : put(w, "]}");
}

/* A loop and what its rays meet. A loop that does not go round its centre, by so few rays, has no crossings. */
static lathe_status put_contour(writing *w, const lathe_slice_structure *s, const lathe_outline *outline, uint32_t l) {
    const lathe_loop *loop = &outline->loops[l];
    lathe_point *points = LATHE_NEW(&w->arena, lathe_point, loop->count), centre;
    if (!points) return LATHE_ERR_MEMORY;
    for (uint32_t i = 0; i < loop->count; i++)
        points[i] = outline->points[loop->first + (loop->hole ? loop->count - 1 - i : i)];
    lathe_ray_contour contour = {0};
    lathe_status status = lathe__loop_centre(&centre, &w->arena, points, loop->count);
    if (status) return status;
    status = lathe__make_ray_contour(&contour, &w->arena, points, loop->count, centre, w->slice->rays, 0);
    if (status == LATHE_ERR_RANGE) contour = (lathe_ray_contour){0};
    else if (status) return status;
    double world[3];
    lathe__slice_point(world, s, w->slice->number, centre);
    status = put_name(w, s, loop->hole);
    if (!status) status = put(w, "\"centre\":");
    if (!status) status = put_place(w, world);
    if (!status) status = put(w, ",");
    if (!status) status = put_points(w, s, contour.points, contour.count);
    return status ? status : put_crossings(w, &contour);
}

static lathe_status write_contour(writing *w) {
    const slice *s = w->slice;
    lathe_status status = put(w, "{\"slice\":%d,\"ray_count\":%u,", s->number, s->rays);
    if (!status) status = put_picture(w);
    if (!status) status = put(w, "\"loops\":[");
    for (size_t i = 0; i < w->slices.count && !status; i++) {
        lathe_outline outline;
        status = lathe__slice_outline(&outline, &w->arena, &w->slices, i, s->number);
        for (uint32_t l = 0; !status && l < outline.loop_count; l++)
            status = put_contour(w, &w->slices.structures[i], &outline, l);
        lathe__arena_reset(&w->arena);
    }
    return status ? status : put(w, "]}\n");
}

/* ---- replies ---- */

static lathe_status build(lathe_body *body, slice *s, lathe_status (*write)(writing *), lathe_error *err) {
    lathe_representation *voxels;
    lathe_status status = get(&voxels, s, "voxels", build_voxels, err);
    if (status) return status;
    writing w = {.slice = s, .slices = lathe__slices_view(voxels->body->bytes)};
    status = write(&w);
    lathe__cache_release(s->request->service->cache, voxels);
    lathe__arena_free(&w.arena);
    if (status) {
        lathe__buffer_free(&w.out);
        return lathe_fail(err, status, "slice %d", s->number);
    }
    body->owned = w.out.bytes;
    body->bytes = w.out.bytes;
    body->size = w.out.size;
    return LATHE_OK;
}
static lathe_status build_picture(lathe_body *body, void *context, lathe_error *err) {
    return build(body, context, write_picture, err);
}
static lathe_status build_outline(lathe_body *body, void *context, lathe_error *err) {
    return build(body, context, write_outline, err);
}
static lathe_status build_contour(lathe_body *body, void *context, lathe_error *err) {
    return build(body, context, write_contour, err);
}

typedef enum kind { PICTURE, OUTLINE, CONTOUR } kind;

static enum MHD_Result reply(lathe_request *request, slice *s, kind kind) {
    static const lathe_build builds[] = {build_picture, build_outline, build_contour};
    lathe_recipe recipe = {.type = kind == PICTURE ? "image/png" : "application/json",
                           .traits = kind == PICTURE ? LATHE_RANGES : LATHE_COMPRESSIBLE,
                           .entry = s->entry, .build = builds[kind], .context = s};
    snprintf(recipe.key, sizeof recipe.key, "%s:%s:slice:%lld:%d:%d:%.17g:%u", s->entry->id, s->entry->hash,
             (long long)s->structure, s->number, (int)kind, s->tolerance, s->rays);
    return lathe__respond(request, &recipe);
}

/* Digits with at most one point: what strtod takes beyond that (signs, hexadecimals, "inf") is no length. */
static bool parse_length(const char *text, double *out) {
    size_t digits = strspn(text, "0123456789"), more = 0, size = strlen(text);
    bool point = text[digits] == '.';
    if (point) more = strspn(text + digits + 1, "0123456789");
    if (!(digits + more) || digits + point + more != size || size > 20) return false;
    *out = 0;
    for (const char *p = text; *p; p++)
        if (*p != '.') *out = *out * 10 + (*p - '0');
    *out /= pow(10, (double)more);
    return *out <= 1e6;
}

static bool query(lathe_request *request, slice *s, kind kind, enum MHD_Result *result) {
    const char *tolerance = lathe__request_query(request, "tolerance"), *rays = lathe__request_query(request, "rays");
    if (kind == OUTLINE && tolerance && !parse_length(tolerance, &s->tolerance)) {
        *result = lathe__respond_problem(
            request, 400, "tolerance is not a length in mm: digits and at most one point, 0..1000000");
        return false;
    }
    if (kind != CONTOUR) return true;
    s->rays = DEFAULT_RAYS;
    if (rays &&
        (!lathe__parse_number(rays, &s->rays) || s->rays < MIN_RAYS || s->rays > MAX_RAYS || s->rays & (s->rays - 1))) {
        *result = lathe__respond_problem(request, 400, "rays is not a power of two in %d..%d", MIN_RAYS, MAX_RAYS);
        return false;
    }
    return true;
}

static enum MHD_Result find_slice(lathe_request *request, slice *s, kind kind) {
    uint32_t number;
    lathe_error err = {""};
    lathe_status status = get_frame(s, &err);
    if (status)
        return lathe__respond_problem(request, status == LATHE_ERR_MEMORY ? 503 : 500,
                                      "the model's slices cannot be read: %s", err.text);
    const int32_t *low = s->frame.low, *high = s->frame.high;
    if (!lathe__parse_number(request->captures[1], &number) || (int32_t)number < low[2] || (int32_t)number > high[2])
        return lathe__respond_problem(request, 404, "%s has slices %d..%d, counted in the volume along its axis %c",
                                      s->structure < 0 ? "the model" : "the structure", low[2], high[2],
                                      'x' + s->entry->info->axis);
    s->number = (int32_t)number;
    return reply(request, s, kind);
}

static enum MHD_Result handle(lathe_request *request, kind kind) {
    enum MHD_Result result;
    slice s = {.request = request, .entry = lathe__request_entry(request, &result), .structure = -1};
    if (!s.entry) return result;
    if (lathe__request_structure(request, s.entry, &s.structure, &result) && query(request, &s, kind, &result))
        result = find_slice(request, &s, kind);
    lathe__entry_release(s.entry);
    return result;
}

enum MHD_Result lathe__handle_slice_picture(lathe_request *request) { return handle(request, PICTURE); }
enum MHD_Result lathe__handle_slice_outline(lathe_request *request) { return handle(request, OUTLINE); }
enum MHD_Result lathe__handle_slice_contour(lathe_request *request) { return handle(request, CONTOUR); }
