/* Just above and below every slice plane a cut through the mesh gives that slice's contours: the triangles are cut exactly, one
 * lattice unit (1/65536 of a slice distance or more) from the plane, the segments chained to loops, and these held against the
 * outline: as many, each turning as its own, vertex for vertex within a stated distance. In the plane itself the mesh has the
 * outline's edges and nothing else. */
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "check.h"
#include "level.h"
#include "mesh.h"
#include "slice_pairs.h"

static lathe_arena arena[2], keep[2];

/* ---- the cut ---- */

typedef struct segment { uint32_t from[2], to[2]; double x, y; } segment;   /* ends: the mesh edges that are cut, lower vertex first; x, y: from */

static int compare_ends(const void *a, const void *b) {
    const segment *s = a, *t = b;
    for (int i = 0; i < 2; i++)
        if (s->from[i] != t->from[i]) return s->from[i] < t->from[i] ? -1 : 1;
    return 0;
}

static void name_end(uint32_t end[2], uint32_t a, uint32_t b) {
    end[0] = a < b ? a : b;
    end[1] = a < b ? b : a;
}

/* Where the plane z meets the edge a b. No vertex lies in the plane. */
static void cut_edge(const lathe_mesh *m, uint32_t a, uint32_t b, int32_t z, double *x, double *y) {
    const int32_t *p = m->lattice[a], *q = m->lattice[b];
    double t = ((double)z - p[2]) / ((double)q[2] - p[2]);
    *x = p[0] + t * ((double)q[0] - p[0]);
    *y = p[1] + t * ((double)q[1] - p[1]);
}

/* Counter-clockwise triangles, seen from outside: walking the cut the solid is on the left, as an outline's region is. */
static uint32_t cut_mesh(segment *out, const lathe_mesh *m, int32_t z) {
    uint32_t n = 0;
    for (uint32_t i = 0; i < m->triangle_count; i++)
        for (int k = 0; k < 3; k++) {
            const uint32_t *t = m->triangles[i];
            uint32_t a = t[k], b = t[(k + 1) % 3], c = t[(k + 2) % 3];
            bool up = m->lattice[a][2] > z;
            if ((m->lattice[b][2] > z) == up || (m->lattice[c][2] > z) == up) continue;
            /* a is alone on its side: the cut goes from one of its edges to the other. */
            segment *s = &out[n++];
            uint32_t first = up ? b : c, last = up ? c : b;
            name_end(s->from, a, first);
            name_end(s->to, a, last);
            cut_edge(m, a, first, z, &s->x, &s->y);
        }
    return n;
}

/* ---- against the outline ---- */

static double distance_to_segment(double x, double y, lathe_point a, lathe_point b) {
    double dx = (double)b.x - a.x, dy = (double)b.y - a.y, t = ((x - a.x) * dx + (y - a.y) * dy) / (dx * dx + dy * dy);
    t = t < 0 ? 0 : t > 1 ? 1 : t;
    return hypot(x - a.x - t * dx, y - a.y - t * dy);
}

/* The loop whose edges all of a chain's points are nearest to; UINT32_MAX if they are not all within reach of one loop. */
static uint32_t loop_of_chain(const lathe_outline *o, const segment *s, const uint32_t *chain, uint32_t count, double reach) {
    for (uint32_t l = 0; l < o->loop_count; l++) {
        const lathe_point *p = o->points + o->loops[l].first;
        uint32_t n = o->loops[l].count, near = 0;
        for (uint32_t i = 0; i < count; i++) {
            double least = INFINITY;
            for (uint32_t k = 0; k < n; k++) least = fmin(least, distance_to_segment(s[chain[i]].x, s[chain[i]].y, p[k], p[(k + 1) % n]));
            if (least > reach) break;
            near++;
        }
        if (near == count) return l;
    }
    return UINT32_MAX;
}

static double area_of_chain(const segment *s, const uint32_t *chain, uint32_t count) {
    double area = 0, x0 = s[chain[0]].x, y0 = s[chain[0]].y;
    for (uint32_t i = 1; i + 1 < count; i++) {
        const segment *a = &s[chain[i]], *b = &s[chain[i + 1]];
        area += (a->x - x0) * (b->y - y0) - (a->y - y0) * (b->x - x0);
    }
    return area;
}

static double area_of_loop(const lathe_outline *o, uint32_t l) {
    const lathe_point *p = o->points + o->loops[l].first;
    double area = 0;
    for (uint32_t i = 1; i + 1 < o->loops[l].count; i++) area += (double)lathe__orient(p[0], p[i], p[i + 1]);
    return area;
}

/* One unit from its plane a surface has moved by what its slope makes of it: the cut of a triangle between a vertex in the plane
 * and vertices at middle height lies within (extent of the triangle) / (height of its middle) units. */
static double reach_of_mesh(const lathe_mesh *m, int32_t plane, int side) {
    double most = 1;
    for (uint32_t i = 0; i < m->triangle_count; i++) {
        bool here = false;
        double rise = INFINITY, extent = 0;
        for (int k = 0; k < 3; k++) {
            const int32_t *p = m->lattice[m->triangles[i][k]], *q = m->lattice[m->triangles[i][(k + 1) % 3]];
            double z = ((double)p[2] - plane) * side;
            here |= z == 0;
            if (z > 0) rise = fmin(rise, z);
            extent = fmax(extent, hypot((double)p[0] - q[0], (double)p[1] - q[1]));
        }
        if (here && rise < INFINITY) most = fmax(most, extent / rise);
    }
    return most;
}

static void check_cut(const lathe_mesh *m, const lathe_outline *o, int32_t plane, int side, const char *what) {
    segment *s = malloc((m->triangle_count + 1) * sizeof *s);
    uint32_t n = cut_mesh(s, m, plane + side), loops = 0, *chain = malloc((n + 1) * sizeof *chain), *found = calloc(o->loop_count + 1, sizeof *found);
    uint8_t *seen = calloc(n + 1, 1);
    bool good = true;
    double reach = reach_of_mesh(m, plane, side);
    qsort(s, n, sizeof *s, compare_ends);
    for (uint32_t i = 1; i < n; i++) good = good && compare_ends(&s[i - 1], &s[i]) != 0;   /* each edge is left once */
    for (uint32_t i = 0; good && i < n; i++) {
        if (seen[i]) continue;
        uint32_t count = 0, at = i;
        do {
            seen[at] = 1;
            chain[count++] = at;
            segment want = {.from = {s[at].to[0], s[at].to[1]}};
            const segment *next = bsearch(&want, s, n, sizeof *s, compare_ends);
            if (!next) { good = false; break; }
            at = (uint32_t)(next - s);
        } while (at != i && !seen[at]);
        good = good && at == i;
        loops++;
        uint32_t l = good ? loop_of_chain(o, s, chain, count, reach) : UINT32_MAX;
        if (l == UINT32_MAX) { good = false; break; }
        found[l]++;
        good = good && (area_of_chain(s, chain, count) > 0) == (area_of_loop(o, l) > 0);
    }
    for (uint32_t l = 0; l < o->loop_count; l++) good = good && found[l] == 1;
    if (!(CHECK(good) & CHECK_EQ(loops, o->loop_count)))
        fprintf(stderr, "  in %s: plane %g, side %d, reach %g: %u loops of %u\n", what, plane / 65536.0, side, reach, loops, o->loop_count);
    free(s);
    free(chain);
    free(found);
    free(seen);
}

/* ---- in the plane ---- */

typedef struct edge { uint32_t a, b; } edge;
static int compare_edges(const void *a, const void *b) {
    const edge *s = a, *t = b;
    return s->a != t->a ? (s->a < t->a ? -1 : 1) : s->b < t->b ? -1 : s->b > t->b;
}

/* The mesh edges whose ends lie in the plane, each in the direction of the triangle above it: exactly the outline's, and no
 * triangle has three corners there. */
static void check_plane(const lathe_mesh *m, const lathe_outline *o, uint32_t base, int32_t plane, const char *what) {
    edge *e = malloc((3 * (size_t)m->triangle_count + 1) * sizeof *e);
    uint32_t n = 0, flat = 0;
    for (uint32_t i = 0; i < m->triangle_count; i++) {
        const uint32_t *t = m->triangles[i];
        int in = 0;
        for (int k = 0; k < 3; k++) in += m->lattice[t[k]][2] == plane;
        flat += in == 3;
        for (int k = 0; in == 2 && k < 3; k++)
            if (m->lattice[t[k]][2] == plane && m->lattice[t[(k + 1) % 3]][2] == plane && m->lattice[t[(k + 2) % 3]][2] > plane)
                e[n++] = (edge){t[k], t[(k + 1) % 3]};
    }
    qsort(e, n, sizeof *e, compare_edges);
    uint32_t matched = 0;
    for (uint32_t l = 0; l < o->loop_count; l++)
        for (uint32_t i = 0; i < o->loops[l].count; i++) {
            uint32_t v = o->loops[l].first + i, w = o->loops[l].first + (i + 1) % o->loops[l].count;
            edge want = {base + v, base + w};
            matched += bsearch(&want, e, n, sizeof *e, compare_edges) != NULL && m->lattice[base + v][0] == o->points[v].x &&
                       m->lattice[base + v][1] == o->points[v].y;
        }
    if (!(CHECK_EQ(flat, 0) & CHECK_EQ(n, o->point_count) & CHECK_EQ(matched, o->point_count))) fprintf(stderr, "  in %s\n", what);
    free(e);
}

/* ---- stacks ---- */

static void check_stack(const lathe_mask *mask, uint32_t coarseness, int fraction, const char *what) {
    lathe_outline *outlines;
    lathe_mesh m = {0};
    lathe_surface_counts counts = {0};
    lathe_surface_style style = {.fraction = fraction, .coarseness = coarseness};
    lathe_level_plan plan = {.slices = mask->size[2], .level_count = coarseness + 1};
    int32_t *slices;
    uint32_t count, base = 0;
    if (lathe__level_slices(&slices, &count, &keep[0], &plan, 0)) abort();
    if (!CHECK(lathe__level_outlines(&outlines, arena, mask, slices, count, &style, &counts) == LATHE_OK)) return;
    if (!CHECK(lathe__stack_outlines(&m, &arena[1], outlines, slices, count, !coarseness, &counts) == LATHE_OK)) return;
    for (uint32_t i = 0; i < count; i++) {
        check_plane(&m, &outlines[i], base, slices[i] * LATHE_LATTICE_ONE, what);
        check_cut(&m, &outlines[i], slices[i] * LATHE_LATTICE_ONE, 1, what);
        check_cut(&m, &outlines[i], slices[i] * LATHE_LATTICE_ONE, -1, what);
        base += outlines[i].point_count;
    }
    lathe_mesh_free(&m);
    lathe__arena_reset(&arena[0]);
    lathe__arena_reset(&arena[1]);
    lathe__arena_reset(&keep[0]);
}

/* A sphere with a tunnel and a cavity: loops in loops. */
static void hollow_ball(void) {
    lathe_mask m;
    int32_t dims[3] = {28, 28, 21}, origin[3] = {0, 0, 0};
    if (lathe__mask_new(&m, dims, origin)) abort();
    for (int w = 0; w < 21; w++)
        for (int v = 1; v < 27; v++)
            for (int u = 1; u < 27; u++) {
                int x = 2 * u - 27, y = 2 * v - 27, z = 2 * (w - 10), d = x * x + y * y + z * z;
                bool tunnel = (x - 8) * (x - 8) + (y - 2) * (y - 2) <= 20, cavity = (x + 9) * (x + 9) + y * y + z * z <= 50;
                pair_set(&m, u, v, w, d <= 400 && !tunnel && !cavity);
            }
    for (uint32_t coarseness = 0; coarseness < 4; coarseness++) check_stack(&m, coarseness, 32, "hollow ball");
    lathe__mask_free(&m);
}

int main(void) {
    hollow_ball();
    for (uint64_t i = 0; i < 1500; i++) {
        slice_pair p = pair_draw(i, 3);
        char what[64];
        snprintf(what, sizeof what, "pair %d (%s)", (int)i, pair_kind_name[p.kind]);
        /* The last level, which is what must cut back to its slices; the coarse ones do too. */
        check_stack(&p.mask, 0, p.fraction, what);
        check_stack(&p.mask, p.coarseness, p.fraction, what);
        lathe__mask_free(&p.mask);
        if (check_failed > 20) break;
    }
    for (int i = 0; i < 2; i++) {
        lathe__arena_free(&arena[i]);
        lathe__arena_free(&keep[i]);
    }
    return check_end();
}
