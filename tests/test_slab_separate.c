/* The last resort of a slab that cannot be joined: every loop closed for itself, and what is left open are the
 * outlines. */
#include "check.h"
#include "mesh.h"
#include "slab_surface.h"
#include <stdlib.h>

enum { UNIT = LATHE_LATTICE_ONE };

/* Squares of some half width around a middle, in voxels; holes clockwise. */
typedef struct square {
    int x, y, half;
    bool hole;
} square;

static void make_outline(lathe_outline *out, lathe_point *points, lathe_loop *loops, const square *squares, int count) {
    static const int corner[4][2] = {{-1, -1}, {1, -1}, {1, 1}, {-1, 1}};
    *out = (lathe_outline){.points = points, .loops = loops};
    for (int k = 0; k < count; k++) {
        const square *s = &squares[k];
        loops[out->loop_count++] = (lathe_loop){.first = out->point_count, .count = 4, .hole = s->hole};
        for (int i = 0; i < 4; i++) {
            const int *c = corner[s->hole ? 3 - i : i];
            points[out->point_count++] = (lathe_point){(s->x + c[0] * s->half) * UNIT, (s->y + c[1] * s->half) * UNIT};
        }
    }
}

/* A square with a hole, in which a square with a hole lies, below; two squares above, each over part of that. */
int main(void) {
    static const square low[] = {{0, 0, 40, false}, {0, 0, 30, true}, {0, 0, 20, false}, {3, 4, 10, true}};
    static const square high[] = {{-30, 0, 12, false}, {25, 5, 11, false}};
    lathe_point points[2][16];
    lathe_loop loops[2][4];
    lathe_outline outline[2];
    make_outline(&outline[0], points[0], loops[0], low, 4);
    make_outline(&outline[1], points[1], loops[1], high, 2);
    lathe_slab_input in = {.outline = {&outline[0], &outline[1]}, .height = {0, 8 * UNIT}};
    lathe_slab_outcome outcome;
    lathe_slab_faults faults;
    lathe_mesh mesh;
    lathe_arena arena = {0};
    CHECK_EQ(lathe__separate_slab(&mesh, &outcome, &faults, &arena, &in), LATHE_OK);
    CHECK_EQ(outcome, LATHE_SLAB_SOUND);
    CHECK(lathe__slab_is_sound(&faults));
    lathe_mesh_report report;
    CHECK_EQ(lathe__mesh_check(&report, &mesh, true), LATHE_OK);
    CHECK_EQ(report.components, 4); /* two rings below, two squares above */
    CHECK_EQ(report.euler, 2);      /* a ring has 0, a square 1 */
    CHECK_EQ(report.boundary_edges, 24);
    CHECK_EQ(report.self_intersections, 0);
    /* Seen from above each area once: upwards below, downwards above. */
    double area[2] = {0, 0};
    for (uint32_t i = 0; i < mesh.triangle_count; i++) {
        const int32_t *a = mesh.lattice[mesh.triangles[i][0]], *b = mesh.lattice[mesh.triangles[i][1]];
        const int32_t *c = mesh.lattice[mesh.triangles[i][2]];
        double twice = ((double)b[0] - a[0]) * ((double)c[1] - a[1]) - ((double)b[1] - a[1]) * ((double)c[0] - a[0]);
        area[mesh.triangles[i][0] >= 16 && a[2] > 4 * UNIT] += twice / 2 / UNIT / UNIT;
    }
    CHECK(area[0] == 80 * 80 - 60 * 60 + 40 * 40 - 20 * 20);
    CHECK(area[1] == -(24 * 24 + 22 * 22));
    lathe_mesh_free(&mesh);
    /* Two loops on one another cannot be closed without touching: no surface, but no failure either. */
    outline[1] = outline[0];
    in.height[1] = 1;
    CHECK_EQ(lathe__separate_slab(&mesh, &outcome, &faults, &arena, &in), LATHE_OK);
    CHECK_EQ(outcome, LATHE_SLAB_AT_FAULT);
    CHECK(!lathe__slab_is_sound(&faults) && !mesh.lattice && !mesh.triangles);
    lathe__arena_free(&arena);
    return check_end();
}
