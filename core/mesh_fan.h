/* Fans: many triangles at one vertex, the apex. Their boxes all hold the apex, so boxes cannot tell which pairs are
 * apart; seen from the apex they can: the edges opposite to it lie in a tree of boxes, and a triangle looks only
 * into those parts of it that planes through the apex do not separate from it. */
#ifndef LATHE_MESH_FAN_H
#define LATHE_MESH_FAN_H
#include "lathe.h"

typedef struct lathe_fan_box {
    int32_t low[3], high[3];
} lathe_fan_box;
/* Level 0: the box of each triangle's edge opposite to the apex; level l: of four of level l - 1. */
enum { LATHE_FAN_LEVELS = 17 };
typedef struct lathe_fan {
    const lathe_mesh *mesh;
    uint32_t apex, count, level_count;
    uint32_t *triangles; /* in the order of the tree; not owned */
    size_t first[LATHE_FAN_LEVELS];
    lathe_fan_box *boxes; /* owned */
} lathe_fan;
typedef struct lathe_fans {
    lathe_fan *fans;
    uint32_t count, *triangles;
} lathe_fans;

/* Takes the triangles at vertices with more than 64 of them out of a list of triangles (indices in range, no degenerate
 * ones), each into the fan of its corner with the most; the list keeps its order. MEMORY. */
lathe_status lathe__fans_gather(lathe_fans *out, const lathe_mesh *mesh, uint32_t *triangles, uint32_t *count);
void lathe__fans_free(lathe_fans *fans);

/* With how many of a fan's triangles another triangle, which is not one of them, meets; how many pairs of its own meet:
 * as lathe__triangles_meet has it. O(log count) for a triangle if edges opposite to the apex are short and lie apart;
 * O(count) at worst. */
uint64_t lathe__fan_meetings(const lathe_fan *fan, uint32_t triangle);
uint64_t lathe__fan_own_meetings(const lathe_fan *fan);
#endif
