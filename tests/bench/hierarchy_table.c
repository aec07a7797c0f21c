/* Prints Ho, Kim & Kim's table 1 with our figures beside theirs, and what cross-links save. One Markdown section on stdout. */
#include "hierarchy.h"
#include "section_shapes.h"
#include <time.h>

enum { ONE = LATHE_LATTICE_ONE, MEASURED = 10000, MOST = 1000000 };

static double seconds(void) {
    struct timespec t;
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
    return (double)t.tv_sec + (double)t.tv_nsec * 1e-9;
}
static void must(bool fine, const char *what) {
    if (fine) return;
    fprintf(stderr, "hierarchy_table: %s\n", what);
    exit(1);
}
static bool is_simple(const lathe_outline *o, uint64_t *tests);

/* ---- table 1 ---- */

static drawing draw_country(int height) { return draw_coast(height * 6 / 10, height, 24, 0.62); }

typedef struct row { const char *name, *ours; drawing (*draw)(int height); uint32_t paper[3]; } row;
static const row ROWS[] = {{"Korean map", "a coast: thresholded fractal noise", draw_country, {319, 279, 272}},
                           {"scorpion", "drawn", draw_scorpion, {297, 265, 237}},
                           {"bird", "drawn", draw_bird, {122, 106, 94}},
                           {"spider", "drawn", draw_spider, {246, 206, 202}},
                           {"spiral", "a band of 4 turns", NULL, {153, 105, 62}}, {"spiral", "a band of 6 turns", NULL, {153, 105, 62}}};

/* The drawing whose longest loop has about as many plain representations as the paper's. */
static lathe_outline shape_of(const row *r, lathe_arena *arena) {
    if (!r->draw) {
        lathe_outline o = section_outline(arena, 400, 1);
        section_spiral(&o, (int)(r->paper[0] + 2) / 2, strchr(r->ours, '6') ? 6 : 4, 10 * ONE, 3 * ONE, 0, ONE);
        return o;
    }
    for (int height = 14;; height++) {
        drawing d = r->draw(height);
        lathe_outline o = draw_trace(&d, arena, true);
        if (o.point_count >= r->paper[0] + 2) return o;
        must(height < 400, "no drawing is large enough");
    }
}

static void print_counts(void) {
    printf("### Table 1: how many outlines the tolerance can choose from\n\n"
           "The paper's shapes are not published; ours are of their kinds, with about as many points. A drawing is traced along its\n"
           "pixels (vertices moved by up to 1/8 pixel), the longest loop taken. Plain: distinct errors of Douglas-Peucker's splits.\n"
           "Natural: no child's attribute above its parent's. Resolved: no outline crosses itself; each of them has been checked\n"
           "pair by pair. Children too: the same if the children of pieces that are expanded early inherit as well, as RESOLVE_TREE has\n"
           "it in print; ours need not, and keep more. In brackets the paper's figures; %%: share of the plain ones.\n\n"
           "| shape | ours | points | plain (paper) | natural (paper) | resolved | children too | (paper) |\n"
           "| --- | --- | ---: | ---: | ---: | ---: | ---: | ---: |\n");
    for (size_t i = 0; i < sizeof ROWS / sizeof *ROWS; i++) {
        lathe_arena arena = {0}, scratch = {0};
        const row *r = &ROWS[i];
        lathe_outline o = shape_of(r, &arena);
        lathe_hierarchy h;
        must(!lathe__hierarchy_build(&h, &arena, &o), "a shape is not simple");
        for (uint32_t k = 0; k < h.tolerance_count; k++) {
            lathe_outline at;
            uint64_t tests = 0;
            must(!lathe__hierarchy_outline(&at, &scratch, &h, h.tolerances[k]) && is_simple(&at, &tests), "an outline crosses itself");
            lathe__arena_reset(&scratch);
        }
        const lathe_hierarchy_counts *c = &h.counts;
        printf("| %s | %s | %u | %u (%u) | %u, %.0f %% (%u, %.0f %%) | %u, %.0f %% | %u, %.0f %% | (%u, %.0f %%) |\n", r->name, r->ours, o.point_count, c->plain,
               r->paper[0], c->adjusted, 100.0 * c->adjusted / c->plain, r->paper[1], 100.0 * r->paper[1] / r->paper[0], c->resolved,
               100.0 * c->resolved / c->plain, c->printed, 100.0 * c->printed / c->plain, r->paper[2], 100.0 * r->paper[2] / r->paper[0]);
        lathe__arena_free(&arena);
        lathe__arena_free(&scratch);
    }
}

/* ---- cost ---- */

static bool edges_cross(lathe_point a, lathe_point b, lathe_point c, lathe_point d) {
    int64_t s = lathe__orient(a, b, c), t = lathe__orient(a, b, d), u = lathe__orient(c, d, a), v = lathe__orient(c, d, b);
    return ((s > 0 && t < 0) || (s < 0 && t > 0)) && ((u > 0 && v < 0) || (u < 0 && v > 0));
}
static bool is_simple(const lathe_outline *o, uint64_t *tests) {
    uint32_t n = o->point_count;
    for (uint32_t i = 0; i < n; i++)
        for (uint32_t k = i + 1; k < n; k++, ++*tests)
            if (edges_cross(o->points[i], o->points[(i + 1) % n], o->points[k], o->points[(k + 1) % n])) return false;
    return true;
}

/* The vertices that go, the last to go first. */
static const double *sorted_by;
static int later(const void *a, const void *b) {
    double x = sorted_by[*(const uint32_t *)a], y = sorted_by[*(const uint32_t *)b];
    return (x < y) - (x > y);
}

/* The same sequence of outlines, each new edge tested against every edge there is: what it costs without octangles. Within a round
 * edges may cross; *crossings is there so that no test is optimised away. */
static uint64_t test_all_pairs(const lathe_outline *o, uint32_t *at, uint32_t kept, const uint32_t *order, uint64_t *crossings) {
    uint64_t tests = 0;
    for (uint32_t i = 0; kept < o->point_count; i++) {
        uint32_t place = kept++;
        for (; place && at[place - 1] > order[i]; place--) at[place] = at[place - 1];
        at[place] = order[i];
        lathe_point m = o->points[order[i]], a = o->points[at[(place + kept - 1) % kept]], b = o->points[at[(place + 1) % kept]];
        for (uint32_t k = 0; k < kept; k++) {
            lathe_point c = o->points[at[k]], d = o->points[at[k + 1 < kept ? k + 1 : 0]];
            *crossings += edges_cross(a, m, c, d);
            *crossings += edges_cross(m, b, c, d);
        }
        tests += 2 * (uint64_t)kept;
    }
    return tests;
}

static uint64_t time_all_pairs(const lathe_outline *o, const lathe_hierarchy *h, double *time) {
    uint32_t n = o->point_count, kept = 0, count = 0;
    uint32_t *at = section_memory(malloc(n * sizeof *at)), *order = section_memory(malloc(n * sizeof *order));
    for (uint32_t v = 0; v < n; v++) {
        if (h->attribute[v] == INFINITY) at[kept++] = v;
        else order[count++] = v;
    }
    sorted_by = h->attribute;
    qsort(order, count, sizeof *order, later);
    uint64_t crossings = 0;
    double start = seconds();
    uint64_t tests = test_all_pairs(o, at, kept, order, &crossings);
    *time = seconds() - start;
    must(crossings < tests, "no pair was tested");
    free(at);
    free(order);
    return tests;
}

static void print_row(const char *name, const lathe_outline *o, double per_square[2]) {
    lathe_arena arena = {0};
    lathe_hierarchy h;
    double start = seconds();
    must(!lathe__hierarchy_build(&h, &arena, o), "a shape is not simple");
    double time = seconds() - start, square = (double)o->point_count * o->point_count;
    must(!h.counts.gave_up, "a natural shape was given up");
    printf("| %s | %u | %.1f | %llu | %llu | %.1f |", name, o->point_count, time * 1e3, (unsigned long long)h.counts.octangle_tests,
           (unsigned long long)h.counts.chord_tests, (double)h.counts.octangle_tests / o->point_count);
    if (o->point_count <= MEASURED) {
        uint64_t tests = time_all_pairs(o, &h, &time);
        per_square[0] = time / square;
        per_square[1] = (double)tests / square;
        printf(" %.1f | %llu |\n", time * 1e3, (unsigned long long)tests);
    } else printf(" *%.0f* | *%.1e* |\n", per_square[0] * square * 1e3, per_square[1] * square);
    lathe__arena_free(&arena);
}

static void print_costs(void) {
    printf("\n### Cost: cross-links against all pairs\n\n"
           "Time of the whole hierarchy (tree, octangles, every outline resolved), one thread, and pairs tested. All pairs: the same\n"
           "sequence of outlines, each new edge against every edge of the outline (its crossing tests and nothing else). *Italic*:\n"
           "extrapolated as n^2 from %d points.\n\n"
           "| shape | points | ms | octangle pairs | of these chord pairs | pairs a point | all pairs: ms | all pairs: pairs |\n"
           "| --- | ---: | ---: | ---: | ---: | ---: | ---: | ---: |\n", MEASURED);
    for (int shape = 0; shape < 2; shape++) {
        double per_square[2] = {0, 0};
        for (uint32_t n = 100; n <= MOST; n *= 10) {
            lathe_arena arena = {0};
            lathe_outline o = section_outline(&arena, n, 1);
            /* Neighbouring points of the spiral are about 110000 / n apart; each is moved by an eighth of that. */
            if (shape) section_spiral(&o, (int)n / 2, 4, 900.0 * ONE, 200.0 * ONE, 0, 0);
            for (uint32_t v = 0; v < o.point_count; v++) {
                o.points[v].x += (int32_t)(14000.0 * ONE / n * section_noise(v, 1));
                o.points[v].y += (int32_t)(14000.0 * ONE / n * section_noise(v, 2));
            }
            if (!shape) section_coast(&o, n, 4000.0 * ONE, 0.5);
            print_row(shape ? "spiral, 4 turns" : "coast", &o, per_square);
            lathe__arena_free(&arena);
        }
    }
    printf("\n");
}

int main(void) {
    printf("## Ho, Kim & Kim: hierarchies without self-intersections\n\n");
    print_counts();
    print_costs();
    return 0;
}
