/* lathe draw: one contour of a slice with its rays, crossings, edge types and derivation tree, as SVG. */
#include "centre.h"
#include "cli.h"
#include "contour_json.h"
#include "derivation.h"
#include "draw_contour.h"
#include "mask.h"
#include <inttypes.h>
#include <stdlib.h>
#include <string.h>

typedef struct draw_arguments {
    const char *input, *output, *slice, *iso, *label, *axis, *rays, *turn, *loop;
} draw_arguments;
typedef struct draw_settings {
    int axis; /* -1: auto */
    int64_t slice, label, rays, loop;
    double iso, turn;
} draw_settings;

static int parse_settings(draw_settings *s, const draw_arguments *a) {
    static const char *const axes[] = {"x", "y", "z"};
    const lathe_command *command = &lathe__command_draw;
    *s = (draw_settings){.axis = -1, .rays = 16};
    if (a->iso && a->label) return lathe__usage_error(command, "only one of --iso and --label");
    if (!a->slice) return lathe__usage_error(command, "--slice K is needed");
    if (!lathe__option_integer(&s->slice, a->slice, 0, LATHE_MAX_DIM - 1))
        return lathe__usage_error(command, "--slice %s: a slice number from 0 on is needed", a->slice);
    if (a->iso && !lathe__option_number(&s->iso, a->iso))
        return lathe__usage_error(command, "--iso %s: a number is needed", a->iso);
    if (a->label && !lathe__option_integer(&s->label, a->label, -(1 << 24), 1 << 24))
        return lathe__usage_error(command, "--label %s: a whole number is needed", a->label);
    if (a->axis && strcmp(a->axis, "auto") != 0) {
        for (int i = 0; i < 3; i++)
            if (strcmp(a->axis, axes[i]) == 0) s->axis = i;
        if (s->axis < 0) return lathe__usage_error(command, "--axis %s: it is one of x, y, z, auto", a->axis);
    }
    if (a->rays && (!lathe__option_integer(&s->rays, a->rays, 4, 4096) || (s->rays & (s->rays - 1))))
        return lathe__usage_error(command, "--rays %s: a power of two from 4 to 4096 is needed", a->rays);
    if (a->turn && (!lathe__option_number(&s->turn, a->turn) || s->turn < -360 || s->turn > 360))
        return lathe__usage_error(command, "--turn %s: degrees from -360 to 360 are needed", a->turn);
    if (a->loop && !lathe__option_integer(&s->loop, a->loop, 0, INT32_MAX))
        return lathe__usage_error(command, "--loop %s: a number from 0 (the largest loop) on is needed", a->loop);
    return LATHE_PARSED;
}

/* ---- the loop ---- */

static int64_t twice_area(const lathe_point *at, uint32_t count) {
    int64_t sum = 0;
    for (uint32_t i = 0; i < count; i++) {
        lathe_point p = at[i], q = at[i + 1 < count ? i + 1 : 0];
        sum += (int64_t)p.x * q.y - (int64_t)q.x * p.y;
    }
    return sum < 0 ? -sum : sum;
}
/* The loop that has exactly `wanted` larger ones, of equal ones the first; -1: there are not so many. */
static int64_t find_loop(const lathe_outline *o, int64_t wanted, lathe_arena *arena) {
    int64_t *areas = LATHE_NEW(arena, int64_t, o->loop_count);
    if (!areas) return -2;
    for (uint32_t i = 0; i < o->loop_count; i++)
        areas[i] = twice_area(o->points + o->loops[i].first, o->loops[i].count);
    for (int64_t rank = 0, found = -1; rank <= wanted; rank++, found = -1) {
        for (uint32_t i = 0; i < o->loop_count; i++)
            if (areas[i] >= 0 && (found < 0 || areas[i] > areas[found])) found = i;
        if (found < 0 || rank == wanted) return found;
        areas[found] = -1;
    }
    return -1;
}

/* A hole's contour is that of its points the other way round. */
static lathe_status draw_loop(char **svg, size_t *size, const lathe_drawing *d, const lathe_loop *loop,
                              const draw_settings *s, lathe_arena *arena) {
    lathe_point *points = LATHE_NEW(arena, lathe_point, loop->count), centre;
    if (!points) return LATHE_ERR_MEMORY;
    for (uint32_t i = 0; i < loop->count; i++)
        points[i] = d->outline->points[loop->first + (loop->hole ? loop->count - 1 - i : i)];
    double turns = s->turn / 360 + 1;
    lathe_ray_contour contour;
    lathe_derivation tree;
    lathe_status status = lathe__loop_centre(&centre, arena, points, loop->count);
    if (!status)
        status = lathe__make_ray_contour(&contour, arena, points, loop->count, centre, (uint32_t)s->rays,
                                         (uint32_t)(65536 * turns + 0.5) & 65535);
    if (!status) status = lathe__derive_alone(&tree, arena, &contour);
    lathe_drawing whole = *d;
    whole.contour = &contour;
    whole.tree = &tree;
    return status ? status : lathe__draw_contour(svg, size, &whole);
}

/* d: the outline, and the pixels if there are some. what: the title's begin, "slice 4 across z" or "section 4". */
static int draw_outline(char **svg, size_t *size, const lathe_drawing *d, const char *what, const draw_settings *s,
                        const draw_arguments *a, lathe_arena *arena) {
    const lathe_outline *outline = d->outline;
    if (!outline->loop_count) return lathe__input_error("draw: %s: %s has no loop", a->input, what);
    int64_t found = find_loop(outline, s->loop, arena);
    if (found == -2) return lathe__status_error("draw", a->input, LATHE_ERR_MEMORY, NULL);
    if (found < 0)
        return lathe__input_error("draw: %s: %s has %u loops, the last is --loop %d", a->input, what,
                                  outline->loop_count, (int)outline->loop_count - 1);
    char title[256], stem[128];
    lathe__volume_stem(stem, sizeof stem, a->input);
    snprintf(title, sizeof title, "%s, %s, %s %" PRId64 " of %u, %" PRId64 " rays", stem, what,
             outline->loops[found].hole ? "hole, loop" : "loop", s->loop, outline->loop_count, s->rays);
    lathe_drawing named = *d;
    named.loop = (uint32_t)found;
    named.title = title;
    lathe_status status = draw_loop(svg, size, &named, &outline->loops[found], s, arena);
    if (status == LATHE_ERR_LIMIT)
        return lathe__input_error("draw: %s: more than %d edges: fewer --rays are needed", a->input,
                                  LATHE_DRAW_MAX_EDGES);
    if (status == LATHE_ERR_FORMAT)
        return lathe__input_error("draw: %s: loop %" PRId64 " is too thin to have a centre inside", a->input, s->loop);
    return status ? lathe__status_error("draw", a->input, status, NULL) : LATHE_EXIT_OK;
}

static int draw_slice(char **svg, size_t *size, const lathe_mask *mask, const draw_settings *s, const draw_arguments *a,
                      lathe_axis axis, lathe_arena *arena) {
    int64_t w = s->slice - mask->origin[2];
    if (w < 0 || w >= mask->size[2])
        return lathe__input_error("draw: %s: the structure has slices %d to %d, not %" PRId64, a->input,
                                  mask->origin[2], mask->origin[2] + mask->size[2] - 1, s->slice);
    lathe_slice_view view = {.pixels = lathe__mask_slice(mask, (int32_t)w),
                             .width = mask->size[0],
                             .height = mask->size[1],
                             .row_words = mask->row_words,
                             .fraction = LATHE_FRACTION_ONE / 2};
    lathe_outline outline;
    int32_t *border;
    lathe_status status = lathe__trace_outline(&outline, &border, arena, &view);
    if (status) return lathe__status_error("draw", a->input, status, NULL);
    char what[64];
    snprintf(what, sizeof what, "slice %" PRId64 " across %c", s->slice, "xyz"[axis]);
    lathe_drawing d = {.pixels = view.pixels,
                       .width = view.width,
                       .height = view.height,
                       .row_words = view.row_words,
                       .outline = &outline};
    return draw_outline(svg, size, &d, what, s, a, arena);
}

static int draw_volume(char **svg, size_t *size, const lathe_volume *volume, draw_settings *s,
                       const draw_arguments *a) {
    lathe_axis axis = s->axis < 0 ? lathe__axis_auto(volume) : (lathe_axis)s->axis;
    lathe_error err = {{0}};
    lathe_mask mask;
    lathe_arena arena = {0};
    if (!a->iso && !a->label) {
        s->iso = lathe_volume_otsu(volume);
        fprintf(stderr, "lathe: threshold %g chosen by Otsu's method (--iso sets another)\n", s->iso);
    }
    lathe_status status = a->label ? lathe__region_label(&mask, volume, axis, s->label, &err)
                                   : lathe__region_threshold(&mask, volume, axis, s->iso, &err);
    if (status) return lathe__status_error("draw", a->input, status, &err);
    int result = draw_slice(svg, size, &mask, s, a, axis, &arena);
    lathe__arena_free(&arena);
    lathe__mask_free(&mask);
    return result;
}

static int open_and_draw_volume(char **svg, size_t *size, draw_settings *s, const draw_arguments *a) {
    lathe_volume *volume = NULL;
    lathe_error err = {{0}};
    lathe_status status = lathe_volume_open(&volume, a->input, &err);
    if (status) return lathe__status_error("draw", a->input, status, &err);
    int result = draw_volume(svg, size, volume, s, a);
    lathe_volume_close(&volume);
    return result;
}

static int draw_section(char **svg, size_t *size, lathe_contour_set *set, const draw_settings *s,
                        const draw_arguments *a) {
    if (s->slice >= set->count)
        return lathe__input_error("draw: %s: the set has sections 0 to %u, not %" PRId64, a->input, set->count - 1,
                                  s->slice);
    const lathe_section *section = &set->sections[s->slice];
    const double *row = set->transform.m[2];
    char what[64];
    snprintf(what, sizeof what, "section %" PRId64 " at %.5g mm", s->slice, row[2] * section->height + row[3]);
    lathe_drawing d = {.outline = &section->outline};
    return draw_outline(svg, size, &d, what, s, a, &set->arena);
}

static int open_and_draw_set(char **svg, size_t *size, const draw_settings *s, const draw_arguments *a) {
    lathe_contour_set set;
    lathe_error err = {{0}};
    if (a->iso || a->label || a->axis)
        return lathe__usage_error(&lathe__command_draw,
                                  "%s is a contour set: --iso, --label and --axis are for volumes", a->input);
    lathe_status status = lathe__contour_json_open(&set, NULL, a->input, &err);
    if (status) return lathe__status_error("draw", a->input, status, &err);
    int result = draw_section(svg, size, &set, s, a);
    lathe__contour_set_free(&set);
    return result;
}

static int write_file(const char *path, const char *svg, size_t size) {
    lathe_error err = {{0}};
    lathe_atomic_file *file = NULL;
    lathe_status status = lathe_atomic_open(&file, path, &err);
    if (status) return lathe__status_error("draw", path, status, &err);
    if (lathe_atomic_write(file, svg, size) == 0)
        status = lathe_atomic_commit(&file, &err);
    else {
        status = LATHE_ERR_IO;
        lathe_atomic_abandon(&file);
    }
    return status ? lathe__status_error("draw", path, status, &err) : LATHE_EXIT_OK;
}

static int run(int argc, char **argv) {
    draw_arguments a = {0};
    const lathe_option options[] = {
        LATHE_OPTION_TEXT("output", 'o', &a.output), LATHE_OPTION_TEXT("slice", 0, &a.slice),
        LATHE_OPTION_TEXT("iso", 0, &a.iso),         LATHE_OPTION_TEXT("label", 0, &a.label),
        LATHE_OPTION_TEXT("axis", 0, &a.axis),       LATHE_OPTION_TEXT("rays", 0, &a.rays),
        LATHE_OPTION_TEXT("turn", 0, &a.turn),       LATHE_OPTION_TEXT("loop", 0, &a.loop),
    };
    int count, status = lathe__parse_options(&lathe__command_draw, argc, argv, options,
                                             sizeof options / sizeof *options, &count);
    if (status != LATHE_PARSED) return status;
    if (count != 1) return lathe__usage_error(&lathe__command_draw, "one INPUT is needed");
    if (!a.output) return lathe__usage_error(&lathe__command_draw, "-o FILE.svg is needed");
    a.input = argv[1];
    draw_settings settings;
    status = parse_settings(&settings, &a);
    if (status != LATHE_PARSED) return status;
    char *svg = NULL;
    size_t size = 0;
    status = lathe__is_contour_json(a.input) ? open_and_draw_set(&svg, &size, &settings, &a)
                                             : open_and_draw_volume(&svg, &size, &settings, &a);
    if (status == LATHE_EXIT_OK) status = write_file(a.output, svg, size);
    free(svg);
    return status;
}

const lathe_command lathe__command_draw = {
    "draw", "draw a contour of a slice with its rays and derivation tree",
    "Usage: lathe draw INPUT --slice K -o FILE.svg [options]\n\n"
    "One loop of a slice as the method sees it: region, centre, rays, crossings, FOR, BACK, UP and DOWN edges in four\n"
    "colours, and beside it the derivation tree. INPUT is a volume as `lathe bake` takes it, or a contour set (.json "
    "with\n"
    "\"sections\", see docs/CONTOUR_SETS.md).\n\n"
    "  --slice K          slice number, counted in voxels from 0; of a contour set: section, from 0 at the lowest\n"
    "  -o, --output FILE  the SVG file\n"
    "  --iso V            volumes: the region value >= V; default: Otsu's threshold, which is printed\n"
    "  --label N          volumes: the region of one label\n"
    "  --axis A           volumes: slices across x, y, z or auto (default: the axis of the largest spacing, else z)\n"
    "  --loop I           which loop of the slice: 0 (default) is the one with the largest area\n"
    "  --rays N           a power of two from 4 to 4096; default 16\n"
    "  --turn DEG         turns the first ray counter-clockwise\n",
    run};
