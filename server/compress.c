/* Content-Encoding: which one a client takes, and the bytes. Each is made once and kept, so quality goes first. */
#include "service.h"
#include <brotli/encode.h>
#include <ctype.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include <zlib.h>

static lathe_status brotli_as(lathe_buffer *out, const uint8_t *bytes, size_t size, BrotliEncoderMode mode,
                              int quality) {
    size_t bound = BrotliEncoderMaxCompressedSize(size);
    if (!bound) return LATHE_ERR_LIMIT;
    uint8_t *target = malloc(bound);
    if (!target) return LATHE_ERR_MEMORY;
    if (!BrotliEncoderCompress(quality, BROTLI_MAX_WINDOW_BITS, mode, size, bytes, &bound, target)) {
        free(target);
        return LATHE_ERR_MEMORY;
    }
    *out = (lathe_buffer){target, bound, bound};
    return LATHE_OK;
}

/* Pages are script and base64, for which the mode made for fonts is often the smaller one, by half a percent: both are
 * tried. */
static lathe_status brotli(lathe_buffer *out, const uint8_t *bytes, size_t size, bool best) {
    lathe_status status = brotli_as(out, bytes, size, BROTLI_MODE_TEXT, best ? 11 : 9);
    if (status || !best) return status;
    lathe_buffer other = {0};
    if (brotli_as(&other, bytes, size, BROTLI_MODE_FONT, 11) == LATHE_OK && other.size < out->size) {
        lathe_buffer swap = *out;
        *out = other;
        other = swap;
    }
    lathe__buffer_free(&other);
    return LATHE_OK;
}

static lathe_status gzip(lathe_buffer *out, const uint8_t *bytes, size_t size) {
    enum { GZIP_WRAPPER = 16 };
    z_stream z = {0};
    if (size > UINT32_MAX / 2) return LATHE_ERR_LIMIT;
    if (deflateInit2(&z, 9, Z_DEFLATED, MAX_WBITS + GZIP_WRAPPER, 9, Z_DEFAULT_STRATEGY) != Z_OK)
        return LATHE_ERR_MEMORY;
    size_t bound = deflateBound(&z, size);
    uint8_t *target = malloc(bound);
    z.next_in = (Bytef *)(uintptr_t)bytes;
    z.avail_in = (uInt)size;
    z.next_out = target;
    z.avail_out = (uInt)bound;
    int result = target ? deflate(&z, Z_FINISH) : Z_MEM_ERROR;
    size_t written = z.total_out;
    deflateEnd(&z);
    if (result != Z_STREAM_END) {
        free(target);
        return LATHE_ERR_MEMORY;
    }
    *out = (lathe_buffer){target, written, bound};
    return LATHE_OK;
}

lathe_status lathe__compress(lathe_buffer *out, const uint8_t *bytes, size_t size, lathe_encoding encoding, bool best) {
    return encoding == LATHE_BROTLI ? brotli(out, bytes, size, best) : gzip(out, bytes, size);
}

/* The weight of one element of Accept-Encoding, in thousandths: `q=0` is a refusal, nonsense counts as 1. */
static int weight(const char *parameters, size_t size) {
    for (size_t i = 0; i + 1 < size; i++) {
        if ((parameters[i] == 'q' || parameters[i] == 'Q') && parameters[i + 1] == '=') {
            int thousandths = 0, digits = 0;
            const char *p = parameters + i + 2, *end = parameters + size;
            if (p < end && *p == '1') return 1000;
            if (p < end && *p == '0') p++;
            if (p < end && *p == '.') p++;
            for (; p < end && digits < 3 && isdigit((unsigned char)*p); p++, digits++)
                thousandths = thousandths * 10 + *p - '0';
            for (; digits < 3; digits++) thousandths *= 10;
            return thousandths;
        }
    }
    return 1000;
}

lathe_encoding lathe__negotiate(const char *accept, bool compressible) {
    int identity = -1, gzip_weight = -1, brotli_weight = -1, any = -1;
    for (const char *p = accept; p && *p;) {
        p += strspn(p, " \t,");
        size_t element = strcspn(p, ","), name = strcspn(p, " \t;,");
        int q = weight(p + name, element - name);
        if (name == 2 && !strncasecmp(p, "br", 2))
            brotli_weight = q;
        else if ((name == 4 && !strncasecmp(p, "gzip", 4)) || (name == 6 && !strncasecmp(p, "x-gzip", 6)))
            gzip_weight = q;
        else if (name == 8 && !strncasecmp(p, "identity", 8))
            identity = q;
        else if (name == 1 && *p == '*')
            any = q;
        p += element;
    }
    if (brotli_weight < 0) brotli_weight = any;
    if (gzip_weight < 0) gzip_weight = any;
    if (identity < 0) identity = any == 0 ? 0 : 1;
    if (compressible && brotli_weight > 0 && brotli_weight >= gzip_weight && brotli_weight >= identity)
        return LATHE_BROTLI;
    if (compressible && gzip_weight > 0 && gzip_weight >= identity) return LATHE_GZIP;
    if (identity > 0) return LATHE_IDENTITY;
    if (compressible && brotli_weight > 0) return LATHE_BROTLI;
    return compressible && gzip_weight > 0 ? LATHE_GZIP : LATHE_NONE_ACCEPTABLE;
}
