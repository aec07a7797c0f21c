/* A raw file and its JSON sidecar:
 * {"file": "a.raw", "dims": [x, y, z], "dtype": "uint8|int16|uint16|float32", "spacing": [mm, mm, mm]}
 * x fastest, little-endian; other keys are ignored. */
#include "volume_internal.h"
#include <jansson.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

enum { MAX_SIDECAR = 1 << 20, CHUNK_VOXELS = 1 << 14 };

static const struct {
    const char *name;
    lathe_raw_type type;
    size_t width;
} TYPES[] = {
    {"uint8", LATHE_RAW_UINT8, 1},
    {"int16", LATHE_RAW_INT16, 2},
    {"uint16", LATHE_RAW_UINT16, 2},
    {"float32", LATHE_RAW_FLOAT32, 4},
};

/* ---- sidecar ----------------------------------------------------------------------------------------------------- */

/* Only what lies beside or below the sidecar: a sidecar from elsewhere must not name files of the machine. */
static bool path_is_local(const char *path) {
    if (!*path || *path == '/') return false;
    for (const char *part = path; part; part = strchr(part, '/')) {
        if (*part == '/') part++;
        if (part[0] == '.' && part[1] == '.' && (part[2] == '/' || !part[2])) return false;
    }
    return true;
}

static lathe_status get_file(lathe_raw_header *h, const json_t *root, lathe_error *err) {
    const json_t *file = json_object_get(root, "file");
    if (!json_is_string(file))
        return lathe_fail(err, LATHE_ERR_FORMAT, "\"file\" must be a string: the raw file's name");
    if (json_string_length(file) >= sizeof h->file) return lathe_fail(err, LATHE_ERR_LIMIT, "\"file\" is too long");
    if (!path_is_local(json_string_value(file)))
        return lathe_fail(err, LATHE_ERR_FORMAT,
                          "\"file\" must be a relative path without \"..\": the raw file lies beside the "
                          "sidecar or below it");
    memcpy(h->file, json_string_value(file), json_string_length(file) + 1);
    return LATHE_OK;
}

static lathe_status get_dims(lathe_raw_header *h, const json_t *root, lathe_error *err) {
    const json_t *dims = json_object_get(root, "dims");
    if (!json_is_array(dims) || json_array_size(dims) != 3)
        return lathe_fail(err, LATHE_ERR_FORMAT, "\"dims\" must be an array of 3 whole numbers");
    for (size_t k = 0; k < 3; k++) {
        const json_t *item = json_array_get(dims, k);
        if (!json_is_integer(item)) return lathe_fail(err, LATHE_ERR_FORMAT, "\"dims\"[%zu] is not a whole number", k);
        h->dims[k] = json_integer_value(item);
    }
    return lathe__check_dims(h->dims, &h->voxels, err);
}

static lathe_status get_spacing(lathe_raw_header *h, const json_t *root, lathe_error *err) {
    const json_t *spacing = json_object_get(root, "spacing");
    if (!json_is_array(spacing) || json_array_size(spacing) != 3)
        return lathe_fail(err, LATHE_ERR_FORMAT, "\"spacing\" must be an array of 3 numbers in mm");
    for (size_t k = 0; k < 3; k++) {
        const json_t *item = json_array_get(spacing, k);
        double value = json_is_number(item) ? json_number_value(item) : 0;
        if (!(value > 1e-9 && value < 1e9))
            return lathe_fail(err, LATHE_ERR_FORMAT, "\"spacing\"[%zu] is not a positive number of mm", k);
        h->spacing[k] = value;
    }
    return LATHE_OK;
}

static lathe_status get_type(lathe_raw_header *h, const json_t *root, lathe_error *err) {
    const char *name = json_string_value(json_object_get(root, "dtype"));
    for (size_t i = 0; name && i < sizeof TYPES / sizeof *TYPES; i++) {
        if (strcmp(name, TYPES[i].name)) continue;
        h->type = TYPES[i].type;
        h->bytes = h->voxels * TYPES[i].width;
        return LATHE_OK;
    }
    return lathe_fail(err, LATHE_ERR_FORMAT, "\"dtype\" must be \"uint8\", \"int16\", \"uint16\" or \"float32\"");
}

lathe_status lathe__raw_header_parse(lathe_raw_header *out, const char *json, size_t size, lathe_error *err) {
    if (size > MAX_SIDECAR) return lathe_fail(err, LATHE_ERR_LIMIT, "the sidecar has more than %d bytes", MAX_SIDECAR);
    json_error_t where;
    json_t *root = json_loadb(json, size, JSON_REJECT_DUPLICATES, &where);
    if (!root)
        return lathe_fail(err,
                          json_error_code(&where) == json_error_out_of_memory ? LATHE_ERR_MEMORY : LATHE_ERR_FORMAT,
                          "line %d, column %d: %.160s", where.line, where.column, where.text);
    lathe_raw_header header = {0};
    lathe_status status = json_is_object(root) ? get_file(&header, root, err)
                                               : lathe_fail(err, LATHE_ERR_FORMAT, "the sidecar is not a JSON object");
    if (!status) status = get_dims(&header, root, err);
    if (!status) status = get_type(&header, root, err);
    if (!status) status = get_spacing(&header, root, err);
    json_decref(root);
    if (!status) *out = header;
    return status;
}

/* ---- data -------------------------------------------------------------------------------------------------------- */

static inline uint32_t little16(const uint8_t *p) { return p[0] | (uint32_t)p[1] << 8; }

static void convert(float *restrict out, const uint8_t *restrict p, size_t count, lathe_raw_type type) {
    switch (type) {
    case LATHE_RAW_UINT8:
        for (size_t i = 0; i < count; i++) out[i] = p[i];
        break;
    case LATHE_RAW_INT16:
        for (size_t i = 0; i < count; i++) out[i] = (int16_t)(uint16_t)little16(p + 2 * i);
        break;
    case LATHE_RAW_UINT16:
        for (size_t i = 0; i < count; i++) out[i] = (float)little16(p + 2 * i);
        break;
    case LATHE_RAW_FLOAT32:
        for (size_t i = 0; i < count; i++) {
            uint32_t bits = little16(p + 4 * i) | little16(p + 4 * i + 2) << 16;
            memcpy(out + i, &bits, sizeof bits);
        }
        break;
    }
}

lathe_status lathe__volume_raw_parse(lathe_volume **out, const lathe_raw_header *header, const uint8_t *bytes,
                                     size_t size, lathe_error *err) {
    if (size != header->bytes)
        return lathe_fail(err, LATHE_ERR_FORMAT, "the raw file has %zu bytes, but dims and dtype make %zu", size,
                          header->bytes);
    lathe_volume *volume = NULL;
    lathe_status status = lathe__volume_new(&volume, header->dims, header->spacing, err);
    if (status) return status;
    size_t width = header->bytes / header->voxels;
    lathe_scan scan;
    lathe__scan_start(&scan);
    for (size_t done = 0; done < header->voxels && scan.finite;) {
        size_t count = header->voxels - done < CHUNK_VOXELS ? header->voxels - done : CHUNK_VOXELS;
        convert(volume->values + done, bytes + done * width, count, header->type);
        lathe__scan_feed(&scan, volume->values + done, count);
        done += count;
    }
    status = lathe__volume_finish(volume, &scan, err);
    if (status)
        lathe_volume_close(&volume);
    else
        *out = volume;
    return status;
}

/* ---- both files -------------------------------------------------------------------------------------------------- */

static char *join_path(const char *sidecar, const char *file) {
    const char *slash = strrchr(sidecar, '/');
    size_t folder = slash ? (size_t)(slash - sidecar) + 1 : 0, length = folder + strlen(file) + 1;
    char *path = malloc(length);
    if (path) snprintf(path, length, "%.*s%s", (int)folder, sidecar, file);
    return path;
}

static lathe_status open_data(lathe_volume **out, const lathe_raw_header *header, const char *path, lathe_error *err) {
    uint8_t *bytes = NULL;
    size_t size = 0;
    struct stat info;
    if (!stat(path, &info) && S_ISREG(info.st_mode) && (uint64_t)info.st_size != header->bytes)
        return lathe_fail(err, LATHE_ERR_FORMAT, "%.200s: %lld bytes, but dims and dtype make %zu", path,
                          (long long)info.st_size, header->bytes); /* before memory is taken for it */
    lathe_status status = lathe__read_file(&bytes, &size, path, header->bytes, err);
    if (status) return status;
    lathe_error detail = {""};
    status = lathe__volume_raw_parse(out, header, bytes, size, &detail);
    free(bytes);
    return status ? lathe_fail(err, status, "%.200s: %.270s", path, detail.text) : LATHE_OK;
}

lathe_status lathe__volume_raw_open(lathe_volume **out, const char *path, lathe_error *err) {
    uint8_t *json = NULL;
    size_t size = 0;
    lathe_status status = lathe__read_file(&json, &size, path, MAX_SIDECAR, err);
    if (status) return status;
    lathe_raw_header header;
    lathe_error detail = {""};
    status = lathe__raw_header_parse(&header, (const char *)json, size, &detail);
    free(json);
    if (status) return lathe_fail(err, status, "%.200s: %.270s", path, detail.text);
    char *data = join_path(path, header.file);
    if (!data) return lathe_fail(err, LATHE_ERR_MEMORY, "no memory for a path");
    status = open_data(out, &header, data, err);
    free(data);
    return status;
}
