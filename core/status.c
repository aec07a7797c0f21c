#include "lathe.h"
#include <stdarg.h>
#include <stdio.h>

const char *lathe_status_name(lathe_status status) {
    switch (status) {
    case LATHE_OK: return "ok";
    case LATHE_MORE: return "more input needed";
    case LATHE_ERR_MEMORY: return "out of memory";
    case LATHE_ERR_IO: return "input/output error";
    case LATHE_ERR_FORMAT: return "malformed input";
    case LATHE_ERR_UNSUPPORTED: return "not supported";
    case LATHE_ERR_EMPTY: return "empty structure";
    case LATHE_ERR_RANGE: return "out of range";
    case LATHE_ERR_CHECKSUM: return "checksum mismatch";
    case LATHE_ERR_LIMIT: return "over a limit";
    }
    return "unknown status";
}

lathe_status lathe_fail(lathe_error *err, lathe_status status, const char *format, ...) {
    if (err) {
        va_list args;
        va_start(args, format);
        (void)vsnprintf(err->text, sizeof err->text, format, args);
        va_end(args);
    }
    return status;
}
