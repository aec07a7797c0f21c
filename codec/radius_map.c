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
    /* And a row of zeros below the first. Before the larger array: blocks of an arena at least double. */
    map->left = LATHE_NEW(arena, uint8_t, samples + map->rays);
    map->radius = LATHE_NEW(arena, int32_t, samples);
    if (!map->centre || !map->radius || !map->left) return LATHE_ERR_MEMORY;
    memset(map->left, 0, samples + map->rays);
    map->left += map->rays;
    return LATHE_OK;
}

uint32_t lathe__radius_ray_stride(const lathe_radius_map *map, uint32_t level) {
    uint32_t stride = (uint32_t)1 << (map->level_count - 1 - level) >> map->ahead;
    return !stride ? 1 : map->rays / stride < 8 ? map->rays / 8 : stride;
}

int32_t lathe__centre_between(int32_t low, int32_t at_low, int32_t high, int32_t at_high, int32_t row) {
    int32_t span = high - low;
    return (int32_t)(((int64_t)at_low * (high - row) * 2 + (int64_t)at_high * (row - low) * 2 + span) / (2 * span));
}

enum { NEAR = 81 };            /* as large as that is as large as it gets */
enum { ENCODES = LATHE_RADII_ENCODE };

typedef struct walk {
    lathe_radius_map *map;
    const lathe_number_coder *coder;
    int32_t step;
    uint32_t mask;             /* rays - 1 */
    uint16_t near[LATHE_RADIUS_MAX_RAYS]; /* of a row's numbers: how large those are that are known around, the ones before in the row left out */
} walk;

static int32_t *row_of(const walk *w, int32_t row) { return w->map->radius + (size_t)row * w->map->rays; }
/* Sizes of what was left of a row; of a row that there is not: 0. */
static uint8_t *left_of(const walk *w, int32_t row) { return w->map->left + (ptrdiff_t)(row < 0 ? -1 : row) * (ptrdiff_t)w->map->rays; }

/* A dead zone: numbers up to 0.6 are 0, and all are rounded that much towards 0. */
static int32_t quantise(int32_t value, int32_t step) {
    int32_t a = (value < 0 ? -value : value) * 5 + 2 * step, number = 0;
    for (; a >= 5 * step; a -= 5 * step) number++;   /* 0 more often than not: faster than to divide */
    return value < 0 ? -number : number;
}

int32_t lathe__code_number(const lathe_number_coder *c, lathe_number_model *model, int32_t number) {
    return ENCODES && c->code ? c->code(c->coder, model, number) : c->coder ? lathe__get_number(c->coder, model) : 0;
}

/* False: it is out of range. */
static bool set_radius(const lathe_radius_map *map, int32_t *at, int64_t r) {
    if (r > map->farthest) {
        if (!map->tube) return false;
        r = map->farthest;
    }
    *at = r < LATHE_RADIUS_LEAST ? LATHE_RADIUS_LEAST : (int32_t)r;
    return true;
}

/* *at stands for what it is predicted to be. */
static bool code_radius(const walk *w, lathe_number_model *model, int32_t *at) {
    lathe_radius_map *map = w->map;
    ptrdiff_t i = at - map->radius;
    int32_t number = ENCODES && w->coder->truth ? quantise(w->coder->truth->radius[i] - *at, w->step) : 0;
    if (map->left) {
        number = lathe__code_number(w->coder, model, number);
        int32_t size = number < 0 ? -number : number;
        map->left[i] = (uint8_t)(size > 127 ? 127 : size);
    }
    return set_radius(map, at, *at + (int64_t)number * w->step);
}

/* The radii of a row from `first` on, every pitch-th: near[] is known. */
static bool code_row(const walk *w, int kind, int32_t row, uint32_t first, uint32_t pitch) {
    static const uint8_t CLASS_OF[NEAR] = {[1 ... 2] = 1,   [3 ... 5] = 2,   [6 ... 9] = 3,   [10 ... 15] = 4,
                                           [16 ... 24] = 5, [25 ... 39] = 6, [40 ... 79] = 7, [80] = 8};
    const lathe_radius_map *map = w->map;
    int32_t *r = row_of(w, row) + first, *end = r - first + map->rays;
    uint8_t *left = map->left ? left_of(w, row) + first : NULL;
    lathe_number_model *models = map->models->radius[kind];
    const uint16_t *near = w->near;
    uint32_t before = 0;       /* ten times the size of the number before, five times that of the one before it */
    uint32_t most = (uint32_t)(map->farthest - LATHE_RADIUS_LEAST);
    lathe_range_decoder *d = left && !(ENCODES && w->coder->code) ? w->coder->coder : NULL;
    uint32_t range = d ? d->range : 0, code = d ? d->code : 0;
    bool quiet = !left && !(ENCODES && w->coder->truth);   /* nothing is coded */
    for (uint32_t one = 0; r < end; r += pitch) {
        lathe_number_model *model = models;
        if (left) {
            uint32_t close = *near++ + before;
            model = &models[CLASS_OF[close < NEAR ? close : NEAR - 1]];
            before = 5 * one;
        }
        /* Most numbers are 0 and need no new byte: those are read here. */
        uint32_t bound = (uint32_t)((uint64_t)range * model->bit[0].p1 >> 16);
        bool zero = d && code >= bound && range - bound >= 1u << 24;
        if (zero || quiet) {
            if (zero) {
                code -= bound, range -= bound;
                lathe__bit_learn(&model->bit[0], 0);
                left += pitch;
                one = 0;       /* as `left` is since the map's start */
            }
            if ((uint32_t)(*r - LATHE_RADIUS_LEAST) > most && !set_radius(map, r, *r)) return false;
            continue;
        }
        if (d) d->range = range, d->code = code;
        if (!code_radius(w, model, r)) return false;
        if (d) range = d->range, code = d->code;
        if (!left) continue;
        one = *left;
        before += 10 * one;
        left += pitch;
    }
    if (d) d->range = range, d->code = code;
    return true;
}

static bool code_centre(const walk *w, int32_t row, const int32_t predicted[2], lathe_number_model *model) {
    enum { MOST = 1 << 14 };   /* twice as far as any frame reaches, so that coordinates have differences */
    for (int k = 0; k < 2; k++) {
        int32_t number = lathe__code_number(w->coder, model, ENCODES && w->coder->truth ? w->coder->truth->centre[row][k] - predicted[k] : 0);
        if (number > MOST || number < -MOST) return false;
        int32_t at = w->map->centre[row][k] = predicted[k] + number;
        if (at > MOST || at < -MOST) return false;
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
        r[i] = predicted;
        if (!code_radius(w, map->models->radius[0], &r[i])) return false;
    }
    return true;
}

/* Next to an end of a tube it is the squares that are linear, as on a ball. */
static int32_t round_between(int32_t low, int64_t a, int32_t high, int64_t b, int32_t row) {
    uint64_t square = (uint64_t)((a * a * (high - row) + b * b * (row - low)) / (high - low)), root = 0;
    for (uint64_t bit = (uint64_t)1 << 19; bit; bit >>= 1)   /* a radius has at most 20 bits */
        if ((root | bit) * (root | bit) <= square) root |= bit;
    return (int32_t)root;
}

/* Between b and c, of four in a row. */
static int32_t between_four(int32_t a, int32_t b, int32_t c, int32_t d) { return (9 * (b + c) - a - d + 8) >> 4; }

/* near[] of every pitch-th ray: of the row below, and of the rays of its own row half way to the next, which count so much. */
static void sum_near(walk *w, const uint8_t *below, const uint8_t *own, uint32_t first, uint32_t weight, uint32_t pitch) {
    uint16_t *near = w->near;
    uint32_t rays = w->map->rays, a = below[rays + first - pitch], b = below[first], half = pitch / 2;
    for (uint32_t i = first; i < rays; i += pitch, near++) {
        uint32_t c = below[(i + pitch) & w->mask];
        *near = (uint16_t)(10 * b + 4 * (a + c));
        if (weight) *near = (uint16_t)(*near + weight * (own[i - half] + own[(i + half) & w->mask]));
        a = b, b = c;
    }
}

/* A new row between two known ones; those beyond are known, too, if they are as far away again. */
static bool code_new_row(walk *w, int32_t row, int32_t stride, uint32_t rays) {
    const lathe_radius_map *map = w->map;
    int32_t last = map->slices - 1, low = row - stride, high = row + stride < last ? row + stride : last, between[2];
    for (int k = 0; k < 2; k++) between[k] = lathe__centre_between(low, map->centre[low][k], high, map->centre[high][k], row);
    if (!code_centre(w, row, between, &map->models->centres)) return false;
    const int32_t *a = row_of(w, low), *b = row_of(w, high);
    int32_t *r = row_of(w, row);
    if (low - 2 * stride >= 0 && high + 2 * stride <= last && high - row == stride) {
        const int32_t *aa = row_of(w, low - 2 * stride), *bb = row_of(w, high + 2 * stride);
        for (uint32_t i = 0; i < map->rays; i += rays) r[i] = between_four(aa[i], a[i], b[i], bb[i]);
    } else {
        for (uint32_t i = 0; i < map->rays; i += rays)
            r[i] = map->tube ? round_between(low, a[i], high, b[i], row) : lathe__centre_between(low, a[i], high, b[i], row);
    }
    if (map->left) sum_near(w, left_of(w, row - 2 * stride), left_of(w, row), 0, 0, rays);
    return code_row(w, 1, row, 0, rays);
}

/* New rays between the known ones of a row. before: the shown row below, or -1. */
static bool code_new_rays(walk *w, int32_t row, int32_t before, bool fresh, uint32_t stride) {
    int32_t *r = row_of(w, row);
    uint32_t mask = w->mask, rays = w->map->rays;
    int32_t a = r[rays - 2 * stride], b = r[0], c = r[2 * stride];
    for (uint32_t i = stride; i < rays; i += 2 * stride) {
        int32_t d = r[(i + 3 * stride) & mask];
        r[i] = between_four(a, b, c, d);
        a = b, b = c, c = d;
    }
    if (w->map->left) sum_near(w, left_of(w, before), left_of(w, row), stride, fresh ? 5 : 0, 2 * stride);
    return code_row(w, 2, row, stride, 2 * stride);
}

static int32_t fallen(const lathe_radius_map *map, int32_t step) { return step > 3 ? (int32_t)((int64_t)step * map->fall / 8) : step; }

static int32_t step_of(const lathe_radius_map *map, uint32_t level) {
    int32_t step = map->fine_step && level >= map->fine_from ? map->fine_step : map->step;
    for (uint32_t l = level; l + 1 < map->level_count; l++) step = fallen(map, step);
    return step;
}

static bool is_wanted(const lathe_radius_map *map, int32_t row) { return !ENCODES || !map->wanted || map->wanted[row]; }

static bool is_early(const lathe_radius_map *map, uint32_t with, int32_t row) {
    return map->early && map->early_with == with && map->early[row];
}

/* The rows that a level puts between those of the one below; early: only those that come with the level below, else the others. */
static bool code_rows_between(walk *w, uint32_t level, bool early) {
    const lathe_radius_map *map = w->map;
    int32_t stride = (int32_t)1 << (map->level_count - 1 - level);
    uint32_t rays = lathe__radius_ray_stride(map, level - 1);
    for (int32_t row = stride; row < map->slices - 1; row += 2 * stride)
        if (is_early(map, level - 1, row) == early && is_wanted(map, row) && !code_new_row(w, row, stride, rays)) return false;
    return true;
}

/* The same of rays. An early row looks at no other: the one below need not be there yet. */
static bool code_rays_between(walk *w, uint32_t level, bool early) {
    const lathe_radius_map *map = w->map;
    int32_t stride = (int32_t)1 << (map->level_count - 1 - level), last = map->slices - 1;
    uint32_t rays = lathe__radius_ray_stride(map, level);
    if (lathe__radius_ray_stride(map, level - 1) == rays) return true;
    for (int32_t row = 0, before = -1;; before = row, row = row + stride < last ? row + stride : last) {
        bool fresh = row % (2 * stride) && row != last;
        if (is_early(map, level - 1, row) == early && is_wanted(map, row) && !code_new_rays(w, row, early ? -1 : before, fresh, rays)) return false;
        if (row == last) return true;
    }
}

static bool code_first_rows(const walk *w) {
    int32_t stride = (int32_t)1 << (w->map->level_count - 1), last = w->map->slices - 1;
    for (int32_t row = 0, before = -1;; before = row, row = row + stride < last ? row + stride : last) {
        if (!code_first_row(w, row, before, lathe__radius_ray_stride(w->map, 0))) return false;
        if (row == last) return true;
    }
}

lathe_status lathe__radius_walk(lathe_radius_map *map, uint32_t level, const lathe_number_coder *coder) {
    walk w;
    w.map = map, w.coder = coder, w.step = step_of(map, level), w.mask = map->rays - 1;
    bool good = level ? code_rows_between(&w, level, false) && code_rays_between(&w, level, false) : code_first_rows(&w);
    if (!good || !map->early || map->early_with != level) return good ? LATHE_OK : LATHE_ERR_FORMAT;
    w.step = fallen(map, w.step);
    good = code_rows_between(&w, level + 1, true) && code_rays_between(&w, level + 1, true);
    return good ? LATHE_OK : LATHE_ERR_FORMAT;
}
