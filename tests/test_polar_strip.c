/* The paper's polar coding [M 6.2]: exact round trips, bytes against plain meshes, damaged and hostile bytes. */
#include "centre.h"
#include "check.h"
#include "mesh.h"
#include "pixel_shapes.h"
#include "polar_strip.h"
#include <math.h>

enum { VOXEL = 65536, MOST = 8 };
static shape region;
static shape_loop loops[MOST];
static lathe_ray_contour contours[MOST];
static int32_t heights[MOST];

static uint32_t make_stack(lathe_arena *arena, uint64_t *seed, uint32_t want, uint32_t rays) {
    uint32_t count = 0;
    for (uint32_t k = 0; k < want; k++) {
        lathe_point centre;
        shape_make(&region, seed, shape_below(seed, 4));
        shape_trace(&loops[k], &region, seed, 1);
        if (lathe__loop_centre(&centre, arena, loops[k].points, loops[k].count)) continue;
        heights[count] = (int32_t)k * VOXEL;
        if (!lathe__make_ray_contour(&contours[count], arena, loops[k].points, loops[k].count, centre, rays,
                                     (uint32_t)shape_below(seed, 65536)))
            count++;
    }
    return count;
}
static bool same_stack(const lathe_polar_stack *a, const lathe_polar_stack *b) {
    if (a->count != b->count || a->rays != b->rays || a->bits != b->bits || a->farthest != b->farthest) return false;
    for (uint32_t k = 0; k < a->count; k++) {
        const lathe_polar_contour *p = &a->contours[k], *q = &b->contours[k];
        const lathe_ray_contour *c = &p->contour, *d = &q->contour;
        if (p->height != q->height || c->centre.x != d->centre.x || c->centre.y != d->centre.y || c->turn != d->turn ||
            c->count != d->count)
            return false;
        if (memcmp(p->steps, q->steps, c->count * sizeof *p->steps) || memcmp(c->types, d->types, c->count) ||
            memcmp(c->points, d->points, c->count * sizeof *c->points) ||
            memcmp(c->radius, d->radius, c->count * sizeof *c->radius))
            return false;
        for (uint32_t i = 0; i < c->count; i++)
            if (c->crossings[i].ray != d->crossings[i].ray || c->crossings[i].in_out != d->crossings[i].in_out)
                return false;
    }
    return true;
}
/* Quantised vertices against those that were given: the same rays in the same order, radii within a step. */
static bool near_given(const lathe_polar_stack *s) {
    double step = (double)s->farthest / (s->bits == 16 ? 21845 : 1 << 22);
    for (uint32_t k = 0; k < s->count; k++) {
        const lathe_ray_contour *c = &s->contours[k].contour, *given = &contours[k];
        uint32_t start = 0;
        while (given->crossings[start].ray || !given->crossings[start].in_out) start++;
        if (c->count != given->count) return false;
        for (uint32_t i = 0; i < c->count; i++) {
            uint32_t g = (start + i) % c->count;
            double off =
                hypot((double)c->points[i].x - given->points[g].x, (double)c->points[i].y - given->points[g].y);
            /* Directions are rounded to 2^-14, turns to as much again. */
            if (c->crossings[i].ray != given->crossings[g].ray || off > step + 3 + (double)given->radius[g] / 8192)
                return false;
            if (llabs(c->radius[i] - given->radius[g]) > step + 2) return false;
        }
    }
    return true;
}

static void test_round_trips(lathe_arena *arena) {
    uint64_t seed = 62, values = 0;
    uint32_t done = 0;
    for (int round = 0; round < 600; round++) {
        lathe__arena_reset(arena);
        uint32_t bits = round & 1 ? 16 : 32,
                 count =
                     make_stack(arena, &seed, 2 + (uint32_t)shape_below(&seed, MOST - 1), 4u << shape_below(&seed, 6));
        lathe_polar_stack stack, back;
        if (!count) continue;
        lathe_status status = lathe__polar_quantise(&stack, arena, contours, heights, count, bits);
        if (!CHECK(status == LATHE_OK || status == LATHE_ERR_FORMAT) || status) continue;
        CHECK(near_given(&stack));
        size_t size = lathe__polar_size(&stack);
        uint8_t *bytes = LATHE_NEW(arena, uint8_t, size);
        lathe__polar_encode(bytes, &stack);
        if (!CHECK(lathe__polar_decode(&back, arena, bytes, size) == LATHE_OK)) continue;
        CHECK(same_stack(&stack, &back));
        size_t vertices = 0;
        for (uint32_t k = 0; k < count; k++) vertices += stack.contours[k].contour.count;
        CHECK_EQ(size, LATHE_POLAR_HEAD + count * LATHE_POLAR_CONTOUR_HEAD + vertices * (bits / 8));
        lathe_mesh mesh = {0};
        lathe_mesh_report report;
        if (CHECK(lathe__polar_mesh(&mesh, &back) == LATHE_OK) && count > 1) {
            CHECK(lathe__mesh_check(&report, &mesh, false) == LATHE_OK);
            CHECK_EQ(report.nonmanifold_edges + report.misoriented_edges + report.bad_indices + report.unused_vertices,
                     0);
            CHECK_EQ(report.boundary_edges, stack.contours[0].contour.count + stack.contours[count - 1].contour.count);
            CHECK_EQ(mesh.triangle_count, 2 * vertices - report.boundary_edges);
        }
        lathe_mesh_free(&mesh);
        values += vertices;
        done++;
    }
    CHECK(done > 500);
    printf("%u stacks, %llu values\n", done, (unsigned long long)values);
}

/* Written by hand: a square at four rays, centre (1, 2), in 16 bits. */
static void test_bytes(lathe_arena *arena) {
    static const uint8_t bytes[] = {'L', 'P', 'S', '1', 16, 2, 0, 0, 1, 0, 0, 0, 0x55, 0x55, 0, 0, 0, 0, 0, 0, 1, 0, 0,
                                    0, 2, 0, 0, 0, 3, 0, 0, 0, 0, 0, 0, 0, 4, 0, 0, 0,
                                    /* 2 * 21845 + 10, 20, 30, 40 */
                                    0xb4, 0xaa, 0xbe, 0xaa, 0xc8, 0xaa, 0xd2, 0xaa};
    lathe_polar_stack s;
    uint8_t again[sizeof bytes];
    if (!CHECK(lathe__polar_decode(&s, arena, bytes, sizeof bytes) == LATHE_OK)) return;
    CHECK(s.count == 1 && s.rays == 4 && s.farthest == 21845 && s.contours[0].height == 3);
    const lathe_ray_contour *c = &s.contours[0].contour;
    for (uint32_t i = 0; i < 4; i++)
        CHECK(c->types[i] == LATHE_FOR && c->crossings[i].ray == i && s.contours[0].steps[i] == 10 * (i + 1));
    CHECK(c->points[1].x == 1 && c->points[1].y == 23 &&
          c->points[2].x == -30); /* 20.5 and 30.5, rounded away from the centre or to it */
    CHECK_EQ(lathe__polar_size(&s), sizeof bytes);
    lathe__polar_encode(again, &s);
    CHECK(!memcmp(bytes, again, sizeof bytes));
}

static void test_damage(lathe_arena *arena) {
    uint64_t seed = 99;
    uint32_t taken = 0;
    for (int round = 0; round < 12; round++) {
        lathe_arena own = {0};
        lathe_polar_stack stack, back;
        uint32_t count = make_stack(&own, &seed, 3, 8);
        if (!CHECK(count > 0) || lathe__polar_quantise(&stack, &own, contours, heights, count, round & 1 ? 16 : 32)) {
            lathe__arena_free(&own);
            continue;
        }
        size_t size = lathe__polar_size(&stack);
        uint8_t *bytes = LATHE_NEW(&own, uint8_t, size), *copy = malloc(size);
        lathe__polar_encode(bytes, &stack);
        for (size_t n = 0; n < size; n++) {
            uint8_t *prefix = malloc(n ? n : 1); /* exactly as long, so that reading on is found out */
            memcpy(prefix, bytes, n);
            lathe__arena_reset(arena);
            CHECK(lathe__polar_decode(&back, arena, prefix, n) == LATHE_ERR_FORMAT);
            free(prefix);
        }
        for (int k = 0; k < 3000; k++) {
            memcpy(copy, bytes, size);
            for (int flips = 1 + shape_below(&seed, 3); flips > 0; flips--)
                copy[shape_below(&seed, (int)size)] ^= (uint8_t)(1 << shape_below(&seed, 8));
            lathe__arena_reset(arena);
            if (lathe__polar_decode(&back, arena, copy, size)) continue;
            /* What is taken is a stack like any other. */
            lathe_mesh mesh = {0};
            CHECK(lathe__polar_mesh(&mesh, &back) == LATHE_OK);
            lathe_mesh_free(&mesh);
            uint8_t *again = malloc(lathe__polar_size(&back));
            lathe__polar_encode(again, &back);
            CHECK(lathe__polar_size(&back) == size && !memcmp(again, copy, size));
            free(again);
            taken++;
        }
        free(copy);
        lathe__arena_free(&own);
    }
    CHECK(taken > 100);
}
static void test_errors(lathe_arena *arena) {
    uint64_t seed = 3;
    lathe_polar_stack s;
    uint32_t count = make_stack(arena, &seed, 2, 8);
    if (!CHECK_EQ(count, 2)) return;
    CHECK_EQ(lathe__polar_quantise(&s, arena, contours, heights, 0, 16), LATHE_ERR_RANGE);
    CHECK_EQ(lathe__polar_quantise(&s, arena, contours, heights, 2, 8), LATHE_ERR_RANGE);
    contours[1].rays = 16;
    CHECK_EQ(lathe__polar_quantise(&s, arena, contours, heights, 2, 16), LATHE_ERR_RANGE);
}

int main(void) {
    lathe_arena arena = {0};
    test_bytes(&arena);
    test_errors(&arena);
    test_round_trips(&arena);
    test_damage(&arena);
    lathe__arena_free(&arena);
    return check_end();
}
