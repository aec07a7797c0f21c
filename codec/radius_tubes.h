/* Structures as radius maps. A simple one is one map, its levels those of the structure. Else loops are grouped into tubes: in each of
 * its slices a tube has one star-shaped loop; it ends where loops split, merge, appear or vanish. Each tube is a map, coded coarse to
 * fine from its two ends on; what is not coded yet is shown as it is predicted. Decoder-safe. */
#ifndef LATHE_RADIUS_TUBES_H
#define LATHE_RADIUS_TUBES_H
#include "level.h"
#include "radius_map.h"

enum { LATHE_TUBES_MOST = 8, LATHE_TUBE_STEPS = 80, LATHE_TUBE_MOST_RAYS = 256 };

typedef struct lathe_radius_tube {
    int32_t first;             /* the slice of row 0 */
    bool hole;
    lathe_radius_map map;      /* what has been coded */
    int32_t *shown, (*shown_centre)[2];   /* the same with all rows and rays, see lathe__tube_show. Of a simple map: NULL */
    uint32_t passes, shown_passes;        /* how many have been coded; of those that `shown` is made of, 0: none */
} lathe_radius_tube;

typedef struct lathe_radii {
    int32_t slices, width, height;
    uint32_t level_count;
    bool simple;
    bool plain;                /* tubes are joined ring to ring where they end, never by the overlay */
    uint32_t count;
    int32_t step, fine_step;   /* index: lathe__tube_step; all tubes have these, and turn, fall and apex of the first */
    uint32_t fine_level;       /* the first one with fine_step; 0: none */
    uint32_t early_level;      /* the level after that with early slices; 0: none */
    bool *early;               /* of each slice: its rows come with that level, if they would be new rows of the next one; NULL: none */
    lathe_radius_tube *tubes;
} lathe_radii;

/* Radius units: eight steps to each doubling. */
static inline int32_t lathe__tube_step(int32_t index) { return (8 + (index & 7)) << (index >> 3); }
/* How many passes a tube of some rows takes; the last level_count ones are the levels'. */
uint32_t lathe__tube_passes(int32_t rows, uint32_t level_count);

/* One packet, both directions; slices, width, height and level_count are set before level 0. truth: what is to be coded, or NULL.
 * Arena memory with level 0. FORMAT: a number out of range. */
lathe_status lathe__radii_code(lathe_radii *radii, const lathe_radii *truth, lathe_arena *arena, uint32_t level, lathe_number_code *code,
                               void *coder);
/* The passes that a tube has with a level. */
static inline uint32_t lathe__passes_at(const lathe_radii *radii, const lathe_radius_tube *tube, uint32_t level) {
    return tube->map.level_count - radii->level_count + level + 1;
}
/* A tube's map as it is shown with some passes coded: what is not coded is predicted, unless that has been done. */
lathe_radius_map lathe__tube_shown(lathe_radius_tube *tube, uint32_t passes);

/* radius_stack.c: the surface at a level that has been coded. arena: two scratch arenas, left reset. */
lathe_status lathe__radii_mesh(lathe_mesh *out, lathe_arena arena[2], lathe_radii *radii, uint32_t level,
                               lathe_surface_counts *counts, uint32_t *shown);
/* Of plain tubes, an encoder's: slab by slab the triangles of those of which it is not known that nothing can cross them. */
lathe_status lathe__radii_joints(lathe_mesh *out, lathe_arena arena[2], lathe_radii *radii, uint32_t level);
/* Can be meshed without the overlay: one tube all along, or plain ones. */
bool lathe__radii_plain(const lathe_radii *radii);
/* The slices that a level shows, ascending, and the stride of its rays. Arena memory. Not of simple maps. */
lathe_status lathe__radii_slices(int32_t **out, uint32_t *count, uint32_t *ray_stride, lathe_arena *arena, const lathe_radii *radii,
                                 uint32_t level);
/* The tubes' polygons in a slice at a level, every stride-th ray of the last level, at least 8 rays. Points get arena memory; they are
 * jittered unless the tubes are plain. */
lathe_status lathe__radii_outline(lathe_outline *out, lathe_arena *arena, lathe_radii *radii, uint32_t level, int32_t slice,
                                  uint32_t stride, uint32_t seed);
/* radius_mesh.c: directions of a row's rays: a quarter of them, the others are that one turned. turn: what they have been computed for,
 * UINT32_MAX: nothing yet. */
typedef struct lathe_ray_fan { lathe_point d[LATHE_RADIUS_MAX_RAYS / 4]; uint32_t turn; } lathe_ray_fan;
/* Every stride-th vertex of a row of a map, whose fan this is: v[0], v[step], v[2 * step], ... */
void lathe__radius_ring(int32_t (*v)[3], ptrdiff_t step, lathe_ray_fan *fan, const lathe_radius_map *map, int32_t row, uint32_t stride,
                        int32_t height);
/* The 2 * rays triangles between two rings of vertices, each quadrangle by its shorter diagonal: an even triangle has two vertices of
 * the lower ring, an odd one two of the upper. */
void lathe__radius_strip(uint32_t (*triangles)[3], const int32_t (*at)[3], uint32_t lower, uint32_t upper, uint32_t rays);
/* radius_mesh.c: strips between rows of a map that reaches from the first slice to the last, and two fans. */
lathe_status lathe__radius_strips(lathe_mesh *out, const lathe_radius_map *map, const int32_t *rows, uint32_t count, uint32_t stride);
#endif
