/* The centre by area medians. Counting pixels would need the region; the loop's own trapezoids give the same halves,
 * to the lattice, and do so for polygons that have left the pixels behind. The medians of 97 % of C shapes lie
 * outside, so the second half of this file is not a corner case. */
#include "centre.h"

enum { MAX_COORDINATE = (LATHE_MAX_DIM + 2) * LATHE_LATTICE_ONE, COLUMN_TRIES = 16 };

typedef struct vertex {
    int32_t along, height;
} vertex; /* the median is sought along; trapezoids have heights */
typedef struct loop_view {
    const lathe_point *points;
    uint32_t count;
    bool rows;
} loop_view;

static vertex vertex_at(const loop_view *loop, uint32_t i) {
    lathe_point p = loop->points[i < loop->count ? i : i - loop->count];
    return loop->rows ? (vertex){p.y, p.x} : (vertex){p.x, p.y};
}

/* Height of the segment a-b above `along`, rounded down; a.along != b.along. */
static int32_t height_at(vertex a, vertex b, int32_t along) {
    int64_t run = (int64_t)b.along - a.along, rise = ((int64_t)b.height - a.height) * ((int64_t)along - a.along);
    if (run < 0) run = -run, rise = -rise;
    int64_t quotient = rise / run;
    return (int32_t)(a.height + quotient - (rise % run < 0));
}

/* Twice the signed area under the part of a-b before `limit`. Unsigned: partial sums may wrap, sums round the loop do
 * not. */
static uint64_t area_before(vertex a, vertex b, int32_t limit) {
    if (a.along >= limit && b.along >= limit) return 0;
    if (a.along > limit)
        a = (vertex){limit, height_at(a, b, limit)};
    else if (b.along > limit)
        b = (vertex){limit, height_at(a, b, limit)};
    return (uint64_t)(((int64_t)a.height + b.height) * ((int64_t)b.along - a.along));
}

/* Bisection. `active` holds the segments that are not wholly before `low` or after `high`, whose part does not change
 * any more. */
static int32_t median(const loop_view *loop, uint32_t *active) {
    int32_t low = INT32_MAX, high = INT32_MIN;
    uint32_t active_count = loop->count;
    uint64_t settled = 0, total = 0;
    for (uint32_t i = 0; i < loop->count; i++) {
        vertex a = vertex_at(loop, i);
        if (a.along < low) low = a.along;
        if (a.along > high) high = a.along;
        total += area_before(a, vertex_at(loop, i + 1), MAX_COORDINATE);
        active[i] = i;
    }
    bool negative = total >> 63;
    if (negative) total = 0 - total;
    while (high - low > 1) {
        int32_t middle = low + (high - low) / 2;
        uint64_t area = settled;
        for (uint32_t i = 0; i < active_count; i++)
            area += area_before(vertex_at(loop, active[i]), vertex_at(loop, active[i] + 1), middle);
        int64_t before = (int64_t)(negative ? 0 - area : area);
        if (before < (int64_t)(total - total / 2))
            low = middle;
        else
            high = middle;
        uint32_t kept = 0;
        for (uint32_t i = 0; i < active_count; i++) {
            vertex a = vertex_at(loop, active[i]), b = vertex_at(loop, active[i] + 1);
            if (a.along <= low && b.along <= low)
                settled += area_before(a, b, low);
            else if (a.along < high || b.along < high)
                active[kept++] = active[i];
        }
        active_count = kept;
    }
    return high;
}

/* The column's crossings with the loop next to a height: two on each side, nearest first. */
typedef struct column {
    int32_t above[2], below[2];
    uint32_t above_count, below_count;
    bool clean; /* no vertex lies on the column */
} column;

static column look_along(const loop_view *loop, int32_t along, int32_t height) {
    column c = {{INT32_MAX, INT32_MAX}, {INT32_MIN, INT32_MIN}, 0, 0, true};
    for (uint32_t i = 0; i < loop->count; i++) {
        vertex a = vertex_at(loop, i), b = vertex_at(loop, i + 1);
        if (a.along == along) c.clean = false;
        if ((a.along < along) == (b.along < along)) continue;
        int32_t h = height_at(a, b, along);
        if (h >= height) {
            c.above_count++;
            if (h < c.above[0])
                c.above[1] = c.above[0], c.above[0] = h;
            else if (h < c.above[1])
                c.above[1] = h;
        } else {
            c.below_count++;
            if (h > c.below[0])
                c.below[1] = c.below[0], c.below[0] = h;
            else if (h > c.below[1])
                c.below[1] = h;
        }
    }
    return c;
}

/* *height to the nearest place strictly inside, by the middle of its stretch. False if the stretches here are too
 * thin. Heights are rounded down: h < inside < h' needs h + 1 <= inside <= h' - 1 at the least. */
static bool move_inside(const column *c, int32_t *height) {
    int32_t up = 0, down = 0;
    bool has_up = c->above_count >= 2 && c->above[1] - c->above[0] >= 2;
    bool has_down = c->below_count >= 2 && c->below[0] - c->below[1] >= 2;
    if (c->above_count & 1) {
        if (c->above[0] > *height && c->below[0] < *height) return true;
        up = c->below[0] + (c->above[0] - c->below[0] + 1) / 2;
        if (c->above[0] - c->below[0] < 2) return false;
        *height = up;
        return true;
    }
    if (has_up) up = c->above[0] + (c->above[1] - c->above[0] + 1) / 2;
    if (has_down) down = c->below[1] + (c->below[0] - c->below[1] + 1) / 2;
    if (!has_up && !has_down) return false;
    if (has_up && has_down) has_up = c->above[0] - *height <= *height - c->below[0];
    *height = has_up ? up : down;
    return true;
}

lathe_status lathe__loop_centre(lathe_point *centre, lathe_arena *arena, const lathe_point *points, uint32_t count) {
    if (!count) return LATHE_ERR_RANGE;
    for (uint32_t i = 0; i < count; i++)
        if (points[i].x <= -MAX_COORDINATE || points[i].x >= MAX_COORDINATE || points[i].y <= -MAX_COORDINATE ||
            points[i].y >= MAX_COORDINATE)
            return LATHE_ERR_RANGE;
    uint32_t *active = LATHE_NEW(arena, uint32_t, count);
    if (!active) return LATHE_ERR_MEMORY;
    loop_view columns = {points, count, false}, rows = {points, count, true};
    int32_t x = median(&columns, active) | 1, y = median(&rows, active) | 1;
    lathe_point found = {x, y};
    /* A column through a vertex could run along the loop; its neighbours do for real outlines. */
    for (int32_t t = 0; t < COLUMN_TRIES; t++) {
        int32_t along = x + (t & 1 ? (t + 1) / 2 : -(t / 2)), height = y;
        column c = look_along(&columns, along, y);
        if (!c.clean || !move_inside(&c, &height)) continue;
        found = (lathe_point){along, height};
        break;
    }
    *centre = found;
    return LATHE_OK;
}
