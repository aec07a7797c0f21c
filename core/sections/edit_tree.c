/* Derivation trees under refinement: leaves become subtrees (see contour_edit.h). */
#include "contour_edit.h"
#include <stdlib.h>
#include <string.h>

#define NONE UINT32_MAX

static bool grow(void **array, uint32_t *capacity, uint32_t want, size_t size) {
    if (want <= *capacity && *array) return true;
    uint32_t more = *capacity + *capacity / 2 + 64;
    if (more < want) more = want;
    void *p = realloc(*array, more * size);
    if (!p) return false;
    *array = p;
    *capacity = more;
    return true;
}
static bool make_room(lathe_edit_tree *t, const lathe_edit_contour *c, uint32_t nodes) {
    void *n = t->nodes, *o = t->owner, *l = t->level1;
    bool ok = grow(&n, &t->node_capacity, t->node_count + nodes, sizeof *t->nodes);
    t->nodes = n;
    ok = ok && grow(&o, &t->owner_capacity, c->count, sizeof *t->owner);
    t->owner = o;
    ok = ok && grow(&l, &t->level1_capacity, c->ray_count, sizeof *t->level1);
    t->level1 = l;
    return ok;
}

static bool is_element(uint8_t symbol) { return symbol >= LATHE_DER_D_I && symbol <= LATHE_DER_U_I; }
static bool is_o(uint8_t symbol) { return symbol == LATHE_DER_D_I || symbol == LATHE_DER_U_O; }
static bool is_up(uint8_t symbol) {
    return symbol == LATHE_DER_U_O || symbol == LATHE_DER_U_I || symbol == LATHE_DER_U || symbol == LATHE_DER_U_R;
}

static uint32_t new_node(lathe_edit_tree *t, uint8_t symbol, uint32_t edge) {
    t->nodes[t->node_count] = (lathe_edit_node){symbol, edge, NONE, NONE, NONE};
    return t->node_count++;
}
static void add_child(lathe_edit_tree *t, uint32_t parent, uint32_t child) {
    lathe_edit_node *p = &t->nodes[parent];
    t->nodes[child].next = NONE;
    if (p->child == NONE)
        p->child = child;
    else
        t->nodes[p->last].next = child;
    p->last = child;
}
static void add_leaf(lathe_edit_tree *t, uint32_t parent, uint32_t edge) {
    add_child(t, parent, new_node(t, LATHE_DER_LEAF, edge));
    t->owner[edge] = parent;
}

/* What an element is called: a single edge by its type, an excursion by the distances of its ends (as derivation.c). */
static uint8_t element_symbol(const lathe_edit_tree *t, const lathe_edit_contour *c, uint32_t element, bool o) {
    const lathe_edit_node *n = &t->nodes[element];
    const lathe_edit_crossing *a = &c->crossings[t->nodes[n->child].edge];
    bool up = n->child == n->last ? a->type == LATHE_UP_O || a->type == LATHE_UP_I
                                  : c->crossings[c->crossings[t->nodes[n->last].edge].next].radius > a->radius;
    return o ? (up ? LATHE_DER_U_O : LATHE_DER_D_I) : up ? LATHE_DER_U_I : LATHE_DER_D_O;
}
static uint32_t single_element(lathe_edit_tree *t, const lathe_edit_contour *c, uint32_t edge) {
    uint32_t e = new_node(t, LATHE_DER_D_I, NONE);
    add_leaf(t, e, edge);
    t->nodes[e].symbol = element_symbol(t, c, e, c->crossings[edge].at.in_out);
    return e;
}
/* Two elements: D or U if an O comes first, else D_R or U_R. */
static uint32_t group(lathe_edit_tree *t, uint32_t first, uint32_t second) {
    bool o = is_o(t->nodes[first].symbol), up = is_up(t->nodes[first].symbol);
    uint32_t g = new_node(t, o ? (up ? LATHE_DER_U : LATHE_DER_D) : up ? LATHE_DER_U_R : LATHE_DER_D_R, NONE);
    add_child(t, g, first);
    add_child(t, g, second);
    return g;
}

/* ---- a fold's pairs, divided between the level-1 nodes before and behind it ---- */

static bool holds_pairs(const lathe_edit_tree *t, uint32_t part) {
    return !is_element(t->nodes[t->nodes[part].child].symbol);
}
static uint32_t part_of(lathe_edit_tree *t, uint32_t pairs, uint32_t end, uint8_t symbol) {
    if (pairs == end) return NONE;
    if (t->nodes[pairs].next == end) {
        t->nodes[pairs].next = NONE;
        return pairs;
    }
    uint32_t part = new_node(t, symbol, NONE);
    for (uint32_t i = pairs, next; i != end; i = next) {
        next = t->nodes[i].next;
        add_child(t, part, i);
    }
    return part;
}
/* Leading pairs outwards are the U of the node before, the rest is the D of the one behind. Room for two nodes. */
static void settle_fold(lathe_edit_tree *t, uint32_t before, uint32_t behind, uint32_t pairs) {
    uint32_t split = pairs;
    while (split != NONE && is_up(t->nodes[split].symbol)) split = t->nodes[split].next;
    uint32_t lower = part_of(t, split, NONE, LATHE_DER_D);
    t->nodes[before].last = part_of(t, pairs, split, LATHE_DER_U);
    t->nodes[behind].child = lower;
}
static uint32_t first_pair(const lathe_edit_tree *t, uint32_t part) {
    return part == NONE ? NONE : holds_pairs(t, part) ? t->nodes[part].child : part;
}

/* An element's symbol changed (its ends are equally far out once rounded, so that an excursion is not what its single
 * edge was): that may change groups and divisions. Rare; done for the whole tree. */
static lathe_status relabel(lathe_edit_tree *t, const lathe_edit_contour *c) {
    for (uint32_t i = 0; i < t->node_count; i++) {
        lathe_edit_node *n = &t->nodes[i];
        if (n->child == NONE || n->symbol == LATHE_DER_F || !is_element(t->nodes[n->child].symbol) ||
            is_element(n->symbol))
            continue;
        bool o = is_o(t->nodes[n->child].symbol), up = is_up(t->nodes[n->child].symbol);
        n->symbol = o ? (up ? LATHE_DER_U : LATHE_DER_D) : up ? LATHE_DER_U_R : LATHE_DER_D_R;
    }
    for (uint32_t ray = 0; ray < c->ray_count; ray++) {
        uint32_t before = t->level1[c->rays[ray].before], behind = t->level1[ray];
        uint32_t pairs = first_pair(t, t->nodes[before].last), rest = first_pair(t, t->nodes[behind].child),
                 last = pairs;
        if (!make_room(t, c, 2)) return LATHE_ERR_MEMORY;
        while (last != NONE && t->nodes[last].next != NONE) last = t->nodes[last].next;
        if (last != NONE) t->nodes[last].next = rest;
        settle_fold(t, before, behind, pairs == NONE ? rest : pairs);
    }
    t->relabel = false;
    return LATHE_OK;
}

/* ---- leaves become subtrees ---- */

/* Elements in a row between two leaves: the first alone, the others in twos. */
typedef struct row {
    uint32_t parent, held, count;
} row;
static void add_element(lathe_edit_tree *t, row *r, uint32_t element) {
    if (r->count++ == 0)
        add_child(t, r->parent, element);
    else if (r->held == NONE)
        r->held = element;
    else {
        add_child(t, r->parent, group(t, r->held, element));
        r->held = NONE;
    }
}
static void check_symbol(lathe_edit_tree *t, const lathe_edit_contour *c, uint32_t element) {
    uint8_t symbol = element_symbol(t, c, element, is_o(t->nodes[element].symbol));
    if (symbol != t->nodes[element].symbol) t->relabel = true;
    t->nodes[element].symbol = symbol;
}

/* o -> f o (i o)* b, i -> b i (o i)* f. */
static void split_single(lathe_edit_tree *t, const lathe_edit_contour *c, uint32_t element, uint32_t edge) {
    uint32_t first = c->crossings[edge].split_first, last = first + c->crossings[edge].split_count - 1;
    row r = {element, NONE, 0};
    t->nodes[element].child = t->nodes[element].last = NONE;
    add_leaf(t, element, edge);
    for (uint32_t x = first; x < last; x++) add_element(t, &r, single_element(t, c, x));
    add_leaf(t, element, last);
    check_symbol(t, c, element);
}
/* O -> f X b, X an O and pairs of a single i and an O: f -> f (o i)* f and b -> b (i o)* b; and where an i of X is
 * crossed by the ray, too (i -> b i (o i)* f), X comes apart, for an excursion ends where it first comes back to its
 * ray:
 *   f (o i)* O' [i (o i)* O']* (i o)* b   with O' -> f X' b.  I likewise. */
static void split_excursion(lathe_edit_tree *t, const lathe_edit_contour *c, uint32_t element, uint32_t ray) {
    uint32_t child = t->nodes[element].child, begin = t->nodes[child].edge, end = t->nodes[t->nodes[element].last].edge;
    uint8_t symbol = t->nodes[element].symbol;
    const lathe_edit_crossing *first = &c->crossings[begin], *last = &c->crossings[end];
    uint32_t x = first->split_first, x_last = x + first->split_count - 1, y = last->split_first,
             y_last = y + last->split_count - 1;
    t->nodes[element].child = t->nodes[element].last = NONE;
    row r = {element, NONE, 0};
    child = t->nodes[child].next;
    add_leaf(t, element, begin);
    for (; x < x_last; x++) add_element(t, &r, single_element(t, c, x));
    uint32_t inner = new_node(t, symbol, NONE), next = t->nodes[child].next;
    add_leaf(t, inner, x_last);
    add_child(t, inner, child);
    for (child = next; t->nodes[child].symbol != LATHE_DER_LEAF; child = next) {
        next = t->nodes[child].next;
        uint32_t edge = t->nodes[t->nodes[t->nodes[child].child].child].edge;
        const lathe_edit_crossing *e = &c->crossings[edge];
        if (e->split_by != ray) {
            add_child(t, inner, child);
            continue;
        }
        add_leaf(t, inner, edge);
        t->nodes[inner].symbol = element_symbol(t, c, inner, is_o(symbol));
        add_element(t, &r, inner);
        uint32_t z = e->split_first, z_last = z + e->split_count - 1;
        for (; z < z_last; z++) add_element(t, &r, single_element(t, c, z));
        inner = new_node(t, symbol, NONE);
        add_leaf(t, inner, z_last);
        add_child(t, inner, t->nodes[child].last);
    }
    add_leaf(t, inner, end);
    t->nodes[inner].symbol = element_symbol(t, c, inner, is_o(symbol));
    add_element(t, &r, inner);
    for (; y < y_last; y++) add_element(t, &r, single_element(t, c, y));
    add_leaf(t, element, y_last);
}
/* F -> F F: D goes to the first, U to the second, the new fold between them. */
static void split_level1(lathe_edit_tree *t, const lathe_edit_contour *c, uint32_t node, uint32_t edge) {
    const lathe_edit_crossing *e = &c->crossings[edge];
    uint32_t first = e->split_first, last = first + e->split_count - 1, ray = e->split_by, pairs = NONE, *link = &pairs;
    uint32_t behind = new_node(t, LATHE_DER_F, last);
    t->level1[ray] = behind;
    t->owner[last] = behind;
    t->nodes[behind].last = t->nodes[node].last;
    for (uint32_t x = first; x < last; x += 2) {
        uint32_t o = single_element(t, c, x), i = single_element(t, c, x + 1), pair = group(t, o, i);
        *link = pair;
        link = &t->nodes[pair].next; /* nodes do not move: there was room for all */
    }
    settle_fold(t, node, behind, pairs);
}

lathe_status lathe__edit_tree_refine(lathe_edit_tree *tree, const lathe_edit_contour *contour) {
    const lathe_edit_contour *c = contour;
    uint64_t room = 0;
    for (uint32_t k = 0; k < c->refined_count; k++) room += 3 * (uint64_t)c->crossings[c->refined[k]].split_count + 8;
    if (room > UINT32_MAX / 2 - tree->node_count) return LATHE_ERR_LIMIT;
    if (!make_room(tree, c, (uint32_t)room)) return LATHE_ERR_MEMORY;
    /* Excursions first: they take their single edges along. */
    uint32_t ray = c->ray_count - 1;
    for (uint32_t k = 0; k < c->refined_count; k++) {
        uint32_t edge = c->refined[k], owner = tree->owner[edge];
        const lathe_edit_node *n = &tree->nodes[owner];
        if (n->symbol != LATHE_DER_F && n->child != n->last && tree->nodes[n->child].edge == edge)
            split_excursion(tree, c, owner, ray);
    }
    for (uint32_t k = 0; k < c->refined_count; k++) {
        uint32_t edge = c->refined[k], owner = tree->owner[edge];
        const lathe_edit_node *n = &tree->nodes[owner];
        if (n->symbol == LATHE_DER_F)
            split_level1(tree, c, owner, edge);
        else if (n->child == n->last)
            split_single(tree, c, owner, edge);
    }
    return tree->relabel ? relabel(tree, c) : LATHE_OK;
}

/* ---- between this form and derivation.h's ---- */

/* Nodes come in preorder and keep their numbers; level-1 leaves have none, and parts hang on their level-1 node. */
static lathe_status take_tree(lathe_edit_tree *t, const lathe_edit_contour *c, const lathe_derivation *d) {
    if (!make_room(t, c, d->node_count)) return LATHE_ERR_MEMORY;
    t->node_count = d->node_count;
    for (uint32_t i = 0; i < d->node_count; i++)
        t->nodes[i] = (lathe_edit_node){d->nodes[i].symbol, NONE, NONE, NONE, NONE};
    for (uint32_t i = 1; i < d->node_count; i++) {
        const lathe_derivation_node *n = &d->nodes[i];
        if (n->symbol != LATHE_DER_F)
            for (uint32_t k = n->child; k != NONE; k = d->nodes[k].next) {
                add_child(t, i, k);
                if (d->nodes[k].symbol != LATHE_DER_LEAF) continue;
                uint32_t edge = (d->start + d->nodes[k].first) % c->count;
                t->nodes[k].edge = edge;
                t->owner[edge] = i;
            }
    }
    for (uint32_t ray = 0; ray < d->rays; ray++) {
        uint32_t f = t->level1[ray] = d->level1[ray], edge = (d->start + d->main_edge[ray]) % c->count;
        t->nodes[f].edge = edge;
        t->owner[edge] = f;
        for (uint32_t k = d->nodes[f].child; k != NONE; k = d->nodes[k].next)
            *(d->nodes[k].first < d->main_edge[ray] ? &t->nodes[f].child : &t->nodes[f].last) = k;
    }
    return LATHE_OK;
}
/* Rays of a contour just opened have their own numbers, as crossings do. */
lathe_status lathe__edit_tree_open(lathe_edit_tree *out, const lathe_edit_contour *contour, const uint32_t *chain) {
    lathe_arena arena = {0};
    lathe_ray_contour plain;
    lathe_derivation d;
    lathe_edit_tree t = {0};
    lathe_status status = lathe__edit_export(&plain, NULL, &arena, contour);
    if (!status) status = lathe__derive_chain(&d, &arena, &plain, chain);
    if (!status) status = take_tree(&t, contour, &d);
    lathe__arena_free(&arena);
    if (status)
        lathe__edit_tree_close(&t);
    else
        *out = t;
    return status;
}
void lathe__edit_tree_close(lathe_edit_tree *tree) {
    free(tree->nodes);
    free(tree->owner);
    free(tree->level1);
    free(tree->stack);
    *tree = (lathe_edit_tree){0};
}

/* While a node is open, `next` is its parent and `count` its last child, as in derivation.c. */
typedef struct writer {
    lathe_derivation tree;
    const lathe_edit_contour *contour;
    lathe_edit_tree *from;
    uint32_t *edges; /* NULL, or gets the edges in order */
    uint32_t top, position;
    bool ok;
} writer;

static void write_open(writer *w, uint8_t symbol, uint8_t edge) {
    lathe_derivation_node *nodes = w->tree.nodes;
    uint32_t index = w->tree.node_count++;
    nodes[index] = (lathe_derivation_node){symbol, edge, w->position, NONE, NONE, w->top};
    if (w->top != NONE) {
        lathe_derivation_node *parent = &nodes[w->top];
        if (parent->child == NONE)
            parent->child = index;
        else
            nodes[parent->count].next = index;
        parent->count = index;
    }
    w->top = index;
}
static void write_close(writer *w) {
    lathe_derivation_node *node = &w->tree.nodes[w->top];
    w->top = node->next;
    node->next = NONE;
    node->count = w->position - node->first;
}
static void write_edge(writer *w, uint32_t edge) {
    if (w->edges) w->edges[w->position] = edge;
    w->position++;
}
static bool push(writer *w, uint32_t *depth, uint32_t node) {
    void *s = w->from->stack;
    w->ok = w->ok && grow(&s, &w->from->stack_capacity, *depth + 1, sizeof *w->from->stack);
    w->from->stack = s;
    if (w->ok) w->from->stack[(*depth)++] = node;
    return w->ok;
}
static void write_part(writer *w, uint32_t root) {
    if (root == NONE) return;
    const lathe_edit_node *nodes = w->from->nodes;
    uint32_t depth = 0, at = root;
    for (;;) {
        write_open(w, nodes[at].symbol, LATHE_FOR);
        if (nodes[at].symbol != LATHE_DER_LEAF) {
            if (!push(w, &depth, at)) return;
            at = nodes[at].child;
            continue;
        }
        w->tree.nodes[w->top].edge = w->contour->crossings[nodes[at].edge].type;
        write_edge(w, nodes[at].edge);
        write_close(w);
        while (nodes[at].next == NONE || at == root) {
            at = w->from->stack[--depth];
            write_close(w);
            if (at == root) return;
        }
        at = nodes[at].next;
    }
}

lathe_status lathe__edit_tree_export(lathe_derivation *out, lathe_arena *arena, lathe_edit_tree *tree,
                                     const lathe_edit_contour *contour) {
    const lathe_edit_contour *c = contour;
    writer w = {
        .contour = c, .from = tree, .top = NONE, .ok = true, .tree = {.rays = c->ray_count, .edge_count = c->count}};
    w.tree.nodes = LATHE_NEW(arena, lathe_derivation_node, 3 * (size_t)c->count + 2);
    w.tree.level1 = LATHE_NEW(arena, uint32_t, c->ray_count);
    w.tree.main_edge = LATHE_NEW(arena, uint32_t, c->ray_count);
    w.edges = LATHE_NEW(arena, uint32_t, c->count);
    if (!w.tree.nodes || !w.tree.level1 || !w.tree.main_edge || !w.edges) return LATHE_ERR_MEMORY;
    write_open(&w, LATHE_DER_S, LATHE_FOR);
    for (uint32_t k = 0, ray = 0; k < c->ray_count && w.ok; k++, ray = c->rays[ray].next) {
        const lathe_edit_node *f = &tree->nodes[tree->level1[ray]];
        w.tree.level1[k] = w.tree.node_count;
        write_open(&w, LATHE_DER_F, LATHE_FOR);
        write_part(&w, f->child);
        w.tree.main_edge[k] = w.position;
        write_edge(&w, f->edge);
        write_part(&w, f->last);
        write_close(&w);
    }
    if (!w.ok) return LATHE_ERR_MEMORY;
    write_close(&w);
    uint32_t start = w.edges[0];
    for (uint32_t i = c->head; i != start; i = c->crossings[i].next) w.tree.start++;
    *out = w.tree;
    return LATHE_OK;
}

/* How many edges lie between two level-1 edges. */
static uint32_t fold_length(const lathe_edit_contour *c, uint32_t before, uint32_t behind) {
    uint32_t n = 0;
    for (uint32_t i = c->crossings[before].next; i != behind; i = c->crossings[i].next) n++;
    return n;
}
lathe_status lathe__edit_tree_fold(lathe_derivation *out, lathe_ray_contour *points, uint32_t **ids, lathe_arena *arena,
                                   lathe_edit_tree *tree, const lathe_edit_contour *contour, uint32_t ray) {
    const lathe_edit_contour *c = contour;
    const lathe_edit_node *before = &tree->nodes[tree->level1[c->rays[ray].before]],
                          *f = &tree->nodes[tree->level1[ray]];
    uint32_t length = fold_length(c, before->edge, f->edge), count = length + 2;
    writer w = {.contour = c, .from = tree, .top = NONE, .ok = true, .tree = {.rays = 1, .edge_count = length + 1}};
    w.tree.nodes = LATHE_NEW(arena, lathe_derivation_node, 3 * (size_t)length + 4);
    w.tree.level1 = LATHE_NEW(arena, uint32_t, 2);
    w.edges = LATHE_NEW(arena, uint32_t, count);
    lathe_ray_contour p = {.centre = c->centre,
                           .rays = 1,
                           .turn = c->turn,
                           .count = count,
                           .points = LATHE_NEW(arena, lathe_point, count)};
    if (!w.tree.nodes || !w.tree.level1 || !w.edges || !p.points) return LATHE_ERR_MEMORY;
    w.tree.main_edge = w.tree.level1 + 1;
    w.tree.level1[0] = 0;
    write_open(&w, LATHE_DER_F, LATHE_FOR);
    write_part(&w, before->last);
    write_part(&w, f->child);
    w.tree.main_edge[0] = w.position;
    write_edge(&w, f->edge);
    if (!w.ok) return LATHE_ERR_MEMORY;
    write_close(&w);
    w.edges[count - 1] = c->crossings[f->edge].next;
    for (uint32_t i = 0; i < count; i++) p.points[i] = c->crossings[w.edges[i]].point;
    *out = w.tree;
    *points = p;
    *ids = w.edges;
    return LATHE_OK;
}
