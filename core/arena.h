/* Scratch memory of one stage, freed in one call. */
#ifndef LATHE_ARENA_H
#define LATHE_ARENA_H
#include "lathe.h"

typedef struct lathe_arena { struct lathe_arena_block *block; size_t used; } lathe_arena;   /* zeroed: empty */
/* 16-byte aligned, not cleared; NULL when memory is out or count * size overflows. */
void *lathe__arena_alloc(lathe_arena *arena, size_t count, size_t size);
/* The newest allocation turns out to need so many bytes only. */
void lathe__arena_shrink(lathe_arena *arena, void *newest, size_t bytes);
/* Keeps the largest block for the next stage, frees the others. */
void lathe__arena_reset(lathe_arena *arena);
void lathe__arena_free(lathe_arena *arena);
#define LATHE_NEW(arena, type, count) ((type *)lathe__arena_alloc((arena), (size_t)(count), sizeof(type)))
#endif
