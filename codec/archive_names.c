/* Names, colours and labels: for people, so they stand in the footer and the decoder never sees them. */
#include <string.h>
#include "archive_write.h"

size_t lathe__utf8_length(const uint8_t *s, size_t left) {
    if (s[0] < 0x80) return 1;
    size_t length = s[0] >= 0xF0 ? 4 : s[0] >= 0xE0 ? 3 : 2;
    if (s[0] < 0xC2 || s[0] > 0xF4 || length > left) return 0;
    for (size_t i = 1; i < length; i++)
        if ((s[i] & 0xC0) != 0x80) return 0;
    if ((s[0] == 0xE0 && s[1] < 0xA0) || (s[0] == 0xED && s[1] > 0x9F)) return 0;
    if ((s[0] == 0xF0 && s[1] < 0x90) || (s[0] == 0xF4 && s[1] > 0x8F)) return 0;
    return length;
}

bool lathe__name_valid(const char *name, size_t size) {
    const uint8_t *s = (const uint8_t *)name;
    for (size_t i = 0; i < size;) {
        size_t length = lathe__utf8_length(s + i, size - i);
        if (!length || s[i] < 0x20 || s[i] == 0x7F) return false;
        i += length;
    }
    return size > 0;
}

/* A name shares a prefix with the one before: Frontal_Sup_L, Frontal_Sup_R. */
static void parse_name(char name[LATHE_NAME_MAX + 1], lathe_reader *body, const lathe_header_structure *previous) {
    uint32_t shared = lathe__read_varint(body), rest = lathe__read_varint(body);
    if (shared > LATHE_NAME_MAX || rest > LATHE_NAME_MAX - shared || shared > strlen(previous->name)) {
        lathe__reader_fail(body, LATHE_ERR_FORMAT, "the length of a structure's name");
        return;
    }
    const uint8_t *bytes = lathe__read_bytes(body, rest);
    if (!bytes) return;
    memcpy(name, previous->name, shared);
    memcpy(name + shared, bytes, rest);
    if (strlen(name) != shared + rest || !lathe__name_valid(name, shared + rest)) lathe__reader_fail(body, LATHE_ERR_FORMAT, "a structure's name");
}

void lathe__parse_identity(lathe_header_structure *s, lathe_reader *body, const lathe_header_structure *previous) {
    parse_name(s->name, body, previous);
    const uint8_t *rgb = lathe__read_bytes(body, 3);
    if (rgb) memcpy(s->rgb, rgb, 3);
    uint64_t label = (uint64_t)previous->label + (uint64_t)lathe__unzigzag64(lathe__read_varint64(body));
    memcpy(&s->label, &label, sizeof label);
}

void lathe__emit_identity(lathe_bytes *bytes, const lathe_header_structure *s, const lathe_header_structure *previous) {
    size_t shared = 0, length = strlen(s->name);
    while (shared < length && s->name[shared] == previous->name[shared]) shared++;
    lathe__emit_varint(bytes, shared);
    lathe__emit_varint(bytes, length - shared);
    lathe__emit(bytes, s->name + shared, length - shared);
    lathe__emit(bytes, s->rgb, 3);
    uint64_t step = (uint64_t)s->label - (uint64_t)previous->label;
    int64_t delta;
    memcpy(&delta, &step, sizeof delta);
    lathe__emit_varint(bytes, lathe__zigzag64(delta));
}
