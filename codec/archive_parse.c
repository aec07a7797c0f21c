/* Parsers of the container's records. They work on a growing prefix: MORE until a record is complete, and nothing is
 * believed or allocated before its checksum is right or its counts are checked against the bytes that are there. */
#include "archive_format.h"
#include "crc32c.h"
#include "pyramid.h"
#include <stdlib.h>
#include <string.h>

/* ---- cursor ---- */

lathe_reader lathe__reader(const uint8_t *bytes, size_t size) {
    return (lathe_reader){.at = bytes, .end = bytes + size, .status = LATHE_OK, .lacking = 0, .fault = ""};
}

lathe_status lathe__reader_fail(lathe_reader *reader, lathe_status status, const char *fault) {
    if (!reader->status) {
        reader->status = status;
        reader->fault = fault;
    }
    return reader->status;
}

const uint8_t *lathe__read_bytes(lathe_reader *reader, size_t size) {
    if (reader->status) return NULL;
    if (size > lathe__reader_left(reader)) {
        reader->lacking = size - lathe__reader_left(reader);
        lathe__reader_fail(reader, LATHE_MORE, LATHE_FAULT("more bytes are needed"));
        return NULL;
    }
    const uint8_t *bytes = reader->at;
    reader->at += size;
    return bytes;
}

static uint64_t read_little(lathe_reader *reader, unsigned size) {
    const uint8_t *bytes = lathe__read_bytes(reader, size);
    uint64_t value = 0;
    if (bytes)
        for (unsigned i = size; i-- > 0;) value = value << 8 | bytes[i];
    return value;
}

uint8_t lathe__read_u8(lathe_reader *reader) { return (uint8_t)read_little(reader, 1); }
uint32_t lathe__read_u32(lathe_reader *reader) { return (uint32_t)read_little(reader, 4); }
uint64_t lathe__read_u64(lathe_reader *reader) { return read_little(reader, 8); }

float lathe__read_f32(lathe_reader *reader) {
    uint32_t bits = lathe__read_u32(reader);
    float value;
    memcpy(&value, &bits, sizeof value);
    return value;
}

double lathe__read_f64(lathe_reader *reader) {
    uint64_t bits = lathe__read_u64(reader);
    double value;
    memcpy(&value, &bits, sizeof value);
    return value;
}

uint64_t lathe__read_varint64(lathe_reader *reader) {
    uint64_t value = 0;
    for (unsigned shift = 0; shift < 64; shift += 7) {
        uint8_t byte = lathe__read_u8(reader);
        if (reader->status) return 0;
        if (shift == 63 && byte > 1) break;
        value |= (uint64_t)(byte & 127) << shift;
        if (byte < 128) return value;
    }
    lathe__reader_fail(reader, LATHE_ERR_FORMAT, LATHE_FAULT("a number is longer than 64 bits"));
    return 0;
}

uint32_t lathe__read_varint(lathe_reader *reader) {
    uint32_t value = 0;
    for (unsigned shift = 0; shift < 35; shift += 7) {
        uint8_t byte = lathe__read_u8(reader);
        if (reader->status) return 0;
        if (shift == 28 && byte > 15) break;
        value |= (uint32_t)(byte & 127) << shift;
        if (byte < 128) return value;
    }
    lathe__reader_fail(reader, LATHE_ERR_FORMAT, LATHE_FAULT("a number is longer than 32 bits"));
    return 0;
}

/* The checksum of everything from start to here, which follows here. */
static void read_checksum(lathe_reader *reader, const uint8_t *start, const char *fault) {
    uint32_t computed = lathe__crc32c(0, start, (size_t)(reader->at - start));
    uint32_t stored = lathe__read_u32(reader);
    if (!reader->status && stored != computed) lathe__reader_fail(reader, LATHE_ERR_CHECKSUM, fault);
}

/* ---- header record ---- */

/* Also false for NaN. Beyond this, positions and determinants would leave the range of float. */
static bool sane(double v) { return v >= -1e12 && v <= 1e12; }

static bool affine_usable(const double m[3][4]) {
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 4; j++)
            if (!sane(m[i][j])) return false;
    double det = m[0][0] * (m[1][1] * m[2][2] - m[1][2] * m[2][1]) - m[0][1] * (m[1][0] * m[2][2] - m[1][2] * m[2][0]) +
                 m[0][2] * (m[1][0] * m[2][1] - m[1][1] * m[2][0]);
    return det != 0;
}

static lathe_status structure_check(const lathe_header_structure *s, const char **fault) {
    *fault = LATHE_FAULT("a structure's level count");
    if (s->level_count < 1 || s->level_count > LATHE_MAX_LEVELS) return LATHE_ERR_FORMAT;
    *fault = LATHE_FAULT("a structure's box");
    for (int i = 0; i < 3; i++) {
        int32_t margin = i < 2;
        if (s->size[i] < 1 + 2 * margin || s->size[i] > LATHE_MAX_DIM + 2 * margin) return LATHE_ERR_FORMAT;
        if (s->origin[i] < -margin || s->origin[i] > LATHE_MAX_DIM - s->size[i] + margin) return LATHE_ERR_FORMAT;
    }
    uint64_t row_words = ((uint64_t)s->size[0] + 63) / 64;
    *fault = LATHE_FAULT("a structure's box is larger than 1 GiB of bits");
    return row_words * 8 * (uint64_t)s->size[1] * (uint64_t)s->size[2] > LATHE_MAX_MASK_BYTES ? LATHE_ERR_LIMIT
                                                                                              : LATHE_OK;
}

lathe_status lathe__header_check(const lathe_header *header, const char **fault) {
    *fault = LATHE_FAULT("the slice axis or the boundary");
    if ((unsigned)header->axis > LATHE_AXIS_Z || (unsigned)header->boundary > LATHE_BOUNDARY_ISO)
        return LATHE_ERR_FORMAT;
    *fault = LATHE_FAULT("the affine transform");
    if (!affine_usable(header->affine)) return LATHE_ERR_FORMAT;
    *fault = LATHE_FAULT("the number of parameters");
    if (header->parameter_count > LATHE_MAX_PARAMETERS) return LATHE_ERR_FORMAT;
    *fault = LATHE_FAULT("the number of structures");
    if (header->structure_count < 1 || header->structure_count > LATHE_MAX_STRUCTURES) return LATHE_ERR_FORMAT;
    lathe_status status = LATHE_OK;
    for (uint32_t i = 0; i < header->structure_count && !status; i++)
        status = structure_check(&header->structures[i], fault);
    lathe_pyramid pyramid;
    if (status || !lathe__header_pyramid(header)) return status;
    *fault = LATHE_FAULT("the passes of a level");
    return lathe__pyramid_read(&pyramid, header);
}

static void parse_structure(lathe_header_structure *s, lathe_reader *body, const lathe_header_structure *previous) {
    memset(s, 0, sizeof *s);
    for (int i = 0; i < 3; i++)
        s->origin[i] = (int32_t)((uint32_t)previous->origin[i] + (uint32_t)lathe__unzigzag(lathe__read_varint(body)));
    for (int i = 0; i < 3; i++) {
        uint32_t size = lathe__read_varint(body);
        s->size[i] = size <= LATHE_MAX_DIM + 2 ? (int32_t)size : 0; /* 0 is refused by the check */
    }
    s->level_count = lathe__read_u8(body);
}

static double parse_number(lathe_reader *body, uint32_t form) {
    switch (form) {
    case LATHE_NUMBER_WHOLE: return (double)lathe__unzigzag(lathe__read_varint(body));
    case LATHE_NUMBER_FLOAT: return (double)lathe__read_f32(body);
    case LATHE_NUMBER_DOUBLE: return lathe__read_f64(body);
    default: return 0;
    }
}

static void parse_affine(double affine[3][4], lathe_reader *body) {
    for (int i = 0; i < 3; i++) {
        uint32_t forms = lathe__read_u8(body);
        for (int k = 0; k < 4; k++) affine[i][k] = parse_number(body, forms >> 2 * k & 3);
    }
}

static void parse_structures(lathe_header *header, lathe_reader *body) {
    header->structure_count = lathe__read_varint(body);
    if (body->status) return;
    if (header->structure_count > LATHE_MAX_STRUCTURES ||
        header->structure_count > lathe__reader_left(body) / LATHE_STRUCTURE_MIN_BYTES) {
        lathe__reader_fail(body, LATHE_ERR_FORMAT, LATHE_FAULT("more structures than the header has room for"));
        return;
    }
    header->structures = malloc((size_t)header->structure_count * sizeof *header->structures + 1);
    if (!header->structures) {
        lathe__reader_fail(body, LATHE_ERR_MEMORY, LATHE_FAULT("out of memory"));
        return;
    }
    static const lathe_header_structure before = {.level_count = 0};
    for (uint32_t i = 0; i < header->structure_count && !body->status; i++) {
        parse_structure(&header->structures[i], body, i ? &header->structures[i - 1] : &before);
        if (header->structures[i].level_count > header->level_count)
            header->level_count = header->structures[i].level_count;
    }
}

static void parse_body(lathe_header *header, lathe_reader *body) {
    uint8_t flags = lathe__read_u8(body);
    if (flags & 0xF8) lathe__reader_fail(body, LATHE_ERR_FORMAT, LATHE_FAULT("unknown header flags"));
    header->axis = (lathe_axis)(flags & 3);
    header->boundary = (lathe_boundary)(flags >> 2 & 1);
    parse_affine(header->affine, body);
    header->parameter_count = lathe__read_u8(body);
    if (header->parameter_count > LATHE_MAX_PARAMETERS)
        lathe__reader_fail(body, LATHE_ERR_FORMAT, LATHE_FAULT("too many parameters"));
    for (uint32_t i = 0; i < header->parameter_count && !body->status; i++)
        header->parameters[i] = lathe__read_varint(body);
    parse_structures(header, body);
    if (!body->status && body->at != body->end)
        lathe__reader_fail(body, LATHE_ERR_FORMAT, LATHE_FAULT("bytes left over in the header"));
    if (body->status == LATHE_MORE) { /* the record said that this is all */
        body->status = LATHE_ERR_FORMAT;
        body->fault = "the header ends early";
    }
    const char *fault;
    if (!body->status) {
        lathe_status status = lathe__header_check(header, &fault);
        if (status) lathe__reader_fail(body, status, fault);
    }
}

/* Any prefix of the magic is looked at: garbage is told apart from an early end at once. */
static void parse_magic(lathe_reader *reader) {
    static const uint8_t magic[LATHE_MAGIC_SIZE] = LATHE_MAGIC_BYTES;
    size_t there = lathe__reader_left(reader);
    size_t common = 0;
    while (common < there && common < LATHE_MAGIC_SIZE && reader->at[common] == magic[common]) common++;
    if (common == LATHE_MAGIC_SIZE || common == there) {
        (void)lathe__read_bytes(reader, LATHE_MAGIC_SIZE);
    } else if (common == LATHE_MAGIC_SIZE - 1) {
        lathe__reader_fail(reader, LATHE_ERR_UNSUPPORTED, LATHE_FAULT("a Lathe archive of another version"));
    } else {
        lathe__reader_fail(reader, LATHE_ERR_FORMAT, LATHE_FAULT("not a Lathe archive"));
    }
}

lathe_status lathe__header_parse(lathe_header *out, lathe_reader *reader) {
    const uint8_t *start = reader->at;
    parse_magic(reader);
    uint32_t size = lathe__read_varint(reader);
    if (!reader->status && size > LATHE_MAX_HEADER_BYTES)
        lathe__reader_fail(reader, LATHE_ERR_LIMIT, LATHE_FAULT("the header is too large"));
    size_t there = lathe__reader_left(reader);
    if (!reader->status && there < (size_t)size + LATHE_CRC_SIZE) {
        reader->lacking = (size_t)size + LATHE_CRC_SIZE - there;
        lathe__reader_fail(reader, LATHE_MORE, LATHE_FAULT("the header is not complete"));
    }
    const uint8_t *bytes = lathe__read_bytes(reader, size);
    read_checksum(reader, start, LATHE_FAULT("the header's checksum does not match"));
    if (reader->status) return reader->status;
    lathe_header header;
    memset(&header, 0, sizeof header);
    lathe_reader body = lathe__reader(bytes, size);
    parse_body(&header, &body);
    if (body.status) {
        lathe__header_free(&header);
        return lathe__reader_fail(reader, body.status, body.fault);
    }
    *out = header;
    return LATHE_OK;
}

void lathe__header_free(lathe_header *header) {
    free(header->structures);
    memset(header, 0, sizeof *header);
}

uint32_t lathe__header_present(const lathe_header *header, uint32_t level) {
    uint32_t count = 0;
    for (uint32_t i = 0; i < header->structure_count; i++) count += header->structures[i].level_count > level;
    return count;
}

uint32_t lathe__header_flags(const lathe_header *header) { return header->parameter_count > 1 ? header->parameters[1] : 0; }

uint32_t lathe__header_packets(const lathe_header *header, uint32_t level) {
    uint32_t present = lathe__header_present(header, level);
    lathe_pyramid pyramid;
    if (!lathe__header_pyramid(header) || lathe__pyramid_read(&pyramid, header)) return present;
    return (lathe__header_flags(header) & LATHE_FLAG_SHARED ? 1 : present) * lathe__pyramid_passes(&pyramid, level);
}

/* ---- level record ---- */

static bool error_usable(float v) { return v >= -1e30f && v <= 1e30f; }

static void parse_sizes(lathe_level_head *head, lathe_reader *reader) {
    size_t least = (size_t)head->count + LATHE_CRC_SIZE, there = lathe__reader_left(reader);
    if (there < least) {
        reader->lacking = least - there;
        lathe__reader_fail(reader, LATHE_MORE, LATHE_FAULT("the level record is not complete"));
        return;
    }
    head->sizes = malloc((size_t)head->count * sizeof *head->sizes + 1);
    if (!head->sizes) lathe__reader_fail(reader, LATHE_ERR_MEMORY, LATHE_FAULT("out of memory"));
    for (uint32_t i = 0; i < head->count && !reader->status; i++) {
        head->sizes[i] = lathe__read_varint(reader);
        head->body_bytes += (uint64_t)head->sizes[i] + LATHE_CRC_SIZE;
        if (head->sizes[i] > LATHE_MAX_PACKET_BYTES)
            lathe__reader_fail(reader, LATHE_ERR_LIMIT, LATHE_FAULT("a packet is too large"));
        if (reader->status == LATHE_MORE) reader->lacking = head->count - i + LATHE_CRC_SIZE;
    }
}

lathe_status lathe__level_parse(lathe_level_head *out, lathe_reader *reader, const lathe_header *header) {
    const uint8_t *start = reader->at;
    lathe_level_head head;
    memset(&head, 0, sizeof head);
    uint8_t tag = lathe__read_u8(reader);
    if (!reader->status && tag != LATHE_LEVEL_TAG)
        lathe__reader_fail(reader, LATHE_ERR_FORMAT, LATHE_FAULT("no level record where one must be"));
    head.level = lathe__read_varint(reader);
    if (!reader->status && head.level >= header->level_count)
        lathe__reader_fail(reader, LATHE_ERR_FORMAT, LATHE_FAULT("the number of a level"));
    head.error_rms_mm = lathe__read_f32(reader);
    head.error_max_mm = lathe__read_f32(reader);
    head.count = lathe__read_varint(reader);
    if (!reader->status && (!error_usable(head.error_rms_mm) || !error_usable(head.error_max_mm)))
        lathe__reader_fail(reader, LATHE_ERR_FORMAT, LATHE_FAULT("the error of a level"));
    if (!reader->status && head.count != lathe__header_packets(header, head.level))
        lathe__reader_fail(reader, LATHE_ERR_FORMAT, LATHE_FAULT("the number of packets of a level"));
    if (!reader->status) parse_sizes(&head, reader);
    read_checksum(reader, start, LATHE_FAULT("the checksum of a level record does not match"));
    if (reader->status) {
        lathe__level_head_free(&head);
        return reader->status;
    }
    *out = head;
    return LATHE_OK;
}

void lathe__level_head_free(lathe_level_head *head) {
    free(head->sizes);
    memset(head, 0, sizeof *head);
}

const uint8_t *lathe__packet_parse(lathe_reader *reader, uint32_t size) {
    size_t there = lathe__reader_left(reader);
    if (!reader->status && there < (size_t)size + LATHE_CRC_SIZE) {
        reader->lacking = (size_t)size + LATHE_CRC_SIZE - there;
        lathe__reader_fail(reader, LATHE_MORE, LATHE_FAULT("the packet is not complete"));
    }
    const uint8_t *payload = lathe__read_bytes(reader, size);
    if (!payload) return NULL;
    read_checksum(reader, payload, LATHE_FAULT("a packet's checksum does not match"));
    return reader->status ? NULL : payload;
}
