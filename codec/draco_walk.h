/* A walk over the vertices of a delta; writer and reader take the same one. draco_slices.c: which slice each vertex lies in;
 * draco_place.c: where it lies there; draco_walk.c: what both need, and the mesh that results. */
#ifndef LATHE_DRACO_WALK_H
#define LATHE_DRACO_WALK_H
#include "archive_write.h"
#include "arena.h"
#include "draco_delta.h"
#include "draco_rank.h"

enum {
    LATHE_SYMBOL_START = 0,    /* of an outline's first vertex: numbers follow */
    LATHE_SYMBOL_NUMBERS = 1,  /* numbers follow */
    LATHE_SYMBOL_RANK = 2,     /* and more: a rank */
    LATHE_SYMBOL_PAIR = LATHE_SYMBOL_RANK + 3 * LATHE_RANK_MOST, /* and more: how far a vertex is from where it was expected, */
    LATHE_PAIR_SIDE = 64,      /* -32 .. 31 both ways */
};
#define LATHE_HALF_UNKNOWN INT32_MIN

typedef struct lathe_draco_walk {
    lathe_draco_mesh *mesh;
    lathe_draco_carrier *c;
    const lathe_draco_truth *truth; /* NULL: reading */
    lathe_arena arena;
    lathe_ranks ranks;
    lathe_bytes numbers;       /* written; or to be read, from `read` on */
    size_t read;
    lathe_status failure;
    uint32_t *twin;            /* corner 3 t + k stands for the edge from corner k of triangle t to the next: the one the other way */
    uint32_t *first, *corner;  /* vertex -> its corners, ascending */
    int32_t *half;             /* as in the truth */
    uint32_t *part, *next, *before, *id; /* per vertex: structure, along its outline, the other way, number in the mesh */
    uint32_t *touched, touched_count;    /* structures that the delta has */
    uint8_t *is_touched;
    uint8_t *used;             /* writing: vertices of the mesh that the delta has taken */
    uint32_t old_count;        /* vertices before the delta */
    int32_t start[2];          /* where the latest outline begins */
    uint64_t work;             /* of the searches for old vertices */
} lathe_draco_walk;

static inline bool lathe__walk_fail(lathe_draco_walk *w, lathe_status status) {
    if (!w->failure) w->failure = status;
    return false;
}
/* A whole number: written, or read over it. Reading beyond the end is FORMAT and gives 0. */
uint32_t lathe__walk_number(lathe_draco_walk *walk, uint32_t value);
int32_t lathe__walk_signed(lathe_draco_walk *walk, int32_t value);

void lathe__walk_slices(lathe_draco_walk *walk);
void lathe__walk_places(lathe_draco_walk *walk);
#endif
