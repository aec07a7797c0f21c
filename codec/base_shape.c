#include "base_shape.h"

void lathe__base_models(lathe_number_model models[LATHE_BASE_MODELS]) {
    /* Of 256: not zero; then: the magnitude's length goes on. */
    static const uint8_t USUAL[LATHE_BASE_MODELS][2] = {{40, 60},  {16, 60},   {4, 20},    {24, 30}, {230, 200},
                                                        {190, 150}, {240, 180}, {200, 120}, {200, 110}};
    for (int i = 0; i < LATHE_BASE_MODELS; i++)
        for (int k = 0; k < LATHE_NUMBER_MODELS; k++) {
            uint32_t p = k == 0 ? USUAL[i][0] : k >= 2 && k < 24 ? USUAL[i][1] : 128;
            models[i].bit[k] = (lathe_bit_model){(uint16_t)(p << 8), 6};
        }
}

int32_t lathe__predict_radius(const lathe_star *star, const lathe_star *parent, uint32_t ray, int32_t start) {
    int32_t p;
    if (!parent) p = ray ? star->radius[ray - 1] : start;
    else {
        uint32_t same = ray * parent->rays / star->rays;
        p = parent->radius[same];
        if (ray) {
            /* Half of what scaling by the ray before says, half of what shifting by it says. */
            int32_t was = parent->radius[(ray - 1) * parent->rays / star->rays], is = star->radius[ray - 1];
            p = (2 * p * (is + 1) / (was + 1) + p + is + 2) / 4;
        }
    }
    return p < 1 ? 1 : p > 65535 ? 65535 : p;
}

lathe_status lathe__star_outline(lathe_outline *out, lathe_arena *arena, const lathe_star_slice *slice, int32_t step, uint32_t seed) {
    size_t points = 0;
    for (uint32_t i = 0; i < slice->count; i++) points += slice->stars[i].rays;
    *out = (lathe_outline){.loop_count = slice->count};
    out->points = LATHE_NEW(arena, lathe_point, points);
    out->ray = LATHE_NEW(arena, int32_t, points);
    out->loops = LATHE_NEW(arena, lathe_loop, slice->count);
    if (!out->points || !out->ray || !out->loops) return LATHE_ERR_MEMORY;
    for (uint32_t i = 0; i < slice->count; i++) {
        const lathe_star *star = &slice->stars[i];
        lathe_point centre = {star->centre[0] * LATHE_LATTICE_ONE, star->centre[1] * LATHE_LATTICE_ONE};
        out->loops[i] = (lathe_loop){.first = out->point_count, .count = star->rays, .hole = star->hole, .centre = centre, .rays = star->rays};
        for (uint32_t k = 0; k < star->rays; k++) {
            /* Holes have the region on the left, too: their rays go round clockwise. */
            uint32_t ray = star->hole ? star->rays - 1 - k : k;
            lathe_point d = lathe__ray_direction(ray, star->rays), at;
            int64_t length = (int64_t)star->radius[ray] * step;
            /* The largest frame's diagonal is shorter; a point twice as far would leave the range that differences have. */
            if (length > (int64_t)1 << 29) return LATHE_ERR_FORMAT;
            at.x = centre.x + (int32_t)(length * d.x / LATHE_RAY_LENGTH);
            at.y = centre.y + (int32_t)(length * d.y / LATHE_RAY_LENGTH);
            out->ray[out->point_count] = (int32_t)ray;
            out->points[out->point_count++] = lathe__jitter((lathe_point){at.x & ~1, at.y & ~1}, seed);
        }
    }
    return LATHE_OK;
}
