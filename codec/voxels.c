/* The pixels of a decoded structure, for pictures and outlines of slices. Not in the small decoder. */
#include <stdlib.h>
#include "lathe_codec.h"
#include "restream.h"

/* Radius maps have no pixels of their own: they are those within their polygons. */
static void fill_from_radii(lathe_structure_state *s) {
    lathe_mask frame = s->mask;
    lathe_arena arena = {0};
    if (lathe__mask_new(&s->mask, frame.size, frame.origin)) return;
    for (int32_t w = 0; w < s->radii->slices; w++) {
        lathe_outline outline;
        if (lathe__radii_outline(&outline, &arena, s->radii, s->radii->level_count - 1, w, 1, 0)) break;
        for (uint32_t i = 0; i < outline.loop_count; i++)
            lathe__mark_polygon(&s->mask, w, outline.points + outline.loops[i].first, outline.loops[i].count);
        lathe__fill_slice(&s->mask, w);
        lathe__arena_reset(&arena);
    }
    lathe__arena_free(&arena);
}

bool lathe_decoder_voxels(lathe_decoder *decoder, uint32_t structure, lathe_voxels *out) {
    if (structure >= lathe_decoder_structures(decoder)) return false;
    lathe_structure_state *s = lathe__decoder_state(decoder, structure);
    bool whole = s->level + 1 == (int32_t)s->plan.level_count;
    if (s->radii && whole && !s->mask.bits) fill_from_radii(s);
    *out = (lathe_voxels){.row_words = s->mask.row_words, .fraction = s->fraction, .bits = s->mask.bits};
    for (int k = 0; k < 3; k++) {
        out->size[k] = s->mask.size[k];
        out->origin[k] = s->mask.origin[k];
    }
    return true;
}
