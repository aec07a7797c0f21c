#include "service.h"
#include <stdlib.h>
#include <string.h>

int lathe__buffer_append(void *context, const void *bytes, size_t size) {
    lathe_buffer *buffer = context;
    if (size > buffer->capacity - buffer->size) {
        if (size > SIZE_MAX / 4 || buffer->size > SIZE_MAX / 4) return 1;
        size_t capacity = buffer->capacity ? buffer->capacity : 4096;
        while (capacity < buffer->size + size) capacity *= 2;
        uint8_t *grown = realloc(buffer->bytes, capacity);
        if (!grown) return 1;
        buffer->bytes = grown;
        buffer->capacity = capacity;
    }
    if (size) memcpy(buffer->bytes + buffer->size, bytes, size);
    buffer->size += size;
    return 0;
}

int lathe__buffer_text(lathe_buffer *buffer, const char *text) {
    return lathe__buffer_append(buffer, text, strlen(text));
}

void lathe__buffer_free(lathe_buffer *buffer) {
    free(buffer->bytes);
    *buffer = (lathe_buffer){0};
}

int lathe__buffer_base64(lathe_buffer *buffer, const uint8_t *bytes, size_t size) {
    static const char digits[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    for (size_t i = 0; i < size; i += 3) {
        size_t left = size - i;
        uint32_t three =
            (uint32_t)bytes[i] << 16 | (left > 1 ? (uint32_t)bytes[i + 1] << 8 : 0) | (left > 2 ? bytes[i + 2] : 0);
        char four[4] = {digits[three >> 18], digits[three >> 12 & 63], left > 1 ? digits[three >> 6 & 63] : '=',
                        left > 2 ? digits[three & 63] : '='};
        if (lathe__buffer_append(buffer, four, 4)) return 1;
    }
    return 0;
}

static uint64_t mix(uint64_t a, uint64_t b) {
    unsigned __int128 product = (unsigned __int128)(a ^ 0x9e3779b97f4a7c15u) * (b ^ 0xbf58476d1ce4e5b9u);
    return (uint64_t)product ^ (uint64_t)(product >> 64);
}

static uint64_t load64(const uint8_t *p, size_t size) {
    uint64_t word = 0;
    for (size_t i = 0; i < size; i++) word |= (uint64_t)p[i] << 8 * i;
    return word;
}

void lathe__hash(char out[LATHE_HASH_SIZE], const void *bytes, size_t size) {
    static const char hex[] = "0123456789abcdef";
    const uint8_t *p = bytes;
    uint64_t state[2] = {mix(size, 1), mix(size, 2)};
    for (size_t i = 0; i < size; i += 8) {
        uint64_t word = load64(p + i, size - i < 8 ? size - i : 8);
        state[0] = mix(state[0] ^ word, 0x94d049bb133111ebu);
        state[1] = mix(state[1] + word, 0x2545f4914f6cdd1du) + state[0];
    }
    state[0] = mix(state[0], state[1]);
    state[1] = mix(state[1], state[0] + 3);
    for (int i = 0; i < 32; i++) out[i] = hex[state[i / 16] >> 4 * (i % 16) & 15];
    out[32] = 0;
}
