/* A tube is a grid: in each of its shown slices it has one ring, whose vertices lie on rays from a centre. So a vertex is told by its
 * radius, and that by how far it is from the cubic between those that are known: first the old ones, which may have changed, then new
 * rows on the old rays, then new rays in all rows. */
#include "draco_rings.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { MOST_RADIUS = 1 << 19, MOST_CENTRE = 1 << 15, MOST_STEP = 256, MOST_RAY_LOG = 16, FIRST_RAYS = 8,
       USUAL_STEP = 4 };

lathe_point lathe__draco_ring_point(const int32_t centre[2], int32_t radius, uint32_t angle, int32_t turn, int32_t row) {
    lathe_point d = lathe__ray_direction((angle + (uint32_t)turn * (uint32_t)row) & 65535, 65536);
    int64_t length = (int64_t)radius * (LATHE_LATTICE_ONE / 64);
    return (lathe_point){centre[0] * (LATHE_LATTICE_ONE / 2) + (int32_t)(length * d.x / LATHE_RAY_LENGTH),
                         centre[1] * (LATHE_LATTICE_ONE / 2) + (int32_t)(length * d.y / LATHE_RAY_LENGTH)};
}

/* ---- the grid of one tube ---- */

typedef struct grid {
    lathe_draco_walk *w;
    const lathe_draco_part *part;
    lathe_draco_tube tube;     /* that results */
    const lathe_draco_tube *truth; /* NULL: reading */
    uint32_t *vertex;          /* of the delta, by row, then ray */
    bool *is_old;              /* of each row */
    uint32_t old_rows, q;      /* an old ray is every q-th */
} grid;

static int32_t *row_of(const grid *g, uint32_t row) { return g->tube.radius + (size_t)row * g->tube.rays; }

/* Numbers that mostly are 0: how many zeros come, then one that is none. */
static int32_t quiet(lathe_draco_walk *w, int32_t value) {
    if (!w->truth) {
        if (!w->is_run) w->zeros = lathe__walk_number(w, 0);
        w->is_run = w->zeros != 0;
        if (!w->is_run) return lathe__walk_signed(w, 0);
        w->zeros--;
        return 0;
    }
    if (!value) {
        w->zeros++;
        return 0;
    }
    lathe__walk_number(w, w->zeros);
    w->zeros = 0;
    return lathe__walk_signed(w, value);
}

/* Writing: in steps; numbers up to 0.6 are 0, so that what nearly was right costs nothing. */
static int32_t quantise(int32_t left, int32_t step) {
    int32_t a = (abs(left) * 5 + 2 * step) / (5 * step);
    return left < 0 ? -a : a;
}

static bool take_radius(grid *g, uint32_t row, uint32_t ray, int32_t predicted) {
    lathe_draco_walk *w = g->w;
    lathe_draco_tube *tube = &g->tube;
    size_t i = (size_t)row * tube->rays + ray;
    uint32_t x = g->vertex[i], angle = (uint32_t)(((uint64_t)ray << 16) / tube->rays);
    int32_t left = g->truth ? quantise(g->truth->radius[i] - predicted, g->part->step) : 0, *symbol = &w->c->value[1][x];
    if (!ray) left = quiet(w, left);
    else {
        if (g->truth) *symbol = LATHE_RING_REST + (int32_t)lathe__zigzag(left);
        if (*symbol < LATHE_RING_REST) return lathe__walk_fail(w, LATHE_ERR_FORMAT);
        left = lathe__unzigzag((uint32_t)(*symbol - LATHE_RING_REST));
    }
    int64_t radius = predicted + (int64_t)left * g->part->step;
    if (radius < 0 || radius >= MOST_RADIUS) return lathe__walk_fail(w, LATHE_ERR_FORMAT);
    tube->radius[i] = (int32_t)radius;
    lathe_point p = lathe__draco_ring_point(tube->centre[row], (int32_t)radius, angle, g->part->turn, (tube->height[row] - tube->height[0]) / 2);
    int32_t u = lathe__walk_rounded(p.x), v = lathe__walk_rounded(p.y);
    if (tube->id[i] == LATHE_DRACO_NONE) {
        lathe__walk_add(w, x, u, v, tube->height[row] * LATHE_DRACO_HEIGHT);
        tube->id[i] = w->id[x];
    } else {
        w->id[x] = tube->id[i];
        w->mesh->at[tube->id[i]][0] = u, w->mesh->at[tube->id[i]][1] = v;
    }
    return !w->failure;
}

static bool take_centre(grid *g, uint32_t row, const int32_t predicted[2]) {
    for (int k = 0; k < 2; k++) {
        int64_t c = (int64_t)predicted[k] + quiet(g->w, g->truth ? g->truth->centre[row][k] - predicted[k] : 0);
        if (c < -MOST_CENTRE || c > MOST_CENTRE) return lathe__walk_fail(g->w, LATHE_ERR_FORMAT);
        g->tube.centre[row][k] = (int32_t)c;
    }
    return !g->w->failure;
}

/* ---- what is expected ---- */

static int32_t clamped(double radius) { return radius < 0 ? 0 : radius >= MOST_RADIUS ? MOST_RADIUS - 1 : (int32_t)radius; }

static int32_t cubic(const int32_t *r, uint32_t mask, uint32_t i, uint32_t s) {
    return (9 * (r[i - s] + r[(i + s) & mask]) - r[(i - 3 * s) & mask] - r[(i + 3 * s) & mask] + 8) >> 4;
}

/* Nothing is known: each row from the one before, on a few rays. */
static bool take_first_row(grid *g, uint32_t row) {
    static const int32_t origin[2] = {0, 0};
    const int32_t *r = row_of(g, row), *b = row ? row_of(g, row - 1) : NULL;
    uint32_t q = g->q;
    if (!take_centre(g, row, b ? g->tube.centre[row - 1] : origin)) return false;
    for (uint32_t i = 0; i < g->tube.rays; i += q) {
        int32_t predicted = i ? r[i - q] : b ? b[0] : 0;
        if (i && b) predicted = (r[i - q] + 2 * b[i] - b[i - q]) / 2;
        if (!take_radius(g, row, i, predicted)) return false;
    }
    return true;
}

static bool take_old_row(grid *g, uint32_t row) {
    const int32_t *r = row_of(g, row), centre[2] = {g->tube.centre[row][0], g->tube.centre[row][1]};
    if (!take_centre(g, row, centre)) return false;
    for (uint32_t i = 0; i < g->tube.rays; i += g->q)
        if (!take_radius(g, row, i, r[i])) return false;
    return true;
}

/* Up to four old rows around a new one, ascending: two below, two above. */
static uint32_t list_around(const grid *g, uint32_t row, uint32_t around[4], uint32_t *below) {
    uint32_t count = 0, low[2];
    *below = 0;
    for (uint32_t i = row; i-- > 0 && *below < 2;)
        if (g->is_old[i]) low[(*below)++] = i;
    for (uint32_t k = *below; k-- > 0;) around[count++] = low[k];
    for (uint32_t i = row + 1; i < g->tube.rows && count < *below + 2; i++)
        if (g->is_old[i]) around[count++] = i;
    return count;
}

/* The cubic through four rows; between two, squares are linear, as on a ball; beyond all, the nearest. */
static bool take_new_row(grid *g, uint32_t row) {
    uint32_t around[4], below, count = list_around(g, row, around, &below), low = around[below ? below - 1 : 0], high = around[below < count ? below : count - 1];
    const int32_t *h = g->tube.height, *a = row_of(g, low), *b = row_of(g, high);
    double weight[4] = {0, 0, 0, 0}, part = low == high ? 0 : (double)(h[row] - h[low]) / (h[high] - h[low]);
    for (uint32_t i = 0; i < count && count == 4; i++) {
        weight[i] = 1;
        for (uint32_t k = 0; k < 4; k++)
            if (k != i) weight[i] *= (double)(h[row] - h[around[k]]) / (h[around[i]] - h[around[k]]);
    }
    int32_t centre[2];
    for (int k = 0; k < 2; k++) {
        const int32_t *c = g->tube.centre[low], *d = g->tube.centre[high];
        centre[k] = (int32_t)floor(c[k] + (d[k] - c[k]) * part + 0.5);
    }
    if (!take_centre(g, row, centre)) return false;
    for (uint32_t i = 0; i < g->tube.rays; i += g->q) {
        double r = sqrt((double)a[i] * a[i] * (1 - part) + (double)b[i] * b[i] * part);
        if (count == 4) {
            r = 0;
            for (uint32_t k = 0; k < 4; k++) r += weight[k] * row_of(g, around[k])[i];
        }
        if (!take_radius(g, row, i, clamped(floor(r + 0.5)))) return false;
    }
    return true;
}

/* Between rays; what the row below had there beyond its own cubic, this one has, too. */
static bool take_new_rays(grid *g, uint32_t row, uint32_t s) {
    const int32_t *r = row_of(g, row), *b = row ? row_of(g, row - 1) : NULL;
    uint32_t mask = g->tube.rays - 1;
    for (uint32_t i = s; i <= mask; i += 2 * s) {
        int32_t predicted = cubic(r, mask, i, s) + (b ? (b[i] - cubic(b, mask, i, s)) / 2 : 0);
        if (!take_radius(g, row, i, clamped(predicted))) return false;
    }
    return true;
}

static bool take_rows(grid *g) {
    for (int fresh = 0; fresh < 2; fresh++)
        for (uint32_t i = 0; i < g->tube.rows; i++) {
            if (g->is_old[i] == fresh) continue;
            if (!(!fresh ? take_old_row(g, i) : g->old_rows ? take_new_row(g, i) : take_first_row(g, i))) return false;
        }
    for (uint32_t s = g->q / 2; s; s /= 2)
        for (uint32_t i = 0; i < g->tube.rows; i++)
            if (!take_new_rays(g, i, s)) return false;
    return true;
}

/* ---- what was before ---- */

/* The old rows and rays: their vertices keep their numbers. */
static void keep_old(grid *g, const lathe_draco_tube *old) {
    memset(g->tube.id, 0xff, (size_t)g->tube.rows * g->tube.rays * sizeof *g->tube.id);
    memset(g->is_old, 0, g->tube.rows * sizeof *g->is_old);
    g->old_rows = 0;
    for (uint32_t i = 0, k = 0; old && g->tube.rays % old->rays == 0 && i < g->tube.rows; i++) {
        while (k < old->rows && old->height[k] < g->tube.height[i]) k++;
        if (k == old->rows || old->height[k] != g->tube.height[i]) continue;
        g->is_old[i] = true;
        g->old_rows++;
        memcpy(g->tube.centre[i], old->centre[k], sizeof old->centre[k]);
        for (uint32_t r = 0; r < old->rays; r++) {
            size_t to = (size_t)i * g->tube.rays + (size_t)r * (g->tube.rays / old->rays), from = (size_t)k * old->rays + r;
            g->tube.radius[to] = old->radius[from];
            g->tube.id[to] = old->id[from];
        }
    }
    g->q = g->old_rows ? g->tube.rays / old->rays : g->tube.rays > FIRST_RAYS ? g->tube.rays / FIRST_RAYS : 1;
}

/* ---- which vertices are rings ---- */

/* Each ring begins at a vertex with the tube's symbol. */
static bool follow_ring(grid *g, uint32_t row, uint32_t start) {
    const uint32_t *follow = g->tube.clockwise ? g->w->before : g->w->next;
    uint32_t x = start;
    for (uint32_t r = 0; r < g->tube.rays; r++, x = follow[x]) {
        if (r && x == start) return lathe__walk_fail(g->w, LATHE_ERR_FORMAT);
        g->vertex[(size_t)row * g->tube.rays + r] = x;
    }
    return x == start || lathe__walk_fail(g->w, LATHE_ERR_FORMAT);
}

static bool allocate(grid *g) {
    size_t rows = g->tube.rows, all = rows * g->tube.rays;
    g->tube.height = malloc((rows + 1) * sizeof(int32_t));
    g->tube.centre = malloc((rows + 1) * sizeof *g->tube.centre);
    g->tube.radius = malloc((all + 1) * sizeof(int32_t));
    g->tube.id = malloc((all + 1) * sizeof(uint32_t));
    g->is_old = LATHE_NEW(&g->w->arena, bool, rows + 1);
    g->vertex = LATHE_NEW(&g->w->arena, uint32_t, all + 1);
    return (g->tube.height && g->tube.centre && g->tube.radius && g->tube.id && g->is_old && g->vertex) || lathe__walk_fail(g->w, LATHE_ERR_MEMORY);
}

static void walk_tube(lathe_draco_walk *w, uint32_t part, uint32_t t, const uint32_t *starts, lathe_draco_tube *out) {
    lathe_draco_part *p = &w->mesh->parts[part];
    grid g = {.w = w, .part = p, .tube = {.rays = p->form.tubes[t].rays, .clockwise = p->form.tubes[t].clockwise}};
    g.truth = w->truth ? &w->truth->shapes[part].rings.tubes[t] : NULL;
    for (uint32_t i = 0; i < p->height_count; i++) g.tube.rows += starts[i] != LATHE_DRACO_NONE;
    bool good = (uint64_t)g.tube.rows * g.tube.rays <= w->c->vertex_count ? allocate(&g) : lathe__walk_fail(w, LATHE_ERR_FORMAT);
    for (uint32_t i = 0, row = 0; good && i < p->height_count; i++) {
        if (starts[i] == LATHE_DRACO_NONE) continue;
        g.tube.height[row] = p->heights[i];
        good = follow_ring(&g, row++, starts[i]);
    }
    if (good) {
        keep_old(&g, t < p->rings.count ? &p->rings.tubes[t] : NULL);
        take_rows(&g);
    }
    *out = g.tube;
}

static void walk_part(lathe_draco_walk *w, uint32_t part, const uint32_t *starts) {
    lathe_draco_part *p = &w->mesh->parts[part];
    lathe_draco_rings rings = {.tubes = calloc(p->form.count, sizeof *rings.tubes)};
    if (!rings.tubes) { lathe__walk_fail(w, LATHE_ERR_MEMORY); return; }
    for (uint32_t t = 0; t < p->form.count && !w->failure; t++) {
        rings.count++;
        walk_tube(w, part, t, starts + (size_t)t * p->height_count, &rings.tubes[t]);
    }
    lathe__draco_rings_free(&p->rings);
    p->rings = rings;
}

void lathe__walk_ring_form(lathe_draco_walk *w, uint32_t part) {
    lathe_draco_part *p = &w->mesh->parts[part];
    const lathe_draco_shape *truth = w->truth ? &w->truth->shapes[part] : NULL;
    uint32_t count = lathe__walk_number(w, truth ? truth->rings.count : 0);
    if (!count || count > LATHE_DRACO_TUBES) { lathe__walk_fail(w, LATHE_ERR_FORMAT); return; }
    p->form.tubes = calloc(count, sizeof *p->form.tubes);
    if (!p->form.tubes) { lathe__walk_fail(w, LATHE_ERR_MEMORY); return; }
    p->form.count = count;
    for (uint32_t t = 0; t < count; t++) {
        uint32_t log = 0;
        while (truth && 1u << log < truth->rings.tubes[t].rays) log++;
        log = lathe__walk_number(w, truth ? 2 * log + truth->rings.tubes[t].clockwise : 0);
        p->form.tubes[t] = (lathe_draco_tube){.rays = 1u << (log / 2 & 31), .clockwise = log & 1};
        if (log / 2 < 3 || log / 2 > MOST_RAY_LOG) lathe__walk_fail(w, LATHE_ERR_FORMAT);
    }
    p->turn = lathe__walk_signed(w, truth ? truth->turn : 0);
    p->step = (int32_t)lathe__walk_number(w, USUAL_STEP);
    if (p->step < 1 || p->step > MOST_STEP) lathe__walk_fail(w, LATHE_ERR_FORMAT);
}

/* All vertices in slices belong to rings. */
static bool has_places(lathe_draco_walk *w) {
    for (uint32_t x = 0; x < w->c->vertex_count; x++)
        if (!(w->half[x] & 1) && w->mesh->parts[w->part[x]].form.count && w->id[x] == LATHE_DRACO_NONE) return lathe__walk_fail(w, LATHE_ERR_FORMAT);
    return true;
}

void lathe__walk_rings(lathe_draco_walk *w) {
    uint32_t parts = w->mesh->part_count;
    uint32_t **starts = (uint32_t **)lathe__arena_alloc(&w->arena, (size_t)parts + 1, sizeof *starts);
    if (!starts) { lathe__walk_fail(w, LATHE_ERR_MEMORY); return; }
    for (uint32_t i = 0; i < w->touched_count; i++) {
        const lathe_draco_part *p = &w->mesh->parts[w->touched[i]];
        size_t rings = (size_t)p->form.count * p->height_count;
        starts[w->touched[i]] = LATHE_NEW(&w->arena, uint32_t, rings + 1);
        if (!starts[w->touched[i]]) { lathe__walk_fail(w, LATHE_ERR_MEMORY); return; }
        memset(starts[w->touched[i]], 0xff, rings * sizeof(uint32_t));
    }
    for (uint32_t x = 0; x < w->c->vertex_count; x++) {
        const lathe_draco_part *p = &w->mesh->parts[w->part[x]];
        if (!p->form.count || w->half[x] & 1) continue;
        uint32_t ring = w->truth ? w->truth->ring[x] : 0, tube = ring >> 28;
        if (w->truth && (ring & 0xfffffff) % p->form.tubes[tube].rays == 0) w->c->value[1][x] = (int32_t)tube;
        if (w->truth ? (ring & 0xfffffff) % p->form.tubes[tube].rays != 0 : (uint32_t)w->c->value[1][x] >= p->form.count) continue;
        starts[w->part[x]][(size_t)w->c->value[1][x] * p->height_count + (uint32_t)w->half[x] / 2] = x;
    }
    for (uint32_t i = 0; i < w->touched_count && !w->failure; i++)
        if (w->mesh->parts[w->touched[i]].form.count) walk_part(w, w->touched[i], starts[w->touched[i]]);
    if (w->truth && w->zeros) lathe__walk_number(w, w->zeros);
    if (!w->failure) has_places(w);
}
