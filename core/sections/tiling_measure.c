#include <math.h>
#include "sections.h"

typedef struct point3 { double x, y, z; } point3;

static double distance(point3 p, point3 q) {
    return sqrt((p.x - q.x) * (p.x - q.x) + (p.y - q.y) * (p.y - q.y) + (p.z - q.z) * (p.z - q.z));
}

static double triangle(point3 a, point3 b, point3 c) {
    double ux = b.x - a.x, uy = b.y - a.y, uz = b.z - a.z, vx = c.x - a.x, vy = c.y - a.y, vz = c.z - a.z;
    double x = uy * vz - uz * vy, y = uz * vx - ux * vz, z = ux * vy - uy * vx;
    return sqrt(x * x + y * y + z * z) / 2;
}

lathe_status lathe__measure_tiling(lathe_tiling_measure *out, const lathe_tiling *tiling, const lathe_point *a,
                                   uint32_t a_count, const lathe_point *b, uint32_t b_count, int32_t rise) {
    if (a_count < 3 || b_count < 3 || tiling->start[0] >= a_count || tiling->start[1] >= b_count)
        return LATHE_ERR_RANGE;
    lathe_tiling_measure m = {.vertices = a_count + b_count};
    double length = 0;
    uint32_t i = tiling->start[0], j = tiling->start[1], edges = 0;
    for (uint32_t k = 0; k < tiling->count; k++) {
        uint32_t step = tiling->steps[k], ni = step & 1 ? (i + 1 < a_count ? i + 1 : 0) : i,
                 nj = step & 2 ? (j + 1 < b_count ? j + 1 : 0) : j;
        point3 p = {a[i].x, a[i].y, 0}, q = {b[j].x, b[j].y, rise}, np = {a[ni].x, a[ni].y, 0},
               nq = {b[nj].x, b[nj].y, rise};
        if (step < 1 || step > 3) return LATHE_ERR_RANGE;
        if (step & 1) length += distance(p, np), edges++;
        if (step & 2) length += distance(q, nq), edges++;
        if (step == 3) {
            double d = distance(p, nq), e = distance(np, q);
            length += d < e ? d : e, edges++;
            m.area += d < e ? triangle(p, np, nq) + triangle(p, nq, q) : triangle(p, np, q) + triangle(np, nq, q);
        } else {
            m.area += step == 1 ? triangle(p, np, q) : triangle(p, nq, q);
        }
        length += distance(np, nq), edges++;   /* the span that the step ends in; the last is the first */
        m.triangles += step == 3 ? 2 : 1;
        i = ni, j = nj;
    }
    if (i != tiling->start[0] || j != tiling->start[1]) return LATHE_ERR_RANGE;
    m.mean_edge = edges ? length / edges : 0;
    *out = m;
    return LATHE_OK;
}
