/* Neighbour information of a triangular grid [P 3.7], and the table of half-edges that it comes from. */
#ifndef LATHE_ADJACENCY_H
#define LATHE_ADJACENCY_H
#include "arena.h"
#include "lathe.h"

enum { LATHE_NO_NEIGHBOUR = 0xffffffffu };

/* Which triangle has the half-edge from a to b. */
typedef struct lathe_half_edges {
    const uint32_t (*triangles)[3];
    uint32_t *slot;            /* open addressing: corner 3 * t + k, whose half-edge goes from corner k to k + 1 */
    uint32_t mask;
    uint32_t repeated;         /* half-edges that an earlier triangle has too; only the first one is found */
} lathe_half_edges;
/* Arena memory; the triangles must stay where they are. LIMIT beyond 2^28 triangles, MEMORY. */
lathe_status lathe__half_edges_build(lathe_half_edges *out, lathe_arena *arena, const uint32_t (*triangles)[3],
                                     uint32_t count);
/* 3 * t + k, or LATHE_NO_NEIGHBOUR. */
uint32_t lathe__half_edge(const lathe_half_edges *edges, uint32_t a, uint32_t b);

/* adt[t][j]: the triangle that shares the edge opposite corner j of triangle t [P 3.7], or LATHE_NO_NEIGHBOUR on a
 * boundary. adt: triangle_count triples. FORMAT if two triangles run along one edge in the same direction (then
 * there is no one neighbour), or an index is out of range. MEMORY, LIMIT. */
lathe_status lathe__find_adjacency(uint32_t (*adt)[3], const lathe_mesh *mesh);
#endif
