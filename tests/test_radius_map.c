/* Radius maps: what is coded is what is decoded, near the truth; their surfaces are closed and cross nothing; hostile bytes end. */
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "check.h"
#include "mesh.h"
#include "radius_map.h"

static uint32_t seed = 7;
static uint32_t next_random(void) {
    seed = seed * 1664525u + 1013904223u;
    return seed >> 8;
}

static int32_t put(void *coder, lathe_number_model *model, int32_t number) {
    lathe__put_number(coder, model, number);
    return number;
}
static int32_t get(void *coder, lathe_number_model *model, int32_t number) {
    (void)number;
    return lathe__get_number(coder, model);
}

enum { MAX_SIZE = 96 };

/* A bumpy tube whose section turns by `twist` a slice about a wandering centre. */
static double tube_radius(double angle, int row, int slices, double size, double bumps, double twist) {
    double along = slices > 1 ? (double)row / (slices - 1) : 0.5, round = 0.35 + 0.65 * sin(3.14159 * along);
    return size * round * (1 + bumps * cos(3 * (angle - twist * row)) + 0.5 * bumps * sin(5 * angle + along));
}

static void fill_mask(lathe_mask *m, int slices, double size, double bumps, double twist) {
    int32_t n = (int32_t)(size * 2 * (1 + 2 * bumps)) + 8, dims[3] = {n, n, slices}, origin[3] = {0, 0, 0};
    if (lathe__mask_new(m, dims, origin)) abort();
    for (int w = 0; w < slices; w++)
        for (int v = 1; v < n - 1; v++)
            for (int u = 1; u < n - 1; u++) {
                double x = u - n / 2.0 - 1.5 * sin(w * 0.1), y = v - n / 2.0;
                if (hypot(x, y) > tube_radius(atan2(y, x), w, slices, size, bumps, twist) && hypot(x, y) > 1.5) continue;
                lathe__mask_slice(m, w)[(size_t)v * (size_t)m->row_words + (size_t)(u >> 6)] |= (uint64_t)1 << (u & 63);
            }
}

static lathe_arena arena, scratch;

static bool closed_ball(const lathe_mesh *mesh) {
    lathe_mesh_report r;
    if (lathe__mesh_check(&r, mesh, true)) return false;
    return !r.boundary_edges && !r.nonmanifold_edges && !r.misoriented_edges && !r.nonmanifold_vertices && !r.degenerate_triangles &&
           !r.duplicate_positions && !r.unused_vertices && !r.self_intersections && r.components == 1 && r.euler == 2;
}

/* Encodes level by level, decodes level by level; every level's surface is checked. Returns the bytes. */
static size_t round_trip(const lathe_radius_map *truth, int32_t step, double *rms) {
    lathe_radius_map coded = *truth, decoded = *truth;
    size_t total = 0;
    if (lathe__radius_map_start(&coded, &arena) || lathe__radius_map_start(&decoded, &arena)) abort();
    coded.step = decoded.step = step;
    for (uint32_t level = 0; level < truth->level_count; level++) {
        lathe_range_encoder e;
        lathe_range_decoder d;
        lathe__encoder_start(&e);
        CHECK(!lathe__radius_walk(&coded, level, &(lathe_number_coder){put, &e, truth}));
        lathe__encoder_finish(&e);
        lathe__decoder_start(&d, e.bytes, e.size);
        CHECK(!lathe__radius_walk(&decoded, level, &(lathe_number_coder){get, &d, NULL}));
        CHECK(d.overrun <= 8);
        total += e.size;
        lathe__encoder_free(&e);
        lathe_mesh mesh;
        if (!CHECK(!lathe__radius_mesh(&mesh, &decoded, level))) continue;
        CHECK(closed_ball(&mesh));
        lathe_mesh_free(&mesh);
    }
    size_t samples = (size_t)truth->slices * truth->rays;
    double sum = 0;
    int32_t worst = 0;
    CHECK(!memcmp(coded.radius, decoded.radius, samples * sizeof *coded.radius));
    for (size_t i = 0; i < samples; i++) {
        int32_t miss = abs(decoded.radius[i] - truth->radius[i]);
        if (miss > worst) worst = miss;
        sum += (double)miss * miss;
    }
    CHECK(worst <= step * 3 / 5 + 1);   /* the dead zone bounds every sample's error */
    *rms = sqrt(sum / (double)samples) / LATHE_RADIUS_ONE;
    return total;
}

static void tubes(void) {
    for (int i = 0; i < 60; i++) {
        int slices = 1 + (int)(next_random() % 60);
        double size = 2 + next_random() % 30, bumps = (next_random() % 20) / 100.0, twist = (next_random() % 3) * 0.03;
        lathe_mask mask;
        lathe_radius_map truth;
        fill_mask(&mask, slices, size, bumps, twist);
        lathe_status status = lathe__radius_fit(&truth, &arena, &scratch, &mask, 32, NULL, lathe__choose_levels(slices),
                                                (int32_t)lround(twist * 65536 / 6.283185307179586));
        if (!status) {
            double fine, coarse;
            size_t most = round_trip(&truth, 20, &fine), least = round_trip(&truth, 120, &coarse);
            CHECK(fine < 0.2 && least <= most);
        } else {
            CHECK_EQ(status, LATHE_ERR_EMPTY);   /* thin tubes can fall apart into diagonal neighbours */
        }
        lathe__mask_free(&mask);
        lathe__arena_reset(&arena);
    }
}

static void not_tubes(void) {
    int32_t dims[3] = {12, 12, 3}, origin[3] = {0, 0, 0};
    lathe_mask mask;
    lathe_radius_map truth;
    if (lathe__mask_new(&mask, dims, origin)) abort();
    for (int w = 0; w < 3; w++) lathe__mask_slice(&mask, w)[3] = 0x06, lathe__mask_slice(&mask, w)[4] = 0x66;
    CHECK_EQ(lathe__radius_fit(&truth, &arena, &scratch, &mask, 32, NULL, 2, 0), LATHE_ERR_EMPTY);   /* two loops in a slice */
    lathe__mask_free(&mask);
    lathe__arena_reset(&scratch);
}

static void hostile(void) {
    for (int i = 0; i < 3000; i++) {
        uint8_t bytes[200];
        size_t size = next_random() % sizeof bytes;
        for (size_t k = 0; k < size; k++) bytes[k] = (uint8_t)(next_random() % 3 ? next_random() : 255);
        lathe_radius_map map = {.slices = 1 + (int32_t)(next_random() % 40), .level_count = 2 + next_random() % 4,
                                .rays = 8u << next_random() % 8, .step = 1 + (int32_t)(next_random() % 100000), .apex = {1, 7},
                                .farthest = 1 << 19};
        if (lathe__radius_map_start(&map, &arena)) abort();
        lathe_range_decoder d;
        lathe__decoder_start(&d, bytes, size);
        lathe_status status = LATHE_OK;
        for (uint32_t level = 0; !status && level < map.level_count; level++) {
            status = lathe__radius_walk(&map, level, &(lathe_number_coder){get, &d, NULL});
            lathe_mesh mesh;
            if (!status && CHECK(!lathe__radius_mesh(&mesh, &map, level))) lathe_mesh_free(&mesh);
        }
        CHECK(!status || status == LATHE_ERR_FORMAT);
        lathe__arena_reset(&arena);
    }
    lathe_radius_map large = {.slices = 4098, .level_count = 6, .rays = 8192};
    CHECK_EQ(lathe__radius_map_start(&large, &arena), LATHE_ERR_LIMIT);
}

int main(void) {
    tubes();
    not_tubes();
    hostile();
    lathe__arena_free(&arena);
    lathe__arena_free(&scratch);
    return check_end();
}
