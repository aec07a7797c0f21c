/* The container with made-up payloads: known byte vectors, growing prefixes, every truncation, every flipped bit,
 * hostile counts, streams of one structure, files that are no archives. */
#include "archive_write.h"
#include "check.h"
#include "crc32c.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

static int take(void *context, const void *bytes, size_t size) {
    lathe__emit(context, bytes, size);
    return 0;
}

/* ---- checksums and numbers ---- */

static void test_crc32c(void) {
    uint8_t bytes[32];
    CHECK_EQ(lathe__crc32c(0, "123456789", 9), 0xE3069283u);
    CHECK_EQ(lathe__crc32c(0, "", 0), 0);
    memset(bytes, 0, 32);
    CHECK_EQ(lathe__crc32c(0, bytes, 32), 0x8A9136AAu); /* RFC 3720, B.4 */
    memset(bytes, 0xFF, 32);
    CHECK_EQ(lathe__crc32c(0, bytes, 32), 0x62A8AB43u);
    for (int i = 0; i < 32; i++) bytes[i] = (uint8_t)i;
    CHECK_EQ(lathe__crc32c(0, bytes, 32), 0x46DD794Eu);
    for (size_t cut = 0; cut <= 32; cut++)
        CHECK_EQ(lathe__crc32c(lathe__crc32c(0, bytes, cut), bytes + cut, 32 - cut), 0x46DD794Eu);
}

static void check_varint(const uint8_t *bytes, size_t size, uint64_t value, bool fits32) {
    lathe_reader reader = lathe__reader(bytes, size);
    CHECK(lathe__read_varint64(&reader) == value && reader.status == LATHE_OK && reader.at == bytes + size);
    reader = lathe__reader(bytes, size);
    uint32_t narrow = lathe__read_varint(&reader);
    CHECK(fits32 ? narrow == value && !reader.status : narrow == 0 && reader.status == LATHE_ERR_FORMAT);
    for (size_t cut = 0; cut < size; cut++) {
        reader = lathe__reader(bytes, cut);
        CHECK(lathe__read_varint64(&reader) == 0 && reader.status == LATHE_MORE && reader.lacking == 1);
    }
    lathe_bytes out = {0};
    lathe__emit_varint(&out, value);
    CHECK(out.size == size && !memcmp(out.data, bytes, size));
    lathe__bytes_free(&out);
}

static void test_numbers(void) {
    check_varint((uint8_t[]){0}, 1, 0, true);
    check_varint((uint8_t[]){0x7F}, 1, 127, true);
    check_varint((uint8_t[]){0xAC, 0x02}, 2, 300, true);
    check_varint((uint8_t[]){0xFF, 0xFF, 0xFF, 0xFF, 0x0F}, 5, UINT32_MAX, true);
    check_varint((uint8_t[]){0x80, 0x80, 0x80, 0x80, 0x10}, 5, UINT64_C(1) << 32, false);
    check_varint((uint8_t[]){0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0x01}, 10, UINT64_MAX, false);
    const uint8_t endless[12] = {0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF};
    lathe_reader reader = lathe__reader(endless, sizeof endless);
    (void)lathe__read_varint64(&reader);
    CHECK_EQ(reader.status, LATHE_ERR_FORMAT);
    const int64_t values[] = {0, -1, 1, -64, 63, INT32_MAX, INT32_MIN, INT64_MAX, INT64_MIN};
    for (size_t i = 0; i < sizeof values / sizeof *values; i++) {
        CHECK(lathe__unzigzag64(lathe__zigzag64(values[i])) == values[i]);
        if (values[i] == (int32_t)values[i]) CHECK(lathe__unzigzag(lathe__zigzag((int32_t)values[i])) == values[i]);
    }
    CHECK_EQ(lathe__zigzag(-1), 1);
    CHECK_EQ(lathe__zigzag(63), 126);
    const uint8_t fixed[] = {0x00, 0x00, 0x20, 0xC0, 1, 2, 3, 4, 5, 6, 7, 8};
    reader = lathe__reader(fixed, sizeof fixed);
    CHECK(lathe__read_f32(&reader) == -2.5f);
    CHECK(lathe__read_u64(&reader) == UINT64_C(0x0807060504030201));
    CHECK(lathe__read_u8(&reader) == 0 && reader.status == LATHE_MORE);
}

static void test_names(void) {
    CHECK(lathe__name_valid("Thalamus_L", 10) && lathe__name_valid("\xC3\xA9\xE2\x82\xAC\xF0\x9F\xA7\xA0", 9));
    const char *bad[] = {"",
                         "a\nb",
                         "\x7F",
                         "\xC3",
                         "\xC0\x80",
                         "\xE0\x80\x80",
                         "\xED\xA0\x80",
                         "\xF5\x80\x80\x80",
                         "\xF4\x90\x80\x80",
                         "\x80",
                         "\xF0\x80\x80\x80"};
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) CHECK(!lathe__name_valid(bad[i], strlen(bad[i])));
    CHECK(!lathe__name_valid("a\0b", 3));
    char out[10];
    lathe__name_clean(out, sizeof out, "a\xFF\n\xC3\xA9z");
    CHECK(!strcmp(out, "a__\xC3\xA9z"));
    lathe__name_clean(out, sizeof out, "12345678\xC3\xA9"); /* no half character at the end */
    CHECK(!strcmp(out, "12345678"));
    lathe__name_clean(out, sizeof out, NULL);
    CHECK(!strcmp(out, "unnamed"));
}

/* ---- headers ---- */

/* axis z, iso, affine 2 3 0.5 on the diagonal, parameter 300, one structure. */
static const uint8_t vector_header[] = {
    0x89, 'L',  'T',  'H',  0x0D, 0x0A, 0x1A, 2, 22, /* magic, version, size of the body */
    0x06,                                           /* axis 2, boundary 1 << 2 */
    0x01, 4,                                        /* 2 0 0 0: the first is whole */
    0x04, 6,                                        /* 0 3 0 0 */
    0x60, 0,    0,    0,    0x3F, 1,                /* 0 0 0.5 -1: a float, a whole number */
    1,    0xAC, 0x02,                               /* one parameter: 300 */
    1,                                              /* one structure */
    1,    8,    0,    3,    5,    7,    2,          /* origin -1 4 0, size 3 5 7, 2 levels */
    0,    0,    0,    0};                           /* CRC-32C */

static void test_header_vector(void) {
    uint8_t bytes[sizeof vector_header];
    memcpy(bytes, vector_header, sizeof bytes);
    size_t body = sizeof bytes - 9 - 4;
    bytes[8] = (uint8_t)body;
    uint32_t crc = lathe__crc32c(0, bytes, sizeof bytes - 4);
    for (int i = 0; i < 4; i++) bytes[sizeof bytes - 4 + (size_t)i] = (uint8_t)(crc >> 8 * i);
    lathe_reader reader = lathe__reader(bytes, sizeof bytes);
    lathe_header header;
    if (!CHECK_EQ(lathe__header_parse(&header, &reader), LATHE_OK)) {
        fprintf(stderr, "%s\n", reader.fault);
        return;
    }
    CHECK(reader.at == reader.end);
    CHECK(header.axis == LATHE_AXIS_Z && header.boundary == LATHE_BOUNDARY_ISO);
    CHECK(header.affine[0][0] == 2 && header.affine[1][1] == 3 && header.affine[2][2] == 0.5 &&
          header.affine[2][3] == -1);
    CHECK(header.parameter_count == 1 && header.parameters[0] == 300);
    CHECK(header.structure_count == 1 && header.level_count == 2);
    const lathe_header_structure *s = header.structures;
    CHECK(!*s->name && s->level_count == 2);
    CHECK(s->origin[0] == -1 && s->origin[1] == 4 && s->origin[2] == 0 && s->size[0] == 3 && s->size[1] == 5 &&
          s->size[2] == 7);
    lathe_bytes again = {0};
    lathe__emit_header(&again, &header, 0, 1);
    CHECK(again.size == sizeof bytes && !memcmp(again.data, bytes, sizeof bytes));
    lathe__bytes_free(&again);
    lathe__header_free(&header);
}

enum { STRUCTURES = 4 };
static lathe_header_structure structures[STRUCTURES] = {
    {"Thalamus_L", {1, 2, 3}, 3, 7101, {80, -1, 60}, {30, 40, 22}},
    {"Thalamus_R", {4, 5, 6}, 2, 7102, {110, 70, 61}, {31, 41, 4}},
    {"Th", {255, 0, 9}, 3, INT64_MIN, {0, 0, 0}, {3, 3, 1}},
    {"\xC3\xA9t\xC3\xA9", {0, 0, 0}, 1, INT64_MAX, {4000, -1, 4095}, {97, 4098, 1}},
};
static const lathe_header sample = {
    .axis = LATHE_AXIS_Y,
    .boundary = LATHE_BOUNDARY_EDGE,
    .affine = {{-1, 0, 0, 90}, {0, 1, 0, -126}, {0, 0, 0.1, -72}}, /* 0.1 needs doubles */
    .parameter_count = 3,
    .parameters = {0, 107, UINT32_MAX},
    .structure_count = STRUCTURES,
    .structures = structures,
};

static bool same_header(const lathe_header *a, const lathe_header *b) {
    bool same = a->axis == b->axis && a->boundary == b->boundary && !memcmp(a->affine, b->affine, sizeof a->affine) &&
                a->parameter_count == b->parameter_count &&
                !memcmp(a->parameters, b->parameters, sizeof a->parameters) && a->structure_count == b->structure_count;
    for (uint32_t i = 0; same && i < a->structure_count; i++) {
        const lathe_header_structure *s = &a->structures[i], *t = &b->structures[i];
        same = s->level_count == t->level_count && !memcmp(s->origin, t->origin, sizeof s->origin) &&
               !memcmp(s->size, t->size, sizeof s->size);
    }
    return same;
}

/* Every prefix wants more, and never more than there is; asking again only when `lacking` bytes have come ends. */
static void test_header_prefixes(void) {
    lathe_bytes bytes = {0};
    lathe__emit_header(&bytes, &sample, 0, STRUCTURES);
    lathe_header header = {.structure_count = 77};
    for (size_t size = 0; size < bytes.size; size++) {
        uint8_t *prefix = malloc(size + 1); /* exact, so that the sanitizer sees a read too far */
        memcpy(prefix, bytes.data, size);
        lathe_reader reader = lathe__reader(prefix, size);
        CHECK_EQ(lathe__header_parse(&header, &reader), LATHE_MORE);
        CHECK(reader.lacking > 0 && reader.lacking <= bytes.size - size && header.structure_count == 77);
        free(prefix);
    }
    lathe_reader reader = lathe__reader(bytes.data, bytes.size);
    if (!CHECK_EQ(lathe__header_parse(&header, &reader), LATHE_OK)) return;
    CHECK(same_header(&header, &sample) && header.level_count == 3);
    CHECK(lathe__header_present(&header, 0) == 4 && lathe__header_present(&header, 1) == 3 &&
          lathe__header_present(&header, 2) == 2);
    lathe__header_free(&header);
    lathe__bytes_free(&bytes);
}

/* Wraps a body as a header record with a right checksum and parses it. */
static lathe_status parse_body(const uint8_t *body, size_t size, lathe_header *header) {
    static const uint8_t magic[] = LATHE_MAGIC_BYTES;
    lathe_bytes bytes = {0};
    lathe__emit(&bytes, magic, sizeof magic);
    lathe__emit_varint(&bytes, size);
    lathe__emit(&bytes, body, size);
    lathe__emit_checksum(&bytes, 0);
    lathe_reader reader = lathe__reader(bytes.data, bytes.size);
    lathe_status status = lathe__header_parse(header, &reader);
    lathe__bytes_free(&bytes);
    return status;
}

static lathe_status parse_changed(size_t at, uint8_t value) {
    uint8_t body[sizeof vector_header - 13];
    memcpy(body, vector_header + 9, sizeof body);
    body[at] = value;
    lathe_header header;
    lathe_status status = parse_body(body, sizeof body, &header);
    if (!status) lathe__header_free(&header);
    return status;
}

/* Shares 0 bytes, 2 bytes "ab", colour 10 20 30, label -1. */
static lathe_status parse_identity(size_t at, uint8_t value, lathe_header_structure *s) {
    uint8_t bytes[] = {0, 2, 'a', 'b', 10, 20, 30, 1};
    static const lathe_header_structure nobody = {.level_count = 0};
    bytes[at] = value;
    memset(s, 0, sizeof *s);
    lathe_reader reader = lathe__reader(bytes, sizeof bytes);
    lathe__parse_identity(s, &reader, &nobody);
    return reader.status;
}

static void test_identities(void) {
    lathe_header_structure s;
    CHECK_EQ(parse_identity(0, 0, &s), LATHE_OK);
    CHECK(!strcmp(s.name, "ab") && s.rgb[0] == 10 && s.rgb[2] == 30 && s.label == -1);
    CHECK_EQ(parse_identity(0, 1, &s), LATHE_ERR_FORMAT); /* nothing to share with */
    CHECK_EQ(parse_identity(1, 0, &s), LATHE_ERR_FORMAT);
    CHECK_EQ(parse_identity(1, 96, &s), LATHE_ERR_FORMAT);
    CHECK_EQ(parse_identity(2, 0, &s), LATHE_ERR_FORMAT);
    CHECK_EQ(parse_identity(2, 0xFF, &s), LATHE_ERR_FORMAT);
    CHECK_EQ(parse_identity(1, 90, &s), LATHE_MORE);
}

static void test_hostile_headers(void) {
    enum { PARAMETERS = 11, COUNT = 14, ORIGIN = 15, SIZE = 18, LEVELS = 21 };
    CHECK_EQ(parse_changed(0, 6), LATHE_OK);
    CHECK_EQ(parse_changed(0, 7), LATHE_ERR_FORMAT);         /* no such axis */
    CHECK_EQ(parse_changed(0, 0x16), LATHE_ERR_FORMAT);      /* unknown flag */
    CHECK_EQ(parse_changed(2, 16), LATHE_OK);                /* 8 instead of 2 */
    CHECK_EQ(parse_changed(2, 0), LATHE_ERR_FORMAT);         /* singular affine */
    CHECK_EQ(parse_changed(9, 0x7E), LATHE_ERR_FORMAT);      /* beyond 1e12 */
    CHECK_EQ(parse_changed(PARAMETERS, 200), LATHE_ERR_FORMAT);
    CHECK_EQ(parse_changed(PARAMETERS, 2), LATHE_ERR_FORMAT);
    CHECK_EQ(parse_changed(COUNT, 0), LATHE_ERR_FORMAT);
    CHECK_EQ(parse_changed(COUNT, 2), LATHE_ERR_FORMAT);
    CHECK_EQ(parse_changed(COUNT, 127), LATHE_ERR_FORMAT);
    CHECK_EQ(parse_changed(ORIGIN, 3), LATHE_ERR_FORMAT); /* -2 */
    CHECK_EQ(parse_changed(SIZE, 2), LATHE_ERR_FORMAT);
    CHECK_EQ(parse_changed(SIZE + 2, 0), LATHE_ERR_FORMAT);
    CHECK_EQ(parse_changed(LEVELS, 0), LATHE_ERR_FORMAT);
    CHECK_EQ(parse_changed(LEVELS, LATHE_MAX_LEVELS), LATHE_OK);
    CHECK_EQ(parse_changed(LEVELS, LATHE_MAX_LEVELS + 1), LATHE_ERR_FORMAT);
    lathe_header header;
    uint8_t body[sizeof vector_header];
    memcpy(body, vector_header + 9, sizeof vector_header - 13);
    body[sizeof vector_header - 13] = 0;
    CHECK_EQ(parse_body(body, sizeof vector_header - 12, &header), LATHE_ERR_FORMAT); /* bytes left over */
    for (size_t size = 0; size < sizeof vector_header - 13; size++)
        CHECK_EQ(parse_body(body, size, &header), LATHE_ERR_FORMAT);
    lathe_header_structure huge = {"x", {0}, 1, 0, {0, 0, 0}, {4096, 4096, 4096}};
    lathe_header large = sample;
    large.structure_count = 1;
    large.structures = &huge;
    const char *fault = NULL;
    CHECK_EQ(lathe__header_check(&large, &fault), LATHE_ERR_LIMIT);
    huge.size[2] = 128;
    CHECK_EQ(lathe__header_check(&large, &fault), LATHE_OK);
    large.affine[1][1] = NAN;
    CHECK_EQ(lathe__header_check(&large, &fault), LATHE_ERR_FORMAT);
}

/* 65535 structures announced in a few bytes, a header of 4 GiB announced in a few more. */
static void test_hostile_counts(void) {
    uint8_t body[sizeof vector_header + 2];
    size_t size = sizeof vector_header - 13;
    lathe_header header;
    memcpy(body, vector_header + 9, 14);
    memcpy(body + 14, (uint8_t[]){0xFF, 0xFF, 0x03}, 3);
    memcpy(body + 17, vector_header + 9 + 15, size - 15);
    CHECK_EQ(parse_body(body, size + 2, &header), LATHE_ERR_FORMAT);
    const uint8_t endless[] = {0x89, 'L', 'T', 'H', 0x0D, 0x0A, 0x1A, 2, 0xFF, 0xFF, 0xFF, 0xFF, 0x0F, 0};
    lathe_reader reader = lathe__reader(endless, sizeof endless);
    CHECK_EQ(lathe__header_parse(&header, &reader), LATHE_ERR_LIMIT);
    const uint8_t next[] = {0x89, 'L', 'T', 'H', 0x0D, 0x0A, 0x1A, 3};
    reader = lathe__reader(next, sizeof next);
    CHECK_EQ(lathe__header_parse(&header, &reader), LATHE_ERR_UNSUPPORTED);
    for (size_t n = 1; n < 8; n++) {
        reader = lathe__reader((const uint8_t *)"GIF89aXX", n);
        CHECK_EQ(lathe__header_parse(&header, &reader), LATHE_ERR_FORMAT);
    }
}

/* An atlas of 116: at most 25 bytes a structure. */
static void test_compact(void) {
    static const char *const stems[] = {"Precentral",        "Frontal_Sup",    "Frontal_Mid_Orb", "Rolandic_Oper",
                                        "Supp_Motor_Area",   "Rectus",         "Insula",          "Cingulum_Ant",
                                        "Hippocampus",       "Calcarine",      "Occipital_Inf",   "SupraMarginal",
                                        "Temporal_Pole_Sup", "Cerebelum_Crus1"};
    static lathe_header_structure many[116];
    for (int i = 0; i < 116; i++) {
        snprintf(many[i].name, sizeof many[i].name, "%s_%d_%c", stems[i / 2 % 14], i / 28, i % 2 ? 'R' : 'L');
        many[i] = (lathe_header_structure){.level_count = 5, .label = 2001 + i * (i % 10 == 0 ? 100 : 1)};
        snprintf(many[i].name, sizeof many[i].name, "%s_%d_%c", stems[i / 2 % 14], i / 28, i % 2 ? 'R' : 'L');
        for (int k = 0; k < 3; k++) many[i].size[k] = 20 + i % 50;
        for (int k = 0; k < 3; k++) many[i].origin[k] = (i * 37 + k * 11) % 120;
    }
    lathe_header header = sample;
    header.structure_count = 116;
    header.structures = many;
    lathe_bytes bytes = {0};
    lathe__emit_header(&bytes, &header, 0, 116);
    CHECK(bytes.size < 116 * 25);
    lathe_reader reader = lathe__reader(bytes.data, bytes.size);
    lathe_header back;
    CHECK_EQ(lathe__header_parse(&back, &reader), LATHE_OK);
    CHECK(same_header(&back, &header));
    lathe__header_free(&back);
    lathe__bytes_free(&bytes);
}

/* ---- archives ---- */

static lathe_level_info stats_of(uint32_t structure, uint32_t level) {
    lathe_level_info info = {.rays = 8u << level,
                             .slices = 5 + structure,
                             .vertices = 100 * level + structure,
                             .triangles = 200 * level,
                             .draco_bytes = level ? (uint64_t)1 << (30 + 2 * level) : 0,
                             .error_rms_mm = structure == 2 ? -1 : 1.5f / (float)(level + 1),
                             .error_max_mm = 3.0f + (float)structure,
                             .components_waiting = level < 2 ? structure : 0};
    info.components = 7 + structure - info.components_waiting;
    info.waiting_mm3 = info.components_waiting * 0.25;
    return info;
}

static uint32_t payload_size(uint32_t structure, uint32_t level) {
    return structure == 2 ? level : 3 + 41 * level + 7 * structure;
}
static uint8_t payload_byte(uint32_t structure, uint32_t level, uint32_t i) {
    return (uint8_t)(structure * 71 + level * 29 + i * i * 13 + i);
}

/* Writes the sample archive; stops at the first failure. */
static lathe_status write_sample(lathe_sink sink, void *context, const char *name) {
    static uint8_t payloads[STRUCTURES][256];
    lathe_archive_writer *writer = NULL;
    lathe_status status = lathe__archive_begin(&writer, &sample, sink, context, NULL);
    for (uint32_t level = 0; level < 3 && !status; level++) {
        lathe_packet packets[STRUCTURES];
        uint32_t count = 0;
        for (uint32_t s = 0; s < STRUCTURES; s++) {
            if (structures[s].level_count <= level) continue;
            for (uint32_t i = 0; i < payload_size(s, level); i++) payloads[s][i] = payload_byte(s, level, i);
            packets[count++] = (lathe_packet){payloads[s], payload_size(s, level)};
        }
        status = lathe__archive_level(writer, level == 1 ? NAN : 2.0f / (float)(level + 1), 7, packets, count);
    }
    lathe_level_info own[STRUCTURES][3], totals[3];
    const lathe_level_info *levels[STRUCTURES];
    for (uint32_t s = 0; s < STRUCTURES; s++) {
        for (uint32_t n = 0; n < 3; n++) own[s][n] = stats_of(s, n);
        levels[s] = own[s];
    }
    for (uint32_t n = 0; n < 3; n++) totals[n] = stats_of(9, n);
    if (!status) status = lathe__archive_finish(writer, &(lathe_archive_stats){name, 46.5, totals, levels});
    lathe__archive_close(&writer);
    return status;
}

static void check_description(const lathe_model *model) {
    uint64_t sums[3] = {0};
    const lathe_model_info *info = lathe_model_describe(model);
    CHECK(!strcmp(info->name, "brain") && info->structure_count == STRUCTURES && info->level_count == 3 &&
          info->iso == 46.5);
    CHECK(info->axis == LATHE_AXIS_Y && info->boundary == LATHE_BOUNDARY_EDGE);
    for (uint32_t s = 0; s < STRUCTURES; s++) {
        const lathe_structure_info *own = &info->structures[s];
        CHECK(!strcmp(own->name, structures[s].name) && own->label == structures[s].label &&
              !memcmp(own->rgb, structures[s].rgb, 3));
        CHECK_EQ(own->level_count, structures[s].level_count);
        CHECK_EQ(lathe_model_find(model, own->name), s);
        for (uint32_t n = 0; n < own->level_count; n++) {
            lathe_level_info want = stats_of(s, n);
            CHECK(own->levels[n].rays == want.rays && own->levels[n].slices == want.slices &&
                  own->levels[n].vertices == want.vertices);
            CHECK(own->levels[n].triangles == want.triangles && own->levels[n].draco_bytes == want.draco_bytes);
            CHECK(own->levels[n].error_rms_mm == want.error_rms_mm && own->levels[n].error_max_mm == want.error_max_mm);
            CHECK(own->levels[n].components == want.components && own->levels[n].components_waiting == want.components_waiting &&
                  own->levels[n].waiting_mm3 == want.waiting_mm3);
            sums[n] += own->levels[n].polar_bytes;
        }
    }
    for (uint32_t n = 0; n < 3; n++) CHECK_EQ(sums[n], info->levels[n].polar_bytes);
    /* Totals: structures with fewer levels stay at their last. */
    CHECK_EQ(info->levels[0].components, 4 * 7);
    CHECK_EQ(info->levels[0].components_waiting, 0 + 1 + 2 + 3);
    CHECK_EQ(info->levels[2].components_waiting, 0 + 1 + 0 + 3);
    CHECK(info->levels[0].waiting_mm3 == 1.5 && info->levels[2].waiting_mm3 == 1);
    CHECK(info->keep_topology && info->caps);   /* bits of parameter 1 */
    CHECK_EQ(lathe_model_find(model, "Thalamus"), -1);
    CHECK(info->levels[0].error_rms_mm == 2 && info->levels[1].error_rms_mm == -1 && info->levels[2].error_max_mm == 7);
    CHECK(info->levels[2].rays == 32 && info->levels[2].draco_bytes == UINT64_C(1) << 34);
}

static void check_whole_streams(const lathe_model *model) {
    size_t size, offset, part, end = 0;
    const uint8_t *bytes = lathe_model_bytes(model, &size);
    for (uint32_t n = 0; n < 3; n++) {
        lathe_model_stream_range(model, n, n, &offset, &part);
        CHECK(offset == end && part == lathe_model_describe(model)->levels[n].polar_bytes);
        end += part;
    }
    for (uint32_t from = 0; from < 5; from++)
        for (uint32_t to = 0; to < 5; to++) {
            lathe_bytes out = {0};
            CHECK_EQ(lathe_model_stream(model, -1, from, to, take, &out), LATHE_OK);
            lathe_model_stream_range(model, from, to, &offset, &part);
            CHECK(out.size == part && part == lathe_model_stream_size(model, -1, from, to));
            CHECK(offset <= end && part <= end - offset && (!part || !memcmp(out.data, bytes + offset, part)));
            CHECK((part == 0) == (from > to || from > 2));
            lathe__bytes_free(&out);
        }
    lathe_model_stream_range(model, 0, UINT32_MAX, &offset, &part);
    CHECK(offset == 0 && part == end && part < size);
}

/* Reads a stream as a decoder does; structure -1: all. */
static void check_stream_content(const uint8_t *bytes, size_t size, int64_t only) {
    lathe_reader reader = lathe__reader(bytes, size);
    lathe_header header;
    if (!CHECK_EQ(lathe__header_parse(&header, &reader), LATHE_OK)) return;
    CHECK_EQ(header.structure_count, only < 0 ? STRUCTURES : 1);
    for (uint32_t level = 0; level < header.level_count; level++) {
        lathe_level_head head;
        if (!CHECK_EQ(lathe__level_parse(&head, &reader, &header), LATHE_OK)) break;
        CHECK_EQ(head.level, level);
        if (only >= 0) CHECK(head.error_rms_mm == stats_of((uint32_t)only, level).error_rms_mm);
        uint32_t packet = 0;
        for (uint32_t s = 0; s < STRUCTURES; s++) {
            if (structures[s].level_count <= level || (only >= 0 && s != only)) continue;
            CHECK_EQ(head.sizes[packet], payload_size(s, level));
            const uint8_t *payload = lathe__packet_parse(&reader, head.sizes[packet++]);
            if (!CHECK(payload != NULL)) break;
            uint32_t same = 0;
            while (same < payload_size(s, level) && payload[same] == payload_byte(s, level, same)) same++;
            CHECK_EQ(same, payload_size(s, level));
        }
        CHECK_EQ(packet, head.count);
        lathe__level_head_free(&head);
    }
    CHECK(reader.at == reader.end);
    lathe__header_free(&header);
}

static void check_structure_streams(const lathe_model *model) {
    for (uint32_t s = 0; s < STRUCTURES; s++) {
        lathe_bytes whole = {0}, parts = {0};
        CHECK_EQ(lathe_model_stream(model, s, 0, UINT32_MAX, take, &whole), LATHE_OK);
        CHECK_EQ(whole.size, lathe_model_stream_size(model, s, 0, UINT32_MAX));
        for (uint32_t n = 0; n < 5; n++) CHECK_EQ(lathe_model_stream(model, s, n, n, take, &parts), LATHE_OK);
        CHECK(parts.size == whole.size && !memcmp(parts.data, whole.data, whole.size));
        check_stream_content(whole.data, whole.size, s);
        lathe__bytes_free(&whole);
        lathe__bytes_free(&parts);
    }
    CHECK_EQ(lathe_model_stream(model, STRUCTURES, 0, 1, take, NULL), LATHE_ERR_RANGE);
    CHECK_EQ(lathe_model_stream_size(model, STRUCTURES, 0, 1), 0);
}

static void test_archive(const lathe_bytes *file) {
    lathe_model *model = NULL;
    lathe_error err = {""};
    if (!CHECK_EQ(lathe_model_parse(&model, file->data, file->size, &err), LATHE_OK)) {
        fprintf(stderr, "%s\n", err.text);
        return;
    }
    CHECK_EQ(lathe_model_check(model, &err), LATHE_OK);
    check_description(model);
    check_whole_streams(model);
    size_t offset, size;
    lathe_model_stream_range(model, 0, 2, &offset, &size);
    check_stream_content(file->data, size, -1);
    check_structure_streams(model);
    lathe_model_close(&model);
    lathe_model_close(&model);
    CHECK(model == NULL);
}

/* A level record's head by every prefix; and a decoder that waits for `lacking` bytes each time ends within a few
 * tries. */
static void test_level_prefixes(const lathe_bytes *file) {
    lathe_reader reader = lathe__reader(file->data, file->size);
    lathe_header header;
    CHECK_EQ(lathe__header_parse(&header, &reader), LATHE_OK);
    const uint8_t *start = reader.at;
    lathe_level_head head = {.level = 99};
    lathe_reader whole = reader;
    CHECK_EQ(lathe__level_parse(&head, &whole, &header), LATHE_OK);
    size_t size = (size_t)(whole.at - start);
    lathe__level_head_free(&head);
    for (size_t cut = 0; cut < size; cut++) {
        uint8_t *prefix = malloc(cut + 1);
        memcpy(prefix, start, cut);
        reader = lathe__reader(prefix, cut);
        CHECK_EQ(lathe__level_parse(&head, &reader, &header), LATHE_MORE);
        CHECK(reader.lacking > 0 && reader.lacking <= size - cut && !head.sizes);
        free(prefix);
    }
    size_t there = 0;
    int tries = 0;
    for (; there < size; tries++) {
        reader = lathe__reader(start, there);
        if (lathe__level_parse(&head, &reader, &header) == LATHE_MORE) there += reader.lacking;
    }
    CHECK(there == size && tries < 30);
    lathe__header_free(&header);
}

static lathe_status open_and_check(const uint8_t *bytes, size_t size) {
    lathe_model *model = NULL;
    lathe_error err = {""};
    lathe_status status = lathe_model_parse(&model, bytes, size, &err);
    if (!status) status = lathe_model_check(model, &err);
    CHECK((status == LATHE_OK) == (err.text[0] == 0));
    lathe_model_close(&model);
    return status;
}

static void test_truncations(const lathe_bytes *file) {
    for (size_t size = 0; size < file->size; size++) {
        uint8_t *prefix = malloc(size + 1);
        memcpy(prefix, file->data, size);
        CHECK(open_and_check(prefix, size) < 0);
        free(prefix);
    }
    uint8_t *longer = calloc(file->size + 20, 1);
    memcpy(longer, file->data, file->size);
    CHECK(open_and_check(longer, file->size + 1) < 0 && open_and_check(longer, file->size + 20) < 0);
    free(longer);
}

/* Checksums cover every byte, so that no flip goes unseen. */
static void test_flips(lathe_bytes *file) {
    for (size_t i = 0; i < file->size; i++)
        for (int mask = 1; mask < 512; mask <<= 1) {
            uint8_t old = file->data[i];
            file->data[i] ^= (uint8_t)(mask == 256 ? 255 : mask);
            CHECK(open_and_check(file->data, file->size) < 0);
            file->data[i] = old;
        }
    CHECK_EQ(open_and_check(file->data, file->size), LATHE_OK);
}

/* A footer with a right checksum that says something else. */
static void test_hostile_footer(const lathe_bytes *file) {
    lathe_reader trailer = lathe__reader(file->data + file->size - 16, 16);
    size_t offset = (size_t)lathe__read_u64(&trailer), size = lathe__read_u32(&trailer);
    for (size_t i = 0; i < size - 4; i++)
        for (int value = 0; value < 256; value += 51) {
            lathe_bytes changed = {0};
            lathe__emit(&changed, file->data, offset + size - 4);
            changed.data[offset + i] = (uint8_t)value;
            lathe__emit_checksum(&changed, offset);
            lathe__emit(&changed, file->data + file->size - 16, 16);
            (void)open_and_check(changed.data, changed.size); /* any answer, but no crash */
            lathe__bytes_free(&changed);
        }
    CHECK_EQ(open_and_check(file->data, file->size), LATHE_OK);
}

/* ---- writer ---- */

typedef struct limited {
    size_t left;
} limited;
static int take_limited(void *context, const void *bytes, size_t size) {
    limited *l = context;
    (void)bytes;
    if (size > l->left) return 1;
    l->left -= size;
    return 0;
}

static void test_writer_errors(size_t file_size) {
    uint64_t all = 0;
    (void)file_size;
    CHECK_EQ(write_sample(lathe__count_bytes, &all, "x"), LATHE_OK);
    for (size_t limit = 0; limit < all; limit += 13)
        CHECK_EQ(write_sample(take_limited, &(limited){limit}, "x"), LATHE_ERR_IO);
    lathe_bytes out = {0};
    lathe_archive_writer *writer = NULL;
    lathe_error err;
    CHECK_EQ(lathe__archive_begin(&writer, &sample, take, &out, &err), LATHE_OK);
    lathe_packet packets[5] = {{NULL, 0}};
    CHECK_EQ(lathe__archive_level(writer, 1, 1, packets, 3), LATHE_ERR_RANGE);
    CHECK_EQ(lathe__archive_finish(writer, &(lathe_archive_stats){0}), LATHE_ERR_RANGE);
    CHECK_EQ(lathe__archive_level(writer, 1, 1, packets, 4), LATHE_OK);
    CHECK_EQ(lathe__archive_level(writer, 1, 1, packets, 3), LATHE_OK);
    CHECK_EQ(lathe__archive_level(writer, 1, 1, packets, 2), LATHE_OK);
    CHECK_EQ(lathe__archive_level(writer, 1, 1, packets, 0), LATHE_ERR_RANGE);
    lathe__archive_close(&writer);
    lathe__archive_close(&writer);
    char old[LATHE_NAME_MAX + 1];
    memcpy(old, structures[2].name, sizeof old);
    strcpy(structures[2].name, "Thalamus_L");
    CHECK_EQ(lathe__archive_begin(&writer, &sample, take, &out, &err), LATHE_ERR_FORMAT);
    CHECK(strstr(err.text, "Thalamus_L") != NULL);
    strcpy(structures[2].name, "");
    CHECK_EQ(lathe__archive_begin(&writer, &sample, take, &out, &err), LATHE_ERR_FORMAT);
    memcpy(structures[2].name, old, sizeof old);
    CHECK(writer == NULL);
    lathe__bytes_free(&out);
}

/* ---- files ---- */

static void expect_refusal(const char *path, lathe_status want, const char *words) {
    lathe_model *model = NULL;
    lathe_error err = {""};
    CHECK_EQ(lathe_model_open(&model, path, &err), want);
    if (!CHECK(strstr(err.text, path) != NULL && strstr(err.text, words) != NULL)) fprintf(stderr, "%s\n", err.text);
    CHECK(model == NULL);
}

static void put_file(const char *path, const void *bytes, size_t size) {
    lathe_atomic_file *file = NULL;
    CHECK_EQ(lathe_atomic_open(&file, path, NULL), LATHE_OK);
    CHECK_EQ(lathe_atomic_write(file, bytes, size), 0);
    CHECK_EQ(lathe_atomic_commit(&file, NULL), LATHE_OK);
}

static void test_files(const lathe_bytes *file) {
    char folder[200], path[256];
    const char *root = getenv("TMPDIR");
    snprintf(folder, sizeof folder, "%s/lathe-archive-XXXXXX", root && strlen(root) < 150 ? root : "/tmp");
    if (!CHECK(mkdtemp(folder) != NULL)) return;
    snprintf(path, sizeof path, "%s/a.lathe", folder);
    expect_refusal(path, LATHE_ERR_IO, "No such file");
    expect_refusal(folder, LATHE_ERR_IO, "directory");
    put_file(path, "", 0);
    expect_refusal(path, LATHE_ERR_FORMAT, "empty");
    put_file(path, "GIF89a, and so on and on", 24);
    expect_refusal(path, LATHE_ERR_FORMAT, "not a Lathe archive");
    put_file(path, file->data, file->size - 1);
    expect_refusal(path, LATHE_ERR_FORMAT, "truncated");
    put_file(path, file->data, 5);
    expect_refusal(path, LATHE_ERR_FORMAT, "truncated");
    put_file(path, file->data, file->size);
    lathe_model *model = NULL;
    CHECK_EQ(lathe_model_open(&model, path, NULL), LATHE_OK);
    if (model) check_description(model);
    lathe_model_close(&model);
    CHECK_EQ(unlink(path), 0);
    CHECK_EQ(mkfifo(path, 0600), 0);
    expect_refusal(path, LATHE_ERR_IO, "regular"); /* and does not wait for a writer */
    unlink(path);
    rmdir(folder);
}

int main(void) {
    test_crc32c();
    test_numbers();
    test_names();
    test_header_vector();
    test_header_prefixes();
    test_hostile_headers();
    test_identities();
    test_hostile_counts();
    test_compact();
    lathe_bytes file = {0}, again = {0};
    CHECK_EQ(write_sample(take, &file, "brain"), LATHE_OK);
    CHECK_EQ(write_sample(take, &again, "brain"), LATHE_OK);
    CHECK(file.size == again.size && !memcmp(file.data, again.data, file.size));
    test_archive(&file);
    test_level_prefixes(&file);
    test_truncations(&file);
    test_flips(&file);
    test_hostile_footer(&file);
    test_writer_errors(file.size);
    test_files(&file);
    lathe__bytes_free(&file);
    lathe__bytes_free(&again);
    return check_end();
}
