/* soak PAIRS [FIRST [SEED]]: the guarantees on random pairs of slices, exact and coarse; ends like a test,
 * "N passed, M failed". */
#include "slice_pairs.h"
#include <inttypes.h>
#include <time.h>

int main(int argc, char **argv) {
    uint64_t pairs = argc > 1 ? strtoull(argv[1], NULL, 10) : 10000, first = argc > 2 ? strtoull(argv[2], NULL, 10) : 0;
    uint64_t seed = argc > 3 ? strtoull(argv[3], NULL, 10) : 1, failed[PAIR_KINDS][2] = {{0}}, total = 0;
    lathe_arena arena[2] = {{0}, {0}};
    time_t start = time(NULL), told = start;
    for (uint64_t i = first; i < first + pairs; i++) {
        slice_pair p = pair_draw(i, seed);
        for (int exact = 0; exact < 2; exact++) {
            const char *fault = pair_fault(&p, arena, exact);
            if (!*fault) continue;
            total++;
            if (failed[p.kind][exact]++ < 5)
                printf("pair %" PRIu64 " (%s, size %d, fraction %d, coarseness %u): the surface %s\n", i,
                       pair_kind_name[p.kind], p.size, p.fraction, exact ? 0 : (unsigned)p.coarseness, fault);
        }
        lathe__mask_free(&p.mask);
        if (i % 1024 || time(NULL) - told < 60) continue;
        told = time(NULL);
        printf("%" PRIu64 " pairs after %ld s, %" PRIu64 " failures\n", i - first + 1, (long)(told - start), total);
        fflush(stdout);
    }
    for (int k = 0; k < PAIR_KINDS; k++)
        if (failed[k][0] + failed[k][1])
            printf("%s: %" PRIu64 " coarse, %" PRIu64 " exact\n", pair_kind_name[k], failed[k][0], failed[k][1]);
    printf("%" PRIu64 " pairs in %ld s\n%" PRIu64 " passed, %" PRIu64 " failed\n", pairs, (long)(time(NULL) - start),
           2 * pairs - total, total);
    lathe__arena_free(&arena[0]);
    lathe__arena_free(&arena[1]);
    return total != 0;
}
