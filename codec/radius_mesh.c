/* The surface of a radius map. Rays keep their directions from row to row (or turn evenly), so that a strip's triangles lie in
 * wedges about the line of centres that do not overlap: the surface cannot cross itself. */
#include <stdlib.h>
#include "radius_tubes.h"

static int64_t squared(const int32_t *a, const int32_t *b) {
    int64_t x = a[0] - b[0], y = a[1] - b[1];
    return x * x + y * y;
}

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

/* Directions of a row's rays: a quarter of them is computed, the others are that one turned. */
typedef struct fan {
    lathe_point d[LATHE_RADIUS_MAX_RAYS / 4];
    uint32_t turn;             /* what they have been computed for */
} fan;

static void aim(fan *f, const lathe_radius_map *map, uint32_t turn, uint32_t stride) {
    f->turn = turn;
    for (uint32_t i = 0; i < map->rays / 4; i += stride) f->d[i / stride] = lathe__ray_direction((i * (65536 / map->rays) + turn) & 65535, 65536);
}

/* As lathe__radius_place has it: radius * 2^10 * direction / 2^14, rounded towards 0. */
static int32_t along(int32_t radius, int32_t direction) {
    return (int32_t)((int64_t)radius * direction / (LATHE_RAY_LENGTH / (LATHE_LATTICE_ONE / LATHE_RADIUS_ONE)));
}

static void place_row(lathe_mesh *mesh, const lathe_radius_map *map, fan *f, int32_t row, uint32_t stride) {
    uint32_t turn = (uint32_t)map->turn * (uint32_t)row & 65535, quarter = map->rays / 4 / stride;
    if (f->turn != turn) aim(f, map, turn, stride);
    const int32_t *radius = map->radius + (size_t)row * map->rays;
    int32_t x = map->centre[row][0] * (LATHE_LATTICE_ONE / 2), y = map->centre[row][1] * (LATHE_LATTICE_ONE / 2);
    int32_t(*v)[3] = mesh->lattice + mesh->vertex_count;
    for (int q = 0; q < 4; q++)
        for (uint32_t i = 0; i < quarter; i++, v++, radius += stride) {
            int32_t a = along(*radius, f->d[i].x), b = along(*radius, f->d[i].y);
            v[0][0] = x + (q == 0 ? a : q == 1 ? -b : q == 2 ? -a : b);
            v[0][1] = y + (q == 0 ? b : q == 1 ? a : q == 2 ? -b : -a);
            v[0][2] = row * LATHE_LATTICE_ONE;
        }
    mesh->vertex_count += 4 * quarter;
}

static void add(lathe_mesh *mesh, uint32_t a, uint32_t b, uint32_t c) {
    uint32_t *t = mesh->triangles[mesh->triangle_count++];
    t[0] = a, t[1] = b, t[2] = c;
}

static void add_strip(lathe_mesh *mesh, uint32_t lower, uint32_t upper, uint32_t rays) {
    const int32_t(*at)[3] = (const int32_t(*)[3])mesh->lattice;
    uint32_t(*t)[3] = mesh->triangles + mesh->triangle_count;
    for (uint32_t i = 0; i < rays; i++, t += 2) {
        uint32_t k = i + 1 < rays ? i + 1 : 0, a = lower + i, b = lower + k, c = upper + k, d = upper + i;
        bool from_a = squared(at[a], at[c]) <= squared(at[b], at[d]);
        t[0][0] = a, t[0][1] = b, t[0][2] = from_a ? c : d;
        t[1][0] = from_a ? a : b, t[1][1] = c, t[1][2] = d;
    }
    mesh->triangle_count += 2 * rays;
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
    fan f = {.turn = UINT32_MAX};
    for (uint32_t i = 0; i < rows; i++) {
        place_row(&mesh, map, &f, list[i], stride);
        if (i) add_strip(&mesh, mesh.vertex_count - 2 * rays, mesh.vertex_count - rays, rays);
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
