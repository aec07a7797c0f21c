/* The surface of a radius map. Rays keep their directions from row to row (or turn evenly), so that a strip's triangles lie in
 * wedges about the line of centres that do not overlap: the surface cannot cross itself. */
#include <stdlib.h>
#include "radius_tubes.h"

lathe_point lathe__radius_place(const lathe_radius_map *map, const int32_t centre[2], int32_t row, uint32_t ray, int32_t radius) {
    uint32_t turn = (uint32_t)map->turn * (uint32_t)row;
    lathe_point d = lathe__ray_direction((ray * (65536 / map->rays) + turn) & 65535, 65536);
    int64_t length = (int64_t)radius * (LATHE_LATTICE_ONE / LATHE_RADIUS_ONE);
    return (lathe_point){centre[0] * (LATHE_LATTICE_ONE / 2) + (int32_t)(length * d.x / LATHE_RAY_LENGTH),
                         centre[1] * (LATHE_LATTICE_ONE / 2) + (int32_t)(length * d.y / LATHE_RAY_LENGTH)};
}

lathe_point lathe__radius_point(const lathe_radius_map *map, int32_t row, uint32_t ray) {
    return lathe__radius_place(map, map->centre[row], row, ray, map->radius[(size_t)row * map->rays + ray]);
}

static void aim(lathe_ray_fan *f, const lathe_radius_map *map, uint32_t turn, uint32_t stride) {
    f->turn = turn;
    for (uint32_t i = 0; i < map->rays / 4; i += stride) f->d[i / stride] = lathe__ray_direction((i * (65536 / map->rays) + turn) & 65535, 65536);
}

/* As lathe__radius_place has it: radius * 2^10 * direction / 2^14, rounded towards 0. */
static inline int32_t along(int32_t radius, int32_t direction) {
    return (int32_t)((int64_t)radius * direction / (LATHE_RAY_LENGTH / (LATHE_LATTICE_ONE / LATHE_RADIUS_ONE)));
}

void lathe__radius_ring(int32_t (*v)[3], ptrdiff_t step, lathe_ray_fan *f, const lathe_radius_map *map, int32_t row, uint32_t stride,
                        int32_t height) {
    uint32_t turn = (uint32_t)map->turn * (uint32_t)row & 65535, quarter = map->rays / 4 / stride;
    if (f->turn != turn) aim(f, map, turn, stride);
    const int32_t *radius = map->radius + (size_t)row * map->rays;
    int32_t centre[2] = {map->centre[row][0] * (LATHE_LATTICE_ONE / 2), map->centre[row][1] * (LATHE_LATTICE_ONE / 2)};
    for (int q = 0; q < 4; q++) {
        /* q quarters of a turn: (a, b), (-b, a), (-a, -b), (b, -a). */
        int first = q & 1, second = !first, x = q == 1 || q == 2 ? -1 : 1, y = q >= 2 ? -1 : 1;
        const lathe_point *d = f->d;
        for (const lathe_point *end = d + quarter; d < end; d++, v += step, radius += stride) {
            v[0][first] = centre[first] + (first ? y : x) * along(*radius, d->x);
            v[0][second] = centre[second] + (first ? x : y) * along(*radius, d->y);
            v[0][2] = height;
        }
    }
}

static void add(lathe_mesh *mesh, uint32_t a, uint32_t b, uint32_t c) {
    uint32_t *t = mesh->triangles[mesh->triangle_count++];
    t[0] = a, t[1] = b, t[2] = c;
}

/* Of a lower and an upper vertex. */
typedef struct rung { int64_t sum[2], gap[2]; } rung;
static inline rung rung_between(const int32_t *p, const int32_t *q) {
    return (rung){{(int64_t)p[0] + q[0], (int64_t)p[1] + q[1]}, {(int64_t)p[0] - q[0], (int64_t)p[1] - q[1]}};
}

/* Of a quadrangle a b c d, |a - c|^2 - |b - d|^2 = (a + d - b - c) (a - d + b - c): is it from a to c? Products that hostile coordinates
 * would make too large wrap. */
static inline bool goes_from_a(const rung *l, const rung *r) {
    uint64_t x = (uint64_t)(l->sum[0] - r->sum[0]) * (uint64_t)(l->gap[0] + r->gap[0]);
    uint64_t y = (uint64_t)(l->sum[1] - r->sum[1]) * (uint64_t)(l->gap[1] + r->gap[1]);
    return (int64_t)(x + y) <= 0;
}

void lathe__radius_strip(uint32_t (*t)[3], const int32_t (*at)[3], uint32_t lower, uint32_t upper, uint32_t rays) {
    rung left = rung_between(at[lower], at[upper]), first = left;
    uint32_t a = lower, d = upper, *out = *t;
    for (const uint32_t last = lower + rays - 1; a < last; a++, d++, out += 6) {
        rung right = rung_between(at[a + 1], at[d + 1]);
        uint32_t from_a = goes_from_a(&left, &right);
        out[0] = a, out[1] = a + 1, out[2] = d + from_a;
        out[3] = a + 1 - from_a, out[4] = d + 1, out[5] = d;
        left = right;
    }
    bool from_a = goes_from_a(&left, &first);
    out[0] = a, out[1] = lower, out[2] = from_a ? upper : d;
    out[3] = from_a ? a : lower, out[4] = upper, out[5] = d;
}

/* side 0: below the first row, 1: above the last. */
static void add_cap(lathe_mesh *mesh, const lathe_radius_map *map, int side, uint32_t first, uint32_t rays) {
    uint32_t apex = mesh->vertex_count++;
    int32_t row = side ? map->slices - 1 : 0, *v = mesh->lattice[apex];
    for (int k = 0; k < 2; k++) v[k] = map->centre[row][k] * (LATHE_LATTICE_ONE / 2);
    v[2] = row * LATHE_LATTICE_ONE + (side ? 1 : -1) * map->apex[side] * (LATHE_LATTICE_ONE / LATHE_APEX_ONE);
    for (uint32_t i = 0; i < rays; i++) {
        uint32_t a = first + i, b = first + (i + 1 < rays ? i + 1 : 0);
        add(mesh, apex, side ? a : b, side ? b : a);
    }
}

lathe_status lathe__radius_strips(lathe_mesh *out, const lathe_radius_map *map, const int32_t *list, uint32_t rows, uint32_t stride) {
    uint32_t rays = map->rays / stride;
    size_t vertices = (size_t)rows * rays + 2, triangles = (size_t)rows * rays * 2;
    lathe_mesh mesh = {.lattice = malloc(vertices * sizeof *mesh.lattice), .triangles = malloc(triangles * sizeof *mesh.triangles)};
    if (!mesh.lattice || !mesh.triangles) {
        lathe_mesh_free(&mesh);
        return LATHE_ERR_MEMORY;
    }
    lathe_ray_fan f = {.turn = UINT32_MAX};
    for (uint32_t i = 0; i < rows; i++, mesh.vertex_count += rays) {
        lathe__radius_ring(mesh.lattice + mesh.vertex_count, 1, &f, map, list[i], stride, list[i] * LATHE_LATTICE_ONE);
        if (!i) continue;
        lathe__radius_strip(mesh.triangles + mesh.triangle_count, (const int32_t(*)[3])mesh.lattice, mesh.vertex_count - rays, mesh.vertex_count, rays);
        mesh.triangle_count += 2 * rays;
    }
    uint32_t top = mesh.vertex_count - rays;
    add_cap(&mesh, map, 0, 0, rays);
    add_cap(&mesh, map, 1, top, rays);
    *out = mesh;
    return LATHE_OK;
}

lathe_status lathe__radius_mesh(lathe_mesh *out, const lathe_radius_map *map, uint32_t level) {
    int32_t stride = (int32_t)1 << (map->level_count - 1 - level), last = map->slices - 1, *rows = malloc((size_t)map->slices * sizeof *rows);
    uint32_t count = 0;
    if (!rows) return LATHE_ERR_MEMORY;
    for (int32_t row = 0; row < last; row += stride) rows[count++] = row;
    rows[count++] = last;
    lathe_status status = lathe__radius_strips(out, map, rows, count, lathe__radius_ray_stride(map, level));
    free(rows);
    return status;
}
