/* Binary STL: 80 bytes of text, a count, 50 bytes for each triangle. World mm. */
#include "write_common.h"
#include <math.h>
#include <string.h>

enum { HEADER = 80 };

/* Must not begin with "solid": readers take that for the text form. */
static void write_header(lathe_out *out, const char *name) {
    char header[HEADER] = "Lathe, millimetres: ";
    size_t n = strlen(header);
    for (; name && *name && n < HEADER; name++)
        header[n++] = (unsigned char)*name >= 32 && (unsigned char)*name < 127 ? *name : '?';
    lathe__out_bytes(out, header, HEADER);
}

/* (0, 0, 0) for a triangle without area, as the format has it for "not given". */
static void write_normal(lathe_out *out, const float *a, const float *b, const float *c) {
    double u[3], v[3], n[3];
    for (int i = 0; i < 3; i++) {
        u[i] = (double)b[i] - (double)a[i];
        v[i] = (double)c[i] - (double)a[i];
    }
    for (int i = 0; i < 3; i++) n[i] = u[(i + 1) % 3] * v[(i + 2) % 3] - u[(i + 2) % 3] * v[(i + 1) % 3];
    double length = sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]);
    bool usable = length > 0 && isfinite(length);
    for (int i = 0; i < 3; i++) lathe__out_f32(out, usable ? (float)(n[i] / length) : 0.0f);
}

lathe_status lathe_write_stl(const lathe_world_mesh *mesh, const lathe_write_options *options, lathe_sink sink,
                             void *context) {
    lathe_status status = lathe__world_mesh_check(mesh);
    if (status) return status;
    lathe_out out;
    lathe__out_start(&out, sink, context);
    write_header(&out, options ? options->name : NULL);
    lathe__out_u32(&out, mesh->triangle_count);
    for (uint32_t t = 0; t < mesh->triangle_count && !out.failed; t++) {
        const uint32_t *index = mesh->indices + (size_t)3 * t;
        const float *corner[3];
        for (int k = 0; k < 3; k++) corner[k] = mesh->positions + (size_t)3 * index[k];
        write_normal(&out, corner[0], corner[1], corner[2]);
        for (int k = 0; k < 3; k++)
            for (int i = 0; i < 3; i++) lathe__out_f32(&out, corner[k][i]);
        lathe__out_u16(&out, 0);
    }
    return lathe__out_finish(&out);
}
