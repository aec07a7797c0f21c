/* Boundary-edge chain code [M 3.1]: border edges are visited with the region on the left. */
#include "outline.h"
#include <string.h>

enum { EAST, NORTH, WEST, SOUTH };
static const int STEP_U[4] = {1, 0, -1, 0}, STEP_V[4] = {0, 1, 0, -1};
/* How far a dent reaches beyond the square's centre in slices of even and of odd order: about 1/16 pixel; twice an odd number, so
 * that no line through two vertices of the other slice can meet it. */
static const int32_t DENT[2] = {4098, 5122};

typedef struct tracer {
    const lathe_slice_view *view;
    uint64_t *seen;            /* horizontal border edges already walked: bit u of row v is the edge (u, v)-(u + 1, v) */
    lathe_outline *out;
    int32_t *border;
    size_t border_count;       /* border edges walked so far: the index into fractions */
} tracer;

static bool inside(const uint64_t *slice, const lathe_slice_view *view, int32_t u, int32_t v) {
    return slice && lathe__slice_pixel(slice, view->row_words, u, v);
}

/* In this neighbour, is the border edge the other way round: outside at (u, v), inside at (ou, ov)? */
static bool exchanged(const uint64_t *slice, const lathe_slice_view *view, int32_t u, int32_t v, int32_t ou, int32_t ov) {
    return slice && !lathe__slice_pixel(slice, view->row_words, u, v) && lathe__slice_pixel(slice, view->row_words, ou, ov);
}

static void add_point(tracer *t, int32_t x, int32_t y, int32_t border) {
    uint32_t i = t->out->point_count++;
    t->out->points[i] = (lathe_point){x, y};
    if (t->border) t->border[i] = border;
}

static void add_border(tracer *t, int32_t u, int32_t v, int direction) {
    const lathe_slice_view *view = t->view;
    int32_t ou = u + STEP_U[direction], ov = v + STEP_V[direction];
    size_t index = t->border_count++;
    int fraction = view->fractions && index < view->fraction_count ? view->fractions[index] : view->fraction;
    if (fraction < LATHE_FRACTION_MIN) fraction = LATHE_FRACTION_MIN;
    if (fraction > LATHE_FRACTION_MAX) fraction = LATHE_FRACTION_MAX;
    if (fraction > 28 && (exchanged(view->below, view, u, v, ou, ov) || exchanged(view->above, view, u, v, ou, ov))) fraction = 28;
    fraction = (fraction & ~1) - (view->parity & 1);
    int32_t offset = fraction * (1 << LATHE_FRACTION_BITS);
    add_point(t, u * LATHE_LATTICE_ONE + STEP_U[direction] * offset, v * LATHE_LATTICE_ONE + STEP_V[direction] * offset,
              (v * view->width + u) * 4 + direction);
}

/* A square that lacks only (ou, ov); (au, av) is opposite. Does this neighbour lack only the opposite corner? */
static bool opposite(const uint64_t *slice, const lathe_slice_view *view, int32_t u, int32_t v, int32_t bu, int32_t bv, int32_t ou,
                     int32_t ov, int32_t au, int32_t av) {
    return inside(slice, view, u, v) && inside(slice, view, bu, bv) && inside(slice, view, ou, ov) && !inside(slice, view, au, av);
}

static lathe_status walk(tracer *t, int32_t u0, int32_t v0, int direction0) {
    const lathe_slice_view *view = t->view;
    lathe_loop *loop = &t->out->loops[t->out->loop_count++];
    *loop = (lathe_loop){.first = t->out->point_count};
    int32_t u = u0, v = v0;
    int d = direction0;
    int64_t turn = 0;
    do {
        if (d == EAST) t->seen[(size_t)v * (size_t)view->row_words + ((uint32_t)u >> 6)] |= (uint64_t)1 << (u & 63);
        if (d == WEST) t->seen[(size_t)v * (size_t)view->row_words + ((uint32_t)(u - 1) >> 6)] |= (uint64_t)1 << ((u - 1) & 63);
        add_border(t, u, v, d);
        int ahead = (d + 1) & 3;
        int32_t au = u + STEP_U[ahead], av = v + STEP_V[ahead];
        if (!lathe__slice_pixel(view->pixels, view->row_words, au, av)) {
            d = ahead;
            turn++;
            continue;
        }
        int32_t ou = u + STEP_U[d], ov = v + STEP_V[d], bu = au + STEP_U[d], bv = av + STEP_V[d];
        if (!lathe__slice_pixel(view->pixels, view->row_words, bu, bv)) {
            u = au;
            v = av;
            continue;
        }
        if (opposite(view->below, view, u, v, bu, bv, ou, ov, au, av) || opposite(view->above, view, u, v, bu, bv, ou, ov, au, av)) {
            int32_t half = LATHE_LATTICE_ONE / 2, dent = DENT[view->parity & 1];
            add_point(t, (au + ou) * half + (au - ou) * dent, (av + ov) * half + (av - ov) * dent, LATHE_NO_BORDER);
        }
        u = bu;
        v = bv;
        d = (d + 3) & 3;
        turn--;
    } while (u != u0 || v != v0 || d != direction0);
    loop->count = t->out->point_count - loop->first;
    loop->hole = turn < 0;
    return LATHE_OK;
}

size_t lathe__count_borders(const lathe_slice_view *view) {
    size_t count = 0, words = (size_t)view->row_words;
    for (int32_t v = 0; v + 1 < view->height; v++) {
        const uint64_t *row = view->pixels + (size_t)v * words;
        for (size_t i = 0; i < words; i++) {
            uint64_t next = lathe__row_next(row, i, words);
            count += (size_t)__builtin_popcountll(row[i] ^ next) + (size_t)__builtin_popcountll(row[i] ^ row[i + words]);
        }
    }
    return count;
}

size_t lathe__mask_borders(const lathe_mask *mask) {
    size_t borders = 0;
    for (int32_t w = 0; w < mask->size[2]; w++)
        borders += lathe__count_borders(&(lathe_slice_view){.pixels = lathe__mask_slice(mask, w), .width = mask->size[0], .height = mask->size[1],
                                                            .row_words = mask->row_words});
    return borders;
}

lathe_status lathe__trace_outline(lathe_outline *out, int32_t **border, lathe_arena *arena, const lathe_slice_view *view) {
    size_t words = (size_t)view->row_words, borders = lathe__count_borders(view);
    *out = (lathe_outline){0};
    if (border) *border = NULL;
    if (borders == 0) return LATHE_OK;
    if (borders > UINT32_MAX / 4) return LATHE_ERR_LIMIT;
    tracer t = {.view = view, .out = out};
    if (border && !(t.border = *border = LATHE_NEW(arena, int32_t, borders * 2))) return LATHE_ERR_MEMORY;
    /* Dents at most double the points; a loop has at least four border edges. What is not used is given back. */
    size_t most_loops = borders / 4 + 1, room = borders * 2 * sizeof *out->points + most_loops * sizeof *out->loops;
    out->points = lathe__arena_alloc(arena, 1, room + words * (size_t)view->height * sizeof *t.seen + sizeof *t.seen);
    if (!out->points) return LATHE_ERR_MEMORY;
    out->loops = (lathe_loop *)(out->points + borders * 2);
    t.seen = (uint64_t *)((char *)out->points + (room + sizeof *t.seen - 1) / sizeof *t.seen * sizeof *t.seen);
    memset(t.seen, 0, words * (size_t)view->height * sizeof *t.seen);
    for (int32_t v = 0; v < view->height; v++) {
        const uint64_t *row = view->pixels + (size_t)v * words;
        for (size_t i = 0; i < words; i++) {
            uint64_t next = lathe__row_next(row, i, words), change;
            while ((change = (row[i] ^ next) & ~t.seen[(size_t)v * words + i]) != 0) {
                int32_t u = (int32_t)(i * 64) + __builtin_ctzll(change);
                bool left = lathe__slice_pixel(view->pixels, view->row_words, u, v);
                lathe_status status = walk(&t, left ? u : u + 1, v, left ? EAST : WEST);
                if (status) return status;
            }
        }
    }
    out->loops = memmove(out->points + out->point_count, out->loops, out->loop_count * sizeof *out->loops);
    lathe__arena_shrink(arena, out->points, out->point_count * sizeof *out->points + out->loop_count * sizeof *out->loops);
    return LATHE_OK;
}
