#include "draco_rank.h"
#include <stdlib.h>
#include <string.h>

void lathe__ranks_free(lathe_ranks *ranks) {
    for (uint32_t i = 0; i < ranks->slots; i++) free(ranks->contexts[i].ranks);
    free(ranks->contexts);
    *ranks = (lathe_ranks){0};
}

/* Where a key is, or the free slot where it belongs; slots > used. */
static lathe_rank_context *slot_of(const lathe_ranks *ranks, uint64_t key) {
    uint64_t hash = (key ^ key >> 31) * 0x9E3779B97F4A7C15u;
    for (uint32_t i = (uint32_t)(hash >> 32);; i++) {
        lathe_rank_context *c = &ranks->contexts[i & (ranks->slots - 1)];
        if (!c->capacity || c->key == key) return c;
    }
}

static lathe_status make_room(lathe_ranks *ranks) {
    if (ranks->used < ranks->slots / 2) return LATHE_OK;
    if (ranks->slots > UINT32_MAX / 4) return LATHE_ERR_LIMIT;
    lathe_ranks more = {.slots = ranks->slots ? ranks->slots * 2 : 256, .used = ranks->used};
    more.contexts = calloc(more.slots, sizeof *more.contexts);
    if (!more.contexts) return LATHE_ERR_MEMORY;
    for (uint32_t i = 0; i < ranks->slots; i++)
        if (ranks->contexts[i].capacity) *slot_of(&more, ranks->contexts[i].key) = ranks->contexts[i];
    free(ranks->contexts);
    *ranks = more;
    return LATHE_OK;
}

lathe_rank_cursor lathe__rank_cursor(const lathe_ranks *ranks, const uint64_t *keys, uint32_t count) {
    lathe_rank_cursor cursor = {.keys = count};
    for (uint32_t k = 0; k < count && ranks->slots; k++) {
        const lathe_rank_context *c = slot_of(ranks, keys[k]);
        cursor.context[k] = c->capacity ? c : NULL;
    }
    return cursor;
}

static bool has(const lathe_rank_context *context, int32_t value) {
    for (uint32_t i = 0; context && i < context->count; i++)
        if (context->ranks[i].value == value) return true;
    return false;
}

bool lathe__rank_next(lathe_rank_cursor *cursor, int32_t *value) {
    for (; cursor->key < cursor->keys; cursor->key++, cursor->at = 0) {
        const lathe_rank_context *c = cursor->context[cursor->key];
        while (c && cursor->at < c->count) {
            *value = c->ranks[cursor->at++].value;
            uint32_t k = 0;
            while (k < cursor->key && !has(cursor->context[k], *value)) k++;
            if (k == cursor->key) return true;
        }
    }
    return false;
}

static lathe_status see(lathe_rank_context *c, int32_t value) {
    uint32_t i = 0;
    while (i < c->count && c->ranks[i].value != value) i++;
    if (i == c->count && c->count == c->capacity && c->capacity < LATHE_RANK_MOST) {
        struct lathe_rank *more = realloc(c->ranks, (size_t)c->capacity * 2 * sizeof *more);
        if (!more) return LATHE_ERR_MEMORY;
        c->ranks = more;
        c->capacity *= 2;
    }
    if (i == c->count) {
        if (c->count == LATHE_RANK_MOST) i--;
        else c->count++;
        c->ranks[i] = (struct lathe_rank){value, 0};
    }
    struct lathe_rank seen = {value, c->ranks[i].seen + 1};
    for (; i && c->ranks[i - 1].seen < seen.seen; i--) c->ranks[i] = c->ranks[i - 1];
    c->ranks[i] = seen;
    return LATHE_OK;
}

lathe_status lathe__rank_seen(lathe_ranks *ranks, const uint64_t *keys, uint32_t count, int32_t value) {
    for (uint32_t k = 0; k < count; k++) {
        lathe_status status = make_room(ranks);
        if (status) return status;
        lathe_rank_context *c = slot_of(ranks, keys[k]);
        if (!c->capacity) {
            struct lathe_rank *first = malloc(2 * sizeof *first);
            if (!first) return LATHE_ERR_MEMORY;
            *c = (lathe_rank_context){.key = keys[k], .capacity = 2, .ranks = first};
            ranks->used++;
        }
        status = see(c, value);
        if (status) return status;
    }
    return LATHE_OK;
}
