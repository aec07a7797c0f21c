/* One structure of a bake: its packets, and what `info` says of its levels. */
#ifndef LATHE_STRUCTURE_ENCODE_H
#define LATHE_STRUCTURE_ENCODE_H
#include "archive_write.h"
#include "structure_state.h"

typedef struct lathe_baked_structure {
    uint32_t level_count;
    lathe_bytes packets[LATHE_MAX_LEVELS];
    lathe_level_info levels[LATHE_MAX_LEVELS];
    double area_mm2;           /* of the reference surface; 0 when nothing was measured */
} lathe_baked_structure;
void lathe__baked_free(lathe_baked_structure *baked);

/* Takes a state whose mask is the whole structure; chooses its plan. Fills packets. */
lathe_status lathe__structure_encode(lathe_baked_structure *out, lathe_structure_state *state, lathe_arena arena[2],
                                     lathe_occupancy **trained);
#endif
