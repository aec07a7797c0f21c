/* Bake, stream, decode: phantoms with known answers go through the whole codec in memory. */
#include <stdlib.h>
#include <string.h>
#include "archive_write.h"
#include "check.h"
#include "lathe_codec.h"
#include "mesh.h"
#include "phantom.h"
#include "structure_encode.h"

static int append(void *context, const void *bytes, size_t size) {
    lathe__emit(context, bytes, size);
    return ((lathe_bytes *)context)->failed;
}

/* labels: bake structures 1 .. labels; 0: the threshold. Closes the volume. */
static lathe_bytes bake_as(lathe_volume *volume, size_t labels, lathe_axis axis, bool measure, bool keep) {
    static const lathe_bake_structure structures[3] = {{"one", {200, 0, 0}, 1}, {"two", {0, 200, 0}, 2}, {"three", {0, 0, 200}, 3}};
    lathe_bake_options options;
    lathe_bytes out = {0};
    lathe_error err = {{0}};
    lathe_bake_defaults(&options);
    options.axis = axis;
    options.iso = PHANTOM_ISO;
    options.structures = structures;
    options.structure_count = labels;
    options.measure = measure;
    options.draco = false;
    options.samples = 4000;
    options.keep_topology = keep;
    if (!volume || !CHECK(lathe_bake(volume, &options, append, &out, &err) == LATHE_OK)) {
        fprintf(stderr, "%s\n", err.text);
        abort();
    }
    lathe_volume_close(&volume);
    return out;
}

static lathe_bytes bake(lathe_volume *volume, size_t labels, lathe_axis axis, bool measure) {
    return bake_as(volume, labels, axis, measure, false);
}

static lathe_model *open_model(const lathe_bytes *archive) {
    lathe_model *model = NULL;
    lathe_error err;
    if (lathe_model_parse(&model, archive->data, archive->size, &err)) abort();
    return model;
}

static lathe_bytes stream_of(const lathe_model *model, int64_t structure, uint32_t from, uint32_t to) {
    lathe_bytes out = {0};
    if (lathe_model_stream(model, structure, from, to, append, &out)) abort();
    CHECK_EQ(out.size, lathe_model_stream_size(model, structure, from, to));
    return out;
}

static bool same_mesh(const lathe_mesh *a, const lathe_mesh *b) {
    return a && b && a->vertex_count == b->vertex_count && a->triangle_count == b->triangle_count &&
           !memcmp(a->lattice, b->lattice, a->vertex_count * sizeof *a->lattice) &&
           !memcmp(a->triangles, b->triangles, a->triangle_count * sizeof *a->triangles);
}

static lathe_mesh copy_mesh(const lathe_mesh *from) {
    lathe_mesh to = {.vertex_count = from->vertex_count, .triangle_count = from->triangle_count};
    to.lattice = malloc(to.vertex_count * sizeof *to.lattice + 1);
    to.triangles = malloc(to.triangle_count * sizeof *to.triangles + 1);
    if (!to.lattice || !to.triangles) abort();
    memcpy(to.lattice, from->lattice, to.vertex_count * sizeof *to.lattice);
    memcpy(to.triangles, from->triangles, to.triangle_count * sizeof *to.triangles);
    return to;
}

/* ---- every step of a stream ---- */

enum { MOST_STEPS = 3 * LATHE_MAX_LEVELS };
typedef struct decoded {
    uint32_t count;
    lathe_step step[MOST_STEPS];
    lathe_mesh mesh[MOST_STEPS];
    lathe_status end;          /* what the last step said */
} decoded;

static void free_decoded(decoded *d) {
    for (uint32_t i = 0; i < d->count; i++) lathe_mesh_free(&d->mesh[i]);
}

/* portion 0: all at once. */
static void decode(decoded *out, const lathe_bytes *stream, size_t portion) {
    lathe_decoder *decoder;
    *out = (decoded){.end = LATHE_MORE};
    if (lathe_decoder_open(&decoder)) abort();
    if (!portion) portion = stream->size;
    for (size_t at = 0; at < stream->size && out->end == LATHE_MORE; at += portion) {
        CHECK(lathe_decoder_feed(decoder, stream->data + at, stream->size - at < portion ? stream->size - at : portion) == LATHE_OK);
        while (out->count < MOST_STEPS && (out->end = lathe_decoder_step(decoder, &out->step[out->count])) == LATHE_OK) {
            const lathe_mesh *mesh = lathe_decoder_mesh(decoder, out->step[out->count].structure);
            if (!CHECK(mesh != NULL)) break;
            out->mesh[out->count++] = copy_mesh(mesh);
        }
    }
    CHECK((lathe_decoder_error(decoder)[0] != 0) == (out->end < 0));
    lathe_decoder_close(&decoder);
    CHECK(decoder == NULL);
}

static void portions_agree(const lathe_bytes *stream, const char *what) {
    static const size_t portion[] = {1, 7, 1000};
    decoded whole, other;
    decode(&whole, stream, 0);
    CHECK_EQ(whole.end, LATHE_MORE);
    for (size_t k = 0; k < sizeof portion / sizeof *portion; k++) {
        decode(&other, stream, portion[k]);
        int ok = CHECK_EQ(other.end, LATHE_MORE) && CHECK_EQ(other.count, whole.count);
        for (uint32_t i = 0; ok && i < whole.count; i++)
            ok = CHECK_EQ(other.step[i].level, whole.step[i].level) && CHECK_EQ(other.step[i].structure, whole.step[i].structure) &&
                 CHECK(same_mesh(&other.mesh[i], &whole.mesh[i]));
        if (!ok) fprintf(stderr, "  in %s by portions of %zu\n", what, portion[k]);
        free_decoded(&other);
    }
    free_decoded(&whole);
}

/* ---- phantoms: what is decoded is what the encoder's own state builds, closed at every level ---- */

typedef struct phantom {
    const char *name;
    lathe_volume *(*make)(void);
    size_t labels;
    lathe_axis axis;
    bool whole;                /* measured: the error falls from level to level; nothing intersects */
} phantom;

static lathe_volume *sphere(void) { return phantom_sphere(40, 16.3, PHANTOM_GREY); }
static lathe_volume *torus(void) { return phantom_torus(40, 12, 5, PHANTOM_LABEL); }
static lathe_volume *branch(void) { return phantom_branch(40, PHANTOM_GREY); }
static lathe_volume *shells(void) { return phantom_shells(40, PHANTOM_GREY); }
static lathe_volume *column(void) { return phantom_column(32, 1.2, PHANTOM_LABEL); }
static lathe_volume *specks(void) { return phantom_specks(24, 60, 5, PHANTOM_LABEL); }
static lathe_volume *voxel(void) { return phantom_voxel(5, PHANTOM_LABEL); }
static lathe_volume *slice(void) { return phantom_slice(20, PHANTOM_GREY); }
static lathe_volume *diagonals(void) { return phantom_diagonals(9, PHANTOM_LABEL); }
static lathe_volume *blobs(void) { return phantom_blobs(32, 12, 3, PHANTOM_GREY); }
static lathe_volume *full(void) { return phantom_full(7, 9, 11, PHANTOM_LABEL); }
static lathe_volume *noise(void) { return phantom_noise(14, 13, 12, 45, 9, PHANTOM_LABEL); }

/* Three labels: a ball, its surroundings, and a column that goes through both. */
static lathe_volume *atlas(void) {
    enum { N = 24 };
    static float value[N * N * N];
    static const int32_t dims[3] = {N, N, N};
    static const double spacing[3] = {0.9, 0.9, 1.7};
    for (int i = 0; i < N * N * N; i++) {
        double x = i % N - 11.3, y = i / N % N - 11.6, z = i / N / N - 11.4, r = x * x + y * y + z * z;
        value[i] = x * x + y * y < 8 ? 3 : r < 36 ? 1 : r < 110 ? 2 : 0;
    }
    lathe_volume *volume = NULL;
    return lathe_volume_wrap(&volume, dims, spacing, value, NULL) ? NULL : volume;
}

static const phantom PHANTOMS[] = {
    {"sphere", sphere, 0, LATHE_AXIS_Z, true},    {"torus", torus, 1, LATHE_AXIS_Z, true},
    {"torus along x", torus, 1, LATHE_AXIS_X, true}, {"branch", branch, 0, LATHE_AXIS_Z, true},
    {"shells", shells, 0, LATHE_AXIS_Z, true},    {"twisted column", column, 1, LATHE_AXIS_Z, false},
    {"specks", specks, 1, LATHE_AXIS_Y, false},   {"one voxel", voxel, 1, LATHE_AXIS_Z, false},
    {"one slice", slice, 0, LATHE_AXIS_Z, false}, {"diagonals", diagonals, 1, LATHE_AXIS_Z, false},
    {"blobs", blobs, 0, LATHE_AXIS_Y, false},     {"all voxels", full, 1, LATHE_AXIS_X, false},
    {"noise", noise, 1, LATHE_AXIS_Z, false},     {"atlas", atlas, 3, LATHE_AXIS_Z, false},
};

static bool closed(const lathe_mesh_report *r) {
    return !r->boundary_edges && !r->nonmanifold_edges && !r->misoriented_edges && !r->nonmanifold_vertices && !r->degenerate_triangles &&
           !r->duplicate_positions && !r->unused_vertices && !r->bad_indices;
}

static void check_level(const phantom *p, const lathe_mesh *mesh, const lathe_transform *transform, const lathe_step *step) {
    lathe_mesh_report report;
    uint64_t duplicates = 1;
    CHECK(lathe__mesh_check(&report, mesh, p->whole) == LATHE_OK);
    int ok = CHECK(closed(&report)) && (!p->whole || CHECK_EQ(report.self_intersections, 0));
    CHECK(lathe__mesh_float_duplicates(&duplicates, mesh, transform) == LATHE_OK);
    if (!CHECK_EQ(duplicates, 0) || !ok) fprintf(stderr, "  in %s, structure %u, level %u\n", p->name, step->structure, step->level);
}

/* A state that has never been coded and decoded: made from the volume's own mask. */
static lathe_volume *start_state(lathe_structure_state *state, const phantom *p, const lathe_model *model, uint32_t structure) {
    lathe_volume *volume = p->make();
    const lathe_model_info *info = lathe_model_describe(model);
    lathe_status status = p->labels ? lathe__region_label(&state->mask, volume, p->axis, info->structures[structure].label, NULL)
                                    : lathe__region_threshold(&state->mask, volume, p->axis, PHANTOM_ISO, NULL);
    if (status) abort();
    return volume;
}

typedef struct grey { const lathe_volume *volume; const lathe_mask *mask; int32_t frame[3]; } grey;
static double grey_value(const void *context, int32_t u, int32_t v, int32_t w) {
    const grey *g = context;
    int32_t at[3], in_frame[3] = {u, v, w};
    for (int k = 0; k < 3; k++) at[g->frame[k]] = g->mask->origin[k] + in_frame[k];
    for (int k = 0; k < 3; k++)
        if (at[k] < 0 || at[k] >= g->volume->dims[k]) return (double)g->volume->min;
    return (double)g->volume->values[((size_t)at[2] * (size_t)g->volume->dims[1] + (size_t)at[1]) * (size_t)g->volume->dims[0] + (size_t)at[0]];
}

static lathe_encode_source source_of(grey *g, const lathe_volume *volume, const lathe_mask *mask, lathe_axis axis) {
    *g = (grey){.volume = volume, .mask = mask};
    lathe__axis_frame(axis, g->frame);
    const double *spacing = volume->spacing;
    return (lathe_encode_source){.slice_ratio = spacing[g->frame[2]] * spacing[g->frame[2]] / (spacing[g->frame[0]] * spacing[g->frame[1]]),
                                 .value = grey_value, .context = g, .iso = PHANTOM_ISO};
}

static void compare_with_state(const phantom *p, const lathe_model *model, const lathe_bytes *archive, const decoded *d, uint32_t structure) {
    lathe_structure_state state = {.level = -1};
    lathe_baked_structure baked;
    lathe_arena arena[2] = {{0}, {0}};
    lathe_models models = {.widest = {3, 3}};
    lathe_header header;
    lathe_reader reader = lathe__reader(archive->data, archive->size);
    memset(&baked, 0, sizeof baked);
    lathe_volume *volume = start_state(&state, p, model, structure);
    grey g;
    lathe_encode_source source = source_of(&g, volume, &state.mask, p->axis);
    if (lathe__header_parse(&header, &reader)) abort();
    state.fraction = (int)header.parameters[0] & 63;
    state.upright = (int)header.parameters[0] >> 6 & 63;
    state.flags = header.parameter_count > 1 ? header.parameters[1] & ~(uint32_t)LATHE_FLAG_SHARED : 0;
    lathe_pyramid pyramid;
    if (state.flags & LATHE_FLAG_PYRAMID) {
        CHECK_EQ(lathe__pyramid_read(&pyramid, &header), LATHE_OK);
        state.pyramid = &pyramid;
        state.plan = (lathe_level_plan){state.mask.size[2], pyramid.level_count, NULL};
        baked.level_count = pyramid.level_count;
        for (int k = 0; k < 3; k++) state.stride[k] = 1;
        if (state.flags & LATHE_FLAG_CAPS) CHECK_EQ(lathe__choose_caps(&baked, &state, arena, &source), LATHE_OK);
    } else {
        CHECK(lathe__structure_plan(&baked, &state, arena, &source) == LATHE_OK);
        CHECK(lathe__choose_radii(&baked, &state, arena, volume, p->axis, header.boundary, &source) == LATHE_OK);
        for (uint32_t level = 0; level < baked.level_count; level++)
            CHECK(lathe__structure_encode_level(&baked, &state, arena, &models, level, &source) == LATHE_OK);
    }
    lathe_volume_close(&volume);
    lathe_transform transform = lathe__mask_transform(&state.mask, p->axis, header.affine);
    uint32_t levels = 0;
    for (uint32_t i = 0; i < d->count; i++) {
        if (d->step[i].structure != structure) continue;
        lathe_mesh mesh = {0};
        lathe_surface_counts counts;
        uint32_t shown;
        CHECK_EQ(d->step[i].level, levels++);
        CHECK(lathe__encoded_mesh(&mesh, arena, &state, &baked, d->step[i].level, &counts, &shown) == LATHE_OK);
        int ok = CHECK(same_mesh(&mesh, &d->mesh[i])) && CHECK_EQ(shown, d->step[i].slices) && CHECK_EQ(counts.rays, d->step[i].rays);
        if (!ok) fprintf(stderr, "  in %s, structure %u, level %u\n", p->name, structure, levels - 1);
        check_level(p, &d->mesh[i], &transform, &d->step[i]);
        lathe_mesh_free(&mesh);
    }
    CHECK_EQ(levels, lathe_model_describe(model)->structures[structure].level_count);
    lathe__header_free(&header);
    lathe__baked_free(&baked);
    lathe__state_free(&state);
    lathe__occupancy_free(&models.occupancy);
    lathe__arena_free(&arena[0]);
    lathe__arena_free(&arena[1]);
}

/* The last level has the topology of the voxels; every level, if it is kept. */
static void check_topology(const phantom *p, const lathe_model *model, const decoded *d) {
    const lathe_model_info *info = lathe_model_describe(model);
    for (uint32_t i = 0; i < d->count; i++) {
        uint32_t s = d->step[i].structure;
        bool last = d->step[i].level + 1 == info->structures[s].level_count;
        if (!last && !info->keep_topology) continue;
        lathe_structure_state state = {.level = -1};
        lathe_topology topology;
        lathe_mesh_report report;
        lathe_volume *volume = start_state(&state, p, model, s);
        lathe_volume_close(&volume);
        CHECK(lathe__mask_topology(&topology, &state.mask, NULL) == LATHE_OK);
        CHECK(lathe__mesh_check(&report, &d->mesh[i], true) == LATHE_OK);
        int ok = CHECK_EQ(report.components, topology.components + topology.cavities) && CHECK_EQ(report.euler, 2 * topology.euler) &&
                 (!last || CHECK_EQ(report.self_intersections, 0));
        if (!ok) fprintf(stderr, "  in %s, level %u\n", p->name, d->step[i].level);
        if (info->keep_topology) CHECK_EQ(info->structures[s].levels[d->step[i].level].components_waiting, 0);
        lathe__state_free(&state);
    }
}

/* The whole model in world mm is what the decoder's meshes and transforms say. */
static void check_world(const phantom *p, const lathe_model *model, const decoded *d) {
    const lathe_model_info *info = lathe_model_describe(model);
    for (uint32_t level = 0; level < info->level_count; level++) {
        lathe_world_mesh world;
        uint64_t vertices = 0, triangles = 0;
        if (!CHECK(lathe_model_mesh(&world, model, -1, level, NULL) == LATHE_OK)) continue;
        for (uint32_t i = 0; i < d->count; i++) {
            uint32_t last = info->structures[d->step[i].structure].level_count - 1;
            if (d->step[i].level != (level < last ? level : last)) continue;
            vertices += d->mesh[i].vertex_count;
            triangles += d->mesh[i].triangle_count;
        }
        int ok = CHECK_EQ(world.vertex_count, vertices) && CHECK_EQ(world.triangle_count, triangles);
        ok = ok && CHECK_EQ(info->levels[level].vertices, vertices) && CHECK_EQ(info->levels[level].triangles, triangles);
        if (!ok) fprintf(stderr, "  in %s, level %u\n", p->name, level);
        lathe_world_mesh_free(&world);
    }
}

static void check_errors(const phantom *p, const lathe_model *model) {
    const lathe_model_info *info = lathe_model_describe(model);
    for (uint32_t level = 0; p->whole && level < info->level_count; level++) {
        const lathe_level_info *l = &info->levels[level];
        int ok = CHECK(l->error_rms_mm > 0 && l->error_max_mm >= l->error_rms_mm);
        if (level) ok &= CHECK(l->error_rms_mm < l[-1].error_rms_mm);
        if (!ok) fprintf(stderr, "  in %s, level %u: %g after %g\n", p->name, level, (double)l->error_rms_mm, level ? (double)l[-1].error_rms_mm : 0);
    }
    if (p->whole) CHECK(info->levels[info->level_count - 1].error_rms_mm < 0.25f);
}

static void check_phantom(const phantom *p, bool keep) {
    lathe_bytes archive = bake_as(p->make(), p->labels, p->axis, p->whole, keep), again = bake_as(p->make(), p->labels, p->axis, p->whole, keep);
    if (!CHECK(archive.size == again.size && !memcmp(archive.data, again.data, archive.size))) fprintf(stderr, "  in %s\n", p->name);
    lathe__bytes_free(&again);
    lathe_model *model = open_model(&archive);
    lathe_bytes stream = stream_of(model, -1, 0, LATHE_MAX_LEVELS);
    decoded d;
    portions_agree(&stream, p->name);
    decode(&d, &stream, 0);
    for (uint32_t s = 0; s < lathe_model_describe(model)->structure_count; s++) compare_with_state(p, model, &archive, &d, s);
    check_topology(p, model, &d);
    check_world(p, model, &d);
    if (!keep) check_errors(p, model);
    free_decoded(&d);
    lathe__bytes_free(&stream);
    lathe_model_close(&model);
    lathe__bytes_free(&archive);
}

/* ---- parts of a stream ---- */

static void check_parts(void) {
    lathe_bytes archive = bake(atlas(), 3, LATHE_AXIS_Z, false);
    lathe_model *model = open_model(&archive);
    const lathe_model_info *info = lathe_model_describe(model);
    lathe_bytes whole = stream_of(model, -1, 0, LATHE_MAX_LEVELS);
    decoded all;
    decode(&all, &whole, 0);
    CHECK_EQ(info->structure_count, 3);
    for (int64_t s = -1; s < 3; s++) {
        lathe_bytes one = stream_of(model, s, 0, LATHE_MAX_LEVELS);
        for (uint32_t cut = 1; cut < info->level_count; cut++) {
            lathe_bytes low = stream_of(model, s, 0, cut - 1), high = stream_of(model, s, cut, LATHE_MAX_LEVELS);
            CHECK_EQ(low.size + high.size, one.size);
            CHECK(low.size + high.size == one.size && low.size && !memcmp(low.data, one.data, low.size) &&
                  (!high.size || !memcmp(high.data, one.data + low.size, high.size)));
            lathe__bytes_free(&low);
            lathe__bytes_free(&high);
        }
        if (s >= 0) {
            decoded d;
            decode(&d, &one, 0);
            uint32_t found = 0;
            for (uint32_t i = 0; i < all.count; i++) {
                if (all.step[i].structure != (uint32_t)s) continue;
                CHECK(found < d.count && d.step[found].structure == 0 && same_mesh(&d.mesh[found], &all.mesh[i]));
                found++;
            }
            CHECK_EQ(found, d.count);
            free_decoded(&d);
        }
        lathe__bytes_free(&one);
    }
    free_decoded(&all);
    lathe__bytes_free(&whole);
    lathe_model_close(&model);
    lathe__bytes_free(&archive);
}

/* ---- damage ---- */

/* A prefix never fails: it gives the steps whose packets are all there, and asks for more. */
static void check_truncations(const lathe_bytes *archive) {
    lathe_model *model = open_model(archive);
    lathe_bytes stream = stream_of(model, -1, 0, LATHE_MAX_LEVELS);
    uint32_t steps = 0;
    for (size_t size = 0; size <= stream.size; size++) {
        lathe_bytes prefix = {.data = malloc(size + 1), .size = size};   /* its own memory, so that reading beyond it is seen */
        decoded d;
        if (!prefix.data) abort();
        memcpy(prefix.data, stream.data, size);
        decode(&d, &prefix, 0);
        CHECK_EQ(d.end, LATHE_MORE);
        CHECK(d.count >= steps && d.count <= steps + 1);
        steps = d.count;
        free_decoded(&d);
        lathe__bytes_free(&prefix);
    }
    CHECK_EQ(steps, lathe_model_describe(model)->level_count);
    lathe__bytes_free(&stream);
    lathe_model_close(&model);
    for (size_t size = 0; size < archive->size; size++) {
        lathe_bytes prefix = {.data = malloc(size + 1), .size = size};
        lathe_error err = {{0}};
        if (!prefix.data) abort();
        memcpy(prefix.data, archive->data, size);
        CHECK(lathe_model_parse(&model, prefix.data, size, &err) < 0 && err.text[0]);
        lathe_model_close(&model);
        lathe__bytes_free(&prefix);
    }
}

/* Every byte changed in turn: parsing or lathe_model_check finds it; the decoder ends with an error or never sees it. */
static void check_flips(const lathe_bytes *archive) {
    lathe_model *model = open_model(archive);
    size_t offset, size;
    lathe_model_stream_range(model, 0, LATHE_MAX_LEVELS, &offset, &size);
    uint32_t steps = lathe_model_describe(model)->level_count;
    CHECK(lathe_model_check(model, NULL) == LATHE_OK);
    lathe_model_close(&model);
    lathe_bytes damaged = {.data = malloc(archive->size), .size = archive->size};
    if (!damaged.data) abort();
    static const uint8_t flip[] = {0x01, 0x10, 0x80, 0xff};
    for (size_t at = 0; at < archive->size; at++)
        for (size_t k = 0; k < sizeof flip; k++) {
            lathe_error err = {{0}};
            memcpy(damaged.data, archive->data, archive->size);
            damaged.data[at] ^= flip[k];
            lathe_status status = lathe_model_parse(&model, damaged.data, damaged.size, &err);
            if (!status) status = lathe_model_check(model, &err);
            if (!CHECK(status < 0 && err.text[0])) fprintf(stderr, "  byte %zu of %zu\n", at, archive->size);
            lathe_model_close(&model);
            if (at < offset || at >= offset + size) continue;
            lathe_bytes stream = {.data = damaged.data + offset, .size = size};
            decoded d;
            decode(&d, &stream, 0);
            CHECK(d.end < 0 || d.count < steps);   /* a size that grew waits for bytes that never come */
            free_decoded(&d);
        }
    free(damaged.data);
}

static void check_misuse(void) {
    lathe_decoder *decoder = NULL;
    lathe_step step;
    lathe_decoder_close(NULL);
    lathe_decoder_close(&decoder);
    CHECK(lathe_decoder_open(&decoder) == LATHE_OK);
    CHECK_EQ(lathe_decoder_step(decoder, &step), LATHE_MORE);
    CHECK(lathe_decoder_feed(decoder, NULL, 0) == LATHE_OK);
    CHECK_EQ(lathe_decoder_step(decoder, &step), LATHE_MORE);
    CHECK(lathe_decoder_mesh(decoder, 0) == NULL && lathe_decoder_transform(decoder, 0) == NULL && lathe_decoder_structures(decoder) == 0);
    CHECK(lathe_decoder_feed(decoder, (const uint8_t *)"no archive at all", 17) == LATHE_OK);
    lathe_status status = lathe_decoder_step(decoder, &step);
    CHECK(status < 0 && lathe_decoder_error(decoder)[0]);
    CHECK_EQ(lathe_decoder_step(decoder, &step), status);
    CHECK_EQ(lathe_decoder_feed(decoder, (const uint8_t *)"x", 1), status);
    lathe_decoder_close(&decoder);
}

/* Meshes on demand are those of every step. */
static void check_on_demand(void) {
    lathe_bytes archive = bake(atlas(), 3, LATHE_AXIS_Y, false);
    lathe_model *model = open_model(&archive);
    lathe_bytes stream = stream_of(model, -1, 0, LATHE_MAX_LEVELS);
    lathe_decoder *decoder;
    lathe_step step;
    decoded d;
    decode(&d, &stream, 0);
    if (lathe_decoder_open(&decoder) || lathe_decoder_feed(decoder, stream.data, stream.size)) abort();
    lathe_decoder_build_meshes(decoder, false);
    uint32_t steps = 0;
    while (lathe_decoder_step(decoder, &step) == LATHE_OK) steps++;
    CHECK_EQ(steps, d.count);
    CHECK_EQ(lathe_decoder_structures(decoder), 3);
    for (uint32_t i = 0; i < d.count; i++)
        if (d.step[i].level + 1 == lathe_model_describe(model)->structures[d.step[i].structure].level_count)
            CHECK(same_mesh(lathe_decoder_mesh(decoder, d.step[i].structure), &d.mesh[i]));
    CHECK(lathe_decoder_mesh(decoder, 3) == NULL);
    lathe_decoder_close(&decoder);
    free_decoded(&d);
    lathe__bytes_free(&stream);
    lathe_model_close(&model);
    lathe__bytes_free(&archive);
}

int main(void) {
    for (size_t i = 0; i < sizeof PHANTOMS / sizeof *PHANTOMS; i++)
        for (int keep = 0; keep < 2; keep++) check_phantom(&PHANTOMS[i], keep);
    check_parts();
    check_on_demand();
    check_misuse();
    lathe_bytes small = bake(phantom_torus(14, 4, 1.6, PHANTOM_LABEL), 1, LATHE_AXIS_Z, false);
    check_truncations(&small);
    check_flips(&small);
    lathe__bytes_free(&small);
    return check_end();
}
