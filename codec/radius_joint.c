/* Plain tubes: where they go on, strips; where they part, merge, begin or end, their rings are joined as they are. Rings of one slice
 * become a single closed chain of vertices [Christiansen and Sederberg 1978], with the shortest bridges there are; two chains are tiled like any two
 * contours, by the path that is least in sum [Fuchs, Kedem and Uselton 1977]. Every edge of a ring is in one triangle below and in one
 * above, every edge of a bridge in two: the surface is closed. Whether it crosses itself is for the encoder to find out. */
#include <string.h>
#include "radius_stack.h"

typedef struct chain { uint32_t *vertices, count; } chain;
typedef const int32_t (*places)[3];

/* Of two vertices as seen from above, squared. Coordinates that are too large wrap. */
static inline uint64_t apart(places at, uint32_t a, uint32_t b) {
    uint64_t x = (uint64_t)((int64_t)at[a][0] - at[b][0]), y = (uint64_t)((int64_t)at[a][1] - at[b][1]);
    return x * x + y * y;
}

static bool comes_once(const chain *c, uint32_t i) {
    uint32_t times = 0;
    for (uint32_t k = 0; k < c->count; k++) times += c->vertices[k] == c->vertices[i];
    return times == 1;
}

/* Of vertices that their chains come by once: of the others it would not be known when. */
static void nearest(uint32_t *a, uint32_t *b, places at, const chain *p, const chain *q) {
    uint64_t least = UINT64_MAX;
    for (uint32_t i = 0; i < p->count; i++)
        for (uint32_t k = 0; k < q->count; k++) {
            uint64_t d = apart(at, p->vertices[i], q->vertices[k]);
            if (d < least && comes_once(p, i) && comes_once(q, k)) least = d, *a = i, *b = k;
        }
}

static uint32_t add_vertex(lathe_mesh *mesh, int32_t x, int32_t y, int32_t z) {
    int32_t *v = mesh->lattice[mesh->vertex_count];
    v[0] = x, v[1] = y, v[2] = z;
    return mesh->vertex_count++;
}

/* The ring is walked around between two visits of the vertex that is nearest to it. The bridge between them has a vertex of its own in the
 * middle, `rise` off the slice: edges in a slice are edges of rings. */
static void add_ring(chain *c, lathe_mesh *mesh, uint32_t first, uint32_t rays, int32_t rise) {
    uint32_t ring[LATHE_RADIUS_MAX_RAYS], from = 0, to = 0, *v = c->vertices;
    for (uint32_t i = 0; i < rays; i++) ring[i] = first + i;
    if (c->count) {
        nearest(&from, &to, (places)mesh->lattice, c, &(chain){ring, rays});
        const int32_t *a = mesh->lattice[v[from]], *b = mesh->lattice[ring[to]];
        uint32_t middle = add_vertex(mesh, (int32_t)(((int64_t)a[0] + b[0]) / 2), (int32_t)(((int64_t)a[1] + b[1]) / 2), a[2] + rise);
        v += from;
        memmove(v + rays + 4, v, (c->count - from) * sizeof *v);
        v[1] = v[rays + 3] = middle;
        v += 2;
        v[rays] = ring[to];
        c->count += 4;
    }
    for (uint32_t i = 0; i < rays; i++) v[i] = ring[(to + i) % rays];
    c->count += rays;
}

/* Walks around both chains at once from where they are nearest; a triangle stands on each of their edges. A chain may be a single vertex. */
static lathe_status join(lathe_mesh *mesh, lathe_arena *arena, const chain *lower, const chain *upper) {
    places at = (places)mesh->lattice;
    uint32_t from = 0, to = 0, m = lower->count, n = upper->count, rows = m > 1 ? m : 0, columns = n > 1 ? n : 0;
    uint64_t *sum = LATHE_NEW(arena, uint64_t, columns + 1);   /* of squares of rungs, up to each one */
    bool *below = lathe__arena_alloc(arena, (size_t)rows + 1, (size_t)columns + 1), *step = below;   /* is the step to a rung on the lower chain? */
    if (!sum || !below) return LATHE_ERR_MEMORY;
    nearest(&from, &to, at, lower, upper);
    for (uint32_t i = 0; i <= rows; i++)
        for (uint32_t k = 0; k <= columns; k++, step++) {
            *step = !k || (i && sum[k] <= sum[k - 1]);
            uint64_t before = !*step ? sum[k - 1] : i ? sum[k] : 0;
            sum[k] = before + apart(at, lower->vertices[(from + i) % m], upper->vertices[(to + k) % n]);
        }
    for (uint32_t i = rows, k = columns; i | k;) {
        uint32_t *t = mesh->triangles[mesh->triangle_count++];
        t[1] = lower->vertices[(from + i) % m];
        t[2] = upper->vertices[(to + k) % n];
        if (below[(size_t)i * (columns + 1) + k]) {
            t[0] = lower->vertices[(from + --i) % m];
        } else {
            t[0] = t[1], t[1] = t[2];
            t[2] = upper->vertices[(to + --k) % n];
        }
    }
    return LATHE_OK;
}

/* ---- which rings ---- */

static bool is_over(const lathe_tube_ring *a, const lathe_tube_ring *b) {
    double x = (double)a->centre[0] - b->centre[0], y = (double)a->centre[1] - b->centre[1], most = a->most > b->most ? a->most : b->most;
    return x * x + y * y < most * most;
}

/* Do tubes that end or begin in a slab belong together? over: those of a kind that go over into each other; else a hole that ends with what
 * is around it. */
static bool belong(const lathe_tube_stack *s, uint32_t slab, uint32_t t, uint32_t u, bool over) {
    const lathe_radius_tube *tubes = s->radii->tubes;
    int side = lathe__has_ring(s, slab, 1, t), other = lathe__has_ring(s, slab, 1, u);
    if ((tubes[t].hole == tubes[u].hole) != over || (side != other) != over) return false;
    return is_over(lathe__ring_at(s, slab, side, t), lathe__ring_at(s, slab, other, u));
}

/* The tubes that a slab joins with each tube that ends or begins there, itself included; 0: it goes on, or is not there. */
static void find_joints(uint8_t *group, const lathe_tube_stack *s, uint32_t slab) {
    uint32_t n = s->radii->count;
    uint8_t over = 0;
    for (uint32_t t = 0; t < n; t++) group[t] = lathe__has_ring(s, slab, 0, t) != lathe__has_ring(s, slab, 1, t) ? (uint8_t)(1 << t) : 0;
    bool gap = slab && slab < s->count && s->slices[slab] - s->slices[slab - 1] > 1;   /* what ends there does not touch what begins */
    for (int pass = gap; pass < 2; pass++)
        for (uint32_t t = 0; t < n; t++)
            for (uint32_t u = 0; u < t; u++) {
                if (!group[t] || !group[u] || (pass && (over >> t & 1 || over >> u & 1)) || !belong(s, slab, t, u, !pass)) continue;
                lathe__merge_groups(group, n, group[t] | group[u]);
                if (!pass) over |= group[t];
            }
}

/* ---- ends ---- */

/* What nothing follows on ends with its ring once more, as far on as caps rise and an eighth narrower, or wider. */
static uint32_t add_rim(lathe_mesh *mesh, const lathe_tube_ring *r, uint32_t rays, int side, int32_t rise, bool wider) {
    uint32_t rim = mesh->vertex_count;
    for (uint32_t i = 0; i < rays; i++) {
        const int32_t *v = mesh->lattice[r->base + i];
        int32_t at[2];
        for (int k = 0; k < 2; k++) at[k] = v[k] + (int32_t)(((int64_t)v[k] - r->centre[k]) / (wider ? 8 : -8));
        add_vertex(mesh, at[0], at[1], v[2] + rise);
    }
    lathe__radius_strip(mesh->triangles + mesh->triangle_count, (places)mesh->lattice, side ? rim : r->base, side ? r->base : rim, rays);
    mesh->triangle_count += 2 * rays;
    return rim;
}

static void turn_round(chain *c) {
    for (uint32_t i = 0; i < c->count / 2; i++) {
        uint32_t v = c->vertices[i];
        c->vertices[i] = c->vertices[c->count - 1 - i], c->vertices[c->count - 1 - i] = v;
    }
}

/* Of tubes whose rings lie in one slice: one alone, or solids and the holes in them. What is left between the rims is a plane. The chain of
 * what is around is on the side of the rings. */
static void add_end(chain chains[2], lathe_tube_stack *s, uint32_t slab, uint32_t group, int side) {
    lathe_mesh *mesh = &s->builder.mesh;
    const int32_t *centre = NULL, rise = s->map[0].apex[!side] * (LATHE_LATTICE_ONE / LATHE_APEX_ONE) * (side ? -1 : 1);
    bool alone = !(group & (group - 1));
    for (uint32_t t = 0; t < s->radii->count; t++) {
        if (!(group >> t & 1)) continue;
        const lathe_tube_ring *ring = lathe__ring_at(s, slab, side, t);
        bool inner = !alone && s->radii->tubes[t].hole;
        uint32_t rim = add_rim(mesh, ring, s->rays[t], side, rise, inner);
        add_ring(&chains[side != inner], mesh, rim, s->rays[t], 0);
        centre = ring->centre;
    }
    chain *in = &chains[!side];
    if (alone) in->vertices[in->count++] = add_vertex(mesh, centre[0], centre[1], mesh->lattice[mesh->vertex_count - 1][2]);
    turn_round(in);            /* holes go the other way round */
}

/* ---- slabs ---- */

static lathe_status add_joint(lathe_tube_stack *s, uint32_t slab, uint32_t group) {
    enum { BRIDGES = 4 * LATHE_TUBES_MOST };
    chain chains[2] = {{0}};
    bool any[2] = {false};
    for (int side = 0; side < 2; side++) {
        chains[side].vertices = LATHE_NEW(s->scratch, uint32_t, s->most + BRIDGES);
        if (!chains[side].vertices) return LATHE_ERR_MEMORY;
        for (uint32_t t = 0; t < s->radii->count; t++) any[side] |= group >> t & 1 && lathe__has_ring(s, slab, side, t);
    }
    if (any[0] != any[1]) add_end(chains, s, slab, group, any[1]);
    for (int side = 0; side < 2 && any[0] == any[1]; side++)
        for (uint32_t t = 0; t < s->radii->count; t++)
            if (group >> t & 1 && lathe__has_ring(s, slab, side, t))
                add_ring(&chains[side], &s->builder.mesh, lathe__ring_at(s, slab, side, t)->base, s->rays[t], (side ? -1 : 1) * LATHE_LATTICE_ONE / 2);
    lathe_status status = join(&s->builder.mesh, s->scratch, &chains[0], &chains[1]);
    lathe__arena_reset(s->scratch);
    return status;
}

lathe_status lathe__add_plain_slab(lathe_tube_stack *s, uint32_t slab) {
    enum { BRIDGES = 8 * LATHE_TUBES_MOST };
    uint8_t group[LATHE_TUBES_MOST];
    lathe_mesh *mesh = &s->builder.mesh;
    /* A tube that ends takes its rim, two triangles for each edge of that, and one for each edge of the rim. */
    lathe_status status = lathe__builder_reserve(&s->builder, s->most + 2 * LATHE_TUBES_MOST, 3 * s->most + BRIDGES);
    find_joints(group, s, slab);
    for (uint32_t t = 0; !status && t < s->radii->count; t++) {
        if (!LATHE_TUBES_ONLY && s->group && !s->group[slab][t]) continue;   /* see lathe__radii_joints */
        if (group[t]) {
            if (!(group[t] & ((1 << t) - 1))) status = add_joint(s, slab, group[t]);
        } else if (lathe__has_ring(s, slab, 0, t)) {
            uint32_t lower = lathe__ring_at(s, slab, 0, t)->base, upper = lathe__ring_at(s, slab, 1, t)->base;
            lathe__radius_strip(mesh->triangles + mesh->triangle_count, (places)mesh->lattice, lower, upper, s->rays[t]);
            mesh->triangle_count += 2 * s->rays[t];
        }
    }
    return status;
}
