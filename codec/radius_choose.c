/* Is a structure better off as a radius map? If it is a ball to topology and every slice one star-shaped loop, maps are tried with
 * coarser and finer steps; the coarsest that stays within the error is taken, if it costs clearly less than slices would. */
#include <math.h>
#include <string.h>
#include "mesh.h"
#include "structure_encode.h"

/* In voxels: at most this far off by RMS and anywhere. */
static const double MOST_RMS = 0.215, MOST_MAX = 1.0;
/* Of the bytes that slices cost. A map is not exact, so it must earn its place. */
static const double MOST_BYTES = 0.75;

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
    for (int32_t row = 0; row + apart < map->slices; row++) {
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
    const lathe_structure_state *state;
    lathe_arena *arena;        /* a map and its surface at a time */
    const lathe_reference *reference;
    double voxel;              /* mm */
} trial;

static int32_t put_number(void *coder, lathe_number_model *model, int32_t number) {
    lathe__put_number(coder, model, number);
    return number;
}

static bool sound(const lathe_mesh *mesh) {
    lathe_mesh_report r;
    if (lathe__mesh_check(&r, mesh, true)) return false;
    return !r.boundary_edges && !r.nonmanifold_edges && !r.misoriented_edges && !r.nonmanifold_vertices && !r.degenerate_triangles &&
           !r.duplicate_positions && !r.self_intersections && r.components == 1 && r.euler == 2;
}

/* Codes all levels with a step; the surface of the last one, its error and, if asked for, the soundness of every level's. */
static lathe_status try_step(size_t *bytes, bool *good, const trial *t, const lathe_radius_map *truth, bool check) {
    lathe_radius_map map;
    lathe_status status = LATHE_OK;
    *good = true;
    *bytes = 0;
    for (uint32_t level = 0; !status && *good && level < truth->level_count; level++) {
        lathe_range_encoder e;
        bool last = level + 1 == truth->level_count;
        lathe__encoder_start(&e);
        lathe_number_coder coder = {put_number, &e, truth};
        if (!level) status = lathe__radius_head(&map, t->state, t->arena, &coder);
        if (!status) status = lathe__radius_walk(&map, level, &coder);
        lathe__encoder_finish(&e);
        *bytes += e.size;
        if (e.failed) status = LATHE_ERR_MEMORY;
        lathe__encoder_free(&e);
        lathe_mesh mesh = {0};
        if (!status && (check || last)) status = lathe__radius_mesh(&mesh, &map, level);
        if (!status && check) *good = sound(&mesh);
        if (!status && last && !check) {
            lathe_metrics m;
            status = lathe__reference_measure(&m, t->reference, &mesh, 4000);
            *good = !status && m.rms_mm <= MOST_RMS * t->voxel && m.max_mm <= MOST_MAX * t->voxel;
        }
        lathe_mesh_free(&mesh);
    }
    lathe__arena_reset(t->arena);
    if (status == LATHE_ERR_FORMAT) *good = false, status = LATHE_OK;   /* a radius out of range */
    return status;
}

/* The coarsest step that is within the error, by halving; *bytes is 0 if the finest is not, or a surface is flawed. Most structures
 * that are no stars fail with the finest, which is tried first. */
static lathe_status try_steps(size_t *bytes, const trial *t, lathe_radius_map *truth) {
    static const double STEPS[] = {0.35, 0.5, 0.7, 0.9, 1.2, 1.6, 2, 2.5, 3.2, 4};
    int good = -1, bad = sizeof STEPS / sizeof *STEPS, k = 0;
    lathe_status status = LATHE_OK;
    bool fits = true;
    for (; !status && good + 1 < bad; k = (good + bad) / 2) {
        truth->step = (int32_t)(STEPS[k] * LATHE_RADIUS_ONE);
        status = try_step(bytes, &fits, t, truth, false);
        *(fits ? &good : &bad) = k;
        if (!fits && !k) break;
    }
    *bytes = 0;
    if (status || good < 0) return status;
    truth->step = (int32_t)(STEPS[good] * LATHE_RADIUS_ONE);
    status = try_step(bytes, &fits, t, truth, true);
    if (!fits) *bytes = 0;
    return status;
}

/* What slices would cost, coded alone. */
static lathe_status cost_of_slices(size_t *bytes, const lathe_structure_state *state, lathe_arena arena[2], const lathe_encode_source *source) {
    lathe_structure_state alone = *state;
    lathe_baked_structure packets = {.level_count = state->plan.level_count};
    lathe_models models = {.widest = {3, 3}};
    lathe_status status = LATHE_OK;
    *bytes = 0;
    alone.flags = state->flags & ~(uint32_t)LATHE_FLAG_SHARED;
    alone.arena = (lathe_arena){0};   /* what is in the other one stays */
    for (uint32_t level = 0; !status && level < packets.level_count; level++) {
        status = lathe__structure_encode_level(&packets, &alone, arena, &models, level, source);
        *bytes += packets.packets[level].size;
    }
    lathe__baked_free(&packets);
    lathe__state_drop_occupancy(&alone);
    lathe__arena_free(&alone.arena);
    lathe__occupancy_free(&models.occupancy);
    return status;
}

static lathe_status fit(lathe_radius_map *truth, lathe_structure_state *state, lathe_arena *scratch, const lathe_encode_source *source,
                        int32_t turn) {
    lathe_grey grey = {between_pixels, (void *)(uintptr_t)source, source->iso};
    return lathe__radius_fit(truth, &state->arena, scratch, &state->mask, state->fraction, source->value ? &grey : NULL,
                             state->plan.level_count, turn);
}

lathe_status lathe__choose_radii(lathe_baked_structure *out, lathe_structure_state *state, lathe_arena arena[2], const lathe_volume *volume,
                                 lathe_axis axis, lathe_boundary boundary, const lathe_encode_source *source) {
    lathe_topology topology;
    lathe_radius_map maps[2];
    size_t bytes[2] = {0, 0}, slices;
    /* The staircase of a label is not smooth: maps of labels cost more than slices. */
    if (state->flags & (LATHE_FLAG_EXACT | LATHE_FLAG_KEEP) || boundary == LATHE_BOUNDARY_EDGE) return LATHE_OK;
    lathe_status status = lathe__mask_topology(&topology, &state->mask, NULL);
    if (status || topology.components != 1 || topology.cavities || topology.euler != 1) return status;
    status = fit(&maps[0], state, &arena[0], source, 0);
    lathe__arena_reset(&arena[0]);
    if (status) return status == LATHE_ERR_EMPTY || status == LATHE_ERR_LIMIT ? LATHE_OK : status;
    int32_t turn = estimate_turn(&maps[0]);
    lathe_reference *reference = NULL;
    status = lathe__reference_build(&reference, volume, axis, &state->mask, boundary, source->iso);
    const double *mm = volume->spacing;
    trial t = {.state = state, .arena = &arena[1], .reference = reference, .voxel = fmin(mm[0], fmin(mm[1], mm[2]))};
    if (!status) status = try_steps(&bytes[0], &t, &maps[0]);
    if (!status && turn) status = fit(&maps[1], state, &arena[0], source, turn);
    lathe__arena_reset(&arena[0]);
    if (!status && turn) status = try_steps(&bytes[1], &t, &maps[1]);
    lathe__reference_free(&reference);
    int best = bytes[1] && (!bytes[0] || bytes[1] < bytes[0]);
    if (status || !bytes[best]) return status;
    status = cost_of_slices(&slices, state, arena, source);
    if (status || (double)bytes[best] > MOST_BYTES * (double)slices) return status;
    lathe_radius_map *kept = LATHE_NEW(&state->arena, lathe_radius_map, 2);
    if (!kept) return LATHE_ERR_MEMORY;
    kept[0] = maps[best];
    state->radii = &kept[1];
    out->truth = &kept[0];
    for (uint32_t level = 0; level < out->level_count; level++) {
        out->levels[level].components = 1;
        out->levels[level].components_waiting = 0;
        out->levels[level].waiting_mm3 = 0;
    }
    return LATHE_OK;
}
