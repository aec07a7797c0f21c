/* Where plain tubes part, merge, begin or end: their rings are joined as they are. Rings of one slice become a single closed chain of
 * vertices [Christiansen and Sederberg 1978], whose bridges are the shortest there are; the two chains are tiled like any two contours,
 * by the shortest path. Whether the result crosses itself is for the encoder to find out. */
#include <string.h>
#include "radius_tubes.h"

/* Of two vertices as seen from above, squared. Coordinates that are too large wrap. */
static inline uint64_t apart(const int32_t (*at)[3], uint32_t a, uint32_t b) {
    uint64_t x = (uint64_t)((int64_t)at[a][0] - at[b][0]), y = (uint64_t)((int64_t)at[a][1] - at[b][1]);
    return x * x + y * y;
}

static void nearest(uint32_t *a, uint32_t *b, const int32_t (*at)[3], const lathe_ring_chain *lower, const lathe_ring_chain *upper) {
    uint64_t least = UINT64_MAX;
    for (uint32_t i = 0; i < lower->count; i++)
        for (uint32_t k = 0; k < upper->count; k++) {
            uint64_t d = apart(at, lower->vertices[i], upper->vertices[k]);
            if (d < least) least = d, *a = i, *b = k;
        }
}

/* The ring is walked around between two visits of the chain's vertex that is next to it. */
void lathe__chain_ring(lathe_ring_chain *chain, const int32_t (*at)[3], uint32_t first, uint32_t rays) {
    uint32_t from = 0, to = 0, *v = chain->vertices, more = chain->count ? rays + 2 : rays;
    uint32_t ring[LATHE_TUBE_MOST_RAYS];
    for (uint32_t i = 0; i < rays; i++) ring[i] = first + i;
    if (chain->count) {
        nearest(&from, &to, at, chain, &(lathe_ring_chain){ring, rays});
        v += from;
        memmove(v + more, v, (chain->count - from) * sizeof *v);
        v++, v[rays] = ring[to];
    }
    for (uint32_t i = 0; i < rays; i++) v[i] = ring[(to + i) % rays];
    chain->count += more;
}

/* Of all ways to walk around both chains at once, from where they are nearest, the one whose rungs' squares are least in sum. */
lathe_status lathe__join_chains(lathe_mesh *mesh, lathe_arena *arena, const lathe_ring_chain *lower, const lathe_ring_chain *upper) {
    const int32_t(*at)[3] = (const int32_t(*)[3])mesh->lattice;
    uint32_t from = 0, to = 0, m = lower->count, n = upper->count, rows = m > 1 ? m : 0, columns = n > 1 ? n : 0;
    uint64_t *sum = LATHE_NEW(arena, uint64_t, columns + 1);
    bool *below = lathe__arena_alloc(arena, (size_t)rows + 1, (size_t)columns + 1), *step = below;   /* does the last step end on the lower chain? */
    if (!sum || !below) return LATHE_ERR_MEMORY;
    nearest(&from, &to, at, lower, upper);
    for (uint32_t i = 0; i <= rows; i++)
        for (uint32_t k = 0; k <= columns; k++, step++) {
            *step = !k || (i && sum[k] <= sum[k - 1]);
            sum[k] = apart(at, lower->vertices[(from + i) % m], upper->vertices[(to + k) % n]) + (*step ? i ? sum[k] : 0 : sum[k - 1]);
        }
    for (uint32_t i = rows, k = columns; i | k;) {
        uint32_t *t = mesh->triangles[mesh->triangle_count++], a = lower->vertices[(from + i) % m], b = upper->vertices[(to + k) % n];
        if (below[(size_t)i * (columns + 1) + k]) i--, t[0] = lower->vertices[(from + i) % m], t[1] = a;
        else k--, t[0] = a, t[1] = b, b = upper->vertices[(to + k) % n];
        t[2] = b;
    }
    return LATHE_OK;
}
