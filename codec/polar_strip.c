/* See polar_strip.h. */
#include "polar_strip.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

static const uint32_t MAGIC = 0x3153504c; /* "LPS1" */
static uint32_t steps_of(uint32_t bits) { return bits == 16 ? 21845 : 1u << 22; }

/* ---- from rays and radii to a contour ---- */

static int32_t on_lattice(double v) {
    const double most = (LATHE_MAX_DIM + 2) * (double)LATHE_LATTICE_ONE;
    return (int32_t)lround(v > most ? most : v < -most ? -most : v);
}
static void set_vertex(lathe_polar_contour *p, const lathe_polar_stack *s, uint32_t i) {
    lathe_ray_contour *c = &p->contour;
    double direction[2], radius = ((double)p->steps[i] + 0.5) * s->farthest / steps_of(s->bits);
    lathe__ray_vector(direction, c->crossings[i].ray, c->rays, c->turn);
    c->points[i] =
        (lathe_point){on_lattice(c->centre.x + radius * direction[0]), on_lattice(c->centre.y + radius * direction[1])};
    c->radius[i] = llround(radius);
}
/* Rays and steps are there: everything else follows. Crossings leave the region and come back in turn with every edge
 * along a ray. */
static lathe_status settle_contour(lathe_polar_contour *p, const lathe_polar_stack *s, lathe_arena *arena) {
    lathe_ray_contour *c = &p->contour;
    lathe_tree tree;
    bool in_out = true;
    for (uint32_t i = 0; i < c->count; i++) {
        uint32_t next = i + 1 < c->count ? i + 1 : 0;
        bool along = c->crossings[i].ray == c->crossings[next].ray;
        c->crossings[i].segment = i;
        c->crossings[i].numerator = 0;
        c->crossings[i].denominator = 1;
        c->crossings[i].in_out = in_out;
        c->crossings[i].outward = along && p->steps[next] > p->steps[i];
        if (along) in_out = !in_out;
        set_vertex(p, s, i);
    }
    if (!in_out || lathe__classify_edges(c->types, c->crossings, c->count, c->rays)) return LATHE_ERR_FORMAT;
    return lathe__parse_contour(&tree, arena, c->crossings, c->types, c->count, c->rays);
}
static lathe_status make_room(lathe_polar_contour *p, lathe_arena *arena, uint32_t count) {
    lathe_ray_contour *c = &p->contour;
    c->count = count;
    c->crossings = LATHE_NEW(arena, lathe_crossing, count);
    c->points = LATHE_NEW(arena, lathe_point, count);
    c->radius = LATHE_NEW(arena, int64_t, count);
    c->types = LATHE_NEW(arena, uint8_t, count);
    p->steps = LATHE_NEW(arena, uint32_t, count);
    return c->crossings && c->points && c->radius && c->types && p->steps ? LATHE_OK : LATHE_ERR_MEMORY;
}

/* ---- quantising ---- */

static lathe_status quantise_contour(lathe_polar_contour *out, lathe_polar_stack *s, lathe_arena *arena,
                                     const lathe_ray_contour *from) {
    uint32_t start = 0, most = steps_of(s->bits);
    while (start < from->count && (from->crossings[start].ray || !from->crossings[start].in_out)) start++;
    if (start == from->count) return LATHE_ERR_FORMAT;
    out->contour = (lathe_ray_contour){.centre = from->centre, .rays = from->rays, .turn = from->turn & 65535};
    lathe_status status = make_room(out, arena, from->count);
    if (status) return status;
    for (uint32_t i = 0; i < from->count; i++) {
        uint32_t k = start + i < from->count ? start + i : start + i - from->count;
        int64_t r = from->radius[k] * (int64_t)most / s->farthest;
        out->steps[i] = (uint32_t)(r < most ? r : most - 1);
        out->contour.crossings[i].ray = from->crossings[k].ray;
    }
    return settle_contour(out, s, arena);
}
lathe_status lathe__polar_quantise(lathe_polar_stack *out, lathe_arena *arena, const lathe_ray_contour *contours,
                                   const int32_t *heights, uint32_t count, uint32_t bits) {
    if (!count || (bits != 16 && bits != 32)) return LATHE_ERR_RANGE;
    lathe_polar_stack s = {.count = count, .rays = contours[0].rays, .bits = bits, .farthest = 1};
    if (s.rays < 4 || s.rays > 65536 || (s.rays & (s.rays - 1))) return LATHE_ERR_RANGE;
    uint64_t edges = 0;
    for (uint32_t k = 0; k < count; k++) {
        if (contours[k].rays != s.rays) return LATHE_ERR_RANGE;
        edges += contours[k].count;
        for (uint32_t i = 0; i < contours[k].count; i++)
            if (contours[k].radius[i] >= s.farthest)
                s.farthest = contours[k].radius[i] < INT32_MAX ? (uint32_t)contours[k].radius[i] + 1 : INT32_MAX;
    }
    if (edges > LATHE_POLAR_MOST_EDGES) return LATHE_ERR_LIMIT;
    s.contours = LATHE_NEW(arena, lathe_polar_contour, count);
    if (!s.contours) return LATHE_ERR_MEMORY;
    for (uint32_t k = 0; k < count; k++) {
        s.contours[k] = (lathe_polar_contour){.height = heights[k]};
        lathe_status status = quantise_contour(&s.contours[k], &s, arena, &contours[k]);
        if (status) return status;
    }
    *out = s;
    return LATHE_OK;
}

/* ---- bytes ---- */

size_t lathe__polar_size(const lathe_polar_stack *stack) {
    size_t size = LATHE_POLAR_HEAD;
    for (uint32_t k = 0; k < stack->count; k++)
        size += LATHE_POLAR_CONTOUR_HEAD + (size_t)stack->contours[k].contour.count * (stack->bits / 8);
    return size;
}
static void put(uint8_t **at, uint32_t value, int size) {
    for (int i = 0; i < size; i++, value >>= 8) *(*at)++ = (uint8_t)value;
}
static uint32_t get(const uint8_t **at, int size) {
    uint32_t value = 0;
    for (int i = 0; i < size; i++) value |= (uint32_t) * (*at)++ << (8 * i);
    return value;
}
/* -1, 0 or 1: the way round from one ray to the next vertex's. */
static int ray_step(const lathe_ray_contour *c, uint32_t i) {
    uint32_t from = c->crossings[i ? i - 1 : c->count - 1].ray, to = c->crossings[i].ray;
    return from == to ? 0 : to == (from + 1 < c->rays ? from + 1 : 0) ? 1 : -1;
}
static uint32_t float_word(int a, uint32_t r) {
    float value = (float)a + (float)r / (float)steps_of(32);
    uint32_t word;
    memcpy(&word, &value, sizeof word);
    return word;
}
static void put_value(uint8_t **at, int a, uint32_t r, uint32_t bits) {
    if (bits == 16)
        put(at, (uint32_t)(a + 1) * steps_of(16) + r, 2);
    else
        put(at, float_word(a, r), 4);
}
/* false: no value that put_value writes. */
static bool get_value(const uint8_t **at, int *a, uint32_t *r, uint32_t bits) {
    if (bits == 16) {
        uint32_t word = get(at, 2);
        *a = (int)(word / steps_of(16)) - 1;
        *r = word % steps_of(16);
        return *a <= 1;
    }
    uint32_t word = get(at, 4);
    float value;
    memcpy(&value, &word, sizeof value);
    if (!(value >= -1 && value < 2)) return false;
    float base = floorf(value), scaled = (value - base) * (float)steps_of(32);
    *a = (int)base;
    *r = (uint32_t)scaled;
    return *r < steps_of(32) && float_word(*a, *r) == word;
}

void lathe__polar_encode(uint8_t *bytes, const lathe_polar_stack *stack) {
    uint8_t *at = bytes;
    uint32_t log2 = 0;
    while (1u << log2 < stack->rays) log2++;
    put(&at, MAGIC, 4);
    put(&at, stack->bits, 1);
    put(&at, log2, 1);
    put(&at, 0, 2);
    put(&at, stack->count, 4);
    put(&at, stack->farthest, 4);
    put(&at, 0, 4);
    for (uint32_t k = 0; k < stack->count; k++) {
        const lathe_polar_contour *p = &stack->contours[k];
        const lathe_ray_contour *c = &p->contour;
        put(&at, (uint32_t)c->centre.x, 4);
        put(&at, (uint32_t)c->centre.y, 4);
        put(&at, (uint32_t)p->height, 4);
        put(&at, c->turn, 2);
        put(&at, 0, 2);
        put(&at, c->count, 4);
        for (uint32_t i = 0; i < c->count; i++) put_value(&at, ray_step(c, i), p->steps[i], stack->bits);
    }
}

static bool small_enough(int32_t v) {
    return v > -(LATHE_MAX_DIM + 2) * LATHE_LATTICE_ONE && v < (LATHE_MAX_DIM + 2) * LATHE_LATTICE_ONE;
}
static lathe_status decode_contour(lathe_polar_contour *p, const lathe_polar_stack *s, lathe_arena *arena,
                                   const uint8_t **at, const uint8_t *end) {
    if (end - *at < LATHE_POLAR_CONTOUR_HEAD) return LATHE_ERR_FORMAT;
    lathe_ray_contour *c = &p->contour;
    *p = (lathe_polar_contour){0};
    c->rays = s->rays;
    c->centre.x = (int32_t)get(at, 4);
    c->centre.y = (int32_t)get(at, 4);
    p->height = (int32_t)get(at, 4);
    c->turn = get(at, 2);
    uint32_t zero = get(at, 2), count = get(at, 4), first_step = 0, ray = 0;
    if (zero || !small_enough(c->centre.x) || !small_enough(c->centre.y) || !small_enough(p->height))
        return LATHE_ERR_FORMAT;
    if (count < s->rays || count > (size_t)(end - *at) / (s->bits / 8)) return LATHE_ERR_FORMAT;
    lathe_status status = make_room(p, arena, count);
    if (status) return status;
    for (uint32_t i = 0; i < count; i++) {
        int a;
        if (!get_value(at, &a, &p->steps[i], s->bits)) return LATHE_ERR_FORMAT;
        if (i)
            ray = (ray + (uint32_t)a) & (s->rays - 1);
        else
            first_step = (uint32_t)a;
        c->crossings[i].ray = ray;
    }
    /* The way round must close. */
    if (((ray + first_step) & (s->rays - 1)) != 0) return LATHE_ERR_FORMAT;
    return settle_contour(p, s, arena);
}
lathe_status lathe__polar_decode(lathe_polar_stack *out, lathe_arena *arena, const uint8_t *bytes, size_t size) {
    if (size < LATHE_POLAR_HEAD) return LATHE_ERR_FORMAT;
    const uint8_t *at = bytes, *end = bytes + size;
    lathe_polar_stack s = {0};
    if (get(&at, 4) != MAGIC) return LATHE_ERR_FORMAT;
    s.bits = get(&at, 1);
    uint32_t log2 = get(&at, 1), zero = get(&at, 2);
    s.count = get(&at, 4);
    s.farthest = get(&at, 4);
    zero |= get(&at, 4);
    if ((s.bits != 16 && s.bits != 32) || log2 < 2 || log2 > 16 || zero || !s.farthest || s.farthest > INT32_MAX)
        return LATHE_ERR_FORMAT;
    s.rays = 1u << log2;
    size_t least = LATHE_POLAR_CONTOUR_HEAD + (size_t)s.rays * (s.bits / 8);
    if (!s.count || s.count > (size - LATHE_POLAR_HEAD) / least) return LATHE_ERR_FORMAT;
    s.contours = LATHE_NEW(arena, lathe_polar_contour, s.count);
    if (!s.contours) return LATHE_ERR_MEMORY;
    for (uint32_t k = 0; k < s.count; k++) {
        lathe_status status = decode_contour(&s.contours[k], &s, arena, &at, end);
        if (status) return status;
        if (k && s.contours[k].height <= s.contours[k - 1].height) return LATHE_ERR_FORMAT;
    }
    if (at != end) return LATHE_ERR_FORMAT;
    *out = s;
    return LATHE_OK;
}

/* ---- the surface ---- */

static double gap(lathe_point p, lathe_point q) { return hypot((double)p.x - q.x, (double)p.y - q.y); }
static void add(lathe_mesh *m, uint32_t a, uint32_t b, uint32_t c) {
    uint32_t *t = m->triangles[m->triangle_count++];
    t[0] = a, t[1] = b, t[2] = c;
}
static lathe_status add_strip(lathe_mesh *m, lathe_arena *scratch, const lathe_ray_contour *a,
                              const lathe_ray_contour *b, uint32_t first) {
    lathe_tiling tiling;
    lathe__arena_reset(scratch);
    lathe_status status = lathe__tile_trees(&tiling, scratch, a, b);
    if (status) return status;
    uint32_t i = tiling.start[0], j = tiling.start[1], second = first + a->count;
    for (uint32_t k = 0; k < tiling.count; k++) {
        uint32_t ni = i + 1 < a->count ? i + 1 : 0, nj = j + 1 < b->count ? j + 1 : 0;
        uint8_t step = tiling.steps[k];
        if (step == 3 && gap(a->points[i], b->points[nj]) < gap(a->points[ni], b->points[j])) {
            add(m, first + i, first + ni, second + nj);
            add(m, first + i, second + nj, second + j);
        } else {
            if (step & 1) add(m, first + i, first + ni, second + j);
            if (step & 2) add(m, first + (step & 1 ? ni : i), second + nj, second + j);
        }
        if (step & 1) i = ni;
        if (step & 2) j = nj;
    }
    return LATHE_OK;
}
lathe_status lathe__polar_mesh(lathe_mesh *out, const lathe_polar_stack *stack) {
    lathe_mesh m = {0};
    lathe_arena scratch = {0};
    lathe_status status = LATHE_OK;
    size_t edges = 0;
    for (uint32_t k = 0; k < stack->count; k++) edges += stack->contours[k].contour.count;
    if (edges > LATHE_POLAR_MOST_EDGES) return LATHE_ERR_LIMIT;
    m.lattice = malloc(edges * sizeof *m.lattice);
    m.triangles = malloc(2 * edges * sizeof *m.triangles);
    if (!m.lattice || !m.triangles) status = LATHE_ERR_MEMORY;
    for (uint32_t k = 0, first = 0; k < stack->count && !status; k++) {
        const lathe_ray_contour *c = &stack->contours[k].contour;
        for (uint32_t i = 0; i < c->count; i++) {
            int32_t *at = m.lattice[m.vertex_count++];
            at[0] = c->points[i].x, at[1] = c->points[i].y, at[2] = stack->contours[k].height;
        }
        if (k + 1 < stack->count) status = add_strip(&m, &scratch, c, &stack->contours[k + 1].contour, first);
        first += c->count;
    }
    lathe__arena_free(&scratch);
    if (status)
        lathe_mesh_free(&m);
    else
        *out = m;
    return status;
}
