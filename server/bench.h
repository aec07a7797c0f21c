/* What the benchmarks of the command line share. */
#ifndef LATHE_BENCH_H
#define LATHE_BENCH_H
#include "cli.h"

double lathe__cpu_seconds(void);   /* of this process, all threads */

/* CPU seconds to decode a stream to the last meshes, joints included: the fastest of several runs. with_normals:
 * also world positions, indices and unit normals of the vertices, as a renderer takes them. */
typedef struct lathe__decode_speed { uint64_t triangles; double seconds, with_normals; } lathe__decode_speed;
lathe_status lathe__measure_decoding(lathe__decode_speed *out, const lathe_model *model, int repeats, lathe_error *err);

/* cmd_bench_bytes.c: `bench bytes`; argv[1] is "bytes". Returns an exit status. */
int lathe__bench_bytes(int argc, char **argv);
#endif
