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
static int64_t find_vertex(const lathe_mesh *mesh, const int32_t *exact, const int32_t *origin) {
    int64_t found = -1;
    for (uint32_t v = 0; v < mesh->vertex_count; v++) {
        const int32_t *at = mesh->lattice[v];
        if ((at[2] - origin[2] * LATHE_DRACO_ONE) * (LATHE_LATTICE_ONE / LATHE_DRACO_ONE) != exact[2]) continue;
        double du = (at[0] - origin[0] * LATHE_DRACO_ONE) * 8192.0 - exact[0], dv = (at[1] - origin[1] * LATHE_DRACO_ONE) * 8192.0 - exact[1];
        if (hypot(du, dv) > LATHE_DRACO_TOLERANCE) continue;
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
static void compare_outlines(const lathe_mesh *exact, const lathe_mesh *mesh, const int32_t *slices, uint32_t count, const int32_t *origin,
                             bool mirrored) {
    int64_t *near = malloc((exact->vertex_count + 1) * sizeof *near);
    uint64_t *edges = list_edges(mesh), missing = 0, several = 0, wrong = 0, right = 0, outline = 0;
    for (uint32_t v = 0; v < exact->vertex_count; v++) {
        near[v] = -3;
        for (uint32_t i = 0; i < count; i++)
            if (slices[i] * LATHE_LATTICE_ONE == exact->lattice[v][2]) near[v] = find_vertex(mesh, exact->lattice[v], origin);
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
        CHECK_EQ(lathe__level_slices(&slices, &count, &arena, &state->plan, (uint32_t)state->level), LATHE_OK);
        compare_outlines(exact, &mesh, slices, count, state->mask.origin, lathe_transform_mirrors(transform));
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

/* Old vertices that the client's triangles still have. */
static uint32_t count_kept(const lathe_draco_mesh *client, uint32_t before) {
    uint8_t *seen = calloc(before + 1, 1);
    uint32_t kept = 0;
    for (uint32_t p = 0; p < client->part_count; p++)
        for (size_t i = 0; i < (size_t)3 * client->parts[p].triangle_count; i++) {
            uint32_t v = client->parts[p].triangles[i / 3][i % 3];
            if (v < before && !seen[v]++) kept++;
        }
    free(seen);
    return kept;
}

typedef struct total { size_t deltas, whole, last; uint32_t kept; } total;

static total test_levels(subject *s) {
    uint32_t levels = lathe_model_describe(s->model)->level_count;
    lathe_draco_mesh client = {0};
    total sum = {0};
    for (uint32_t n = 0; n < levels; n++) {
        lathe_bytes delta = {0}, again = {0};
        uint32_t before = client.vertex_count;
        int32_t(*places)[3] = malloc((before + 1) * sizeof *places);
        if (before) memcpy(places, client.at, before * sizeof *places);
        CHECK_EQ(lathe_write_draco_delta(s->model, -1, n, append, &delta, NULL), LATHE_OK);
        CHECK_EQ(lathe_write_draco_delta(s->model, -1, n, append, &again, NULL), LATHE_OK);
        CHECK(delta.size == again.size && (!delta.size || !memcmp(delta.data, again.data, delta.size)));
        if (!CHECK_EQ(lathe__draco_delta_apply(&client, delta.data, delta.size), LATHE_OK)) fprintf(stderr, "%s, level %u\n", s->name, n);
        CHECK_EQ(client.level_count, n + 1);
        CHECK(client.vertex_count >= before && (!before || !memcmp(places, client.at, before * sizeof *places)));
        check_level(&client, s->model, n);
        sum.kept = count_kept(&client, before);
        sum.deltas += delta.size;
        sum.last = whole_level(s->model, n);
        sum.whole += sum.last;
        free(places);
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
        bake("balls alone", balls(), (baking){.axis = LATHE_AXIS_Y, .labels = 4, .independent = true}),
    };
    for (size_t i = 0; i < sizeof s / sizeof *s; i++) {
        total sum = test_levels(&s[i]);
        printf("%-12s deltas %6zu B, whole levels %6zu, the last %6zu; %u vertices kept\n", s[i].name, sum.deltas, sum.whole, sum.last, sum.kept);
        /* Tiny meshes are mostly tables of frequencies. */
        if (sum.last < 5000) continue;
        CHECK(sum.deltas < sum.whole);
        CHECK(sum.deltas * 10 <= sum.last * 14);
        CHECK(sum.kept > 0);
    }
    test_structure(&s[8], 1);
    test_structure(&s[8], 3);
    test_structure(&s[9], 2);
    test_hostile(&s[0]);
    test_hostile(&s[8]);
    test_carriers();
    for (size_t i = 0; i < sizeof s / sizeof *s; i++) close_subject(&s[i]);
    return check_end();
}
