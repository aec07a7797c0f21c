/* What was encoded: an archive baked again from its volume, for `lathe verify`. */
#ifndef LATHE_REBAKE_H
#define LATHE_REBAKE_H
#include "lathe_codec.h"

typedef struct lathe_rebaked { uint8_t *bytes; size_t size, capacity; } lathe_rebaked;
/* Bakes without measuring, with the structures, axis, boundary and iso of info. *out is malloc'ed, owned by the
 * caller. */
lathe_status lathe__rebake(lathe_rebaked *out, const lathe_model_info *info, const lathe_volume *volume,
                           lathe_error *err);
#endif
