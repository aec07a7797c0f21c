/* For fuzzing: puts right checksums over damaged bytes of a stream or archive, so that what is behind them is reached. */
#ifndef LATHE_MEND_STREAM_H
#define LATHE_MEND_STREAM_H
#include "crc32c.h"
#include <stdbool.h>
#include <stdint.h>
#include <string.h>

typedef struct mender { uint8_t *bytes; size_t size, at; } mender;

static inline bool mend_skip(mender *m, size_t count) {
    if (count > m->size - m->at) return false;
    m->at += count;
    return true;
}
static inline bool mend_varint(mender *m, uint64_t *value) {
    *value = 0;
    for (int shift = 0; shift < 35 && m->at < m->size; shift += 7) {
        uint8_t byte = m->bytes[m->at++];
        *value |= (uint64_t)(byte & 127) << shift;
        if (byte < 128) return true;
    }
    return false;
}
static inline bool mend_checksum(mender *m, size_t from) {
    if (m->size - m->at < 4) return false;
    uint32_t crc = lathe__crc32c(0, m->bytes + from, m->at - from);
    for (int i = 0; i < 4; i++) m->bytes[m->at++] = (uint8_t)(crc >> 8 * i);
    return true;
}
static inline bool mend_header(mender *m) {
    uint64_t size;
    size_t from = m->at;
    return mend_skip(m, 8) && mend_varint(m, &size) && mend_skip(m, (size_t)size) && mend_checksum(m, from);
}
/* Sizes are read a second time for the packets, so that none need be kept. */
static inline bool mend_level(mender *m) {
    uint64_t level, count, size;
    size_t from = m->at;
    if (!mend_skip(m, 1) || !mend_varint(m, &level) || !mend_skip(m, 8) || !mend_varint(m, &count)) return false;
    mender sizes = *m;
    for (uint64_t i = 0; i < count; i++)
        if (!mend_varint(m, &size)) return false;
    if (!mend_checksum(m, from)) return false;
    for (uint64_t i = 0; i < count; i++) {
        mend_varint(&sizes, &size);
        size_t packet = m->at;
        if (!mend_skip(m, (size_t)size) || !mend_checksum(m, packet)) return false;
    }
    return true;
}
static inline void mend_stream(uint8_t *bytes, size_t size) {
    mender m = {bytes, size, 0};
    if (!mend_header(&m)) return;
    while (m.at < size && bytes[m.at] == 0x4c)
        if (!mend_level(&m)) return;
}
/* The same, and the footer between the stream and the last 16 bytes. */
static inline void mend_archive(uint8_t *bytes, size_t size) {
    if (size < 20) return;
    uint64_t footer = 0;
    for (int i = 0; i < 8; i++) footer |= (uint64_t)bytes[size - 16 + (size_t)i] << 8 * i;
    if (footer > size - 20) return;
    mend_stream(bytes, (size_t)footer);
    mender m = {bytes, size - 16, size - 20};
    mend_checksum(&m, (size_t)footer);
}
#endif
