#include "adjacency.h"
#include <string.h>

static uint32_t hash_pair(uint32_t a, uint32_t b) {
    uint64_t h = ((uint64_t)a << 32 | b) * 0x9E3779B97F4A7C15u;
    return (uint32_t)(h >> 32 ^ h >> 13);
}

static bool is_edge(const lathe_half_edges *e, uint32_t corner, uint32_t a, uint32_t b) {
    const uint32_t *t = e->triangles[corner / 3];
    return t[corner % 3] == a && t[(corner + 1) % 3] == b;
}

lathe_status lathe__half_edges_build(lathe_half_edges *out, lathe_arena *arena, const uint32_t (*triangles)[3],
                                     uint32_t count) {
    if (count > 1u << 28) return LATHE_ERR_LIMIT;
    uint32_t size = 16;
    while (size < count * 6) size *= 2;
    lathe_half_edges e = {.triangles = triangles, .slot = LATHE_NEW(arena, uint32_t, size), .mask = size - 1};
    if (!e.slot) return LATHE_ERR_MEMORY;
    memset(e.slot, 0xff, size * sizeof *e.slot);
    for (uint32_t i = 0; i < count * 3; i++) {
        uint32_t a = triangles[i / 3][i % 3], b = triangles[i / 3][(i + 1) % 3], h = hash_pair(a, b) & e.mask;
        while (e.slot[h] != LATHE_NO_NEIGHBOUR && !is_edge(&e, e.slot[h], a, b)) h = (h + 1) & e.mask;
        if (e.slot[h] == LATHE_NO_NEIGHBOUR) e.slot[h] = i;
        else e.repeated++;
    }
    *out = e;
    return LATHE_OK;
}

uint32_t lathe__half_edge(const lathe_half_edges *e, uint32_t a, uint32_t b) {
    uint32_t h = hash_pair(a, b) & e->mask;
    while (e->slot[h] != LATHE_NO_NEIGHBOUR && !is_edge(e, e->slot[h], a, b)) h = (h + 1) & e->mask;
    return e->slot[h];
}

lathe_status lathe__find_adjacency(uint32_t (*adt)[3], const lathe_mesh *mesh) {
    lathe_arena arena = {0};
    lathe_half_edges edges;
    for (uint32_t t = 0; t < mesh->triangle_count; t++)
        for (int k = 0; k < 3; k++)
            if (mesh->triangles[t][k] >= mesh->vertex_count) return LATHE_ERR_FORMAT;
    lathe_status status =
        lathe__half_edges_build(&edges, &arena, (const uint32_t(*)[3])mesh->triangles, mesh->triangle_count);
    if (!status && edges.repeated) status = LATHE_ERR_FORMAT;
    for (uint32_t t = 0; !status && t < mesh->triangle_count; t++)
        for (int k = 0; k < 3; k++) {
            const uint32_t *v = mesh->triangles[t];
            uint32_t other = lathe__half_edge(&edges, v[(k + 2) % 3], v[(k + 1) % 3]);
            adt[t][k] = other == LATHE_NO_NEIGHBOUR ? other : other / 3;
        }
    lathe__arena_free(&arena);
    return status;
}
