/* Occupancy of a slice, coded with contexts of the slices already known. The heart of the polar stream's levels 1..N. */
#ifndef LATHE_OCCUPANCY_H
#define LATHE_OCCUPANCY_H
#include "lathe.h"
#include "range_coder.h"

/* What is known when a slice is coded. All slices have the same size: rows x row_words words, margin of one empty pixel.
 * NULL: not known (treat as unknown, not as empty). gap: distance in slices. */
typedef struct lathe_known {
    const uint64_t *below, *above;      /* nearest known slices on either side */
    int32_t gap_below, gap_above;
    int32_t estimate;                   /* 0: above is a slice; 1: it is an estimate of this very slice; 2: of one farther up */
} lathe_known;

typedef struct lathe_occupancy lathe_occupancy;    /* adaptive state; one per structure, kept over its levels */
/* Size in pixels, margin included. sure: pixels that one small context is sure of are coded by it alone, four times as fast; slices
 * are never estimates then. */
lathe_status lathe__occupancy_new(lathe_occupancy **out, int32_t width, int32_t height, bool sure);
/* A fresh state beside one that has not coded yet: `from` is only a template, whose start-up training (1.4 ms) is saved. */
lathe_status lathe__occupancy_copy(lathe_occupancy **out, const lathe_occupancy *from, int32_t width, int32_t height);
/* The size of the slices to come. What was learned stays. */
lathe_status lathe__occupancy_frame(lathe_occupancy *state, int32_t width, int32_t height);
void lathe__occupancy_free(lathe_occupancy **state);
lathe_status lathe__occupancy_encode(lathe_occupancy *state, lathe_range_encoder *e, const uint64_t *slice,
                                     const lathe_known *known);
/* slice: cleared and written; the margin always comes out empty whatever the bytes are. */
lathe_status lathe__occupancy_decode(lathe_occupancy *state, lathe_range_decoder *d, uint64_t *slice, const lathe_known *known);
#endif
