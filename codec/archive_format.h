/* The container of a model: constants and parsers of its records, shared by archives and the decoder. Decoder-safe.
 * docs/FORMAT.md specifies the bytes:
 *
 *   stream = header record, level record 0, level record 1, ...      what a client needs, in the order it needs it
 *   file   = stream, footer, trailer                                 the rest is for `info` and for finding the levels
 */
#ifndef LATHE_ARCHIVE_FORMAT_H
#define LATHE_ARCHIVE_FORMAT_H
#include "lathe.h"

#define LATHE_MAGIC_SIZE 8
#define LATHE_MAGIC_BYTES \
    { 0x89, 'L', 'T', 'H', 0x0D, 0x0A, 0x1A, LATHE_FORMAT_VERSION }
enum {
    LATHE_FORMAT_VERSION = 2,
    LATHE_LEVEL_TAG = 'L',
    LATHE_FOOTER_TAG = 'F',
    LATHE_CRC_SIZE = 4,
    LATHE_TRAILER_SIZE = 16,
    LATHE_NAME_MAX = 95, /* bytes of a structure's name */
    LATHE_MODEL_NAME_MAX = 255,
    LATHE_MAX_STRUCTURES = 65535,
    LATHE_MAX_PARAMETERS = 16,
    LATHE_STRUCTURE_MIN_BYTES = 7,    /* the shortest structure entry of a header */
    LATHE_LEVEL_STATS_MIN_BYTES = 14, /* the shortest entry of a structure's level in a footer */
    LATHE_MAX_HEADER_BYTES = 1 << 24,
    LATHE_MAX_PACKET_BYTES = 1 << 30
};
#define LATHE_TRAILER_MAGIC 0x5A48544Cu /* "LTHZ" in file order */
/* Of the bit mask of one structure: what a decoder may have to allocate for one small packet. 2048^3 bits. */
#define LATHE_MAX_MASK_BYTES (UINT64_C(1) << 30)

/* What is wrong with the input, for people: a small decoder has only the status' name. */
#ifdef LATHE_SMALL
#define LATHE_FAULT(text) ""
#else
#define LATHE_FAULT(text) text
#endif
/* What a small decoder says that does not read a model. */
#define LATHE_OTHERS "the model is made of something else: the whole decoder reads it"

/* ---- cursor: checked little-endian reads ---- */

/* Once a read fails, status stays, at stays and every read gives 0: callers read on and look once. */
typedef struct lathe_reader {
    const uint8_t *at, *end;
    lathe_status status; /* OK; MORE: beyond the end; FORMAT, CHECKSUM, ...: fault says what */
    size_t lacking;      /* with MORE: it is no use to try again with less than so many further bytes */
    const char *fault;   /* constant text, never NULL */
} lathe_reader;
lathe_reader lathe__reader(const uint8_t *bytes, size_t size);
static inline size_t lathe__reader_left(const lathe_reader *reader) { return (size_t)(reader->end - reader->at); }
/* Keeps the first failure. Returns it. */
lathe_status lathe__reader_fail(lathe_reader *reader, lathe_status status, const char *fault);
const uint8_t *lathe__read_bytes(lathe_reader *reader, size_t size); /* NULL if they are not there */
uint8_t lathe__read_u8(lathe_reader *reader);
uint32_t lathe__read_u32(lathe_reader *reader);
uint64_t lathe__read_u64(lathe_reader *reader);
float lathe__read_f32(lathe_reader *reader);
double lathe__read_f64(lathe_reader *reader);
uint32_t lathe__read_varint(lathe_reader *reader);   /* at most 5 bytes */
uint64_t lathe__read_varint64(lathe_reader *reader); /* at most 10 bytes */
static inline int32_t lathe__unzigzag(uint32_t v) { return (int32_t)(v >> 1 ^ (0u - (v & 1))); }
static inline uint32_t lathe__zigzag(int32_t v) { return (uint32_t)v << 1 ^ (v < 0 ? UINT32_MAX : 0); }
static inline int64_t lathe__unzigzag64(uint64_t v) { return (int64_t)(v >> 1 ^ (0u - (v & 1))); }
static inline uint64_t lathe__zigzag64(int64_t v) { return (uint64_t)v << 1 ^ (v < 0 ? UINT64_MAX : 0); }

/* ---- header record ---- */

typedef struct lathe_header_structure {
    /* Not in the header record but in the footer, for people; a decoder leaves them empty. */
    char name[LATHE_NAME_MAX + 1];
    uint8_t rgb[3];
    uint8_t level_count; /* 1 .. LATHE_MAX_LEVELS: it has packets in the records of levels 0 .. level_count - 1 */
    int64_t label;       /* -1: a threshold */
    int32_t origin[3], size[3]; /* as in lathe_mask: (u, v, w), margin of one pixel in u and v */
} lathe_header_structure;

/* How a number of the affine is written. */
enum { LATHE_NUMBER_ZERO, LATHE_NUMBER_WHOLE, LATHE_NUMBER_FLOAT, LATHE_NUMBER_DOUBLE };

/* Bits of parameter 1; parameter 0 is the fraction of border edges. SHARED: structures are coded one after the other by one model,
 * and none can be decoded alone. EXACT: every structure has slices, none is a radius map. PYRAMID: levels are rasters (pyramid.h).
 * SURE: of a pyramid: pixels that are nearly certain are coded by a small context alone (occupancy.h).
 * CUBES: of a pyramid: its surface is made cube by cube (raster_surface.h). */
enum {
    LATHE_FLAG_CAPS = 1, LATHE_FLAG_KEEP = 2, LATHE_FLAG_SHARED = 4, LATHE_FLAG_EXACT = 8, LATHE_FLAG_PYRAMID = 16, LATHE_FLAG_SURE = 32,
    LATHE_FLAG_CUBES = 64,
    LATHE_RASTER_FLAGS = LATHE_FLAG_PYRAMID | LATHE_FLAG_SURE | LATHE_FLAG_CUBES   /* what the decoder of rasters needs */
};

typedef struct lathe_header {
    lathe_axis axis;
    lathe_boundary boundary;
    double affine[3][4]; /* of the volume, file axes: voxel index -> world mm (see lathe__mask_transform) */
    uint32_t parameter_count;
    uint32_t parameters[LATHE_MAX_PARAMETERS]; /* of the packets' coding; the container does not interpret them */
    uint32_t structure_count;
    uint32_t level_count;               /* the most of any structure */
    lathe_header_structure *structures; /* owned */
} lathe_header;

/* Parses the header record at the reader and moves behind it. MORE: not all there (*out is untouched; reader->lacking is
 * exact as soon as the size is there). Allocates at most 24 times the record's size, and that only when the record is
 * complete and its checksum right. */
lathe_status lathe__header_parse(lathe_header *out, lathe_reader *reader);
uint32_t lathe__header_flags(const lathe_header *header);   /* parameter 1 */
/* A decoder of tubes refuses such headers and asks no more. */
static inline bool lathe__header_pyramid(const lathe_header *header) {
    return !LATHE_TUBES_ONLY && lathe__header_flags(header) & LATHE_FLAG_PYRAMID;
}
void lathe__header_free(lathe_header *header); /* clears; a zeroed one is fine */
/* How many structures have the level, and how many packets its record has: one for each; of a pyramid one for each pass and
 * structure, pass by pass, or with SHARED one for each pass. */
uint32_t lathe__header_present(const lathe_header *header, uint32_t level);
uint32_t lathe__header_packets(const lathe_header *header, uint32_t level);
/* FORMAT or LIMIT and *fault if a field is outside what the format allows. Used by the parser and by the writer. */
lathe_status lathe__header_check(const lathe_header *header, const char **fault);

/* ---- level record ---- */

/* Each packet is its payload, then the payload's CRC-32C (4 bytes). */
typedef struct lathe_level_head {
    uint32_t level;
    float error_rms_mm, error_max_mm; /* finite; negative: not measured */
    uint32_t count;
    uint32_t *sizes;     /* of the payloads, their checksums not included; owned */
    uint64_t body_bytes; /* of all packets behind the head, checksums included */
} lathe_level_head;
/* Parses the head of a level record and moves behind it, to the first packet. MORE as above. Allocates 4 * count
 * bytes. */
lathe_status lathe__level_parse(lathe_level_head *out, lathe_reader *reader, const lathe_header *header);
void lathe__level_head_free(lathe_level_head *head); /* clears; a zeroed one is fine */

/* A packet's payload, checked: NULL with MORE or CHECKSUM in the reader. */
const uint8_t *lathe__packet_parse(lathe_reader *reader, uint32_t size);

/* ---- names ---- */

/* Length of the UTF-8 sequence at s (left > 0 bytes are there), or 0: no overlong forms, surrogates, nothing beyond
 * U+10FFFF. */
size_t lathe__utf8_length(const uint8_t *s, size_t left);
/* UTF-8 without control characters, not empty. */
bool lathe__name_valid(const char *name, size_t size);
#endif
