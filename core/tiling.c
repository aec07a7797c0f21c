/* Tiles two contours by walking their derivation trees together [M 4.1-4.5]. The i-th main f edges correspond; between
 * them the two folds E are matched symbol by symbol, X against X in order. Two leaves correspond if their types are
 * equal; an i against b T f is matched with the first i inside (4.5 case C: descend in one tree only); whatever else
 * remains is unmatched and keeps one vertex of the other contour.
 *
 * Nodes are in preorder, so descending into a T or X, or going on to its sibling, is always going to the next leaf:
 * two cursors over the leaves and the number of open b T f stand in for the recursion, which hostile contours could
 * make arbitrarily deep. */
#include "contour.h"

enum { STEP_BOTH = 3 };

/* A contour's cursor: the next leaf, inside the fold that ends at string position `end`. */
typedef struct cursor {
    const lathe_tree *tree;
    uint32_t node, end;
    uint8_t step; /* 1 or 2 */
} cursor;
typedef struct path {
    uint8_t *steps;
    uint32_t count;
} path;

static void find_leaf(cursor *c) {
    while (c->node < c->tree->node_count && c->tree->nodes[c->node].symbol != LATHE_SYM_LEAF) c->node++;
}
static bool fold_ended(const cursor *c) {
    return c->node >= c->tree->node_count || c->tree->nodes[c->node].first >= c->end;
}
static uint8_t edge_at(const cursor *c) { return c->tree->nodes[c->node].edge; }
static bool is_outgoing(uint8_t edge) { return edge == LATHE_UP_O || edge == LATHE_DOWN_I; }
/* Whether the fold goes on at this place with another o T. */
static bool goes_on(const cursor *c) { return !fold_ended(c) && is_outgoing(edge_at(c)); }

static void advance(cursor *c) {
    c->node++;
    find_leaf(c);
}
static void take_one(path *p, cursor *c) {
    p->steps[p->count++] = c->step;
    advance(c);
}
static void take_pair(path *p, cursor *a, cursor *b) {
    if (edge_at(a) != edge_at(b)) {
        take_one(p, a);
        take_one(p, b);
        return;
    }
    p->steps[p->count++] = STEP_BOTH;
    advance(a);
    advance(b);
}

/* Takes edges alone until `open` more f than b are passed; with open == 0, until the f that closes this T, or the
 * fold's end. */
static void take_rest(path *p, cursor *c, uint32_t open) {
    bool to_end = open == 0;
    while (!fold_ended(c)) {
        uint8_t edge = edge_at(c);
        if (edge == LATHE_FOR && to_end && open == 0) return;
        if (edge == LATHE_BACK) open++;
        if (edge == LATHE_FOR) open--;
        take_one(p, c);
        if (!to_end && open == 0) return;
    }
}

/* From the start of an X in both to the end of the first X that both have, which may lie deeper: *depth counts the b T
 * f that are open in both. */
static void match_x(path *p, cursor *a, cursor *b, uint32_t *depth) {
    while (edge_at(a) == LATHE_BACK && edge_at(b) == LATHE_BACK) {
        take_pair(p, a, b);
        ++*depth;
    }
    cursor *deeper = edge_at(a) == LATHE_BACK ? a : b;
    uint32_t open = 0;
    for (; edge_at(deeper) == LATHE_BACK; open++) take_one(p, deeper);
    take_pair(p, a, b);
    if (open) take_rest(p, deeper, open);
}

/* Both cursors at the start of a fold, which may be empty. */
static void match_folds(path *p, cursor *a, cursor *b) {
    uint32_t depth = 0;
    for (;;) {
        if (goes_on(a) && goes_on(b)) {
            take_pair(p, a, b);
            match_x(p, a, b, &depth);
            continue;
        }
        take_rest(p, a, 0);
        take_rest(p, b, 0);
        if (!depth) return;
        take_pair(p, a, b);
        depth--;
    }
}

/* The trees come from lathe__parse_contour; RANGE if their ray counts differ. Linear in the edges. */
lathe_status lathe__walk_trees(uint8_t *steps, uint32_t *step_count, const lathe_tree *a, const lathe_tree *b) {
    if (a->rays != b->rays) return LATHE_ERR_RANGE;
    path p = {steps, 0};
    cursor ca = {a, 0, 0, 1}, cb = {b, 0, 0, 2};
    find_leaf(&ca);
    find_leaf(&cb);
    for (uint32_t i = 0; i < a->rays; i++) {
        ca.end = a->main_edge[i];
        cb.end = b->main_edge[i];
        match_folds(&p, &ca, &cb);
        take_pair(&p, &ca, &cb);
    }
    *step_count = p.count;
    return LATHE_OK;
}
