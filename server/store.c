/* The models that are served: archives given one by one or found in directories, read again when a file has changed. An
 * archive is published by renaming it into place, so a mapped file never changes under us. */
#include "service.h"
#include <dirent.h>
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* A file that was refused is remembered, so that it is reported once and not each time we look. */
typedef struct refused {
    char *path;
    struct stat stat;
    struct refused *next;
} refused;
struct lathe_store {
    pthread_mutex_t lock;  /* of entries, count, generation */
    lathe_entry **entries; /* sorted by id */
    size_t count;
    uint64_t generation;
    char **paths; /* as given */
    size_t path_count;
    refused *refused;
};
typedef struct found {
    char *path;
    char id[LATHE_ID_SIZE];
} found;
typedef struct finds {
    found *items;
    size_t count, capacity;
} finds;

lathe_entry *lathe__entry_retain(lathe_entry *entry) {
    atomic_fetch_add(&entry->references, 1);
    return entry;
}

void lathe__entry_release(lathe_entry *entry) {
    if (!entry || atomic_fetch_sub(&entry->references, 1) != 1) return;
    lathe_model_close(&entry->model);
    pthread_mutex_destroy(&entry->bounds_lock);
    free(entry->path);
    free(entry);
}

static bool same_file(const struct stat *a, const struct stat *b) {
    return a->st_dev == b->st_dev && a->st_ino == b->st_ino && a->st_size == b->st_size &&
           a->st_mtim.tv_sec == b->st_mtim.tv_sec && a->st_mtim.tv_nsec == b->st_mtim.tv_nsec;
}

/* The file's name without directory and suffix in [a-z0-9._-]{1,64}. */
static void id_of_path(char id[LATHE_ID_SIZE], const char *path) {
    const char *name = strrchr(path, '/');
    name = name ? name + 1 : path;
    size_t size = strlen(name);
    while (size > 6 && !strncmp(name + size - 6, ".lathe", 6)) size -= 6;
    if (size > LATHE_ID_SIZE - 1) size = LATHE_ID_SIZE - 1;
    for (size_t i = 0; i < size; i++) {
        char c = name[i] >= 'A' && name[i] <= 'Z' ? (char)(name[i] - 'A' + 'a') : name[i];
        bool fine = (c >= 'a' && c <= 'z') || (c >= '0' && c <= '9') || c == '_' || c == '-' || (c == '.' && i > 0);
        id[i] = fine ? c : '-';
    }
    if (!size) id[size++] = '-';
    id[size] = 0;
}

static int by_id(const void *a, const void *b) {
    const found *x = a, *y = b;
    int order = strcmp(x->id, y->id);
    return order ? order : strcmp(x->path, y->path);
}

static bool add_find(finds *list, const char *directory, const char *name) {
    if (list->count == list->capacity) {
        size_t capacity = list->capacity ? list->capacity * 2 : 16;
        found *grown = realloc(list->items, capacity * sizeof *grown);
        if (!grown) return false;
        list->items = grown;
        list->capacity = capacity;
    }
    found *item = &list->items[list->count];
    size_t size = (directory ? strlen(directory) + 1 : 0) + strlen(name) + 1;
    if (!(item->path = malloc(size))) return false;
    snprintf(item->path, size, "%s%s%s", directory ? directory : "", directory ? "/" : "", name);
    id_of_path(item->id, item->path);
    list->count++;
    return true;
}

static void add_directory(finds *list, const char *path) {
    DIR *directory = opendir(path);
    if (!directory) return;
    for (struct dirent *at; (at = readdir(directory));) {
        size_t size = strlen(at->d_name);
        /* Names with a dot in front are files being written. */
        if (at->d_name[0] != '.' && size > 6 && !strcmp(at->d_name + size - 6, ".lathe"))
            add_find(list, path, at->d_name);
    }
    closedir(directory);
}

static finds find_all(const lathe_store *store) {
    finds list = {0};
    for (size_t i = 0; store->paths && i < store->path_count; i++) {
        struct stat stat_;
        if (!store->paths[i] || stat(store->paths[i], &stat_)) continue;
        if (S_ISDIR(stat_.st_mode))
            add_directory(&list, store->paths[i]);
        else
            add_find(&list, NULL, store->paths[i]);
    }
    if (list.count) qsort(list.items, list.count, sizeof *list.items, by_id);
    return list;
}

static lathe_status open_entry(lathe_entry **out, const found *file, const struct stat *stat_, lathe_error *err) {
    lathe_entry *entry = calloc(1, sizeof *entry);
    if (!entry) return lathe_fail(err, LATHE_ERR_MEMORY, "%s: out of memory", file->path);
    atomic_init(&entry->references, 1);
    pthread_mutex_init(&entry->bounds_lock, NULL);
    memcpy(entry->id, file->id, sizeof entry->id);
    entry->stat = *stat_;
    entry->path = strdup(file->path);
    lathe_status status = entry->path ? lathe_model_open(&entry->model, file->path, err) : LATHE_ERR_MEMORY;
    if (!status) status = lathe_model_check(entry->model, err);
    if (!status) entry->info = lathe_model_describe(entry->model);
    if (!status && (!entry->info->structure_count || !entry->info->level_count))
        status = lathe_fail(err, LATHE_ERR_FORMAT, "it has no structure or no level");
    if (status) {
        lathe__entry_release(entry);
        return status;
    }
    size_t size;
    const uint8_t *bytes = lathe_model_bytes(entry->model, &size);
    lathe__hash(entry->hash, bytes, size);
    *out = entry;
    return LATHE_OK;
}

/* True the first time. */
static bool refuse(lathe_store *store, const char *path, const struct stat *stat_) {
    for (refused *r = store->refused; r; r = r->next) {
        if (!strcmp(r->path, path)) {
            bool again = same_file(&r->stat, stat_);
            r->stat = *stat_;
            return !again;
        }
    }
    refused *r = calloc(1, sizeof *r);
    if (r && (r->path = strdup(path))) {
        r->stat = *stat_;
        r->next = store->refused;
        store->refused = r;
    } else
        free(r);
    return true;
}

static bool was_refused(const lathe_store *store, const char *path, const struct stat *stat_) {
    for (const refused *r = store->refused; r; r = r->next)
        if (!strcmp(r->path, path)) return same_file(&r->stat, stat_);
    return false;
}

/* The entry of a file: the one we have if the file is the same, else opened; NULL if it is refused. */
static lathe_entry *entry_of(lathe_store *store, const found *file) {
    struct stat stat_;
    if (stat(file->path, &stat_)) return NULL;
    for (size_t i = 0; i < store->count; i++) {
        lathe_entry *have = store->entries[i];
        if (!strcmp(have->path, file->path) && same_file(&have->stat, &stat_)) return lathe__entry_retain(have);
    }
    if (was_refused(store, file->path, &stat_)) return NULL;
    lathe_entry *entry = NULL;
    lathe_error err = {""};
    lathe_status status = open_entry(&entry, file, &stat_, &err);
    if (status && refuse(store, file->path, &stat_))
        fprintf(stderr, "lathe: %s is not served: %s%s%s\n", file->path, lathe_status_name(status),
                err.text[0] ? ": " : "", err.text);
    return entry;
}

static lathe_entry **load_all(lathe_store *store, const finds *files, size_t *count) {
    lathe_entry **entries = calloc(files->count + 1, sizeof(lathe_entry *));
    *count = 0;
    for (size_t i = 0; entries && i < files->count; i++) {
        bool taken = *count && !strcmp(entries[*count - 1]->id, files->items[i].id);
        struct stat stat_;
        if (taken && !stat(files->items[i].path, &stat_)) {
            if (strcmp(entries[*count - 1]->path, files->items[i].path) != 0 &&
                refuse(store, files->items[i].path, &stat_))
                fprintf(stderr, "lathe: %s is not served: %s has the same id `%s`\n", files->items[i].path,
                        entries[*count - 1]->path, files->items[i].id);
            continue;
        }
        lathe_entry *entry = entry_of(store, &files->items[i]);
        if (entry) entries[(*count)++] = entry;
    }
    return entries;
}

static bool contains(lathe_entry *const *entries, size_t count, const lathe_entry *entry) {
    for (size_t i = 0; i < count; i++)
        if (entries[i] == entry) return true;
    return false;
}

void lathe__store_refresh(lathe_store *store, lathe_cache *cache) {
    finds files = find_all(store);
    size_t count;
    lathe_entry **entries = load_all(store, &files, &count);
    for (size_t i = 0; i < files.count; i++) free(files.items[i].path);
    free(files.items);
    if (!entries) return;
    bool changed = count != store->count;
    for (size_t i = 0; i < count && !changed; i++) changed = entries[i] != store->entries[i];
    lathe_entry **old = entries;
    size_t old_count = count;
    if (changed) {
        pthread_mutex_lock(&store->lock);
        old = store->entries, old_count = store->count;
        store->entries = entries, store->count = count;
        store->generation++;
        pthread_mutex_unlock(&store->lock);
    }
    for (size_t i = 0; i < old_count; i++) {
        if (changed && cache && !contains(entries, count, old[i])) lathe__cache_forget(cache, old[i]);
        lathe__entry_release(old[i]);
    }
    free(old);
}

lathe_status lathe__store_open(lathe_store **out, const char *const *paths, size_t count, lathe_error *err) {
    for (size_t i = 0; i < count; i++) {
        struct stat stat_;
        if (stat(paths[i], &stat_)) return lathe_fail(err, LATHE_ERR_IO, "%s: %s", paths[i], strerror(errno));
    }
    lathe_store *store = calloc(1, sizeof *store);
    if (!store) return lathe_fail(err, LATHE_ERR_MEMORY, "out of memory");
    pthread_mutex_init(&store->lock, NULL);
    store->paths = calloc(count + 1, sizeof *store->paths);
    bool failed = !store->paths;
    for (size_t i = 0; i < count && !failed; i++, store->path_count++) failed = !(store->paths[i] = strdup(paths[i]));
    if (failed) {
        lathe__store_close(&store);
        return lathe_fail(err, LATHE_ERR_MEMORY, "out of memory");
    }
    lathe__store_refresh(store, NULL);
    *out = store;
    return LATHE_OK;
}

void lathe__store_close(lathe_store **store) {
    if (!*store) return;
    for (size_t i = 0; i < (*store)->count; i++) lathe__entry_release((*store)->entries[i]);
    for (size_t i = 0; (*store)->paths && i < (*store)->path_count; i++) free((*store)->paths[i]);
    for (refused *r = (*store)->refused, *next; r; r = next) {
        next = r->next;
        free(r->path);
        free(r);
    }
    free((*store)->entries);
    free((*store)->paths);
    pthread_mutex_destroy(&(*store)->lock);
    free(*store);
    *store = NULL;
}

lathe_entry *lathe__store_find(lathe_store *store, const char *id) {
    lathe_entry *entry = NULL;
    pthread_mutex_lock(&store->lock);
    for (size_t low = 0, high = store->count; low < high;) {
        size_t middle = low + (high - low) / 2;
        int order = strcmp(id, store->entries[middle]->id);
        if (!order) {
            entry = lathe__entry_retain(store->entries[middle]);
            break;
        }
        if (order < 0)
            high = middle;
        else
            low = middle + 1;
    }
    pthread_mutex_unlock(&store->lock);
    return entry;
}

lathe_entry **lathe__store_list(lathe_store *store, size_t *count, uint64_t *generation) {
    pthread_mutex_lock(&store->lock);
    lathe_entry **list = calloc(store->count + 1, sizeof(lathe_entry *));
    *count = list ? store->count : 0;
    *generation = store->generation;
    for (size_t i = 0; i < *count; i++) list[i] = lathe__entry_retain(store->entries[i]);
    pthread_mutex_unlock(&store->lock);
    return list;
}

static bool measure_bounds(const lathe_entry *entry, int64_t structure, double low[3], double high[3]) {
    lathe_world_mesh mesh = {0};
    if (lathe_model_mesh(&mesh, entry->model, structure, 0, NULL)) return false;
    for (int axis = 0; axis < 3; axis++) low[axis] = INFINITY, high[axis] = -INFINITY;
    for (size_t i = 0; i < 3 * (size_t)mesh.vertex_count; i++) {
        double at = mesh.positions[i];
        if (at < low[i % 3]) low[i % 3] = at;
        if (at > high[i % 3]) high[i % 3] = at;
    }
    lathe_world_mesh_free(&mesh);
    return low[0] <= high[0];
}

bool lathe__entry_bounds(lathe_entry *entry, int64_t structure, double low[3], double high[3]) {
    if (structure >= 0) return measure_bounds(entry, structure, low, high);
    pthread_mutex_lock(&entry->bounds_lock);
    if (!entry->bounds_state) entry->bounds_state = measure_bounds(entry, -1, entry->low, entry->high) ? 1 : -1;
    bool known = entry->bounds_state > 0;
    pthread_mutex_unlock(&entry->bounds_lock);
    for (int axis = 0; axis < 3; axis++) low[axis] = entry->low[axis], high[axis] = entry->high[axis];
    return known;
}

uint32_t lathe__entry_levels(const lathe_entry *entry, int64_t structure) {
    return structure < 0 ? entry->info->level_count : entry->info->structures[structure].level_count;
}
