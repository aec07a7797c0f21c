/* Contour sets as JSON files (docs/CONTOUR_SETS.md). */
#ifndef LATHE_CONTOUR_JSON_H
#define LATHE_CONTOUR_JSON_H
#include "contour_set.h"

/* Is this file a contour set, that is JSON whose outermost object has "sections"? False for whatever cannot be read;
 * then a volume's reader will say what is wrong. */
bool lathe__is_contour_json(const char *path);
/* Hostile files are safe. IO; FORMAT (err: where, counted from 0); UNSUPPORTED: an unknown unit; LIMIT: more than 64
 * MiB or a limit of contour_set.h; RANGE; MEMORY. Free with lathe__contour_set_free. repairs may be NULL. */
lathe_status lathe__contour_json_open(lathe_contour_set *out, lathe_set_repairs *repairs, const char *path,
                                      lathe_error *err);
/* The same from bytes. */
lathe_status lathe__contour_json_parse(lathe_contour_set *out, lathe_set_repairs *repairs, const char *bytes,
                                       size_t size, lathe_error *err);
#endif
