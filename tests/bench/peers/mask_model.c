/* mask_model FILE.raw X Y Z [X Y Z ...]: bytes of voxel masks (one byte a voxel, 0 or 1, x fastest, one mask after the other in
 * FILE) under an adaptive model with large 3D contexts, a peer of the benchmark of bytes: the receiver extracts and smooths the
 * surface itself. Three contexts of known neighbours (12, 22 and 16, in this slice and the two below) are mixed in the logistic
 * domain. Prints the ideal code lengths, which an arithmetic coder reaches within 0.1 %: `apart` with a fresh model for each mask,
 * `together` with one model that goes on from mask to mask. */
#include <math.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>

enum { CONTEXTS = 3, MOST_NEIGHBOURS = 22, MIXERS = 16, MARGIN = 3 };

typedef struct neighbour { int8_t x, y, z; } neighbour;
static const neighbour shapes[CONTEXTS][MOST_NEIGHBOURS] = {
    {{-1, 0, 0}, {0, -1, 0}, {0, 0, -1}, {-1, -1, 0}, {1, -1, 0}, {1, 0, -1}, {-1, 0, -1}, {0, 1, -1}, {0, -1, -1}, {-2, 0, 0}, {0, -2, 0},
     {2, -1, 0}},
    {{-1, 0, 0}, {0, -1, 0}, {0, 0, -1}, {-1, -1, 0}, {1, -1, 0}, {1, 0, -1}, {-1, 0, -1}, {0, 1, -1}, {0, -1, -1}, {-2, 0, 0}, {0, -2, 0},
     {2, -1, 0}, {-2, -1, 0}, {1, 1, -1}, {-1, 1, -1}, {1, -1, -1}, {0, 0, -2}, {2, 0, -1}, {0, 2, -1}, {1, -2, 0}, {-1, -2, 0}, {-3, 0, 0}},
    {{-1, 0, 0}, {0, -1, 0}, {0, 0, -1}, {1, -1, 0}, {1, 0, -1}, {0, 1, -1}, {0, 0, -2}, {1, 0, -2}, {0, 1, -2}, {2, 0, -1}, {0, 2, -1},
     {1, 1, -1}, {2, 1, -1}, {1, 2, -1}, {-1, 1, -1}, {2, -1, 0}},
};
static const int sizes[CONTEXTS] = {12, 22, 16};

typedef struct cell { float p; uint16_t seen; } cell;
typedef struct model {
    cell *cells[CONTEXTS];
    float weights[MIXERS][CONTEXTS];
} model;

static void model_start(model *m) {
    for (int c = 0; c < CONTEXTS; c++)
        for (size_t i = 0; i < (size_t)1 << sizes[c]; i++) m->cells[c][i] = (cell){0.5f, 0};
    for (int i = 0; i < MIXERS; i++)
        for (int c = 0; c < CONTEXTS; c++) m->weights[i][c] = 0.4f;
}

/* Which weights count: how much the largest context has seen, and whether the nearest neighbours agree. */
static float *choose_weights(model *m, const cell *largest, uint32_t near) {
    int seen = largest->seen > 30 ? 4 : largest->seen > 7 ? 3 : largest->seen > 2 ? 2 : largest->seen > 0;
    int agree = near == 0 || near == 31;
    return m->weights[2 * seen + agree];
}

static double code(model *m, const uint8_t *at, const ptrdiff_t offsets[CONTEXTS][MOST_NEIGHBOURS]) {
    cell *cells[CONTEXTS];
    uint32_t near = 0;
    for (int c = 0; c < CONTEXTS; c++) {
        uint32_t context = 0;
        for (int i = 0; i < sizes[c]; i++) context = context << 1 | at[offsets[c][i]];
        cells[c] = &m->cells[c][context];
        if (c == 0) near = context >> (sizes[0] - 5);
    }
    float stretched[CONTEXTS], sum = 0, *weights = choose_weights(m, cells[1], near);
    for (int c = 0; c < CONTEXTS; c++) {
        stretched[c] = logf(cells[c]->p / (1 - cells[c]->p));
        sum += weights[c] * stretched[c];
    }
    float p = 1 / (1 + expf(-sum)), bit = at[0];
    p = fminf(fmaxf(p, 1e-5f), 1 - 1e-5f);
    for (int c = 0; c < CONTEXTS; c++) {
        weights[c] += 0.003f * (bit - p) * stretched[c];
        float rate = fmaxf(1 / (cells[c]->seen + 1.6f), 0.01f);
        cells[c]->p += (bit - cells[c]->p) * rate;
        cells[c]->p = fminf(fmaxf(cells[c]->p, 1e-4f), 1 - 1e-4f);
        if (cells[c]->seen < 255) cells[c]->seen++;
    }
    return -log2(bit > 0 ? p : 1 - p);
}

/* The mask inside a margin of zeros, so that every neighbour can be read. */
static double code_mask(model *m, const uint8_t *padded, const int size[3]) {
    ptrdiff_t row = size[0] + 2 * MARGIN, slice = row * (size[1] + 2 * MARGIN), offsets[CONTEXTS][MOST_NEIGHBOURS];
    for (int c = 0; c < CONTEXTS; c++)
        for (int i = 0; i < sizes[c]; i++) offsets[c][i] = shapes[c][i].x + shapes[c][i].y * row + shapes[c][i].z * slice;
    double bits = 0;
    for (int z = 0; z < size[2]; z++)
        for (int y = 0; y < size[1]; y++)
            for (int x = 0; x < size[0]; x++) bits += code(m, padded + (z + MARGIN) * slice + (y + MARGIN) * row + x + MARGIN, offsets);
    return bits;
}

static uint8_t *read_padded(FILE *file, const int size[3]) {
    size_t row = (size_t)size[0] + 2 * MARGIN, height = (size_t)size[1] + 2 * MARGIN;
    uint8_t *padded = calloc(row * height, (size_t)size[2] + 2 * MARGIN);
    if (!padded) return NULL;
    for (int z = 0; z < size[2]; z++)
        for (int y = 0; y < size[1]; y++) {
            uint8_t *at = padded + ((size_t)(z + MARGIN) * height + (size_t)(y + MARGIN)) * row + MARGIN;
            if (fread(at, 1, (size_t)size[0], file) != (size_t)size[0]) {
                free(padded);
                return NULL;
            }
            for (int x = 0; x < size[0]; x++) at[x] = at[x] != 0;
        }
    return padded;
}

static int code_all(double total[2], model models[2], FILE *file, int argc, char **argv) {
    for (int i = 2; i + 2 < argc; i += 3) {
        int size[3];
        for (int k = 0; k < 3; k++)
            if ((size[k] = atoi(argv[i + k])) < 1 || size[k] > 4096) return 2;
        uint8_t *padded = read_padded(file, size);
        if (!padded) return 1;
        model_start(&models[0]);
        for (int k = 0; k < 2; k++) total[k] += code_mask(&models[k], padded, size);
        free(padded);
    }
    return 0;
}

int main(int argc, char **argv) {
    FILE *file = argc > 4 && argc % 3 == 2 ? fopen(argv[1], "rb") : NULL;
    if (!file) return fprintf(stderr, "mask_model FILE.raw X Y Z [X Y Z ...]\n"), 2;
    model models[2];
    for (int k = 0; k < 2; k++)
        for (int c = 0; c < CONTEXTS; c++)
            if (!(models[k].cells[c] = malloc(sizeof(cell) << sizes[c]))) return 1;
    model_start(&models[1]);
    double total[2] = {0, 0};
    int failed = code_all(total, models, file, argc, argv);
    fclose(file);
    for (int k = 0; k < 2; k++)
        for (int c = 0; c < CONTEXTS; c++) free(models[k].cells[c]);
    if (failed) return fprintf(stderr, "mask_model: %s: not as long as said\n", argv[1]), failed;
    printf("{\"apart\": %.0f, \"together\": %.0f}\n", ceil(total[0] / 8), ceil(total[1] / 8));
    return 0;
}
