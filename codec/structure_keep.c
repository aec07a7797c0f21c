/* --topology keep: every level gets the topology of the last. In two steps, each judged by what was counted, not by what ought
 * to be: slices that carry topology begin early, until the stack of the level's slices, voxel for voxel, has the components,
 * cavities and Euler characteristic of all slices; then outlines of the level are made finer where their thinning changes how
 * two slices overlap. With every vertex the surface has the topology of its slices (docs/ARCHITECTURE.md), so this ends. */
#include <stdlib.h>
#include <string.h>
#include "mesh.h"
#include "structure_encode.h"

static bool same(const lathe_topology *a, const lathe_topology *b) {
    return a->components == b->components && a->cavities == b->cavities && a->euler == b->euler;
}

lathe_status lathe__mesh_keeps(bool *out, const lathe_mesh *mesh, const lathe_topology *topology) {
    lathe_mesh_report r;
    *out = false;
    if (!mesh->triangle_count) return LATHE_OK;
    lathe_status status = lathe__mesh_check(&r, mesh, false);
    *out = !status && !r.boundary_edges && !r.nonmanifold_edges && !r.misoriented_edges && !r.nonmanifold_vertices &&
           !r.degenerate_triangles && !r.duplicate_positions && (int64_t)r.components == topology->components + topology->cavities && r.euler == 2 * topology->euler;
    return status;
}

/* ---- slices ---- */

typedef struct keeper {
    lathe_structure_state *state;
    lathe_topology all;
    bool *shown;               /* slices of the level that is being made */
    int32_t *candidates;       /* that might be left out */
} keeper;

/* Of three neighbouring shown slices, does the middle one matter? Enough to sort out most; the whole stack is the judge. */
static lathe_status matters_here(bool *out, const keeper *k, int32_t w) {
    const lathe_mask *mask = &k->state->mask;
    int32_t below = w - 1, above = w + 1;
    while (!k->shown[below]) below--;
    while (!k->shown[above]) above++;
    static const bool BOTH[3] = {true, false, true};
    int32_t size[3] = {mask->size[0], mask->size[1], 3};
    size_t bytes = lathe__mask_slice_words(mask) * sizeof(uint64_t);
    lathe_mask three;
    lathe_topology with, without;
    lathe_status status = lathe__mask_new(&three, size, mask->origin);
    if (status) return status;
    memcpy(lathe__mask_slice(&three, 0), lathe__mask_slice(mask, below), bytes);
    memcpy(lathe__mask_slice(&three, 1), lathe__mask_slice(mask, w), bytes);
    memcpy(lathe__mask_slice(&three, 2), lathe__mask_slice(mask, above), bytes);
    status = lathe__mask_topology(&with, &three, NULL);
    if (!status) status = lathe__mask_topology(&without, &three, BOTH);
    lathe__mask_free(&three);
    *out = status || !same(&with, &without);
    return status;
}

/* Leaves out candidates first .. end - 1 as far as the topology of the whole stack stays; halves what fails. */
static lathe_status leave_out(keeper *k, size_t first, size_t end) {
    size_t left = 0;
    lathe_status status = LATHE_OK;
    bool *before = malloc((size_t)k->state->plan.slices);
    if (!before) return LATHE_ERR_MEMORY;
    memcpy(before, k->shown, (size_t)k->state->plan.slices);
    for (size_t i = first; i < end && !status; i++) {
        bool matters = true;
        status = matters_here(&matters, k, k->candidates[i]);
        k->shown[k->candidates[i]] = matters;
        left += !matters;
    }
    lathe_topology now = {0};
    if (!status && left) status = lathe__mask_topology(&now, &k->state->mask, k->shown);
    if (!status && left && !same(&now, &k->all)) {
        memcpy(k->shown, before, (size_t)k->state->plan.slices);
        size_t middle = first + (end - first) / 2;
        if (middle > first) {
            status = leave_out(k, first, middle);
            if (!status) status = leave_out(k, middle, end);
        }
    }
    free(before);
    return status;
}

/* From the last level down: a level shows what the one before it needs, so a slice left out stays out below. */
static lathe_status keep_levels(keeper *k) {
    lathe_level_plan *plan = &k->state->plan;
    uint8_t *early = (uint8_t *)(uintptr_t)plan->early;
    memset(k->shown, true, (size_t)plan->slices);
    for (uint32_t level = plan->level_count - 1; level-- > lathe__first_exact(k->state);) {
        size_t count = 0;
        for (int32_t w = 0; w < plan->slices; w++)
            if (k->shown[w] && lathe__slice_level(plan, w) > level) k->candidates[count++] = w;
        lathe_status status = leave_out(k, 0, count);
        if (status) return status;
        for (size_t i = 0; i < count; i++) {
            int32_t w = k->candidates[i];
            if (k->shown[w]) early[w] = (uint8_t)(lathe__regular_level(plan, w) - level);
        }
    }
    return LATHE_OK;
}

lathe_status lathe__keep_slices(lathe_structure_state *state) {
    size_t slices = (size_t)state->plan.slices;
    keeper k = {.state = state, .shown = malloc(slices), .candidates = malloc(slices * sizeof(int32_t))};
    lathe_status status = k.shown && k.candidates ? lathe__mask_topology(&k.all, &state->mask, NULL) : LATHE_ERR_MEMORY;
    if (!status) status = keep_levels(&k);
    free(k.shown);
    free(k.candidates);
    return status;
}

/* ---- outlines ---- */

typedef struct level_stack {
    int32_t *slices;
    uint32_t count;
    uint8_t *finer;
    int64_t *wanted;           /* Euler characteristic of slab i, between slices i and i + 1 */
    bool *fine;                /* it has it */
} level_stack;

/* Twice the Euler characteristic that two neighbouring slices have alone. */
static lathe_status wanted_euler(int64_t *out, const lathe_structure_state *state, const level_stack *s, uint32_t i) {
    const lathe_mask *mask = &state->mask;
    int32_t size[3] = {mask->size[0], mask->size[1], 2};
    size_t bytes = lathe__mask_slice_words(mask) * sizeof(uint64_t);
    lathe_mask two;
    lathe_topology topology = {0};
    lathe_status status = lathe__mask_new(&two, size, mask->origin);
    if (status) return status;
    for (uint32_t k = 0; k < 2; k++) memcpy(lathe__mask_slice(&two, (int32_t)k), lathe__mask_slice(mask, s->slices[i + k]), bytes);
    status = lathe__mask_topology(&topology, &two, NULL);
    lathe__mask_free(&two);
    *out = 2 * topology.euler;
    return status;
}

/* The Euler characteristic of the closed surface that two outlines and their regions would make: that of the slab between them
 * (V - E + F, where only the outlines' edges are used once) and of the two regions. */
static lathe_status slab_euler(int64_t *out, const lathe_outline outlines[2], lathe_arena *scratch) {
    lathe_mesh_builder builder = {0};
    lathe_overlay_counts counts = {0};
    uint32_t points = outlines[0].point_count + outlines[1].point_count;
    lathe_slab slab = {.outline = {&outlines[0], &outlines[1]}, .height = {0, LATHE_LATTICE_ONE}, .base = 0,
                       .cap = LATHE_LATTICE_ONE / 2};
    lathe_status status = lathe__builder_reserve(&builder, points, 0);
    builder.mesh.vertex_count = points;   /* their positions do not matter here */
    if (!status) status = lathe__overlay_slab(&builder, scratch, &slab, &counts);
    *out = (int64_t)builder.mesh.vertex_count - ((int64_t)builder.mesh.triangle_count + points) / 2;
    for (int side = 0; side < 2; side++)
        for (uint32_t l = 0; l < outlines[side].loop_count; l++) *out += outlines[side].loops[l].hole ? -1 : 1;
    lathe__arena_reset(scratch);
    lathe_mesh_free(&builder.mesh);
    return status;
}

/* One round: slices on either side of a slab that is wrong become finer by one level. */
static lathe_status refine_wrong(bool *changed, level_stack *s, const lathe_structure_state *state, lathe_arena arena[2],
                                 uint32_t coarseness) {
    lathe_surface_style style = {.fraction = state->fraction, .coarseness = coarseness, .finer = s->finer};
    lathe_surface_counts counts = {0};
    lathe_outline *outlines;
    *changed = false;
    lathe_status status = lathe__level_outlines(&outlines, arena, &state->mask, s->slices, s->count, &style, &counts);
    for (uint32_t i = 0; !status && i + 1 < s->count; i++) {
        int64_t euler = 0;
        if (s->fine[i]) continue;
        status = slab_euler(&euler, outlines + i, &arena[1]);
        s->fine[i] = !status && euler == s->wanted[i];
    }
    lathe__arena_reset(&arena[0]);
    lathe__arena_reset(&arena[1]);
    bool *again = malloc(s->count);
    if (!again) return LATHE_ERR_MEMORY;
    memset(again, 0, s->count);
    for (uint32_t i = 0; !status && i + 1 < s->count; i++)
        if (!s->fine[i]) again[i] = again[i + 1] = true;
    for (uint32_t i = 0; i < s->count; i++) {
        if (!again[i] || s->finer[i] >= coarseness) continue;
        s->finer[i]++;
        *changed = true;
        if (i) s->fine[i - 1] = false;
        s->fine[i] = false;
    }
    free(again);
    return status;
}

static lathe_status whole_keeps(bool *out, lathe_structure_state *state, const level_stack *s, lathe_arena arena[2], uint32_t coarseness,
                                const lathe_topology *all) {
    lathe_surface_style style = {.fraction = state->fraction, .coarseness = coarseness, .finer = s->finer};
    lathe_surface_counts counts = {0};
    lathe_mesh mesh = {0};
    lathe_status status = lathe__build_styled(&mesh, arena, &state->mask, s->slices, s->count, &style, &counts);
    if (!status) status = lathe__mesh_keeps(out, &mesh, all);
    lathe__arena_reset(&arena[0]);
    lathe__arena_reset(&arena[1]);
    lathe_mesh_free(&mesh);
    return status;
}

static lathe_status keep_stack(level_stack *s, lathe_structure_state *state, lathe_arena arena[2], uint32_t coarseness) {
    lathe_topology all;
    bool changed = true, right = false;
    lathe_status status = lathe__mask_topology(&all, &state->mask, NULL);
    for (uint32_t i = 0; !status && i + 1 < s->count; i++) status = wanted_euler(&s->wanted[i], state, s, i);
    while (!status && changed && coarseness) status = refine_wrong(&changed, s, state, arena, coarseness);
    if (!status) status = whole_keeps(&right, state, s, arena, coarseness, &all);
    /* Slabs may have the right number and join the wrong parts: then all of them are made finer. */
    for (uint32_t more = 0; !status && !right && more < coarseness; more++) {
        for (uint32_t i = 0; i < s->count; i++) s->finer[i] += s->finer[i] < coarseness;
        status = whole_keeps(&right, state, s, arena, coarseness, &all);
    }
    return !status && !right ? LATHE_ERR_FORMAT : status;
}

lathe_status lathe__keep_outlines(uint8_t **finer, lathe_structure_state *state, lathe_arena arena[2], uint32_t level) {
    lathe_arena list = {0};
    level_stack s = {.finer = NULL};
    lathe_status status = lathe__level_slices(&s.slices, &s.count, &list, &state->plan, level);
    if (!status) {
        s.finer = calloc(s.count, 1);
        s.fine = calloc(s.count, sizeof *s.fine);
        s.wanted = calloc(s.count, sizeof *s.wanted);
        status = s.finer && s.fine && s.wanted ? keep_stack(&s, state, arena, state->plan.level_count - 1 - level) : LATHE_ERR_MEMORY;
    }
    free(s.fine);
    free(s.wanted);
    if (status) free(s.finer);
    else *finer = s.finer;
    lathe__arena_free(&list);
    return status;
}
