/* Label tables: lenient about lines, strict about what comes out (unique, clean names). */
#include "label_table.h"
#include "volume_internal.h"
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include <unistd.h>

enum {
    MAX_TABLE = 4 << 20,
    LUT_BYTES = 768,
    LUT_COLOURS = 256,
    MAX_FIELDS = 64,
    NAME_SIZE = sizeof((lathe_label *)0)->name
};

struct lathe_label_table {
    lathe_label *labels; /* ascending by label */
    size_t count, capacity, malformed;
    bool has_lut;
    uint8_t lut[LUT_BYTES];
};

/* ---- colours ----------------------------------------------------------------------------------------------------- */

/* Hues a golden angle apart: neighbouring labels look different, and no hue comes again. Integers: the same everywhere. */
static void made_up_colour(int64_t label, uint8_t rgb[3]) {
    const uint32_t golden = 0x9e3779b9u; /* 2^32 / golden ratio */
    uint32_t hue = (uint32_t)(uint64_t)label * golden, sector = (uint32_t)((uint64_t)hue * 6 >> 32);
    uint32_t part = (uint32_t)((uint64_t)hue * 6 & 0xffffffffu) >> 24; /* 0 .. 255 within the sector */
    const uint32_t high = 235, low = 85, up = low + (high - low) * part / 255, down = high - (high - low) * part / 255;
    const uint32_t wheel[6][3] = {{high, up, low},   {down, high, low}, {low, high, up},
                                  {low, down, high}, {up, low, high},   {high, low, down}};
    for (int k = 0; k < 3; k++) rgb[k] = (uint8_t)wheel[sector][k];
}

/* Black in a palette means "no colour", and nearly black would not be seen on a dark page. */
static bool is_visible(const uint8_t rgb[3]) { return rgb[0] + rgb[1] + rgb[2] >= 48; }

static void colour_of(const lathe_label_table *table, int64_t label, uint8_t rgb[3]) {
    if (table->has_lut && label >= 0 && label < LUT_COLOURS) {
        for (int k = 0; k < 3; k++) rgb[k] = table->lut[k * LUT_COLOURS + (size_t)label];
        if (is_visible(rgb)) return;
    }
    made_up_colour(label, rgb);
}

/* ---- names ------------------------------------------------------------------------------------------------------- */

/* Bytes of the UTF-8 character at s (at most left), 0 if it is not one: overlong forms, surrogates, beyond U+10FFFF. */
static size_t utf8_length(const uint8_t *s, size_t left) {
    if (s[0] < 0x80) return 1;
    size_t n = s[0] >= 0xc2 && s[0] <= 0xdf ? 2 : (s[0] & 0xf0) == 0xe0 ? 3 : s[0] >= 0xf0 && s[0] <= 0xf4 ? 4 : 0;
    if (!n || n > left) return 0;
    for (size_t i = 1; i < n; i++)
        if ((s[i] & 0xc0) != 0x80) return 0;
    if ((s[0] == 0xe0 && s[1] < 0xa0) || (s[0] == 0xed && s[1] > 0x9f)) return 0;
    if ((s[0] == 0xf0 && s[1] < 0x90) || (s[0] == 0xf4 && s[1] > 0x8f)) return 0;
    return n;
}

/* Copies what is valid; control characters (C1 too) and broken bytes become '_'. Cut between characters. */
static void clean_name(char out[NAME_SIZE], const char *text, size_t size) {
    size_t n = 0;
    for (size_t i = 0; i < size;) {
        size_t length = utf8_length((const uint8_t *)text + i, size - i);
        bool control = (uint8_t)text[i] < 0x20 || text[i] == 0x7f ||
                       (length == 2 && (uint8_t)text[i] == 0xc2 && (uint8_t)text[i + 1] < 0xa0);
        bool good = length && !control;
        size_t take = good ? length : 1;
        if (n + take >= NAME_SIZE) break;
        if (good)
            memcpy(out + n, text + i, length);
        else
            out[n] = '_';
        n += take;
        i += length ? length : 1;
    }
    out[n] = 0;
}

static int compare_names(const void *a, const void *b) {
    const lathe_label *x = *(lathe_label *const *)a, *y = *(lathe_label *const *)b;
    int order = strcmp(x->name, y->name);
    return order ? order : (x->label > y->label) - (x->label < y->label);
}

/* "name" -> "name-12": cut so that the label fits, between characters. */
static void append_label(lathe_label *label) {
    char suffix[24];
    int length = snprintf(suffix, sizeof suffix, "-%" PRId64, label->label);
    size_t keep = strlen(label->name);
    if (keep + (size_t)length >= NAME_SIZE) {
        keep = NAME_SIZE - 1 - (size_t)length;
        while (keep && ((uint8_t)label->name[keep] & 0xc0) == 0x80) keep--;
    }
    memcpy(label->name + keep, suffix, (size_t)length + 1);
}

/* True for a name that lathe_label_table_find makes up for another label. */
static bool is_made_up_for_another(const lathe_label *label) {
    char own[NAME_SIZE];
    snprintf(own, sizeof own, "label-%" PRId64, label->label);
    return !strncmp(label->name, "label-", 6) && strcmp(label->name, own);
}

/* The first of equal names keeps it, the others get their label appended. That may meet another name, hence the rounds;
 * names that are still equal after them are replaced by "label-N", which is nobody else's. */
static lathe_status make_unique(lathe_label_table *table) {
    lathe_label **sorted = malloc((table->count ? table->count : 1) * sizeof *sorted);
    if (!sorted) return LATHE_ERR_MEMORY;
    for (size_t i = 0; i < table->count; i++) {
        sorted[i] = &table->labels[i];
        if (is_made_up_for_another(sorted[i])) snprintf(sorted[i]->name, NAME_SIZE, "label-%" PRId64, sorted[i]->label);
    }
    bool again = true;
    for (int round = 0; round < 4 && again; round++) {
        again = false;
        qsort(sorted, table->count, sizeof *sorted, compare_names);
        const char *kept = NULL;
        char before[NAME_SIZE] = "";
        for (size_t i = 0; i < table->count; i++) {
            bool equal = kept && !strcmp(before, sorted[i]->name);
            if (!equal) {
                memcpy(before, sorted[i]->name, NAME_SIZE);
                kept = before;
                continue;
            }
            again = true;
            if (round < 3)
                append_label(sorted[i]);
            else
                snprintf(sorted[i]->name, NAME_SIZE, "label-%" PRId64, sorted[i]->label);
        }
    }
    free(sorted);
    return LATHE_OK;
}

/* ---- lines ------------------------------------------------------------------------------------------------------- */

typedef struct field {
    const char *at;
    size_t size;
} field;

static bool is_blank(char c) { return c == ' ' || c == '\t' || c == '\r' || c == '\v' || c == '\f'; }

/* Tables with tabs have names with spaces: there only tabs part fields. */
static size_t split(field fields[MAX_FIELDS], const char *line, size_t size) {
    bool tabs = false;
    while (size && is_blank(line[size - 1])) size--;
    while (size && is_blank(*line)) line++, size--;
    for (size_t i = 0; i < size; i++) tabs = tabs || line[i] == '\t';
    size_t count = 0;
    for (size_t i = 0; i < size && count < MAX_FIELDS;) {
        while (i < size && is_blank(line[i])) i++;
        size_t start = i;
        while (i < size && (tabs ? line[i] != '\t' : !is_blank(line[i]))) i++;
        size_t end = i;
        while (end > start && is_blank(line[end - 1])) end--;
        if (end > start) fields[count++] = (field){line + start, end - start};
    }
    return count;
}

static bool parse_integer(int64_t *out, field f) {
    bool negative = f.size && *f.at == '-';
    size_t i = negative;
    int64_t value = 0;
    if (f.size - i < 1 || f.size - i > 12) return false;
    for (; i < f.size; i++) {
        if (f.at[i] < '0' || f.at[i] > '9') return false;
        value = value * 10 + (f.at[i] - '0');
    }
    *out = negative ? -value : value;
    return true;
}

static bool parse_colours(uint8_t rgb[3], const field *fields) {
    for (int k = 0; k < 4; k++) {
        int64_t value;
        if (!parse_integer(&value, fields[k]) || value < 0 || value > 255) return false;
        if (k < 3) rgb[k] = (uint8_t)value;
    }
    return true;
}

/* The name is all that is left between the index and the numbers at the end. */
static bool parse_line(const lathe_label_table *table, lathe_label *out, const field *fields, size_t count) {
    if (count < 2 || !parse_integer(&out->label, fields[0])) return false;
    size_t last = count - 1;
    int64_t code;
    colour_of(table, out->label, out->rgb);
    uint8_t rgb[3];
    if (count >= 6 && parse_colours(rgb, fields + count - 4)) {
        last -= 4;
        if (is_visible(rgb)) memcpy(out->rgb, rgb, 3);
    } else if (count == 3 && parse_integer(&code, fields[2])) {
        last--;
    }
    clean_name(out->name, fields[1].at, (size_t)(fields[last].at + fields[last].size - fields[1].at));
    return out->name[0] != 0;
}

static lathe_status add_line(lathe_label_table *table, const char *line, size_t size) {
    field fields[MAX_FIELDS];
    size_t count = split(fields, line, size);
    if (!count || *fields[0].at == '#') return LATHE_OK;
    lathe_label label = {0};
    if (!parse_line(table, &label, fields, count)) {
        table->malformed++;
        return LATHE_OK;
    }
    if (table->count == table->capacity) {
        size_t capacity = table->capacity ? table->capacity * 2 : 128;
        lathe_label *grown = realloc(table->labels, capacity * sizeof *grown);
        if (!grown) return LATHE_ERR_MEMORY;
        table->labels = grown;
        table->capacity = capacity;
    }
    table->labels[table->count++] = label;
    return LATHE_OK;
}

static lathe_status add_lines(lathe_label_table *table, const char *text, size_t size) {
    if (size >= 3 && !memcmp(text, "\xef\xbb\xbf", 3)) text += 3, size -= 3; /* byte order mark */
    for (size_t start = 0; start < size;) {
        const char *newline = memchr(text + start, '\n', size - start);
        size_t end = newline ? (size_t)(newline - text) : size;
        lathe_status status = add_line(table, text + start, end - start);
        if (status) return status;
        start = end + 1;
    }
    return LATHE_OK;
}

/* ---- table ------------------------------------------------------------------------------------------------------- */

typedef struct placed {
    lathe_label label;
    size_t place;
} placed;

static int compare_placed(const void *a, const void *b) {
    const placed *x = a, *y = b;
    if (x->label.label != y->label.label) return x->label.label < y->label.label ? -1 : 1;
    return (x->place > y->place) - (x->place < y->place);
}

/* Ascending; of several lines for one label the first counts, the others are malformed. */
static lathe_status sort_labels(lathe_label_table *table) {
    placed *sorted = malloc((table->count ? table->count : 1) * sizeof *sorted);
    if (!sorted) return LATHE_ERR_MEMORY;
    for (size_t i = 0; i < table->count; i++) sorted[i] = (placed){table->labels[i], i};
    qsort(sorted, table->count, sizeof *sorted, compare_placed);
    size_t kept = 0;
    for (size_t i = 0; i < table->count; i++)
        if (!i || sorted[i].label.label != sorted[i - 1].label.label) table->labels[kept++] = sorted[i].label;
    table->malformed += table->count - kept;
    table->count = kept;
    free(sorted);
    return LATHE_OK;
}

lathe_status lathe_label_table_parse(lathe_label_table **out, const char *text, size_t size, const uint8_t *lut,
                                     lathe_error *err) {
    if (size > MAX_TABLE) return lathe_fail(err, LATHE_ERR_LIMIT, "the label table has more than %d bytes", MAX_TABLE);
    lathe_label_table *table = calloc(1, sizeof *table);
    lathe_status status = table ? LATHE_OK : LATHE_ERR_MEMORY;
    if (!status && lut) {
        table->has_lut = true;
        memcpy(table->lut, lut, LUT_BYTES);
    }
    if (!status) status = add_lines(table, text, size);
    if (!status) status = sort_labels(table);
    if (!status) status = make_unique(table);
    if (status) {
        lathe_label_table_close(&table);
        return lathe_fail(err, status, "no memory for the label table");
    }
    *out = table;
    return LATHE_OK;
}

/* The volume's path without .gz and .nii or .json, then the ending. */
static bool path_beside(char *out, size_t room, const char *path, const char *ending) {
    static const char *const SUFFIXES[] = {".nii.gz", ".nii", ".json"};
    size_t n = strlen(path);
    for (size_t i = 0; i < sizeof SUFFIXES / sizeof *SUFFIXES; i++) {
        size_t m = strlen(SUFFIXES[i]);
        if (n < m || strcasecmp(path + n - m, SUFFIXES[i])) continue;
        n -= m;
        break;
    }
    int length = snprintf(out, room, "%.*s%s", (int)n, path, ending);
    return length > 0 && (size_t)length < room;
}

/* The first of two files that exists; OK with *bytes NULL if there is none. */
static lathe_status read_beside(uint8_t **bytes, size_t *size, const char *path, const char *first, const char *second,
                                lathe_error *err) {
    const char *endings[2] = {first, second};
    *bytes = NULL;
    *size = 0;
    for (int i = 0; i < 2; i++) {
        char name[4096];
        if (!path_beside(name, sizeof name, path, endings[i]) || access(name, F_OK)) continue;
        return lathe__read_file(bytes, size, name, MAX_TABLE, err);
    }
    return LATHE_OK;
}

lathe_status lathe_label_table_open(lathe_label_table **out, const char *volume_path, lathe_error *err) {
    uint8_t *text = NULL, *lut = NULL;
    size_t text_size = 0, lut_size = 0;
    lathe_status status = read_beside(&text, &text_size, volume_path, ".nii.txt", ".txt", err);
    if (!status) status = read_beside(&lut, &lut_size, volume_path, ".nii.lut", ".lut", err);
    /* A palette of another size is another program's format. */
    if (!status)
        status = lathe_label_table_parse(out, text ? (const char *)text : "", text_size,
                                         lut_size == LUT_BYTES ? lut : NULL, err);
    free(text);
    free(lut);
    return status;
}

void lathe_label_table_close(lathe_label_table **table) {
    if (!table || !*table) return;
    free((*table)->labels);
    free(*table);
    *table = NULL;
}

bool lathe_label_table_find(const lathe_label_table *table, int64_t label, lathe_label *out) {
    size_t low = 0, high = table->count;
    while (low < high) {
        size_t middle = low + (high - low) / 2;
        if (table->labels[middle].label < label)
            low = middle + 1;
        else
            high = middle;
    }
    if (low < table->count && table->labels[low].label == label) {
        *out = table->labels[low];
        return true;
    }
    *out = (lathe_label){.label = label};
    snprintf(out->name, sizeof out->name, "label-%" PRId64, label);
    colour_of(table, label, out->rgb);
    return false;
}

size_t lathe_label_table_count(const lathe_label_table *table) { return table->count; }
const lathe_label *lathe_label_table_at(const lathe_label_table *table, size_t i) {
    return i < table->count ? &table->labels[i] : NULL;
}
size_t lathe_label_table_malformed(const lathe_label_table *table) { return table->malformed; }
