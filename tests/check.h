/* The whole test framework: CHECK counts, a failure prints where and why, `return check_end()` closes a test program. */
#ifndef LATHE_CHECK_H
#define LATHE_CHECK_H
#include <stdio.h>

static int check_passed, check_failed;
#define CHECK(condition) check_that((condition) ? 1 : 0, __FILE__, __LINE__, #condition)
#define CHECK_EQ(a, b) check_equal((long long)(a), (long long)(b), __FILE__, __LINE__, #a " == " #b)

static inline int check_that(int ok, const char *file, int line, const char *text) {
    if (ok) check_passed++;
    else { check_failed++; fprintf(stderr, "%s:%d: failed: %s\n", file, line, text); }
    return ok;
}
static inline int check_equal(long long a, long long b, const char *file, int line, const char *text) {
    if (a == b) check_passed++;
    else { check_failed++; fprintf(stderr, "%s:%d: failed: %s (%lld, %lld)\n", file, line, text, a, b); }
    return a == b;
}
static inline int check_end(void) {
    printf("%d passed, %d failed\n", check_passed, check_failed);
    return check_failed != 0;
}
#endif
