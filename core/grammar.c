/* Parses a contour with the repaired grammar (see contour.h). The paper's G [M theorem 1] rejects some real contours;
 * this grammar accepts every contour that goes round its centre once, if the string begins at a *record* crossing,
 * where the unwrapped ray index first reaches a new maximum. There is exactly one record for each ray; together they
 * are the main chain, a simple star-shaped polygon. With nf unmatched f so far and depth unmatched b, the unwrapped
 * index is nf - depth; so the i-th unmatched f is the edge that reaches the record of ray i + 1: string position
 * main_edge[i], crossing (start + main_edge[i] + 1) mod edge_count.
 *
 * The last E of S is always empty and has no node. Nodes are in preorder, so leaves come in string order. Nodes: S; E
 * and a leaf for each unmatched f; leaf and T for each o; X and leaf for each i; two leaves, X and T for each b with
 * its f: at most 2 * edge_count + 1. */
#include "contour.h"

#define NONE UINT32_MAX
static const uint32_t MAX_EDGES = UINT32_MAX / 8;

/* While a node is open, `next` is its parent and `count` its last child: no stack is needed. */
typedef struct parser {
    lathe_tree tree;
    uint32_t top, position, depth, main_edges;
} parser;

static uint32_t append(parser *p, lathe_symbol symbol, uint8_t edge) {
    lathe_node *nodes = p->tree.nodes;
    uint32_t index = p->tree.node_count++;
    nodes[index] = (lathe_node){(uint8_t)symbol, edge, p->position, 1, NONE, NONE};
    if (p->top != NONE) {
        lathe_node *parent = &nodes[p->top];
        if (parent->child == NONE)
            parent->child = index;
        else
            nodes[parent->count].next = index;
        parent->count = index;
    }
    return index;
}
static void open_node(parser *p, lathe_symbol symbol) {
    uint32_t index = append(p, symbol, 0);
    p->tree.nodes[index].next = p->top;
    p->tree.nodes[index].count = NONE;
    p->top = index;
}
static void close_node(parser *p) {
    lathe_node *node = &p->tree.nodes[p->top];
    p->top = node->next;
    node->next = NONE;
    node->count = p->position - node->first;
}
static void close_all(parser *p, lathe_symbol symbol) {
    while (p->tree.nodes[p->top].symbol == symbol) close_node(p);
}
static void take(parser *p, uint8_t edge) {
    append(p, LATHE_SYM_LEAF, edge);
    p->position++;
}

/* f: ends the T of the innermost open b, or, if none is open, the fold before it. */
static void take_forward(parser *p, uint8_t edge) {
    close_all(p, LATHE_SYM_T);
    if (p->depth) {
        p->depth--;
        take(p, edge);
        close_node(p);
        return;
    }
    close_node(p);
    p->tree.main_edge[p->main_edges++] = p->position;
    take(p, edge);
    if (p->main_edges < p->tree.rays) open_node(p, LATHE_SYM_E);
}

/* One symbol; *inside is the state: at an IN-OUT crossing. S is on top only after the last main f. */
static bool take_edge(parser *p, bool *inside, uint8_t edge) {
    bool here = *inside;
    switch (edge) {
    case LATHE_FOR:
        if (!here || p->top == 0) return false;
        take_forward(p, edge);
        return true;
    case LATHE_BACK:
        if (here) return false;
        open_node(p, LATHE_SYM_X);
        take(p, edge);
        open_node(p, LATHE_SYM_T);
        p->depth++;
        return true;
    case LATHE_UP_O:
    case LATHE_DOWN_I:
        if (!here || p->top == 0) return false;
        take(p, edge);
        open_node(p, LATHE_SYM_T);
        *inside = false;
        return true;
    case LATHE_UP_I:
    case LATHE_DOWN_O:
        if (here) return false;
        open_node(p, LATHE_SYM_X);
        take(p, edge);
        close_node(p);
        *inside = true;
        return true;
    default: return false;
    }
}

/* Adds the step of an edge to the unwrapped ray index. */
static int64_t step(uint8_t edge) { return edge == LATHE_FOR ? 1 : edge == LATHE_BACK ? -1 : 0; }

/* The record crossing of ray 0. One turn gives the maximum of all earlier turns; the records are new maxima of the
 * next. */
static bool find_start(uint32_t *start, uint32_t first_ray, const uint8_t *types, uint32_t count, uint32_t rays) {
    int64_t index = first_ray, highest = first_ray;
    for (uint32_t i = 0; i < count; i++) {
        if (index > highest) highest = index;
        index += step(types[i]);
    }
    if (index != (int64_t)first_ray + rays) return false;
    for (uint32_t i = 0; i < count; i++) {
        if (index > highest) {
            highest = index;
            if (index % rays == 0) {
                *start = i;
                return true;
            }
        }
        index += step(types[i]);
    }
    return false;
}

lathe_status lathe__parse_contour(lathe_tree *out, lathe_arena *arena, const lathe_crossing *crossings,
                                  const uint8_t *types, uint32_t count, uint32_t rays) {
    if (rays < 3 || count > MAX_EDGES) return LATHE_ERR_RANGE;
    parser p = {.tree = {.rays = rays, .edge_count = count}, .top = NONE};
    if (!count || crossings[0].ray >= rays || !find_start(&p.tree.start, crossings[0].ray, types, count, rays))
        return LATHE_ERR_FORMAT;
    p.tree.nodes = LATHE_NEW(arena, lathe_node, 2 * (size_t)count + 2);
    p.tree.main_edge = LATHE_NEW(arena, uint32_t, rays);
    if (!p.tree.nodes || !p.tree.main_edge) return LATHE_ERR_MEMORY;
    bool inside = true;
    open_node(&p, LATHE_SYM_S);
    open_node(&p, LATHE_SYM_E);
    for (uint32_t i = p.tree.start, k = 0; k < count; k++) {
        if (!take_edge(&p, &inside, types[i])) return LATHE_ERR_FORMAT;
        if (++i == count) i = 0;
    }
    if (!inside || p.depth || p.main_edges != rays) return LATHE_ERR_FORMAT;
    close_node(&p);
    *out = p.tree;
    return LATHE_OK;
}
