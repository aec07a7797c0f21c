/* The binary tree of the pieces of an outline [H 1, 2.1]: Douglas-Peucker's, with octangles and errors; all loops in
 * one tree. */
#ifndef LATHE_PIECE_TREE_H
#define LATHE_PIECE_TREE_H
#include "octangle.h"
#include "hierarchy.h"

/* A piece of a loop from one vertex to another: the index of a node, or a single edge: PIECE_EDGE + the vertex it
 * begins in. */
typedef uint32_t lathe_piece;
#define LATHE_PIECE_EDGE 0x80000000u
#define LATHE_NO_PIECE 0xffffffffu

typedef struct lathe_piece_node {
    lathe_octangle bound;      /* of the whole piece, so that it holds the chord of every piece below it */
    double error;              /* largest distance of a vertex from the chord as a segment; lattice units */
    double attribute;          /* expanded at tolerances below this */
    uint32_t from, to;         /* vertices; to == the loop's first: the piece ends where the loop closes */
    uint32_t split;            /* the vertex between the two children */
    uint32_t loop;
    lathe_piece child[2];
    bool group;                /* no piece: two groups of loops, or the two halves of one loop */
    bool forced;               /* its chord would change what lies inside what: always expanded */
    bool expanded;
    bool early;                /* expanded at a greater tolerance than its own error asks for */
} lathe_piece_node;

typedef struct lathe_piece_tree {
    lathe_point *at;           /* the loops' points; each loop begins with its lowest point here */
    uint32_t *rotation;        /* per loop: which of its points that is */
    uint32_t *loop_of;         /* per point */
    const lathe_loop *loops;
    lathe_piece_node *nodes;   /* parents before children; node 0 is the root */
    uint32_t point_count, loop_count, node_count;
    uint64_t work;             /* distances computed */
} lathe_piece_tree;

/* Memory is the arena's. FORMAT, RANGE, LIMIT, MEMORY as lathe__hierarchy_build has them. */
lathe_status lathe__piece_tree_build(lathe_piece_tree *tree, lathe_arena *arena, const lathe_outline *outline);
/* Marks pieces whose chord would have a vertex of another loop change sides. False: more than `most` steps; nothing
 * is to be relied on then. MEMORY: status. */
lathe_status lathe__piece_tree_mark(lathe_piece_tree *tree, lathe_arena *arena, uint64_t most, bool *done);

static inline uint32_t lathe__piece_from(const lathe_piece_tree *tree, lathe_piece piece) {
    return piece & LATHE_PIECE_EDGE ? piece & ~LATHE_PIECE_EDGE : tree->nodes[piece].from;
}
static inline uint32_t lathe__piece_to(const lathe_piece_tree *tree, lathe_piece piece) {
    if (!(piece & LATHE_PIECE_EDGE)) return tree->nodes[piece].to;
    uint32_t v = (piece & ~LATHE_PIECE_EDGE) + 1;
    const lathe_loop *loop = &tree->loops[tree->loop_of[v - 1]];
    return v < loop->first + loop->count ? v : loop->first;
}
#endif
