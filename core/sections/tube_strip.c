/* Strips of a tube: the trees of two neighbouring contours, and their groups. */
#include "tube_parts.h"
#include <stdlib.h>

void lathe__tube_close_strip(lathe_tube_strip *s) {
    lathe__edit_tree_close(&s->right);
    lathe__edit_tree_close(&s->left);
    free(s->group);
    free(s->made);
    free(s->passed[0]);
    free(s->passed[1]);
    *s = (lathe_tube_strip){0};
}
static lathe_status choose_level1(const lathe_tube_surface *t, uint32_t *chain[2], lathe_arena *arena,
                                  const lathe_edit_contour *a, const lathe_edit_contour *b) {
    lathe_ray_contour plain[2];
    lathe_derivation d[2];
    lathe_status status = lathe__edit_export(&plain[0], NULL, arena, a);
    if (!status) status = lathe__edit_export(&plain[1], NULL, arena, b);
    if (!status) status = lathe__derive_pair(&d[0], &d[1], arena, &plain[0], &plain[1]);
    for (int k = 0; k < 2 && !status; k++) {
        chain[k] = LATHE_NEW(arena, uint32_t, t->first_rays);
        if (!chain[k]) return LATHE_ERR_MEMORY;
        for (uint32_t i = 0; i < t->first_rays; i++) chain[k][i] = (d[k].start + d[k].main_edge[i]) % plain[k].count;
    }
    return status;
}
/* The trees of two loops, from the first rays on through all rays that were added. */
static lathe_status grow_trees(const lathe_tube_surface *t, lathe_tube_strip *s, lathe_edit_contour c[2],
                               lathe_arena *arena) {
    uint32_t *chain[2];
    lathe_status status = choose_level1(t, chain, arena, &c[0], &c[1]);
    if (!status) status = lathe__edit_tree_open(&s->right, &c[0], chain[0]);
    if (!status) status = lathe__edit_tree_open(&s->left, &c[1], chain[1]);
    for (uint32_t i = 0; i < t->added_count && !status; i++)
        for (int k = 0; k < 2 && !status; k++) {
            status = lathe__edit_insert_ray(&c[k], t->added[i].after, t->added[i].angle);
            if (!status) status = lathe__edit_tree_refine(k ? &s->left : &s->right, &c[k]);
        }
    return status;
}
lathe_status lathe__tube_open_contour(const lathe_tube_surface *t, lathe_edit_contour *c, const lathe_tube_loop *loop) {
    return lathe__edit_contour_open(c, loop->points, loop->count, loop->centre, t->first_rays, loop->turn);
}
/* The contours are made again for the trees' sake: crossings get the same numbers again. */
lathe_status lathe__tube_open_strip(const lathe_tube_surface *t, lathe_tube_strip *out, const lathe_tube_loop *lower,
                                    const lathe_tube_loop *upper) {
    lathe_edit_contour c[2] = {{0}, {0}};
    lathe_arena arena = {0};
    lathe_tube_strip s = {0};
    lathe_status status = lathe__tube_open_contour(t, &c[0], lower);
    if (!status) status = lathe__tube_open_contour(t, &c[1], upper);
    if (!status) status = grow_trees(t, &s, c, &arena);
    uint32_t rays = t->first_rays + t->added_count;
    if (!status && !lathe__tube_grow_indices(&s.group, &s.capacity, rays)) status = LATHE_ERR_MEMORY;
    for (uint32_t i = 0; i < rays && !status; i++) s.group[i] = LATHE_TUBE_NONE;
    for (int k = 0; k < 2; k++) lathe__edit_contour_close(&c[k]);
    lathe__arena_free(&arena);
    if (status)
        lathe__tube_close_strip(&s);
    else
        *out = s;
    return status;
}
lathe_status lathe__tube_fill_strip(lathe_tube_surface *t, uint32_t k) {
    lathe_status status = LATHE_OK;
    for (uint32_t ray = 0; ray < t->first_rays + t->added_count && !status; ray++)
        status = lathe__tube_remake_groups(t, k, &ray, 1);
    return status;
}
