/* Which slice each vertex lies in. The triangles of a slab lie between two shown slices; over an edge within a slice the walk
 * comes to the next slab, over any other it stays. So the third corner of a triangle is in one of three places, and what is
 * known around it nearly tells which. */
#include "draco_rings.h"
#include <stdlib.h>
#include <string.h>

enum { MOST_DEGREE = 12, MOST_HALF = 1 << 14, MOST_HEIGHT = 4 * LATHE_MAX_DIM };

static bool flat(const lathe_draco_walk *w, uint32_t a, uint32_t b) { return w->half[a] == w->half[b] && !(w->half[a] & 1); }

/* An edge within a slice is part of an outline: which way it goes is told by the side on which its slab lies. */
static void link_edges(lathe_draco_walk *w, uint32_t t) {
    const uint32_t *v = w->c->triangles + (size_t)3 * t;
    for (int k = 0; k < 3; k++) {
        uint32_t a = v[k], b = v[(k + 1) % 3], third = v[(k + 2) % 3];
        if (!flat(w, a, b)) continue;
        if (w->half[third] < w->half[a]) { uint32_t swap = a; a = b; b = swap; }
        w->next[a] = b;
        w->before[b] = a;
    }
}

/* Twice the number of the lower slice of the slab beyond the edge a b of a triangle whose third corner is y. */
static int32_t slab_beyond(const lathe_draco_walk *w, uint32_t a, uint32_t b, uint32_t y) {
    const int32_t *h = w->half;
    if (flat(w, a, b)) return h[y] > h[a] ? h[a] - 2 : h[a];
    int32_t low = h[a] < h[b] ? h[a] : h[b];
    if (h[y] < low) low = h[y];
    return low & 1 ? low - 1 : low;
}

static uint64_t field(int64_t v, int64_t most) { return (uint64_t)(v < 0 ? 0 : v > most ? most : v); }

/* 0: between slices; 1: the vertex's outline may go on through this slab; 2: it is known to go elsewhere. */
static uint64_t open_end(const lathe_draco_walk *w, uint32_t v, int32_t base, const uint32_t *if_low, const uint32_t *if_high) {
    if (w->half[v] & 1) return 0;
    return (w->half[v] == base ? if_low : if_high)[v] == LATHE_DRACO_NONE ? 1 : 2;
}

static uint64_t context(const lathe_draco_walk *w, uint32_t a, uint32_t b, uint32_t y, uint32_t x, int32_t base) {
    uint64_t key = field(w->half[a] - base, 3) * 4 + field(w->half[b] - base, 3);
    key = key * 4 + (flat(w, a, b) ? 3 : field(w->half[y] - base, 2));
    key = key * 3 + open_end(w, a, base, w->next, w->before);
    key = key * 3 + open_end(w, b, base, w->before, w->next);
    return key * (MOST_DEGREE + 1) + field(w->first[x + 1] - w->first[x], MOST_DEGREE);
}

static bool recall(lathe_rank_cursor *cursor, uint32_t *unseen, int32_t *value) {
    if (lathe__rank_next(cursor, value)) return true;
    for (; *unseen < 3; ++*unseen) {
        bool known = false;
        for (uint32_t i = 0; cursor->context[0] && i < cursor->context[0]->count; i++)
            known = known || cursor->context[0]->ranks[i].value == (int32_t)*unseen;
        if (known) continue;
        *value = (int32_t)(*unseen)++;
        return true;
    }
    return false;
}

/* The symbol of x, which is met beyond the edge a b: the rank of its place among 0, 1, 2 in the slab. */
static void place(lathe_draco_walk *w, uint32_t a, uint32_t b, uint32_t y, uint32_t x) {
    int32_t base = slab_beyond(w, a, b, y), value = 0, *symbol = &w->c->value[0][x], rank = 0;
    uint64_t key = context(w, a, b, y, x, base);
    lathe_rank_cursor cursor = lathe__rank_cursor(&w->ranks, &key, 1);
    uint32_t unseen = 0;
    bool found = false;
    for (; !found && recall(&cursor, &unseen, &value); rank++) found = w->truth ? w->truth->half[x] - base == value : *symbol == rank;
    if (!found) {
        lathe__walk_fail(w, w->truth ? LATHE_ERR_UNSUPPORTED : LATHE_ERR_FORMAT);
        return;
    }
    *symbol = rank - 1;
    w->half[x] = base + value;
    w->part[x] = w->part[a];
    lathe_status status = lathe__rank_seen(&w->ranks, &key, 1, value);
    if (status) lathe__walk_fail(w, status);
}

/* ---- where a component begins ---- */

static int by_value(const void *a, const void *b) {
    int32_t x = *(const int32_t *)a, y = *(const int32_t *)b;
    return x < y ? -1 : x > y;
}

static bool has_height(const int32_t *list, uint32_t count, int32_t w) {
    return count && bsearch(&w, list, count, sizeof w, by_value) != NULL;
}

/* The new slices as runs of equal steps. */
static uint32_t list_runs(int32_t (*runs)[3], const int32_t *fresh, uint32_t count) {
    uint32_t n = 0;
    for (uint32_t i = 0; i < count; n++) {
        int32_t step = i + 1 < count ? fresh[i + 1] - fresh[i] : 1, length = 1;
        while (i + (uint32_t)length < count && fresh[i + (uint32_t)length] - fresh[i + (uint32_t)length - 1] == step) length++;
        runs[n][0] = fresh[i], runs[n][1] = step, runs[n][2] = length;
        i += (uint32_t)length;
    }
    return n;
}

static uint32_t form_of(const lathe_draco_part *p) { return p->grain_log + (p->samples ? LATHE_FORM_SAMPLES : 0); }

/* How a structure's vertices are told: by steps of some grain, also over samples, or as rings. */
static void code_form(lathe_draco_walk *w, uint32_t part, bool told, uint32_t form) {
    lathe_draco_part *p = &w->mesh->parts[part];
    form = told ? lathe__walk_number(w, form) : form_of(p);
    lathe__draco_rings_free(&p->form);
    if (form >= LATHE_FORM_SAMPLES + LATHE_FORM_RINGS) lathe__walk_fail(w, LATHE_ERR_FORMAT);
    else if (form == LATHE_FORM_RINGS) lathe__walk_ring_form(w, part);
    else {
        p->samples = form >= LATHE_FORM_SAMPLES;
        p->grain_log = p->samples ? form - LATHE_FORM_SAMPLES : form;
        lathe__draco_rings_free(&p->rings);
    }
}

static uint32_t true_form(const lathe_draco_shape *shape) {
    uint32_t least = (uint32_t)(shape->stride[0] < shape->stride[1] ? shape->stride[0] : shape->stride[1]), log = 0;
    while (least >> log > 1 && log + 1 < LATHE_FORM_RINGS) log++;
    return shape->rings.count ? LATHE_FORM_RINGS : log + (shape->samples ? LATHE_FORM_SAMPLES : 0);
}

/* The slices that a structure shows from this level on: those before, unless they are dropped, and runs of new ones; its form. */
static void code_heights(lathe_draco_walk *w, uint32_t part) {
    lathe_draco_part *p = &w->mesh->parts[part];
    const lathe_draco_shape *truth = w->truth ? &w->truth->shapes[part] : NULL;
    int32_t(*runs)[3] = NULL;
    uint32_t run_count = 0, fresh_count = 0, keep = 1;
    if (truth) {
        int32_t *fresh = LATHE_NEW(&w->arena, int32_t, truth->height_count + 1);
        runs = (int32_t(*)[3])LATHE_NEW(&w->arena, int32_t, (size_t)3 * truth->height_count + 3);
        if (!fresh || !runs) { lathe__walk_fail(w, LATHE_ERR_MEMORY); return; }
        for (uint32_t i = 0; i < p->height_count; i++) keep = keep && has_height(truth->heights, truth->height_count, p->heights[i]);
        for (uint32_t i = 0; i < truth->height_count; i++)
            if (!keep || !has_height(p->heights, p->height_count, truth->heights[i])) fresh[fresh_count++] = truth->heights[i];
        run_count = list_runs(runs, fresh, fresh_count);
    }
    uint32_t form = truth ? true_form(truth) : 0, told = form != form_of(p);
    uint32_t head = lathe__walk_number(w, run_count * 4 + told * 2 + keep), kept = head & 1 ? p->height_count : 0, count = kept;
    code_form(w, part, head & 2, form);
    int32_t *heights = malloc(2 * LATHE_MAX_DIM * sizeof *heights), last = 0;
    if (!heights) { lathe__walk_fail(w, LATHE_ERR_MEMORY); return; }
    if (kept) memcpy(heights, p->heights, kept * sizeof *heights);
    for (uint32_t i = 0; i < head / 4 && !w->failure; i++) {
        int32_t start = lathe__walk_signed(w, runs ? runs[i][0] - last : 0);
        uint32_t step = lathe__walk_number(w, runs ? (uint32_t)runs[i][1] : 0), length = lathe__walk_number(w, runs ? (uint32_t)runs[i][2] : 0);
        if (start < -MOST_HEIGHT || start > MOST_HEIGHT || step > MOST_HEIGHT || length > 2 * LATHE_MAX_DIM - count)
            lathe__walk_fail(w, LATHE_ERR_FORMAT);
        for (last += start; length && !w->failure; length--, last += (int32_t)step) {
            if (last < -MOST_HEIGHT || last > MOST_HEIGHT) lathe__walk_fail(w, LATHE_ERR_FORMAT);
            else heights[count++] = last;
        }
    }
    qsort(heights, count, sizeof *heights, by_value);
    uint32_t n = 0;
    for (uint32_t i = 0; i < count; i++)
        if (!n || heights[n - 1] != heights[i]) heights[n++] = heights[i];
    free(p->heights);
    int32_t *fitting = realloc(heights, (n + 1) * sizeof *heights);
    p->heights = fitting ? fitting : heights;
    p->height_count = n;
}

static bool reserve_parts(lathe_draco_walk *w, uint32_t count) {
    lathe_draco_mesh *m = w->mesh;
    if (count <= m->part_count) return true;
    lathe_draco_part *more = realloc(m->parts, count * sizeof *more);
    if (!more) return lathe__walk_fail(w, LATHE_ERR_MEMORY);
    memset(more + m->part_count, 0, (count - m->part_count) * sizeof *more);
    m->parts = more;
    m->part_count = count;
    return true;
}

/* The structure of a component and where its first triangle lies. */
static void begin(lathe_draco_walk *w, uint32_t t, uint32_t *part) {
    const uint32_t *v = w->c->triangles + (size_t)3 * t;
    const int32_t *truth = w->truth ? w->truth->half : NULL;
    int64_t now = (int64_t)*part + lathe__walk_signed(w, truth ? (int32_t)(w->truth->part[v[0]] - *part) : 0);
    if (now < 0 || now >= UINT16_MAX) lathe__walk_fail(w, LATHE_ERR_FORMAT);
    if (w->failure || !reserve_parts(w, (uint32_t)now + 1)) return;
    *part = (uint32_t)now;
    if (!w->is_touched[*part]) {
        w->is_touched[*part] = 1;
        w->touched[w->touched_count++] = *part;
        code_heights(w, *part);
    }
    int32_t base = 0;
    if (truth) {
        base = truth[v[0]];
        for (int k = 1; k < 3; k++)
            if (truth[v[k]] < base) base = truth[v[k]];
        base = base & 1 ? base - 1 : base;
    }
    base = lathe__walk_signed(w, base / 2) * 2;
    if (base < -MOST_HALF || base > MOST_HALF) { lathe__walk_fail(w, LATHE_ERR_FORMAT); return; }
    for (int k = 0; k < 3; k++) {
        uint32_t above = lathe__walk_number(w, truth ? (uint32_t)(truth[v[k]] - base) : 0);
        if (above > 2) lathe__walk_fail(w, truth ? LATHE_ERR_UNSUPPORTED : LATHE_ERR_FORMAT);
        w->half[v[k]] = base + (int32_t)above;
        w->part[v[k]] = *part;
        w->c->value[0][v[k]] = 0;
    }
}

void lathe__walk_slices(lathe_draco_walk *w) {
    uint32_t n = w->c->triangle_count, part = 0;
    uint8_t *seen = LATHE_NEW(&w->arena, uint8_t, n + 1);
    uint32_t *queue = LATHE_NEW(&w->arena, uint32_t, (size_t)3 * n + 3);
    w->touched = LATHE_NEW(&w->arena, uint32_t, (size_t)n + 1);
    w->is_touched = LATHE_NEW(&w->arena, uint8_t, UINT16_MAX + 1);
    if (!seen || !queue || !w->touched || !w->is_touched) { lathe__walk_fail(w, LATHE_ERR_MEMORY); return; }
    memset(seen, 0, n);
    memset(w->is_touched, 0, UINT16_MAX + 1);
    for (uint32_t seed = 0; seed < n; seed++) {
        uint32_t head = 0, tail = 0;
        if (seen[seed]) continue;
        for (int k = 0; k < 3 && !w->failure; k++)
            /* A corner that another component has: only hostile meshes touch themselves. */
            if (w->half[w->c->triangles[(size_t)3 * seed + (size_t)k]] != LATHE_HALF_UNKNOWN) lathe__walk_fail(w, LATHE_ERR_FORMAT);
        if (!w->failure) begin(w, seed, &part);
        if (w->failure) return;
        for (uint32_t t = seed;;) {
            seen[t] = 1;
            link_edges(w, t);
            for (uint32_t k = 0; k < 3; k++) queue[tail++] = 3 * t + k;
            while (head < tail && seen[w->twin[queue[head]] / 3]) head++;
            if (head == tail) break;
            uint32_t corner = queue[head++], across = w->twin[corner], x = w->c->triangles[across - across % 3 + (across + 2) % 3];
            const uint32_t *v = w->c->triangles + corner - corner % 3;
            uint32_t a = v[corner % 3], b = v[(corner + 1) % 3], y = v[(corner + 2) % 3];
            if (w->half[x] == LATHE_HALF_UNKNOWN) place(w, a, b, y, x);
            if (w->failure) return;
            t = across / 3;
        }
    }
}
