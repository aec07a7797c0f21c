/* The last resort of a slab that cannot be joined: every loop closed for itself. */
#include "slab_build.h"

/* Every outer loop with the holes in it. */
static lathe_status close_all(lathe_slab_build *s) {
    uint32_t *loops = LATHE_NEW(s->arena, uint32_t, s->loops + 1),
             *parent = LATHE_NEW(s->arena, uint32_t, s->loops + 1);
    if (!loops || !parent) return LATHE_ERR_MEMORY;
    for (uint32_t l = 0; l < s->loops; l++)
        parent[l] = lathe__slab_loop(s, l)->hole ? lathe__slab_parent(s, l) : LATHE_SLAB_NONE;
    lathe_status status = LATHE_OK;
    for (uint32_t l = 0; !status && l < s->loops; l++) {
        if (lathe__slab_loop(s, l)->hole) continue;
        uint32_t count = 0;
        loops[count++] = l;
        for (uint32_t k = 0; k < s->loops; k++)
            if (parent[k] == l) loops[count++] = k;
        status = lathe__slab_close_loops(s, loops, count);
    }
    return status;
}

lathe_status lathe__separate_slab(lathe_mesh *out, lathe_slab_outcome *outcome, lathe_slab_faults *faults,
                                  lathe_arena *arena, const lathe_slab_input *in) {
    lathe_slab_counts counts = {0};
    lathe_slab_options options = {.branching = LATHE_BRANCHING_PAPER};
    lathe_slab_build s = {.in = in, .options = &options, .arena = arena, .counts = &counts};
    lathe__slab_number(&s);
    *out = (lathe_mesh){0};
    *outcome = LATHE_SLAB_AT_FAULT;
    lathe_status status = lathe__start_slab(&s.b, in);
    if (!status) status = close_all(&s);
    if (!status && lathe__slab_rise(&s)) status = lathe__slab_raise_flat(&s, 0, lathe__slab_rise(&s));
    if (!status) status = lathe__prove_slab(faults, arena, &s.b.mesh, in);
    if (!status && lathe__slab_is_sound(faults)) {
        *out = s.b.mesh;
        *outcome = LATHE_SLAB_SOUND;
        return LATHE_OK;
    }
    lathe_mesh_free(&s.b.mesh);
    return status;
}
