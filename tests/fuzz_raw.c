/* libFuzzer target: a sidecar, a zero byte, and the raw file's bytes. */
#include "volume_internal.h"
#include <stdlib.h>
#include <string.h>

int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t size);
int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t size) {
    const uint8_t *zero = size ? memchr(bytes, 0, size) : NULL;
    size_t json_size = zero ? (size_t)(zero - bytes) : size;
    lathe_raw_header header;
    lathe_error err = {""};
    if (lathe__raw_header_parse(&header, (const char *)bytes, json_size, &err)) {
        if (!err.text[0]) abort();
        return 0;
    }
    size_t data = zero ? size - json_size - 1 : 0;
    lathe_volume *volume = NULL;
    lathe_status status = lathe__volume_raw_parse(&volume, &header, zero ? zero + 1 : bytes + size, data, &err);
    if ((status == LATHE_OK) != (volume != NULL) || (status && !err.text[0])) abort();
    lathe_volume_close(&volume);
    return 0;
}
