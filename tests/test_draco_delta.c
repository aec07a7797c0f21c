/* Draco deltas, written and applied: every level closed and manifold, its vertices where the level has them, old ones kept; fewer
 * bytes than whole levels; hostile bytes. web/test/draco.test.mjs applies the same bytes with the other decoder. */
#include "archive_write.h"
#include "check.h"
#include "draco_delta.h"
#include "mesh.h"
#include "phantom.h"
#include "restream.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

static int append(void *context, const void *bytes, size_t size) {
    lathe_bytes *out = context;
    lathe__emit(out, bytes, size);
    return out->failed;
}

typedef struct subject {
    const char *name;
    lathe_bytes archive;
    lathe_model *model;
} subject;

typedef struct baking { lathe_axis axis; int labels; bool exact, keep, independent; } baking;

static subject bake(const char *name, lathe_volume *volume, baking how) {
    subject s = {.name = name};
    lathe_bake_options options;
    lathe_error err = {{0}};
    lathe_bake_structure labels[4];
    lathe_bake_defaults(&options);
    for (int i = 0; i < how.labels; i++) {
        labels[i] = (lathe_bake_structure){.label = i + 1};
        snprintf(labels[i].name, sizeof labels[i].name, "label %d", i + 1);
    }
    options.axis = how.axis;
    options.iso = PHANTOM_ISO;
    options.structures = labels;
    options.structure_count = (size_t)how.labels;
    options.exact = how.exact;
    options.keep_topology = how.keep;
    options.independent = how.independent;
    options.measure = options.draco = false;
    if (!volume || !CHECK(lathe_bake(volume, &options, append, &s.archive, &err) == LATHE_OK) ||
        !CHECK(lathe_model_parse(&s.model, s.archive.data, s.archive.size, &err) == LATHE_OK)) {
        fprintf(stderr, "%s: %s\n", name, err.text);
        abort();
    }
    lathe_volume_close(&volume);
    return s;
}

static void close_subject(subject *s) {
    lathe_model_close(&s->model);
    lathe__bytes_free(&s->archive);
}

/* Four balls of different sizes, so that structures end at different levels. */
static lathe_volume *balls(void) {
    enum { N = 48 };
    static const double ball[4][4] = {{16, 17, 24, 13.3}, {36, 12, 20, 7.2}, {36, 36, 33, 9.4}, {9, 39, 10, 3.1}};
    float *values = calloc((size_t)N * N * N, sizeof *values);
    lathe_volume *volume = NULL;
    for (int i = 0; values && i < N * N * N; i++)
        for (int k = 0; k < 4; k++) {
            double x = i % N - ball[k][0], y = i / N % N - ball[k][1], z = i / N / N - ball[k][2];
            if (x * x + y * y + z * z + 6 * sin(0.9 * x) * cos(0.7 * y + k) < ball[k][3] * ball[k][3]) values[i] = (float)(k + 1);
        }
    if (values) lathe_volume_wrap(&volume, (int32_t[]){N, N, N}, (double[]){1, 1.5, 2}, values, NULL);
    free(values);
    return volume;
}

static double distance_to(const double p[3], const double a[3], const double b[3]) {
    double dot = 0, length = 0, sum = 0;
    for (int k = 0; k < 3; k++) dot += (p[k] - a[k]) * (b[k] - a[k]), length += (b[k] - a[k]) * (b[k] - a[k]);
    double t = dot < 0 ? 0 : dot > length ? 1 : dot / length;
    for (int k = 0; k < 3; k++) sum += pow(p[k] - a[k] - t * (b[k] - a[k]), 2);
    return sqrt(sum);
}

/* An oval trunk with a vessel inside that parts into two, as a cavity; grey values: several tubes of radius maps, some of them holes. */
static lathe_volume *fork_tubes(void) {
    enum { N = 64 };
    static const double at[4][3] = {{32, 32, 8}, {32, 32, 28}, {19, 32, 54}, {45, 33, 52}};
    float *values = calloc((size_t)N * N * N, sizeof *values);
    lathe_volume *volume = NULL;
    for (int i = 0; values && i < N * N * N; i++) {
        double p[3] = {i % N, i / N % N, i / N / N}, round = hypot((p[0] - 32) / 29, (p[1] - 32) / 22), trunk = (1 - round) * 22;
        double vessel = fmin(distance_to(p, at[0], at[1]) - 6, fmin(distance_to(p, at[1], at[2]) - 5, distance_to(p, at[1], at[3]) - 5));
        double inside = p[2] < 2 || p[2] > 61 ? -4 : fmin(trunk, vessel);
        values[i] = (float)(PHANTOM_ISO + 20 * fmax(-4, fmin(4, inside)));
    }
    if (values) lathe_volume_wrap(&volume, (int32_t[]){N, N, N}, (double[]){1, 1, 1}, values, NULL);
    free(values);
    return volume;
}

/* ---- a level as the archive has it ---- */

static int feed(void *context, const void *bytes, size_t size) { return lathe_decoder_feed(context, bytes, size) != LATHE_OK; }

static lathe_decoder *decode_to(const lathe_model *model, uint32_t level) {
    lathe_decoder *decoder = NULL;
    lathe_step step;
    CHECK_EQ(lathe_decoder_open(&decoder), LATHE_OK);
    lathe_decoder_build_meshes(decoder, false);
    CHECK_EQ(lathe_model_stream(model, -1, 0, level, feed, decoder), LATHE_OK);
    while (lathe_decoder_step(decoder, &step) == LATHE_OK) continue;
    return decoder;
}

/* The client's structure with its own numbers of vertices. */
static lathe_mesh as_mesh(const lathe_draco_mesh *client, const lathe_draco_part *part, uint32_t **ids) {
    lathe_mesh mesh = {.triangle_count = part->triangle_count};
    uint32_t *own = malloc((client->vertex_count + 1) * sizeof *own);
    memset(own, 0xff, client->vertex_count * sizeof *own);
    mesh.triangles = malloc((part->triangle_count + 1) * sizeof *mesh.triangles);
    mesh.lattice = malloc((3 * (size_t)part->triangle_count + 1) * sizeof *mesh.lattice);
    *ids = malloc((3 * (size_t)part->triangle_count + 1) * sizeof **ids);
    for (size_t i = 0; i < (size_t)3 * part->triangle_count; i++) {
        uint32_t v = part->triangles[i / 3][i % 3];
        if (own[v] == UINT32_MAX) {
            (*ids)[mesh.vertex_count] = v;
            memcpy(mesh.lattice[mesh.vertex_count], client->at[v], sizeof client->at[v]);
            own[v] = mesh.vertex_count++;
        }
        mesh.triangles[i / 3][i % 3] = own[v];
    }
    free(own);
    return mesh;
}

/* The one vertex of `list` within its tolerance of an exact place in a slice, or -1: none, -2: several. */
static int64_t find_vertex(const lathe_mesh *mesh, const int32_t *exact, const int32_t *origin, double tolerance) {
    int64_t found = -1;
    for (uint32_t v = 0; v < mesh->vertex_count; v++) {
        const int32_t *at = mesh->lattice[v];
        if ((at[2] - origin[2] * LATHE_DRACO_ONE) * (LATHE_LATTICE_ONE / LATHE_DRACO_ONE) != exact[2]) continue;
        double du = (at[0] - origin[0] * LATHE_DRACO_ONE) * 8192.0 - exact[0], dv = (at[1] - origin[1] * LATHE_DRACO_ONE) * 8192.0 - exact[1];
        if (hypot(du, dv) > tolerance) continue;
        found = found == -1 ? (int64_t)v : -2;
    }
    return found;
}

static int compare_edges(const void *a, const void *b) {
    uint64_t x = *(const uint64_t *)a, y = *(const uint64_t *)b;
    return x < y ? -1 : x > y;
}
static uint64_t *list_edges(const lathe_mesh *mesh) {
    uint64_t *edges = malloc((3 * (size_t)mesh->triangle_count + 1) * sizeof *edges);
    for (size_t i = 0; i < (size_t)3 * mesh->triangle_count; i++)
        edges[i] = (uint64_t)mesh->triangles[i / 3][i % 3] << 32 | mesh->triangles[i / 3][(i + 1) % 3];
    qsort(edges, (size_t)3 * mesh->triangle_count, sizeof *edges, compare_edges);
    return edges;
}

/* What is in shown slices: each vertex has one near it, and each edge between two of them is one of the client's, that way round. */
static void compare_outlines(const lathe_mesh *exact, const lathe_mesh *mesh, const lathe_draco_part *part, const int32_t *origin, bool mirrored) {
    int64_t *near = malloc((exact->vertex_count + 1) * sizeof *near);
    uint64_t *edges = list_edges(mesh), missing = 0, several = 0, wrong = 0, right = 0, outline = 0;
    double tolerance = part->form.count ? LATHE_DRACO_RING : LATHE_DRACO_TOLERANCE * (double)(1u << part->grain_log);
    for (uint32_t v = 0; v < exact->vertex_count; v++) {
        near[v] = -3;
        for (uint32_t i = 0; i < part->height_count; i++)
            if ((part->heights[i] - 2 * origin[2]) * (LATHE_LATTICE_ONE / 2) == exact->lattice[v][2])
                near[v] = find_vertex(mesh, exact->lattice[v], origin, tolerance);
        outline += near[v] != -3;
        missing += near[v] == -1;
        several += near[v] == -2;
    }
    for (size_t i = 0; i < (size_t)3 * exact->triangle_count; i++) {
        uint32_t p = exact->triangles[i / 3][i % 3], q = exact->triangles[i / 3][(i + 1) % 3];
        if (near[p] < 0 || near[q] < 0) continue;
        uint64_t edge = mirrored ? (uint64_t)near[q] << 32 | (uint64_t)near[p] : (uint64_t)near[p] << 32 | (uint64_t)near[q];
        if (bsearch(&edge, edges, (size_t)3 * mesh->triangle_count, sizeof edge, compare_edges)) right++;
        else wrong++;
    }
    CHECK_EQ(missing, 0);
    CHECK_EQ(wrong, 0);
    CHECK(right > 0);
    CHECK(several * 20 <= outline);
    free(near);
    free(edges);
}

static double volume_mm3(const lathe_draco_mesh *client, const lathe_draco_part *part) {
    double sum = 0;
    for (uint32_t t = 0; t < part->triangle_count; t++) {
        double p[3][3];
        for (int k = 0; k < 3; k++)
            for (int i = 0; i < 3; i++) {
                const double *m = client->affine + 4 * i;
                const int32_t *at = client->at[part->triangles[t][k]];
                p[k][i] = m[0] * at[0] + m[1] * at[1] + m[2] * at[2] + m[3];
            }
        sum += p[0][0] * (p[1][1] * p[2][2] - p[1][2] * p[2][1]) + p[0][1] * (p[1][2] * p[2][0] - p[1][0] * p[2][2]) +
               p[0][2] * (p[1][0] * p[2][1] - p[1][1] * p[2][0]);
    }
    return sum / 6;
}

static double exact_volume(const lathe_mesh *mesh, const lathe_transform *transform) {
    lathe_draco_mesh like = {0};
    lathe_draco_part part = {.triangle_count = mesh->triangle_count, .triangles = malloc((mesh->triangle_count + 1) * sizeof *part.triangles)};
    for (int i = 0; i < 12; i++) like.affine[i] = transform->m[i / 4][i % 4];
    like.at = mesh->lattice;
    lathe_mesh_indices(mesh, transform, &part.triangles[0][0]);
    double volume = volume_mm3(&like, &part);
    free(part.triangles);
    return volume;
}

/* ---- levels ---- */

static void check_level(const lathe_draco_mesh *client, const lathe_model *model, uint32_t level) {
    lathe_decoder *decoder = decode_to(model, level);
    for (uint32_t s = 0; s < lathe_model_describe(model)->structure_count; s++) {
        const lathe_mesh *exact = lathe_decoder_mesh(decoder, s);
        const lathe_structure_state *state = lathe__decoder_state(decoder, s);
        const lathe_transform *transform = lathe_decoder_transform(decoder, s);
        if (!CHECK(exact != NULL) || !CHECK(s < client->part_count)) continue;
        uint32_t *ids, count;
        int32_t *slices;
        lathe_arena arena = {0};
        lathe_mesh mesh = as_mesh(client, &client->parts[s], &ids);
        lathe_mesh_report mine, theirs;
        CHECK_EQ(mesh.vertex_count, exact->vertex_count);
        CHECK_EQ(mesh.triangle_count, exact->triangle_count);
        CHECK_EQ(lathe__mesh_check(&mine, &mesh, false), LATHE_OK);
        CHECK_EQ(lathe__mesh_check(&theirs, exact, false), LATHE_OK);
        CHECK_EQ(mine.boundary_edges + mine.nonmanifold_edges + mine.misoriented_edges + mine.nonmanifold_vertices, 0);
        CHECK_EQ(mine.euler, theirs.euler);
        CHECK_EQ(mine.components, theirs.components);
        CHECK_EQ(lathe__state_slices(&slices, &count, &arena, state), LATHE_OK);
        const lathe_draco_part *part = &client->parts[s];
        /* A lattice without a sample inside is an octahedron with a slice of its own. */
        if (!state->radii && (exact->vertex_count != 6 || part->height_count != 1)) {
            CHECK_EQ(part->height_count, count);
            for (uint32_t i = 0; i < count && i < part->height_count; i++) CHECK_EQ(part->heights[i], 2 * (slices[i] + state->mask.origin[2]));
        }
        compare_outlines(exact, &mesh, part, state->mask.origin, lathe_transform_mirrors(transform));
        double own = volume_mm3(client, &client->parts[s]), right = exact_volume(exact, transform);
        if (!CHECK(own > 0 && fabs(own - right) < 0.04 * right + 1)) fprintf(stderr, "level %u, structure %u: %.2f mm^3 instead of %.2f\n", level, s, own, right);
        lathe__arena_free(&arena);
        lathe_mesh_free(&mesh);
        free(ids);
    }
    lathe_decoder_close(&decoder);
}

static size_t whole_level(const lathe_model *model, uint32_t level) {
    lathe_world_mesh mesh;
    lathe_bytes out = {0};
    CHECK_EQ(lathe_model_mesh(&mesh, model, -1, level, NULL), LATHE_OK);
    CHECK_EQ(lathe_write_drc(&mesh, 0, append, &out), LATHE_OK);
    lathe_world_mesh_free(&mesh);
    size_t size = out.size;
    lathe__bytes_free(&out);
    return size;
}

/* What a client had before a delta: where its vertices were, and which lay in slices. */
typedef struct before { uint32_t count; int32_t (*at)[3]; uint8_t *in_slice; } before;
static before remember(const lathe_draco_mesh *client) {
    before b = {client->vertex_count, malloc((client->vertex_count + 1) * sizeof *b.at), calloc(client->vertex_count + 1, 1)};
    if (b.count) memcpy(b.at, client->at, b.count * sizeof *b.at);
    for (uint32_t p = 0; p < client->part_count; p++)
        for (uint32_t i = 0; i < client->parts[p].contour_count; i++) b.in_slice[client->parts[p].contour[i]] = 1;
    return b;
}

typedef struct kept { uint32_t old, kept, moved, used, strays; } kept;
/* Vertices in slices keep their numbers and their slices, and move by half an edge of the old lattice at most: some of the new one's
 * least, as a level may halve a stride twice. */
static kept compare_kept(const lathe_draco_mesh *client, before *b) {
    kept k = {0};
    uint8_t *used = calloc(client->vertex_count + 1, 1);
    for (uint32_t v = 0; v < b->count; v++) k.old += b->in_slice[v];
    for (uint32_t p = 0; p < client->part_count; p++) {
        const lathe_draco_part *part = &client->parts[p];
        for (size_t i = 0; i < (size_t)3 * part->triangle_count; i++) used[part->triangles[i / 3][i % 3]] = 1;
        for (uint32_t i = 0; i < part->contour_count; i++) {
            uint32_t v = part->contour[i];
            if (v >= b->count || !b->in_slice[v] || b->at[v][2] != client->at[v][2]) continue;
            int32_t du = abs(client->at[v][0] - b->at[v][0]), dv = abs(client->at[v][1] - b->at[v][1]);
            k.kept++;
            k.moved += du || dv;
            /* A radius map's may be predicted otherwise than they were. */
            if (!part->form.count) k.strays += (du > dv ? du : dv) >= 4 * LATHE_DRACO_ONE << part->grain_log;
        }
    }
    for (uint32_t v = 0; v < client->vertex_count; v++) k.used += used[v];
    free(used);
    free(b->at);
    free(b->in_slice);
    return k;
}

typedef struct total { size_t deltas, whole, last; uint32_t old, kept, moved, vertices, used, tubes; } total;

static total test_levels(subject *s) {
    uint32_t levels = lathe_model_describe(s->model)->level_count;
    lathe_draco_mesh client = {0};
    total sum = {0};
    for (uint32_t n = 0; n < levels; n++) {
        lathe_bytes delta = {0}, again = {0};
        before b = remember(&client);
        CHECK_EQ(lathe_write_draco_delta(s->model, -1, n, append, &delta, NULL), LATHE_OK);
        CHECK_EQ(lathe_write_draco_delta(s->model, -1, n, append, &again, NULL), LATHE_OK);
        CHECK(delta.size == again.size && (!delta.size || !memcmp(delta.data, again.data, delta.size)));
        if (!CHECK_EQ(lathe__draco_delta_apply(&client, delta.data, delta.size), LATHE_OK)) fprintf(stderr, "%s, level %u\n", s->name, n);
        CHECK_EQ(client.level_count, n + 1);
        check_level(&client, s->model, n);
        kept k = compare_kept(&client, &b);
        if (!CHECK_EQ(k.strays, 0)) fprintf(stderr, "%s, level %u\n", s->name, n);
        sum.old += k.old, sum.kept += k.kept, sum.moved += k.moved;
        sum.vertices = client.vertex_count, sum.used = k.used, sum.tubes = client.part_count ? client.parts[0].form.count : 0;
        sum.deltas += delta.size;
        sum.last = whole_level(s->model, n);
        sum.whole += sum.last;
        lathe__bytes_free(&delta);
        lathe__bytes_free(&again);
    }
    lathe__draco_mesh_free(&client);
    return sum;
}

static void test_structure(subject *s, int64_t structure) {
    const lathe_model_info *info = lathe_model_describe(s->model);
    uint32_t own = info->structures[structure].level_count;
    lathe_draco_mesh client = {0};
    for (uint32_t n = 0; n < info->level_count; n++) {
        lathe_bytes delta = {0};
        CHECK_EQ(lathe_write_draco_delta(s->model, structure, n, append, &delta, NULL), LATHE_OK);
        CHECK((delta.size > 0) == (n < own));
        CHECK_EQ(lathe__draco_delta_apply(&client, delta.data, delta.size), LATHE_OK);
        lathe__bytes_free(&delta);
    }
    lathe_world_mesh mesh;
    CHECK_EQ(lathe_model_mesh(&mesh, s->model, structure, info->level_count - 1, NULL), LATHE_OK);
    if (CHECK(client.part_count == (uint32_t)structure + 1)) CHECK_EQ(client.parts[structure].triangle_count, mesh.triangle_count);
    for (uint32_t p = 0; p + 1 < client.part_count; p++) CHECK_EQ(client.parts[p].triangle_count, 0);
    lathe_world_mesh_free(&mesh);
    lathe__draco_mesh_free(&client);
}

/* ---- two lattices, without an archive ---- */

/* A lumpy ball around the middle; as any shape, it has edges of the coarse lattice that are crossed in either half. */
static void fill_mask(lathe_mask *mask, int32_t size) {
    CHECK_EQ(lathe__mask_new(mask, (int32_t[]){size + 2, size + 2, size}, (int32_t[]){5, -3, 7}), LATHE_OK);
    for (int32_t w = 0; w < size; w++)
        for (int32_t v = 1; v <= size; v++)
            for (int32_t u = 1; u <= size; u++) {
                double x = u - size / 2.0, y = v - size / 2.0, z = w - size / 2.0, r = 0.38 * size + 2 * sin(0.8 * x) * cos(0.7 * y + 0.5 * z);
                if (x * x + y * y + z * z > r * r) continue;
                lathe__mask_slice(mask, w)[(size_t)v * (size_t)mask->row_words + ((uint32_t)u >> 6)] |= (uint64_t)1 << (u & 63);
            }
}

static bool has_voxel(const lathe_mask *mask, int32_t u, int32_t v, int32_t w) {
    return lathe__slice_pixel(lathe__mask_slice(mask, w), mask->row_words, u, v);
}

/* Every stride-th voxel, and the surface of these in the frame of the whole mask. */
static void build_lattice(lathe_mesh *mesh, lathe_draco_shape *shape, const lathe_mask *whole, int32_t stride) {
    int32_t size[3], slices[64];
    for (int k = 0; k < 3; k++) size[k] = (whole->size[k] - 1) / stride + 1 + (k < 2 && stride > 1);
    lathe_mask mask = {0};
    CHECK_EQ(lathe__mask_new(&mask, size, whole->origin), LATHE_OK);
    for (int32_t w = 0; w < size[2]; w++)
        for (int32_t v = 0; v * stride < whole->size[1]; v++)
            for (int32_t u = 0; u * stride < whole->size[0]; u++)
                if (has_voxel(whole, u * stride, v * stride, w * stride))
                    lathe__mask_slice(&mask, w)[(size_t)v * (size_t)mask.row_words + ((uint32_t)u >> 6)] |= (uint64_t)1 << (u & 63);
    lathe_arena arena[2] = {{0}, {0}};
    lathe_surface_counts counts;
    for (int32_t w = 0; w < size[2]; w++) slices[w] = w;
    CHECK_EQ(lathe__build_surface(mesh, arena, &mask, slices, (uint32_t)size[2], 32, 0, &counts), LATHE_OK);
    for (uint32_t i = 0; i < mesh->vertex_count; i++)
        for (int k = 0; k < 3; k++) mesh->lattice[i][k] *= stride;
    *shape = (lathe_draco_shape){.height_count = (uint32_t)size[2], .heights = malloc((size_t)size[2] * sizeof(int32_t)),
                                 .origin = {whole->origin[0], whole->origin[1]}, .stride = {stride, stride}, .before = {2 * stride, 2 * stride}};
    for (int32_t w = 0; w < size[2]; w++) shape->heights[w] = 2 * (w * stride + whole->origin[2]);
    lathe__arena_free(&arena[0]);
    lathe__arena_free(&arena[1]);
    lathe__mask_free(&mask);
}

/* The place in half edges of the coarse lattice: one is odd on an edge (dents lie elsewhere). Eighths of a voxel. */
static bool is_on_edge(const int32_t at[3], const int32_t *origin, int *axis) {
    int32_t rest[2];
    for (int k = 0; k < 2; k++) rest[k] = (at[k] - LATHE_DRACO_ONE * origin[k]) % (2 * LATHE_DRACO_ONE);
    *axis = rest[0] ? 0 : 1;
    return (rest[0] == 0) != (rest[1] == 0);
}

static void test_nested(void) {
    lathe_mask whole = {0};
    fill_mask(&whole, 30);
    lathe_draco_mesh writer = {0}, client = {0};
    before b = {0};
    uint32_t edges = 0, kept = 0, far = 0, wrong = 0;
    for (int32_t stride = 2; stride; stride--) {
        lathe_mesh mesh = {0};
        lathe_draco_shape shape;
        lathe_draco_level level = {0};
        double affine[12] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0};
        uint8_t *bytes = NULL;
        size_t size = 0;
        build_lattice(&mesh, &shape, &whole, stride);
        CHECK_EQ(lathe__draco_level_add(&level, &mesh, 0, &shape, whole.origin, false), LATHE_OK);
        CHECK_EQ(lathe__draco_delta_write(&bytes, &size, &writer, &level, &shape, stride > 1 ? affine : NULL), LATHE_OK);
        if (stride == 1) b = remember(&client);
        CHECK_EQ(lathe__draco_delta_apply(&client, bytes, size), LATHE_OK);
        CHECK_EQ(client.parts[0].triangle_count, mesh.triangle_count);
        CHECK_EQ(client.parts[0].grain_log, (uint32_t)stride - 1);
        printf("nested, stride %d: %u vertices, %zu bytes\n", stride, mesh.vertex_count, size);
        free(bytes);
        lathe__draco_level_free(&level);
        lathe__draco_shape_free(&shape);
        lathe_mesh_free(&mesh);
    }
    /* A vertex on a coarse edge is on the same edge now, in the half where the voxels change. */
    uint8_t *in_slice = calloc(client.vertex_count + 1, 1);
    for (uint32_t i = 0; i < client.parts[0].contour_count; i++) in_slice[client.parts[0].contour[i]] = 1;
    for (uint32_t v = 0; v < b.count; v++) {
        int axis;
        if (!b.in_slice[v] || !is_on_edge(b.at[v], whole.origin, &axis)) continue;
        edges++;
        if (!in_slice[v]) continue;
        kept++;
        int32_t p[3], move = client.at[v][axis] - b.at[v][axis];
        for (int k = 0; k < 3; k++) p[k] = (b.at[v][k] - LATHE_DRACO_ONE * whole.origin[k] + LATHE_DRACO_ONE / 2) / LATHE_DRACO_ONE;
        far += client.at[v][!axis] != b.at[v][!axis] || client.at[v][2] != b.at[v][2] || abs(abs(move) - LATHE_DRACO_ONE / 2) > 1;
        int32_t next[2] = {p[0], p[1]}; /* the middle sample is p, and the one before it on the edge is p - 1 */
        next[axis]--;
        wrong += (has_voxel(&whole, p[0], p[1], p[2]) != has_voxel(&whole, next[0], next[1], p[2])) != (move < 0);
    }
    CHECK(edges > 500);
    CHECK_EQ(kept, edges);
    CHECK_EQ(far, 0);
    CHECK_EQ(wrong, 0);
    CHECK_EQ(writer.vertex_count, client.vertex_count);
    CHECK(!memcmp(writer.at, client.at, writer.vertex_count * sizeof *writer.at));
    free(in_slice);
    free(b.at);
    free(b.in_slice);
    lathe__draco_mesh_free(&writer);
    lathe__draco_mesh_free(&client);
    lathe__mask_free(&whole);
}

/* ---- what is not as it should be ---- */

static void test_hostile(subject *s) {
    lathe_bytes delta[2] = {{0}, {0}};
    uint32_t random = 7, accepted = 0;
    for (uint32_t n = 0; n < 2; n++) CHECK_EQ(lathe_write_draco_delta(s->model, -1, n, append, &delta[n], NULL), LATHE_OK);
    lathe_draco_mesh client = {0};
    CHECK(lathe__draco_delta_apply(&client, delta[1].data, delta[1].size) != LATHE_OK); /* without the one before */
    lathe__draco_mesh_free(&client);
    for (size_t size = 1; size < delta[0].size; size += 1 + delta[0].size / 200) {
        CHECK(lathe__draco_delta_apply(&client, delta[0].data, size) != LATHE_OK);
        lathe__draco_mesh_free(&client);
    }
    for (int i = 0; i < 600; i++) {
        lathe_bytes *d = &delta[i & 1];
        size_t at = phantom_random(&random) % d->size;
        uint8_t flip = (uint8_t)(1 << phantom_random(&random) % 8);
        if (i & 1) CHECK_EQ(lathe__draco_delta_apply(&client, delta[0].data, delta[0].size), LATHE_OK);
        d->data[at] ^= flip;
        lathe_status status = lathe__draco_delta_apply(&client, d->data, d->size);
        d->data[at] ^= flip;
        accepted += status == LATHE_OK; /* the check sum has no say in Draco's own header, nor in the affine */
        lathe__draco_mesh_free(&client);
    }
    CHECK(accepted < 600 / 4);
    lathe_error err = {{0}};
    CHECK_EQ(lathe_write_draco_delta(s->model, -1, 99, append, &delta[0], &err), LATHE_ERR_RANGE);
    CHECK_EQ(lathe_write_draco_delta(s->model, 99, 0, append, &delta[0], &err), LATHE_ERR_RANGE);
    CHECK(*err.text);
    for (uint32_t n = 0; n < 2; n++) lathe__bytes_free(&delta[n]);
}

/* Symbols and numbers that no writer makes, in a delta that Draco decodes. */
static void test_symbols(subject *s) {
    lathe_bytes delta[2] = {{0}, {0}};
    lathe_draco_carrier whole[2] = {{0}, {0}};
    uint32_t random = 3, accepted = 0, changed = 0;
    for (uint32_t n = 0; n < 2; n++) {
        CHECK_EQ(lathe_write_draco_delta(s->model, -1, n, append, &delta[n], NULL), LATHE_OK);
        CHECK_EQ(lathe__draco_unpack(&whole[n], delta[n].data, delta[n].size), LATHE_OK);
    }
    for (int i = 0; i < 300; i++) {
        lathe_draco_mesh client = {0};
        lathe_draco_carrier *c = &whole[i & 1];
        if (i & 1) CHECK_EQ(lathe__draco_delta_apply(&client, delta[0].data, delta[0].size), LATHE_OK);
        int32_t *values[3] = {c->value[0], c->value[1], c->words}, *array = values[i % 3];
        uint32_t count = i % 3 < 2 ? c->vertex_count : c->word_count, at = count ? phantom_random(&random) % count : 0;
        if (!count) continue;
        int32_t old = array[at], byte = (int32_t)(phantom_random(&random) % 4) * 8;
        array[at] = i % 3 < 2 ? (int32_t)(i % 5 ? phantom_random(&random) % 12 : phantom_random(&random)) : old ^ (int32_t)(phantom_random(&random) % 256 << byte);
        lathe_status status = lathe__draco_walk(&client, c, NULL);
        changed += array[at] != old;
        accepted += array[at] != old && status == LATHE_OK;
        array[at] = old;
        lathe__draco_mesh_free(&client);
    }
    CHECK(changed > 200);
    CHECK(accepted * 5 < changed); /* what has no meaning, as an old vertex' symbol, or the padding of words */
    for (uint32_t n = 0; n < 2; n++) {
        lathe__draco_carrier_free(&whole[n]);
        lathe__bytes_free(&delta[n]);
    }
}

/* Words and values that no writer makes, behind a mesh that is closed: a tetrahedron. */
static void test_carriers(void) {
    uint32_t triangles[12] = {0, 1, 2, 0, 3, 1, 1, 3, 2, 0, 2, 3}, random = 5;
    lathe_draco_mesh client = {0};
    for (int i = 0; i < 3000; i++) {
        int32_t values[2][4], words[8];
        for (int k = 0; k < 4; k++) {
            values[0][k] = (int32_t)(phantom_random(&random) % 4) - (i % 7 == 0);
            values[1][k] = i % 5 ? (int32_t)(phantom_random(&random) % 5) : (int32_t)phantom_random(&random);
        }
        for (int k = 0; k < 8; k++) words[k] = (int32_t)(phantom_random(&random) & (i & 1 ? 0x03030303u : 0xffffffffu));
        lathe_draco_carrier carrier = {4, 4, (uint32_t)i % 9, triangles, {values[0], values[1]}, words, NULL};
        CHECK(lathe__draco_walk(&client, &carrier, NULL) != LATHE_OK);
        if (i % 16 == 0) lathe__draco_mesh_free(&client);
    }
    lathe__draco_mesh_free(&client);
    triangles[0] = 1; /* not closed */
    int32_t zero[4] = {0};
    lathe_draco_carrier carrier = {4, 4, 0, triangles, {zero, zero}, NULL, NULL};
    CHECK_EQ(lathe__draco_walk(&client, &carrier, NULL), LATHE_ERR_FORMAT);
    lathe__draco_mesh_free(&client);
}

int main(void) {
    subject s[] = {
        bake("column", phantom_column(96, 2, PHANTOM_GREY), (baking){.axis = LATHE_AXIS_Z}),
        bake("branch", phantom_branch(40, PHANTOM_GREY), (baking){.axis = LATHE_AXIS_Y, .exact = true}),
        bake("blobs", phantom_blobs(36, 9, 3, PHANTOM_LABEL), (baking){.axis = LATHE_AXIS_X, .labels = 1}),
        bake("sphere", phantom_sphere(40, 15.2, PHANTOM_GREY), (baking){.axis = LATHE_AXIS_Z}),
        bake("shells", phantom_shells(32, PHANTOM_GREY), (baking){.axis = LATHE_AXIS_Z, .keep = true}),
        bake("noise", phantom_noise(14, 14, 14, 40, 11, PHANTOM_LABEL), (baking){.axis = LATHE_AXIS_Z, .labels = 1}),
        bake("voxel", phantom_voxel(5, PHANTOM_LABEL), (baking){.axis = LATHE_AXIS_Z, .labels = 1}),
        bake("slice", phantom_slice(24, PHANTOM_LABEL), (baking){.axis = LATHE_AXIS_Z, .labels = 1}),
        bake("balls", balls(), (baking){.axis = LATHE_AXIS_Z, .labels = 4, .exact = true}),
        bake("fork", fork_tubes(), (baking){.axis = LATHE_AXIS_Z}),
        bake("balls alone", balls(), (baking){.axis = LATHE_AXIS_Y, .labels = 4, .independent = true}),
    };
    for (size_t i = 0; i < sizeof s / sizeof *s; i++) {
        total sum = test_levels(&s[i]);
        printf("%-12s deltas %6zu B, whole levels %6zu, the last %6zu; of %u old vertices in slices %u kept, %u of them moved; %u of %u used; %u tubes\n",
               s[i].name, sum.deltas, sum.whole, sum.last, sum.old, sum.kept, sum.moved, sum.used, sum.vertices, sum.tubes);
        /* Tiny meshes are mostly tables of frequencies. */
        if (!strcmp(s[i].name, "fork")) CHECK(sum.tubes > 1);
        if (sum.last < 5000 || !strcmp(s[i].name, "noise")) continue;   /* random voxels: a coarse level tells nothing of a finer one */
        CHECK(sum.deltas < sum.whole);
        CHECK(sum.deltas * 10 <= sum.last * 14);
        /* A level of tubes may show slices near their ends that the next one does not. */
        CHECK(sum.kept > 0 && sum.kept * 100ull >= sum.old * (sum.tubes ? 92ull : 98ull));
        CHECK((sum.vertices - sum.used) * 100ull <= sum.vertices * (sum.tubes ? 3 : 1));
    }
    test_structure(&s[8], 1);
    test_structure(&s[8], 3);
    test_structure(&s[10], 2);
    test_hostile(&s[0]);
    test_hostile(&s[8]);
    test_hostile(&s[9]);
    test_symbols(&s[0]);
    test_symbols(&s[9]);
    test_carriers();
    test_nested();
    for (size_t i = 0; i < sizeof s / sizeof *s; i++) close_subject(&s[i]);
    return check_end();
}
