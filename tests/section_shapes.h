/* Outlines with convoluted loops for tests and tables: polygons by formula, and drawings on a pixel grid that are traced.
 * Every drawn vertex is moved by less than 1/8 pixel, a hash of its place, so that distances differ as in measured shapes. */
#ifndef SECTION_SHAPES_H
#define SECTION_SHAPES_H
#include "outline.h"
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define SECTION_PI 3.14159265358979323846
static inline double section_noise(uint32_t a, uint32_t b) { /* -1 .. 1 */
    uint32_t h = a * 2654435761u ^ (b + 77) * 2246822519u;
    h = (h ^ h >> 15) * 2246822519u;
    h = (h ^ h >> 13) * 3266489917u;
    h ^= h >> 16;
    return (double)h / 2147483648.0 - 1;
}

/* ---- outlines of polygons; memory of an arena; out of memory ends the program ---- */

static inline void *section_memory(void *memory) {
    if (memory) return memory;
    fprintf(stderr, "out of memory\n");
    exit(1);
}
static inline lathe_outline section_outline(lathe_arena *arena, uint32_t points, uint32_t loops) {
    lathe_outline o = {0};
    o.points = section_memory(LATHE_NEW(arena, lathe_point, points));
    o.loops = section_memory(LATHE_NEW(arena, lathe_loop, loops));
    return o;
}
static inline void section_begin(lathe_outline *o, bool hole) {
    o->loops[o->loop_count++] = (lathe_loop){.first = o->point_count, .hole = hole};
}
static inline void section_add(lathe_outline *o, double x, double y) {
    o->points[o->point_count++] = (lathe_point){(int32_t)lround(x), (int32_t)lround(y)};
    o->loops[o->loop_count - 1].count++;
}

/* A band along a curve, out along one side and back along the other; half its width is `wide`. */
static inline void section_band(lathe_outline *o, const double (*curve)[2], int count, double wide) {
    section_begin(o, false);
    for (int back = 0; back < 2; back++)
        for (int k = 0; k < count; k++) {
            int i = back ? count - 1 - k : k, a = i ? i - 1 : 0, b = i + 1 < count ? i + 1 : i;
            double dx = curve[b][0] - curve[a][0], dy = curve[b][1] - curve[a][1], length = hypot(dx, dy), w = back ? wide : -wide;
            section_add(o, curve[i][0] - dy / length * w, curve[i][1] + dx / length * w);
        }
}
/* A spiral of `turns` turns, `pitch` from arm to arm, half a band `wide`, begun at angle `turn`; `half` points on each side. */
static inline void section_spiral(lathe_outline *o, int half, double turns, double pitch, double wide, double turn, double noise) {
    double(*curve)[2] = section_memory(calloc((size_t)half, sizeof *curve));
    for (int i = 0; i < half; i++) {
        /* Points at about equal distances. */
        double t = sqrt(0.02 + 0.98 * i / (half - 1)) * turns, r = (t + 0.3) * pitch, angle = t * 2 * SECTION_PI + turn;
        r += noise * section_noise((uint32_t)i, 5);
        curve[i][0] = r * cos(angle);
        curve[i][1] = r * sin(angle);
    }
    section_band(o, (const double(*)[2])curve, half, wide);
    free(curve);
}
/* Koch's curve around a triangle, `depth` times; the apexes vary by `noise` (below 0.2: it stays simple). 3 * 4^depth points. */
static inline void section_koch(lathe_outline *o, int depth, double size, double noise) {
    size_t count = 3;
    double(*at)[2] = section_memory(calloc(3, sizeof *at));
    for (int i = 0; i < 3; i++) at[i][0] = size * cos(i * 2 * SECTION_PI / 3), at[i][1] = size * sin(i * 2 * SECTION_PI / 3);
    for (int d = 0; d < depth; d++, count *= 4) {
        double(*next)[2] = section_memory(calloc(count * 4, sizeof *next));
        for (size_t i = 0; i < count; i++) {
            const double *a = at[i], *b = at[(i + 1) % count];
            double dx = b[0] - a[0], dy = b[1] - a[1], high = 0.2886751 * (0.9 + noise * section_noise((uint32_t)i, (uint32_t)d));
            const double t[4] = {0, 1 / 3.0, 0.5, 2 / 3.0}, h[4] = {0, 0, high, 0};
            for (int k = 0; k < 4; k++) {
                next[4 * i + (size_t)k][0] = a[0] + dx * t[k] + dy * h[k];
                next[4 * i + (size_t)k][1] = a[1] + dy * t[k] - dx * h[k];
            }
        }
        free(at);
        at = next;
    }
    section_begin(o, false);
    for (size_t i = 0; i < count; i++) section_add(o, at[i][0], at[i][1]);
    free(at);
}
/* Round a centre: a fractal radius; never crosses itself. */
static inline void section_coast(lathe_outline *o, uint32_t count, double size, double rough) {
    section_begin(o, false);
    for (uint32_t i = 0; i < count; i++) {
        double angle = 2 * SECTION_PI * i / count, r = 0;
        for (uint32_t k = 1, w = 2; w < count / 2; k++, w *= 2) {
            double at = (double)i * w / count, f = at - floor(at);
            uint32_t cell = (uint32_t)at;
            double a = section_noise(cell % w, k), b = section_noise((cell + 1) % w, k);
            r += (a + (b - a) * f * f * (3 - 2 * f)) / w;
        }
        section_add(o, size * (1 + rough * r) * cos(angle), size * (1 + rough * r) * sin(angle));
    }
}
/* A comb with its back at y = 0 and slanted teeth up; `shift` moves it, `down` hangs the teeth from `high`. */
static inline void section_comb(lathe_outline *o, int teeth, double pitch, double thick, double high, double shift, bool down) {
    double back = down ? high + 2 * pitch : 0, tip = down ? pitch : high, to = down ? back + pitch : -pitch;
    section_begin(o, false);
    if (down) section_add(o, shift + teeth * pitch, to), section_add(o, shift - pitch, to);
    else section_add(o, shift - pitch, to), section_add(o, shift + teeth * pitch, to);
    for (int k = 0; k < teeth; k++) {
        int i = down ? k : teeth - 1 - k;
        double x = shift + i * pitch, slant = section_noise((uint32_t)i, 9) * pitch * 0.05;
        if (!down) section_add(o, x + thick, back), section_add(o, x + thick + slant, tip), section_add(o, x + slant, tip - thick * 0.3), section_add(o, x, back);
        else section_add(o, x, back), section_add(o, x + slant, tip), section_add(o, x + thick + slant, tip - thick * 0.3), section_add(o, x + thick, back);
    }
}

/* ---- drawings ---- */

typedef struct drawing { int width, height; uint8_t *at; } drawing;   /* the margin stays empty */
static inline drawing draw_begin(int width, int height) {
    return (drawing){width, height, section_memory(calloc((size_t)width * (size_t)height, 1))};
}
/* A stroke of half widths r0 and r1 at its ends, in units of the drawing's height. */
static inline void draw_stroke(drawing *d, double x0, double y0, double x1, double y1, double r0, double r1) {
    for (int y = 1; y + 1 < d->height; y++)
        for (int x = 1; x + 1 < d->width; x++) {
            double px = (double)x / d->height - x0, py = (double)y / d->height - y0, dx = x1 - x0, dy = y1 - y0;
            double t = (px * dx + py * dy) / (dx * dx + dy * dy + 1e-12);
            t = t < 0 ? 0 : t > 1 ? 1 : t;
            if (hypot(px - dx * t, py - dy * t) <= r0 + (r1 - r0) * t) d->at[y * d->width + x] = 1;
        }
}
/* Traces it. largest: only the longest loop. */
static inline lathe_outline draw_trace(drawing *d, lathe_arena *arena, bool largest) {
    int words = (d->width + 63) / 64;
    uint64_t *pixels = section_memory(calloc((size_t)words * (size_t)d->height, sizeof *pixels));
    for (int y = 0; y < d->height; y++)
        for (int x = 0; x < d->width; x++)
            if (d->at[y * d->width + x]) pixels[y * words + x / 64] |= (uint64_t)1 << (x & 63);
    lathe_slice_view view = {.pixels = pixels, .width = d->width, .height = d->height, .row_words = words, .fraction = 32};
    lathe_outline o;
    int32_t *border;
    if (lathe__trace_outline(&o, &border, arena, &view)) section_memory(NULL);
    free(pixels);
    free(d->at);
    for (uint32_t i = 0; i < o.point_count; i++) {
        o.points[i].x += (int32_t)(LATHE_LATTICE_ONE / 8.1 * section_noise(i, 1));
        o.points[i].y += (int32_t)(LATHE_LATTICE_ONE / 8.1 * section_noise(i, 2));
    }
    if (!largest) return o;
    uint32_t best = 0;
    for (uint32_t l = 1; l < o.loop_count; l++)
        if (o.loops[l].count > o.loops[best].count) best = l;
    o.points += o.loops[best].first;
    o.point_count = o.loops[best].count;
    o.loops[0] = o.loops[best];
    o.loops[0].first = 0;
    o.loop_count = 1;
    return o;
}
static inline drawing draw_spider(int height) {
    drawing d = draw_begin(height * 4 / 3, height);
    draw_stroke(&d, 0.66, 0.40, 0.66, 0.55, 0.06, 0.11);
    draw_stroke(&d, 0.66, 0.36, 0.66, 0.32, 0.05, 0.04);
    for (int side = -1; side <= 1; side += 2)
        for (int k = 0; k < 4; k++) {
            double y = 0.38 + 0.035 * k, knee = 0.25 + 0.13 * k, foot = 0.08 + 0.27 * k, x = 0.66;
            draw_stroke(&d, x, y, x + side * 0.28, knee, 0.012, 0.009);
            draw_stroke(&d, x + side * 0.28, knee, x + side * (0.48 + 0.04 * (k == 1 || k == 2)), foot, 0.009, 0.006);
        }
    return d;
}
static inline drawing draw_scorpion(int height) {
    drawing d = draw_begin(height * 5 / 4, height);
    draw_stroke(&d, 0.30, 0.42, 0.62, 0.38, 0.07, 0.05);
    double px = 0.62, py = 0.38;
    for (int k = 1; k <= 24; k++) { /* the tail curls over the back, in segments */
        double a = -0.9 + k * 0.16, r = 0.24 - 0.004 * k, x = 0.74 + r * cos(a), y = 0.60 + r * sin(a);
        draw_stroke(&d, px, py, x, y, k % 3 ? 0.024 : 0.015, k % 3 ? 0.024 : 0.015);
        px = x, py = y;
    }
    draw_stroke(&d, px, py, px + 0.03, py - 0.07, 0.02, 0.004);
    for (int side = -1; side <= 1; side += 2) {
        for (int k = 0; k < 4; k++) {
            double x = 0.32 + 0.07 * k;
            draw_stroke(&d, x, 0.42, x + 0.02 - 0.02 * k, 0.42 + side * 0.16, 0.012, 0.009);
            draw_stroke(&d, x + 0.02 - 0.02 * k, 0.42 + side * 0.16, x - 0.05 + 0.03 * k, 0.42 + side * 0.27, 0.009, 0.005);
        }
        draw_stroke(&d, 0.26, 0.42, 0.17, 0.42 + side * 0.13, 0.015, 0.018);
        draw_stroke(&d, 0.17, 0.42 + side * 0.13, 0.09, 0.42 + side * 0.09, 0.03, 0.015);
        draw_stroke(&d, 0.09, 0.42 + side * 0.09, 0.05, 0.42 + side * 0.02, 0.013, 0.004);
        draw_stroke(&d, 0.16, 0.42 + side * 0.15, 0.04, 0.42 + side * 0.10, 0.015, 0.004);
    }
    return d;
}
static inline drawing draw_bird(int height) {
    drawing d = draw_begin(height * 3 / 2, height);
    draw_stroke(&d, 0.45, 0.45, 0.85, 0.50, 0.09, 0.05);
    draw_stroke(&d, 0.40, 0.40, 0.36, 0.37, 0.055, 0.05);
    draw_stroke(&d, 0.34, 0.37, 0.24, 0.39, 0.02, 0.003);
    for (int k = 0; k < 7; k++) {
        double a = 1.15 + 0.13 * k;
        draw_stroke(&d, 0.58, 0.48, 0.58 + 0.40 * cos(a), 0.48 + 0.40 * sin(a), 0.04, 0.012);
        draw_stroke(&d, 0.62, 0.44, 0.62 + 0.33 * cos(0.9 + a), 0.44 - 0.33 * sin(0.4 + a), 0.035, 0.01);
    }
    for (int k = 0; k < 4; k++) draw_stroke(&d, 0.85, 0.50, 1.10 + 0.02 * k, 0.40 + 0.07 * k, 0.03, 0.012);
    return d;
}
/* Thresholded fractal noise within an ellipse: bays, headlands, islands, lakes. */
static inline drawing draw_coast(int width, int height, uint32_t seed, double level) {
    drawing d = draw_begin(width, height);
    for (int y = 1; y + 1 < height; y++)
        for (int x = 1; x + 1 < width; x++) {
            double value = 0, ex = 2.0 * x / width - 1, ey = 2.0 * y / height - 1;
            for (int o = 0, w = 3; w < 2 * width; o++, w *= 2) {
                double fx = (double)x * w / width, fy = (double)y * w / width;
                uint32_t cx = (uint32_t)fx, cy = (uint32_t)fy, k = seed + (uint32_t)o * 131;
                fx -= cx, fy -= cy;
                double a = section_noise(cx + cy * 4099, k), b = section_noise(cx + 1 + cy * 4099, k);
                double c = section_noise(cx + (cy + 1) * 4099, k), e = section_noise(cx + 1 + (cy + 1) * 4099, k);
                value += ((a + (b - a) * fx) * (1 - fy) + (c + (e - c) * fx) * fy) * 0.9 / sqrt(w);
            }
            d.at[y * width + x] = value + level - ex * ex - ey * ey > 0;
        }
    return d;
}
#endif
