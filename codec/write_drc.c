/* Draco: all structures in one mesh, positions only. */
#include "draco_bridge.h"
#include "write_common.h"
#include <stdlib.h>

enum { DEFAULT_BITS = 11, MAX_BITS = 30 };

lathe_status lathe_write_drc(const lathe_world_mesh *mesh, int quantization_bits, lathe_sink sink, void *context) {
    if (quantization_bits < 0 || quantization_bits > MAX_BITS) return LATHE_ERR_RANGE;
    lathe_status status = lathe__world_mesh_check(mesh);
    if (status) return status;
    uint8_t *bytes = NULL;
    size_t size = 0;
    status = lathe__draco_encode(&bytes, &size, mesh->positions, mesh->vertex_count, mesh->indices,
                                 mesh->triangle_count, quantization_bits ? quantization_bits : DEFAULT_BITS);
    if (!status && sink(context, bytes, size)) status = LATHE_ERR_IO;
    free(bytes);
    return status;
}
