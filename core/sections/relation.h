/* Which contours of neighbouring sections are linked: overlap degrees, the relation matrix, rank order clustering
 * [P 3.1, 3.2]. */
#ifndef LATHE_RELATION_H
#define LATHE_RELATION_H
#include "contour.h"

#define LATHE_LINK_THRESHOLD 0.45      /* the paper's, section 5 */

/* Convex hull, counter-clockwise, without collinear points. hull: room for count + 1 points. Returns how many;
 * exact. */
uint32_t lathe__convex_hull(lathe_point *hull, const lathe_point *points, uint32_t count);
/* O = (area(P and Q) / area(P) + area(P and Q) / area(Q)) / 2 of two convex polygons, counter-clockwise; 0..1, and 0
 * if one has no area. Clipping in double: good to about 1e-12 of the box. scratch: 4 * (p_count + q_count) doubles. */
double lathe__overlap_degree(const lathe_point *p, uint32_t p_count, const lathe_point *q, uint32_t q_count,
                             double *scratch);

/* The relation of section A (rows) and B (columns). All arrays are arena memory. */
typedef struct lathe_relation {
    uint32_t rows, columns;
    double *overlap;           /* rows * columns: O_ij */
    uint8_t *link;             /* rows * columns: L_ij, 0 or 1 */
} lathe_relation;

/* Contour i of A is points a[first[i] .. first[i + 1]), either direction; B alike. L_ij = O_ij >= threshold. MEMORY,
 * LIMIT (2^24 pairs). */
lathe_status lathe__relate(lathe_relation *out, lathe_arena *arena, const lathe_point *a, const uint32_t *a_first,
                           uint32_t a_count, const lathe_point *b, const uint32_t *b_first, uint32_t b_count,
                           double threshold);

typedef enum lathe_link_kind {
    LATHE_LINK_SELF,
    LATHE_LINK_ONE_TO_ONE,
    LATHE_LINK_ONE_TO_MANY,
    LATHE_LINK_MANY_TO_MANY
} lathe_link_kind;

/* A submatrix on the diagonal of the rearranged matrix; a self link has one row and no column, or the other way
 * round. */
typedef struct lathe_block {
    lathe_link_kind kind;
    uint32_t row, row_count, column, column_count;   /* ranges of row_order and column_order */
} lathe_block;

typedef struct lathe_clustering {
    uint32_t *row_order, *column_order;    /* place -> contour of A, of B */
    lathe_block *blocks;
    uint32_t block_count;
    uint32_t rounds;           /* of rank order clustering, until nothing moved */
    bool repaired;             /* rank order clustering was stopped before it was stable, with a block in pieces */
} lathe_clustering;
/* King's rank order clustering: rows by their binary number (first column: highest bit) falling, columns alike,
 * until stable. Stable means block-diagonal: the first row has its ones in the first columns; the rows that have a
 * one there are the first rows; the columns that have a one in those are the first columns, and so on: the first
 * row's whole component is a corner of the matrix, and the rest is stable for itself. A single round is not enough.
 * Should the rounds run out (none of 20,000 random relations needed more than 10), rows and columns are put in order
 * of their connected components, and `repaired` is set. Self links come last. Arena memory. */
lathe_status lathe__cluster(lathe_clustering *out, lathe_arena *arena, const lathe_relation *relation);
#endif
