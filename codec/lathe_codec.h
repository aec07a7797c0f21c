/* Lathe codec: archives, the progressive decoder, the baker and the mesh writers. Public API; compiles alone as C and C++.
 * docs/FORMAT.md specifies the bytes. */
#ifndef LATHE_CODEC_H
#define LATHE_CODEC_H
#include "lathe.h"
#ifdef __cplusplus
extern "C" {
#endif

/* Where bytes go. Returns 0, or anything else to stop (the writer then returns LATHE_ERR_IO). */
typedef int (*lathe_sink)(void *context, const void *bytes, size_t size);

/* ---- decoder: bytes of a stream in, meshes out; hostile input is safe; the same code runs as wasm ------------------- */

typedef struct lathe_decoder lathe_decoder;
/* What one step has decoded: structure `structure` now stands at level `level`. */
typedef struct lathe_step {
    uint32_t structure, level;
    float error_rms_mm, error_max_mm;   /* of the whole model at this level, as measured at bake time; negative: not measured */
    uint32_t rays, slices;              /* most rays of any contour, slices shown, of this structure at this level */
    uint32_t passes_left;               /* until the level is whole: 0, unless every pass is asked for */
} lathe_step;
lathe_status lathe_decoder_open(lathe_decoder **out);
void lathe_decoder_close(lathe_decoder **decoder);
/* Appends bytes of a stream (an archive's stream part, from its first byte, in any portions). */
lathe_status lathe_decoder_feed(lathe_decoder *decoder, const uint8_t *bytes, size_t size);
/* Decodes the next packet: LATHE_OK and *step; LATHE_MORE if it is not all there yet; FORMAT, CHECKSUM, ... with
 * lathe_decoder_error. After an error the decoder only repeats it. After all packets of the stream: LATHE_MORE. */
lathe_status lathe_decoder_step(lathe_decoder *decoder, lathe_step *step);
/* Build a mesh at each step (the default), or only decode (false): then lathe_decoder_mesh builds on demand. */
void lathe_decoder_build_meshes(lathe_decoder *decoder, bool build);
/* Stop behind every pass of a level, not only where one is whole: lathe_step.passes_left tells. */
void lathe_decoder_every_pass(lathe_decoder *decoder, bool every);
/* The structure's mesh at its latest level or pass; valid until the next step or close. NULL (and FORMAT in the error) if the level
 * cannot be built from hostile input. */
const lathe_mesh *lathe_decoder_mesh(lathe_decoder *decoder, uint32_t structure);
const lathe_transform *lathe_decoder_transform(const lathe_decoder *decoder, uint32_t structure);
/* The voxels of a structure: the slices decoded so far. Pixel (u, v) of slice w is bit u & 63 of
 * bits[(w * size[1] + v) * row_words + (u >> 6)]; there is an empty margin of one pixel in u and v. */
typedef struct lathe_voxels {
    int32_t size[3], origin[3], row_words;   /* origin: permuted voxel index of pixel (0, 0) of slice 0 */
    int fraction;                  /* where the outlines cross border edges, 0..64 */
    const uint64_t *bits;          /* the decoder's, until it closes; NULL: no slice yet */
} lathe_voxels;
/* False until the header is in, or if there is no such structure. */
bool lathe_decoder_voxels(lathe_decoder *decoder, uint32_t structure, lathe_voxels *out);
uint32_t lathe_decoder_structures(const lathe_decoder *decoder);      /* 0 until the header is in */
const char *lathe_decoder_error(const lathe_decoder *decoder);        /* detail of the failure, "" if none */

/* ---- archives ------------------------------------------------------------------------------------------------------ */

typedef struct lathe_level_info {
    uint32_t rays, slices, vertices, triangles;
    uint64_t polar_bytes;          /* what a client fetches for this level of this structure, its share of headers included */
    uint64_t draco_bytes;          /* of the whole level as .drc, 0: not computed at bake time */
    float error_rms_mm, error_max_mm;   /* negative: not measured */
    uint32_t components, components_waiting;   /* of the region: shown by the level, and not yet */
    double waiting_mm3;            /* volume of those that wait */
} lathe_level_info;
typedef struct lathe_structure_info {
    const char *name;              /* UTF-8, unique in the model */
    uint8_t rgb[3];
    int64_t label;                 /* the volume's label, or -1 for a threshold */
    uint32_t level_count;
    const lathe_level_info *levels;
} lathe_structure_info;
typedef struct lathe_model_info {
    const char *name;              /* of the source, for people */
    uint32_t structure_count, level_count;   /* level_count: the most of any structure; the others stay at their last */
    const lathe_structure_info *structures;
    /* How it was baked, so that `verify` can do the same to a volume. */
    lathe_axis axis;
    lathe_boundary boundary;
    double iso;                    /* NaN for labels */
    bool keep_topology;            /* every level has the topology of the last */
    bool caps;                     /* caps of the last level have coded shapes */
    bool exact;                    /* no structure is a radius map */
    bool independent, pyramid;     /* each structure can be decoded alone; levels are rasters, not slices */
    bool rasters_only;             /* rasters of the newest kind: the decoder of rasters reads them */
    /* Of the whole model at each level: area-weighted RMS, largest max (negative: not measured), and totals. */
    const lathe_level_info *levels;
} lathe_model_info;

typedef struct lathe_model lathe_model;
/* Maps the file (read only) and checks header, index and sizes; packets are checked when they are decoded. */
lathe_status lathe_model_open(lathe_model **out, const char *path, lathe_error *err);
/* The same from memory; bytes stay the caller's and must outlive the model. */
lathe_status lathe_model_parse(lathe_model **out, const uint8_t *bytes, size_t size, lathe_error *err);
void lathe_model_close(lathe_model **model);
const lathe_model_info *lathe_model_describe(const lathe_model *model);
const uint8_t *lathe_model_bytes(const lathe_model *model, size_t *size);           /* the whole archive */
/* The smallest of the browser's decoders that reads the model. Decodes the base shapes unless the model is made of rasters. */
typedef enum lathe_small_decoder { LATHE_DECODER_WHOLE, LATHE_DECODER_RASTERS, LATHE_DECODER_TUBES } lathe_small_decoder;
lathe_small_decoder lathe_model_decoder(const lathe_model *model);
/* Index of a structure by name, or -1. */
int64_t lathe_model_find(const lathe_model *model, const char *name);

/* Writes the stream of levels from..to (inclusive; clamped) as the decoder takes it: header if from is 0, then level records.
 * structure: index, or -1 for all. For all structures this is a slice of the archive, byte for byte.
 * A decoder that starts must be given from = 0; later parts continue it. */
lathe_status lathe_model_stream(const lathe_model *model, int64_t structure, uint32_t from, uint32_t to, lathe_sink sink,
                                void *context);
uint64_t lathe_model_stream_size(const lathe_model *model, int64_t structure, uint32_t from, uint32_t to);
/* For all structures the stream from..to is a slice of the archive: its place in lathe_model_bytes. */
void lathe_model_stream_range(const lathe_model *model, uint32_t from, uint32_t to, size_t *offset, size_t *size);
/* The last level whose whole-model rms is >= 0... is in lathe_model_info; this checks every checksum of the archive. */
lathe_status lathe_model_check(const lathe_model *model, lathe_error *err);

/* A mesh ready for writers: world mm, winding right. structure -1: all structures in one mesh. Owned by the caller. */
typedef struct lathe_world_mesh {
    uint32_t vertex_count, triangle_count, structure_count;
    float *positions;              /* 3 * vertex_count, mm */
    uint32_t *indices;             /* 3 * triangle_count */
    struct lathe_world_part { uint32_t structure, first_vertex, vertex_count, first_triangle, triangle_count; } *parts;
    float *normals;                /* 3 * vertex_count, or NULL: whoever needs them takes those of the triangles */
} lathe_world_mesh;
lathe_status lathe_model_mesh(lathe_world_mesh *out, const lathe_model *model, int64_t structure, uint32_t level,
                              lathe_error *err);
void lathe_world_mesh_free(lathe_world_mesh *mesh);
/* Replaces each part by the smooth surface through its vertices [P 4], every edge in k pieces (1 to 16), every triangle in k * k,
 * with the patches' normals. Untouched on failure: RANGE, LIMIT, MEMORY. */
lathe_status lathe_world_mesh_smooth(lathe_world_mesh *mesh, uint32_t k);

/* ---- bake ---------------------------------------------------------------------------------------------------------- */

typedef struct lathe_bake_structure { char name[96]; uint8_t rgb[3]; int64_t label; } lathe_bake_structure;
typedef struct lathe_bake_options {
    lathe_axis axis;
    int boundary;                  /* lathe_boundary, or -1: edge for labels, iso for a threshold */
    double iso;                    /* used when structure_count is 0 */
    const lathe_bake_structure *structures; size_t structure_count;   /* labels to bake; none: the threshold */
    const char *name;              /* of the model */
    bool keep_topology;            /* every level gets the topology of the last, at the price of more bytes at first */
    bool exact;                    /* never a radius map (within 0.22 voxel RMS, for fewer bytes) */
    bool independent;              /* each structure can be decoded alone, for about an eighth more bytes */
    bool slices;                   /* levels of whole slices, as with keep_topology, instead of rasters: archives of before */
    uint32_t levels;               /* at most so many; 0: by the size. Not for a kept topology or a radius map */
    bool flat_caps;                /* caps rise half a voxel instead of following the grey values */
    bool measure;                  /* errors in mm (mesh against isosurface) */
    size_t samples;                /* per surface and level, shared over structures by area; 0: default */
    bool draco;                    /* also compute draco_bytes for `info` */
    /* Called now and then, 0 <= fraction <= 1, with a constant stage name; may be NULL. Non-zero return cancels. */
    int (*progress)(void *context, const char *stage, double fraction);
    void *progress_context;
} lathe_bake_options;
void lathe_bake_defaults(lathe_bake_options *options);
/* Writes the whole archive through sink, in order. */
lathe_status lathe_bake(const lathe_volume *volume, const lathe_bake_options *options, lathe_sink sink, void *context,
                        lathe_error *err);
/* The same to a file, atomically: a temporary file beside it, fsync, rename. Nothing is left on failure. */
lathe_status lathe_bake_file(const lathe_volume *volume, const lathe_bake_options *options, const char *path, lathe_error *err);

/* ---- writers: one mesh through a sink ------------------------------------------------------------------------------ */

typedef struct lathe_write_options {
    const lathe_model_info *model; /* names and colours of the parts; may be NULL */
    const char *name;
} lathe_write_options;
lathe_status lathe_write_stl(const lathe_world_mesh *mesh, const lathe_write_options *options, lathe_sink sink, void *context);
lathe_status lathe_write_ply(const lathe_world_mesh *mesh, const lathe_write_options *options, lathe_sink sink, void *context);
/* Binary glTF: one mesh and material for each part, positions, normals (the mesh's own, else smooth ones), 32-bit indices, metres as glTF wants. */
lathe_status lathe_write_glb(const lathe_world_mesh *mesh, const lathe_write_options *options, lathe_sink sink, void *context);
/* Draco edgebreaker, positions at quantization_bits (11 when 0); compression level 10. */
lathe_status lathe_write_drc(const lathe_world_mesh *mesh, int quantization_bits, lathe_sink sink, void *context);
/* What takes a client from level - 1 to level (0: its start) by a stock Draco decoder, docs/DRACO_DELTAS.md; structure: index, or -1
 * for all. Nothing is written if the level changes nothing. The work is that of all levels up to this one. */
lathe_status lathe_write_draco_delta(const lathe_model *model, int64_t structure, uint32_t level, lathe_sink sink, void *context,
                                     lathe_error *err);

/* Writes bytes to PATH atomically: temporary file beside it, fsync, rename; on failure nothing is left. */
typedef struct lathe_atomic_file lathe_atomic_file;
lathe_status lathe_atomic_open(lathe_atomic_file **out, const char *path, lathe_error *err);
int lathe_atomic_write(void *file, const void *bytes, size_t size);                /* a lathe_sink */
lathe_status lathe_atomic_commit(lathe_atomic_file **file, lathe_error *err);
void lathe_atomic_abandon(lathe_atomic_file **file);

#ifdef __cplusplus
}
#endif
#endif
