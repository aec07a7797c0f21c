#include "phantom.h"
#include <math.h>
#include <stdlib.h>

static const double CLAMP = 3.0; /* voxels */

uint32_t phantom_random(uint32_t *state) {
    *state = *state * 1664525u + 1013904223u;
    uint32_t x = *state;
    x ^= x >> 16;
    x *= 0x45d9f3bu;
    x ^= x >> 16;
    return x;
}

/* Inside is value >= PHANTOM_ISO, for both kinds the same voxels. */
static float value_of(double distance, phantom_kind kind) {
    float value = (float)fmin(fmax(distance, -CLAMP), CLAMP);
    return kind == PHANTOM_GREY ? value : value >= (float)PHANTOM_ISO ? 1.0f : 0.0f;
}

typedef double shape(double x, double y, double z, const void *context); /* signed distance, positive inside */

static lathe_volume *finish(int nx, int ny, int nz, float *values) {
    const int32_t dims[3] = {nx, ny, nz};
    const double spacing[3] = {1, 1, 1};
    lathe_volume *volume = NULL;
    if (values && lathe_volume_wrap(&volume, dims, spacing, values, NULL)) volume = NULL;
    free(values);
    return volume;
}

static float *new_values(int nx, int ny, int nz) {
    return malloc((size_t)nx * (size_t)ny * (size_t)nz * sizeof(float));
}

/* Samples a shape whose origin is the middle of the grid, a little off the lattice so that nothing is degenerate. */
static lathe_volume *sample(int nx, int ny, int nz, shape *inside, const void *context, phantom_kind kind) {
    float *values = new_values(nx, ny, nz), *at = values;
    const double cx = (nx - 1) / 2.0 + 0.0713, cy = (ny - 1) / 2.0 - 0.0391, cz = (nz - 1) / 2.0 + 0.0257;
    for (int z = 0; z < nz && at; z++)
        for (int y = 0; y < ny; y++)
            for (int x = 0; x < nx; x++) *at++ = value_of(inside(x - cx, y - cy, z - cz, context), kind);
    return finish(nx, ny, nz, values);
}

static double ball(double x, double y, double z, const void *context) {
    return *(const double *)context - sqrt(x * x + y * y + z * z);
}

lathe_volume *phantom_sphere(int n, double radius, phantom_kind kind) { return sample(n, n, n, ball, &radius, kind); }

static double ring(double x, double y, double z, const void *context) {
    const double *r = context;
    double across = sqrt(x * x + y * y) - r[0];
    return r[1] - sqrt(across * across + z * z);
}

lathe_volume *phantom_torus(int n, double major, double minor, phantom_kind kind) {
    const double radii[2] = {major, minor};
    return sample(n, n, n, ring, radii, kind);
}

static double capsule(const double p[3], const double a[3], const double b[3], double radius) {
    double along = 0, length = 0, distance = 0;
    for (int k = 0; k < 3; k++) along += (p[k] - a[k]) * (b[k] - a[k]), length += (b[k] - a[k]) * (b[k] - a[k]);
    along = fmin(fmax(along / length, 0), 1);
    for (int k = 0; k < 3; k++) {
        double d = p[k] - a[k] - along * (b[k] - a[k]);
        distance += d * d;
    }
    return radius - sqrt(distance);
}

static double fork(double x, double y, double z, const void *context) {
    const double n = *(const double *)context, p[3] = {x, y, z};
    const double crotch[3] = {0, 0, 0.05 * n}, top[3] = {0, 0, 0.36 * n};
    const double left[3] = {-0.24 * n, 0.02 * n, -0.36 * n}, right[3] = {0.26 * n, -0.02 * n, -0.36 * n};
    double legs = fmax(capsule(p, left, crotch, 0.09 * n), capsule(p, right, crotch, 0.09 * n));
    return fmax(legs, capsule(p, crotch, top, 0.11 * n));
}

lathe_volume *phantom_branch(int n, phantom_kind kind) {
    const double size = n;
    return sample(n, n, n, fork, &size, kind);
}

static double nested(double x, double y, double z, const void *context) {
    const double n = *(const double *)context, r = sqrt(x * x + y * y + z * z);
    return fmax(fmin(0.42 * n - r, r - 0.28 * n), 0.14 * n - r);
}

lathe_volume *phantom_shells(int n, phantom_kind kind) {
    const double size = n;
    return sample(n, n, n, nested, &size, kind);
}

static double bar(double along, double across, double length, double width) {
    double dx = fabs(along) - length, dy = fabs(across) - width;
    return dx > 0 && dy > 0 ? -sqrt(dx * dx + dy * dy) : -fmax(dx, dy);
}

static double turned_cross(double x, double y, double z, const void *context) {
    const double *c = context, n = c[0], angle = c[1] * z / n + 0.3;
    double u = cos(angle) * x + sin(angle) * y, v = cos(angle) * y - sin(angle) * x;
    double section = fmax(bar(u, v, 0.4 * n, 0.07 * n), bar(v, u, 0.33 * n, 0.07 * n));
    return fmin(section, 0.42 * n - fabs(z));
}

lathe_volume *phantom_column(int n, double turn, phantom_kind kind) {
    const double context[2] = {n, turn};
    return sample(n, n, n, turned_cross, context, kind);
}

/* ---- made of voxels ---------------------------------------------------------------------------------------------- */

static float *outside(int nx, int ny, int nz, phantom_kind kind) {
    float *values = new_values(nx, ny, nz);
    size_t count = (size_t)nx * (size_t)ny * (size_t)nz;
    for (size_t i = 0; i < count && values; i++) values[i] = kind == PHANTOM_GREY ? -1.0f : 0.0f;
    return values;
}

lathe_volume *phantom_specks(int n, int count, uint32_t seed, phantom_kind kind) {
    float *values = outside(n, n, n, kind);
    /* Sites are two voxels apart; each is taken with the probability that makes about count of them, never more. */
    int per_axis = (n + 1) / 2, left = count;
    long sites = (long)per_axis * per_axis * per_axis;
    for (long s = 0; s < sites && values && left; s++) {
        if (phantom_random(&seed) % (uint32_t)(sites - s) >= (uint32_t)left) continue;
        long x = s % per_axis * 2, y = s / per_axis % per_axis * 2, z = s / per_axis / per_axis * 2;
        values[(z * n + y) * n + x] = 1.0f;
        left--;
    }
    return finish(n, n, n, values);
}

lathe_volume *phantom_voxel(int n, phantom_kind kind) {
    float *values = outside(n, n, n, kind);
    if (values) values[((size_t)(n / 2) * (size_t)n + (size_t)(n / 2)) * (size_t)n + (size_t)(n / 2)] = 1.0f;
    return finish(n, n, n, values);
}

static double washer(double x, double y, double z, const void *context) {
    (void)z;
    const double n = *(const double *)context, r = sqrt(x * x + y * y);
    return fmin(0.4 * n - r, r - 0.15 * n);
}

lathe_volume *phantom_slice(int n, phantom_kind kind) {
    const double size = n;
    return sample(n, n, 1, washer, &size, kind);
}

lathe_volume *phantom_diagonals(int n, phantom_kind kind) {
    float *values = outside(n, n, n, kind), *at = values;
    for (int z = 0; z < n && values; z++)
        for (int y = 0; y < n; y++)
            for (int x = 0; x < n; x++, at++)
                if ((x + y + z) % 2 == 0) *at = 1.0f;
    return finish(n, n, n, values);
}

enum { MAX_BLOBS = 256 };
typedef struct blobs {
    int count;
    double ball[MAX_BLOBS][4];
} blobs;

/* Every third ball cuts what came before it. */
static double clutter(double x, double y, double z, const void *context) {
    const blobs *b = context;
    double distance = -CLAMP;
    for (int i = 0; i < b->count; i++) {
        const double *c = b->ball[i];
        double dx = x - c[0], dy = y - c[1], dz = z - c[2], d = c[3] - sqrt(dx * dx + dy * dy + dz * dz);
        distance = i % 3 == 2 ? fmin(distance, -d) : fmax(distance, d);
    }
    return distance;
}

lathe_volume *phantom_blobs(int n, int count, uint32_t seed, phantom_kind kind) {
    blobs b = {.count = count < MAX_BLOBS ? count : MAX_BLOBS};
    for (int i = 0; i < b.count; i++) {
        for (int k = 0; k < 3; k++) b.ball[i][k] = ((double)phantom_random(&seed) / 4294967296.0 - 0.5) * 0.8 * n;
        b.ball[i][3] = (0.05 + 0.13 * (double)phantom_random(&seed) / 4294967296.0) * n;
    }
    return sample(n, n, n, clutter, &b, kind);
}

lathe_volume *phantom_full(int nx, int ny, int nz, phantom_kind kind) {
    (void)kind; /* every voxel is inside */
    float *values = new_values(nx, ny, nz);
    size_t count = (size_t)nx * (size_t)ny * (size_t)nz;
    for (size_t i = 0; i < count && values; i++) values[i] = 1.0f;
    return finish(nx, ny, nz, values);
}

lathe_volume *phantom_noise(int nx, int ny, int nz, int percent, uint32_t seed, phantom_kind kind) {
    float *values = outside(nx, ny, nz, kind);
    size_t count = (size_t)nx * (size_t)ny * (size_t)nz;
    for (size_t i = 0; i < count && values; i++)
        if (phantom_random(&seed) % 100 < (uint32_t)percent) values[i] = 1.0f;
    return finish(nx, ny, nz, values);
}
