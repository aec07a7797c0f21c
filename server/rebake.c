/* Bakes a volume again as an archive says it was baked, into memory: what was encoded, to compare with what was
 * decoded. */
#include "rebake.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

static int take_bytes(void *context, const void *bytes, size_t size) {
    lathe_rebaked *out = context;
    if (size > out->capacity - out->size) {
        size_t capacity = out->capacity ? out->capacity : 1 << 16;
        while (capacity - out->size < size) {
            if (capacity > SIZE_MAX / 2) return -1;
            capacity *= 2;
        }
        uint8_t *more = realloc(out->bytes, capacity);
        if (!more) return -1;
        out->bytes = more;
        out->capacity = capacity;
    }
    memcpy(out->bytes + out->size, bytes, size);
    out->size += size;
    return 0;
}

static lathe_bake_structure *same_structures(const lathe_model_info *info) {
    lathe_bake_structure *list = calloc((size_t)info->structure_count + 1, sizeof *list);
    for (uint32_t i = 0; list && i < info->structure_count; i++) {
        const lathe_structure_info *from = &info->structures[i];
        strncpy(list[i].name, from->name, sizeof list[i].name - 1);
        memcpy(list[i].rgb, from->rgb, sizeof list[i].rgb);
        list[i].label = from->label;
    }
    return list;
}

lathe_status lathe__rebake(lathe_rebaked *out, const lathe_model_info *info, const lathe_volume *volume,
                           lathe_error *err) {
    lathe_bake_structure *structures = same_structures(info);
    if (!structures) return LATHE_ERR_MEMORY;
    lathe_bake_options options;
    lathe_bake_defaults(&options);
    options.axis = info->axis;
    options.boundary = (int)info->boundary;
    options.iso = info->iso;
    options.name = info->name;
    options.keep_topology = info->keep_topology;
    options.flat_caps = !info->caps;
    options.exact = info->exact;
    options.slices = !info->pyramid;
    options.levels = info->pyramid ? info->level_count : 0;
    options.independent = info->independent;
    options.measure = options.draco = false;
    if (isnan(info->iso)) {
        options.structures = structures;
        options.structure_count = info->structure_count;
    }
    lathe_rebaked bytes = {NULL, 0, 0};
    lathe_status status = lathe_bake(volume, &options, take_bytes, &bytes, err);
    free(structures);
    if (status) free(bytes.bytes);
    else *out = bytes;
    return status;
}
