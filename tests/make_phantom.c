/* make_phantom KIND OUT.json [SIZE]: a computed volume as raw bytes with their sidecar, for the demo without network and for tests.
 *   knot    float32, mm inside a trefoil tube (iso 0)      ball    uint8, 0 and 255 (iso 128)
 *   labels  uint8: 1 a ball, 2 a box, 3 a ring             values  int16, a ball of rising values with a cavity (iso 100) */
#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define PI 3.14159265358979323846

typedef struct vector { double x, y, z; } vector;
static double square(double a) { return a * a; }
static double length(vector a) { return sqrt(square(a.x) + square(a.y) + square(a.z)); }

enum { KNOT_POINTS = 480 };
static vector knot_points[KNOT_POINTS];

static void make_knot(void) {
    for (int i = 0; i < KNOT_POINTS; i++) {
        double t = 2 * PI * i / KNOT_POINTS;
        knot_points[i] = (vector){(sin(t) + 2 * sin(2 * t)) / 4, (cos(t) - 2 * cos(2 * t)) / 4, -sin(3 * t) / 4};
    }
}

/* All shapes live in the cube -1 .. 1. */
static double knot(vector p) {
    double nearest = 1e9;
    for (int i = 0; i < KNOT_POINTS; i++) {
        vector d = {p.x - knot_points[i].x, p.y - knot_points[i].y, p.z - knot_points[i].z};
        double distance = square(d.x) + square(d.y) + square(d.z);
        if (distance < nearest) nearest = distance;
    }
    return 0.17 - sqrt(nearest);
}
static double ball(vector p) { return length(p) < 0.8 ? 255 : 0; }
static double labels(vector p) {
    if (length((vector){p.x + 0.45, p.y + 0.45, p.z}) < 0.35) return 1;
    if (fabs(p.x - 0.45) < 0.3 && fabs(p.y - 0.45) < 0.3 && fabs(p.z) < 0.5) return 2;
    double around = hypot(p.x - 0.45, p.z) - 0.3;
    return hypot(around, p.y + 0.5) < 0.13 ? 3 : 0;
}
static double values(vector p) { return length(p) < 0.3 ? 20 : 100 + 400 * (0.8 - length(p)); }

typedef struct kind { const char *name, *dtype; double (*at)(vector); } kind;
static const kind kinds[] = {{"knot", "float32", knot}, {"ball", "uint8", ball}, {"labels", "uint8", labels}, {"values", "int16", values}};

static int write_voxel(FILE *file, const kind *k, double value, double half) {
    if (strcmp(k->dtype, "uint8") == 0) return fputc((int)value, file) == EOF;
    uint32_t word;
    if (strcmp(k->dtype, "int16") == 0) word = (uint16_t)(int16_t)lrint(value);
    else {
        float mm = (float)(value * half);
        memcpy(&word, &mm, 4);
    }
    for (int i = 0, n = strcmp(k->dtype, "int16") == 0 ? 2 : 4; i < n; i++)
        if (fputc((int)(word >> 8 * i & 255), file) == EOF) return 1;
    return 0;
}

static int write_voxels(FILE *file, const kind *k, int size) {
    double half = size / 2.0;
    int failed = 0;
    for (int z = 0; z < size; z++)
        for (int y = 0; y < size; y++)
            for (int x = 0; x < size; x++)
                failed |= write_voxel(file, k, k->at((vector){(x + 0.5) / half - 1, (y + 0.5) / half - 1, (z + 0.5) / half - 1}), half);
    return failed;
}

int main(int argc, char **argv) {
    const kind *chosen = NULL;
    for (size_t i = 0; argc >= 3 && i < sizeof kinds / sizeof *kinds; i++)
        if (strcmp(argv[1], kinds[i].name) == 0) chosen = &kinds[i];
    int size = argc > 3 ? atoi(argv[3]) : 80;
    size_t stem = argc >= 3 ? strlen(argv[2]) : 0;
    if (!chosen || stem < 6 || stem > 900 || strcmp(argv[2] + stem - 5, ".json") != 0 || size < 4 || size > 512) {
        fputs("usage: make_phantom knot|ball|labels|values OUT.json [SIZE]\n", stderr);
        return 2;
    }
    char raw[1024];
    snprintf(raw, sizeof raw, "%.*s.raw", (int)stem - 5, argv[2]);
    const char *slash = strrchr(raw, '/');
    make_knot();
    FILE *file = fopen(raw, "wb");
    if (!file || write_voxels(file, chosen, size) || fclose(file)) return perror(raw), 1;
    file = fopen(argv[2], "w");
    if (!file) return perror(argv[2]), 1;
    fprintf(file, "{\"file\": \"%s\", \"dims\": [%d, %d, %d], \"dtype\": \"%s\", \"spacing\": [1, 1, 1]}\n", slash ? slash + 1 : raw,
            size, size, size, chosen->dtype);
    if (fclose(file)) return perror(argv[2]), 1;
    return 0;
}
