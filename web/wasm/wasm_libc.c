/* The C library of the wasm decoder: an allocator over linear memory, memory functions, a sort and a small printf.
 * Built with -mbulk-memory, so that copying and filling are single instructions. */
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* ---- allocator: first fit over a list of free blocks in address order; neighbours are merged when one is freed ---- */

enum { PAGE = 65536 };

/* Before every block, and 16 bytes so that blocks are aligned for everything. next is meaningful only while it is free. */
typedef struct block {
    size_t size;               /* of the whole block, header included; a multiple of the header's size */
    struct block *next;
    size_t unused[2];
} block;

extern unsigned char __heap_base;
static block *free_list;
static uintptr_t heap_end;     /* 0 before the first growth */

static block *block_end(block *b) { return (block *)((char *)b + b->size); }

/* Inserts b where its address belongs and merges it with what it touches. */
static void insert_free(block *b) {
    block *before = NULL, *after = free_list;
    while (after && after < b) {
        before = after;
        after = after->next;
    }
    b->next = after;
    if (after && block_end(b) == after) {
        b->size += after->size;
        b->next = after->next;
    }
    if (!before) {
        free_list = b;
    } else if (block_end(before) == b) {
        before->size += b->size;
        before->next = b->next;
    } else {
        before->next = b;
    }
}

/* Adds at least size bytes to the heap, as a free block. */
static int grow_heap(size_t size) {
    if (!heap_end) {
        uintptr_t start = ((uintptr_t)&__heap_base + sizeof(block) - 1) & ~(uintptr_t)(sizeof(block) - 1);
        heap_end = (uintptr_t)__builtin_wasm_memory_size(0) * PAGE;
        if (heap_end > start) {
            block *first = (block *)start;
            first->size = heap_end - start;
            insert_free(first);
            if (first->size >= size) return 1;
        }
    }
    size_t pages = size / PAGE + 1;
    if (__builtin_wasm_memory_grow(0, pages) == (size_t)-1) return 0;
    block *fresh = (block *)heap_end;
    fresh->size = pages * PAGE;
    heap_end += fresh->size;
    insert_free(fresh);
    return 1;
}

/* Cuts what lies beyond size off b and frees it, if it is worth a block of its own. */
static void trim_block(block *b, size_t size) {
    if (b->size - size < 2 * sizeof(block)) return;
    block *rest = (block *)((char *)b + size);
    rest->size = b->size - size;
    b->size = size;
    insert_free(rest);
}

void *malloc(size_t size) {
    if (size > (size_t)INT32_MAX) return NULL;
    size = (size + 2 * sizeof(block) - 1) & ~(sizeof(block) - 1);
    do {
        for (block **link = &free_list; *link; link = &(*link)->next) {
            block *b = *link;
            if (b->size < size) continue;
            *link = b->next;
            trim_block(b, size);
            return b + 1;
        }
    } while (grow_heap(size));
    return NULL;
}

void free(void *memory) {
    if (memory) insert_free((block *)memory - 1);
}

void *calloc(size_t count, size_t size) {
    size_t total;
    if (__builtin_mul_overflow(count, size, &total)) return NULL;
    void *memory = malloc(total);
    return memory ? memset(memory, 0, total) : NULL;
}

void *realloc(void *memory, size_t size) {
    if (!memory) return malloc(size);
    size_t old = ((block *)memory - 1)->size - sizeof(block);
    if (size <= old) return memory;
    void *larger = malloc(size);
    if (!larger) return NULL;
    memcpy(larger, memory, old);
    free(memory);
    return larger;
}

/* ---- memory and text ---- */

void *memcpy(void *restrict to, const void *restrict from, size_t size) { return __builtin_memcpy(to, from, size); }
void *memmove(void *to, const void *from, size_t size) { return __builtin_memmove(to, from, size); }
void *memset(void *to, int value, size_t size) { return __builtin_memset(to, value, size); }

int memcmp(const void *a, const void *b, size_t size) {
    const unsigned char *x = a, *y = b;
    for (; size; size--, x++, y++)
        if (*x != *y) return *x - *y;
    return 0;
}

void *memchr(const void *bytes, int value, size_t size) {
    for (const unsigned char *at = bytes; size; size--, at++)
        if (*at == (unsigned char)value) return (void *)(uintptr_t)at;
    return NULL;
}

size_t strlen(const char *text) {
    const char *end = text;
    while (*end) end++;
    return (size_t)(end - text);
}

int strcmp(const char *a, const char *b) {
    while (*a && *a == *b) a++, b++;
    return (unsigned char)*a - (unsigned char)*b;
}

/* ---- qsort: heap sort, so that no input is slow and no memory is needed ---- */

static void swap_items(unsigned char *a, unsigned char *b, size_t size) {
    for (; size; size--, a++, b++) {
        unsigned char kept = *a;
        *a = *b;
        *b = kept;
    }
}

static void sift_down(unsigned char *base, size_t root, size_t count, size_t size,
                      int (*compare)(const void *, const void *)) {
    for (size_t child; (child = 2 * root + 1) < count; root = child) {
        if (child + 1 < count && compare(base + child * size, base + (child + 1) * size) < 0) child++;
        if (compare(base + root * size, base + child * size) >= 0) return;
        swap_items(base + root * size, base + child * size, size);
    }
}

void qsort(void *base, size_t count, size_t size, int (*compare)(const void *, const void *)) {
    for (size_t root = count / 2; root-- > 0;) sift_down(base, root, count, size, compare);
    for (size_t last = count; last-- > 1;) {
        swap_items(base, (unsigned char *)base + last * size, size);
        sift_down(base, 0, last, size, compare);
    }
}

/* ---- printf ---- */

typedef struct printer { char *out; size_t room, length; } printer;

static void put(printer *p, char c) {
    if (p->length + 1 < p->room) p->out[p->length] = c;
    p->length++;
}

static void put_number(printer *p, uint64_t value, unsigned base) {
    char digits[20];
    int count = 0;
    do digits[count++] = "0123456789abcdef"[value % base];
    while (value /= base);
    while (count) put(p, digits[--count]);
}

int vsnprintf(char *out, size_t size, const char *format, va_list arguments) {
    printer p = {out, size, 0};
    for (; *format; format++) {
        if (*format != '%') {
            put(&p, *format);
            continue;
        }
        int wide = 0;
        while (*++format == 'l' || *format == 'z' || *format == 'h') wide += *format == 'l';
        if (*format == 's') {
            for (const char *text = va_arg(arguments, const char *); *text; text++) put(&p, *text);
        } else if (*format == 'c') {
            put(&p, (char)va_arg(arguments, int));
        } else if (*format == 'd' || *format == 'i') {
            int64_t value = wide > 1 ? va_arg(arguments, int64_t) : va_arg(arguments, int32_t);
            if (value < 0) put(&p, '-');
            put_number(&p, value < 0 ? 0 - (uint64_t)value : (uint64_t)value, 10);
        } else if (*format == 'u' || *format == 'x') {
            put_number(&p, wide > 1 ? va_arg(arguments, uint64_t) : va_arg(arguments, uint32_t), *format == 'u' ? 10 : 16);
        } else if (*format) {
            put(&p, *format);
        } else {
            break;
        }
    }
    if (size) out[p.length < size ? p.length : size - 1] = 0;
    return (int)p.length;
}

int snprintf(char *out, size_t size, const char *format, ...) {
    va_list arguments;
    va_start(arguments, format);
    int length = vsnprintf(out, size, format, arguments);
    va_end(arguments);
    return length;
}
