#ifndef LATHE_RESTREAM_H
#define LATHE_RESTREAM_H
#include "archive_write.h"
#include "structure_state.h"

/* The packets of one structure as if it were a model of its own; packets are the caller's to free, also on failure. Costs decoding
 * the stream and encoding the structure. Errors of the decoder; MEMORY. */
lathe_status lathe__restream(lathe_packet_list packets[LATHE_MAX_LEVELS], const lathe_model *model, uint32_t structure, uint32_t level_count);

/* decode.c: what a decoder knows of a structure; its own. */
lathe_structure_state *lathe__decoder_state(lathe_decoder *decoder, uint32_t structure);
#endif
