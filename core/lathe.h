/* Lathe core: from a volume to the surface of any level. Public API; compiles alone as C and C++.
 *
 * Units: a voxel index counts voxels of the file; lattice units are 1/65536 of a voxel edge (LATHE_LATTICE_ONE), in the
 * permuted frame (u, v, w) whose w is the slice axis; millimetres are world coordinates after the affine.
 * Every function that can fail returns a lathe_status (0 is success); out-pointers are untouched on failure. */
#ifndef LATHE_H
#define LATHE_H
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#ifdef __cplusplus
extern "C" {
#endif

typedef enum lathe_status {
    LATHE_OK = 0,
    LATHE_MORE = 1,            /* a decoder needs more input; not an error */
    LATHE_ERR_MEMORY = -1,     /* an allocation failed */
    LATHE_ERR_IO = -2,         /* the operating system refused: the detail has the path and errno's text */
    LATHE_ERR_FORMAT = -3,     /* the bytes are not what their format says: the detail has what and where */
    LATHE_ERR_UNSUPPORTED = -4,/* a correct file that Lathe does not take */
    LATHE_ERR_EMPTY = -5,      /* no voxel belongs to the structure */
    LATHE_ERR_RANGE = -6,      /* an argument is out of range */
    LATHE_ERR_CHECKSUM = -7,   /* a checksum does not match: the bytes are damaged */
    LATHE_ERR_LIMIT = -8       /* larger than Lathe's stated limits */
} lathe_status;

/* A constant English name of a status, never NULL. */
const char *lathe_status_name(lathe_status status);

/* The detail of one failure: what, where, what to do. Filled only on failure. NULL may be passed where one is taken. */
typedef struct lathe_error { char text[480]; } lathe_error;

/* Writes a printf-style detail and returns status, so that a failing function can `return lathe_fail(...)`. err may be NULL. */
lathe_status lathe_fail(lathe_error *err, lathe_status status, const char *format, ...)
#ifdef __GNUC__
    __attribute__((format(printf, 3, 4)))
#endif
    ;

#define LATHE_LATTICE_BITS 16
#define LATHE_LATTICE_ONE 65536
#define LATHE_MAX_DIM 4096     /* voxels along one axis */
#define LATHE_MAX_LEVELS 12

typedef enum lathe_axis { LATHE_AXIS_X = 0, LATHE_AXIS_Y = 1, LATHE_AXIS_Z = 2 } lathe_axis;
typedef enum lathe_boundary {
    LATHE_BOUNDARY_EDGE = 0,   /* contour vertices at the middle of pixel border edges: labels */
    LATHE_BOUNDARY_ISO = 1     /* at the linear interpolation of the grey values: thresholds */
} lathe_boundary;

/* ---- volume ---------------------------------------------------------------------------------------------------- */

/* A scalar grid in memory. Voxel (x, y, z) is values[(z * dims[1] + y) * dims[0] + x], after the file's scaling. */
typedef struct lathe_volume {
    int32_t dims[3];
    double spacing[3];         /* mm, positive */
    double affine[3][4];       /* voxel index -> world mm (rows x, y, z) */
    float *values;             /* owned */
    float min, max;            /* over all voxels; every value is finite */
    bool integer;              /* every value is a whole number: labels can be asked for */
} lathe_volume;

/* Opens PATH by its suffix: .nii, .nii.gz (NIfTI-1/2) or .json (sidecar of a raw file). Hostile files are safe.
 * Errors: IO, FORMAT (truncated, garbage, NaN or infinite voxel with its index), UNSUPPORTED, LIMIT, MEMORY. */
lathe_status lathe_volume_open(lathe_volume **out, const char *path, lathe_error *err);
/* Takes a copy of values (dims product floats, x fastest). Affine: diagonal of the spacing. For tests and programs. */
lathe_status lathe_volume_wrap(lathe_volume **out, const int32_t dims[3], const double spacing[3], const float *values,
                               lathe_error *err);
void lathe_volume_close(lathe_volume **volume);       /* NULL and a pointer to NULL are fine */

/* Otsu's threshold over a 1024-bin histogram: the value that splits the voxels into two classes of least variance. */
double lathe_volume_otsu(const lathe_volume *volume);

/* ---- mesh ------------------------------------------------------------------------------------------------------ */

/* A triangle mesh on the integer lattice. Counter-clockwise triangles seen from outside in the (u, v, w) frame. */
typedef struct lathe_mesh {
    uint32_t vertex_count, triangle_count;
    int32_t (*lattice)[3];     /* vertex_count positions (u, v, w) in lattice units; owned */
    uint32_t (*triangles)[3];  /* triangle_count vertex triples; owned */
} lathe_mesh;
void lathe_mesh_free(lathe_mesh *mesh);               /* clears; a zeroed mesh is fine */

/* Lattice (u, v, w) -> world mm: world[i] = m[i][0]*u + m[i][1]*v + m[i][2]*w + m[i][3], u, v, w in lattice units. */
typedef struct lathe_transform { double m[3][4]; } lathe_transform;
/* True when the transform mirrors: triangles must then be written with two corners swapped. */
bool lathe_transform_mirrors(const lathe_transform *transform);
/* Writes 3 * vertex_count floats (world mm). Evaluated in double, in a fixed order, so that every platform agrees. */
void lathe_mesh_positions(const lathe_mesh *mesh, const lathe_transform *transform, float *positions);
/* Writes 3 * triangle_count indices with the winding right for world space (corners 1 and 2 swapped when it mirrors). */
void lathe_mesh_indices(const lathe_mesh *mesh, const lathe_transform *transform, uint32_t *indices);

#ifdef __cplusplus
}
#endif
/* A decoder of rasters alone, of the newest kind (FORMAT.md: PYRAMID, SURE, CUBES). What it never does is left out where this says so. */
#ifdef LATHE_RASTERS
enum { LATHE_RASTERS_ONLY = 1 };
#else
enum { LATHE_RASTERS_ONLY = 0 };
#endif
/* A decoder of single radius maps and plain tubes alone (FORMAT.md: Tubes). */
#ifdef LATHE_TUBES
enum { LATHE_TUBES_ONLY = 1 };
#else
enum { LATHE_TUBES_ONLY = 0 };
#endif
#endif
