/* A slab while it is built: what the files slab_*.c share. Vertices are numbered: the lower outline's, the upper one's,
 * then what is added. Loops alike. Memory is the arena's, but for the two meshes. Functions fail with MEMORY, and where
 * they build with LIMIT. */
#ifndef LATHE_SLAB_BUILD_H
#define LATHE_SLAB_BUILD_H
#include "slab_surface.h"

#define LATHE_SLAB_NONE UINT32_MAX

/* Loops that are linked, directly or through others. */
typedef struct lathe_slab_block {
    uint32_t *loops; /* lower ones first */
    uint32_t count[2];
    lathe_link_kind kind;
    uint32_t piece; /* of the overlay, or NONE: linked by the paper's rule */
} lathe_slab_block;

typedef struct lathe_slab_build {
    const lathe_slab_input *in;
    const lathe_slab_options *options;
    lathe_arena *arena;
    lathe_slab_counts *counts;
    lathe_mesh_builder b;
    lathe_mesh overlay;
    uint32_t *piece;          /* overlay vertex -> the least vertex of its connected piece */
    uint32_t *first, *sorted; /* overlay triangles piece by piece: those of p are sorted[first[p] .. first[p + 1]) */
    uint32_t *members;        /* piece -> its vertices */
    uint32_t *to;             /* overlay vertex -> vertex of the slab, where it has been copied */
    uint32_t *compact;        /* outline vertex -> vertex of the block that is being proved */
    uint32_t upper, vertices; /* the upper outline's first vertex; of both outlines */
    uint32_t loops0, loops;   /* of the lower outline; of both */
    lathe_slab_block *blocks;
    uint32_t block_count;
    bool refused; /* a block: no tiling or polygon came out of it */
} lathe_slab_build;

/* Nodes of a polygon, counter-clockwise: vertices of the slab. */
typedef struct lathe_slab_nodes {
    uint32_t *at, count;
} lathe_slab_nodes;

static inline const lathe_loop *lathe__slab_loop(const lathe_slab_build *s, uint32_t l) {
    return l < s->loops0 ? &s->in->outline[0]->loops[l] : &s->in->outline[1]->loops[l - s->loops0];
}
static inline int lathe__slab_loop_side(const lathe_slab_build *s, uint32_t l) { return l >= s->loops0; }
static inline uint32_t lathe__slab_first_vertex(const lathe_slab_build *s, uint32_t l) {
    return lathe__slab_loop(s, l)->first + (lathe__slab_loop_side(s, l) ? s->upper : 0);
}
/* 0: of the lower outline, 1: of the upper one, 2: added. */
static inline int lathe__slab_side(const lathe_slab_build *s, uint32_t v) {
    return (v >= s->upper) + (v >= s->vertices);
}
static inline lathe_point lathe__slab_point(const lathe_slab_build *s, uint32_t v) {
    const int32_t *p = s->b.mesh.lattice[v];
    return (lathe_point){p[0], p[1]};
}
static inline int32_t lathe__slab_middle(const lathe_slab_build *s) {
    return s->in->height[0] + (s->in->height[1] - s->in->height[0]) / 2;
}
/* How far from its slice what must not lie in it is raised. */
static inline int32_t lathe__slab_rise(const lathe_slab_build *s) {
    int32_t height = s->in->height[1] - s->in->height[0];
    return s->in->end ? s->in->cap : height / 16 > 0 ? height / 16 : 1;
}
static inline double lathe__slab_distance2(lathe_point a, lathe_point b) {
    double x = (double)a.x - b.x, y = (double)a.y - b.y;
    return x * x + y * y;
}

/* slab_build.c */
void lathe__slab_number(lathe_slab_build *s); /* upper, vertices, loops0, loops: from the input */
lathe_status lathe__slab_add_vertex(lathe_slab_build *s, uint32_t *out, int32_t x, int32_t y, int32_t z);
lathe_status lathe__slab_emit(lathe_slab_build *s, uint32_t a, uint32_t b, uint32_t c, bool flip);
lathe_status lathe__slab_loop_nodes(lathe_slab_nodes *out, const lathe_slab_build *s, uint32_t l);
/* The loops of a block as outlines of their own, turned round with flip. of: their vertices, in order. */
lathe_status lathe__slab_cut_out(lathe_outline part[2], uint32_t **of, lathe_slab_build *s, const lathe_slab_block *b,
                                 bool flip);

/* slab_prove.c: positions of both outlines at the begin of a mesh. */
lathe_status lathe__start_slab(lathe_mesh_builder *builder, const lathe_slab_input *in);

/* slab_overlay.c. contacts: where the outlines touch; with any the overlay is not to be trusted. */
lathe_status lathe__slab_overlay(lathe_mesh *out, uint64_t *contacts, lathe_arena *arena, const lathe_slab_input *in,
                                 int32_t cap);
lathe_status lathe__slab_find_pieces(lathe_slab_build *s);
bool lathe__slab_piece_is_plain(const lathe_slab_build *s, const lathe_slab_block *b);
lathe_status lathe__slab_copy_piece(lathe_slab_build *s, uint32_t piece);
lathe_status lathe__slab_overlay_block(lathe_slab_build *s, const lathe_slab_block *b);

/* slab_links.c: makes the blocks. */
lathe_status lathe__slab_link_regions(lathe_slab_build *s);
lathe_status lathe__slab_link_paper(lathe_slab_build *s);
/* The smallest outer loop of the same side that holds a hole, or NONE. */
uint32_t lathe__slab_parent(const lathe_slab_build *s, uint32_t hole);

/* slab_tiling.c. turn: of the trees' first rays; rise: of the upper polygon over the lower one. FORMAT: no tiling. */
lathe_status lathe__slab_choose_tiling(lathe_tiling *out, lathe_slab_build *s, const lathe_point *const p[2],
                                       const uint32_t size[2], const uint32_t turn[2], int32_t rise);

/* slab_wall.c, slab_closing.c, slab_branching.c: where no polygon or tiling comes out, OK, and s->refused is set. */
/* The wall between two polygons; it faces outwards, or inwards with flip. */
lathe_status lathe__slab_tile_wall(lathe_slab_build *s, const lathe_slab_nodes *low, const lathe_slab_nodes *high,
                                   const uint32_t turn[2], bool flip);
lathe_status lathe__slab_build_tube(lathe_slab_build *s, const lathe_slab_block *b);
/* The loops of a block on one side: the largest one is closed, the others are islands in it. */
lathe_status lathe__slab_close_loops(lathe_slab_build *s, const uint32_t *loops, uint32_t count);
lathe_status lathe__slab_build_branching(lathe_slab_build *s, const lathe_slab_block *b);

/* slab_middle.c. The longer side of the box around polygons; middle: its centre. */
double lathe__slab_box_side(const lathe_slab_build *s, const lathe_slab_nodes *list, uint32_t count,
                            lathe_point *middle);
lathe_status lathe__slab_copy_many(lathe_slab_build *s, lathe_slab_nodes *copies, const lathe_slab_nodes *one,
                                   const lathe_slab_nodes *many, uint32_t count, bool many_above, bool flip);
lathe_status lathe__slab_middle_polygon(lathe_slab_build *s, lathe_slab_nodes *out, const lathe_slab_nodes *list,
                                        uint32_t count);

/* slab_flat.c: raises what the triangles from number `from` on have in a slice plane. */
lathe_status lathe__slab_raise_flat(lathe_slab_build *s, uint32_t from, int32_t rise);
#endif
