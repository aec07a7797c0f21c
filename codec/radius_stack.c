/* The surface of tubes. Where a tube goes on from one shown slice to the next and nothing comes near it, the two rings are joined ray by
 * ray, as in a single tube. Where tubes begin, end, part, merge or come near each other, the overlay joins their polygons: it cannot
 * cross itself whatever they do. Which of the two it is, is decided slab by slab and tube by tube:
 *  - at every height of a strip its section is star-shaped about a centre between the rings' ones. It lies in the circle of the larger
 *    radii and outside that of the smaller ones, less what chords and turns cut off: strips are apart if such circles are;
 *  - what the overlay makes of a group of tubes lies within the group's polygons, and of one tube where a strip would be.
 * Vertices next to the overlay are jittered, as it wants them in general position: less than would spoil a strip. */
#include <math.h>
#include <string.h>
#include "radius_tubes.h"

enum { NONE = UINT32_MAX, MOVE = 1500 /* as far as jitter, twice, moves a vertex at most */,
       NEAR = LATHE_LATTICE_ONE / 8 };
enum { OWN = 1 << 30 };        /* a group's vertices count from here, while the overlay makes its triangles */

static bool is_one_tube(const lathe_radii *radii) {
    return radii->count == 1 && !radii->tubes[0].hole && !radii->tubes[0].first && radii->tubes[0].map.slices == radii->slices;
}

static uint32_t stride_of(const lathe_radius_map *map, uint32_t stride) { return map->rays / stride < 8 ? map->rays / 8 : stride; }

lathe_status lathe__radii_outline(lathe_outline *out, lathe_arena *arena, lathe_radii *radii, uint32_t level, int32_t slice,
                                  uint32_t stride, uint32_t seed) {
    size_t points = 0;
    *out = (lathe_outline){0};
    for (uint32_t i = 0; i < radii->count; i++) points += radii->tubes[i].map.rays / stride_of(&radii->tubes[i].map, stride);
    out->points = LATHE_NEW(arena, lathe_point, points);
    out->ray = LATHE_NEW(arena, int32_t, points);
    out->loops = LATHE_NEW(arena, lathe_loop, radii->count);
    if (!out->points || !out->ray || !out->loops) return LATHE_ERR_MEMORY;
    for (uint32_t i = 0; i < radii->count; i++) {
        lathe_radius_tube *tube = &radii->tubes[i];
        int32_t row = slice - tube->first;
        if (row < 0 || row >= tube->map.slices) continue;
        lathe_radius_map map = lathe__tube_shown(tube, lathe__passes_at(radii, tube, level));
        uint32_t q = stride_of(&map, stride), rays = map.rays / q;
        const int32_t *c = map.centre[row], *r = map.radius + (size_t)row * map.rays;
        out->loops[out->loop_count++] = (lathe_loop){.first = out->point_count, .count = rays, .hole = tube->hole, .rays = rays,
                                                     .centre = {c[0] * (LATHE_LATTICE_ONE / 2), c[1] * (LATHE_LATTICE_ONE / 2)}};
        for (uint32_t k = 0; k < rays; k++) {
            uint32_t ray = tube->hole ? rays - 1 - k : k;   /* holes have the region on the left, too */
            lathe_point p = lathe__radius_place(&map, c, row, ray * q, r[ray * q]);
            out->ray[out->point_count] = (int32_t)ray;
            out->points[out->point_count++] = lathe__jitter((lathe_point){p.x & ~1, p.y & ~1}, seed);
        }
    }
    return LATHE_OK;
}

/* Every stride-th slice and the last; early ones, if asked for; of each tube the ends, and slices 1, 2, 4, ... from them: ends are round more often than not. */
static void mark_slices(bool *shown, const lathe_radii *radii, int32_t stride, bool early) {
    memset(shown, 0, (size_t)radii->slices * sizeof *shown);
    for (int32_t w = 0; w < radii->slices; w += stride) shown[w] = true;
    shown[radii->slices - 1] = true;
    for (int32_t w = 0; early && w < radii->slices; w++) shown[w] |= radii->early[w];
    for (uint32_t i = 0; i < radii->count; i++) {
        int32_t first = radii->tubes[i].first, last = first + radii->tubes[i].map.slices - 1;
        shown[first] = shown[last] = true;
        for (int32_t k = 1; k < stride && first + k < last; k *= 2) shown[first + k] = shown[last - k] = true;
    }
}

/* Rays are shown twice as dense as they have been coded: what is predicted between them is better than an edge. */
lathe_status lathe__radii_slices(int32_t **out, uint32_t *count, uint32_t *ray_stride, lathe_arena *arena, const lathe_radii *radii,
                                 uint32_t level) {
    int32_t stride = (int32_t)1 << (radii->level_count - 1 - level), *slices = LATHE_NEW(arena, int32_t, radii->slices);
    bool *mark = LATHE_NEW(arena, bool, radii->slices);
    uint32_t n = 0;
    if (!mark || !slices) return LATHE_ERR_MEMORY;
    mark_slices(mark, radii, stride, radii->early_level && radii->early_level == level + 1);
    for (int32_t w = 0; w < radii->slices; w++)
        if (mark[w]) slices[n++] = w;
    *out = slices;
    *count = n;
    uint32_t rays = (uint32_t)stride / 2 >> radii->tubes[0].map.ahead;
    *ray_stride = rays ? rays : 1;
    return LATHE_OK;
}

/* ---- tubes and slabs ---- */

typedef struct ring {          /* of a tube in a shown slice */
    uint32_t base;             /* its first vertex, or NONE: the tube has none there */
    int32_t centre[2];         /* lattice units */
    double least, most, jump;  /* bounds of its radii and of what two neighbours differ by, lattice units */
} ring;

/* Slab i lies below shown slice i: there is one more of them. */
typedef struct stack {
    lathe_mesh_builder builder;
    lathe_arena *keep, *scratch;
    const lathe_radii *radii;
    const int32_t *slices;
    uint32_t count;            /* of shown slices */
    size_t most;               /* vertices of a slice */
    lathe_radius_map map[LATHE_TUBES_MOST];
    uint32_t stride[LATHE_TUBES_MOST], rays[LATHE_TUBES_MOST];
    ring (*rings)[LATHE_TUBES_MOST];           /* by shown slice; before the first and behind the last there are empty ones */
    uint8_t (*group)[LATHE_TUBES_MOST];        /* by slab: the tubes that the overlay joins with this one, itself included; 0: a strip */
    lathe_ray_fan *fans;       /* of each tube */
    lathe_surface_counts *counts;
} stack;
_Static_assert(LATHE_TUBES_MOST <= 8, "a group is a byte");

static void measure_ring(ring *r, const stack *s, uint32_t tube, int32_t row) {
    const lathe_radius_map *map = &s->map[tube];
    const int32_t *radius = map->radius + (size_t)row * map->rays;
    int32_t least = radius[0], most = least, jump = 0, before = radius[map->rays - s->stride[tube]];
    for (uint32_t i = 0; i < map->rays; before = radius[i], i += s->stride[tube]) {
        most = radius[i] > most ? radius[i] : most;
        if (LATHE_TUBES_ONLY) continue;
        int32_t rise = radius[i] < before ? before - radius[i] : radius[i] - before;
        jump = rise > jump ? rise : jump;
        least = radius[i] < least ? radius[i] : least;
    }
    /* Directions are as long as LATHE_RAY_LENGTH but for less than a thousandth. */
    r->least = (double)least * (LATHE_LATTICE_ONE / LATHE_RADIUS_ONE - 1);
    r->most = (double)most * (LATHE_LATTICE_ONE / LATHE_RADIUS_ONE + 1);
    r->jump = (double)jump * (LATHE_LATTICE_ONE / LATHE_RADIUS_ONE);
    for (int k = 0; k < 2; k++) r->centre[k] = map->centre[row][k] * (LATHE_LATTICE_ONE / 2);
}

static void place_ring(stack *s, uint32_t slice, uint32_t tube) {
    const ring *r = &s->rings[slice][tube];
    int32_t(*v)[3] = s->builder.mesh.lattice + r->base, height = s->slices[slice] * LATHE_LATTICE_ONE;
    uint32_t n = s->rays[tube];
    /* Holes have the region on the left, too: they go round clockwise. */
    bool hole = s->radii->tubes[tube].hole;
    lathe__radius_ring(hole ? v + n - 1 : v, hole ? -1 : 1, &s->fans[tube], &s->map[tube], s->slices[slice] - s->radii->tubes[tube].first, s->stride[tube], height);
    for (; n; n--, v++) v[0][0] &= ~1, v[0][1] &= ~1;   /* middles stay on the lattice */
}

static lathe_status open_stack(stack *s, uint32_t stride, lathe_radii *radii, uint32_t level) {
    size_t points = 0;
    s->rings = lathe__arena_alloc(s->keep, (size_t)s->count + 2, sizeof *s->rings);
    s->group = lathe__arena_alloc(s->keep, (size_t)s->count + 2, sizeof *s->group);
    s->fans = LATHE_NEW(s->keep, lathe_ray_fan, radii->count);
    if (!s->rings || !s->group || !s->fans) return LATHE_ERR_MEMORY;
    for (uint32_t t = 0; t < radii->count; t++) {
        s->fans[t].turn = UINT32_MAX;
        s->map[t] = lathe__tube_shown(&radii->tubes[t], lathe__passes_at(radii, &radii->tubes[t], level));
        s->stride[t] = stride_of(&s->map[t], stride);
        s->rays[t] = s->map[t].rays / s->stride[t];
        s->most += s->rays[t];
        if (s->rays[t] > s->counts->rays) s->counts->rays = s->rays[t];
    }
    s->rings++;                /* slice -1 has none */
    for (uint32_t i = 0; i < s->count + 2; i++)
        for (uint32_t t = 0; t < radii->count; t++) {
            ring *r = &s->rings[(int32_t)i - 1][t];
            int32_t row = i && i <= s->count ? s->slices[i - 1] - radii->tubes[t].first : -1;
            *r = (ring){.base = NONE};
            if (row < 0 || row >= s->map[t].slices) continue;
            measure_ring(r, s, t, row);
            r->base = (uint32_t)points;
            points += s->rays[t];
        }
    if (points > UINT32_MAX / 16) return LATHE_ERR_LIMIT;
    s->counts->contour_vertices += points;
    lathe_status status = lathe__builder_reserve(&s->builder, points + points / 8 + 1024, points * 2 + points / 4 + 2048);
    if (status) return status;
    s->builder.mesh.vertex_count = (uint32_t)points;
    for (uint32_t i = 0; i < s->count; i++)
        for (uint32_t t = 0; t < radii->count; t++)
            if (s->rings[i][t].base != NONE) place_ring(s, i, t);
    return LATHE_OK;
}

/* The circle about a point that a tube in a slab lies in. */
static double reach_of(const stack *s, uint32_t slab, uint32_t tube, const int32_t from[2]) {
    double reach = 0;
    for (int side = 0; side < 2; side++) {
        const ring *r = &s->rings[(int32_t)slab - 1 + side][tube];
        double x = (double)r->centre[0] - from[0], y = (double)r->centre[1] - from[1], far = r->most + sqrt(x * x + y * y);
        if (r->base != NONE && far > reach) reach = far;
    }
    return reach;
}

static const int32_t *centre_in(const stack *s, uint32_t slab, uint32_t tube) {
    const ring *r = &s->rings[slab][tube];
    return r->base == NONE ? s->rings[(int32_t)slab - 1][tube].centre : r->centre;
}

/* What a triangle's part of a section spans, as seen from the centre: from (1 - t) A + t C to (1 - t) B + t C, if A and B are neighbours
 * in the lower ring and C is above one of them. It goes on to the left if A x B > 0 and C x (B - A) > 0. Both hold by at least
 * |C| |A| 5.6 / rays, less what moved vertices take away: (2 |C| + |B - A| + 2 MOVE) MOVE; the last is below |C| / 4. */
static bool can_be_strip(const stack *s, uint32_t slab, uint32_t tube) {
    const ring *a = &s->rings[(int32_t)slab - 1][tube], *b = &s->rings[slab][tube];
    double least = a->least < b->least ? a->least : b->least, most = a->most > b->most ? a->most : b->most, rays = s->rays[tube];
    double side = (a->jump > b->jump ? a->jump : b->jump) + most * 7 / rays;   /* |B - A| at most */
    return a->base != NONE && b->base != NONE && !s->map[tube].turn && 5.6 * least * least > (2.25 * least + side) * MOVE * rays;
}

/* Is there a strip around a tube? */
static bool is_within(const stack *s, uint32_t slab, uint32_t inner, uint32_t outer) {
    if (!can_be_strip(s, slab, outer)) return false;
    const ring *a = &s->rings[(int32_t)slab - 1][outer], *b = &s->rings[slab][outer];
    /* Chords over the angle between rays, of chords over that angle: each comes as near as the cosine of half of it, pi / rays. */
    double least = a->least < b->least ? a->least : b->least, turns = 1.0 / s->rays[outer], room = least * (1 - 10 * turns * turns) - NEAR;
    return reach_of(s, slab, inner, a->centre) < room && reach_of(s, slab, inner, b->centre) < room;
}

static bool in_slab(const stack *s, uint32_t slab, uint32_t tube) {
    return s->rings[(int32_t)slab - 1][tube].base != NONE || s->rings[slab][tube].base != NONE;
}

static bool are_apart(const stack *s, uint32_t slab, uint32_t t, uint32_t u) {
    const int32_t *a = centre_in(s, slab, t), *b = centre_in(s, slab, u);
    double x = (double)a[0] - b[0], y = (double)a[1] - b[1], both = reach_of(s, slab, t, a) + reach_of(s, slab, u, b) + NEAR;
    return x * x + y * y > both * both || is_within(s, slab, t, u) || is_within(s, slab, u, t);
}

static void merge_groups(uint8_t *group, uint32_t count, uint8_t both) {
    for (uint32_t k = 0; k < count; k++)
        if (group[k] & both) group[k] = both;
}

static void group_slab(stack *s, uint32_t slab) {
    uint8_t *group = s->group[slab], all = 0, holes = 0;
    uint32_t n = s->radii->count;
    for (uint32_t t = 0; t < n; t++) {
        group[t] = in_slab(s, slab, t) ? (uint8_t)(1 << t) : 0;
        all |= group[t];
        if (s->radii->tubes[t].hole) holes |= group[t];
    }
    for (uint32_t t = 0; t < n; t++)
        for (uint32_t u = 0; u < t; u++) {
            if (!group[t] || !group[u] || group[t] == group[u] || are_apart(s, slab, t, u)) continue;
            uint8_t both = group[t] | group[u];
            /* The overlay takes holes for solids if there is nothing else. */
            if (both & holes && both & ~holes) both = all;
            merge_groups(group, n, both);
        }
    for (uint32_t t = 0; t < n; t++)
        if (group[t] == 1 << t && can_be_strip(s, slab, t)) group[t] = 0;
}

/* ---- slab by slab, upwards ---- */

static void jitter_ring(stack *s, uint32_t slice, uint32_t tube) {
    int32_t(*v)[3] = s->builder.mesh.lattice + s->rings[slice][tube].base;
    for (uint32_t i = 0; i < s->rays[tube]; i++) {
        lathe_point p = lathe__jitter((lathe_point){v[i][0], v[i][1]}, slice);
        v[i][0] = p.x, v[i][1] = p.y;
    }
}

/* A group's polygons in one of a slab's slices; *vertex: the mesh's vertex of each of theirs, moved on. */
static lathe_status take_outline(lathe_outline *o, uint32_t **vertex, const stack *s, const ring *rings, uint32_t group, bool turned) {
    *o = (lathe_outline){.points = LATHE_NEW(s->keep, lathe_point, s->most), .loops = LATHE_NEW(s->keep, lathe_loop, s->radii->count)};
    if (!o->points || !o->loops) return LATHE_ERR_MEMORY;
    for (uint32_t t = 0; t < s->radii->count; t++) {
        uint32_t n = s->rays[t];
        if (!(group >> t & 1) || rings[t].base == NONE) continue;
        o->loops[o->loop_count++] = (lathe_loop){.first = o->point_count, .count = n, .hole = s->radii->tubes[t].hole && !turned, .rays = n,
                                                 .centre = {rings[t].centre[0], rings[t].centre[1]}};
        for (uint32_t i = 0; i < n; i++) {
            uint32_t v = *(*vertex)++ = rings[t].base + (turned ? n - 1 - i : i);
            const int32_t *p = s->builder.mesh.lattice[v];
            o->points[o->point_count++] = (lathe_point){p[0], p[1]};
        }
    }
    return LATHE_OK;
}

/* Only holes: they are taken for solids, and turned inside out. */
static lathe_status add_group(stack *s, uint32_t slab, uint32_t group) {
    lathe_outline outline[2];
    uint32_t *vertex = LATHE_NEW(s->keep, uint32_t, 2 * s->most), *next = vertex, first = s->builder.mesh.triangle_count;
    bool turned = true;
    if (!vertex) return LATHE_ERR_MEMORY;
    for (uint32_t t = 0; t < s->radii->count; t++)
        if (group >> t & 1 && !s->radii->tubes[t].hole) turned = false;
    for (int side = 0; side < 2; side++) {
        lathe_status status = take_outline(&outline[side], &next, s, s->rings[(int32_t)slab - 1 + side], group, turned);
        if (status) return status;
    }
    int32_t top = slab < s->count ? s->slices[slab] : s->slices[slab - 1] + 1, bottom = slab ? s->slices[slab - 1] : top - 1;
    lathe_slab one = {.outline = {&outline[0], &outline[1]}, .height = {bottom * LATHE_LATTICE_ONE, top * LATHE_LATTICE_ONE}, .base = OWN,
                      .cap = LATHE_LATTICE_ONE / 2};
    lathe_status status = lathe__stack_slab(&s->builder, s->scratch, &one, vertex, &s->counts->overlay);
    for (uint32_t(*t)[3] = s->builder.mesh.triangles + first; !status && first < s->builder.mesh.triangle_count; first++, t++) {
        for (int k = 0; k < 3; k++)
            if (t[0][k] >= OWN) t[0][k] = vertex[t[0][k] - OWN];
        if (turned) {
            uint32_t swap = t[0][1];
            t[0][1] = t[0][2], t[0][2] = swap;
        }
    }
    return status;
}

/* ---- plain tubes ---- */

static bool has_ring(const stack *s, uint32_t slab, int side, uint32_t tube) { return s->rings[(int32_t)slab - 1 + side][tube].base != NONE; }

static bool is_over(const ring *a, const ring *b) {
    double x = (double)a->centre[0] - b->centre[0], y = (double)a->centre[1] - b->centre[1], most = a->most > b->most ? a->most : b->most;
    return x * x + y * y < most * most;
}

/* Do tubes that end or begin in a slab belong together? Those that go over into each other do, and holes that end with what is around
 * them. */
static bool belong(const stack *s, uint32_t slab, uint32_t t, uint32_t u, bool over) {
    const lathe_radius_tube *tubes = s->radii->tubes;
    int side = has_ring(s, slab, 1, t), other = has_ring(s, slab, 1, u);
    if ((tubes[t].hole == tubes[u].hole) != over || (side != other) != over) return false;
    return is_over(&s->rings[(int32_t)slab - 1 + side][t], &s->rings[(int32_t)slab - 1 + other][u]);
}

/* The tubes that a slab joins with each tube that ends or begins there, itself included; 0: it goes on. */
static void find_joints(uint8_t *group, const stack *s, uint32_t slab) {
    uint32_t n = s->radii->count;
    uint8_t over = 0;
    for (uint32_t t = 0; t < n; t++) group[t] = has_ring(s, slab, 0, t) != has_ring(s, slab, 1, t) ? (uint8_t)(1 << t) : 0;
    bool gap = slab && slab < s->count && s->slices[slab] - s->slices[slab - 1] > 1;   /* what ends there does not touch what begins */
    for (int pass = gap; pass < 2; pass++)
        for (uint32_t t = 0; t < n; t++)
            for (uint32_t u = 0; u < t; u++) {
                if (!group[t] || !group[u] || (pass && (over >> t & 1 || over >> u & 1)) || !belong(s, slab, t, u, !pass)) continue;
                merge_groups(group, n, group[t] | group[u]);
                if (!pass) over |= group[t];
            }
}

static uint32_t add_vertex(lathe_mesh *mesh, int32_t x, int32_t y, int32_t z) {
    int32_t *v = mesh->lattice[mesh->vertex_count];
    v[0] = x, v[1] = y, v[2] = z;
    return mesh->vertex_count++;
}

/* What nothing follows on ends with its ring once more, as high as the caps rise and an eighth narrower, holes in it wider. */
static uint32_t add_rim(lathe_mesh *mesh, const ring *r, uint32_t rays, int side, int32_t rise, bool wider) {
    uint32_t rim = mesh->vertex_count;
    for (uint32_t i = 0; i < rays; i++) {
        const int32_t *v = mesh->lattice[r->base + i];
        int32_t at[2];
        for (int k = 0; k < 2; k++) at[k] = v[k] + (int32_t)(((int64_t)v[k] - r->centre[k]) / (wider ? 8 : -8));
        add_vertex(mesh, at[0], at[1], v[2] + rise);
    }
    lathe__radius_strip(mesh->triangles + mesh->triangle_count, (const int32_t(*)[3])mesh->lattice, side ? rim : r->base, side ? r->base : rim, rays);
    mesh->triangle_count += 2 * rays;
    return rim;
}

/* All of a group's rings lie in one slice: a solid and holes in it, or one alone. What is left between rims is filled. */
static void add_end(stack *s, uint32_t slab, uint32_t group, int side, lathe_ring_chain chain[2]) {
    lathe_mesh *mesh = &s->builder.mesh;
    const ring *ring = NULL;
    int32_t rise = s->map[0].apex[!side] * (LATHE_LATTICE_ONE / LATHE_APEX_ONE) * (side ? -1 : 1);
    bool alone = !(group & (group - 1));
    for (uint32_t t = 0; t < s->radii->count; t++) {
        if (!(group >> t & 1)) continue;
        bool inner = !alone && s->radii->tubes[t].hole;
        ring = &s->rings[(int32_t)slab - 1 + side][t];
        uint32_t rim = add_rim(mesh, ring, s->rays[t], side, rise, inner);
        lathe__chain_ring(&chain[side != inner], (const int32_t(*)[3])mesh->lattice, rim, s->rays[t]);
    }
    lathe_ring_chain *in = &chain[!side];
    if (alone) in->vertices[in->count++] = add_vertex(mesh, ring->centre[0], ring->centre[1], mesh->lattice[mesh->vertex_count - 1][2]);
    for (uint32_t i = 0; i < in->count / 2; i++) {   /* holes go round the other way */
        uint32_t v = in->vertices[i];
        in->vertices[i] = in->vertices[in->count - 1 - i], in->vertices[in->count - 1 - i] = v;
    }
}

static lathe_status add_joint(stack *s, uint32_t slab, uint32_t group) {
    enum { BRIDGES = 2 * LATHE_TUBES_MOST };
    lathe_ring_chain chain[2] = {{0}};
    bool any[2] = {false};
    for (int side = 0; side < 2; side++) {
        chain[side].vertices = LATHE_NEW(s->scratch, uint32_t, s->most + BRIDGES);
        if (!chain[side].vertices) return LATHE_ERR_MEMORY;
        for (uint32_t t = 0; t < s->radii->count; t++) any[side] |= group >> t & 1 && has_ring(s, slab, side, t);
    }
    if (any[0] != any[1]) add_end(s, slab, group, any[1], chain);
    for (int side = 0; side < 2 && any[0] == any[1]; side++)
        for (uint32_t t = 0; t < s->radii->count; t++)
            if (group >> t & 1 && has_ring(s, slab, side, t))
                lathe__chain_ring(&chain[side], (const int32_t(*)[3])s->builder.mesh.lattice, s->rings[(int32_t)slab - 1 + side][t].base, s->rays[t]);
    lathe_status status = lathe__join_chains(&s->builder.mesh, s->scratch, &chain[0], &chain[1]);
    lathe__arena_reset(s->scratch);
    return status;
}

static lathe_status add_plain_slab(stack *s, uint32_t slab) {
    enum { BRIDGES = 4 * LATHE_TUBES_MOST };
    uint8_t group[LATHE_TUBES_MOST];
    lathe_mesh *mesh = &s->builder.mesh;
    lathe_status status = lathe__builder_reserve(&s->builder, 2 * s->most + LATHE_TUBES_MOST, 6 * s->most + BRIDGES);
    find_joints(group, s, slab);
    for (uint32_t t = 0; !status && t < s->radii->count; t++) {
        const ring *lower = &s->rings[(int32_t)slab - 1][t], *upper = &s->rings[slab][t];
        if (group[t]) {
            if (!(group[t] & ((1 << t) - 1))) status = add_joint(s, slab, group[t]);
        } else if (lower->base != NONE) {
            lathe__radius_strip(mesh->triangles + mesh->triangle_count, (const int32_t(*)[3])mesh->lattice, lower->base, upper->base, s->rays[t]);
            mesh->triangle_count += 2 * s->rays[t];
        }
    }
    return status;
}

/* ---- tubes that the overlay joins ---- */

static lathe_status add_slab(stack *s, uint32_t slab) {
    const uint8_t *group = s->group[slab];
    lathe_mesh *mesh = &s->builder.mesh;
    lathe_status status = lathe__builder_reserve(&s->builder, 0, 2 * s->most);
    for (uint32_t t = 0; !status && t < s->radii->count; t++) {
        const ring *lower = &s->rings[(int32_t)slab - 1][t], *upper = &s->rings[slab][t];
        if (upper->base != NONE && (group[t] || s->group[slab + 1][t])) jitter_ring(s, slab, t);
        if (group[t] || !in_slab(s, slab, t)) continue;
        lathe__radius_strip(mesh->triangles + mesh->triangle_count, (const int32_t(*)[3])mesh->lattice, lower->base, upper->base, s->rays[t]);
        mesh->triangle_count += 2 * s->rays[t];
    }
    /* When all of the slab's rings are in place. */
    for (uint32_t t = 0; !status && t < s->radii->count; t++)
        if (group[t] && !(group[t] & ((1 << t) - 1))) status = add_group(s, slab, group[t]);
    return status;
}

static bool needs_proof(const stack *s, uint32_t slab) {
    uint8_t any = 0;
    for (uint32_t t = 0; t < s->radii->count; t++) any |= s->group[slab][t];
    return any;
}

static lathe_status stack_tubes(lathe_mesh *out, lathe_arena arena[2], lathe_radii *radii, uint32_t level, const int32_t *slices, uint32_t count,
                                uint32_t stride, bool joints, lathe_surface_counts *counts) {
    stack s = {.keep = &arena[0], .scratch = &arena[1], .radii = radii, .slices = slices, .count = count, .counts = counts};
    lathe_status status = open_stack(&s, stride, radii, level);
    if (radii->plain || LATHE_TUBES_ONLY) {
        for (uint32_t i = 0; joints && !LATHE_TUBES_ONLY && !status && i <= count; i++) group_slab(&s, i);
        for (uint32_t i = 0; !status && i <= count; i++)
            if (!joints || needs_proof(&s, i)) status = add_plain_slab(&s, i);
    } else {
        if (!status) memset(s.group[count + 1], 0, sizeof *s.group);
        for (uint32_t i = 0; !status && i <= count; i++) group_slab(&s, i);
        for (uint32_t i = 0; !status && i <= count; i++) status = add_slab(&s, i);
    }
    if (status) lathe_mesh_free(&s.builder.mesh);
    else *out = s.builder.mesh;
    return status;
}

bool lathe__radii_plain(const lathe_radii *radii) { return radii->simple || radii->plain || is_one_tube(radii); }

lathe_status lathe__radii_joints(lathe_mesh *out, lathe_arena arena[2], lathe_radii *radii, uint32_t level) {
    lathe_surface_counts counts = {0};
    int32_t *slices;
    uint32_t count, stride;
    lathe_status status = lathe__radii_slices(&slices, &count, &stride, &arena[0], radii, level);
    if (!status) status = stack_tubes(out, arena, radii, level, slices, count, stride, true, &counts);
    lathe__arena_reset(&arena[0]);
    lathe__arena_reset(&arena[1]);
    return status;
}

lathe_status lathe__radii_mesh(lathe_mesh *out, lathe_arena arena[2], lathe_radii *radii, uint32_t level,
                               lathe_surface_counts *counts, uint32_t *shown) {
    if (radii->simple) {
        int32_t stride = (int32_t)1 << (radii->level_count - 1 - level);
        const lathe_radius_map *map = &radii->tubes[0].map;
        counts->rays = map->rays / lathe__radius_ray_stride(map, level);
        *shown = (uint32_t)((radii->slices - 1 + stride - 1) / stride) + 1;
        counts->contour_vertices = (uint64_t)counts->rays * *shown;
        return lathe__radius_mesh(out, map, level);
    }
    int32_t *slices;
    uint32_t count, stride;
    lathe_status status = lathe__radii_slices(&slices, &count, &stride, &arena[0], radii, level);
    if (!status) {
        *shown = count;
        if (is_one_tube(radii)) {
            lathe_radius_map map = lathe__tube_shown(&radii->tubes[0], lathe__passes_at(radii, &radii->tubes[0], level));
            uint32_t q = stride_of(&map, stride);
            counts->rays = map.rays / q;
            counts->contour_vertices = (uint64_t)counts->rays * count;
            status = lathe__radius_strips(out, &map, slices, count, q);
        } else {
            status = stack_tubes(out, arena, radii, level, slices, count, stride, false, counts);
        }
    }
    lathe__arena_reset(&arena[0]);
    lathe__arena_reset(&arena[1]);
    return status;
}
