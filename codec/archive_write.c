/* The writer that a bake drives: header, level records as they are finished, footer; everything goes out in order. */
#include "archive_write.h"
#include "crc32c.h"
#include <stdlib.h>
#include <string.h>

struct lathe_archive_writer {
    lathe_sink sink;
    void *context;
    lathe_header header; /* a copy */
    lathe_status status; /* the first failure */
    uint32_t next_level;
    uint64_t written, header_bytes;
    uint64_t record_bytes[LATHE_MAX_LEVELS];
};

/* ---- names ---- */

void lathe__name_clean(char *out, size_t capacity, const char *name) {
    size_t n = 0;
    for (const char *s = name ? name : ""; *s;) {
        size_t length = lathe__utf8_length((const uint8_t *)s, strnlen(s, 4));
        bool valid = length && lathe__name_valid(s, length);
        if (!valid) length = 1;
        if (n + length >= capacity) break;
        if (valid)
            memcpy(out + n, s, length);
        else
            out[n] = '_';
        n += length;
        s += length;
    }
    out[n] = '\0';
    if (!n) strcpy(out, "unnamed");
}

static int compare_names(const void *a, const void *b) {
    const lathe_header_structure *const *x = a, *const *y = b;
    int order = strcmp((*x)->name, (*y)->name);
    return order ? order : (*x > *y) - (*x < *y);
}

int64_t lathe__header_duplicate(const lathe_header *header) {
    const lathe_header_structure **sorted = malloc((size_t)header->structure_count * sizeof *sorted + 1);
    if (!sorted) return -2;
    for (uint32_t i = 0; i < header->structure_count; i++) sorted[i] = &header->structures[i];
    qsort(sorted, header->structure_count, sizeof *sorted, compare_names);
    int64_t found = -1;
    for (uint32_t i = 1; i < header->structure_count && found < 0; i++)
        if (!strcmp(sorted[i - 1]->name, sorted[i]->name)) found = sorted[i] - header->structures;
    free(sorted);
    return found;
}

/* ---- header ---- */

static void put(lathe_archive_writer *writer, const void *bytes, size_t size) {
    if (writer->status || !size) return;
    if (writer->sink(writer->context, bytes, size)) writer->status = LATHE_ERR_IO;
    writer->written += size;
}

static void put_bytes(lathe_archive_writer *writer, lathe_bytes *bytes) {
    if (bytes->failed && !writer->status) writer->status = LATHE_ERR_MEMORY;
    put(writer, bytes->data, bytes->size);
    lathe__bytes_free(bytes);
}

static lathe_status check_names(const lathe_header *header, lathe_error *err) {
    for (uint32_t i = 0; i < header->structure_count; i++) {
        size_t length = strnlen(header->structures[i].name, sizeof header->structures[i].name);
        if (length > LATHE_NAME_MAX || !lathe__name_valid(header->structures[i].name, length))
            return lathe_fail(err, LATHE_ERR_FORMAT, "structure %u: the name must be 1 to %d bytes of UTF-8", i,
                              LATHE_NAME_MAX);
    }
    int64_t twin = lathe__header_duplicate(header);
    if (twin == -2) return lathe_fail(err, LATHE_ERR_MEMORY, "out of memory");
    if (twin >= 0)
        return lathe_fail(err, LATHE_ERR_FORMAT, "two structures are named '%s'; names must differ",
                          header->structures[twin].name);
    return LATHE_OK;
}

static lathe_status copy_header(lathe_header *out, const lathe_header *header) {
    *out = *header;
    size_t size = (size_t)header->structure_count * sizeof *header->structures;
    out->structures = malloc(size);
    if (!out->structures) return LATHE_ERR_MEMORY;
    memcpy(out->structures, header->structures, size);
    out->level_count = 0;
    for (uint32_t i = 0; i < header->structure_count; i++)
        if (header->structures[i].level_count > out->level_count) out->level_count = header->structures[i].level_count;
    return LATHE_OK;
}

lathe_status lathe__archive_begin(lathe_archive_writer **out, const lathe_header *header, lathe_sink sink,
                                  void *context, lathe_error *err) {
    const char *fault = "";
    lathe_status status = lathe__header_check(header, &fault);
    if (status) return lathe_fail(err, status, "the model cannot be written: %s is out of range", fault);
    status = check_names(header, err);
    if (status) return status;
    lathe_archive_writer *writer = calloc(1, sizeof *writer);
    if (!writer || copy_header(&writer->header, header)) {
        free(writer);
        return lathe_fail(err, LATHE_ERR_MEMORY, "out of memory");
    }
    writer->sink = sink;
    writer->context = context;
    lathe_bytes record = {0};
    lathe__emit_header(&record, &writer->header, 0, header->structure_count);
    put_bytes(writer, &record);
    writer->header_bytes = writer->written;
    status = writer->status;
    if (status) {
        lathe__archive_close(&writer);
        return lathe_fail(err, status, "the archive's header could not be written");
    }
    *out = writer;
    return LATHE_OK;
}

/* ---- levels ---- */

/* Not measured has one form, so that equal models are equal bytes. */
static float stored_error(float v) { return v >= 0 && v <= 1e30f ? v : -1.0f; }

static lathe_status make_head(lathe_level_head *head, const lathe_archive_writer *writer, const lathe_packet *packets,
                              uint32_t count) {
    if (writer->next_level >= writer->header.level_count) return LATHE_ERR_RANGE;
    if (count != lathe__header_packets(&writer->header, writer->next_level)) return LATHE_ERR_RANGE;
    for (uint32_t i = 0; i < count; i++)
        if (packets[i].size > LATHE_MAX_PACKET_BYTES) return LATHE_ERR_LIMIT;
    head->sizes = malloc((size_t)count * sizeof *head->sizes + 1);
    if (!head->sizes) return LATHE_ERR_MEMORY;
    head->level = writer->next_level;
    head->count = count;
    for (uint32_t i = 0; i < count; i++) head->sizes[i] = (uint32_t)packets[i].size;
    return LATHE_OK;
}

static void put_packet(lathe_archive_writer *writer, const lathe_packet *packet) {
    uint32_t crc = lathe__crc32c(0, packet->bytes, packet->size);
    uint8_t checksum[LATHE_CRC_SIZE] = {(uint8_t)crc, (uint8_t)(crc >> 8), (uint8_t)(crc >> 16), (uint8_t)(crc >> 24)};
    put(writer, packet->bytes, packet->size);
    put(writer, checksum, sizeof checksum);
}

lathe_status lathe__archive_level(lathe_archive_writer *writer, float error_rms_mm, float error_max_mm,
                                  const lathe_packet *packets, uint32_t count) {
    if (writer->status) return writer->status;
    lathe_level_head head = {.error_rms_mm = stored_error(error_rms_mm), .error_max_mm = stored_error(error_max_mm)};
    lathe_status status = make_head(&head, writer, packets, count);
    if (status) return status;
    uint64_t before = writer->written;
    lathe_bytes bytes = {0};
    lathe__emit_level_head(&bytes, &head);
    lathe__level_head_free(&head);
    put_bytes(writer, &bytes);
    for (uint32_t i = 0; i < count; i++) put_packet(writer, &packets[i]);
    writer->record_bytes[writer->next_level++] = writer->written - before;
    return writer->status;
}

/* ---- footer ---- */

static void emit_counts(lathe_bytes *footer, const lathe_level_info *level) {
    lathe__emit_varint(footer, level->rays);
    lathe__emit_varint(footer, level->slices);
    lathe__emit_varint(footer, level->vertices);
    lathe__emit_varint(footer, level->triangles);
    lathe__emit_varint(footer, level->draco_bytes);
}

static void emit_structure_levels(lathe_bytes *footer, const lathe_level_info *levels, uint32_t count) {
    for (uint32_t i = 0; i < count; i++) {
        emit_counts(footer, &levels[i]);
        lathe__emit_f32(footer, stored_error(levels[i].error_rms_mm));
        lathe__emit_f32(footer, stored_error(levels[i].error_max_mm));
        lathe__emit_varint(footer, levels[i].components_waiting);
        if (levels[i].components_waiting) lathe__emit_f32(footer, (float)levels[i].waiting_mm3);
    }
}

static void emit_footer(lathe_bytes *footer, const lathe_archive_writer *writer, const lathe_archive_stats *stats) {
    const lathe_header *header = &writer->header;
    char name[LATHE_MODEL_NAME_MAX + 1];
    lathe__name_clean(name, sizeof name, stats->name);
    lathe__emit_u8(footer, LATHE_FOOTER_TAG);
    lathe__emit_varint(footer, strlen(name));
    lathe__emit(footer, name, strlen(name));
    lathe__emit_f64(footer, stats->iso);
    lathe__emit_varint(footer, writer->header_bytes);
    lathe__emit_varint(footer, header->level_count);
    for (uint32_t i = 0; i < header->level_count; i++) {
        lathe__emit_varint(footer, writer->record_bytes[i]);
        emit_counts(footer, &stats->levels[i]);
    }
    static const lathe_header_structure nobody = {.level_count = 0};
    for (uint32_t i = 0; i < header->structure_count; i++) {
        lathe__emit_identity(footer, &header->structures[i], i ? &header->structures[i - 1] : &nobody);
        const lathe_level_info *first = stats->structures[i];
        lathe__emit_varint(footer, (uint64_t)first->components + first->components_waiting);
        emit_structure_levels(footer, first, header->structures[i].level_count);
    }
    lathe__emit_checksum(footer, 0);
}

lathe_status lathe__archive_finish(lathe_archive_writer *writer, const lathe_archive_stats *stats) {
    if (writer->status) return writer->status;
    if (writer->next_level != writer->header.level_count) return LATHE_ERR_RANGE;
    lathe_bytes footer = {0};
    emit_footer(&footer, writer, stats);
    size_t size = footer.size;
    if (size > UINT32_MAX) footer.failed = true;
    lathe__emit_u64(&footer, writer->written);
    lathe__emit_u32(&footer, (uint32_t)size);
    lathe__emit_u32(&footer, LATHE_TRAILER_MAGIC);
    put_bytes(writer, &footer);
    return writer->status;
}

void lathe__archive_close(lathe_archive_writer **writer) {
    if (!writer || !*writer) return;
    lathe__header_free(&(*writer)->header);
    free(*writer);
    *writer = NULL;
}
