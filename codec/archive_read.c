/* Reading archives: lathe_model. Opening checks the structure of the whole file (header, every level record's head,
 * footer, trailer; all sizes must meet); packets' checksums are checked by lathe_model_check and by decoders. Memory:
 * at most 24 times the header's and 5 times the footer's size, whatever the bytes say. */
#include "pyramid.h"
#include "restream.h"
#include "archive_write.h"
#include "crc32c.h"
#include <errno.h>
#include <fcntl.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

typedef struct level_record {
    size_t offset, packets, end; /* of the record, of its first packet, of the next record */
    lathe_level_head head;
} level_record;

struct lathe_model {
    const uint8_t *bytes;
    size_t size, footer; /* footer: its offset; the stream ends there */
    bool mapped;
    lathe_header header;
    level_record records[LATHE_MAX_LEVELS];
    lathe_model_info info;
    char name[LATHE_MODEL_NAME_MAX + 1];
    lathe_structure_info *structures;
    lathe_level_info *levels; /* of all structures, one behind the other */
    lathe_level_info totals[LATHE_MAX_LEVELS];
};

/* A failed read inside the file: there is no more to come. */
static lathe_status reader_failure(const lathe_reader *reader, const lathe_model *model, lathe_error *err) {
    size_t at = (size_t)(reader->at - model->bytes);
    if (reader->status == LATHE_MORE)
        return lathe_fail(err, LATHE_ERR_FORMAT, "the archive is truncated or damaged near byte %zu", at);
    return lathe_fail(err, reader->status, "damaged archive: %s (near byte %zu)", reader->fault, at);
}

/* ---- trailer, header, level records ---- */

static lathe_status read_trailer(lathe_model *model, lathe_error *err) {
    if (model->size < LATHE_TRAILER_SIZE)
        return lathe_fail(err, LATHE_ERR_FORMAT, "%zu bytes are too few for an archive: truncated", model->size);
    lathe_reader reader = lathe__reader(model->bytes + model->size - LATHE_TRAILER_SIZE, LATHE_TRAILER_SIZE);
    uint64_t offset = lathe__read_u64(&reader);
    uint32_t size = lathe__read_u32(&reader), magic = lathe__read_u32(&reader);
    uint64_t room = model->size - LATHE_TRAILER_SIZE;
    if (magic != LATHE_TRAILER_MAGIC || size > room || offset != room - size)
        return lathe_fail(err, LATHE_ERR_FORMAT,
                          "the archive's end is missing or damaged: the file is truncated, or bytes follow");
    model->footer = (size_t)offset;
    return LATHE_OK;
}

static lathe_status check_names(const lathe_model *model, lathe_error *err) {
    int64_t twin = lathe__header_duplicate(&model->header);
    if (twin == -2) return lathe_fail(err, LATHE_ERR_MEMORY, "out of memory");
    if (twin >= 0)
        return lathe_fail(err, LATHE_ERR_FORMAT, "damaged archive: two structures are named '%s'",
                          model->header.structures[twin].name);
    return LATHE_OK;
}

static lathe_status read_records(lathe_model *model, lathe_reader *reader, lathe_error *err) {
    for (uint32_t i = 0; i < model->header.level_count; i++) {
        level_record *record = &model->records[i];
        record->offset = (size_t)(reader->at - model->bytes);
        if (lathe__level_parse(&record->head, reader, &model->header)) return reader_failure(reader, model, err);
        record->packets = (size_t)(reader->at - model->bytes);
        if (record->head.level != i)
            return lathe_fail(err, LATHE_ERR_FORMAT, "damaged archive: level %u where level %u must be",
                              record->head.level, i);
        if (record->head.body_bytes > lathe__reader_left(reader))
            return lathe_fail(err, LATHE_ERR_FORMAT, "damaged archive: the packets of level %u end beyond the footer",
                              i);
        (void)lathe__read_bytes(reader, (size_t)record->head.body_bytes);
        record->end = (size_t)(reader->at - model->bytes);
    }
    if (reader->at != reader->end)
        return lathe_fail(err, LATHE_ERR_FORMAT, "damaged archive: bytes between levels and footer");
    return LATHE_OK;
}

/* ---- footer ---- */

static void read_counts(lathe_level_info *level, lathe_reader *reader) {
    level->rays = lathe__read_varint(reader);
    level->slices = lathe__read_varint(reader);
    level->vertices = lathe__read_varint(reader);
    level->triangles = lathe__read_varint(reader);
    level->draco_bytes = lathe__read_varint64(reader);
}

static bool error_usable(float v) { return v >= -1e30f && v <= 1e30f; }

/* How many of the structure's components a level does not show yet, and their volume. */
static void read_waiting(lathe_level_info *level, uint32_t components, lathe_reader *reader) {
    level->components_waiting = lathe__read_varint(reader);
    if (level->components_waiting) level->waiting_mm3 = (double)lathe__read_f32(reader);
    if (level->components_waiting > components || !(level->waiting_mm3 >= 0 && level->waiting_mm3 <= 1e30))
        lathe__reader_fail(reader, LATHE_ERR_FORMAT, "the components of a structure's level");
    level->components = components - level->components_waiting;
}

static void read_structure_levels(lathe_level_info *levels, uint32_t count, lathe_reader *reader) {
    uint32_t components = lathe__read_varint(reader);
    for (uint32_t i = 0; i < count && !reader->status; i++) {
        read_counts(&levels[i], reader);
        levels[i].error_rms_mm = lathe__read_f32(reader);
        levels[i].error_max_mm = lathe__read_f32(reader);
        if (!error_usable(levels[i].error_rms_mm) || !error_usable(levels[i].error_max_mm))
            lathe__reader_fail(reader, LATHE_ERR_FORMAT, "the error of a structure's level");
        read_waiting(&levels[i], components, reader);
    }
}

static lathe_status allocate_info(lathe_model *model, lathe_reader *reader) {
    uint64_t entries = 0;
    for (uint32_t i = 0; i < model->header.structure_count; i++) entries += model->header.structures[i].level_count;
    if (entries > lathe__reader_left(reader) / LATHE_LEVEL_STATS_MIN_BYTES)
        return lathe__reader_fail(reader, LATHE_ERR_FORMAT, "the footer is too short");
    model->levels = calloc((size_t)entries, sizeof *model->levels);
    model->structures = calloc(model->header.structure_count, sizeof *model->structures);
    if (!model->levels || !model->structures) return lathe__reader_fail(reader, LATHE_ERR_MEMORY, "out of memory");
    return LATHE_OK;
}

static void read_model_levels(lathe_model *model, lathe_reader *reader) {
    uint64_t header_bytes = lathe__read_varint64(reader);
    uint32_t count = lathe__read_varint(reader);
    if (header_bytes != model->records[0].offset || count != model->header.level_count)
        lathe__reader_fail(reader, LATHE_ERR_FORMAT, "the footer belongs to another model");
    for (uint32_t i = 0; i < count && !reader->status; i++) {
        const level_record *record = &model->records[i];
        uint64_t bytes = lathe__read_varint64(reader);
        read_counts(&model->totals[i], reader);
        if (bytes != record->end - record->offset)
            lathe__reader_fail(reader, LATHE_ERR_FORMAT, "the size of a level in the footer");
        model->totals[i].polar_bytes = bytes + (i ? 0 : header_bytes);
        model->totals[i].error_rms_mm = record->head.error_rms_mm;
        model->totals[i].error_max_mm = record->head.error_max_mm;
    }
}

static void read_footer_body(lathe_model *model, lathe_reader *reader) {
    if (lathe__read_u8(reader) != LATHE_FOOTER_TAG)
        lathe__reader_fail(reader, LATHE_ERR_FORMAT, "no footer where one must be");
    uint32_t length = lathe__read_varint(reader);
    if (length > LATHE_MODEL_NAME_MAX) lathe__reader_fail(reader, LATHE_ERR_FORMAT, "the model's name is too long");
    const uint8_t *name = lathe__read_bytes(reader, length);
    if (name && !lathe__name_valid((const char *)name, length))
        lathe__reader_fail(reader, LATHE_ERR_FORMAT, "the model's name is not UTF-8");
    if (name) memcpy(model->name, name, length);
    model->info.iso = lathe__read_f64(reader);
    read_model_levels(model, reader);
    if (reader->status || allocate_info(model, reader)) return;
    static const lathe_header_structure nobody = {.level_count = 0};
    lathe_level_info *levels = model->levels;
    for (uint32_t i = 0; i < model->header.structure_count && !reader->status; i++) {
        lathe_header_structure *s = &model->header.structures[i];
        lathe__parse_identity(s, reader, i ? s - 1 : &nobody);
        model->structures[i].levels = levels;
        read_structure_levels(levels, model->header.structures[i].level_count, reader);
        levels += model->header.structures[i].level_count;
    }
    if (!reader->status && reader->at != reader->end)
        lathe__reader_fail(reader, LATHE_ERR_FORMAT, "bytes left over in the footer");
}

static lathe_status read_footer(lathe_model *model, lathe_error *err) {
    const uint8_t *start = model->bytes + model->footer;
    size_t size = model->size - LATHE_TRAILER_SIZE - model->footer;
    lathe_reader reader = lathe__reader(start, size);
    if (size < LATHE_CRC_SIZE) return lathe_fail(err, LATHE_ERR_FORMAT, "damaged archive: no footer");
    reader.end -= LATHE_CRC_SIZE;
    lathe_reader stored = lathe__reader(reader.end, LATHE_CRC_SIZE);
    if (lathe__read_u32(&stored) != lathe__crc32c(0, start, size - LATHE_CRC_SIZE))
        return lathe_fail(err, LATHE_ERR_CHECKSUM, "damaged archive: the footer's checksum does not match");
    read_footer_body(model, &reader);
    return reader.status ? reader_failure(&reader, model, err) : LATHE_OK;
}

/* ---- the stream of one structure ---- */

/* Which packets of a level are a structure's: first, first + step, ... below the record's count. */
typedef struct packet_range { uint32_t first, step; } packet_range;

static packet_range packets_of(const lathe_model *model, uint32_t structure, uint32_t level) {
    packet_range range = {0, lathe__header_present(&model->header, level)};
    for (uint32_t i = 0; i < structure; i++) range.first += model->header.structures[i].level_count > level;
    return range;
}

static void emit_structure_head(lathe_bytes *out, const lathe_model *model, uint32_t structure, uint32_t level, uint32_t *sizes,
                                uint32_t count) {
    const lathe_level_info *info = &model->structures[structure].levels[level];
    lathe_level_head head = {.level = level,
                             .error_rms_mm = info->error_rms_mm,
                             .error_max_mm = info->error_max_mm,
                             .count = count,
                             .sizes = sizes};
    lathe__emit_level_head(out, &head);
}

/* Header (level 0), head and packets of one level of one structure. */
static void emit_own_level(lathe_bytes *out, const lathe_model *model, uint32_t structure, uint32_t level) {
    const level_record *record = &model->records[level];
    packet_range own = packets_of(model, structure, level);
    uint32_t sizes[LATHE_PYRAMID_MOST_PASSES], count = 0;
    for (uint32_t i = own.first; i < record->head.count; i += own.step) sizes[count++] = record->head.sizes[i];
    if (level == 0) lathe__emit_header(out, &model->header, structure, 1);
    emit_structure_head(out, model, structure, level, sizes, count);
    const uint8_t *packet = model->bytes + record->packets;
    for (uint32_t i = 0; i < record->head.count; i++) {
        size_t size = (size_t)record->head.sizes[i] + LATHE_CRC_SIZE;
        if (i % own.step == own.first) lathe__emit(out, packet, size);
        packet += size;
    }
}

/* The same of a structure that was coded again to stand alone. */
static void emit_alone(lathe_bytes *out, const lathe_model *model, uint32_t structure, uint32_t level, const lathe_packet_list *packets) {
    lathe_header header = model->header;
    uint32_t sizes[LATHE_PYRAMID_MOST_PASSES];
    header.parameters[1] &= ~(uint32_t)LATHE_FLAG_SHARED;
    if (header.parameter_count == 2 && !header.parameters[1]) header.parameter_count = 1;
    for (uint32_t i = 0; i < packets->count; i++) sizes[i] = (uint32_t)packets->at[i].size;
    if (level == 0) lathe__emit_header(out, &header, structure, 1);
    emit_structure_head(out, model, structure, level, sizes, packets->count);
    for (uint32_t i = 0; i < packets->count; i++) {
        size_t start = out->size;
        lathe__emit(out, packets->at[i].bytes, packets->at[i].size);
        lathe__emit_checksum(out, start);
    }
}

static lathe_status stream_structure(const lathe_model *model, uint32_t structure, uint32_t from, uint32_t to, lathe_sink sink, void *context) {
    lathe_packet_list packets[LATHE_MAX_LEVELS] = {{0}};
    uint32_t count = model->header.structures[structure].level_count;
    lathe_status status = model->info.independent ? LATHE_OK : lathe__restream(packets, model, structure, count);
    for (uint32_t level = from; !status && level <= to && level < count; level++) {
        lathe_bytes part = {0};
        if (model->info.independent) emit_own_level(&part, model, structure, level);
        else emit_alone(&part, model, structure, level, &packets[level]);
        status = part.failed ? LATHE_ERR_MEMORY : sink(context, part.data, part.size) ? LATHE_ERR_IO : LATHE_OK;
        lathe__bytes_free(&part);
    }
    for (int i = 0; i < LATHE_MAX_LEVELS; i++) lathe__packets_free(&packets[i]);
    return status;
}

/* ---- what describe tells ---- */

/* Summed over the structures of a level these are the bytes of its part of the stream: packets of one structure count where they
 * belong, what structures share (header, head of the level record, packets of all) is divided evenly. */
static void fill_polar_bytes(lathe_model *model) {
    for (uint32_t level = 0; level < model->header.level_count; level++) {
        const lathe_level_head *head = &model->records[level].head;
        uint32_t present = lathe__header_present(&model->header, level), rank = 0;
        bool own = model->info.independent || !model->info.pyramid;
        uint64_t common = model->totals[level].polar_bytes;
        for (uint32_t packet = 0; own && packet < head->count; packet++) common -= (uint64_t)head->sizes[packet] + LATHE_CRC_SIZE;
        for (uint32_t i = 0; i < model->header.structure_count; i++) {
            if (model->header.structures[i].level_count <= level) continue;
            lathe_level_info *info = model->levels + (model->structures[i].levels - model->levels) + level;
            info->polar_bytes = common / present + (rank < common % present);
            for (uint32_t packet = rank; own && packet < head->count; packet += present)
                info->polar_bytes += (uint64_t)head->sizes[packet] + LATHE_CRC_SIZE;
            rank++;
        }
    }
}

static void sum_components(lathe_model *model) {
    for (uint32_t level = 0; level < model->header.level_count; level++)
        for (uint32_t i = 0; i < model->header.structure_count; i++) {
            uint32_t last = model->structures[i].level_count - 1;
            const lathe_level_info *from = &model->structures[i].levels[level < last ? level : last];
            lathe_level_info *to = &model->totals[level];
            to->components += from->components;
            to->components_waiting += from->components_waiting;
            to->waiting_mm3 += from->waiting_mm3;
        }
}

static void fill_info(lathe_model *model) {
    for (uint32_t i = 0; i < model->header.structure_count; i++) {
        const lathe_header_structure *from = &model->header.structures[i];
        lathe_structure_info *to = &model->structures[i];
        to->name = from->name;
        memcpy(to->rgb, from->rgb, sizeof to->rgb);
        to->label = from->label;
        to->level_count = from->level_count;
    }
    model->info.name = model->name;
    model->info.structure_count = model->header.structure_count;
    model->info.level_count = model->header.level_count;
    model->info.structures = model->structures;
    model->info.axis = model->header.axis;
    model->info.boundary = model->header.boundary;
    uint32_t flags = model->header.parameter_count > 1 ? model->header.parameters[1] : 0;
    model->info.keep_topology = flags & LATHE_FLAG_KEEP;
    model->info.caps = flags & LATHE_FLAG_CAPS;
    model->info.exact = flags & LATHE_FLAG_EXACT;
    model->info.independent = !(flags & LATHE_FLAG_SHARED);
    model->info.pyramid = flags & LATHE_FLAG_PYRAMID;
    model->info.rasters_only = !(~flags & LATHE_RASTER_FLAGS);
    model->info.levels = model->totals;
    sum_components(model);
    fill_polar_bytes(model);
}

/* ---- open, close ---- */

static lathe_status read_archive(lathe_model *model, lathe_error *err) {
    if (!model->size) return lathe_fail(err, LATHE_ERR_FORMAT, "the file is empty");
    lathe_reader magic = lathe__reader(model->bytes, model->size);
    lathe_header header; /* first, so that other files are called by their name */
    if (lathe__header_parse(&header, &magic) == LATHE_OK)
        lathe__header_free(&header);
    else if (magic.status != LATHE_MORE)
        return reader_failure(&magic, model, err);
    lathe_status status = read_trailer(model, err);
    if (status) return status;
    lathe_reader reader = lathe__reader(model->bytes, model->footer);
    if (lathe__header_parse(&model->header, &reader)) return reader_failure(&reader, model, err);
    status = read_records(model, &reader, err);
    if (!status) status = read_footer(model, err);
    if (!status) status = check_names(model, err);
    if (!status) fill_info(model);
    return status;
}

static lathe_status parse_model(lathe_model **out, const uint8_t *bytes, size_t size, bool mapped, lathe_error *err) {
    lathe_model *model = calloc(1, sizeof *model);
    if (!model) return lathe_fail(err, LATHE_ERR_MEMORY, "out of memory");
    model->bytes = bytes;
    model->size = size;
    lathe_status status = read_archive(model, err);
    if (status) {
        lathe_model_close(&model);
        return status;
    }
    model->mapped = mapped;
    *out = model;
    return LATHE_OK;
}

lathe_status lathe_model_parse(lathe_model **out, const uint8_t *bytes, size_t size, lathe_error *err) {
    return parse_model(out, bytes, size, false, err);
}

/* O_NONBLOCK: opening a pipe that nobody writes to must not hang. */
static lathe_status map_file(const uint8_t **bytes, size_t *size, const char *path, lathe_error *err) {
    int fd = open(path, O_RDONLY | O_CLOEXEC | O_NONBLOCK);
    if (fd < 0) return lathe_fail(err, LATHE_ERR_IO, "%s: %s", path, strerror(errno));
    struct stat stat;
    lathe_status status = LATHE_OK;
    void *map = NULL;
    if (fstat(fd, &stat))
        status = lathe_fail(err, LATHE_ERR_IO, "%s: %s", path, strerror(errno));
    else if (S_ISDIR(stat.st_mode))
        status = lathe_fail(err, LATHE_ERR_IO, "%s: is a directory, not an archive", path);
    else if (!S_ISREG(stat.st_mode))
        status = lathe_fail(err, LATHE_ERR_IO, "%s: is not a regular file", path);
    else if (stat.st_size == 0)
        status = lathe_fail(err, LATHE_ERR_FORMAT, "%s: the file is empty", path);
    else if ((uintmax_t)stat.st_size > SIZE_MAX / 2)
        status = lathe_fail(err, LATHE_ERR_LIMIT, "%s: too large", path);
    if (!status) {
        map = mmap(NULL, (size_t)stat.st_size, PROT_READ, MAP_SHARED, fd, 0);
        if (map == MAP_FAILED) status = lathe_fail(err, LATHE_ERR_IO, "%s: %s", path, strerror(errno));
    }
    close(fd);
    if (status) return status;
    *bytes = map;
    *size = (size_t)stat.st_size;
    return LATHE_OK;
}

lathe_status lathe_model_open(lathe_model **out, const char *path, lathe_error *err) {
    const uint8_t *bytes = NULL;
    size_t size = 0;
    lathe_status status = map_file(&bytes, &size, path, err);
    if (status) return status;
    lathe_error inner = {""};
    status = parse_model(out, bytes, size, true, &inner);
    if (!status) return LATHE_OK;
    munmap((void *)(uintptr_t)bytes, size);
    return lathe_fail(err, status, "%s: %s", path, inner.text);
}

void lathe_model_close(lathe_model **model) {
    if (!model || !*model) return;
    lathe_model *m = *model;
    for (int i = 0; i < LATHE_MAX_LEVELS; i++) lathe__level_head_free(&m->records[i].head);
    lathe__header_free(&m->header);
    free(m->structures);
    free(m->levels);
    if (m->mapped) munmap((void *)(uintptr_t)m->bytes, m->size);
    free(m);
    *model = NULL;
}

/* ---- questions ---- */

const lathe_model_info *lathe_model_describe(const lathe_model *model) { return &model->info; }

const uint8_t *lathe_model_bytes(const lathe_model *model, size_t *size) {
    *size = model->size;
    return model->bytes;
}

int64_t lathe_model_find(const lathe_model *model, const char *name) {
    for (uint32_t i = 0; i < model->header.structure_count; i++)
        if (!strcmp(model->header.structures[i].name, name)) return i;
    return -1;
}

void lathe_model_stream_range(const lathe_model *model, uint32_t from, uint32_t to, size_t *offset, size_t *size) {
    uint32_t last = model->header.level_count - 1;
    if (to > last) to = last;
    *offset = from > last ? model->footer : from ? model->records[from].offset : 0;
    *size = from > to ? 0 : model->records[to].end - *offset;
}

lathe_status lathe_model_stream(const lathe_model *model, int64_t structure, uint32_t from, uint32_t to,
                                lathe_sink sink, void *context) {
    if (structure >= model->header.structure_count) return LATHE_ERR_RANGE;
    if (structure >= 0) return stream_structure(model, (uint32_t)structure, from, to, sink, context);
    size_t offset, size;
    lathe_model_stream_range(model, from, to, &offset, &size);
    return size && sink(context, model->bytes + offset, size) ? LATHE_ERR_IO : LATHE_OK;
}

uint64_t lathe_model_stream_size(const lathe_model *model, int64_t structure, uint32_t from, uint32_t to) {
    uint64_t sum = 0;
    return lathe_model_stream(model, structure, from, to, lathe__count_bytes, &sum) ? 0 : sum;
}

/* Whose packet it is, for people. */
static const char *owner_of(const lathe_model *model, uint32_t level, uint32_t packet) {
    if (model->info.pyramid && !model->info.independent) return "all";
    uint32_t rank = packet % lathe__header_present(&model->header, level);
    for (uint32_t i = 0; i < model->header.structure_count; i++)
        if (model->header.structures[i].level_count > level && !rank--) return model->header.structures[i].name;
    return "";
}

static lathe_status check_level(const lathe_model *model, uint32_t level, lathe_error *err) {
    const level_record *record = &model->records[level];
    lathe_reader reader = lathe__reader(model->bytes + record->packets, record->end - record->packets);
    for (uint32_t packet = 0; packet < record->head.count; packet++) {
        size_t at = (size_t)(reader.at - model->bytes);
        if (!lathe__packet_parse(&reader, record->head.sizes[packet]))
            return lathe_fail(err, LATHE_ERR_CHECKSUM, "damaged archive: level %u of structure '%s': %s (packet at byte %zu)", level,
                              owner_of(model, level, packet), reader.fault, at);
    }
    return LATHE_OK;
}

/* Heads, header and footer were checked when the model was opened. */
lathe_status lathe_model_check(const lathe_model *model, lathe_error *err) {
    lathe_status status = LATHE_OK;
    for (uint32_t level = 0; level < model->header.level_count && !status; level++)
        status = check_level(model, level, err);
    return status;
}
