/* The triangles of a strip hang on rays: those of the fold on ray i and of the level-1 edge that leads from it to the
 * next one are group i. A group is made by walking the two contours' folds on that ray; those of its triangles that
 * were there before stay. */
#include "tube_parts.h"
#include <string.h>

static lathe_status add_fresh(lathe_tube_surface *t, uint32_t a, uint32_t b, uint32_t c) {
    void *p = t->fresh;
    bool ok = lathe__tube_grow(&p, &t->fresh_capacity, t->fresh_count + 1, sizeof *t->fresh);
    t->fresh = p;
    if (!ok) return LATHE_ERR_MEMORY;
    uint32_t *at = t->fresh[t->fresh_count++];
    at[0] = a, at[1] = b, at[2] = c;
    return LATHE_OK;
}
static int64_t flat_distance2(lathe_point p, lathe_point q) {
    int64_t dx = (int64_t)p.x - q.x, dy = (int64_t)p.y - q.y;
    return dx * dx + dy * dy;
}
/* One step of a tiling from the span (a, b), crossings of the lower and of the upper slice. */
static lathe_status add_step(lathe_tube_surface *t, const lathe_tube_slice *lower, const lathe_tube_slice *upper,
                             uint8_t step, uint32_t a, uint32_t b) {
    const lathe_edit_crossing *ca = lower->contour.crossings, *cb = upper->contour.crossings;
    uint32_t na = ca[a].next, nb = cb[b].next;
    const uint32_t *va = lower->vertex, *vb = upper->vertex;
    if (step == 1) return add_fresh(t, va[a], va[na], vb[b]);
    if (step == 2) return add_fresh(t, va[a], vb[nb], vb[b]);
    /* The shorter diagonal; of equal ones always the same. */
    bool rising = flat_distance2(ca[a].point, cb[nb].point) < flat_distance2(ca[na].point, cb[b].point);
    lathe_status status = add_fresh(t, va[a], va[na], rising ? vb[nb] : vb[b]);
    return status ? status : rising ? add_fresh(t, va[a], vb[nb], vb[b]) : add_fresh(t, va[na], vb[nb], vb[b]);
}
/* A group's triangles into `fresh`. */
static lathe_status walk_group(lathe_tube_surface *t, uint32_t k, uint32_t ray) {
    lathe_tube_slice *lower = &t->slices[k], *upper = &t->slices[k + 1];
    lathe_tube_strip *s = &t->strips[k];
    uint32_t main_a = s->right.nodes[s->right.level1[ray]].edge, main_b = s->left.nodes[s->left.level1[ray]].edge;
    uint32_t before = lower->contour.rays[ray].before;
    uint32_t a = lower->contour.crossings[s->right.nodes[s->right.level1[before]].edge].next;
    uint32_t b = upper->contour.crossings[s->left.nodes[s->left.level1[before]].edge].next;
    if (a == main_a && b == main_b) return add_step(t, lower, upper, 3, a, b);
    lathe_derivation fold_a, fold_b;
    lathe_ray_contour points_a, points_b;
    lathe_tiling tiling;
    uint32_t *ids;
    lathe__arena_reset(&t->scratch);
    lathe_status status = lathe__edit_tree_fold(&fold_a, &points_a, &ids, &t->scratch, &s->right, &lower->contour, ray);
    if (!status) status = lathe__edit_tree_fold(&fold_b, &points_b, &ids, &t->scratch, &s->left, &upper->contour, ray);
    if (!status) status = lathe__walk_derivations(&tiling, NULL, &t->scratch, &points_a, &fold_a, &points_b, &fold_b);
    for (uint32_t i = 0; !status && i < tiling.count; i++) {
        status = add_step(t, lower, upper, tiling.steps[i], a, b);
        if (tiling.steps[i] & 1) a = lower->contour.crossings[a].next;
        if (tiling.steps[i] & 2) b = upper->contour.crossings[b].next;
    }
    return status;
}

static uint32_t hash(const uint32_t corner[3]) {
    return (corner[0] * 0x9e3779b1u ^ corner[1] * 0x85ebca77u ^ corner[2] * 0xc2b2ae3du) * 0x27d4eb2fu;
}
/* Old triangles (a list) against t->fresh: match[i] becomes the old one that the i-th new one is, or NONE; the others
 * are removed. Steps give corners in the order lower slice first, so equal triangles are equal as they are written. */
static lathe_status match_old(lathe_tube_surface *t, uint32_t old) {
    uint32_t size = 16;
    while (size < 2 * t->fresh_count) size *= 2;
    lathe__arena_reset(&t->scratch);
    uint32_t *table = LATHE_NEW(&t->scratch, uint32_t, size);
    if (!table || !lathe__tube_grow_indices(&t->match, &t->match_capacity, t->fresh_count)) return LATHE_ERR_MEMORY;
    memset(table, 0xff, size * sizeof *table);
    memset(t->match, 0xff, t->fresh_count * sizeof *t->match);
    for (uint32_t i = 0; i < t->fresh_count; i++) {
        uint32_t h = hash(t->fresh[i]) >> 7 & (size - 1);
        while (table[h] != LATHE_TUBE_NONE) h = (h + 1) & (size - 1);
        table[h] = i;
    }
    for (uint32_t next; old != LATHE_TUBE_NONE; old = next) {
        next = t->triangles[old].next;
        uint32_t h = hash(t->triangles[old].corner) >> 7 & (size - 1);
        while (table[h] != LATHE_TUBE_NONE && memcmp(t->fresh[table[h]], t->triangles[old].corner, sizeof *t->fresh))
            h = (h + 1) & (size - 1);
        if (table[h] == LATHE_TUBE_NONE)
            lathe__tube_remove_triangle(t, old);
        else {
            t->match[table[h]] = old;
            t->work.kept++;
        }
    }
    return LATHE_OK;
}
/* The new triangles [from, to) become a group's. */
static lathe_status fill_group(lathe_tube_surface *t, lathe_tube_strip *s, uint32_t ray, uint32_t from, uint32_t to) {
    s->group[ray] = LATHE_TUBE_NONE;
    for (uint32_t i = from; i < to; i++) {
        uint32_t index = t->match[i];
        lathe_status status = index == LATHE_TUBE_NONE ? lathe__tube_add_triangle(t, &index, t->fresh[i]) : LATHE_OK;
        if (status) return status;
        t->triangles[index].next = s->group[ray];
        s->group[ray] = index;
    }
    return LATHE_OK;
}
lathe_status lathe__tube_remake_groups(lathe_tube_surface *t, uint32_t k, const uint32_t *rays, uint32_t count) {
    lathe_tube_strip *s = &t->strips[k];
    uint32_t end[3] = {0}, old = LATHE_TUBE_NONE;
    t->fresh_count = 0;
    for (uint32_t i = 0; i < count; i++) {
        lathe_status status = walk_group(t, k, rays[i]);
        if (status) return status;
        end[i + 1] = t->fresh_count;
        for (uint32_t x = s->group[rays[i]], next; x != LATHE_TUBE_NONE; x = next) {
            next = t->triangles[x].next;
            t->triangles[x].next = old;
            old = x;
        }
    }
    lathe_status status = match_old(t, old);
    for (uint32_t i = 0; i < count && !status; i++) status = fill_group(t, s, rays[i], end[i], end[i + 1]);
    return status;
}
