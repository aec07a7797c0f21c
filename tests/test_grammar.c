/* Edge types and the parser: every short cyclic string, every small planar crossing system, the paper's
 * counter-examples, and 20,000 random pixel regions. Each tree is derived again, production by production, by code of
 * the test's own. */
#include "centre.h"
#include "check.h"
#include "pixel_shapes.h"

#define NONE UINT32_MAX
enum { SHAPES = 20000 };

static bool is_out(int t) { return t == LATHE_UP_O || t == LATHE_DOWN_I; }
static bool is_in(int t) { return t == LATHE_UP_I || t == LATHE_DOWN_O; }
static int sum_of(const uint8_t *types, uint32_t count, int type) {
    int sum = 0;
    for (uint32_t i = 0; i < count; i++) sum += types[i] == type;
    return sum;
}

/* ---- the derivation, checked by recursive descent over the tree ---- */
typedef struct derivation {
    const lathe_tree *tree;
    const uint8_t *types;
    uint32_t visited;
    bool ok;
} derivation;

static uint32_t symbol_at(const derivation *d, uint32_t node) {
    return node == NONE || node >= d->tree->node_count ? NONE : d->tree->nodes[node].symbol;
}
/* Checks a leaf at string position `at`; returns its type, or -1. */
static int leaf(derivation *d, uint32_t node, uint32_t at) {
    if (symbol_at(d, node) != LATHE_SYM_LEAF) return d->ok = false, -1;
    const lathe_node *n = &d->tree->nodes[node];
    d->visited++;
    d->ok &= n->first == at && n->count == 1 && n->child == NONE &&
             n->edge == d->types[(d->tree->start + at) % d->tree->edge_count];
    return n->edge;
}
static uint32_t derive_t(derivation *d, uint32_t node, uint32_t at);

/* X -> i | b T f; returns the string position behind it, as all of these do. */
static uint32_t derive_x(derivation *d, uint32_t node, uint32_t at) {
    const lathe_node *n = &d->tree->nodes[node];
    uint32_t begin = at, child = n->child;
    d->visited++;
    int type = leaf(d, child, at++);
    if (!d->ok) return at;
    child = d->tree->nodes[child].next;
    if (type == LATHE_BACK) {
        if (symbol_at(d, child) != LATHE_SYM_T) return d->ok = false, at;
        at = derive_t(d, child, at);
        if (!d->ok) return at;
        child = d->tree->nodes[child].next;
        d->ok &= leaf(d, child, at++) == LATHE_FOR;
        if (!d->ok) return at;
        child = d->tree->nodes[child].next;
    } else
        d->ok &= is_in(type);
    d->ok &= child == NONE && n->first == begin && n->count == at - begin;
    return at;
}
/* T -> X | X o T */
static uint32_t derive_t(derivation *d, uint32_t node, uint32_t at) {
    const lathe_node *n = &d->tree->nodes[node];
    uint32_t begin = at, child = n->child;
    d->visited++;
    if (symbol_at(d, child) != LATHE_SYM_X) return d->ok = false, at;
    at = derive_x(d, child, at);
    if (!d->ok) return at;
    child = d->tree->nodes[child].next;
    if (child != NONE) {
        d->ok &= is_out(leaf(d, child, at++));
        if (!d->ok) return at;
        child = d->tree->nodes[child].next;
        if (symbol_at(d, child) != LATHE_SYM_T) return d->ok = false, at;
        at = derive_t(d, child, at);
        if (!d->ok) return at;
        child = d->tree->nodes[child].next;
    }
    d->ok &= child == NONE && n->first == begin && n->count == at - begin;
    return at;
}
/* E -> nothing | o T */
static uint32_t derive_e(derivation *d, uint32_t node, uint32_t at) {
    const lathe_node *n = &d->tree->nodes[node];
    uint32_t begin = at, child = n->child;
    d->visited++;
    if (child != NONE) {
        d->ok &= is_out(leaf(d, child, at++));
        if (!d->ok) return at;
        child = d->tree->nodes[child].next;
        if (symbol_at(d, child) != LATHE_SYM_T) return d->ok = false, at;
        at = derive_t(d, child, at);
        if (!d->ok) return at;
        child = d->tree->nodes[child].next;
    }
    d->ok &= child == NONE && n->first == begin && n->count == at - begin;
    return at;
}
/* S -> (E f)^rays, all nodes used once, all edges covered. */
static bool derives(const lathe_tree *tree, const uint8_t *types) {
    derivation d = {tree, types, 1, true};
    uint32_t at = 0, child = tree->nodes[0].child;
    if (tree->nodes[0].symbol != LATHE_SYM_S || tree->node_count > 2 * tree->edge_count + 2) return false;
    for (uint32_t i = 0; i < tree->rays; i++) {
        if (symbol_at(&d, child) != LATHE_SYM_E) return false;
        at = derive_e(&d, child, at);
        if (!d.ok || tree->main_edge[i] != at) return false;
        child = tree->nodes[child].next;
        if (leaf(&d, child, at++) != LATHE_FOR || !d.ok) return false;
        child = tree->nodes[child].next;
    }
    return child == NONE && at == tree->edge_count && tree->nodes[0].count == at && d.visited == tree->node_count;
}

/* The i-th main f runs from ray i to the first crossing ever on ray i + 1 since the start: the main chain. */
static bool main_chain_right(const lathe_tree *tree, const lathe_crossing *c, const uint8_t *types) {
    int64_t index = 0, highest = 0;
    uint32_t next = 0;
    if (c[tree->start].ray != 0 || !c[tree->start].in_out) return false;
    for (uint32_t k = 0; k < tree->edge_count; k++) {
        uint8_t type = types[(tree->start + k) % tree->edge_count];
        index += type == LATHE_FOR ? 1 : type == LATHE_BACK ? -1 : 0;
        if (index <= highest) continue;
        highest = index;
        const lathe_crossing *record = &c[(tree->start + k + 1) % tree->edge_count];
        if (next == tree->rays || tree->main_edge[next] != k || record->ray != (uint32_t)index % tree->rays ||
            !record->in_out)
            return false;
        next++;
    }
    return next == tree->rays;
}

/* ---- every cyclic string ---- */

/* Crossings with these types, starting on `ray`; false if they do not close after one turn. */
static bool crossings_of(lathe_crossing *c, const uint8_t *types, uint32_t count, uint32_t ray, uint32_t rays) {
    int index = (int)ray;
    bool inside = types[0] == LATHE_FOR || is_out(types[0]), first = inside;
    for (uint32_t i = 0; i < count; i++) {
        int t = types[i];
        c[i] = (lathe_crossing){0,      (uint32_t)((index % (int)rays + (int)rays) % (int)rays),
                                inside, t == LATHE_UP_O || t == LATHE_UP_I,
                                0,      1};
        if (inside != (t == LATHE_FOR || is_out(t))) return false;
        index += t == LATHE_FOR ? 1 : t == LATHE_BACK ? -1 : 0;
        if (is_out(t)) inside = false;
        if (is_in(t)) inside = true;
    }
    return inside == first && index == (int)(ray + rays);
}

static lathe_status parse(lathe_tree *tree, lathe_arena *arena, const lathe_crossing *c, uint32_t count, uint32_t rays,
                          uint8_t *types) {
    lathe_status status = lathe__classify_edges(types, c, count, rays);
    return status ? status : lathe__parse_contour(tree, arena, c, types, count, rays);
}

/* Each state has two symbols, so a string is a number: all of up to 15 edges that go round once are accepted. */
static void test_all_strings(void) {
    lathe_arena arena = {0};
    int wrong = 0, strings = 0;
    for (uint32_t rays = 3; rays <= 5; rays++)
        for (uint32_t count = rays; count <= 15; count++)
            for (uint32_t code = 0; code < 2u << count; code++) {
                uint8_t types[16], again[16];
                lathe_crossing c[16];
                bool inside = code & 1;
                for (uint32_t i = 0; i < count; i++) {
                    bool turn = code >> (i + 1) & 1;
                    types[i] = inside ? (turn ? LATHE_UP_O : LATHE_FOR) : turn ? LATHE_UP_I : LATHE_BACK;
                    inside ^= turn;
                }
                if (!crossings_of(c, types, count, code % rays, rays)) continue;
                strings++;
                lathe_tree tree;
                wrong += parse(&tree, &arena, c, count, rays, again) != LATHE_OK || memcmp(types, again, count) ||
                         !derives(&tree, types) || !main_chain_right(&tree, c, types);
                lathe__arena_reset(&arena);
            }
    lathe__arena_free(&arena);
    CHECK_EQ(wrong, 0);
    CHECK(strings > 10000);
}

/* ---- every small planar crossing system: rays with odd numbers of points, joined without crossing between
 * neighbouring rays ---- */
enum { MAX_RAYS = 4, MAX_ON_RAY = 5, MAX_POINTS = MAX_RAYS * MAX_ON_RAY };
typedef struct planar {
    uint32_t rays, on_ray[MAX_RAYS];
    int8_t match[MAX_RAYS]
                [2 * MAX_ON_RAY]; /* sector r: points of ray r outermost first, then of ray r + 1 innermost first */
    int tried, wrong, unbalanced;
    lathe_arena arena;
} planar;

/* Follows the curve from ray 0's innermost point; false if it does not pass all points (more than one loop). */
static bool walk_planar(const planar *s, lathe_crossing *c, uint32_t *count) {
    uint32_t ray = 0, rank = 0, total = 0, n = 0;
    int direction = 1; /* into the sector after (1) or before (-1) this ray */
    for (uint32_t r = 0; r < s->rays; r++) total += s->on_ray[r];
    do {
        if (n == total) return false;
        c[n] = (lathe_crossing){0, ray, direction > 0, false, 0, 1};
        uint32_t sector = direction > 0 ? ray : (ray + s->rays - 1) % s->rays, next_ray = (sector + 1) % s->rays,
                 low = s->on_ray[sector];
        uint32_t slot = direction > 0 ? low - 1 - rank : low + rank, other = (uint32_t)s->match[sector][slot];
        uint32_t to_ray = other < low ? sector : next_ray, to_rank = other < low ? low - 1 - other : other - low;
        c[n++].outward = to_rank > rank;
        direction = other < low ? -1 : 1;
        ray = to_ray;
        rank = to_rank;
    } while (ray != 0 || rank != 0);
    *count = n;
    return n == total;
}

static void check_planar(planar *s) {
    lathe_crossing c[MAX_POINTS];
    uint8_t types[MAX_POINTS];
    uint32_t count;
    lathe_tree tree;
    if (!walk_planar(s, c, &count)) return;
    s->tried++;
    if (parse(&tree, &s->arena, c, count, s->rays, types) || !derives(&tree, types) ||
        !main_chain_right(&tree, c, types))
        s->wrong++;
    s->unbalanced += sum_of(types, count, LATHE_UP_O) != sum_of(types, count, LATHE_UP_I);
    s->unbalanced += sum_of(types, count, LATHE_DOWN_O) != sum_of(types, count, LATHE_DOWN_I);
    s->unbalanced += sum_of(types, count, LATHE_FOR) - sum_of(types, count, LATHE_BACK) != (int)s->rays;
    lathe__arena_reset(&s->arena);
}

/* All non-crossing matchings of the slots of a sector, then of the next sector. open: stack of unmatched slots. */
static void match_sector(planar *s, uint32_t sector, int slot, int8_t *open, int open_count) {
    if (sector == s->rays) {
        check_planar(s);
        return;
    }
    int slots = (int)(s->on_ray[sector] + s->on_ray[(sector + 1) % s->rays]);
    if (slot == slots) {
        int8_t fresh[2 * MAX_ON_RAY];
        if (!open_count) match_sector(s, sector + 1, 0, fresh, 0);
        return;
    }
    if (open_count) {
        int8_t partner = open[open_count - 1];
        s->match[sector][slot] = partner;
        s->match[sector][partner] = (int8_t)slot;
        match_sector(s, sector, slot + 1, open, open_count - 1);
        open[open_count - 1] = partner;
    }
    if (open_count < slots - slot) {
        open[open_count] = (int8_t)slot;
        match_sector(s, sector, slot + 1, open, open_count + 1);
    }
}

static void test_planar(void) {
    planar s = {0};
    int8_t open[2 * MAX_ON_RAY];
    for (uint32_t code = 0; code < 81; code++) {
        for (s.rays = 3; s.rays <= 4; s.rays++) {
            uint32_t rest = code, largest = 0;
            for (uint32_t r = 0; r < 4; r++, rest /= 3) {
                s.on_ray[r] = 1 + 2 * (rest % 3);
                if (r < s.rays && s.on_ray[r] > largest) largest = s.on_ray[r];
            }
            if (s.rays == 3 ? code >= 27 : largest > 3) continue;
            match_sector(&s, 0, 0, open, 0);
        }
    }
    lathe__arena_free(&s.arena);
    CHECK_EQ(s.wrong, 0);
    CHECK_EQ(s.unbalanced, 0);
    CHECK(s.tried > 1000);
}

/* ---- the paper's counter-examples, and what must be refused ---- */
static uint32_t types_of(uint8_t *types, const char *text) {
    uint32_t n = 0;
    for (; *text; text++) {
        if (*text == 'f') types[n++] = LATHE_FOR;
        if (*text == 'b') types[n++] = LATHE_BACK;
        if (*text == 'u' || *text == 'd') {
            bool in = text[1] == 'i';
            types[n++] = *text == 'u' ? (in ? LATHE_UP_I : LATHE_UP_O) : in ? LATHE_DOWN_I : LATHE_DOWN_O;
            text++;
        }
    }
    return n;
}

static void test_counter_examples(void) {
    static const char *const strings[] = {"ff di do di b ui uo do ff", /* rejected by the paper's G */
                                          "ff di b do ff",             /* property 4 fails on each single ray */
                                          "ff uo b uo ui",             /* not a contour: ends in the wrong state */
                                          "fff", "ff uo b b ui ff ui"};
    static const bool accepted[] = {true, true, false, true, false};
    lathe_arena arena = {0};
    for (int i = 0; i < 5; i++)
        for (uint32_t ray = 0; ray < 3; ray++) {
            uint8_t types[16], again[16];
            lathe_crossing c[16];
            lathe_tree tree;
            uint32_t count = types_of(types, strings[i]);
            bool closes = crossings_of(c, types, count, ray, 3);
            CHECK_EQ(closes, accepted[i]);
            lathe_status status = lathe__parse_contour(&tree, &arena, c, types, count, 3);
            CHECK_EQ(status, accepted[i] ? LATHE_OK : LATHE_ERR_FORMAT);
            if (!accepted[i]) continue;
            CHECK_EQ(lathe__classify_edges(again, c, count, 3), LATHE_OK);
            CHECK(!memcmp(types, again, count));
            CHECK(derives(&tree, types));
        }
    lathe__arena_free(&arena);
}

/* Random bytes as types: refused or parsed, never more; what is parsed derives. */
static void test_hostile(void) {
    lathe_arena arena = {0};
    uint64_t seed = 5;
    int accepted = 0, wrong = 0;
    for (int i = 0; i < 300000; i++) {
        uint8_t types[24];
        lathe_crossing c[24] = {{0}};
        uint32_t count = (uint32_t)shape_below(&seed, 24), rays = 3 + (uint32_t)shape_below(&seed, 3);
        for (uint32_t k = 0; k < count; k++)
            types[k] = (uint8_t)(shape_below(&seed, 3) ? LATHE_FOR : shape_below(&seed, i & 1 ? 7 : 6));
        c[0].ray = (uint32_t)shape_below(&seed, 6);
        lathe_tree tree;
        lathe_status status = lathe__parse_contour(&tree, &arena, c, types, count, rays);
        wrong += status != LATHE_OK && status != LATHE_ERR_FORMAT;
        if (status == LATHE_OK) accepted++, wrong += !derives(&tree, types);
        lathe__arena_reset(&arena);
    }
    CHECK_EQ(wrong, 0);
    CHECK(accepted > 100);
    lathe_crossing far[3] = {{0, 0, true, false, 0, 1}, {0, 2, true, false, 0, 1}, {0, 4, true, false, 0, 1}};
    uint8_t types[3] = {LATHE_FOR, LATHE_FOR, LATHE_FOR};
    lathe_tree tree;
    CHECK_EQ(lathe__classify_edges(types, far, 3, 8), LATHE_ERR_RANGE);
    CHECK_EQ(lathe__parse_contour(&tree, &arena, far, types, 0, 8), LATHE_ERR_FORMAT);
    CHECK_EQ(lathe__parse_contour(&tree, &arena, far, types, 3, 2), LATHE_ERR_RANGE);
    lathe__arena_free(&arena);
}

/* ---- real contours ---- */
typedef struct failures {
    int status, property1, property2, balance, derivation, chain, star, hole;
} failures;

/* FOR and BACK are separated by an odd number of UP and DOWN edges; #f - #b = rays. */
static void check_properties(failures *f, const uint8_t *types, uint32_t count, uint32_t rays) {
    int last = -1, between = 0;
    for (uint32_t i = 0; i < 2 * count; i++) {
        int t = types[i % count];
        if (t != LATHE_FOR && t != LATHE_BACK) {
            between++;
            continue;
        }
        if (last >= 0) f->property1 += (between % 2 == 1) != (last != t);
        last = t;
        between = 0;
    }
    f->property2 += sum_of(types, count, LATHE_FOR) - sum_of(types, count, LATHE_BACK) != (int)rays;
    f->balance += sum_of(types, count, LATHE_UP_O) != sum_of(types, count, LATHE_UP_I);
    f->balance += sum_of(types, count, LATHE_DOWN_O) != sum_of(types, count, LATHE_DOWN_I);
}

/* Record crossings, one on each ray and off the centre, turn counter-clockwise round it: star-shaped, hence simple. */
static void check_star(failures *f, const lathe_tree *tree, const lathe_crossing *c, const shape_loop *loop,
                       lathe_point o) {
    double x0 = 0, y0 = 0;
    for (uint32_t i = 0; i <= tree->rays; i++) {
        const lathe_crossing *r = &c[(tree->start + tree->main_edge[i % tree->rays] + 1) % tree->edge_count];
        lathe_point p = loop->points[r->segment], q = loop->points[(r->segment + 1) % loop->count];
        double t = (double)r->numerator / (double)r->denominator, x = p.x - o.x + t * (q.x - p.x),
               y = p.y - o.y + t * (q.y - p.y);
        f->star += r->ray != (i + 1) % tree->rays || x * x + y * y <= 0;
        if (i) f->star += tree->rays > 4 && x0 * y - y0 * x <= 0;
        x0 = x;
        y0 = y;
    }
}

/* The same loop walked as a hole has no contour; reversed by the caller it has. */
static void check_hole(failures *f, lathe_arena *arena, shape_loop *loop, lathe_point o, uint32_t rays) {
    static uint8_t types[1 << 16];
    for (uint32_t i = 0, j = loop->count - 1; i < j; i++, j--) {
        lathe_point swap = loop->points[i];
        loop->points[i] = loop->points[j];
        loop->points[j] = swap;
    }
    lathe_crossing *c;
    lathe_tree tree;
    uint32_t count;
    f->status += lathe__cast_rays(&c, &count, arena, loop->points, loop->count, o, rays) != LATHE_OK;
    f->hole += parse(&tree, arena, c, count, rays, types) != LATHE_ERR_FORMAT;
}

static void test_shapes(void) {
    static shape s;
    static shape_loop loop;
    static uint8_t types[1 << 16];
    lathe_arena arena = {0};
    uint64_t seed = 77;
    failures f = {0};
    long folds = 0;
    for (int i = 0; i < SHAPES; i++) {
        shape_make(&s, &seed, i);
        shape_trace(&loop, &s, &seed, i & 4);
        uint32_t rays = 8u << shape_below(&seed, 5), count;
        lathe_point o;
        lathe_crossing *c;
        lathe_tree tree;
        f.status += lathe__loop_centre(&o, &arena, loop.points, loop.count) != LATHE_OK;
        f.status += lathe__cast_rays(&c, &count, &arena, loop.points, loop.count, o, rays) != LATHE_OK;
        if (parse(&tree, &arena, c, count, rays, types) != LATHE_OK)
            f.status++;
        else {
            check_properties(&f, types, count, rays);
            f.derivation += !derives(&tree, types);
            f.chain += !main_chain_right(&tree, c, types);
            check_star(&f, &tree, c, &loop, o);
            folds += count - rays;
        }
        if (i % 8 == 0) check_hole(&f, &arena, &loop, o, rays);
        lathe__arena_reset(&arena);
    }
    lathe__arena_free(&arena);
    CHECK_EQ(f.status, 0);
    CHECK_EQ(f.property1, 0);
    CHECK_EQ(f.property2, 0);
    CHECK_EQ(f.balance, 0);
    CHECK_EQ(f.derivation, 0);
    CHECK_EQ(f.chain, 0);
    CHECK_EQ(f.star, 0);
    CHECK_EQ(f.hole, 0);
    CHECK(folds > 100000);
}

int main(void) {
    test_all_strings();
    test_planar();
    test_counter_examples();
    test_hostile();
    test_shapes();
    return check_end();
}
