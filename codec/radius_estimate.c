#include "radius_estimate.h"
#include <math.h>
#include <string.h>

static const double FULL_TURN = 6.283185307179586;
/* Slanted parts count at least so much: where a tube all but ends, a slope from three rows says little. */
static const double LEAST_FACING = 0.15;

/* How a radius changes from row to row where one looks the same way, pixels; rows next to each other, or an end's. */
static double rise(const lathe_radius_map *m, int32_t row, uint32_t ray, double dx, double dy, double around) {
    int32_t low = row ? row - 1 : row, high = row + 1 < m->slices ? row + 1 : row;
    if (low == high) return 0;
    double r = (double)(m->radius[(size_t)high * m->rays + ray] - m->radius[(size_t)low * m->rays + ray]) / LATHE_RADIUS_ONE;
    r += 0.5 * ((m->centre[high][0] - m->centre[low][0]) * dx + (m->centre[high][1] - m->centre[low][1]) * dy);
    return r / (high - low) - around * FULL_TURN * m->turn / 65536;
}

lathe_status lathe__estimate_start(lathe_radius_estimate *out, lathe_arena *arena, const lathe_radii *truth, double slice) {
    *out = (lathe_radius_estimate){.truth = truth, .slice = slice};
    for (uint32_t i = 0; i < truth->count; i++) {
        const lathe_radius_map *m = &truth->tubes[i].map;
        float *f = out->facing[i] = LATHE_NEW(arena, float, (size_t)m->slices * m->rays);
        if (!f) return LATHE_ERR_MEMORY;
        for (int32_t row = 0; row < m->slices; row++)
            for (uint32_t ray = 0; ray < m->rays; ray++) {
                const int32_t *r = m->radius + (size_t)row * m->rays;
                double angle = FULL_TURN * ((double)ray / m->rays + (double)m->turn * row / 65536);
                double around = (r[(ray + 1) & (m->rays - 1)] - r[(ray - 1) & (m->rays - 1)]) / (2.0 * LATHE_RADIUS_ONE) * m->rays / FULL_TURN;
                double up = rise(m, row, ray, cos(angle), sin(angle), around) / slice, along = around * LATHE_RADIUS_ONE / r[ray];
                double facing = 1 / sqrt(1 + along * along + up * up);
                *f++ = (float)(facing < LEAST_FACING ? LEAST_FACING : facing);
            }
    }
    return LATHE_OK;
}

typedef struct sums { double square, weight, most; } sums;

typedef struct chords {
    const lathe_radius_map *truth;
    lathe_radius_map shown;
    uint32_t stride;
    float weight[LATHE_RADIUS_MAX_RAYS / 8][2];   /* of the two rays' inverse radii */
} chords;

/* One row against the strip between shown rows low and high. */
static void add_row(sums *s, const chords *c, float *inverse, const float *facing, int32_t row, int32_t low, int32_t high) {
    const lathe_radius_map *t = c->truth, *m = &c->shown;
    const int32_t *a = m->radius + (size_t)low * m->rays, *b = m->radius + (size_t)high * m->rays, *r = t->radius + (size_t)row * t->rays;
    double part = high > low ? (double)(row - low) / (high - low) : 0, shift[2], turn = FULL_TURN * t->turn * (high - low) / 65536;
    double shrink = sqrt(fmax(0, 1 - 2 * part * (1 - part) * (1 - cos(turn))));
    for (int k = 0; k < 2; k++)
        shift[k] = LATHE_RADIUS_ONE / 2 * (t->centre[row][k] - (m->centre[low][k] * (1 - part) + m->centre[high][k] * part));
    for (uint32_t i = 0; i < m->rays; i += c->stride) inverse[i] = (float)(1 / (shrink * (a[i] * (1 - part) + b[i] * part)));
    bool moved = shift[0] != 0 || shift[1] != 0;
    for (uint32_t i = 0; i < m->rays; i += c->stride) {
        float from = inverse[i], to = inverse[(i + c->stride) & (m->rays - 1)];
        for (uint32_t k = 0; k < c->stride; k++) {
            double d = r[i + k] - 1 / (c->weight[k][0] * from + c->weight[k][1] * to), f = facing[i + k];
            if (moved) {
                double angle = FULL_TURN * ((double)(i + k) / t->rays + (double)t->turn * row / 65536);
                d += shift[0] * cos(angle) + shift[1] * sin(angle);
            }
            double weight = r[i + k] / f / t->rays;
            d = fabs(d) * f;
            s->square += weight * d * d;
            s->weight += weight;
            if (d > s->most) s->most = d;
        }
    }
}

static lathe_status add_tube(sums *s, const lathe_radius_estimate *e, lathe_arena *scratch, lathe_radii *radii, uint32_t index, uint32_t level,
                             const int32_t *next, const int32_t *last, uint32_t stride) {
    lathe_radius_tube *tube = &radii->tubes[index];
    chords c = {.truth = &e->truth->tubes[index].map, .shown = lathe__tube_shown(tube, lathe__passes_at(radii, tube, level)), .stride = stride};
    if (c.shown.rays / c.stride < 8) c.stride = c.shown.rays / 8;
    float *inverse = LATHE_NEW(scratch, float, c.shown.rays);
    if (!inverse) return LATHE_ERR_MEMORY;
    double whole = FULL_TURN * c.stride / c.shown.rays;
    for (uint32_t k = 0; k < c.stride; k++) {
        double at = whole * k / c.stride;
        c.weight[k][0] = (float)(sin(whole - at) / sin(whole));
        c.weight[k][1] = (float)(sin(at) / sin(whole));
    }
    for (int32_t row = 0; row < c.shown.slices; row++)
        add_row(s, &c, inverse, e->facing[index] + (size_t)row * c.shown.rays, row, last[tube->first + row] - tube->first, next[tube->first + row] - tube->first);
    return LATHE_OK;
}

lathe_status lathe__estimate_error(double *rms, double *most, const lathe_radius_estimate *e, lathe_arena *scratch, lathe_radii *radii,
                                   uint32_t level) {
    int32_t *slices, *last = LATHE_NEW(scratch, int32_t, radii->slices), *next = LATHE_NEW(scratch, int32_t, radii->slices);
    uint32_t count, stride;
    sums s = {0};
    lathe_status status = last && next ? lathe__radii_slices(&slices, &count, &stride, scratch, radii, level) : LATHE_ERR_MEMORY;
    for (uint32_t i = 0; !status && i < count; i++) {
        last[slices[i]] = next[slices[i]] = slices[i];
        for (int32_t w = slices[i] + 1; i + 1 < count && w < slices[i + 1]; w++) last[w] = slices[i], next[w] = slices[i + 1];
    }
    for (uint32_t i = 0; !status && i < radii->count; i++) status = add_tube(&s, e, scratch, radii, i, level, next, last, stride);
    *rms = s.weight > 0 ? sqrt(s.square / s.weight) / LATHE_RADIUS_ONE : 0;
    *most = s.most / LATHE_RADIUS_ONE;
    lathe__arena_reset(scratch);
    return status;
}
