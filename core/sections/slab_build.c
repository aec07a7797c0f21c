/* What the steps of a slab share: vertices and triangles that are added, loops as polygons, blocks cut out. */
#include "slab_build.h"

void lathe__slab_number(lathe_slab_build *s) {
    s->upper = s->in->outline[0]->point_count;
    s->vertices = s->upper + s->in->outline[1]->point_count;
    s->loops0 = s->in->outline[0]->loop_count;
    s->loops = s->loops0 + s->in->outline[1]->loop_count;
}

lathe_status lathe__slab_add_vertex(lathe_slab_build *s, uint32_t *out, int32_t x, int32_t y, int32_t z) {
    lathe_status status = lathe__builder_reserve(&s->b, 1, 0);
    if (status) return status;
    *out = s->b.mesh.vertex_count++;
    int32_t *v = s->b.mesh.lattice[*out];
    v[0] = x, v[1] = y, v[2] = z;
    return LATHE_OK;
}

lathe_status lathe__slab_emit(lathe_slab_build *s, uint32_t a, uint32_t b, uint32_t c, bool flip) {
    lathe_status status = lathe__builder_reserve(&s->b, 0, 1);
    if (status) return status;
    uint32_t *t = s->b.mesh.triangles[s->b.mesh.triangle_count++];
    t[0] = a;
    t[1 + flip] = b;
    t[2 - flip] = c;
    return LATHE_OK;
}

lathe_status lathe__slab_loop_nodes(lathe_slab_nodes *out, const lathe_slab_build *s, uint32_t l) {
    const lathe_loop *loop = lathe__slab_loop(s, l);
    uint32_t first = lathe__slab_first_vertex(s, l);
    *out = (lathe_slab_nodes){LATHE_NEW(s->arena, uint32_t, loop->count), loop->count};
    if (!out->at) return LATHE_ERR_MEMORY;
    for (uint32_t i = 0; i < loop->count; i++) out->at[i] = loop->hole ? first + loop->count - 1 - i : first + i;
    return LATHE_OK;
}

lathe_status lathe__slab_cut_out(lathe_outline part[2], uint32_t **of, lathe_slab_build *s, const lathe_slab_block *b,
                                 bool flip) {
    uint32_t total = 0, used = 0;
    for (uint32_t k = 0; k < b->count[0] + b->count[1]; k++) total += lathe__slab_loop(s, b->loops[k])->count;
    *of = LATHE_NEW(s->arena, uint32_t, total + 1);
    if (!*of) return LATHE_ERR_MEMORY;
    for (int side = 0, k = 0; side < 2; side++) {
        lathe_outline *o = &part[side];
        *o = (lathe_outline){.points = LATHE_NEW(s->arena, lathe_point, total + 1),
                             .loops = LATHE_NEW(s->arena, lathe_loop, b->count[side] + 1)};
        if (!o->points || !o->loops) return LATHE_ERR_MEMORY;
        for (uint32_t i = 0; i < b->count[side]; i++, k++) {
            const lathe_loop *loop = lathe__slab_loop(s, b->loops[k]);
            uint32_t first = lathe__slab_first_vertex(s, b->loops[k]);
            lathe_loop *copy = &o->loops[o->loop_count++];
            *copy = *loop;
            copy->first = o->point_count;
            copy->hole = loop->hole != flip;
            for (uint32_t v = 0; v < loop->count; v++, used++) {
                (*of)[used] = flip ? first + loop->count - 1 - v : first + v;
                o->points[o->point_count++] = lathe__slab_point(s, (*of)[used]);
            }
        }
    }
    return LATHE_OK;
}
