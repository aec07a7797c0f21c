/* Casting one ray more at a contour (see contour_edit.h).
 *
 * Between two neighbouring crossings all points of the loop lie in one sector, from ray i (counted to it) to ray i +
 * 1, less than half a turn wide: on which side of the new ray a point lies is the sign of one cross product. The edges
 * in that sector are those that leave the IN-OUT crossings of ray i (f, o) and the OUT-IN crossings of ray i + 1 (b,
 * i). */
#include "contour_edit.h"
#include <stdlib.h>
#include <string.h>

#define NONE UINT32_MAX
static const uint32_t MOST = UINT32_MAX / 8;

typedef struct vector {
    int64_t x, y;
} vector;
static int64_t cross(vector a, vector b) { return a.x * b.y - a.y * b.x; }
static uint64_t magnitude(int64_t v) { return v < 0 ? -(uint64_t)v : (uint64_t)v; }
static vector from_centre(const lathe_edit_contour *c, uint32_t point) {
    const lathe_point *p = &c->cast[point < c->point_count ? point : point - c->point_count];
    return (vector){(int64_t)p->x - c->centre.x, (int64_t)p->y - c->centre.y};
}
static vector direction_at(uint32_t angle) {
    lathe_point d = lathe__ray_direction(angle, 65536);
    return (vector){d.x, d.y};
}

static bool grow(void **array, uint32_t *capacity, uint32_t want, size_t size) {
    if (want <= *capacity && *array) return true;
    uint32_t more = *capacity + *capacity / 2 + 64;
    if (more < want) more = want;
    void *p = realloc(*array, more * size);
    if (!p) return false;
    *array = p;
    *capacity = more;
    return true;
}
static bool grow_crossings(lathe_edit_contour *c, uint32_t want) {
    void *p = c->crossings;
    bool ok = grow(&p, &c->capacity, want, sizeof *c->crossings);
    c->crossings = p;
    return ok;
}
static bool grow_rays(lathe_edit_contour *c, uint32_t want) {
    void *p = c->rays;
    bool ok = grow(&p, &c->ray_capacity, want, sizeof *c->rays);
    c->rays = p;
    return ok;
}
static bool grow_refined(lathe_edit_contour *c, uint32_t want) {
    void *p = c->refined;
    bool ok = grow(&p, &c->refined_capacity, want, sizeof *c->refined);
    c->refined = p;
    return ok;
}

/* ---- one crossing ---- */

/* As lathe__cast_rays orders them: by distance; both in one vertex: by the turn of the walk. */
static bool further_out(const lathe_edit_contour *c, const lathe_edit_crossing *a, const lathe_edit_crossing *b) {
    int order = lathe__compare_fractions(a->reach, a->divisor, b->reach, b->divisor);
    if (order) return order < 0;
    vector p = from_centre(c, a->cast_segment), q = from_centre(c, a->cast_segment + 1);
    vector r = from_centre(c, b->cast_segment), s = from_centre(c, b->cast_segment + 1);
    return cross((vector){q.x - p.x, q.y - p.y}, (vector){s.x - r.x, s.y - r.y}) < 0;
}
static uint8_t type_of(const lathe_edit_crossing *a, const lathe_edit_crossing *b) {
    if (a->at.ray != b->at.ray) return a->at.in_out ? LATHE_FOR : LATHE_BACK;
    if (a->at.in_out) return a->at.outward ? LATHE_UP_O : LATHE_DOWN_I;
    return a->at.outward ? LATHE_UP_I : LATHE_DOWN_O;
}
/* What depends on both ends of the edge that begins at crossing i. */
static void settle_edge(lathe_edit_contour *c, uint32_t i) {
    lathe_edit_crossing *a = &c->crossings[i], *b = &c->crossings[a->next];
    a->at.outward = a->at.ray == b->at.ray && further_out(c, a, b);
    a->type = type_of(a, b);
}

/* false: the loop passes through the centre. */
static bool place(lathe_edit_contour *c, lathe_edit_crossing *x, vector direction) {
    vector p = from_centre(c, x->cast_segment), q = from_centre(c, x->cast_segment + 1);
    uint64_t before = magnitude(cross(direction, p));
    x->reach = magnitude(cross(p, q));
    x->divisor = before + magnitude(cross(direction, q));
    if (!x->reach) return false;
    x->at.segment = x->cast_segment;
    x->at.numerator = (int64_t)before;
    x->at.denominator = (int64_t)x->divisor;
    if (before == x->divisor) {
        x->at.segment = x->cast_segment + 1 < c->point_count ? x->cast_segment + 1 : 0;
        x->at.numerator = 0;
    }
    x->point = lathe__crossing_point(&x->radius, &x->at, c->loop, c->point_count, c->centre);
    return true;
}

/* ---- the contour at its first rays ---- */

/* All crossings of a segment through the centre are given at its start. */
static bool through_centre(const lathe_edit_contour *c, const lathe_crossing *x) {
    return !x->numerator && x->denominator == 1 && !cross(from_centre(c, x->segment), from_centre(c, x->segment + 1));
}
/* A crossing counter-clockwise in a vertex was found on the segment that ends there. */
static uint32_t segment_of(const lathe_edit_contour *c, const lathe_crossing *x) {
    if (x->numerator || !x->in_out) return x->segment;
    return x->segment ? x->segment - 1 : c->point_count - 1;
}
static lathe_status take_crossings(lathe_edit_contour *c, const lathe_crossing *found, uint32_t count, uint32_t step) {
    if (!grow_crossings(c, count)) return LATHE_ERR_MEMORY;
    for (uint32_t i = 0; i < count; i++) {
        if (through_centre(c, &found[i])) return LATHE_ERR_FORMAT;
        lathe_edit_crossing *x = &c->crossings[i];
        *x = (lathe_edit_crossing){.at = found[i],
                                   .next = i + 1 < count ? i + 1 : 0,
                                   .beside = c->rays[found[i].ray].first,
                                   .cast_segment = segment_of(c, &found[i]),
                                   .split_by = NONE};
        c->rays[x->at.ray].first = i;
        if (!place(c, x, direction_at(x->at.ray * step))) return LATHE_ERR_FORMAT;
    }
    c->count = count;
    for (uint32_t i = 0; i < count; i++) settle_edge(c, i);
    return LATHE_OK;
}
static lathe_status open_contour(lathe_edit_contour *c, lathe_arena *scratch, uint32_t rays) {
    lathe_crossing *found;
    uint32_t count;
    lathe_tree tree;
    lathe_status status = lathe__turn_loop(&c->cast, &c->arena, c->loop, c->point_count, c->centre, c->turn);
    if (!status) status = lathe__cast_rays(&found, &count, scratch, c->cast, c->point_count, c->centre, rays);
    if (status) return status;
    for (uint32_t i = 0; i < c->point_count; i++)
        if (c->cast[i].x == c->centre.x && c->cast[i].y == c->centre.y) return LATHE_ERR_FORMAT;
    uint8_t *types = LATHE_NEW(scratch, uint8_t, count);
    if (!types || !grow_rays(c, rays)) return LATHE_ERR_MEMORY;
    /* Neighbours more than one ray apart do not go round the centre as contours do. */
    if (lathe__classify_edges(types, found, count, rays)) return LATHE_ERR_FORMAT;
    status = lathe__parse_contour(&tree, scratch, found, types, count, rays);
    if (status) return status;
    c->ray_count = rays;
    for (uint32_t i = 0; i < rays; i++)
        c->rays[i] = (lathe_edit_ray){i * (65536 / rays), NONE, i + 1 < rays ? i + 1 : 0, i ? i - 1 : rays - 1};
    return take_crossings(c, found, count, 65536 / rays);
}
lathe_status lathe__edit_contour_open(lathe_edit_contour *out, const lathe_point *loop, uint32_t count,
                                      lathe_point centre, uint32_t rays, uint32_t turn) {
    if (count < 3 || count > MOST || rays < 4) return LATHE_ERR_RANGE;
    lathe_edit_contour c = {.loop = loop, .point_count = count, .turn = turn & 65535, .centre = centre};
    lathe_arena scratch = {0};
    lathe_status status = open_contour(&c, &scratch, rays);
    lathe__arena_free(&scratch);
    if (status)
        lathe__edit_contour_close(&c);
    else
        *out = c;
    return status;
}
void lathe__edit_contour_close(lathe_edit_contour *contour) {
    free(contour->rays);
    free(contour->crossings);
    free(contour->refined);
    lathe__arena_free(&contour->arena);
    *contour = (lathe_edit_contour){0};
}

/* ---- one ray more ---- */

typedef struct insertion {
    lathe_edit_contour *contour;
    uint32_t ray;
    vector direction;
    uint32_t last, next; /* of the edge in hand: the crossing that a new one follows, the one that it led to */
    bool wraps;          /* the edge in hand leads past the loop's first point */
    lathe_status status;
} insertion;

static void add_crossing(insertion *in, uint32_t segment, bool in_out) {
    lathe_edit_contour *c = in->contour;
    if (c->count >= MOST)
        in->status = LATHE_ERR_LIMIT;
    else if (!grow_crossings(c, c->count + 1))
        in->status = LATHE_ERR_MEMORY;
    if (in->status) return;
    bool behind = segment >= c->point_count;
    lathe_edit_crossing *x = &c->crossings[c->count];
    *x = (lathe_edit_crossing){.at = {.ray = in->ray, .in_out = in_out},
                               .next = in->next,
                               .beside = c->rays[in->ray].first,
                               .cast_segment = behind ? segment - c->point_count : segment,
                               .split_by = NONE};
    if (!place(c, x, in->direction)) {
        in->status = LATHE_ERR_FORMAT;
        return;
    }
    if (in->wraps && (behind || x->at.segment < x->cast_segment)) {
        c->head = c->count;
        in->wraps = false;
    }
    c->rays[in->ray].first = c->count;
    c->crossings[in->last].next = c->count;
    in->last = c->count++;
}

/* Follows the loop along an edge; left: whether its ends lie to the left of the new ray. */
static void split_edge(insertion *in, uint32_t edge, bool left, bool ends_left) {
    lathe_edit_contour *c = in->contour;
    uint32_t next = c->crossings[edge].next, segment = c->crossings[edge].cast_segment, first = c->count;
    uint32_t steps = (c->crossings[next].cast_segment + c->point_count - segment) % c->point_count;
    uint8_t type = c->crossings[edge].type;
    in->last = edge;
    in->next = next;
    in->wraps = next == c->head;
    for (uint32_t k = 0; k < steps && !in->status; k++, segment++) {
        bool side = cross(in->direction, from_centre(c, segment + 1)) >= 0;
        if (side != left) add_crossing(in, segment, side);
        left = side;
    }
    if (left != ends_left && !in->status) add_crossing(in, segment, ends_left);
    if (in->status) return;
    uint32_t added = c->count - first;
    c->counts.edges[type][!added ? LATHE_SPLIT_NONE : added <= 2 ? LATHE_SPLIT_SIMPLE : LATHE_SPLIT_GENERAL]++;
    if (!added) return;
    if (!grow_refined(c, c->refined_count + 1)) {
        in->status = LATHE_ERR_MEMORY;
        return;
    }
    c->refined[c->refined_count++] = edge;
    c->crossings[edge].split_by = in->ray;
    c->crossings[edge].split_first = first;
    c->crossings[edge].split_count = added;
    settle_edge(c, edge);
    for (uint32_t i = first; i < c->count; i++) settle_edge(c, i);
}

/* Where a ray's sector ends: a full turn, not 0. */
static uint32_t end_of_sector(const lathe_edit_contour *c, uint32_t ray) {
    uint32_t end = c->rays[c->rays[ray].next].angle;
    return end ? end : 65536;
}
uint32_t lathe__edit_middle_angle(const lathe_edit_contour *contour, uint32_t after) {
    uint32_t angle = contour->rays[after].angle, width = end_of_sector(contour, after) - angle;
    return width < 2 ? 0 : angle + width / 2;
}

lathe_status lathe__edit_insert_ray(lathe_edit_contour *contour, uint32_t after, uint32_t angle) {
    lathe_edit_contour *c = contour;
    if (after >= c->ray_count) return LATHE_ERR_RANGE;
    uint32_t next = c->rays[after].next, ray = c->ray_count;
    if (angle <= c->rays[after].angle || angle >= end_of_sector(c, after)) return LATHE_ERR_RANGE;
    if (!grow_rays(c, ray + 1)) return LATHE_ERR_MEMORY;
    c->rays[ray] = (lathe_edit_ray){angle, NONE, next, after};
    c->rays[after].next = c->rays[next].before = ray;
    c->ray_count++;
    c->refined_count = 0;
    insertion in = {.contour = c, .ray = ray, .direction = direction_at(angle), .status = LATHE_OK};
    for (uint32_t i = c->rays[after].first; i != NONE && !in.status; i = c->crossings[i].beside)
        if (c->crossings[i].at.in_out) split_edge(&in, i, false, c->crossings[i].type == LATHE_FOR);
    for (uint32_t i = c->rays[next].first; i != NONE && !in.status; i = c->crossings[i].beside)
        if (!c->crossings[i].at.in_out) split_edge(&in, i, true, c->crossings[i].type != LATHE_BACK);
    return in.status;
}

/* ---- export ---- */

lathe_status lathe__edit_export(lathe_ray_contour *out, uint32_t **ids, lathe_arena *arena,
                                const lathe_edit_contour *contour) {
    const lathe_edit_contour *c = contour;
    lathe_ray_contour r = {.centre = c->centre, .rays = c->ray_count, .turn = c->turn, .count = c->count};
    uint32_t *rank = LATHE_NEW(arena, uint32_t, c->ray_count), *order = LATHE_NEW(arena, uint32_t, c->count);
    r.crossings = LATHE_NEW(arena, lathe_crossing, c->count);
    r.points = LATHE_NEW(arena, lathe_point, c->count);
    r.radius = LATHE_NEW(arena, int64_t, c->count);
    r.types = LATHE_NEW(arena, uint8_t, c->count);
    if (!rank || !order || !r.crossings || !r.points || !r.radius || !r.types) return LATHE_ERR_MEMORY;
    for (uint32_t ray = 0, k = 0; k < c->ray_count; k++, ray = c->rays[ray].next) rank[ray] = k;
    for (uint32_t i = c->head, k = 0; k < c->count; k++, i = c->crossings[i].next) {
        const lathe_edit_crossing *x = &c->crossings[i];
        order[k] = i;
        r.crossings[k] = x->at;
        r.crossings[k].ray = rank[x->at.ray];
        r.points[k] = x->point;
        r.radius[k] = x->radius;
        r.types[k] = x->type;
    }
    *out = r;
    if (ids) *ids = order;
    return LATHE_OK;
}
