/* Caps follow the grey values: for each cell of a single outline at the last level, the shape that comes nearest to where the
 * values interpolate to the threshold between its slice and the next. */
#include <math.h>
#include <stdlib.h>
#include "structure_encode.h"

void lathe__cap_list_free(lathe_cap_list *list) {
    free(list->list);
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
    return l->next;   /* the shape that is tried on all caps */
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

enum { SHAPES = 8, STEEP = 4, FLAT = 7 };

/* The rise of each shape, from the rises of the steepest and the flattest paraboloid: one of them is not clamped, if any is. */
static void all_rises(double rise[SHAPES], double steep, double flat) {
    static const double LEAST = LATHE_RISE_MIN / (double)LATHE_LATTICE_ONE, MOST = LATHE_RISE_MAX / (double)LATHE_LATTICE_ONE;
    double square = steep < MOST ? steep * 2 : flat * 128;
    for (int s = 0; s < SHAPES; s++) {
        double bow = ldexp(square, 7 - 2 * s);
        rise[s] = s < STEEP ? (2 * s + 1) / 8.0 : bow < LEAST ? LEAST : bow > MOST ? MOST : bow;
    }
}

static double rise_over(const int32_t at[3], int32_t slice) { return fabs(at[2] / (double)LATHE_LATTICE_ONE - slice); }

/* A shape other than that of the cap before must be worth its bits. */
static void choose_shapes(lathe_cap_list *l, const lathe_mesh *steep, const lathe_mesh *flat, const lathe_encode_source *source) {
    static const double WORTH = 0.0005;
    uint32_t before = 0;
    for (uint32_t i = 0; i < l->count; i++) {
        struct lathe_cap *cap = &l->list[i];
        double error[SHAPES] = {0}, rise[SHAPES];
        for (uint32_t k = cap->first; k < cap->first + cap->vertices; k++) {
            int32_t slice = slice_of(steep->lattice[k], cap->side);
            double wanted = wanted_rise(source, steep->lattice[k], slice, cap->side);
            all_rises(rise, rise_over(steep->lattice[k], slice), rise_over(flat->lattice[k], slice));
            for (uint32_t s = 0; s < SHAPES; s++) error[s] += (rise[s] - wanted) * (rise[s] - wanted) + (s == before ? 0 : WORTH);
        }
        for (uint32_t s = 0; s < SHAPES; s++)
            if (error[s] < error[cap->shape]) cap->shape = (uint8_t)s;
        before = cap->shape;
    }
}

static lathe_status build_all_as(lathe_mesh *mesh, lathe_cap_list *out, lathe_structure_state *state, lathe_arena arena[2],
                                 uint32_t shape) {
    lathe_surface_counts counts;
    uint32_t shown;
    out->count = 0;
    out->next = shape;
    lathe_status status = lathe__state_mesh(mesh, arena, state, &counts, &shown);
    return out->failed ? LATHE_ERR_MEMORY : status;
}

lathe_status lathe__choose_caps(lathe_cap_list *out, lathe_structure_state *state, lathe_arena arena[2],
                                const lathe_encode_source *source) {
    lathe_mesh steep = {0}, flat = {0};
    state->level = (int32_t)state->plan.level_count - 1;
    state->caps = &out->caps;
    out->caps.shape = record;
    lathe_status status = build_all_as(&steep, out, state, arena, STEEP);
    if (!status) status = build_all_as(&flat, out, state, arena, FLAT);
    if (!status) choose_shapes(out, &steep, &flat, source);
    lathe_mesh_free(&steep);
    lathe_mesh_free(&flat);
    state->caps = NULL;
    out->caps.shape = replay;
    return status;
}

void lathe__encode_caps(lathe_range_encoder *e, const lathe_cap_list *list) {
    lathe_number_model models[LATHE_CAP_MODELS];
    lathe__number_start(models, LATHE_CAP_MODELS, LATHE_NUMBER_START);
    for (uint32_t i = 0; i < list->count; i++)
        lathe__put_number(e, &models[lathe__cap_context(list->list[i].vertices)], 7 - list->list[i].shape);
}
