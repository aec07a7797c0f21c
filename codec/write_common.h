/* What the mesh writers share: a buffered little-endian sink and the vetting of meshes. */
#ifndef LATHE_WRITE_COMMON_H
#define LATHE_WRITE_COMMON_H
#include "lathe_codec.h"

typedef struct lathe_out {
    lathe_sink sink;
    void *context;
    bool failed; /* the sink refused: nothing more is sent */
    size_t filled;
    uint8_t buffer[1 << 14];
} lathe_out;
void lathe__out_start(lathe_out *out, lathe_sink sink, void *context);
void lathe__out_bytes(lathe_out *out, const void *bytes, size_t size);
void lathe__out_u8(lathe_out *out, uint8_t v);
void lathe__out_u16(lathe_out *out, uint16_t v);
void lathe__out_u32(lathe_out *out, uint32_t v);
void lathe__out_f32(lathe_out *out, float v);
lathe_status lathe__out_finish(lathe_out *out); /* flushes; IO if the sink refused */

/* RANGE: no triangle, a position that is not finite, an index or a part outside its bounds. */
lathe_status lathe__world_mesh_check(const lathe_world_mesh *mesh);
/* The structure of a part, or NULL if the options do not tell. */
const lathe_structure_info *lathe__part_info(const lathe_world_mesh *mesh, const lathe_write_options *options,
                                             uint32_t part);
#endif
