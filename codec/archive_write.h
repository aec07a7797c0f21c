/* Writing archives: records into a buffer, and the writer that a bake drives. Never linked into the decoder. */
#ifndef LATHE_ARCHIVE_WRITE_H
#define LATHE_ARCHIVE_WRITE_H
#include "archive_format.h"
#include "lathe_codec.h"

/* ---- archive_emit.c: bytes that are being put together ---- */
typedef struct lathe_bytes {
    uint8_t *data; /* owned */
    size_t size, capacity;
    bool failed; /* an allocation failed: what was written is useless */
} lathe_bytes;   /* zeroed: empty */
void lathe__bytes_free(lathe_bytes *bytes);
void lathe__emit(lathe_bytes *bytes, const void *data, size_t size);
void lathe__emit_u8(lathe_bytes *bytes, uint8_t v);
void lathe__emit_u32(lathe_bytes *bytes, uint32_t v);
void lathe__emit_u64(lathe_bytes *bytes, uint64_t v);
void lathe__emit_f32(lathe_bytes *bytes, float v);
void lathe__emit_f64(lathe_bytes *bytes, double v);
void lathe__emit_varint(lathe_bytes *bytes, uint64_t v);
/* CRC-32C of everything from start. */
void lathe__emit_checksum(lathe_bytes *bytes, size_t start);

/* The header record of structures[first .. first + count). The header must have passed lathe__header_check. */
void lathe__emit_header(lathe_bytes *bytes, const lathe_header *header, uint32_t first, uint32_t count);
void lathe__emit_level_head(lathe_bytes *bytes, const lathe_level_head *head);

/* A lathe_sink that only counts: context is a uint64_t. */
int lathe__count_bytes(void *context, const void *bytes, size_t size);

/* ---- archive_names.c: name, colour and label of a structure, coded against the one before (the first: a zeroed one) ---- */
void lathe__emit_identity(lathe_bytes *bytes, const lathe_header_structure *s, const lathe_header_structure *previous);
/* FORMAT in the reader if the name is empty, not UTF-8, or has control characters. */
void lathe__parse_identity(lathe_header_structure *s, lathe_reader *body, const lathe_header_structure *previous);

/* ---- archive_write.c ---- */
typedef struct lathe_packet {
    const uint8_t *bytes;
    size_t size;
} lathe_packet;

/* Packets of a level, in order; owned. */
typedef struct lathe_packet_list { lathe_packet *at; uint32_t count, capacity; } lathe_packet_list;
/* Takes over the bytes, also on failure (MEMORY). */
lathe_status lathe__packets_add(lathe_packet_list *list, lathe_bytes *bytes);
void lathe__packets_free(lathe_packet_list *list);

/* What `info` shows. rms and max of the whole model are taken from the level records. */
typedef struct lathe_archive_stats {
    const char *name;               /* of the model; cleaned and cut to LATHE_MODEL_NAME_MAX bytes; may be NULL */
    double iso;                     /* NaN for labels */
    const lathe_level_info *levels; /* header.level_count */
    const lathe_level_info *const *structures; /* structures[s][level], level_count of each; polar_bytes is not used */
} lathe_archive_stats;

typedef struct lathe_archive_writer lathe_archive_writer;
/* Writes the header record. Keeps a copy of the header (level_count is computed). FORMAT or LIMIT, with the detail, if
 * a field is outside the format or two structures have one name. The sink must take what lathe_archive_writer calls
 * until it is closed. */
lathe_status lathe__archive_begin(lathe_archive_writer **out, const lathe_header *header, lathe_sink sink,
                                  void *context, lathe_error *err);
/* Writes the record of the next level (0, 1, ...). packets: lathe__header_packets of them
 * (RANGE). A negative error means not measured; NaN counts as such. */
lathe_status lathe__archive_level(lathe_archive_writer *writer, float error_rms_mm, float error_max_mm,
                                  const lathe_packet *packets, uint32_t count);
/* Writes the footer, after all levels (RANGE before). */
lathe_status lathe__archive_finish(lathe_archive_writer *writer, const lathe_archive_stats *stats);
void lathe__archive_close(lathe_archive_writer **writer); /* frees only; NULL and a pointer to NULL are fine */

/* Makes a valid name of any bytes: what is not UTF-8 or is a control character becomes '_', an empty name "unnamed";
 * cut to capacity - 1 bytes between characters. capacity >= 8. */
void lathe__name_clean(char *out, size_t capacity, const char *name);
/* Index of a structure whose name an earlier one has, or -1; -2 if memory is out. */
int64_t lathe__header_duplicate(const lathe_header *header);
#endif
