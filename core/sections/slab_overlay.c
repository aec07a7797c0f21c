/* The lifted overlay of a slab and its connected pieces; the overlay of a block alone. */
#include "slab_build.h"
#include <string.h>

static uint32_t find(uint32_t *parent, uint32_t i) {
    while (parent[i] != i) i = parent[i] = parent[parent[i]];
    return i;
}

static void unite(uint32_t *parent, uint32_t a, uint32_t b) {
    a = find(parent, a), b = find(parent, b);
    parent[a > b ? a : b] = a < b ? a : b;
}

lathe_status lathe__slab_overlay(lathe_mesh *out, uint64_t *contacts, lathe_arena *arena, const lathe_slab_input *in,
                                 int32_t cap) {
    lathe_mesh_builder builder = {0};
    lathe_overlay_counts counts = {0};
    lathe_slab overlay = {.outline = {in->outline[0], in->outline[1]},
                          .height = {in->height[0], in->height[1]},
                          .base = 0,
                          .cap = cap,
                          .lattice = in->lattice};
    lathe_status status = lathe__start_slab(&builder, in);
    if (!status) status = lathe__overlay_slab(&builder, arena, &overlay, &counts);
    if (status) {
        lathe_mesh_free(&builder.mesh);
        return status;
    }
    *out = builder.mesh;
    *contacts = counts.contacts;
    return LATHE_OK;
}

lathe_status lathe__slab_find_pieces(lathe_slab_build *s) {
    uint32_t n = s->overlay.vertex_count, triangles = s->overlay.triangle_count;
    s->piece = LATHE_NEW(s->arena, uint32_t, n + 1);
    s->first = LATHE_NEW(s->arena, uint32_t, n + 2);
    s->sorted = LATHE_NEW(s->arena, uint32_t, triangles + 1);
    s->members = LATHE_NEW(s->arena, uint32_t, n + 1);
    s->to = LATHE_NEW(s->arena, uint32_t, n + 1);
    s->compact = LATHE_NEW(s->arena, uint32_t, s->vertices + 1);
    if (!s->piece || !s->first || !s->sorted || !s->members || !s->to || !s->compact) return LATHE_ERR_MEMORY;
    for (uint32_t i = 0; i < n; i++) s->piece[i] = i;
    for (uint32_t t = 0; t < triangles; t++) {
        unite(s->piece, s->overlay.triangles[t][0], s->overlay.triangles[t][1]);
        unite(s->piece, s->overlay.triangles[t][0], s->overlay.triangles[t][2]);
    }
    memset(s->members, 0, (n + 1) * sizeof *s->members);
    memset(s->first, 0, (n + 2) * sizeof *s->first);
    for (uint32_t i = 0; i < n; i++) s->members[s->piece[i] = find(s->piece, i)]++;
    for (uint32_t t = 0; t < triangles; t++) s->first[s->piece[s->overlay.triangles[t][0]] + 2]++;
    for (uint32_t i = 2; i < n + 2; i++) s->first[i] += s->first[i - 1];
    for (uint32_t t = 0; t < triangles; t++) s->sorted[s->first[s->piece[s->overlay.triangles[t][0]] + 1]++] = t;
    return LATHE_OK;
}

/* Is the block's piece of the overlay a sphere with one opening for each loop? Then what is tiled instead has its
 * topology. */
bool lathe__slab_piece_is_plain(const lathe_slab_build *s, const lathe_slab_block *b) {
    uint32_t vertices = s->members[b->piece], triangles = s->first[b->piece + 1] - s->first[b->piece], open = 0;
    for (uint32_t k = 0; k < b->count[0] + b->count[1]; k++) open += lathe__slab_loop(s, b->loops[k])->count;
    /* Inner edges have two triangles, outline edges one. */
    int64_t edges = (3 * (int64_t)triangles + open) / 2, euler = (int64_t)vertices - edges + triangles;
    return euler == 2 - (int64_t)(b->count[0] + b->count[1]);
}

/* A piece of the slab's overlay. */
lathe_status lathe__slab_copy_piece(lathe_slab_build *s, uint32_t piece) {
    lathe_status status = LATHE_OK;
    for (uint32_t i = s->first[piece]; i < s->first[piece + 1]; i++)
        for (int k = 0; k < 3; k++) {
            uint32_t v = s->overlay.triangles[s->sorted[i]][k];
            s->to[v] = v < s->vertices ? v : LATHE_SLAB_NONE;
        }
    for (uint32_t i = s->first[piece]; !status && i < s->first[piece + 1]; i++) {
        const uint32_t *t = s->overlay.triangles[s->sorted[i]];
        for (int k = 0; k < 3 && !status; k++) {
            const int32_t *p = s->overlay.lattice[t[k]];
            if (s->to[t[k]] == LATHE_SLAB_NONE) status = lathe__slab_add_vertex(s, &s->to[t[k]], p[0], p[1], p[2]);
        }
        if (!status) status = lathe__slab_emit(s, s->to[t[0]], s->to[t[1]], s->to[t[2]], false);
    }
    return status;
}

/* The overlay of a block's loops alone; a block of holes is turned inside out. */
lathe_status lathe__slab_overlay_block(lathe_slab_build *s, const lathe_slab_block *b) {
    bool flip = lathe__slab_loop(s, b->loops[0])->hole;
    lathe_outline part[2];
    uint32_t *of;
    lathe_status status = lathe__slab_cut_out(part, &of, s, b, flip);
    if (status) return status;
    uint32_t total = part[0].point_count + part[1].point_count;
    lathe_slab_input in = *s->in;
    lathe_mesh mesh = {0};
    uint64_t contacts;
    in.outline[0] = &part[0], in.outline[1] = &part[1];
    /* Links by threshold leave loops apart that overlap: their caps must not meet at the middle height. */
    status = lathe__slab_overlay(&mesh, &contacts, s->arena, &in, (in.height[1] - in.height[0]) / 2 / 8 * 7);
    uint32_t *to = status ? NULL : LATHE_NEW(s->arena, uint32_t, mesh.vertex_count + 1);
    if (!status && !to) status = LATHE_ERR_MEMORY;
    for (uint32_t v = 0; !status && v < mesh.vertex_count; v++) {
        if (v < total)
            to[v] = of[v];
        else
            status = lathe__slab_add_vertex(s, &to[v], mesh.lattice[v][0], mesh.lattice[v][1], mesh.lattice[v][2]);
    }
    for (uint32_t i = 0; !status && i < mesh.triangle_count; i++)
        status =
            lathe__slab_emit(s, to[mesh.triangles[i][0]], to[mesh.triangles[i][1]], to[mesh.triangles[i][2]], flip);
    lathe_mesh_free(&mesh);
    return status;
}
