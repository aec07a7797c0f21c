#include "base_shape.h"

void lathe__put_bit(lathe_range_encoder *e, lathe_bit_model *m, int bit) {
    lathe__encode_bit(e, m->p1, bit);
    lathe__bit_learn(m, bit);
}

/* 0; else sign, then the length of the magnitude in unary, then its lower bits, the first of them modelled. */
void lathe__put_number(lathe_range_encoder *e, lathe_number_model *m, int32_t v) {
    lathe__put_bit(e, &m->bit[0], v != 0);
    if (!v) return;
    lathe__put_bit(e, &m->bit[1], v < 0);
    uint32_t a = (uint32_t)(v < 0 ? -v : v);
    int length = 0;
    while (a >> length > 1) length++;
    for (int i = 0; i < length; i++) lathe__put_bit(e, &m->bit[2 + i], 1);
    lathe__put_bit(e, &m->bit[2 + length], 0);
    for (int i = length - 1; i >= 0; i--)
        if (i == length - 1) lathe__put_bit(e, &m->bit[24 + length], a >> i & 1);
        else lathe__encode_bit(e, 32768, a >> i & 1);
}

static void put_star(lathe_range_encoder *e, lathe_number_model *m, const lathe_star *star, uint32_t index, const lathe_star_slice *before,
                     const lathe_mask *frame) {
    int32_t expected = before && index < before->count ? (int32_t)index + 1 : 0;
    lathe__put_number(e, &m[LATHE_BASE_PARENT], star->parent - expected);
    const lathe_star *parent = before && star->parent ? &before->stars[star->parent - 1] : NULL;
    lathe__put_number(e, &m[LATHE_BASE_HOLE], (star->hole ? 1 : 0) - (parent && parent->hole ? 1 : 0));
    lathe__put_number(e, &m[LATHE_BASE_RAYS], __builtin_ctz(star->rays) - (parent ? __builtin_ctz(parent->rays) : 3));
    for (int k = 0; k < 2; k++)
        lathe__put_number(e, &m[parent ? LATHE_BASE_CENTRE : LATHE_BASE_CENTRE_NEW], star->centre[k] - (parent ? parent->centre[k] : frame->size[k] / 2));
    for (uint32_t i = 0; i < star->rays; i++)
        lathe__put_number(e, &m[parent ? LATHE_BASE_RADIUS_PARENT : i ? LATHE_BASE_RADIUS_ALONE : LATHE_BASE_RADIUS_FIRST],
                   star->radius[i] - lathe__predict_radius(star, parent, i, 16));
}

lathe_status lathe__base_encode(lathe_range_encoder *e, const lathe_star_slice *slices, uint32_t count, const lathe_mask *frame,
                                lathe_number_model m[LATHE_BASE_MODELS]) {
    for (uint32_t s = 0; s < count; s++) {
        const lathe_star_slice *before = s ? &slices[s - 1] : NULL;
        lathe__put_number(e, &m[LATHE_BASE_LOOPS], (int32_t)slices[s].count - (before ? (int32_t)before->count : 1));
        for (uint32_t i = 0; i < slices[s].count; i++) put_star(e, m, &slices[s].stars[i], i, before, frame);
    }
    return e->failed ? LATHE_ERR_MEMORY : LATHE_OK;
}
