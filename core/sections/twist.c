/* How far each section is turned against the one before it (see twist.h). */
#include "twist.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { DIRECTIONS = 720, HALF_TURN = DIRECTIONS / 2, FARTHEST = 90 /* 45 degrees */, AROUND = 2 };
static const double FULL_TURN = 6.283185307179586;
static const double ROUND = 0.01; /* profiles that vary by less than this part of their mean say nothing about turns */
static const double HALVED = 0.5; /* what a believable turn leaves of the difference */
static const double UNSTEADY = 5; /* degrees by which turns may differ from the median of those around, on average */

lathe_status lathe__parse_twist(lathe_twist *out, const char *text, lathe_error *err) {
    if (!strcmp(text, "none")) {
        *out = (lathe_twist){LATHE_TWIST_NONE, 0};
        return LATHE_OK;
    }
    if (!strcmp(text, "auto")) {
        *out = (lathe_twist){LATHE_TWIST_AUTO, 0};
        return LATHE_OK;
    }
    char *end;
    double degrees = strtod(text, &end);
    if (end == text || *end || !(fabs(degrees) <= 180))
        return lathe_fail(err, LATHE_ERR_FORMAT, "twist: '%.60s' is not none, auto, or degrees from -180 to 180", text);
    *out = (lathe_twist){LATHE_TWIST_FIXED, degrees};
    return LATHE_OK;
}

/* ---- profiles ---- */

typedef struct profile {
    double at[DIRECTIONS];
    bool flat;
} profile; /* mean 0, variance 1; flat: round, or nothing there */

static double area_and_centre(const lathe_point *p, uint32_t n, double centre[2]) {
    double area = 0, x = 0, y = 0;
    for (uint32_t i = 0; i < n; i++) {
        /* Relative to the first point: squares of coordinates would lose digits. */
        lathe_point q = p[i + 1 < n ? i + 1 : 0];
        double ax = (double)p[i].x - p[0].x, ay = (double)p[i].y - p[0].y, bx = (double)q.x - p[0].x,
               by = (double)q.y - p[0].y;
        double c = ax * by - ay * bx;
        area += c, x += c * (ax + bx), y += c * (ay + by);
    }
    centre[0] = p[0].x + (area != 0 ? x / (3 * area) : 0);
    centre[1] = p[0].y + (area != 0 ? y / (3 * area) : 0);
    return area;
}
/* The directions that a segment covers; the farthest radius counts. */
static void add_segment(double *radius, double px, double py, double qx, double qy) {
    double from = atan2(py, px) * DIRECTIONS / FULL_TURN, to = atan2(qy, qx) * DIRECTIONS / FULL_TURN,
           turns = px * qy - py * qx;
    if (to - from > HALF_TURN) to -= DIRECTIONS;
    if (to - from < -HALF_TURN) to += DIRECTIONS;
    int first = (int)ceil(from < to ? from : to), last = (int)floor(from < to ? to : from);
    for (int k = first; k <= last; k++) {
        double c = cos(k * FULL_TURN / DIRECTIONS), s = sin(k * FULL_TURN / DIRECTIONS),
               across = c * (qy - py) - s * (qx - px);
        double r = across != 0 ? turns / across : hypot(px, py);
        double *at = &radius[(k + 2 * DIRECTIONS) % DIRECTIONS];
        if (r > *at) *at = r;
    }
}
static void make_profile(profile *out, const lathe_outline *outline) {
    double centre[2] = {0, 0}, largest = 0, mean = 0, variance = 0;
    const lathe_loop *loop = NULL;
    memset(out, 0, sizeof *out);
    out->flat = true;
    for (uint32_t i = 0; i < outline->loop_count; i++) {
        double c[2], area = outline->loops[i].count
                                ? area_and_centre(outline->points + outline->loops[i].first, outline->loops[i].count, c)
                                : 0;
        if (area <= largest) continue;
        largest = area;
        loop = &outline->loops[i];
        memcpy(centre, c, sizeof c);
    }
    if (!loop) return;
    const lathe_point *p = outline->points + loop->first;
    for (uint32_t i = 0; i < loop->count; i++) {
        lathe_point q = p[i + 1 < loop->count ? i + 1 : 0];
        add_segment(out->at, p[i].x - centre[0], p[i].y - centre[1], q.x - centre[0], q.y - centre[1]);
    }
    for (int k = 0; k < DIRECTIONS; k++) mean += out->at[k] / DIRECTIONS;
    for (int k = 0; k < DIRECTIONS; k++) variance += (out->at[k] - mean) * (out->at[k] - mean) / DIRECTIONS;
    out->flat = !(sqrt(variance) > ROUND * mean);
    for (int k = 0; k < DIRECTIONS && !out->flat; k++) out->at[k] = (out->at[k] - mean) / sqrt(variance);
}

/* ---- correlation ---- */

/* b turned back by s directions against a: 1 if they are the same shape. */
static double correlate(const profile *a, const profile *b, int s) {
    double sum = 0;
    for (int k = 0, j = s < 0 ? s + DIRECTIONS : s; k < DIRECTIONS; k++, j = j + 1 < DIRECTIONS ? j + 1 : 0)
        sum += a->at[k] * b->at[j];
    return sum / DIRECTIONS;
}
typedef struct step {
    double degrees, unturned, turned;
} step; /* what is left of 1 without and with the turn */

static step best_step(const profile *a, const profile *b) {
    if (a->flat || b->flat) return (step){0, 0, 0};
    double c[2 * FARTHEST + 3];
    for (int s = -FARTHEST - 1; s <= FARTHEST + 1; s++) c[s + FARTHEST + 1] = correlate(a, b, s);
    /* From the middle outwards: of equal peaks the smaller turn. */
    int best = 0;
    for (int s = 1; s <= FARTHEST; s++)
        for (int sign = -1; sign <= 1; sign += 2)
            if (c[sign * s + FARTHEST + 1] > c[best + FARTHEST + 1] + 1e-9) best = sign * s;
    const double *at = &c[best + FARTHEST + 1];
    double bend = at[-1] - 2 * at[0] + at[1], shift = bend < 0 ? (at[-1] - at[1]) / (2 * bend) : 0;
    if (fabs(shift) > 0.5) shift = 0; /* at the end of the range, no peak */
    return (step){(best + shift) * 360 / DIRECTIONS, 1 - c[FARTHEST + 1], 1 - at[0]};
}

static int compare_doubles(const void *p, const void *q) {
    double a = *(const double *)p, b = *(const double *)q;
    return a < b ? -1 : a > b;
}
static double median_around(const step *steps, uint32_t count, uint32_t k) {
    double values[2 * AROUND + 1];
    uint32_t low = k > AROUND ? k - AROUND : 0, high = k + AROUND < count ? k + AROUND : count - 1, n = 0;
    for (uint32_t i = low; i <= high; i++) values[n++] = steps[i].degrees;
    qsort(values, n, sizeof *values, compare_doubles);
    return n % 2 ? values[n / 2] : (values[n / 2 - 1] + values[n / 2]) / 2;
}
/* All or nothing for the body, then step by step. */
static void believe(double *degrees, const step *steps, uint32_t count) {
    double unturned = 0, turned = 0, unsteady = 0;
    for (uint32_t k = 0; k < count; k++) {
        unturned += steps[k].unturned;
        turned += steps[k].turned;
        unsteady += fabs(steps[k].degrees - median_around(steps, count, k)) / count;
    }
    bool turns = count && turned <= HALVED * unturned && unsteady <= UNSTEADY;
    for (uint32_t k = 0; k < count; k++) {
        double around = median_around(steps, count, k);
        degrees[k] = !turns ? 0 : fabs(steps[k].degrees - around) > UNSTEADY ? around : steps[k].degrees;
    }
}
static lathe_status find_steps(double *degrees, const lathe_section *sections, uint32_t count) {
    profile *pair = malloc(2 * sizeof *pair);
    step *steps = calloc(count, sizeof *steps);
    lathe_status status = pair && steps ? LATHE_OK : LATHE_ERR_MEMORY;
    for (uint32_t k = 0; k < count && !status; k++) {
        make_profile(&pair[k & 1], &sections[k].outline);
        if (k) steps[k - 1] = best_step(&pair[(k - 1) & 1], &pair[k & 1]);
    }
    if (!status) believe(degrees, steps, count - 1);
    free(pair);
    free(steps);
    return status;
}

lathe_status lathe__choose_turns(uint32_t *turn, double *degrees, const lathe_section *sections, uint32_t count,
                                 const lathe_twist *twist) {
    if (!count) return LATHE_OK;
    double *steps = calloc(count, sizeof *steps), sum = 0;
    if (!steps) return LATHE_ERR_MEMORY;
    for (uint32_t k = 0; k < count && twist->method == LATHE_TWIST_FIXED; k++) steps[k] = twist->degrees;
    lathe_status status = twist->method == LATHE_TWIST_AUTO ? find_steps(steps, sections, count) : LATHE_OK;
    for (uint32_t k = 0; k < count && !status; k++) {
        double added = k ? steps[k - 1] : 0;
        sum = fmod(sum + added, 360);
        turn[k] = (uint32_t)(int32_t)lround(sum * 65536 / 360) & 65535;
        if (degrees) degrees[k] = added;
    }
    free(steps);
    return status;
}

lathe_status lathe__turn_sections(uint32_t ***out, lathe_arena *arena, const lathe_section *sections, uint32_t count,
                                  const lathe_twist *twist) {
    uint32_t *turn = LATHE_NEW(arena, uint32_t, count), **all = LATHE_NEW(arena, uint32_t *, count);
    if (!turn || !all) return LATHE_ERR_MEMORY;
    lathe_status status = lathe__choose_turns(turn, NULL, sections, count, twist);
    for (uint32_t k = 0; k < count && !status; k++) {
        all[k] = LATHE_NEW(arena, uint32_t, sections[k].outline.loop_count);
        if (!all[k]) return LATHE_ERR_MEMORY;
        for (uint32_t i = 0; i < sections[k].outline.loop_count; i++) all[k][i] = turn[k];
    }
    if (!status) *out = all;
    return status;
}
