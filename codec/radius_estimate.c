#include "radius_estimate.h"
#include <math.h>
#include <string.h>

static const double FULL_TURN = 6.283185307179586;
/* Slanted parts count at least so much: where a tube all but ends, a slope from three rows says little. */
static const double LEAST_FACING = 0.15;

/* Cosine and sine of a row's turn. */
static void row_turn(double out[2], const lathe_radius_map *m, int32_t row) {
    double angle = FULL_TURN * m->turn * row / 65536;
    out[0] = m->turn ? cos(angle) : 1, out[1] = m->turn ? sin(angle) : 0;
}

/* ---- once for a truth ---- */

/* How a radius changes from row to row where one looks the same way, pixels; rows next to each other, or an end's. */
static double rise(const lathe_radius_map *m, int32_t row, uint32_t ray, double dx, double dy, double around) {
    int32_t low = row ? row - 1 : row, high = row + 1 < m->slices ? row + 1 : row;
    if (low == high) return 0;
    double r = (double)(m->radius[(size_t)high * m->rays + ray] - m->radius[(size_t)low * m->rays + ray]) / LATHE_RADIUS_ONE;
    r += 0.5 * ((m->centre[high][0] - m->centre[low][0]) * dx + (m->centre[high][1] - m->centre[low][1]) * dy);
    return r / (high - low) - around * FULL_TURN * m->turn / 65536;
}

static void start_row(lathe_radius_estimate *out, const lathe_estimate_tube *tube, const lathe_radius_map *m, int32_t row) {
    const int32_t *r = m->radius + (size_t)row * m->rays;
    float *facing = tube->facing + (size_t)row * m->rays, *share = tube->share + (size_t)row * m->rays;
    double turn[2], sum = 0;
    row_turn(turn, m, row);
    for (uint32_t ray = 0; ray < m->rays; ray++) {
        double d[2] = {(double)tube->direction[ray], (double)tube->direction[ray + m->rays]};
        double around = (r[(ray + 1) & (m->rays - 1)] - r[(ray - 1) & (m->rays - 1)]) / (2.0 * LATHE_RADIUS_ONE) * m->rays / FULL_TURN;
        double up = rise(m, row, ray, d[0] * turn[0] - d[1] * turn[1], d[1] * turn[0] + d[0] * turn[1], around) / out->slice;
        double along = around * LATHE_RADIUS_ONE / r[ray], f = 1 / sqrt(1 + along * along + up * up);
        facing[ray] = (float)(f < LEAST_FACING ? LEAST_FACING : f);
        share[ray] = (float)r[ray] / facing[ray] / (float)m->rays;
        sum += (double)share[ray];
    }
    out->shares += sum;
}

lathe_status lathe__estimate_start(lathe_radius_estimate *out, lathe_arena *arena, const lathe_radii *truth, double slice) {
    *out = (lathe_radius_estimate){.truth = truth, .slice = slice, .every = 1};
    for (uint32_t i = 0; i < truth->count; i++) {
        const lathe_radius_map *m = &truth->tubes[i].map;
        lathe_estimate_tube *tube = &out->tubes[i];
        size_t samples = (size_t)m->slices * m->rays;
        tube->facing = LATHE_NEW(arena, float, samples);
        tube->share = LATHE_NEW(arena, float, samples);
        tube->direction = LATHE_NEW(arena, float, 2 * (size_t)m->rays);
        tube->worst = LATHE_NEW(arena, float, m->slices);
        if (!tube->facing || !tube->share || !tube->direction || !tube->worst) return LATHE_ERR_MEMORY;
        for (uint32_t ray = 0; ray < m->rays; ray++) {
            tube->direction[ray] = (float)cos(FULL_TURN * ray / m->rays);
            tube->direction[ray + m->rays] = (float)sin(FULL_TURN * ray / m->rays);
        }
        for (int32_t row = 0; row < m->slices; row++) start_row(out, tube, m, row);
    }
    return LATHE_OK;
}

/* ---- what a level shows ---- */

/* Passes that are not coded yet need further rows for the wanted ones; those of a later pass are of no use to an earlier one. */
static void want_neighbours(bool *wanted, const lathe_radius_map *map, uint32_t passes) {
    int32_t last = map->slices - 1;
    for (uint32_t pass = map->level_count; pass-- > passes;) {
        int32_t stride = (int32_t)1 << (map->level_count - 1 - pass);
        for (int32_t row = stride; row < last; row += 2 * stride) {
            if (!wanted[row]) continue;
            for (int32_t k = -3; k <= 3; k += 2) {
                int32_t at = row + k * stride;
                if (k == 1 && at > last) at = last;
                if (at >= 0 && at <= last) wanted[at] = true;
            }
        }
    }
}

/* As lathe__tube_shown has it, but for the rows that are not shown. */
static lathe_status show(lathe_radius_map *out, lathe_arena *scratch, lathe_radius_tube *tube, uint32_t passes, const int32_t *slices, uint32_t count) {
    static const lathe_number_coder PREDICT = {0};
    lathe_radius_map map = tube->map;
    *out = map;
    if (!tube->shown || passes >= map.level_count) return LATHE_OK;
    bool *wanted = LATHE_NEW(scratch, bool, map.slices);
    if (!wanted) return LATHE_ERR_MEMORY;
    memset(wanted, 0, (size_t)map.slices * sizeof *wanted);
    for (uint32_t i = 0; i < count; i++)
        if (slices[i] >= tube->first && slices[i] - tube->first < map.slices) wanted[slices[i] - tube->first] = true;
    want_neighbours(wanted, &map, passes);
    map.radius = tube->shown, map.centre = tube->shown_centre, map.left = NULL, map.wanted = wanted;
    memcpy(map.centre, tube->map.centre, (size_t)map.slices * sizeof *map.centre);
    for (int32_t row = 0; row < map.slices; row++)
        if (wanted[row]) memcpy(map.radius + (size_t)row * map.rays, tube->map.radius + (size_t)row * map.rays, map.rays * sizeof *map.radius);
    for (uint32_t pass = passes; pass < map.level_count; pass++) (void)lathe__radius_walk(&map, pass, &PREDICT);   /* nothing can be out of range */
    tube->shown_passes = 0;
    *out = map;
    return LATHE_OK;
}

/* ---- how far off it is ---- */

typedef struct sums { double square, most; } sums;

typedef struct chords {
    const lathe_estimate_tube *tube;
    const lathe_radius_map *truth;
    lathe_radius_map shown;
    uint32_t stride;
    float weight[LATHE_RADIUS_MAX_RAYS / 8][2];   /* of the two rays' inverse radii */
    float *off;                /* of each ray in a row: the truth's radius minus the strip's */
    float *inverse;            /* of the strip's radii */
} chords;

/* The truth's radii minus those of the strip between shown rows low and high, at a row; and by how much its centre differs. */
static void strip_row(const chords *c, double shift[2], int32_t row, int32_t low, int32_t high) {
    const lathe_radius_map *t = c->truth, *m = &c->shown;
    const int32_t *a = m->radius + (size_t)low * m->rays, *b = m->radius + (size_t)high * m->rays, *r = t->radius + (size_t)row * m->rays;
    double part = high > low ? (double)(row - low) / (high - low) : 0, turn = FULL_TURN * t->turn * (high - low) / 65536;
    double shrink = t->turn ? sqrt(fmax(0, 1 - 2 * part * (1 - part) * (1 - cos(turn)))) : 1;
    float from = (float)(shrink * (1 - part)), to = (float)(shrink * part);
    for (int k = 0; k < 2; k++)
        shift[k] = LATHE_RADIUS_ONE / 2 * (t->centre[row][k] - (m->centre[low][k] * (1 - part) + m->centre[high][k] * part));
    for (uint32_t i = 0; i < m->rays; i += c->stride) {
        float length = from * (float)a[i] + to * (float)b[i];
        c->off[i] = (float)r[i] - length;
        c->inverse[i] = 1 / length;
    }
    for (uint32_t i = 0; i < m->rays && c->stride > 1; i += c->stride) {
        float first = c->inverse[i], second = c->inverse[(i + c->stride) & (m->rays - 1)];
        for (uint32_t k = 1; k < c->stride; k++) c->off[i + k] = (float)r[i + k] - 1 / (c->weight[k][0] * first + c->weight[k][1] * second);
    }
}

static void move_row(const chords *c, const double shift[2], int32_t row) {
    double turn[2];
    row_turn(turn, c->truth, row);
    float x = (float)(shift[0] * turn[0] + shift[1] * turn[1]), y = (float)(shift[1] * turn[0] - shift[0] * turn[1]);
    const float *dx = c->tube->direction, *dy = dx + c->truth->rays;
    for (uint32_t i = 0; i < c->truth->rays; i++) c->off[i] += x * dx[i] + y * dy[i];
}

/* One row against the strip: eight sums side by side. */
static void add_row(sums *s, const chords *c, int32_t row, int32_t low, int32_t high) {
    enum { SIDE = 8 };
    const lathe_radius_map *t = c->truth;
    const float *facing = c->tube->facing + (size_t)row * t->rays, *share = c->tube->share + (size_t)row * t->rays;
    double shift[2], sum = 0;
    float square[SIDE] = {0}, most[SIDE] = {0};
    strip_row(c, shift, row, low, high);
    if (shift[0] != 0 || shift[1] != 0) move_row(c, shift, row);
    for (uint32_t i = 0; i < t->rays; i += SIDE)
        for (uint32_t k = 0; k < SIDE; k++) {
            float d = c->off[i + k] * facing[i + k];
            square[k] += share[i + k] * d * d;
            d = fabsf(d);
            most[k] = d > most[k] ? d : most[k];
        }
    float worst = 0;
    for (int k = 0; k < SIDE; k++) {
        sum += (double)square[k];
        worst = fmaxf(worst, most[k]);
    }
    s->square += sum;
    s->most = fmax(s->most, (double)worst);
    c->tube->worst[row] = worst / LATHE_RADIUS_ONE;
}

static lathe_status add_tube(sums *s, const lathe_radius_estimate *e, lathe_arena *scratch, lathe_radii *radii, uint32_t index, uint32_t level,
                             const int32_t *slices, uint32_t count, uint32_t stride) {
    lathe_radius_tube *tube = &radii->tubes[index];
    chords c = {.tube = &e->tubes[index], .truth = &e->truth->tubes[index].map, .stride = stride};
    lathe_status status = show(&c.shown, scratch, tube, lathe__passes_at(radii, tube, level), slices, count);
    if (status) return status;
    if (c.shown.rays / c.stride < 8) c.stride = c.shown.rays / 8;
    c.off = LATHE_NEW(scratch, float, c.shown.rays);
    c.inverse = LATHE_NEW(scratch, float, c.shown.rays);
    if (!c.off || !c.inverse) return LATHE_ERR_MEMORY;
    double whole = FULL_TURN * c.stride / c.shown.rays;
    for (uint32_t k = 0; k < c.stride; k++) {
        double at = whole * k / c.stride;
        c.weight[k][0] = (float)(sin(whole - at) / sin(whole));
        c.weight[k][1] = (float)(sin(at) / sin(whole));
    }
    int32_t end = c.shown.slices - 1;
    for (uint32_t i = 0; i < count; i++) {   /* an end of a tube is shown */
        int32_t low = slices[i] - tube->first, high = i + 1 < count ? slices[i + 1] - tube->first : low + 1;
        for (int32_t row = low; row < high && low >= 0 && row <= end; row++)
            if (row % e->every == 0) add_row(s, &c, row, low, row > low ? high : low);
    }
    return LATHE_OK;
}

lathe_status lathe__estimate_error(double *rms, double *most, const lathe_radius_estimate *e, lathe_arena *scratch, lathe_radii *radii,
                                   uint32_t level) {
    int32_t *slices;
    uint32_t count, stride;
    sums s = {0};
    lathe_status status = lathe__radii_slices(&slices, &count, &stride, scratch, radii, level);
    for (uint32_t i = 0; !status && i < radii->count; i++) status = add_tube(&s, e, scratch, radii, i, level, slices, count, stride);
    *rms = e->shares > 0 ? sqrt(s.square * e->every / e->shares) / LATHE_RADIUS_ONE : 0;
    *most = s.most / LATHE_RADIUS_ONE;
    lathe__arena_reset(scratch);
    return status;
}
