/* A contour set as input of a bake: reconstructed, then put on a grid. */
#include "cli.h"
#include "contour_json.h"
#include "reconstruct.h"
#include "voxelise.h"
#include <math.h>
#include <stdlib.h>

static int compare_gaps(const void *a, const void *b) {
    int32_t x = *(const int32_t *)a, y = *(const int32_t *)b;
    return (x > y) - (x < y);
}

/* mm */
static double choose_spacing(const lathe_contour_set *set) {
    double unit = set->transform.m[0][0], side = (double)LATHE_SET_QUANTA * LATHE_SET_QUANTUM * unit, gap = side / 128;
    int32_t *gaps = set->count > 1 ? malloc(set->count * sizeof *gaps) : NULL;
    if (gaps) {
        for (uint32_t i = 1; i < set->count; i++) gaps[i - 1] = set->sections[i].height - set->sections[i - 1].height;
        qsort(gaps, set->count - 1, sizeof *gaps, compare_gaps);
        gap = gaps[(set->count - 1) / 2] * unit;
        free(gaps);
    }
    return fmin(fmax(gap, side / 384), side / 64);
}

static lathe_status bake_contours(lathe_volume **out, const lathe_bake_arguments *a, lathe_error *err) {
    lathe_contour_set set;
    lathe_reconstruct_options options;
    lathe_mesh mesh = {0};
    double spacing = 0;
    if (a->spacing && (!lathe__option_number(&spacing, a->spacing) || !(spacing > 0)))
        return lathe_fail(err, LATHE_ERR_RANGE, "--spacing %s: a number of mm above 0", a->spacing);
    lathe_status status = lathe__contour_json_open(&set, NULL, a->input, err);
    if (status) return status;
    lathe_reconstruct_defaults(&options);
    if (!a->spacing) spacing = choose_spacing(&set);
    status = lathe__reconstruct(&mesh, NULL, &set, &options, err);
    if (!status) status = lathe__voxelise(out, &mesh, &set.transform, spacing, err);
    if (!status && !a->quiet)
        fprintf(stderr, "lathe: contour set on a grid of %d x %d x %d voxels of %g mm (--spacing sets another)\n",
                (*out)->dims[0], (*out)->dims[1], (*out)->dims[2], spacing);
    lathe_mesh_free(&mesh);
    lathe__contour_set_free(&set);
    return status;
}

lathe_status lathe__open_bake_input(lathe_volume **out, const lathe_bake_arguments *a, lathe_error *err) {
    return lathe__is_contour_json(a->input) ? bake_contours(out, a, err) : lathe_volume_open(out, a->input, err);
}
