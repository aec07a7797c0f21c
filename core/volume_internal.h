/* What the readers of volume files share. Bytes come from memory, so that the same code is tested, fuzzed and used. */
#ifndef LATHE_VOLUME_INTERNAL_H
#define LATHE_VOLUME_INTERNAL_H
#include "lathe.h"

/* What one pass over the voxels finds out. Feed it all voxels in file order, in pieces of any size. */
typedef struct lathe_scan {
    float min, max;
    bool integer; /* whole numbers below 2^24 in size, which a float holds exactly */
    bool finite;  /* false: at `broken` is the first voxel that is NaN or infinite */
    size_t broken, count;
} lathe_scan;
void lathe__scan_start(lathe_scan *scan);
void lathe__scan_feed(lathe_scan *scan, const float *values, size_t count);

/* LATHE_OK if dims are within 1 .. LATHE_MAX_DIM and 2^31 voxels; *voxels is their product. */
lathe_status lathe__check_dims(const int64_t dims[3], size_t *voxels, lathe_error *err);
/* Allocates header and (uninitialised) values; spacing and affine are those of the diagonal. dims must have been checked. */
lathe_status lathe__volume_new(lathe_volume **out, const int64_t dims[3], const double spacing[3], lathe_error *err);
/* Moves the scan's result into the volume; FORMAT with the voxel's index if one is not finite. */
lathe_status lathe__volume_finish(lathe_volume *volume, const lathe_scan *scan, lathe_error *err);

/* The whole of a regular file; *bytes is malloc'ed (one byte at least). LIMIT if it is larger than limit. */
lathe_status lathe__read_file(uint8_t **bytes, size_t *size, const char *path, uint64_t limit, lathe_error *err);

/* volume_nifti.c: the bytes of a .nii or .nii.gz file (told apart by their first two bytes). Hostile bytes are safe. */
lathe_status lathe__volume_nifti_parse(lathe_volume **out, const uint8_t *bytes, size_t size, lathe_error *err);

/* volume_raw.c: a sidecar is parsed, then the bytes it speaks of. Hostile bytes are safe. */
typedef enum lathe_raw_type { LATHE_RAW_UINT8, LATHE_RAW_INT16, LATHE_RAW_UINT16, LATHE_RAW_FLOAT32 } lathe_raw_type;
typedef struct lathe_raw_header {
    char file[1024]; /* relative, below the sidecar's folder */
    int64_t dims[3];
    double spacing[3];
    lathe_raw_type type;
    size_t voxels, bytes; /* of the data */
} lathe_raw_header;
lathe_status lathe__raw_header_parse(lathe_raw_header *out, const char *json, size_t size, lathe_error *err);
lathe_status lathe__volume_raw_parse(lathe_volume **out, const lathe_raw_header *header, const uint8_t *bytes,
                                     size_t size, lathe_error *err);
lathe_status lathe__volume_raw_open(lathe_volume **out, const char *path, lathe_error *err);

/* Four floats, four masks: gcc and clang map them to whatever the machine has. */
typedef float lathe_f4 __attribute__((vector_size(16)));
typedef int32_t lathe_i4 __attribute__((vector_size(16)));
#endif
