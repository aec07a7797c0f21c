/* Loops that end in a slab: closed in their plane, with islands [P 3.3]. */
#include "closing.h"
#include "contour_set.h"
#include "slab_build.h"
#include <math.h>

lathe_status lathe__slab_close_loops(lathe_slab_build *s, const uint32_t *loops, uint32_t count) {
    uint32_t total = 0, root = 0, used = 0;
    for (uint32_t k = 0; k < count; k++) {
        const lathe_outline *o = s->in->outline[lathe__slab_loop_side(s, loops[0])];
        uint32_t base = lathe__slab_loop_side(s, loops[0]) ? s->loops0 : 0;
        total += lathe__slab_loop(s, loops[k])->count;
        if (fabs(lathe__loop_area2(o, loops[k] - base)) > fabs(lathe__loop_area2(o, loops[root] - base))) root = k;
    }
    lathe_point *at = LATHE_NEW(s->arena, lathe_point, total);
    uint32_t *of = LATHE_NEW(s->arena, uint32_t, total), *ring = LATHE_NEW(s->arena, uint32_t, total);
    uint32_t *end = LATHE_NEW(s->arena, uint32_t, count);
    if (!at || !of || !ring || !end) return LATHE_ERR_MEMORY;
    for (uint32_t k = 0; k < count; k++) {
        lathe_slab_nodes n;
        uint32_t l = loops[k == 0 ? root : k == root ? 0 : k];
        lathe_status status = lathe__slab_loop_nodes(&n, s, l);
        if (status) return status;
        for (uint32_t i = 0; i < n.count; i++, used++) {
            of[used] = n.at[k ? n.count - 1 - i : i];
            at[used] = lathe__slab_point(s, of[used]);
            ring[used] = used;
        }
        end[k] = used;
    }
    lathe_polygon polygon = {.at = at, .nodes = ring, .ring_end = end, .ring_count = count};
    lathe_triangles list = {0};
    lathe_status status = lathe__close_with_islands(&list, s->arena, &polygon);
    bool flip = lathe__slab_loop(s, loops[root])->hole != (lathe__slab_loop_side(s, loops[0]) == 1);
    for (uint32_t i = 0; !status && i < list.count; i++)
        status = lathe__slab_emit(s, of[list.at[i][0]], of[list.at[i][1]], of[list.at[i][2]], flip);
    s->counts->closed++;
    return status;
}
