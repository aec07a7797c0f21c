/* Is a structure better off as radius maps? If its loops make few tubes and are all but stars, coarser and finer steps are tried: what
 * they would cost and how far off they would be is found from the maps alone. The cheapest way to a level that is close is taken, if
 * its surface keeps that promise and costs clearly less than slices would. */
#include <math.h>
#include <string.h>
#include "mesh.h"
#include "mesh_intersect.h"
#include "radius_estimate.h"
#include "radius_trace.h"
#include "structure_encode.h"

/* In voxels. A level is close that is at most this far off by RMS and anywhere; the last one must be closer. */
static const double CLOSE_RMS = 0.239, CLOSE_MAX = 3, MOST_RMS = 0.22, MOST_MAX = 1.0;
/* A slice between two that a close level shows comes early if anything in that gap is farther off by the estimate, which sees too much
 * where a surface is oblique: points this far off along their ray are nearer than MOST_MAX as a rule. */
static const double EARLY_MAX = 1.2;
/* A level's error against the one before it, by the estimate. */
static const double STILL = 1.05;
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
    double fu = u - i, fv = v - j;
    float at[4];
    if (s->square) s->square(s->context, i, j, w, at);
    else for (int32_t k = 0; k < 4; k++) at[k] = (float)s->value(s->context, i + (k & 1), j + (k >> 1), w);
    return ((double)at[0] * (1 - fu) + (double)at[1] * fu) * (1 - fv) + ((double)at[2] * (1 - fu) + (double)at[3] * fu) * fv;
}

/* ---- how much the shape turns from slice to slice ---- */

static double likeness(const lathe_radius_map *map, int32_t apart, int32_t shift) {
    double sum = 0;
    int32_t every = map->slices / 8 + 1, rows = 0;
    for (int32_t row = 0; row + apart < map->slices; row += every, rows++) {
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
    return sum / rows;
}

/* Profiles farther and farther apart are laid over each other; each distance refines what the one before said. What is hardly more
 * alike when turned is straight. */
static int32_t estimate_turn(const lathe_radius_map *map) {
    static const double CLEARLY = 0.1;
    double turn = 0, gain = 0; /* turn: in rays for each slice */
    for (int32_t apart = 1; apart <= 16 && apart < map->slices; apart *= 2) {
        int32_t around = (int32_t)lround(turn * apart), reach = apart == 1 ? (int32_t)map->rays / 16 : 2, best = around;
        double most = -2;
        for (int32_t shift = around - reach; shift <= around + reach; shift++) {
            double l = likeness(map, apart, shift);
            if (l > most + 1e-9) most = l, best = shift;
        }
        turn = (double)best / apart;
        if (2 * apart > 16 || 2 * apart >= map->slices) gain = best ? most - likeness(map, apart, 0) : 0;
    }
    return gain > CLEARLY ? (int32_t)lround(turn * 65536 / map->rays) : 0;
}

/* ---- trying ---- */

enum { FINEST_STEP = 10, FINE_STEP = 20, USUAL_STEP = 30, COARSE_STEP = 52 };

typedef struct trial {
    lathe_radii truth;
    lathe_radius_estimate estimate;
    const lathe_reference *reference;
    lathe_arena *arena;        /* three: of a trial's maps, and two for scratch */
    double pixel, voxel;       /* pixel: in voxels; voxel: the smallest of its edges, mm */
    size_t borders, samples;   /* border edges of the mask; points of a measurement */
    double apart[LATHE_MAX_LEVELS];   /* what estimates leave out, squared: measured minus estimated */
    double spacing[3];         /* of u, v, w, mm */
    int64_t components, euler; /* of the mask's surface */
} trial;

typedef struct outcome {
    lathe_radii coded;         /* until the next trial; at any level */
    double rms[LATHE_MAX_LEVELS], most[LATHE_MAX_LEVELS];   /* voxels; by the estimate */
} outcome;

static int32_t put_number(void *coder, lathe_number_model *model, int32_t number) {
    lathe__put_number(coder, model, number);
    return number;
}

/* What a decoder would have, without its bytes. */
static int32_t keep_number(void *coder, lathe_number_model *model, int32_t number) {
    (void)coder, (void)model;
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

/* A number out of range: no such maps. */
static lathe_status no_map(lathe_status status) { return status == LATHE_ERR_FORMAT ? LATHE_ERR_EMPTY : status; }

/* Takes levels up to `last` over; errors are estimated from level `from` on. */
static lathe_status try_steps(outcome *out, trial *t, uint32_t from, uint32_t last) {
    lathe_status status = LATHE_OK;
    lathe__arena_reset(&t->arena[0]);
    out->coded = frame_of(t);
    for (uint32_t level = 0; !status && level <= last; level++) {
        status = lathe__radii_code(&out->coded, &t->truth, &t->arena[0], level, keep_number, NULL);
        for (uint32_t i = 0; !status && !level && i < out->coded.count; i++) out->coded.tubes[i].map.left = NULL;
        if (status || level < from) continue;
        status = lathe__estimate_error(&out->rms[level], &out->most[level], &t->estimate, &t->arena[1], &out->coded, level);
        out->rms[level] *= t->pixel;
        out->most[level] *= t->pixel;
    }
    return no_map(status);
}

/* Codes a level behind the ones before it; its bytes are added. */
static lathe_status add_bytes(size_t *bytes, lathe_radii *coded, trial *t, uint32_t level) {
    lathe_range_encoder e;
    lathe__encoder_start(&e);
    lathe_status status = lathe__radii_code(coded, &t->truth, &t->arena[0], level, put_number, &e);
    lathe__encoder_finish(&e);
    *bytes += e.size;
    if (!status && e.failed) status = LATHE_ERR_MEMORY;
    lathe__encoder_free(&e);
    return no_map(status);
}

/* Of levels up to one, without what stands around them. */
static lathe_status count_bytes(size_t *bytes, trial *t, uint32_t level) {
    lathe_radii coded = frame_of(t);
    lathe_status status = LATHE_OK;
    lathe__arena_reset(&t->arena[0]);
    *bytes = 0;
    for (uint32_t i = 0; !status && i <= level; i++) status = add_bytes(bytes, &coded, t, i);
    return status;
}

/* An estimate with what it leaves out; that is never taken for more than makes up for half of it. */
static double corrected(double rms, double apart) { return sqrt(fmax(rms * rms + apart, 0.25 * rms * rms)); }

static double expected(const trial *t, const outcome *o, uint32_t level, uint32_t measured) {
    return corrected(o->rms[level], t->apart[measured]);
}

/* What the estimate leaves out are caps and joints, and that it looks along rays: measured once, it is known for other steps, too. */
static lathe_status measure(bool *close, const outcome *o, trial *t, uint32_t level, size_t samples) {
    lathe_mesh mesh = {0};
    lathe_surface_counts counts = {0};
    double rms;
    bool within;
    uint32_t shown;
    lathe_radii coded = o->coded;
    lathe_status status = lathe__radii_mesh(&mesh, &t->arena[1], &coded, level, &counts, &shown);
    if (!status) status = lathe__reference_within(&within, &rms, t->reference, &mesh, samples, CLOSE_MAX * t->voxel);
    lathe_mesh_free(&mesh);
    if (status) return status;
    rms /= t->voxel;
    t->apart[level] = rms * rms - o->rms[level] * o->rms[level];
    *close = rms <= CLOSE_RMS && within;
    return LATHE_OK;
}

/* ---- the step that a level has ---- */

/* Steps of one level; each is tried once. */
typedef struct search {
    trial *t;
    uint32_t level;
    double rms[COARSE_STEP];   /* by the estimate; 0: not known yet */
    int32_t in_hand;           /* the step that `o` is of */
    outcome o;
} search;

static lathe_status try_step(search *s, int32_t step) {
    set_steps(&s->t->truth, step, 0, 0);
    lathe_status status = try_steps(&s->o, s->t, s->level, s->level);
    s->rms[step] = s->o.rms[s->level];
    s->in_hand = step;
    return status;
}

static double expected_of(const search *s, int32_t step) { return corrected(s->rms[step], s->t->apart[s->level]); }

/* Between two steps, the lower of which is good: where a line through the logarithms of their estimates meets the limit. Errors grow a
 * little slower than steps, eight of which double them. */
static int32_t next_guess(const search *s, int32_t low, int32_t high) {
    const double limit2 = CLOSE_RMS * CLOSE_RMS;
    double limit = sqrt(fmin(limit2 - s->t->apart[s->level], 4 * limit2)), slope = 0.1;   /* see corrected */
    double below = fmax(0, log2(limit / s->rms[low]));
    if (high < COARSE_STEP && s->rms[high] > 0) slope = fmax(1e-3, (below + log2(s->rms[high] / limit)) / (high - low));
    int32_t guess = low + (int32_t)lround(fmin(below / slope, high - low));
    return guess <= low ? low + 1 : guess >= high ? high - 1 : guess;
}

/* The coarsest step above `good` that is expected to leave the level close, below `bad`, which does not; or `good`. */
static lathe_status guess_step(int32_t *step, search *s, int32_t good, int32_t bad) {
    int32_t low = good, high = bad;
    for (int32_t i = good + 1; i < high; i++) {
        if (s->rms[i] <= 0) continue;
        if (expected_of(s, i) <= CLOSE_RMS) low = i;
        else high = i;
    }
    while (high - low > 1) {
        int32_t guess = next_guess(s, low, high);
        lathe_status status = try_step(s, guess);
        if (status) return status;
        *(expected_of(s, guess) <= CLOSE_RMS ? &low : &high) = guess;
    }
    *step = low;
    return LATHE_OK;
}

static lathe_status measure_step(bool *close, search *s, int32_t step) {
    lathe_status status = s->in_hand == step ? LATHE_OK : try_step(s, step);
    return status ? status : measure(close, &s->o, s->t, s->level, s->t->samples);
}

/* The coarsest step that leaves the level close, by measurement of where the search ends; a step that it refuses makes way for finer
 * ones. *good: the finest step, and whether that has been measured. */
static lathe_status search_step(int32_t *good, bool *sure, search *s, int32_t bad) {
    enum { MEASUREMENTS = 2 };
    static const double NEAR = 0.97;
    for (int count = 0; bad - *good > 1 && count < MEASUREMENTS; count++) {
        int32_t step;
        bool close;
        lathe_status status = guess_step(&step, s, *good, bad);
        if (!status && step == *good) break;
        if (!status) status = measure_step(&close, s, step);
        if (status) return status;
        *(close ? good : &bad) = step;
        *sure |= close;
        if (close && expected_of(s, step) > CLOSE_RMS * NEAR) break;
    }
    return *sure ? LATHE_OK : measure_step(sure, s, *good);
}

/* What a client has fetched when it has a level, more or less. */
static lathe_status cost_of(size_t *bytes, trial *t, uint32_t level, int32_t step) {
    enum { RECORD = 21 };
    set_steps(&t->truth, step, 0, 0);
    lathe_status status = count_bytes(bytes, t, level);
    *bytes += RECORD * level;
    return status;
}

static size_t samples_of(const lathe_radii *radii) {
    size_t samples = 0;
    for (uint32_t i = 0; i < radii->count; i++) samples += (size_t)radii->tubes[i].map.slices * radii->tubes[i].map.rays;
    return samples;
}

enum { MANY = 8000 };          /* coded radii: to measure a second level of so many takes longer than it is worth */

/* Is the level close with the fine step, with something to spare unless it is the last? What is far below the limit needs no measurement
 * now, nor does a small shape, of which a second level is looked at anyway: a single tube's error at the limit, squared, is about so much
 * of its estimate's square. What is chosen in the end has been measured. */
static lathe_status look_at(bool *close, bool *sure, const outcome *fine, trial *t, uint32_t level, bool last) {
    static const double FAR_BELOW = 0.7, CLEARLY = 0.98, SMALL = 0.75;
    bool small = !last && samples_of(&t->truth) <= MANY;
    double one_tube = (1 - 1 / SMALL) * CLOSE_RMS * CLOSE_RMS;
    lathe_status status = LATHE_OK;
    t->apart[level] = level && t->apart[level - 1] != 0 ? t->apart[level - 1] : small && t->truth.count == 1 ? one_tube : 0;
    *sure = false;
    *close = true;
    double rms = fmax(fine->rms[level], expected(t, fine, level, level));
    if (last || (!small && rms > CLOSE_RMS * FAR_BELOW)) {
        status = measure(close, fine, t, level, last ? t->samples : t->samples / 2);
        *sure = *close;
    }
    *close &= last || expected(t, fine, level, level) <= CLOSE_RMS * CLEARLY;
    return status;
}

typedef struct choice { uint32_t level; int32_t step; size_t bytes; } choice;

/* A level with its coarsest step, if that costs less than what has been found. */
static lathe_status choose_for_level(choice *best, trial *t, uint32_t level, int32_t start, double rms, int32_t bad, bool sure) {
    search s = {.t = t, .level = level};
    int32_t step = start;
    size_t bytes = 0;
    lathe_status status = LATHE_OK;
    s.rms[start] = rms;
    if (best->step) {
        status = guess_step(&step, &s, start, bad);
        if (!status) status = cost_of(&bytes, t, level, step);
        if (status || bytes >= best->bytes) return status;
        s.in_hand = 0, step = start;
    }
    status = search_step(&step, &sure, &s, bad);
    if (!status && sure) status = cost_of(&bytes, t, level, step);
    if (!status && sure && bytes < best->bytes) *best = (choice){level, step, bytes};
    return status;
}

/* The first level that a fine step brings close, with its coarsest step; if that is fine still, the one behind it may cost less. (To look
 * at the next level of every shape took a tenth of the planning of small ones and changed two archives of 27: 940 to 1175 B, 677 to 612.) */
static lathe_status choose_step(uint32_t *level, trial *t) {
    enum { STILL_FINE = FINE_STEP + 4 };
    static const double MISJUDGED = 1.3;
    outcome fine;
    choice best = {.bytes = SIZE_MAX};
    uint32_t last = t->truth.level_count - 1, taken = 0;
    int32_t start = FINE_STEP, bad = COARSE_STEP;
    set_steps(&t->truth, start, 0, 0);
    lathe_status status = try_steps(&fine, t, 0, last);
    if (!status && fine.rms[last] > CLOSE_RMS) {
        bad = start;
        set_steps(&t->truth, start = FINEST_STEP, 0, 0);
        status = try_steps(&fine, t, 0, last);
    }
    for (uint32_t i = 0; !status && i <= last && taken < 2 && best.step < STILL_FINE; i++) {
        bool close = true, sure = false;
        if (fine.rms[i] > CLOSE_RMS * MISJUDGED || (taken && samples_of(&t->truth) >> 2 * (last - i) > MANY)) continue;
        if (taken) t->apart[i] = t->apart[i - 1];   /* measured at the end of the search */
        else status = look_at(&close, &sure, &fine, t, i, i == last);
        if (status || !close) continue;
        taken++;
        status = choose_for_level(&best, t, i, start, fine.rms[i], bad, sure);
    }
    set_steps(&t->truth, best.step, 0, 0);
    *level = best.level;
    return status ? status : best.step ? LATHE_OK : LATHE_ERR_EMPTY;
}

/* ---- rays against slices ---- */

static void set_ahead(lathe_radii *truth, uint32_t ahead) {
    for (uint32_t i = 0; i < truth->count; i++) truth->tubes[i].map.ahead = ahead;
}

/* What a level costs that is about close, at a step that may be usual for it; it need not be known if it is clearly more than least. */
static lathe_status try_ahead(double *cost, trial *t, uint32_t ahead, int32_t step, double least) {
    enum { RECORD = 21 };
    static const double NEARLY = 1.3, CLEARLY_MORE = 1.1;
    lathe_radii coded = frame_of(t);
    double rms = INFINITY, most;
    size_t sum = 0;
    lathe_status status = LATHE_OK;
    *cost = INFINITY;
    set_ahead(&t->truth, ahead);
    set_steps(&t->truth, step, 0, 0);
    lathe__arena_reset(&t->arena[0]);
    for (uint32_t level = 0; level < t->truth.level_count && rms > CLOSE_RMS; level++) {
        status = add_bytes(&sum, &coded, t, level);
        sum += RECORD;
        if (status || (double)sum >= CLEARLY_MORE * least) break;
        status = lathe__estimate_error(&rms, &most, &t->estimate, &t->arena[1], &coded, level);
        if (status) break;
        rms *= t->pixel;
        double far = rms / CLOSE_RMS;
        if (far <= NEARLY) *cost = fmin(*cost, (double)sum * (far > 1 ? far : sqrt(far)));   /* the step will be another one */
    }
    return status;
}

/* Rays as dense as slices, denser, or all of them before any slice between the ends: what twists or is the same all along. By the step that
 * is usual, or by a fine one if that brings no level near. */
static lathe_status choose_ahead(trial *t) {
    static const uint32_t OTHERS[] = {LATHE_RADIUS_MOST_AHEAD, 1};
    static const double CLEARLY = 0.96;
    enum { EVERY = 5 };
    double least, cost;
    uint32_t best = 0;
    int32_t step = USUAL_STEP;
    t->estimate.every = EVERY;
    lathe_status status = try_ahead(&least, t, 0, step, INFINITY);
    if (!status && least >= INFINITY) status = try_ahead(&least, t, 0, step = FINE_STEP, INFINITY);
    for (size_t i = 0; !status && i < sizeof OTHERS / sizeof *OTHERS; i++) {
        status = try_ahead(&cost, t, OTHERS[i], step, least);
        if (cost < CLEARLY * least) least = cost, best = OTHERS[i];
    }
    t->estimate.every = 1;
    set_ahead(&t->truth, best);
    return status;
}

/* The slices that come early because something beside them is farther off than limit, pixels; how many. */
static int32_t mark_early(trial *t, uint32_t level, double limit) {
    lathe_radii *truth = &t->truth;
    int32_t half = (int32_t)1 << (truth->level_count - 2 - level), count = 0;
    memset(truth->early, 0, (size_t)truth->slices * sizeof *truth->early);
    for (uint32_t i = 0; i < truth->count; i++)
        for (int32_t row = 0, last = truth->tubes[i].map.slices - 1; row < last; row++) {
            if (t->estimate.tubes[i].worst[row] <= limit) continue;
            truth->early[truth->tubes[i].first + row / half * half] = true;
            if (row % half && row / half * half + half < last) truth->early[truth->tubes[i].first + row / half * half + half] = true;
        }
    for (int32_t w = 0; w < truth->slices; w++) count += truth->early[w];
    return count;
}

/* What sticks out between two slices of the close level is shown with it. Where that is all over the place, only the worst. */
static lathe_status choose_early(trial *t, uint32_t level) {
    static const double FEWER = 1.25;
    outcome o;
    if (level + 1 >= t->truth.level_count) return LATHE_OK;
    lathe_status status = try_steps(&o, t, level, level);
    if (status || o.most[level] <= EARLY_MAX) return status;
    int32_t count, most = (t->truth.slices >> (t->truth.level_count - 1 - level)) / 8 + 1;
    double limit = EARLY_MAX / t->pixel;
    while ((count = mark_early(t, level, limit)) > most) limit *= FEWER;
    t->truth.early_level = count ? level + 1 : 0;
    return LATHE_OK;
}

/* The step of the levels behind the close one: as coarse as errors then keep falling, down to what the last level may have. */
static lathe_status choose_fine_step(trial *t, uint32_t level) {
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
        status = try_steps(&o, t, o.rms[level] > 0 ? level + 1 : level, last);
        double rms = level == last ? CLOSE_RMS : MOST_RMS;
        bool within = !status && expected(t, &o, last, level) <= rms && o.most[last] <= MOST_MAX, falls = within;
        for (uint32_t k = level; k < last; k++) falls &= expected(t, &o, k + 1, level) <= STILL * expected(t, &o, k, level);
        good |= within;
        if (falls) kept = true, taken = t->truth.fine_step, high = i;
        else low = i;
        if (within && !kept) taken = t->truth.fine_step;
    }
    set_steps(&t->truth, step, level == last ? 0 : level + 1, taken);
    return status ? status : good ? LATHE_OK : LATHE_ERR_EMPTY;
}

/* ---- the surfaces ---- */

static bool sound(const lathe_mesh *mesh, int64_t components, int64_t euler) {
    lathe_mesh_report r;
    if (lathe__mesh_check(&r, mesh, false)) return false;
    return !r.boundary_edges && !r.nonmanifold_edges && !r.misoriented_edges && !r.nonmanifold_vertices && !r.degenerate_triangles &&
           !r.duplicate_positions && (int64_t)r.components == components && r.euler == euler;
}

static lathe_status outlines_fit(bool *good, trial *t, lathe_radii *coded, uint32_t level) {
    int32_t *slices;
    uint32_t shown, stride;
    lathe_status status = lathe__radii_slices(&slices, &shown, &stride, &t->arena[1], coded, level);
    for (uint32_t i = 0; !status && *good && i < shown; i++) {
        lathe_outline outline;
        status = lathe__radii_outline(&outline, &t->arena[1], coded, level, slices[i], stride, i);
        *good = !status && lathe__loops_fit(&outline);
    }
    lathe__arena_reset(&t->arena[1]);
    return status;
}

/* Slabs of plain tubes meet in outlines, which fit: within each of them, either tubes keep apart or it is looked at. */
static lathe_status joints_fit(bool *good, trial *t, lathe_radii *coded, uint32_t level) {
    lathe_mesh mesh = {0};
    lathe_mesh_report r;
    lathe_status status = lathe__radii_joints(&mesh, &t->arena[1], coded, level);
    if (!status) status = lathe__mesh_check(&r, &mesh, true);
    if (!status) *good = !r.self_intersections;
    lathe_mesh_free(&mesh);
    return status;
}

/* Of strips that turn, each alone: they meet in rings, which are stars, and caps lie beyond them. */
static lathe_status strips_fit(bool *good, trial *t, const lathe_mesh *mesh, uint32_t rays, uint32_t strips) {
    uint32_t(*triangles)[3] = lathe__arena_alloc(&t->arena[1], (size_t)2 * rays, sizeof *triangles);
    lathe_status status = triangles ? LATHE_OK : LATHE_ERR_MEMORY;
    for (uint32_t i = 0; !status && *good && i < strips; i++) {
        uint64_t found = 0;
        for (uint32_t k = 0; k < 6 * rays; k++) triangles[k / 3][k % 3] = mesh->triangles[(size_t)2 * rays * i + k / 3][k % 3] - rays * i;
        status = lathe__mesh_intersections(&found, &(lathe_mesh){2 * rays, 2 * rays, mesh->lattice + (size_t)rays * i, triangles});
        *good = !found;
    }
    lathe__arena_reset(&t->arena[1]);
    return status;
}

/* A single tube that does not turn is sound whatever it is. Else what has few triangles is checked for its topology, all of level 0 is;
 * strips that turn are looked at, and of plain tubes, which close whatever they are, all of which it is not known. */
static lathe_status check_level(bool *good, trial *t, lathe_radii *coded, uint32_t level) {
    enum { FEW = 3000 };
    lathe_surface_counts counts = {0};
    lathe_mesh mesh = {0};
    bool turned = coded->tubes[0].map.turn, tubes = coded->count > 1;
    uint32_t shown;
    lathe_status status = tubes ? outlines_fit(good, t, coded, level) : LATHE_OK;
    if (status || !*good || (!tubes && !turned)) return status;
    status = lathe__radii_mesh(&mesh, &t->arena[1], coded, level, &counts, &shown);
    bool few = !level || mesh.triangle_count <= FEW;
    if (!status) *good = (int64_t)mesh.vertex_count - mesh.triangle_count / 2 == t->euler && (!few || sound(&mesh, t->components, t->euler));
    if (!status && *good && few && turned) status = strips_fit(good, t, &mesh, counts.rays, shown - 1);
    lathe_mesh_free(&mesh);
    return !status && *good && tubes ? joints_fit(good, t, coded, level) : status;
}

/* Codes all levels; their bytes. */
static lathe_status check_levels(size_t *bytes, bool *good, trial *t) {
    lathe_radii coded = frame_of(t);
    lathe_status status = LATHE_OK;
    lathe__arena_reset(&t->arena[0]);
    *bytes = 0;
    *good = true;
    for (uint32_t level = 0; !status && *good && level < coded.level_count; level++) {
        status = add_bytes(bytes, &coded, t, level);
        if (!status) status = check_level(good, t, &coded, level);
    }
    return status;
}

/* Do the tubes go together at the first level? Cheaper to know than to find out in the end. */
static lathe_status try_joints(trial *t) {
    outcome o;
    bool good = true;
    if (!t->truth.plain) return LATHE_OK;
    set_steps(&t->truth, USUAL_STEP, 0, 0);
    lathe_status status = try_steps(&o, t, 1, 0);
    if (!status) status = check_level(&good, t, &o.coded, 0);
    return status ? status : good ? LATHE_OK : LATHE_ERR_EMPTY;
}

/* ---- from loops to maps ---- */

static lathe_status fit_tubes(lathe_radii *truth, lathe_arena *arena, lathe_arena *scratch, const lathe_traced_tubes *traced) {
    lathe_status status = LATHE_OK;
    truth->count = traced->count;
    truth->plain = truth->count > 1;
    truth->tubes = LATHE_NEW(arena, lathe_radius_tube, traced->count);
    if (!truth->tubes) return LATHE_ERR_MEMORY;
    memset(truth->tubes, 0, traced->count * sizeof *truth->tubes);
    for (uint32_t i = 0; !status && i < traced->count; i++) {
        const lathe_traced_tube *from = &traced->tubes[i];
        lathe_radius_tube *tube = &truth->tubes[i];
        double back;
        tube->first = from->first;
        tube->hole = from->hole;
        tube->map = (lathe_radius_map){.slices = from->rows, .level_count = lathe__tube_passes(from->rows, truth->level_count), .fall = FALL,
                                       .farthest = (truth->width + truth->height) * LATHE_RADIUS_ONE};
        status = lathe__radius_fit(&tube->map, arena, scratch, from->loops, &back);
        bool wide = traced->count > 1 && tube->map.rays > LATHE_TUBE_MOST_RAYS;
        if (!status && (back > MOST_BACK || wide)) status = LATHE_ERR_EMPTY;
    }
    return status;
}

static lathe_status follow(lathe_radius_tube *tube, lathe_arena *scratch, const lathe_grey *grey) {
    lathe_status status = lathe__radius_follow(&tube->map, scratch, tube->first, tube->hole, grey);
    lathe__arena_reset(scratch);
    return status;
}

/* Of a tube that turns, the rays that turn along, if that takes clearly fewer bytes at one step: their surface must be checked. */
static lathe_status turn_tube(trial *t, lathe_arena *arena, const lathe_traced_tubes *traced, int32_t turn) {
    lathe_radius_tube *tube = &t->truth.tubes[0];
    lathe_radius_map straight = tube->map;
    uint32_t last = t->truth.level_count - 1;
    size_t before, bytes;
    set_steps(&t->truth, FINE_STEP, 0, 0);
    lathe_status status = count_bytes(&before, t, last);
    if (!status) status = lathe__radius_turn(&tube->map, arena, traced->tubes[0].loops, turn);
    if (!status) status = count_bytes(&bytes, t, last);
    if (!status && bytes + before / 32 >= before) tube->map = straight;
    return status;
}

static lathe_status fit_maps(trial *t, lathe_structure_state *state, lathe_arena *scratch, const lathe_traced_tubes *traced,
                             const lathe_encode_source *source, double slice) {
    lathe_grey grey = {between_pixels, (void *)(uintptr_t)source, source->iso};
    lathe_status status = fit_tubes(&t->truth, &state->arena, scratch, traced);
    int32_t turn = status || traced->count > 1 ? 0 : estimate_turn(&t->truth.tubes[0].map);
    if (!status && turn) status = turn_tube(t, &state->arena, traced, turn);
    for (uint32_t i = 0; !status && i < t->truth.count; i++) status = follow(&t->truth.tubes[i], scratch, &grey);
    return status ? status : lathe__estimate_start(&t->estimate, &state->arena, &t->truth, slice);
}

/* The smoothest shapes' rasters cost a quarter of a bit for each border edge, and their first bytes more. */
static lathe_status earns_its_place(bool *good, size_t bytes, const trial *t, const lathe_structure_state *state) {
    size_t rasters = t->borders / 30 + 110;
    lathe_status status = LATHE_OK;
    if ((double)bytes > MOST_BYTES * (double)rasters) {
        size_t enough = (size_t)((double)bytes / MOST_BYTES) + 1;
        status = lathe__pyramid_cost(&rasters, &state->mask, t->spacing, enough);
    }
    *good = (double)bytes <= MOST_BYTES * (double)rasters;
    return status;
}

static lathe_status choose(trial *t, const lathe_structure_state *state) {
    uint32_t level = 0;
    size_t bytes = 0;
    bool good = true;
    lathe_topology all = {.components = 1, .euler = 1};
    lathe_status status = t->truth.count > 1 ? lathe__mask_topology(&all, &state->mask, NULL) : LATHE_OK;
    t->components = all.components + all.cavities;
    t->euler = 2 * all.euler;
    if (!status) status = choose_ahead(t);
    if (!status) status = try_joints(t);
    if (!status) status = choose_step(&level, t);
    if (!status) status = choose_early(t, level);
    if (!status) status = choose_fine_step(t, level);
    if (!status) status = check_levels(&bytes, &good, t);
    if (!status && good) status = earns_its_place(&good, bytes, t, state);
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
    t.borders = lathe__mask_borders(&state->mask);
    t.samples = t.borders < 4000 ? 400 : t.borders < 15000 ? t.borders / 10 : 1500;
    lathe_traced_tubes traced;
    lathe_arena loops = {0};
    t.truth.early = LATHE_NEW(&state->arena, bool, t.truth.slices);
    lathe_status status = t.truth.early ? lathe__radius_trace(&traced, &loops, &state->mask, state->fraction) : LATHE_ERR_MEMORY;
    if (!status) status = fit_maps(&t, state, &arena[0], &traced, source, mm[frame[2]] / pixel);
    lathe__arena_free(&loops);
    lathe_reference *own = NULL;
    if (!status && source->reference) status = source->reference(source->context, &t.reference);
    else if (!status) status = lathe__reference_build(&own, volume, axis, &state->mask, boundary, source->iso);
    if (own) t.reference = own;
    if (!status) status = choose(&t, state);
    lathe__reference_free(&own);
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
