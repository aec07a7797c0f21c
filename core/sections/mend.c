/* Mending contours that overlap themselves (see mend.h). */
#include "mend.h"
#include "derivation.h"
#include <stdlib.h>

#define NONE UINT32_MAX

/* A crossing of a ray, or an edge between two rays with its radii on both. */
typedef struct mark {
    uint32_t ray, index;
    int64_t radius, other;
} mark;
/* An edge at fault, and what it is at fault with: a crossing (is_crossing) or another edge. */
typedef struct fault {
    uint32_t edge, with;
    bool is_crossing;
} fault;
typedef struct fault_list {
    fault *at;
    uint32_t count;
} fault_list;

static int compare_marks(const void *a, const void *b) {
    const mark *p = a, *q = b;
    if (p->ray != q->ray) return p->ray < q->ray ? -1 : 1;
    if (p->radius != q->radius) return p->radius < q->radius ? -1 : 1;
    if (p->other != q->other) return p->other < q->other ? -1 : 1;
    return p->index < q->index ? -1 : p->index > q->index;
}
static uint32_t next_of(const lathe_ray_contour *c, uint32_t i) { return i + 1 < c->count ? i + 1 : 0; }

/* UP and DOWN edges: the crossing that follows the inner end along the ray must not lie before the outer end. */
static void find_covered(fault_list *faults, const lathe_ray_contour *c, mark *marks, uint32_t *place) {
    for (uint32_t i = 0; i < c->count; i++) marks[i] = (mark){c->crossings[i].ray, i, c->radius[i], 0};
    qsort(marks, c->count, sizeof *marks, compare_marks);
    for (uint32_t k = 0; k < c->count; k++) place[marks[k].index] = k;
    for (uint32_t i = 0; i < c->count; i++) {
        uint32_t next = next_of(c, i);
        if (c->types[i] == LATHE_FOR || c->types[i] == LATHE_BACK) continue;
        bool up = c->radius[next] >= c->radius[i];
        uint32_t inner = up ? i : next, outer = up ? next : i;
        for (uint32_t k = place[inner] + 1; k < c->count && marks[k].ray == marks[place[inner]].ray; k++) {
            if (marks[k].radius >= c->radius[outer]) break;
            if (marks[k].radius == c->radius[inner]) continue;
            faults->at[faults->count++] = (fault){i, marks[k].index, true};
            break;
        }
    }
}
/* FOR and BACK edges of a ray pair: sorted along the one ray they must be sorted along the other. */
static void find_crossed(fault_list *faults, const lathe_ray_contour *c, mark *marks) {
    uint32_t count = 0;
    for (uint32_t i = 0; i < c->count; i++) {
        uint32_t next = next_of(c, i);
        if (c->types[i] == LATHE_FOR) marks[count++] = (mark){c->crossings[i].ray, i, c->radius[i], c->radius[next]};
        if (c->types[i] == LATHE_BACK)
            marks[count++] = (mark){c->crossings[next].ray, i, c->radius[next], c->radius[i]};
    }
    if (count) qsort(marks, count, sizeof *marks, compare_marks);
    for (uint32_t k = 1; k < count; k++)
        if (marks[k].ray == marks[k - 1].ray && marks[k].radius > marks[k - 1].radius &&
            marks[k].other < marks[k - 1].other)
            faults->at[faults->count++] = (fault){marks[k].index, marks[k - 1].index, false};
}
static lathe_status find_faults(fault_list *faults, lathe_arena *arena, const lathe_ray_contour *c) {
    mark *marks = LATHE_NEW(arena, mark, c->count);
    uint32_t *place = LATHE_NEW(arena, uint32_t, c->count);
    *faults = (fault_list){LATHE_NEW(arena, fault, 2 * (size_t)c->count), 0};
    if (!marks || !place || !faults->at) return LATHE_ERR_MEMORY;
    find_covered(faults, c, marks, place);
    find_crossed(faults, c, marks);
    return LATHE_OK;
}

lathe_status lathe__count_overlaps(uint32_t *overlaps, lathe_arena *arena, const lathe_ray_contour *contour) {
    fault_list faults;
    lathe_status status = find_faults(&faults, arena, contour);
    if (!status) *overlaps = faults.count;
    return status;
}

lathe_status lathe__mend_by_rays(lathe_ray_contour *out, uint32_t *overlaps, lathe_arena *arena,
                                 const lathe_point *loop, uint32_t count, lathe_point centre, uint32_t rays,
                                 uint32_t turn, uint32_t max_rays) {
    for (;; rays *= 2) {
        lathe_ray_contour c;
        uint32_t left;
        lathe_status status = lathe__make_ray_contour(&c, arena, loop, count, centre, rays, turn);
        if (!status) status = lathe__count_overlaps(&left, arena, &c);
        if (status) return status;
        if (left && rays <= max_rays / 2) continue;
        *out = c;
        *overlaps = left;
        return LATHE_OK;
    }
}

/* ---- pruning ---- */

static bool is_pair(const lathe_derivation *t, uint32_t node) {
    uint8_t symbol = t->nodes[node].symbol;
    bool group = symbol == LATHE_DER_D || symbol == LATHE_DER_U || symbol == LATHE_DER_D_R || symbol == LATHE_DER_U_R;
    return group && t->nodes[t->nodes[node].child].symbol >= LATHE_DER_D_I; /* not a part over several pairs */
}
/* The contour's edge at a place of the tree's string, which is at most edge_count. */
static uint32_t edge_at(const lathe_derivation *t, uint32_t place) {
    uint32_t edge = t->start + place;
    return edge < t->edge_count ? edge : edge - t->edge_count;
}
/* Of each edge the innermost pair it belongs to, or NONE: nodes are in preorder, so parents come first. */
static void find_pairs(uint32_t *pair_of, uint32_t *pair_above, const lathe_derivation *t) {
    for (uint32_t i = 0; i < t->edge_count; i++) pair_of[i] = NONE;
    pair_above[0] = NONE;
    for (uint32_t i = 0; i < t->node_count; i++) {
        uint32_t here = is_pair(t, i) ? i : pair_above[i];
        if (t->nodes[i].symbol == LATHE_DER_LEAF) pair_of[edge_at(t, t->nodes[i].first)] = here;
        for (uint32_t k = t->nodes[i].child; k != NONE; k = t->nodes[k].next) pair_above[k] = here;
    }
}
/* Of two as small the later one: what follows it is less likely to be an UP or DOWN edge, which would grow. */
static uint32_t smaller_pair(const lathe_derivation *t, uint32_t a, uint32_t b) {
    if (a == NONE || b == NONE) return a == NONE ? b : a;
    const lathe_derivation_node *p = &t->nodes[a], *q = &t->nodes[b];
    return q->count < p->count || (q->count == p->count && q->first > p->first) ? b : a;
}
/* Marks the crossings behind the first one of each pair at fault. */
static void mark_removed(uint8_t *removed, const lathe_derivation *t, const fault_list *faults, const uint32_t *pair_of,
                         uint8_t *condemned) {
    for (uint32_t i = 0; i < t->node_count; i++) condemned[i] = 0;
    for (uint32_t i = 0; i < faults->count; i++) {
        const fault *f = &faults->at[i];
        uint32_t pair = smaller_pair(t, pair_of[f->edge], pair_of[f->with]);
        if (f->is_crossing) pair = smaller_pair(t, pair, pair_of[f->with ? f->with - 1 : t->edge_count - 1]);
        if (pair != NONE) condemned[pair] = 1;
    }
    for (uint32_t i = 0; i < t->edge_count; i++) removed[i] = 0;
    uint32_t done = 0; /* string position up to which crossings are marked: a pair inside a marked one adds nothing */
    for (uint32_t i = 0; i < t->node_count; i++) {
        if (!condemned[i]) continue;
        uint32_t end = t->nodes[i].first + t->nodes[i].count;
        for (uint32_t k = t->nodes[i].first + 1 > done ? t->nodes[i].first + 1 : done; k <= end; k++)
            removed[edge_at(t, k)] = 1;
        if (end + 1 > done) done = end + 1;
    }
}

static lathe_status without(lathe_ray_contour *c, lathe_arena *arena, const uint8_t *removed) {
    lathe_ray_contour left = *c;
    left.crossings = LATHE_NEW(arena, lathe_crossing, c->count);
    left.points = LATHE_NEW(arena, lathe_point, c->count);
    left.radius = LATHE_NEW(arena, int64_t, c->count);
    left.types = LATHE_NEW(arena, uint8_t, c->count);
    if (!left.crossings || !left.points || !left.radius || !left.types) return LATHE_ERR_MEMORY;
    left.count = 0;
    for (uint32_t i = 0; i < c->count; i++) {
        if (removed[i]) continue;
        left.crossings[left.count] = c->crossings[i];
        left.points[left.count] = c->points[i];
        left.radius[left.count++] = c->radius[i];
        uint32_t next = next_of(c, i), kept = next;
        while (removed[kept]) kept = next_of(c, kept);
        if (kept != next) left.crossings[left.count - 1].outward = c->radius[kept] > c->radius[i];
    }
    lathe_status status = lathe__classify_edges(left.types, left.crossings, left.count, left.rays);
    if (!status) *c = left;
    return status;
}

lathe_status lathe__mend_by_pruning(lathe_ray_contour *out, uint32_t *removed, lathe_arena *arena,
                                    const lathe_ray_contour *contour) {
    lathe_ray_contour c = *contour;
    for (;;) {
        fault_list faults;
        lathe_derivation tree;
        lathe_status status = find_faults(&faults, arena, &c);
        if (status) return status;
        if (!faults.count) break;
        status = lathe__derive_alone(&tree, arena, &c);
        if (status) return status;
        uint32_t *pair_of = LATHE_NEW(arena, uint32_t, c.count),
                 *pair_above = LATHE_NEW(arena, uint32_t, tree.node_count);
        uint8_t *gone = LATHE_NEW(arena, uint8_t, c.count), *condemned = LATHE_NEW(arena, uint8_t, tree.node_count);
        if (!pair_of || !pair_above || !gone || !condemned) return LATHE_ERR_MEMORY;
        find_pairs(pair_of, pair_above, &tree);
        mark_removed(gone, &tree, &faults, pair_of, condemned);
        uint32_t before = c.count;
        status = without(&c, arena, gone);
        if (status) return status;
        if (c.count == before) return LATHE_ERR_FORMAT; /* faults, but no fold: not a contour of a simple loop */
    }
    *removed = contour->count - c.count;
    *out = c;
    return LATHE_OK;
}
