/* The surface between two neighbouring sections: linked, tiled, branched, closed, and proved. */
#ifndef LATHE_SLAB_SURFACE_H
#define LATHE_SLAB_SURFACE_H
#include "overlay.h"
#include "relation.h"
#include "sections.h"

typedef enum lathe_link_rule {
    LATHE_LINKS_REGIONS,       /* loops that share a cell of the overlay of both regions, or cross (default) */
    LATHE_LINKS_PAPER          /* overlap degree of convex hulls against a threshold, outer loops and holes apart [P
                                * 3.1, 3.2] */
} lathe_link_rule;
typedef enum lathe_branching {
    LATHE_BRANCHING_OVERLAY,   /* joints are lifted overlays (default) */
    LATHE_BRANCHING_PAPER      /* exterior and interior polygons, contour closing [P 3.3, 3.5, 3.6] where all loops
                                * of a block are outer ones or all are holes; else the overlay */
} lathe_branching;

typedef struct lathe_slab_options {
    lathe_link_rule links;
    double threshold;          /* of LATHE_LINKS_PAPER */
    lathe_tiling_method tiling;/* of one-to-one links and of exterior polygons */
    uint32_t rays;             /* of LATHE_TILING_TREES, a power of two >= 8; 0: chosen for each pair */
    lathe_branching branching;
    bool mid_slices;           /* one-to-many: copy the many to the middle height where the slab is wide, that is
                                * higher than a quarter of the longer side of their box [P 3.5] */
} lathe_slab_options;

typedef struct lathe_slab_input {
    const lathe_outline *outline[2];   /* lower, upper; one without points is air */
    int32_t height[2];
    const uint32_t *turn[2];   /* per loop: where its first ray points, 1/65536 of a full turn; NULL: 0 everywhere */
    bool lattice;              /* every edge lies within one pixel square */
    int32_t cap;               /* at the ends (one outline is air): how far a cap rises; 0: it is flat */
    bool end;                  /* beyond the first or the last section */
} lathe_slab_input;

/* What became of a slab; sums over slabs. */
typedef struct lathe_slab_counts {
    uint64_t links[4];         /* blocks by lathe_link_kind */
    uint64_t tubes, branched, closed, overlaid;    /* blocks by what was done with them */
    uint64_t copied;           /* branched blocks with a copy of the many at the middle height */
    uint64_t treeless;         /* tubes without derivation trees: by shortest span instead */
    uint64_t refused, crossed; /* blocks that fell back to the overlay: no polygon or tiling came out; what did was torn
                                * or met itself */
    uint64_t handles;          /* blocks left to the overlay because the regions' overlap has holes or several parts:
                                * a wall would close what is open there (links by regions only) */
    uint64_t repaired;         /* relations whose rank order clustering was stopped with a block in pieces */
} lathe_slab_counts;

/* Why a slab is no surface. All zero: it is one. */
typedef struct lathe_slab_faults {
    uint64_t degenerate;       /* triangles without area */
    uint64_t edges;            /* half-edges twice, without partner, or outline edges not used once in their
                                * direction */
    uint64_t fans;             /* vertices whose triangles are not one fan */
    uint64_t flat;             /* triangles or inner edges in a slice plane, vertices beyond the slab */
    uint64_t duplicates;       /* vertices at one position */
    uint64_t crossings;        /* pairs of triangles that meet beyond what they share */
} lathe_slab_faults;

/* mesh: the lower outline's vertices, then the upper one's, then others. A slab without faults meets its neighbours
 * in the outlines only: together they close. Exact. MEMORY, LIMIT. */
lathe_status lathe__prove_slab(lathe_slab_faults *out, lathe_arena *arena, const lathe_mesh *mesh,
                               const lathe_slab_input *in);
bool lathe__slab_is_sound(const lathe_slab_faults *faults);

typedef enum lathe_slab_outcome {
    LATHE_SLAB_SOUND,          /* as asked */
    LATHE_SLAB_OVERLAID,       /* the whole slab fell back to the lifted overlay */
    LATHE_SLAB_AT_FAULT        /* the overlay is at fault too: outlines touch, or rounding folds it. out is empty */
} lathe_slab_outcome;

/* Builds one slab and proves it. out: as for lathe__prove_slab, owned by the caller, vertices of both outlines
 * included. faults: of the last thing that failed. MEMORY, LIMIT, RANGE. Scratch comes from the arena. */
lathe_status lathe__build_slab(lathe_mesh *out, lathe_slab_outcome *outcome, lathe_slab_counts *counts,
                               lathe_slab_faults *faults, lathe_arena *arena, const lathe_slab_input *in,
                               const lathe_slab_options *options);
/* The last resort: every loop of both outlines closed for itself, within its half of the slab. */
lathe_status lathe__separate_slab(lathe_mesh *out, lathe_slab_outcome *outcome, lathe_slab_faults *faults,
                                  lathe_arena *arena, const lathe_slab_input *in);
#endif
