/* Branchings of a slab: one polygon against many by their exterior and interior polygons [P 3.5], many against many
 * [P 3.6]. */
#include "branching.h"
#include "slab_build.h"

/* One polygon against the many on the other side of it; both heights are those of the nodes. */
static lathe_status branch(lathe_slab_build *s, const lathe_slab_nodes *one, const lathe_slab_nodes *many,
                           uint32_t count, bool many_above, bool flip) {
    uint32_t total = 0, used = 0, rings;
    for (uint32_t k = 0; k < count; k++) total += many[k].count;
    lathe_point *at = LATHE_NEW(s->arena, lathe_point, total);
    uint32_t *of = LATHE_NEW(s->arena, uint32_t, total), *first = LATHE_NEW(s->arena, uint32_t, count + 1);
    bool *taken = LATHE_NEW(s->arena, bool, count);
    if (!at || !of || !first || !taken) return LATHE_ERR_MEMORY;
    for (uint32_t k = 0; k < count; k++) {
        first[k] = used;
        for (uint32_t i = 0; i < many[k].count; i++, used++) at[used] = lathe__slab_point(s, of[used] = many[k].at[i]);
    }
    first[count] = used;
    lathe_many m = {at, first, count};
    lathe_slab_nodes f;
    uint32_t *compact;
    lathe_status status = lathe__exterior_polygon(&compact, &f.count, taken, s->arena, &m);
    if (status == LATHE_ERR_FORMAT) {
        s->refused = true;
        return LATHE_OK;
    }
    if (status) return status;
    if (!(f.at = LATHE_NEW(s->arena, uint32_t, f.count))) return LATHE_ERR_MEMORY;
    for (uint32_t i = 0; i < f.count; i++) f.at[i] = of[compact[i]];
    status = lathe__slab_tile_wall(s, many_above ? one : &f, many_above ? &f : one, (const uint32_t[2]){0, 0}, flip);
    lathe_triangles list = {0};
    if (!status) status = lathe__close_interior(&list, &rings, s->arena, &m, compact, f.count, taken);
    if (status == LATHE_ERR_FORMAT) {
        s->refused = true;
        return LATHE_OK;
    }
    for (uint32_t i = 0; !status && i < list.count; i++)
        status = lathe__slab_emit(s, of[list.at[i][0]], of[list.at[i][1]], of[list.at[i][2]], flip != !many_above);
    return status;
}

static lathe_status branch_one_to_many(lathe_slab_build *s, const lathe_slab_nodes *one, const lathe_slab_nodes *many,
                                       uint32_t count, bool many_above, bool flip) {
    lathe_point middle;
    double side = lathe__slab_box_side(s, many, count, &middle);
    if (!s->options->mid_slices || (double)s->in->height[1] - s->in->height[0] <= side / 4)
        return branch(s, one, many, count, many_above, flip);
    lathe_slab_nodes *copies = LATHE_NEW(s->arena, lathe_slab_nodes, count);
    if (!copies) return LATHE_ERR_MEMORY;
    s->counts->copied++;
    lathe_status status = lathe__slab_copy_many(s, copies, one, many, count, many_above, flip);
    return status ? status : branch(s, one, copies, count, many_above, flip);
}

lathe_status lathe__slab_build_branching(lathe_slab_build *s, const lathe_slab_block *b) {
    uint32_t total = b->count[0] + b->count[1];
    bool hole = lathe__slab_loop(s, b->loops[0])->hole;
    lathe_slab_nodes *list = LATHE_NEW(s->arena, lathe_slab_nodes, total), middle;
    if (!list) return LATHE_ERR_MEMORY;
    for (uint32_t k = 0; k < total; k++) {
        lathe_status status = lathe__slab_loop_nodes(&list[k], s, b->loops[k]);
        if (status) return status;
    }
    s->counts->branched++;
    if (b->count[0] == 1) return branch_one_to_many(s, &list[0], list + 1, b->count[1], true, hole);
    if (b->count[1] == 1) return branch_one_to_many(s, &list[b->count[0]], list, b->count[0], false, hole);
    lathe_status status = lathe__slab_middle_polygon(s, &middle, list, total);
    if (!status) status = branch(s, &middle, list, b->count[0], false, hole);
    return status ? status : branch(s, &middle, list + b->count[0], b->count[1], true, hole);
}
