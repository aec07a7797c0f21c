/* Caps follow the grey values: of a ball, whose surface is known everywhere, and of a plate whose ends lie at a known height. */
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "check.h"
#include "lathe_codec.h"
#include "mesh.h"
#include "phantom.h"
#include "archive_write.h"

static int append(void *context, const void *bytes, size_t size) {
    lathe__emit(context, bytes, size);
    return ((lathe_bytes *)context)->failed;
}

/* The last level in mm, where a vertex between two slices is one of a cap or a meeting. Closes the volume. */
static lathe_world_mesh last_level(lathe_volume *volume, bool cubes, bool flat_caps, float *rms, size_t *bytes) {
    lathe_bake_options options;
    lathe_bytes out = {0};
    lathe_model *model = NULL;
    lathe_world_mesh mesh;
    lathe_error err = {{0}};
    lathe_bake_defaults(&options);
    options.axis = LATHE_AXIS_Z;
    options.iso = PHANTOM_ISO;
    options.draco = false;
    options.samples = 20000;
    options.flat_caps = flat_caps;
    options.exact = true;
    options.slices = !cubes;       /* caps are of slices */
    if (lathe_bake(volume, &options, append, &out, &err) || lathe_model_parse(&model, out.data, out.size, &err)) abort();
    const lathe_model_info *info = lathe_model_describe(model);
    CHECK_EQ(info->caps, !cubes && !flat_caps);
    *rms = info->levels[info->level_count - 1].error_rms_mm;
    *bytes = out.size;
    if (lathe_model_mesh(&mesh, model, -1, info->level_count - 1, &err)) abort();
    lathe_model_close(&model);
    lathe__bytes_free(&out);
    lathe_volume_close(&volume);
    return mesh;
}

typedef struct stairs { double mean, rms; size_t count; } stairs;

/* Signed distance from the sphere of what stands out from the first and the last slice: the polar caps. */
static stairs ball_stairs(int n, double radius, bool flat_caps, float *rms, size_t *bytes) {
    const double centre[3] = {(n - 1) / 2.0 + 0.0713, (n - 1) / 2.0 - 0.0391, (n - 1) / 2.0 + 0.0257};
    lathe_world_mesh mesh = last_level(phantom_sphere(n, radius, PHANTOM_GREY), false, flat_caps, rms, bytes);
    double low = ceil(centre[2] - radius), high = floor(centre[2] + radius);
    stairs s = {0, 0, 0};
    for (uint32_t i = 0; i < mesh.vertex_count; i++) {
        const float *p = mesh.positions + 3 * (size_t)i;
        if ((double)p[2] >= low && (double)p[2] <= high) continue;
        double square = 0;
        for (int k = 0; k < 3; k++) square += ((double)p[k] - centre[k]) * ((double)p[k] - centre[k]);
        double d = sqrt(square) - radius;
        s.mean += d;
        s.rms += d * d;
        s.count++;
    }
    lathe_world_mesh_free(&mesh);
    s.mean /= (double)s.count;
    s.rms = sqrt(s.rms / (double)s.count);
    return s;
}

static void balls(void) {
    static const struct { int n; double radius; } BALLS[] = {{64, 26.3}, {40, 16.3}, {90, 40.05}, {48, 20.55}};
    for (size_t i = 0; i < sizeof BALLS / sizeof *BALLS; i++) {
        float flat_rms, rms;
        size_t flat_bytes, bytes;
        stairs half = ball_stairs(BALLS[i].n, BALLS[i].radius, true, &flat_rms, &flat_bytes);
        stairs coded = ball_stairs(BALLS[i].n, BALLS[i].radius, false, &rms, &bytes);
        int ok = CHECK(coded.count == half.count && coded.count > 10);
        ok &= CHECK(fabs(coded.mean) < 0.1) & CHECK(coded.rms < 0.15) & CHECK(coded.rms < half.rms / 1.5);
        ok &= CHECK(bytes <= flat_bytes + 16) & CHECK(rms < flat_rms * 1.02f);
        fprintf(stderr, "ball of %g: caps mean %+.3f rms %.3f (half: %+.3f, %.3f); surface rms %.4f (%.4f); %+d bytes\n", BALLS[i].radius, coded.mean,
                coded.rms, half.mean, half.rms, (double)rms, (double)flat_rms, (int)bytes - (int)flat_bytes);
        if (!ok) fprintf(stderr, "  in the ball of radius %g\n", BALLS[i].radius);
    }
}

/* A plate of 9 slices whose last grey value puts its ends `rise` beyond the outer slices: shapes of caps say so in eighths, and of a
 * raster's surface the mean fraction along w. */
static void plate(double rise, bool cubes) {
    enum { N = 24, LOW = 7, HIGH = 15 };
    static float value[N * N * N];
    static const int32_t dims[3] = {N, N, N};
    static const double spacing[3] = {1, 1, 1};
    for (int i = 0; i < N * N * N; i++) {
        int x = i % N, y = i / N % N, z = i / N / N;
        bool inside = x >= 5 && x <= 18 && y >= 6 && y <= 17 && z >= LOW && z <= HIGH;
        bool beyond = z == LOW - 1 || z == HIGH + 1;
        /* Along z the threshold is crossed `rise` behind the last slice: rise / (rise + below) of the way. */
        value[i] = inside ? (float)rise : beyond ? (float)(rise - 1) : -1;
    }
    lathe_volume *volume = NULL;
    if (lathe_volume_wrap(&volume, dims, spacing, value, NULL)) abort();
    float rms;
    size_t bytes;
    lathe_world_mesh mesh = last_level(volume, cubes, false, &rms, &bytes);
    double worst = 0;
    size_t count = 0;
    for (uint32_t i = 0; i < mesh.vertex_count; i++) {
        const float *p = mesh.positions + 3 * (size_t)i;
        double out = (double)p[2] < LOW ? LOW - (double)p[2] : (double)p[2] - HIGH;
        /* Vertices over the plate's rim are pulled down by the values beside it. */
        if (out <= 0 || p[0] < 6 || p[0] > 17 || p[1] < 7 || p[1] > 16) continue;
        CHECK(out > 0 && out < 1);
        if (fabs(out - rise) > worst) worst = fabs(out - rise);
        count++;
    }
    if (!CHECK(count > 10) || !CHECK(worst <= (cubes ? 0.09 : 0.1251))) fprintf(stderr, "  plate with ends at %g: %g off\n", rise, worst);
    lathe_world_mesh_free(&mesh);
}

/* Labels have no grey values: half a voxel. */
static void labels(void) {
    static const lathe_bake_structure one = {"one", {1, 2, 3}, 1};
    lathe_volume *volume = phantom_sphere(32, 11.3, PHANTOM_LABEL);
    lathe_bake_options options;
    lathe_bytes out = {0};
    lathe_model *model = NULL;
    lathe_error err = {{0}};
    lathe_world_mesh mesh;
    lathe_bake_defaults(&options);
    options.axis = LATHE_AXIS_Z;
    options.structures = &one;
    options.structure_count = 1;
    options.draco = options.measure = false;
    if (lathe_bake(volume, &options, append, &out, &err) || lathe_model_parse(&model, out.data, out.size, &err)) abort();
    CHECK(!lathe_model_describe(model)->caps);
    if (lathe_model_mesh(&mesh, model, -1, lathe_model_describe(model)->level_count - 1, &err)) abort();
    for (uint32_t i = 0; i < mesh.vertex_count; i++) {
        double z = (double)mesh.positions[3 * (size_t)i + 2];
        CHECK(z == floor(z) || z == floor(z) + 0.5);
    }
    lathe_world_mesh_free(&mesh);
    lathe_model_close(&model);
    lathe__bytes_free(&out);
    lathe_volume_close(&volume);
}

int main(void) {
    balls();
    for (double rise = 0.06; rise < 0.95; rise += 0.08) plate(rise, false), plate(rise, true);
    labels();
    return check_end();
}
