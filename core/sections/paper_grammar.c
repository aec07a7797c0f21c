/* The paper's grammar by a chart (see paper_grammar.h). Productions of three symbols go through a symbol of their own
 * for the first two. */
#include "paper_grammar.h"

#define NONE UINT32_MAX
enum {
    F = LATHE_PAPER_F,
    B = LATHE_PAPER_B,
    D = LATHE_PAPER_D,
    DI = LATHE_PAPER_D_I,
    DO = LATHE_PAPER_D_O,
    DR = LATHE_PAPER_D_R,
    U = LATHE_PAPER_U,
    UI = LATHE_PAPER_U_I,
    UO = LATHE_PAPER_U_O,
    UR = LATHE_PAPER_U_R,
    D_F = LATHE_PAPER_U_R + 1,
    F_DI,
    B_DO,
    B_UI,
    F_UO, /* the first two of three */
    NO_SYMBOL = 255
};
typedef struct rule {
    uint8_t production, left, right[3], joined;
    unsigned option;
} rule;
static const rule rules[] = {
    {2, F, {D, F, U}, D_F, 0},
    {2, F, {D, F, NO_SYMBOL}, 0, 0},
    {2, F, {F, U, NO_SYMBOL}, 0, 0},
    {2, F, {F, F, NO_SYMBOL}, 0, LATHE_PAPER_REFINED},
    {2, F, {F, D, NO_SYMBOL}, 0, LATHE_PAPER_F_D},
    {3, B, {B, B, NO_SYMBOL}, 0, LATHE_PAPER_REFINED},
    {4, D, {D, D, NO_SYMBOL}, 0, 0},
    {4, D, {D, U, NO_SYMBOL}, 0, 0},
    {4, D, {U, D, NO_SYMBOL}, 0, 0},
    {4, D, {DI, DO, NO_SYMBOL}, 0, 0},
    {5, DI, {F, DI, B}, F_DI, 0},
    {5, DI, {DI, UR, NO_SYMBOL}, 0, 0},
    {6, DO, {B, DO, F}, B_DO, 0},
    {6, DO, {DO, U, NO_SYMBOL}, 0, 0},
    {7, U, {U, U, NO_SYMBOL}, 0, 0},
    {7, U, {D, U, NO_SYMBOL}, 0, 0},
    {7, U, {U, D, NO_SYMBOL}, 0, 0},
    {7, U, {UO, UI, NO_SYMBOL}, 0, 0},
    {8, UI, {B, UI, F}, B_UI, 0},
    {8, UI, {UI, D, NO_SYMBOL}, 0, 0},
    {9, UO, {F, UO, B}, F_UO, 0},
    {9, UO, {UO, DR, NO_SYMBOL}, 0, 0},
    {10, DR, {DO, DI, NO_SYMBOL}, 0, 0},
    {11, UR, {UI, UO, NO_SYMBOL}, 0, 0},
};
enum { RULES = sizeof rules / sizeof rules[0] };
/* By lathe_edge_type: the symbol that derives it, and the production. */
static const uint8_t terminal[6] = {F, B, UI, UO, DI, DO}, terminal_production[6] = {2, 3, 8, 9, 5, 6};

static void add_product(lathe_paper_grammar *g, uint8_t left, uint8_t right, uint8_t result) {
    uint32_t half = right >> 3, bit = right & 7;
    for (uint32_t set = 0; set < 256; set++)
        if (set >> bit & 1) g->product[left][half][set] |= (uint16_t)(1u << result);
}
void lathe__paper_grammar_make(lathe_paper_grammar *out, unsigned options) {
    *out = (lathe_paper_grammar){.options = options};
    for (uint32_t i = 0; i < RULES; i++) {
        const rule *r = &rules[i];
        if (r->option & ~options) continue;
        if (r->right[2] == NO_SYMBOL) {
            add_product(out, r->right[0], r->right[1], r->left);
            continue;
        }
        add_product(out, r->right[0], r->right[1], r->joined);
        add_product(out, r->joined, r->right[2], r->left);
    }
}

static uint16_t product(const lathe_paper_grammar *g, uint16_t left, uint16_t right) {
    uint32_t result = 0;
    for (uint32_t rest = left; rest; rest &= rest - 1) {
        uint32_t symbol = (uint32_t)__builtin_ctz(rest);
        result |= g->product[symbol][0][right & 255] | (uint32_t)g->product[symbol][1][right >> 8];
    }
    return (uint16_t)result;
}
static uint16_t cell(const lathe_paper_chart *c, uint32_t start, uint32_t length) {
    if (start >= c->count) start -= c->count;
    return c->cells[(size_t)(length - 1) * c->count + start];
}

lathe_status lathe__paper_chart_make(lathe_paper_chart *out, lathe_arena *arena, const lathe_paper_grammar *grammar,
                                     const uint8_t *types, uint32_t count) {
    if (count > LATHE_PAPER_MAX_EDGES) return LATHE_ERR_LIMIT;
    if (!count) return LATHE_ERR_RANGE;
    lathe_paper_chart c = {grammar, types, count, LATHE_NEW(arena, uint16_t, (size_t)count * count)};
    if (!c.cells) return LATHE_ERR_MEMORY;
    for (uint32_t i = 0; i < count; i++) {
        if (types[i] > LATHE_DOWN_O) return LATHE_ERR_RANGE;
        c.cells[i] = (uint16_t)(1u << terminal[types[i]]);
    }
    for (uint32_t length = 2; length <= count; length++)
        for (uint32_t start = 0; start < count; start++) {
            uint16_t set = 0;
            for (uint32_t k = 1; k < length; k++) {
                uint16_t left = cell(&c, start, k), right = cell(&c, start + k, length - k);
                if (left && right) set |= product(grammar, left, right);
            }
            c.cells[(size_t)(length - 1) * count + start] = set;
        }
    *out = c;
    return LATHE_OK;
}

bool lathe__paper_derives(const lathe_paper_chart *chart, lathe_paper_symbol symbol, uint32_t start, uint32_t length) {
    if (start >= chart->count || !length || length > chart->count || symbol > LATHE_PAPER_U_R) return false;
    return cell(chart, start, length) >> symbol & 1;
}

/* ---- S -> F ... F: with how many F a prefix can be had, as a set of numbers 0 .. rays ---- */
static uint32_t words_of(uint32_t rays) { return rays / 64 + 1; }
static void fill_prefixes(uint64_t *sets, const lathe_paper_chart *c, uint32_t start, uint32_t rays) {
    uint32_t words = words_of(rays);
    for (size_t i = 0; i < (size_t)(c->count + 1) * words; i++) sets[i] = 0;
    sets[0] = 1;
    for (uint32_t at = 0; at < c->count; at++) {
        const uint64_t *here = sets + (size_t)at * words;
        bool any = false;
        for (uint32_t w = 0; w < words; w++) any |= here[w] != 0;
        for (uint32_t length = 1; any && at + length <= c->count; length++) {
            if (!(cell(c, start + at, length) >> F & 1)) continue;
            uint64_t *there = sets + (size_t)(at + length) * words;
            for (uint32_t w = words; w-- > 0;) there[w] |= here[w] << 1 | (w ? here[w - 1] >> 63 : 0);
        }
    }
}
static bool has_number(const uint64_t *sets, uint32_t rays, uint32_t at, uint32_t number) {
    return sets[(size_t)at * words_of(rays) + number / 64] >> (number % 64) & 1;
}

lathe_status lathe__paper_accepts(uint32_t *starts, bool *from, lathe_arena *scratch, const lathe_paper_chart *chart,
                                  uint32_t rays) {
    uint32_t found = 0;
    if (rays <= chart->count) {
        uint64_t *sets = LATHE_NEW(scratch, uint64_t, (size_t)(chart->count + 1) * words_of(rays));
        if (!sets) return LATHE_ERR_MEMORY;
        for (uint32_t start = 0; start < chart->count; start++) {
            fill_prefixes(sets, chart, start, rays);
            bool accepted = has_number(sets, rays, chart->count, rays);
            if (from) from[start] = accepted;
            found += accepted;
        }
    } else
        for (uint32_t start = 0; from && start < chart->count; start++) from[start] = false;
    *starts = found;
    return LATHE_OK;
}

/* ---- trees: at most 400 deep, so recursion will do ---- */
static uint32_t new_node(lathe_paper_tree *t, uint8_t symbol, uint8_t production, uint32_t first, uint32_t count) {
    t->nodes[t->node_count] = (lathe_paper_node){symbol, 0, production, first, count, NONE, NONE};
    return t->node_count++;
}
static uint32_t derive(lathe_paper_tree *t, const lathe_paper_chart *c, uint8_t symbol, uint32_t start,
                       uint32_t length);

/* Shortest first: where (start, length) = left right. NONE if it is not. */
static uint32_t find_cut(const lathe_paper_chart *c, uint8_t left, uint8_t right, uint32_t start, uint32_t length) {
    for (uint32_t k = 1; k < length; k++)
        if (cell(c, start, k) >> left & 1 && cell(c, start + k, length - k) >> right & 1) return k;
    return NONE;
}
static bool apply(lathe_paper_tree *t, const lathe_paper_chart *c, const rule *r, uint32_t node, uint32_t start,
                  uint32_t length) {
    bool three = r->right[2] != NO_SYMBOL;
    uint32_t cut = find_cut(c, three ? r->joined : r->right[0], three ? r->right[2] : r->right[1], start, length);
    if (cut == NONE) return false;
    uint32_t first_cut = three ? find_cut(c, r->right[0], r->right[1], start, cut) : cut;
    t->nodes[node].production = r->production;
    uint32_t child = derive(t, c, r->right[0], start, first_cut);
    t->nodes[node].child = child;
    if (three) {
        uint32_t middle = derive(t, c, r->right[1], start + first_cut, cut - first_cut);
        t->nodes[child].next = middle;
        child = middle;
    }
    uint32_t last = derive(t, c, three ? r->right[2] : r->right[1], start + cut, length - cut);
    t->nodes[child].next = last;
    return true;
}
static uint32_t derive(lathe_paper_tree *t, const lathe_paper_chart *c, uint8_t symbol, uint32_t start,
                       uint32_t length) {
    if (start >= c->count) start -= c->count;
    uint32_t node = new_node(t, symbol, 0, start, length);
    if (length == 1) {
        uint8_t type = c->types[start];
        t->nodes[node].production = terminal_production[type];
        uint32_t leaf = new_node(t, LATHE_PAPER_LEAF, 0, start, 1);
        t->nodes[leaf].edge = type;
        t->nodes[node].child = leaf;
        return node;
    }
    for (uint32_t i = 0; i < RULES; i++)
        if (rules[i].left == symbol && !(rules[i].option & ~c->grammar->options) &&
            apply(t, c, &rules[i], node, start, length))
            break;
    return node;
}

/* From the end: the shortest F that leaves one F less before it. */
static lathe_status derive_start(lathe_paper_tree *t, lathe_arena *arena, const lathe_paper_chart *c, uint32_t start,
                                 uint32_t rays) {
    uint64_t *sets = LATHE_NEW(arena, uint64_t, (size_t)(c->count + 1) * words_of(rays));
    uint32_t *ends = LATHE_NEW(arena, uint32_t, (size_t)rays + 1);
    if (!sets || !ends) return LATHE_ERR_MEMORY;
    fill_prefixes(sets, c, start, rays);
    if (!has_number(sets, rays, c->count, rays)) return LATHE_ERR_FORMAT;
    ends[rays] = c->count;
    for (uint32_t k = rays; k-- > 0;) {
        uint32_t at = ends[k + 1] - 1;
        while (!has_number(sets, rays, at, k) || !(cell(c, start + at, ends[k + 1] - at) >> F & 1)) at--;
        ends[k] = at;
    }
    uint32_t root = new_node(t, LATHE_PAPER_S, 1, start, c->count), before = NONE;
    for (uint32_t k = 0; k < rays; k++) {
        uint32_t child = derive(t, c, F, start + ends[k], ends[k + 1] - ends[k]);
        if (before == NONE)
            t->nodes[root].child = child;
        else
            t->nodes[before].next = child;
        before = child;
    }
    return LATHE_OK;
}

lathe_status lathe__paper_tree_make(lathe_paper_tree *out, lathe_arena *arena, const lathe_paper_chart *chart,
                                    lathe_paper_symbol symbol, uint32_t start, uint32_t length, uint32_t rays) {
    /* Two nodes an edge, and each inner node has two children or more. */
    lathe_paper_tree t = {0, LATHE_NEW(arena, lathe_paper_node, 3 * (size_t)chart->count + 1)};
    if (!t.nodes) return LATHE_ERR_MEMORY;
    if (symbol == LATHE_PAPER_S) {
        if (start >= chart->count || length != chart->count || !rays || rays > chart->count) return LATHE_ERR_FORMAT;
        lathe_status status = derive_start(&t, arena, chart, start, rays);
        if (status) return status;
    } else {
        if (!lathe__paper_derives(chart, symbol, start, length)) return LATHE_ERR_FORMAT;
        derive(&t, chart, (uint8_t)symbol, start, length);
    }
    *out = t;
    return LATHE_OK;
}
