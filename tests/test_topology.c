/* Levels that keep the last one's topology, components that wait, and how slices and outlines are chosen for both: random regions
 * against counts made from the voxels. */
#include <stdlib.h>
#include <string.h>
#include "check.h"
#include "mesh.h"
#include "structure_encode.h"

static uint32_t seed = 7;
static uint32_t next_random(uint32_t below) {
    seed = seed * 1664525u + 1013904223u;
    return (seed >> 8) % below;
}

static void set(lathe_mask *m, int u, int v, int w) {
    if (u < 1 || v < 1 || w < 0 || u > m->size[0] - 2 || v > m->size[1] - 2 || w >= m->size[2]) return;
    lathe__mask_slice(m, w)[(size_t)v * (size_t)m->row_words + (size_t)(u >> 6)] |= (uint64_t)1 << (u & 63);
}

static void new_mask(lathe_mask *m, int size, int slices) {
    int32_t dims[3] = {size + 2, size + 2, slices}, origin[3] = {0, 0, 0};
    if (lathe__mask_new(m, dims, origin)) abort();
}

/* Balls, hollow ones, and tubes between them; the first and the last slice are not empty. */
static void random_blobs(lathe_mask *m, int size, int slices) {
    new_mask(m, size, slices);
    for (uint32_t n = 2 + next_random(7); n--;) {
        int c[3] = {1 + (int)next_random((uint32_t)size), 1 + (int)next_random((uint32_t)size), (int)next_random((uint32_t)slices)};
        int r = 1 + (int)next_random((uint32_t)size / 3), hollow = next_random(3) ? 0 : r / 2, along = (int)next_random(3);
        int stretch = next_random(3) ? 1 : 4;
        for (int w = 0; w < slices; w++)
            for (int v = 1; v <= size; v++)
                for (int u = 1; u <= size; u++) {
                    int d[3] = {u - c[0], v - c[1], w - c[2]}, sum = 0;
                    for (int k = 0; k < 3; k++) sum += d[k] * d[k] / (k == along ? stretch * stretch : 1);
                    if (sum <= r * r && sum >= hollow * hollow) set(m, u, v, w);
                }
    }
    set(m, 1 + (int)next_random((uint32_t)size), 1 + (int)next_random((uint32_t)size), 0);
    set(m, 1 + (int)next_random((uint32_t)size), 1 + (int)next_random((uint32_t)size), slices - 1);
}

static void random_noise(lathe_mask *m, int size, int slices) {
    uint32_t density = 5 + next_random(85);
    new_mask(m, size, slices);
    for (int i = 0; i < size * size * slices; i++)
        if (next_random(100) < density) set(m, 1 + i % size, 1 + i / size % size, i / size / size);
    set(m, 1, 1, 0);
    set(m, size, size, slices - 1);
}

static lathe_arena arena[2];
static lathe_models models = {.widest = {3, 3}};

/* The encoder's levels, decoded packet by packet; *levels is filled from the encoder. */
static uint32_t code(const lathe_mask *mask, uint32_t flags, lathe_level_info levels[LATHE_MAX_LEVELS], lathe_mesh meshes[LATHE_MAX_LEVELS]) {
    lathe_structure_state state = {.level = -1, .fraction = 30, .flags = flags}, other = state;
    lathe_baked_structure baked;
    lathe_encode_source source = {.slice_ratio = 1};
    memset(&baked, 0, sizeof baked);
    state.mask = *mask;
    CHECK(lathe__structure_plan(&baked, &state, arena, &source) == LATHE_OK);
    for (uint32_t n = 0; n < baked.level_count; n++) CHECK(lathe__structure_encode_level(&baked, &state, arena, &models, n, &source) == LATHE_OK);
    memcpy(levels, baked.levels, sizeof baked.levels);
    other.plan = (lathe_level_plan){.slices = mask->size[2], .level_count = baked.level_count};
    memcpy(other.mask.size, mask->size, sizeof mask->size);
    other.mask.row_words = mask->row_words;
    for (uint32_t n = 0; n < baked.level_count; n++) {
        const char *fault;
        lathe_surface_counts counts;
        lathe_mesh mesh = {0};
        uint32_t shown;
        CHECK(lathe__structure_decode(&other, &arena[0], &models, n, baked.packets[n].data, baked.packets[n].size, &fault) == LATHE_OK);
        CHECK(lathe__state_mesh(&meshes[n], arena, &other, &counts, &shown) == LATHE_OK);
        CHECK(lathe__encoded_mesh(&mesh, arena, &state, &baked, n, &counts, &shown) == LATHE_OK);
        CHECK(mesh.vertex_count == meshes[n].vertex_count && mesh.triangle_count == meshes[n].triangle_count &&
              !memcmp(mesh.lattice, meshes[n].lattice, mesh.vertex_count * sizeof *mesh.lattice) &&
              !memcmp(mesh.triangles, meshes[n].triangles, mesh.triangle_count * sizeof *mesh.triangles));
        lathe_mesh_free(&mesh);
    }
    uint32_t count = baked.level_count;
    state.mask.bits = NULL;   /* the caller's */
    lathe__baked_free(&baked);
    lathe__state_free(&state);
    lathe__state_free(&other);
    return count;
}

static bool closed(const lathe_mesh_report *r) {
    return !r->boundary_edges && !r->nonmanifold_edges && !r->misoriented_edges && !r->nonmanifold_vertices && !r->degenerate_triangles &&
           !r->duplicate_positions;
}

static void check_keep(const lathe_mask *mask, const char *what) {
    lathe_level_info levels[LATHE_MAX_LEVELS];
    lathe_mesh meshes[LATHE_MAX_LEVELS] = {{0}};
    lathe_topology t;
    CHECK(lathe__mask_topology(&t, mask, NULL) == LATHE_OK);
    uint32_t count = code(mask, LATHE_FLAG_KEEP, levels, meshes);
    for (uint32_t n = 0; n < count; n++) {
        lathe_mesh_report r;
        CHECK(lathe__mesh_check(&r, &meshes[n], false) == LATHE_OK);
        int ok = CHECK(closed(&r)) && CHECK_EQ(r.components, t.components + t.cavities) && CHECK_EQ(r.euler, 2 * t.euler) &&
                 CHECK_EQ(levels[n].components, t.components) && CHECK_EQ(levels[n].components_waiting, 0) && CHECK(levels[n].waiting_mm3 == 0);
        if (!ok) fprintf(stderr, "  in %s, level %u of %u\n", what, n, count);
        lathe_mesh_free(&meshes[n]);
    }
}

/* With the topology of its own, a level of slices shows every component that matters to it, and counts those that it does not. */
static void check_own(const lathe_mask *mask, const char *what) {
    lathe_level_info levels[LATHE_MAX_LEVELS];
    lathe_mesh meshes[LATHE_MAX_LEVELS] = {{0}};
    lathe_component *components;
    size_t component_count;
    uint32_t count = code(mask, 0, levels, meshes);
    lathe_level_plan plan = {.slices = mask->size[2], .level_count = count};
    CHECK(lathe__mask_components(&components, &component_count, mask) == LATHE_OK);
    int64_t voxels = 0, small = 0;
    for (size_t i = 0; i < component_count; i++) voxels += components[i].voxels;
    for (uint32_t n = 0; n < count; n++) {
        uint32_t matter = 0;
        small = 0;
        for (size_t i = 0; i < component_count; i++) {
            bool matters = (double)components[i].voxels >= lathe__matters(&plan, n, 1);
            matter += matters;
            small += matters ? 0 : components[i].voxels;
        }
        int ok = CHECK_EQ(levels[n].components + levels[n].components_waiting, component_count) &&
                 CHECK(levels[n].waiting_mm3 >= levels[n].components_waiting && levels[n].waiting_mm3 <= (double)voxels);
        if (n) ok = ok && CHECK(levels[n].components >= matter) && CHECK(levels[n].waiting_mm3 <= (double)small);
        if (n > 1) ok = ok && CHECK(levels[n].components >= levels[n - 1].components);
        if (n + 1 == count) ok = ok && CHECK_EQ(levels[n].components_waiting, 0);
        if (!ok) fprintf(stderr, "  in %s, level %u of %u\n", what, n, count);
        lathe_mesh_free(&meshes[n]);
    }
    free(components);
}

/* A column with a small island between the regular slices: it waits as long as it is smaller than what matters. */
static void island(int size, uint32_t first_shown) {
    lathe_mask m;
    lathe_level_info levels[LATHE_MAX_LEVELS];
    lathe_mesh meshes[LATHE_MAX_LEVELS] = {{0}};
    new_mask(&m, 40, 64);
    for (int w = 0; w < 64; w++)
        for (int i = 0; i < 64; i++) set(&m, 4 + i % 8, 4 + i / 8, w);
    /* Slices 17 .. : level 0 has a stride of 8, so slice 24 is the next that it shows. */
    for (int i = 0; i < size * size * size; i++) set(&m, 20 + i % size, 20 + i / size % size, 17 + i / size / size);
    uint32_t count = code(&m, 0, levels, meshes);
    CHECK_EQ(count, 4);
    for (uint32_t n = 0; n < count; n++) {
        bool shown = n >= first_shown;
        CHECK_EQ(levels[n].components, shown ? 2 : 1);
        CHECK_EQ(levels[n].components_waiting, shown ? 0 : 1);
        CHECK(levels[n].waiting_mm3 == (shown ? 0 : size * size * size));
        lathe_mesh_free(&meshes[n]);
    }
    lathe__mask_free(&m);
}

/* A pair of parallel plates joined by one pillar, with a cavity: topology sits in single slices. */
static void thin_events(void) {
    lathe_mask m;
    new_mask(&m, 20, 33);
    for (int w = 0; w < 33; w++)
        for (int v = 1; v <= 20; v++)
            for (int u = 1; u <= 20; u++) {
                bool plate = w <= 6 || w >= 25, pillar = u >= 4 && u <= 6 && v >= 4 && v <= 6 && w != 9, second = u == 15 && v == 15;
                bool cavity = w == 3 && u == 12 && v == 7;
                if ((plate || pillar || second) && !cavity) set(&m, u, v, w);
            }
    lathe_topology t;
    CHECK(lathe__mask_topology(&t, &m, NULL) == LATHE_OK);
    CHECK_EQ(t.components, 1);
    CHECK_EQ(t.cavities, 1);
    check_keep(&m, "plates, a broken pillar, a cavity of one voxel");
    check_own(&m, "plates");
    lathe__mask_free(&m);
}

int main(void) {
    thin_events();
    /* pi / 6 of the stride's cube, strides 8, 4, 2, 1: 268, 33.5, 4.2, 0.5 voxels. */
    island(1, 3);
    island(2, 2);
    island(3, 2);
    island(4, 1);
    island(6, 1);
    island(7, 0);
    for (int i = 0; i < 300 && check_failed <= 20; i++) {
        lathe_mask m;
        char what[64];
        int size = 3 + (int)next_random(i % 3 ? 20 : 8), slices = 1 + (int)next_random(i % 3 ? 40 : 12);
        snprintf(what, sizeof what, "%s %d: size %d, %d slices", i % 3 ? "blobs" : "noise", i, size, slices);
        if (i % 3) random_blobs(&m, size, slices);
        else random_noise(&m, size, slices);
        check_keep(&m, what);
        check_own(&m, what);
        lathe__mask_free(&m);
    }
    lathe__occupancy_free(&models.occupancy);
    lathe__arena_free(&arena[0]);
    lathe__arena_free(&arena[1]);
    return check_end();
}
