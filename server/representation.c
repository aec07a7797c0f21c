/* Representations: derived from immutable archives, built once, kept in memory up to a limit, oldest use out first. A
 * reply holds its bytes itself, so what leaves the cache while it is being sent lives until it is sent. */
#include "service.h"
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { BUCKETS = 4096, BUILDING = 0, READY = 1, GONE = 2, MAX_COUNT = 16384, FIXED_COST = 4096 };
struct lathe_cache {
    pthread_mutex_t lock;
    pthread_cond_t settled; /* some representation is not BUILDING any more */
    size_t limit, size, count;
    lathe_representation *buckets[BUCKETS], *newest, *oldest;
};

void lathe__body_release(void *pointer) {
    lathe_body *body = pointer;
    if (!body || atomic_fetch_sub(&body->references, 1) != 1) return;
    free(body->owned);
    lathe__entry_release(body->entry);
    free(body);
}

static uint64_t hash_key(const char *key) {
    uint64_t hash = 1469598103934665603u;
    for (; *key; key++) hash = (hash ^ (uint8_t)*key) * 1099511628211u;
    return hash ^ hash >> 32;
}

static size_t cost(const lathe_representation *r) {
    return FIXED_COST + (r->body && r->body->owned ? r->body->size : 0);
}

static void free_representation(lathe_representation *r) {
    for (int i = 0; i < 2; i++) {
        if (r->full[i]) MHD_destroy_response(r->full[i]);
        if (r->unchanged[i]) MHD_destroy_response(r->unchanged[i]);
    }
    lathe__body_release(r->body);
    free(r->key);
    free(r);
}

static void unlink_use(lathe_cache *cache, lathe_representation *r) {
    if (r->newer)
        r->newer->older = r->older;
    else
        cache->newest = r->older;
    if (r->older)
        r->older->newer = r->newer;
    else
        cache->oldest = r->newer;
    r->newer = r->older = NULL;
}

static void link_use(lathe_cache *cache, lathe_representation *r) {
    r->older = cache->newest;
    r->newer = NULL;
    if (r->older)
        r->older->newer = r;
    else
        cache->oldest = r;
    cache->newest = r;
}

/* Out of the table; returns it if it is to be freed (outside the lock). */
static lathe_representation *drop(lathe_cache *cache, lathe_representation *r) {
    lathe_representation **at = &cache->buckets[r->hash % BUCKETS];
    while (*at != r) at = &(*at)->chain;
    *at = r->chain;
    r->chain = NULL;
    if (r->state == READY) {
        unlink_use(cache, r);
        cache->size -= cost(r);
    }
    cache->count--;
    r->state = GONE;
    return --r->references ? NULL : r;
}

/* Chains what is to be freed. */
static lathe_representation *evict(lathe_cache *cache, const lathe_representation *keep) {
    lathe_representation *dead = NULL;
    while (cache->oldest && cache->oldest != keep && (cache->size > cache->limit || cache->count > MAX_COUNT)) {
        lathe_representation *r = drop(cache, cache->oldest);
        if (r) r->chain = dead, dead = r;
    }
    return dead;
}

static void free_chain(lathe_representation *dead) {
    while (dead) {
        lathe_representation *next = dead->chain;
        free_representation(dead);
        dead = next;
    }
}

lathe_status lathe__cache_open(lathe_cache **out, size_t limit) {
    lathe_cache *cache = calloc(1, sizeof *cache);
    if (!cache) return LATHE_ERR_MEMORY;
    pthread_mutex_init(&cache->lock, NULL);
    pthread_cond_init(&cache->settled, NULL);
    cache->limit = limit;
    *out = cache;
    return LATHE_OK;
}

void lathe__cache_close(lathe_cache **cache) {
    if (!*cache) return;
    while ((*cache)->oldest) free_chain(drop(*cache, (*cache)->oldest));
    pthread_cond_destroy(&(*cache)->settled);
    pthread_mutex_destroy(&(*cache)->lock);
    free(*cache);
    *cache = NULL;
}

static lathe_status compress_body(lathe_body *body, lathe_cache *cache, const lathe_recipe *recipe,
                                  lathe_encoding encoding, lathe_error *err) {
    lathe_representation *plain = NULL;
    lathe_status status = lathe__cache_get(&plain, cache, recipe, LATHE_IDENTITY, err);
    if (status || !plain) return status ? status : LATHE_ERR_MEMORY;
    lathe_buffer packed = {0};
    status =
        lathe__compress(&packed, plain->body->bytes, plain->body->size, encoding, (recipe->traits & LATHE_PAGE) != 0);
    lathe__cache_release(cache, plain);
    if (status) return lathe_fail(err, status, "compression failed");
    body->owned = packed.bytes;
    body->bytes = packed.bytes;
    body->size = packed.size;
    return LATHE_OK;
}

static lathe_status build(lathe_representation *r, lathe_cache *cache, const lathe_recipe *recipe, lathe_error *err) {
    lathe_body *body = calloc(1, sizeof *body);
    if (!body) return lathe_fail(err, LATHE_ERR_MEMORY, "out of memory");
    atomic_init(&body->references, 1);
    r->body = body;
    lathe_status status = r->encoding == LATHE_IDENTITY ? recipe->build(body, recipe->context, err)
                                                        : compress_body(body, cache, recipe, r->encoding, err);
    if (status) return status;
    char hash[LATHE_HASH_SIZE];
    lathe__hash(hash, body->bytes, body->size);
    snprintf(r->etag, sizeof r->etag, "\"%s\"", hash);
    return lathe__representation_dress(r) ? LATHE_OK : lathe_fail(err, LATHE_ERR_MEMORY, "out of memory");
}

static lathe_representation *new_representation(const lathe_recipe *recipe, lathe_encoding encoding, const char *key) {
    lathe_representation *r = calloc(1, sizeof *r);
    if (!r || !(r->key = strdup(key))) {
        free(r);
        return NULL;
    }
    r->hash = hash_key(key);
    r->type = recipe->type;
    r->traits = recipe->traits;
    r->encoding = encoding;
    r->entry = recipe->entry;
    memcpy(r->file_name, recipe->file_name, sizeof r->file_name);
    r->references = 2; /* the table's and the caller's */
    return r;
}

static lathe_representation *find(lathe_cache *cache, const char *key) {
    uint64_t hash = hash_key(key);
    for (lathe_representation *r = cache->buckets[hash % BUCKETS]; r; r = r->chain)
        if (r->hash == hash && !strcmp(r->key, key)) return r;
    return NULL;
}

/* Under the lock: what is READY, counted for the caller; or a new one that the caller has to build (*fresh). */
static lathe_representation *find_or_add(lathe_cache *cache, const lathe_recipe *recipe, lathe_encoding encoding,
                                         const char *key, bool *fresh) {
    lathe_representation *r;
    *fresh = false;
    while ((r = find(cache, key))) {
        if (r->state == READY) {
            unlink_use(cache, r);
            link_use(cache, r);
            r->references++;
            return r;
        }
        pthread_cond_wait(&cache->settled, &cache->lock);
    }
    if (!(r = new_representation(recipe, encoding, key))) return NULL;
    *fresh = true;
    r->chain = cache->buckets[r->hash % BUCKETS];
    cache->buckets[r->hash % BUCKETS] = r;
    cache->count++;
    return r;
}

/* The fresh one is built: known to all, or taken out again. */
static void settle(lathe_cache *cache, lathe_representation *r, lathe_status status) {
    pthread_mutex_lock(&cache->lock);
    lathe_representation *dead = NULL;
    if (status) {
        drop(cache, r);
        r->references--;
        dead = r;
    } else {
        r->state = READY;
        cache->size += cost(r);
        link_use(cache, r);
        dead = evict(cache, r);
    }
    pthread_cond_broadcast(&cache->settled);
    pthread_mutex_unlock(&cache->lock);
    free_chain(dead);
}

lathe_status lathe__cache_get(lathe_representation **out, lathe_cache *cache, const lathe_recipe *recipe,
                              lathe_encoding encoding, lathe_error *err) {
    char key[sizeof recipe->key + 4];
    snprintf(key, sizeof key, "%d:%s", (int)encoding, recipe->key);
    bool fresh;
    pthread_mutex_lock(&cache->lock);
    lathe_representation *r = find_or_add(cache, recipe, encoding, key, &fresh);
    pthread_mutex_unlock(&cache->lock);
    if (!r) return lathe_fail(err, LATHE_ERR_MEMORY, "out of memory");
    if (fresh) {
        lathe_status status = build(r, cache, recipe, err);
        settle(cache, r, status);
        if (status) return status;
    }
    *out = r;
    return LATHE_OK;
}

void lathe__cache_release(lathe_cache *cache, lathe_representation *r) {
    pthread_mutex_lock(&cache->lock);
    bool last = !--r->references;
    pthread_mutex_unlock(&cache->lock);
    if (last) free_representation(r);
}

void lathe__cache_forget(lathe_cache *cache, const lathe_entry *entry) {
    lathe_representation *dead = NULL, *next;
    pthread_mutex_lock(&cache->lock);
    for (lathe_representation *r = cache->oldest; r; r = next) {
        next = r->newer;
        if (r->entry != entry) continue;
        if ((r = drop(cache, r))) r->chain = dead, dead = r;
    }
    pthread_mutex_unlock(&cache->lock);
    free_chain(dead);
}
