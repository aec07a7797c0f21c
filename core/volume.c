/* The grid itself: making, scanning and closing volumes; Otsu's threshold; which reader a path goes to. */
#include "volume_internal.h"
#include <errno.h>
#include <fcntl.h>
#include <float.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include <sys/stat.h>
#include <unistd.h>

enum { OTSU_BINS = 1024 };
#define MAX_VOXELS ((uint64_t)1 << 31)
#define MAX_WHOLE 16777216.0f                       /* 2^24: beyond it neighbouring whole numbers share a float */
#define MAX_FILE_BYTES (MAX_VOXELS * 8 + (1 << 30)) /* the largest type, and room for header extensions */

/* ---- scan -------------------------------------------------------------------------------------------------------- */

void lathe__scan_start(lathe_scan *scan) {
    *scan = (lathe_scan){.min = FLT_MAX, .max = -FLT_MAX, .integer = true, .finite = true};
}

static void scan_one(lathe_scan *scan, float value, size_t index) {
    if (!isfinite(value)) {
        if (scan->finite) scan->broken = index;
        scan->finite = false;
        return;
    }
    if (value < scan->min) scan->min = value;
    if (value > scan->max) scan->max = value;
    if (!(fabsf(value) < MAX_WHOLE) || value != (float)(int32_t)value) scan->integer = false;
}

static inline lathe_f4 select4(lathe_i4 mask, lathe_f4 yes, lathe_f4 no) {
    return (lathe_f4)((mask & (lathe_i4)yes) | (~mask & (lathe_i4)no));
}

/* Four voxels at a time: a NaN or infinity is only noticed here, and looked for by scan_one. */
static bool scan_fours(lathe_scan *scan, const float *values, size_t fours) {
    lathe_f4 low = {scan->min, scan->min, scan->min, scan->min}, high = {scan->max, scan->max, scan->max, scan->max};
    const lathe_i4 magnitude = {INT32_MAX, INT32_MAX, INT32_MAX, INT32_MAX};
    const lathe_f4 limit = {MAX_WHOLE, MAX_WHOLE, MAX_WHOLE, MAX_WHOLE}, huge = {FLT_MAX, FLT_MAX, FLT_MAX, FLT_MAX};
    lathe_i4 finite = {-1, -1, -1, -1}, whole = finite;
    for (size_t i = 0; i < fours; i++) {
        lathe_f4 v;
        memcpy(&v, values + 4 * i, sizeof v);
        lathe_f4 size = (lathe_f4)((lathe_i4)v & magnitude);
        lathe_i4 small = size < limit;
        lathe_f4 safe = (lathe_f4)((lathe_i4)v & small); /* 0 where the conversion would overflow */
        whole &= small & (safe == __builtin_convertvector(__builtin_convertvector(safe, lathe_i4), lathe_f4));
        finite &= size <= huge;
        low = select4(v < low, v, low);
        high = select4(v > high, v, high);
    }
    bool all_finite = true;
    for (int k = 0; k < 4; k++) {
        all_finite = all_finite && finite[k];
        scan->integer = scan->integer && whole[k];
        if (low[k] < scan->min) scan->min = low[k];
        if (high[k] > scan->max) scan->max = high[k];
    }
    return all_finite;
}

void lathe__scan_feed(lathe_scan *scan, const float *values, size_t count) {
    size_t done = count & ~(size_t)3;
    if (!scan_fours(scan, values, done / 4)) done = 0;
    for (size_t i = done; i < count; i++) scan_one(scan, values[i], scan->count + i);
    scan->count += count;
}

/* ---- making and closing ------------------------------------------------------------------------------------------ */

lathe_status lathe__check_dims(const int64_t dims[3], size_t *voxels, lathe_error *err) {
    uint64_t product = 1;
    for (int k = 0; k < 3; k++) {
        if (dims[k] < 1)
            return lathe_fail(err, LATHE_ERR_FORMAT, "the volume has %lld voxels along %c; at least 1 is needed",
                              (long long)dims[k], "xyz"[k]);
        if (dims[k] > LATHE_MAX_DIM)
            return lathe_fail(err, LATHE_ERR_LIMIT, "the volume has %lld voxels along %c; the limit is %d",
                              (long long)dims[k], "xyz"[k], LATHE_MAX_DIM);
        product *= (uint64_t)dims[k];
    }
    if (product > MAX_VOXELS || product > SIZE_MAX / sizeof(double))
        return lathe_fail(err, LATHE_ERR_LIMIT, "the volume has %lld x %lld x %lld voxels; the limit is %llu in all",
                          (long long)dims[0], (long long)dims[1], (long long)dims[2], (unsigned long long)MAX_VOXELS);
    *voxels = (size_t)product;
    return LATHE_OK;
}

lathe_status lathe__volume_new(lathe_volume **out, const int64_t dims[3], const double spacing[3], lathe_error *err) {
    size_t voxels = (size_t)dims[0] * (size_t)dims[1] * (size_t)dims[2];
    lathe_volume *volume = calloc(1, sizeof *volume);
    float *values = malloc(voxels * sizeof *values);
    if (!volume || !values) {
        free(volume);
        free(values);
        return lathe_fail(err, LATHE_ERR_MEMORY, "no memory for %lld x %lld x %lld voxels", (long long)dims[0],
                          (long long)dims[1], (long long)dims[2]);
    }
    volume->values = values;
    for (int k = 0; k < 3; k++) {
        volume->dims[k] = (int32_t)dims[k];
        volume->spacing[k] = volume->affine[k][k] = spacing[k];
    }
    *out = volume;
    return LATHE_OK;
}

lathe_status lathe__volume_finish(lathe_volume *volume, const lathe_scan *scan, lathe_error *err) {
    if (!scan->finite) {
        size_t nx = (size_t)volume->dims[0], ny = (size_t)volume->dims[1], i = scan->broken;
        return lathe_fail(err, LATHE_ERR_FORMAT,
                          "voxel (%zu, %zu, %zu) is not a finite number that fits 32-bit float; every voxel must be",
                          i % nx, i / nx % ny, i / nx / ny);
    }
    volume->min = scan->min;
    volume->max = scan->max;
    volume->integer = scan->integer;
    return LATHE_OK;
}

lathe_status lathe_volume_wrap(lathe_volume **out, const int32_t dims[3], const double spacing[3], const float *values,
                               lathe_error *err) {
    int64_t size[3] = {dims[0], dims[1], dims[2]};
    size_t voxels = 0;
    lathe_status status = lathe__check_dims(size, &voxels, err);
    if (status) return status;
    for (int k = 0; k < 3; k++)
        if (!(spacing[k] > 0 && spacing[k] < 1e9))
            return lathe_fail(err, LATHE_ERR_RANGE, "spacing %g mm along %c is not positive", spacing[k], "xyz"[k]);
    lathe_volume *volume = NULL;
    status = lathe__volume_new(&volume, size, spacing, err);
    if (status) return status;
    memcpy(volume->values, values, voxels * sizeof *values);
    lathe_scan scan;
    lathe__scan_start(&scan);
    lathe__scan_feed(&scan, volume->values, voxels);
    status = lathe__volume_finish(volume, &scan, err);
    if (status)
        lathe_volume_close(&volume);
    else
        *out = volume;
    return status;
}

void lathe_volume_close(lathe_volume **volume) {
    if (!volume || !*volume) return;
    free((*volume)->values);
    free(*volume);
    *volume = NULL;
}

/* ---- opening ----------------------------------------------------------------------------------------------------- */

static lathe_status fail_errno(lathe_error *err, const char *path) {
    return lathe_fail(err, errno == ENOMEM ? LATHE_ERR_MEMORY : LATHE_ERR_IO, "%s: %s", path, strerror(errno));
}

static lathe_status read_all(int fd, uint8_t *bytes, size_t size, const char *path, lathe_error *err) {
    for (size_t done = 0; done < size;) {
        size_t want = size - done < (size_t)1 << 30 ? size - done : (size_t)1 << 30;
        ssize_t got = read(fd, bytes + done, want);
        if (got < 0 && errno == EINTR) continue;
        if (got < 0) return fail_errno(err, path);
        if (!got) return lathe_fail(err, LATHE_ERR_IO, "%s: became shorter while it was read", path);
        done += (size_t)got;
    }
    return LATHE_OK;
}

lathe_status lathe__read_file(uint8_t **bytes, size_t *size, const char *path, uint64_t limit, lathe_error *err) {
    int fd = open(path, O_RDONLY | O_CLOEXEC | O_NONBLOCK); /* a pipe without a writer must not hang */
    if (fd < 0) return fail_errno(err, path);
    lathe_status status = LATHE_OK;
    uint8_t *data = NULL;
    struct stat info;
    if (fstat(fd, &info))
        status = fail_errno(err, path);
    else if (!S_ISREG(info.st_mode))
        status = lathe_fail(err, LATHE_ERR_IO, "%s: not a regular file", path);
    else if ((uint64_t)info.st_size > limit)
        status = lathe_fail(err, LATHE_ERR_LIMIT, "%s: %lld bytes; the limit is %llu", path, (long long)info.st_size,
                            (unsigned long long)limit);
    else if (!(data = malloc((size_t)info.st_size + 1)))
        status = lathe_fail(err, LATHE_ERR_MEMORY, "%s: no memory for %lld bytes", path, (long long)info.st_size);
    if (!status) status = read_all(fd, data, (size_t)info.st_size, path, err);
    close(fd);
    if (status) {
        free(data);
        return status;
    }
    *bytes = data;
    *size = (size_t)info.st_size;
    return LATHE_OK;
}

static bool has_suffix(const char *path, const char *suffix) {
    size_t n = strlen(path), m = strlen(suffix);
    return n > m && !strcasecmp(path + n - m, suffix);
}

static lathe_status open_nifti(lathe_volume **out, const char *path, lathe_error *err) {
    uint8_t *bytes = NULL;
    size_t size = 0;
    lathe_status status = lathe__read_file(&bytes, &size, path, MAX_FILE_BYTES, err);
    if (status) return status;
    lathe_error detail = {""};
    status = lathe__volume_nifti_parse(out, bytes, size, &detail);
    free(bytes);
    return status ? lathe_fail(err, status, "%.120s%s: %.340s", strlen(path) > 120 ? "..." : "",
                               strlen(path) > 120 ? path + strlen(path) - 117 : path, detail.text)
                  : LATHE_OK;
}

lathe_status lathe_volume_open(lathe_volume **out, const char *path, lathe_error *err) {
    if (has_suffix(path, ".nii") || has_suffix(path, ".nii.gz")) return open_nifti(out, path, err);
    if (has_suffix(path, ".json")) return lathe__volume_raw_open(out, path, err);
    return lathe_fail(err, LATHE_ERR_UNSUPPORTED,
                      "%.300s: not a volume that Lathe reads; give a .nii, .nii.gz or .json (sidecar of a raw file)",
                      path);
}

/* ---- Otsu -------------------------------------------------------------------------------------------------------- */

static void fill_histogram(uint64_t histogram[OTSU_BINS], const lathe_volume *volume) {
    size_t voxels = (size_t)volume->dims[0] * (size_t)volume->dims[1] * (size_t)volume->dims[2];
    double scale = OTSU_BINS / ((double)volume->max - volume->min), low = volume->min;
    memset(histogram, 0, OTSU_BINS * sizeof *histogram);
    for (size_t i = 0; i < voxels; i++) {
        int bin = (int)((volume->values[i] - low) * scale);
        histogram[bin < OTSU_BINS ? bin : OTSU_BINS - 1]++;
    }
}

double lathe_volume_otsu(const lathe_volume *volume) {
    if (!(volume->max > volume->min)) return volume->min;
    uint64_t histogram[OTSU_BINS];
    fill_histogram(histogram, volume);
    double total = 0, total_sum = 0;
    for (int i = 0; i < OTSU_BINS; i++) total += (double)histogram[i], total_sum += (double)histogram[i] * i;
    double count = 0, sum = 0, best = -1;
    int first = 1, last = 1; /* empty bins between the classes give a plateau: its middle is the threshold */
    for (int i = 1; i < OTSU_BINS; i++) {
        count += (double)histogram[i - 1];
        sum += (double)histogram[i - 1] * (i - 1);
        double rest = total - count;
        if (count <= 0 || rest <= 0) continue;
        double gap = sum / count - (total_sum - sum) / rest, between = count * rest * gap * gap;
        if (between > best) best = between, first = i;
        if (between >= best) last = i;
    }
    return volume->min + ((double)volume->max - volume->min) * (first + last) / (2.0 * OTSU_BINS);
}
