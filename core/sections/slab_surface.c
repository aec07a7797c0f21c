/* One slab, in four steps:
 *   1. the lifted overlay of both outlines: it says which loops belong together, does the joints, and is what the slab falls back to;
 *   2. blocks of linked loops, by the overlay's pieces or by the paper's relation matrix;
 *   3. each block is tiled, branched, closed, or left to the overlay; one whose triangles meet falls back to the overlay;
 *   4. the whole is proved; where it fails, the overlay is taken, proved as well.
 * Vertices are numbered: the lower outline's, the upper one's, then what is added. Loops alike. No triangle and no inner edge lies in
 * a slice plane, where the slab beyond could have the same one: such an edge gets a raised middle, such a triangle a raised centroid. */
#include "slab_surface.h"
#include "adjacency.h"
#include "branching.h"
#include "centre.h"
#include "contour_set.h"
#include "level.h"
#include "mesh_intersect.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { NONE = 0xffffffffu };

typedef struct block {
    uint32_t *loops;           /* lower ones first */
    uint32_t count[2];
    lathe_link_kind kind;
    uint32_t piece;            /* of the overlay, or NONE: linked by the paper's rule */
} block;

typedef struct slab {
    const lathe_slab_input *in;
    const lathe_slab_options *options;
    lathe_arena *arena;
    lathe_slab_counts *counts;
    lathe_mesh_builder b;
    lathe_mesh overlay;
    uint32_t *piece;           /* overlay vertex -> the least vertex of its connected piece */
    uint32_t *first, *sorted;  /* overlay triangles piece by piece: those of piece p are sorted[first[p] .. first[p + 1]) */
    uint32_t *members;         /* piece -> its vertices */
    uint32_t *to;              /* overlay vertex -> vertex of the slab, where it has been copied */
    uint32_t *compact;         /* outline vertex -> vertex of the block that is being proved */
    uint32_t upper, vertices;  /* the upper outline's first vertex; of both outlines */
    uint32_t loops0, loops;
    block *blocks;
    uint32_t block_count;
    bool refused;              /* a block: no tiling or polygon came out of it */
} slab;

/* Nodes of a polygon, counter-clockwise: vertices of the slab. */
typedef struct nodes {
    uint32_t *at, count;
} nodes;

static const lathe_loop *loop_at(const slab *s, uint32_t l) {
    return l < s->loops0 ? &s->in->outline[0]->loops[l] : &s->in->outline[1]->loops[l - s->loops0];
}
static int side_of_loop(const slab *s, uint32_t l) { return l >= s->loops0; }
static uint32_t first_vertex(const slab *s, uint32_t l) { return loop_at(s, l)->first + (side_of_loop(s, l) ? s->upper : 0); }
static int side_of(const slab *s, uint32_t v) { return (v >= s->upper) + (v >= s->vertices); }
static int32_t mid_height(const slab *s) { return s->in->height[0] + (s->in->height[1] - s->in->height[0]) / 2; }
static lathe_point position(const slab *s, uint32_t v) {
    const int32_t *p = s->b.mesh.lattice[v];
    return (lathe_point){p[0], p[1]};
}

static lathe_status add_vertex(slab *s, uint32_t *out, int32_t x, int32_t y, int32_t z) {
    lathe_status status = lathe__builder_reserve(&s->b, 1, 0);
    if (status) return status;
    *out = s->b.mesh.vertex_count++;
    int32_t *v = s->b.mesh.lattice[*out];
    v[0] = x, v[1] = y, v[2] = z;
    return LATHE_OK;
}

static lathe_status emit(slab *s, uint32_t a, uint32_t b, uint32_t c, bool flip) {
    lathe_status status = lathe__builder_reserve(&s->b, 0, 1);
    if (status) return status;
    uint32_t *t = s->b.mesh.triangles[s->b.mesh.triangle_count++];
    t[0] = a;
    t[1 + flip] = b;
    t[2 - flip] = c;
    return LATHE_OK;
}

/* ---- 1. the overlay ---- */

static uint32_t find(uint32_t *parent, uint32_t i) {
    while (parent[i] != i) i = parent[i] = parent[parent[i]];
    return i;
}

static void unite(uint32_t *parent, uint32_t a, uint32_t b) {
    a = find(parent, a), b = find(parent, b);
    parent[a > b ? a : b] = a < b ? a : b;
}

static lathe_status build_overlay(lathe_mesh *out, uint64_t *contacts, lathe_arena *arena, const lathe_slab_input *in, int32_t cap) {
    lathe_mesh_builder builder = {0};
    lathe_overlay_counts counts = {0};
    lathe_slab overlay = {.outline = {in->outline[0], in->outline[1]}, .height = {in->height[0], in->height[1]},
                          .base = {0, in->outline[0]->point_count}, .cap = cap, .lattice = in->lattice};
    lathe_status status = lathe__start_slab(&builder, in);
    if (!status) status = lathe__overlay_slab(&builder, arena, &overlay, &counts);
    if (status) {
        lathe_mesh_free(&builder.mesh);
        return status;
    }
    *out = builder.mesh;
    *contacts = counts.contacts;
    return LATHE_OK;
}

static lathe_status find_pieces(slab *s) {
    uint32_t n = s->overlay.vertex_count, triangles = s->overlay.triangle_count;
    s->piece = LATHE_NEW(s->arena, uint32_t, n + 1);
    s->first = LATHE_NEW(s->arena, uint32_t, n + 2);
    s->sorted = LATHE_NEW(s->arena, uint32_t, triangles + 1);
    s->members = LATHE_NEW(s->arena, uint32_t, n + 1);
    s->to = LATHE_NEW(s->arena, uint32_t, n + 1);
    s->compact = LATHE_NEW(s->arena, uint32_t, s->vertices + 1);
    if (!s->piece || !s->first || !s->sorted || !s->members || !s->to || !s->compact) return LATHE_ERR_MEMORY;
    for (uint32_t i = 0; i < n; i++) s->piece[i] = i;
    for (uint32_t t = 0; t < triangles; t++) {
        unite(s->piece, s->overlay.triangles[t][0], s->overlay.triangles[t][1]);
        unite(s->piece, s->overlay.triangles[t][0], s->overlay.triangles[t][2]);
    }
    memset(s->members, 0, (n + 1) * sizeof *s->members);
    memset(s->first, 0, (n + 2) * sizeof *s->first);
    for (uint32_t i = 0; i < n; i++) s->members[s->piece[i] = find(s->piece, i)]++;
    for (uint32_t t = 0; t < triangles; t++) s->first[s->piece[s->overlay.triangles[t][0]] + 2]++;
    for (uint32_t i = 2; i < n + 2; i++) s->first[i] += s->first[i - 1];
    for (uint32_t t = 0; t < triangles; t++) s->sorted[s->first[s->piece[s->overlay.triangles[t][0]] + 1]++] = t;
    return LATHE_OK;
}

/* ---- 2. blocks ---- */

static lathe_link_kind kind_of(const uint32_t count[2]) {
    if (!count[0] || !count[1]) return LATHE_LINK_SELF;
    if (count[0] == 1 && count[1] == 1) return LATHE_LINK_ONE_TO_ONE;
    return count[0] == 1 || count[1] == 1 ? LATHE_LINK_ONE_TO_MANY : LATHE_LINK_MANY_TO_MANY;
}

/* Groups loops that have one representative. owner: loop -> representative loop. */
static lathe_status group_loops(slab *s, const uint32_t *owner, bool pieces) {
    uint32_t *number = LATHE_NEW(s->arena, uint32_t, s->loops + 1), *members = LATHE_NEW(s->arena, uint32_t, s->loops + 1);
    s->blocks = LATHE_NEW(s->arena, block, s->loops + 1);
    if (!number || !members || !s->blocks) return LATHE_ERR_MEMORY;
    for (uint32_t l = 0; l < s->loops; l++) {
        if (owner[l] == l) {
            number[l] = s->block_count;
            s->blocks[s->block_count++] = (block){.piece = pieces ? s->piece[first_vertex(s, l)] : NONE};
        }
        s->blocks[number[owner[l]]].count[side_of_loop(s, l)]++;
    }
    uint32_t used = 0;
    for (uint32_t i = 0; i < s->block_count; i++) {
        block *b = &s->blocks[i];
        b->loops = members + used;
        used += b->count[0] + b->count[1];
        b->kind = kind_of(b->count);
        s->counts->links[b->kind]++;
        b->count[0] = b->count[1] = 0;
    }
    for (uint32_t l = 0; l < s->loops; l++) {
        block *b = &s->blocks[number[owner[l]]];
        b->loops[b->count[0] + b->count[1]] = l;
        b->count[side_of_loop(s, l)]++;
    }
    return LATHE_OK;
}

static lathe_status link_regions(slab *s) {
    uint32_t *owner = LATHE_NEW(s->arena, uint32_t, s->loops + 1), *of_piece = LATHE_NEW(s->arena, uint32_t, s->overlay.vertex_count + 1);
    if (!owner || !of_piece) return LATHE_ERR_MEMORY;
    memset(of_piece, 0xff, s->overlay.vertex_count * sizeof *of_piece);
    for (uint32_t l = 0; l < s->loops; l++) {
        uint32_t *o = &of_piece[s->piece[first_vertex(s, l)]];
        if (*o == NONE) *o = l;
        owner[l] = *o;
    }
    return group_loops(s, owner, true);
}

/* Relation and clustering of the loops of one kind [P 3.1, 3.2]. */
static lathe_status relate_loops(slab *s, uint32_t *owner, bool holes) {
    lathe_point *points[2];
    uint32_t *first[2], *loops[2], count[2] = {0, 0};
    for (int k = 0; k < 2; k++) {
        const lathe_outline *o = s->in->outline[k];
        points[k] = LATHE_NEW(s->arena, lathe_point, o->point_count + 1);
        first[k] = LATHE_NEW(s->arena, uint32_t, o->loop_count + 1);
        loops[k] = LATHE_NEW(s->arena, uint32_t, o->loop_count + 1);
        if (!points[k] || !first[k] || !loops[k]) return LATHE_ERR_MEMORY;
        first[k][0] = 0;
        for (uint32_t l = 0; l < o->loop_count; l++) {
            if (o->loops[l].hole != holes) continue;
            memcpy(points[k] + first[k][count[k]], o->points + o->loops[l].first, o->loops[l].count * sizeof *points[k]);
            loops[k][count[k]++] = l + (k ? s->loops0 : 0);
            first[k][count[k]] = first[k][count[k] - 1] + o->loops[l].count;
        }
    }
    lathe_relation relation;
    lathe_clustering clustering;
    lathe_status status = lathe__relate(&relation, s->arena, points[0], first[0], count[0], points[1], first[1], count[1], s->options->threshold);
    if (!status) status = lathe__cluster(&clustering, s->arena, &relation);
    if (status) return status;
    s->counts->repaired += clustering.repaired;
    for (uint32_t i = 0; i < clustering.block_count; i++) {
        const lathe_block *b = &clustering.blocks[i];
        uint32_t least = NONE;
        for (uint32_t k = 0; k < b->row_count + b->column_count; k++) {
            uint32_t l = k < b->row_count ? loops[0][clustering.row_order[b->row + k]] : loops[1][clustering.column_order[b->column + k - b->row_count]];
            if (l < least) least = l;
        }
        for (uint32_t k = 0; k < b->row_count + b->column_count; k++) {
            uint32_t l = k < b->row_count ? loops[0][clustering.row_order[b->row + k]] : loops[1][clustering.column_order[b->column + k - b->row_count]];
            owner[l] = least;
        }
    }
    return LATHE_OK;
}

/* The smallest outer loop of the same side that holds a hole, or NONE. */
static uint32_t parent_of(const slab *s, uint32_t hole) {
    int side = side_of_loop(s, hole);
    const lathe_outline *o = s->in->outline[side];
    uint32_t base = side ? s->loops0 : 0, best = NONE;
    double least = INFINITY;
    lathe_point p = o->points[o->loops[hole - base].first];
    for (uint32_t l = 0; l < o->loop_count; l++) {
        if (o->loops[l].hole || !lathe__loop_holds(o, l, p)) continue;
        double area = fabs(lathe__loop_area2(o, l));
        if (area < least) least = area, best = l + base;
    }
    return best;
}

/* Holes that end within an outer loop that ends as well are islands of its closing. */
static lathe_status link_paper(slab *s) {
    uint32_t *owner = LATHE_NEW(s->arena, uint32_t, s->loops + 1), *alone = LATHE_NEW(s->arena, uint32_t, s->loops + 1);
    if (!owner || !alone) return LATHE_ERR_MEMORY;
    memset(alone, 0, s->loops * sizeof *alone);
    lathe_status status = relate_loops(s, owner, false);
    if (!status) status = relate_loops(s, owner, true);
    if (status) return status;
    for (uint32_t l = 0; l < s->loops; l++) alone[owner[l]]++;
    for (uint32_t l = 0; l < s->loops; l++) {
        if (!loop_at(s, l)->hole || owner[l] != l || alone[l] != 1) continue;
        uint32_t parent = parent_of(s, l);
        if (parent != NONE && owner[parent] == parent && alone[parent] == 1) owner[l] = parent;
    }
    /* An owner comes before what it owns. */
    for (uint32_t l = 0; l < s->loops; l++) alone[l] = NONE;
    for (uint32_t l = 0; l < s->loops; l++) {
        if (alone[owner[l]] == NONE) alone[owner[l]] = l;
    }
    for (uint32_t l = 0; l < s->loops; l++) owner[l] = alone[owner[l]];
    return group_loops(s, owner, false);
}

/* ---- 3. tubes ---- */

static lathe_status loop_nodes(nodes *out, const slab *s, uint32_t l) {
    const lathe_loop *loop = loop_at(s, l);
    uint32_t first = first_vertex(s, l);
    *out = (nodes){LATHE_NEW(s->arena, uint32_t, loop->count), loop->count};
    if (!out->at) return LATHE_ERR_MEMORY;
    for (uint32_t i = 0; i < loop->count; i++) out->at[i] = loop->hole ? first + loop->count - 1 - i : first + i;
    return LATHE_OK;
}

static double distance2(lathe_point a, lathe_point b) {
    double x = (double)a.x - b.x, y = (double)a.y - b.y;
    return x * x + y * y;
}

/* The vertex next to the i-th crossing. */
static uint32_t vertex_at(const lathe_ray_contour *c, uint32_t i, uint32_t size) {
    const lathe_crossing *x = &c->crossings[i % c->count];
    uint32_t v = x->segment + ((double)x->numerator * 2 >= (double)x->denominator);
    return v < size ? v : v - size;
}

static uint32_t ahead(uint32_t from, uint32_t to, uint32_t size) { return to >= from ? to - from : to + size - from; }

/* The trees walk from crossing to crossing; each step is drawn out to the loops' own vertices next to them, shorter diagonal first. */
static lathe_status draw_out(lathe_tiling *out, const lathe_tiling *trees, lathe_arena *arena, const lathe_ray_contour c[2],
                             const lathe_point *const p[2], const uint32_t size[2]) {
    uint32_t i[2] = {trees->start[0], trees->start[1]}, v[2], n = 0, total = size[0] + size[1];
    uint8_t *steps = LATHE_NEW(arena, uint8_t, total);
    if (!steps) return LATHE_ERR_MEMORY;
    for (int k = 0; k < 2; k++) out->start[k] = v[k] = vertex_at(&c[k], i[k], size[k]);
    for (uint32_t step = 0; step < trees->count; step++) {
        uint32_t left[2];
        for (int k = 0; k < 2; k++) {
            i[k] += trees->steps[step] >> k & 1;
            left[k] = ahead(v[k], vertex_at(&c[k], i[k], size[k]), size[k]);
        }
        while (left[0] || left[1]) {
            if (n == total) return LATHE_ERR_FORMAT;
            int k = !left[0];
            if (left[0] && left[1])
                k = distance2(p[0][(v[0] + 1) % size[0]], p[1][v[1]]) > distance2(p[0][v[0]], p[1][(v[1] + 1) % size[1]]);
            v[k] = (v[k] + 1) % size[k];
            left[k]--;
            steps[n++] = (uint8_t)(1 << k);
        }
    }
    out->steps = steps;
    out->count = n;
    return LATHE_OK;
}

static lathe_status tile_by_trees(lathe_tiling *out, slab *s, const lathe_point *const p[2], const uint32_t size[2], const uint32_t turn[2]) {
    lathe_ray_contour c[2];
    lathe_point centre[2];
    int64_t reach = 0;
    for (int k = 0; k < 2; k++) {
        lathe_status status = lathe__loop_centre(&centre[k], s->arena, p[k], size[k]);
        if (status) return status;
        for (uint32_t i = 0; i < size[k]; i++) {
            int64_t dx = llabs((int64_t)p[k][i].x - centre[k].x), dy = llabs((int64_t)p[k][i].y - centre[k].y);
            if (dx > reach) reach = dx;
            if (dy > reach) reach = dy;
        }
    }
    uint32_t rays = s->options->rays, fewer = size[0] < size[1] ? size[0] : size[1];
    if (!rays) {
        rays = lathe__choose_rays(reach, 0);
        while (rays > 8 && rays > fewer) rays /= 2;
    }
    for (int k = 0; k < 2; k++) {
        lathe_status status = lathe__make_ray_contour(&c[k], s->arena, p[k], size[k], centre[k], rays, turn[k]);
        if (status) return status;
    }
    lathe_tiling trees;
    lathe_status status = lathe__tile_trees(&trees, s->arena, &c[0], &c[1]);
    return status ? status : draw_out(out, &trees, s->arena, c, p, size);
}

/* Each edge of both exactly once? */
static bool is_whole(const lathe_tiling *t, const uint32_t size[2]) {
    uint32_t a = 0, b = 0;
    if (t->start[0] >= size[0] || t->start[1] >= size[1]) return false;
    for (uint32_t i = 0; i < t->count; i++) {
        if (t->steps[i] < 1 || t->steps[i] > 3) return false;
        a += t->steps[i] & 1;
        b += t->steps[i] >> 1;
    }
    return a == size[0] && b == size[1];
}

static lathe_status choose_tiling(lathe_tiling *out, slab *s, const lathe_point *const p[2], const uint32_t size[2], const uint32_t turn[2],
                                  int32_t rise) {
    lathe_status status = LATHE_ERR_FORMAT;
    switch (s->options->tiling) {
    case LATHE_TILING_TREES: status = tile_by_trees(out, s, p, size, turn); break;
    case LATHE_TILING_TOROIDAL: status = lathe__tile_toroidal(out, s->arena, p[0], size[0], p[1], size[1], rise); break;
    case LATHE_TILING_CHRISTIANSEN: status = lathe__tile_christiansen(out, s->arena, p[0], size[0], p[1], size[1], rise); break;
    case LATHE_TILING_SHORTEST: status = lathe__tile_shortest(out, s->arena, p[0], size[0], p[1], size[1], rise); break;
    }
    if (s->options->tiling == LATHE_TILING_TREES && status != LATHE_ERR_MEMORY && (status || !is_whole(out, size))) {
        s->counts->treeless++;
        status = lathe__tile_shortest(out, s->arena, p[0], size[0], p[1], size[1], rise);
    }
    return status || is_whole(out, size) ? status : LATHE_ERR_FORMAT;
}

/* The wall between two polygons, both counter-clockwise; it faces outwards, or inwards with flip. */
static lathe_status tile_wall(slab *s, const nodes *low, const nodes *high, const uint32_t turn[2], bool flip) {
    const nodes *pair[2] = {low, high};
    lathe_point *p[2];
    uint32_t size[2] = {low->count, high->count};
    for (int k = 0; k < 2; k++) {
        if (!(p[k] = LATHE_NEW(s->arena, lathe_point, size[k]))) return LATHE_ERR_MEMORY;
        for (uint32_t i = 0; i < size[k]; i++) p[k][i] = position(s, pair[k]->at[i]);
    }
    lathe_tiling tiling = {0};
    int32_t rise = s->b.mesh.lattice[high->at[0]][2] - s->b.mesh.lattice[low->at[0]][2];
    lathe_status status = choose_tiling(&tiling, s, (const lathe_point *const *)p, size, turn, rise);
    if (status == LATHE_ERR_MEMORY) return status;
    s->refused |= status != LATHE_OK;
    if (s->refused) return LATHE_OK;
    uint32_t i = tiling.start[0], j = tiling.start[1];
    for (uint32_t k = 0; !status && k < tiling.count; k++) {
        uint32_t i1 = (i + 1) % size[0], j1 = (j + 1) % size[1];
        int step = tiling.steps[k], first = step & 1;
        if (step == 3) first = distance2(p[0][i1], p[1][j]) <= distance2(p[0][i], p[1][j1]);
        for (int turn2 = 0; !status && turn2 < (step == 3 ? 2 : 1); turn2++, first = !first) {
            if (first) {
                status = emit(s, low->at[i], low->at[i1], high->at[j], flip);
                i = i1;
            } else {
                status = emit(s, low->at[i], high->at[j1], high->at[j], flip);
                j = j1;
            }
        }
    }
    return status;
}

static uint32_t turn_of(const slab *s, uint32_t l) {
    int side = side_of_loop(s, l);
    return s->in->turn[side] ? s->in->turn[side][l - (side ? s->loops0 : 0)] : 0;
}

static lathe_status build_tube(slab *s, const block *b) {
    nodes low, high;
    bool hole = loop_at(s, b->loops[0])->hole;
    lathe_status status = loop_nodes(&low, s, b->loops[0]);
    if (!status) status = loop_nodes(&high, s, b->loops[1]);
    uint32_t turn[2] = {turn_of(s, b->loops[0]), turn_of(s, b->loops[1])};
    s->counts->tubes++;
    return status ? status : tile_wall(s, &low, &high, turn, hole);
}

/* ---- 3. closings ---- */

static double box_side(const slab *s, const nodes *list, uint32_t count, lathe_point *middle) {
    int32_t low[2] = {INT32_MAX, INT32_MAX}, high[2] = {INT32_MIN, INT32_MIN};
    for (uint32_t k = 0; k < count; k++)
        for (uint32_t i = 0; i < list[k].count; i++)
            for (int a = 0; a < 2; a++) {
                int32_t x = s->b.mesh.lattice[list[k].at[i]][a];
                if (x < low[a]) low[a] = x;
                if (x > high[a]) high[a] = x;
            }
    *middle = (lathe_point){(int32_t)(((int64_t)low[0] + high[0]) / 2), (int32_t)(((int64_t)low[1] + high[1]) / 2)};
    return fmax((double)high[0] - low[0], (double)high[1] - low[1]);
}

/* The loops of a block on one side: the largest one is closed, the others are islands in it. */
static lathe_status close_loops(slab *s, const uint32_t *loops, uint32_t count) {
    uint32_t total = 0, root = 0, used = 0;
    for (uint32_t k = 0; k < count; k++) {
        const lathe_outline *o = s->in->outline[side_of_loop(s, loops[0])];
        uint32_t base = side_of_loop(s, loops[0]) ? s->loops0 : 0;
        total += loop_at(s, loops[k])->count;
        if (fabs(lathe__loop_area2(o, loops[k] - base)) > fabs(lathe__loop_area2(o, loops[root] - base))) root = k;
    }
    lathe_point *at = LATHE_NEW(s->arena, lathe_point, total);
    uint32_t *of = LATHE_NEW(s->arena, uint32_t, total), *ring = LATHE_NEW(s->arena, uint32_t, total);
    uint32_t *end = LATHE_NEW(s->arena, uint32_t, count);
    if (!at || !of || !ring || !end) return LATHE_ERR_MEMORY;
    for (uint32_t k = 0; k < count; k++) {
        nodes n;
        uint32_t l = loops[k == 0 ? root : k == root ? 0 : k];
        lathe_status status = loop_nodes(&n, s, l);
        if (status) return status;
        for (uint32_t i = 0; i < n.count; i++, used++) {
            of[used] = n.at[k ? n.count - 1 - i : i];
            at[used] = position(s, of[used]);
            ring[used] = used;
        }
        end[k] = used;
    }
    lathe_polygon polygon = {.at = at, .nodes = ring, .ring_end = end, .ring_count = count};
    lathe_triangles list = {0};
    lathe_status status = lathe__close_with_islands(&list, s->arena, &polygon);
    bool flip = loop_at(s, loops[root])->hole != (side_of_loop(s, loops[0]) == 1);
    for (uint32_t i = 0; !status && i < list.count; i++) status = emit(s, of[list.at[i][0]], of[list.at[i][1]], of[list.at[i][2]], flip);
    s->counts->closed++;
    return status;
}

/* ---- 3. branchings ---- */

/* One polygon against the many on the other side of it; both heights are those of the nodes. */
static lathe_status branch(slab *s, const nodes *one, const nodes *many, uint32_t count, bool many_above, bool flip) {
    uint32_t total = 0, used = 0, rings;
    for (uint32_t k = 0; k < count; k++) total += many[k].count;
    lathe_point *at = LATHE_NEW(s->arena, lathe_point, total);
    uint32_t *of = LATHE_NEW(s->arena, uint32_t, total), *first = LATHE_NEW(s->arena, uint32_t, count + 1);
    bool *taken = LATHE_NEW(s->arena, bool, count);
    if (!at || !of || !first || !taken) return LATHE_ERR_MEMORY;
    for (uint32_t k = 0; k < count; k++) {
        first[k] = used;
        for (uint32_t i = 0; i < many[k].count; i++, used++) at[used] = position(s, of[used] = many[k].at[i]);
    }
    first[count] = used;
    lathe_many m = {at, first, count};
    nodes f;
    uint32_t *compact;
    lathe_status status = lathe__exterior_polygon(&compact, &f.count, taken, s->arena, &m);
    if (status == LATHE_ERR_FORMAT) {
        s->refused = true;
        return LATHE_OK;
    }
    if (status) return status;
    if (!(f.at = LATHE_NEW(s->arena, uint32_t, f.count))) return LATHE_ERR_MEMORY;
    for (uint32_t i = 0; i < f.count; i++) f.at[i] = of[compact[i]];
    status = tile_wall(s, many_above ? one : &f, many_above ? &f : one, (const uint32_t[2]){0, 0}, flip);
    lathe_triangles list = {0};
    if (!status) status = lathe__close_interior(&list, &rings, s->arena, &m, compact, f.count, taken);
    if (status == LATHE_ERR_FORMAT) {
        s->refused = true;
        return LATHE_OK;
    }
    for (uint32_t i = 0; !status && i < list.count; i++)
        status = emit(s, of[list.at[i][0]], of[list.at[i][1]], of[list.at[i][2]], flip != !many_above);
    return status;
}

static double area_of(const slab *s, const nodes *n) {
    double sum = 0;
    for (uint32_t i = 2; i < n->count; i++) sum += (double)lathe__orient(position(s, n->at[0]), position(s, n->at[i - 1]), position(s, n->at[i]));
    return fabs(sum) / 2;
}

/* The many once more at the middle height, between their own place and size and the one's [P 3.5], with walls up to them. The copies
 * are similar to the originals as a group: so they are disjoint as these are. */
static lathe_status copy_many(slab *s, nodes *copies, const nodes *one, const nodes *many, uint32_t count, bool many_above, bool flip) {
    lathe_point from, to;
    double own = 0;
    box_side(s, many, count, &from);
    box_side(s, one, 1, &to);
    for (uint32_t k = 0; k < count; k++) own += area_of(s, &many[k]);
    /* Never so large that copies of far parts leave the one's neighbourhood, never vanishing. */
    double scale = (1 + fmin(fmax(sqrt(area_of(s, one) / fmax(own, 1)), 0.5), 1.25)) / 2;
    for (uint32_t k = 0; k < count; k++) {
        copies[k] = (nodes){LATHE_NEW(s->arena, uint32_t, many[k].count), many[k].count};
        if (!copies[k].at) return LATHE_ERR_MEMORY;
        for (uint32_t i = 0; i < many[k].count; i++) {
            lathe_point p = position(s, many[k].at[i]);
            lathe_status status = add_vertex(s, &copies[k].at[i], (int32_t)lround((from.x + (double)to.x) / 2 + (p.x - (double)from.x) * scale),
                                             (int32_t)lround((from.y + (double)to.y) / 2 + (p.y - (double)from.y) * scale), mid_height(s));
            if (status) return status;
        }
        /* Copy and original have corresponding points: one-to-one needs no search. */
        for (uint32_t i = 0; i < many[k].count; i++) {
            uint32_t j = (i + 1) % many[k].count;
            const nodes *low = many_above ? &copies[k] : &many[k], *high = many_above ? &many[k] : &copies[k];
            lathe_status status = emit(s, low->at[i], low->at[j], high->at[i], flip);
            if (!status) status = emit(s, low->at[j], high->at[j], high->at[i], flip);
            if (status) return status;
        }
    }
    return LATHE_OK;
}

static lathe_status branch_one_to_many(slab *s, const nodes *one, const nodes *many, uint32_t count, bool many_above, bool flip) {
    lathe_point middle;
    double side = box_side(s, many, count, &middle);
    if (!s->options->mid_slices || (double)s->in->height[1] - s->in->height[0] <= side / 4) return branch(s, one, many, count, many_above, flip);
    nodes *copies = LATHE_NEW(s->arena, nodes, count);
    if (!copies) return LATHE_ERR_MEMORY;
    s->counts->copied++;
    lathe_status status = copy_many(s, copies, one, many, count, many_above, flip);
    return status ? status : branch(s, one, copies, count, many_above, flip);
}

/* The polygon that goes between many and many [P 3.6]: the hull of both hulls, at the middle height; edges longer than the longest
 * allowed one, twice the mean edge of the block, get points. */
static lathe_status middle_polygon(slab *s, nodes *out, const nodes *list, uint32_t count) {
    uint32_t total = 0, used = 0;
    double length = 0;
    for (uint32_t k = 0; k < count; k++) total += list[k].count;
    lathe_point *at = LATHE_NEW(s->arena, lathe_point, total), *hull = LATHE_NEW(s->arena, lathe_point, total + 1);
    if (!at || !hull) return LATHE_ERR_MEMORY;
    for (uint32_t k = 0; k < count; k++)
        for (uint32_t i = 0; i < list[k].count; i++) {
            at[used++] = position(s, list[k].at[i]);
            length += sqrt(distance2(at[used - 1], position(s, list[k].at[(i + 1) % list[k].count])));
        }
    uint32_t n = lathe__convex_hull(hull, at, total);
    if (!n) return LATHE_ERR_MEMORY;
    double longest = fmax(2 * length / total, 4), around = 0;
    for (uint32_t i = 0; i < n; i++) around += sqrt(distance2(hull[i], hull[(i + 1) % n]));
    if (around / longest > (double)total * 4) longest = around / (total * 4.0);
    *out = (nodes){LATHE_NEW(s->arena, uint32_t, (size_t)total * 4 + 2 * (size_t)n + 8), 0};
    if (!out->at) return LATHE_ERR_MEMORY;
    for (uint32_t i = 0; i < n; i++) {
        lathe_point a = hull[i], b = hull[(i + 1) % n];
        uint32_t parts = (uint32_t)ceil(sqrt(distance2(a, b)) / longest);
        for (uint32_t k = 0; k < (parts ? parts : 1); k++) {
            double t = (double)k / (parts ? parts : 1);
            lathe_status status = add_vertex(s, &out->at[out->count++], (int32_t)lround(a.x + ((double)b.x - a.x) * t),
                                             (int32_t)lround(a.y + ((double)b.y - a.y) * t), mid_height(s));
            if (status) return status;
        }
    }
    return LATHE_OK;
}

static lathe_status build_branching(slab *s, const block *b) {
    uint32_t total = b->count[0] + b->count[1];
    bool hole = loop_at(s, b->loops[0])->hole;
    nodes *list = LATHE_NEW(s->arena, nodes, total), middle;
    if (!list) return LATHE_ERR_MEMORY;
    for (uint32_t k = 0; k < total; k++) {
        lathe_status status = loop_nodes(&list[k], s, b->loops[k]);
        if (status) return status;
    }
    s->counts->branched++;
    if (b->count[0] == 1) return branch_one_to_many(s, &list[0], list + 1, b->count[1], true, hole);
    if (b->count[1] == 1) return branch_one_to_many(s, &list[b->count[0]], list, b->count[0], false, hole);
    lathe_status status = middle_polygon(s, &middle, list, total);
    if (!status) status = branch(s, &middle, list, b->count[0], false, hole);
    return status ? status : branch(s, &middle, list + b->count[0], b->count[1], true, hole);
}

/* ---- 3. the overlay of a block ---- */

/* A piece of the slab's overlay. */
static lathe_status copy_piece(slab *s, uint32_t piece) {
    lathe_status status = LATHE_OK;
    for (uint32_t i = s->first[piece]; i < s->first[piece + 1]; i++)
        for (int k = 0; k < 3; k++) {
            uint32_t v = s->overlay.triangles[s->sorted[i]][k];
            s->to[v] = v < s->vertices ? v : NONE;
        }
    for (uint32_t i = s->first[piece]; !status && i < s->first[piece + 1]; i++) {
        const uint32_t *t = s->overlay.triangles[s->sorted[i]];
        for (int k = 0; k < 3 && !status; k++) {
            const int32_t *p = s->overlay.lattice[t[k]];
            if (s->to[t[k]] == NONE) status = add_vertex(s, &s->to[t[k]], p[0], p[1], p[2]);
        }
        if (!status) status = emit(s, s->to[t[0]], s->to[t[1]], s->to[t[2]], false);
    }
    return status;
}

/* The loops of a block as outlines of their own, turned round with flip. of: their vertices, in order; arena memory. */
static lathe_status cut_out(lathe_outline part[2], uint32_t **of, slab *s, const block *b, bool flip) {
    uint32_t total = 0, used = 0;
    for (uint32_t k = 0; k < b->count[0] + b->count[1]; k++) total += loop_at(s, b->loops[k])->count;
    *of = LATHE_NEW(s->arena, uint32_t, total + 1);
    if (!*of) return LATHE_ERR_MEMORY;
    for (int side = 0, k = 0; side < 2; side++) {
        lathe_outline *o = &part[side];
        *o = (lathe_outline){.points = LATHE_NEW(s->arena, lathe_point, total + 1), .loops = LATHE_NEW(s->arena, lathe_loop, b->count[side] + 1)};
        if (!o->points || !o->loops) return LATHE_ERR_MEMORY;
        for (uint32_t i = 0; i < b->count[side]; i++, k++) {
            const lathe_loop *loop = loop_at(s, b->loops[k]);
            uint32_t first = first_vertex(s, b->loops[k]);
            lathe_loop *copy = &o->loops[o->loop_count++];
            *copy = *loop;
            copy->first = o->point_count;
            copy->hole = loop->hole != flip;
            for (uint32_t v = 0; v < loop->count; v++, used++) {
                (*of)[used] = flip ? first + loop->count - 1 - v : first + v;
                o->points[o->point_count++] = position(s, (*of)[used]);
            }
        }
    }
    return LATHE_OK;
}

/* The overlay of a block's loops alone; a block of holes is turned inside out. */
static lathe_status overlay_block(slab *s, const block *b) {
    bool flip = loop_at(s, b->loops[0])->hole;
    lathe_outline part[2];
    uint32_t *of;
    lathe_status status = cut_out(part, &of, s, b, flip);
    if (status) return status;
    uint32_t total = part[0].point_count + part[1].point_count;
    lathe_slab_input in = *s->in;
    lathe_mesh mesh = {0};
    uint64_t contacts;
    in.outline[0] = &part[0], in.outline[1] = &part[1];
    /* Links by threshold leave loops apart that overlap: their caps must not meet at the middle height. */
    status = build_overlay(&mesh, &contacts, s->arena, &in, (in.height[1] - in.height[0]) / 2 / 8 * 7);
    uint32_t *to = status ? NULL : LATHE_NEW(s->arena, uint32_t, mesh.vertex_count + 1);
    if (!status && !to) status = LATHE_ERR_MEMORY;
    for (uint32_t v = 0; !status && v < mesh.vertex_count; v++) {
        if (v < total) to[v] = of[v];
        else status = add_vertex(s, &to[v], mesh.lattice[v][0], mesh.lattice[v][1], mesh.lattice[v][2]);
    }
    for (uint32_t i = 0; !status && i < mesh.triangle_count; i++)
        status = emit(s, to[mesh.triangles[i][0]], to[mesh.triangles[i][1]], to[mesh.triangles[i][2]], flip);
    lathe_mesh_free(&mesh);
    return status;
}

/* ---- no triangle lies flat ---- */

static bool is_flat_edge(const slab *s, uint32_t a, uint32_t b) {
    int side = side_of(s, a);
    if (side == 2 || side_of(s, b) != side) return false;
    /* Loops are few against vertices, and both ends of an outline edge are neighbours in the numbering but at a loop's seam. */
    uint32_t low = a < b ? a : b, high = a < b ? b : a;
    const lathe_outline *o = s->in->outline[side];
    uint32_t base = side ? s->upper : 0, i = 0, j = o->loop_count;
    while (j - i > 1) {
        uint32_t m = (i + j) / 2;
        if (o->loops[m].first + base <= low) i = m;
        else j = m;
    }
    uint32_t first = o->loops[i].first + base, last = first + o->loops[i].count - 1;
    return !(high <= last && (high == low + 1 || (low == first && high == last)));
}

/* Raises what the triangles from `from` on have in a slice plane. */
static lathe_status raise_flat(slab *s, uint32_t from, int32_t rise) {
    uint32_t count = s->b.mesh.triangle_count - from;
    uint32_t(*t)[3] = lathe__arena_alloc(s->arena, count + 1, sizeof *t), *mid = LATHE_NEW(s->arena, uint32_t, (size_t)count * 3 + 1);
    lathe_half_edges edges;
    if (!t || !mid) return LATHE_ERR_MEMORY;
    if (!count) return LATHE_OK;
    memcpy(t, s->b.mesh.triangles + from, count * sizeof *t);
    memset(mid, 0xff, (size_t)count * 3 * sizeof *mid);
    lathe_status status = lathe__half_edges_build(&edges, s->arena, (const uint32_t(*)[3])t, count);
    for (uint32_t i = 0; !status && i < count * 3; i++) {
        uint32_t a = t[i / 3][i % 3], b = t[i / 3][(i + 1) % 3];
        if (mid[i] != NONE || !is_flat_edge(s, a, b)) continue;
        lathe_point p = position(s, a), q = position(s, b);
        int32_t z = side_of(s, a) ? s->in->height[1] - rise : s->in->height[0] + rise;
        status = add_vertex(s, &mid[i], (int32_t)(((int64_t)p.x + q.x) / 2), (int32_t)(((int64_t)p.y + q.y) / 2), z);
        uint32_t twin = lathe__half_edge(&edges, b, a);
        if (twin != LATHE_NO_NEIGHBOUR) mid[twin] = mid[i];
    }
    s->b.mesh.triangle_count = from;
    for (uint32_t i = 0; !status && i < count; i++) {
        const uint32_t *v = t[i], *m = mid + 3 * (size_t)i;
        int split = (m[0] != NONE) + (m[1] != NONE) + (m[2] != NONE), k = 0;
        if (!split) {
            if (side_of(s, v[0]) == 2 || side_of(s, v[0]) != side_of(s, v[1]) || side_of(s, v[0]) != side_of(s, v[2])) {
                status = emit(s, v[0], v[1], v[2], false);
                continue;
            }
            int64_t x = 0, y = 0;
            uint32_t centre;
            for (int c = 0; c < 3; c++) x += position(s, v[c]).x, y += position(s, v[c]).y;
            status = add_vertex(s, &centre, (int32_t)(x / 3), (int32_t)(y / 3),
                                side_of(s, v[0]) ? s->in->height[1] - rise : s->in->height[0] + rise);
            for (int c = 0; !status && c < 3; c++) status = emit(s, v[c], v[(c + 1) % 3], centre, false);
            continue;
        }
        if (split == 3) {
            for (; !status && k < 3; k++) status = emit(s, v[k], m[k], m[(k + 2) % 3], false);
            if (!status) status = emit(s, m[0], m[1], m[2], false);
            continue;
        }
        /* The only edge that is split, or the only one that is not: from a to b; c is opposite. */
        while ((m[k] != NONE) != (split == 1)) k++;
        uint32_t a = v[k], b = v[(k + 1) % 3], c = v[(k + 2) % 3], bc = m[(k + 1) % 3], ca = m[(k + 2) % 3];
        if (split == 1) {
            status = emit(s, a, m[k], c, false);
            if (!status) status = emit(s, m[k], b, c, false);
        } else {
            status = emit(s, ca, bc, c, false);
            if (!status) status = emit(s, a, b, bc, false);
            if (!status) status = emit(s, a, bc, ca, false);
        }
    }
    return status;
}

/* ---- blocks, and the whole ---- */

static bool is_uniform(const slab *s, const block *b) {
    for (uint32_t k = 1; k < b->count[0] + b->count[1]; k++)
        if (loop_at(s, b->loops[k])->hole != loop_at(s, b->loops[0])->hole) return false;
    return true;
}

static int32_t rise_of(const slab *s) {
    int32_t height = s->in->height[1] - s->in->height[0];
    return s->in->end ? s->in->cap : height / 16 > 0 ? height / 16 : 1;
}

/* Are the block's triangles from `from` on, with the vertices from `added` on, a proper surface between its loops? */
static lathe_status is_free(bool *out, slab *s, const block *b, uint32_t from, uint32_t added) {
    lathe_outline part[2];
    lathe_mesh_builder builder = {0};
    lathe_slab_input in = *s->in;
    lathe_slab_faults faults = {0};
    uint32_t *of, count = s->b.mesh.triangle_count - from, more = s->b.mesh.vertex_count - added;
    lathe_status status = cut_out(part, &of, s, b, false);
    in.outline[0] = &part[0], in.outline[1] = &part[1];
    if (!status) status = lathe__start_slab(&builder, &in);
    if (!status) status = lathe__builder_reserve(&builder, more, count);
    if (!status) {
        lathe_mesh *m = &builder.mesh;
        uint32_t own = m->vertex_count;
        for (uint32_t v = 0; v < own; v++) s->compact[of[v]] = v;
        memcpy(m->lattice + own, s->b.mesh.lattice + added, more * sizeof *m->lattice);
        m->vertex_count += more;
        m->triangle_count = count;
        for (uint32_t i = 0; i < count * 3; i++) {
            uint32_t v = s->b.mesh.triangles[from + i / 3][i % 3];
            m->triangles[i / 3][i % 3] = v < s->vertices ? s->compact[v] : v - added + own;
        }
        status = lathe__prove_slab(&faults, s->arena, m, &in);
    }
    *out = lathe__slab_is_sound(&faults);
    lathe_mesh_free(&builder.mesh);
    return status;
}

/* Is the block's piece of the overlay a sphere with one opening for each loop? Then what is tiled instead has its topology. */
static bool is_plain(const slab *s, const block *b) {
    uint32_t vertices = s->members[b->piece], triangles = s->first[b->piece + 1] - s->first[b->piece], open = 0;
    for (uint32_t k = 0; k < b->count[0] + b->count[1]; k++) open += loop_at(s, b->loops[k])->count;
    /* Inner edges have two triangles, outline edges one. */
    int64_t edges = (3 * (int64_t)triangles + open) / 2, euler = (int64_t)vertices - edges + triangles;
    return euler == 2 - (int64_t)(b->count[0] + b->count[1]);
}

static lathe_status build_block(slab *s, const block *b) {
    uint32_t vertices = s->b.mesh.vertex_count, triangles = s->b.mesh.triangle_count;
    bool paper = s->options->branching == LATHE_BRANCHING_PAPER, uniform = is_uniform(s, b), done = true, free = true;
    lathe_slab_counts before = *s->counts;
    lathe_status status = LATHE_OK;
    s->refused = false;
    if (b->piece != NONE && b->kind != LATHE_LINK_SELF && !is_plain(s, b)) {
        s->counts->handles++;
        s->counts->overlaid++;
        return copy_piece(s, b->piece);
    }
    if (b->kind == LATHE_LINK_ONE_TO_ONE && uniform) status = build_tube(s, b);
    else if (b->kind == LATHE_LINK_SELF && (paper || s->in->end)) status = close_loops(s, b->loops, b->count[0] + b->count[1]);
    else if (b->kind != LATHE_LINK_SELF && paper && uniform) status = build_branching(s, b);
    else done = false;
    if (!status && done && !s->refused && rise_of(s)) status = raise_flat(s, triangles, rise_of(s));
    if (!status && done && !s->refused) status = is_free(&free, s, b, triangles, vertices);
    if (status || (done && free && !s->refused)) return status;
    bool refused = s->refused;
    *s->counts = before;
    if (done) ++*(refused ? &s->counts->refused : &s->counts->crossed);
    s->counts->overlaid++;
    s->b.mesh.vertex_count = vertices;
    s->b.mesh.triangle_count = triangles;
    return b->piece != NONE ? copy_piece(s, b->piece) : overlay_block(s, b);
}

static lathe_status build(slab *s) {
    s->upper = s->in->outline[0]->point_count;
    s->vertices = s->upper + s->in->outline[1]->point_count;
    s->loops0 = s->in->outline[0]->loop_count;
    s->loops = s->loops0 + s->in->outline[1]->loop_count;
    lathe_status status = find_pieces(s);
    if (!status) status = s->options->links == LATHE_LINKS_PAPER && !s->in->end ? link_paper(s) : link_regions(s);
    if (!status) status = lathe__start_slab(&s->b, s->in);
    for (uint32_t i = 0; !status && i < s->block_count; i++) status = build_block(s, &s->blocks[i]);
    return status;
}

lathe_status lathe__build_slab(lathe_mesh *out, lathe_slab_outcome *outcome, lathe_slab_counts *counts, lathe_slab_faults *faults,
                               lathe_arena *arena, const lathe_slab_input *in, const lathe_slab_options *options) {
    lathe_slab_counts mine = {0};
    slab s = {.in = in, .options = options, .arena = arena, .counts = &mine};
    uint64_t contacts = 0;
    lathe_slab_faults found = {0};
    *outcome = LATHE_SLAB_AT_FAULT;
    *out = (lathe_mesh){0};
    lathe_status status = build_overlay(&s.overlay, &contacts, arena, in, in->end && in->cap ? in->cap : (in->height[1] - in->height[0]) / 2);
    if (status || contacts) goto cleanup;   /* outlines that touch: what the overlay says is not to be trusted */
    status = build(&s);
    if (!status) status = lathe__prove_slab(&found, arena, &s.b.mesh, in);
    if (status) goto cleanup;
    if (lathe__slab_is_sound(&found)) {
        *out = s.b.mesh;
        s.b.mesh = (lathe_mesh){0};
        *outcome = LATHE_SLAB_SOUND;
    } else {
        *faults = found;
        /* Beyond the ends a flat cap has no overlay to fall back to. */
        status = in->end && !in->cap ? LATHE_OK : lathe__prove_slab(&found, arena, &s.overlay, in);
        if (!status && lathe__slab_is_sound(&found)) {
            *out = s.overlay;
            s.overlay = (lathe_mesh){0};
            *outcome = LATHE_SLAB_OVERLAID;
            mine.tubes = mine.branched = mine.closed = mine.copied = 0;
            mine.overlaid = s.block_count;
        } else if (!status) {
            *faults = found;
        }
    }
    *counts = mine;
cleanup:
    lathe_mesh_free(&s.b.mesh);
    lathe_mesh_free(&s.overlay);
    return status;
}

/* ---- the last resort ---- */

lathe_status lathe__separate_slab(lathe_mesh *out, lathe_slab_outcome *outcome, lathe_slab_faults *faults, lathe_arena *arena,
                                  const lathe_slab_input *in) {
    lathe_slab_counts counts = {0};
    lathe_slab_options options = {.branching = LATHE_BRANCHING_PAPER};
    slab s = {.in = in, .options = &options, .arena = arena, .counts = &counts};
    s.upper = in->outline[0]->point_count;
    s.vertices = s.upper + in->outline[1]->point_count;
    s.loops0 = in->outline[0]->loop_count;
    s.loops = s.loops0 + in->outline[1]->loop_count;
    *out = (lathe_mesh){0};
    *outcome = LATHE_SLAB_AT_FAULT;
    lathe_status status = lathe__start_slab(&s.b, in);
    uint32_t *loops = LATHE_NEW(arena, uint32_t, s.loops + 1);
    if (!status && !loops) status = LATHE_ERR_MEMORY;
    for (uint32_t l = 0; !status && l < s.loops; l++) {
        if (loop_at(&s, l)->hole) continue;
        uint32_t count = 0;
        loops[count++] = l;
        for (uint32_t k = 0; k < s.loops; k++)
            if (loop_at(&s, k)->hole && side_of_loop(&s, k) == side_of_loop(&s, l) && parent_of(&s, k) == l) loops[count++] = k;
        status = close_loops(&s, loops, count);
    }
    if (!status && rise_of(&s)) status = raise_flat(&s, 0, rise_of(&s));
    if (!status) status = lathe__prove_slab(faults, arena, &s.b.mesh, in);
    if (!status && lathe__slab_is_sound(faults)) {
        *out = s.b.mesh;
        *outcome = LATHE_SLAB_SOUND;
        return LATHE_OK;
    }
    lathe_mesh_free(&s.b.mesh);
    return status;
}
