/* One slab, in four steps:
 *   1. the lifted overlay of both outlines: it says which loops belong together, does the joints, and is what the slab
 *      falls back to (slab_overlay.c);
 *   2. blocks of linked loops, by the overlay's pieces or by the paper's relation matrix (slab_links.c);
 *   3. each block is tiled (slab_wall.c), branched (slab_branching.c), closed (slab_closing.c), or left to the overlay;
 *      one whose triangles meet falls back to the overlay;
 *   4. the whole is proved (slab_prove.c); where it fails, the overlay is taken, proved as well. */
#include "slab_build.h"
#include <string.h>

static bool is_uniform(const lathe_slab_build *s, const lathe_slab_block *b) {
    for (uint32_t k = 1; k < b->count[0] + b->count[1]; k++)
        if (lathe__slab_loop(s, b->loops[k])->hole != lathe__slab_loop(s, b->loops[0])->hole) return false;
    return true;
}

/* Are the block's triangles from `from` on, with the vertices from `added` on, a proper surface between its loops? */
static lathe_status is_free(bool *out, lathe_slab_build *s, const lathe_slab_block *b, uint32_t from, uint32_t added) {
    lathe_outline part[2];
    lathe_mesh_builder builder = {0};
    lathe_slab_input in = *s->in;
    lathe_slab_faults faults = {0};
    uint32_t *of, count = s->b.mesh.triangle_count - from, more = s->b.mesh.vertex_count - added;
    lathe_status status = lathe__slab_cut_out(part, &of, s, b, false);
    in.outline[0] = &part[0], in.outline[1] = &part[1];
    if (!status) status = lathe__start_slab(&builder, &in);
    if (!status) status = lathe__builder_reserve(&builder, more, count);
    if (!status) {
        lathe_mesh *m = &builder.mesh;
        uint32_t own = m->vertex_count;
        for (uint32_t v = 0; v < own; v++) s->compact[of[v]] = v;
        memcpy(m->lattice + own, s->b.mesh.lattice + added, more * sizeof *m->lattice);
        m->vertex_count += more;
        m->triangle_count = count;
        for (uint32_t i = 0; i < count * 3; i++) {
            uint32_t v = s->b.mesh.triangles[from + i / 3][i % 3];
            m->triangles[i / 3][i % 3] = v < s->vertices ? s->compact[v] : v - added + own;
        }
        status = lathe__prove_slab(&faults, s->arena, m, &in);
    }
    *out = lathe__slab_is_sound(&faults);
    lathe_mesh_free(&builder.mesh);
    return status;
}

static lathe_status build_block(lathe_slab_build *s, const lathe_slab_block *b) {
    uint32_t vertices = s->b.mesh.vertex_count, triangles = s->b.mesh.triangle_count;
    bool paper = s->options->branching == LATHE_BRANCHING_PAPER, uniform = is_uniform(s, b), done = true, free = true;
    lathe_slab_counts before = *s->counts;
    lathe_status status = LATHE_OK;
    s->refused = false;
    if (b->piece != LATHE_SLAB_NONE && b->kind != LATHE_LINK_SELF && !lathe__slab_piece_is_plain(s, b)) {
        s->counts->handles++;
        s->counts->overlaid++;
        return lathe__slab_copy_piece(s, b->piece);
    }
    if (b->kind == LATHE_LINK_ONE_TO_ONE && uniform)
        status = lathe__slab_build_tube(s, b);
    else if (b->kind == LATHE_LINK_SELF && (paper || s->in->end))
        status = lathe__slab_close_loops(s, b->loops, b->count[0] + b->count[1]);
    else if (b->kind != LATHE_LINK_SELF && paper && uniform)
        status = lathe__slab_build_branching(s, b);
    else
        done = false;
    if (!status && done && !s->refused && lathe__slab_rise(s))
        status = lathe__slab_raise_flat(s, triangles, lathe__slab_rise(s));
    if (!status && done && !s->refused) status = is_free(&free, s, b, triangles, vertices);
    if (status || (done && free && !s->refused)) return status;
    bool refused = s->refused;
    *s->counts = before;
    if (done) ++*(refused ? &s->counts->refused : &s->counts->crossed);
    s->counts->overlaid++;
    s->b.mesh.vertex_count = vertices;
    s->b.mesh.triangle_count = triangles;
    return b->piece != LATHE_SLAB_NONE ? lathe__slab_copy_piece(s, b->piece) : lathe__slab_overlay_block(s, b);
}

static lathe_status build(lathe_slab_build *s) {
    lathe__slab_number(s);
    lathe_status status = lathe__slab_find_pieces(s);
    if (!status)
        status = s->options->links == LATHE_LINKS_PAPER && !s->in->end ? lathe__slab_link_paper(s)
                                                                       : lathe__slab_link_regions(s);
    if (!status) status = lathe__start_slab(&s->b, s->in);
    for (uint32_t i = 0; !status && i < s->block_count; i++) status = build_block(s, &s->blocks[i]);
    return status;
}

/* What was built, if it is sound; else the overlay, if that is. Takes the mesh it chooses out of s. */
static lathe_status settle(lathe_mesh *out, lathe_slab_outcome *outcome, lathe_slab_faults *faults,
                           lathe_slab_build *s) {
    lathe_slab_faults found = {0};
    lathe_status status = lathe__prove_slab(&found, s->arena, &s->b.mesh, s->in);
    if (status) return status;
    if (lathe__slab_is_sound(&found)) {
        *out = s->b.mesh;
        s->b.mesh = (lathe_mesh){0};
        *outcome = LATHE_SLAB_SOUND;
        return LATHE_OK;
    }
    *faults = found;
    /* Beyond the ends a flat cap has no overlay to fall back to. */
    if (!s->in->end || s->in->cap) status = lathe__prove_slab(&found, s->arena, &s->overlay, s->in);
    if (status) return status;
    if (!lathe__slab_is_sound(&found)) {
        *faults = found;
        return LATHE_OK;
    }
    *out = s->overlay;
    s->overlay = (lathe_mesh){0};
    *outcome = LATHE_SLAB_OVERLAID;
    s->counts->tubes = s->counts->branched = s->counts->closed = s->counts->copied = 0;
    s->counts->overlaid = s->block_count;
    return LATHE_OK;
}

lathe_status lathe__build_slab(lathe_mesh *out, lathe_slab_outcome *outcome, lathe_slab_counts *counts,
                               lathe_slab_faults *faults, lathe_arena *arena, const lathe_slab_input *in,
                               const lathe_slab_options *options) {
    lathe_slab_counts mine = {0};
    lathe_slab_build s = {.in = in, .options = options, .arena = arena, .counts = &mine};
    uint64_t contacts = 0;
    *outcome = LATHE_SLAB_AT_FAULT;
    *out = (lathe_mesh){0};
    lathe_status status = lathe__slab_overlay(&s.overlay, &contacts, arena, in,
                                              in->end && in->cap ? in->cap : (in->height[1] - in->height[0]) / 2);
    if (status || contacts) goto cleanup; /* outlines that touch: what the overlay says is not to be trusted */
    status = build(&s);
    if (!status) status = settle(out, outcome, faults, &s);
    if (!status) *counts = mine;
cleanup:
    lathe_mesh_free(&s.b.mesh);
    lathe_mesh_free(&s.overlay);
    return status;
}
