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

static void place_row(lathe_mesh *mesh, const lathe_radius_map *map, int32_t row, uint32_t stride) {
    for (uint32_t i = 0; i < map->rays; i += stride) {
        int32_t *v = mesh->lattice[mesh->vertex_count++];
        lathe_point p = lathe__radius_point(map, row, i);
        v[0] = p.x, v[1] = p.y, v[2] = row * LATHE_LATTICE_ONE;
    }
}

static void add(lathe_mesh *mesh, uint32_t a, uint32_t b, uint32_t c) {
    uint32_t *t = mesh->triangles[mesh->triangle_count++];
    t[0] = a, t[1] = b, t[2] = c;
}

static void add_strip(lathe_mesh *mesh, uint32_t lower, uint32_t upper, uint32_t rays) {
    for (uint32_t i = 0; i < rays; i++) {
        uint32_t k = i + 1 < rays ? i + 1 : 0, a = lower + i, b = lower + k, c = upper + k, d = upper + i;
        if (squared(mesh->lattice[a], mesh->lattice[c]) <= squared(mesh->lattice[b], mesh->lattice[d])) {
            add(mesh, a, b, c);
            add(mesh, a, c, d);
        } else {
            add(mesh, a, b, d);
            add(mesh, b, c, d);
        }
    }
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
    for (uint32_t i = 0; i < rows; i++) {
        place_row(&mesh, map, list[i], stride);
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
