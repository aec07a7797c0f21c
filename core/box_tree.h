/* A packed tree of boxes: items sorted along a Morton curve, four to a node, four nodes to a node above. Building it is one
 * sort and one sweep, and it does not mind items of very different sizes, unlike a uniform grid. */
#ifndef LATHE_BOX_TREE_H
#define LATHE_BOX_TREE_H
#include "lathe.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>
#ifdef __SSE2__
#include <emmintrin.h>
#endif

typedef float lathe_f4 __attribute__((vector_size(16)));
typedef int32_t lathe_i4 __attribute__((vector_size(16)));

static inline lathe_f4 lathe__f4(float x) { return (lathe_f4){x, x, x, x}; }
static inline lathe_f4 lathe__select(lathe_i4 mask, lathe_f4 yes, lathe_f4 no) {
    return (lathe_f4)(((lathe_i4)yes & mask) | ((lathe_i4)no & ~mask));
}
#ifdef __SSE2__
static inline lathe_f4 lathe__max4(lathe_f4 a, lathe_f4 b) { return (lathe_f4)_mm_max_ps((__m128)a, (__m128)b); }
static inline lathe_f4 lathe__min4(lathe_f4 a, lathe_f4 b) { return (lathe_f4)_mm_min_ps((__m128)a, (__m128)b); }
static inline int lathe__bits4(lathe_i4 mask) { return _mm_movemask_ps((__m128)mask); }
#else
static inline lathe_f4 lathe__max4(lathe_f4 a, lathe_f4 b) { return lathe__select(a > b, a, b); }
static inline lathe_f4 lathe__min4(lathe_f4 a, lathe_f4 b) { return lathe__select(a < b, a, b); }
static inline int lathe__bits4(lathe_i4 mask) { return (mask[0] & 1) | (mask[1] & 2) | (mask[2] & 4) | (mask[3] & 8); }
#endif

typedef struct lathe_box {
    float low[3], high[3];
} lathe_box;
typedef struct lathe_box_node {
    lathe_f4 low[3], high[3];
} lathe_box_node; /* the boxes of its four children */

/* Level 0's node k holds items 4k .. 4k + 3; level l's node k holds level l - 1's nodes 4k .. 4k + 3; the last level is one
 * node. Places without a child have an empty box (low = +inf, high = -inf). */
enum { LATHE_BOX_TREE_LEVELS = 17 };
typedef struct lathe_box_tree {
    uint32_t level_count;
    size_t first[LATHE_BOX_TREE_LEVELS]; /* of each level in nodes */
    lathe_box_node *nodes;               /* owned */
} lathe_box_tree;

static inline void lathe__box_tree_free(lathe_box_tree *tree) {
    free(tree->nodes);
    *tree = (lathe_box_tree){0};
}

static inline lathe_box lathe__box_empty(void) {
    return (lathe_box){{INFINITY, INFINITY, INFINITY}, {-INFINITY, -INFINITY, -INFINITY}};
}

static inline void lathe__box_add(lathe_box *box, const float p[3]) {
    for (int i = 0; i < 3; i++) {
        box->low[i] = p[i] < box->low[i] ? p[i] : box->low[i];
        box->high[i] = p[i] > box->high[i] ? p[i] : box->high[i];
    }
}

static inline void lathe__box_node_put(lathe_box_node *node, size_t place, const lathe_box *box) {
    for (int i = 0; i < 3; i++) {
        ((float *)&node->low[i])[place] = box->low[i];
        ((float *)&node->high[i])[place] = box->high[i];
    }
}

static inline lathe_box lathe__box_of_node(const lathe_box_node *node) {
    lathe_box box;
    for (int i = 0; i < 3; i++) {
        const float *l = (const float *)&node->low[i], *h = (const float *)&node->high[i];
        float l0 = l[0] < l[1] ? l[0] : l[1], l1 = l[2] < l[3] ? l[2] : l[3];
        float h0 = h[0] > h[1] ? h[0] : h[1], h1 = h[2] > h[3] ? h[2] : h[3];
        box.low[i] = l0 < l1 ? l0 : l1;
        box.high[i] = h0 > h1 ? h0 : h1;
    }
    return box;
}

/* boxes: count (>= 1) item boxes in the order of the tree. MEMORY. */
static inline lathe_status lathe__box_tree_build(lathe_box_tree *out, const lathe_box *boxes, uint32_t count) {
    lathe_box_tree tree = {0};
    size_t size[LATHE_BOX_TREE_LEVELS], total = 0, n = count;
    do {
        n = (n + 3) / 4;
        tree.first[tree.level_count] = total;
        size[tree.level_count++] = n;
        total += n;
    } while (n > 1);
    tree.nodes = malloc(total * sizeof *tree.nodes);
    if (!tree.nodes) return LATHE_ERR_MEMORY;
    const lathe_box none = lathe__box_empty();
    for (size_t k = 0; k < 4 * size[0]; k++)
        lathe__box_node_put(&tree.nodes[k / 4], k % 4, k < count ? &boxes[k] : &none);
    for (uint32_t l = 1; l < tree.level_count; l++)
        for (size_t k = 0; k < 4 * size[l]; k++) {
            lathe_box box = k < size[l - 1] ? lathe__box_of_node(&tree.nodes[tree.first[l - 1] + k]) : none;
            lathe__box_node_put(&tree.nodes[tree.first[l] + k / 4], k % 4, &box);
        }
    *out = tree;
    return LATHE_OK;
}

static inline uint32_t lathe__spread_bits(uint32_t x) {
    x = (x | x << 16) & 0x030000FFu;
    x = (x | x << 8) & 0x0300F00Fu;
    x = (x | x << 4) & 0x030C30C3u;
    return (x | x << 2) & 0x09249249u;
}

/* A Morton curve through 1024^3 cells; points outside of them count as on their border. */
typedef struct lathe_curve {
    float low[3], scale;
} lathe_curve;

static inline lathe_curve lathe__curve_through(const lathe_box *box) {
    lathe_curve curve = {{box->low[0], box->low[1], box->low[2]}, 0};
    float extent = 0;
    for (int i = 0; i < 3; i++) extent = box->high[i] - box->low[i] > extent ? box->high[i] - box->low[i] : extent;
    if (extent > 0) curve.scale = 1024 / extent;
    return curve;
}

static inline uint32_t lathe__curve_key(const lathe_curve *curve, const float p[3]) {
    uint32_t key = 0;
    for (int i = 0; i < 3; i++) {
        float f = (p[i] - curve->low[i]) * curve->scale;
        uint32_t cell = f >= 0 && f < 1023 ? (uint32_t)f : f >= 1023 ? 1023 : 0; /* NaN too gives 0 */
        key |= lathe__spread_bits(cell) << i;
    }
    return key;
}

/* One stable counting pass over ten bits of the keys. */
static inline void lathe__radix_pass(uint64_t *to, const uint64_t *from, uint32_t count, int shift) {
    uint32_t start[1024] = {0}, sum = 0;
    for (uint32_t k = 0; k < count; k++) start[from[k] >> shift & 1023]++;
    for (int b = 0; b < 1024; b++) {
        uint32_t n = start[b];
        start[b] = sum;
        sum += n;
    }
    for (uint32_t k = 0; k < count; k++) to[start[from[k] >> shift & 1023]++] = from[k];
}

/* order[k]: index of the k-th point along the curve; key[k]: its key (key may be NULL). MEMORY. */
static inline lathe_status lathe__curve_order(uint32_t *order, uint32_t *key, const float (*points)[3], uint32_t count,
                                              const lathe_curve *curve) {
    uint64_t *keys = malloc((2 * (size_t)count + 1) * sizeof *keys);
    if (!keys) return LATHE_ERR_MEMORY;
    for (uint32_t k = 0; k < count; k++) keys[k] = (uint64_t)lathe__curve_key(curve, points[k]) << 32 | k;
    for (int pass = 0; pass < 3; pass++)
        lathe__radix_pass(keys + (pass & 1 ? 0 : count), keys + (pass & 1 ? count : 0), count, 32 + 10 * pass);
    for (uint32_t k = 0; k < count; k++) order[k] = (uint32_t)keys[count + k];
    for (uint32_t k = 0; key && k < count; k++) key[k] = (uint32_t)(keys[count + k] >> 32);
    free(keys);
    return LATHE_OK;
}
#endif
