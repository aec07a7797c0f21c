/* Which tubes of a slab come near each other, and how the overlay joins those that do (archives from before there were plain tubes). Where
 * a tube goes on from one shown slice to the next and nothing comes near it, the two rings are joined ray by ray, as in a single tube.
 * Where tubes begin, end, part, merge or come near each other, the overlay joins their polygons: it cannot cross itself whatever they do.
 * Which of the two it is, is decided slab by slab and tube by tube:
 *  - at every height of a strip its section is star-shaped about a centre between the rings' ones. It lies in the circle of the larger
 *    radii and outside that of the smaller ones, less what chords and turns cut off: strips are apart if such circles are;
 *  - what the overlay makes of a group of tubes lies within the group's polygons, and of one tube where a strip would be.
 * Vertices next to the overlay are jittered, as it wants them in general position: less than would spoil a strip. */
#include <math.h>
#include "radius_stack.h"

enum { MOVE = 1500 /* as far as jitter, twice, moves a vertex at most */, NEAR = LATHE_LATTICE_ONE / 8 };
enum { OWN = 1 << 30 };        /* a group's vertices count from here, while the overlay makes its triangles */

/* The circle about a point that a tube in a slab lies in. */
static double reach_of(const lathe_tube_stack *s, uint32_t slab, uint32_t tube, const int32_t from[2]) {
    double reach = 0;
    for (int side = 0; side < 2; side++) {
        const lathe_tube_ring *r = &s->rings[(int32_t)slab - 1 + side][tube];
        double x = (double)r->centre[0] - from[0], y = (double)r->centre[1] - from[1], far = r->most + sqrt(x * x + y * y);
        if (r->base != LATHE_NO_RING && far > reach) reach = far;
    }
    return reach;
}

static const int32_t *centre_in(const lathe_tube_stack *s, uint32_t slab, uint32_t tube) {
    const lathe_tube_ring *r = &s->rings[slab][tube];
    return r->base == LATHE_NO_RING ? s->rings[(int32_t)slab - 1][tube].centre : r->centre;
}

/* What a triangle's part of a section spans, as seen from the centre: from (1 - t) A + t C to (1 - t) B + t C, if A and B are neighbours
 * in the lower ring and C is above one of them. It goes on to the left if A x B > 0 and C x (B - A) > 0. Both hold by at least
 * |C| |A| 5.6 / rays, less what moved vertices take away: (2 |C| + |B - A| + 2 MOVE) MOVE; the last is below |C| / 4. */
static bool can_join(const lathe_tube_ring *a, const lathe_tube_ring *b, double rays) {
    double least = a->least < b->least ? a->least : b->least, most = a->most > b->most ? a->most : b->most;
    double side = (a->jump > b->jump ? a->jump : b->jump) + most * 7 / rays;   /* |B - A| at most */
    return 5.6 * least * least > (2.25 * least + side) * MOVE * rays;
}

static bool can_be_strip(const lathe_tube_stack *s, uint32_t slab, uint32_t tube) {
    const lathe_tube_ring *a = lathe__ring_at(s, slab, 0, tube), *b = lathe__ring_at(s, slab, 1, tube);
    return a->base != LATHE_NO_RING && b->base != LATHE_NO_RING && !s->map[tube].turn && can_join(a, b, s->rays[tube]);
}

/* The end of a plain tube, if nothing else is in the joint: a strip to a narrower ring, and a star. */
static bool can_be_end(const lathe_tube_stack *s, uint32_t slab, uint32_t tube) {
    int side = lathe__has_ring(s, slab, 1, tube);
    const lathe_tube_ring *ring = lathe__ring_at(s, slab, side, tube);
    return s->radii->plain && !lathe__has_ring(s, slab, !side, tube) && can_join(ring, ring, s->rays[tube]);
}

/* Is there a strip around a tube? */
static bool is_within(const lathe_tube_stack *s, uint32_t slab, uint32_t inner, uint32_t outer) {
    if (!can_be_strip(s, slab, outer)) return false;
    const lathe_tube_ring *a = &s->rings[(int32_t)slab - 1][outer], *b = &s->rings[slab][outer];
    /* Chords over the angle between rays, of chords over that angle: each comes as near as the cosine of half of it, pi / rays. */
    double least = a->least < b->least ? a->least : b->least, turns = 1.0 / s->rays[outer], room = least * (1 - 10 * turns * turns) - NEAR;
    return reach_of(s, slab, inner, a->centre) < room && reach_of(s, slab, inner, b->centre) < room;
}

static bool in_slab(const lathe_tube_stack *s, uint32_t slab, uint32_t tube) {
    return s->rings[(int32_t)slab - 1][tube].base != LATHE_NO_RING || s->rings[slab][tube].base != LATHE_NO_RING;
}

static bool are_apart(const lathe_tube_stack *s, uint32_t slab, uint32_t t, uint32_t u) {
    const int32_t *a = centre_in(s, slab, t), *b = centre_in(s, slab, u);
    double x = (double)a[0] - b[0], y = (double)a[1] - b[1], both = reach_of(s, slab, t, a) + reach_of(s, slab, u, b) + NEAR;
    return x * x + y * y > both * both || is_within(s, slab, t, u) || is_within(s, slab, u, t);
}

void lathe__group_slab(lathe_tube_stack *s, uint32_t slab) {
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
            lathe__merge_groups(group, n, both);
        }
    for (uint32_t t = 0; t < n; t++)
        if (group[t] == 1 << t && (can_be_strip(s, slab, t) || can_be_end(s, slab, t))) group[t] = 0;
}

/* ---- slab by slab, upwards ---- */

static void jitter_ring(lathe_tube_stack *s, uint32_t slice, uint32_t tube) {
    int32_t(*v)[3] = s->builder.mesh.lattice + s->rings[slice][tube].base;
    for (uint32_t i = 0; i < s->rays[tube]; i++) {
        lathe_point p = lathe__jitter((lathe_point){v[i][0], v[i][1]}, slice);
        v[i][0] = p.x, v[i][1] = p.y;
    }
}

/* A group's polygons in one of a slab's slices; *vertex: the mesh's vertex of each of theirs, moved on. */
static lathe_status take_outline(lathe_outline *o, uint32_t **vertex, const lathe_tube_stack *s, const lathe_tube_ring *rings, uint32_t group, bool turned) {
    *o = (lathe_outline){.points = LATHE_NEW(s->keep, lathe_point, s->most), .loops = LATHE_NEW(s->keep, lathe_loop, s->radii->count)};
    if (!o->points || !o->loops) return LATHE_ERR_MEMORY;
    for (uint32_t t = 0; t < s->radii->count; t++) {
        uint32_t n = s->rays[t];
        if (!(group >> t & 1) || rings[t].base == LATHE_NO_RING) continue;
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
static lathe_status add_group(lathe_tube_stack *s, uint32_t slab, uint32_t group) {
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

lathe_status lathe__add_group_slab(lathe_tube_stack *s, uint32_t slab) {
    const uint8_t *group = s->group[slab];
    lathe_mesh *mesh = &s->builder.mesh;
    lathe_status status = lathe__builder_reserve(&s->builder, 0, 2 * s->most);
    for (uint32_t t = 0; !status && t < s->radii->count; t++) {
        const lathe_tube_ring *lower = &s->rings[(int32_t)slab - 1][t], *upper = &s->rings[slab][t];
        if (upper->base != LATHE_NO_RING && (group[t] || s->group[slab + 1][t])) jitter_ring(s, slab, t);
        if (group[t] || !in_slab(s, slab, t)) continue;
        lathe__radius_strip(mesh->triangles + mesh->triangle_count, (const int32_t(*)[3])mesh->lattice, lower->base, upper->base, s->rays[t]);
        mesh->triangle_count += 2 * s->rays[t];
    }
    /* When all of the slab's rings are in place. */
    for (uint32_t t = 0; !status && t < s->radii->count; t++)
        if (group[t] && !(group[t] & ((1 << t) - 1))) status = add_group(s, slab, group[t]);
    return status;
}
