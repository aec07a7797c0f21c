#include <stdlib.h>
#include "overlay.h"

static bool grow(void **array, uint32_t *capacity, size_t want, size_t size) {
    if (want <= *capacity) return true;
    if (want > UINT32_MAX / 16) return false;
    size_t capacity2 = (size_t)*capacity + *capacity / 2 + 1024;
    if (capacity2 < want) capacity2 = want;
    void *p = realloc(*array, capacity2 * size);
    if (!p) return false;
    *array = p;
    *capacity = (uint32_t)capacity2;
    return true;
}

lathe_status lathe__builder_reserve(lathe_mesh_builder *b, size_t vertices, size_t triangles) {
    void *v = b->mesh.lattice, *t = b->mesh.triangles;
    bool ok = grow(&v, &b->vertex_capacity, b->mesh.vertex_count + vertices, sizeof *b->mesh.lattice);
    b->mesh.lattice = v;
    if (!ok) return LATHE_ERR_MEMORY;
    ok = grow(&t, &b->triangle_capacity, b->mesh.triangle_count + triangles, sizeof *b->mesh.triangles);
    b->mesh.triangles = t;
    return ok ? LATHE_OK : LATHE_ERR_MEMORY;
}
