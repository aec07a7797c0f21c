/* Derivation trees (see derivation.h): choosing the level-1 edges, cutting folds in two, building nodes. */
#include "derivation.h"

#define NONE UINT32_MAX
enum { MASK_D = 1, MASK_U = 2 };
static const uint32_t MAX_EDGES = UINT32_MAX / 8;

/* One contour while its tree is made. Folds are indexed by ray: what lies between level-1 edge i - 1 and level-1 edge
 * i. */
typedef struct side {
    const lathe_ray_contour *contour;
    uint32_t *chain; /* level-1 edge of ray pair (i, i + 1) */
    uint32_t *split; /* per fold: the edge where its D part begins */
    uint8_t *mask;   /* per fold: which pure pairs it has */
    uint64_t work;
} side;

static uint32_t next_edge(const lathe_ray_contour *c, uint32_t edge) { return edge + 1 < c->count ? edge + 1 : 0; }
/* Whether an element leads outward. Rounded radii may be equal where the crossings are not: a single edge has its
 * type. */
static bool further_out(const lathe_ray_contour *c, uint32_t from, uint32_t to) {
    if (next_edge(c, from) == to) return c->types[from] == LATHE_UP_O || c->types[from] == LATHE_UP_I;
    return c->radius[to] > c->radius[from];
}

/* ---- ambiguous case 1: one FOR edge for each ray pair, in walking order, near the neighbour's ---- */

static int64_t edge_gap(const lathe_ray_contour *a, uint32_t e, const lathe_ray_contour *b, uint32_t f) {
    return lathe__point_gap(a->points[e], b->points[f]) +
           lathe__point_gap(a->points[next_edge(a, e)], b->points[next_edge(b, f)]);
}

/* A ray pair with the fewest FOR edges: where it has one only, every chain passes it. */
static uint32_t anchor_ray(const lathe_ray_contour *c, uint32_t *counts) {
    uint32_t best = 0;
    for (uint32_t i = 0; i < c->rays; i++) counts[i] = 0;
    for (uint32_t e = 0; e < c->count; e++)
        if (c->types[e] == LATHE_FOR) counts[c->crossings[e].ray]++;
    for (uint32_t i = 1; i < c->rays; i++)
        if (counts[i] < counts[best]) best = i;
    return best;
}
static uint32_t nearest_edge(const lathe_ray_contour *c, uint32_t ray, const lathe_ray_contour *other,
                             uint32_t target) {
    uint32_t best = NONE;
    int64_t least = INT64_MAX;
    for (uint32_t e = 0; e < c->count; e++) {
        if (c->types[e] != LATHE_FOR || c->crossings[e].ray != ray) continue;
        int64_t gap = edge_gap(c, e, other, target);
        if (gap >= least) continue;
        least = gap;
        best = e;
    }
    return best;
}

/* The best chain through the anchor in one walk round the contour: of each unwrapped level only the cheapest way to
 * reach it so far is kept. A way is always found: from the anchor's end the walk passes every level before it comes
 * round. */
static lathe_status choose_chain(side *s, lathe_arena *arena, const side *other) {
    const lathe_ray_contour *c = s->contour;
    if (c->count == c->rays) return LATHE_OK;
    uint32_t rays = c->rays, *reached = LATHE_NEW(arena, uint32_t, rays),
             *before = LATHE_NEW(arena, uint32_t, c->count);
    int64_t *cost = LATHE_NEW(arena, int64_t, rays);
    if (!reached || !before || !cost) return LATHE_ERR_MEMORY;
    uint32_t first_ray = anchor_ray(c, reached),
             anchor = nearest_edge(c, first_ray, other->contour, other->chain[first_ray]);
    if (anchor == NONE) return LATHE_ERR_FORMAT;
    for (uint32_t i = 0; i < rays; i++) reached[i] = NONE;
    reached[0] = anchor;
    cost[0] = 0;
    int64_t level = 1;
    for (uint32_t e = next_edge(c, anchor); e != anchor; e = next_edge(c, e)) {
        if (c->types[e] == LATHE_BACK) level--;
        if (c->types[e] != LATHE_FOR) continue;
        uint32_t ray = c->crossings[e].ray, j = (uint32_t)level;
        if (level >= 1 && level < rays && reached[j - 1] != NONE) {
            int64_t sum = cost[j - 1] + edge_gap(c, e, other->contour, other->chain[ray]);
            before[e] = reached[j - 1];
            if (reached[j] == NONE || sum < cost[j]) reached[j] = e, cost[j] = sum;
        }
        level++;
    }
    s->work += 3 * (uint64_t)c->count;
    uint32_t e = reached[rays - 1];
    for (uint32_t j = rays; j-- > 0; e = j ? before[e] : e) {
        if (e == NONE) return LATHE_ERR_FORMAT;
        s->chain[c->crossings[e].ray] = e;
    }
    return LATHE_OK;
}

/* ---- ambiguous case 3: where a fold is cut into U and D ---- */

/* The end of the piece of a walk that begins at this edge: the edge behind it, where the walk is back at its level. */
static uint32_t piece_end(side *s, uint32_t edge) {
    const lathe_ray_contour *c = s->contour;
    int64_t level = 0;
    do {
        uint8_t type = c->types[edge];
        level += type == LATHE_FOR ? 1 : type == LATHE_BACK ? -1 : 0;
        edge = next_edge(c, edge);
        s->work++;
    } while (level);
    return edge;
}
static uint8_t direction(const lathe_ray_contour *c, uint32_t from, uint32_t to) {
    return further_out(c, from, to) ? MASK_U : MASK_D;
}

static uint32_t fold_begin(const side *s, uint32_t ray) {
    return next_edge(s->contour, s->chain[ray ? ray - 1 : s->contour->rays - 1]);
}

/* O, I, O, I ... from the end of one level-1 edge to the next: which pure pairs there are. */
static void scan_fold(side *s, uint32_t ray) {
    s->mask[ray] = 0;
    for (uint32_t e = fold_begin(s, ray), end = s->chain[ray]; e != end;) {
        uint32_t middle = piece_end(s, e), behind = piece_end(s, middle);
        uint8_t out = direction(s->contour, e, middle);
        if (out == direction(s->contour, middle, behind)) s->mask[ray] |= out;
        e = behind;
    }
}

/* A pair's symbol: what both elements are; of a mixed pair the neighbour's, else its first's. */
static bool pair_is_up(bool first_up, bool second_up, uint8_t wanted) {
    return first_up == second_up || wanted == 0 || wanted == (MASK_D | MASK_U) ? first_up : wanted == MASK_U;
}

static void settle_split(side *s, const side *other, uint32_t ray) {
    uint8_t wanted = other ? other->mask[ray] : 0;
    uint32_t e = fold_begin(s, ray), end = s->chain[ray];
    s->split[ray] = wanted == MASK_U ? end : e;
    if (s->mask[ray] & wanted && wanted != (MASK_D | MASK_U)) return;
    s->split[ray] = e;
    while (e != end) {
        uint32_t middle = piece_end(s, e), behind = piece_end(s, middle);
        if (!pair_is_up(further_out(s->contour, e, middle), further_out(s->contour, middle, behind), wanted)) return;
        s->split[ray] = e = behind;
    }
}

/* ---- nodes ---- */

/* While a node is open, `next` is its parent and `count` its last child: no stack is needed. */
typedef struct builder {
    lathe_derivation tree;
    const lathe_ray_contour *contour;
    uint32_t top, position;
    uint8_t wanted; /* which symbol a mixed pair takes: the neighbour's, or 0 */
} builder;

static uint32_t append(builder *b, uint8_t symbol, uint8_t edge) {
    lathe_derivation_node *nodes = b->tree.nodes;
    uint32_t index = b->tree.node_count++;
    nodes[index] = (lathe_derivation_node){symbol, edge, b->position, 1, NONE, NONE};
    if (b->top != NONE) {
        lathe_derivation_node *parent = &nodes[b->top];
        if (parent->child == NONE)
            parent->child = index;
        else
            nodes[parent->count].next = index;
        parent->count = index;
    }
    return index;
}
static void open_node(builder *b, uint8_t symbol) {
    uint32_t index = append(b, symbol, LATHE_FOR);
    b->tree.nodes[index].next = b->top;
    b->tree.nodes[index].count = NONE;
    b->top = index;
}
static void close_node(builder *b) {
    lathe_derivation_node *node = &b->tree.nodes[b->top];
    b->top = node->next;
    node->next = NONE;
    node->count = b->position - node->first;
}
static uint32_t edge_at(const builder *b, uint32_t position) {
    uint32_t e = b->tree.start + position;
    return e < b->contour->count ? e : e - b->contour->count;
}
static void take_leaf(builder *b) {
    append(b, LATHE_DER_LEAF, b->contour->types[edge_at(b, b->position)]);
    b->position++;
}

static bool is_o(uint8_t symbol) { return symbol == LATHE_DER_D_I || symbol == LATHE_DER_U_O; }
static bool is_i(uint8_t symbol) { return symbol == LATHE_DER_D_O || symbol == LATHE_DER_U_I; }
static bool is_pair(uint8_t symbol) { return symbol == LATHE_DER_D || symbol == LATHE_DER_U; }
static bool is_r(uint8_t symbol) { return symbol == LATHE_DER_D_R || symbol == LATHE_DER_U_R; }
static bool is_up(uint8_t symbol) {
    return symbol == LATHE_DER_U_O || symbol == LATHE_DER_U_I || symbol == LATHE_DER_U || symbol == LATHE_DER_U_R;
}
static uint8_t top_symbol(const builder *b) { return b->tree.nodes[b->top].symbol; }

static void close_group(builder *b, bool in_fold) {
    lathe_derivation_node *group = &b->tree.nodes[b->top];
    const lathe_derivation_node *first = &b->tree.nodes[group->child], *second = &b->tree.nodes[group->count];
    bool up = pair_is_up(is_up(first->symbol), is_up(second->symbol), in_fold ? b->wanted : 0);
    if (is_r(group->symbol))
        group->symbol = up ? LATHE_DER_U_R : LATHE_DER_D_R;
    else
        group->symbol = up ? LATHE_DER_U : LATHE_DER_D;
    close_node(b);
}
/* An O inside an excursion f ... b follows an I, or is its first element; everywhere else it begins a pair. */
static void open_o(builder *b) {
    if (!is_o(top_symbol(b)) && !is_r(top_symbol(b))) open_node(b, LATHE_DER_D);
    open_node(b, LATHE_DER_D_I);
}
static void open_i(builder *b) {
    if (is_o(top_symbol(b))) open_node(b, LATHE_DER_D_R);
    open_node(b, LATHE_DER_D_O);
}
static void close_element(builder *b, uint32_t pairs_parent) {
    lathe_derivation_node *node = &b->tree.nodes[b->top];
    bool o = is_o(node->symbol), up = further_out(b->contour, edge_at(b, node->first), edge_at(b, b->position));
    node->symbol = o ? (up ? LATHE_DER_U_O : LATHE_DER_D_I) : up ? LATHE_DER_U_I : LATHE_DER_D_O;
    close_node(b);
    if (o ? is_r(top_symbol(b)) : is_pair(top_symbol(b)) && b->top != pairs_parent)
        close_group(b, b->tree.nodes[b->top].next == pairs_parent);
}

/* One edge of a fold whose pairs are children of pairs_parent; inside: at an IN-OUT crossing. */
static void take_fold_edge(builder *b, bool *inside, uint32_t pairs_parent) {
    uint8_t type = b->contour->types[edge_at(b, b->position)];
    bool crosses = type == LATHE_FOR || type == LATHE_BACK;
    if (crosses && b->top != pairs_parent && (*inside ? is_i(top_symbol(b)) : is_o(top_symbol(b)))) {
        take_leaf(b);
        close_element(b, pairs_parent);
        return;
    }
    if (*inside)
        open_o(b);
    else
        open_i(b);
    take_leaf(b);
    if (crosses) return;
    close_element(b, pairs_parent);
    *inside = !*inside;
}

/* The part of a fold up to edge `end`: nothing, one pair, or a node over several. */
static void build_part(builder *b, side *s, uint32_t end, uint8_t symbol) {
    uint32_t begin = edge_at(b, b->position);
    if (begin == end) return;
    bool several = piece_end(s, piece_end(s, begin)) != end, inside = true;
    if (several) open_node(b, symbol);
    uint32_t pairs_parent = b->top;
    do take_fold_edge(b, &inside, pairs_parent);
    while (edge_at(b, b->position) != end);
    if (several) close_node(b);
}

static lathe_status build_tree(lathe_derivation *out, lathe_arena *arena, side *s, const side *other) {
    const lathe_ray_contour *c = s->contour;
    builder b = {.contour = c, .top = NONE, .tree = {.rays = c->rays, .edge_count = c->count}};
    lathe_derivation *t = &b.tree;
    t->nodes = LATHE_NEW(arena, lathe_derivation_node, 3 * (size_t)c->count + 2);
    t->level1 = LATHE_NEW(arena, uint32_t, c->rays);
    t->main_edge = LATHE_NEW(arena, uint32_t, c->rays);
    if (!t->nodes || !t->level1 || !t->main_edge) return LATHE_ERR_MEMORY;
    for (uint32_t i = 0; i < c->rays; i++) settle_split(s, other, i);
    t->start = s->split[0];
    open_node(&b, LATHE_DER_S);
    for (uint32_t i = 0; i < c->rays; i++) {
        uint32_t next = i + 1 < c->rays ? i + 1 : 0;
        t->level1[i] = t->node_count;
        open_node(&b, LATHE_DER_F);
        b.wanted = other ? other->mask[i] : 0;
        build_part(&b, s, s->chain[i], LATHE_DER_D);
        t->main_edge[i] = b.position++;
        b.wanted = other ? other->mask[next] : 0;
        build_part(&b, s, s->split[next], LATHE_DER_U);
        close_node(&b);
    }
    close_node(&b);
    s->work += c->count;
    t->work = s->work;
    *out = b.tree;
    return LATHE_OK;
}

/* ---- all of it ---- */

/* One FOR edge for each ray pair and nothing else: once round, and no choice. */
static bool is_star(const lathe_ray_contour *c) {
    if (c->count != c->rays) return false;
    for (uint32_t e = 0; e < c->count; e++)
        if (c->types[e] != LATHE_FOR) return false;
    return true;
}
/* Begins with the record chain, which is there for every contour. */
static lathe_status begin_side(side *s, lathe_arena *arena, const lathe_ray_contour *c) {
    if (c->count > MAX_EDGES) return LATHE_ERR_RANGE;
    *s = (side){.contour = c, .work = 3 * (uint64_t)c->count};
    s->chain = LATHE_NEW(arena, uint32_t, c->rays);
    s->split = LATHE_NEW(arena, uint32_t, c->rays);
    s->mask = LATHE_NEW(arena, uint8_t, c->rays);
    if (!s->chain || !s->split || !s->mask) return LATHE_ERR_MEMORY;
    if (is_star(c)) {
        for (uint32_t e = 0; e < c->count; e++) s->chain[c->crossings[e].ray] = e;
        return LATHE_OK;
    }
    lathe_tree records;
    lathe_status status = lathe__parse_contour(&records, arena, c->crossings, c->types, c->count, c->rays);
    if (status) return status;
    for (uint32_t i = 0; i < c->rays; i++) s->chain[i] = (records.start + records.main_edge[i]) % c->count;
    return LATHE_OK;
}
static void scan_folds(side *s) {
    for (uint32_t i = 0; i < s->contour->rays; i++) scan_fold(s, i);
}

lathe_status lathe__derive_alone(lathe_derivation *out, lathe_arena *arena, const lathe_ray_contour *contour) {
    side s;
    lathe_status status = begin_side(&s, arena, contour);
    if (status) return status;
    scan_folds(&s);
    return build_tree(out, arena, &s, NULL);
}

lathe_status lathe__derive_chain(lathe_derivation *out, lathe_arena *arena, const lathe_ray_contour *contour,
                                 const uint32_t *chain) {
    side s = {.contour = contour,
              .chain = LATHE_NEW(arena, uint32_t, contour->rays),
              .split = LATHE_NEW(arena, uint32_t, contour->rays),
              .mask = LATHE_NEW(arena, uint8_t, contour->rays)};
    if (!s.chain || !s.split || !s.mask) return LATHE_ERR_MEMORY;
    for (uint32_t i = 0; i < contour->rays; i++) s.chain[i] = chain[i];
    scan_folds(&s);
    return build_tree(out, arena, &s, NULL);
}

lathe_status lathe__derive_pair(lathe_derivation *right, lathe_derivation *left, lathe_arena *arena,
                                const lathe_ray_contour *a, const lathe_ray_contour *b) {
    if (a->rays != b->rays) return LATHE_ERR_RANGE;
    side sa, sb;
    lathe_status status = begin_side(&sa, arena, a);
    if (!status) status = begin_side(&sb, arena, b);
    if (!status) status = choose_chain(&sa, arena, &sb);
    if (!status) status = choose_chain(&sb, arena, &sa);
    if (!status) status = choose_chain(&sa, arena, &sb);
    if (status) return status;
    scan_folds(&sa);
    scan_folds(&sb);
    status = build_tree(right, arena, &sa, &sb);
    return status ? status : build_tree(left, arena, &sb, &sa);
}

const char *lathe__derivation_symbol_name(uint8_t symbol) {
    static const char *const names[] = {"S", "F", "D", "U", "D_R", "U_R", "D_I", "U_O", "D_O", "U_I", "leaf"};
    return symbol < sizeof names / sizeof names[0] ? names[symbol] : "?";
}
