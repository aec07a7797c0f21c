/* The paper's own grammar G [M theorem 1] and G' [M 5.1], as printed, for its trees, tables and figures. Not a gate
 * for real data: theorem 1 is false (counts in tests/test_paper_grammar.c), core/grammar.c and derivation.h take every
 * contour.
 *
 *   P1  S -> F ... F (as many as rays)         P7  U -> U U | D U | U D | U_O U_I
 *   P2  F -> D F U | D F | F U | f             P8  U_I -> B U_I F | U_I D | u_i
 *   P3  B -> b                                 P9  U_O -> F U_O B | U_O D_R | u_o
 *   P4  D -> D D | D U | U D | D_I D_O         P10 D_R -> D_O D_I
 *   P5  D_I -> F D_I B | D_I U_R | d_i         P11 U_R -> U_I U_O
 *   P6  D_O -> B D_O F | D_O U | d_o           P2' F -> F F   P3' B -> B B   (G'); F -> F D (our extension)
 *
 * G is ambiguous, so strings are parsed with a chart over all substrings of the cyclic string (Cocke, Younger, Kasami;
 * the products of two cells by table): time count^3, memory count^2, hence the limit. */
#ifndef LATHE_PAPER_GRAMMAR_H
#define LATHE_PAPER_GRAMMAR_H
#include "contour.h"

enum { LATHE_PAPER_MAX_EDGES = 400, LATHE_PAPER_SYMBOLS = 15 };
enum { LATHE_PAPER_G = 0, LATHE_PAPER_REFINED = 1, LATHE_PAPER_F_D = 2 }; /* options: P2', P3'; F -> F D */

typedef enum lathe_paper_symbol {
    LATHE_PAPER_F,
    LATHE_PAPER_B,
    LATHE_PAPER_D,
    LATHE_PAPER_D_I,
    LATHE_PAPER_D_O,
    LATHE_PAPER_D_R,
    LATHE_PAPER_U,
    LATHE_PAPER_U_I,
    LATHE_PAPER_U_O,
    LATHE_PAPER_U_R,
    LATHE_PAPER_S = 16,
    LATHE_PAPER_LEAF
} lathe_paper_symbol;

/* The products of two sets of symbols: by symbol on the left, by each half of the set on the right. Made once. */
typedef struct lathe_paper_grammar {
    unsigned options;
    uint16_t product[LATHE_PAPER_SYMBOLS][2][256];
} lathe_paper_grammar;
void lathe__paper_grammar_make(lathe_paper_grammar *out, unsigned options);

/* What each substring of a cyclic string derives from. */
typedef struct lathe_paper_chart {
    const lathe_paper_grammar *grammar;
    const uint8_t *types; /* the caller's */
    uint32_t count;
    uint16_t *cells; /* [length - 1][start]: set of symbols; arena memory */
} lathe_paper_chart;
/* types: count lathe_edge_type. LIMIT: more than LATHE_PAPER_MAX_EDGES. RANGE: none, or no such type. MEMORY. */
lathe_status lathe__paper_chart_make(lathe_paper_chart *out, lathe_arena *arena, const lathe_paper_grammar *grammar,
                                     const uint8_t *types, uint32_t count);
/* Whether the substring (start, length; cyclic) derives from a symbol other than S. */
bool lathe__paper_derives(const lathe_paper_chart *chart, lathe_paper_symbol symbol, uint32_t start, uint32_t length);
/* From how many starts S -> F^rays gives the whole cyclic string: 0: rejected; chart->count: from every start.
 * from: NULL, or count entries that say which. MEMORY. */
lathe_status lathe__paper_accepts(uint32_t *starts, bool *from, lathe_arena *scratch, const lathe_paper_chart *chart,
                                  uint32_t rays);

typedef struct lathe_paper_node {
    uint8_t symbol;        /* lathe_paper_symbol */
    uint8_t edge;          /* lathe_edge_type of a leaf */
    uint8_t production;    /* the n of P_n that was applied; 0 at a leaf */
    uint32_t first, count; /* the edges it spans: first (index in types), count (cyclic) */
    uint32_t child, next;  /* first child, next sibling; UINT32_MAX: none */
} lathe_paper_node;
typedef struct lathe_paper_tree {
    uint32_t node_count;
    lathe_paper_node *nodes;
} lathe_paper_tree; /* node 0: the root */
/* One derivation tree of (start, length) from a symbol; of several, the one whose productions come first in the list
 * above and whose first symbols are the shortest. symbol S: length must be count; rays as above (else not read).
 * FORMAT if there is none. Arena memory. MEMORY. */
lathe_status lathe__paper_tree_make(lathe_paper_tree *out, lathe_arena *arena, const lathe_paper_chart *chart,
                                    lathe_paper_symbol symbol, uint32_t start, uint32_t length, uint32_t rays);
#endif
