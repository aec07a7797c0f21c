#include "octangle.h"

void lathe__octangle_add(lathe_octangle *octangle, lathe_point p) {
    const int32_t value[4] = {p.x, p.y, p.x + p.y, p.x - p.y};
    for (int k = 0; k < 4; k++) {
        if (value[k] < octangle->low[k]) octangle->low[k] = value[k];
        if (value[k] > octangle->high[k]) octangle->high[k] = value[k];
    }
}

lathe_octangle lathe__octangle_of(lathe_point p, lathe_point q) {
    lathe_octangle o = {{p.x, p.y, p.x + p.y, p.x - p.y}, {p.x, p.y, p.x + p.y, p.x - p.y}};
    lathe__octangle_add(&o, q);
    return o;
}

void lathe__octangle_join(lathe_octangle *octangle, const lathe_octangle *other) {
    for (int k = 0; k < 4; k++) {
        if (other->low[k] < octangle->low[k]) octangle->low[k] = other->low[k];
        if (other->high[k] > octangle->high[k]) octangle->high[k] = other->high[k];
    }
}

void lathe__octangle_corners(lathe_point c[8], const lathe_octangle *o) {
    const int32_t *low = o->low, *high = o->high;
    c[0] = (lathe_point){high[0], high[0] - high[3]};
    c[1] = (lathe_point){high[0], high[2] - high[0]};
    c[2] = (lathe_point){high[2] - high[1], high[1]};
    c[3] = (lathe_point){high[1] + low[3], high[1]};
    c[4] = (lathe_point){low[0], low[0] - low[3]};
    c[5] = (lathe_point){low[0], low[2] - low[0]};
    c[6] = (lathe_point){low[2] - low[1], low[1]};
    c[7] = (lathe_point){low[1] + high[3], low[1]};
}
