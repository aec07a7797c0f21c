/* Time of parsing and tiling for each crossing, from 10^3 to 10^6 crossings: rows of a Markdown table. */
#include "derivation.h"
#include "../long_contour.h"
#include <stdio.h>
#include <time.h>

static double now_ns(void) {
    struct timespec t;
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
    return 1e9 * (double)t.tv_sec + (double)t.tv_nsec;
}

typedef struct timing {
    double parse, trees, walk;
} timing;
static void keep_least(double *least, double value) {
    if (*least == 0 || value < *least) *least = value;
}

/* The least of several runs, CPU ns for each crossing of both contours. */
static lathe_status measure(timing *out, lathe_arena *scratch, const lathe_ray_contour *a, const lathe_ray_contour *b,
                            int runs) {
    *out = (timing){0, 0, 0};
    double crossings = (double)a->count + b->count;
    for (int run = 0; run < runs; run++) {
        lathe_tree tree;
        lathe_derivation right, left;
        lathe_tiling tiling;
        double t0 = now_ns();
        lathe_status status = lathe__parse_contour(&tree, scratch, a->crossings, a->types, a->count, a->rays);
        if (!status) status = lathe__parse_contour(&tree, scratch, b->crossings, b->types, b->count, b->rays);
        double t1 = now_ns();
        if (!status) status = lathe__derive_pair(&right, &left, scratch, a, b);
        double t2 = now_ns();
        if (!status) status = lathe__walk_derivations(&tiling, NULL, scratch, a, &right, b, &left);
        double t3 = now_ns();
        if (status) return status;
        keep_least(&out->parse, (t1 - t0) / crossings);
        keep_least(&out->trees, (t2 - t1) / crossings);
        keep_least(&out->walk, (t3 - t2) / crossings);
        lathe__arena_reset(scratch);
    }
    return LATHE_OK;
}

int main(void) {
    lathe_arena arena = {0}, scratch = {0};
    lathe_status status = LATHE_OK;
    puts("## Min and Lee 2003: parsing and tiling are linear\n\nOne folded contour against another, CPU nanoseconds for each crossing; the counts of work for each crossing are asserted in\ntests/test_derivation.c.\n\n| crossings | parse, ns each | left and right trees, ns each | tile, ns each |\n| --- | --- | --- | --- |");
    for (uint32_t n = 1000; n <= 1000000 && !status; n *= 10) {
        lathe_ray_contour a, b;
        timing t;
        status = long_contour(&a, &arena, n, 0);
        if (!status) status = long_contour(&b, &arena, n, 1);
        if (!status) status = measure(&t, &scratch, &a, &b, n < 100000 ? 200 : 10);
        if (!status) printf("| %u | %.1f | %.1f | %.1f |\n", a.count, t.parse, t.trees, t.walk);
        lathe__arena_reset(&arena);
    }
    lathe__arena_free(&arena);
    lathe__arena_free(&scratch);
    if (status) fprintf(stderr, "parse_scaling: %s\n", lathe_status_name(status));
    return status != LATHE_OK;
}
