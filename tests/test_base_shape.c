/* The base shape: stars through the coder and back, hostile bytes, and stars fitted to slices. */
#include "base_shape.h"
#include <stdlib.h>
#include <string.h>
#include "check.h"
#include "pixel_shapes.h"

static lathe_arena arena;

enum { SLICES = 12 };
typedef struct shape_stars {
    lathe_star_slice slices[SLICES];
    uint32_t count;
} shape_stars;

/* ---- coding ---- */

static void random_star(lathe_star *star, uint64_t *seed, const lathe_star_slice *before, const lathe_mask *frame) {
    *star = (lathe_star){.hole = shape_below(seed, 4) == 0, .rays = (uint16_t)(8 << shape_below(seed, 5))};
    if (before && before->count && shape_below(seed, 3)) star->parent = (uint8_t)(1 + shape_below(seed, (int)before->count));
    for (int k = 0; k < 2; k++) star->centre[k] = shape_below(seed, frame->size[k] + 1);
    star->radius = LATHE_NEW(&arena, uint16_t, star->rays);
    int range = 1 << shape_below(seed, 16);
    for (uint32_t i = 0; i < star->rays; i++) star->radius[i] = (uint16_t)(1 + shape_below(seed, range > 32767 ? 32767 : range));
}

static void random_stars(shape_stars *s, uint64_t *seed, const lathe_mask *frame) {
    s->count = 1 + (uint32_t)shape_below(seed, SLICES);
    int most = shape_below(seed, 8) ? 4 : LATHE_BASE_MAX_LOOPS;
    for (uint32_t i = 0; i < s->count; i++) {
        s->slices[i].count = (uint32_t)shape_below(seed, most + 1);
        s->slices[i].stars = LATHE_NEW(&arena, lathe_star, s->slices[i].count);
        for (uint32_t k = 0; k < s->slices[i].count; k++)
            random_star(&s->slices[i].stars[k], seed, i ? &s->slices[i - 1] : NULL, frame);
    }
}

static bool same_star(const lathe_star *a, const lathe_star *b) {
    return a->centre[0] == b->centre[0] && a->centre[1] == b->centre[1] && a->rays == b->rays && a->hole == b->hole &&
           a->parent == b->parent && !memcmp(a->radius, b->radius, a->rays * sizeof *a->radius);
}

static bool same_stars(const lathe_star_slice *a, const lathe_star_slice *b, uint32_t count) {
    for (uint32_t i = 0; i < count; i++) {
        if (a[i].count != b[i].count) return false;
        for (uint32_t k = 0; k < a[i].count; k++)
            if (!same_star(&a[i].stars[k], &b[i].stars[k])) return false;
    }
    return true;
}

static lathe_status decode(lathe_star_slice *out, uint32_t count, const uint8_t *bytes, size_t size, const lathe_mask *frame) {
    lathe_range_decoder d;
    lathe__decoder_start(&d, bytes, size);
    lathe_number_model models[LATHE_BASE_MODELS];
    lathe__base_models(models);
    return lathe__base_decode(out, count, &arena, &d, frame, models);
}

static void check_round_trips(void) {
    uint64_t seed = 11;
    for (int i = 0; i < 400; i++) {
        lathe_mask frame = {.size = {3 + shape_below(&seed, 4096), 3 + shape_below(&seed, 300), SLICES}};
        shape_stars s;
        lathe_star_slice back[SLICES];
        lathe_range_encoder e;
        random_stars(&s, &seed, &frame);
        lathe__encoder_start(&e);
        lathe_number_model models[LATHE_BASE_MODELS];
        lathe__base_models(models);
        CHECK(lathe__base_encode(&e, s.slices, s.count, &frame, models) == LATHE_OK);
        lathe__encoder_finish(&e);
        if (CHECK(decode(back, s.count, e.bytes, e.size, &frame) == LATHE_OK)) CHECK(same_stars(s.slices, back, s.count));
        lathe__encoder_free(&e);
        lathe__arena_reset(&arena);
    }
}

/* ---- hostile bytes ---- */

static bool star_within_limits(const lathe_star *star, const lathe_star_slice *before, const lathe_mask *frame) {
    if (star->rays < LATHE_BASE_MIN_RAYS || star->rays > LATHE_BASE_MAX_RAYS || star->rays & (star->rays - 1)) return false;
    if (star->parent > (before ? before->count : 0)) return false;
    for (int k = 0; k < 2; k++)
        if (star->centre[k] < 0 || star->centre[k] > frame->size[k]) return false;
    for (uint32_t i = 0; i < star->rays; i++)
        if (star->radius[i] < 1) return false;
    return true;
}

/* Whatever was decoded, its polygons keep to coordinates that the overlay can subtract; or they are refused. */
static bool outline_within_limits(const lathe_star_slice *slice, int32_t stride) {
    lathe_outline outline;
    lathe_status status = lathe__star_outline(&outline, &arena, slice, lathe__radius_step(stride), 3);
    if (status) return status == LATHE_ERR_FORMAT;
    for (uint32_t i = 0; i < outline.point_count; i++) {
        lathe_point p = outline.points[i];
        if (p.x <= -(1 << 30) || p.x >= 1 << 30 || p.y <= -(1 << 30) || p.y >= 1 << 30) return false;
    }
    return true;
}

static void fill_bytes(uint8_t *bytes, size_t size, uint64_t *seed, int kind) {
    for (size_t k = 0; k < size; k++) {
        uint8_t random = (uint8_t)shape_random(seed);
        bytes[k] = kind == 0 ? random : kind == 1 ? 0 : kind == 2 ? 255 : shape_below(seed, 16) ? 0 : random;
    }
}

static void check_hostile(void) {
    uint64_t seed = 5;
    uint32_t good = 0, bad = 0;
    for (int i = 0; i < 20000; i++) {
        uint8_t bytes[96];
        size_t size = (size_t)shape_below(&seed, sizeof bytes + 1);
        lathe_mask frame = {.size = {3 + shape_below(&seed, 4096), 3 + shape_below(&seed, 4096), 4096}};
        int32_t stride = 1 << shape_below(&seed, 12);
        lathe_star_slice out[SLICES];
        fill_bytes(bytes, size, &seed, i & 3);
        lathe_status status = decode(out, SLICES, bytes, size, &frame);
        CHECK(status == LATHE_OK || status == LATHE_ERR_FORMAT);
        if (status) bad++;
        else good++;
        for (uint32_t s = 0; status == LATHE_OK && s < SLICES; s++) {
            CHECK(out[s].count <= LATHE_BASE_MAX_LOOPS);
            for (uint32_t k = 0; k < out[s].count; k++) CHECK(star_within_limits(&out[s].stars[k], s ? &out[s - 1] : NULL, &frame));
            CHECK(outline_within_limits(&out[s], stride));
        }
        lathe__arena_reset(&arena);
    }
    CHECK(good > 100 && bad > 100);
}

/* The longest rays that the coder can carry, on the largest stride. */
static void check_longest(void) {
    for (int32_t stride = 1; stride <= 2048; stride *= 2) {
        uint16_t radius[8];
        for (int i = 0; i < 8; i++) radius[i] = 32767;
        lathe_star star = {.centre = {4098, 4098}, .rays = 8, .radius = radius};
        lathe_star_slice slice = {1, &star};
        CHECK(outline_within_limits(&slice, stride));
    }
    /* The largest frame's own diagonal is never refused. */
    for (int32_t stride = 1; stride <= 2048; stride *= 2) {
        uint16_t radius[8];
        lathe_outline outline;
        for (int i = 0; i < 8; i++) radius[i] = (uint16_t)(5797 * (int64_t)LATHE_LATTICE_ONE / lathe__radius_step(stride) + 1);
        lathe_star star = {.centre = {4098, 4098}, .rays = 8, .radius = radius};
        lathe_star_slice slice = {1, &star};
        CHECK(lathe__star_outline(&outline, &arena, &slice, lathe__radius_step(stride), 0) == LATHE_OK);
        lathe__arena_reset(&arena);
    }
}

/* ---- stars of slices ---- */

static int side(lathe_point a, lathe_point b, lathe_point c) {
    int64_t d = lathe__orient(a, b, c);
    return (d > 0) - (d < 0);
}

static bool on_segment(lathe_point a, lathe_point b, lathe_point c) {
    return !side(a, b, c) && (c.x < a.x ? b.x <= c.x : c.x == a.x || b.x >= c.x) && (c.y < a.y ? b.y <= c.y : c.y == a.y || b.y >= c.y);
}

static bool segments_meet(lathe_point a, lathe_point b, lathe_point c, lathe_point d) {
    if (on_segment(a, b, c) || on_segment(a, b, d) || on_segment(c, d, a) || on_segment(c, d, b)) return true;
    return side(a, b, c) * side(a, b, d) < 0 && side(c, d, a) * side(c, d, b) < 0;
}

/* No two edges meet, except neighbours at their common end. */
static bool is_simple(const lathe_outline *o) {
    for (uint32_t l = 0; l < o->loop_count; l++)
        for (uint32_t i = 0; i < o->loops[l].count; i++)
            for (uint32_t m = l; m < o->loop_count; m++)
                for (uint32_t k = m == l ? i + 1 : 0; k < o->loops[m].count; k++) {
                    const lathe_point *p = o->points + o->loops[l].first, *q = o->points + o->loops[m].first;
                    uint32_t n = o->loops[l].count;
                    lathe_point a = p[i], b = p[(i + 1) % n], c = q[k], d = q[(k + 1) % o->loops[m].count];
                    if (m == l && k == i + 1) {
                        if (on_segment(a, b, d)) return false;
                    } else if (m == l && i == 0 && k == n - 1) {
                        if (on_segment(a, b, c)) return false;
                    } else if (segments_meet(a, b, c, d)) return false;
                }
    return true;
}

static double area_of(const lathe_outline *o, uint32_t l) {
    const lathe_point *p = o->points + o->loops[l].first;
    double area = 0;
    for (uint32_t i = 0, n = o->loops[l].count; i < n; i++)
        area += (double)p[i].x * p[(i + 1) % n].y - (double)p[i].y * p[(i + 1) % n].x;
    return area / 2 / LATHE_LATTICE_ONE / LATHE_LATTICE_ONE;
}

static void trace_shape(lathe_outline *loops, const shape *s) {
    uint64_t rows[SHAPE_SIZE] = {0};
    for (int y = 0; y < SHAPE_SIZE; y++)
        for (int x = 0; x < SHAPE_SIZE; x++) rows[y] |= (uint64_t)s->at[y][x] << x;
    lathe_slice_view view = {.pixels = rows, .width = SHAPE_SIZE, .height = SHAPE_SIZE, .row_words = 1, .fraction = 32};
    int32_t *border;
    if (lathe__trace_outline(loops, &border, &arena, &view)) abort();
}

/* Stars of a region, holes included: disjoint simple polygons, each turning as its kind says. */
static void check_fit(const shape *s, const lathe_star_slice *before, lathe_star_slice *out, int32_t stride, uint32_t seed) {
    lathe_outline loops, outline;
    trace_shape(&loops, s);
    if (!CHECK(lathe__base_fit(out, &arena, &loops, before, stride, seed) == LATHE_OK)) return;
    CHECK(out->count <= loops.loop_count);
    CHECK(lathe__star_outline(&outline, &arena, out, lathe__radius_step(stride), seed) == LATHE_OK);
    CHECK(is_simple(&outline));
    for (uint32_t l = 0; l < outline.loop_count; l++) {
        CHECK(outline.loops[l].hole == out->stars[l].hole);
        CHECK(outline.loops[l].hole ? area_of(&outline, l) < 0 : area_of(&outline, l) > 0);
        CHECK(star_within_limits(&out->stars[l], before, &(lathe_mask){.size = {SHAPE_SIZE, SHAPE_SIZE, 1}}));
    }
}

static void check_fits(void) {
    uint64_t seed = 21;
    for (int i = 0; i < 1500; i++) {
        shape s;
        lathe_star_slice stars[2];
        int32_t stride = 1 << shape_below(&seed, 4);
        for (int k = 0; k < 2; k++) {
            shape_make(&s, &seed, i);
            for (int h = shape_below(&seed, 20); h > 0; h--) s.at[1 + shape_below(&seed, SHAPE_SIZE - 2)][1 + shape_below(&seed, SHAPE_SIZE - 2)] ^= 1;
            check_fit(&s, k ? &stars[0] : NULL, &stars[k], stride, (uint32_t)k);
        }
        lathe__arena_reset(&arena);
    }
}

/* A disc: the star's area is the disc's within the rounding of its radii; with a hole in it: two stars. */
static void check_disc(void) {
    shape s = {{{0}}};
    lathe_star_slice stars;
    lathe_outline outline;
    int pixels = 0;
    for (int y = 1; y < SHAPE_SIZE - 1; y++)
        for (int x = 1; x < SHAPE_SIZE - 1; x++) pixels += s.at[y][x] = (x - 13) * (x - 13) + (y - 13) * (y - 13) <= 110;
    check_fit(&s, NULL, &stars, 4, 0);
    CHECK(lathe__star_outline(&outline, &arena, &stars, lathe__radius_step(4), 0) == LATHE_OK);
    if (CHECK_EQ(stars.count, 1)) {
        CHECK_EQ(stars.stars[0].centre[0], 13);
        CHECK_EQ(stars.stars[0].centre[1], 13);
        CHECK(area_of(&outline, 0) > 0.8 * pixels && area_of(&outline, 0) < 1.2 * pixels);
    }
    for (int y = 1; y < SHAPE_SIZE - 1; y++)
        for (int x = 1; x < SHAPE_SIZE - 1; x++) s.at[y][x] &= (x - 13) * (x - 13) + (y - 13) * (y - 13) > 30;
    check_fit(&s, NULL, &stars, 4, 0);
    if (CHECK_EQ(stars.count, 2)) CHECK(!stars.stars[0].hole && stars.stars[1].hole);
    lathe__arena_reset(&arena);
}

int main(void) {
    check_round_trips();
    check_hostile();
    check_longest();
    check_disc();
    check_fits();
    lathe__arena_free(&arena);
    return check_end();
}
