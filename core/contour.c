/* Edge types of a contour [M definition 1], with the in and out of the DOWN edges as the paper's own appendix has
 * them. */
#include "contour.h"

/* The grammar's four symbols follow from the ends alone: f joins two IN-OUT crossings, b two OUT-IN ones, an o edge
 * (UP_O, DOWN_I) goes from IN-OUT to OUT-IN, an i edge (UP_I, DOWN_O) back. */
static bool edge_type(uint8_t *type, const lathe_crossing *a, const lathe_crossing *b, uint32_t rays) {
    if (a->ray == b->ray && a->in_out != b->in_out) {
        if (a->in_out)
            *type = a->outward ? LATHE_UP_O : LATHE_DOWN_I;
        else
            *type = a->outward ? LATHE_UP_I : LATHE_DOWN_O;
        return true;
    }
    const lathe_crossing *low = a->in_out ? a : b, *high = a->in_out ? b : a;
    *type = a->in_out ? LATHE_FOR : LATHE_BACK;
    return a->in_out == b->in_out && high->ray == (low->ray + 1 == rays ? 0 : low->ray + 1);
}

/* Also RANGE where the types of two crossings do not fit their rays, which lathe__cast_rays never gives. */
lathe_status lathe__classify_edges(uint8_t *types, const lathe_crossing *crossings, uint32_t count, uint32_t rays) {
    if (rays < 3) return LATHE_ERR_RANGE;
    for (uint32_t i = 0; i < count; i++) {
        const lathe_crossing *next = &crossings[i + 1 < count ? i + 1 : 0];
        if (!edge_type(&types[i], &crossings[i], next, rays)) return LATHE_ERR_RANGE;
    }
    return LATHE_OK;
}
