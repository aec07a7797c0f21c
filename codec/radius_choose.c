/* Is a structure better off as radius maps? If its loops make few tubes and are all but stars, coarser and finer steps are tried: what
 * they would cost and how far off they would be is found from the maps alone. The cheapest way to a level that is close is taken, if
 * its surface keeps that promise and costs clearly less than slices would. */
#include <math.h>
#include <string.h>
#include "mesh.h"
#include "radius_estimate.h"
#include "radius_trace.h"
#include "structure_encode.h"

/* In voxels. A level is close that is at most this far off by RMS and anywhere; the last one must be closer. */
static const double CLOSE_RMS = 0.239, CLOSE_MAX = 3, MOST_RMS = 0.22, MOST_MAX = 1.0;
/* A level's error against the one before it, by the estimate. */
static const double STILL = 1.005;
/* Of the bytes that slices cost. */
static const double MOST_BYTES = 0.9;
/* Eighths of a step that each pass has below the next. */
enum { FALL = 6 };
/* Of the loops' area, what may turn back. */
static const double MOST_BACK = 0.05;

/* ---- grey values between pixels ---- */

static double between_pixels(void *context, double u, double v, int32_t w) {
    const lathe_encode_source *s = context;
    int32_t i = (int32_t)floor(u), j = (int32_t)floor(v);
    double fu = u - i, fv = v - j, low = 0, high = 0;
    low = s->value(s->context, i, j, w) * (1 - fu) + s->value(s->context, i + 1, j, w) * fu;
    high = s->value(s->context, i, j + 1, w) * (1 - fu) + s->value(s->context, i + 1, j + 1, w) * fu;
    return low * (1 - fv) + high * fv;
}

/* ---- how much the shape turns from slice to slice ---- */

static double likeness(const lathe_radius_map *map, int32_t apart, int32_t shift) {
    double sum = 0;
    int32_t every = map->slices / 48 + 1;
    for (int32_t row = 0; row + apart < map->slices; row += every) {
        const int32_t *a = map->radius + (size_t)row * map->rays, *b = a + (size_t)apart * map->rays;
        double ab = 0, aa = 0, bb = 0, mean_a = 0, mean_b = 0;
        for (uint32_t i = 0; i < map->rays; i++) mean_a += a[i], mean_b += b[i];
        mean_a /= map->rays, mean_b /= map->rays;
        for (uint32_t i = 0; i < map->rays; i++) {
            double p = a[i] - mean_a, q = b[(i + (uint32_t)shift) & (map->rays - 1)] - mean_b;
            ab += p * q, aa += p * p, bb += q * q;
        }
        if (aa > 0 && bb > 0) sum += ab / sqrt(aa * bb);
    }
    return sum / (map->slices - apart);
}

/* Profiles farther and farther apart are laid over each other; each distance refines what the one before said. */
static int32_t estimate_turn(const lathe_radius_map *map) {
    double turn = 0;           /* in rays for each slice */
    for (int32_t apart = 1; apart <= 16 && apart < map->slices; apart *= 2) {
        int32_t around = (int32_t)lround(turn * apart), reach = apart == 1 ? (int32_t)map->rays / 16 : 2, best = around;
        double most = -2;
        for (int32_t shift = around - reach; shift <= around + reach; shift++) {
            double l = likeness(map, apart, shift);
            if (l > most + 1e-9) most = l, best = shift;
        }
        turn = (double)best / apart;
    }
    return (int32_t)lround(turn * 65536 / map->rays);
}

/* ---- trying ---- */

typedef struct trial {
    lathe_radii truth;
    lathe_radius_estimate estimate;
    lathe_reference *reference;
    lathe_arena *arena;        /* three: of a trial's maps, and two for scratch */
    double pixel, voxel;       /* pixel: in voxels; voxel: the smallest of its edges, mm */
    size_t borders, samples;   /* border edges of the mask; points of a measurement */
    double apart[LATHE_MAX_LEVELS];   /* what estimates leave out, squared: measured minus estimated */
    double spacing[3];         /* of u, v, w, mm */
} trial;

typedef struct outcome {
    lathe_radii coded;         /* until the next trial; at any level */
    size_t bytes[LATHE_MAX_LEVELS];
    double rms[LATHE_MAX_LEVELS], most[LATHE_MAX_LEVELS];   /* voxels */
} outcome;

static int32_t put_number(void *coder, lathe_number_model *model, int32_t number) {
    lathe__put_number(coder, model, number);
    return number;
}

static void set_steps(lathe_radii *truth, int32_t step, uint32_t fine_level, int32_t fine_step) {
    truth->step = step;
    truth->fine_level = fine_level;
    truth->fine_step = fine_step;
}

static lathe_radii frame_of(const trial *t) {
    return (lathe_radii){.slices = t->truth.slices, .width = t->truth.width, .height = t->truth.height, .level_count = t->truth.level_count};
}

/* Codes levels up to `last`; errors are estimated from level `from` on. */
static lathe_status try_steps(outcome *out, trial *t, uint32_t from, uint32_t last) {
    lathe_status status = LATHE_OK;
    lathe__arena_reset(&t->arena[0]);
    out->coded = frame_of(t);
    for (uint32_t level = 0; !status && level <= last; level++) {
        lathe_range_encoder e;
        lathe__encoder_start(&e);
        status = lathe__radii_code(&out->coded, &t->truth, &t->arena[0], level, put_number, &e);
        lathe__encoder_finish(&e);
        out->bytes[level] = e.size;
        if (!status && e.failed) status = LATHE_ERR_MEMORY;
        lathe__encoder_free(&e);
        if (status || level < from) continue;
        status = lathe__estimate_error(&out->rms[level], &out->most[level], &t->estimate, &t->arena[1], &out->coded, level);
        out->rms[level] *= t->pixel;
        out->most[level] *= t->pixel;
    }
    return status == LATHE_ERR_FORMAT ? LATHE_ERR_EMPTY : status;   /* a number out of range */
}

enum { FINEST_STEP = 10, FINE_STEP = 20, COARSE_STEP = 52 };

static double expected(const trial *t, const outcome *o, uint32_t level, uint32_t measured) {
    return sqrt(fmax(o->rms[level] * o->rms[level] + t->apart[measured], 0.25 * o->rms[level] * o->rms[level]));
}

/* What the estimate leaves out are caps and joints, and that it looks along rays: measured once, it is known for other steps, too. */
static lathe_status measure(bool *close, outcome *o, trial *t, uint32_t level) {
    lathe_mesh mesh = {0};
    lathe_surface_counts counts = {0};
    lathe_metrics m;
    uint32_t shown;
    lathe_status status = lathe__radii_mesh(&mesh, &t->arena[1], &o->coded, level, &counts, &shown);
    if (!status) status = lathe__reference_measure(&m, t->reference, &mesh, t->samples);
    lathe_mesh_free(&mesh);
    if (status) return status;
    double rms = m.rms_mm / t->voxel;
    t->apart[level] = rms * rms - o->rms[level] * o->rms[level];
    *close = rms <= CLOSE_RMS && m.max_mm <= CLOSE_MAX * t->voxel;
    return LATHE_OK;
}

/* The coarsest step between two, the first of which is close enough, that leaves a level close: found by the estimate, which is measured
 * where the search ends; a step that the measurement refuses makes way for finer ones. */
static lathe_status search_step(int32_t *good, trial *t, uint32_t level, int32_t bad, double first) {
    enum { MEASUREMENTS = 2 };
    static const double NEAR = 0.97;
    outcome o;
    for (int count = 0; bad - *good > 1 && count < MEASUREMENTS; count++) {
        /* Errors grow a little slower than steps. */
        int32_t low = *good, high = bad, guess = low + (int32_t)lround(10 * log2(CLOSE_RMS / fmin(CLOSE_RMS, first)));
        for (; high - low > 1; guess = (low + high) / 2) {
            guess = guess <= low ? low + 1 : guess >= high ? high - 1 : guess;
            set_steps(&t->truth, guess, 0, 0);
            lathe_status status = try_steps(&o, t, level, level);
            if (status) return status;
            *(expected(t, &o, level, level) <= CLOSE_RMS ? &low : &high) = guess;
        }
        if (low == *good) break;
        bool close;
        set_steps(&t->truth, low, 0, 0);
        lathe_status status = try_steps(&o, t, level, level);
        if (!status) status = measure(&close, &o, t, level);
        if (status) return status;
        *(close ? good : &bad) = low;
        first = expected(t, &o, level, level);
        if (close && first > CLOSE_RMS * NEAR) break;
    }
    return LATHE_OK;
}

/* What a client has fetched when it has a level, more or less. */
static lathe_status cost_of(size_t *bytes, trial *t, uint32_t level) {
    enum { RECORD = 21 };
    outcome o;
    lathe_status status = try_steps(&o, t, LATHE_MAX_LEVELS, level);
    *bytes = RECORD * level;
    for (uint32_t i = 0; !status && i <= level; i++) *bytes += o.bytes[i];
    return status;
}

static size_t samples_of(const lathe_radii *radii) {
    size_t samples = 0;
    for (uint32_t i = 0; i < radii->count; i++) samples += (size_t)radii->tubes[i].map.slices * radii->tubes[i].map.rays;
    return samples;
}

/* The first level that a fine step brings close, or the one behind it, each with its coarsest step: the one that costs less. */
static lathe_status choose_step(uint32_t *level, trial *t) {
    enum { MANY = 8000 };      /* coded radii: to measure a second level of so many takes longer than it is worth */
    static const double MISJUDGED = 1.3, CLEARLY = 0.95;
    outcome fine;
    uint32_t last = t->truth.level_count - 1, taken = 0;
    int32_t start = FINE_STEP, bad = COARSE_STEP, best = 0;
    size_t least = SIZE_MAX;
    *level = 0;
    set_steps(&t->truth, start, 0, 0);
    lathe_status status = try_steps(&fine, t, 0, last);
    if (!status && fine.rms[last] > CLOSE_RMS) {
        bad = start;
        set_steps(&t->truth, start = FINEST_STEP, 0, 0);
        status = try_steps(&fine, t, 0, last);
    }
    for (uint32_t i = 0; !status && i <= last && taken < 2; i++) {
        bool close = false;
        size_t bytes;
        int32_t step = start;
        if (fine.rms[i] > CLOSE_RMS * MISJUDGED || (taken && samples_of(&t->truth) >> 2 * (last - i) > MANY)) continue;
        if (taken) {
            t->apart[i] = t->apart[i - 1];   /* measured at the end of the search */
        } else {
            status = measure(&close, &fine, t, i);
            if (status || !close || (i < last && expected(t, &fine, i, i) > CLOSE_RMS * CLEARLY)) continue;
        }
        taken++;
        status = search_step(&step, t, i, bad, expected(t, &fine, i, i));
        set_steps(&t->truth, step, 0, 0);
        if (!status) status = cost_of(&bytes, t, i);
        if (!status && bytes < least) least = bytes, best = step, *level = i;
    }
    set_steps(&t->truth, best, 0, 0);
    return status ? status : taken ? LATHE_OK : LATHE_ERR_EMPTY;
}

/* The step of the levels behind the close one: as coarse as errors then keep falling, down to what the last level may have. */
static lathe_status choose_fine_step(size_t *bytes, trial *t, uint32_t level) {
    outcome o = {0};
    uint32_t last = t->truth.level_count - 1;
    int32_t step = t->truth.step, taken = step;
    static const int32_t FINER[] = {-8, -4, 0, 4, 6, 8, 11, 14};
    enum { FINERS = sizeof FINER / sizeof *FINER };
    int low = -1, high = level == last ? 1 : FINERS;   /* halving: the coarsest that will do */
    bool good = false, kept = false;
    lathe_status status = LATHE_OK;
    for (int i = high / 2; !status && high - low > 1; i = (low + high) / 2) {
        set_steps(&t->truth, step, level == last ? 0 : level + 1, step - FINER[i] < 0 ? 0 : step - FINER[i]);
        status = try_steps(&o, t, level, last);
        double rms = level == last ? CLOSE_RMS : MOST_RMS;
        bool within = !status && expected(t, &o, last, level) <= rms && o.most[last] <= MOST_MAX, falls = within;
        for (uint32_t k = level; k < last; k++) falls &= expected(t, &o, k + 1, level) <= STILL * expected(t, &o, k, level);
        good |= within;
        if (falls) kept = true, taken = t->truth.fine_step, high = i;
        else low = i;
        if (falls || (within && !kept)) {
            taken = t->truth.fine_step;
            for (uint32_t k = 0, sum = 0; k <= last; k++) *bytes = sum += (uint32_t)o.bytes[k];
        }
    }
    set_steps(&t->truth, step, level == last ? 0 : level + 1, taken);
    return status ? status : good ? LATHE_OK : LATHE_ERR_EMPTY;
}

/* ---- the surfaces ---- */

static bool sound(const lathe_mesh *mesh, int64_t components, int64_t euler, bool intersections) {
    lathe_mesh_report r;
    if (lathe__mesh_check(&r, mesh, intersections)) return false;
    return !r.boundary_edges && !r.nonmanifold_edges && !r.misoriented_edges && !r.nonmanifold_vertices && !r.degenerate_triangles &&
           !r.duplicate_positions && !r.self_intersections && (int64_t)r.components == components && r.euler == euler;
}

/* The overlay makes a sound surface of whatever outlines fit together, strips of rows that do not turn need no check at all: what has few
 * triangles is checked as a whole, as much as for the topology; else outlines are. */
static lathe_status check_level(bool *good, trial *t, lathe_radii *coded, uint32_t level, int64_t components, int64_t euler) {
    enum { FEW = 3000 };
    lathe_surface_counts counts = {0};
    lathe_mesh mesh = {0};
    int32_t *slices;
    uint32_t shown, stride;
    lathe_status status = lathe__radii_slices(&slices, &shown, &stride, &t->arena[1], coded, level);
    for (uint32_t i = 0; !status && *good && coded->count > 1 && i < shown; i++) {
        lathe_outline outline;
        status = lathe__radii_outline(&outline, &t->arena[1], coded, level, slices[i], stride, i);
        *good = !status && lathe__loops_fit(&outline);
    }
    lathe__arena_reset(&t->arena[1]);
    if (status || !*good || (level && (coded->count == 1 && !coded->tubes[0].map.turn))) return status;
    if (level && (uint64_t)shown * coded->tubes[0].map.rays / stride * 2 > FEW) return LATHE_OK;
    status = lathe__radii_mesh(&mesh, &t->arena[1], coded, level, &counts, &shown);
    if (!status) *good = sound(&mesh, components, euler, true);
    lathe_mesh_free(&mesh);
    return status;
}

static lathe_status check_levels(trial *t, const lathe_structure_state *state) {
    lathe_radii coded = frame_of(t);
    lathe_topology all = {.components = 1, .euler = 1};
    bool good = true;
    lathe_status status = t->truth.count > 1 ? lathe__mask_topology(&all, &state->mask, NULL) : LATHE_OK;
    lathe__arena_reset(&t->arena[0]);
    for (uint32_t level = 0; !status && good && level < coded.level_count; level++) {
        lathe_range_encoder e;
        lathe__encoder_start(&e);
        status = lathe__radii_code(&coded, &t->truth, &t->arena[0], level, put_number, &e);
        lathe__encoder_free(&e);
        if (!status) status = check_level(&good, t, &coded, level, all.components + all.cavities, 2 * all.euler);
    }
    return status ? status : good ? LATHE_OK : LATHE_ERR_EMPTY;
}

/* ---- from loops to maps ---- */

static lathe_status fit_tubes(lathe_radii *truth, lathe_arena *arena, lathe_arena *scratch, const lathe_traced_tubes *traced,
                              const lathe_encode_source *source, int32_t turn) {
    lathe_grey grey = {between_pixels, (void *)(uintptr_t)source, source->iso};
    lathe_status status = LATHE_OK;
    truth->count = traced->count;
    truth->tubes = LATHE_NEW(arena, lathe_radius_tube, traced->count);
    if (!truth->tubes) return LATHE_ERR_MEMORY;
    memset(truth->tubes, 0, traced->count * sizeof *truth->tubes);
    for (uint32_t i = 0; !status && i < traced->count; i++) {
        const lathe_traced_tube *from = &traced->tubes[i];
        lathe_radius_tube *tube = &truth->tubes[i];
        double back;
        tube->first = from->first;
        tube->hole = from->hole;
        tube->map = (lathe_radius_map){.slices = from->rows, .level_count = lathe__tube_passes(from->rows, truth->level_count), .turn = turn,
                                       .fall = FALL, .farthest = (truth->width + truth->height) * LATHE_RADIUS_ONE};
        status = lathe__radius_fit(&tube->map, arena, scratch, from->loops, from->first, from->hole, source->value ? &grey : NULL, &back);
        bool wide = traced->count > 1 && tube->map.rays > LATHE_TUBE_MOST_RAYS;
        if (!status && (back > MOST_BACK || wide)) status = LATHE_ERR_EMPTY;
    }
    return status;
}

/* The first fit, and for a tube that turns another with its rays turning along; the one with fewer bytes at one step stays. */
static lathe_status fit_turned(trial *t, lathe_structure_state *state, lathe_arena *scratch, const lathe_traced_tubes *traced,
                               const lathe_encode_source *source, double slice) {
    lathe_status status = fit_tubes(&t->truth, &state->arena, scratch, traced, source, 0);
    int32_t turn = status || traced->count > 1 ? 0 : estimate_turn(&t->truth.tubes[0].map);
    if (!status && turn) {
        lathe_radii straight = t->truth;
        outcome o[2];
        uint32_t last = t->truth.level_count - 1;
        set_steps(&t->truth, FINE_STEP, 0, 0);
        status = try_steps(&o[0], t, LATHE_MAX_LEVELS, last);
        if (!status) status = fit_tubes(&t->truth, &state->arena, scratch, traced, source, turn);
        if (!status) status = try_steps(&o[1], t, LATHE_MAX_LEVELS, last);
        size_t bytes[2] = {0, 0};
        for (int i = 0; i < 2; i++)
            for (uint32_t level = 0; level <= last; level++) bytes[i] += o[i].bytes[level];
        if (bytes[1] >= bytes[0]) t->truth = straight;
    }
    return status ? status : lathe__estimate_start(&t->estimate, &state->arena, &t->truth, slice);
}

static size_t count_borders(const lathe_mask *mask) {
    size_t borders = 0;
    for (int32_t w = 0; w < mask->size[2]; w++) {
        lathe_slice_view view = {.pixels = lathe__mask_slice(mask, w), .width = mask->size[0], .height = mask->size[1], .row_words = mask->row_words};
        borders += lathe__count_borders(&view);
    }
    return borders;
}

/* The smoothest shapes' rasters cost a quarter of a bit for each border edge, and their first bytes more. */
static lathe_status earns_its_place(bool *good, size_t bytes, const trial *t, const lathe_structure_state *state) {
    size_t rasters = t->borders / 30 + 110;
    lathe_status status = LATHE_OK;
    if ((double)bytes > MOST_BYTES * (double)rasters) status = lathe__pyramid_cost(&rasters, &state->mask, t->spacing);
    *good = (double)bytes <= MOST_BYTES * (double)rasters;
    return status;
}

static lathe_status choose(trial *t, const lathe_structure_state *state) {
    uint32_t level;
    size_t bytes = 0;
    bool good = true;
    lathe_status status = choose_step(&level, t);
    if (!status) status = choose_fine_step(&bytes, t, level);
    if (!status) status = check_levels(t, state);
    if (!status) status = earns_its_place(&good, bytes, t, state);
    return status ? status : good ? LATHE_OK : LATHE_ERR_EMPTY;
}

lathe_status lathe__choose_radii(lathe_baked_structure *out, lathe_structure_state *state, lathe_arena arena[2], const lathe_volume *volume,
                                 lathe_axis axis, lathe_boundary boundary, const lathe_encode_source *source) {
    int32_t frame[3];
    /* The staircase of a label is not smooth: maps of labels cost more than slices. */
    if (state->flags & (LATHE_FLAG_EXACT | LATHE_FLAG_KEEP) || boundary == LATHE_BOUNDARY_EDGE || !source->value) return LATHE_OK;
    lathe_arena trials[3] = {{0}};
    trial t = {.truth = lathe__radii_frame(state), .arena = trials};
    const double *mm = volume->spacing;
    lathe__axis_frame(axis, frame);
    double least = fmin(mm[0], fmin(mm[1], mm[2])), pixel = sqrt(mm[frame[0]] * mm[frame[1]]);
    for (int k = 0; k < 3; k++) t.spacing[k] = mm[frame[k]];
    t.pixel = pixel / least;
    t.voxel = least;
    t.borders = count_borders(&state->mask);
    t.samples = t.borders < 8000 ? 400 : t.borders < 30000 ? t.borders / 20 : 1500;
    lathe_traced_tubes traced;
    lathe_arena loops = {0};
    lathe_status status = lathe__radius_trace(&traced, &loops, &state->mask, state->fraction);
    if (!status) status = fit_turned(&t, state, &arena[0], &traced, source, mm[frame[2]] / pixel);
    lathe__arena_free(&loops);
    if (!status) status = lathe__reference_build(&t.reference, volume, axis, &state->mask, boundary, source->iso);
    if (!status) status = choose(&t, state);
    lathe__reference_free(&t.reference);
    lathe__arena_reset(&arena[0]);
    for (int i = 0; i < 3; i++) lathe__arena_free(&trials[i]);
    if (status) return status == LATHE_ERR_EMPTY || status == LATHE_ERR_LIMIT ? LATHE_OK : status;
    lathe_radii *kept = LATHE_NEW(&state->arena, lathe_radii, 2);
    if (!kept) return LATHE_ERR_MEMORY;
    kept[0] = t.truth;
    state->radii = &kept[1];
    out->truth = &kept[0];
    for (uint32_t level = 0; level < out->level_count; level++) {
        out->levels[level].components = out->levels[out->level_count - 1].components;
        out->levels[level].components_waiting = 0;
        out->levels[level].waiting_mm3 = 0;
    }
    return LATHE_OK;
}
