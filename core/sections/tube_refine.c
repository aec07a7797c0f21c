/* A tube refined: one ray more [M 5.2.1], one slice more [M 5.2.2]. A new ray between i and the next makes group i and
 * its own anew, and those whose folds come there: on the next ray, and, with excursions, on rays farther away. */
#include "tube_parts.h"
#include <stdlib.h>
#include <string.h>

/* ---- one ray more ---- */

static bool make_marks(lathe_tube_strip *s, const lathe_edit_contour *a, const lathe_edit_contour *b) {
    const lathe_edit_contour *c[2] = {a, b};
    uint32_t had = s->made_capacity;
    if (!lathe__tube_grow_indices(&s->group, &s->capacity, a->ray_count) ||
        !lathe__tube_grow_indices(&s->made, &s->made_capacity, a->ray_count))
        return false;
    for (; had < s->made_capacity; had++) s->made[had] = LATHE_TUBE_NONE;
    for (int k = 0; k < 2; k++) {
        had = s->passed_capacity[k];
        if (!lathe__tube_grow_indices(&s->passed[k], &s->passed_capacity[k], c[k]->count)) return false;
        for (; had < s->passed_capacity[k]; had++) s->passed[k][had] = LATHE_TUBE_NONE;
    }
    return true;
}
/* Makes the groups anew to whose folds the edges belong that were split: on from each of them is the level-1 edge of
 * its group. */
static lathe_status remake_split(lathe_tube_surface *t, uint32_t k, int side, uint32_t ray) {
    lathe_tube_strip *s = &t->strips[k];
    const lathe_edit_contour *c = &t->slices[k + (uint32_t)side].contour;
    const lathe_edit_tree *tree = side ? &s->left : &s->right;
    for (uint32_t i = 0; i < c->refined_count; i++) {
        uint32_t e = c->refined[i];
        while (s->passed[side][e] != ray && tree->nodes[tree->owner[e]].symbol != LATHE_DER_F) {
            s->passed[side][e] = ray;
            e = c->crossings[e].next;
        }
        uint32_t group = c->crossings[e].at.ray;
        if (s->passed[side][e] == ray || s->made[group] == ray) continue;
        s->made[group] = ray;
        lathe_status status = lathe__tube_remake_groups(t, k, &group, 1);
        if (status) return status;
    }
    return LATHE_OK;
}
static lathe_status refine_strip(lathe_tube_surface *t, uint32_t k, uint32_t ray) {
    lathe_tube_strip *s = &t->strips[k];
    const lathe_edit_contour *a = &t->slices[k].contour, *b = &t->slices[k + 1].contour;
    lathe_status status = lathe__edit_tree_refine(&s->right, a);
    if (!status) status = lathe__edit_tree_refine(&s->left, b);
    if (!status && !make_marks(s, a, b)) status = LATHE_ERR_MEMORY;
    if (status) return status;
    s->group[ray] = LATHE_TUBE_NONE;
    uint32_t groups[2] = {a->rays[ray].before, ray};
    s->made[groups[0]] = s->made[ray] = ray;
    status = lathe__tube_remake_groups(t, k, groups, 2);
    for (int side = 0; side < 2 && !status; side++) status = remake_split(t, k, side, ray);
    return status;
}
lathe_status lathe__tube_insert_ray(lathe_tube_surface *t, uint32_t after, uint32_t angle) {
    void *p = t->added;
    bool ok = lathe__tube_grow(&p, &t->added_capacity, t->added_count + 1, sizeof *t->added);
    t->added = p;
    if (!ok) return LATHE_ERR_MEMORY;
    lathe_status status = LATHE_OK;
    uint32_t ray = t->slices[0].contour.ray_count;
    for (uint32_t k = 0; k < t->count && !status; k++) {
        status = lathe__edit_insert_ray(&t->slices[k].contour, after, angle);
        if (!status) status = lathe__tube_add_vertices(t, &t->slices[k]);
    }
    if (status) return status;
    t->added[t->added_count++] = (lathe_tube_ray){after, angle};
    for (uint32_t k = 0; k + 1 < t->count && !status; k++) status = refine_strip(t, k, ray);
    for (int end = 0; end < 2 && !status; end++) status = lathe__tube_refine_fan(t, end);
    return status;
}
lathe_status lathe__tube_double_rays(lathe_tube_surface *t) {
    const lathe_edit_contour *c = &t->slices[0].contour;
    lathe_status status = c->ray_count > 32768 ? LATHE_ERR_RANGE : LATHE_OK;
    for (uint32_t n = c->ray_count, ray = 0; n && !status; n--) {
        uint32_t next = c->rays[ray].next;
        status = lathe__tube_insert_ray(t, ray, lathe__edit_middle_angle(c, ray));
        ray = next;
    }
    return status;
}

/* ---- one slice more ---- */

static lathe_status open_slice(const lathe_tube_surface *t, lathe_tube_slice *out, const lathe_tube_loop *loop) {
    lathe_tube_slice s = {.loop = *loop, .apex = LATHE_TUBE_NONE};
    lathe_status status = lathe__tube_open_contour(t, &s.contour, loop);
    for (uint32_t i = 0; i < t->added_count && !status; i++)
        status = lathe__edit_insert_ray(&s.contour, t->added[i].after, t->added[i].angle);
    if (status)
        lathe__tube_close_slice(&s);
    else
        *out = s;
    return status;
}
static lathe_status make_place(lathe_tube_surface *t) {
    lathe_tube_slice *slices = realloc(t->slices, (t->count + 1) * sizeof *slices);
    if (slices) t->slices = slices;
    lathe_tube_strip *strips = realloc(t->strips, (t->count + 1) * sizeof *strips);
    if (strips) t->strips = strips;
    return slices && strips ? LATHE_OK : LATHE_ERR_MEMORY;
}
lathe_status lathe__tube_insert_slice(lathe_tube_surface *t, const lathe_tube_loop *loop) {
    uint32_t k = 0;
    while (k < t->count && t->slices[k].loop.height < loop->height) k++;
    if (!k || k == t->count || t->slices[k].loop.height == loop->height) return LATHE_ERR_RANGE;
    if (t->count >= LATHE_MAX_DIM) return LATHE_ERR_LIMIT;
    lathe_tube_slice s;
    lathe_tube_strip below, above;
    lathe_status status = make_place(t);
    if (!status) status = open_slice(t, &s, loop);
    if (status) return status;
    status = lathe__tube_open_strip(t, &below, &t->slices[k - 1].loop, loop);
    if (status) {
        lathe__tube_close_slice(&s);
        return status;
    }
    status = lathe__tube_open_strip(t, &above, loop, &t->slices[k].loop);
    if (status) {
        lathe__tube_close_slice(&s);
        lathe__tube_close_strip(&below);
        return status;
    }
    lathe_tube_strip *gone = &t->strips[k - 1];
    for (uint32_t ray = 0; ray < t->first_rays + t->added_count; ray++)
        for (uint32_t x = gone->group[ray], next; x != LATHE_TUBE_NONE; x = next) {
            next = t->triangles[x].next;
            lathe__tube_remove_triangle(t, x);
        }
    lathe__tube_close_strip(gone);
    memmove(&t->slices[k + 1], &t->slices[k], (t->count - k) * sizeof s);
    memmove(&t->strips[k + 1], &t->strips[k], (t->count - 1 - k) * sizeof below);
    t->slices[k] = s;
    t->strips[k - 1] = below;
    t->strips[k] = above;
    t->count++;
    status = lathe__tube_add_vertices(t, &t->slices[k]);
    if (!status) status = lathe__tube_fill_strip(t, k - 1);
    return status ? status : lathe__tube_fill_strip(t, k);
}
