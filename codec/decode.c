/* The decoder: bytes are collected until a record or packet is complete, then decoded in place. */
#include <stdlib.h>
#include <string.h>
#include "lathe_codec.h"
#include "structure_state.h"

/* restream.h, which is not in the small decoder. */
lathe_structure_state *lathe__decoder_state(lathe_decoder *d, uint32_t structure);

struct lathe_decoder {
    uint8_t *bytes;
    size_t size, capacity, used;
    bool has_header, has_level, build;
    lathe_header header;
    lathe_level_head head;
    uint32_t next_packet;      /* of the current level record */
    uint32_t next_structure;
    lathe_structure_state *states;
    lathe_models models;
    lathe_transform *transforms;
    lathe_arena arena[2];
    lathe_mesh mesh;           /* of mesh_of at its level, if mesh_level >= 0 */
    uint32_t mesh_of;
    int32_t mesh_level;
    lathe_surface_counts counts;
    uint32_t shown;
    lathe_status failure;
    const char *fault;
};

lathe_status lathe_decoder_open(lathe_decoder **out) {
    lathe_decoder *d = calloc(1, sizeof *d);
    if (!d) return LATHE_ERR_MEMORY;
    d->build = true;
    d->mesh_level = -1;
    d->fault = "";
    *out = d;
    return LATHE_OK;
}

void lathe_decoder_close(lathe_decoder **decoder) {
    if (!decoder || !*decoder) return;
    lathe_decoder *d = *decoder;
    for (uint32_t i = 0; d->states && i < d->header.structure_count; i++) lathe__state_free(&d->states[i]);
    lathe__occupancy_free(&d->models.occupancy);
    free(d->states);
    free(d->transforms);
    free(d->bytes);
    lathe__header_free(&d->header);
    lathe__level_head_free(&d->head);
    lathe__arena_free(&d->arena[0]);
    lathe__arena_free(&d->arena[1]);
    lathe_mesh_free(&d->mesh);
    free(d);
    *decoder = NULL;
}

lathe_status lathe_decoder_feed(lathe_decoder *d, const uint8_t *bytes, size_t size) {
    if (d->failure) return d->failure;
    if (d->used) {
        memmove(d->bytes, d->bytes + d->used, d->size - d->used);
        d->size -= d->used;
        d->used = 0;
    }
    if (size > d->capacity - d->size) {
        if (size > SIZE_MAX / 4 - d->size) return LATHE_ERR_MEMORY;
        size_t capacity = (d->size + size) * 3 / 2 + 256;
        uint8_t *more = realloc(d->bytes, capacity);
        if (!more) return LATHE_ERR_MEMORY;
        d->bytes = more;
        d->capacity = capacity;
    }
    if (size) memcpy(d->bytes + d->size, bytes, size);
    d->size += size;
    return LATHE_OK;
}

static lathe_status fail(lathe_decoder *d, lathe_status status, const char *fault) {
    d->failure = status;
    d->fault = fault;
    return status;
}

static lathe_status start_structures(lathe_decoder *d) {
    uint32_t n = d->header.structure_count;
    d->states = calloc(n, sizeof *d->states);
    d->transforms = calloc(n, sizeof *d->transforms);
    if (!d->states || !d->transforms) return LATHE_ERR_MEMORY;
    lathe__models_start(&d->models, &d->header);
    for (uint32_t i = 0; i < n; i++) {
        const lathe_header_structure *h = &d->header.structures[i];
        lathe_structure_state *s = &d->states[i];
        for (int k = 0; k < 3; k++) {
            s->mask.size[k] = h->size[k];
            s->mask.origin[k] = h->origin[k];
        }
        s->mask.row_words = (h->size[0] + 63) / 64;
        s->plan = (lathe_level_plan){.slices = h->size[2], .level_count = h->level_count};
        s->fraction = d->header.parameter_count ? (int)(d->header.parameters[0] & 63) : LATHE_FRACTION_ONE / 2;
        s->flags = d->header.parameter_count > 1 ? d->header.parameters[1] : 0;
        s->level = -1;
        d->transforms[i] = lathe__mask_transform(&s->mask, d->header.axis, d->header.affine);
    }
    return LATHE_OK;
}

/* What a failed or incomplete read means for the decoder. */
static lathe_status reading(lathe_decoder *d, const lathe_reader *reader, lathe_status status) {
    if (status == LATHE_MORE) return status;
    return fail(d, status, reader->fault);
}

static lathe_status next_packet(lathe_decoder *d, const uint8_t **payload, uint32_t *size) {
    if (d->used == d->size) return LATHE_MORE;   /* bytes may be NULL then */
    lathe_reader reader = lathe__reader(d->bytes + d->used, d->size - d->used);
    if (!d->has_header) {
        lathe_status status = lathe__header_parse(&d->header, &reader);
        if (status) return reading(d, &reader, status);
        status = start_structures(d);
        if (status) return fail(d, status, LATHE_FAULT("header"));
        d->has_header = true;
        d->used = (size_t)(reader.at - d->bytes);
    }
    if (!d->has_level) {
        if (!lathe__reader_left(&reader)) return LATHE_MORE;
        lathe_status status = lathe__level_parse(&d->head, &reader, &d->header);
        if (status) return reading(d, &reader, status);
        d->has_level = true;
        d->next_packet = d->next_structure = 0;
        d->used = (size_t)(reader.at - d->bytes);
    }
    *size = d->head.sizes[d->next_packet];
    *payload = lathe__packet_parse(&reader, *size);
    if (!*payload) return reading(d, &reader, reader.status);
    d->used = (size_t)(reader.at - d->bytes);
    return LATHE_OK;
}

lathe_status lathe_decoder_step(lathe_decoder *d, lathe_step *step) {
    if (d->failure) return d->failure;
    const uint8_t *payload;
    uint32_t size;
    lathe_status status = next_packet(d, &payload, &size);
    if (status) return status;
    while (d->header.structures[d->next_structure].level_count <= d->head.level) d->next_structure++;
    uint32_t s = d->next_structure++;
    lathe_structure_state *state = &d->states[s];
    const char *fault = LATHE_FAULT("");
    status = lathe__structure_decode(state, &d->arena[0], &d->models, d->head.level, payload, size, &fault);
    lathe__arena_reset(&d->arena[0]);
    if (status) return fail(d, status, fault);
    d->mesh_level = -1;
    *step = (lathe_step){.structure = s, .level = d->head.level, .error_rms_mm = d->head.error_rms_mm, .error_max_mm = d->head.error_max_mm};
    if (++d->next_packet == d->head.count) {
        d->has_level = false;
        lathe__level_head_free(&d->head);
    }
    if (d->build) {
        if (!lathe_decoder_mesh(d, s)) return d->failure;
        step->rays = d->counts.rays;
        step->slices = d->shown;
    }
    return LATHE_OK;
}

void lathe_decoder_build_meshes(lathe_decoder *d, bool build) { d->build = build; }

const lathe_mesh *lathe_decoder_mesh(lathe_decoder *d, uint32_t structure) {
    if (!d->has_header || structure >= d->header.structure_count || d->states[structure].level < 0) return NULL;
    if (d->mesh_level == d->states[structure].level && d->mesh_of == structure) return &d->mesh;
    lathe_mesh_free(&d->mesh);
    d->mesh_level = -1;
    lathe_status status = lathe__state_mesh(&d->mesh, d->arena, &d->states[structure], &d->counts, &d->shown);
    if (status) {
        fail(d, status, LATHE_FAULT("the surface cannot be built"));
        return NULL;
    }
    d->mesh_of = structure;
    d->mesh_level = d->states[structure].level;
    return &d->mesh;
}

const lathe_transform *lathe_decoder_transform(const lathe_decoder *d, uint32_t structure) {
    return d->has_header && structure < d->header.structure_count ? &d->transforms[structure] : NULL;
}

uint32_t lathe_decoder_structures(const lathe_decoder *d) { return d->has_header ? d->header.structure_count : 0; }

const char *lathe_decoder_error(const lathe_decoder *d) {
    if (!d->failure) return "";
    return *d->fault ? d->fault : lathe_status_name(d->failure);
}

lathe_structure_state *lathe__decoder_state(lathe_decoder *d, uint32_t structure) { return &d->states[structure]; }
