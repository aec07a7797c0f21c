/* Which triangles lie in a cube of eight samples, by which of them are inside. Decoder-safe. */
#ifndef LATHE_CUBE_TABLE_H
#define LATHE_CUBE_TABLE_H
#include <stdint.h>

/* Corner c of a cube is at (c & 1, c >> 1 & 1, c >> 2). Edge 4 * axis + k is along `axis`, with k & 1 and k >> 1 its place along the
 * next two axes, cyclically. */
enum { LATHE_CUBE_EDGES = 12, LATHE_CUBE_TRIANGLES = 6 };

/* Triangles between vertices on edges, counter-clockwise seen from outside of the solid. */
typedef struct lathe_cube_case {
    uint8_t count, corner[LATHE_CUBE_TRIANGLES][3];
} lathe_cube_case;

/* By the corners that are inside, bit c for corner c. Made when first asked for; any thread may ask. */
const lathe_cube_case *lathe__cube_table(void);
#endif
