/* What the server's files share. A request: routes.c matches it, a handle_*.c says which representation is wanted (a
 * recipe), representation.c builds it or has it, respond.c sends it. */
#ifndef LATHE_SERVICE_H
#define LATHE_SERVICE_H
#include "lathe_codec.h"
#include "server.h"
#include <jansson.h>
#include <microhttpd.h>
#include <pthread.h>
#include <stdatomic.h>
#include <sys/stat.h>

/* ---- buffer.c: bytes that grow, a hash, base64 ---- */
typedef struct lathe_buffer { uint8_t *bytes; size_t size, capacity; } lathe_buffer;
int lathe__buffer_append(void *buffer, const void *bytes, size_t size);     /* a lathe_sink; non-zero: out of memory */
int lathe__buffer_text(lathe_buffer *buffer, const char *text);
int lathe__buffer_base64(lathe_buffer *buffer, const uint8_t *bytes, size_t size);
void lathe__buffer_free(lathe_buffer *buffer);
enum { LATHE_HASH_SIZE = 33 };
/* 128 bits as 32 hex digits. Tells versions apart; not made to withstand somebody who searches for collisions. */
void lathe__hash(char out[LATHE_HASH_SIZE], const void *bytes, size_t size);

/* ---- store.c: the models that are served ---- */
enum { LATHE_ID_SIZE = 65 };
typedef struct lathe_entry {
    atomic_int references;
    char id[LATHE_ID_SIZE], hash[LATHE_HASH_SIZE];
    char *path;
    struct stat stat;              /* of the file when it was opened */
    lathe_model *model;
    const lathe_model_info *info;
    pthread_mutex_t bounds_lock;
    int bounds_state;              /* 0: not asked for yet, 1: known, -1: level 0 has no mesh */
    double low[3], high[3];        /* of level 0, world mm */
} lathe_entry;
typedef struct lathe_store lathe_store;
typedef struct lathe_cache lathe_cache;
/* MEMORY, or IO if a given path does not exist. Damaged archives are reported on stderr and skipped. */
lathe_status lathe__store_open(lathe_store **out, const char *const *paths, size_t count, lathe_error *err);
void lathe__store_close(lathe_store **store);
/* Looks for new, changed and vanished archives; what was built of the old ones leaves the cache. One thread only. */
void lathe__store_refresh(lathe_store *store, lathe_cache *cache);
lathe_entry *lathe__store_find(lathe_store *store, const char *id);          /* NULL, or to be released */
/* All entries in the order of their ids, to be released one by one, the array freed. NULL: out of memory. */
lathe_entry **lathe__store_list(lathe_store *store, size_t *count, uint64_t *generation);
lathe_entry *lathe__entry_retain(lathe_entry *entry);
void lathe__entry_release(lathe_entry *entry);
/* The box of level 0 of one structure, or of all (-1, remembered); false if it cannot be built. */
bool lathe__entry_bounds(lathe_entry *entry, int64_t structure, double low[3], double high[3]);

/* ---- representation.c: what has been built, in memory up to a limit ---- */
typedef enum lathe_encoding { LATHE_IDENTITY, LATHE_GZIP, LATHE_BROTLI, LATHE_NONE_ACCEPTABLE } lathe_encoding;
enum lathe_traits { LATHE_COMPRESSIBLE = 1, LATHE_PAGE = 2, LATHE_RANGES = 4 };
/* The bytes: either owned (malloc) or part of an entry's mapped archive. */
typedef struct lathe_body {
    atomic_int references;
    const uint8_t *bytes;
    size_t size;
    uint8_t *owned;
    lathe_entry *entry;
} lathe_body;
typedef lathe_status (*lathe_build)(lathe_body *body, void *context, lathe_error *err);
typedef struct lathe_recipe {
    char key[192];                 /* names the bytes: model, its hash, what of it */
    const char *type;              /* Content-Type, constant text */
    char file_name[112];           /* for Content-Disposition; "": none */
    unsigned traits;
    lathe_entry *entry;            /* of which model; NULL: of none */
    lathe_build build;
    void *context;
} lathe_recipe;
typedef struct lathe_representation {
    char *key;
    const char *type;
    unsigned traits;
    lathe_encoding encoding;
    char etag[LATHE_HASH_SIZE + 2];
    char file_name[112];
    lathe_body *body;
    const lathe_entry *entry;      /* only compared, never followed */
    struct MHD_Response *full[2], *unchanged[2];   /* 200 and 304; [1]: for a URL that names the version */
    int references, state;         /* under the cache's lock, as what follows */
    uint64_t hash;
    struct lathe_representation *chain, *newer, *older;
} lathe_representation;
lathe_status lathe__cache_open(lathe_cache **out, size_t limit);
void lathe__cache_close(lathe_cache **cache);
/* Built by one thread while the others wait; to be released. */
lathe_status lathe__cache_get(lathe_representation **out, lathe_cache *cache, const lathe_recipe *recipe,
                              lathe_encoding encoding, lathe_error *err);
void lathe__cache_release(lathe_cache *cache, lathe_representation *representation);
void lathe__cache_forget(lathe_cache *cache, const lathe_entry *entry);
void lathe__body_release(void *body);

/* compress.c */
lathe_status lathe__compress(lathe_buffer *out, const uint8_t *bytes, size_t size, lathe_encoding encoding, bool best);
lathe_encoding lathe__negotiate(const char *accept_encoding, bool compressible);

/* ---- connection.c: absolute deadlines, because the library's timeout only sees inactivity ---- */
typedef struct lathe_service lathe_service;
typedef struct lathe_peer {
    lathe_service *service;
    int fd;
    atomic_llong deadline;         /* milliseconds of the monotonic clock; 0: none */
    atomic_bool busy;              /* a request's headers are in and its reply is not all sent */
    struct lathe_peer *previous, *next;
} lathe_peer;
int64_t lathe__now_ms(void);
void lathe__peer_event(void *service, struct MHD_Connection *connection, void **socket_context,
                       enum MHD_ConnectionNotificationCode code);
lathe_peer *lathe__peer_of(struct MHD_Connection *connection);
void lathe__peer_begin(lathe_peer *peer);
void lathe__peer_reply(lathe_peer *peer, uint64_t size);   /* from now on the client must keep reading */
void lathe__peer_end(lathe_peer *peer);
/* Shuts down the sockets of peers past their deadline; with idle also of all that have no request running, with all of
 * every one. Returns how many peers there are. */
size_t lathe__peers_reap(lathe_service *service, bool idle, bool all);

struct lathe_service {
    lathe_serve_options options;
    lathe_store *store;
    lathe_cache *cache;
    pthread_mutex_t peers_lock;
    lathe_peer *peers;
    atomic_bool draining;
};

/* ---- request.c ---- */
enum { LATHE_MAX_SEGMENTS = 6, LATHE_MAX_QUERY = 16 };
typedef struct lathe_request {
    lathe_service *service;
    struct MHD_Connection *connection;
    lathe_peer *peer;
    char *target, *logged;         /* the request target: cut up in place, and as it came */
    uintptr_t target_address;      /* where the library has it */
    const char *method;            /* "" until the headers are in */
    char *segments[LATHE_MAX_SEGMENTS];
    unsigned segment_count;
    struct { const char *name, *value; } query[LATHE_MAX_QUERY];
    unsigned query_count;
    const char *captures[2];       /* what the route's stars matched */
    bool vetted;                   /* the headers are in and were found good */
    bool close;                    /* the connection must not be used again */
    unsigned status;
    uint64_t bytes;
    int64_t started;
} lathe_request;
void *lathe__request_begin(void *service, const char *target, struct MHD_Connection *connection);
void lathe__request_end(void *service, struct MHD_Connection *connection, void **request,
                        enum MHD_RequestTerminationCode code);
/* What HTTP leaves to be misunderstood between us and a proxy, and what is malformed: 0, or the status and *why. */
unsigned lathe__request_vet(lathe_request *request, const char *version, const char **why);
/* Cuts the target into decoded segments and query parameters: 0 or the status and *why. */
unsigned lathe__request_parse(lathe_request *request, const char **why);
const char *lathe__request_header(const lathe_request *request, const char *name);   /* NULL: none */
const char *lathe__request_query(const lathe_request *request, const char *name);    /* NULL: none */
bool lathe__parse_number(const char *text, uint32_t *number);                        /* digits only, below 10000 */
/* The model of captures[0]; NULL: replied (*result). Checks ?v= too. */
lathe_entry *lathe__request_entry(lathe_request *request, enum MHD_Result *result);
/* ?structure=: *structure is an index or -1 for all; false: replied. */
bool lathe__request_structure(lathe_request *request, const lathe_entry *entry, int64_t *structure,
                              enum MHD_Result *result);
/* The levels a structure, or the model (-1), has. */
uint32_t lathe__entry_levels(const lathe_entry *entry, int64_t structure);

/* ---- respond.c: every reply ---- */
enum MHD_Result lathe__respond(lathe_request *request, const lathe_recipe *recipe);
enum MHD_Result lathe__respond_problem(lathe_request *request, unsigned status, const char *format, ...)
    __attribute__((format(printf, 3, 4)));
enum MHD_Result lathe__respond_not_allowed(lathe_request *request);
enum MHD_Result lathe__respond_options(lathe_request *request);
/* The responses of a representation; false: out of memory. */
bool lathe__representation_dress(lathe_representation *representation);

/* ---- routes.c ---- */
typedef enum MHD_Result (*lathe_handler)(lathe_request *request);
enum MHD_Result lathe__route(void *service, struct MHD_Connection *connection, const char *url, const char *method,
                             const char *version, const char *upload, size_t *upload_size, void **request);

/* ---- handle_*.c ---- */
enum MHD_Result lathe__handle_index(lathe_request *request);
enum MHD_Result lathe__handle_page(lathe_request *request);
enum MHD_Result lathe__handle_models(lathe_request *request);
enum MHD_Result lathe__handle_manifest(lathe_request *request);
enum MHD_Result lathe__handle_archive(lathe_request *request);
enum MHD_Result lathe__handle_level(lathe_request *request);
enum MHD_Result lathe__handle_delta(lathe_request *request);
enum MHD_Result lathe__handle_stream(lathe_request *request);
enum MHD_Result lathe__handle_draco_delta(lathe_request *request);
enum MHD_Result lathe__handle_draco_page(lathe_request *request);
enum MHD_Result lathe__handle_extras(lathe_request *request);
enum MHD_Result lathe__handle_slice_picture(lathe_request *request);
enum MHD_Result lathe__handle_slice_outline(lathe_request *request);
enum MHD_Result lathe__handle_slice_contour(lathe_request *request);
enum MHD_Result lathe__handle_health(lathe_request *request);

/* ---- manifest.c ---- */
/* The manifest of a model. NULL: out of memory. */
json_t *lathe__manifest(lathe_entry *entry);
/* What the viewer reads of it, which its page carries; structure: only this one, or -1. */
json_t *lathe__page_manifest(lathe_entry *entry, int64_t structure);
json_t *lathe__json_name(const char *text);     /* a string, also of bytes that are not UTF-8 */
/* Compact, and safe inside a <script>: no '<' in it. */
lathe_status lathe__json_write(lathe_buffer *out, json_t *json);

extern const unsigned char lathe_viewer_html[];
extern const size_t lathe_viewer_html_size;
extern const unsigned char lathe_decoder_text[];   /* a decoder as the page carries it: of every model */
extern const size_t lathe_decoder_text_size;
extern const unsigned char lathe_rasters_text[];   /* of models made of rasters */
extern const size_t lathe_rasters_text_size;
extern const unsigned char lathe_tubes_text[];     /* of radius maps whose tubes are plain */
extern const size_t lathe_tubes_text_size;
extern const unsigned char lathe_extras_js[];
extern const size_t lathe_extras_js_size;
extern const unsigned char lathe_draco_html[];
extern const size_t lathe_draco_html_size;
#endif
