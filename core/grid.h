/* Which boxes lie in which cell of a grid: what may meet is found without comparing everything. Decoder-safe. */
#ifndef LATHE_GRID_H
#define LATHE_GRID_H
#include "arena.h"
#include "contour.h"

typedef struct lathe_range { int32_t x0, y0, x1, y1; } lathe_range;   /* inclusive; y0 > y1: empty */
lathe_range lathe__range_of(lathe_point a, lathe_point b);
static inline bool lathe__ranges_meet(const lathe_range *a, const lathe_range *b) {
    return a->x0 <= b->x1 && b->x0 <= a->x1 && a->y0 <= b->y1 && b->y0 <= a->y1;
}
void lathe__range_add(lathe_range *range, int32_t x, int32_t y);

/* Do the segments at[a] at[b] and at[c] at[d] have a point in common? */
bool lathe__segments_meet(const lathe_point *at, uint32_t a, uint32_t b, uint32_t c, uint32_t d);

/* The nearest edge so far that lies to the left of a point. */
typedef struct lathe_left { double x, slope; } lathe_left;
#define LATHE_NOTHING_LEFT ((lathe_left){-1e18, 0})
/* Does the edge a b pass left of p, just above its height, and nearer than the one before? Then it takes its place. */
bool lathe__is_nearer_left(lathe_left *nearest, lathe_point p, lathe_point a, lathe_point b);

/* Does at[vertex] come within `room` of the segment at[a] at[b]? Or a little farther: lengths are taken as sums. */
bool lathe__comes_close(const lathe_point *at, uint32_t vertex, uint32_t a, uint32_t b, int32_t room);

typedef struct lathe_grid {
    lathe_range cells;         /* of the whole grid; a cell is coordinate >> shift */
    int shift;
    uint32_t width;
    uint32_t *first;           /* cell -> its first entry; cells row by row, one more than there are */
    uint32_t *entry;           /* indices of boxes, ascending in each cell */
} lathe_grid;
static inline lathe_range lathe__cells_of(const lathe_range *range, int shift) {
    return (lathe_range){range->x0 >> shift, range->y0 >> shift, range->x1 >> shift, range->y1 >> shift};
}
static inline size_t lathe__cell_at(const lathe_grid *grid, int32_t x, int32_t y) {
    return (size_t)(y - grid->cells.y0) * grid->width + (size_t)(x - grid->cells.x0);
}
/* Cells are pixels, or as much larger as it takes to have at most `most` of them. count >= 1. MEMORY, LIMIT. */
lathe_status lathe__grid_build(lathe_grid *grid, lathe_arena *arena, const lathe_range *ranges, uint32_t count, uint64_t most);
#endif
