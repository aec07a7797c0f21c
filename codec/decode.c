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
    lathe_pyramid pyramid;
    lathe_range_decoder code;  /* of a pyramid's packet that is being decoded */
    uint8_t *open;             /* its bytes: SHARED, structure by structure; NULL: none */
    bool every_pass;
    lathe_transform *transforms;
    lathe_arena arena[2];
    lathe_mesh mesh;           /* of mesh_of at its level, if has_mesh */
    uint32_t mesh_of;
    bool has_mesh;
    lathe_surface_counts counts;
    uint32_t shown;
    lathe_status failure;
    const char *fault;
};

lathe_status lathe_decoder_open(lathe_decoder **out) {
    lathe_decoder *d = calloc(1, sizeof *d);
    if (!d) return LATHE_ERR_MEMORY;
    d->build = true;
    d->has_mesh = false;
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
    free(d->open);
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
    bool pyramid = lathe__header_pyramid(&d->header);
    if (pyramid && lathe__pyramid_read(&d->pyramid, &d->header)) return LATHE_ERR_FORMAT;
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
        s->upright = d->header.parameter_count ? (int)(d->header.parameters[0] >> 6 & 63) : 0;
        s->flags = lathe__header_flags(&d->header);
        s->pyramid = pyramid ? &d->pyramid : NULL;
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
        uint32_t flags = lathe__header_flags(&d->header);
        bool strange = (LATHE_RASTERS_ONLY && ~flags & LATHE_RASTER_FLAGS) || (LATHE_TUBES_ONLY && flags & LATHE_FLAG_PYRAMID);
        status = strange ? LATHE_ERR_FORMAT : start_structures(d);
        if (status) return fail(d, status, strange ? LATHE_OTHERS : LATHE_FAULT("header"));
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

/* ---- steps: a packet of one structure, or one structure's part of a packet ---- */

static void end_packet(lathe_decoder *d) {
    free(d->open);
    d->open = NULL;
    if (++d->next_packet < d->head.count) return;
    d->has_level = false;
    lathe__level_head_free(&d->head);
}

/* Structure by structure of a packet of SHARED models, which is kept meanwhile. */
static lathe_status shared_step(lathe_decoder *d, const uint8_t *payload, uint32_t size, const char **fault) {
    if (!d->open) {
        d->open = malloc((size_t)size + 1);
        if (!d->open) return LATHE_ERR_MEMORY;
        memcpy(d->open, payload, size);
        lathe__decoder_start(&d->code, d->open, size);
    }
    return lathe__pass_decode(&d->states[d->next_structure], &d->code, &d->models, d->head.level, fault);
}

static lathe_status single_step(lathe_decoder *d, const uint8_t *payload, uint32_t size, const char **fault) {
    lathe_structure_state *state = &d->states[d->next_structure];
    if (!lathe__is_pyramid(state)) return lathe__structure_decode(state, &d->arena[0], &d->models, d->head.level, payload, size, fault);
    lathe__decoder_start(&d->code, payload, size);
    return lathe__pass_decode(state, &d->code, &d->models, d->head.level, fault);
}

/* Decodes a part; *step says whose. */
static lathe_status next_step(lathe_decoder *d, lathe_step *step) {
    const uint8_t *payload = NULL;
    uint32_t size = 0;
    lathe_status status = d->open ? LATHE_OK : next_packet(d, &payload, &size);
    if (status) return status;
    while (d->header.structures[d->next_structure].level_count <= d->head.level) d->next_structure++;
    uint32_t s = d->next_structure;
    lathe_structure_state *state = &d->states[s];
    const char *fault = LATHE_FAULT("");
    bool shared = lathe__is_pyramid(state) && state->flags & LATHE_FLAG_SHARED;
    d->has_mesh = false;
    status = shared ? shared_step(d, payload, size, &fault) : single_step(d, payload, size, &fault);
    lathe__arena_reset(&d->arena[0]);
    if (status) return fail(d, status, fault);
    uint32_t left = !lathe__is_pyramid(state) || state->level == (int32_t)d->head.level ? 0 : lathe__pyramid_passes(&d->pyramid, d->head.level) - state->pass;
    *step = (lathe_step){.structure = s, .level = d->head.level, .error_rms_mm = d->head.error_rms_mm,
                         .error_max_mm = d->head.error_max_mm, .passes_left = left};
    if (++d->next_structure == d->header.structure_count && lathe__is_pyramid(state)) d->next_structure = 0;
    if (!shared || !d->next_structure) end_packet(d);
    return LATHE_OK;
}

lathe_status lathe_decoder_step(lathe_decoder *d, lathe_step *step) {
    if (d->failure) return d->failure;
    do {
        lathe_status status = next_step(d, step);
        if (status) return status;
    } while (step->passes_left && !d->every_pass);
    if (d->build) {
        if (!lathe_decoder_mesh(d, step->structure)) return d->failure;
        step->rays = d->counts.rays;
        step->slices = d->shown;
    }
    return LATHE_OK;
}

void lathe_decoder_every_pass(lathe_decoder *d, bool every) { d->every_pass = every; }
void lathe_decoder_build_meshes(lathe_decoder *d, bool build) { d->build = build; }

const lathe_mesh *lathe_decoder_mesh(lathe_decoder *d, uint32_t structure) {
    if (!d->has_header || structure >= d->header.structure_count || !lathe__state_known(&d->states[structure])) return NULL;
    if (d->has_mesh && d->mesh_of == structure) return &d->mesh;
    lathe_mesh_free(&d->mesh);
    d->has_mesh = false;
    lathe_status status = lathe__state_mesh(&d->mesh, d->arena, &d->states[structure], &d->counts, &d->shown);
    if (status) {
        fail(d, status, LATHE_FAULT("the surface cannot be built"));
        return NULL;
    }
    d->mesh_of = structure;
    d->has_mesh = true;
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
