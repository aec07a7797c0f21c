/* Draco deltas of a model: the levels up to the wanted one are built and walked one after another, because which vertices are
 * old, and where they lie, depends on all of them. */
#include "draco_rings.h"
#include "restream.h"
#include <stdlib.h>
#include <string.h>

void lathe__draco_rings_free(lathe_draco_rings *rings) {
    for (uint32_t i = 0; i < rings->count; i++) {
        free(rings->tubes[i].height);
        free(rings->tubes[i].centre);
        free(rings->tubes[i].radius);
        free(rings->tubes[i].id);
    }
    free(rings->tubes);
    *rings = (lathe_draco_rings){0};
}

void lathe__draco_shape_free(lathe_draco_shape *shape) {
    free(shape->heights);
    lathe__draco_rings_free(&shape->rings);
    *shape = (lathe_draco_shape){0};
}

void lathe__draco_mesh_free(lathe_draco_mesh *mesh) {
    for (uint32_t i = 0; i < mesh->part_count; i++) {
        lathe__draco_rings_free(&mesh->parts[i].rings);
        lathe__draco_rings_free(&mesh->parts[i].form);
        free(mesh->parts[i].heights);
        free(mesh->parts[i].triangles);
        free(mesh->parts[i].contour);
    }
    for (int k = 0; k < 2; k++) lathe__ranks_free(&mesh->ranks[k]);
    free(mesh->parts);
    free(mesh->at);
    free(mesh->spare);
    free(mesh->next);
    *mesh = (lathe_draco_mesh){0};
}

lathe_status lathe__draco_delta_apply(lathe_draco_mesh *mesh, const uint8_t *bytes, size_t size) {
    if (!size) {
        mesh->level_count++;
        return LATHE_OK;
    }
    lathe_draco_carrier carrier = {0};
    lathe_status status = lathe__draco_unpack(&carrier, bytes, size);
    if (status) return status;
    if (carrier.affine) memcpy(mesh->affine, carrier.affine, sizeof mesh->affine);
    status = lathe__draco_walk(mesh, &carrier, NULL);
    lathe__draco_carrier_free(&carrier);
    return status;
}

/* ---- a level's changed structures in one ---- */

void lathe__draco_level_free(lathe_draco_level *level) {
    free(level->exact);
    free(level->half);
    free(level->part);
    free(level->ring);
    free(level->triangles);
    *level = (lathe_draco_level){0};
}

static bool grow(void **array, size_t count, size_t size) {
    void *more = count > SIZE_MAX / size ? NULL : realloc(*array, count * size);
    if (more) *array = more;
    return more != NULL;
}

static lathe_status reserve(lathe_draco_level *level, uint32_t vertices, uint32_t triangles) {
    uint64_t v = (uint64_t)level->vertex_count + vertices, t = (uint64_t)level->triangle_count + triangles;
    if (v > INT32_MAX / 3 || t > INT32_MAX / 3) return LATHE_ERR_LIMIT;
    bool good = true;
    if (v > level->vertex_room) {
        level->vertex_room = (uint32_t)(v + v / 2);
        good = grow((void **)&level->exact, level->vertex_room, sizeof *level->exact) &&
               grow((void **)&level->half, level->vertex_room, sizeof *level->half) &&
               grow((void **)&level->part, level->vertex_room, sizeof *level->part) &&
               grow((void **)&level->ring, level->vertex_room, sizeof *level->ring);
    }
    if (good && t > level->triangle_room) {
        level->triangle_room = (uint32_t)(t + t / 2);
        good = grow((void **)&level->triangles, level->triangle_room, sizeof *level->triangles);
    }
    return good ? LATHE_OK : LATHE_ERR_MEMORY;
}

/* Twice the number of the slice at a height, or of the one below, plus one. */
static int32_t half_of(const int32_t *slices, uint32_t count, int32_t w) {
    uint32_t low = 0, high = count;
    while (low < high) {
        uint32_t middle = (low + high) / 2;
        if ((int64_t)slices[middle] * (LATHE_LATTICE_ONE / 2) < w) low = middle + 1;
        else high = middle;
    }
    bool shown = low < count && slices[low] * (LATHE_LATTICE_ONE / 2) == w;
    return shown ? 2 * (int32_t)low : 2 * (int32_t)low - 1;
}

/* Of a radius map's mesh: whose tube and ray the vertices are, slice by slice and tube by tube. False: it is another one. */
static bool find_rings(uint32_t *ring, const lathe_mesh *mesh, const lathe_draco_shape *shape, const int32_t *origin) {
    uint32_t row[LATHE_DRACO_TUBES] = {0}, v = 0;
    for (uint32_t slice = 0; slice < shape->height_count; slice++)
        for (uint32_t t = 0; t < shape->rings.count; t++) {
            const lathe_draco_tube *tube = &shape->rings.tubes[t];
            if (row[t] == tube->rows || tube->height[row[t]] != shape->heights[slice]) continue;
            for (uint32_t k = 0; k < tube->rays; k++, v++) {
                uint32_t ray = tube->clockwise ? tube->rays - 1 - k : k, at = row[t] * tube->rays + ray;
                lathe_point p = lathe__draco_ring_point(tube->centre[row[t]], tube->radius[at], ray * (65536 / tube->rays), shape->turn,
                                                        (tube->height[row[t]] - tube->height[0]) / 2);
                if (v >= mesh->vertex_count || abs(p.x - mesh->lattice[v][0] - origin[0] * LATHE_LATTICE_ONE) > LATHE_LATTICE_ONE / 32 ||
                    abs(p.y - mesh->lattice[v][1] - origin[1] * LATHE_LATTICE_ONE) > LATHE_LATTICE_ONE / 32 || at >> 28)
                    return false;
                ring[v] = t << 28 | at;
            }
            row[t]++;
        }
    return v > 0;
}

lathe_status lathe__draco_level_add(lathe_draco_level *level, const lathe_mesh *mesh, uint32_t structure, lathe_draco_shape *shape,
                                    const int32_t origin[3], bool mirrored) {
    lathe_status status = reserve(level, mesh->vertex_count, mesh->triangle_count);
    if (status) return status;
    uint32_t *ring = level->ring + level->vertex_count;
    memset(ring, 0xff, (size_t)mesh->vertex_count * sizeof *ring);
    bool mapped = shape->rings.count && find_rings(ring, mesh, shape, origin), whole = true;
    for (uint32_t i = 0, at = level->vertex_count; i < mesh->vertex_count; i++, at++) {
        for (int k = 0; k < 3; k++) level->exact[at][k] = mesh->lattice[i][k] + origin[k] * LATHE_LATTICE_ONE;
        level->half[at] = half_of(shape->heights, shape->height_count, level->exact[at][2]);
        level->part[at] = structure;
        whole = whole && (ring[i] == LATHE_DRACO_NONE) == (level->half[at] & 1);
    }
    if (!mapped || !whole) lathe__draco_rings_free(&shape->rings);
    for (uint32_t t = 0; t < shape->rings.count; t++) shape->rings.tubes[t].clockwise ^= mirrored;
    for (uint32_t t = 0; t < mesh->triangle_count; t++)
        for (int k = 0; k < 3; k++)
            level->triangles[level->triangle_count + t][k] = level->vertex_count + mesh->triangles[t][mirrored && k ? 3 - k : k];
    level->vertex_count += mesh->vertex_count;
    level->triangle_count += mesh->triangle_count;
    return LATHE_OK;
}

/* ---- one delta ---- */

static lathe_status copy_triangles(lathe_draco_carrier *to, const void *triangles, uint32_t vertices, uint32_t count) {
    *to = (lathe_draco_carrier){.vertex_count = vertices, .triangle_count = count};
    to->triangles = malloc((size_t)3 * count * sizeof *to->triangles + 1);
    for (int k = 0; k < 2; k++) to->value[k] = calloc((size_t)vertices + 1, sizeof(int32_t));
    if (!to->triangles || !to->value[0] || !to->value[1]) return LATHE_ERR_MEMORY;
    memcpy(to->triangles, triangles, (size_t)3 * count * sizeof *to->triangles);
    return LATHE_OK;
}

/* In which order Draco gives vertices and triangles back: they are sent there and back with their numbers. */
static lathe_status find_order(lathe_draco_carrier *back, const lathe_draco_level *level) {
    lathe_draco_carrier there = {0};
    uint8_t *bytes = NULL;
    size_t size = 0;
    lathe_status status = copy_triangles(&there, level->triangles, level->vertex_count, level->triangle_count);
    for (uint32_t v = 0; !status && v < level->vertex_count; v++) there.value[0][v] = (int32_t)v;
    if (!status) status = lathe__draco_pack(&bytes, &size, &there);
    if (!status) status = lathe__draco_unpack(back, bytes, size);
    if (!status && (back->vertex_count != level->vertex_count || back->triangle_count != level->triangle_count)) status = LATHE_ERR_UNSUPPORTED;
    free(bytes);
    lathe__draco_carrier_free(&there);
    return status;
}

/* The level's vertices in Draco's order. *order: which they are in the level. */
static lathe_status reorder(lathe_draco_level *sorted, const lathe_draco_level *level, const lathe_draco_carrier *back) {
    lathe_status status = reserve(sorted, level->vertex_count, 0);
    for (uint32_t v = 0; !status && v < level->vertex_count; v++) {
        uint32_t from = (uint32_t)back->value[0][v];
        if (from >= level->vertex_count) return LATHE_ERR_UNSUPPORTED;
        memcpy(sorted->exact[v], level->exact[from], sizeof sorted->exact[v]);
        sorted->half[v] = level->half[from];
        sorted->part[v] = level->part[from];
        sorted->ring[v] = level->ring[from];
    }
    sorted->vertex_count = level->vertex_count;
    return status;
}

/* Packs what the walk has made, in the order of the level, so that Draco turns it the same way again. */
static lathe_status pack(uint8_t **out, size_t *size, const lathe_draco_level *level, const lathe_draco_carrier *walked, const uint32_t *order,
                         double *affine) {
    lathe_draco_carrier c = {0}, check = {0};
    lathe_status status = copy_triangles(&c, level->triangles, level->vertex_count, level->triangle_count);
    for (uint32_t v = 0; !status && v < level->vertex_count; v++)
        for (int k = 0; k < 2; k++) c.value[k][order[v]] = walked->value[k][v];
    c.words = walked->words;
    c.word_count = walked->word_count;
    c.affine = affine;
    if (!status) status = lathe__draco_pack(out, size, &c);
    c.words = NULL;
    c.affine = NULL;
    lathe__draco_carrier_free(&c);
    if (!status) status = lathe__draco_unpack(&check, *out, *size);
    if (!status && memcmp(check.triangles, walked->triangles, (size_t)3 * check.triangle_count * sizeof *check.triangles) != 0)
        status = LATHE_ERR_UNSUPPORTED;
    lathe__draco_carrier_free(&check);
    return status;
}

lathe_status lathe__draco_delta_write(uint8_t **out, size_t *size, lathe_draco_mesh *mesh, const lathe_draco_level *level,
                                      const lathe_draco_shape *shapes, double *affine) {
    lathe_draco_carrier carrier = {0};
    lathe_draco_level sorted = {0};
    uint32_t *order = NULL;
    lathe_status status = find_order(&carrier, level);
    if (!status) status = reorder(&sorted, level, &carrier);
    if (!status && !(order = malloc(((size_t)level->vertex_count + 1) * sizeof *order))) status = LATHE_ERR_MEMORY;
    for (uint32_t v = 0; !status && v < level->vertex_count; v++) order[v] = (uint32_t)carrier.value[0][v];
    lathe_draco_truth truth = {(const int32_t(*)[3])sorted.exact, sorted.half, sorted.part, sorted.ring, shapes};
    if (!status) status = lathe__draco_walk(mesh, &carrier, &truth);
    if (!status && out) status = pack(out, size, level, &carrier, order, affine);
    free(order);
    lathe__draco_level_free(&sorted);
    lathe__draco_carrier_free(&carrier);
    return status;
}

/* ---- the levels of a model ---- */

typedef struct delta_writer {
    lathe_decoder *decoder;
    lathe_status fed;
    const lathe_model *model;
    int64_t structure;         /* -1: all */
    bool alone;                /* the stream is that of the structure alone */
    uint32_t structure_count;
    lathe_draco_mesh mesh;
    lathe_mesh *latest;        /* of each structure, to see what changes */
    lathe_draco_shape *shapes; /* owned */
    lathe_draco_level level;
    double affine[12];
} delta_writer;

static int feed(void *context, const void *bytes, size_t size) {
    delta_writer *d = context;
    d->fed = lathe_decoder_feed(d->decoder, bytes, size);
    return d->fed != LATHE_OK;
}

static void close_writer(delta_writer *d) {
    for (uint32_t i = 0; i < d->structure_count; i++) {
        if (d->latest) lathe_mesh_free(&d->latest[i]);
        if (d->shapes) lathe__draco_shape_free(&d->shapes[i]);
    }
    free(d->latest);
    free(d->shapes);
    lathe__draco_level_free(&d->level);
    lathe__draco_mesh_free(&d->mesh);
    lathe_decoder_close(&d->decoder);
}

static bool is_same(const lathe_mesh *a, const lathe_mesh *b) {
    return a->vertex_count == b->vertex_count && a->triangle_count == b->triangle_count &&
           !memcmp(a->lattice, b->lattice, (size_t)a->vertex_count * sizeof *a->lattice) &&
           !memcmp(a->triangles, b->triangles, (size_t)a->triangle_count * sizeof *a->triangles);
}

static lathe_status keep(lathe_mesh *to, const lathe_mesh *from) {
    lathe_mesh_free(to);
    *to = (lathe_mesh){from->vertex_count, from->triangle_count, malloc((size_t)from->vertex_count * sizeof *to->lattice + 1),
                       malloc((size_t)from->triangle_count * sizeof *to->triangles + 1)};
    if (!to->lattice || !to->triangles) return LATHE_ERR_MEMORY;
    memcpy(to->lattice, from->lattice, (size_t)from->vertex_count * sizeof *to->lattice);
    memcpy(to->triangles, from->triangles, (size_t)from->triangle_count * sizeof *to->triangles);
    return LATHE_OK;
}

static void set_affine(delta_writer *d, const lathe_transform *t, const int32_t *origin) {
    double unit = LATHE_LATTICE_ONE / LATHE_DRACO_ONE;
    for (int i = 0; i < 3; i++) {
        double shift = t->m[i][3];
        for (int k = 0; k < 3; k++) {
            d->affine[4 * i + k] = t->m[i][k] * unit;
            shift -= t->m[i][k] * LATHE_LATTICE_ONE * origin[k];
        }
        d->affine[4 * i + 3] = shift;
    }
}

/* One tube of a radius map at a level, in its shown slices; a ray of the level is every stride-th. */
static lathe_status take_tube(lathe_draco_tube *out, const lathe_draco_shape *shape, const lathe_radius_map *map, int32_t first, bool hole,
                              const int32_t *origin, uint32_t stride) {
    uint32_t rays = map->rays / stride;
    *out = (lathe_draco_tube){.rays = rays, .clockwise = hole, .height = malloc(((size_t)shape->height_count + 1) * sizeof *out->height),
                              .centre = malloc(((size_t)shape->height_count + 1) * sizeof *out->centre),
                              .radius = malloc((size_t)shape->height_count * rays * sizeof *out->radius + 1)};
    if (!out->height || !out->centre || !out->radius) return LATHE_ERR_MEMORY;
    for (uint32_t i = 0; i < shape->height_count; i++) {
        int32_t row = shape->heights[i] / 2 - origin[2] - first;
        if (row < 0 || row >= map->slices) continue;
        out->height[out->rows] = shape->heights[i];
        for (int k = 0; k < 2; k++) out->centre[out->rows][k] = map->centre[row][k] + 2 * origin[k];
        for (uint32_t r = 0; r < rays; r++)
            out->radius[(size_t)out->rows * rays + r] = map->radius[(size_t)row * map->rays + (size_t)r * stride];
        out->rows++;
    }
    return LATHE_OK;
}

/* The radius map of a level. What is not as the mesh has it is found out by lathe__draco_level_add. */
static lathe_status take_rings(lathe_draco_shape *shape, lathe_radii *radii, const int32_t *origin, uint32_t level, uint32_t ray_stride) {
    if (radii->count > LATHE_DRACO_TUBES) return LATHE_OK;
    shape->rings.tubes = calloc(radii->count, sizeof *shape->rings.tubes);
    if (!shape->rings.tubes) return LATHE_ERR_MEMORY;
    for (uint32_t t = 0; t < radii->count; t++) {
        lathe_radius_map map = lathe__tube_shown(&radii->tubes[t], lathe__passes_at(radii, &radii->tubes[t], level));
        uint32_t stride = radii->simple ? lathe__radius_ray_stride(&map, level) : map.rays / ray_stride < 8 ? map.rays / 8 : ray_stride;
        shape->rings.count++;
        lathe_status status = take_tube(&shape->rings.tubes[t], shape, &map, radii->tubes[t].first, radii->tubes[t].hole, origin, stride);
        if (status) return status;
        shape->turn = map.turn;
    }
    return LATHE_OK;
}

/* What a raster without a sample inside shows: an octahedron, with one slice in the middle of its box, which has no other there. */
static bool is_octahedron(const lathe_structure_state *state, const lathe_mesh *mesh) {
    int32_t middle = (state->mask.size[2] - 1) * (LATHE_LATTICE_ONE / 2);
    if (!state->pyramid || mesh->vertex_count != 6 || mesh->triangle_count != 8) return false;
    for (uint32_t v = 0; v < 4; v++)
        if (mesh->lattice[v][2] != middle) return false;
    return true;
}

/* The slices that a level shows, from the box's first; arena memory. *ray_stride: of a radius map that is not a simple one. */
static lathe_status slices_of(int32_t **slices, uint32_t *count, uint32_t *ray_stride, lathe_arena *arena, const lathe_structure_state *state,
                              uint32_t level) {
    *ray_stride = 1;
    if (state->radii && !state->radii->simple) return lathe__radii_slices(slices, count, ray_stride, arena, state->radii, level);
    return state->radii ? lathe__level_slices(slices, count, arena, &state->plan, level) : lathe__state_slices(slices, count, arena, state);
}

/* What a structure that has come to a level shows: the one place that knows how levels are made. */
static lathe_status shape_of(lathe_draco_shape *shape, const lathe_structure_state *state, const lathe_mesh *mesh, uint32_t level) {
    lathe_arena arena = {0};
    int32_t *slices;
    uint32_t count = 0, ray_stride;
    lathe_status status = slices_of(&slices, &count, &ray_stride, &arena, state, level);
    *shape = (lathe_draco_shape){.height_count = count, .origin = {state->mask.origin[0], state->mask.origin[1]}};
    if (!status && !(shape->heights = malloc(((size_t)count + 1) * sizeof *shape->heights))) status = LATHE_ERR_MEMORY;
    for (uint32_t i = 0; !status && i < count; i++) shape->heights[i] = 2 * (slices[i] + state->mask.origin[2]);
    if (!status && is_octahedron(state, mesh)) {
        shape->height_count = 1;
        shape->heights[0] = 2 * state->mask.origin[2] + state->mask.size[2] - 1;
    }
    lathe__arena_free(&arena);
    if (!status && state->radii) status = take_rings(shape, state->radii, state->mask.origin, level, ray_stride);
    for (int k = 0; k < 2 && state->pyramid && !state->radii; k++) shape->stride[k] = state->stride[k];
    shape->samples = state->pyramid && !state->radii && state->flags & LATHE_FLAG_CUBES;
    return status;
}

/* A structure has come to a level. */
static lathe_status add_structure(delta_writer *d, uint32_t own, uint32_t structure, uint32_t level) {
    const lathe_mesh *mesh = lathe_decoder_mesh(d->decoder, own);
    if (!mesh) return LATHE_ERR_FORMAT;
    if (is_same(&d->latest[structure], mesh)) return LATHE_OK;
    lathe_status status = keep(&d->latest[structure], mesh);
    const lathe_structure_state *state = lathe__decoder_state(d->decoder, own);
    const lathe_transform *transform = lathe_decoder_transform(d->decoder, own);
    if (!d->mesh.level_count) set_affine(d, transform, state->mask.origin);
    lathe_draco_shape *shape = &d->shapes[structure], before = *shape;
    lathe__draco_shape_free(shape);
    if (!status) status = shape_of(shape, state, mesh, level);
    memcpy(shape->before, before.stride, sizeof before.stride);
    if (!status)
        status = lathe__draco_level_add(&d->level, mesh, structure, shape, state->mask.origin, lathe_transform_mirrors(transform));
    return status;
}

static lathe_status end_level(delta_writer *d, bool wanted, uint8_t **out, size_t *size) {
    lathe_status status = LATHE_OK;
    if (d->level.triangle_count)
        status = lathe__draco_delta_write(wanted ? out : NULL, size, &d->mesh, &d->level, d->shapes, d->mesh.level_count ? NULL : d->affine);
    else d->mesh.level_count++;
    d->level.vertex_count = d->level.triangle_count = 0;
    return status;
}

static lathe_status run(delta_writer *d, uint32_t level, uint8_t **out, size_t *size) {
    lathe_step step;
    uint32_t at = 0;
    for (;;) {
        lathe_status status = lathe_decoder_step(d->decoder, &step);
        if (status == LATHE_MORE) break;
        while (!status && at < step.level) status = end_level(d, false, out, size), at++;
        uint32_t structure = d->alone ? (uint32_t)d->structure : step.structure;
        if (!status && (d->structure < 0 || structure == d->structure)) status = add_structure(d, step.structure, structure, step.level);
        if (status) return status;
    }
    while (at < level) {
        lathe_status status = end_level(d, false, out, size);
        if (status) return status;
        at++;
    }
    return end_level(d, true, out, size);
}

static lathe_status open_writer(delta_writer *d, uint32_t level) {
    d->latest = calloc((size_t)d->structure_count + 1, sizeof *d->latest);
    d->shapes = calloc((size_t)d->structure_count + 1, sizeof *d->shapes);
    lathe_status status = lathe_decoder_open(&d->decoder);
    if (status || !d->latest || !d->shapes) return LATHE_ERR_MEMORY;
    lathe_decoder_build_meshes(d->decoder, false);
    status = lathe_model_stream(d->model, d->alone ? d->structure : -1, 0, level, feed, d);
    return d->fed ? d->fed : status;
}

lathe_status lathe_write_draco_delta(const lathe_model *model, int64_t structure, uint32_t level, lathe_sink sink, void *context,
                                     lathe_error *err) {
    const lathe_model_info *info = lathe_model_describe(model);
    if (structure >= info->structure_count)
        return lathe_fail(err, LATHE_ERR_RANGE, "structure %lld: the model has %u", (long long)structure, info->structure_count);
    if (level >= info->level_count)
        return lathe_fail(err, LATHE_ERR_RANGE, "level %u: the last one is %u", level, info->level_count - 1);
    delta_writer d = {.model = model, .structure = structure, .alone = structure >= 0 && info->independent,
                      .structure_count = info->structure_count};
    uint8_t *bytes = NULL;
    size_t size = 0;
    lathe_status status = open_writer(&d, level);
    if (!status) status = run(&d, level, &bytes, &size);
    const char *detail = d.decoder ? lathe_decoder_error(d.decoder) : "";
    if (status) lathe_fail(err, status, "%s", *detail ? detail : lathe_status_name(status));
    close_writer(&d);
    if (!status && size && sink(context, bytes, size)) status = LATHE_ERR_IO;
    free(bytes);
    return status;
}
