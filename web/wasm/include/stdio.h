/* Error details are the only text that the decoder writes: %s %c %d %i %u %x with the lengths l, ll, z, h and no others. */
#ifndef LATHE_WASM_STDIO_H
#define LATHE_WASM_STDIO_H
#include <stdarg.h>
#include <stddef.h>
int vsnprintf(char *out, size_t size, const char *format, va_list arguments);
int snprintf(char *out, size_t size, const char *format, ...) __attribute__((format(printf, 3, 4)));
#endif
