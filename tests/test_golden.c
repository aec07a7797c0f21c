/* Golden streams: what is in tests/golden decodes to what it always did, packet by packet and mesh by mesh; cut short it waits for
 * more, damaged it is refused by name.
 *
 *   test_golden                    compares with tests/golden/packets.txt and tests/golden/meshes.txt
 *   test_golden --write packets    writes packets.txt anew: only after streams were added
 *   test_golden --write meshes     writes meshes.txt anew: after a change of the surface that is meant (see docs/FORMAT.md)
 *
 * web/test/reference.test.mjs computes packets.txt, too, with the second decoder. LATHE_GOLDEN names another folder. */
#include <dirent.h>
#include <stdlib.h>
#include <string.h>
#include "check.h"
#include "lathe_codec.h"
#include "restream.h"

static const char *folder(void) {
    const char *given = getenv("LATHE_GOLDEN");
    return given ? given : "tests/golden";
}

/* ---- files ---- */

typedef struct file { uint8_t *bytes; size_t size; } file;

/* Exactly as long as the file, so that a sanitizer sees a read too far; NULL if there is none. */
static file read_file(const char *name) {
    char path[600];
    file f = {NULL, 0};
    snprintf(path, sizeof path, "%s/%s", folder(), name);
    FILE *in = fopen(path, "rb");
    if (!in) return f;
    if (fseek(in, 0, SEEK_END) || ftell(in) < 0) abort();
    f.size = (size_t)ftell(in);
    rewind(in);
    f.bytes = malloc(f.size + !f.size);
    if (!f.bytes || fread(f.bytes, 1, f.size, in) != f.size) abort();
    fclose(in);
    return f;
}

static int is_golden(const struct dirent *entry) {
    const char *dot = strrchr(entry->d_name, '.');
    return dot && !strcmp(dot, ".lathe");
}

/* ---- digests: FNV-1a over little-endian words ---- */

typedef struct digest { uint64_t hash; } digest;
static const digest START = {0xCBF29CE484222325u};

static void add_byte(digest *d, uint8_t byte) { d->hash = (d->hash ^ byte) * 0x100000001B3u; }
static void add(digest *d, uint32_t word) {
    for (int i = 0; i < 4; i++) add_byte(d, (uint8_t)(word >> 8 * i));
}
static void add64(digest *d, uint64_t v) { add(d, (uint32_t)v), add(d, (uint32_t)(v >> 32)); }
static void add_float(digest *d, float v) {
    uint32_t bits;
    memcpy(&bits, &v, sizeof bits);
    add(d, bits);
}
static void add_double(digest *d, double v) {
    uint64_t bits;
    memcpy(&bits, &v, sizeof bits);
    add64(d, bits);
}
static void add_text(digest *d, const char *text) {
    add(d, (uint32_t)strlen(text));
    for (; *text; text++) add_byte(d, (uint8_t)*text);
}

static uint64_t header_digest(const lathe_header *h) {
    digest d = START;
    add(&d, h->axis), add(&d, h->boundary);
    for (int i = 0; i < 12; i++) add_double(&d, h->affine[i / 4][i % 4]);
    add(&d, h->parameter_count);
    for (uint32_t i = 0; i < h->parameter_count; i++) add(&d, h->parameters[i]);
    add(&d, h->structure_count);
    for (uint32_t i = 0; i < h->structure_count; i++) {
        for (int k = 0; k < 3; k++) add(&d, (uint32_t)h->structures[i].origin[k]), add(&d, (uint32_t)h->structures[i].size[k]);
        add(&d, h->structures[i].level_count);
    }
    return d.hash;
}

static void add_counts(digest *d, const lathe_level_info *l) {
    add(d, l->rays), add(d, l->slices), add(d, l->vertices), add(d, l->triangles), add64(d, l->draco_bytes);
}

static uint64_t footer_digest(const lathe_model_info *info) {
    digest d = START;
    add_text(&d, info->name);
    add_double(&d, info->iso);
    for (uint32_t l = 0; l < info->level_count; l++) add_counts(&d, &info->levels[l]);
    for (uint32_t i = 0; i < info->structure_count; i++) {
        const lathe_structure_info *s = &info->structures[i];
        add_text(&d, s->name);
        for (int k = 0; k < 3; k++) add(&d, s->rgb[k]);
        add64(&d, (uint64_t)s->label);
        for (uint32_t l = 0; l < s->level_count; l++) {
            const lathe_level_info *level = &s->levels[l];
            add_counts(&d, level);
            add_float(&d, level->error_rms_mm), add_float(&d, level->error_max_mm);
            add(&d, level->components), add(&d, level->components_waiting);
            add_float(&d, (float)level->waiting_mm3);
        }
    }
    return d.hash;
}

static void add_stars(digest *d, const lathe_structure_state *s, const int32_t *slices, uint32_t count) {
    for (uint32_t i = 0; i < count; i++) {
        add(d, (uint32_t)slices[i]), add(d, s->base[i].count);
        for (uint32_t k = 0; k < s->base[i].count; k++) {
            const lathe_star *star = &s->base[i].stars[k];
            add(d, star->parent), add(d, star->hole), add(d, star->rays);
            add(d, (uint32_t)star->centre[0]), add(d, (uint32_t)star->centre[1]);
            for (uint32_t r = 0; r < star->rays; r++) add(d, star->radius[r]);
        }
    }
}

/* Where the shapes of the caps begin. */
static void add_caps(digest *d, const lathe_structure_state *s) {
    if (!s->cap_bytes) return;
    add(d, s->cap_code.code), add(d, s->cap_code.range);
    add(d, (uint32_t)(s->cap_code.end - s->cap_code.at)), add(d, s->cap_code.overrun);
}

static void add_slices(digest *d, const lathe_structure_state *s, const int32_t *slices, uint32_t count) {
    for (uint32_t i = 0; i < count; i++) {
        const uint64_t *words = lathe__mask_slice(&s->mask, slices[i]);
        add(d, (uint32_t)slices[i]), add(d, s->finer ? s->finer[i] : 0);
        for (size_t k = 0; k < lathe__mask_slice_words(&s->mask); k++) add64(d, words[k]);
    }
    add_caps(d, s);
}

/* Of each tube where it lies, and all that is shown of it. */
static void add_tubes(digest *d, const lathe_structure_state *s) {
    add(d, s->radii->count), add(d, (uint32_t)s->radii->step), add(d, s->radii->fine_level), add(d, (uint32_t)s->radii->fine_step);
    for (uint32_t i = 0; i < s->radii->count; i++) {
        lathe_radius_tube *tube = &s->radii->tubes[i];
        lathe_radius_map m = lathe__tube_shown(tube, lathe__passes_at(s->radii, tube, (uint32_t)s->level));
        add(d, (uint32_t)tube->first), add(d, tube->hole), add(d, (uint32_t)m.slices), add(d, m.rays), add(d, m.fall);
        add(d, (uint32_t)m.turn), add(d, (uint32_t)m.apex[0]), add(d, (uint32_t)m.apex[1]);
        for (int32_t row = 0; row < m.slices; row++) {
            add(d, (uint32_t)m.centre[row][0]), add(d, (uint32_t)m.centre[row][1]);
            for (uint32_t k = 0; k < m.rays; k++) add(d, (uint32_t)m.radius[(size_t)row * m.rays + k]);
        }
    }
}

static void add_radii(digest *d, const lathe_structure_state *s) {
    if (!s->radii->simple) {
        add_tubes(d, s);
        return;
    }
    const lathe_radius_map *m = &s->radii->tubes[0].map;
    int32_t stride = lathe__level_stride(&s->plan, (uint32_t)s->level), last = m->slices - 1;
    uint32_t rays = lathe__radius_ray_stride(m, (uint32_t)s->level);
    add(d, m->rays), add(d, (uint32_t)m->step), add(d, (uint32_t)m->turn), add(d, (uint32_t)m->apex[0]), add(d, (uint32_t)m->apex[1]);
    for (int32_t row = 0;; row = row + stride < last ? row + stride : last) {
        add(d, (uint32_t)row), add(d, (uint32_t)m->centre[row][0]), add(d, (uint32_t)m->centre[row][1]);
        for (uint32_t i = 0; i < m->rays; i += rays) add(d, (uint32_t)m->radius[(size_t)row * m->rays + i]);
        if (row == last) return;
    }
}

static void add_raster(digest *d, const lathe_structure_state *s) {
    const lathe_mask *raster = s->raster.bits ? &s->raster : &s->mask;
    size_t words = lathe__mask_slice_words(raster) * (size_t)raster->size[2];
    for (int k = 0; k < 3; k++) add(d, (uint32_t)s->stride[k]);
    for (int k = 0; k < 3; k++) add(d, (uint32_t)raster->size[k]);
    for (size_t i = 0; i < words; i++) add64(d, raster->bits[i]);
    add_caps(d, s);
}

/* What the packet of a step said. */
static uint64_t packet_digest(const char **kind, const lathe_structure_state *s, const lathe_step *step) {
    digest d = START;
    lathe_arena arena = {0};
    int32_t *slices;
    uint32_t count;
    if (lathe__state_slices(&slices, &count, &arena, s)) abort();
    add_float(&d, step->error_rms_mm), add_float(&d, step->error_max_mm);
    *kind = s->pyramid ? "raster" : s->radii ? "radii" : s->base ? "stars" : "slices";
    if (s->pyramid) add_raster(&d, s);
    else if (s->radii) add_radii(&d, s);
    else if (s->base) add_stars(&d, s, slices, count);
    else add_slices(&d, s, slices, count);
    lathe__arena_free(&arena);
    return d.hash;
}

static uint64_t mesh_digest(const lathe_mesh *mesh) {
    digest d = START;
    for (uint32_t i = 0; i < mesh->vertex_count * 3; i++) add(&d, (uint32_t)mesh->lattice[i / 3][i % 3]);
    for (uint32_t i = 0; i < mesh->triangle_count * 3; i++) add(&d, mesh->triangles[i / 3][i % 3]);
    return d.hash;
}

/* ---- where the records of an archive are ---- */

enum { MOST_PACKETS = 256 };
typedef struct packet { size_t begin, end; uint32_t level, structure, steps; } packet;   /* steps: more than 1 if it is of all structures */
typedef struct records {
    size_t header, stream;     /* bytes of both */
    packet packets[MOST_PACKETS];
    uint32_t count;
} records;

static lathe_header find_records(records *out, const file *f) {
    lathe_reader trailer = lathe__reader(f->bytes + f->size - LATHE_TRAILER_SIZE, LATHE_TRAILER_SIZE);
    *out = (records){.stream = (size_t)lathe__read_u64(&trailer)};
    lathe_reader reader = lathe__reader(f->bytes, out->stream);
    lathe_header header;
    if (lathe__header_parse(&header, &reader)) abort();
    out->header = (size_t)(reader.at - f->bytes);
    for (uint32_t level = 0; level < header.level_count; level++) {
        lathe_level_head head;
        if (lathe__level_parse(&head, &reader, &header)) abort();
        bool all = lathe__header_flags(&header) & LATHE_FLAG_PYRAMID && lathe__header_flags(&header) & LATHE_FLAG_SHARED;
        for (uint32_t k = 0, structure = 0; k < head.count; k++) {
            size_t begin = (size_t)(reader.at - f->bytes);
            while (header.structures[structure].level_count <= level) structure++;
            if (out->count == MOST_PACKETS || !lathe__packet_parse(&reader, head.sizes[k])) abort();
            out->packets[out->count++] = (packet){begin, (size_t)(reader.at - f->bytes), level, structure, all ? header.structure_count : 1};
            if (!all && ++structure == header.structure_count) structure = 0;
        }
        lathe__level_head_free(&head);
    }
    return header;
}

/* ---- what the streams decode to ---- */

static void decode(FILE *packets, FILE *meshes, const char *name, const file *f) {
    records r;
    lathe_header header = find_records(&r, f);
    fprintf(packets, "%s header %016llx\n", name, (unsigned long long)header_digest(&header));
    lathe__header_free(&header);
    lathe_decoder *decoder;
    lathe_step step;
    if (lathe_decoder_open(&decoder) || lathe_decoder_feed(decoder, f->bytes, r.stream)) abort();
    lathe_decoder_every_pass(decoder, true);
    lathe_status status;
    uint32_t at = 0, steps = 0;
    while (!(status = lathe_decoder_step(decoder, &step))) {
        const char *kind;
        char level[16];
        snprintf(level, sizeof level, step.passes_left ? "%u-%u" : "%u", step.level, step.passes_left);
        uint64_t digest = packet_digest(&kind, lathe__decoder_state(decoder, step.structure), &step);
        fprintf(packets, "%s %s %u %s %016llx\n", name, level, step.structure, kind, (unsigned long long)digest);
        const lathe_mesh *mesh = lathe_decoder_mesh(decoder, step.structure);
        if (!CHECK(mesh != NULL)) break;
        fprintf(meshes, "%s %s %u %u %u %016llx\n", name, level, step.structure, mesh->vertex_count, mesh->triangle_count,
                (unsigned long long)mesh_digest(mesh));
        CHECK(at < r.count && step.level == r.packets[at].level && step.structure == r.packets[at].structure + steps);
        if (at < r.count && ++steps == r.packets[at].steps) at++, steps = 0;
    }
    if (!CHECK(status == LATHE_MORE)) fprintf(stderr, "%s: %s\n", name, lathe_decoder_error(decoder));
    CHECK_EQ(at, r.count);
    lathe_decoder_close(&decoder);
    lathe_model *model;
    lathe_error err = {""};
    if (!CHECK(!lathe_model_parse(&model, f->bytes, f->size, &err))) return;
    CHECK(!lathe_model_check(model, &err));
    fprintf(packets, "%s footer %016llx\n", name, (unsigned long long)footer_digest(lathe_model_describe(model)));
    lathe_model_close(&model);
}

/* Line by line; a line too many is a failure, too. */
static void compare(const char *name, char *computed) {
    file expected = read_file(name);
    if (!CHECK(expected.bytes != NULL)) return;
    char *text = malloc(expected.size + 1), *rest = text, *other = computed, *line;
    if (!text) abort();
    memcpy(text, expected.bytes, expected.size);
    text[expected.size] = 0;
    while ((line = strsep(&rest, "\n")) != NULL) {
        const char *now = strsep(&other, "\n");
        if (!CHECK(now && !strcmp(line, now))) fprintf(stderr, "%s: expected %s\n    got      %s\n", name, line, now ? now : "(nothing)");
    }
    CHECK(!other || !*other);
    free(text);
    free(expected.bytes);
}

static void write_anew(const char *name, const char *computed) {
    char path[600];
    snprintf(path, sizeof path, "%s/%s", folder(), name);
    FILE *out = fopen(path, "w");
    if (!out || fputs(computed, out) == EOF || fclose(out)) {
        perror(path);
        exit(1);
    }
    printf("%s written\n", path);
}

/* ---- one structure of many ---- */

static int append(void *context, const void *bytes, size_t size) {
    lathe__emit(context, bytes, size);
    return 0;
}

static lathe_decoder *decode_all(const uint8_t *bytes, size_t size) {
    lathe_decoder *decoder;
    lathe_step step;
    lathe_status status;
    if (lathe_decoder_open(&decoder) || lathe_decoder_feed(decoder, bytes, size)) abort();
    lathe_decoder_build_meshes(decoder, false);
    while (!(status = lathe_decoder_step(decoder, &step))) {}
    CHECK_EQ(status, LATHE_MORE);
    return decoder;
}

static bool same_content(const lathe_structure_state *a, const lathe_structure_state *b) {
    if (a->level != b->level || a->fraction != b->fraction || !a->radii != !b->radii || !a->mask.bits != !b->mask.bits) return false;
    if (a->radii) {
        if (a->radii->count != b->radii->count) return false;
        for (uint32_t i = 0; i < a->radii->count; i++) {
            const lathe_radius_map *p = &a->radii->tubes[i].map, *q = &b->radii->tubes[i].map;
            size_t rows = (size_t)p->slices, samples = rows * p->rays;
            if (p->slices != q->slices || p->rays != q->rays || p->turn != q->turn || memcmp(p->apex, q->apex, sizeof p->apex) ||
                memcmp(p->centre, q->centre, rows * sizeof *p->centre) || memcmp(p->radius, q->radius, samples * sizeof *p->radius))
                return false;
        }
        return true;
    }
    size_t bytes = lathe__mask_slice_words(&a->mask) * sizeof(uint64_t) * (size_t)a->mask.size[2];
    return a->mask.bits && !memcmp(a->mask.size, b->mask.size, sizeof a->mask.size) && !memcmp(a->mask.bits, b->mask.bits, bytes);
}

/* The stream of a structure alone, coded anew if its model is shared, decodes to what the structure is in the whole. */
static void every_structure_alone(const char *name, const file *f) {
    records r;
    lathe_header header = find_records(&r, f);
    lathe__header_free(&header);
    lathe_model *model;
    if (lathe_model_parse(&model, f->bytes, f->size, NULL)) abort();
    lathe_decoder *whole = decode_all(f->bytes, r.stream);
    for (uint32_t i = 0; i < lathe_decoder_structures(whole); i++) {
        lathe_bytes stream = {0};
        CHECK(!lathe_model_stream(model, i, 0, LATHE_MAX_LEVELS, append, &stream));
        lathe_decoder *one = decode_all(stream.data, stream.size);
        CHECK_EQ(lathe_decoder_structures(one), 1);
        if (!CHECK(same_content(lathe__decoder_state(one, 0), lathe__decoder_state(whole, i)))) fprintf(stderr, "%s, structure %u\n", name, i);
        lathe_decoder_close(&one);
        lathe__bytes_free(&stream);
    }
    lathe_decoder_close(&whole);
    lathe_model_close(&model);
}

/* ---- cut short ---- */

/* One decoder is fed byte by byte: after each byte it stands where a decoder of that prefix stands. */
static void every_prefix(const file *f) {
    records r;
    lathe_header header = find_records(&r, f);
    lathe__header_free(&header);
    lathe_decoder *decoder;
    lathe_step step;
    if (lathe_decoder_open(&decoder)) abort();
    lathe_decoder_build_meshes(decoder, false);
    lathe_decoder_every_pass(decoder, true);
    CHECK_EQ(lathe_decoder_step(decoder, &step), LATHE_MORE);
    uint32_t packets = 0, wrong = 0;
    for (size_t at = 0; at < r.stream; at++) {
        wrong += lathe_decoder_feed(decoder, f->bytes + at, 1) != LATHE_OK;
        bool complete = packets < r.count && at + 1 == r.packets[packets].end;
        for (uint32_t i = 0; complete && i < r.packets[packets].steps; i++) wrong += lathe_decoder_step(decoder, &step) != LATHE_OK;
        packets += complete;
        wrong += lathe_decoder_step(decoder, &step) != LATHE_MORE;
    }
    CHECK_EQ(wrong, 0);
    CHECK_EQ(packets, r.count);
    CHECK(!*lathe_decoder_error(decoder));
    lathe_decoder_close(&decoder);
}

static void every_short_archive(const file *f) {
    uint32_t wrong = 0;
    for (size_t size = 0; size < f->size; size++) {
        uint8_t *copy = malloc(size + !size);
        if (!copy) abort();
        memcpy(copy, f->bytes, size);
        lathe_model *model;
        lathe_error err = {""};
        wrong += lathe_model_parse(&model, copy, size, &err) != LATHE_ERR_FORMAT || !err.text[0];
        free(copy);
    }
    CHECK_EQ(wrong, 0);
}

/* ---- damaged ---- */

/* The message about a damaged byte tells where it is: a packet by level and structure, else the record or the byte. */
static bool named(const records *r, const lathe_model_info *info, size_t at, const char *text) {
    for (uint32_t i = 0; i < r->count; i++) {
        if (at < r->packets[i].begin || at >= r->packets[i].end) continue;
        char who[160];
        snprintf(who, sizeof who, "level %u of structure '%s'", r->packets[i].level,
                 r->packets[i].steps > 1 ? "all" : info->structures[r->packets[i].structure].name);
        return strstr(text, who) != NULL;
    }
    if (at < LATHE_MAGIC_SIZE) return strstr(text, "not a Lathe archive") || strstr(text, "another version");
    if (strstr(text, "near byte")) return true;
    return at >= r->stream && (strstr(text, "footer") || strstr(text, "the archive's end is missing"));
}

static lathe_status parse_damaged(const uint8_t *bytes, size_t size, lathe_error *err) {
    lathe_model *model = NULL;
    lathe_status status = lathe_model_parse(&model, bytes, size, err);
    if (!status) status = lathe_model_check(model, err);
    lathe_model_close(&model);
    return status;
}

static void every_flipped_bit(const file *f) {
    records r;
    lathe_header header = find_records(&r, f);
    lathe__header_free(&header);
    lathe_model *model;
    if (lathe_model_parse(&model, f->bytes, f->size, NULL)) abort();
    uint32_t unseen = 0, nameless = 0;
    for (size_t i = 0; i < f->size * 8; i++) {
        lathe_error err = {""};
        f->bytes[i / 8] ^= (uint8_t)(1 << i % 8);
        lathe_status status = parse_damaged(f->bytes, f->size, &err);
        f->bytes[i / 8] ^= (uint8_t)(1 << i % 8);
        unseen += status != LATHE_ERR_FORMAT && status != LATHE_ERR_CHECKSUM && status != LATHE_ERR_UNSUPPORTED && status != LATHE_ERR_LIMIT;
        if (named(&r, lathe_model_describe(model), i / 8, err.text)) continue;
        if (!nameless++) fprintf(stderr, "byte %zu: %s\n", i / 8, err.text);
    }
    CHECK_EQ(unseen, 0);
    CHECK_EQ(nameless, 0);
    lathe_model_close(&model);
}

/* A decoder never gets past the damaged record. A size that has grown makes it wait. */
static void flipped_streams(const file *f) {
    enum { EVERY = 37 };
    records r;
    lathe_header header = find_records(&r, f);
    lathe__header_free(&header);
    for (size_t at = 0; at < r.stream; at += EVERY) {
        uint32_t before = 0, steps = 0, expected = 0;
        for (; before < r.count && r.packets[before].end <= at; before++) expected += r.packets[before].steps;
        lathe_decoder *decoder;
        lathe_step step;
        if (lathe_decoder_open(&decoder)) abort();
        lathe_decoder_build_meshes(decoder, false);
        lathe_decoder_every_pass(decoder, true);
        f->bytes[at] ^= (uint8_t)(1 << at % 8);
        if (lathe_decoder_feed(decoder, f->bytes, r.stream)) abort();
        f->bytes[at] ^= (uint8_t)(1 << at % 8);
        lathe_status status;
        while (!(status = lathe_decoder_step(decoder, &step))) steps++;
        CHECK_EQ(steps, expected);
        CHECK(status == LATHE_MORE || *lathe_decoder_error(decoder));
        if (before < r.count && at >= r.packets[before].begin) CHECK_EQ(status, LATHE_ERR_CHECKSUM);
        lathe_decoder_close(&decoder);
    }
}

int main(int argc, char **argv) {
    const char *anew = argc == 3 && !strcmp(argv[1], "--write") ? argv[2] : NULL;
    if (argc > 1 && (!anew || (strcmp(anew, "packets") && strcmp(anew, "meshes")))) {
        fputs("usage: test_golden [--write packets|meshes]\n", stderr);
        return 2;
    }
    char *text[2];
    size_t size[2];
    FILE *packets = open_memstream(&text[0], &size[0]), *meshes = open_memstream(&text[1], &size[1]);
    struct dirent **entries;
    int count = scandir(folder(), &entries, is_golden, alphasort);
    if (!packets || !meshes) abort();
    CHECK(count >= 12);
    for (int i = 0; i < count; i++) {
        char name[300];
        file f = read_file(entries[i]->d_name);
        snprintf(name, sizeof name, "%.*s", (int)strlen(entries[i]->d_name) - 6, entries[i]->d_name);
        CHECK(f.size > 0 && f.size <= 8192);
        decode(packets, meshes, name, &f);
        if (!anew) {
            every_structure_alone(name, &f);
            every_prefix(&f);
            every_short_archive(&f);
            every_flipped_bit(&f);
            flipped_streams(&f);
        }
        free(f.bytes);
        free(entries[i]);
    }
    if (count >= 0) free(entries);
    if (fclose(packets) || fclose(meshes)) abort();
    if (!anew) {
        compare("packets.txt", text[0]);
        compare("meshes.txt", text[1]);
    } else {
        bool of_packets = !strcmp(anew, "packets");
        write_anew(of_packets ? "packets.txt" : "meshes.txt", text[of_packets ? 0 : 1]);
    }
    free(text[0]);
    free(text[1]);
    return check_end();
}
