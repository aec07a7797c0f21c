/* Plain tubes: where they go on, strips; where they part, merge, begin or end, their rings are joined as they are. Rings of one slice
 * become a single closed chain of vertices by bridges [after Christiansen and Sederberg 1978]; two chains are tiled like any two contours, by
 * the path that is least in sum [Fuchs, Kedem and Uselton 1977]. Every edge of a ring is in one triangle below and in one above, every other
 * edge in two of its slab: the surface is closed. Whether it crosses itself is for the encoder to find out. */
#include <string.h>
#include "radius_stack.h"

typedef struct chain { uint32_t *vertices, count; } chain;
typedef const int32_t (*places)[3];

/* Of two places as seen from above, squared. Coordinates that are too large wrap. */
static inline uint64_t apart(const int32_t *a, const int32_t *b) {
    uint64_t x = (uint64_t)((int64_t)a[0] - b[0]), y = (uint64_t)((int64_t)a[1] - b[1]);
    return x * x + y * y;
}

/* The edges, each by its first vertex, whose ends are nearest to each other crosswise; of the chain only those of rings, which lie in the slice. */
static void nearest_edges(uint32_t *a, uint32_t *b, places at, const chain *c, const chain *ring) {
    uint64_t least = UINT64_MAX;
    int32_t slice = at[ring->vertices[0]][2];
    for (uint32_t i = 0; i < c->count; i++) {
        const int32_t *p = at[c->vertices[i]], *q = at[c->vertices[(i + 1) % c->count]];
        for (uint32_t k = 0; p[2] == slice && q[2] == slice && k < ring->count; k++) {
            uint64_t d = apart(p, at[ring->vertices[(k + 1) % ring->count]]) + apart(q, at[ring->vertices[k]]);
            if (d < least) least = d, *a = i, *b = k;
        }
    }
}

static uint32_t add_vertex(lathe_mesh *mesh, int32_t x, int32_t y, int32_t z) {
    int32_t *v = mesh->lattice[mesh->vertex_count];
    v[0] = x, v[1] = y, v[2] = z;
    return mesh->vertex_count++;
}

/* The other way round in an upper slice. */
static void add_triangle(lathe_mesh *mesh, int side, uint32_t a, uint32_t b, uint32_t c) {
    uint32_t *t = mesh->triangles[mesh->triangle_count++];
    t[0] = a, t[1 + side] = b, t[2 - side] = c;
}

static uint32_t add_middle(lathe_mesh *mesh, uint32_t p, uint32_t q, int32_t rise) {
    const int32_t *a = mesh->lattice[p], *b = mesh->lattice[q];
    return add_vertex(mesh, (int32_t)(((int64_t)a[0] + b[0]) / 2), (int32_t)(((int64_t)a[1] + b[1]) / 2), a[2] + rise);
}

/* A further ring is entered over one of its edges and left over the same: a bridge, four triangles between that edge and the one of the
 * chain that is nearest to it. Its sides have a vertex in the middle, `rise` off the slice: edges in a slice are edges of rings. */
static void bridge(chain *c, const chain *ring, lathe_mesh *mesh, int side, int32_t rise) {
    uint32_t i = 0, k = 0, n = c->count, rays = ring->count;
    nearest_edges(&i, &k, (places)mesh->lattice, c, ring);
    uint32_t *v = c->vertices + i, a = v[0], b = c->vertices[(i + 1) % n], p = ring->vertices[k], q = ring->vertices[(k + 1) % rays];
    uint32_t enter = add_middle(mesh, a, q, rise), leave = add_middle(mesh, b, p, rise);
    add_triangle(mesh, side, a, b, leave);
    add_triangle(mesh, side, a, leave, enter);
    add_triangle(mesh, side, enter, leave, p);
    add_triangle(mesh, side, enter, p, q);
    v++;
    memmove(v + rays + 2, v, (n - i - 1) * sizeof *v);
    *v++ = enter;
    for (uint32_t s = 1; s <= rays; s++) *v++ = ring->vertices[(k + s) % rays];
    *v = leave;
    c->count += rays + 2;
}

static void add_ring(chain *c, lathe_mesh *mesh, uint32_t first, uint32_t rays, int side, int32_t rise) {
    uint32_t vertices[LATHE_RADIUS_MAX_RAYS];
    for (uint32_t i = 0; i < rays; i++) vertices[i] = first + i;
    if (c->count) bridge(c, &(chain){vertices, rays}, mesh, side, rise);
    else memcpy(c->vertices, vertices, (c->count = rays) * sizeof *vertices);
}

/* ---- between two chains ---- */

/* The vertex of a chain that is farthest from the middle of all: from bridges, too. */
static uint32_t outermost(lathe_mesh *mesh, const chain *c) {
    int64_t sum[2] = {0};
    uint64_t most = 0;
    uint32_t found = 0;
    for (uint32_t i = 0; i < c->count; i++)
        for (int k = 0; k < 2; k++) sum[k] += mesh->lattice[c->vertices[i]][k];
    int32_t middle[3] = {(int32_t)(sum[0] / c->count), (int32_t)(sum[1] / c->count), 0};
    for (uint32_t i = 0; i < c->count; i++) {
        uint64_t d = apart(mesh->lattice[c->vertices[i]], middle);
        if (d > most) most = d, found = i;
    }
    return found;
}

static uint32_t nearest(lathe_mesh *mesh, const chain *c, const int32_t *to) {
    uint64_t least = UINT64_MAX;
    uint32_t found = 0;
    for (uint32_t i = 0; i < c->count; i++) {
        uint64_t d = apart(mesh->lattice[c->vertices[i]], to);
        if (d < least) least = d, found = i;
    }
    return found;
}

/* Vertices that are next to each other, far from bridges: where nothing is between them. */
static void find_start(uint32_t *from, uint32_t *to, lathe_mesh *mesh, const chain *lower, const chain *upper) {
    *to = outermost(mesh, upper);
    for (int i = 0; i < 2; i++) {
        *from = nearest(mesh, lower, mesh->lattice[upper->vertices[*to]]);
        *to = nearest(mesh, upper, mesh->lattice[lower->vertices[*from]]);
    }
}

/* Walks around both chains at once from far out; a triangle stands on each of their edges. A chain may be a single vertex. */
static lathe_status join(lathe_mesh *mesh, lathe_arena *arena, const chain *lower, const chain *upper) {
    places at = (places)mesh->lattice;
    uint32_t from, to, m = lower->count, n = upper->count, rows = m > 1 ? m : 0, columns = n > 1 ? n : 0;
    uint64_t *sum = LATHE_NEW(arena, uint64_t, columns + 1);   /* of squares of rungs, up to each one */
    bool *below = lathe__arena_alloc(arena, (size_t)rows + 1, (size_t)columns + 1), *step = below;   /* is the step to a rung on the lower chain? */
    if (!sum || !below) return LATHE_ERR_MEMORY;
    find_start(&from, &to, mesh, lower, upper);
    for (uint32_t i = 0; i <= rows; i++)
        for (uint32_t k = 0; k <= columns; k++, step++) {
            *step = !k || (i && sum[k] <= sum[k - 1]);
            uint64_t before = !*step ? sum[k - 1] : i ? sum[k] : 0;
            sum[k] = before + apart(at[lower->vertices[(from + i) % m]], at[upper->vertices[(to + k) % n]]);
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

/* Does a ring's polygon have a vertex of another one inside? */
static bool encloses(places at, uint32_t first, uint32_t rays, uint32_t other, uint32_t count) {
    for (uint32_t n = other; n < other + count; n++) {
        bool odd = false;
        for (uint32_t i = 0; i < rays; i++) {
            const int32_t *p = at[first + i], *q = at[first + (i + 1) % rays];
            if ((p[1] > at[n][1]) == (q[1] > at[n][1])) continue;
            int64_t turn = (int64_t)(q[0] - p[0]) * (at[n][1] - p[1]) - (int64_t)(q[1] - p[1]) * (at[n][0] - p[0]);
            odd ^= (turn > 0) == (q[1] > p[1]);
        }
        if (odd) return true;
    }
    return false;
}

static bool is_over(const lathe_tube_stack *s, const lathe_tube_ring *a, uint32_t m, const lathe_tube_ring *b, uint32_t n) {
    places at = (places)s->builder.mesh.lattice;
    return encloses(at, a->base, m, b->base, n) || encloses(at, b->base, n, a->base, m);
}

/* Do tubes that end or begin in a slab belong together? over: those of a kind that go over into each other; else a hole that ends with what
 * is around it. */
static bool belong(const lathe_tube_stack *s, uint32_t slab, uint32_t t, uint32_t u, bool over) {
    const lathe_radius_tube *tubes = s->radii->tubes;
    int side = lathe__has_ring(s, slab, 1, t), other = lathe__has_ring(s, slab, 1, u);
    if ((tubes[t].hole == tubes[u].hole) != over || (side != other) != over) return false;
    return is_over(s, lathe__ring_at(s, slab, side, t), s->rays[t], lathe__ring_at(s, slab, other, u), s->rays[u]);
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
        add_ring(&chains[side != inner], mesh, rim, s->rays[t], side, 0);
        centre = ring->centre;
    }
    chain *in = &chains[!side];
    if (alone) in->vertices[in->count++] = add_vertex(mesh, centre[0], centre[1], mesh->lattice[mesh->vertex_count - 1][2]);
    turn_round(in);            /* holes go the other way round */
}

/* ---- slabs ---- */

static lathe_status add_joint(lathe_tube_stack *s, uint32_t slab, uint32_t group) {
    enum { BRIDGES = 2 * LATHE_TUBES_MOST };
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
                add_ring(&chains[side], &s->builder.mesh, lathe__ring_at(s, slab, side, t)->base, s->rays[t], side, (side ? -1 : 1) * LATHE_LATTICE_ONE / 2);
    lathe_status status = join(&s->builder.mesh, s->scratch, &chains[0], &chains[1]);
    lathe__arena_reset(s->scratch);
    return status;
}

lathe_status lathe__add_plain_slab(lathe_tube_stack *s, uint32_t slab) {
    enum { BRIDGES = 16 * LATHE_TUBES_MOST };
    uint8_t group[LATHE_TUBES_MOST];
    lathe_mesh *mesh = &s->builder.mesh;
    /* A tube that ends takes its rim, two triangles for each edge of that, and one for each edge of the rim. */
    lathe_status status = lathe__builder_reserve(&s->builder, s->most + 4 * LATHE_TUBES_MOST, 3 * s->most + BRIDGES);
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
