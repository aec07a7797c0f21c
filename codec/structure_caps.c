/* Caps follow the grey values: for each cell of a single outline at the last level, the shape that comes nearest to where the
 * values interpolate to the threshold between its slice and the next. */
#include <math.h>
#include <stdlib.h>
#include "structure_encode.h"

void lathe__cap_list_free(lathe_cap_list *list) {
    free(list->list);
    free(list->squares);
    *list = (lathe_cap_list){.list = NULL};
}

static uint32_t replay(lathe_caps *caps, const lathe_mesh *mesh, uint32_t vertices, uint32_t side) {
    lathe_cap_list *l = (lathe_cap_list *)caps;
    (void)mesh, (void)vertices, (void)side;
    return l->next < l->count ? l->list[l->next++].shape : 0;
}

static uint32_t record(lathe_caps *caps, const lathe_mesh *mesh, uint32_t vertices, uint32_t side) {
    lathe_cap_list *l = (lathe_cap_list *)caps;
    if (l->count == l->capacity) {
        uint32_t capacity = l->capacity * 2 + 64;
        struct lathe_cap *more = realloc(l->list, capacity * sizeof *more);
        l->failed |= !more;
        if (!more) return 0;
        l->list = more;
        l->capacity = capacity;
    }
    l->list[l->count++] = (struct lathe_cap){mesh->vertex_count, vertices, (uint8_t)side, 0};
    return 0;
}

static void record_chord(lathe_caps *caps, int64_t square) {
    lathe_cap_list *l = (lathe_cap_list *)caps;
    if (l->square_count == l->square_capacity) {
        size_t capacity = l->square_capacity * 2 + 64;
        int64_t *more = realloc(l->squares, capacity * sizeof *more);
        l->failed |= !more;
        if (!more) return;
        l->squares = more;
        l->square_capacity = capacity;
    }
    l->squares[l->square_count++] = square;
}

static double interpolate(const lathe_encode_source *source, double u, double v, int32_t w) {
    int32_t x = (int32_t)floor(u), y = (int32_t)floor(v);
    double a = u - x, b = v - y;
    return (source->value(source->context, x, y, w) * (1 - a) + source->value(source->context, x + 1, y, w) * a) * (1 - b) +
           (source->value(source->context, x, y + 1, w) * (1 - a) + source->value(source->context, x + 1, y + 1, w) * a) * b;
}

/* How far above (or below) its slice the surface lies, in slice distances; from 0 to 1. */
static double wanted_rise(const lathe_encode_source *source, const int32_t at[3], int32_t slice, uint32_t side) {
    double u = at[0] / (double)LATHE_LATTICE_ONE, v = at[1] / (double)LATHE_LATTICE_ONE;
    double inside = interpolate(source, u, v, slice) - source->iso;
    double outside = interpolate(source, u, v, side ? slice - 1 : slice + 1) - source->iso;
    return inside <= 0 ? 0 : outside >= 0 ? 1 : inside / (inside - outside);
}

/* The slice that a cap stands on. It rises from it by less than one. */
static int32_t slice_of(const int32_t at[3], uint32_t side) {
    return side ? (at[2] + LATHE_LATTICE_ONE - 1) >> LATHE_LATTICE_BITS : at[2] >> LATHE_LATTICE_BITS;
}

/* A shape other than that of the cap before must be worth its bits. squares: of the cap's chords. */
static void choose_shape(struct lathe_cap *cap, const lathe_mesh *mesh, const int64_t *squares, uint32_t before,
                         const lathe_encode_source *source) {
    enum { SHAPES = 8 };
    static const double WORTH = 0.0005;
    double error[SHAPES] = {0};
    for (uint32_t k = 0; k < cap->vertices; k++) {
        const int32_t *at = mesh->lattice[cap->first + k];
        double wanted = wanted_rise(source, at, slice_of(at, cap->side), cap->side);
        for (uint32_t s = 0; s < SHAPES; s++) {
            double off = lathe__cap_rise(s, squares[k]) / (double)LATHE_LATTICE_ONE - wanted;
            error[s] += off * off + (s == before ? 0 : WORTH);
        }
    }
    for (uint32_t s = 0; s < SHAPES; s++)
        if (error[s] < error[cap->shape]) cap->shape = (uint8_t)s;
}

/* Puts the vertices of a cap where its shape says. */
static void apply_shape(const struct lathe_cap *cap, lathe_mesh *mesh, const int64_t *squares) {
    for (uint32_t k = 0; k < cap->vertices; k++) {
        int32_t *at = mesh->lattice[cap->first + k], slice = slice_of(at, cap->side) * LATHE_LATTICE_ONE;
        int32_t rise = lathe__cap_rise(cap->shape, squares[k]);
        at[2] = cap->side ? slice - rise : slice + rise;
    }
}

lathe_status lathe__choose_caps(lathe_baked_structure *out, lathe_structure_state *state, lathe_arena arena[2],
                                const lathe_encode_source *source) {
    lathe_cap_list *l = &out->caps;
    uint32_t shown;
    state->level = (int32_t)state->plan.level_count - 1;
    state->caps = &l->caps;
    l->caps = (lathe_caps){record, record_chord};
    lathe_status status = lathe__state_mesh(&out->last, arena, state, &out->last_counts, &shown);
    if (!status && l->failed) status = LATHE_ERR_MEMORY;
    const int64_t *squares = l->squares;
    for (uint32_t i = 0, before = 0; !status && i < l->count; before = l->list[i].shape, squares += l->list[i].vertices, i++) {
        choose_shape(&l->list[i], &out->last, squares, before, source);
        apply_shape(&l->list[i], &out->last, squares);
    }
    state->caps = NULL;
    l->caps = (lathe_caps){replay, NULL};
    return status;
}

void lathe__encode_caps(lathe_range_encoder *e, const lathe_cap_list *list) {
    lathe_number_model models[LATHE_CAP_MODELS];
    lathe__number_start(models, LATHE_CAP_MODELS, LATHE_NUMBER_START);
    for (uint32_t i = 0; i < list->count; i++)
        lathe__put_number(e, &models[lathe__cap_context(list->list[i].vertices)], 7 - list->list[i].shape);
}
