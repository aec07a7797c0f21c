/* Ray directions and sectors: all 65536 directions, all ray counts, and vectors at, beside and between the rays. */
#include "check.h"
#include "contour.h"
#include <math.h>

static int64_t cross(lathe_point a, lathe_point b) { return (int64_t)a.x * b.y - (int64_t)a.y * b.x; }

static void test_directions(void) {
    int wrong = 0, unordered = 0, asymmetric = 0;
    double worst = 0;
    for (uint32_t i = 0; i < 65536; i++) {
        lathe_point d = lathe__ray_direction(i, 65536), next = lathe__ray_direction((i + 1) & 65535, 65536);
        double angle = i * (2 * 3.14159265358979323846 / 65536), ex = fabs(d.x - 16384 * cos(angle)),
               ey = fabs(d.y - 16384 * sin(angle));
        if (ex > worst) worst = ex;
        if (ey > worst) worst = ey;
        wrong += ex > 0.51 || ey > 0.51;
        unordered += cross(d, next) <= 0;
        lathe_point quarter = lathe__ray_direction((i + 16384) & 65535, 65536);
        asymmetric += quarter.x != -d.y || quarter.y != d.x;
    }
    CHECK_EQ(wrong, 0);
    CHECK_EQ(unordered, 0);
    CHECK_EQ(asymmetric, 0);
    CHECK_EQ(lathe__ray_direction(0, 8).x, 16384);
    CHECK_EQ(lathe__ray_direction(0, 8).y, 0);
    CHECK_EQ(lathe__ray_direction(1, 8).x, 11585);
    CHECK_EQ(lathe__ray_direction(1, 8).y, 11585);
    CHECK_EQ(lathe__ray_direction(3, 4).y, -16384);
}

/* The rays of a level are the even rays of the next. */
static void test_nesting(void) {
    int differ = 0;
    for (uint32_t rays = 4; rays < 65536; rays *= 2)
        for (uint32_t i = 0; i < rays; i++) {
            lathe_point a = lathe__ray_direction(i, rays), b = lathe__ray_direction(2 * i, 2 * rays);
            differ += a.x != b.x || a.y != b.y;
        }
    CHECK_EQ(differ, 0);
}

static int in_sector(int64_t x, int64_t y, uint32_t sector, uint32_t rays) {
    lathe_point d = lathe__ray_direction(sector, rays), e = lathe__ray_direction((sector + 1) % rays, rays);
    __int128 after = (__int128)d.x * y - (__int128)d.y * x, before = (__int128)e.x * y - (__int128)e.y * x;
    __int128 front = (__int128)d.x * x + (__int128)d.y * y;
    return after >= 0 && before < 0 && (rays > 4 ? front > 0 : front >= 0);
}

static uint64_t random_bits(uint64_t *seed) {
    *seed ^= *seed << 13;
    *seed ^= *seed >> 7;
    return *seed ^= *seed << 17;
}

static void test_sectors(void) {
    uint64_t seed = 88172645463325252u;
    int bad = 0;
    for (uint32_t rays = 4; rays <= 65536; rays *= 2)
        for (int i = 0; i < 120000; i++) {
            int bits = 1 + (int)(random_bits(&seed) % 47);
            int64_t x =
                (int64_t)(random_bits(&seed) >> 16 & (((uint64_t)1 << bits) - 1)) * (random_bits(&seed) & 1 ? -1 : 1);
            int64_t y =
                (int64_t)(random_bits(&seed) >> 16 & (((uint64_t)1 << bits) - 1)) * (random_bits(&seed) & 1 ? -1 : 1);
            if (!x && !y) continue;
            bad += !in_sector(x, y, lathe__ray_sector(x, y, rays), rays);
        }
    CHECK_EQ(bad, 0);
    int64_t far = (int64_t)1 << 47, corners[8][2] = {{far, 0},  {far, far},   {0, far},  {-far, far},
                                                     {-far, 0}, {-far, -far}, {0, -far}, {far, -far}};
    for (uint32_t i = 0; i < 8; i++) CHECK_EQ(lathe__ray_sector(corners[i][0], corners[i][1], 8), i);
    CHECK_EQ(lathe__ray_sector(0, 0, 64), 0);
}

/* On each ray at many lengths, and one lattice unit to either side of it. */
static void test_boundaries(void) {
    int on = 0, beside = 0;
    for (uint32_t i = 0; i < 65536; i++) {
        lathe_point d = lathe__ray_direction(i, 65536);
        for (int64_t length = 1; length <= (int64_t)1 << 32; length *= 1 << 8) {
            int64_t x = d.x * length, y = d.y * length, nx = d.y > 0 ? -1 : 1, ny = d.x > 0 ? 1 : -1;
            on += lathe__ray_sector(x, y, 65536) != i;
            beside += !in_sector(x + nx, y, lathe__ray_sector(x + nx, y, 65536), 65536);
            beside += !in_sector(x, y + ny, lathe__ray_sector(x, y + ny, 65536), 65536);
            beside += !in_sector(x, y - ny, lathe__ray_sector(x, y - ny, 65536), 65536);
        }
    }
    CHECK_EQ(on, 0);
    CHECK_EQ(beside, 0);
    int bad = 0;
    for (uint32_t rays = 4; rays <= 65536; rays *= 4)
        for (int x = -60; x <= 60; x++)
            for (int y = -60; y <= 60; y++)
                if (x || y) bad += !in_sector(x, y, lathe__ray_sector(x, y, rays), rays);
    CHECK_EQ(bad, 0);
}

int main(void) {
    test_directions();
    test_nesting();
    test_sectors();
    test_boundaries();
    return check_end();
}
