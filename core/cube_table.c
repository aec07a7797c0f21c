/* A face with vertices on its edges has one segment for each run of inside corners around it: that keeps inside corners apart across the
 * diagonal. The segments of a cube's faces form loops, which are filled with triangles. No triangle has an edge within a face that is no
 * segment, so cubes meet in their segments only. */
#include "cube_table.h"
#include <stdbool.h>
#include <string.h>
#include <threads.h>

enum { EDGES = LATHE_CUBE_EDGES, NONE = 255 };

static int corner_of(int axis, int along, int first, int second) {
    return along << axis | first << (axis + 1) % 3 | second << (axis + 2) % 3;
}

static int edge_of(int a, int b) {
    int axis = (a ^ b) >> 1, low = a & b;   /* 1, 2, 4 become 0, 1, 2 */
    return 4 * axis + (low >> (axis + 1) % 3 & 1) + 2 * (low >> (axis + 2) % 3 & 1);
}

/* Do two edges lie in one face? */
static bool share_face(int a, int b) {
    int x = a / 4, y = b / 4;
    for (int axis = 0; axis < 3; axis++) {
        if (axis == x || axis == y) continue;
        int p = a >> (axis == (x + 2) % 3) & 1, q = b >> (axis == (y + 2) % 3) & 1;
        if (p == q) return true;
    }
    return false;
}

/* next[edge]: where the segment that begins there ends. */
static void find_segments(uint8_t next[EDGES], int inside) {
    memset(next, NONE, EDGES);
    for (int axis = 0; axis < 3; axis++)
        for (int side = 0; side < 2; side++) {
            int ring[4];       /* counter-clockwise, seen from outside of the cube */
            for (int k = 0; k < 4; k++) {
                int i = side ? k : 3 - k;
                ring[k] = corner_of(axis, side, i == 1 || i == 2, i >= 2);
            }
            for (int k = 0; k < 4; k++) {
                /* A run of inside corners begins at k. */
                if (!(inside >> ring[k] & 1) || inside >> ring[(k + 3) % 4] & 1) continue;
                int end = k;
                while (inside >> ring[(end + 1) % 4] & 1) end++;
                next[edge_of(ring[(k + 3) % 4], ring[k])] = (uint8_t)edge_of(ring[end % 4], ring[(end + 1) % 4]);
            }
        }
}

static void add_triangle(lathe_cube_case *c, int p, int q, int r) {
    uint8_t *t = c->corner[c->count++];
    t[0] = (uint8_t)p, t[1] = (uint8_t)q, t[2] = (uint8_t)r;
}

static bool may_join(const uint8_t *loop, int n, int i, int k) {
    return k == i + 1 || (i == 0 && k == n - 1) || !share_face(loop[i], loop[k]);
}

/* Triangles between the vertices i .. k of a loop; false if there are none without an edge in a face. */
static bool fill(lathe_cube_case *c, const uint8_t *loop, int n, int i, int k) {
    if (k == i + 1) return true;
    int keep = c->count;
    for (int m = i + 1; m < k; m++) {
        if (!may_join(loop, n, i, m) || !may_join(loop, n, m, k)) continue;
        add_triangle(c, loop[i], loop[m], loop[k]);
        if (fill(c, loop, n, i, m) && fill(c, loop, n, m, k)) return true;
        c->count = (uint8_t)keep;
    }
    return false;
}

/* Two opposite corners outside: those inside are a ring of six, so there is a tunnel between. */
static void add_tunnel(lathe_cube_case *c, const uint8_t loop[3], int opposite) {
    for (int i = 0; i < 3; i++) {
        int p = loop[i], q = loop[(i + 1) % 3], axis = 3 - p / 4 - q / 4;
        add_triangle(c, p, q, edge_of(opposite, opposite ^ 1 << axis));
    }
}

static void make_case(lathe_cube_case *c, int inside) {
    uint8_t next[EDGES], loop[EDGES];
    c->count = 0;
    find_segments(next, inside);
    int outside = ~inside & 255;
    bool tunnel = false;
    for (int k = 0; k < 4; k++) tunnel = tunnel || outside == (1 << k | 1 << (7 - k));
    for (int e = 0; e < EDGES; e++) {
        int n = 0;
        for (int at = e; next[at] != NONE; n++) {
            loop[n] = (uint8_t)at;
            int to = next[at];
            next[at] = NONE;
            at = to;
        }
        if (!n) continue;
        if (!tunnel) {
            fill(c, loop, n, 0, n - 1);   /* never in vain: tests/test_raster_surface.c looks at all of them */
            continue;
        }
        for (int k = 0; k < 8; k++)
            if (outside >> k & 1 && edge_of(k, k ^ 1 << loop[0] / 4) != loop[0]) add_tunnel(c, loop, k);
    }
}

static lathe_cube_case table[256];
static once_flag made = ONCE_FLAG_INIT;
static void make_table(void) {
    for (int i = 0; i < 256; i++) make_case(&table[i], i);
}

const lathe_cube_case *lathe__cube_table(void) {
    call_once(&made, make_table);
    return table;
}
