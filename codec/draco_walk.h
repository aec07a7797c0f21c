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
    LATHE_RING_REST = 8,       /* of a radius map's vertex: below, it begins a ring of that tube; and more: how far its radius is from what was expected */
    LATHE_SYMBOL_PAIR = LATHE_SYMBOL_RANK + 3 * LATHE_RANK_MOST, /* and more: how far a vertex is from where it was expected, */
    LATHE_PAIR_SIDE = 64,      /* -32 .. 31 both ways */
};
#define LATHE_HALF_UNKNOWN INT32_MIN
enum { LATHE_FORM_RINGS = 12, LATHE_FORM_SAMPLES = 13 }; /* of a structure: below, log2 of its grain; from there on, too, of a raster's surface */

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
    uint8_t *used;             /* vertices of the mesh that the delta has taken */
    uint32_t *partner;         /* writing: of a vertex: the old one that moves there, or NONE */
    uint32_t *free, free_count, free_taken; /* numbers that no vertex has any more, ascending */
    int32_t start[2];          /* where the latest outline begins */
    uint32_t zeros;            /* of quiet numbers: zeros before the next other one */
    bool is_run;               /* reading: `zeros` are known */
    uint64_t work;             /* of the searches for old vertices */
} lathe_draco_walk;

static inline bool lathe__walk_fail(lathe_draco_walk *w, lathe_status status) {
    if (!w->failure) w->failure = status;
    return false;
}
/* A whole number: written, or read over it. Reading beyond the end is FORMAT and gives 0. */
uint32_t lathe__walk_number(lathe_draco_walk *walk, uint32_t value);
int32_t lathe__walk_signed(lathe_draco_walk *walk, int32_t value);

/* Lattice units to the nearest eighth of a voxel edge. */
static inline int32_t lathe__walk_rounded(int32_t lattice) {
    enum { UNIT = LATHE_LATTICE_ONE / LATHE_DRACO_ONE };
    int32_t up = lattice + UNIT / 2;
    return up < 0 ? -((-up + UNIT - 1) / UNIT) : up / UNIT;
}
/* A new vertex; its number is a free one, if there is any. */
void lathe__walk_add(lathe_draco_walk *walk, uint32_t x, int32_t u, int32_t v, int32_t w);

void lathe__walk_slices(lathe_draco_walk *walk);
void lathe__walk_places(lathe_draco_walk *walk);
#endif
