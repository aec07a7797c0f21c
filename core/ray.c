/* Ray directions and sectors. Sines and arctangents are short integer polynomials over one octant, so that every
 * platform gets the same bits without a table. 65536 directions rounded to a circle of radius 2^14 stay strictly
 * increasing in angle: they are 2 pi / 4 = 1.571 apart, and rounding moves each by at most sqrt(1/2) + 0.01. */
#include "contour.h"

enum { OCTANT = 8192, QUADRANT = 2 * OCTANT, RADIUS_BITS = 14, FIXED = 30, ARC_SLACK = 2 };
#define ONE ((uint64_t)1 << FIXED)

static uint64_t times(uint64_t a, uint64_t b) { return (a * b) >> FIXED; }

/* Cosine and sine of step / 8192 of 45 degrees: Taylor series whose remainders are below 4e-4 of a unit of 2^-14. */
static lathe_point octant_direction(uint32_t step) {
    uint64_t t = (uint64_t)step << (FIXED - 13), t2 = times(t, t);
    uint64_t c = ONE - times(t2, 331168970 - times(t2, 17023473 - times(t2, 350031 - times(t2, 3856))));
    uint64_t s = times(t, 843314857 - times(t2, 86699834 - times(t2, 2674041 - times(t2, 39273 - times(t2, 336)))));
    uint64_t half = (uint64_t)1 << (FIXED - RADIUS_BITS - 1);
    return (lathe_point){(int32_t)((c + half) >> (FIXED - RADIUS_BITS)),
                         (int32_t)((s + half) >> (FIXED - RADIUS_BITS))};
}

lathe_point lathe__ray_direction(uint32_t ray, uint32_t rays) {
    uint32_t angle = ((ray & (rays - 1)) << 16) / rays, within = angle & (QUADRANT - 1);
    lathe_point d = octant_direction(within <= OCTANT ? within : QUADRANT - within);
    if (within > OCTANT) d = (lathe_point){d.y, d.x};
    switch (angle / QUADRANT) {
    case 0: return d;
    case 1: return (lathe_point){-d.y, d.x};
    case 2: return (lathe_point){-d.x, -d.y};
    default: return (lathe_point){d.y, -d.x};
    }
}

/* Angle of (x, y), 0 <= y <= x > 0, in units of 45 degrees / 8192; off by less than 1/2 (A&S 4.4.49). */
static uint32_t octant_angle(uint64_t x, uint64_t y) {
    while (x >> 33) x >>= 8, y >>= 8;
    uint64_t t = (y << FIXED) / x, t2 = times(t, t);
    uint64_t a = 1366947356 - times(t2, 451562537 - times(t2, 246276265 - times(t2, 116387925 - times(t2, 28484302))));
    return (uint32_t)(times(t, a) >> (FIXED - 13));
}

static uint32_t rough_angle(int64_t dx, int64_t dy) {
    uint32_t quadrant = dx > 0 && dy >= 0 ? 0 : dx <= 0 && dy > 0 ? 1 : dx < 0 ? 2 : 3;
    uint64_t x = (uint64_t)(dx < 0 ? -dx : dx), y = (uint64_t)(dy < 0 ? -dy : dy);
    if (quadrant & 1) {
        uint64_t swap = x;
        x = y;
        y = swap;
    }
    uint32_t within = y <= x ? octant_angle(x, y) : QUADRANT - octant_angle(y, x);
    return (quadrant * QUADRANT + within) & 65535;
}

static bool right_of(int64_t dx, int64_t dy, uint32_t ray, uint32_t rays) {
    lathe_point d = lathe__ray_direction(ray, rays);
    return d.x * dy - d.y * dx < 0;
}

/* |dx|, |dy| <= 2^47, so that the cross products with a direction fit. A rough angle is off by less than 1/2, a
 * rounded direction by 0.45 of 1/65536 turn: only vectors within ARC_SLACK of a ray need the comparison. */
uint32_t lathe__ray_sector(int64_t dx, int64_t dy, uint32_t rays) {
    if (!dx && !dy) return 0;
    uint32_t scaled = rough_angle(dx, dy), sector, rest;
    uint64_t product = (uint64_t)scaled * rays;
    sector = (uint32_t)(product >> 16);
    rest = (uint32_t)product & 65535;
    if (rest >= ARC_SLACK * rays && rest + ARC_SLACK * rays < 65536) return sector;
    while (right_of(dx, dy, sector, rays)) sector = (sector - 1) & (rays - 1);
    while (!right_of(dx, dy, sector + 1, rays)) sector = (sector + 1) & (rays - 1);
    return sector;
}
