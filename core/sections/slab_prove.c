/* The proof of one slab, by exact predicates. */
#include "adjacency.h"
#include "mesh_intersect.h"
#include "slab_build.h"
#include <stdlib.h>
#include <string.h>

enum { NONE = LATHE_NO_NEIGHBOUR };

typedef struct proof {
    const lathe_mesh *mesh;
    const lathe_slab_input *in;
    lathe_slab_faults *faults;
    uint32_t upper, vertices;  /* the upper outline's first vertex; of both outlines */
    uint32_t *next, *prev;     /* along the outlines */
    uint32_t *degree;          /* vertex -> triangles */
    lathe_half_edges edges;
} proof;

bool lathe__slab_is_sound(const lathe_slab_faults *f) {
    return !f->degenerate && !f->edges && !f->fans && !f->flat && !f->duplicates && !f->crossings;
}

lathe_status lathe__start_slab(lathe_mesh_builder *builder, const lathe_slab_input *in) {
    lathe_status status =
        lathe__builder_reserve(builder, (size_t)in->outline[0]->point_count + in->outline[1]->point_count, 16);
    for (int s = 0; !status && s < 2; s++)
        for (uint32_t i = 0; i < in->outline[s]->point_count; i++) {
            int32_t *v = builder->mesh.lattice[builder->mesh.vertex_count++];
            v[0] = in->outline[s]->points[i].x, v[1] = in->outline[s]->points[i].y, v[2] = in->height[s];
        }
    return status;
}

static int side_of(const proof *p, uint32_t v) { return (v >= p->upper) + (v >= p->vertices); }

/* Follows the triangles around v from a half-edge that leaves it; true if they are all of v's, and end at `last`
 * (NONE: where they began). */
static bool is_one_fan(const proof *p, uint32_t v, uint32_t corner, uint32_t last) {
    uint32_t steps = 0, first = corner, previous = NONE;
    do {
        previous = p->mesh->triangles[corner / 3][(corner % 3 + 2) % 3];
        steps++;
        corner = lathe__half_edge(&p->edges, v, previous);
    } while (corner != NONE && corner != first && steps <= p->degree[v]);
    if (steps != p->degree[v]) return false;
    return last == NONE ? corner == first : corner == NONE && previous == last;
}

static void check_outline_fans(proof *p) {
    for (uint32_t v = 0; v < p->vertices; v++) {
        /* Forward edges of the lower outline, backward ones of the upper: each without partner. */
        uint32_t to = v < p->upper ? p->next[v] : p->prev[v], from = v < p->upper ? p->prev[v] : p->next[v];
        uint32_t corner = lathe__half_edge(&p->edges, v, to);
        if (corner == NONE || lathe__half_edge(&p->edges, to, v) != NONE) p->faults->edges++;
        else if (!is_one_fan(p, v, corner, from)) p->faults->fans++;
    }
}

static lathe_status check_inner_fans(proof *p, lathe_arena *arena) {
    uint32_t n = p->mesh->vertex_count - p->vertices, *any = LATHE_NEW(arena, uint32_t, n + 1);
    if (!any) return LATHE_ERR_MEMORY;
    memset(any, 0xff, n * sizeof *any);
    for (uint32_t i = 0; i < p->mesh->triangle_count * 3; i++) {
        uint32_t v = p->mesh->triangles[i / 3][i % 3];
        if (v >= p->vertices) any[v - p->vertices] = i;
    }
    for (uint32_t i = 0; i < n; i++)
        if (any[i] == NONE || !is_one_fan(p, p->vertices + i, any[i], NONE)) p->faults->fans++;
    return LATHE_OK;
}

static void check_edges(proof *p) {
    uint32_t open = 0;
    p->faults->edges += p->edges.repeated;
    for (uint32_t i = 0; i < p->mesh->triangle_count * 3; i++) {
        const uint32_t *t = p->mesh->triangles[i / 3];
        uint32_t a = t[i % 3], b = t[(i + 1) % 3];
        open += lathe__half_edge(&p->edges, b, a) == NONE;
        bool flat = !(p->in->end && !p->in->cap) && side_of(p, a) == side_of(p, b) && a < p->vertices;
        if (flat && p->next[a] != b && p->prev[a] != b) p->faults->flat++;
    }
    /* As many as there are outline edges; that these are they is seen at the vertices. */
    if (open != p->vertices) p->faults->edges++;
}

static void check_triangles(proof *p) {
    for (uint32_t i = 0; i < p->mesh->triangle_count; i++) {
        const uint32_t *t = p->mesh->triangles[i];
        const int32_t *a = p->mesh->lattice[t[0]], *b = p->mesh->lattice[t[1]], *c = p->mesh->lattice[t[2]];
        p->faults->degenerate += t[0] == t[1] || t[1] == t[2] || t[2] == t[0] || lathe__triangle_degenerate(a, b, c);
        bool flat = a[2] == b[2] && b[2] == c[2] && (a[2] == p->in->height[0] || a[2] == p->in->height[1]);
        p->faults->flat += flat && !(p->in->end && !p->in->cap);
        for (int k = 0; k < 3; k++) p->degree[t[k]]++;
    }
    for (uint32_t v = p->vertices; v < p->mesh->vertex_count; v++) {
        int32_t z = p->mesh->lattice[v][2];
        p->faults->flat += z <= p->in->height[0] || z >= p->in->height[1];
    }
}

static int compare_positions(const void *a, const void *b) {
    const int32_t *p = a, *q = b;
    for (int k = 0; k < 3; k++)
        if (p[k] != q[k]) return p[k] < q[k] ? -1 : 1;
    return 0;
}

/* Outlines are simple, so only the other vertices can coincide. */
static lathe_status count_duplicates(proof *p, lathe_arena *arena) {
    uint32_t n = p->mesh->vertex_count - p->vertices;
    int32_t(*at)[3] = lathe__arena_alloc(arena, n + 1, sizeof *at);
    if (!at) return LATHE_ERR_MEMORY;
    memcpy(at, p->mesh->lattice + p->vertices, n * sizeof *at);
    qsort(at, n, sizeof *at, compare_positions);
    for (uint32_t i = 1; i < n; i++) p->faults->duplicates += compare_positions(at[i - 1], at[i]) == 0;
    return LATHE_OK;
}

static lathe_status link_vertices(proof *p, lathe_arena *arena) {
    p->upper = p->in->outline[0]->point_count;
    p->vertices = p->upper + p->in->outline[1]->point_count;
    p->next = LATHE_NEW(arena, uint32_t, p->vertices + 1);
    p->prev = LATHE_NEW(arena, uint32_t, p->vertices + 1);
    p->degree = LATHE_NEW(arena, uint32_t, p->mesh->vertex_count + 1);
    if (!p->next || !p->prev || !p->degree) return LATHE_ERR_MEMORY;
    memset(p->degree, 0, p->mesh->vertex_count * sizeof *p->degree);
    for (int s = 0; s < 2; s++)
        for (uint32_t l = 0; l < p->in->outline[s]->loop_count; l++) {
            const lathe_loop *loop = &p->in->outline[s]->loops[l];
            uint32_t first = loop->first + (s ? p->upper : 0);
            for (uint32_t i = 0; i < loop->count; i++) {
                p->next[first + i] = first + (i + 1) % loop->count;
                p->prev[first + i] = first + (i + loop->count - 1) % loop->count;
            }
        }
    return LATHE_OK;
}

lathe_status lathe__prove_slab(lathe_slab_faults *out, lathe_arena *arena, const lathe_mesh *mesh,
                               const lathe_slab_input *in) {
    lathe_slab_faults faults = {0};
    proof p = {.mesh = mesh, .in = in, .faults = &faults};
    lathe_status status = link_vertices(&p, arena);
    if (!status)
        status = lathe__half_edges_build(&p.edges, arena, (const uint32_t(*)[3])mesh->triangles, mesh->triangle_count);
    if (status) return status;
    check_triangles(&p);
    check_edges(&p);
    check_outline_fans(&p);
    status = check_inner_fans(&p, arena);
    if (!status) status = count_duplicates(&p, arena);
    if (!status && lathe__slab_is_sound(&faults)) status = lathe__mesh_intersections(&faults.crossings, mesh);
    if (!status) *out = faults;
    return status;
}
