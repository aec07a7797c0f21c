/* States of the occupancy model: tables, what a new one has learned, copies. */
#include "occupancy_model.h"
#include <stdlib.h>
#include <string.h>

static void make_tables(lathe_occupancy *s) {
    /* chance(x) = 1 / (1 + e^-x); power runs through e^(-k / 256) in 32-bit fractions. */
    uint64_t power = (uint64_t)1 << 32;
    for (int32_t k = 0; k <= LOGIT_MAX; k++) {
        uint32_t p = (uint32_t)(((uint64_t)1 << 48) / (((uint64_t)1 << 32) + power));
        if (p > 65535) p = 65535;
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
    for (uint32_t n = 0; n <= COUNT_MAX; n++) {
        s->m.rate[n] = 65536 * 5 / (5 * n + 8);
        s->m.seen_class[n] = (uint8_t)lathe__floor_log2(n + 1);
    }
    for (uint64_t n = 0; n < 1024; n++) {
        s->m.threes[n] = 0;
        for (int k = 0; k < 8; k++) s->m.threes[n] |= (n >> k & 7) << 8 * k;
    }
}

static void fill_slots(slot *at, size_t count, slot value) {
    for (size_t i = 0; i < count; i++) at[i] = value;
}

static void make_ignorant(lathe_occupancy *s) {
    fill_slots(s->slots, lathe__small_slots(lathe__is_sure(s)) + ((size_t)1 << s->slot_bits), (slot)1 << 31);
    fill_slots(s->m.run[0][0], sizeof s->m.run / sizeof(slot), (slot)1 << 28);
    for (int i = 0; i < BY_SIDE; i++)
        for (int k = 0; k < INPUTS; k++) s->m.weight[i][k] = WEIGHT_ONE / 2 / (lathe__is_sure(s) ? INPUTS_SURE : INPUTS);
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
    for (int pass = 0; pass < 3; pass++)
        for (int32_t stride = 1; stride < BLOB_VOXELS; stride *= BLOB) {
            int32_t count = stride == BLOB * BLOB ? BLOB_SLICES : BLOB;
            for (int32_t i = 0; i < BLOB_VOXELS; i += stride * count)
                for (int32_t k = 0; k < stride; k++) smooth(v + i + k, count, stride);
        }
    memset(bits, 0, sizeof(uint64_t) * BLOB * BLOB_SLICES);
    for (int32_t i = 0; i < BLOB_VOXELS; i++) {
        int32_t x = i % BLOB, y = i / BLOB % BLOB;
        bool inside = x && y && x < BLOB - 1 && y < BLOB - 1;
        if (inside && v[i] > 0) bits[i / (BLOB * BLOB)][y] |= (uint64_t)1 << x;
    }
}

static void code_blob(lathe_occupancy *s, uint64_t bits[BLOB_SLICES][BLOB]) {
    for (int32_t gap = 8; gap; gap /= 2)
        for (int32_t w = gap & 7; w < BLOB_SLICES; w += gap == 8 ? 8 : 2 * gap) {
            lathe_known known = {w ? bits[w - gap] : NULL, gap < 8 ? bits[w + gap] : NULL, gap, gap, 0};
            lathe__occupancy_walk(s, &(lathe_bit_coder){.truth = bits[w]}, NULL, &known);
        }
}

static lathe_status train(lathe_occupancy *s) {
    struct { uint64_t bits[BLOB_SLICES][BLOB]; int32_t values[BLOB_VOXELS]; } *blob = malloc(sizeof *blob);
    if (!blob) return LATHE_ERR_MEMORY;
    make_blob(blob->bits, blob->values);
    s->count_max = COUNT_TRAINING;   /* so that real data soon outweighs the blob */
    code_blob(s, blob->bits);
    s->count_max = lathe__is_sure(s) ? COUNT_MAX_SURE : COUNT_MAX;
    free(blob);
    return LATHE_OK;
}

/* ---- states -------------------------------------------------------------------------------------------------------- */

/* Large slices have more contexts; small structures come by the hundred. */
static int32_t slot_bits_of(int32_t width, int32_t height, bool sure) {
    int64_t area = (int64_t)width * height;
    return area <= 64 * 64 ? SLOT_BITS_TRAINED : area <= 128 * 128 || sure ? SLOT_BITS_SURE : SLOT_BITS_MAX;
}

static lathe_status allocate(lathe_occupancy **out, int32_t width, int32_t height, int32_t slot_bits, bool sure) {
    lathe_occupancy *s = malloc(sizeof *s + sizeof(slot) * (lathe__small_slots(sure) + ((size_t)1 << slot_bits)));
    if (!s) return LATHE_ERR_MEMORY;
    *s = (lathe_occupancy){.slot_bits = slot_bits, .sure = sure};
    lathe_status status = lathe__occupancy_frame(s, width, height);
    if (status) lathe__occupancy_free(&s);
    else *out = s;
    return status;
}

lathe_status lathe__occupancy_frame(lathe_occupancy *s, int32_t width, int32_t height) {
    if (s->width == width && s->height == height) return LATHE_OK;
    if (width < 1 || height < 1 || width > LATHE_MAX_DIM + 2 || height > LATHE_MAX_DIM + 2) return LATHE_ERR_RANGE;
    int32_t row_words = (width + 63) / 64;
    size_t padded = (size_t)row_words + 2;
    uint64_t *memory = calloc((LINES + 2) * padded, sizeof *memory);
    if (!memory) return LATHE_ERR_MEMORY;
    free(s->memory);
    s->memory = memory;
    for (int i = 0; i < LINES; i++) s->line[i] = memory + (size_t)i * padded + 1;
    for (int i = 0; i < 2; i++) s->calm[i] = memory + (size_t)(LINES + i) * padded + 1;
    s->width = width;
    s->height = height;
    s->row_words = row_words;
    return LATHE_OK;
}

void lathe__occupancy_free(lathe_occupancy **state) {
    if (!*state) return;
    free((*state)->memory);
    free(*state);
    *state = NULL;
}

/* A slot's place is the top bits of a hash, so a larger table starts with each slot repeated, and a smaller one with every
 * so-manieth: whatever the template's size was, the same state comes out. */
static void copy_slots(lathe_occupancy *s, const lathe_occupancy *from) {
    size_t small = lathe__small_slots(lathe__is_sure(s));
    int32_t more = s->slot_bits - from->slot_bits, up = more > 0 ? more : 0, down = more < 0 ? -more : 0;
    memcpy(s->slots, from->slots, small * sizeof(slot));
    for (size_t i = 0; i < (size_t)1 << s->slot_bits; i++) s->slots[small + i] = from->slots[small + (i >> up << down)];
}

lathe_status lathe__occupancy_copy(lathe_occupancy **out, const lathe_occupancy *from, int32_t width, int32_t height) {
    lathe_occupancy *s;
    lathe_status status = allocate(&s, width, height, slot_bits_of(width, height, lathe__is_sure(from)), lathe__is_sure(from));
    if (status != LATHE_OK) return status;
    s->count_max = from->count_max;
    s->m = from->m;
    copy_slots(s, from);
    *out = s;
    return LATHE_OK;
}

lathe_status lathe__occupancy_new(lathe_occupancy **out, int32_t width, int32_t height, bool sure) {
    lathe_occupancy *trained;
    lathe_status status = allocate(&trained, BLOB, BLOB, SLOT_BITS_TRAINED, sure);
    if (status != LATHE_OK) return status;
    make_tables(trained);
    make_ignorant(trained);
    status = train(trained);
    if (status == LATHE_OK) status = lathe__occupancy_copy(out, trained, width, height);
    lathe__occupancy_free(&trained);
    return status;
}
