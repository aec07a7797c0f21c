/* What the files of a tube surface share. Functions fail with MEMORY; a tube whose edit has failed can only be
 * closed. */
#ifndef LATHE_TUBE_PARTS_H
#define LATHE_TUBE_PARTS_H
#include "tube_surface.h"

#define LATHE_TUBE_NONE UINT32_MAX

typedef struct lathe_tube_triangle {
    uint32_t corner[3], next; /* next in its group; corner[0] == NONE: free, next free one */
} lathe_tube_triangle;
typedef struct lathe_tube_slice {
    lathe_tube_loop loop;
    lathe_edit_contour contour;
    uint32_t *vertex; /* by crossing */
    uint32_t vertex_capacity, vertex_count, apex;
} lathe_tube_slice;
typedef struct lathe_tube_strip {
    lathe_edit_tree right, left; /* of the slice below, towards the one above; and the other way */
    uint32_t *group;             /* by ray: its triangles */
    uint32_t *made;              /* by ray: the last ray for whose sake it was made */
    uint32_t *passed[2];         /* by edge of either contour: the last ray for whose sake it was passed on the way to
                                  * its group */
    uint32_t capacity, made_capacity, passed_capacity[2];
} lathe_tube_strip;
typedef struct lathe_tube_ray {
    uint32_t after, angle;
} lathe_tube_ray;

struct lathe_tube_surface {
    lathe_tube_slice *slices;
    lathe_tube_strip *strips; /* strips[k] joins slices k and k + 1 */
    uint32_t count, first_rays;
    lathe_tube_ray *added; /* in the order in which they came */
    uint32_t added_count, added_capacity;
    uint32_t *fan[2]; /* the ends' triangles by edge */
    uint32_t fan_capacity[2];
    int32_t (*vertices)[3];
    lathe_tube_triangle *triangles;
    uint32_t vertex_count, vertex_capacity, triangle_count, triangle_capacity, free_triangle, live;
    uint32_t (*fresh)[3], *match; /* a group's new triangles, and which old ones they are */
    uint32_t fresh_count, fresh_capacity, match_capacity;
    lathe_tube_work work;
    lathe_arena scratch;
};

/* tube_mesh.c. Arrays grow by half; false: no memory, or more than 2^28 - 1. */
bool lathe__tube_grow(void **array, uint32_t *capacity, uint32_t want, size_t size);
bool lathe__tube_grow_indices(uint32_t **array, uint32_t *capacity, uint32_t want);
/* Vertices for the crossings that have none. */
lathe_status lathe__tube_add_vertices(lathe_tube_surface *t, lathe_tube_slice *s);
lathe_status lathe__tube_add_triangle(lathe_tube_surface *t, uint32_t *out, const uint32_t corner[3]);
void lathe__tube_remove_triangle(lathe_tube_surface *t, uint32_t index);
lathe_status lathe__tube_make_fan(lathe_tube_surface *t, int end);   /* end: 0 below, 1 above */
lathe_status lathe__tube_refine_fan(lathe_tube_surface *t, int end); /* after one ray more */

/* tube_group.c: makes one or two groups of strip k anew; where a ray's group was empty it is new. */
lathe_status lathe__tube_remake_groups(lathe_tube_surface *t, uint32_t k, const uint32_t *rays, uint32_t count);

/* tube_strip.c */
lathe_status lathe__tube_open_contour(const lathe_tube_surface *t, lathe_edit_contour *c, const lathe_tube_loop *loop);
lathe_status lathe__tube_open_strip(const lathe_tube_surface *t, lathe_tube_strip *out, const lathe_tube_loop *lower,
                                    const lathe_tube_loop *upper);
lathe_status lathe__tube_fill_strip(lathe_tube_surface *t, uint32_t k);
void lathe__tube_close_strip(lathe_tube_strip *s);

/* tube_surface.c */
void lathe__tube_close_slice(lathe_tube_slice *s);
#endif
