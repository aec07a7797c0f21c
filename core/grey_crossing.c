#include "grey_crossing.h"
#include "outline.h"

float lathe__frame_value(const lathe_volume *volume, const int32_t frame[3], int32_t u, int32_t v, int32_t w) {
    int32_t at[3];
    at[frame[0]] = u, at[frame[1]] = v, at[frame[2]] = w;
    for (int k = 0; k < 3; k++)
        if (at[k] < 0 || at[k] >= volume->dims[k]) return volume->min;
    return volume->values[((size_t)at[2] * (size_t)volume->dims[1] + (size_t)at[1]) * (size_t)volume->dims[0] + (size_t)at[0]];
}

typedef struct crossings {
    const lathe_mask *mask;
    const lathe_volume *volume;
    int32_t frame[3];
    double iso, sum;
    size_t count;
} crossings;

/* Of 64 pixels from (u, v, w) on: those whose bit is set differ from the next one along an axis. */
static void add_word(crossings *c, uint64_t change, int32_t u, int32_t v, int32_t w, int axis) {
    const int32_t *o = c->mask->origin;
    for (; change; change &= change - 1) {
        int32_t at = o[0] + u + __builtin_ctzll(change);
        float p = lathe__frame_value(c->volume, c->frame, at, o[1] + v, o[2] + w);
        float q = lathe__frame_value(c->volume, c->frame, at + (axis == 0), o[1] + v + (axis == 1), o[2] + w + (axis == 2));
        double inside = p >= q ? p : q, outside = p >= q ? q : p;
        if (inside > outside) c->sum += (inside - c->iso) / (inside - outside), c->count++;
    }
}

static void add_row(crossings *c, int32_t v, int32_t w, bool upright) {
    const lathe_mask *mask = c->mask;
    size_t words = (size_t)mask->row_words, offset = (size_t)v * words;
    const uint64_t *row = w < 0 ? NULL : lathe__mask_slice(mask, w) + offset;
    const uint64_t *above = upright && w + 1 < mask->size[2] ? lathe__mask_slice(mask, w + 1) + offset : NULL;
    for (size_t i = 0; i < words; i++) {
        uint64_t here = row ? row[i] : 0;
        int32_t u = (int32_t)i * 64;
        if (upright) {
            add_word(c, here ^ (above ? above[i] : 0), u, v, w, 2);
            continue;
        }
        add_word(c, here ^ lathe__row_next(row, i, words), u, v, w, 0);
        if (v + 1 < mask->size[1]) add_word(c, here ^ row[i + words], u, v, w, 1);
    }
}

int lathe__mean_fraction(const lathe_mask *mask, const lathe_volume *volume, lathe_axis axis, double iso, bool upright) {
    crossings c = {.mask = mask, .volume = volume, .iso = iso};
    lathe__axis_frame(axis, c.frame);
    for (int32_t w = -upright; w < mask->size[2]; w += mask->size[2] / 24 + 1)
        for (int32_t v = 0; v < mask->size[1]; v++) add_row(&c, v, w, upright);
    int fraction = c.count ? (int)(c.sum / (double)c.count * LATHE_FRACTION_ONE + 0.5) : LATHE_FRACTION_ONE / 2;
    return fraction < 8 ? 8 : fraction > 56 ? 56 : fraction;
}
