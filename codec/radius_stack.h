/* A stack of tubes while its surface is built: what the ways to join their rings share. */
#ifndef LATHE_RADIUS_STACK_H
#define LATHE_RADIUS_STACK_H
#include "radius_tubes.h"

enum { LATHE_NO_RING = UINT32_MAX };
_Static_assert(LATHE_TUBES_MOST <= 8, "a group is a byte");

typedef struct lathe_tube_ring {  /* of a tube in a shown slice */
    uint32_t base;             /* its first vertex, or LATHE_NO_RING: the tube has none there */
    int32_t centre[2];         /* lattice units */
    double most;               /* its largest radius, no less, lattice units */
    double least, jump;        /* the smallest, and the most that two neighbours differ by; only with groups */
} lathe_tube_ring;

/* Slab i lies below shown slice i: there is one more of them. */
typedef struct lathe_tube_stack {
    lathe_mesh_builder builder;
    lathe_arena *keep, *scratch;
    const lathe_radii *radii;
    const int32_t *slices;
    uint32_t count;            /* of shown slices */
    size_t most;               /* vertices of a slice */
    lathe_radius_map map[LATHE_TUBES_MOST];
    uint32_t stride[LATHE_TUBES_MOST], rays[LATHE_TUBES_MOST];
    lathe_tube_ring (*rings)[LATHE_TUBES_MOST];   /* by shown slice; before the first and behind the last there are empty ones */
    uint8_t (*group)[LATHE_TUBES_MOST];        /* by slab: the tubes that come near this one, itself included; 0: a strip, or a plain end, apart. NULL: not asked */
    lathe_ray_fan *fans;       /* of each tube */
    lathe_surface_counts *counts;
} lathe_tube_stack;

/* side 0: the slice below a slab, 1: the one above. */
static inline const lathe_tube_ring *lathe__ring_at(const lathe_tube_stack *s, uint32_t slab, int side, uint32_t tube) {
    return &s->rings[(int32_t)slab - 1 + side][tube];
}
static inline bool lathe__has_ring(const lathe_tube_stack *s, uint32_t slab, int side, uint32_t tube) {
    return lathe__ring_at(s, slab, side, tube)->base != LATHE_NO_RING;
}
static inline void lathe__merge_groups(uint8_t *group, uint32_t count, uint8_t both) {
    for (uint32_t k = 0; k < count; k++)
        if (group[k] & both) group[k] = both;
}

/* radius_joint.c: the triangles of a slab of plain tubes; with groups, only of those that have one. */
lathe_status lathe__add_plain_slab(lathe_tube_stack *s, uint32_t slab);
/* radius_group.c: finds what comes near what; the triangles of a slab whose groups are joined by the overlay. */
void lathe__group_slab(lathe_tube_stack *s, uint32_t slab);
lathe_status lathe__add_group_slab(lathe_tube_stack *s, uint32_t slab);
#endif
