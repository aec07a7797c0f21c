/* Douglas-Peucker without its quadratic worst case: blocks of points have octangles, and a block is looked into only
 * if one of its octangle's corners is farther from the chord than the best point so far. On natural shapes that is
 * as good as looking at every point, on spirals and combs far better; and should it not be, pieces are halved in
 * their middle after 512 distances a point. */
#include "piece_tree.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { BLOCK_BITS = 5, SMALL = 64, WORK_PER_POINT = 512, MAX_COORDINATE = 1 << 29 };

typedef struct chord { lathe_point a, b; } chord;

/* The square of a point's distance from a segment. */
static double distance2(const chord *c, lathe_point p) {
    int64_t dx = c->b.x - c->a.x, dy = c->b.y - c->a.y, px = p.x - c->a.x, py = p.y - c->a.y;
    int64_t along = px * dx + py * dy, length2 = dx * dx + dy * dy;
    if (along <= 0) return (double)(px * px + py * py);
    if (along >= length2) {
        int64_t qx = p.x - c->b.x, qy = p.y - c->b.y;
        return (double)(qx * qx + qy * qy);
    }
    double across = (double)(dx * py - dy * px);
    return across * across / (double)length2;
}

/* ---- the farthest point ---- */

typedef struct search {
    lathe_piece_tree *tree;
    const lathe_octangle *blocks;  /* a binary tree: block i of the lowest row is blocks[row + i] */
    uint32_t row;
    chord chord;
    uint32_t first, end;       /* points to search */
    uint32_t best;
    double most;
} search;

static void scan(search *s, uint32_t first, uint32_t end) {
    for (uint32_t v = first; v < end; v++) {
        double d = distance2(&s->chord, s->tree->at[v]);
        if (d > s->most) s->most = d, s->best = v;
    }
    s->tree->work += end - first;
}

/* No point of the octangle is farther: distance from a segment is convex. The factor is for rounding. */
static double bound2(search *s, const lathe_octangle *octangle) {
    lathe_point corners[8];
    double most = 0;
    lathe__octangle_corners(corners, octangle);
    for (int k = 0; k < 8; k++) {
        double d = distance2(&s->chord, corners[k]);
        if (d > most) most = d;
    }
    s->tree->work += 8;
    return most * (1 + 1e-12);
}

/* Depth: log2 of the blocks. `span`: blocks below this node, which begin at block `block`. */
static void descend(search *s, uint32_t node, uint32_t block, uint32_t span) {
    uint64_t first = (uint64_t)block << BLOCK_BITS, end = ((uint64_t)block + span) << BLOCK_BITS;
    if (first >= s->end || end <= s->first) return;
    if (bound2(s, &s->blocks[node]) <= s->most) return;
    if (span == 1) {
        scan(s, first > s->first ? (uint32_t)first : s->first, end < s->end ? (uint32_t)end : s->end);
        return;
    }
    /* What is nearer to the middle of the range first. */
    uint64_t middle = first + (end - first) / 2;
    bool right = middle < ((uint64_t)s->first + s->end) / 2;
    for (int k = 0; k < 2; k++) {
        uint32_t child = (uint32_t)(right ^ (k == 1));
        descend(s, 2 * node + child, block + child * (span / 2), span / 2);
    }
}

static lathe_status build_blocks(search *s, lathe_arena *arena) {
    uint32_t n = s->tree->point_count, count = (n >> BLOCK_BITS) + 1;
    for (s->row = 1; s->row < count;) s->row *= 2;
    lathe_octangle *blocks = LATHE_NEW(arena, lathe_octangle, 2 * (size_t)s->row);
    if (!blocks) return LATHE_ERR_MEMORY;
    for (uint32_t b = 0; b < s->row; b++) {
        uint64_t v = (uint64_t)b << BLOCK_BITS, end = v + (1u << BLOCK_BITS);
        lathe_point p = s->tree->at[v < n ? v : n - 1];
        blocks[s->row + b] = lathe__octangle_of(p, p);
        for (; v < end && v < n; v++) lathe__octangle_add(&blocks[s->row + b], s->tree->at[v]);
    }
    for (uint32_t i = s->row; --i > 0;) {
        blocks[i] = blocks[2 * i];
        lathe__octangle_join(&blocks[i], &blocks[2 * i + 1]);
    }
    s->blocks = blocks;
    return LATHE_OK;
}

/* Where a piece is split, and its error. */
static void split_piece(search *s, lathe_piece_node *node) {
    const lathe_piece_tree *tree = s->tree;
    const lathe_loop *loop = &tree->loops[node->loop];
    s->chord = (chord){tree->at[node->from], tree->at[node->to]};
    s->first = node->from + 1;
    s->end = node->to > node->from ? node->to : loop->first + loop->count;
    s->best = s->first;
    s->most = -1;
    if (s->end - s->first <= SMALL) scan(s, s->first, s->end);
    else if (tree->work < (uint64_t)WORK_PER_POINT * tree->point_count) descend(s, 1, 0, s->row);
    else {
        scan(s, s->first, s->end);
        s->best = s->first + (s->end - s->first) / 2;
    }
    node->split = s->best;
    node->error = s->most > 0 ? sqrt(s->most) : LATHE_HIERARCHY_LEAST;
}

/* ---- the tree ---- */

static lathe_piece new_node(lathe_piece_tree *tree, lathe_piece_node node) {
    tree->nodes[tree->node_count] = node;
    return tree->node_count++;
}

/* A piece: an edge, or a node that is to be split. */
static lathe_piece new_piece(lathe_piece_tree *tree, uint32_t loop, uint32_t from, uint32_t to) {
    uint32_t end = tree->loops[loop].first + tree->loops[loop].count;
    if ((to > from ? to : end) == from + 1) return LATHE_PIECE_EDGE | from;
    return new_node(
        tree, (lathe_piece_node){.from = from, .to = to, .loop = loop, .child = {LATHE_NO_PIECE, LATHE_NO_PIECE}});
}

static uint32_t farthest_vertex(const lathe_piece_tree *tree, const lathe_loop *loop) {
    chord point = {tree->at[loop->first], tree->at[loop->first]};
    uint32_t best = loop->first + 1;
    double most = -1;
    for (uint32_t v = loop->first + 1; v < loop->first + loop->count; v++) {
        double d = distance2(&point, tree->at[v]);
        if (d > most) most = d, best = v;
    }
    return best;
}

/* The two halves of a loop, and the third vertex that every representation has. */
static lathe_status add_loop(search *s, uint32_t l, uint32_t group) {
    lathe_piece_tree *tree = s->tree;
    const lathe_loop *loop = &tree->loops[l];
    uint32_t far = farthest_vertex(tree, loop);
    lathe_piece half[2];
    double error[2] = {0, 0};
    half[0] = new_piece(tree, l, loop->first, far);
    half[1] = new_piece(tree, l, far, loop->first);
    for (int k = 0; k < 2; k++) {
        tree->nodes[group].child[k] = half[k];
        if (half[k] & LATHE_PIECE_EDGE) continue;
        split_piece(s, &tree->nodes[half[k]]);
        error[k] = tree->nodes[half[k]].error;
    }
    double most = error[0] > error[1] ? error[0] : error[1];
    if (most <= LATHE_HIERARCHY_LEAST) return LATHE_ERR_FORMAT;
    lathe_piece_node *node = &tree->nodes[half[error[1] > error[0]]];
    node->error = INFINITY;
    return LATHE_OK;
}

typedef struct place { uint64_t key; uint32_t loop; } place;

static int by_key(const void *a, const void *b) {
    const place *p = a, *q = b;
    return p->key != q->key ? (p->key > q->key ? 1 : -1) : (p->loop > q->loop) - (p->loop < q->loop);
}

/* Bits of a number with a zero before each. */
static uint64_t spread(uint32_t x) {
    uint64_t v = x;
    v = (v | v << 16) & 0x0000ffff0000ffffu;
    v = (v | v << 8) & 0x00ff00ff00ff00ffu;
    v = (v | v << 4) & 0x0f0f0f0f0f0f0f0fu;
    v = (v | v << 2) & 0x3333333333333333u;
    return (v | v << 1) & 0x5555555555555555u;
}

/* Groups of loops that are near to each other (in Morton order of their lowest points): a balanced tree above them. */
static lathe_status group_loops(search *s, lathe_arena *arena) {
    lathe_piece_tree *tree = s->tree;
    uint32_t count = tree->loop_count;
    typedef struct span { uint32_t first, end; lathe_piece node; } span;
    place *places = LATHE_NEW(arena, place, count);
    span *stack = LATHE_NEW(arena, span, count + 1);
    if (!places || !stack) return LATHE_ERR_MEMORY;
    for (uint32_t l = 0; l < count; l++) {
        lathe_point p = tree->at[tree->loops[l].first];
        places[l] =
            (place){spread((uint32_t)(p.x + MAX_COORDINATE)) | spread((uint32_t)(p.y + MAX_COORDINATE)) << 1, l};
    }
    qsort(places, count, sizeof *places, by_key);
    const lathe_piece_node group = {.group = true, .error = INFINITY};
    uint32_t depth = 0;
    stack[depth++] = (span){0, count, new_node(tree, group)};
    while (depth) {
        span top = stack[--depth];
        if (top.end - top.first == 1) {
            uint32_t l = places[top.first].loop;
            tree->nodes[top.node].loop = l;
            lathe_status status = add_loop(s, l, top.node);
            if (status) return status;
            continue;
        }
        uint32_t middle = top.first + (top.end - top.first) / 2;
        lathe_piece a = new_node(tree, group), b = new_node(tree, group);
        tree->nodes[top.node].child[0] = a;
        tree->nodes[top.node].child[1] = b;
        stack[depth++] = (span){top.first, middle, a};
        stack[depth++] = (span){middle, top.end, b};
    }
    return LATHE_OK;
}

/* Nodes are split in the order in which they were made, so none waits on a stack. */
static void split_all(search *s) {
    lathe_piece_tree *tree = s->tree;
    for (uint32_t i = 0; i < tree->node_count; i++) {
        lathe_piece_node *node = &tree->nodes[i];
        if (node->group) continue;
        if (!(node->error > 0)) split_piece(s, node);
        lathe_piece a = new_piece(tree, node->loop, node->from, node->split);
        lathe_piece b = new_piece(tree, node->loop, node->split, node->to);
        node->child[0] = a;
        node->child[1] = b;
    }
}

static lathe_octangle bound_of(const lathe_piece_tree *tree, lathe_piece piece) {
    if (!(piece & LATHE_PIECE_EDGE)) return tree->nodes[piece].bound;
    return lathe__octangle_of(tree->at[lathe__piece_from(tree, piece)], tree->at[lathe__piece_to(tree, piece)]);
}

static void bound_all(lathe_piece_tree *tree) {
    for (uint32_t i = tree->node_count; i-- > 0;) {
        lathe_octangle other = bound_of(tree, tree->nodes[i].child[1]);
        tree->nodes[i].bound = bound_of(tree, tree->nodes[i].child[0]);
        lathe__octangle_join(&tree->nodes[i].bound, &other);
    }
}

static bool in_range(lathe_point p) {
    return p.x > -MAX_COORDINATE && p.x < MAX_COORDINATE && p.y > -MAX_COORDINATE && p.y < MAX_COORDINATE;
}

/* Copies the points, each loop from its lowest (and of these its leftmost) one on. */
static lathe_status copy_points(lathe_piece_tree *tree, const lathe_outline *outline) {
    for (uint32_t l = 0; l < outline->loop_count; l++) {
        const lathe_loop *loop = &outline->loops[l];
        const lathe_point *points = outline->points + loop->first;
        if (loop->count < 3) return LATHE_ERR_FORMAT;
        uint32_t lowest = 0;
        for (uint32_t i = 0; i < loop->count; i++) {
            if (!in_range(points[i])) return LATHE_ERR_RANGE;
            if (points[i].y < points[lowest].y || (points[i].y == points[lowest].y && points[i].x < points[lowest].x))
                lowest = i;
        }
        tree->rotation[l] = lowest;
        for (uint32_t i = 0; i < loop->count; i++) {
            uint32_t k = lowest + i < loop->count ? lowest + i : lowest + i - loop->count;
            tree->at[loop->first + i] = points[k];
            tree->loop_of[loop->first + i] = l;
        }
    }
    return LATHE_OK;
}

lathe_status lathe__piece_tree_build(lathe_piece_tree *tree, lathe_arena *arena, const lathe_outline *outline) {
    uint32_t n = outline->point_count, loops = outline->loop_count;
    if (n >= 1u << 30) return LATHE_ERR_LIMIT;
    *tree = (lathe_piece_tree){.loops = outline->loops, .point_count = n, .loop_count = loops};
    tree->at = LATHE_NEW(arena, lathe_point, n);
    tree->loop_of = LATHE_NEW(arena, uint32_t, n);
    tree->rotation = LATHE_NEW(arena, uint32_t, loops);
    /* A loop of c points has c - 2 splits and a node that joins its halves; one less than there are loops joins
     * them. */
    tree->nodes = LATHE_NEW(arena, lathe_piece_node, n);
    if (!tree->at || !tree->loop_of || !tree->rotation || !tree->nodes) return LATHE_ERR_MEMORY;
    lathe_status status = copy_points(tree, outline);
    if (status || !loops) return status;
    search s = {.tree = tree};
    status = build_blocks(&s, arena);
    if (!status) status = group_loops(&s, arena);
    if (status) return status;
    split_all(&s);
    bound_all(tree);
    return LATHE_OK;
}

/* ---- nesting ---- */

/* Is an edge above a point crossed by the ray from it to the right? The same for both directions of the edge, so
 * that parities add up whatever lies on what. */
static bool crosses(const lathe_point *at, uint32_t a, uint32_t b, lathe_point p) {
    if ((at[a].y > p.y) == (at[b].y > p.y)) return false;
    return at[a].y > at[b].y ? lathe__orient(at[b], at[a], p) > 0 : lathe__orient(at[a], at[b], p) > 0;
}

/* A point is cut off by a piece if it lies between the piece and its chord. That is so for a piece if an odd number
 * of the following holds: it is cut off by the first child, by the second, it lies in the triangle of the three
 * chords. Only pieces whose octangle holds the point can cut it off. */
static lathe_status mark_for(lathe_piece_tree *tree, uint32_t own, uint8_t *odd, lathe_piece *list, uint64_t *steps,
                             uint64_t most) {
    lathe_point p = tree->at[tree->loops[own].first];
    uint32_t count = 0;
    list[count++] = 0;
    for (uint32_t i = 0; i < count; i++) {
        const lathe_piece_node *node = &tree->nodes[list[i]];
        for (int k = 0; k < 2; k++) {
            lathe_piece child = node->child[k];
            if (child & LATHE_PIECE_EDGE) continue;
            const lathe_piece_node *c = &tree->nodes[child];
            if (!lathe__octangle_holds(&c->bound, p) || (!c->group && c->loop == own)) continue;
            list[count++] = child;
        }
    }
    *steps += count;
    for (uint32_t i = count; i-- > 0;) {
        lathe_piece_node *node = &tree->nodes[list[i]];
        if (node->group) continue;
        bool inside = crosses(tree->at, node->from, node->split, p) ^ crosses(tree->at, node->split, node->to, p) ^
                      crosses(tree->at, node->to, node->from, p);
        for (int k = 0; k < 2; k++)
            if (!(node->child[k] & LATHE_PIECE_EDGE)) inside ^= odd[node->child[k]];
        odd[list[i]] = inside;
        if (inside) node->forced = true;
    }
    for (uint32_t i = 0; i < count; i++) odd[list[i]] = 0;
    return *steps > most ? LATHE_ERR_LIMIT : LATHE_OK;
}

lathe_status lathe__piece_tree_mark(lathe_piece_tree *tree, lathe_arena *arena, uint64_t most, bool *done) {
    uint8_t *odd = LATHE_NEW(arena, uint8_t, tree->node_count);
    lathe_piece *list = LATHE_NEW(arena, lathe_piece, tree->node_count);
    uint64_t steps = 0;
    *done = true;
    if (!odd || !list) return LATHE_ERR_MEMORY;
    memset(odd, 0, tree->node_count);
    for (uint32_t l = 0; l < tree->loop_count && tree->loop_count > 1 && *done; l++)
        *done = !mark_for(tree, l, odd, list, &steps, most);
    return LATHE_OK;
}
