/* Walking two trees: every edge once, equal contours edge by edge, known small cases, and the same path as a plain
 * recursion over the trees' links, on all pairs of short strings and 20,000 pairs of random pixel regions. */
#include "centre.h"
#include "check.h"
#include "pixel_shapes.h"

#define NONE UINT32_MAX
enum { PAIRS = 20000, ROOM = 1 << 16 };

/* ---- the specification as a recursion ---- */
typedef struct spec {
    const lathe_tree *a, *b;
    uint8_t steps[2 * ROOM];
    uint32_t count;
} spec;

static const lathe_node *node_of(const lathe_tree *t, uint32_t n) { return &t->nodes[n]; }
static uint32_t sibling(const lathe_tree *t, uint32_t n) { return n == NONE ? NONE : t->nodes[n].next; }

static void alone(spec *s, uint32_t edges, uint8_t step) {
    while (edges--) s->steps[s->count++] = step;
}
static void spec_leaves(spec *s, uint32_t a, uint32_t b) {
    if (node_of(s->a, a)->edge == node_of(s->b, b)->edge)
        alone(s, 1, 3);
    else
        alone(s, 1, 1), alone(s, 1, 2);
}
static bool nested(const lathe_tree *t, uint32_t x) { return node_of(t, node_of(t, x)->child)->edge == LATHE_BACK; }
static uint32_t inner_t(const lathe_tree *t, uint32_t x) { return sibling(t, node_of(t, x)->child); }
static void spec_t(spec *s, uint32_t a, uint32_t b);

/* X against X; an i against b T f goes on with the first X of T. */
static void spec_x(spec *s, uint32_t a, uint32_t b) {
    bool na = nested(s->a, a), nb = nested(s->b, b);
    if (!na && !nb)
        spec_leaves(s, node_of(s->a, a)->child, node_of(s->b, b)->child);
    else if (na && nb) {
        alone(s, 1, 3);
        spec_t(s, inner_t(s->a, a), inner_t(s->b, b));
        alone(s, 1, 3);
    } else if (na) {
        uint32_t t = inner_t(s->a, a), x = node_of(s->a, t)->child;
        alone(s, 1, 1);
        spec_x(s, x, b);
        alone(s, node_of(s->a, t)->count - node_of(s->a, x)->count + 1, 1);
    } else {
        uint32_t t = inner_t(s->b, b), x = node_of(s->b, t)->child;
        alone(s, 1, 2);
        spec_x(s, a, x);
        alone(s, node_of(s->b, t)->count - node_of(s->b, x)->count + 1, 2);
    }
}
static void spec_t(spec *s, uint32_t a, uint32_t b) {
    uint32_t xa = node_of(s->a, a)->child, xb = node_of(s->b, b)->child, oa = sibling(s->a, xa), ob = sibling(s->b, xb);
    spec_x(s, xa, xb);
    if (oa != NONE && ob != NONE) {
        spec_leaves(s, oa, ob);
        spec_t(s, sibling(s->a, oa), sibling(s->b, ob));
    } else {
        alone(s, node_of(s->a, a)->count - node_of(s->a, xa)->count, 1);
        alone(s, node_of(s->b, b)->count - node_of(s->b, xb)->count, 2);
    }
}
static void spec_walk(spec *s) {
    uint32_t a = node_of(s->a, 0)->child, b = node_of(s->b, 0)->child;
    s->count = 0;
    while (a != NONE) {
        uint32_t oa = node_of(s->a, a)->child, ob = node_of(s->b, b)->child;
        if (oa != NONE && ob != NONE) {
            spec_leaves(s, oa, ob);
            spec_t(s, sibling(s->a, oa), sibling(s->b, ob));
        } else
            alone(s, node_of(s->a, a)->count, 1), alone(s, node_of(s->b, b)->count, 2);
        alone(s, 1, 3);
        a = sibling(s->a, sibling(s->a, a));
        b = sibling(s->b, sibling(s->b, b));
    }
}

/* ---- checks of a path ---- */
typedef struct failures {
    int status, edges, types, spec, equal;
} failures;
typedef struct contour {
    lathe_crossing *crossings;
    uint8_t types[ROOM];
    uint32_t count;
    lathe_tree tree;
} contour;

/* Every edge once and in order; corresponding edges have one type. */
static void check_path(failures *f, const contour *a, const contour *b, const uint8_t *steps, uint32_t count) {
    uint32_t na = 0, nb = 0;
    for (uint32_t k = 0; k < count; k++) {
        if (steps[k] == 3)
            f->types += na < a->count && nb < b->count &&
                        a->types[(a->tree.start + na) % a->count] != b->types[(b->tree.start + nb) % b->count];
        na += steps[k] & 1;
        nb += steps[k] >> 1 & 1;
        f->edges += steps[k] < 1 || steps[k] > 3;
    }
    f->edges += na != a->count || nb != b->count;
}
static void check_pair(failures *f, const contour *a, const contour *b) {
    static uint8_t steps[2 * ROOM];
    static spec s;
    uint32_t count = 0;
    f->status += lathe__walk_trees(steps, &count, &a->tree, &b->tree) != LATHE_OK;
    check_path(f, a, b, steps, count);
    s.a = &a->tree;
    s.b = &b->tree;
    spec_walk(&s);
    f->spec += s.count != count || memcmp(s.steps, steps, count);
    f->status += lathe__walk_trees(steps, &count, &a->tree, &a->tree) != LATHE_OK;
    f->equal += count != a->count;
    for (uint32_t k = 0; k < count; k++) f->equal += steps[k] != 3;
}
static void report(const failures *f) {
    CHECK_EQ(f->status, 0);
    CHECK_EQ(f->edges, 0);
    CHECK_EQ(f->types, 0);
    CHECK_EQ(f->spec, 0);
    CHECK_EQ(f->equal, 0);
}

/* ---- strings ---- */
static void make_string(contour *c, lathe_arena *arena, const char *text, uint32_t rays) {
    c->count = 0;
    for (; *text; text++) {
        uint8_t type = LATHE_FOR;
        if (*text == ' ') continue;
        if (*text == 'b') type = LATHE_BACK;
        if (*text == 'u')
            type = *++text == 'i' ? LATHE_UP_I : LATHE_UP_O;
        else if (*text == 'd')
            type = *++text == 'i' ? LATHE_DOWN_I : LATHE_DOWN_O;
        c->types[c->count++] = type;
    }
    lathe_crossing first = {0};
    CHECK_EQ(lathe__parse_contour(&c->tree, arena, &first, c->types, c->count, rays), LATHE_OK);
}

static void test_known_paths(void) {
    static const struct {
        const char *a, *b;
        uint8_t steps[12];
    } cases[] = {
        {"fff", "fff", {3, 3, 3}},
        {"f uo ui ff", "fff", {3, 1, 1, 3, 3}},
        {"fff", "f uo ui ff", {3, 2, 2, 3, 3}},
        {"f uo ui ff", "f uo ui ff", {3, 3, 3, 3, 3}},
        {"f uo ui ff", "f di do ff", {3, 1, 2, 1, 2, 3, 3}},
        {"f uo ui ff", "f uo b ui fff", {3, 3, 2, 3, 2, 3, 3}},    /* i against b i f */
        {"f uo ui uo ui ff", "f uo ui ff", {3, 3, 3, 1, 1, 3, 3}}, /* the rest of a fold */
        {"f f di b do ff", "f f di b do ff", {3, 3, 3, 3, 3, 3, 3}},
        {"f uo b ui f uo ui ff", "f uo b ui uo ui f ff", {3, 3, 3, 3, 2, 2, 3, 1, 1, 3, 3}},
    };
    static contour a, b;
    lathe_arena arena = {0};
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        uint8_t steps[40];
        uint32_t count, expected = 0;
        make_string(&a, &arena, cases[i].a, 3);
        make_string(&b, &arena, cases[i].b, 3);
        while (expected < 12 && cases[i].steps[expected]) expected++;
        /* The strings begin at a crossing on ray 0, and so does every tree: at its record. */
        CHECK_EQ(lathe__walk_trees(steps, &count, &a.tree, &b.tree), LATHE_OK);
        CHECK_EQ(count, expected);
        CHECK(!memcmp(steps, cases[i].steps, expected));
    }
    make_string(&a, &arena, "fff", 3);
    make_string(&b, &arena, "ffff", 4);
    uint32_t count;
    uint8_t steps[8];
    CHECK_EQ(lathe__walk_trees(steps, &count, &a.tree, &b.tree), LATHE_ERR_RANGE);
    lathe__arena_free(&arena);
}

/* All pairs of the strings of 3 rays with up to 11 edges (UP only: types then differ by symbol alone). */
static void test_all_pairs(void) {
    enum { MOST = 400 };
    static contour all[MOST];
    lathe_arena arena = {0};
    failures f = {0};
    uint32_t used = 0;
    for (uint32_t count = 3; count <= 11; count++)
        for (uint32_t code = 0; code < 1u << count && used < MOST; code++) {
            contour *c = &all[used];
            bool inside = true;
            for (uint32_t i = 0; i < count; i++) {
                bool turn = code >> i & 1;
                c->types[i] = inside ? (turn ? LATHE_UP_O : LATHE_FOR) : turn ? LATHE_UP_I : LATHE_BACK;
                inside ^= turn;
            }
            lathe_crossing first = {0};
            c->count = count;
            if (!inside || lathe__parse_contour(&c->tree, &arena, &first, c->types, count, 3)) continue;
            used += c->tree.start == 0;
        }
    for (uint32_t i = 0; i < used; i++)
        for (uint32_t k = 0; k < used; k++) check_pair(&f, &all[i], &all[k]);
    CHECK(used > 100);
    report(&f);
    lathe__arena_free(&arena);
}

/* ---- regions ---- */
static void cast(failures *f, contour *c, lathe_arena *arena, const shape_loop *loop, uint32_t rays) {
    lathe_point o;
    f->status += lathe__loop_centre(&o, arena, loop->points, loop->count) != LATHE_OK;
    f->status += lathe__cast_rays(&c->crossings, &c->count, arena, loop->points, loop->count, o, rays) != LATHE_OK;
    f->status += lathe__classify_edges(c->types, c->crossings, c->count, rays) != LATHE_OK;
    f->status += lathe__parse_contour(&c->tree, arena, c->crossings, c->types, c->count, rays) != LATHE_OK;
}
/* A neighbouring slice: some border pixels gained or lost. */
static void vary(shape *s, uint64_t *seed) {
    shape old = *s;
    for (int y = 1; y < SHAPE_SIZE - 1; y++)
        for (int x = 1; x < SHAPE_SIZE - 1; x++) {
            int around = old.at[y][x + 1] + old.at[y][x - 1] + old.at[y + 1][x] + old.at[y - 1][x];
            if (around > 0 && around < 4 && shape_below(seed, 8) == 0) s->at[y][x] ^= 1;
        }
    shape_keep_one(s);
}

static void test_shapes(void) {
    static shape s;
    static shape_loop loop;
    static contour a, b;
    lathe_arena arena = {0};
    uint64_t seed = 11;
    failures f = {0};
    for (int i = 0; i < PAIRS; i++) {
        uint32_t rays = 8u << shape_below(&seed, 4);
        shape_make(&s, &seed, i);
        shape_trace(&loop, &s, &seed, i & 4);
        cast(&f, &a, &arena, &loop, rays);
        if (i & 8)
            vary(&s, &seed);
        else
            shape_make(&s, &seed, i / 16);
        shape_trace(&loop, &s, &seed, i & 4);
        cast(&f, &b, &arena, &loop, rays);
        check_pair(&f, &a, &b);
        lathe__arena_reset(&arena);
    }
    lathe__arena_free(&arena);
    report(&f);
}

/* A fold a hundred thousand deep: no recursion in parser or walk. */
static void test_deep(void) {
    enum { DEPTH = 100000, COUNT = 2 * DEPTH + 5 };
    uint8_t *types = malloc(COUNT), *steps = malloc(2 * COUNT);
    lathe_arena arena = {0};
    lathe_crossing first = {0};
    lathe_tree deep, flat;
    uint32_t n = 0, count = 0;
    uint8_t circle[3] = {LATHE_FOR, LATHE_FOR, LATHE_FOR};
    if (types && steps) {
        types[n++] = LATHE_UP_O;
        for (int i = 0; i < DEPTH; i++) types[n++] = LATHE_BACK;
        types[n++] = LATHE_UP_I;
        for (int i = 0; i < DEPTH + 3; i++) types[n++] = LATHE_FOR;
        CHECK_EQ(n, COUNT);
        CHECK_EQ(lathe__parse_contour(&deep, &arena, &first, types, n, 3), LATHE_OK);
        CHECK_EQ(lathe__parse_contour(&flat, &arena, &first, circle, 3, 3), LATHE_OK);
        CHECK_EQ(lathe__walk_trees(steps, &count, &deep, &deep), LATHE_OK);
        CHECK_EQ(count, COUNT);
        CHECK_EQ(lathe__walk_trees(steps, &count, &flat, &deep), LATHE_OK);
        CHECK_EQ(count, COUNT);
    }
    lathe__arena_free(&arena);
    free(types);
    free(steps);
}

int main(void) {
    test_known_paths();
    test_all_pairs();
    test_shapes();
    test_deep();
    return check_end();
}
