#include "arena.h"
#include <stdlib.h>

struct lathe_arena_block {
    struct lathe_arena_block *next;
    size_t size;               /* bytes after the header */
};
enum { ALIGN = 16, HEADER = (sizeof(struct lathe_arena_block) + ALIGN - 1) / ALIGN * ALIGN, FIRST_BLOCK = 1 << 12 };

static size_t aligned(size_t bytes) { return (bytes + ALIGN - 1) & ~(size_t)(ALIGN - 1); }

void *lathe__arena_alloc(lathe_arena *arena, size_t count, size_t size) {
    if (size && count > (SIZE_MAX / 4) / size) return NULL;
    size_t bytes = aligned(count * size);
    struct lathe_arena_block *top = arena->block;
    if (!top || bytes > top->size - arena->used) {
        size_t want = top ? top->size * 2 : FIRST_BLOCK;
        if (want < bytes) want = bytes;
        struct lathe_arena_block *block = malloc(HEADER + want);
        if (!block) return NULL;
        block->next = top;
        block->size = want;
        arena->block = top = block;
        arena->used = 0;
    }
    void *p = (char *)top + HEADER + arena->used;
    arena->used += bytes;
    return p;
}

void lathe__arena_shrink(lathe_arena *arena, void *newest, size_t bytes) {
    arena->used = (size_t)((char *)newest - (char *)arena->block - HEADER) + aligned(bytes);
}

void lathe__arena_reset(lathe_arena *arena) {
    if (!arena->block) return;
    /* Blocks grow, so the newest is the largest. */
    struct lathe_arena_block *old = arena->block->next;
    while (old) {
        struct lathe_arena_block *next = old->next;
        free(old);
        old = next;
    }
    arena->block->next = NULL;
    arena->used = 0;
}

void lathe__arena_free(lathe_arena *arena) {
    lathe__arena_reset(arena);
    free(arena->block);
    arena->block = NULL;
    arena->used = 0;
}
