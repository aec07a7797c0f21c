/* What the decoder needs of the standard library when it is built for wasm without one. */
#ifndef LATHE_WASM_STDLIB_H
#define LATHE_WASM_STDLIB_H
#include <stddef.h>
void *malloc(size_t size);
void *calloc(size_t count, size_t size);
void *realloc(void *block, size_t size);
void free(void *block);
void qsort(void *base, size_t count, size_t size, int (*compare)(const void *, const void *));
static inline int abs(int value) { return value < 0 ? -value : value; }
static inline long long llabs(long long value) { return value < 0 ? -value : value; }
_Noreturn static inline void abort(void) { __builtin_trap(); }
#endif
