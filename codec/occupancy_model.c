/* Occupancy of a slice under adaptive contexts.
 *
 * A pixel whose close neighbourhood (the row above it, the known slices below and above) is all equal is *calm*. A maximal
 * calm stretch of a row, met while the pixels before it have its value, costs one decision: does it hold a surprise? Only a
 * surprise is then located. All other pixels, about the outline's, are predicted by INPUTS adaptive probabilities, each looked
 * up by another context, mixed in the logistic domain with weights that learn (as in the paq and lpaq compressors).
 *
 * A small structure ends before such a model has learned, so a new state first codes a blob that it makes up itself.
 * What was tried, with figures: docs/EXPERIMENTS.md. */
#include "occupancy_model.h"
#include <stdlib.h>
#include <string.h>

/* The rows around a pixel that contexts read: of this slice the current one and 1 to 3 before it, of the slices below and above
 * -1 to 1. The slices beyond those were tried: they did not help. */
enum {
    CUR0, CUR1, CUR2, CUR3,
    BELOW0, BELOW1, BELOW2, ABOVE0, ABOVE1, ABOVE2,
    LINES
};
enum {
    INPUTS = 6,
    SLOT_BITS_TRAINED = 17, SLOT_BITS_MAX = 20,   /* all contexts share one table: 512 KB, 1 MB or 4 MB */
    MODES = 8,                 /* 0: no slice known, 1: one side, 2..5: both, gap 1, 2, 4, 8 and more; 6, 7: an estimate above */
    SEEN_CLASSES = 8,
    CENTRE = 4,                /* bit of the pixel itself in a window */
    LOGIT_ONE = 256, LOGIT_MAX = 12 * LOGIT_ONE - 1,
    WEIGHT_ONE = 65536,
    LEARN_FAST = 10, LEARN_SLOW = 4, FAST_PIXELS = 1 << 15,   /* sixteenths; the first pixels learn faster */
    COUNT_MASK = 1023, COUNT_MAX = 254, COUNT_TRAINING = 4,
    LENGTH_CLASSES = 16
};

/* A probability that learns: of 1 in the upper 22 bits, how often it was seen in the lower 10. */
typedef uint32_t slot;

typedef struct lines { uint64_t row[LINES]; } lines;   /* one word of every line */

struct lathe_occupancy {
    int32_t width, height, row_words;
    uint32_t count_max, pixels;
    int32_t slot_bits;
    lines *words;              /* row_words and one of padding on either side */
    uint64_t *calm[2];         /* pixels whose neighbourhood is all 0, all 1; same padding */
    struct learned {
        /* An input's weight is a sum: by how often its slot was seen, by the causal neighbours, by mode and the pixels below
         * and above. */
        int32_t weight_seen[SEEN_CLASSES][INPUTS], weight_near[16][INPUTS], weight_side[MODES * 4][INPUTS];
        slot surprise[MODES][8][LENGTH_CLASSES], place[2][LENGTH_CLASSES][LENGTH_CLASSES];
        int16_t logit[4096];       /* of a 12-bit probability */
        uint16_t chance[2 * LOGIT_MAX + 1];   /* 16-bit probability of a logit */
        uint32_t rate[COUNT_MAX + 1];
    } m;
    slot slots[];              /* 1 << slot_bits */
};

static uint32_t clamp16(uint32_t p) { return p < 1 ? 1 : p > 65535 ? 65535 : p; }
static uint32_t floor_log2(uint32_t x) { return 31 - (uint32_t)__builtin_clz(x | 1); }

static void learn(const lathe_occupancy *s, slot *e, int bit) {
    uint32_t count = *e & COUNT_MASK, p = *e >> 10;
    int32_t miss = (bit ? (1 << 22) - 1 : 0) - (int32_t)p;
    p = (uint32_t)((int32_t)p + (int32_t)((int64_t)miss * s->m.rate[count] >> 16));
    *e = p << 10 | (count < s->count_max ? count + 1 : s->count_max);
}

static int code_slot(const lathe_occupancy *s, const lathe_bit_coder *coder, slot *e, int bit) {
    bit = coder->code(coder->coder, clamp16(*e >> 16), bit);
    learn(s, e, bit);
    return bit;
}

/* ---- contexts ------------------------------------------------------------------------------------------------------ */

static uint32_t field(uint64_t window, int from, int count) {   /* pixels from .. from + count - 1 relative to the pixel */
    return (uint32_t)(window >> (CENTRE + from)) & ((1u << count) - 1);
}

/* The pixel and its four neighbours. */
static uint64_t cross(const uint64_t *w, int line) {
    return field(w[line + 1], -1, 3) | field(w[line], 0, 1) << 3 | field(w[line + 2], 0, 1) << 4;
}

static uint64_t square(const uint64_t *w, int line) {
    return field(w[line], -1, 3) | field(w[line + 1], -1, 3) << 3 | field(w[line + 2], -1, 3) << 6;
}

static slot *slot_of(lathe_occupancy *s, uint64_t key, uint64_t salt) {
    return &s->slots[(key + (salt << 40)) * 0x9E3779B97F4A7C15u >> (64 - s->slot_bits)];
}

/* Returns the four causal neighbours: they choose the mixer's weights. */
static uint32_t contexts(lathe_occupancy *s, slot *found[INPUTS], const uint64_t *w, uint64_t mode) {
    uint64_t below = cross(w, BELOW0), above = cross(w, ABOVE0);
    uint64_t centres = field(w[BELOW1], 0, 1) | field(w[ABOVE1], 0, 1) << 1;
    uint64_t left = field(w[CUR0], -4, 4);
    uint64_t near = left >> 3 | field(w[CUR1], -1, 3) << 1;
    uint64_t causal10 = left >> 2 | field(w[CUR1], -2, 5) << 2 | field(w[CUR2], -1, 3) << 7;
    uint64_t causal19 = left | field(w[CUR1], -3, 7) << 4 | field(w[CUR2], -2, 5) << 11 | field(w[CUR3], -1, 3) << 16;
    uint64_t causal25 = left | field(w[CUR1], -4, 9) << 4 | field(w[CUR2], -3, 7) << 13 | field(w[CUR3], -2, 5) << 20;
    uint64_t wide = near | (left >> 2 & 1) << 4 | square(w, BELOW0) << 5 | square(w, ABOVE0) << 14 |
                    (uint64_t)field(w[CUR2], 0, 1) << 23 | (uint64_t)field(w[CUR1], 2, 1) << 24;
    found[0] = slot_of(s, near | below << 4 | above << 9 | mode << 14, 1);
    found[1] = slot_of(s, causal19 | centres << 19 | mode << 21, 2);
    found[2] = slot_of(s, causal25 | centres << 25, 3);
    found[3] = slot_of(s, wide, 4);
    /* Both sides share their statistics: the same salt. */
    found[4] = slot_of(s, causal10 | below << 10, 5);
    found[5] = slot_of(s, causal10 | above << 10, 5);
    return (uint32_t)near;
}

/* ---- one pixel ----------------------------------------------------------------------------------------------------- */

static void windows(uint64_t w[LINES], const lathe_occupancy *s, int32_t x, uint64_t flip) {
    uint32_t bit = (uint32_t)x + 64 - CENTRE, shift = bit & 63;
    const lines *low = &s->words[bit >> 6], *high = low + 1;
    for (int i = 0; i < LINES; i++) w[i] = (low->row[i] >> shift | high->row[i] << 1 << (63 - shift)) ^ flip;
}

/* Wraps: hostile bytes may drive weights anywhere. */
static void add(int32_t *weight, int32_t change) { *weight = (int32_t)((uint32_t)*weight + (uint32_t)change); }

static int code_pixel(lathe_occupancy *s, const lathe_bit_coder *coder, int32_t x, uint32_t mode, int bit) {
    /* Everything is seen from the pixel before: inside and outside share their statistics. */
    int flip = (int)(s->words[(x + 63) >> 6].row[CUR0] >> ((x - 1) & 63) & 1);
    uint64_t w[LINES];
    windows(w, s, x, flip ? ~(uint64_t)0 : 0);
    slot *found[INPUTS];
    uint32_t near = contexts(s, found, w, mode);
    uint32_t side = mode * 4 + field(w[BELOW1], 0, 1) + 2 * field(w[ABOVE1], 0, 1);
    int32_t logit[INPUTS], *by_near = s->m.weight_near[near], *by_side = s->m.weight_side[side], *by_seen[INPUTS];
    int64_t sum = 0;
    for (int i = 0; i < INPUTS; i++) {
        slot e = *found[i];
        logit[i] = s->m.logit[e >> 20];
        by_seen[i] = &s->m.weight_seen[floor_log2((e & COUNT_MASK) + 1)][i];
        sum += ((int64_t)*by_seen[i] + by_near[i] + by_side[i]) * logit[i];
    }
    sum >>= 16;
    uint32_t p = s->m.chance[(sum < -LOGIT_MAX ? -LOGIT_MAX : sum > LOGIT_MAX ? LOGIT_MAX : sum) + LOGIT_MAX];
    bit = coder->code(coder->coder, p, bit ^ flip);
    int32_t speed = s->pixels < FAST_PIXELS ? LEARN_FAST : LEARN_SLOW;
    s->pixels += s->pixels < FAST_PIXELS;
    int32_t step = ((bit << 16) - (int32_t)p) * speed / 16;
    for (int i = 0; i < INPUTS; i++) {
        int32_t change = (logit[i] * step + 32768) >> 16;
        add(by_seen[i], change);
        add(&by_near[i], change);
        add(&by_side[i], change);
        learn(s, found[i], bit);
    }
    return bit ^ flip;
}

/* ---- one row ------------------------------------------------------------------------------------------------------- */

static void load_line(lathe_occupancy *s, int line, const uint64_t *slice, int32_t y) {
    bool none = !slice || y < 0 || y >= s->height;
    const uint64_t *row = none ? NULL : slice + (size_t)y * (size_t)s->row_words;
    for (int32_t i = 0; i < s->row_words; i++) s->words[i + 1].row[line] = none ? 0 : row[i];
}

static void load_row(lathe_occupancy *s, const lathe_known *known, int32_t y) {
    for (int32_t i = 1; i <= s->row_words; i++) {
        uint64_t *row = s->words[i].row;
        row[CUR3] = row[CUR2];
        row[CUR2] = row[CUR1];
        row[CUR1] = row[CUR0];
        row[CUR0] = 0;
    }
    for (int k = 0; k < 3; k++) {
        load_line(s, BELOW0 + k, known->below, y + k - 1);
        load_line(s, ABOVE0 + k, known->above, y + k - 1);
    }
}

typedef struct span { uint64_t all, any; } span;

static void take(span *t, const lines *at, int line, bool sides) {
    uint64_t centre = at[0].row[line];
    t->all &= centre;
    t->any |= centre;
    if (!sides) return;
    uint64_t left = centre << 1 | at[-1].row[line] >> 63, right = centre >> 1 | at[1].row[line] << 63;
    t->all &= left & right;
    t->any |= left | right;
}

static void find_calm(lathe_occupancy *s, const lathe_known *known) {
    for (int32_t i = 1; i <= s->row_words; i++) {
        span t = {~(uint64_t)0, 0};
        take(&t, &s->words[i], CUR1, true);
        for (int k = 0; k < 3; k++) {
            if (known->below) take(&t, &s->words[i], BELOW0 + k, k == 1);
            if (known->above) take(&t, &s->words[i], ABOVE0 + k, k == 1);
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
        s->words[(x >> 6) + 1].row[CUR0] |= ~(uint64_t)0 >> (64 - n) << (x & 63);
        x += n;
        count -= n;
    }
}

/* How many pixels of the calm run keep its value; the one after them, if there is one, is a surprise. */
static int32_t code_run(lathe_occupancy *s, const lathe_bit_coder *coder, int32_t x, int32_t length, int value, uint32_t mode,
                        int32_t kept) {
    int ends = (x == 1) + 2 * (x + length == s->width - 1);
    slot *e = &s->m.surprise[mode][value * 4 + ends][floor_log2((uint32_t)length)];
    if (!code_slot(s, coder, e, kept < length)) return length;
    int32_t i = 0;
    while (i < length - 1) {
        e = &s->m.place[value][floor_log2((uint32_t)(length - i))][floor_log2((uint32_t)i + 1)];
        if (code_slot(s, coder, e, kept == i)) break;
        i++;
    }
    return i;
}

static void code_row(lathe_occupancy *s, const lathe_bit_coder *coder, const uint64_t *truth, uint32_t mode) {
    int32_t end = s->width - 1;
    int before = 0, before2 = 0;
    for (int32_t x = 1; x < end;) {
        int32_t calm = before == before2 ? run_length(s->calm[before] + 1, x, end - x, 0) : 0;
        int bit;
        if (calm) {
            int32_t kept = truth ? run_length(truth, x, calm, before ? 0 : ~(uint64_t)0) : 0;
            kept = code_run(s, coder, x, calm, before, mode, kept);
            if (before) fill(s, x, kept);
            x += kept;
            if (kept == calm) continue;   /* before and before2 stay equal */
            bit = !before;
        } else {
            bit = code_pixel(s, coder, x, mode, truth ? (int)(truth[x >> 6] >> (x & 63) & 1) : 0);
        }
        if (bit) fill(s, x, 1);
        before2 = before;
        before = bit;
        x++;
    }
}

static uint32_t mode_of(const lathe_known *known) {
    if (known->estimate) return known->estimate == 1 ? 6 : 7;
    if (!known->below && !known->above) return 0;
    if (!known->below || !known->above) return 1;
    int32_t gap = known->gap_below < known->gap_above ? known->gap_below : known->gap_above;
    return gap >= 8 ? 5 : gap >= 4 ? 4 : gap >= 2 ? 3 : 2;
}

void lathe__occupancy_walk(lathe_occupancy *s, const lathe_bit_coder *coder, uint64_t *out, const lathe_known *known) {
    size_t row_words = (size_t)s->row_words;
    uint32_t mode = mode_of(known);
    memset(s->words, 0, (row_words + 2) * sizeof *s->words);
    if (out) memset(out, 0, row_words * (size_t)s->height * sizeof *out);
    for (int32_t y = 1; y < s->height - 1; y++) {
        load_row(s, known, y);
        find_calm(s, known);
        code_row(s, coder, coder->truth ? coder->truth + (size_t)y * row_words : NULL, mode);
        if (!out) continue;
        for (size_t i = 0; i < row_words; i++) out[(size_t)y * row_words + i] = s->words[i + 1].row[CUR0];
    }
}

/* ---- a new state --------------------------------------------------------------------------------------------------- */

static void make_tables(lathe_occupancy *s) {
    /* chance(x) = 1 / (1 + e^-x); power runs through e^(-k / 256) in 32-bit fractions. */
    uint64_t power = (uint64_t)1 << 32;
    for (int32_t k = 0; k <= LOGIT_MAX; k++) {
        uint32_t p = clamp16((uint32_t)(((uint64_t)1 << 48) / (((uint64_t)1 << 32) + power)));
        s->m.chance[LOGIT_MAX + k] = (uint16_t)p;
        s->m.chance[LOGIT_MAX - k] = (uint16_t)(65536 - p);
        power = power * 4278222847u >> 32;   /* 2^32 e^(-1/256) */
    }
    /* logit: the inverse, odd around 1/2. */
    int32_t k = 0;
    for (int32_t p = 2048; p < 4096; p++) {
        while (k < LOGIT_MAX && s->m.chance[LOGIT_MAX + k] >> 4 < p) k++;
        s->m.logit[p] = (int16_t)k;
        s->m.logit[4095 - p] = (int16_t)-k;
    }
    for (uint32_t n = 0; n <= COUNT_MAX; n++) s->m.rate[n] = 65536 * 5 / (5 * n + 8);
}

static void fill_slots(slot *at, size_t count, slot value) {
    for (size_t i = 0; i < count; i++) at[i] = value;
}

static void make_ignorant(lathe_occupancy *s) {
    fill_slots(s->slots, (size_t)1 << s->slot_bits, (slot)1 << 31);
    fill_slots(&s->m.surprise[0][0][0], sizeof s->m.surprise / sizeof(slot), (slot)1 << 28);
    fill_slots(&s->m.place[0][0][0], sizeof s->m.place / sizeof(slot), (slot)1 << 28);
    memset(s->m.weight_side, 0, sizeof s->m.weight_side);
    for (int i = 0; i < INPUTS; i++) {
        for (int k = 0; k < SEEN_CLASSES; k++) s->m.weight_seen[k][i] = WEIGHT_ONE / 2 / INPUTS;
        for (int k = 0; k < 16; k++) s->m.weight_near[k][i] = WEIGHT_ONE / 2 / INPUTS;
    }
}

/* The blob that trains a new state: noise, smoothed three times along each axis, and cut at its mean. */
enum { BLOB = 40, BLOB_SLICES = 17, BLOB_VOXELS = BLOB * BLOB * BLOB_SLICES, BLOB_RADIUS = 3 };

static void smooth(int32_t *at, int32_t count, int32_t stride) {
    int32_t line[BLOB + 2 * BLOB_RADIUS + 1] = {0}, sum = 0;
    for (int32_t i = 0; i < count; i++) line[i + BLOB_RADIUS + 1] = at[i * stride];
    for (int32_t i = 1; i < 2 * BLOB_RADIUS + 1; i++) sum += line[i];
    for (int32_t i = 0; i < count; i++) {
        sum += line[i + 2 * BLOB_RADIUS + 1] - line[i];
        at[i * stride] = sum >> 1;
    }
}

static void make_blob(uint64_t bits[BLOB_SLICES][BLOB], int32_t *v) {
    uint32_t random = 1;
    for (int32_t i = 0; i < BLOB_VOXELS; i++) {
        random = random * 1664525u + 1013904223u;
        v[i] = (int32_t)(random >> 16 & 2047) - 1024;
    }
    for (int pass = 0; pass < 3; pass++) {
        for (int32_t i = 0; i < BLOB * BLOB_SLICES; i++) smooth(v + i * BLOB, BLOB, 1);
        for (int32_t i = 0; i < BLOB * BLOB_SLICES; i++) smooth(v + i / BLOB * BLOB * BLOB + i % BLOB, BLOB, BLOB);
        for (int32_t i = 0; i < BLOB * BLOB; i++) smooth(v + i, BLOB_SLICES, BLOB * BLOB);
    }
    memset(bits, 0, sizeof(uint64_t) * BLOB * BLOB_SLICES);
    for (int32_t i = 0; i < BLOB_VOXELS; i++) {
        int32_t x = i % BLOB, y = i / BLOB % BLOB;
        bool inside = x && y && x < BLOB - 1 && y < BLOB - 1;
        if (inside && v[i] > 0) bits[i / (BLOB * BLOB)][y] |= (uint64_t)1 << x;
    }
}

static int say(void *coder, uint32_t p1, int bit) {
    (void)coder;
    (void)p1;
    return bit;
}

static void code_blob(lathe_occupancy *s, uint64_t bits[BLOB_SLICES][BLOB]) {
    for (int32_t w = 0; w < BLOB_SLICES; w += 8) {
        lathe_known known = {.below = w ? bits[w - 8] : NULL, .gap_below = 8};
        lathe__occupancy_walk(s, &(lathe_bit_coder){say, NULL, bits[w]}, NULL, &known);
    }
    for (int32_t gap = 4; gap >= 1; gap /= 2)
        for (int32_t w = gap; w < BLOB_SLICES; w += 2 * gap) {
            lathe_known known = {bits[w - gap], bits[w + gap], gap, gap, 0};
            lathe__occupancy_walk(s, &(lathe_bit_coder){say, NULL, bits[w]}, NULL, &known);
        }
}

static lathe_status train(lathe_occupancy *s) {
    struct { uint64_t bits[BLOB_SLICES][BLOB]; int32_t values[BLOB_VOXELS]; } *blob = malloc(sizeof *blob);
    if (!blob) return LATHE_ERR_MEMORY;
    make_blob(blob->bits, blob->values);
    s->count_max = COUNT_TRAINING;   /* so that real data soon outweighs the blob */
    code_blob(s, blob->bits);
    s->count_max = COUNT_MAX;
    free(blob);
    return LATHE_OK;
}

/* ---- states -------------------------------------------------------------------------------------------------------- */

/* Large slices have more contexts; small structures come by the hundred. */
static int32_t slot_bits_of(int32_t width, int32_t height) {
    int64_t area = (int64_t)width * height;
    return area <= 64 * 64 ? SLOT_BITS_TRAINED : area <= 128 * 128 ? 18 : SLOT_BITS_MAX;
}

static lathe_status allocate(lathe_occupancy **out, int32_t width, int32_t height, int32_t slot_bits) {
    lathe_occupancy *s = malloc(sizeof *s + sizeof(slot) * ((size_t)1 << slot_bits));
    if (!s) return LATHE_ERR_MEMORY;
    *s = (lathe_occupancy){.slot_bits = slot_bits};
    lathe_status status = lathe__occupancy_frame(s, width, height);
    if (status) lathe__occupancy_free(&s);
    else *out = s;
    return status;
}

lathe_status lathe__occupancy_frame(lathe_occupancy *s, int32_t width, int32_t height) {
    if (s->width == width && s->height == height) return LATHE_OK;
    if (width < 1 || height < 1 || width > LATHE_MAX_DIM + 2 || height > LATHE_MAX_DIM + 2) return LATHE_ERR_RANGE;
    size_t words = (size_t)(width + 63) / 64 + 2;
    lines *line = calloc(words, sizeof *line);
    uint64_t *calm = calloc(2 * words, sizeof *calm);
    if (!line || !calm) {
        free(line);
        free(calm);
        return LATHE_ERR_MEMORY;
    }
    free(s->words);
    free(s->calm[0]);
    s->words = line;
    s->calm[0] = calm;
    s->calm[1] = calm + words;
    s->width = width;
    s->height = height;
    s->row_words = (int32_t)words - 2;
    return LATHE_OK;
}

void lathe__occupancy_free(lathe_occupancy **state) {
    if (!*state) return;
    free((*state)->words);
    free((*state)->calm[0]);
    free(*state);
    *state = NULL;
}

/* A slot's place is the top bits of a hash, so a larger table starts with each slot repeated, and a smaller one with every
 * so-manieth: whatever the template's size was, the same state comes out. */
static void copy_slots(lathe_occupancy *s, const lathe_occupancy *from) {
    int32_t more = s->slot_bits - from->slot_bits;
    for (size_t i = 0; i < (size_t)1 << s->slot_bits; i++) s->slots[i] = from->slots[more >= 0 ? i >> more : i << -more];
}

lathe_status lathe__occupancy_copy(lathe_occupancy **out, const lathe_occupancy *from, int32_t width, int32_t height) {
    lathe_occupancy *s;
    lathe_status status = allocate(&s, width, height, slot_bits_of(width, height));
    if (status != LATHE_OK) return status;
    s->count_max = from->count_max;
    s->m = from->m;
    copy_slots(s, from);
    *out = s;
    return LATHE_OK;
}

lathe_status lathe__occupancy_new(lathe_occupancy **out, int32_t width, int32_t height) {
    lathe_occupancy *trained;
    lathe_status status = allocate(&trained, BLOB, BLOB, SLOT_BITS_TRAINED);
    if (status != LATHE_OK) return status;
    make_tables(trained);
    make_ignorant(trained);
    status = train(trained);
    if (status == LATHE_OK) status = lathe__occupancy_copy(out, trained, width, height);
    lathe__occupancy_free(&trained);
    return status;
}
