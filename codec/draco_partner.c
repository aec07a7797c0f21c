/* Which old vertices move, and where to. The surface of a lattice of samples has one vertex on an edge between two samples of which one
 * is inside. With half the stride there is one sample more on it, and one vertex again, in one half or the other: that is where the
 * old one moves. */
#include "draco_place.h"
#include <stdlib.h>

/* A vertex of an outline by the edge of the coarse lattice on which it lies. */
typedef struct on_edge { int32_t height, axis, line, cell; uint32_t vertex; } on_edge;

static int compare(const void *a, const void *b) {
    const on_edge *x = a, *y = b;
    if (x->height != y->height) return x->height < y->height ? -1 : 1;
    if (x->axis != y->axis) return x->axis < y->axis ? -1 : 1;
    if (x->line != y->line) return x->line < y->line ? -1 : 1;
    return x->cell < y->cell ? -1 : x->cell > y->cell;
}

static int64_t floor_of(int64_t a, int64_t b) { return a >= 0 ? a / b : -((-a + b - 1) / b); }

/* at: lattice units. It must be on a line of samples (within slack) and between two of them. */
static bool find_edge(on_edge *e, const lathe_draco_shape *s, const int64_t at[2], int64_t slack) {
    int64_t beside[2];
    for (int k = 0; k < 2; k++) {
        int64_t stride = (int64_t)s->before[k] * LATHE_LATTICE_ONE, rest = at[k] - (int64_t)s->origin[k] * LATHE_LATTICE_ONE;
        rest -= floor_of(rest + stride / 2, stride) * stride;
        beside[k] = rest < 0 ? -rest : rest;
    }
    e->axis = beside[0] > beside[1] ? 0 : 1;
    if (beside[!e->axis] > slack || beside[e->axis] <= slack) return false;
    int64_t along = (int64_t)s->before[e->axis] * LATHE_LATTICE_ONE, across = (int64_t)s->before[!e->axis] * LATHE_LATTICE_ONE;
    e->cell = (int32_t)floor_of(at[e->axis] - (int64_t)s->origin[e->axis] * LATHE_LATTICE_ONE, along);
    e->line = (int32_t)floor_of(at[!e->axis] - (int64_t)s->origin[!e->axis] * LATHE_LATTICE_ONE + across / 2, across);
    return true;
}

static uint32_t list_old(const lathe_draco_walk *w, on_edge *out, const lathe_draco_part *part, const lathe_draco_shape *shape) {
    uint32_t count = 0;
    int32_t least = shape->before[0] < shape->before[1] ? shape->before[0] : shape->before[1];
    for (uint32_t i = 0; i < part->contour_count; i++) {
        const int32_t *p = w->mesh->at[part->contour[i]];
        int64_t unit = LATHE_LATTICE_ONE / LATHE_DRACO_ONE, at[2] = {p[0] * unit, p[1] * unit};
        out[count] = (on_edge){.height = p[2] / LATHE_DRACO_HEIGHT, .vertex = part->contour[i]};
        count += find_edge(&out[count], shape, at, least * unit / 2 + unit / 2);
    }
    qsort(out, count, sizeof *out, compare);
    return count;
}

static bool is_moving(const lathe_draco_walk *w, uint32_t part) {
    const lathe_draco_shape *s = &w->truth->shapes[part];
    return !s->rings.count && s->before[0] && s->before[1] && w->mesh->parts[part].contour_count;
}

void lathe__walk_find_partners(lathe_draco_walk *w) {
    uint32_t parts = w->mesh->part_count;
    on_edge **old = (on_edge **)lathe__arena_alloc(&w->arena, (size_t)parts + 1, sizeof *old);
    uint32_t *count = LATHE_NEW(&w->arena, uint32_t, (size_t)parts + 1);
    w->partner = LATHE_NEW(&w->arena, uint32_t, (size_t)w->c->vertex_count + 1);
    if (!old || !count || !w->partner) { lathe__walk_fail(w, LATHE_ERR_MEMORY); return; }
    for (uint32_t p = 0; p < parts; p++) {
        count[p] = 0;
        if (!w->is_touched[p] || !is_moving(w, p)) continue;
        old[p] = LATHE_NEW(&w->arena, on_edge, (size_t)w->mesh->parts[p].contour_count + 1);
        if (!old[p]) { lathe__walk_fail(w, LATHE_ERR_MEMORY); return; }
        count[p] = list_old(w, old[p], &w->mesh->parts[p], &w->truth->shapes[p]);
    }
    for (uint32_t x = 0; x < w->c->vertex_count; x++) {
        uint32_t p = w->part[x];
        w->partner[x] = LATHE_DRACO_NONE;
        if (w->half[x] & 1 || !count[p]) continue;
        const lathe_draco_shape *shape = &w->truth->shapes[p];
        on_edge own = {.height = shape->heights[w->half[x] / 2]};
        if (!find_edge(&own, shape, (int64_t[]){w->truth->exact[x][0], w->truth->exact[x][1]}, LATHE_LATTICE_ONE / 64)) continue;
        const on_edge *found = bsearch(&own, old[p], count[p], sizeof own, compare);
        if (found) w->partner[x] = found->vertex;
    }
}
