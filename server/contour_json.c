#include "contour_json.h"
#include "volume_internal.h"
#include <jansson.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

enum { MOST_BYTES = 1 << 26 };

typedef struct reading {
    double (*points)[2];
    lathe_raw_polygon *polygons;
    lathe_raw_section *sections;
    uint32_t point_count, polygon_count;
    double unit;               /* mm */
    bool has_z;                /* the section's height is known */
    double z;
    lathe_error *err;
} reading;

static lathe_status get_unit(reading *r, const json_t *root) {
    static const struct { const char *name; double mm; } units[] = {{"mm", 1}, {"um", 1e-3}, {"cm", 10}, {"m", 1000}};
    const json_t *unit = json_object_get(root, "unit");
    r->unit = 1;
    if (!unit) return LATHE_OK;
    for (size_t i = 0; json_is_string(unit) && i < sizeof units / sizeof *units; i++)
        if (strcmp(json_string_value(unit), units[i].name) == 0) {
            r->unit = units[i].mm;
            return LATHE_OK;
        }
    return lathe_fail(r->err, LATHE_ERR_UNSUPPORTED, "\"unit\" is none of \"mm\", \"um\", \"cm\", \"m\"");
}

/* A point may have a third coordinate, if the whole section has only one. */
static lathe_status get_point(reading *r, const json_t *point, size_t s, size_t k, size_t i) {
    size_t n = json_array_size(point);
    if (n != 2 && n != 3)
        return lathe_fail(r->err, LATHE_ERR_FORMAT,
                          "section %zu, polygon %zu, point %zu: not an array of 2 or 3 numbers", s, k, i);
    for (size_t a = 0; a < n; a++) {
        const json_t *x = json_array_get(point, a);
        if (!json_is_number(x))
            return lathe_fail(r->err, LATHE_ERR_FORMAT, "section %zu, polygon %zu, point %zu: not a number", s, k, i);
        double value = json_number_value(x) * r->unit;
        if (a < 2) r->points[r->point_count][a] = value;
        else if (!r->has_z) r->z = value, r->has_z = true;
        else if (!(fabs(value - r->z) <= 1e-9 * (1 + fabs(r->z))))
            return lathe_fail(r->err, LATHE_ERR_FORMAT,
                              "section %zu, polygon %zu, point %zu: its height %g mm is not the section's, %g mm", s, k,
                              i, value, r->z);
    }
    r->point_count++;
    return LATHE_OK;
}

static lathe_status get_section(reading *r, const json_t *section, size_t s) {
    const json_t *z = json_object_get(section, "z"), *polygons = json_object_get(section, "polygons");
    if (z && !json_is_number(z)) return lathe_fail(r->err, LATHE_ERR_FORMAT, "section %zu: \"z\" is not a number", s);
    if (!json_is_array(polygons))
        return lathe_fail(r->err, LATHE_ERR_FORMAT, "section %zu: \"polygons\" is not an array", s);
    r->has_z = z != NULL;
    r->z = json_number_value(z) * r->unit;
    r->sections[s] = (lathe_raw_section){0, r->polygon_count, (uint32_t)json_array_size(polygons)};
    for (size_t k = 0; k < json_array_size(polygons); k++) {
        const json_t *polygon = json_array_get(polygons, k);
        if (!json_is_array(polygon))
            return lathe_fail(r->err, LATHE_ERR_FORMAT, "section %zu, polygon %zu: not an array of points", s, k);
        r->polygons[r->polygon_count++] = (lathe_raw_polygon){r->point_count, (uint32_t)json_array_size(polygon)};
        for (size_t i = 0; i < json_array_size(polygon); i++) {
            lathe_status status = get_point(r, json_array_get(polygon, i), s, k, i);
            if (status) return status;
        }
    }
    if (!r->has_z)
        return lathe_fail(r->err, LATHE_ERR_FORMAT, "section %zu: no \"z\", and no point with three coordinates", s);
    r->sections[s].z = r->z;
    return LATHE_OK;
}

/* How much there is, so that arrays need not grow. What is no array counts as empty here and is complained about
 * later. */
static lathe_status allocate(reading *r, const json_t *sections) {
    size_t polygons = 0, points = 0, count = json_array_size(sections);
    for (size_t s = 0; s < count; s++) {
        const json_t *list = json_object_get(json_array_get(sections, s), "polygons");
        polygons += json_array_size(list);
        for (size_t k = 0; k < json_array_size(list); k++) points += json_array_size(json_array_get(list, k));
    }
    if (points > LATHE_SET_POINTS) return lathe_fail(r->err, LATHE_ERR_LIMIT, "more than %d points", LATHE_SET_POINTS);
    if (count > LATHE_SET_SECTIONS)
        return lathe_fail(r->err, LATHE_ERR_LIMIT, "more than %d sections", LATHE_SET_SECTIONS);
    if (polygons > (size_t)LATHE_SET_POLYGONS * LATHE_SET_SECTIONS)
        return lathe_fail(r->err, LATHE_ERR_LIMIT, "too many polygons");
    r->points = malloc((points + 1) * sizeof *r->points);
    r->polygons = malloc((polygons + 1) * sizeof *r->polygons);
    r->sections = malloc((count + 1) * sizeof *r->sections);
    return r->points && r->polygons && r->sections ? LATHE_OK : lathe_fail(r->err, LATHE_ERR_MEMORY, "out of memory");
}

static lathe_status read_root(lathe_contour_set *out, lathe_set_repairs *repairs, const json_t *root,
                              lathe_error *err) {
    const json_t *sections = json_object_get(root, "sections");
    reading r = {.err = err};
    if (!json_is_array(sections)) return lathe_fail(err, LATHE_ERR_FORMAT, "\"sections\" is not an array");
    lathe_status status = get_unit(&r, root);
    if (!status) status = allocate(&r, sections);
    for (size_t s = 0; !status && r.sections && s < json_array_size(sections); s++)
        status = get_section(&r, json_array_get(sections, s), s);
    if (!status) {
        lathe_raw_set raw = {(const double(*)[2])r.points, r.polygons, r.sections, r.point_count, r.polygon_count,
                             (uint32_t)json_array_size(sections)};
        status = lathe__contour_set_build(out, repairs, &raw, err);
    }
    free(r.points);
    free(r.polygons);
    free(r.sections);
    return status;
}

lathe_status lathe__contour_json_parse(lathe_contour_set *out, lathe_set_repairs *repairs, const char *bytes,
                                       size_t size, lathe_error *err) {
    json_error_t error;
    json_t *root = json_loadb(bytes, size, JSON_REJECT_DUPLICATES, &error);
    if (!root) return lathe_fail(err, LATHE_ERR_FORMAT, "line %d: %s", error.line, error.text);
    lathe_status status = read_root(out, repairs, root, err);
    json_decref(root);
    return status;
}

lathe_status lathe__contour_json_open(lathe_contour_set *out, lathe_set_repairs *repairs, const char *path,
                                      lathe_error *err) {
    uint8_t *bytes;
    size_t size;
    lathe_status status = lathe__read_file(&bytes, &size, path, MOST_BYTES, err);
    if (status) return status;
    status = lathe__contour_json_parse(out, repairs, (const char *)bytes, size, err);
    free(bytes);
    return status;
}

bool lathe__is_contour_json(const char *path) {
    size_t length = strlen(path), size;
    uint8_t *bytes;
    if (length < 5 || strcasecmp(path + length - 5, ".json") != 0 ||
        lathe__read_file(&bytes, &size, path, MOST_BYTES, NULL))
        return false;
    json_t *root = json_loadb((const char *)bytes, size, 0, NULL);
    bool is = json_object_get(root, "sections") != NULL;
    json_decref(root);
    free(bytes);
    return is;
}
