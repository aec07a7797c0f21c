/* The baker: structure by structure to packets, meshes and errors; then the archive, level by level. */
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "grey_crossing.h"
#include "lathe_codec.h"
#include "mesh.h"
#include "structure_encode.h"

void lathe_bake_defaults(lathe_bake_options *options) {
    *options = (lathe_bake_options){.axis = LATHE_AXIS_Z, .boundary = -1, .measure = true, .draco = true};
}

typedef struct bake {
    const lathe_volume *volume;
    const lathe_bake_options *options;
    lathe_boundary boundary;
    size_t count;              /* structures */
    lathe_label_box *boxes;    /* of all labels of the volume */
    size_t box_count;
    lathe_header header;
    lathe_baked_structure *baked;
    lathe_arena arena[2];
    lathe_models models;
    lathe_structure_state *states;
    lathe_pyramid pyramid;     /* unless levels are of slices */
    lathe_packet_list packets[LATHE_MAX_LEVELS];
    lathe_reference *reference; /* of the structure, once planning has asked for it and errors will */
    double done, total;        /* voxels, for progress */
    lathe_error *err;
} bake;

static lathe_status tell(bake *b, const char *stage, double fraction) {
    const lathe_bake_options *o = b->options;
    if (o->progress && o->progress(o->progress_context, stage, fraction)) return lathe_fail(b->err, LATHE_ERR_IO, "the bake was cancelled");
    return LATHE_OK;
}

static const lathe_label_box *find_box(const bake *b, int64_t label) {
    for (size_t i = 0; i < b->box_count; i++)
        if (b->boxes[i].label == label) return &b->boxes[i];
    return NULL;
}

static lathe_status extract(bake *b, size_t index, lathe_mask *mask) {
    const lathe_bake_options *o = b->options;
    if (!o->structure_count) return lathe__region_threshold(mask, b->volume, o->axis, o->iso, b->err);
    int64_t label = o->structures[index].label;
    const lathe_label_box *box = find_box(b, label);
    if (!box) return lathe_fail(b->err, LATHE_ERR_EMPTY, "label %lld: no voxel has it; the volume has %zu labels", (long long)label, b->box_count);
    return lathe__region_label_box(mask, b->volume, o->axis, box, b->err);
}

/* What the encoder asks: positions are of the mask's frame. */
typedef struct grey_values { bake *bake; const lathe_mask *mask; int32_t frame[3]; } grey_values;

static double grey_value(const void *context, int32_t u, int32_t v, int32_t w) {
    const grey_values *g = context;
    const int32_t *o = g->mask->origin;
    return (double)lathe__frame_value(g->bake->volume, g->frame, o[0] + u, o[1] + v, o[2] + w);
}

static void grey_square(const void *context, int32_t u, int32_t v, int32_t w, float out[4]) {
    const grey_values *g = context;
    const lathe_volume *volume = g->bake->volume;
    const int32_t *frame = g->frame, *o = g->mask->origin, *dims = volume->dims;
    int32_t at[3] = {o[0] + u, o[1] + v, o[2] + w};
    bool within = true;
    for (int k = 0; k < 3; k++) within &= at[k] >= 0 && at[k] + (k < 2) < dims[frame[k]];
    if (within) {
        size_t step[3] = {1, (size_t)dims[0], (size_t)dims[0] * (size_t)dims[1]}, du = step[frame[0]], dv = step[frame[1]];
        const float *p = volume->values + (size_t)at[0] * du + (size_t)at[1] * dv + (size_t)at[2] * step[frame[2]];
        out[0] = p[0], out[1] = p[du], out[2] = p[dv], out[3] = p[du + dv];
        return;
    }
    for (int k = 0; k < 4; k++) out[k] = lathe__frame_value(volume, frame, at[0] + (k & 1), at[1] + (k >> 1), at[2]);
}

/* Planning borrows what errors need: where they are wanted, it is a stage of its own. */
static lathe_status grey_reference(const void *context, const lathe_reference **out) {
    const grey_values *g = context;
    bake *b = g->bake;
    const lathe_bake_options *o = b->options;
    if (!b->reference) {
        lathe_status status = o->measure ? tell(b, "planning", 0.2) : LATHE_OK;
        if (!status) status = lathe__reference_build(&b->reference, b->volume, o->axis, g->mask, b->boundary, o->iso);
        if (!status && o->measure) status = tell(b, "reference surface", 0.2);
        if (status) return status;
    }
    *out = b->reference;
    return LATHE_OK;
}

static double voxel_mm3(const lathe_volume *volume) {
    const double(*m)[4] = volume->affine;
    return fabs(m[0][0] * (m[1][1] * m[2][2] - m[1][2] * m[2][1]) - m[0][1] * (m[1][0] * m[2][2] - m[1][2] * m[2][0]) +
                m[0][2] * (m[1][0] * m[2][1] - m[1][1] * m[2][0]));
}

static lathe_encode_source source_of(bake *b, grey_values *grey, const lathe_mask *mask) {
    *grey = (grey_values){.bake = b, .mask = mask};
    lathe__axis_frame(b->options->axis, grey->frame);
    const double *spacing = b->volume->spacing;
    double slice = spacing[grey->frame[2]];
    return (lathe_encode_source){.slice_ratio = slice * slice / (spacing[grey->frame[0]] * spacing[grey->frame[1]]),
                                 .value = grey_value, .square = grey_square, .reference = b->count == 1 ? grey_reference : NULL,
                                 .context = grey, .iso = b->options->iso};
}

/* One number for the whole structure. */
static int mean_fraction(const bake *b, const lathe_mask *mask, bool upright) {
    if (b->boundary == LATHE_BOUNDARY_EDGE) return LATHE_FRACTION_ONE / 2;
    return lathe__mean_fraction(mask, b->volume, b->options->axis, b->options->iso, upright);
}

static size_t sample_count(const bake *b, const lathe_mask *mask) {
    if (b->options->samples) return b->options->samples;
    /* One for about eight border edges: denser where there is more surface, so that sums over structures are area-weighted. */
    size_t n = lathe__mask_borders(mask) / 8;
    return n < 400 ? 400 : n > 20000 ? 20000 : n;
}

static lathe_status draco_size(uint64_t *out, const lathe_mesh *mesh, const lathe_transform *transform) {
    struct lathe_world_part part = {0, 0, mesh->vertex_count, 0, mesh->triangle_count};
    lathe_world_mesh world = {.vertex_count = mesh->vertex_count, .triangle_count = mesh->triangle_count, .structure_count = 1, .parts = &part};
    world.positions = malloc((size_t)mesh->vertex_count * 3 * sizeof *world.positions);
    world.indices = malloc((size_t)mesh->triangle_count * 3 * sizeof *world.indices);
    lathe_status status = LATHE_ERR_MEMORY;
    if (world.positions && world.indices) {
        lathe_mesh_positions(mesh, transform, world.positions);
        lathe_mesh_indices(mesh, transform, world.indices);
        *out = 0;
        status = lathe_write_drc(&world, 0, lathe__count_bytes, out);
    }
    free(world.positions);
    free(world.indices);
    return status;
}

/* Builds each level's mesh as a decoder will, counts and measures it. */
static lathe_status finish_levels(bake *b, lathe_structure_state *state, lathe_baked_structure *baked, double voxels) {
    const lathe_bake_options *o = b->options;
    lathe_reference *reference = b->reference;
    lathe_transform transform = lathe__mask_transform(&state->mask, o->axis, b->volume->affine);
    lathe_status status = LATHE_OK;
    size_t samples = o->measure ? sample_count(b, &state->mask) : 0;
    b->reference = NULL;
    if (o->measure && !reference) status = lathe__reference_build(&reference, b->volume, o->axis, &state->mask, b->boundary, o->iso);
    for (uint32_t level = 0; !status && level < baked->level_count; level++) {
        lathe_level_info *info = &baked->levels[level];
        lathe_surface_counts counts;
        lathe_mesh mesh = {0};
        info->error_rms_mm = info->error_max_mm = -1;
        status = lathe__encoded_mesh(&mesh, b->arena, state, baked, level, &counts, &info->slices);
        info->rays = counts.rays;
        info->vertices = mesh.vertex_count;
        info->triangles = mesh.triangle_count;
        if (!status && o->measure) {
            lathe_metrics metrics;
            status = lathe__reference_measure(&metrics, reference, &mesh, samples);
            info->error_rms_mm = (float)metrics.rms_mm;
            info->error_max_mm = (float)metrics.max_mm;
            baked->area_mm2 = metrics.area_mm2;
        }
        if (!status && o->draco) status = draco_size(&info->draco_bytes, &mesh, &transform);
        lathe_mesh_free(&mesh);
        b->done += voxels / baked->level_count;
        if (!status) status = tell(b, o->measure ? "building and measuring" : "building", 0.4 + 0.6 * b->done / b->total);
    }
    lathe__reference_free(&reference);
    return status;
}

/* ---- stages: each goes over all structures ---- */

static lathe_status explain(const bake *b, size_t index, const char *what, lathe_status status) {
    if (status && b->err && !b->err->text[0])
        lathe_fail(b->err, status, "%s: %s: %s", b->header.structures[index].name, what, lathe_status_name(status));
    return status;
}

static lathe_status extract_structure(bake *b, size_t index) {
    lathe_structure_state *state = &b->states[index];
    lathe_header_structure *h = &b->header.structures[index];
    lathe_status status = extract(b, index, &state->mask);
    if (status) return explain(b, index, "its region", status);
    state->level = -1;
    state->fraction = mean_fraction(b, &state->mask, false);
    if (!b->options->structure_count) b->header.parameters[0] = (uint32_t)state->fraction;
    state->flags = b->header.parameters[1];
    memcpy(h->origin, state->mask.origin, sizeof h->origin);
    memcpy(h->size, state->mask.size, sizeof h->size);
    return LATHE_OK;
}

static void scale_waiting(bake *b, size_t index) {
    for (uint32_t level = 0; level < b->baked[index].level_count; level++)
        b->baked[index].levels[level].waiting_mm3 *= voxel_mm3(b->volume);
}

/* Levels of slices: a kept topology, and what a radius map is chosen against. */
static lathe_status plan_slices(bake *b, size_t index) {
    lathe_structure_state *state = &b->states[index];
    lathe_baked_structure *baked = &b->baked[index];
    grey_values grey;
    lathe_encode_source source = source_of(b, &grey, &state->mask);
    lathe_status status = lathe__structure_plan(baked, state, b->arena, &source);
    if (!status) status = lathe__choose_radii(baked, state, b->arena, b->volume, b->options->axis, b->boundary, &source);
    b->header.structures[index].level_count = (uint8_t)baked->level_count;
    scale_waiting(b, index);
    return explain(b, index, "planning", status);
}

/* Voxels of the largest structure, and their distances, along u, v and w. */
static void schedule(bake *b) {
    int32_t most[3] = {1, 1, 1}, frame[3];
    double spacing[3], voxels = 0;
    lathe__axis_frame(b->options->axis, frame);
    for (int k = 0; k < 3; k++) spacing[k] = b->volume->spacing[frame[k]];
    for (size_t i = 0; i < b->count; i++) {
        const int32_t *size = b->states[i].mask.size;
        double n = (double)(size[0] - 2) * (size[1] - 2) * size[2];
        if (n <= voxels) continue;
        voxels = n;
        most[0] = size[0] - 2, most[1] = size[1] - 2, most[2] = size[2];
    }
    lathe__pyramid_plan(&b->header, spacing, most, b->options->levels);
}

static lathe_status plan_pyramid(bake *b) {
    lathe_status status = LATHE_OK;
    b->header.parameters[1] = (b->header.parameters[1] & ~(uint32_t)LATHE_FLAG_CAPS) | LATHE_FLAG_PYRAMID | LATHE_FLAG_SURE |
                              LATHE_FLAG_CUBES;
    schedule(b);
    for (size_t i = 0; i < b->count; i++) b->header.structures[i].level_count = (uint8_t)(b->header.parameter_count - 1);
    status = lathe__pyramid_read(&b->pyramid, &b->header);
    for (size_t i = 0; !status && i < b->count; i++) {
        b->states[i].pyramid = &b->pyramid;
        b->states[i].flags = b->header.parameters[1];
        b->baked[i].level_count = b->pyramid.level_count;
        b->states[i].plan.slices = b->states[i].mask.size[2];
        b->states[i].plan.level_count = b->pyramid.level_count;
        status = lathe__pyramid_waiting(b->baked[i].levels, &b->states[i]);
        scale_waiting(b, i);
    }
    return status;
}

/* May be a radius map instead: then nothing of the pyramid stays but how many components there are. */
static lathe_status plan_radii(bake *b) {
    lathe_structure_state *state = &b->states[0];
    lathe_baked_structure *baked = &b->baked[0];
    grey_values grey;
    lathe_encode_source source = source_of(b, &grey, &state->mask);
    lathe_baked_structure rasters = *baked;
    state->plan.level_count = baked->level_count = lathe__choose_levels(state->plan.slices);
    baked->levels[baked->level_count - 1].components = rasters.levels[rasters.level_count - 1].components;
    lathe_status status = lathe__choose_radii(baked, state, b->arena, b->volume, b->options->axis, b->boundary, &source);
    if (!state->radii) {
        *baked = rasters;
        state->plan.level_count = baked->level_count;
        return explain(b, 0, "planning", status);
    }
    state->pyramid = NULL;
    state->flags = b->header.parameters[1] &= ~(uint32_t)(LATHE_FLAG_PYRAMID | LATHE_FLAG_SURE | LATHE_FLAG_CUBES);
    b->header.parameter_count = b->header.parameters[1] ? 2 : 1;
    b->header.structures[0].level_count = (uint8_t)baked->level_count;
    return LATHE_OK;
}

/* A raster's edges along w have a fraction of their own; that of a threshold is sent. */
static void set_upright(bake *b) {
    for (size_t i = 0; i < b->count; i++) b->states[i].upright = mean_fraction(b, &b->states[i].mask, true);
    if (!b->options->structure_count) b->header.parameters[0] |= (uint32_t)b->states[0].upright << 6;
}

static lathe_status plan(bake *b) {
    const lathe_bake_options *o = b->options;
    lathe_status status = LATHE_OK;
    bool slices = o->keep_topology || o->slices;
    for (size_t i = 0; !status && i < b->count; i++) {
        status = extract_structure(b, i);
        if (!status && slices) status = plan_slices(b, i);
        if (!status) status = tell(b, "planning", 0.2 * (double)(i + 1) / (double)b->count);
    }
    if (!status && !slices) status = plan_pyramid(b);
    if (!status && !slices && !o->structure_count && !o->exact && !o->levels) status = plan_radii(b);
    if (!status && b->states[0].pyramid) set_upright(b);
    return status ? status : tell(b, "planning", 0.2);
}

static lathe_status encode_structure(bake *b, size_t index, uint32_t level) {
    lathe_structure_state *state = &b->states[index];
    lathe_baked_structure *baked = &b->baked[index];
    grey_values grey;
    if (level >= baked->level_count) return LATHE_OK;
    lathe_encode_source source = source_of(b, &grey, &state->mask);
    lathe_status status = lathe__structure_encode_level(baked, state, b->arena, &b->models, level, &source);
    if (!status && lathe__packets_add(&b->packets[level], &baked->packets[level])) status = LATHE_ERR_MEMORY;
    return explain(b, index, "encoding", status);
}

/* One structure's part of a pass. */
static lathe_status encode_pass(bake *b, size_t index, lathe_range_encoder *e, uint32_t level, uint32_t pass) {
    lathe_structure_state *state = &b->states[index];
    lathe_status status = lathe__pass_encode(e, state, &b->models, level, pass);
    if (level + 1 == b->pyramid.level_count && pass + 1 == lathe__pyramid_passes(&b->pyramid, level)) lathe__state_drop_occupancy(state);
    return explain(b, index, "encoding", status);
}

static lathe_status encode_passes(bake *b, uint32_t level) {
    bool shared = b->header.parameters[1] & LATHE_FLAG_SHARED;
    lathe_status status = LATHE_OK;
    for (uint32_t pass = 0; !status && pass < lathe__pyramid_passes(&b->pyramid, level); pass++)
        for (size_t first = 0; !status && first < b->count;) {
            lathe_range_encoder e;
            lathe_bytes packet = {0};
            lathe__encoder_start(&e);
            do status = encode_pass(b, first++, &e, level, pass); while (!status && shared && first < b->count);
            lathe_status coded = lathe__append_coded(&packet, &e);
            if (!status) status = coded;
            if (!status && lathe__packets_add(&b->packets[level], &packet)) status = LATHE_ERR_MEMORY;
            lathe__bytes_free(&packet);
        }
    return status;
}

static lathe_status bake_structures(bake *b) {
    lathe_status status = plan(b);
    uint32_t levels = 0;
    for (size_t i = 0; i < b->count; i++)
        if (b->baked[i].level_count > levels) levels = b->baked[i].level_count;
    if (!status) lathe__models_start(&b->models, &b->header);
    for (uint32_t level = 0; !status && level < levels; level++) {
        if (b->states[0].pyramid) status = encode_passes(b, level);
        else for (size_t i = 0; !status && i < b->count; i++) status = encode_structure(b, i, level);
        if (!status) status = tell(b, "encoding", 0.2 + 0.2 * (level + 1) / levels);
    }
    for (size_t i = 0; !status && i < b->count; i++) {
        status = explain(b, i, "building its levels", finish_levels(b, &b->states[i], &b->baked[i], 1));
        lathe__state_free(&b->states[i]);
    }
    return status;
}

/* ---- the whole model ---- */

static lathe_level_info sum_levels(const bake *b, uint32_t level) {
    lathe_level_info sum = {.error_rms_mm = -1, .error_max_mm = -1};
    double squares = 0, area = 0;
    for (size_t s = 0; s < b->count; s++) {
        const lathe_baked_structure *baked = &b->baked[s];
        const lathe_level_info *l = &baked->levels[level < baked->level_count ? level : baked->level_count - 1];
        if (l->rays > sum.rays) sum.rays = l->rays;
        if (l->slices > sum.slices) sum.slices = l->slices;
        sum.vertices += l->vertices;
        sum.triangles += l->triangles;
        sum.draco_bytes += l->draco_bytes;
        sum.components += l->components;
        sum.components_waiting += l->components_waiting;
        sum.waiting_mm3 += l->waiting_mm3;
        if (l->error_max_mm > sum.error_max_mm) sum.error_max_mm = l->error_max_mm;
        squares += (double)l->error_rms_mm * (double)l->error_rms_mm * baked->area_mm2;
        area += baked->area_mm2;
    }
    if (area > 0) sum.error_rms_mm = (float)sqrt(squares / area);
    return sum;
}

static lathe_status write_levels(bake *b, lathe_archive_writer *writer, const lathe_level_info *levels) {
    for (uint32_t level = 0; level < b->header.level_count; level++) {
        const lathe_packet_list *list = &b->packets[level];
        lathe_status status = lathe__archive_level(writer, levels[level].error_rms_mm, levels[level].error_max_mm, list->at, list->count);
        if (status) return status;
    }
    return LATHE_OK;
}

static lathe_status write_archive(bake *b, lathe_sink sink, void *context) {
    lathe_archive_writer *writer = NULL;
    lathe_level_info levels[LATHE_MAX_LEVELS];
    const lathe_level_info **structures = calloc(b->count + 1, sizeof(void *));
    lathe_status status = structures ? LATHE_OK : LATHE_ERR_MEMORY;
    if (!status) status = lathe__archive_begin(&writer, &b->header, sink, context, b->err);
    for (size_t s = 0; !status && s < b->count; s++) {
        structures[s] = b->baked[s].levels;
        if (b->baked[s].level_count > b->header.level_count) b->header.level_count = b->baked[s].level_count;
    }
    if (!status) {
        for (uint32_t level = 0; level < b->header.level_count; level++) levels[level] = sum_levels(b, level);
        status = write_levels(b, writer, levels);
    }
    if (!status) {
        lathe_archive_stats stats = {.name = b->options->name, .iso = b->options->structure_count ? (double)NAN : b->options->iso,
                                     .levels = levels, .structures = structures};
        status = lathe__archive_finish(writer, &stats);
    }
    lathe__archive_close(&writer);
    free(structures);
    return status;
}

static lathe_status prepare(bake *b) {
    const lathe_bake_options *o = b->options;
    b->count = o->structure_count ? o->structure_count : 1;
    b->boundary = o->boundary >= 0 ? (lathe_boundary)o->boundary : o->structure_count ? LATHE_BOUNDARY_EDGE : LATHE_BOUNDARY_ISO;
    if (b->count > LATHE_MAX_STRUCTURES) {
        lathe_fail(b->err, LATHE_ERR_LIMIT, "%zu structures: at most %d", b->count, LATHE_MAX_STRUCTURES);
        return LATHE_ERR_LIMIT;
    }
    b->header.axis = o->axis;
    b->header.boundary = b->boundary;
    memcpy(b->header.affine, b->volume->affine, sizeof b->header.affine);
    b->header.parameters[0] = LATHE_FRACTION_ONE / 2;
    b->header.parameters[1] = (o->keep_topology ? LATHE_FLAG_KEEP : 0) | (o->exact ? LATHE_FLAG_EXACT : 0) |
                              (b->count > 1 && !o->independent ? LATHE_FLAG_SHARED : 0) |
                              (b->boundary == LATHE_BOUNDARY_ISO && !o->structure_count && !o->flat_caps ? LATHE_FLAG_CAPS : 0);
    b->header.parameter_count = b->header.parameters[1] ? 2 : 1;
    b->header.structure_count = (uint32_t)b->count;
    b->header.structures = calloc(b->count, sizeof *b->header.structures);
    b->baked = calloc(b->count, sizeof *b->baked);
    b->states = calloc(b->count, sizeof *b->states);
    if (!b->header.structures || !b->baked || !b->states) {
        lathe_fail(b->err, LATHE_ERR_MEMORY, "out of memory");
        return LATHE_ERR_MEMORY;
    }
    for (size_t i = 0; i < b->count; i++) {
        lathe_header_structure *h = &b->header.structures[i];
        lathe__name_clean(h->name, sizeof h->name, o->structure_count ? o->structures[i].name : o->name ? o->name : "surface");
        static const uint8_t bone[3] = {222, 205, 180};
        memcpy(h->rgb, o->structure_count ? o->structures[i].rgb : bone, 3);
        h->label = o->structure_count ? o->structures[i].label : -1;
    }
    b->total = (double)b->count;
    if (o->structure_count) return lathe__region_labels(&b->boxes, &b->box_count, b->volume, b->err);
    return LATHE_OK;
}

lathe_status lathe_bake(const lathe_volume *volume, const lathe_bake_options *options, lathe_sink sink, void *context,
                        lathe_error *err) {
    bake b = {.volume = volume, .options = options, .err = err};
    if (err) err->text[0] = '\0';
    lathe_status status = tell(&b, "reading", 0);
    if (!status) status = prepare(&b);
    if (!status) status = bake_structures(&b);
    if (!status) status = tell(&b, "writing", 1);
    if (!status) status = write_archive(&b, sink, context);
    if (status && err && !err->text[0]) lathe_fail(err, status, "writing the archive: %s", lathe_status_name(status));
    for (int i = 0; i < LATHE_MAX_LEVELS; i++) lathe__packets_free(&b.packets[i]);
    for (size_t i = 0; b.baked && i < b.count; i++) lathe__baked_free(&b.baked[i]);
    for (size_t i = 0; b.states && i < b.count; i++) lathe__state_free(&b.states[i]);
    lathe__reference_free(&b.reference);
    free(b.states);
    free(b.baked);
    free(b.header.structures);
    free(b.boxes);
    lathe__occupancy_free(&b.models.occupancy);
    lathe__arena_free(&b.arena[0]);
    lathe__arena_free(&b.arena[1]);
    return status;
}

lathe_status lathe_bake_file(const lathe_volume *volume, const lathe_bake_options *options, const char *path, lathe_error *err) {
    lathe_atomic_file *file = NULL;
    lathe_status status = lathe_atomic_open(&file, path, err);
    if (status) return status;
    status = lathe_bake(volume, options, lathe_atomic_write, file, err);
    if (!status) return lathe_atomic_commit(&file, err);
    lathe_atomic_abandon(&file);
    return status;
}
