#include "base_shape.h"

int lathe__get_bit(lathe_range_decoder *d, lathe_bit_model *m) {
    int bit = lathe__decode_bit(d, m->p1);
    lathe__bit_learn(m, bit);
    return bit;
}

int32_t lathe__get_number(lathe_range_decoder *d, lathe_number_model *m) {
    if (!lathe__get_bit(d, &m->bit[0])) return 0;
    int negative = lathe__get_bit(d, &m->bit[1]), length = 0;
    while (length < 20 && lathe__get_bit(d, &m->bit[2 + length])) length++;
    uint32_t a = 1;
    for (int i = length - 1; i >= 0; i--)
        a = a * 2 + (uint32_t)(i == length - 1 ? lathe__get_bit(d, &m->bit[24 + length]) : lathe__decode_bit(d, 32768));
    return negative ? -(int32_t)a : (int32_t)a;
}

static bool get_star(lathe_star *star, lathe_arena *arena, lathe_range_decoder *d, lathe_number_model *m, uint32_t index,
                     const lathe_star_slice *before, const lathe_mask *frame) {
    int32_t expected = before && index < before->count ? (int32_t)index + 1 : 0;
    int32_t parent_index = expected + lathe__get_number(d, &m[LATHE_BASE_PARENT]);
    if (parent_index < 0 || parent_index > (before ? (int32_t)before->count : 0)) return false;
    star->parent = (uint8_t)parent_index;
    const lathe_star *parent = parent_index ? &before->stars[parent_index - 1] : NULL;
    star->hole = ((parent && parent->hole ? 1 : 0) + lathe__get_number(d, &m[LATHE_BASE_HOLE])) != 0;
    int32_t log_rays = (parent ? __builtin_ctz(parent->rays) : 3) + lathe__get_number(d, &m[LATHE_BASE_RAYS]);
    if (log_rays < 3 || log_rays > 7) return false;
    star->rays = (uint16_t)(1 << log_rays);
    for (int k = 0; k < 2; k++) {
        int32_t c = (parent ? parent->centre[k] : frame->size[k] / 2) + lathe__get_number(d, &m[parent ? LATHE_BASE_CENTRE : LATHE_BASE_CENTRE_NEW]);
        if (c < 0 || c > frame->size[k]) return false;
        star->centre[k] = c;
    }
    star->radius = LATHE_NEW(arena, uint16_t, star->rays);
    if (!star->radius) return false;
    for (uint32_t i = 0; i < star->rays; i++) {
        int32_t r = lathe__predict_radius(star, parent, i, 16) +
                    lathe__get_number(d, &m[parent ? LATHE_BASE_RADIUS_PARENT : i ? LATHE_BASE_RADIUS_ALONE : LATHE_BASE_RADIUS_FIRST]);
        if (r < 1 || r > 32767) return false;
        star->radius[i] = (uint16_t)r;
    }
    return d->overrun <= 8;
}

lathe_status lathe__base_decode(lathe_star_slice *slices, uint32_t count, lathe_arena *arena, lathe_range_decoder *d,
                                const lathe_mask *frame, lathe_number_model m[LATHE_BASE_MODELS]) {
    for (uint32_t s = 0; s < count; s++) {
        const lathe_star_slice *before = s ? &slices[s - 1] : NULL;
        int32_t loops = lathe__get_number(d, &m[LATHE_BASE_LOOPS]) + (before ? (int32_t)before->count : 1);
        if (loops < 0 || loops > LATHE_BASE_MAX_LOOPS || d->overrun > 8) return LATHE_ERR_FORMAT;
        slices[s].count = (uint32_t)loops;
        slices[s].stars = LATHE_NEW(arena, lathe_star, loops);
        if (!slices[s].stars) return LATHE_ERR_MEMORY;
        for (int32_t i = 0; i < loops; i++)
            if (!get_star(&slices[s].stars[i], arena, d, m, (uint32_t)i, before, frame)) return LATHE_ERR_FORMAT;
    }
    return LATHE_OK;
}
