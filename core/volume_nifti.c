/* NIfTI-1 and NIfTI-2 single files. The NIfTI library turns the header into an image description (byte order, scaling,
 * sform and qform); everything it would trust, exit on or print about is checked before it sees the bytes. The voxels are
 * inflated, converted and scanned here in one pass: no second copy of the volume is ever in memory. */
#include "volume_internal.h"
#include <math.h>
#include <nifti2_io.h> /* its folder, /usr/include/nifti, must be on the include path */
#include <stdlib.h>
#include <string.h>
#include <zlib.h>

enum {
    CHUNK = 1 << 17,      /* bytes converted at a time; a multiple of every type's size */
    MAX_INFLATION = 1032, /* deflate cannot expand more than this */
    MAX_OFFSET = 1 << 30  /* header extensions larger than this are not believed */
};

/* ---- bytes, plain or inflated ------------------------------------------------------------------------------------ */

typedef struct source {
    const uint8_t *at, *end; /* plain: what is left */
    bool packed, ended;      /* gzip; its last member has ended */
    z_stream z;
} source;

static lathe_status source_open(source *s, const uint8_t *bytes, size_t size, lathe_error *err) {
    memset(s, 0, sizeof *s);
    s->at = bytes;
    s->end = bytes + size;
    s->packed = size >= 2 && bytes[0] == 0x1f && bytes[1] == 0x8b;
    if (s->packed && inflateInit2(&s->z, 15 + 16) != Z_OK)
        return lathe_fail(err, LATHE_ERR_MEMORY, "no memory for decompression");
    return LATHE_OK;
}

static void source_close(source *s) {
    if (s->packed) inflateEnd(&s->z);
}

/* A gzip file may be several members one after the other. */
static void end_member(source *s) {
    size_t left = (size_t)(s->end - s->at);
    if (left >= 2 && s->at[0] == 0x1f && s->at[1] == 0x8b && inflateReset(&s->z) == Z_OK) return;
    s->ended = true;
}

static lathe_status inflate_some(source *s, uint8_t *out, size_t size, size_t *got, lathe_error *err) {
    size_t done = 0;
    while (done < size && !s->ended) {
        size_t in = (size_t)(s->end - s->at), room = size - done;
        s->z.next_in = (Bytef *)(uintptr_t)s->at; /* zlib does not write here */
        s->z.avail_in = (uInt)(in < 1u << 30 ? in : 1u << 30);
        s->z.next_out = out + done;
        s->z.avail_out = (uInt)(room < 1u << 30 ? room : 1u << 30);
        uInt out_before = s->z.avail_out;
        int code = inflate(&s->z, Z_NO_FLUSH);
        s->at = s->z.next_in;
        done += out_before - s->z.avail_out;
        if (code == Z_STREAM_END)
            end_member(s);
        else if (code == Z_BUF_ERROR)
            break; /* no input left */
        else if (code == Z_MEM_ERROR)
            return lathe_fail(err, LATHE_ERR_MEMORY, "no memory for decompression");
        else if (code != Z_OK)
            return lathe_fail(err, LATHE_ERR_FORMAT, "the gzip data is damaged after %llu bytes (%s)",
                              (unsigned long long)s->z.total_out, s->z.msg ? s->z.msg : "bad stream");
    }
    *got = done;
    return LATHE_OK;
}

static lathe_status source_read(source *s, uint8_t *out, size_t size, size_t *got, lathe_error *err) {
    if (s->packed) return inflate_some(s, out, size, got, err);
    size_t left = (size_t)(s->end - s->at);
    *got = left < size ? left : size;
    if (*got) memcpy(out, s->at, *got);
    s->at += *got;
    return LATHE_OK;
}

/* The most that the file can hold: refuses declared sizes before anything is allocated for them. */
static uint64_t source_bound(const uint8_t *bytes, size_t size) {
    bool packed = size >= 2 && bytes[0] == 0x1f && bytes[1] == 0x8b;
    return packed ? (uint64_t)size * MAX_INFLATION : size;
}

static lathe_status source_check_end(source *s, lathe_error *err) {
    uint8_t extra;
    size_t got = 0;
    lathe_status status = source_read(s, &extra, 1, &got, err);
    if (status) return status;
    if (got)
        return lathe_fail(err, LATHE_ERR_FORMAT, "there is data after the last voxel: header and data do not agree");
    if (s->packed && !s->ended)
        return lathe_fail(err, LATHE_ERR_FORMAT, "the gzip data is truncated: its checksum is missing");
    if (s->at != s->end)
        return lathe_fail(err, LATHE_ERR_FORMAT, "there are %zu bytes of garbage after the gzip data",
                          (size_t)(s->end - s->at));
    return LATHE_OK;
}

/* ---- header ------------------------------------------------------------------------------------------------------ */

/* The fields that are checked before the library sees the header, in host byte order. */
typedef struct raw_fields {
    int64_t dim[8];
    double offset, slope, inter;
    int datatype, bitpix;
    bool single; /* header and data in one file */
} raw_fields;

typedef union header_bytes {
    uint8_t bytes[sizeof(nifti_2_header)];
    nifti_1_header n1;
    nifti_2_header n2;
} header_bytes;

typedef struct grid {
    int64_t dims[3];
    size_t voxels, offset; /* offset of the first voxel in the inflated file */
    int type, width;       /* NIfTI datatype, bytes in a voxel */
    bool swap, scaled;
    double slope, inter;
    double spacing[3], affine[3][4];
} grid;

/* 1 or 2: the version by its size field and magic, 0 if it is neither. */
static int header_version(const header_bytes *h, size_t size) {
    int32_t field = h->n1.sizeof_hdr, swapped = (int32_t)__builtin_bswap32((uint32_t)field);
    if (field == 348 || swapped == 348) {
        bool magic = size >= 348 && (!memcmp(h->n1.magic, "n+1", 4) || !memcmp(h->n1.magic, "ni1", 4));
        return magic ? 1 : 0;
    }
    if (size >= 540 && (field == 540 || swapped == 540))
        return !memcmp(h->n2.magic, "n+2\0\r\n\032\n", 8) || !memcmp(h->n2.magic, "ni2\0\r\n\032\n", 8) ? 2 : 0;
    return 0;
}

static raw_fields fields_of(const header_bytes *original, int version) {
    header_bytes h = *original;
    raw_fields f = {0};
    if (version == 1) {
        if (h.n1.sizeof_hdr != 348) swap_nifti_header(&h.n1, 1);
        for (int i = 0; i < 8; i++) f.dim[i] = h.n1.dim[i];
        f.offset = h.n1.vox_offset, f.slope = h.n1.scl_slope, f.inter = h.n1.scl_inter;
        f.datatype = h.n1.datatype, f.bitpix = h.n1.bitpix, f.single = h.n1.magic[1] == '+';
    } else {
        if (h.n2.sizeof_hdr != 540) swap_nifti_header(&h.n2, 2);
        for (int i = 0; i < 8; i++) f.dim[i] = h.n2.dim[i];
        f.offset = (double)h.n2.vox_offset, f.slope = h.n2.scl_slope, f.inter = h.n2.scl_inter;
        f.datatype = h.n2.datatype, f.bitpix = h.n2.bitpix, f.single = h.n2.magic[1] == '+';
    }
    return f;
}

static int type_width(int datatype) {
    switch (datatype) {
    case NIFTI_TYPE_UINT8:
    case NIFTI_TYPE_INT8: return 1;
    case NIFTI_TYPE_UINT16:
    case NIFTI_TYPE_INT16: return 2;
    case NIFTI_TYPE_UINT32:
    case NIFTI_TYPE_INT32:
    case NIFTI_TYPE_FLOAT32: return 4;
    case NIFTI_TYPE_UINT64:
    case NIFTI_TYPE_INT64:
    case NIFTI_TYPE_FLOAT64: return 8;
    default: return 0;
    }
}

static lathe_status check_dim(const raw_fields *f, lathe_error *err) {
    if (f->dim[0] < 1 || f->dim[0] > 7)
        return lathe_fail(err, LATHE_ERR_FORMAT, "the header says %lld dimensions; 1 to 7 are possible",
                          (long long)f->dim[0]);
    int64_t dims[3];
    for (int i = 1; i <= 3; i++) dims[i - 1] = i <= f->dim[0] ? f->dim[i] : 1;
    size_t voxels;
    lathe_status status = lathe__check_dims(dims, &voxels, err);
    for (int i = 4; i <= f->dim[0] && !status; i++) {
        if (f->dim[i] < 0)
            status = lathe_fail(err, LATHE_ERR_FORMAT, "dim[%d] is %lld", i, (long long)f->dim[i]);
        else if (f->dim[i] > 1)
            status = lathe_fail(err, LATHE_ERR_UNSUPPORTED, "the file has %lld %s (dim[%d]); extract one of them first",
                                (long long)f->dim[i], i == 4 ? "frames" : "values for each voxel", i);
    }
    return status;
}

static lathe_status check_fields(const raw_fields *f, int version, lathe_error *err) {
    if (!f->single)
        return lathe_fail(err, LATHE_ERR_UNSUPPORTED,
                          "the header belongs to a .hdr/.img pair; convert it to one .nii file");
    lathe_status status = check_dim(f, err);
    if (status) return status;
    int width = type_width(f->datatype);
    if (!width)
        return lathe_fail(err, nifti_datatype_is_valid(f->datatype, 1) ? LATHE_ERR_UNSUPPORTED : LATHE_ERR_FORMAT,
                          "voxels of type %d (%.40s); integers and 32 or 64-bit floats are possible", f->datatype,
                          nifti_datatype_to_string(f->datatype));
    if (f->bitpix && f->bitpix != width * 8)
        return lathe_fail(err, LATHE_ERR_FORMAT, "the header says %d bits for each voxel, but its type has %d",
                          f->bitpix, width * 8);
    int least = version == 1 ? 348 : 540;
    if (!(f->offset >= least && f->offset <= MAX_OFFSET && f->offset == floor(f->offset)))
        return lathe_fail(err, LATHE_ERR_FORMAT, "the data begins at byte %g (vox_offset); %d to %d are possible",
                          f->offset, least, MAX_OFFSET);
    if (isinf(f->slope) || isinf(f->inter) || (isnan(f->inter) && !isnan(f->slope) && f->slope != 0))
        return lathe_fail(err, LATHE_ERR_FORMAT, "the scaling is not finite (scl_slope %g, scl_inter %g)", f->slope,
                          f->inter);
    return LATHE_OK;
}

static double millimetres(const nifti_image *image) {
    return image->xyz_units == NIFTI_UNITS_METER ? 1000 : image->xyz_units == NIFTI_UNITS_MICRON ? 0.001 : 1;
}

/* Spacing is the length of the affine's columns: what pixdim says besides does not matter. */
static lathe_status set_affine(grid *g, const nifti_image *image, lathe_error *err) {
    const nifti_dmat44 *m = image->sform_code > 0 ? &image->sto_xyz : &image->qto_xyz;
    const char *name = image->sform_code > 0 ? "sform" : image->qform_code > 0 ? "qform" : "pixdim";
    double unit = millimetres(image), a[3][4];
    bool good = true;
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 4; j++) {
            g->affine[i][j] = a[i][j] = m->m[i][j] * unit;
            good = good && isfinite(a[i][j]) && fabs(a[i][j]) < 1e12;
        }
    double volume = 1;
    for (int j = 0; j < 3 && good; j++) {
        g->spacing[j] = sqrt(a[0][j] * a[0][j] + a[1][j] * a[1][j] + a[2][j] * a[2][j]);
        good = g->spacing[j] > 1e-9 && g->spacing[j] < 1e9;
        volume *= g->spacing[j];
    }
    double det = a[0][0] * (a[1][1] * a[2][2] - a[1][2] * a[2][1]) - a[0][1] * (a[1][0] * a[2][2] - a[1][2] * a[2][0]) +
                 a[0][2] * (a[1][0] * a[2][1] - a[1][1] * a[2][0]);
    if (!good || !(fabs(det) > 1e-6 * volume))
        return lathe_fail(err, LATHE_ERR_FORMAT,
                          "the %s does not describe a grid in space (its matrix is singular or not finite)", name);
    return LATHE_OK;
}

static lathe_status grid_of_image(grid *g, const nifti_image *image, const raw_fields *f, lathe_error *err) {
    g->dims[0] = image->nx, g->dims[1] = image->ny, g->dims[2] = image->nz;
    g->type = image->datatype;
    g->width = type_width(image->datatype);
    g->offset = (size_t)f->offset;
    g->swap = image->byteorder != nifti_short_order();
    g->slope = image->scl_slope, g->inter = image->scl_inter;
    /* A slope of 0 or NaN means "not scaled": nibabel writes NaN for it. */
    g->scaled = !isnan(f->slope) && image->scl_slope != 0 && (image->scl_slope != 1 || image->scl_inter != 0);
    lathe_status status = lathe__check_dims(g->dims, &g->voxels, err);
    return status ? status : set_affine(g, image, err);
}

static lathe_status read_header(grid *g, source *s, lathe_error *err) {
    header_bytes h = {{0}};
    size_t got = 0, more = 0;
    lathe_status status = source_read(s, h.bytes, sizeof h.n1, &got, err);
    /* Only a NIfTI-2 header has more than 348 bytes; reading further would run into the voxels of NIfTI-1. */
    bool long_header = got == sizeof h.n1 && h.n1.sizeof_hdr != 348 && h.n1.sizeof_hdr != 0x5c010000;
    if (!status && long_header) status = source_read(s, h.bytes + got, sizeof h - got, &more, err);
    if (status) return status;
    got += more;
    if (got < sizeof h.n1)
        return lathe_fail(err, LATHE_ERR_FORMAT, "truncated: %zu bytes are too few for a NIfTI header", got);
    int version = header_version(&h, got);
    if (!version)
        return lathe_fail(err, LATHE_ERR_FORMAT, "not a NIfTI-1 or NIfTI-2 file: size field and magic do not match");
    nifti_set_debug_level(0); /* the library must not write to stderr */
    raw_fields f = fields_of(&h, version);
    status = check_fields(&f, version, err);
    if (status) return status;
    nifti_image *image = version == 1 ? nifti_convert_n1hdr2nim(h.n1, NULL) : nifti_convert_n2hdr2nim(h.n2, NULL);
    if (!image) return lathe_fail(err, LATHE_ERR_FORMAT, "the NIfTI library refuses the header");
    status = grid_of_image(g, image, &f, err);
    nifti_image_free(image);
    if (!status && g->offset < got) status = lathe_fail(err, LATHE_ERR_FORMAT, "the data begins inside the header");
    g->offset -= status ? 0 : got; /* what is still to be skipped */
    return status;
}

/* ---- voxels ------------------------------------------------------------------------------------------------------ */

#define SAME(x) (x)
#define CONVERT_LOOP(type, bits, order)                                          \
    for (size_t i = 0; i < count; i++) {                                         \
        bits word;                                                               \
        memcpy(&word, bytes + i * sizeof word, sizeof word);                     \
        word = (bits)order(word);                                                \
        type value;                                                              \
        memcpy(&value, &word, sizeof value);                                     \
        out[i] = scaled ? (float)(slope * (double)value + inter) : (float)value; \
    }
#define CONVERT(name, type, bits, order)                                                                \
    static void name(float *restrict out, const uint8_t *restrict bytes, size_t count, const grid *g) { \
        const bool scaled = g->scaled;                                                                  \
        const double slope = g->slope, inter = g->inter;                                                \
        if (!g->swap) {                                                                                 \
            CONVERT_LOOP(type, bits, SAME)                                                              \
        } else {                                                                                        \
            CONVERT_LOOP(type, bits, order)                                                             \
        }                                                                                               \
    }
CONVERT(convert_u8, uint8_t, uint8_t, SAME)
CONVERT(convert_i8, int8_t, uint8_t, SAME)
CONVERT(convert_u16, uint16_t, uint16_t, __builtin_bswap16)
CONVERT(convert_i16, int16_t, uint16_t, __builtin_bswap16)
CONVERT(convert_u32, uint32_t, uint32_t, __builtin_bswap32)
CONVERT(convert_i32, int32_t, uint32_t, __builtin_bswap32)
CONVERT(convert_f32, float, uint32_t, __builtin_bswap32)
CONVERT(convert_u64, uint64_t, uint64_t, __builtin_bswap64)
CONVERT(convert_i64, int64_t, uint64_t, __builtin_bswap64)
CONVERT(convert_f64, double, uint64_t, __builtin_bswap64)

static void convert(float *out, const uint8_t *bytes, size_t count, const grid *g) {
    switch (g->type) {
    case NIFTI_TYPE_UINT8: convert_u8(out, bytes, count, g); break;
    case NIFTI_TYPE_INT8: convert_i8(out, bytes, count, g); break;
    case NIFTI_TYPE_UINT16: convert_u16(out, bytes, count, g); break;
    case NIFTI_TYPE_INT16: convert_i16(out, bytes, count, g); break;
    case NIFTI_TYPE_UINT32: convert_u32(out, bytes, count, g); break;
    case NIFTI_TYPE_INT32: convert_i32(out, bytes, count, g); break;
    case NIFTI_TYPE_FLOAT32: convert_f32(out, bytes, count, g); break;
    case NIFTI_TYPE_UINT64: convert_u64(out, bytes, count, g); break;
    case NIFTI_TYPE_INT64: convert_i64(out, bytes, count, g); break;
    default: convert_f64(out, bytes, count, g); break;
    }
}

static lathe_status skip_bytes(source *s, uint8_t *chunk, size_t count, lathe_error *err) {
    while (count) {
        size_t want = count < CHUNK ? count : CHUNK, got = 0;
        lathe_status status = source_read(s, chunk, want, &got, err);
        if (status) return status;
        if (got < want) return lathe_fail(err, LATHE_ERR_FORMAT, "truncated between header and voxels");
        count -= got;
    }
    return LATHE_OK;
}

static lathe_status read_voxels(lathe_volume *volume, source *s, uint8_t *chunk, const grid *g, lathe_error *err) {
    lathe_scan scan;
    lathe__scan_start(&scan);
    size_t per_chunk = CHUNK / (size_t)g->width;
    for (size_t done = 0; done < g->voxels;) {
        size_t want = g->voxels - done < per_chunk ? g->voxels - done : per_chunk, got = 0;
        lathe_status status = source_read(s, chunk, want * (size_t)g->width, &got, err);
        if (status) return status;
        if (got < want * (size_t)g->width)
            return lathe_fail(err, LATHE_ERR_FORMAT, "truncated: data for %zu of %zu voxels",
                              done + got / (size_t)g->width, g->voxels);
        convert(volume->values + done, chunk, want, g);
        lathe__scan_feed(&scan, volume->values + done, want);
        if (!scan.finite) break;
        done += want;
    }
    return lathe__volume_finish(volume, &scan, err);
}

static lathe_status parse_source(lathe_volume **out, source *s, uint8_t *chunk, uint64_t bound, lathe_error *err) {
    grid g;
    lathe_status status = read_header(&g, s, err);
    if (status) return status;
    uint64_t need = (uint64_t)g.voxels * (uint64_t)g.width + g.offset;
    if (need > bound)
        return lathe_fail(err, LATHE_ERR_FORMAT,
                          "truncated: the header promises %llu bytes, the file cannot hold more than %llu",
                          (unsigned long long)need, (unsigned long long)bound);
    lathe_volume *volume = NULL;
    status = lathe__volume_new(&volume, g.dims, g.spacing, err);
    if (status) return status;
    memcpy(volume->affine, g.affine, sizeof g.affine);
    status = skip_bytes(s, chunk, g.offset, err);
    if (!status) status = read_voxels(volume, s, chunk, &g, err);
    if (!status) status = source_check_end(s, err);
    if (status)
        lathe_volume_close(&volume);
    else
        *out = volume;
    return status;
}

lathe_status lathe__volume_nifti_parse(lathe_volume **out, const uint8_t *bytes, size_t size, lathe_error *err) {
    source s;
    lathe_status status = source_open(&s, bytes, size, err);
    if (status) return status;
    uint8_t *chunk = malloc(CHUNK);
    status = chunk ? parse_source(out, &s, chunk, source_bound(bytes, size), err)
                   : lathe_fail(err, LATHE_ERR_MEMORY, "no memory to read the file");
    free(chunk);
    source_close(&s);
    return status;
}
