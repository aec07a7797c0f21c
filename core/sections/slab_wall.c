/* Walls of a slab: one polygon of the lower slice, one of the upper, or of the middle height. */
#include "slab_build.h"

static lathe_status emit_wall(lathe_slab_build *s, const lathe_slab_nodes *low, const lathe_slab_nodes *high,
                              const lathe_tiling *tiling, lathe_point *const p[2], bool flip) {
    lathe_status status = LATHE_OK;
    uint32_t i = tiling->start[0], j = tiling->start[1];
    for (uint32_t k = 0; !status && k < tiling->count; k++) {
        uint32_t i1 = i + 1 < low->count ? i + 1 : 0, j1 = j + 1 < high->count ? j + 1 : 0;
        int step = tiling->steps[k], first = step & 1;
        /* A quadrilateral: shorter diagonal. */
        if (step == 3) first = lathe__slab_distance2(p[0][i1], p[1][j]) <= lathe__slab_distance2(p[0][i], p[1][j1]);
        for (int half = 0; !status && half < (step == 3 ? 2 : 1); half++, first = !first) {
            if (first) {
                status = lathe__slab_emit(s, low->at[i], low->at[i1], high->at[j], flip);
                i = i1;
            } else {
                status = lathe__slab_emit(s, low->at[i], high->at[j1], high->at[j], flip);
                j = j1;
            }
        }
    }
    return status;
}

lathe_status lathe__slab_tile_wall(lathe_slab_build *s, const lathe_slab_nodes *low, const lathe_slab_nodes *high,
                                   const uint32_t turn[2], bool flip) {
    const lathe_slab_nodes *pair[2] = {low, high};
    lathe_point *p[2];
    uint32_t size[2] = {low->count, high->count};
    for (int k = 0; k < 2; k++) {
        if (!(p[k] = LATHE_NEW(s->arena, lathe_point, size[k]))) return LATHE_ERR_MEMORY;
        for (uint32_t i = 0; i < size[k]; i++) p[k][i] = lathe__slab_point(s, pair[k]->at[i]);
    }
    lathe_tiling tiling = {0};
    int32_t rise = s->b.mesh.lattice[high->at[0]][2] - s->b.mesh.lattice[low->at[0]][2];
    lathe_status status = lathe__slab_choose_tiling(&tiling, s, (const lathe_point *const *)p, size, turn, rise);
    if (status == LATHE_ERR_MEMORY) return status;
    s->refused |= status != LATHE_OK;
    return s->refused ? LATHE_OK : emit_wall(s, low, high, &tiling, p, flip);
}

static uint32_t turn_of(const lathe_slab_build *s, uint32_t l) {
    int side = lathe__slab_loop_side(s, l);
    return s->in->turn[side] ? s->in->turn[side][l - (side ? s->loops0 : 0)] : 0;
}

lathe_status lathe__slab_build_tube(lathe_slab_build *s, const lathe_slab_block *b) {
    lathe_slab_nodes low, high;
    bool hole = lathe__slab_loop(s, b->loops[0])->hole;
    lathe_status status = lathe__slab_loop_nodes(&low, s, b->loops[0]);
    if (!status) status = lathe__slab_loop_nodes(&high, s, b->loops[1]);
    uint32_t turn[2] = {turn_of(s, b->loops[0]), turn_of(s, b->loops[1])};
    s->counts->tubes++;
    return status ? status : lathe__slab_tile_wall(s, &low, &high, turn, hole);
}
