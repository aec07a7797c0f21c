/* Random pixel regions and their outer loops for property tests: blobs, C shapes, spirals, noise. Shares no code with
 * the library's tracer. Each test program uses some of it. */
#ifndef LATHE_PIXEL_SHAPES_H
#define LATHE_PIXEL_SHAPES_H
#include "contour.h"
#include <stdlib.h>
#include <string.h>

enum { SHAPE_SIZE = 26, SHAPE_POINTS = 4 * SHAPE_SIZE * SHAPE_SIZE };
typedef struct shape {
    uint8_t at[SHAPE_SIZE][SHAPE_SIZE];
} shape; /* [y][x]; the margin stays empty */
typedef struct shape_loop {
    lathe_point points[SHAPE_POINTS];
    uint32_t count;
} shape_loop;

static inline uint32_t shape_random(uint64_t *seed) {
    *seed = *seed * 6364136223846793005u + 1442695040888963407u;
    return (uint32_t)(*seed >> 33);
}
static inline int shape_below(uint64_t *seed, int n) { return (int)(shape_random(seed) % (uint32_t)n); }
static inline void shape_set(shape *s, int x, int y) {
    if (x > 0 && y > 0 && x < SHAPE_SIZE - 1 && y < SHAPE_SIZE - 1) s->at[y][x] = 1;
}

static inline void shape_blob(shape *s, uint64_t *seed) {
    int x = SHAPE_SIZE / 2, y = x, steps = 5 + shape_below(seed, 150);
    for (int i = 0; i < steps; i++) {
        shape_set(s, x, y);
        int d = shape_below(seed, 4), nx = x + (d == 0) - (d == 2), ny = y + (d == 1) - (d == 3);
        if (nx > 0 && ny > 0 && nx < SHAPE_SIZE - 1 && ny < SHAPE_SIZE - 1) x = nx, y = ny;
        if (shape_below(seed, 3) == 0) shape_set(s, x + 1, y), shape_set(s, x, y + 1), shape_set(s, x + 1, y + 1);
    }
}
/* A ring with a gap, turned by quarter turns and sheared. */
static inline void shape_c(shape *s, uint64_t *seed) {
    int outer = 5 + shape_below(seed, 7), inner = 1 + shape_below(seed, outer - 2),
        gap = 1 + shape_below(seed, inner + 1);
    int turn = shape_below(seed, 4), centre = SHAPE_SIZE / 2;
    for (int y = -outer; y <= outer; y++)
        for (int x = -outer; x <= outer; x++) {
            int r = x * x + y * y;
            if (r > outer * outer || r < inner * inner || (x > 0 && abs(y) < gap)) continue;
            if (turn == 0) shape_set(s, centre + x, centre + y);
            if (turn == 1) shape_set(s, centre - y, centre + x);
            if (turn == 2) shape_set(s, centre - x, centre - y);
            if (turn == 3) shape_set(s, centre + y, centre - x);
        }
}
/* A square spiral with arms `thick` wide, `pitch` apart. */
static inline void shape_spiral(shape *s, uint64_t *seed) {
    int thick = 1 + shape_below(seed, 2), pitch = thick + 1 + shape_below(seed, 2), mirror = shape_below(seed, 2);
    int x = SHAPE_SIZE / 2, y = x, d = shape_below(seed, 4), arms = 3 + shape_below(seed, 9);
    for (int arm = 0; arm < arms; arm++) {
        for (int k = 0; k <= (arm / 2 + 1) * pitch; k++) {
            for (int a = 0; a < thick; a++)
                for (int b = 0; b < thick; b++) shape_set(s, x + a, y + b);
            if (k == (arm / 2 + 1) * pitch) break;
            int nx = x + (d == 0) - (d == 2), ny = y + (d == 1) - (d == 3);
            if (nx < 1 || ny < 1 || nx > SHAPE_SIZE - 3 || ny > SHAPE_SIZE - 3) return;
            x = nx, y = ny;
        }
        d = (d + (mirror ? 3 : 1)) & 3;
    }
}
static inline void shape_noise(shape *s, uint64_t *seed) {
    int size = 6 + shape_below(seed, SHAPE_SIZE - 8), density = 45 + shape_below(seed, 40);
    for (int y = 1; y <= size; y++)
        for (int x = 1; x <= size; x++)
            if (shape_below(seed, 100) < density) shape_set(s, x, y);
}

/* Keeps only what is 4-connected to the middlemost pixel set, so that one outer loop remains. */
static inline void shape_keep_one(shape *s) {
    static const int dx[4] = {1, 0, -1, 0}, dy[4] = {0, 1, 0, -1};
    int stack[SHAPE_SIZE * SHAPE_SIZE], used = 0, best = -1, best_distance = 1 << 30;
    for (int i = 0; i < SHAPE_SIZE * SHAPE_SIZE; i++) {
        int x = i % SHAPE_SIZE - SHAPE_SIZE / 2, y = i / SHAPE_SIZE - SHAPE_SIZE / 2;
        if (s->at[i / SHAPE_SIZE][i % SHAPE_SIZE] && x * x + y * y < best_distance)
            best = i, best_distance = x * x + y * y;
    }
    if (best < 0) best = SHAPE_SIZE * SHAPE_SIZE / 2 + SHAPE_SIZE / 2;
    s->at[best / SHAPE_SIZE][best % SHAPE_SIZE] = 2;
    stack[used++] = best;
    while (used) {
        int i = stack[--used];
        for (int d = 0; d < 4; d++) {
            int x = i % SHAPE_SIZE + dx[d], y = i / SHAPE_SIZE + dy[d];
            if (s->at[y][x] != 1) continue;
            s->at[y][x] = 2;
            stack[used++] = y * SHAPE_SIZE + x;
        }
    }
    for (int i = 0; i < SHAPE_SIZE * SHAPE_SIZE; i++) {
        uint8_t *p = &s->at[i / SHAPE_SIZE][i % SHAPE_SIZE];
        *p = *p == 2;
    }
}

static inline void shape_make(shape *s, uint64_t *seed, int kind) {
    memset(s, 0, sizeof *s);
    switch (kind & 3) {
    case 0: shape_blob(s, seed); break;
    case 1: shape_c(s, seed); break;
    case 2: shape_spiral(s, seed); break;
    default: shape_noise(s, seed); break;
    }
    shape_keep_one(s);
}

/* The outer loop, counter-clockwise, by the boundary-edge chain code: a vertex on the way from each inside pixel
 * centre to its outside neighbour, at 32/64 of it or (jitter) anywhere in 4/64..60/64. */
static inline void shape_trace(shape_loop *loop, const shape *s, uint64_t *seed, int jitter) {
    static const int dx[4] = {1, 0, -1, 0}, dy[4] = {0, 1, 0, -1};
    int first = 0;
    while (!s->at[first / SHAPE_SIZE][first % SHAPE_SIZE]) first++;
    int x = first % SHAPE_SIZE, y = first / SHAPE_SIZE, d = 3, x0 = x, y0 = y, d0 = d;
    loop->count = 0;
    do {
        int32_t offset = (jitter ? 4 + shape_below(seed, 57) : 32) * 1024;
        loop->points[loop->count++] = (lathe_point){x * 65536 + dx[d] * offset, y * 65536 + dy[d] * offset};
        int along = (d + 1) & 3, ax = x + dx[along], ay = y + dy[along];
        if (!s->at[ay][ax])
            d = along;
        else if (!s->at[ay + dy[d]][ax + dx[d]])
            x = ax, y = ay;
        else
            x = ax + dx[d], y = ay + dy[d], d = (d + 3) & 3;
    } while (x != x0 || y != y0 || d != d0);
}
#endif
