/* Masks of regions against voxel-by-voxel comparison, for all axes; labels, boxes and transforms. */
#include "check.h"
#include "mask.h"
#include "phantom.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

static float voxel(const lathe_volume *v, int32_t x, int32_t y, int32_t z) {
    return v->values[((size_t)z * (size_t)v->dims[1] + (size_t)y) * (size_t)v->dims[0] + (size_t)x];
}

static bool in_region(float value, bool equal, double wanted) { return equal ? value == wanted : value >= wanted; }

static bool slice_is_empty(const lathe_mask *m, int32_t w) {
    for (size_t i = 0; i < lathe__mask_slice_words(m); i++)
        if (lathe__mask_slice(m, w)[i]) return false;
    return true;
}

/* Voxels in the wrong state, margins and bits beyond the row included; and the number of voxels must be that of the volume. */
static long count_wrong(const lathe_mask *m, const lathe_volume *v, lathe_axis axis, bool equal, double wanted) {
    int32_t frame[3], p[3];
    lathe__axis_frame(axis, frame);
    long wrong = 0, inside = 0;
    for (int32_t w = 0; w < m->size[2]; w++)
        for (int32_t b = 0; b < m->size[1]; b++)
            for (int32_t a = 0; a < m->row_words * 64; a++) {
                p[frame[0]] = m->origin[0] + a, p[frame[1]] = m->origin[1] + b, p[frame[2]] = m->origin[2] + w;
                bool valid = a < m->size[0];
                for (int k = 0; k < 3; k++) valid = valid && p[k] >= 0 && p[k] < v->dims[k];
                bool expected = valid && in_region(voxel(v, p[0], p[1], p[2]), equal, wanted);
                inside += expected;
                wrong += expected != lathe__slice_pixel(lathe__mask_slice(m, w), m->row_words, a, b);
            }
    for (int32_t z = 0; z < v->dims[2]; z++)
        for (int32_t y = 0; y < v->dims[1]; y++)
            for (int32_t x = 0; x < v->dims[0]; x++) inside -= in_region(voxel(v, x, y, z), equal, wanted);
    return wrong + labs(inside);
}

/* The box is as small as it can be and has a margin of one. */
static bool is_cropped(const lathe_mask *m) {
    bool low_u = false, high_u = false, low_v = false, high_v = false, margin = true;
    for (int32_t w = 0; w < m->size[2]; w++) {
        const uint64_t *s = lathe__mask_slice(m, w);
        for (int32_t v = 0; v < m->size[1]; v++) {
            low_u |= lathe__slice_pixel(s, m->row_words, 1, v),
                high_u |= lathe__slice_pixel(s, m->row_words, m->size[0] - 2, v);
            margin &=
                !lathe__slice_pixel(s, m->row_words, 0, v) && !lathe__slice_pixel(s, m->row_words, m->size[0] - 1, v);
        }
        for (int32_t u = 0; u < m->size[0]; u++) {
            low_v |= lathe__slice_pixel(s, m->row_words, u, 1),
                high_v |= lathe__slice_pixel(s, m->row_words, u, m->size[1] - 2);
            margin &=
                !lathe__slice_pixel(s, m->row_words, u, 0) && !lathe__slice_pixel(s, m->row_words, u, m->size[1] - 1);
        }
    }
    return low_u && high_u && low_v && high_v && margin && !slice_is_empty(m, 0) && !slice_is_empty(m, m->size[2] - 1);
}

static void check_threshold(const lathe_volume *v, double iso) {
    for (int axis = 0; axis < 3; axis++) {
        lathe_mask m;
        lathe_error err;
        if (!CHECK_EQ(lathe__region_threshold(&m, v, (lathe_axis)axis, iso, &err), LATHE_OK)) continue;
        CHECK_EQ(count_wrong(&m, v, (lathe_axis)axis, false, iso), 0);
        CHECK(is_cropped(&m));
        lathe__mask_free(&m);
        CHECK(!m.bits);
    }
}

/* Sizes around the word size, so that every shift and remainder occurs. */
static void test_shapes(void) {
    static const int sizes[][3] = {{1, 1, 1},     {2, 3, 5},     {62, 5, 3},  {63, 64, 2}, {64, 65, 3}, {65, 3, 66},
                                   {130, 7, 129}, {3, 128, 127}, {200, 2, 1}, {1, 200, 1}, {1, 1, 200}};
    for (size_t i = 0; i < sizeof sizes / sizeof *sizes; i++)
        for (int percent = 1; percent <= 81; percent += 20) {
            lathe_volume *v =
                phantom_noise(sizes[i][0], sizes[i][1], sizes[i][2], percent, (uint32_t)i * 7 + 1, PHANTOM_GREY);
            CHECK(v);
            if (v && v->max > 0) check_threshold(v, PHANTOM_ISO);
            lathe_volume_close(&v);
        }
    lathe_volume *shapes[] = {phantom_sphere(70, 30.3, PHANTOM_GREY), phantom_torus(66, 20, 6.2, PHANTOM_GREY),
                              phantom_voxel(65, PHANTOM_GREY),        phantom_slice(67, PHANTOM_GREY),
                              phantom_full(64, 3, 2, PHANTOM_GREY),   phantom_specks(30, 500, 3, PHANTOM_GREY)};
    for (size_t i = 0; i < sizeof shapes / sizeof *shapes; i++) {
        CHECK(shapes[i]);
        if (shapes[i]) check_threshold(shapes[i], PHANTOM_ISO);
        lathe_volume_close(&shapes[i]);
    }
}

/* A threshold between two floats must not be rounded to the lower one. */
static void test_iso_between_floats(void) {
    const int32_t dims[3] = {2, 1, 1};
    const double spacing[3] = {1, 1, 1};
    float values[2] = {1.0f, nextafterf(1.0f, 2.0f)};
    lathe_volume *v = NULL;
    lathe_error err;
    lathe_mask m;
    CHECK_EQ(lathe_volume_wrap(&v, dims, spacing, values, &err), LATHE_OK);
    CHECK_EQ(lathe__region_threshold(&m, v, LATHE_AXIS_Z, 1.0 + 1e-9, &err), LATHE_OK);
    CHECK_EQ(m.size[0], 3);
    CHECK_EQ(m.origin[0], 0);
    lathe__mask_free(&m);
    CHECK_EQ(lathe__region_threshold(&m, v, LATHE_AXIS_Z, 1e300, &err), LATHE_ERR_EMPTY);
    CHECK(strstr(err.text, "no voxel"));
    CHECK_EQ(lathe__region_threshold(&m, v, LATHE_AXIS_Z, NAN, &err), LATHE_ERR_RANGE);
    CHECK_EQ(lathe__region_threshold(&m, v, (lathe_axis)3, 0, &err), LATHE_ERR_RANGE);
    CHECK_EQ(lathe__region_label(&m, v, LATHE_AXIS_Z, 1, &err), LATHE_ERR_UNSUPPORTED);
    CHECK_EQ(lathe__region_threshold(&m, v, LATHE_AXIS_Z, -1e300, NULL), LATHE_OK);
    CHECK_EQ(m.size[0], 4);
    lathe__mask_free(&m);
    lathe_volume_close(&v);
}

/* ---- labels ------------------------------------------------------------------------------------------------------ */

static lathe_volume *label_volume(const int32_t dims[3], int labels, uint32_t seed, bool smooth) {
    static const float names[8] = {0, 1, 2, -5, 300, 65536, 16777215, -16777215};
    size_t count = (size_t)dims[0] * (size_t)dims[1] * (size_t)dims[2];
    float *values = malloc(count * sizeof *values), last = 0;
    for (size_t i = 0; i < count && values; i++) {
        if (!smooth || phantom_random(&seed) % 9 == 0) last = names[phantom_random(&seed) % (uint32_t)labels];
        values[i] = last;
    }
    const double spacing[3] = {1, 1, 1};
    lathe_volume *v = NULL;
    CHECK_EQ(lathe_volume_wrap(&v, dims, spacing, values, NULL), LATHE_OK);
    free(values);
    return v;
}

static void check_box(const lathe_volume *v, const lathe_label_box *box) {
    int64_t voxels = 0;
    bool low[3] = {false}, high[3] = {false}, inside = true;
    for (int32_t z = 0; z < v->dims[2]; z++)
        for (int32_t y = 0; y < v->dims[1]; y++)
            for (int32_t x = 0; x < v->dims[0]; x++) {
                if (voxel(v, x, y, z) != (float)box->label) continue;
                const int32_t p[3] = {x, y, z};
                voxels++;
                for (int k = 0; k < 3; k++) {
                    inside = inside && p[k] >= box->low[k] && p[k] <= box->high[k];
                    low[k] |= p[k] == box->low[k], high[k] |= p[k] == box->high[k];
                }
            }
    CHECK(inside && low[0] && low[1] && low[2] && high[0] && high[1] && high[2]);
    CHECK_EQ(box->voxels, voxels);
}

static void check_labels(const lathe_volume *v) {
    lathe_label_box *boxes = NULL;
    size_t count = 0;
    lathe_error err;
    if (!CHECK_EQ(lathe__region_labels(&boxes, &count, v, &err), LATHE_OK)) return;
    int64_t total = 0, nonzero = 0;
    for (size_t i = 0; i < count; i++) {
        CHECK(boxes[i].label != 0 && (!i || boxes[i - 1].label < boxes[i].label));
        check_box(v, &boxes[i]);
        total += boxes[i].voxels;
        for (int axis = 0; axis < 3; axis++) {
            lathe_mask a, b;
            if (!CHECK_EQ(lathe__region_label(&a, v, (lathe_axis)axis, boxes[i].label, &err), LATHE_OK)) continue;
            CHECK_EQ(count_wrong(&a, v, (lathe_axis)axis, true, (double)boxes[i].label), 0);
            CHECK(is_cropped(&a));
            if (CHECK_EQ(lathe__region_label_box(&b, v, (lathe_axis)axis, &boxes[i], &err), LATHE_OK)) {
                CHECK(!memcmp(a.size, b.size, sizeof a.size) && !memcmp(a.origin, b.origin, sizeof a.origin));
                CHECK(!memcmp(a.bits, b.bits, lathe__mask_slice_words(&a) * (size_t)a.size[2] * sizeof *a.bits));
                lathe__mask_free(&b);
            }
            lathe__mask_free(&a);
        }
    }
    size_t voxels = (size_t)v->dims[0] * (size_t)v->dims[1] * (size_t)v->dims[2];
    for (size_t i = 0; i < voxels; i++) nonzero += v->values[i] != 0;
    CHECK_EQ(total, nonzero);
    free(boxes);
}

static void test_labels(void) {
    static const int32_t sizes[][3] = {{5, 4, 3}, {64, 3, 2}, {65, 9, 4}, {130, 20, 11}, {1, 40, 3}, {129, 1, 1}};
    for (size_t i = 0; i < sizeof sizes / sizeof *sizes; i++)
        for (int k = 0; k < 2; k++) {
            lathe_volume *v = label_volume(sizes[i], 8, (uint32_t)i + 11, k == 0);
            check_labels(v);
            lathe_volume_close(&v);
        }
}

static void test_label_errors(void) {
    lathe_volume *v = phantom_full(300, 300, 1, PHANTOM_LABEL), *zeros = phantom_sphere(4, -3, PHANTOM_LABEL);
    lathe_label_box *boxes = NULL;
    size_t count = 0;
    lathe_error err;
    lathe_mask m;
    for (int i = 0; i < 300 * 300; i++) v->values[i] = (float)i;
    v->max = 300 * 300 - 1;
    CHECK_EQ(lathe__region_labels(&boxes, &count, v, &err), LATHE_ERR_LIMIT);
    for (int i = 65536; i < 300 * 300; i++) v->values[i] = 0;
    CHECK_EQ(lathe__region_labels(&boxes, &count, v, &err), LATHE_OK);
    CHECK_EQ(count, 65535);
    free(boxes);
    CHECK_EQ(lathe__region_labels(&boxes, &count, zeros, &err), LATHE_ERR_EMPTY);
    CHECK_EQ(lathe__region_label(&m, zeros, LATHE_AXIS_X, 1, &err), LATHE_ERR_EMPTY);
    CHECK_EQ(lathe__region_label(&m, zeros, LATHE_AXIS_X, INT64_MIN, &err), LATHE_ERR_EMPTY);
    lathe_label_box outside = {.label = 0, .low = {0, 0, 0}, .high = {3, 4, 3}};
    CHECK_EQ(lathe__region_label_box(&m, zeros, LATHE_AXIS_Z, &outside, &err), LATHE_ERR_RANGE);
    v->integer = false;
    CHECK_EQ(lathe__region_labels(&boxes, &count, v, &err), LATHE_ERR_UNSUPPORTED);
    lathe_volume_close(&v);
    lathe_volume_close(&zeros);
}

/* ---- frames ------------------------------------------------------------------------------------------------------ */

static void test_transform(void) {
    static const double affine[3][4] = {{0.5, 0.1, 0, -7}, {0, -2, 0.25, 9}, {0.125, 0, 3, 100}};
    const int32_t size[3] = {9, 9, 9}, origin[3] = {-1, 4, 11};
    lathe_mask m;
    CHECK_EQ(lathe__mask_new(&m, size, origin), LATHE_OK);
    for (int axis = 0; axis < 3; axis++) {
        int32_t frame[3], lattice[3] = {3, 5, 7}, p[3];
        lathe__axis_frame((lathe_axis)axis, frame);
        CHECK_EQ(frame[2], axis);
        CHECK_EQ((frame[0] + 1) % 3, frame[1]);
        CHECK_EQ((frame[1] + 1) % 3, frame[2]);
        lathe_transform t = lathe__mask_transform(&m, (lathe_axis)axis, affine);
        for (int k = 0; k < 3; k++) p[frame[k]] = lattice[k] + origin[k];
        for (int i = 0; i < 3; i++) {
            double got = t.m[i][3], want = affine[i][3];
            for (int k = 0; k < 3; k++) {
                got += t.m[i][k] * lattice[k] * LATHE_LATTICE_ONE;
                want += affine[i][k] * p[k];
            }
            CHECK(fabs(got - want) < 1e-9);
        }
    }
    lathe__mask_free(&m);
}

static void test_mask_limits(void) {
    const int32_t origin[3] = {0, 0, 0}, none[3] = {0, 3, 3}, large[3] = {3, LATHE_MAX_DIM + 3, 3};
    lathe_mask m;
    CHECK_EQ(lathe__mask_new(&m, none, origin), LATHE_ERR_RANGE);
    CHECK_EQ(lathe__mask_new(&m, large, origin), LATHE_ERR_LIMIT);
}

static void test_auto_axis(void) {
    static const struct {
        double spacing[3];
        lathe_axis axis;
    } cases[] = {{{1, 1, 1}, LATHE_AXIS_Z}, {{1, 1, 2}, LATHE_AXIS_Z}, {{2, 1, 1}, LATHE_AXIS_X},
                 {{1, 2, 1}, LATHE_AXIS_Y}, {{1, 2, 2}, LATHE_AXIS_Z}, {{1 + 1e-9, 1, 1}, LATHE_AXIS_Z}};
    lathe_volume *v = phantom_full(2, 2, 2, PHANTOM_LABEL);
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        memcpy(v->spacing, cases[i].spacing, sizeof v->spacing);
        CHECK_EQ(lathe__axis_auto(v), cases[i].axis);
    }
    lathe_volume_close(&v);
}

int main(void) {
    test_shapes();
    test_iso_between_floats();
    test_labels();
    test_label_errors();
    test_transform();
    test_mask_limits();
    test_auto_axis();
    return check_end();
}
