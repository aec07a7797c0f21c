/* Casts rays at a loop [M 3.1]. The walk goes from vertex to vertex; a segment crosses the rays between the sectors of
 * its ends, on the way round on which it passes the centre, so the work is linear in points and crossings and nothing
 * is sorted.
 *
 * A vertex on a ray counts as to the ray's left (it opens the sector). A crossing in such a vertex is given as the
 * vertex itself: segment = its index, numerator = 0; segments never decrease along the result.
 *
 * IN-OUT is where the walk crosses a ray counter-clockwise: what lies on the left of the walk is then on the centre's
 * side. So for an outer loop around its centre, region on the left, axiom 1 holds as printed. A hole is walked
 * clockwise, region on the left: reverse its points first (and turn segment s into count - 1 - s where needed); then
 * IN-OUT reads "leaves the hole", and the same edge types and grammar hold.
 *
 * All values are exact. Coordinates hardly above 2^28: |p - centre| < 2^29, so doubled areas are < 2^60, numerators and
 * denominators (cross products with a direction of length 2^14) < 2^46. */
#include "contour.h"

enum { MAX_COORDINATE = (LATHE_MAX_DIM + 2) * LATHE_LATTICE_ONE };
static const uint64_t MAX_CROSSINGS = UINT32_MAX / 8;

typedef struct vector {
    int64_t x, y;
} vector;
typedef struct hit {
    uint64_t reach, divisor;
    uint32_t segment;
} hit; /* radius = reach / divisor lengths of the direction */

static int64_t cross(vector a, vector b) { return a.x * b.y - a.y * b.x; }
static uint64_t magnitude(int64_t v) { return (uint64_t)(v < 0 ? -v : v); }
static vector from(lathe_point centre, lathe_point p) {
    return (vector){(int64_t)p.x - centre.x, (int64_t)p.y - centre.y};
}
static bool small_enough(lathe_point p) {
    return p.x > -MAX_COORDINATE && p.x < MAX_COORDINATE && p.y > -MAX_COORDINATE && p.y < MAX_COORDINATE;
}

/* By continued fractions, which end after one or two steps for all but near ties. */
int lathe__compare_fractions(uint64_t a, uint64_t b, uint64_t c, uint64_t d) {
    for (int sign = 1;; sign = -sign) {
        uint64_t left = a / b, right = c / d;
        if (left != right) return left < right ? -sign : sign;
        a -= left * b;
        c -= right * d;
        if (!a || !c) return a == c ? 0 : a ? sign : -sign;
        uint64_t swap = a;
        a = b, b = swap;
        swap = c;
        c = d, d = swap;
    }
}

/* How many rays a segment crosses: positive counter-clockwise. Through the centre counts as counter-clockwise. */
static int32_t rays_passed(vector p, vector q, uint32_t sector_p, uint32_t sector_q, uint32_t rays) {
    if (sector_p == sector_q) return 0;
    if (cross(p, q) >= 0) return (int32_t)((sector_q - sector_p) & (rays - 1));
    return -(int32_t)((sector_p - sector_q) & (rays - 1));
}

/* Whether b, the next crossing of the walk on the ray of a, is further out. Both in one vertex (the tip of a spike
 * whose right flank the ray just misses): the walk turns towards the centre by a left turn. */
static bool further_out(const hit *a, const hit *b, const lathe_point *points, uint32_t count) {
    int order = lathe__compare_fractions(a->reach, a->divisor, b->reach, b->divisor);
    if (order) return order < 0;
    vector along_a = from(points[a->segment], points[(a->segment + 1) % count]);
    vector along_b = from(points[b->segment], points[(b->segment + 1) % count]);
    return cross(along_a, along_b) < 0;
}

/* One cast: what stays the same from segment to segment, and the last crossing found. */
typedef struct cast {
    const lathe_point *points;
    uint32_t point_count, rays, found;
    lathe_point centre;
    lathe_crossing *crossings;
    hit first, last;
} cast;

/* Whether the previous crossing is followed by one further out; types need it only between crossings of one ray. */
static bool next_is_outward(const cast *c, const lathe_crossing *a, const hit *at_a, const lathe_crossing *b,
                            const hit *at_b) {
    return a->ray == b->ray && further_out(at_a, at_b, c->points, c->point_count);
}

static void add_crossing(cast *c, uint32_t segment, vector p, vector q, uint32_t ray, bool in_out) {
    lathe_point d = lathe__ray_direction(ray, c->rays);
    vector direction = {d.x, d.y};
    uint64_t before = magnitude(cross(direction, p)), divisor = before + magnitude(cross(direction, q));
    hit here = {magnitude(cross(p, q)), divisor, segment};
    /* A segment through the centre: all its crossings are given at its start. */
    if (!here.reach) before = 0, divisor = here.divisor = 1;
    lathe_crossing *out = &c->crossings[c->found];
    *out = (lathe_crossing){segment, ray, in_out, false, (int64_t)before, (int64_t)divisor};
    if (before == divisor) {
        out->segment = segment + 1; /* == point_count: put right at the end of the cast */
        out->numerator = 0;
    }
    if (c->found++)
        out[-1].outward = next_is_outward(c, &out[-1], &c->last, out, &here);
    else
        c->first = here;
    c->last = here;
}

static void cross_rays(cast *c, uint32_t segment, uint32_t sector_p, uint32_t sector_q) {
    vector p = from(c->centre, c->points[segment]), q = from(c->centre, c->points[(segment + 1) % c->point_count]);
    int32_t passed = rays_passed(p, q, sector_p, sector_q, c->rays);
    for (int32_t k = 0; k < passed; k++)
        add_crossing(c, segment, p, q, (sector_p + 1 + (uint32_t)k) & (c->rays - 1), true);
    for (int32_t k = 0; k > passed; k--)
        add_crossing(c, segment, p, q, (sector_p + (uint32_t)k) & (c->rays - 1), false);
}

/* A crossing in vertex 0 that the last segment found belongs to the front, where a place is kept for it. There is only
 * one: the directions differ. */
static void wrap_last(cast *c) {
    if (!c->found || c->crossings[c->found - 1].segment < c->point_count) return;
    lathe_crossing moved = c->crossings[c->found - 1];
    moved.segment = 0;
    *--c->crossings = moved;
}

/* Fills sectors and sums up the crossings, so that the result is allocated once. */
static lathe_status count_crossings(uint64_t *total, uint32_t *sectors, const cast *c) {
    uint64_t sum = 0;
    for (uint32_t i = 0; i < c->point_count; i++) {
        if (!small_enough(c->points[i])) return LATHE_ERR_RANGE;
        vector p = from(c->centre, c->points[i]);
        sectors[i] = lathe__ray_sector(p.x, p.y, c->rays);
    }
    for (uint32_t i = 0; i < c->point_count; i++) {
        uint32_t next = i + 1 < c->point_count ? i + 1 : 0;
        if (sectors[i] == sectors[next]) continue;
        vector p = from(c->centre, c->points[i]), q = from(c->centre, c->points[next]);
        int32_t passed = rays_passed(p, q, sectors[i], sectors[next], c->rays);
        sum += (uint64_t)(passed < 0 ? -passed : passed);
    }
    *total = sum;
    return sum > MAX_CROSSINGS ? LATHE_ERR_LIMIT : LATHE_OK;
}

/* RANGE: rays not a power of two in 4..65536, coordinates not below 4098 pixels. LIMIT: more than 2^29 crossings. */
lathe_status lathe__cast_rays(lathe_crossing **out, uint32_t *count, lathe_arena *arena, const lathe_point *points,
                              uint32_t point_count, lathe_point centre, uint32_t rays) {
    if (rays < 4 || rays > 65536 || (rays & (rays - 1)) || !small_enough(centre)) return LATHE_ERR_RANGE;
    cast c = {.points = points, .point_count = point_count, .rays = rays, .centre = centre};
    uint32_t *sectors = LATHE_NEW(arena, uint32_t, point_count);
    if (!sectors) return LATHE_ERR_MEMORY;
    uint64_t total;
    lathe_status status = count_crossings(&total, sectors, &c);
    if (status) return status;
    c.crossings = LATHE_NEW(arena, lathe_crossing, total + 1);
    if (!c.crossings) return LATHE_ERR_MEMORY;
    c.crossings++; /* see wrap_last */
    for (uint32_t i = 0; i < point_count; i++) {
        uint32_t next = i + 1 < point_count ? i + 1 : 0;
        if (sectors[i] != sectors[next]) cross_rays(&c, i, sectors[i], sectors[next]);
    }
    if (c.found) {
        lathe_crossing *last = &c.crossings[c.found - 1];
        last->outward = next_is_outward(&c, last, &c.last, &c.crossings[0], &c.first);
    }
    wrap_last(&c);
    *out = c.crossings;
    *count = c.found;
    return LATHE_OK;
}
