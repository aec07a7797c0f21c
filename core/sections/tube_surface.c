/* See tube_surface.h. */
#include "tube_parts.h"
#include <stdlib.h>
#include <string.h>

void lathe__tube_close_slice(lathe_tube_slice *s) {
    lathe__edit_contour_close(&s->contour);
    free(s->vertex);
    *s = (lathe_tube_slice){0};
}
void lathe__tube_close(lathe_tube_surface **out) {
    if (!out || !*out) return;
    lathe_tube_surface *t = *out;
    for (uint32_t k = 0; k < t->count; k++) {
        lathe__tube_close_slice(&t->slices[k]);
        if (k + 1 < t->count) lathe__tube_close_strip(&t->strips[k]);
    }
    free(t->slices);
    free(t->strips);
    free(t->added);
    free(t->fan[0]);
    free(t->fan[1]);
    free(t->vertices);
    free(t->triangles);
    free(t->fresh);
    free(t->match);
    lathe__arena_free(&t->scratch);
    free(t);
    *out = NULL;
}

static lathe_status fill_tube(lathe_tube_surface *t, const lathe_tube_loop *loops) {
    lathe_status status = LATHE_OK;
    for (uint32_t k = 0; k < t->count && !status; k++) {
        t->slices[k] = (lathe_tube_slice){.loop = loops[k], .apex = LATHE_TUBE_NONE};
        status = lathe__tube_open_contour(t, &t->slices[k].contour, &loops[k]);
        if (!status) status = lathe__tube_add_vertices(t, &t->slices[k]);
    }
    for (uint32_t k = 0; k + 1 < t->count && !status; k++) {
        status = lathe__tube_open_strip(t, &t->strips[k], &loops[k], &loops[k + 1]);
        if (!status) status = lathe__tube_fill_strip(t, k);
    }
    for (int end = 0; end < 2 && !status; end++) status = lathe__tube_make_fan(t, end);
    t->work = (lathe_tube_work){0};
    return status;
}
lathe_status lathe__tube_open(lathe_tube_surface **out, const lathe_tube_loop *loops, uint32_t count, uint32_t rays) {
    if (count < 2 || count > LATHE_MAX_DIM) return LATHE_ERR_RANGE;
    for (uint32_t k = 1; k < count; k++)
        if (loops[k].height <= loops[k - 1].height) return LATHE_ERR_RANGE;
    lathe_tube_surface *t = calloc(1, sizeof *t);
    if (!t) return LATHE_ERR_MEMORY;
    t->count = count;
    t->first_rays = rays;
    t->free_triangle = LATHE_TUBE_NONE;
    t->slices = calloc(count, sizeof *t->slices);
    t->strips = calloc(count, sizeof *t->strips);
    if (!t->slices || !t->strips) t->count = 0;
    lathe_status status = t->count ? fill_tube(t, loops) : LATHE_ERR_MEMORY;
    if (status)
        lathe__tube_close(&t);
    else
        *out = t;
    return status;
}

uint32_t lathe__tube_slices(const lathe_tube_surface *t) { return t->count; }
uint32_t lathe__tube_triangles(const lathe_tube_surface *t) { return t->live; }
lathe_tube_work lathe__tube_work_done(const lathe_tube_surface *t) { return t->work; }
const lathe_edit_contour *lathe__tube_contour(const lathe_tube_surface *t, uint32_t slice) {
    return &t->slices[slice].contour;
}
uint32_t lathe__tube_vertex(const lathe_tube_surface *t, uint32_t slice, uint32_t crossing) {
    return crossing == LATHE_TUBE_NONE ? t->slices[slice].apex : t->slices[slice].vertex[crossing];
}
lathe_status lathe__tube_mesh(lathe_mesh *out, const lathe_tube_surface *t) {
    lathe_mesh m = {.vertex_count = t->vertex_count};
    m.lattice = malloc(t->vertex_count * sizeof *m.lattice);
    m.triangles = malloc(t->live * sizeof *m.triangles);
    if (!m.lattice || !m.triangles) {
        lathe_mesh_free(&m);
        return LATHE_ERR_MEMORY;
    }
    memcpy(m.lattice, t->vertices, t->vertex_count * sizeof *m.lattice);
    for (uint32_t i = 0; i < t->triangle_count; i++)
        if (t->triangles[i].corner[0] != LATHE_TUBE_NONE)
            memcpy(m.triangles[m.triangle_count++], t->triangles[i].corner, sizeof *m.triangles);
    *out = m;
    return LATHE_OK;
}
