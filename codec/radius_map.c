#include "radius_map.h"
#include <string.h>

/* Of 256: a number is not zero; the length of its magnitude goes on. */
static void start_model(lathe_number_model *m, uint32_t not_zero, uint32_t longer) {
    for (int k = 0; k < LATHE_NUMBER_MODELS; k++) {
        uint32_t p = k == 0 ? not_zero : k >= 2 && k < 24 ? longer : 128;
        m->bit[k] = (lathe_bit_model){(uint16_t)(p << 8), 3};
    }
}

static lathe_status start_models(lathe_radius_map *map, lathe_arena *arena) {
    /* Of 256: a number is not zero, by how large its neighbours are. */
    static const uint8_t USUAL[LATHE_RADIUS_CLASSES] = {8, 24, 64, 100, 128, 154, 192, 216, 240};
    lathe_radius_models *m = map->models = LATHE_NEW(arena, lathe_radius_models, 1);
    if (!m) return LATHE_ERR_MEMORY;
    start_model(&m->centres, 24, 77);
    start_model(&m->starts, 200, 200);
    for (int kind = 0; kind < LATHE_RADIUS_KINDS; kind++)
        for (int i = 0; i < LATHE_RADIUS_CLASSES; i++) start_model(&m->radius[kind][i], kind ? USUAL[i] : 250, kind ? 77 : 180);
    return LATHE_OK;
}

lathe_status lathe__radius_map_start(lathe_radius_map *map, lathe_arena *arena) {
    size_t samples = (size_t)map->slices * map->rays;
    if (samples > (size_t)1 << 24) return LATHE_ERR_LIMIT;
    lathe_status status = map->models ? LATHE_OK : start_models(map, arena);
    if (status) return status;
    map->centre = lathe__arena_alloc(arena, (size_t)map->slices, sizeof *map->centre);
    map->left = LATHE_NEW(arena, int8_t, samples);   /* before the larger array: blocks of an arena at least double */
    map->radius = LATHE_NEW(arena, int32_t, samples);
    if (!map->centre || !map->radius || !map->left) return LATHE_ERR_MEMORY;
    memset(map->left, 0, samples);
    return LATHE_OK;
}

uint32_t lathe__radius_ray_stride(const lathe_radius_map *map, uint32_t level) {
    uint32_t stride = (uint32_t)1 << (map->level_count - 1 - level);
    return map->rays / stride < 8 ? map->rays / 8 : stride;
}

int32_t lathe__centre_between(int32_t low, int32_t at_low, int32_t high, int32_t at_high, int32_t row) {
    int32_t span = high - low;
    return (int32_t)(((int64_t)at_low * (high - row) * 2 + (int64_t)at_high * (row - low) * 2 + span) / (2 * span));
}

typedef struct walk {
    lathe_radius_map *map;
    const lathe_number_coder *coder;
    int32_t step;
    uint32_t mask;             /* rays - 1 */
} walk;

static int32_t *row_of(const walk *w, int32_t row) { return w->map->radius + (size_t)row * w->map->rays; }
static int32_t size_at(const walk *w, int32_t row, uint32_t ray) {
    int32_t v = w->map->left ? w->map->left[(size_t)row * w->map->rays + (ray & w->mask)] : 0;
    return v < 0 ? -v : v;
}

/* A dead zone: numbers up to 0.6 are 0, and all are rounded that much towards 0. */
static int32_t quantise(int32_t value, int32_t step) {
    int32_t a = (value < 0 ? -value : value) * 5 + 2 * step;
    a /= 5 * step;
    return value < 0 ? -a : a;
}

static bool code_radius(const walk *w, int kind, int32_t near, int32_t row, uint32_t ray, int32_t predicted) {
    static const int16_t LIMITS[LATHE_RADIUS_CLASSES - 1] = {1, 3, 6, 10, 16, 25, 40, 80};
    lathe_radius_map *map = w->map;
    size_t at = (size_t)row * map->rays + ray;
    int class = 0;
    while (class < LATHE_RADIUS_CLASSES - 1 && near >= LIMITS[class]) class++;
    int32_t number = w->coder->truth ? quantise(w->coder->truth->radius[at] - predicted, w->step) : 0;
    number = w->coder->code(w->coder->coder, &map->models->radius[kind][class], number);
    if (map->left) map->left[at] = (int8_t)(number > 127 ? 127 : number < -127 ? -127 : number);
    int64_t r = predicted + (int64_t)number * w->step;
    if (r > map->farthest && !map->tube) return false;
    if (r > map->farthest) r = map->farthest;
    map->radius[at] = r < LATHE_RADIUS_LEAST ? LATHE_RADIUS_LEAST : (int32_t)r;
    return true;
}

static bool code_centre(const walk *w, int32_t row, const int32_t predicted[2], lathe_number_model *model) {
    for (int k = 0; k < 2; k++) {
        int32_t number = w->coder->truth ? w->coder->truth->centre[row][k] - predicted[k] : 0;
        number = w->coder->code(w->coder->coder, model, number);
        if (number > 1 << 14 || number < -(1 << 14)) return false;
        w->map->centre[row][k] = predicted[k] + number;
    }
    return true;
}

/* Level 0: each row from the one before. */
static bool code_first_row(const walk *w, int32_t row, int32_t before, uint32_t stride) {
    lathe_radius_map *map = w->map;
    int32_t *r = row_of(w, row), *b = before >= 0 ? row_of(w, before) : NULL;
    if (!code_centre(w, row, b ? map->centre[before] : map->start, map->tube && !b ? &map->models->starts : &map->models->centres)) return false;
    for (uint32_t i = 0; i < map->rays; i += stride) {
        int32_t predicted = i ? r[i - stride] : b ? b[0] : map->start[2];
        if (i && b) predicted = (r[i - stride] + b[i] + b[i] - b[i - stride]) / 2;
        if (!code_radius(w, 0, 0, row, i, predicted)) return false;
    }
    return true;
}

/* Next to an end of a tube it is the squares that are linear, as on a ball. */
static int32_t round_between(int32_t low, int64_t a, int32_t high, int64_t b, int32_t row) {
    uint64_t square = (uint64_t)((a * a * (high - row) + b * b * (row - low)) / (high - low)), root = 0;
    for (uint64_t bit = (uint64_t)1 << 31; bit; bit >>= 1)
        if ((root | bit) * (root | bit) <= square) root |= bit;
    return (int32_t)root;
}

/* Between b and c, of four in a row. */
static int32_t between_four(int32_t a, int32_t b, int32_t c, int32_t d) { return (9 * (b + c) - a - d + 8) >> 4; }

/* A new row between two known ones; those beyond are known, too, if they are as far away again. */
static bool code_new_row(const walk *w, int32_t row, int32_t stride, uint32_t rays) {
    int32_t last = w->map->slices - 1, low = row - stride, high = row + stride < last ? row + stride : last, between[2];
    for (int k = 0; k < 2; k++)
        between[k] = lathe__centre_between(low, w->map->centre[low][k], high, w->map->centre[high][k], row);
    if (!code_centre(w, row, between, &w->map->models->centres)) return false;
    const int32_t *a = row_of(w, low), *b = row_of(w, high);
    bool cubic = low - 2 * stride >= 0 && high + 2 * stride <= last && high - row == stride;
    const int32_t *aa = cubic ? row_of(w, low - 2 * stride) : NULL, *bb = cubic ? row_of(w, high + 2 * stride) : NULL;
    int32_t below = row - 2 * stride;
    for (uint32_t i = 0; i < w->map->rays; i += rays) {
        int32_t predicted = cubic         ? between_four(aa[i], a[i], b[i], bb[i])
                            : w->map->tube ? round_between(low, a[i], high, b[i], row)
                                           : lathe__centre_between(low, a[i], high, b[i], row);
        int32_t near = i ? 10 * size_at(w, row, i - rays) : 0;
        if (i > rays) near += 5 * size_at(w, row, i - 2 * rays);
        if (below >= 0) near += 10 * size_at(w, below, i) + 4 * size_at(w, below, i - rays) + 4 * size_at(w, below, i + rays);
        if (!code_radius(w, 1, near, row, i, predicted)) return false;
    }
    return true;
}

/* New rays between the known ones of a row. before: the shown row below, or -1. */
static bool code_new_rays(const walk *w, int32_t row, int32_t before, bool fresh, uint32_t stride) {
    const int32_t *r = row_of(w, row);
    for (uint32_t i = stride; i < w->map->rays; i += 2 * stride) {
        int32_t predicted = between_four(r[(i - 3 * stride) & w->mask], r[i - stride], r[(i + stride) & w->mask], r[(i + 3 * stride) & w->mask]);
        int32_t near = i > stride ? 10 * size_at(w, row, i - 2 * stride) : 0;
        if (i > 3 * stride) near += 5 * size_at(w, row, i - 4 * stride);
        if (before >= 0) near += 10 * size_at(w, before, i) + 4 * size_at(w, before, i - 2 * stride) + 4 * size_at(w, before, i + 2 * stride);
        if (fresh) near += 5 * size_at(w, row, i - stride) + 5 * size_at(w, row, i + stride);
        if (!code_radius(w, 2, near, row, i, predicted)) return false;
    }
    return true;
}

static int32_t step_of(const lathe_radius_map *map, uint32_t level) {
    int32_t step = map->fine_step && level >= map->fine_from ? map->fine_step : map->step;
    for (uint32_t l = level; l + 1 < map->level_count; l++) step = step > 3 ? (int32_t)((int64_t)step * map->fall / 8) : step;
    return step;
}

lathe_status lathe__radius_walk(lathe_radius_map *map, uint32_t level, const lathe_number_coder *coder) {
    walk w = {.map = map, .coder = coder, .step = step_of(map, level), .mask = map->rays - 1};
    int32_t stride = (int32_t)1 << (map->level_count - 1 - level), last = map->slices - 1;
    uint32_t rays = lathe__radius_ray_stride(map, level);
    if (level == 0) {
        for (int32_t row = 0, before = -1;; before = row, row = row + stride < last ? row + stride : last) {
            if (!code_first_row(&w, row, before, rays)) return LATHE_ERR_FORMAT;
            if (row == last) return LATHE_OK;
        }
    }
    uint32_t known = lathe__radius_ray_stride(map, level - 1);
    for (int32_t row = stride; row < last; row += 2 * stride)
        if (!code_new_row(&w, row, stride, known)) return LATHE_ERR_FORMAT;
    if (known == rays) return LATHE_OK;
    for (int32_t row = 0, before = -1;; before = row, row = row + stride < last ? row + stride : last) {
        bool fresh = row % (2 * stride) && row != last;
        if (!code_new_rays(&w, row, before, fresh, rays)) return LATHE_ERR_FORMAT;
        if (row == last) return LATHE_OK;
    }
}
