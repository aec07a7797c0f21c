/* Exact checks of a mesh: a look at the triangles around each vertex settles edges, fans and components together. */
#include "mesh.h"
#include "mesh_intersect.h"
#include <stdlib.h>
#include <string.h>

/* A corner at some vertex v of triangle (v, next, previous): the edge of v's link from next to previous. */
typedef struct link {
    uint32_t next, previous, triangle;
} link;

typedef struct check {
    const lathe_mesh *mesh;
    lathe_mesh_report *report;
    uint32_t *first; /* vertex_count + 1: where a vertex's links begin */
    link *links;
    uint32_t *parent; /* union-find over triangles; UINT32_MAX: left out, its indices are bad */
    uint64_t edges, used;
} check;

static bool has_good_indices(const lathe_mesh *mesh, const uint32_t t[3]) {
    return t[0] < mesh->vertex_count && t[1] < mesh->vertex_count && t[2] < mesh->vertex_count;
}

static uint32_t find_root(uint32_t *parent, uint32_t k) {
    while (parent[k] != k) k = parent[k] = parent[parent[k]];
    return k;
}

static void unite(check *c, uint32_t a, uint32_t b) {
    a = find_root(c->parent, a);
    b = find_root(c->parent, b);
    if (a < b)
        c->parent[b] = a;
    else
        c->parent[a] = b;
}

static void collect_links(check *c) {
    const lathe_mesh *mesh = c->mesh;
    for (size_t k = 0; k < mesh->triangle_count; k++) {
        const uint32_t *t = mesh->triangles[k];
        bool good = has_good_indices(mesh, t);
        c->parent[k] = good ? (uint32_t)k : UINT32_MAX;
        c->report->bad_indices += !good;
        for (int i = 0; good && i < 3; i++) c->first[t[i]]++;
    }
    uint32_t sum = 0;
    for (size_t v = 0; v <= mesh->vertex_count; v++) {
        uint32_t n = c->first[v];
        c->first[v] = sum;
        sum += n;
    }
    for (size_t k = 0; k < mesh->triangle_count; k++) {
        const uint32_t *t = mesh->triangles[k];
        if (c->parent[k] == UINT32_MAX) continue;
        if (lathe__triangle_degenerate(mesh->lattice[t[0]], mesh->lattice[t[1]], mesh->lattice[t[2]]))
            c->report->degenerate_triangles++;
        for (int i = 0; i < 3; i++) c->links[c->first[t[i]]++] = (link){t[(i + 1) % 3], t[(i + 2) % 3], (uint32_t)k};
    }
    memmove(c->first + 1, c->first, mesh->vertex_count * sizeof *c->first); /* the ends are the next ones' beginnings */
    c->first[0] = 0;
}

/* Reorders the links into one closed fan with every neighbour met once; false if they are not one. */
static bool chain_fan(link *links, uint32_t n) {
    for (uint32_t i = 0; i + 1 < n; i++) {
        uint32_t want = links[i].previous, k = i + 1;
        while (k < n && links[k].next != want) k++;
        if (k == n) return false;
        link l = links[k];
        links[k] = links[i + 1];
        links[i + 1] = l;
    }
    if (n < 2 || links[n - 1].previous != links[0].next) return false;
    for (uint32_t i = 0; i < n; i++)
        for (uint32_t k = i + 1; k < n; k++)
            if (links[i].next == links[k].next) return false;
    return true;
}

static void count_fan_edges(check *c, uint32_t v, const link *links, uint32_t n) {
    for (uint32_t i = 0; i < n; i++) {
        if (links[i].next < v) continue; /* an edge counts at its lower end */
        c->edges++;
        unite(c, links[i].triangle, links[i ? i - 1 : n - 1].triangle);
    }
}

/* ---- the general case: many triangles, or no single closed fan ---- */

/* One half-edge at a vertex: to or from a neighbour. */
typedef struct spoke {
    uint32_t neighbour, triangle, outgoing, link;
} spoke;

static int compare_spokes(const void *a, const void *b) {
    const spoke *s = a, *t = b;
    if (s->neighbour != t->neighbour) return s->neighbour < t->neighbour ? -1 : 1;
    return s->outgoing != t->outgoing ? (s->outgoing < t->outgoing ? 1 : -1)
           : s->link < t->link        ? -1
                                      : s->link > t->link;
}

static void count_edge(check *c, uint32_t v, const spoke *spokes, uint32_t n) {
    if (spokes->neighbour < v) return;
    uint32_t outgoing = 0;
    c->edges++;
    for (uint32_t i = 0; i < n; i++) {
        outgoing += spokes[i].outgoing;
        unite(c, spokes[0].triangle, spokes[i].triangle);
    }
    /* An edge from v to itself shows both of its ends here; its triangle is degenerate. */
    if (n == 1)
        c->report->boundary_edges++;
    else if (n > 2)
        c->report->nonmanifold_edges++;
    else if (outgoing != 1)
        c->report->misoriented_edges++;
}

/* after[k]: the link that follows link k around v. True when following it from link 0 meets all of them. */
static bool is_one_cycle(const uint32_t *after, uint32_t n) {
    uint32_t k = 0, steps = 0;
    do {
        k = after[k];
        steps++;
    } while (k && k != UINT32_MAX && steps < n);
    return !k && steps == n;
}

static lathe_status check_spokes(check *c, uint32_t v, const link *links, uint32_t n) {
    spoke *spokes = malloc(2 * (size_t)n * sizeof *spokes);
    uint32_t *after = malloc((size_t)n * sizeof *after);
    lathe_status status = LATHE_ERR_MEMORY;
    if (!spokes || !after) goto cleanup;
    for (uint32_t k = 0; k < n; k++) {
        spokes[2 * k] = (spoke){links[k].next, links[k].triangle, 1, k};
        spokes[2 * k + 1] = (spoke){links[k].previous, links[k].triangle, 0, k};
        after[k] = UINT32_MAX;
    }
    qsort(spokes, 2 * (size_t)n, sizeof *spokes, compare_spokes);
    for (size_t i = 0, end; i < 2 * (size_t)n; i = end) {
        for (end = i; end < 2 * (size_t)n && spokes[end].neighbour == spokes[i].neighbour;) end++;
        count_edge(c, v, spokes + i, (uint32_t)(end - i));
        if (end - i == 2 && spokes[i].outgoing && !spokes[i + 1].outgoing) after[spokes[i + 1].link] = spokes[i].link;
    }
    if (!is_one_cycle(after, n)) c->report->nonmanifold_vertices++;
    status = LATHE_OK;
cleanup:
    free(spokes);
    free(after);
    return status;
}

static lathe_status check_vertices(check *c) {
    enum { SMALL = 24 }; /* up to here chaining by search beats sorting */
    for (uint32_t v = 0; v < c->mesh->vertex_count; v++) {
        link *links = c->links + c->first[v];
        uint32_t n = c->first[v + 1] - c->first[v];
        if (!n) {
            c->report->unused_vertices++;
            continue;
        }
        c->used++;
        if (n <= SMALL && chain_fan(links, n)) {
            count_fan_edges(c, v, links, n);
            continue;
        }
        lathe_status status = check_spokes(c, v, links, n);
        if (status != LATHE_OK) return status;
    }
    return LATHE_OK;
}

static lathe_status check_connectivity(lathe_mesh_report *report, const lathe_mesh *mesh) {
    size_t vertices = mesh->vertex_count, triangles = mesh->triangle_count;
    lathe_status status = LATHE_ERR_MEMORY;
    check c = {.mesh = mesh, .report = report};
    if (triangles > UINT32_MAX / 3) return LATHE_ERR_LIMIT;
    c.first = calloc(vertices + 1, sizeof *c.first);
    c.links = malloc((3 * triangles + 1) * sizeof *c.links);
    c.parent = malloc((triangles + 1) * sizeof *c.parent);
    if (!c.first || !c.links || !c.parent) goto cleanup;
    collect_links(&c);
    if ((status = check_vertices(&c)) != LATHE_OK) goto cleanup;
    for (size_t k = 0; k < triangles; k++) report->components += c.parent[k] == k;
    report->euler = (int64_t)c.used - (int64_t)c.edges + (int64_t)(triangles - report->bad_indices);
cleanup:
    free(c.first);
    free(c.links);
    free(c.parent);
    return status;
}

/* ---- positions that occur twice ---- */

static uint64_t hash_position(const int32_t p[3]) {
    uint64_t h = ((uint64_t)(uint32_t)p[0] << 32 | (uint32_t)p[1]) * 0x9E3779B97F4A7C15u;
    h = (h ^ h >> 29 ^ (uint32_t)p[2]) * 0xBF58476D1CE4E5B9u;
    return h ^ h >> 32;
}

static lathe_status count_duplicates(uint64_t *out, const int32_t (*positions)[3], uint32_t count) {
    size_t size = 16;
    while (size < 2 * (size_t)count) size *= 2;
    uint32_t *slots = malloc(size * sizeof *slots);
    if (!slots) return LATHE_ERR_MEMORY;
    memset(slots, 0xFF, size * sizeof *slots);
    uint64_t found = 0;
    for (uint32_t v = 0; v < count; v++) {
        size_t at = (size_t)hash_position(positions[v]) & (size - 1);
        while (slots[at] != UINT32_MAX && memcmp(positions[slots[at]], positions[v], sizeof *positions))
            at = (at + 1) & (size - 1);
        if (slots[at] != UINT32_MAX)
            found++;
        else
            slots[at] = v;
    }
    free(slots);
    *out = found;
    return LATHE_OK;
}

lathe_status lathe__mesh_check(lathe_mesh_report *out, const lathe_mesh *mesh, bool intersections) {
    lathe_mesh_report report = {0};
    lathe_status status = check_connectivity(&report, mesh);
    if (status == LATHE_OK)
        status = count_duplicates(&report.duplicate_positions, (const int32_t(*)[3])mesh->lattice, mesh->vertex_count);
    if (status == LATHE_OK && intersections) status = lathe__mesh_intersections(&report.self_intersections, mesh);
    if (status == LATHE_OK) *out = report;
    return status;
}

lathe_status lathe__mesh_float_duplicates(uint64_t *out, const lathe_mesh *mesh, const lathe_transform *transform) {
    size_t count = mesh->vertex_count;
    float *positions = malloc((3 * count + 1) * sizeof *positions);
    int32_t(*bits)[3] = malloc((count + 1) * sizeof *bits);
    lathe_status status = LATHE_ERR_MEMORY;
    if (positions && bits) {
        lathe_mesh_positions(mesh, transform, positions);
        for (size_t k = 0; k < 3 * count; k++) positions[k] += 0.0f; /* -0 becomes 0 */
        memcpy(bits, positions, 3 * count * sizeof *positions);
        status = count_duplicates(out, (const int32_t(*)[3])bits, mesh->vertex_count);
    }
    free(positions);
    free(bits);
    return status;
}
