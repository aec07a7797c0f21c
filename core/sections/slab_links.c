/* Which loops of a slab belong together: blocks by the overlay's pieces, or by the paper's relation matrix
 * [P 3.1, 3.2]. */
#include "contour_set.h"
#include "slab_build.h"
#include <math.h>
#include <string.h>

static lathe_link_kind kind_of(const uint32_t count[2]) {
    if (!count[0] || !count[1]) return LATHE_LINK_SELF;
    if (count[0] == 1 && count[1] == 1) return LATHE_LINK_ONE_TO_ONE;
    return count[0] == 1 || count[1] == 1 ? LATHE_LINK_ONE_TO_MANY : LATHE_LINK_MANY_TO_MANY;
}

/* Groups loops that have one representative. owner: loop -> representative loop. */
static lathe_status group_loops(lathe_slab_build *s, const uint32_t *owner, bool pieces) {
    uint32_t *number = LATHE_NEW(s->arena, uint32_t, s->loops + 1),
             *members = LATHE_NEW(s->arena, uint32_t, s->loops + 1);
    s->blocks = LATHE_NEW(s->arena, lathe_slab_block, s->loops + 1);
    if (!number || !members || !s->blocks) return LATHE_ERR_MEMORY;
    for (uint32_t l = 0; l < s->loops; l++) {
        if (owner[l] == l) {
            number[l] = s->block_count;
            s->blocks[s->block_count++] =
                (lathe_slab_block){.piece = pieces ? s->piece[lathe__slab_first_vertex(s, l)] : LATHE_SLAB_NONE};
        }
        s->blocks[number[owner[l]]].count[lathe__slab_loop_side(s, l)]++;
    }
    uint32_t used = 0;
    for (uint32_t i = 0; i < s->block_count; i++) {
        lathe_slab_block *b = &s->blocks[i];
        b->loops = members + used;
        used += b->count[0] + b->count[1];
        b->kind = kind_of(b->count);
        s->counts->links[b->kind]++;
        b->count[0] = b->count[1] = 0;
    }
    for (uint32_t l = 0; l < s->loops; l++) {
        lathe_slab_block *b = &s->blocks[number[owner[l]]];
        b->loops[b->count[0] + b->count[1]] = l;
        b->count[lathe__slab_loop_side(s, l)]++;
    }
    return LATHE_OK;
}

lathe_status lathe__slab_link_regions(lathe_slab_build *s) {
    uint32_t *owner = LATHE_NEW(s->arena, uint32_t, s->loops + 1),
             *of_piece = LATHE_NEW(s->arena, uint32_t, s->overlay.vertex_count + 1);
    if (!owner || !of_piece) return LATHE_ERR_MEMORY;
    memset(of_piece, 0xff, s->overlay.vertex_count * sizeof *of_piece);
    for (uint32_t l = 0; l < s->loops; l++) {
        uint32_t *o = &of_piece[s->piece[lathe__slab_first_vertex(s, l)]];
        if (*o == LATHE_SLAB_NONE) *o = l;
        owner[l] = *o;
    }
    return group_loops(s, owner, true);
}

/* The k-th loop of a block of the clustering; rows are the lower outline's. */
static uint32_t clustered_loop(const lathe_clustering *c, const lathe_block *b, uint32_t k, uint32_t *const loops[2]) {
    return k < b->row_count ? loops[0][c->row_order[b->row + k]]
                            : loops[1][c->column_order[b->column + k - b->row_count]];
}

/* The loops of one kind of an outline, without gaps. */
typedef struct polygons {
    lathe_point *points;
    uint32_t *first, *loops, count; /* loops: their numbers in the slab */
} polygons;

static lathe_status gather(polygons *out, lathe_slab_build *s, int side, bool holes) {
    const lathe_outline *o = s->in->outline[side];
    *out = (polygons){LATHE_NEW(s->arena, lathe_point, o->point_count + 1),
                      LATHE_NEW(s->arena, uint32_t, o->loop_count + 1),
                      LATHE_NEW(s->arena, uint32_t, o->loop_count + 1), 0};
    if (!out->points || !out->first || !out->loops) return LATHE_ERR_MEMORY;
    out->first[0] = 0;
    for (uint32_t l = 0; l < o->loop_count; l++) {
        const lathe_loop *loop = &o->loops[l];
        if (loop->hole != holes) continue;
        memcpy(out->points + out->first[out->count], o->points + loop->first, loop->count * sizeof *out->points);
        out->loops[out->count++] = l + (side ? s->loops0 : 0);
        out->first[out->count] = out->first[out->count - 1] + loop->count;
    }
    return LATHE_OK;
}

/* Relation and clustering of the loops of one kind [P 3.1, 3.2]. */
static lathe_status relate_loops(lathe_slab_build *s, uint32_t *owner, bool holes) {
    polygons p[2];
    for (int k = 0; k < 2; k++) {
        lathe_status status = gather(&p[k], s, k, holes);
        if (status) return status;
    }
    uint32_t *const loops[2] = {p[0].loops, p[1].loops};
    lathe_relation relation;
    lathe_clustering clustering;
    lathe_status status = lathe__relate(&relation, s->arena, p[0].points, p[0].first, p[0].count, p[1].points,
                                        p[1].first, p[1].count, s->options->threshold);
    if (!status) status = lathe__cluster(&clustering, s->arena, &relation);
    if (status) return status;
    s->counts->repaired += clustering.repaired;
    for (uint32_t i = 0; i < clustering.block_count; i++) {
        const lathe_block *b = &clustering.blocks[i];
        uint32_t least = LATHE_SLAB_NONE;
        for (uint32_t k = 0; k < b->row_count + b->column_count; k++) {
            uint32_t l = clustered_loop(&clustering, b, k, loops);
            if (l < least) least = l;
        }
        for (uint32_t k = 0; k < b->row_count + b->column_count; k++)
            owner[clustered_loop(&clustering, b, k, loops)] = least;
    }
    return LATHE_OK;
}

uint32_t lathe__slab_parent(const lathe_slab_build *s, uint32_t hole) {
    int side = lathe__slab_loop_side(s, hole);
    const lathe_outline *o = s->in->outline[side];
    uint32_t base = side ? s->loops0 : 0, best = LATHE_SLAB_NONE;
    double least = INFINITY;
    lathe_point p = o->points[o->loops[hole - base].first];
    for (uint32_t l = 0; l < o->loop_count; l++) {
        if (o->loops[l].hole || !lathe__loop_holds(o, l, p)) continue;
        double area = fabs(lathe__loop_area2(o, l));
        if (area < least) least = area, best = l + base;
    }
    return best;
}

/* Holes that end within an outer loop that ends as well are islands of its closing. */
lathe_status lathe__slab_link_paper(lathe_slab_build *s) {
    uint32_t *owner = LATHE_NEW(s->arena, uint32_t, s->loops + 1), *alone = LATHE_NEW(s->arena, uint32_t, s->loops + 1);
    if (!owner || !alone) return LATHE_ERR_MEMORY;
    memset(alone, 0, s->loops * sizeof *alone);
    lathe_status status = relate_loops(s, owner, false);
    if (!status) status = relate_loops(s, owner, true);
    if (status) return status;
    for (uint32_t l = 0; l < s->loops; l++) alone[owner[l]]++;
    for (uint32_t l = 0; l < s->loops; l++) {
        if (!lathe__slab_loop(s, l)->hole || owner[l] != l || alone[l] != 1) continue;
        uint32_t parent = lathe__slab_parent(s, l);
        if (parent != LATHE_SLAB_NONE && owner[parent] == parent && alone[parent] == 1) owner[l] = parent;
    }
    /* An owner comes before what it owns. */
    for (uint32_t l = 0; l < s->loops; l++) alone[l] = LATHE_SLAB_NONE;
    for (uint32_t l = 0; l < s->loops; l++) {
        if (alone[owner[l]] == LATHE_SLAB_NONE) alone[owner[l]] = l;
    }
    for (uint32_t l = 0; l < s->loops; l++) owner[l] = alone[owner[l]];
    return group_loops(s, owner, false);
}
