#include "radius_tubes.h"
#include <string.h>

/* Numbers of the head, each kind with its own context. */
enum { HEAD_FORM, HEAD_COUNT, HEAD_STEP, HEAD_FALL, HEAD_FINE, HEAD_TURN, HEAD_APEX, HEAD_FIRST, HEAD_ROWS, HEAD_RAYS, HEAD_HOLE, HEAD_AHEAD, HEAD_EARLY,
       HEAD_GAP, HEAD_KINDS };
/* Simple maps: log2 rays - 6, to 4. */
enum { LEAST_FORM = -3, FORM_TUBES = 5, FORM_TUBES_MORE = 6, FORM_TUBES_PLAIN = 7, USUAL_STEP = 32, USUAL_FALL = 6, USUAL_LOG_RAYS = 6, MOST_SAMPLES = 1 << 22, MOST_STEP = 1 << 16 };

typedef struct head {
    lathe_radii *radii;
    const lathe_radii *truth;
    lathe_number_coder coder;
    lathe_number_model models[HEAD_KINDS];
    lathe_radius_map common;   /* what all tubes share */
    bool more;                 /* not FORM_TUBES */
    bool wrong;                /* a number is out of range */
} head;

static const lathe_radii *truth_of(const head *h) { return LATHE_RADII_ENCODE ? h->truth : NULL; }

static void start_number(lathe_number_model *m, uint32_t not_zero, uint32_t longer) {
    for (int k = 0; k < LATHE_NUMBER_MODELS; k++) {
        uint32_t p = k == 0 ? not_zero : k >= 2 && k < 24 ? longer : 128;
        m->bit[k] = (lathe_bit_model){(uint16_t)(p << 8), 2};
    }
}

/* From `low` to `high`; coded as its difference from what is usual. */
static int32_t number(head *h, int kind, int32_t usual, int32_t low, int32_t high, int32_t truth) {
    int64_t n = (int64_t)usual + lathe__code_number(&h->coder, &h->models[kind], truth_of(h) ? truth - usual : 0);
    if (n >= low && n <= high) return (int32_t)n;
    h->wrong = true;
    return low;
}

uint32_t lathe__tube_passes(int32_t rows, uint32_t level_count) {
    uint32_t passes = 1;
    while ((int32_t)1 << (passes - 1) < rows - 1) passes++;
    return passes < level_count ? level_count : passes;
}

/* Kinds are those of the two forms. */
static void code_turn(head *h, lathe_radius_map *map, int turn, int apex) {
    const lathe_radius_map *t = truth_of(h) ? &h->truth->tubes[0].map : NULL;
    map->turn = number(h, turn, 0, -32768, 32768, t ? t->turn : 0);
    for (int k = 0; k < 2; k++) map->apex[k] = number(h, apex, LATHE_APEX_ONE / 2, 1, LATHE_APEX_ONE - 1, t ? t->apex[k] : 0);
    map->farthest = (h->radii->width + h->radii->height) * LATHE_RADIUS_ONE;
}

static lathe_status start_simple(head *h, lathe_arena *arena, int32_t form) {
    lathe_radii *radii = h->radii;
    lathe_radius_map *map = &radii->tubes[0].map;
    *map = (lathe_radius_map){.slices = radii->slices, .level_count = radii->level_count, .rays = 64u << (form + 3) >> 3, .fall = 6, .start = {0, 0, 16 * LATHE_RADIUS_ONE}};
    map->step = number(h, HEAD_FORM, 0, 1, MOST_STEP, truth_of(h) ? h->truth->tubes[0].map.step : 0);
    code_turn(h, map, HEAD_FORM, HEAD_FORM);
    return h->wrong ? LATHE_ERR_FORMAT : lathe__radius_map_start(map, arena);
}

/* ---- the head of tubes ---- */

/* 0: the slice that the tube before begins in; 1: the one above its end; n: n - 1 above its first. */
static int32_t first_number(const lathe_radius_tube *tube, const lathe_radius_tube *before) {
    int32_t from = before ? before->first : 0;
    if (before && tube->first == from + before->map.slices) return 1;
    return tube->first > from ? tube->first - from + 1 : 0;
}

static void code_tube(head *h, uint32_t index) {
    lathe_radii *radii = h->radii;
    lathe_radius_tube *tube = &radii->tubes[index], *before = index ? tube - 1 : NULL;
    const lathe_radius_tube *t = truth_of(h) ? &h->truth->tubes[index] : NULL;
    int32_t from = before ? before->first : 0;
    int32_t n = number(h, HEAD_FIRST, 0, 0, radii->slices, t ? first_number(t, index ? t - 1 : NULL) : 0);
    tube->first = n == 1 && before ? from + before->map.slices : n ? from + n - 1 : from;
    int32_t left = radii->slices - tube->first;
    /* What is coded is how many rows there could be more; a tube that begins above the last slice has none. */
    int32_t rows = left - number(h, HEAD_ROWS, 0, 0, left - 1, t ? left - t->map.slices : 0);
    int32_t log_rays = number(h, HEAD_RAYS, before ? __builtin_ctz(before->map.rays) : USUAL_LOG_RAYS, 3,
                              __builtin_ctz(radii->count > 1 ? LATHE_TUBE_MOST_RAYS : LATHE_RADIUS_MAX_RAYS), t ? __builtin_ctz(t->map.rays) : 0);
    tube->hole = number(h, HEAD_HOLE, 0, INT32_MIN, INT32_MAX, t ? t->hole : 0) != 0;
    if (h->wrong) return;
    tube->map = h->common;
    tube->map.slices = rows;
    tube->map.level_count = lathe__tube_passes(rows, radii->level_count);
    tube->map.rays = (uint32_t)1 << log_rays;
    tube->map.fine_from = tube->map.level_count - radii->level_count + radii->fine_level;
    tube->map.early = radii->early_level ? radii->early + tube->first : NULL;
    tube->map.early_with = tube->map.level_count - radii->level_count + radii->early_level - 1;
}

/* Tubes share their contexts. */
static lathe_status allocate(lathe_radius_tube *tube, lathe_arena *arena, lathe_radius_models *models) {
    tube->map.models = models;
    size_t samples = (size_t)tube->map.slices * tube->map.rays;
    lathe_status status = lathe__radius_map_start(&tube->map, arena);
    tube->shown = LATHE_NEW(arena, int32_t, samples);
    tube->shown_centre = lathe__arena_alloc(arena, (size_t)tube->map.slices, sizeof *tube->shown_centre);
    return status ? status : tube->shown && tube->shown_centre ? LATHE_OK : LATHE_ERR_MEMORY;
}

static int32_t next_early(const lathe_radii *radii, int32_t slice) {
    while (slice < radii->slices && !radii->early[slice]) slice++;
    return slice < radii->slices ? slice : -1;
}

/* Ascending; each as what it is above the one before, at first above -1; 0 ends the list. */
static lathe_status code_early(head *h, lathe_arena *arena) {
    lathe_radii *radii = h->radii;
    const lathe_radii *t = truth_of(h);
    radii->early_level = (uint32_t)number(h, HEAD_EARLY, 0, 0, (int32_t)radii->level_count - 1, t ? (int32_t)t->early_level : 0);
    if (!radii->early_level) return LATHE_OK;
    radii->early = LATHE_NEW(arena, bool, radii->slices);
    if (!radii->early) return LATHE_ERR_MEMORY;
    memset(radii->early, 0, (size_t)radii->slices * sizeof *radii->early);
    for (int32_t slice = -1, gap;; radii->early[slice += gap] = true) {
        int32_t next = t ? next_early(t, slice + 1) : 0;
        gap = number(h, HEAD_GAP, 0, 0, radii->slices - slice - 1, t && next >= 0 ? next - slice : 0);
        if (!gap) return LATHE_OK;
    }
}

static lathe_status start_tubes(head *h, lathe_arena *arena) {
    lathe_radii *radii = h->radii;
    const lathe_radii *t = truth_of(h);
    lathe_radius_map *common = &h->common;
    const lathe_radius_map *truth = t ? &t->tubes[0].map : NULL;
    radii->count = (uint32_t)number(h, HEAD_COUNT, 1, 1, LATHE_TUBES_MOST, t ? (int32_t)t->count : 0);
    radii->step = number(h, HEAD_STEP, USUAL_STEP, 0, LATHE_TUBE_STEPS - 1, t ? t->step : 0);
    common->fall = (uint32_t)number(h, HEAD_FALL, USUAL_FALL, 3, 8, truth ? (int32_t)truth->fall : 0);
    radii->fine_level = (uint32_t)number(h, HEAD_FINE, 0, 0, (int32_t)radii->level_count - 1, t ? (int32_t)t->fine_level : 0);
    radii->fine_step = radii->step;
    if (radii->fine_level) radii->fine_step -= number(h, HEAD_STEP, 0, radii->step - (LATHE_TUBE_STEPS - 1), radii->step, t ? t->step - t->fine_step : 0);
    code_turn(h, common, HEAD_TURN, HEAD_APEX);
    common->tube = true;
    common->step = lathe__tube_step(radii->step);
    common->fine_step = radii->fine_level ? lathe__tube_step(radii->fine_step) : 0;
    lathe_status status = LATHE_OK;
    if (h->more) {
        common->ahead = (uint32_t)number(h, HEAD_AHEAD, 0, 0, LATHE_RADIUS_MOST_AHEAD, truth ? (int32_t)truth->ahead : 0);
        status = code_early(h, arena);
    }
    int64_t samples = 0;
    for (uint32_t i = 0; !status && i < radii->count; i++) {
        code_tube(h, i);
        samples += (int64_t)radii->tubes[i].map.slices * radii->tubes[i].map.rays;
        if (h->wrong || samples > MOST_SAMPLES) status = LATHE_ERR_FORMAT;
    }
    for (uint32_t i = 0; !status && i < radii->count; i++) status = allocate(&radii->tubes[i], arena, radii->tubes[0].map.models);
    return status;
}

static int32_t form_of(const lathe_radii *truth) {
    const lathe_radius_map *map = &truth->tubes[0].map;
    if (truth->simple) return __builtin_ctz(map->rays) - 6;
    if (truth->plain) return FORM_TUBES_PLAIN;
    return map->ahead || truth->early_level ? FORM_TUBES_MORE : FORM_TUBES;
}

static lathe_status code_head(lathe_radii *radii, const lathe_radii *truth, lathe_arena *arena, lathe_number_code *code, void *coder) {
    head h = {.radii = radii, .truth = truth, .coder = {code, coder, NULL}};
    for (int k = 0; k < HEAD_KINDS; k++) start_number(&h.models[k], 128, 128);
    radii->tubes = LATHE_NEW(arena, lathe_radius_tube, LATHE_TUBES_MOST);
    if (!radii->tubes) return LATHE_ERR_MEMORY;
    memset(radii->tubes, 0, LATHE_TUBES_MOST * sizeof *radii->tubes);
    int32_t form = number(&h, HEAD_FORM, 0, LEAST_FORM, FORM_TUBES_PLAIN, truth_of(&h) ? form_of(truth) : 0);
    radii->simple = form < FORM_TUBES;
    radii->plain = form == FORM_TUBES_PLAIN;
    radii->count = 1;
    h.more = form != FORM_TUBES;
    return radii->simple ? start_simple(&h, arena, form) : start_tubes(&h, arena);
}

/* ---- passes ---- */

/* A tube begins where the one that ends below it, the last such, had its centre; else where the tube before begins. */
static void start_from(lathe_radius_tube *tube, const lathe_radii *radii) {
    lathe_radius_map *map = &tube->map;
    map->start[0] = radii->width - 1;
    map->start[1] = radii->height - 1;
    map->start[2] = map->farthest / 4;
    if (tube == radii->tubes) return;
    const lathe_radius_tube *near = tube - 1;
    int32_t row = 0;
    for (const lathe_radius_tube *t = radii->tubes; t < tube; t++)
        if (t->hole == tube->hole && t->first + t->map.slices == tube->first) near = t, row = t->map.slices - 1;
    memcpy(map->start, near->map.centre[row], sizeof *near->map.centre);
    map->start[2] = near->map.radius[(size_t)row * near->map.rays] / 2;
}

/* Later passes touch no radius of earlier ones: what a lower level shows can be made again at any time. */
lathe_radius_map lathe__tube_shown(lathe_radius_tube *tube, uint32_t passes) {
    lathe_radius_map map = tube->map;
    static const lathe_number_coder PREDICT = {0};
    map.left = NULL;
    if (passes > tube->passes) passes = tube->passes;
    if (!tube->shown || passes == map.level_count) return map;
    map.radius = tube->shown, map.centre = tube->shown_centre;
    if (tube->shown_passes == passes) return map;
    memcpy(tube->shown, tube->map.radius, (size_t)map.slices * map.rays * sizeof *tube->shown);
    memcpy(tube->shown_centre, tube->map.centre, (size_t)map.slices * sizeof *tube->shown_centre);
    for (uint32_t pass = passes; pass < map.level_count; pass++) (void)lathe__radius_walk(&map, pass, &PREDICT);   /* nothing can be out of range */
    tube->shown_passes = passes;
    return map;
}

static lathe_status code_tubes(lathe_radii *radii, const lathe_radii *truth, uint32_t level, lathe_number_code *code, void *coder) {
    for (uint32_t i = 0; i < radii->count; i++) {
        lathe_radius_tube *tube = &radii->tubes[i];
        lathe_number_coder c = {code, coder, LATHE_RADII_ENCODE && truth ? &truth->tubes[i].map : NULL};
        uint32_t last = tube->map.level_count - radii->level_count + level, pass = level ? last : 0;
        if (!level) start_from(tube, radii);
        for (; pass <= last; pass++) {
            lathe_status status = lathe__radius_walk(&tube->map, pass, &c);
            if (status) return status;
        }
        tube->passes = pass;
        tube->shown_passes = 0;
    }
    return LATHE_OK;
}

lathe_status lathe__radii_code(lathe_radii *radii, const lathe_radii *truth, lathe_arena *arena, uint32_t level, lathe_number_code *code,
                               void *coder) {
    lathe_status status = level ? LATHE_OK : code_head(radii, truth, arena, code, coder);
    if (status) return status;
    lathe_number_coder c = {code, coder, LATHE_RADII_ENCODE && truth ? &truth->tubes[0].map : NULL};
    return radii->simple ? lathe__radius_walk(&radii->tubes[0].map, level, &c) : code_tubes(radii, truth, level, code, coder);
}
