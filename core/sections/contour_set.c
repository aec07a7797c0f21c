#include "contour_set.h"
#include "strip.h"
#include "grid.h"
#include "hierarchy.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { MARGIN = LATHE_LATTICE_ONE };   /* of the lattice around a set: coordinates are positive */

void lathe__contour_set_free(lathe_contour_set *set) {
    lathe__arena_free(&set->arena);
    memset(set, 0, sizeof *set);
}

/* ---- planar questions ---- */

bool lathe__loop_holds(const lathe_outline *outline, uint32_t loop, lathe_point p) {
    const lathe_point *at = outline->points + outline->loops[loop].first;
    uint32_t n = outline->loops[loop].count;
    bool odd = false;
    for (uint32_t i = 0, j = n - 1; i < n; j = i++) {
        bool up = at[i].y > p.y;
        if ((at[j].y > p.y) != up && lathe__orient(up ? at[j] : at[i], up ? at[i] : at[j], p) > 0) odd = !odd;
    }
    return odd;
}

double lathe__loop_area2(const lathe_outline *outline, uint32_t loop) {
    const lathe_point *at = outline->points + outline->loops[loop].first;
    double sum = 0;
    for (uint32_t i = 2; i < outline->loops[loop].count; i++) sum += (double)lathe__turn(at, 0, i - 1, i);
    return sum;
}

lathe_status lathe__find_meeting_edges(bool *found, uint32_t edge[2], lathe_arena *arena, const lathe_outline *o,
                                       uint64_t *tests) {
    *found = false;
    if (!o->point_count) return LATHE_OK;
    uint32_t n = o->point_count, *next = LATHE_NEW(arena, uint32_t, n);
    lathe_range *ranges = LATHE_NEW(arena, lathe_range, n);
    if (!next || !ranges) return LATHE_ERR_MEMORY;
    for (uint32_t l = 0; l < o->loop_count; l++)
        for (uint32_t i = 0; i < o->loops[l].count; i++) {
            uint32_t v = o->loops[l].first + i;
            next[v] = i + 1 < o->loops[l].count ? v + 1 : o->loops[l].first;
            ranges[v] = lathe__range_of(o->points[v], o->points[next[v]]);
        }
    lathe_grid grid;
    lathe_status status = lathe__grid_build(&grid, arena, ranges, n, 4 * (uint64_t)n);
    if (status) return status;
    size_t cells = lathe__cell_at(&grid, grid.cells.x1, grid.cells.y1) + 1;
    for (size_t c = 0; c < cells; c++)
        for (uint32_t i = grid.first[c]; i < grid.first[c + 1]; i++) {
            uint32_t a = grid.entry[i], left = grid.first[c + 1] - i - 1;
            if (left > *tests) return LATHE_ERR_LIMIT;
            *tests -= left;
            for (uint32_t k = i + 1; k < grid.first[c + 1]; k++) {
                uint32_t b = grid.entry[k];
                const lathe_range *r = &ranges[a], *s = &ranges[b];
                if (r->x0 > s->x1 || r->x1 < s->x0 || r->y0 > s->y1 || r->y1 < s->y0 || next[a] == b || next[b] == a)
                    continue;
                if (!lathe__segments_meet(o->points, a, next[a], b, next[b])) continue;
                edge[0] = a;
                edge[1] = b;
                *found = true;
                return LATHE_OK;
            }
        }
    return LATHE_OK;
}

/* ---- from mm ---- */

typedef struct building {
    const lathe_raw_set *raw;
    lathe_contour_set set;
    lathe_arena scratch;
    lathe_set_repairs repairs;
    lathe_error *err;
    double origin[3], step;    /* mm; of a quantum */
    uint32_t *order;           /* section of the set -> as it was given */
    uint64_t tests;
} building;

static bool sane(double x) { return isfinite(x) && fabs(x) <= 1e9; }

static lathe_status check_counts(const building *b) {
    const lathe_raw_set *raw = b->raw;
    if (!raw->section_count) return lathe_fail(b->err, LATHE_ERR_FORMAT, "there is no section");
    if (!raw->polygon_count) return lathe_fail(b->err, LATHE_ERR_FORMAT, "there is no polygon");
    if (raw->section_count > LATHE_SET_SECTIONS)
        return lathe_fail(b->err, LATHE_ERR_LIMIT, "more than %d sections", LATHE_SET_SECTIONS);
    if (raw->point_count > LATHE_SET_POINTS)
        return lathe_fail(b->err, LATHE_ERR_LIMIT, "more than %d points", LATHE_SET_POINTS);
    for (uint32_t s = 0; s < raw->section_count; s++) {
        const lathe_raw_section *section = &raw->sections[s];
        uint64_t points = 0;
        if (!sane(section->z))
            return lathe_fail(b->err, LATHE_ERR_RANGE, "section %u: z is not a height within 1e9 mm", s);
        if (section->count > LATHE_SET_POLYGONS)
            return lathe_fail(b->err, LATHE_ERR_LIMIT, "section %u: more than %d polygons", s, LATHE_SET_POLYGONS);
        for (uint32_t k = 0; k < section->count; k++) {
            const lathe_raw_polygon *p = &raw->polygons[section->first + k];
            points += p->count;
            if (p->count < 3)
                return lathe_fail(b->err, LATHE_ERR_FORMAT, "section %u, polygon %u: fewer than 3 points", s, k);
            for (uint32_t i = 0; i < p->count; i++)
                if (!sane(raw->points[p->first + i][0]) || !sane(raw->points[p->first + i][1]))
                    return lathe_fail(b->err, LATHE_ERR_RANGE,
                                      "section %u, polygon %u, point %u: not a position within 1e9 mm", s, k, i);
        }
        if (points > LATHE_SET_SECTION_POINTS)
            return lathe_fail(b->err, LATHE_ERR_LIMIT, "section %u: more than %d points", s, LATHE_SET_SECTION_POINTS);
    }
    return LATHE_OK;
}

/* The box of everything decides how fine the lattice is. */
static lathe_status choose_lattice(building *b) {
    double low[3] = {INFINITY, INFINITY, INFINITY}, high[3] = {-INFINITY, -INFINITY, -INFINITY}, side = 0;
    for (uint32_t s = 0; s < b->raw->section_count; s++) {
        const lathe_raw_section *section = &b->raw->sections[s];
        low[2] = fmin(low[2], section->z), high[2] = fmax(high[2], section->z);
        for (uint32_t k = 0; k < section->count; k++)
            for (uint32_t i = 0; i < b->raw->polygons[section->first + k].count; i++)
                for (int a = 0; a < 2; a++) {
                    double x = b->raw->points[b->raw->polygons[section->first + k].first + i][a];
                    low[a] = fmin(low[a], x), high[a] = fmax(high[a], x);
                }
    }
    for (int a = 0; a < 3; a++) side = fmax(side, high[a] - low[a]);
    if (!(side > 0)) return lathe_fail(b->err, LATHE_ERR_FORMAT, "all points are one");
    b->step = side / LATHE_SET_QUANTA;
    double unit = b->step / LATHE_SET_QUANTUM;
    for (int a = 0; a < 3; a++) {
        b->origin[a] = low[a];
        b->set.transform.m[a][a] = unit;
        b->set.transform.m[a][3] = low[a] - unit * (a < 2 ? MARGIN : 0);
    }
    return LATHE_OK;
}

static int32_t to_lattice(const building *b, double x, int axis) {
    return (int32_t)lround((x - b->origin[axis]) / b->step) * LATHE_SET_QUANTUM + (axis < 2 ? MARGIN : 0);
}

static lathe_status sort_sections(building *b) {
    uint32_t n = b->raw->section_count;
    b->order = LATHE_NEW(&b->set.arena, uint32_t, n);
    b->set.sections = LATHE_NEW(&b->set.arena, lathe_section, n);
    if (!b->order || !b->set.sections) return LATHE_ERR_MEMORY;
    b->set.count = n;
    for (uint32_t i = 0; i < n; i++) {
        uint32_t k = i;
        for (; k && b->raw->sections[b->order[k - 1]].z > b->raw->sections[i].z; k--) b->order[k] = b->order[k - 1];
        b->order[k] = i;
    }
    for (uint32_t i = 0; i < n; i++) {
        b->set.sections[i] = (lathe_section){.height = to_lattice(b, b->raw->sections[b->order[i]].z, 2)};
        if (i && b->set.sections[i].height <= b->set.sections[i - 1].height)
            return lathe_fail(b->err, LATHE_ERR_FORMAT, "sections %u and %u are at one height", b->order[i - 1],
                              b->order[i]);
    }
    return LATHE_OK;
}

/* Drops points equal to the one before and points at which the polygon turns straight back, until there are none. */
static uint32_t clean_polygon(building *b, lathe_point *p, uint32_t n) {
    for (bool changed = true; changed && n >= 3;) {
        uint32_t kept = 0, spikes = 0, repeated = 0;
        for (uint32_t i = 0; i < n; i++) {
            lathe_point q = p[i];
            if (kept && p[kept - 1].x == q.x && p[kept - 1].y == q.y) { repeated++; continue; }
            if (kept >= 2 && lathe__orient(p[kept - 2], p[kept - 1], q) == 0) {
                lathe_point a = p[kept - 2], v = p[kept - 1];
                int64_t dot = (int64_t)(v.x - a.x) * (q.x - v.x) + (int64_t)(v.y - a.y) * (q.y - v.y);
                if (dot < 0) {
                    kept--, i--, spikes++;   /* q is looked at again, against the point before */
                    continue;
                }
            }
            p[kept++] = q;
        }
        while (kept > 1 && p[0].x == p[kept - 1].x && p[0].y == p[kept - 1].y) kept--, repeated++;
        changed = spikes || repeated;
        b->repairs.spikes += spikes;
        b->repairs.repeated_points += repeated;
        n = kept;
        /* Turned by one, so that the ends are looked at as well. */
        if (n < 3) break;
        lathe_point a = p[n - 2], v = p[n - 1], q = p[0], s = p[1];
        int64_t last =
            lathe__orient(a, v, q) == 0 ? (int64_t)(v.x - a.x) * (q.x - v.x) + (int64_t)(v.y - a.y) * (q.y - v.y) : 0;
        int64_t first =
            lathe__orient(v, q, s) == 0 ? (int64_t)(q.x - v.x) * (s.x - q.x) + (int64_t)(q.y - v.y) * (s.y - q.y) : 0;
        if (last < 0) n--, b->repairs.spikes++, changed = true;
        else if (first < 0) memmove(p, p + 1, --n * sizeof *p), b->repairs.spikes++, changed = true;
    }
    return n;
}

static lathe_status read_polygons(building *b, uint32_t section) {
    uint32_t given = b->order[section];
    const lathe_raw_section *raw = &b->raw->sections[given];
    lathe_outline *o = &b->set.sections[section].outline;
    size_t total = 0;
    for (uint32_t k = 0; k < raw->count; k++) total += b->raw->polygons[raw->first + k].count;
    o->points = LATHE_NEW(&b->set.arena, lathe_point, total + 1);
    o->loops = LATHE_NEW(&b->set.arena, lathe_loop, raw->count + 1);
    if (!o->points || !o->loops) return LATHE_ERR_MEMORY;
    for (uint32_t k = 0; k < raw->count; k++) {
        const lathe_raw_polygon *p = &b->raw->polygons[raw->first + k];
        lathe_point *to = o->points + o->point_count;
        for (uint32_t i = 0; i < p->count; i++)
            to[i] = (lathe_point){to_lattice(b, b->raw->points[p->first + i][0], 0),
                                  to_lattice(b, b->raw->points[p->first + i][1], 1)};
        uint32_t n = clean_polygon(b, to, p->count);
        if (n < 3)
            return lathe_fail(b->err, LATHE_ERR_FORMAT,
                              "section %u, polygon %u: it has no area: its points lie on a line, or closer than %g mm",
                              given, k, b->step);
        o->loops[o->loop_count++] = (lathe_loop){.first = o->point_count, .count = n};
        o->point_count += n;
    }
    return LATHE_OK;
}

static uint32_t loop_of(const lathe_outline *o, uint32_t vertex) {
    uint32_t l = 0;
    while (l + 1 < o->loop_count && o->loops[l + 1].first <= vertex) l++;
    return l;
}

static lathe_status check_polygons(building *b, uint32_t section) {
    const lathe_outline *o = &b->set.sections[section].outline;
    bool found;
    uint32_t edge[2];
    lathe_status status = lathe__find_meeting_edges(&found, edge, &b->scratch, o, &b->tests);
    if (status == LATHE_ERR_LIMIT)
        return lathe_fail(b->err, status, "section %u: too many edges lie close together", b->order[section]);
    if (status || !found) return status;
    uint32_t p = loop_of(o, edge[0]), q = loop_of(o, edge[1]);
    lathe_point at = o->points[edge[0]];
    double x = b->origin[0] + (double)(at.x - MARGIN) / LATHE_SET_QUANTUM * b->step,
           y = b->origin[1] + (double)(at.y - MARGIN) / LATHE_SET_QUANTUM * b->step;
    if (p == q)
        return lathe_fail(b->err, LATHE_ERR_FORMAT,
                          "section %u, polygon %u: it touches or crosses itself, on the edge from (%g, %g) mm",
                          b->order[section], p, x, y);
    return lathe_fail(b->err, LATHE_ERR_FORMAT,
                      "section %u: polygons %u and %u touch or cross, on the edge from (%g, %g) mm", b->order[section],
                      p < q ? p : q, p < q ? q : p, x, y);
}

static void reverse(lathe_point *p, uint32_t n) {
    for (uint32_t i = 0; i < n / 2; i++) {
        lathe_point swap = p[i];
        p[i] = p[n - 1 - i];
        p[n - 1 - i] = swap;
    }
}

static void direct_polygons(building *b, lathe_outline *o) {
    for (uint32_t l = 0; l < o->loop_count; l++) {
        bool hole = false;
        for (uint32_t k = 0; k < o->loop_count; k++)
            if (k != l && lathe__loop_holds(o, k, o->points[o->loops[l].first])) hole = !hole;
        o->loops[l].hole = hole;
        if ((lathe__loop_area2(o, l) < 0) == hole) continue;
        reverse(o->points + o->loops[l].first, o->loops[l].count);
        b->repairs.turned_polygons++;
    }
}

static lathe_status build(building *b) {
    lathe_status status = check_counts(b);
    if (!status) status = choose_lattice(b);
    if (!status) status = sort_sections(b);
    for (uint32_t s = 0; !status && s < b->set.count; s++) {
        status = read_polygons(b, s);
        if (!status) status = check_polygons(b, s);
        if (!status) direct_polygons(b, &b->set.sections[s].outline);
        lathe__arena_reset(&b->scratch);
    }
    return status;
}

lathe_status lathe__contour_set_build(lathe_contour_set *out, lathe_set_repairs *repairs, const lathe_raw_set *raw,
                                      lathe_error *err) {
    building b = {.raw = raw, .err = err, .tests = (uint64_t)1 << 29};
    lathe_status status = build(&b);
    lathe__arena_free(&b.scratch);
    if (status) {
        lathe__contour_set_free(&b.set);
        return status == LATHE_ERR_MEMORY ? lathe_fail(err, status, "out of memory") : status;
    }
    *out = b.set;
    if (repairs) *repairs = b.repairs;
    return LATHE_OK;
}

/* ---- from a mask ---- */

lathe_status lathe__contour_set_of_mask(lathe_contour_set *out, const lathe_mask *mask,
                                        const lathe_transform *transform, int fraction) {
    lathe_contour_set set = {.count = (uint32_t)mask->size[2], .transform = *transform};
    set.sections = LATHE_NEW(&set.arena, lathe_section, set.count);
    lathe_status status = set.sections ? LATHE_OK : LATHE_ERR_MEMORY;
    for (int32_t w = 0; !status && w < mask->size[2]; w++) {
        lathe_slice_view view = {.pixels = lathe__mask_slice(mask, w),
                                 .below = w ? lathe__mask_slice(mask, w - 1) : NULL,
                                 .above = w + 1 < mask->size[2] ? lathe__mask_slice(mask, w + 1) : NULL,
                                 .width = mask->size[0],
                                 .height = mask->size[1],
                                 .row_words = mask->row_words,
                                 .parity = w & 1,
                                 .fraction = fraction};
        int32_t *border;
        set.sections[w].height = w * LATHE_LATTICE_ONE;
        status = lathe__trace_outline(&set.sections[w].outline, &border, &set.arena, &view);
    }
    if (status) lathe__contour_set_free(&set);
    else *out = set;
    return status;
}

/* A lattice unit's length in the slice plane, mm; the shorter side of a pixel. */
static double unit_of(const lathe_contour_set *set) {
    const double(*m)[4] = set->transform.m;
    return sqrt(fmin(m[0][0] * m[0][0] + m[1][0] * m[1][0] + m[2][0] * m[2][0],
                     m[0][1] * m[0][1] + m[1][1] * m[1][1] + m[2][1] * m[2][1]));
}

lathe_status lathe__contour_set_strip(lathe_contour_set *set, double tolerance_mm) {
    double tolerance = tolerance_mm / unit_of(set);
    if (!(tolerance >= 1)) return LATHE_OK;
    lathe_status status = LATHE_OK;
    for (uint32_t s = 0; !status && s < set->count; s++) {
        lathe_outline less;
        if (!set->sections[s].outline.point_count) continue;
        status = lathe__strip_outline(&less, &set->arena, &set->sections[s].outline,
                                      tolerance > 1e9 ? 1000000000 : (int32_t)tolerance);
        if (!status) set->sections[s].outline = less;
    }
    return status;
}

lathe_status lathe__contour_set_simplify(lathe_contour_set *set, double tolerance_mm) {
    double tolerance = tolerance_mm / unit_of(set);
    if (!(tolerance >= 1)) return LATHE_OK;   /* finer than the lattice */
    lathe_status status = LATHE_OK;
    for (uint32_t s = 0; !status && s < set->count; s++) {
        lathe_outline less;
        if (!set->sections[s].outline.point_count) continue;
        status = lathe__simplify_section(&less, &set->arena, &set->sections[s].outline, tolerance);
        if (!status) set->sections[s].outline = less;
    }
    return status;
}
