#include "reconstruct.h"
#include "contour_set.h"
#include <stdlib.h>
#include <string.h>

enum { MOST_MOVES = 8, FIRST_AMPLITUDE = 30, LAST_AMPLITUDE = 510 };

typedef struct built {
    lathe_mesh mesh;
    bool done;
    lathe_slab_counts counts;
    lathe_slab_faults faults;
    bool overlaid, separated;
} built;

typedef struct reconstruction {
    const lathe_contour_set *set;
    const lathe_reconstruct_options *options;
    lathe_arena keep, scratch;
    lathe_outline *outlines;   /* of the sections, moved where they had to be */
    uint8_t *moves;            /* section -> how often it was moved */
    int32_t *amplitude;        /* section -> by how much at most */
    built *slabs;
    uint64_t tests;
    lathe_error *err;
} reconstruction;

void lathe_reconstruct_defaults(lathe_reconstruct_options *options) {
    memset(options, 0, sizeof *options);
    options->slab.threshold = LATHE_LINK_THRESHOLD;
    options->slab.tiling = LATHE_TILING_TREES;
}

/* ---- moving sections apart ---- */

static lathe_point moved(lathe_point p, uint32_t seed, int32_t amplitude) {
    uint64_t h = ((uint64_t)(uint32_t)p.x << 32 | (uint32_t)p.y) * 0x9E3779B97F4A7C15u + seed * 0xD6E8FEB86659FD93u;
    h = (h ^ h >> 29) * 0xBF58476D1CE4E5B9u;
    h ^= h >> 32;
    /* Even: products of differences stay exact in the overlay's doubles. */
    uint32_t span = (uint32_t)amplitude + 1;
    return (lathe_point){p.x + (int32_t)((uint32_t)h % span) * 2 - amplitude,
                         p.y + (int32_t)((uint32_t)(h >> 24) % span) * 2 - amplitude};
}

/* Still simple, and still nested as before? */
static lathe_status is_sound(bool *out, reconstruction *r, const lathe_outline *o) {
    bool found;
    uint32_t edge[2];
    lathe_status status = lathe__find_meeting_edges(&found, edge, &r->scratch, o, &r->tests);
    if (status) return status;
    *out = !found;
    for (uint32_t l = 0; *out && l < o->loop_count; l++) {
        bool hole = false;
        for (uint32_t k = 0; k < o->loop_count; k++)
            if (k != l && lathe__loop_holds(o, k, o->points[o->loops[l].first])) hole = !hole;
        *out = hole == o->loops[l].hole && (lathe__loop_area2(o, l) < 0) == hole;
    }
    return LATHE_OK;
}

/* Moves the points of a section anew; where no move leaves it simple it stays as it was given. */
static lathe_status move_section(reconstruction *r, uint32_t s) {
    const lathe_outline *given = &r->set->sections[s].outline;
    lathe_outline *o = &r->outlines[s];
    int32_t amplitude = FIRST_AMPLITUDE << (r->moves[s] / 2);
    if (amplitude > LAST_AMPLITUDE) amplitude = LAST_AMPLITUDE;
    r->moves[s]++;
    for (uint32_t attempt = 0; attempt < 6; attempt++, amplitude = amplitude / 4 * 2) {
        for (uint32_t i = 0; i < given->point_count; i++)
            o->points[i] = moved(given->points[i], s * 64 + r->moves[s] * 8u + attempt, amplitude);
        bool sound;
        lathe_status status = is_sound(&sound, r, o);
        lathe__arena_reset(&r->scratch);
        if (status) return status;
        if (!sound) continue;
        r->amplitude[s] = amplitude;
        return LATHE_OK;
    }
    memcpy(o->points, given->points, given->point_count * sizeof *o->points);
    r->amplitude[s] = 0;
    return LATHE_OK;
}

/* ---- slabs ---- */

static void describe(const reconstruction *r, uint32_t i, lathe_slab_input *in) {
    static const lathe_outline air = {0};
    uint32_t count = r->set->count;
    const lathe_section *s = r->set->sections;
    bool first = i == 0, last = i == count;
    *in = (lathe_slab_input){.outline = {first ? &air : &r->outlines[i - 1], last ? &air : &r->outlines[i]},
                             .end = first || last,
                             .cap = r->options->cap};
    /* Beyond the ends there is room for the cap, or for the overlay that a flat cap falls back to. */
    int32_t beyond = r->options->cap ? 2 * r->options->cap : 2 * FIRST_AMPLITUDE;
    in->height[0] = first ? s[0].height - beyond : s[i - 1].height;
    in->height[1] = last ? s[count - 1].height + beyond : s[i].height;
    in->lattice = r->options->lattice && (first || !r->moves[i - 1]) && (last || !r->moves[i]);
    if (r->options->turns) {
        in->turn[0] = first ? NULL : r->options->turns[i - 1];
        in->turn[1] = last ? NULL : r->options->turns[i];
    }
}

static void forget(built *slab) {
    lathe_mesh_free(&slab->mesh);
    *slab = (built){0};
}

/* Moves both sections of a slab and forgets the slabs about them; false: they were moved often enough. */
static lathe_status move_both(reconstruction *r, uint32_t i, bool *again) {
    *again = false;
    for (uint32_t k = i ? i - 1 : 0; k <= i && k < r->set->count; k++) *again |= r->moves[k] < MOST_MOVES;
    for (uint32_t k = i ? i - 1 : 0; *again && k <= i && k < r->set->count; k++) {
        if (r->moves[k] == MOST_MOVES) continue;
        lathe_status status = move_section(r, k);
        if (status) return status;
        forget(&r->slabs[k]);
        forget(&r->slabs[k + 1]);
    }
    return LATHE_OK;
}

static lathe_status build_slab(reconstruction *r, uint32_t i, bool *again) {
    built *slab = &r->slabs[i];
    lathe_slab_input in;
    lathe_slab_outcome outcome;
    describe(r, i, &in);
    lathe_status status =
        lathe__build_slab(&slab->mesh, &outcome, &slab->counts, &slab->faults, &r->scratch, &in, &r->options->slab);
    lathe__arena_reset(&r->scratch);
    *again = false;
    if (status)
        return lathe_fail(r->err, status, "between sections %d and %u: %s", (int)i - 1, i, lathe_status_name(status));
    slab->overlaid = outcome == LATHE_SLAB_OVERLAID;
    slab->done = true;
    if (outcome != LATHE_SLAB_AT_FAULT) return LATHE_OK;
    slab->done = false;
    status = move_both(r, i, again);
    if (status || *again) return status;
    status = lathe__separate_slab(&slab->mesh, &outcome, &slab->faults, &r->scratch, &in);
    lathe__arena_reset(&r->scratch);
    if (!status && outcome == LATHE_SLAB_AT_FAULT) status = LATHE_ERR_LIMIT;
    if (status)
        return lathe_fail(r->err, status, "no surface between sections %d and %u: outlines too close together",
                          (int)i - 1, i);
    slab->done = slab->separated = true;
    return LATHE_OK;
}

/* A slab at fault sends the walk back to the first slab about its sections; each section moves at most MOST_MOVES
 * times. */
static lathe_status build_slabs(reconstruction *r) {
    for (uint32_t i = 0; i <= r->set->count; i++) {
        bool again;
        if (r->slabs[i].done) continue;
        lathe_status status = build_slab(r, i, &again);
        if (status) return status;
        if (again) i = i >= 2 ? i - 2 : UINT32_MAX;   /* the loop counts it on */
    }
    return LATHE_OK;
}

/* ---- the whole ---- */

static lathe_status start(reconstruction *r) {
    uint32_t n = r->set->count;
    size_t points = 0;
    r->outlines = LATHE_NEW(&r->keep, lathe_outline, n + 1);
    r->moves = LATHE_NEW(&r->keep, uint8_t, n + 1);
    r->amplitude = LATHE_NEW(&r->keep, int32_t, n + 1);
    built *slabs = LATHE_NEW(&r->keep, built, n + 1);
    if (!r->outlines || !r->moves || !r->amplitude || !slabs) return LATHE_ERR_MEMORY;
    memset(r->moves, 0, n + 1);
    memset(r->amplitude, 0, (n + 1) * sizeof *r->amplitude);
    memset(slabs, 0, (n + 1) * sizeof *slabs);
    r->slabs = slabs;
    for (uint32_t s = 0; s < n; s++) {
        const lathe_outline *given = &r->set->sections[s].outline;
        lathe_outline *o = &r->outlines[s];
        *o = *given;
        o->points = LATHE_NEW(&r->keep, lathe_point, given->point_count + 1);
        if (!o->points) return LATHE_ERR_MEMORY;
        if (given->point_count) memcpy(o->points, given->points, given->point_count * sizeof *o->points);
        points += given->point_count;
    }
    return points ? LATHE_OK : LATHE_ERR_EMPTY;
}

static lathe_status merge(lathe_mesh *out, const reconstruction *r) {
    uint32_t n = r->set->count;
    size_t points = 0, vertices = 0, triangles = 0, extra;
    for (uint32_t s = 0; s < n; s++) points += r->outlines[s].point_count;
    vertices = points;
    for (uint32_t i = 0; i <= n; i++) {
        size_t own = (i ? r->outlines[i - 1].point_count : 0) + (size_t)(i < n ? r->outlines[i].point_count : 0);
        vertices += r->slabs[i].mesh.vertex_count - own;
        triangles += r->slabs[i].mesh.triangle_count;
    }
    lathe_mesh_builder builder = {0};
    lathe_status status = lathe__builder_reserve(&builder, vertices, triangles);
    if (status) {
        lathe_mesh_free(&builder.mesh);
        return status;
    }
    lathe_mesh *m = &builder.mesh;
    for (uint32_t s = 0; s < n; s++)
        for (uint32_t i = 0; i < r->outlines[s].point_count; i++) {
            int32_t *v = m->lattice[m->vertex_count++];
            v[0] = r->outlines[s].points[i].x, v[1] = r->outlines[s].points[i].y, v[2] = r->set->sections[s].height;
        }
    extra = points;
    for (uint32_t i = 0, low = 0; i <= n; i++) {
        const lathe_mesh *slab = &r->slabs[i].mesh;
        uint32_t own = (i ? r->outlines[i - 1].point_count : 0) + (i < n ? r->outlines[i].point_count : 0);
        memcpy(m->lattice + extra, slab->lattice + own, (slab->vertex_count - own) * sizeof *m->lattice);
        for (uint32_t t = 0; t < slab->triangle_count; t++, m->triangle_count++)
            for (int k = 0; k < 3; k++) {
                uint32_t v = slab->triangles[t][k];
                m->triangles[m->triangle_count][k] = v < own ? v + low : v - own + (uint32_t)extra;
            }
        extra += slab->vertex_count - own;
        low += i ? r->outlines[i - 1].point_count : 0;
    }
    m->vertex_count = (uint32_t)extra;
    *out = *m;
    return LATHE_OK;
}

static void add_counts(lathe_slab_counts *to, const lathe_slab_counts *c) {
    for (int k = 0; k < 4; k++) to->links[k] += c->links[k];
    to->tubes += c->tubes, to->branched += c->branched, to->closed += c->closed, to->overlaid += c->overlaid;
    to->copied += c->copied, to->treeless += c->treeless, to->refused += c->refused, to->crossed += c->crossed;
    to->repaired += c->repaired, to->handles += c->handles;
}

static void write_report(lathe_reconstruct_report *out, const reconstruction *r, const lathe_mesh *mesh) {
    lathe_reconstruct_report report = {
        .slabs = r->set->count + 1, .vertices = mesh->vertex_count, .triangles = mesh->triangle_count};
    for (uint32_t i = 0; i <= r->set->count; i++) {
        const built *slab = &r->slabs[i];
        const lathe_slab_faults *f = &slab->faults;
        add_counts(&report.blocks, &slab->counts);
        report.overlaid += slab->overlaid;
        report.separated += slab->separated;
        if (!slab->overlaid) continue;
        if (f->crossings) report.crossing++;
        else if (f->edges || f->fans) report.torn++;
        else report.flat++;
    }
    for (uint32_t s = 0; s < r->set->count; s++) {
        report.moved += r->amplitude[s] > 0;
        if (r->amplitude[s] > report.farthest) report.farthest = r->amplitude[s];
    }
    *out = report;
}

lathe_status lathe__reconstruct(lathe_mesh *out, lathe_reconstruct_report *report, const lathe_contour_set *set,
                                const lathe_reconstruct_options *options, lathe_error *err) {
    reconstruction r = {.set = set, .options = options, .tests = (uint64_t)1 << 33, .err = err};
    lathe_mesh mesh = {0};
    for (uint32_t s = 1; s < set->count; s++)
        if (set->sections[s].height - set->sections[s - 1].height < 4)
            return lathe_fail(err, LATHE_ERR_RANGE, "sections %u and %u are closer than 4 lattice units", s - 1, s);
    lathe_status status = start(&r);
    if (status == LATHE_ERR_EMPTY) lathe_fail(err, status, "no section has a contour");
    if (!status) status = build_slabs(&r);
    if (!status) status = merge(&mesh, &r);
    if (!status) {
        if (report) write_report(report, &r, &mesh);
        *out = mesh;
    }
    for (uint32_t i = 0; r.slabs && i <= set->count; i++) lathe_mesh_free(&r.slabs[i].mesh);
    lathe__arena_free(&r.keep);
    lathe__arena_free(&r.scratch);
    return status;
}
