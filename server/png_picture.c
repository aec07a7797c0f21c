/* PNG (ISO/IEC 15948): four kinds of chunks, rows as differences from the one above, zlib for the rest. */
#include "png_picture.h"
#include <stdlib.h>
#include <string.h>
#include <zlib.h>

enum { MAX_SIDE = 16384, CHUNK = 12, HEADER = 13, PHYSICAL = 9 };

static void put_u32(uint8_t *at, uint32_t value) {
    for (int k = 0; k < 4; k++) at[k] = (uint8_t)(value >> (24 - 8 * k));
}

/* Length, type, data, checksum; data may already be in its place. Returns what follows the chunk. */
static uint8_t *put_chunk(uint8_t *at, const char type[4], const uint8_t *data, uint32_t size) {
    put_u32(at, size);
    memcpy(at + 4, type, 4);
    if (size && data != at + 8) memcpy(at + 8, data, size);
    put_u32(at + 8 + size, (uint32_t)crc32(0, at + 4, size + 4));
    return at + CHUNK + size;
}

/* Each row behind a byte that says that it is the difference from the row above. */
static void filter_rows(uint8_t *out, const uint8_t *rgba, uint32_t width, uint32_t height) {
    size_t row = (size_t)width * 4;
    for (uint32_t y = 0; y < height; y++) {
        const uint8_t *now = rgba + y * row, *above = y ? now - row : NULL;
        *out++ = 2;
        for (size_t i = 0; i < row; i++) *out++ = (uint8_t)(now[i] - (above ? above[i] : 0));
    }
}

lathe_status lathe__png_write(uint8_t **bytes, size_t *size, const uint8_t *rgba, uint32_t width, uint32_t height,
                              double pixel_mm) {
    static const uint8_t signature[8] = {0x89, 'P', 'N', 'G', '\r', '\n', 0x1a, '\n'};
    if (!width || !height || width > MAX_SIDE || height > MAX_SIDE) return LATHE_ERR_LIMIT;
    uLong raw = ((uLong)width * 4 + 1) * height;
    uLongf packed = compressBound(raw);
    uint8_t *rows = malloc(raw), *out = malloc(sizeof signature + 4 * CHUNK + HEADER + PHYSICAL + packed);
    if (!rows || !out) {
        free(rows);
        free(out);
        return LATHE_ERR_MEMORY;
    }
    filter_rows(rows, rgba, width, height);
    uint8_t header[HEADER] = {[8] = 8 /* bits */, [9] = 6 /* RGBA */}, physical[PHYSICAL] = {[8] = 1 /* metre */};
    put_u32(header, width);
    put_u32(header + 4, height);
    double density = pixel_mm > 0 ? 1000 / pixel_mm : 0;
    memcpy(out, signature, sizeof signature);
    uint8_t *at = put_chunk(out + sizeof signature, "IHDR", header, HEADER);
    if (density >= 1 && density < 2e9) {
        put_u32(physical, (uint32_t)(density + 0.5));
        put_u32(physical + 4, (uint32_t)(density + 0.5));
        at = put_chunk(at, "pHYs", physical, PHYSICAL);
    }
    int result = compress2(at + 8, &packed, rows, raw, 6);
    free(rows);
    if (result != Z_OK || packed > INT32_MAX) {
        free(out);
        return result == Z_MEM_ERROR ? LATHE_ERR_MEMORY : LATHE_ERR_LIMIT;
    }
    at = put_chunk(at, "IDAT", at + 8, (uint32_t)packed);
    at = put_chunk(at, "IEND", NULL, 0);
    *bytes = out;
    *size = (size_t)(at - out);
    return LATHE_OK;
}
