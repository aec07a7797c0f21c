/* What a model is, as JSON. */
#include "service.h"
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

json_t *lathe__json_name(const char *text) {
    json_t *json = json_string(text);
    if (json) return json;
    char *plain = strdup(text);
    for (char *p = plain; p && *p; p++)
        if (*p & 0x80) *p = '?';
    json = plain ? json_string(plain) : NULL;
    free(plain);
    return json;
}

/* Six digits are more than is measured; a shorter decimal number travels better. */
static json_t *rounded(double value, int digits) {
    char text[40];
    if (!isfinite(value)) return json_null();
    snprintf(text, sizeof text, "%.*g", digits, value);
    return json_real(strtod(text, NULL));
}

static json_t *error_mm(float value) { return value >= 0 ? rounded(value, 6) : json_null(); }

static json_t *levels_json(const lathe_level_info *levels, uint32_t count) {
    json_t *list = json_array();
    for (uint32_t n = 0; list && n < count; n++) {
        const lathe_level_info *l = &levels[n];
        json_t *level =
            json_pack("{s:i, s:I, s:I, s:I, s:I, s:I, s:o, s:o, s:o, s:I, s:I, s:o}", "level", (int)n, "rays",
                      (json_int_t)l->rays, "slices", (json_int_t)l->slices, "vertices", (json_int_t)l->vertices,
                      "triangles", (json_int_t)l->triangles, "polar_bytes", (json_int_t)l->polar_bytes, "draco_bytes",
                      l->draco_bytes ? json_integer((json_int_t)l->draco_bytes) : json_null(), "error_max_mm",
                      error_mm(l->error_max_mm), "error_rms_mm", error_mm(l->error_rms_mm), "components",
                      (json_int_t)l->components, "components_waiting", (json_int_t)l->components_waiting, "waiting_mm3",
                      rounded(l->waiting_mm3, 6));
        if (!level || json_array_append_new(list, level)) {
            json_decref(list);
            return NULL;
        }
    }
    return list;
}

/* As many digits as the viewer shows. */
static json_t *shown_mm(float value) { return value >= 0 ? rounded(value, 2) : json_null(); }

static json_t *level_errors_json(const lathe_level_info *levels, uint32_t count) {
    json_t *list = json_array();
    for (uint32_t n = 0; list && n < count; n++) {
        json_t *level = json_pack("{s:o, s:o}", "error_max_mm", shown_mm(levels[n].error_max_mm), "error_rms_mm",
                                  shown_mm(levels[n].error_rms_mm));
        if (!level || json_array_append_new(list, level)) {
            json_decref(list);
            return NULL;
        }
    }
    return list;
}

/* counted: with the count of levels instead of the levels. */
static json_t *structure_json(const lathe_structure_info *s, bool counted) {
    char colour[8];
    snprintf(colour, sizeof colour, "#%02x%02x%02x", s->rgb[0], s->rgb[1], s->rgb[2]);
    return json_pack("{s:o, s:s, s:o}", "name", lathe__json_name(s->name), "color", colour, "levels",
                     counted ? json_integer(s->level_count) : levels_json(s->levels, s->level_count));
}

static json_t *structures_json(const lathe_entry *entry, bool counted, int64_t only) {
    json_t *list = json_array();
    for (uint32_t i = 0; list && i < entry->info->structure_count; i++) {
        if (only >= 0 && i != only) continue;
        json_t *structure = structure_json(&entry->info->structures[i], counted);
        if (!structure || json_array_append_new(list, structure)) {
            json_decref(list);
            return NULL;
        }
    }
    return list;
}

static json_t *point_json(const double p[3]) {
    return json_pack("[o, o, o]", rounded(p[0], 7), rounded(p[1], 7), rounded(p[2], 7));
}

static json_t *bounds_json(lathe_entry *entry, int64_t structure) {
    double low[3], high[3];
    if (!lathe__entry_bounds(entry, structure, low, high)) return json_null();
    return json_pack("[o, o]", point_json(low), point_json(high));
}

static json_t *model_name(const lathe_entry *entry) {
    return lathe__json_name(entry->info->name ? entry->info->name : entry->id);
}

json_t *lathe__manifest(lathe_entry *entry) {
    const lathe_model_info *info = entry->info;
    const char axis[2] = {(char)('x' + info->axis), 0};
    return json_pack("{s:s, s:o, s:s, s:s, s:s, s:s, s:o, s:o, s:o, s:o}", "id", entry->id, "name", model_name(entry),
                     "hash", entry->hash, "axis", axis, "boundary",
                     info->boundary == LATHE_BOUNDARY_EDGE ? "edge" : "iso", "topology",
                     info->keep_topology ? "keep" : "own", "iso", rounded(info->iso, 15), "levels",
                     levels_json(info->levels, lathe__entry_levels(entry, -1)), "bounds", bounds_json(entry, -1),
                     "structures", structures_json(entry, false, -1));
}

json_t *lathe__page_manifest(lathe_entry *entry, int64_t structure) {
    const lathe_model_info *info = entry->info;
    const lathe_level_info *levels = structure < 0 ? info->levels : info->structures[structure].levels;
    return json_pack("{s:s, s:o, s:o, s:o, s:o}", "id", entry->id, "name", model_name(entry), "levels",
                     level_errors_json(levels, lathe__entry_levels(entry, structure)), "bounds",
                     bounds_json(entry, structure), "structures", structures_json(entry, true, structure));
}

lathe_status lathe__json_write(lathe_buffer *out, json_t *json) {
    char *text = json ? json_dumps(json, JSON_COMPACT | JSON_REAL_PRECISION(15)) : NULL;
    int failed = !text;
    for (const char *p = text; !failed && *p;) {
        size_t plain = strcspn(p, "<");
        failed = lathe__buffer_append(out, p, plain);
        p += plain;
        if (!failed && *p) failed = lathe__buffer_text(out, "\\u003c"), p++;
    }
    free(text);
    return failed ? LATHE_ERR_MEMORY : LATHE_OK;
}
