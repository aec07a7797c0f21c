/* Volume files: every type, byte order and affine; damaged files of every kind; raw sidecars; label tables; Otsu. */
#include "check.h"
#include "label_table.h"
#include "phantom.h"
#include "volume_internal.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>
#include <zlib.h>

static char folder[64];

static const char *path_of(const char *name) {
    static char path[256];
    snprintf(path, sizeof path, "%s/%s", folder, name);
    return path;
}

static void write_file(const char *name, const void *bytes, size_t size) {
    FILE *f = fopen(path_of(name), "wb");
    if (!CHECK(f)) return;
    CHECK_EQ(fwrite(bytes, 1, size, f), size);
    fclose(f);
}

/* ---- writing NIfTI by hand --------------------------------------------------------------------------------------- */

typedef struct image {
    uint8_t *bytes;
    size_t size, header;
    bool big;
    int version;
} image;

static void put(const image *m, size_t at, uint64_t value, int width) {
    for (int i = 0; i < width; i++) m->bytes[at + (size_t)(m->big ? width - 1 - i : i)] = (uint8_t)(value >> (8 * i));
}
static void put_float(const image *m, size_t at, float value) {
    uint32_t bits;
    memcpy(&bits, &value, sizeof bits);
    put(m, at, bits, 4);
}
static void put_double(const image *m, size_t at, double value) {
    uint64_t bits;
    memcpy(&bits, &value, sizeof bits);
    put(m, at, bits, 8);
}
static void put_real(const image *m, size_t at1, size_t at2, double value) {
    if (m->version == 1)
        put_float(m, at1, (float)value);
    else
        put_double(m, at2, value);
}
static void put_dim(const image *m, int i, int64_t value) {
    if (m->version == 1)
        put(m, 40 + 2 * (size_t)i, (uint64_t)value, 2);
    else
        put(m, 16 + 8 * (size_t)i, (uint64_t)value, 8);
}
static void put_pixdim(const image *m, int i, double value) {
    put_real(m, 76 + 4 * (size_t)i, 104 + 8 * (size_t)i, value);
}
static void put_offset(const image *m, double value) {
    if (m->version == 1)
        put_float(m, 108, (float)value);
    else
        put(m, 168, (uint64_t)(int64_t)value, 8);
}
static void put_scaling(const image *m, double slope, double inter) {
    put_real(m, 112, 176, slope);
    put_real(m, 116, 184, inter);
}
static void put_codes(const image *m, int qform, int sform) {
    if (m->version == 1)
        put(m, 252, (uint64_t)qform, 2), put(m, 254, (uint64_t)sform, 2);
    else
        put(m, 344, (uint64_t)qform, 4), put(m, 348, (uint64_t)sform, 4);
}
static void put_type(const image *m, int datatype, int bits) {
    size_t at = m->version == 1 ? 70 : 12;
    put(m, at, (uint64_t)datatype, 2);
    put(m, at + 2, (uint64_t)bits, 2);
}

static image new_image(int version, bool big, const int dims[3], int datatype, int width) {
    image m = {.big = big, .version = version, .header = version == 1 ? 352 : 544};
    m.size = m.header + (size_t)dims[0] * (size_t)dims[1] * (size_t)dims[2] * (size_t)width;
    m.bytes = calloc(m.size, 1);
    put(&m, 0, version == 1 ? 348 : 540, 4);
    memcpy(m.bytes + (version == 1 ? 344 : 4), version == 1 ? "n+1" : "n+2\0\r\n\032\n", version == 1 ? 4 : 8);
    put_dim(&m, 0, 3);
    for (int k = 0; k < 3; k++) put_dim(&m, k + 1, dims[k]), put_pixdim(&m, k + 1, 0.5 + 0.25 * k);
    put_pixdim(&m, 0, 1);
    put_offset(&m, (double)m.header);
    put_type(&m, datatype, width * 8);
    return m;
}

static void put_voxel(const image *m, size_t i, int datatype, int width, double value) {
    size_t at = m->header + i * (size_t)width;
    if (datatype == 16)
        put_float(m, at, (float)value);
    else if (datatype == 64)
        put_double(m, at, value);
    else
        put(m, at, value < 0 ? (uint64_t)(int64_t)value : (uint64_t)value, width);
}

static lathe_status parse(lathe_volume **v, const image *m, lathe_error *err) {
    err->text[0] = 0;
    lathe_status status = lathe__volume_nifti_parse(v, m->bytes, m->size, err);
    CHECK(!status || err->text[0]);
    return status;
}

static uint8_t *pack(const uint8_t *bytes, size_t size, size_t *packed) {
    z_stream z = {0};
    CHECK_EQ(deflateInit2(&z, 6, Z_DEFLATED, 31, 8, Z_DEFAULT_STRATEGY), Z_OK);
    size_t room = deflateBound(&z, size) + 64;
    uint8_t *out = malloc(room);
    z.next_in = (Bytef *)(uintptr_t)bytes, z.avail_in = (uInt)size, z.next_out = out, z.avail_out = (uInt)room;
    CHECK_EQ(deflate(&z, Z_FINISH), Z_STREAM_END);
    *packed = z.total_out;
    deflateEnd(&z);
    return out;
}

/* ---- good files -------------------------------------------------------------------------------------------------- */

static const struct {
    int type, width;
    double low, high;
} TYPES[] = {{2, 1, 0, 255},
             {256, 1, -128, 127},
             {4, 2, -32768, 32767},
             {512, 2, 0, 65535},
             {8, 4, -2147483648.0, 2147483647},
             {768, 4, 0, 4294967295.0},
             {16, 4, -1.5e30, 2.5},
             {64, 8, -1.25e-3, 3e38},
             {1024, 8, -9e15, 9e15},
             {1280, 8, 0, 1.8e19}};

static void check_type(size_t t, int version, bool big, bool scaled) {
    static const int dims[3] = {5, 4, 3};
    image m = new_image(version, big, dims, TYPES[t].type, TYPES[t].width);
    double slope = scaled ? 0.5 : 0, inter = scaled ? -3 : 7; /* slope 0: not scaled, whatever inter says */
    put_scaling(&m, slope, inter);
    for (size_t i = 0; i < 60; i++) {
        double value = i == 17 ? TYPES[t].low : i == 42 ? TYPES[t].high : (double)(i % 7);
        put_voxel(&m, i, TYPES[t].type, TYPES[t].width, value);
    }
    lathe_volume *v = NULL;
    lathe_error err;
    if (CHECK_EQ(parse(&v, &m, &err), LATHE_OK)) {
        bool same = true;
        for (size_t i = 0; i < 60; i++) {
            double value = i == 17 ? TYPES[t].low : i == 42 ? TYPES[t].high : (double)(i % 7);
            if (TYPES[t].type == 16) value = (float)value;
            same = same && v->values[i] == (float)(scaled ? value * slope + inter : value);
        }
        CHECK(same);
        double low = fmin(0, TYPES[t].low), high = fmax(6, TYPES[t].high);
        CHECK(v->min == (float)(scaled ? low * slope + inter : low) &&
              v->max == (float)(scaled ? high * slope + inter : high));
        CHECK_EQ(v->integer, TYPES[t].width < 4 && !scaled);
        CHECK(v->dims[0] == 5 && v->dims[1] == 4 && v->dims[2] == 3);
        CHECK(v->spacing[0] == 0.5 && v->spacing[1] == 0.75 && v->spacing[2] == 1.0);
    } else {
        fprintf(stderr, "  type %d version %d: %s\n", TYPES[t].type, version, err.text);
    }
    lathe_volume_close(&v);
    free(m.bytes);
}

static void test_types(void) {
    for (size_t t = 0; t < sizeof TYPES / sizeof *TYPES; t++)
        for (int i = 0; i < 8; i++) check_type(t, 1 + (i & 1), i & 2, i & 4);
}

static void check_affine(int version, int qform, int sform, const double expected[3][4]) {
    static const int dims[3] = {2, 2, 2};
    image m = new_image(version, version == 2, dims, 2, 1);
    put_codes(&m, qform, sform);
    /* quaternion (0, 0, 1): half a turn about z; qfac -1 mirrors z */
    put_pixdim(&m, 0, -1);
    put_real(&m, 264, 368, 1.0);
    put_real(&m, 268, 376, 10), put_real(&m, 272, 384, 20), put_real(&m, 276, 392, 30);
    static const double sform_rows[3][4] = {{0, 2, 0, -4}, {3, 0, 0, 5}, {0, 0, 1.5, 6}};
    for (size_t i = 0; i < 3; i++)
        for (size_t j = 0; j < 4; j++) put_real(&m, 280 + 16 * i + 4 * j, 400 + 32 * i + 8 * j, sform_rows[i][j]);
    lathe_volume *v = NULL;
    lathe_error err;
    if (CHECK_EQ(parse(&v, &m, &err), LATHE_OK)) {
        for (int i = 0; i < 3; i++)
            for (int j = 0; j < 4; j++) CHECK(fabs(v->affine[i][j] - expected[i][j]) < 1e-6);
        for (int j = 0; j < 3; j++)
            CHECK(fabs(v->spacing[j] - sqrt(pow(expected[0][j], 2) + pow(expected[1][j], 2) + pow(expected[2][j], 2))) <
                  1e-6);
    }
    lathe_volume_close(&v);
    free(m.bytes);
}

static void test_affines(void) {
    static const double sform[3][4] = {{0, 2, 0, -4}, {3, 0, 0, 5}, {0, 0, 1.5, 6}};
    static const double qform[3][4] = {{-0.5, 0, 0, 10}, {0, -0.75, 0, 20}, {0, 0, -1, 30}};
    static const double pixdim[3][4] = {{0.5, 0, 0, 0}, {0, 0.75, 0, 0}, {0, 0, 1, 0}};
    for (int version = 1; version <= 2; version++) {
        check_affine(version, 1, 2, sform);
        check_affine(version, 0, 1, sform);
        check_affine(version, 1, 0, qform);
        check_affine(version, 0, 0, pixdim);
    }
}

static void test_units(void) {
    static const int dims[3] = {2, 2, 2};
    image m = new_image(1, false, dims, 2, 1);
    lathe_volume *v = NULL;
    lathe_error err;
    m.bytes[123] = 3; /* micrometres */
    CHECK_EQ(parse(&v, &m, &err), LATHE_OK);
    CHECK(fabs(v->spacing[0] - 0.0005) < 1e-12 && fabs(v->affine[2][2] - 0.001) < 1e-12);
    lathe_volume_close(&v);
    free(m.bytes);
}

static void test_frames(void) {
    static const int dims[3] = {2, 3, 4};
    image m = new_image(2, false, dims, 4, 2);
    lathe_volume *v = NULL;
    lathe_error err;
    put_dim(&m, 0, 5), put_dim(&m, 4, 1), put_dim(&m, 5, 1);
    CHECK_EQ(parse(&v, &m, &err), LATHE_OK);
    lathe_volume_close(&v);
    put_dim(&m, 4, 120);
    CHECK_EQ(parse(&v, &m, &err), LATHE_ERR_UNSUPPORTED);
    CHECK(strstr(err.text, "120 frames"));
    put_dim(&m, 4, 1), put_dim(&m, 5, 3);
    CHECK_EQ(parse(&v, &m, &err), LATHE_ERR_UNSUPPORTED);
    put_dim(&m, 5, INT64_MAX);
    CHECK_EQ(parse(&v, &m, &err), LATHE_ERR_UNSUPPORTED);
    put_dim(&m, 0, 2), put_dim(&m, 3, -7);
    m.size = m.header + 12;
    CHECK_EQ(parse(&v, &m, &err), LATHE_OK); /* two dimensions: one slice; what is beyond dim[0] does not count */
    CHECK_EQ(v->dims[2], 1);
    lathe_volume_close(&v);
    free(m.bytes);
}

/* Header extensions lie between header and voxels; NaN for the slope is how nibabel says "not scaled". */
static void test_extension(void) {
    static const int dims[3] = {3, 3, 3};
    image m = new_image(1, true, dims, 2, 1);
    m.size += 160000;
    m.bytes = realloc(m.bytes, m.size);
    memset(m.bytes + 352, 0xee, 160000);
    memset(m.bytes + 160352, 9, 27);
    put_offset(&m, 160352);
    put_scaling(&m, NAN, NAN);
    lathe_volume *v = NULL;
    lathe_error err;
    CHECK_EQ(parse(&v, &m, &err), LATHE_OK);
    CHECK(v->min == 9 && v->max == 9 && v->integer);
    lathe_volume_close(&v);
    put_scaling(&m, INFINITY, 0);
    CHECK_EQ(parse(&v, &m, &err), LATHE_ERR_FORMAT);
    put_scaling(&m, 1, NAN);
    CHECK_EQ(parse(&v, &m, &err), LATHE_ERR_FORMAT);
    CHECK(strstr(err.text, "scl_"));
    free(m.bytes);
}

/* ---- bad files --------------------------------------------------------------------------------------------------- */

static image small_image(int version) {
    static const int dims[3] = {7, 5, 3};
    image m = new_image(version, version == 1, dims, 4, 2);
    for (size_t i = 0; i < 105; i++) put_voxel(&m, i, 4, 2, (double)(i * 37 % 101));
    return m;
}

static void test_truncated(void) {
    for (int version = 1; version <= 2; version++) {
        image m = small_image(version);
        size_t packed_size;
        uint8_t *packed = pack(m.bytes, m.size, &packed_size);
        lathe_volume *v = NULL;
        lathe_error err;
        for (size_t n = 0; n < m.size; n++) {
            uint8_t *copy = malloc(n + 1); /* so that a sanitizer sees reads beyond the end */
            memcpy(copy, m.bytes, n);
            image cut = {.bytes = copy, .size = n};
            CHECK_EQ(parse(&v, &cut, &err), LATHE_ERR_FORMAT);
            free(copy);
        }
        for (size_t n = 0; n < packed_size; n++) {
            image cut = {.bytes = packed, .size = n};
            CHECK_EQ(parse(&v, &cut, &err), LATHE_ERR_FORMAT);
        }
        image whole = {.bytes = packed, .size = packed_size};
        CHECK_EQ(parse(&v, &whole, &err), LATHE_OK);
        CHECK(!v || (v->min == 0 && v->max == 100));
        lathe_volume_close(&v);
        free(packed);
        free(m.bytes);
    }
}

/* Every byte of the header and of the gzip file changed: an error or a volume, and no sanitizer report. */
static void test_flipped(void) {
    image m = small_image(1);
    size_t packed_size;
    uint8_t *packed = pack(m.bytes, m.size, &packed_size);
    lathe_volume *v = NULL, *good = NULL;
    lathe_error err;
    CHECK_EQ(parse(&good, &m, &err), LATHE_OK);
    for (size_t i = 0; i < 352 * 8; i++) {
        m.bytes[i / 8] ^= (uint8_t)(1 << i % 8);
        (void)parse(&v, &m, &err);
        lathe_volume_close(&v);
        m.bytes[i / 8] ^= (uint8_t)(1 << i % 8);
    }
    for (size_t i = 10; i < packed_size; i++) { /* gzip's own header has bytes that mean nothing */
        packed[i] ^= 0x10;
        image bad = {.bytes = packed, .size = packed_size};
        /* Padding bits after the last code mean nothing: then the voxels are the same. */
        if (parse(&v, &bad, &err))
            CHECK(!v);
        else
            CHECK(!memcmp(v->values, good->values, 105 * sizeof(float)));
        lathe_volume_close(&v);
        packed[i] ^= 0x10;
    }
    lathe_volume_close(&good);
    free(packed);
    free(m.bytes);
}

static void test_trailing(void) {
    image m = small_image(2), more = m;
    more.bytes = calloc(m.size + 1, 1);
    more.size = m.size + 1;
    memcpy(more.bytes, m.bytes, m.size);
    lathe_volume *v = NULL;
    lathe_error err;
    CHECK_EQ(parse(&v, &more, &err), LATHE_ERR_FORMAT);
    CHECK(strstr(err.text, "after the last voxel"));
    size_t half = m.size / 2, n1, n2;
    uint8_t *first = pack(m.bytes, half, &n1), *second = pack(m.bytes + half, m.size - half, &n2);
    image two = {.bytes = malloc(n1 + n2 + 5), .size = n1 + n2};
    memcpy(two.bytes, first, n1);
    memcpy(two.bytes + n1, second, n2);
    memcpy(two.bytes + n1 + n2, "hello", 5);
    CHECK_EQ(parse(&v, &two, &err), LATHE_OK); /* two gzip members */
    lathe_volume_close(&v);
    two.size += 5;
    CHECK_EQ(parse(&v, &two, &err), LATHE_ERR_FORMAT);
    CHECK(strstr(err.text, "5 bytes of garbage"));
    free(two.bytes), free(first), free(second), free(more.bytes), free(m.bytes);
}

static void test_hostile_headers(void) {
    static const struct {
        int dim;
        int64_t value;
        lathe_status status;
    } dims[] = {{0, 0, LATHE_ERR_FORMAT},   {0, 8, LATHE_ERR_FORMAT},  {0, -1, LATHE_ERR_FORMAT},
                {1, 0, LATHE_ERR_FORMAT},   {2, -3, LATHE_ERR_FORMAT}, {3, 32767, LATHE_ERR_LIMIT},
                {3, 4, LATHE_ERR_FORMAT},   {3, 2, LATHE_ERR_FORMAT},  {1, 4097, LATHE_ERR_LIMIT},
                {3, 4096, LATHE_ERR_FORMAT}};
    lathe_volume *v = NULL;
    lathe_error err;
    for (int version = 1; version <= 2; version++) {
        for (size_t i = 0; i < sizeof dims / sizeof *dims; i++) {
            image m = small_image(version);
            put_dim(&m, dims[i].dim, dims[i].value);
            CHECK_EQ(parse(&v, &m, &err), dims[i].status);
            free(m.bytes);
        }
        static const double offsets[] = {0, 347, -1, 352.5, 1e30, NAN, INFINITY};
        for (size_t i = 0; i < 4; i++) {
            image m = small_image(version);
            put_offset(&m, version == 1 ? offsets[i] : i == 3 ? 9e15 : offsets[i]);
            CHECK_EQ(parse(&v, &m, &err), LATHE_ERR_FORMAT);
            if (version == 1) put_offset(&m, offsets[i + 3]);
            CHECK_EQ(parse(&v, &m, &err), LATHE_ERR_FORMAT);
            free(m.bytes);
        }
        static const struct {
            int type, bits;
            lathe_status status;
        } types[] = {{0, 8, LATHE_ERR_FORMAT},           {1, 1, LATHE_ERR_FORMAT},
                     {32, 64, LATHE_ERR_UNSUPPORTED},    {128, 24, LATHE_ERR_UNSUPPORTED},
                     {1536, 128, LATHE_ERR_UNSUPPORTED}, {4, 8, LATHE_ERR_FORMAT},
                     {-1, 16, LATHE_ERR_FORMAT},         {12345, 16, LATHE_ERR_FORMAT}};
        for (size_t i = 0; i < sizeof types / sizeof *types; i++) {
            image m = small_image(version);
            put_type(&m, types[i].type, types[i].bits);
            CHECK(parse(&v, &m, &err) < 0);
            if (types[i].status == LATHE_ERR_UNSUPPORTED) CHECK_EQ(parse(&v, &m, &err), LATHE_ERR_UNSUPPORTED);
            free(m.bytes);
        }
        image m = small_image(version);
        put_codes(&m, 0, 1); /* an sform of zeros */
        CHECK_EQ(parse(&v, &m, &err), LATHE_ERR_FORMAT);
        CHECK(strstr(err.text, "sform"));
        put_codes(&m, 0, 0);
        m.bytes[version == 1 ? 345 : 5] = 'i';
        memcpy(m.bytes + (version == 1 ? 344 : 4), version == 1 ? "ni1" : "ni2", 3);
        CHECK_EQ(parse(&v, &m, &err), LATHE_ERR_UNSUPPORTED);
        free(m.bytes);
    }
}

/* A header that promises 2^31 voxels, and gigabytes of zeros in a small file. */
static void test_bombs(void) {
    static const int dims[3] = {1, 1, 1};
    lathe_volume *v = NULL;
    lathe_error err;
    image m = new_image(1, false, dims, 64, 8);
    for (int k = 1; k <= 3; k++) put_dim(&m, k, k == 3 ? 128 : 4096);
    size_t packed_size;
    uint8_t *packed = pack(m.bytes, m.size, &packed_size);
    image small = {.bytes = packed, .size = packed_size};
    CHECK_EQ(parse(&v, &m, &err), LATHE_ERR_FORMAT);
    CHECK_EQ(parse(&v, &small, &err), LATHE_ERR_FORMAT);
    CHECK(strstr(err.text, "promises"));
    put_dim(&m, 3, 129);
    CHECK_EQ(parse(&v, &m, &err), LATHE_ERR_LIMIT);
    free(packed);
    for (int k = 1; k <= 3; k++) put_dim(&m, k, 2);
    m.bytes = realloc(m.bytes, 20 << 20);
    memset(m.bytes + 352, 0, (20 << 20) - 352);
    packed = pack(m.bytes, 20 << 20, &packed_size);
    image bomb = {.bytes = packed, .size = packed_size};
    CHECK_EQ(parse(&v, &bomb, &err), LATHE_ERR_FORMAT); /* stops after the voxels */
    free(packed);
    free(m.bytes);
}

static void test_not_finite(void) {
    static const int dims[3] = {9, 5, 4};
    static const double values[] = {NAN, INFINITY, -INFINITY, 1e39};
    for (size_t i = 0; i < 4; i++)
        for (int scaled = 0; scaled < 2; scaled++) {
            image m = new_image(2, false, dims, 64, 8);
            put_voxel(&m, (3 * 5 + 2) * 9 + 7, 64, 8, values[i]);
            put_voxel(&m, (3 * 5 + 4) * 9 + 8, 64, 8, NAN);
            if (scaled) put_scaling(&m, 2, 1);
            lathe_volume *v = NULL;
            lathe_error err;
            CHECK_EQ(parse(&v, &m, &err), LATHE_ERR_FORMAT);
            CHECK(strstr(err.text, "voxel (7, 2, 3)"));
            free(m.bytes);
        }
    image m = new_image(2, true, dims, 4, 2); /* whole numbers, but scaled beyond every float */
    put_voxel(&m, 11, 4, 2, 300);
    put_scaling(&m, 1e37, 0);
    lathe_volume *v = NULL;
    lathe_error err;
    CHECK_EQ(parse(&v, &m, &err), LATHE_ERR_FORMAT);
    CHECK(strstr(err.text, "voxel (2, 1, 0)"));
    free(m.bytes);
}

/* ---- files ------------------------------------------------------------------------------------------------------- */

static void test_open_nifti(void) {
    image m = small_image(1);
    size_t packed_size;
    uint8_t *packed = pack(m.bytes, m.size, &packed_size);
    lathe_volume *v = NULL;
    lathe_error err;
    write_file("a.nii", m.bytes, m.size);
    write_file("a.nii.gz", packed, packed_size);
    write_file("cut.nii", m.bytes, m.size - 1);
    write_file("empty.nii", "", 0);
    write_file("a.mha", m.bytes, m.size);
    CHECK_EQ(lathe_volume_open(&v, path_of("a.nii"), &err), LATHE_OK);
    lathe_volume_close(&v);
    CHECK(!v);
    CHECK_EQ(lathe_volume_open(&v, path_of("a.nii.gz"), &err), LATHE_OK);
    lathe_volume_close(&v);
    CHECK_EQ(lathe_volume_open(&v, path_of("cut.nii"), &err), LATHE_ERR_FORMAT);
    CHECK(strstr(err.text, "cut.nii") && strstr(err.text, "truncated"));
    CHECK_EQ(lathe_volume_open(&v, path_of("empty.nii"), &err), LATHE_ERR_FORMAT);
    CHECK_EQ(lathe_volume_open(&v, path_of("none.nii"), &err), LATHE_ERR_IO);
    CHECK(strstr(err.text, "No such file"));
    CHECK_EQ(lathe_volume_open(&v, path_of("a.mha"), &err), LATHE_ERR_UNSUPPORTED);
    CHECK_EQ(lathe_volume_open(&v, path_of("a.mha"), NULL), LATHE_ERR_UNSUPPORTED);
    CHECK(!mkdir(path_of("folder.nii"), 0700));
    CHECK_EQ(lathe_volume_open(&v, path_of("folder.nii"), &err), LATHE_ERR_IO);
    CHECK(!mkfifo(path_of("pipe.nii"), 0600));
    CHECK_EQ(lathe_volume_open(&v, path_of("pipe.nii"), &err), LATHE_ERR_IO);
    lathe_volume_close(NULL);
    free(packed);
    free(m.bytes);
}

static void check_raw(const char *type, const void *data, size_t size, const float expected[8]) {
    char json[256];
    lathe_volume *v = NULL;
    lathe_error err;
    int n = snprintf(
        json, sizeof json,
        "{\"file\": \"d.raw\", \"dims\": [2, 2, 2], \"dtype\": \"%s\", \"spacing\": [0.5, 1, 2], \"by\": {}}", type);
    write_file("d.json", json, (size_t)n);
    write_file("d.raw", data, size);
    if (CHECK_EQ(lathe_volume_open(&v, path_of("d.json"), &err), LATHE_OK)) {
        CHECK(!memcmp(v->values, expected, 8 * sizeof *expected));
        CHECK(v->affine[0][0] == 0.5 && v->affine[1][1] == 1 && v->affine[2][2] == 2 && v->affine[0][3] == 0);
    }
    lathe_volume_close(&v);
    write_file("d.raw", data, size - 1);
    CHECK_EQ(lathe_volume_open(&v, path_of("d.json"), &err), LATHE_ERR_FORMAT);
    char want[32], have[32];
    snprintf(want, sizeof want, "make %zu", size);
    snprintf(have, sizeof have, "%zu bytes", size - 1);
    CHECK(strstr(err.text, want) && strstr(err.text, have));
}

static void test_raw_types(void) {
    static const uint8_t u8[8] = {0, 1, 2, 3, 4, 250, 254, 255};
    static const uint8_t i16[16] = {0, 0, 1, 0, 0xff, 0xff, 0, 0x80, 0xff, 0x7f, 2, 1, 0, 1, 9, 0};
    static const uint8_t f32[32] = {0, 0, 0x80, 0x3f, 0, 0, 0, 0xc0, 0, 0, 0, 0x3f};
    check_raw("uint8", u8, 8, (const float[8]){0, 1, 2, 3, 4, 250, 254, 255});
    check_raw("int16", i16, 16, (const float[8]){0, 1, -1, -32768, 32767, 258, 256, 9});
    check_raw("uint16", i16, 16, (const float[8]){0, 1, 65535, 32768, 32767, 258, 256, 9});
    check_raw("float32", f32, 32, (const float[8]){1, -2, 0.5f});
}

static void test_bad_sidecars(void) {
    static const struct {
        const char *json;
        lathe_status status;
    } cases[] = {
        {"", LATHE_ERR_FORMAT},
        {"{", LATHE_ERR_FORMAT},
        {"[]", LATHE_ERR_FORMAT},
        {"{\"file\":1,\"dims\":[1,1,1],\"dtype\":\"uint8\",\"spacing\":[1,1,1]}", LATHE_ERR_FORMAT},
        {"{\"file\":\"\",\"dims\":[1,1,1],\"dtype\":\"uint8\",\"spacing\":[1,1,1]}", LATHE_ERR_FORMAT},
        {"{\"file\":\"/etc/passwd\",\"dims\":[1,1,1],\"dtype\":\"uint8\",\"spacing\":[1,1,1]}", LATHE_ERR_FORMAT},
        {"{\"file\":\"../a\",\"dims\":[1,1,1],\"dtype\":\"uint8\",\"spacing\":[1,1,1]}", LATHE_ERR_FORMAT},
        {"{\"file\":\"b/../../a\",\"dims\":[1,1,1],\"dtype\":\"uint8\",\"spacing\":[1,1,1]}", LATHE_ERR_FORMAT},
        {"{\"file\":\"b/..\",\"dims\":[1,1,1],\"dtype\":\"uint8\",\"spacing\":[1,1,1]}", LATHE_ERR_FORMAT},
        {"{\"file\":\"a\",\"file\":\"b\",\"dims\":[1,1,1],\"dtype\":\"uint8\",\"spacing\":[1,1,1]}", LATHE_ERR_FORMAT},
        {"{\"file\":\"a\",\"dims\":[1,1],\"dtype\":\"uint8\",\"spacing\":[1,1,1]}", LATHE_ERR_FORMAT},
        {"{\"file\":\"a\",\"dims\":[1,1,0],\"dtype\":\"uint8\",\"spacing\":[1,1,1]}", LATHE_ERR_FORMAT},
        {"{\"file\":\"a\",\"dims\":[1,1.5,1],\"dtype\":\"uint8\",\"spacing\":[1,1,1]}", LATHE_ERR_FORMAT},
        {"{\"file\":\"a\",\"dims\":[1,-1,1],\"dtype\":\"uint8\",\"spacing\":[1,1,1]}", LATHE_ERR_FORMAT},
        {"{\"file\":\"a\",\"dims\":[1,1,9000],\"dtype\":\"uint8\",\"spacing\":[1,1,1]}", LATHE_ERR_LIMIT},
        {"{\"file\":\"a\",\"dims\":[4096,4096,4096],\"dtype\":\"uint8\",\"spacing\":[1,1,1]}", LATHE_ERR_LIMIT},
        {"{\"file\":\"a\",\"dims\":[1,1,1],\"dtype\":\"int8\",\"spacing\":[1,1,1]}", LATHE_ERR_FORMAT},
        {"{\"file\":\"a\",\"dims\":[1,1,1],\"dtype\":8,\"spacing\":[1,1,1]}", LATHE_ERR_FORMAT},
        {"{\"file\":\"a\",\"dims\":[1,1,1],\"spacing\":[1,1,1]}", LATHE_ERR_FORMAT},
        {"{\"file\":\"a\",\"dims\":[1,1,1],\"dtype\":\"uint8\",\"spacing\":[1,0,1]}", LATHE_ERR_FORMAT},
        {"{\"file\":\"a\",\"dims\":[1,1,1],\"dtype\":\"uint8\",\"spacing\":[1,\"1\",1]}", LATHE_ERR_FORMAT},
        {"{\"file\":\"a\",\"dims\":[1,1,1],\"dtype\":\"uint8\",\"spacing\":[1,1]}", LATHE_ERR_FORMAT},
        {"{\"file\":\"a\",\"dims\":[1,1,1],\"dtype\":\"uint8\"}", LATHE_ERR_FORMAT},
        {"{\"file\":\"missing\",\"dims\":[1,1,1],\"dtype\":\"uint8\",\"spacing\":[1,1,1]}", LATHE_ERR_IO},
        {"{\"file\":\".\",\"dims\":[1,1,1],\"dtype\":\"uint8\",\"spacing\":[1,1,1]}", LATHE_ERR_IO},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        lathe_volume *v = NULL;
        lathe_error err = {""};
        write_file("bad.json", cases[i].json, strlen(cases[i].json));
        if (!CHECK_EQ(lathe_volume_open(&v, path_of("bad.json"), &err), cases[i].status))
            fprintf(stderr, "  %s: %s\n", cases[i].json, err.text);
        CHECK(err.text[0] && !v);
    }
    static const uint8_t nan_bytes[12] = {0, 0, 0, 0, 0, 0, 0xc0, 0x7f, 0, 0, 0, 0};
    static const char json[] = "{\"file\":\"n.raw\",\"dims\":[1,3,1],\"dtype\":\"float32\",\"spacing\":[1,1,1]}";
    lathe_volume *v = NULL;
    lathe_error err;
    write_file("n.raw", nan_bytes, sizeof nan_bytes);
    write_file("n.json", json, sizeof json - 1);
    CHECK_EQ(lathe_volume_open(&v, path_of("n.json"), &err), LATHE_ERR_FORMAT);
    CHECK(strstr(err.text, "voxel (0, 1, 0)"));
}

/* ---- volumes ----------------------------------------------------------------------------------------------------- */

static void test_wrap(void) {
    const int32_t dims[3] = {5, 1, 1}, none[3] = {5, 0, 1};
    const double spacing[3] = {1, 2, 3}, flat[3] = {1, 0, 1};
    float values[5] = {1, 2, 3, -4, 16777216.0f};
    lathe_volume *v = NULL;
    lathe_error err;
    CHECK_EQ(lathe_volume_wrap(&v, dims, spacing, values, &err), LATHE_OK);
    CHECK(!v->integer && v->min == -4 && v->max == 16777216.0f &&
          v->affine[2][2] == 3); /* 2^24: its neighbour is lost */
    lathe_volume_close(&v);
    for (int i = 0; i < 5; i++) {
        values[4] = 7;
        float kept = values[i];
        values[i] = 2.5f;
        CHECK_EQ(lathe_volume_wrap(&v, dims, spacing, values, &err), LATHE_OK);
        CHECK(!v->integer);
        lathe_volume_close(&v);
        values[i] = NAN;
        CHECK_EQ(lathe_volume_wrap(&v, dims, spacing, values, &err), LATHE_ERR_FORMAT);
        values[i] = kept;
    }
    CHECK_EQ(lathe_volume_wrap(&v, none, spacing, values, &err), LATHE_ERR_FORMAT);
    CHECK_EQ(lathe_volume_wrap(&v, dims, flat, values, &err), LATHE_ERR_RANGE);
}

static void test_otsu(void) {
    lathe_volume *v = phantom_full(10, 10, 10, PHANTOM_LABEL);
    CHECK(lathe_volume_otsu(v) == 1);
    for (int i = 0; i < 1000; i++) v->values[i] = (float)(i < 700 ? 10 + i % 3 : 90 + i % 5);
    v->min = 10, v->max = 94;
    double t = lathe_volume_otsu(v);
    CHECK(t > 45 && t < 57); /* the middle of the gap between 12 and 90 */
    v->values[0] = -3e38f, v->min = -3e38f;
    v->values[1] = 3e38f, v->max = 3e38f;
    t = lathe_volume_otsu(v);
    CHECK(t > v->min && t < v->max);
    lathe_volume_close(&v);
}

/* ---- label tables ------------------------------------------------------------------------------------------------ */

static void check_name(const lathe_label_table *t, int64_t label, const char *name) {
    lathe_label found;
    lathe_label_table_find(t, label, &found);
    if (!CHECK(!strcmp(found.name, name)))
        fprintf(stderr, "  label %lld is %s, not %s\n", (long long)label, found.name, name);
}

static void test_table_lines(void) {
    static const char text[] =
        "\xef\xbb\xbf# comment\n1 Precentral_L 2001\r\n2 Precentral_R 2002\n\n"
        "10  Left-Thalamus-Proper  0 118 14 0\n11\tGrey matter 4\n12 Two words\n"
        "x y\n13\n-4 Below\n1 Again\n14 Same\n15 Same\n16 label-99\n17 b\xc3\xa9\xff\x01z\n18 Black 0 0 0 0\n"
        "99999999999999999999 Far\n19 last";
    lathe_label_table *t = NULL;
    lathe_label label;
    lathe_error err;
    CHECK_EQ(lathe_label_table_parse(&t, text, sizeof text - 1, NULL, &err), LATHE_OK);
    CHECK_EQ(lathe_label_table_malformed(t), 4);
    CHECK_EQ(lathe_label_table_count(t), 12);
    CHECK_EQ(lathe_label_table_at(t, 0)->label, -4);
    CHECK(!lathe_label_table_at(t, 12));
    check_name(t, 1, "Precentral_L");
    check_name(t, 2, "Precentral_R");
    check_name(t, 10, "Left-Thalamus-Proper");
    check_name(t, 11, "Grey matter 4");
    check_name(t, 12, "Two words");
    check_name(t, -4, "Below");
    check_name(t, 14, "Same");
    check_name(t, 15, "Same-15");
    check_name(t, 16, "label-16");
    check_name(t, 17, "b\xc3\xa9__z");
    check_name(t, 19, "last");
    check_name(t, 99, "label-99");
    CHECK(lathe_label_table_find(t, 10, &label));
    CHECK(label.rgb[0] == 0 && label.rgb[1] == 118 && label.rgb[2] == 14);
    CHECK(lathe_label_table_find(t, 18, &label) && label.rgb[0] + label.rgb[1] + label.rgb[2] > 100);
    CHECK(!lathe_label_table_find(t, 1000, &label));
    lathe_label_table_close(&t);
    CHECK(!t);
    lathe_label_table_close(&t);
}

static void test_table_names_unique(void) {
    char *text = malloc(1 << 20);
    size_t n = 0;
    /* Long equal names with a character of two bytes at the cut, and names that look like the ones made from them. */
    for (int i = 0; i < 300; i++) {
        n += (size_t)sprintf(text + n, "%d ", i);
        if (i % 3 == 0)
            n += (size_t)sprintf(text + n, "a");
        else if (i % 3 == 1)
            n += (size_t)sprintf(text + n, "a-%d", i - 1 + i % 2 * 3);
        else
            for (int k = 0; k < 70; k++) n += (size_t)sprintf(text + n, "%s", k ? "\xc3\xa9" : i % 2 ? "x" : "");
        text[n++] = '\n';
    }
    lathe_label_table *t = NULL;
    CHECK_EQ(lathe_label_table_parse(&t, text, n, NULL, NULL), LATHE_OK);
    CHECK_EQ(lathe_label_table_count(t), 300);
    int equal = 0;
    for (size_t i = 0; i < 300; i++)
        for (size_t j = 0; j < i; j++)
            equal += !strcmp(lathe_label_table_at(t, i)->name, lathe_label_table_at(t, j)->name);
    CHECK_EQ(equal, 0);
    lathe_label_table_close(&t);
    uint32_t seed = 5;
    for (size_t i = 0; i < 50000; i++) text[i] = "0123 \t\n\xc3\xa9#-a\xff"[phantom_random(&seed) % 14];
    CHECK_EQ(lathe_label_table_parse(&t, text, 50000, NULL, NULL), LATHE_OK);
    lathe_label_table_close(&t);
    CHECK_EQ(lathe_label_table_parse(&t, text, (size_t)5 << 20, NULL, NULL), LATHE_ERR_LIMIT);
    free(text);
}

static void test_table_files(void) {
    uint8_t lut[768];
    lathe_label_table *t = NULL;
    lathe_label label, other;
    for (int i = 0; i < 768; i++) lut[i] = (uint8_t)(i / 256 * 50 + i % 100);
    write_file("p.nii.txt", "1 One\n2 Two\n", 12);
    write_file("p.nii.lut", lut, sizeof lut);
    write_file("q.txt", "1 Uno\n", 6);
    write_file("q.lut", lut, 100); /* not a palette */
    CHECK_EQ(lathe_label_table_open(&t, path_of("p.nii.gz"), NULL), LATHE_OK);
    CHECK(lathe_label_table_find(t, 2, &label) && !strcmp(label.name, "Two"));
    CHECK(label.rgb[0] == lut[2] && label.rgb[1] == lut[258] && label.rgb[2] == lut[514]);
    lathe_label_table_close(&t);
    CHECK_EQ(lathe_label_table_open(&t, path_of("q.nii"), NULL), LATHE_OK);
    CHECK(lathe_label_table_find(t, 1, &label) && !strcmp(label.name, "Uno"));
    CHECK(!lathe_label_table_find(t, 2, &other) && !strcmp(other.name, "label-2"));
    CHECK(memcmp(label.rgb, other.rgb, 3));
    lathe_label_table_close(&t);
    CHECK_EQ(lathe_label_table_open(&t, path_of("none.json"), NULL), LATHE_OK);
    CHECK_EQ(lathe_label_table_count(t), 0);
    lathe_label_table_close(&t);
}

/* ---- real files, where they are installed ------------------------------------------------------------------------ */

static void test_real_files(void) {
    static const char brain[] = "/usr/share/mricron/templates/ch2bet.nii.gz",
                      atlas[] = "/usr/share/mricron/templates/aal.nii.gz";
    lathe_volume *v = NULL;
    lathe_error err;
    if (access(brain, R_OK) || access(atlas, R_OK)) return;
    if (!CHECK_EQ(lathe_volume_open(&v, brain, &err), LATHE_OK)) return;
    CHECK(v->dims[0] == 181 && v->dims[1] == 217 && v->dims[2] == 181 && v->integer && v->max == 133);
    CHECK(v->affine[0][3] == -90 && v->affine[1][3] == -125 && v->affine[2][3] == -71);
    CHECK(fabs(lathe_volume_otsu(v) - 46.5) < 0.1);
    lathe_volume_close(&v);
    lathe_label_table *t = NULL;
    lathe_label label;
    CHECK_EQ(lathe_label_table_open(&t, atlas, &err), LATHE_OK);
    CHECK_EQ(lathe_label_table_count(t), 116);
    CHECK_EQ(lathe_label_table_malformed(t), 0);
    CHECK(lathe_label_table_find(t, 77, &label) && !strcmp(label.name, "Thalamus_L"));
    lathe_label_table_close(&t);
}

int main(void) {
    snprintf(folder, sizeof folder, "/tmp/lathe-volume-XXXXXX");
    if (!CHECK(mkdtemp(folder))) return check_end();
    test_types();
    test_affines();
    test_units();
    test_frames();
    test_extension();
    test_truncated();
    test_flipped();
    test_trailing();
    test_hostile_headers();
    test_bombs();
    test_not_finite();
    test_open_nifti();
    test_raw_types();
    test_bad_sidecars();
    test_wrap();
    test_otsu();
    test_table_lines();
    test_table_names_unique();
    test_table_files();
    test_real_files();
    static const char *const made[] = {"a.nii",    "a.nii.gz",  "cut.nii",   "empty.nii", "a.mha",
                                       "pipe.nii", "d.json",    "d.raw",     "bad.json",  "n.raw",
                                       "n.json",   "p.nii.txt", "p.nii.lut", "q.txt",     "q.lut"};
    for (size_t i = 0; i < sizeof made / sizeof *made; i++) unlink(path_of(made[i]));
    rmdir(path_of("folder.nii"));
    CHECK(!rmdir(folder));
    return check_end();
}
