/* The pixels of a decoded structure, for pictures and outlines of slices. Not in the small decoder. */
#include <stdlib.h>
#include "lathe_codec.h"
#include "restream.h"

/* A radius map has no pixels of its own: they are those within its polygons. */
static void fill_from_radii(lathe_structure_state *s) {
    const lathe_radius_map *map = s->radii;
    lathe_mask frame = s->mask;
    lathe_point *polygon = malloc(map->rays * sizeof *polygon);
    if (polygon && !lathe__mask_new(&s->mask, frame.size, frame.origin))
        for (int32_t row = 0; row < map->slices; row++) {
            for (uint32_t i = 0; i < map->rays; i++) polygon[i] = lathe__radius_point(map, row, i);
            lathe__mark_polygon(&s->mask, row, polygon, map->rays);
            lathe__fill_slice(&s->mask, row);
        }
    free(polygon);
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
