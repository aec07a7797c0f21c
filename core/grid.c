#include "grid.h"
#include <string.h>

void lathe__range_add(lathe_range *range, int32_t x, int32_t y) {
    if (x < range->x0) range->x0 = x;
    if (x > range->x1) range->x1 = x;
    if (y < range->y0) range->y0 = y;
    if (y > range->y1) range->y1 = y;
}

lathe_range lathe__range_of(lathe_point a, lathe_point b) {
    lathe_range range = {a.x, a.y, a.x, a.y};
    lathe__range_add(&range, b.x, b.y);
    return range;
}

static bool apart(const lathe_point *at, uint32_t a, uint32_t b, uint32_t c, uint32_t d) {
    int64_t s = lathe__turn(at, a, b, c), t = lathe__turn(at, a, b, d);
    return (s > 0 && t > 0) || (s < 0 && t < 0);
}

bool lathe__segments_meet(const lathe_point *at, uint32_t a, uint32_t b, uint32_t c, uint32_t d) {
    return !apart(at, a, b, c, d) && !apart(at, c, d, a, b);
}

bool lathe__comes_close(const lathe_point *at, uint32_t vertex, uint32_t a, uint32_t b, int32_t room) {
    lathe_point p = at[vertex];
    lathe_range r = lathe__range_of(at[a], at[b]);
    if (p.x < r.x0 - room || p.x > r.x1 + room || p.y < r.y0 - room || p.y > r.y1 + room) return false;
    int64_t turn = lathe__turn(at, a, b, vertex);
    return (turn < 0 ? -turn : turn) < room * ((int64_t)r.x1 - r.x0 + r.y1 - r.y0);
}

bool lathe__is_nearer_left(lathe_left *nearest, lathe_point p, lathe_point a, lathe_point b) {
    if (a.y > b.y) { lathe_point swap = a; a = b; b = swap; }
    if (p.y < a.y || p.y >= b.y || (a.x > p.x && b.x > p.x)) return false;
    double slope = (double)(b.x - a.x) / (double)(b.y - a.y), x = a.x + slope * (double)(p.y - a.y);
    if (x > p.x || x < nearest->x || (x == nearest->x && slope <= nearest->slope)) return false;
    *nearest = (lathe_left){x, slope};
    return true;
}

lathe_status lathe__grid_build(lathe_grid *grid, lathe_arena *arena, const lathe_range *ranges, uint32_t count, uint64_t most) {
    lathe_range all = ranges[0];
    for (uint32_t i = 1; i < count; i++) {
        lathe__range_add(&all, ranges[i].x0, ranges[i].y0);
        lathe__range_add(&all, ranges[i].x1, ranges[i].y1);
    }
    int shift = LATHE_LATTICE_BITS;
    while (shift < 24 && (uint64_t)(((all.x1 - all.x0) >> shift) + 1) * (uint64_t)(((all.y1 - all.y0) >> shift) + 1) > most) shift++;
    grid->shift = shift;
    all = grid->cells = lathe__cells_of(&all, shift);
    grid->width = (uint32_t)(all.x1 - all.x0) + 1;
    size_t cells = grid->width * (size_t)(all.y1 - all.y0 + 1), entries = 0;
    uint32_t *first = grid->first = LATHE_NEW(arena, uint32_t, cells + 2);
    if (!first) return LATHE_ERR_MEMORY;
    memset(first, 0, (cells + 2) * sizeof *first);
    /* A counting sort: the first turn counts two places ahead, the second moves each cell's begin to its end. */
    for (int turn = 0; turn < 2; turn++) {
        for (uint32_t i = 0; i < count; i++) {
            lathe_range r = lathe__cells_of(&ranges[i], shift);
            for (int32_t y = r.y0; y <= r.y1; y++)
                for (int32_t x = r.x0; x <= r.x1; x++) {
                    uint32_t *place = &first[lathe__cell_at(grid, x, y) + 2 - (size_t)turn];
                    if (turn) grid->entry[*place] = i;
                    else entries++;
                    ++*place;
                }
        }
        if (turn) break;
        if (entries > UINT32_MAX) return LATHE_ERR_LIMIT;
        for (size_t i = 2; i < cells + 2; i++) first[i] += first[i - 1];
        grid->entry = LATHE_NEW(arena, uint32_t, entries);
        if (!grid->entry) return LATHE_ERR_MEMORY;
    }
    return LATHE_OK;
}
