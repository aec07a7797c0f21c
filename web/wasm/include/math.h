/* The functions that wasm has instructions for: the results are IEEE's, the same on every platform. */
#ifndef LATHE_WASM_MATH_H
#define LATHE_WASM_MATH_H
#define sqrt __builtin_sqrt
#define sqrtf __builtin_sqrtf
#define fabs __builtin_fabs
#define fabsf __builtin_fabsf
#define floor __builtin_floor
#define ceil __builtin_ceil
#define isfinite __builtin_isfinite
#define isnan __builtin_isnan
#define NAN __builtin_nanf("")
#define INFINITY __builtin_inff()
#endif
