/* Values ranked by how often a context has seen them: a value becomes a small number that a static entropy coder, such as
 * Draco's, codes well. Writer and reader keep the same tables. */
#ifndef LATHE_DRACO_RANK_H
#define LATHE_DRACO_RANK_H
#include "lathe.h"

enum { LATHE_RANK_MOST = 64 }; /* values of one context; one more takes the place of the last */

typedef struct lathe_rank_context {
    uint64_t key;
    uint32_t count, capacity;
    struct lathe_rank { int32_t value; uint32_t seen; } *ranks; /* most seen first, of equals the earlier */
} lathe_rank_context;
typedef struct lathe_ranks {
    lathe_rank_context *contexts; /* open addressing, `slots` a power of two or 0; free: capacity 0 */
    uint32_t slots, used;
} lathe_ranks; /* zeroed: empty */
void lathe__ranks_free(lathe_ranks *ranks);

/* Goes through the values of one context after another, each value once. */
enum { LATHE_RANK_KEYS = 3 };
typedef struct lathe_rank_cursor {
    const lathe_rank_context *context[LATHE_RANK_KEYS]; /* NULL: nothing seen yet */
    uint32_t keys, key, at;
} lathe_rank_cursor;
lathe_rank_cursor lathe__rank_cursor(const lathe_ranks *ranks, const uint64_t *keys, uint32_t count);
bool lathe__rank_next(lathe_rank_cursor *cursor, int32_t *value);
/* The contexts have seen a value. MEMORY. */
lathe_status lathe__rank_seen(lathe_ranks *ranks, const uint64_t *keys, uint32_t count, int32_t value);
#endif
