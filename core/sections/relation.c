#include "relation.h"
#include <stdlib.h>
#include <string.h>

/* ---- overlap degree [P 3.1] ---- */

static int compare_points(const void *a, const void *b) {
    const lathe_point *p = a, *q = b;
    if (p->x != q->x) return p->x < q->x ? -1 : 1;
    return (p->y > q->y) - (p->y < q->y);
}

/* Andrew's monotone chain; hull serves as the sorted copy's target, so the points are sorted in a copy behind. */
static uint32_t chain(lathe_point *hull, const lathe_point *sorted, uint32_t count) {
    uint32_t n = 0;
    for (uint32_t i = 0; i < count; i++) {
        while (n >= 2 && lathe__orient(hull[n - 2], hull[n - 1], sorted[i]) <= 0) n--;
        hull[n++] = sorted[i];
    }
    uint32_t lower = n + 1;
    for (uint32_t i = count - 1; i-- > 0;) {
        while (n >= lower && lathe__orient(hull[n - 2], hull[n - 1], sorted[i]) <= 0) n--;
        hull[n++] = sorted[i];
    }
    return n > 1 ? n - 1 : n;
}

uint32_t lathe__convex_hull(lathe_point *hull, const lathe_point *points, uint32_t count) {
    if (count == 0) return 0;
    lathe_point *sorted = malloc(count * sizeof *sorted);
    if (!sorted) return 0;
    memcpy(sorted, points, count * sizeof *sorted);
    qsort(sorted, count, sizeof *sorted, compare_points);
    uint32_t distinct = 1;
    for (uint32_t i = 1; i < count; i++)
        if (compare_points(&sorted[i], &sorted[distinct - 1])) sorted[distinct++] = sorted[i];
    uint32_t n = chain(hull, sorted, distinct);
    free(sorted);
    return n;
}

static double area_of(const double (*p)[2], uint32_t n) {
    double sum = 0;
    for (uint32_t i = 2; i < n; i++)
        sum += (p[i - 1][0] - p[0][0]) * (p[i][1] - p[0][1]) - (p[i - 1][1] - p[0][1]) * (p[i][0] - p[0][0]);
    return sum / 2;
}

/* Keeps the part of a convex polygon on the left of the line from a to b. A cut adds one corner; where rounding has
 * left corners in a row it could add more, but never beyond `most`. */
static uint32_t clip(double (*out)[2], uint32_t most, const double (*in)[2], uint32_t n, lathe_point a, lathe_point b) {
    uint32_t m = 0;
    double dx = (double)b.x - a.x, dy = (double)b.y - a.y;
    for (uint32_t i = 0; i < n && m + 2 <= most; i++) {
        const double *p = in[i], *q = in[i + 1 < n ? i + 1 : 0];
        double s = dx * (p[1] - a.y) - dy * (p[0] - a.x), t = dx * (q[1] - a.y) - dy * (q[0] - a.x);
        if (s >= 0) {
            out[m][0] = p[0];
            out[m++][1] = p[1];
        }
        if ((s > 0 && t < 0) || (s < 0 && t > 0)) {
            out[m][0] = p[0] + (q[0] - p[0]) * (s / (s - t));
            out[m][1] = p[1] + (q[1] - p[1]) * (s / (s - t));
            m++;
        }
    }
    return m;
}

static void widen(double (*out)[2], const lathe_point *p, uint32_t n) {
    for (uint32_t i = 0; i < n; i++) out[i][0] = p[i].x, out[i][1] = p[i].y;
}

double lathe__overlap_degree(const lathe_point *p, uint32_t p_count, const lathe_point *q, uint32_t q_count,
                             double *scratch) {
    double(*here)[2] = (double(*)[2])scratch, (*there)[2] = here + p_count + q_count;
    if (p_count < 3 || q_count < 3) return 0;
    widen(here, q, q_count);
    double of_q = area_of((const double(*)[2])here, q_count);
    widen(here, p, p_count);
    double of_p = area_of((const double(*)[2])here, p_count);
    uint32_t n = p_count;
    for (uint32_t i = 0; i < q_count && n; i++) {
        n = clip(there, p_count + q_count, (const double(*)[2])here, n, q[i], q[i + 1 < q_count ? i + 1 : 0]);
        double(*swap)[2] = here;
        here = there;
        there = swap;
    }
    double both = n < 3 ? 0 : area_of((const double(*)[2])here, n);
    return of_p > 0 && of_q > 0 && both > 0 ? 0.5 * both / of_p + 0.5 * both / of_q : 0;
}

/* The hulls of all contours, one behind the other. */
static lathe_status list_hulls(lathe_point **hulls, uint32_t **first, lathe_arena *arena, const lathe_point *points,
                               const uint32_t *at, uint32_t count) {
    lathe_point *hull = LATHE_NEW(arena, lathe_point, (size_t)at[count] - at[0] + count + 1);
    uint32_t *begin = LATHE_NEW(arena, uint32_t, count + 1), n = 0;
    if (!hull || !begin) return LATHE_ERR_MEMORY;
    for (uint32_t i = 0; i < count; i++) {
        begin[i] = n;
        uint32_t size = lathe__convex_hull(hull + n, points + at[i], at[i + 1] - at[i]);
        if (!size && at[i + 1] > at[i]) return LATHE_ERR_MEMORY;
        n += size;
    }
    begin[count] = n;
    *hulls = hull;
    *first = begin;
    return LATHE_OK;
}

lathe_status lathe__relate(lathe_relation *out, lathe_arena *arena, const lathe_point *a, const uint32_t *a_first,
                           uint32_t a_count, const lathe_point *b, const uint32_t *b_first, uint32_t b_count,
                           double threshold) {
    lathe_relation r = {.rows = a_count, .columns = b_count};
    lathe_point *p, *q;
    uint32_t *pf, *qf;
    size_t pairs = (size_t)a_count * b_count;
    if (pairs > 1u << 24) return LATHE_ERR_LIMIT;
    lathe_status status = list_hulls(&p, &pf, arena, a, a_first, a_count);
    if (!status) status = list_hulls(&q, &qf, arena, b, b_first, b_count);
    if (status) return status;
    r.overlap = LATHE_NEW(arena, double, pairs + 1);
    r.link = LATHE_NEW(arena, uint8_t, pairs + 1);
    double *scratch = LATHE_NEW(arena, double, 4 * ((size_t)pf[a_count] + qf[b_count] + 2));
    if (!r.overlap || !r.link || !scratch) return LATHE_ERR_MEMORY;
    for (uint32_t i = 0; i < a_count; i++)
        for (uint32_t j = 0; j < b_count; j++) {
            double o = lathe__overlap_degree(p + pf[i], pf[i + 1] - pf[i], q + qf[j], qf[j + 1] - qf[j], scratch);
            r.overlap[(size_t)i * b_count + j] = o;
            r.link[(size_t)i * b_count + j] = o >= threshold;
        }
    *out = r;
    return LATHE_OK;
}

/* ---- rank order clustering [P 3.2, King 1980] ---- */

typedef struct ranking {
    const lathe_relation *r;
    uint32_t *order[2];        /* rows, columns */
} ranking;

static uint8_t cell(const ranking *k, int side, uint32_t line, uint32_t across) {
    return side ? k->r->link[(size_t)across * k->r->columns + line] : k->r->link[(size_t)line * k->r->columns + across];
}

/* The binary numbers of two lines, compared digit by digit: any number of columns. */
static int compare_lines(const ranking *k, int side, uint32_t a, uint32_t b) {
    uint32_t n = side ? k->r->rows : k->r->columns;
    for (uint32_t i = 0; i < n; i++) {
        int d = cell(k, side, b, k->order[!side][i]) - cell(k, side, a, k->order[!side][i]);
        if (d) return d;
    }
    return 0;
}

/* A stable merge sort of one side's lines, falling; true if anything moved. */
static bool sort_lines(const ranking *k, int side, uint32_t *spare) {
    uint32_t n = side ? k->r->columns : k->r->rows, *from = k->order[side], *to = spare;
    bool moved = false;
    for (uint32_t width = 1; width < n; width *= 2) {
        for (uint32_t low = 0; low < n; low += 2 * width) {
            uint32_t middle = low + width < n ? low + width : n, high = low + 2 * width < n ? low + 2 * width : n;
            for (uint32_t i = low, j = middle, o = low; o < high; o++) {
                bool right = i == middle || (j < high && compare_lines(k, side, from[i], from[j]) > 0);
                moved |= right && i < middle;
                to[o] = right ? from[j++] : from[i++];
            }
        }
        uint32_t *swap = from;
        from = to;
        to = swap;
    }
    if (from != k->order[side]) memcpy(k->order[side], from, n * sizeof *from);
    return moved;
}

static uint32_t find(uint32_t *parent, uint32_t i) {
    while (parent[i] != i) i = parent[i] = parent[parent[i]];
    return i;
}

/* Puts one side's lines in order of their blocks; true if they were not. Blocks are numbered as they first occur
 * among the rows, then among the columns without links. */
static bool gather(uint32_t *order, uint32_t n, uint32_t base, const uint32_t *number, const uint32_t *root,
                   uint32_t *spare, uint32_t *start, uint32_t blocks) {
    bool moved = false;
    memset(start, 0, (blocks + 1) * sizeof *start);
    for (uint32_t i = 0; i < n; i++) start[number[root[base + i]] + 1]++;
    for (uint32_t i = 1; i < n; i++) moved |= number[root[base + order[i]]] < number[root[base + order[i - 1]]];
    for (uint32_t i = 0; i < blocks; i++) start[i + 1] += start[i];
    for (uint32_t i = 0; i < n; i++) spare[start[number[root[base + order[i]]]]++] = order[i];
    memcpy(order, spare, n * sizeof *order);
    return moved;
}

static lathe_link_kind kind_of(uint32_t rows, uint32_t columns) {
    if (!rows || !columns) return LATHE_LINK_SELF;
    if (rows == 1 && columns == 1) return LATHE_LINK_ONE_TO_ONE;
    return rows == 1 || columns == 1 ? LATHE_LINK_ONE_TO_MANY : LATHE_LINK_MANY_TO_MANY;
}

/* Components of the links; linked blocks are numbered first, self links behind them. */
static uint32_t number_blocks(const ranking *k, uint32_t *root, uint32_t *number) {
    const lathe_relation *r = k->r;
    uint32_t lines = r->rows + r->columns, blocks = 0;
    for (uint32_t i = 0; i < lines; i++) root[i] = i, number[i] = UINT32_MAX;
    for (uint32_t i = 0; i < r->rows; i++)
        for (uint32_t j = 0; j < r->columns; j++)
            if (r->link[(size_t)i * r->columns + j]) {
                uint32_t a = find(root, i), b = find(root, r->rows + j);
                root[a > b ? a : b] = a < b ? a : b;
            }
    for (uint32_t i = 0; i < lines; i++) root[i] = find(root, i);
    for (int self = 0; self < 2; self++)
        for (int side = 0; side < 2; side++) {
            uint32_t n = side ? r->columns : r->rows, across = side ? r->rows : r->columns, base = side ? r->rows : 0;
            for (uint32_t i = 0; i < n; i++) {
                uint32_t line = k->order[side][i], linked = 0;
                for (uint32_t j = 0; j < across && !linked; j++) linked = cell(k, side, line, j);
                if ((linked == 0) == (self == 1) && number[root[base + line]] == UINT32_MAX)
                    number[root[base + line]] = blocks++;
            }
        }
    return blocks;
}

lathe_status lathe__cluster(lathe_clustering *out, lathe_arena *arena, const lathe_relation *r) {
    uint32_t lines = r->rows + r->columns;
    lathe_clustering c = {0};
    ranking k = {.r = r,
                 .order = {LATHE_NEW(arena, uint32_t, r->rows + 1), LATHE_NEW(arena, uint32_t, r->columns + 1)}};
    uint32_t *spare = LATHE_NEW(arena, uint32_t, lines + 1), *start = LATHE_NEW(arena, uint32_t, lines + 2);
    uint32_t *root = LATHE_NEW(arena, uint32_t, lines + 1), *number = LATHE_NEW(arena, uint32_t, lines + 1);
    c.blocks = LATHE_NEW(arena, lathe_block, lines + 1);
    if (!k.order[0] || !k.order[1] || !spare || !start || !root || !number || !c.blocks) return LATHE_ERR_MEMORY;
    for (int s = 0; s < 2; s++)
        for (uint32_t i = 0; i < (s ? r->columns : r->rows); i++) k.order[s][i] = i;
    /* It settles within a few rounds; the bound only stops what nobody has seen. */
    for (bool moved = true; moved && c.rounds < lines + 2; c.rounds++) {
        moved = sort_lines(&k, 0, spare);
        moved |= sort_lines(&k, 1, spare);
    }
    c.block_count = number_blocks(&k, root, number);
    c.repaired = gather(k.order[0], r->rows, 0, number, root, spare, start, c.block_count);
    c.repaired |= gather(k.order[1], r->columns, r->rows, number, root, spare, start, c.block_count);
    for (uint32_t b = 0, i = 0, j = 0; b < c.block_count; b++) {
        lathe_block *block = &c.blocks[b];
        *block = (lathe_block){.row = i, .column = j};
        while (i < r->rows && number[root[k.order[0][i]]] == b) i++;
        while (j < r->columns && number[root[r->rows + k.order[1][j]]] == b) j++;
        block->row_count = i - block->row;
        block->column_count = j - block->column;
        block->kind = kind_of(block->row_count, block->column_count);
    }
    c.row_order = k.order[0];
    c.column_order = k.order[1];
    *out = c;
    return LATHE_OK;
}
