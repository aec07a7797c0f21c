/* The records of the container as bytes: the counterpart of archive_parse.c. */
#include "archive_write.h"
#include "crc32c.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

void lathe__bytes_free(lathe_bytes *bytes) {
    free(bytes->data);
    memset(bytes, 0, sizeof *bytes);
}

static bool reserve(lathe_bytes *bytes, size_t more) {
    if (bytes->failed) return false;
    if (more <= bytes->capacity - bytes->size) return true;
    bytes->failed = more > SIZE_MAX / 4 || bytes->size > SIZE_MAX / 4;
    if (bytes->failed) return false;
    size_t capacity = (bytes->size + more) * 3 / 2 + 64;
    uint8_t *data = realloc(bytes->data, capacity);
    bytes->failed = !data;
    if (!data) return false;
    bytes->data = data;
    bytes->capacity = capacity;
    return true;
}

void lathe__emit(lathe_bytes *bytes, const void *data, size_t size) {
    if (!size || !reserve(bytes, size)) return;
    memcpy(bytes->data + bytes->size, data, size);
    bytes->size += size;
}

static void emit_little(lathe_bytes *bytes, uint64_t v, size_t size) {
    uint8_t little[8];
    for (size_t i = 0; i < size; i++) little[i] = (uint8_t)(v >> 8 * i);
    lathe__emit(bytes, little, size);
}

void lathe__emit_u8(lathe_bytes *bytes, uint8_t v) { emit_little(bytes, v, 1); }
void lathe__emit_u32(lathe_bytes *bytes, uint32_t v) { emit_little(bytes, v, 4); }
void lathe__emit_u64(lathe_bytes *bytes, uint64_t v) { emit_little(bytes, v, 8); }

void lathe__emit_f32(lathe_bytes *bytes, float v) {
    uint32_t bits;
    memcpy(&bits, &v, sizeof bits);
    lathe__emit_u32(bytes, bits);
}

void lathe__emit_f64(lathe_bytes *bytes, double v) {
    uint64_t bits;
    memcpy(&bits, &v, sizeof bits);
    lathe__emit_u64(bytes, bits);
}

void lathe__emit_varint(lathe_bytes *bytes, uint64_t v) {
    for (; v >= 128; v >>= 7) lathe__emit_u8(bytes, (uint8_t)(v | 128));
    lathe__emit_u8(bytes, (uint8_t)v);
}

void lathe__emit_checksum(lathe_bytes *bytes, size_t start) {
    if (bytes->failed) return;
    lathe__emit_u32(bytes, lathe__crc32c(0, bytes->data + start, bytes->size - start));
}

/* NIfTI's transforms are floats: 48 bytes of the first kilobytes saved. */
/* Most of an affine is zero or whole. */
static uint32_t form_of(double v) {
    if (v == 0) return LATHE_NUMBER_ZERO;
    if (v == (double)(int32_t)(fabs(v) < 1e9 ? v : 0)) return LATHE_NUMBER_WHOLE;
    return (double)(float)v == v ? LATHE_NUMBER_FLOAT : LATHE_NUMBER_DOUBLE;
}

static void emit_affine(lathe_bytes *bytes, const double affine[3][4]) {
    for (int i = 0; i < 3; i++) {
        uint32_t forms = 0;
        for (int k = 0; k < 4; k++) forms |= form_of(affine[i][k]) << 2 * k;
        lathe__emit_u8(bytes, (uint8_t)forms);
        for (int k = 0; k < 4; k++) {
            double v = affine[i][k];
            switch (forms >> 2 * k & 3) {
            case LATHE_NUMBER_WHOLE: lathe__emit_varint(bytes, lathe__zigzag((int64_t)v)); break;
            case LATHE_NUMBER_FLOAT: lathe__emit_f32(bytes, (float)v); break;
            case LATHE_NUMBER_DOUBLE: lathe__emit_f64(bytes, v); break;
            }
        }
    }
}

static void emit_structure(lathe_bytes *bytes, const lathe_header_structure *s,
                           const lathe_header_structure *previous) {
    for (int i = 0; i < 3; i++) lathe__emit_varint(bytes, lathe__zigzag(s->origin[i] - previous->origin[i]));
    for (int i = 0; i < 3; i++) lathe__emit_varint(bytes, (uint32_t)s->size[i]);
    lathe__emit_u8(bytes, s->level_count);
}

static void emit_body(lathe_bytes *bytes, const lathe_header *header, uint32_t first, uint32_t count) {
    lathe__emit_u8(bytes, (uint8_t)((unsigned)header->axis | (unsigned)header->boundary << 2));
    emit_affine(bytes, header->affine);
    lathe__emit_u8(bytes, (uint8_t)header->parameter_count);
    for (uint32_t i = 0; i < header->parameter_count; i++) lathe__emit_varint(bytes, header->parameters[i]);
    lathe__emit_varint(bytes, count);
    static const lathe_header_structure before = {.level_count = 0};
    for (uint32_t i = first; i < first + count; i++)
        emit_structure(bytes, &header->structures[i], i > first ? &header->structures[i - 1] : &before);
}

void lathe__emit_header(lathe_bytes *bytes, const lathe_header *header, uint32_t first, uint32_t count) {
    static const uint8_t magic[LATHE_MAGIC_SIZE] = LATHE_MAGIC_BYTES;
    lathe_bytes body = {0};
    emit_body(&body, header, first, count);
    size_t start = bytes->size;
    lathe__emit(bytes, magic, sizeof magic);
    lathe__emit_varint(bytes, body.size);
    lathe__emit(bytes, body.data, body.size);
    lathe__emit_checksum(bytes, start);
    bytes->failed = bytes->failed || body.failed;
    lathe__bytes_free(&body);
}

void lathe__emit_level_head(lathe_bytes *bytes, const lathe_level_head *head) {
    size_t start = bytes->size;
    lathe__emit_u8(bytes, LATHE_LEVEL_TAG);
    lathe__emit_varint(bytes, head->level);
    lathe__emit_f32(bytes, head->error_rms_mm);
    lathe__emit_f32(bytes, head->error_max_mm);
    lathe__emit_varint(bytes, head->count);
    for (uint32_t i = 0; i < head->count; i++) lathe__emit_varint(bytes, head->sizes[i]);
    lathe__emit_checksum(bytes, start);
}

int lathe__count_bytes(void *context, const void *bytes, size_t size) {
    (void)bytes;
    *(uint64_t *)context += size;
    return 0;
}

/* ---- packets ---- */

lathe_status lathe__packets_add(lathe_packet_list *list, lathe_bytes *bytes) {
    uint32_t capacity = list->count < list->capacity ? list->capacity : list->capacity * 2 + 8;
    lathe_packet *more = capacity == list->capacity ? list->at : realloc(list->at, capacity * sizeof *more);
    if (!more) {
        lathe__bytes_free(bytes);
        return LATHE_ERR_MEMORY;
    }
    list->at = more;
    list->capacity = capacity;
    list->at[list->count++] = (lathe_packet){bytes->data, bytes->size};
    *bytes = (lathe_bytes){0};
    return LATHE_OK;
}

void lathe__packets_free(lathe_packet_list *list) {
    for (uint32_t i = 0; i < list->count; i++) free((void *)(uintptr_t)list->at[i].bytes);
    free(list->at);
    *list = (lathe_packet_list){0};
}
