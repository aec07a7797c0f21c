/* See tube_surface.h. The triangles of a strip hang on rays: those of the fold on ray i and of the level-1 edge that
 * leads from it to the next one are group i. A group is made by walking the two contours' folds on that ray, so a new
 * ray between i and the next makes group i and its own anew, and those whose folds come there: on the next ray, and,
 * with excursions, on rays farther away. */
#include "tube_surface.h"
#include <stdlib.h>
#include <string.h>

#define NONE UINT32_MAX
static const uint32_t MOST = (1u << 28) - 1;

typedef struct triangle {
    uint32_t corner[3], next;
} triangle; /* next in its group; corner[0] == NONE: free, next free one */
typedef struct slice {
    lathe_tube_loop loop;
    lathe_edit_contour contour;
    uint32_t *vertex; /* by crossing */
    uint32_t vertex_capacity, vertex_count, apex;
} slice;
typedef struct strip {
    lathe_edit_tree right, left; /* of the slice below, towards the one above; and the other way */
    uint32_t *group;             /* by ray: its triangles */
    uint32_t *made;              /* by ray: the last ray for whose sake it was made */
    uint32_t
        *passed[2]; /* by edge of either contour: the last ray for whose sake it was passed on the way to its group */
    uint32_t capacity, made_capacity, passed_capacity[2];
} strip;
typedef struct added_ray {
    uint32_t after, angle;
} added_ray;

struct lathe_tube_surface {
    slice *slices;
    strip *strips; /* strips[k] joins slices k and k + 1 */
    uint32_t count, first_rays;
    added_ray *added; /* in the order in which they came */
    uint32_t added_count, added_capacity;
    uint32_t *fan[2]; /* the ends' triangles by edge */
    uint32_t fan_capacity[2];
    int32_t (*vertices)[3];
    triangle *triangles;
    uint32_t vertex_count, vertex_capacity, triangle_count, triangle_capacity, free_triangle, live;
    uint32_t (*fresh)[3], *match; /* a group's new triangles, and which old ones they are */
    uint32_t fresh_count, fresh_capacity, match_capacity;
    lathe_tube_work work;
    lathe_arena scratch;
};
typedef lathe_tube_surface tube;

static bool grow(void **array, uint32_t *capacity, uint32_t want, size_t size) {
    if (want <= *capacity && *array) return true;
    uint32_t more = *capacity + *capacity / 2 + 64;
    if (want > MOST) return false;
    if (more < want) more = want;
    void *p = realloc(*array, more * size);
    if (!p) return false;
    *array = p;
    *capacity = more;
    return true;
}
static bool grow_indices(uint32_t **array, uint32_t *capacity, uint32_t want) {
    void *p = *array;
    bool ok = grow(&p, capacity, want, sizeof **array);
    *array = p;
    return ok;
}

/* ---- vertices and triangles ---- */

static lathe_status add_vertex(tube *t, uint32_t *out, lathe_point p, int32_t height) {
    void *v = t->vertices;
    bool ok = grow(&v, &t->vertex_capacity, t->vertex_count + 1, sizeof *t->vertices);
    t->vertices = v;
    if (!ok) return LATHE_ERR_MEMORY;
    int32_t *at = t->vertices[t->vertex_count];
    at[0] = p.x, at[1] = p.y, at[2] = height;
    *out = t->vertex_count++;
    t->work.vertices++;
    return LATHE_OK;
}
/* Vertices for the crossings that have none. */
static lathe_status add_vertices(tube *t, slice *s) {
    if (!grow_indices(&s->vertex, &s->vertex_capacity, s->contour.count)) return LATHE_ERR_MEMORY;
    for (; s->vertex_count < s->contour.count; s->vertex_count++) {
        lathe_status status =
            add_vertex(t, &s->vertex[s->vertex_count], s->contour.crossings[s->vertex_count].point, s->loop.height);
        if (status) return status;
    }
    return LATHE_OK;
}
static lathe_status add_triangle(tube *t, uint32_t *out, const uint32_t corner[3]) {
    uint32_t index = t->free_triangle;
    if (index != NONE)
        t->free_triangle = t->triangles[index].next;
    else {
        void *p = t->triangles;
        bool ok = grow(&p, &t->triangle_capacity, t->triangle_count + 1, sizeof *t->triangles);
        t->triangles = p;
        if (!ok) return LATHE_ERR_MEMORY;
        index = t->triangle_count++;
    }
    t->triangles[index] = (triangle){{corner[0], corner[1], corner[2]}, NONE};
    t->live++;
    t->work.added++;
    *out = index;
    return LATHE_OK;
}
static void remove_triangle(tube *t, uint32_t index) {
    t->triangles[index].corner[0] = NONE;
    t->triangles[index].next = t->free_triangle;
    t->free_triangle = index;
    t->live--;
    t->work.removed++;
}

/* ---- the ends ---- */

static lathe_status set_fan_triangle(tube *t, int end, uint32_t edge) {
    const slice *s = &t->slices[end ? t->count - 1 : 0];
    uint32_t a = s->vertex[edge], b = s->vertex[s->contour.crossings[edge].next];
    const uint32_t corner[3] = {s->apex, end ? a : b, end ? b : a};
    return add_triangle(t, &t->fan[end][edge], corner);
}
static lathe_status make_fan(tube *t, int end) {
    slice *s = &t->slices[end ? t->count - 1 : 0];
    lathe_status status = add_vertex(t, &s->apex, s->loop.centre, s->loop.height);
    if (!grow_indices(&t->fan[end], &t->fan_capacity[end], s->contour.count)) return LATHE_ERR_MEMORY;
    for (uint32_t e = 0; e < s->contour.count && !status; e++) status = set_fan_triangle(t, end, e);
    return status;
}
static lathe_status refine_fan(tube *t, int end) {
    const lathe_edit_contour *c = &t->slices[end ? t->count - 1 : 0].contour;
    lathe_status status = LATHE_OK;
    if (!grow_indices(&t->fan[end], &t->fan_capacity[end], c->count)) return LATHE_ERR_MEMORY;
    for (uint32_t k = 0; k < c->refined_count && !status; k++) {
        uint32_t edge = c->refined[k], first = c->crossings[edge].split_first,
                 last = first + c->crossings[edge].split_count;
        remove_triangle(t, t->fan[end][edge]);
        status = set_fan_triangle(t, end, edge);
        for (uint32_t e = first; e < last && !status; e++) status = set_fan_triangle(t, end, e);
    }
    return status;
}

/* ---- groups ---- */

static lathe_status add_fresh(tube *t, uint32_t a, uint32_t b, uint32_t c) {
    void *p = t->fresh;
    bool ok = grow(&p, &t->fresh_capacity, t->fresh_count + 1, sizeof *t->fresh);
    t->fresh = p;
    if (!ok) return LATHE_ERR_MEMORY;
    uint32_t *at = t->fresh[t->fresh_count++];
    at[0] = a, at[1] = b, at[2] = c;
    return LATHE_OK;
}
static int64_t flat_distance2(lathe_point p, lathe_point q) {
    int64_t dx = (int64_t)p.x - q.x, dy = (int64_t)p.y - q.y;
    return dx * dx + dy * dy;
}
/* One step of a tiling from the span (a, b), crossings of the lower and of the upper slice. */
static lathe_status add_step(tube *t, const slice *lower, const slice *upper, uint8_t step, uint32_t a, uint32_t b) {
    const lathe_edit_crossing *ca = lower->contour.crossings, *cb = upper->contour.crossings;
    uint32_t na = ca[a].next, nb = cb[b].next;
    const uint32_t *va = lower->vertex, *vb = upper->vertex;
    if (step == 1) return add_fresh(t, va[a], va[na], vb[b]);
    if (step == 2) return add_fresh(t, va[a], vb[nb], vb[b]);
    /* The shorter diagonal; of equal ones always the same. */
    bool rising = flat_distance2(ca[a].point, cb[nb].point) < flat_distance2(ca[na].point, cb[b].point);
    lathe_status status = add_fresh(t, va[a], va[na], rising ? vb[nb] : vb[b]);
    return status ? status : rising ? add_fresh(t, va[a], vb[nb], vb[b]) : add_fresh(t, va[na], vb[nb], vb[b]);
}
/* A group's triangles into `fresh`. */
static lathe_status walk_group(tube *t, uint32_t k, uint32_t ray) {
    slice *lower = &t->slices[k], *upper = &t->slices[k + 1];
    strip *s = &t->strips[k];
    uint32_t main_a = s->right.nodes[s->right.level1[ray]].edge, main_b = s->left.nodes[s->left.level1[ray]].edge;
    uint32_t before = lower->contour.rays[ray].before;
    uint32_t a = lower->contour.crossings[s->right.nodes[s->right.level1[before]].edge].next;
    uint32_t b = upper->contour.crossings[s->left.nodes[s->left.level1[before]].edge].next;
    if (a == main_a && b == main_b) return add_step(t, lower, upper, 3, a, b);
    lathe_derivation fold_a, fold_b;
    lathe_ray_contour points_a, points_b;
    lathe_tiling tiling;
    uint32_t *ids;
    lathe__arena_reset(&t->scratch);
    lathe_status status = lathe__edit_tree_fold(&fold_a, &points_a, &ids, &t->scratch, &s->right, &lower->contour, ray);
    if (!status) status = lathe__edit_tree_fold(&fold_b, &points_b, &ids, &t->scratch, &s->left, &upper->contour, ray);
    if (!status) status = lathe__walk_derivations(&tiling, NULL, &t->scratch, &points_a, &fold_a, &points_b, &fold_b);
    for (uint32_t i = 0; !status && i < tiling.count; i++) {
        status = add_step(t, lower, upper, tiling.steps[i], a, b);
        if (tiling.steps[i] & 1) a = lower->contour.crossings[a].next;
        if (tiling.steps[i] & 2) b = upper->contour.crossings[b].next;
    }
    return status;
}

static uint32_t hash(const uint32_t corner[3]) {
    return (corner[0] * 0x9e3779b1u ^ corner[1] * 0x85ebca77u ^ corner[2] * 0xc2b2ae3du) * 0x27d4eb2fu;
}
/* Old triangles (a list) against t->fresh: match[i] becomes the old one that the i-th new one is, or NONE; the others
 * are removed. Steps give corners in the order lower slice first, so equal triangles are equal as they are written. */
static lathe_status match_old(tube *t, uint32_t old) {
    uint32_t size = 16;
    while (size < 2 * t->fresh_count) size *= 2;
    lathe__arena_reset(&t->scratch);
    uint32_t *table = LATHE_NEW(&t->scratch, uint32_t, size);
    if (!table || !grow_indices(&t->match, &t->match_capacity, t->fresh_count)) return LATHE_ERR_MEMORY;
    memset(table, 0xff, size * sizeof *table);
    memset(t->match, 0xff, t->fresh_count * sizeof *t->match);
    for (uint32_t i = 0; i < t->fresh_count; i++) {
        uint32_t h = hash(t->fresh[i]) >> 7 & (size - 1);
        while (table[h] != NONE) h = (h + 1) & (size - 1);
        table[h] = i;
    }
    for (uint32_t next; old != NONE; old = next) {
        next = t->triangles[old].next;
        uint32_t h = hash(t->triangles[old].corner) >> 7 & (size - 1);
        while (table[h] != NONE && memcmp(t->fresh[table[h]], t->triangles[old].corner, sizeof *t->fresh))
            h = (h + 1) & (size - 1);
        if (table[h] == NONE)
            remove_triangle(t, old);
        else {
            t->match[table[h]] = old;
            t->work.kept++;
        }
    }
    return LATHE_OK;
}
/* The new triangles [from, to) become a group's. */
static lathe_status fill_group(tube *t, strip *s, uint32_t ray, uint32_t from, uint32_t to) {
    s->group[ray] = NONE;
    for (uint32_t i = from; i < to; i++) {
        uint32_t index = t->match[i];
        lathe_status status = index == NONE ? add_triangle(t, &index, t->fresh[i]) : LATHE_OK;
        if (status) return status;
        t->triangles[index].next = s->group[ray];
        s->group[ray] = index;
    }
    return LATHE_OK;
}
/* Makes one or two groups of strip k anew; where a ray's group was empty it is new. */
static lathe_status remake_groups(tube *t, uint32_t k, const uint32_t *rays, uint32_t count) {
    strip *s = &t->strips[k];
    uint32_t end[3] = {0}, old = NONE;
    t->fresh_count = 0;
    for (uint32_t i = 0; i < count; i++) {
        lathe_status status = walk_group(t, k, rays[i]);
        if (status) return status;
        end[i + 1] = t->fresh_count;
        for (uint32_t x = s->group[rays[i]], next; x != NONE; x = next) {
            next = t->triangles[x].next;
            t->triangles[x].next = old;
            old = x;
        }
    }
    lathe_status status = match_old(t, old);
    for (uint32_t i = 0; i < count && !status; i++) status = fill_group(t, s, rays[i], end[i], end[i + 1]);
    return status;
}

/* ---- strips ---- */

static void close_strip(strip *s) {
    lathe__edit_tree_close(&s->right);
    lathe__edit_tree_close(&s->left);
    free(s->group);
    free(s->made);
    free(s->passed[0]);
    free(s->passed[1]);
    *s = (strip){0};
}
static lathe_status choose_level1(const tube *t, uint32_t *chain[2], lathe_arena *arena, const lathe_edit_contour *a,
                                  const lathe_edit_contour *b) {
    lathe_ray_contour plain[2];
    lathe_derivation d[2];
    lathe_status status = lathe__edit_export(&plain[0], NULL, arena, a);
    if (!status) status = lathe__edit_export(&plain[1], NULL, arena, b);
    if (!status) status = lathe__derive_pair(&d[0], &d[1], arena, &plain[0], &plain[1]);
    for (int k = 0; k < 2 && !status; k++) {
        chain[k] = LATHE_NEW(arena, uint32_t, t->first_rays);
        if (!chain[k]) return LATHE_ERR_MEMORY;
        for (uint32_t i = 0; i < t->first_rays; i++) chain[k][i] = (d[k].start + d[k].main_edge[i]) % plain[k].count;
    }
    return status;
}
/* The trees of two loops, from the first rays on through all rays that were added. */
static lathe_status grow_trees(const tube *t, strip *s, lathe_edit_contour c[2], lathe_arena *arena) {
    uint32_t *chain[2];
    lathe_status status = choose_level1(t, chain, arena, &c[0], &c[1]);
    if (!status) status = lathe__edit_tree_open(&s->right, &c[0], chain[0]);
    if (!status) status = lathe__edit_tree_open(&s->left, &c[1], chain[1]);
    for (uint32_t i = 0; i < t->added_count && !status; i++)
        for (int k = 0; k < 2 && !status; k++) {
            status = lathe__edit_insert_ray(&c[k], t->added[i].after, t->added[i].angle);
            if (!status) status = lathe__edit_tree_refine(k ? &s->left : &s->right, &c[k]);
        }
    return status;
}
static lathe_status open_contour(const tube *t, lathe_edit_contour *c, const lathe_tube_loop *loop) {
    return lathe__edit_contour_open(c, loop->points, loop->count, loop->centre, t->first_rays, loop->turn);
}
/* The contours are made again for the trees' sake: crossings get the same numbers again. */
static lathe_status open_strip(const tube *t, strip *out, const lathe_tube_loop *lower, const lathe_tube_loop *upper) {
    lathe_edit_contour c[2] = {{0}, {0}};
    lathe_arena arena = {0};
    strip s = {0};
    lathe_status status = open_contour(t, &c[0], lower);
    if (!status) status = open_contour(t, &c[1], upper);
    if (!status) status = grow_trees(t, &s, c, &arena);
    uint32_t rays = t->first_rays + t->added_count;
    if (!status && !grow_indices(&s.group, &s.capacity, rays)) status = LATHE_ERR_MEMORY;
    for (uint32_t i = 0; i < rays && !status; i++) s.group[i] = NONE;
    for (int k = 0; k < 2; k++) lathe__edit_contour_close(&c[k]);
    lathe__arena_free(&arena);
    if (status)
        close_strip(&s);
    else
        *out = s;
    return status;
}
static lathe_status fill_strip(tube *t, uint32_t k) {
    lathe_status status = LATHE_OK;
    for (uint32_t ray = 0; ray < t->first_rays + t->added_count && !status; ray++)
        status = remake_groups(t, k, &ray, 1);
    return status;
}

/* ---- opening ---- */

static void close_slice(slice *s) {
    lathe__edit_contour_close(&s->contour);
    free(s->vertex);
    *s = (slice){0};
}
void lathe__tube_close(lathe_tube_surface **out) {
    if (!out || !*out) return;
    tube *t = *out;
    for (uint32_t k = 0; k < t->count; k++) {
        close_slice(&t->slices[k]);
        if (k + 1 < t->count) close_strip(&t->strips[k]);
    }
    free(t->slices);
    free(t->strips);
    free(t->added);
    free(t->fan[0]);
    free(t->fan[1]);
    free(t->vertices);
    free(t->triangles);
    free(t->fresh);
    free(t->match);
    lathe__arena_free(&t->scratch);
    free(t);
    *out = NULL;
}

static lathe_status fill_tube(tube *t, const lathe_tube_loop *loops) {
    lathe_status status = LATHE_OK;
    for (uint32_t k = 0; k < t->count && !status; k++) {
        t->slices[k] = (slice){.loop = loops[k], .apex = NONE};
        status = open_contour(t, &t->slices[k].contour, &loops[k]);
        if (!status) status = add_vertices(t, &t->slices[k]);
    }
    for (uint32_t k = 0; k + 1 < t->count && !status; k++) {
        status = open_strip(t, &t->strips[k], &loops[k], &loops[k + 1]);
        if (!status) status = fill_strip(t, k);
    }
    for (int end = 0; end < 2 && !status; end++) status = make_fan(t, end);
    t->work = (lathe_tube_work){0};
    return status;
}
lathe_status lathe__tube_open(lathe_tube_surface **out, const lathe_tube_loop *loops, uint32_t count, uint32_t rays) {
    if (count < 2 || count > LATHE_MAX_DIM) return LATHE_ERR_RANGE;
    for (uint32_t k = 1; k < count; k++)
        if (loops[k].height <= loops[k - 1].height) return LATHE_ERR_RANGE;
    tube *t = calloc(1, sizeof *t);
    if (!t) return LATHE_ERR_MEMORY;
    t->count = count;
    t->first_rays = rays;
    t->free_triangle = NONE;
    t->slices = calloc(count, sizeof *t->slices);
    t->strips = calloc(count, sizeof *t->strips);
    if (!t->slices || !t->strips) t->count = 0;
    lathe_status status = t->count ? fill_tube(t, loops) : LATHE_ERR_MEMORY;
    if (status)
        lathe__tube_close(&t);
    else
        *out = t;
    return status;
}

/* ---- one ray more [M 5.2.1] ---- */

static bool make_marks(strip *s, const lathe_edit_contour *a, const lathe_edit_contour *b) {
    const lathe_edit_contour *c[2] = {a, b};
    uint32_t had = s->made_capacity;
    if (!grow_indices(&s->group, &s->capacity, a->ray_count) ||
        !grow_indices(&s->made, &s->made_capacity, a->ray_count))
        return false;
    for (; had < s->made_capacity; had++) s->made[had] = NONE;
    for (int k = 0; k < 2; k++) {
        had = s->passed_capacity[k];
        if (!grow_indices(&s->passed[k], &s->passed_capacity[k], c[k]->count)) return false;
        for (; had < s->passed_capacity[k]; had++) s->passed[k][had] = NONE;
    }
    return true;
}
/* Makes the groups anew to whose folds the edges belong that were split: on from each of them is the level-1 edge of
 * its group. */
static lathe_status remake_split(tube *t, uint32_t k, int side, uint32_t ray) {
    strip *s = &t->strips[k];
    const lathe_edit_contour *c = &t->slices[k + (uint32_t)side].contour;
    const lathe_edit_tree *tree = side ? &s->left : &s->right;
    for (uint32_t i = 0; i < c->refined_count; i++) {
        uint32_t e = c->refined[i];
        while (s->passed[side][e] != ray && tree->nodes[tree->owner[e]].symbol != LATHE_DER_F) {
            s->passed[side][e] = ray;
            e = c->crossings[e].next;
        }
        uint32_t group = c->crossings[e].at.ray;
        if (s->passed[side][e] == ray || s->made[group] == ray) continue;
        s->made[group] = ray;
        lathe_status status = remake_groups(t, k, &group, 1);
        if (status) return status;
    }
    return LATHE_OK;
}
static lathe_status refine_strip(tube *t, uint32_t k, uint32_t ray) {
    strip *s = &t->strips[k];
    const lathe_edit_contour *a = &t->slices[k].contour, *b = &t->slices[k + 1].contour;
    lathe_status status = lathe__edit_tree_refine(&s->right, a);
    if (!status) status = lathe__edit_tree_refine(&s->left, b);
    if (!status && !make_marks(s, a, b)) status = LATHE_ERR_MEMORY;
    if (status) return status;
    s->group[ray] = NONE;
    uint32_t groups[2] = {a->rays[ray].before, ray};
    s->made[groups[0]] = s->made[ray] = ray;
    status = remake_groups(t, k, groups, 2);
    for (int side = 0; side < 2 && !status; side++) status = remake_split(t, k, side, ray);
    return status;
}
lathe_status lathe__tube_insert_ray(lathe_tube_surface *t, uint32_t after, uint32_t angle) {
    void *p = t->added;
    bool ok = grow(&p, &t->added_capacity, t->added_count + 1, sizeof *t->added);
    t->added = p;
    if (!ok) return LATHE_ERR_MEMORY;
    lathe_status status = LATHE_OK;
    uint32_t ray = t->slices[0].contour.ray_count;
    for (uint32_t k = 0; k < t->count && !status; k++) {
        status = lathe__edit_insert_ray(&t->slices[k].contour, after, angle);
        if (!status) status = add_vertices(t, &t->slices[k]);
    }
    if (status) return status;
    t->added[t->added_count++] = (added_ray){after, angle};
    for (uint32_t k = 0; k + 1 < t->count && !status; k++) status = refine_strip(t, k, ray);
    for (int end = 0; end < 2 && !status; end++) status = refine_fan(t, end);
    return status;
}
lathe_status lathe__tube_double_rays(lathe_tube_surface *t) {
    const lathe_edit_contour *c = &t->slices[0].contour;
    lathe_status status = c->ray_count > 32768 ? LATHE_ERR_RANGE : LATHE_OK;
    for (uint32_t n = c->ray_count, ray = 0; n && !status; n--) {
        uint32_t next = c->rays[ray].next;
        status = lathe__tube_insert_ray(t, ray, lathe__edit_middle_angle(c, ray));
        ray = next;
    }
    return status;
}

/* ---- one slice more [M 5.2.2] ---- */

static lathe_status open_slice(const tube *t, slice *out, const lathe_tube_loop *loop) {
    slice s = {.loop = *loop, .apex = NONE};
    lathe_status status = open_contour(t, &s.contour, loop);
    for (uint32_t i = 0; i < t->added_count && !status; i++)
        status = lathe__edit_insert_ray(&s.contour, t->added[i].after, t->added[i].angle);
    if (status)
        close_slice(&s);
    else
        *out = s;
    return status;
}
static lathe_status make_place(tube *t) {
    slice *slices = realloc(t->slices, (t->count + 1) * sizeof *slices);
    if (slices) t->slices = slices;
    strip *strips = realloc(t->strips, (t->count + 1) * sizeof *strips);
    if (strips) t->strips = strips;
    return slices && strips ? LATHE_OK : LATHE_ERR_MEMORY;
}
lathe_status lathe__tube_insert_slice(lathe_tube_surface *t, const lathe_tube_loop *loop) {
    uint32_t k = 0;
    while (k < t->count && t->slices[k].loop.height < loop->height) k++;
    if (!k || k == t->count || t->slices[k].loop.height == loop->height) return LATHE_ERR_RANGE;
    if (t->count >= LATHE_MAX_DIM) return LATHE_ERR_LIMIT;
    slice s;
    strip below, above;
    lathe_status status = make_place(t);
    if (!status) status = open_slice(t, &s, loop);
    if (status) return status;
    status = open_strip(t, &below, &t->slices[k - 1].loop, loop);
    if (status) {
        close_slice(&s);
        return status;
    }
    status = open_strip(t, &above, loop, &t->slices[k].loop);
    if (status) {
        close_slice(&s);
        close_strip(&below);
        return status;
    }
    strip *gone = &t->strips[k - 1];
    for (uint32_t ray = 0; ray < t->first_rays + t->added_count; ray++)
        for (uint32_t x = gone->group[ray], next; x != NONE; x = next) {
            next = t->triangles[x].next;
            remove_triangle(t, x);
        }
    close_strip(gone);
    memmove(&t->slices[k + 1], &t->slices[k], (t->count - k) * sizeof s);
    memmove(&t->strips[k + 1], &t->strips[k], (t->count - 1 - k) * sizeof below);
    t->slices[k] = s;
    t->strips[k - 1] = below;
    t->strips[k] = above;
    t->count++;
    status = add_vertices(t, &t->slices[k]);
    if (!status) status = fill_strip(t, k - 1);
    return status ? status : fill_strip(t, k);
}

/* ---- what it is ---- */

uint32_t lathe__tube_slices(const lathe_tube_surface *t) { return t->count; }
uint32_t lathe__tube_triangles(const lathe_tube_surface *t) { return t->live; }
lathe_tube_work lathe__tube_work_done(const lathe_tube_surface *t) { return t->work; }
const lathe_edit_contour *lathe__tube_contour(const lathe_tube_surface *t, uint32_t slice) {
    return &t->slices[slice].contour;
}
uint32_t lathe__tube_vertex(const lathe_tube_surface *t, uint32_t slice, uint32_t crossing) {
    return crossing == NONE ? t->slices[slice].apex : t->slices[slice].vertex[crossing];
}
lathe_status lathe__tube_mesh(lathe_mesh *out, const lathe_tube_surface *t) {
    lathe_mesh m = {.vertex_count = t->vertex_count};
    m.lattice = malloc(t->vertex_count * sizeof *m.lattice);
    m.triangles = malloc(t->live * sizeof *m.triangles);
    if (!m.lattice || !m.triangles) {
        lathe_mesh_free(&m);
        return LATHE_ERR_MEMORY;
    }
    memcpy(m.lattice, t->vertices, t->vertex_count * sizeof *m.lattice);
    for (uint32_t i = 0; i < t->triangle_count; i++)
        if (t->triangles[i].corner[0] != NONE)
            memcpy(m.triangles[m.triangle_count++], t->triangles[i].corner, sizeof *m.triangles);
    *out = m;
    return LATHE_OK;
}
