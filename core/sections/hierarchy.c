/* The algorithm of [H 2.3]: HRESOLVE, EXPAND_TREE, RESOLVE_TREE, EXPAND_CROSS_LINK, CHECK_ADD_CROSS_LINK.
 *
 * The pieces that stand for the outline at some tolerance are the front. It begins as the root and moves down: the
 * piece with the greatest attribute a is expanded; where chords then meet, the greater piece of each meeting pair is
 * expanded as well and inherits a, until none meet. So the front after each round is the outline at all tolerances
 * from the next attribute up to a, and each front is checked. Two pieces are cross-linked while their octangles
 * overlap; only the children of linked pieces can be, since an octangle holds all that is below it. Pieces that
 * follow each other always are, by their common vertex; that is one link each.
 *
 * What the paper leaves out: loops that are stepped over (piece_tree.c: a static property of a piece, so such pieces
 * are *forced*: expanded with their parents), and loops that turn over (the area of each loop is kept while the
 * front moves). RESOLVE_TREE as printed raises the attributes of the children, too; here they keep their own, since
 * they need not be expanded: more tolerances remain different. */
#include "hierarchy.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "piece_tree.h"

enum { NONE = 0xffffffffu, SCANNED_PIECES = 1024 };

typedef struct link {
    lathe_piece piece[2];
    uint32_t next[2], previous[2];     /* in the lists of both pieces: 2 * link + side */
    uint32_t stamp;                    /* counts up when the link is freed */
} link;

typedef struct waiting { double key; uint32_t item, stamp; } waiting;
typedef struct heap { waiting *items; size_t count, capacity; } heap;

typedef struct resolver {
    lathe_arena *arena;
    lathe_piece_tree tree;
    uint32_t *node_links, *edge_links; /* first link of a piece: 2 * link + side */
    link *links;
    uint32_t link_count, link_capacity, free_link, live_links;
    heap pieces, meetings;             /* by attribute: what to expand; links whose chords meet */
    lathe_piece *front;                /* per vertex: the piece of the front that begins in it; only at vertices of
                                        * the front */
    uint64_t *area;                    /* per loop: twice its signed area now, modulo 2^64 (a simple loop's fits) */
    bool *negative, *touched;          /* per loop: the sign it must have; whether it has changed in this round */
    uint32_t *changed, changed_count;
    double attribute;                  /* of this round */
    uint64_t most_tests;
    uint32_t most_links;
    lathe_hierarchy_counts counts;
} resolver;

/* ---- a heap, greatest first ---- */

static lathe_status push(heap *h, waiting item) {
    if (h->count == h->capacity) {
        size_t capacity = h->capacity ? h->capacity * 2 : 256;
        waiting *more = realloc(h->items, capacity * sizeof *more);
        if (!more) return LATHE_ERR_MEMORY;
        h->items = more;
        h->capacity = capacity;
    }
    size_t i = h->count++;
    for (size_t up; i && h->items[up = (i - 1) / 2].key < item.key; i = up) h->items[i] = h->items[up];
    h->items[i] = item;
    return LATHE_OK;
}

static waiting pop(heap *h) {
    waiting top = h->items[0], last = h->items[--h->count];
    size_t i = 0;
    for (size_t down; (down = 2 * i + 1) < h->count; i = down) {
        if (down + 1 < h->count && h->items[down + 1].key > h->items[down].key) down++;
        if (h->items[down].key <= last.key) break;
        h->items[i] = h->items[down];
    }
    if (h->count) h->items[i] = last;
    return top;
}

/* ---- cross-links ---- */

static bool is_edge(lathe_piece piece) { return (piece & LATHE_PIECE_EDGE) != 0; }

static uint32_t *links_of(resolver *r, lathe_piece piece) {
    return is_edge(piece) ? &r->edge_links[piece & ~LATHE_PIECE_EDGE] : &r->node_links[piece];
}

static lathe_status new_link(resolver *r, lathe_piece a, lathe_piece b, uint32_t *out) {
    uint32_t l = r->free_link;
    if (l != NONE) r->free_link = r->links[l].next[0];
    else {
        if (r->link_count == r->link_capacity) {
            uint32_t capacity = r->link_capacity ? r->link_capacity * 2 : 1024;
            link *more = realloc(r->links, capacity * sizeof *more);
            if (!more) return LATHE_ERR_MEMORY;
            r->links = more;
            r->link_capacity = capacity;
        }
        l = r->link_count++;
        r->links[l].stamp = 0;
    }
    link *at = &r->links[l];
    at->piece[0] = a;
    at->piece[1] = b;
    for (uint32_t side = 0; side < 2; side++) {
        uint32_t *first = links_of(r, at->piece[side]);
        at->previous[side] = NONE;
        at->next[side] = *first;
        if (*first != NONE) r->links[*first / 2].previous[*first & 1] = 2 * l + side;
        *first = 2 * l + side;
    }
    if (++r->live_links > r->counts.most_links) r->counts.most_links = r->live_links;
    *out = l;
    return LATHE_OK;
}

static void free_link(resolver *r, uint32_t l) {
    link *at = &r->links[l];
    for (int side = 0; side < 2; side++) {
        uint32_t next = at->next[side], previous = at->previous[side];
        if (previous == NONE) *links_of(r, at->piece[side]) = next;
        else r->links[previous / 2].next[previous & 1] = next;
        if (next != NONE) r->links[next / 2].previous[next & 1] = previous;
    }
    at->stamp++;
    at->next[0] = r->free_link;
    r->free_link = l;
    r->live_links--;
}

static int sign(int64_t value) { return (value > 0) - (value < 0); }

static int side(const lathe_point *at, uint32_t a, uint32_t b, uint32_t c) { return sign(lathe__turn(at, a, b, c)); }

/* Of three points on a line: is s at an end, with a and b on the same side of it? */
static bool folds_back(lathe_point s, lathe_point a, lathe_point b) {
    return ((int64_t)a.x - s.x) * ((int64_t)b.x - s.x) + ((int64_t)a.y - s.y) * ((int64_t)b.y - s.y) > 0;
}

/* Do two chords have more in common than an end they share? */
static bool chords_meet(const lathe_piece_tree *tree, lathe_piece p, lathe_piece q) {
    const lathe_point *at = tree->at;
    uint32_t a = lathe__piece_from(tree, p), b = lathe__piece_to(tree, p);
    uint32_t c = lathe__piece_from(tree, q), d = lathe__piece_to(tree, q);
    if (b == c && a == d) return true;
    if (b == c) return !side(at, a, b, d) && folds_back(at[b], at[a], at[d]);
    if (a == d) return !side(at, b, a, c) && folds_back(at[a], at[b], at[c]);
    int abc = side(at, a, b, c), abd = side(at, a, b, d), cda = side(at, c, d, a), cdb = side(at, c, d, b);
    if (abc * abd > 0 || cda * cdb > 0) return false;
    if (abc || abd || cda || cdb) return true;
    for (int k = 0; k < 2; k++) {      /* all on one line: do the ranges overlap? */
        int32_t a1 = k ? at[a].y : at[a].x, b1 = k ? at[b].y : at[b].x, c1 = k ? at[c].y : at[c].x,
                d1 = k ? at[d].y : at[d].x;
        if ((a1 > b1 ? a1 : b1) < (c1 < d1 ? c1 : d1) || (c1 > d1 ? c1 : d1) < (a1 < b1 ? a1 : b1)) return false;
    }
    return true;
}

static bool is_group(const resolver *r, lathe_piece piece) { return !is_edge(piece) && r->tree.nodes[piece].group; }

static lathe_octangle octangle_of(const resolver *r, lathe_piece piece) {
    if (!is_edge(piece)) return r->tree.nodes[piece].bound;
    return lathe__octangle_of(r->tree.at[lathe__piece_from(&r->tree, piece)],
                              r->tree.at[lathe__piece_to(&r->tree, piece)]);
}

static double attribute_of(const resolver *r, lathe_piece piece) {
    return is_edge(piece) ? -1 : r->tree.nodes[piece].attribute;
}

/* CHECK_ADD_CROSS_LINK. Two edges of the outline itself are tested once and need no link. */
static lathe_status check_pair(resolver *r, lathe_piece p, const lathe_octangle *bound, lathe_piece q) {
    r->counts.octangle_tests++;
    lathe_octangle other = octangle_of(r, q);
    if (!lathe__octangles_overlap(bound, &other)) return LATHE_OK;
    bool meet = false;
    if (!is_group(r, p) && !is_group(r, q)) {
        r->counts.chord_tests++;
        meet = chords_meet(&r->tree, p, q);
    }
    if (is_edge(p) && is_edge(q)) return meet ? LATHE_ERR_FORMAT : LATHE_OK;
    uint32_t l;
    lathe_status status = new_link(r, p, q, &l);
    if (status || !meet) return status;
    double a = attribute_of(r, p), b = attribute_of(r, q);
    return push(&r->meetings, (waiting){a > b ? a : b, l, r->links[l].stamp});
}

/* ---- the front ---- */

static lathe_status enter_front(resolver *r, lathe_piece piece) {
    if (!is_group(r, piece)) r->front[lathe__piece_from(&r->tree, piece)] = piece;
    if (is_edge(piece)) return LATHE_OK;
    lathe_piece_node *node = &r->tree.nodes[piece];
    node->attribute = node->forced || node->error > r->attribute ? r->attribute : node->error;
    return push(&r->pieces, (waiting){node->attribute, piece, 0});
}

static void change_area(resolver *r, const lathe_piece_node *node) {
    r->area[node->loop] += (uint64_t)lathe__turn(r->tree.at, node->from, node->split, node->to);
    if (r->touched[node->loop]) return;
    r->touched[node->loop] = true;
    r->changed[r->changed_count++] = node->loop;
}

/* EXPAND_CROSS_LINK: a piece gives way to its children, with the attribute of this round. LIMIT: time to give up. */
static lathe_status expand(resolver *r, lathe_piece piece) {
    lathe_piece_node *node = &r->tree.nodes[piece];
    lathe_octangle bound[2];
    node->expanded = true;
    if (r->attribute > node->attribute) {
        r->counts.inherited++;
        node->early = true;
    }
    node->attribute = r->attribute;
    if (!node->group) change_area(r, node);
    lathe_status status = LATHE_OK;
    for (int k = 0; k < 2; k++) bound[k] = octangle_of(r, node->child[k]);
    for (int k = 0; k < 2 && !status; k++) status = enter_front(r, node->child[k]);
    if (!status) status = check_pair(r, node->child[0], &bound[0], node->child[1]);
    for (uint32_t at = r->node_links[piece]; at != NONE && !status; at = r->node_links[piece]) {
        lathe_piece other = r->links[at / 2].piece[~at & 1];
        free_link(r, at / 2);
        for (int k = 0; k < 2 && !status; k++) status = check_pair(r, node->child[k], &bound[k], other);
    }
    bool spent = r->counts.octangle_tests > r->most_tests || r->live_links > r->most_links;
    return status ? status : spent ? LATHE_ERR_LIMIT : LATHE_OK;
}

/* The greatest piece of a loop that has turned over; all of them where there are many. */
static lathe_status turn_back(resolver *r, uint32_t l) {
    const lathe_loop *loop = &r->tree.loops[l];
    lathe_piece greatest = LATHE_NO_PIECE;
    uint32_t scanned = 0, v = loop->first;
    do {
        lathe_piece piece = r->front[v];
        v = lathe__piece_to(&r->tree, piece);
        if (is_edge(piece)) continue;
        if (greatest == LATHE_NO_PIECE || attribute_of(r, piece) > attribute_of(r, greatest)) greatest = piece;
        if (++scanned < SCANNED_PIECES) continue;
        lathe_status status = expand(r, greatest);
        greatest = LATHE_NO_PIECE;
        if (status) return status;
    } while (v != loop->first);
    /* The whole loop has its own sign: only a loop that crosses itself can come here without a piece. */
    return greatest != LATHE_NO_PIECE ? expand(r, greatest) : scanned >= SCANNED_PIECES ? LATHE_OK : LATHE_ERR_FORMAT;
}

/* RESOLVE_TREE: until no chords meet. */
static lathe_status resolve_meetings(resolver *r) {
    while (r->meetings.count) {
        waiting top = pop(&r->meetings);
        const link *l = &r->links[top.item];
        if (l->stamp != top.stamp) continue;
        double a = attribute_of(r, l->piece[0]), b = attribute_of(r, l->piece[1]);
        lathe_status status = expand(r, l->piece[b > a]);
        if (status) return status;
    }
    return LATHE_OK;
}

/* Expands the pieces that share the greatest attribute, and whatever that asks for. */
static lathe_status play_round(resolver *r) {
    lathe_status status = LATHE_OK;
    r->attribute = r->pieces.items[0].key;
    while (!status) {
        while (!status && r->pieces.count && r->pieces.items[0].key >= r->attribute) {
            uint32_t piece = pop(&r->pieces).item;
            if (!r->tree.nodes[piece].expanded) status = expand(r, piece);
        }
        if (!status) status = resolve_meetings(r);
        if (status || (r->pieces.count && r->pieces.items[0].key >= r->attribute)) continue;
        uint32_t i = 0;
        while (i < r->changed_count && (r->area[r->changed[i]] >> 63 != 0) == r->negative[r->changed[i]] &&
               r->area[r->changed[i]])
            i++;
        if (i == r->changed_count) break;
        status = turn_back(r, r->changed[i]);
    }
    while (r->changed_count) r->touched[r->changed[--r->changed_count]] = false;
    return status;
}

/* What is not expanded yet goes with this round: below its attribute there is only the whole outline. */
static void give_up(resolver *r, double attribute) {
    for (uint32_t i = 0; i < r->tree.node_count; i++) {
        lathe_piece_node *node = &r->tree.nodes[i];
        if (!node->expanded) node->attribute = attribute;
    }
    r->counts.gave_up = true;
}

/* HRESOLVE. */
static lathe_status resolve(resolver *r) {
    r->attribute = INFINITY;
    lathe_status status = enter_front(r, 0);
    while (!status && r->pieces.count) status = play_round(r);
    if (status != LATHE_ERR_LIMIT) return status;
    give_up(r, r->attribute);
    return LATHE_OK;
}

/* ---- before and after ---- */

static lathe_status prepare(resolver *r, uint64_t most_tests) {
    uint32_t n = r->tree.point_count, loops = r->tree.loop_count;
    r->node_links = LATHE_NEW(r->arena, uint32_t, r->tree.node_count);
    r->edge_links = LATHE_NEW(r->arena, uint32_t, n);
    r->front = LATHE_NEW(r->arena, lathe_piece, n);
    r->area = LATHE_NEW(r->arena, uint64_t, loops);
    r->negative = LATHE_NEW(r->arena, bool, loops);
    r->touched = LATHE_NEW(r->arena, bool, loops);
    r->changed = LATHE_NEW(r->arena, uint32_t, loops);
    if (!r->node_links || !r->edge_links || !r->front || !r->area || !r->negative || !r->touched || !r->changed)
        return LATHE_ERR_MEMORY;
    memset(r->node_links, 0xff, r->tree.node_count * sizeof *r->node_links);
    memset(r->edge_links, 0xff, n * sizeof *r->edge_links);
    memset(r->touched, 0, loops * sizeof *r->touched);
    for (uint32_t l = 0; l < loops; l++) {
        const lathe_loop *loop = &r->tree.loops[l];
        uint64_t area = 0;
        for (uint32_t v = loop->first; v + 1 < loop->first + loop->count; v++)
            area += (uint64_t)lathe__turn(r->tree.at, loop->first, v, v + 1);
        if (!area) return LATHE_ERR_FORMAT;
        r->negative[l] = area >> 63 != 0;
        r->area[l] = 0;
    }
    r->free_link = NONE;
    r->most_tests = most_tests;
    uint64_t most_links = ((uint64_t)1 << 22) + 8 * (uint64_t)n;
    r->most_links = most_links < 1u << 30 ? (uint32_t)most_links : 1u << 30;
    return LATHE_OK;
}

static int ascending(const void *a, const void *b) {
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

/* Sorts, leaves one of each; INFINITY goes. Returns how many remain. */
static uint32_t distinct(double *values, uint32_t count) {
    qsort(values, count, sizeof *values, ascending);
    uint32_t n = 0;
    for (uint32_t i = 0; i < count; i++)
        if (values[i] < INFINITY && (!n || values[i] > values[n - 1])) values[n++] = values[i];
    return n;
}

/* Douglas-Peucker's errors, and the same with no child's above its parent's. */
static lathe_status count_unresolved(resolver *r) {
    lathe_piece_node *nodes = r->tree.nodes;
    double *values = LATHE_NEW(r->arena, double, r->tree.node_count);
    if (!values) return LATHE_ERR_MEMORY;
    uint32_t n = r->tree.node_count;
    for (uint32_t i = 0; i < n; i++) values[i] = nodes[i].attribute = nodes[i].error;
    r->counts.plain = distinct(values, n) + 1;
    for (uint32_t i = 0; i < n; i++)
        for (int k = 0; k < 2; k++) {
            lathe_piece child = nodes[i].child[k];
            if (!is_edge(child) && nodes[child].attribute > nodes[i].attribute)
                nodes[child].attribute = nodes[i].attribute;
        }
    for (uint32_t i = 0; i < n; i++) values[i] = nodes[i].attribute;
    r->counts.adjusted = distinct(values, n) + 1;
    return LATHE_OK;
}

/* What would be left if the children of early pieces inherited, too. */
static lathe_status count_printed(resolver *r) {
    const lathe_piece_node *nodes = r->tree.nodes;
    uint32_t n = r->tree.node_count;
    double *values = LATHE_NEW(r->arena, double, n);
    if (!values) return LATHE_ERR_MEMORY;
    for (uint32_t i = 0; i < n; i++) values[i] = nodes[i].attribute;
    for (uint32_t i = 0; i < n; i++)
        for (int k = 0; k < 2; k++)
            if (nodes[i].early && !is_edge(nodes[i].child[k])) values[nodes[i].child[k]] = values[i];
    r->counts.printed = distinct(values, n) + 1;
    return LATHE_OK;
}

static lathe_status write_result(lathe_hierarchy *out, lathe_arena *arena, const resolver *r,
                                 const lathe_outline *outline) {
    const lathe_piece_tree *tree = &r->tree;
    uint32_t n = tree->point_count;
    lathe_hierarchy h = {.outline = outline, .counts = r->counts};
    h.attribute = LATHE_NEW(arena, double, n);
    h.tolerances = LATHE_NEW(arena, double, (size_t)n + 1);
    if (!h.attribute || !h.tolerances) return LATHE_ERR_MEMORY;
    for (uint32_t v = 0; v < n; v++) h.attribute[v] = INFINITY;
    for (uint32_t i = 0; i < tree->node_count; i++) {
        const lathe_piece_node *node = &tree->nodes[i];
        if (node->group) continue;
        const lathe_loop *loop = &tree->loops[node->loop];
        uint32_t k = node->split - loop->first + tree->rotation[node->loop];
        h.attribute[loop->first + (k < loop->count ? k : k - loop->count)] = node->attribute;
    }
    h.tolerances[0] = 0;
    if (n) memcpy(h.tolerances + 1, h.attribute, n * sizeof *h.attribute);
    h.tolerance_count = distinct(h.tolerances + 1, n) + 1;
    h.counts.resolved = h.tolerance_count;
    *out = h;
    return LATHE_OK;
}

lathe_status lathe__hierarchy_build(lathe_hierarchy *out, lathe_arena *arena, const lathe_outline *outline) {
    return lathe__hierarchy_build_within(out, arena, outline,
                                         ((uint64_t)1 << 24) + 256 * (uint64_t)outline->point_count);
}

lathe_status lathe__hierarchy_build_within(lathe_hierarchy *out, lathe_arena *arena, const lathe_outline *outline,
                                           uint64_t most_tests) {
    lathe_arena scratch = {0};
    resolver r = {.arena = &scratch};
    lathe_status status = lathe__piece_tree_build(&r.tree, &scratch, outline);
    if (!status && outline->loop_count) {
        bool done = false;
        status = prepare(&r, most_tests);
        if (!status) status = count_unresolved(&r);
        if (!status) status = lathe__piece_tree_mark(&r.tree, &scratch, most_tests, &done);
        if (!status && done) status = resolve(&r);
        else if (!status) give_up(&r, INFINITY);
    }
    if (!status) status = count_printed(&r);
    if (!status) status = write_result(out, arena, &r, outline);
    free(r.links);
    free(r.pieces.items);
    free(r.meetings.items);
    lathe__arena_free(&scratch);
    return status;
}

const double *lathe__hierarchy_tolerances(uint32_t *count, const lathe_hierarchy *hierarchy) {
    *count = hierarchy->tolerance_count;
    return hierarchy->tolerances;
}

lathe_status lathe__hierarchy_outline(lathe_outline *out, lathe_arena *arena, const lathe_hierarchy *hierarchy,
                                      double tolerance) {
    const lathe_outline *whole = hierarchy->outline;
    uint32_t n = 0;
    bool all = !(tolerance > 0);
    for (uint32_t v = 0; v < whole->point_count; v++) n += all || hierarchy->attribute[v] > tolerance;
    lathe_outline o = {.loop_count = whole->loop_count};
    o.points = LATHE_NEW(arena, lathe_point, n);
    o.loops = LATHE_NEW(arena, lathe_loop, whole->loop_count);
    o.ray = whole->ray ? LATHE_NEW(arena, int32_t, n) : NULL;
    if (!o.points || !o.loops || (whole->ray && !o.ray)) return LATHE_ERR_MEMORY;
    for (uint32_t l = 0; l < whole->loop_count; l++) {
        const lathe_loop *loop = &whole->loops[l];
        o.loops[l] = *loop;
        o.loops[l].first = o.point_count;
        for (uint32_t v = loop->first; v < loop->first + loop->count; v++) {
            if (!all && !(hierarchy->attribute[v] > tolerance)) continue;
            if (whole->ray) o.ray[o.point_count] = whole->ray[v];
            o.points[o.point_count++] = whole->points[v];
        }
        o.loops[l].count = o.point_count - o.loops[l].first;
    }
    *out = o;
    return LATHE_OK;
}

lathe_status lathe__simplify_section(lathe_outline *out, lathe_arena *arena, const lathe_outline *outline,
                                     double tolerance) {
    lathe_arena scratch = {0};
    lathe_hierarchy hierarchy;
    lathe_status status = lathe__hierarchy_build(&hierarchy, &scratch, outline);
    if (!status) status = lathe__hierarchy_outline(out, arena, &hierarchy, tolerance);
    lathe__arena_free(&scratch);
    return status;
}
