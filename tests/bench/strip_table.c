/* Prints table 1 of [L] (Lyu 1994): break points, square roots and multiplications on the circle and the spiral of 1001
 * points, the paper's figures in brackets, and time as a ratio to Roberge's method in the same run. */
#include <math.h>
#include <stdio.h>
#include <time.h>
#include "strip.h"

enum { POINTS = 1001, ROUNDS = 400 };
typedef void method(uint32_t *, uint32_t *, const double *, uint32_t, double, lathe_strip_cost *);
typedef struct printed {
    unsigned breaks, roots, multiplications;
} printed;

static const char *NAMES[3] = {"Roberge", "Williams", "Lyu"};
static method *const METHODS[3] = {lathe__strip_roberge, lathe__strip_williams, lathe__strip_lyu};
/* Table 1 of the paper: curve, method, tolerance. */
static const printed PAPER[2][3][5] = {
    {{{1001, 999, 7995}, {501, 500, 5999}, {144, 143, 4571}, {45, 44, 4087}, {14, 13, 3661}},
     {{1001, 1999, 7000}, {251, 1999, 5003}, {73, 1999, 4649}, {23, 1951, 4490}, {7, 1787, 4201}},
     {{1001, 1000, 8999}, {201, 200, 5399}, {60, 59, 5002}, {20, 19, 4854}, {7, 6, 4665}}},
    {{{1001, 999, 7995}, {467, 465, 5859}, {146, 145, 4569}, {44, 43, 3835}, {12, 11, 3513}},
     {{910, 1999, 6730}, {262, 1999, 5087}, {76, 1991, 4662}, {24, 1803, 4270}, {6, 1065, 3233}},
     {{764, 763, 7814}, {214, 213, 5560}, {64, 63, 5050}, {21, 20, 4749}, {6, 5, 4340}}}};

static double points[2 * POINTS];

static void make_curve(int spiral) {
    for (int i = 0; i < POINTS; i++) {
        double t = spiral ? 18.244 + (0.924 - 18.244) * i / (POINTS - 1)
                          : 2 * 3.14159265358979323846 * i / (POINTS - 1),
               r = spiral ? 1 / t : 1;
        points[2 * i] = r * cos(t);
        points[2 * i + 1] = (spiral ? -1 : 1) * r * sin(t);
    }
}

static double seconds(method *run, double tolerance) {
    static uint32_t breaks[POINTS];
    uint32_t n;
    lathe_strip_cost cost;
    clock_t start = clock();
    for (int k = 0; k < ROUNDS; k++) run(breaks, &n, points, POINTS, tolerance, &cost);
    return (double)(clock() - start) / CLOCKS_PER_SEC;
}

static void row(int spiral, int e, double tolerance) {
    double base = seconds(METHODS[0], tolerance);
    printf("| %s | %g |", spiral ? "spiral" : "circle", tolerance);
    for (int m = 0; m < 3; m++) {
        uint32_t breaks[POINTS], n;
        lathe_strip_cost cost;
        METHODS[m](breaks, &n, points, POINTS, tolerance, &cost);
        const printed *p = &PAPER[spiral][m][e];
        printf(" %u (%u) | %llu (%u) | %llu (%u) |", n, p->breaks, (unsigned long long)cost.square_roots, p->roots,
               (unsigned long long)cost.multiplications, p->multiplications);
        if (m) printf(" %.2f |", seconds(METHODS[m], tolerance) / base);
    }
    uint32_t breaks[POINTS], n;
    lathe__strip_drawn(breaks, &n, points, POINTS, tolerance);
    printf(" %u |\n", n);
}

int main(void) {
    printf("## Polygonal approximation: table 1 of Lyu 1994\n\n"
           "1001 points; break points with both ends, square roots, multiplications (in brackets: the paper's), time "
           "as a\n"
           "multiple of Roberge's. The last column is our drawn mode, which promises the tolerance for the chords\n"
           "themselves.\n\n| curve | e |");
    for (int m = 0; m < 3; m++) printf(" %s: breaks | roots | mult. |%s", NAMES[m], m ? " time |" : "");
    printf(" drawn: breaks |\n|---|---|");
    for (int k = 0; k < 12; k++) printf("---|");
    printf("\n");
    for (int spiral = 0; spiral < 2; spiral++) {
        make_curve(spiral);
        double tolerance = 1e-5;
        for (int e = 0; e < 5; e++, tolerance *= 10) row(spiral, e, tolerance);
    }
    printf(
        "\nLyu's break points and square roots are the paper's in every row but the spiral's first. On the circle his\n"
        "multiplications are the paper's, too, but that the paper has two more for each point within e of a start\n"
        "(19 points at e = 0.01, 90 at 0.1). The spiral's range and sampling are not printed: angles from 18.244 down\n"
        "to 0.924 in even steps give the counts above, and at e >= 0.001 fewer multiplications than the paper's.\n"
        "Roberge's: the paper has one multiplication more for each root, within 3, but on the spiral at e = 0.1 it\n"
        "has 381 more. Williams' method is not described in the paper. Ours narrows the cone by tangents: one root\n"
        "and at most 14 multiplications a point, where the paper counts up to two roots and 7 multiplications; break\n"
        "points differ by one or two in six rows, by four in the spiral's first. Times in the paper: Lyu's 0.8 to 1.4\n"
        "of Roberge's, Williams' 1.3 to 4.1. Figures 3(c) and (d) are Dunham's curves, whose points are not printed:\n"
        "they are left out.\n");
    return 0;
}
