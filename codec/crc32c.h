/* CRC-32C (Castagnoli, reflected 0x82F63B78): every checksum of an archive. Decoder-safe. */
#ifndef LATHE_CRC32C_H
#define LATHE_CRC32C_H
#include <stddef.h>
#include <stdint.h>

/* Continues crc (0 to begin) over size bytes: crc32c("123456789") is 0xE3069283. */
uint32_t lathe__crc32c(uint32_t crc, const void *bytes, size_t size);
#endif
