/* Components and topology: known shapes, and random regions against a plain flood fill and against each other. */
#include "check.h"
#include "mask.h"
#include "phantom.h"
#include <stdlib.h>
#include <string.h>

static lathe_topology topology_of(lathe_volume *v, lathe_axis axis, size_t *components) {
    lathe_mask m;
    lathe_topology t = {-1, -1, -1};
    lathe_component *list = NULL;
    *components = 0;
    if (!CHECK(v) || !CHECK_EQ(lathe__region_threshold(&m, v, axis, 0.5, NULL), LATHE_OK)) return t;
    CHECK_EQ(lathe__mask_topology(&t, &m, NULL), LATHE_OK);
    CHECK_EQ(lathe__mask_components(&list, components, &m), LATHE_OK);
    free(list);
    lathe__mask_free(&m);
    return t;
}

/* Euler = components - tunnels + cavities. */
static void check_shape(lathe_volume *v, int64_t components, int64_t tunnels, int64_t cavities) {
    for (int axis = 0; axis < 3; axis++) {
        size_t count;
        lathe_topology t = topology_of(v, (lathe_axis)axis, &count);
        CHECK_EQ(t.components, components);
        CHECK_EQ(count, components);
        CHECK_EQ(t.cavities, cavities);
        CHECK_EQ(t.euler, components - tunnels + cavities);
    }
    lathe_volume_close(&v);
}

static void test_known_shapes(void) {
    check_shape(phantom_sphere(40, 15.3, PHANTOM_LABEL), 1, 0, 0);
    check_shape(phantom_torus(50, 15, 5.3, PHANTOM_LABEL), 1, 1, 0);
    check_shape(phantom_branch(48, PHANTOM_LABEL), 1, 0, 0);
    check_shape(phantom_shells(40, PHANTOM_LABEL), 2, 0, 1);
    check_shape(phantom_column(48, 1.2, PHANTOM_LABEL), 1, 0, 0);
    check_shape(phantom_specks(60, 4000, 5, PHANTOM_LABEL), 4000, 0, 0);
    check_shape(phantom_voxel(9, PHANTOM_LABEL), 1, 0, 0);
    check_shape(phantom_slice(40, PHANTOM_LABEL), 1, 1, 0);
    check_shape(phantom_full(63, 2, 3, PHANTOM_LABEL), 1, 0, 0);
    check_shape(phantom_full(62, 64, 1, PHANTOM_LABEL), 1, 0, 0);
    check_shape(phantom_full(1, 130, 2, PHANTOM_LABEL), 1, 0, 0);
    /* By 26-connectivity the background of a checkerboard is in one piece and reaches the rim. */
    check_shape(phantom_diagonals(8, PHANTOM_LABEL), 256, 0, 0);
}

/* Two slices of the fork: two loops below, one above. */
static void test_branch_slices(void) {
    lathe_volume *v = phantom_branch(48, PHANTOM_LABEL);
    lathe_mask m;
    CHECK_EQ(lathe__region_threshold(&m, v, LATHE_AXIS_Z, 0.5, NULL), LATHE_OK);
    bool *shown = calloc((size_t)m.size[2], sizeof *shown);
    lathe_topology t;
    CHECK_EQ(lathe__mask_topology(&t, &m, shown), LATHE_OK);
    CHECK(t.components == 0 && t.cavities == 0 && t.euler == 0);
    shown[6] = true;
    CHECK_EQ(lathe__mask_topology(&t, &m, shown), LATHE_OK);
    CHECK_EQ(t.components, 2);
    shown[m.size[2] - 8] = true;
    CHECK_EQ(lathe__mask_topology(&t, &m, shown), LATHE_OK);
    CHECK_EQ(t.components + t.cavities - t.euler, 0);
    free(shown);
    lathe__mask_free(&m);
    lathe_volume_close(&v);
}

/* A closed box whose lid is not shown is open: the cavity is gone. */
static void test_shown_cavity(void) {
    lathe_volume *v = phantom_full(5, 5, 5, PHANTOM_LABEL);
    v->values[(2 * 5 + 2) * 5 + 2] = 0;
    lathe_mask m;
    lathe_topology t;
    CHECK_EQ(lathe__region_threshold(&m, v, LATHE_AXIS_Z, 0.5, NULL), LATHE_OK);
    CHECK_EQ(lathe__mask_topology(&t, &m, NULL), LATHE_OK);
    CHECK(t.components == 1 && t.cavities == 1 && t.euler == 2);
    const bool open[5] = {true, true, true, false, false}, closed[5] = {true, false, true, false, true};
    CHECK_EQ(lathe__mask_topology(&t, &m, open), LATHE_OK);
    CHECK(t.components == 1 && t.cavities == 0 && t.euler == 1);
    CHECK_EQ(lathe__mask_topology(&t, &m, closed), LATHE_OK);
    CHECK(t.components == 1 && t.cavities == 1 && t.euler == 2);
    lathe__mask_free(&m);
    lathe_volume_close(&v);
}

/* ---- a third opinion --------------------------------------------------------------------------------------------- */

typedef struct box {
    int n[3];
    uint8_t *set;
    int *stack;
} box;

static uint8_t *at(const box *b, int x, int y, int z) {
    return &b->set[((size_t)z * (size_t)b->n[1] + (size_t)y) * (size_t)b->n[0] + (size_t)x];
}

/* Floods the voxels that have the state of the first one; they get state 2. Returns how many, and their slices. */
static long flood(const box *b, int x, int y, int z, int reach, int *low, int *high) {
    uint8_t state = *at(b, x, y, z);
    long count = 0, top = 0;
    b->stack[top++] = (z * b->n[1] + y) * b->n[0] + x;
    *at(b, x, y, z) = 2;
    *low = *high = z;
    while (top) {
        int p = b->stack[--top], px = p % b->n[0], py = p / b->n[0] % b->n[1], pz = p / b->n[0] / b->n[1];
        count++;
        *low = pz < *low ? pz : *low, *high = pz > *high ? pz : *high;
        for (int k = 0; k < 27; k++) {
            int dx = k % 3 - 1, dy = k / 3 % 3 - 1, dz = k / 9 - 1;
            if (abs(dx) + abs(dy) + abs(dz) > reach) continue;
            int qx = px + dx, qy = py + dy, qz = pz + dz;
            if (qx < 0 || qy < 0 || qz < 0 || qx >= b->n[0] || qy >= b->n[1] || qz >= b->n[2]) continue;
            if (*at(b, qx, qy, qz) != state) continue;
            *at(b, qx, qy, qz) = 2;
            b->stack[top++] = (qz * b->n[1] + qy) * b->n[0] + qx;
        }
    }
    return count;
}

static box box_of(const lathe_mask *m) {
    box b = {.n = {m->size[0] + 2, m->size[1] + 2, m->size[2] + 2}};
    size_t count = (size_t)b.n[0] * (size_t)b.n[1] * (size_t)b.n[2];
    b.set = calloc(count, 1);
    b.stack = malloc(count * sizeof *b.stack);
    for (int w = 0; w < m->size[2]; w++)
        for (int v = 0; v < m->size[1]; v++)
            for (int u = 0; u < m->size[0]; u++)
                *at(&b, u + 1, v + 1, w + 1) = lathe__slice_pixel(lathe__mask_slice(m, w), m->row_words, u, v);
    return b;
}

/* Vertices - edges + squares - cubes: cell by cell, a cell being there when all its voxels are. */
static long plain_euler(const box *b) {
    long sum = 0;
    for (int z = 0; z + 1 < b->n[2]; z++)
        for (int y = 0; y + 1 < b->n[1]; y++)
            for (int x = 0; x + 1 < b->n[0]; x++)
                for (int k = 0; k < 8; k++) {
                    bool all = true; /* the cell from (x, y, z) along the axes in k */
                    for (int i = 0; i < 8; i++)
                        if ((i & ~k) == 0) all = all && *at(b, x + (i & 1), y + (i >> 1 & 1), z + (i >> 2)) == 1;
                    if (all) sum += __builtin_popcount((unsigned)k) % 2 ? -1 : 1;
                }
    return sum;
}

static void check_components(const lathe_mask *m, const box *b, lathe_topology t) {
    lathe_component *list = NULL;
    size_t count = 0, found = 0;
    if (!CHECK_EQ(lathe__mask_components(&list, &count, m), LATHE_OK)) return;
    bool same = true;
    for (int z = 0; z < b->n[2]; z++)
        for (int y = 0; y < b->n[1]; y++)
            for (int x = 0; x < b->n[0]; x++) {
                if (*at(b, x, y, z) != 1) continue;
                int low, high;
                long voxels = flood(b, x, y, z, 1, &low, &high);
                if (found < count) {
                    const lathe_component *c = &list[found];
                    same = same && c->voxels == voxels && c->first_slice == low - 1 && c->last_slice == high - 1;
                }
                found++;
            }
    CHECK(same);
    CHECK_EQ(count, found);
    CHECK_EQ(t.components, found);
    free(list);
}

static void check_random(lathe_volume *v, lathe_axis axis, double iso) {
    lathe_mask m;
    lathe_topology t;
    if (!CHECK(v)) return;
    if (v->max >= iso && CHECK_EQ(lathe__region_threshold(&m, v, axis, iso, NULL), LATHE_OK)) {
        CHECK_EQ(lathe__mask_topology(&t, &m, NULL), LATHE_OK);
        box b = box_of(&m);
        CHECK_EQ(t.euler, plain_euler(&b));
        int low, high;
        int64_t cavities = -1;
        for (int i = 0; i < b.n[0] * b.n[1] * b.n[2]; i++)
            if (b.set[i] == 0) {
                flood(&b, i % b.n[0], i / b.n[0] % b.n[1], i / b.n[0] / b.n[1], 3, &low, &high);
                cavities++;
            }
        CHECK_EQ(t.cavities, cavities);
        check_components(&m, &b, t);
        free(b.set);
        free(b.stack);
        lathe__mask_free(&m);
    }
    lathe_volume_close(&v);
}

static void test_random(void) {
    static const int sizes[][3] = {{6, 6, 6},   {62, 7, 5},   {63, 9, 6},  {64, 8, 4},
                                   {127, 6, 6}, {140, 12, 9}, {3, 80, 70}, {1, 9, 9}};
    uint32_t seed = 1;
    for (size_t i = 0; i < sizeof sizes / sizeof *sizes; i++)
        for (int percent = 5; percent < 100; percent += 9, seed++)
            check_random(phantom_noise(sizes[i][0], sizes[i][1], sizes[i][2], percent, seed, PHANTOM_LABEL),
                         (lathe_axis)(seed % 3), 0.5);
    for (; seed < 110; seed++)
        check_random(phantom_blobs(36, 20, seed, PHANTOM_GREY), (lathe_axis)(seed % 3), PHANTOM_ISO);
}

int main(void) {
    test_known_shapes();
    test_branch_slices();
    test_shown_cavity();
    test_random();
    return check_end();
}
