/* The mesh of a tube: vertices and triangles that come and go, numbers of removed triangles taken again; and the fans
 * at its ends. */
#include "tube_parts.h"
#include <stdlib.h>

static const uint32_t MOST = (1u << 28) - 1;

bool lathe__tube_grow(void **array, uint32_t *capacity, uint32_t want, size_t size) {
    if (want <= *capacity && *array) return true;
    uint32_t more = *capacity + *capacity / 2 + 64;
    if (want > MOST) return false;
    if (more < want) more = want;
    void *p = realloc(*array, more * size);
    if (!p) return false;
    *array = p;
    *capacity = more;
    return true;
}
bool lathe__tube_grow_indices(uint32_t **array, uint32_t *capacity, uint32_t want) {
    void *p = *array;
    bool ok = lathe__tube_grow(&p, capacity, want, sizeof **array);
    *array = p;
    return ok;
}

static lathe_status lathe__tube_add_vertex(lathe_tube_surface *t, uint32_t *out, lathe_point p, int32_t height) {
    void *v = t->vertices;
    bool ok = lathe__tube_grow(&v, &t->vertex_capacity, t->vertex_count + 1, sizeof *t->vertices);
    t->vertices = v;
    if (!ok) return LATHE_ERR_MEMORY;
    int32_t *at = t->vertices[t->vertex_count];
    at[0] = p.x, at[1] = p.y, at[2] = height;
    *out = t->vertex_count++;
    t->work.vertices++;
    return LATHE_OK;
}
lathe_status lathe__tube_add_vertices(lathe_tube_surface *t, lathe_tube_slice *s) {
    if (!lathe__tube_grow_indices(&s->vertex, &s->vertex_capacity, s->contour.count)) return LATHE_ERR_MEMORY;
    for (; s->vertex_count < s->contour.count; s->vertex_count++) {
        lathe_status status = lathe__tube_add_vertex(t, &s->vertex[s->vertex_count],
                                                     s->contour.crossings[s->vertex_count].point, s->loop.height);
        if (status) return status;
    }
    return LATHE_OK;
}
lathe_status lathe__tube_add_triangle(lathe_tube_surface *t, uint32_t *out, const uint32_t corner[3]) {
    uint32_t index = t->free_triangle;
    if (index != LATHE_TUBE_NONE)
        t->free_triangle = t->triangles[index].next;
    else {
        void *p = t->triangles;
        bool ok = lathe__tube_grow(&p, &t->triangle_capacity, t->triangle_count + 1, sizeof *t->triangles);
        t->triangles = p;
        if (!ok) return LATHE_ERR_MEMORY;
        index = t->triangle_count++;
    }
    t->triangles[index] = (lathe_tube_triangle){{corner[0], corner[1], corner[2]}, LATHE_TUBE_NONE};
    t->live++;
    t->work.added++;
    *out = index;
    return LATHE_OK;
}
void lathe__tube_remove_triangle(lathe_tube_surface *t, uint32_t index) {
    t->triangles[index].corner[0] = LATHE_TUBE_NONE;
    t->triangles[index].next = t->free_triangle;
    t->free_triangle = index;
    t->live--;
    t->work.removed++;
}

static lathe_status set_fan_triangle(lathe_tube_surface *t, int end, uint32_t edge) {
    const lathe_tube_slice *s = &t->slices[end ? t->count - 1 : 0];
    uint32_t a = s->vertex[edge], b = s->vertex[s->contour.crossings[edge].next];
    const uint32_t corner[3] = {s->apex, end ? a : b, end ? b : a};
    return lathe__tube_add_triangle(t, &t->fan[end][edge], corner);
}
lathe_status lathe__tube_make_fan(lathe_tube_surface *t, int end) {
    lathe_tube_slice *s = &t->slices[end ? t->count - 1 : 0];
    lathe_status status = lathe__tube_add_vertex(t, &s->apex, s->loop.centre, s->loop.height);
    if (!lathe__tube_grow_indices(&t->fan[end], &t->fan_capacity[end], s->contour.count)) return LATHE_ERR_MEMORY;
    for (uint32_t e = 0; e < s->contour.count && !status; e++) status = set_fan_triangle(t, end, e);
    return status;
}
lathe_status lathe__tube_refine_fan(lathe_tube_surface *t, int end) {
    const lathe_edit_contour *c = &t->slices[end ? t->count - 1 : 0].contour;
    lathe_status status = LATHE_OK;
    if (!lathe__tube_grow_indices(&t->fan[end], &t->fan_capacity[end], c->count)) return LATHE_ERR_MEMORY;
    for (uint32_t k = 0; k < c->refined_count && !status; k++) {
        uint32_t edge = c->refined[k], first = c->crossings[edge].split_first,
                 last = first + c->crossings[edge].split_count;
        lathe__tube_remove_triangle(t, t->fan[end][edge]);
        status = set_fan_triangle(t, end, edge);
        for (uint32_t e = first; e < last && !status; e++) status = set_fan_triangle(t, end, e);
    }
    return status;
}
