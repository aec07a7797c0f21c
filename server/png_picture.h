/* A picture as PNG. */
#ifndef LATHE_PNG_PICTURE_H
#define LATHE_PNG_PICTURE_H
#include "lathe.h"

/* rgba: width * height pixels of 4 bytes, row by row from the top. pixel_mm: side of a pixel, told to who opens it;
 * 0: not known. *bytes is malloc'ed, the caller's. LIMIT (a side beyond 16384), MEMORY. */
lathe_status lathe__png_write(uint8_t **bytes, size_t *size, const uint8_t *rgba, uint32_t width, uint32_t height,
                              double pixel_mm);
#endif
