/* Min-Lee's tiling: the right tree of one contour walked together with the left tree of its neighbour [M 4.1, 4.5].
 *
 * The level-1 edges of a ray pair correspond. On each ray the two folds are lists of elements O, I, O, I ... (both
 * parts together: which of them case 3 calls D or U does not matter here); elements of one symbol may correspond, in
 * order, the nearest first of all (ambiguous case 2). Two corresponding excursions have corresponding first and last
 * edges and are lists again; an excursion against a single edge is searched for that edge (4.5 C). What remains
 * unmatched keeps one vertex of the other contour: first the run of a, on the end of its last correspondence, then the
 * run of b [4.1].
 *
 * Two lists, the shorter of at most ALIGN elements, are matched at best: as many elements as possible, then the least
 * sum of distances, in ALIGN steps an element. Longer lists are matched greedily with a look ahead of one pair. All
 * else is linear. Work is kept on a stack of its own: folds can be as deep as a contour is long. */
#include "derivation.h"

#define NONE UINT32_MAX
enum { ALIGN = 16, STEP_BOTH = 3 };
typedef enum task_kind { TAKE_A, TAKE_B, MATCH, LISTS } task_kind;
typedef struct task {
    uint8_t kind;
    uint32_t a, b;
} task; /* TAKE: a edges; MATCH, LISTS: two elements */
typedef struct score {
    uint32_t matched;
    int64_t gap;
} score;

/* One contour: its tree and the list that is being matched. */
typedef struct reader {
    const lathe_ray_contour *contour;
    const lathe_derivation *tree;
    uint32_t *list, count;
} reader;
typedef struct walk {
    reader a, b;
    uint8_t *steps, *choice; /* choice: (ALIGN + 1) rows */
    score *row[2];
    uint32_t step_count, task_count;
    task *tasks;
    uint64_t work;
} walk;

static const lathe_derivation_node *node_of(const reader *r, uint32_t index) { return &r->tree->nodes[index]; }
static bool is_element(uint8_t symbol) { return symbol >= LATHE_DER_D_I && symbol <= LATHE_DER_U_I; }

/* Elements among the children, those of groups included. Groups are nested twice at most: a part, its pairs. */
static void collect(reader *r, uint32_t parent) {
    for (uint32_t i = node_of(r, parent)->child; i != NONE; i = node_of(r, i)->next) {
        uint8_t symbol = node_of(r, i)->symbol;
        if (is_element(symbol))
            r->list[r->count++] = i;
        else if (symbol != LATHE_DER_LEAF)
            collect(r, i);
    }
}
/* The fold on a ray: the U part of the level-1 node before, the D part of the one behind. */
static void collect_fold(reader *r, uint32_t ray) {
    const lathe_derivation *t = r->tree;
    uint32_t before = ray ? ray - 1 : t->rays - 1;
    r->count = 0;
    for (uint32_t pass = 0; pass < 2; pass++) {
        uint32_t level1 = pass ? ray : before, main_edge = t->main_edge[level1];
        for (uint32_t i = node_of(r, t->level1[level1])->child; i != NONE; i = node_of(r, i)->next) {
            bool is_d_part = node_of(r, i)->first < main_edge;
            if (is_d_part != (pass == 1)) continue;
            collect(r, i);
        }
    }
}

static lathe_point point_at(const reader *r, uint32_t position) {
    uint32_t i = r->tree->start + position;
    while (i >= r->contour->count) i -= r->contour->count;
    return r->contour->points[i];
}
static int64_t element_gap(const walk *w, uint32_t a, uint32_t b) {
    const lathe_derivation_node *p = node_of(&w->a, a), *q = node_of(&w->b, b);
    return lathe__point_gap(point_at(&w->a, p->first), point_at(&w->b, q->first)) +
           lathe__point_gap(point_at(&w->a, p->first + p->count), point_at(&w->b, q->first + q->count));
}
static bool homogeneous(const walk *w, uint32_t a, uint32_t b) {
    return node_of(&w->a, a)->symbol == node_of(&w->b, b)->symbol;
}

/* ---- tasks; the last pushed is done first ---- */
static void push(walk *w, task_kind kind, uint32_t a, uint32_t b) {
    w->tasks[w->task_count++] = (task){(uint8_t)kind, a, b};
}
static void push_runs(walk *w, uint32_t run[2]) {
    if (run[1]) push(w, TAKE_B, run[1], 0);
    if (run[0]) push(w, TAKE_A, run[0], 0);
    run[0] = run[1] = 0;
}

/* ---- matching two lists ---- */

static bool better(score x, score y) { return x.matched != y.matched ? x.matched > y.matched : x.gap < y.gap; }

/* choice of cell (k, j): what ends the best matching of k elements of the shorter and j of the longer list. */
enum { SKIP_SHORT, SKIP_LONG, PAIR };
static void align(walk *w, bool a_is_short) {
    reader *shorter = a_is_short ? &w->a : &w->b, *longer = a_is_short ? &w->b : &w->a;
    uint32_t m = shorter->count, n = longer->count, width = n + 1;
    for (uint32_t j = 0; j <= n; j++) w->row[0][j] = (score){0, 0}, w->choice[j] = SKIP_LONG;
    for (uint32_t k = 1; k <= m; k++) {
        score *row = w->row[k & 1], *above = w->row[(k - 1) & 1];
        uint8_t *choice = w->choice + (size_t)k * width;
        row[0] = above[0];
        choice[0] = SKIP_SHORT;
        for (uint32_t j = 1; j <= n; j++) {
            uint32_t s = shorter->list[k - 1], l = longer->list[j - 1], a = a_is_short ? s : l, b = a_is_short ? l : s;
            row[j] = row[j - 1];
            choice[j] = SKIP_LONG;
            if (better(above[j], row[j])) row[j] = above[j], choice[j] = SKIP_SHORT;
            if (!homogeneous(w, a, b)) continue;
            score both = {above[j - 1].matched + 1, above[j - 1].gap + element_gap(w, a, b)};
            if (better(both, row[j])) row[j] = both, choice[j] = PAIR;
        }
    }
    w->work += (uint64_t)(m + 1) * width;
    uint32_t run[2] = {0, 0}, k = m, j = n;
    while (k || j) {
        uint8_t choice = w->choice[(size_t)k * width + j];
        if (choice == PAIR) {
            uint32_t s = shorter->list[--k], l = longer->list[--j];
            push_runs(w, run);
            push(w, MATCH, a_is_short ? s : l, a_is_short ? l : s);
        } else if (choice == SKIP_SHORT)
            run[!a_is_short] += node_of(shorter, shorter->list[--k])->count;
        else
            run[a_is_short] += node_of(longer, longer->list[--j])->count;
    }
    push_runs(w, run);
}

/* Whether the longer of the two rests had better skip a pair of elements. */
static bool skip_pair(const walk *w, uint32_t i, uint32_t j, bool in_a) {
    if (in_a ? w->a.count - i < w->b.count - j + 2 : w->b.count - j < w->a.count - i + 2) return false;
    uint32_t a = w->a.list[i], b = w->b.list[j], later_a = w->a.list[in_a ? i + 2 : i],
             later_b = w->b.list[in_a ? j : j + 2];
    return homogeneous(w, later_a, later_b) && element_gap(w, later_a, later_b) < element_gap(w, a, b);
}
static void match_greedily(walk *w) {
    uint32_t begin = w->task_count, i = 0, j = 0, run[2] = {0, 0};
    while (i < w->a.count && j < w->b.count) {
        uint32_t a = w->a.list[i], b = w->b.list[j];
        bool same = homogeneous(w, a, b);
        w->work++;
        if (same && !skip_pair(w, i, j, true) && !skip_pair(w, i, j, false)) {
            if (run[0]) push(w, TAKE_A, run[0], 0);
            if (run[1]) push(w, TAKE_B, run[1], 0);
            run[0] = run[1] = 0;
            push(w, MATCH, a, b);
            i++, j++;
        } else if (w->a.count - i >= w->b.count - j) {
            run[0] += node_of(&w->a, a)->count, i++;
            if (!same && w->a.count - i < w->b.count - j) run[1] += node_of(&w->b, b)->count, j++;
        } else
            run[1] += node_of(&w->b, b)->count, j++;
    }
    for (; i < w->a.count; i++) run[0] += node_of(&w->a, w->a.list[i])->count;
    for (; j < w->b.count; j++) run[1] += node_of(&w->b, w->b.list[j])->count;
    if (run[0]) push(w, TAKE_A, run[0], 0);
    if (run[1]) push(w, TAKE_B, run[1], 0);
    for (uint32_t low = begin, high = w->task_count; low + 1 < high; low++) {
        task swap = w->tasks[low];
        w->tasks[low] = w->tasks[--high];
        w->tasks[high] = swap;
    }
}
static void match_lists(walk *w) {
    uint32_t least = w->a.count < w->b.count ? w->a.count : w->b.count;
    if (least <= ALIGN)
        align(w, w->a.count <= w->b.count);
    else
        match_greedily(w);
}

/* ---- steps ---- */

static void emit(walk *w, uint8_t step, uint32_t times) {
    while (times--) w->steps[w->step_count++] = step;
}
/* A single edge is a list of itself. */
static void collect_inside(reader *r, uint32_t element) {
    r->count = 0;
    if (node_of(r, element)->count == 1)
        r->list[r->count++] = element;
    else
        collect(r, element);
}
/* Two elements of one symbol. */
static void match_elements(walk *w, uint32_t a, uint32_t b) {
    bool single_a = node_of(&w->a, a)->count == 1, single_b = node_of(&w->b, b)->count == 1;
    if (single_a && single_b) {
        emit(w, STEP_BOTH, 1);
        return;
    }
    if (single_a || single_b) {
        uint32_t alone[2] = {single_a ? 0 : 1, single_b ? 0 : 1};
        push_runs(w, alone);
        push(w, LISTS, a, b);
        emit(w, single_a ? 2 : 1, 1);
        return;
    }
    push(w, MATCH, NONE, NONE);
    push(w, LISTS, a, b);
    emit(w, STEP_BOTH, 1);
}
static void run_tasks(walk *w) {
    while (w->task_count) {
        task t = w->tasks[--w->task_count];
        w->work++;
        switch ((task_kind)t.kind) {
        case TAKE_A: emit(w, 1, t.a); break;
        case TAKE_B: emit(w, 2, t.a); break;
        case MATCH:
            if (t.a == NONE)
                emit(w, STEP_BOTH, 1);
            else
                match_elements(w, t.a, t.b);
            break;
        case LISTS:
            collect_inside(&w->a, t.a);
            collect_inside(&w->b, t.b);
            w->work += w->a.count + w->b.count;
            match_lists(w);
            break;
        }
    }
}

static lathe_status prepare(walk *w, lathe_arena *arena) {
    size_t a = w->a.contour->count, b = w->b.contour->count, most = a > b ? a : b;
    w->a.list = LATHE_NEW(arena, uint32_t, a + 1);
    w->b.list = LATHE_NEW(arena, uint32_t, b + 1);
    w->steps = LATHE_NEW(arena, uint8_t, a + b);
    w->choice = LATHE_NEW(arena, uint8_t, (ALIGN + 1) * (most + 1));
    w->row[0] = LATHE_NEW(arena, score, most + 1);
    w->row[1] = LATHE_NEW(arena, score, most + 1);
    /* Each task stands for edges or an element of its own, or comes with one that does. */
    w->tasks = LATHE_NEW(arena, task, 4 * (a + b) + 4);
    return w->a.list && w->b.list && w->steps && w->choice && w->row[0] && w->row[1] && w->tasks ? LATHE_OK
                                                                                                 : LATHE_ERR_MEMORY;
}

static uint32_t end_of_edge(const reader *r, uint32_t position) {
    return (uint32_t)(((uint64_t)r->tree->start + position + 1) % r->contour->count);
}

lathe_status lathe__walk_derivations(lathe_tiling *out, uint64_t *work, lathe_arena *arena, const lathe_ray_contour *a,
                                     const lathe_derivation *right, const lathe_ray_contour *b,
                                     const lathe_derivation *left) {
    if (right->rays != left->rays) return LATHE_ERR_RANGE;
    walk w = {.a = {.contour = a, .tree = right}, .b = {.contour = b, .tree = left}};
    lathe_status status = prepare(&w, arena);
    if (status) return status;
    for (uint32_t i = 0; i < right->rays; i++) {
        collect_fold(&w.a, i);
        collect_fold(&w.b, i);
        w.work += w.a.count + w.b.count + 1;
        match_lists(&w);
        run_tasks(&w);
        emit(&w, STEP_BOTH, 1);
    }
    uint32_t last = right->rays - 1;
    *out =
        (lathe_tiling){.start = {end_of_edge(&w.a, right->main_edge[last]), end_of_edge(&w.b, left->main_edge[last])},
                       .count = w.step_count,
                       .steps = w.steps};
    if (work) *work = w.work;
    return LATHE_OK;
}

lathe_status lathe__tile_trees(lathe_tiling *out, lathe_arena *arena, const lathe_ray_contour *a,
                               const lathe_ray_contour *b) {
    lathe_derivation right, left;
    lathe_status status = lathe__derive_pair(&right, &left, arena, a, b);
    return status ? status : lathe__walk_derivations(out, NULL, arena, a, &right, b, &left);
}
