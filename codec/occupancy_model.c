/* Occupancy of a slice under adaptive contexts.
 *
 * A pixel whose close neighbourhood (the row above it, the known slices below and above) is all equal is *calm*. A maximal
 * calm stretch of a row, met while the pixels before it have its value, costs one decision: does it hold a surprise? Only a
 * surprise is then located. All other pixels are *mixed*: predicted by adaptive probabilities, each looked up by another
 * context, mixed in the logistic domain with weights that learn (as in the paq and lpaq compressors).
 *
 * Most mixed pixels are nearly certain, and one small context knows it. A state of the newer kind (`sure`) codes these by that
 * context's probability alone: they touch nothing else, and the mixer learns from the doubtful ones only.
 *
 * A small structure ends before such a model has learned, so a new state has coded a blob that was made up (model_state.c).
 * What was tried, with figures: docs/EXPERIMENTS.md. */
#include "occupancy_model.h"
#include <string.h>

/* 16-bit probability of a 1; never 0. */
static inline uint32_t chance_of(slot e) { return e >> 16 ? e >> 16 : 1; }

static inline int code_bit(const lathe_bit_coder *coder, uint32_t p1, int bit) {
    if (coder->decoder) return lathe__decode_bit_inline(coder->decoder, p1);
    if (coder->code) coder->code(coder->coder, p1, bit);
    return bit;
}

static inline void learn(const lathe_occupancy *s, slot *e, int bit) {
    uint32_t count = *e & COUNT_MASK, p = *e >> 10;
    int32_t miss = (bit ? (1 << 22) - 1 : 0) - (int32_t)p;
    *e += ((uint32_t)((int64_t)miss * s->m.rate[count] >> 16) << 10) + (count < s->count_max);
}

__attribute__((noinline)) static int code_slot(const lathe_occupancy *s, const lathe_bit_coder *coder, slot *e, int bit) {
    bit = code_bit(coder, chance_of(*e), bit);
    learn(s, e, bit);
    return bit;
}

/* ---- windows ------------------------------------------------------------------------------------------------------- */

/* Pixels x, x + 1, ... of a line from the lowest bit on, at least 57; x from -8 on. */
static inline uint64_t window(const uint64_t *line, int32_t x) {
#if __BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__
    typedef uint64_t anywhere __attribute__((aligned(1), may_alias));
    return *(const anywhere *)((const char *)line + (x >> 3)) >> (x & 7);
#else
    uint32_t shift = (uint32_t)x & 63;
    return line[x >> 6] >> shift | line[(x >> 6) + 1] << 1 << (63 - shift);
#endif
}

static inline uint32_t field(uint64_t window, int from, int count) {   /* pixels from .. from + count - 1 relative to the pixel */
    return (uint32_t)(window >> (CENTRE + from)) & ((1u << count) - 1);
}

/* ---- the small context --------------------------------------------------------------------------------------------- */

/* Of eight pixels from `first` on, a byte of each word is a pixel's: the three causal neighbours in the row before, then of the
 * slice below the one before, the pixel, the one after it, and those of the rows before and after; the same five of the slice
 * above. */
typedef struct key_group { int32_t first; uint64_t low, high; } key_group;

/* rows: of a slice, three pixels in each byte. */
static inline uint64_t crosses(const uint64_t rows[3]) {
    uint64_t middle = UINT64_C(0x0202020202020202);
    return rows[1] | (rows[0] & middle) << 2 | (rows[2] & middle) << 3;
}

static void load_group(const lathe_occupancy *s, key_group *group, int32_t x) {
    uint64_t threes[LINES];
    for (int i = CUR1; i < LINES; i++) threes[i] = s->m.threes[window(s->line[i], x - 1) & 1023];
    *group = (key_group){x, threes[CUR1] | crosses(threes + BELOW0) << 3, crosses(threes + ABOVE0)};
}

static inline uint32_t key_of(const key_group *group, int32_t x) {
    int shift = (x - group->first) * 8;
    return (uint32_t)(group->low >> shift & 255) | (uint32_t)(group->high >> shift & 255) << 8;
}

/* ---- a doubtful pixel ---------------------------------------------------------------------------------------------- */

static inline uint32_t square(const uint64_t *w, int line) {
    return field(w[line], -1, 3) | field(w[line + 1], -1, 3) << 3 | field(w[line + 2], -1, 3) << 6;
}

static inline slot *slot_of(lathe_occupancy *s, uint64_t key, uint64_t salt) {
    return s->slots + lathe__small_slots(lathe__is_sure(s)) + ((key + (salt << 40)) * 0x9E3779B97F4A7C15u >> (64 - s->slot_bits));
}

/* key: the small context. */
static inline void contexts(lathe_occupancy *s, slot *found[INPUTS], int32_t x, uint32_t mode, uint32_t key, uint64_t flip) {
    uint64_t w[LINES];
    for (int i = 0; i < LINES; i++) w[i] = window(s->line[i], x - CENTRE) ^ flip;
    uint32_t below = key >> 3 & 31, above = key >> 8, centres = (key >> 4 & 1) | (key >> 8 & 2);
    uint32_t left = field(w[CUR0], -4, 4);
    uint32_t causal10 = left >> 2 | field(w[CUR1], -2, 5) << 2 | field(w[CUR2], -1, 3) << 7;
    uint32_t causal19 = left | field(w[CUR1], -3, 7) << 4 | field(w[CUR2], -2, 5) << 11 | field(w[CUR3], -1, 3) << 16;
    uint32_t wide = (key & 7) << 1 | (left & 4) << 2 | square(w, BELOW0) << 5 | square(w, ABOVE0) << 14 |
                    field(w[CUR2], 0, 1) << 23 | field(w[CUR1], 2, 1) << 24;
    found[1] = slot_of(s, causal19 | centres << 19 | mode << 21, 2);
    found[2] = slot_of(s, wide, 4);
    /* Both sides share their statistics: the same salt. */
    found[3] = slot_of(s, causal10 | below << 10, 5);
    found[4] = slot_of(s, causal10 | above << 10, 5);
    if (lathe__is_sure(s)) return;
    uint32_t causal25 = left | field(w[CUR1], -4, 9) << 4 | field(w[CUR2], -3, 7) << 13 | field(w[CUR3], -2, 5) << 20;
    found[0] = slot_of(s, key << 1 | mode << 14, 1);
    found[5] = slot_of(s, causal25 | centres << 25, 3);
}

/* Wraps: hostile bytes may drive weights anywhere. */
static inline void add(int32_t *weight, int32_t change) { *weight = (int32_t)((uint32_t)*weight + (uint32_t)change); }

/* The small context's slot, if it is there, is the first input. */
static int code_doubtful(lathe_occupancy *s, const lathe_bit_coder *coder, slot *small, int32_t x, uint32_t mode, uint32_t key,
                         uint64_t flip, int bit) {
    slot *found[INPUTS] = {small};
    contexts(s, found, x, mode, key, flip);
    int inputs = lathe__is_sure(s) ? INPUTS_SURE : INPUTS;
    int32_t logit[INPUTS], *by_seen[INPUTS], *by_near = s->m.weight[BY_NEAR + (key & 7)];
    int32_t *by_side = s->m.weight[BY_SIDE + mode * 4 + (key >> 4 & 1) + (key >> 8 & 2)];
    int64_t sum = 0;
    for (int i = 0; i < inputs; i++) {
        slot e = *found[i];
        logit[i] = s->m.logit[e >> 20];
        by_seen[i] = s->m.weight[BY_SEEN + s->m.seen_class[e & COUNT_MASK]] + i;
        sum += ((int64_t)*by_seen[i] + by_near[i] + by_side[i]) * logit[i];
    }
    sum >>= 16;
    uint32_t p = s->m.chance[(sum < -LOGIT_MAX ? -LOGIT_MAX : sum > LOGIT_MAX ? LOGIT_MAX : sum) + LOGIT_MAX];
    bit = code_bit(coder, p, bit);
    int32_t speed = lathe__is_sure(s) ? LEARN_SURE : s->pixels < FAST_PIXELS ? LEARN_FAST : LEARN_SLOW;
    s->pixels += s->pixels < FAST_PIXELS;
    int32_t step = ((bit << 16) - (int32_t)p) * speed / 16;
    for (int i = 0; i < inputs; i++) {
        int32_t change = (logit[i] * step + 32768) >> 16;
        add(by_seen[i], change);
        add(&by_near[i], change);
        add(&by_side[i], change);
        learn(s, found[i], bit);
    }
    return bit;
}

/* before: the pixel before. */
static inline int code_mixed(lathe_occupancy *s, const lathe_bit_coder *coder, key_group *group, int32_t x, uint32_t mode, int before,
                             int bit) {
    if (x - group->first >= 8) load_group(s, group, x);
    /* Everything is seen from the pixel before: inside and outside share their statistics. */
    uint64_t flip = -(uint64_t)before;
    uint32_t key = key_of(group, x) ^ (flip & ((1 << KEY_BITS) - 1));
    slot *small = NULL;
    bit ^= before;
    if (lathe__is_sure(s)) {
        small = &s->slots[mode << KEY_BITS | key];
        uint32_t p = chance_of(*small);
        if (p - SURE >= 65536 - 2 * SURE && (*small & COUNT_MASK) >= SURE_COUNT) {
            bit = code_bit(coder, p, bit);
            learn(s, small, bit);
            return bit ^ before;
        }
    }
    return code_doubtful(s, coder, small, x, mode, key, flip, bit) ^ before;
}

/* ---- one row ------------------------------------------------------------------------------------------------------- */

/* The first line becomes the last, for what comes next. */
static inline void next_line(uint64_t **lines, int count) {
    uint64_t *first = lines[0];
    for (int i = 0; i < count - 1; i++) lines[i] = lines[i + 1];
    lines[count - 1] = first;
}

typedef struct span { uint64_t all, any; } span;

static inline void take(span *t, uint64_t pixels) {
    t->all &= pixels;
    t->any |= pixels;
}

static inline void take_three(span *t, const uint64_t *at) {
    take(t, at[0]);
    take(t, at[0] << 1 | at[-1] >> 63);
    take(t, at[0] >> 1 | at[1] << 63);
}

/* Rows of the slices, and which pixels are calm. The rows of an unknown slice stay empty. */
static void load_row(lathe_occupancy *s, const lathe_known *known, int32_t y) {
    size_t next = (size_t)(y + 1) * (size_t)s->row_words;
    const uint64_t *slices[2] = {known->below, known->above};
    next_line(s->line + CUR3, 4);
    for (int k = 0; k < 2; k++)
        if (slices[k]) next_line(s->line + BELOW0 + 3 * k, 3);
    for (int32_t i = 0; i < s->row_words; i++) {
        span t = {~(uint64_t)0, 0};
        s->line[CUR0][i] = 0;
        take_three(&t, &s->line[CUR1][i]);
        for (int k = 0; k < 2; k++) {
            if (!slices[k]) continue;
            uint64_t **rows = s->line + BELOW0 + 3 * k;
            rows[2][i] = slices[k][next + (size_t)i];
            take(&t, rows[0][i]);
            take_three(&t, &rows[1][i]);
            take(&t, rows[2][i]);
        }
        s->calm[0][i] = ~t.any;
        s->calm[1][i] = t.all;
    }
}

/* Length of the run of `value` bits from pixel x on, at most `limit`. */
static int32_t run_length(const uint64_t *words, int32_t x, int32_t limit, uint64_t flip) {
    int32_t length = 0;
    while (length < limit) {
        int32_t at = x + length, left = 64 - (at & 63);
        uint64_t other = ~(words[at >> 6] ^ flip) >> (at & 63);
        int32_t here = other ? __builtin_ctzll(other) : left;
        length += here < left ? here : left;
        if (here < left) break;
    }
    return length < limit ? length : limit;
}

static void fill(lathe_occupancy *s, int32_t x, int32_t count) {
    while (count > 0) {
        int32_t left = 64 - (x & 63), n = count < left ? count : left;
        s->line[CUR0][x >> 6] |= ~(uint64_t)0 >> (64 - n) << (x & 63);
        x += n;
        count -= n;
    }
}

/* How many pixels of the calm run keep its value; the one after them, if there is one, is a surprise. */
static int32_t code_run(lathe_occupancy *s, const lathe_bit_coder *coder, int32_t x, int32_t length, int value, uint32_t mode,
                        int32_t kept) {
    int ends = (x == 1) + 2 * (x + length == s->width - 1);
    slot *e = &s->m.run[mode][value * 4 + ends][lathe__floor_log2((uint32_t)length)];
    if (!code_slot(s, coder, e, kept < length)) return length;
    int32_t i = 0;
    while (i < length - 1) {
        uint32_t left = lathe__floor_log2((uint32_t)(length - i));
        e = &s->m.run[MODES + value * 2 + (left >> 3)][left & 7][lathe__floor_log2((uint32_t)i + 1)];
        if (code_slot(s, coder, e, kept == i)) break;
        i++;
    }
    return i;
}

static void code_row(lathe_occupancy *s, const lathe_bit_coder *coder, const uint64_t *truth, uint32_t mode) {
    int32_t end = s->width - 1;
    int before = 0, before2 = 0;
    uint64_t *row = s->line[CUR0], *calms[2] = {s->calm[0], s->calm[1]};
    key_group group = {.first = -8};
    for (int32_t x = 1; x < end;) {
        int bit;
        if (before == before2 && calms[before][x >> 6] >> (x & 63) & 1) {
            int32_t calm = run_length(calms[before], x, end - x, 0);
            int32_t kept = truth ? run_length(truth, x, calm, before ? 0 : ~(uint64_t)0) : 0;
            kept = code_run(s, coder, x, calm, before, mode, kept);
            if (before) fill(s, x, kept);
            x += kept;
            if (kept == calm) continue;   /* before and before2 stay equal */
            bit = !before;
        } else {
            bit = code_mixed(s, coder, &group, x, mode, before, truth ? (int)(truth[x >> 6] >> (x & 63) & 1) : 0);
        }
        row[x >> 6] |= (uint64_t)bit << (x & 63);
        before2 = before;
        before = bit;
        x++;
    }
}

static uint32_t mode_of(const lathe_known *known, bool sure) {
    if (!LATHE_RASTERS_ONLY && !sure && known->estimate) return known->estimate == 1 ? 6 : 7;
    if (!known->below && !known->above) return 0;
    if (!known->below || !known->above) return 1;
    int32_t gap = known->gap_below < known->gap_above ? known->gap_below : known->gap_above;
    if (gap < 2) return 2;
    return sure || gap < 4 ? 3 : gap < 8 ? 4 : 5;
}

void lathe__occupancy_walk(lathe_occupancy *s, const lathe_bit_coder *coder, uint64_t *out, const lathe_known *known) {
    size_t row_words = (size_t)s->row_words, row_bytes = row_words * sizeof *out;
    uint32_t mode = mode_of(known, lathe__is_sure(s));
    memset(s->memory, 0, LINES * (row_bytes + 2 * sizeof *out));
    if (out) memset(out, 0, row_bytes * (size_t)s->height);
    for (int32_t y = -1; y < s->height - 1; y++) {
        load_row(s, known, y);
        if (y < 1) continue;   /* the rows after the first two have been loaded for it */
        code_row(s, coder, coder->truth ? coder->truth + (size_t)y * row_words : NULL, mode);
        for (size_t i = 0; out && i < row_words; i++) out[(size_t)y * row_words + i] = s->line[CUR0][i];
    }
}
