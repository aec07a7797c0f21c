/* A file as bytes of the program: const unsigned char NAME[]; const size_t NAME_size. -DNAME=... -DFILE="..." */
#define GLUED(name, suffix) name##suffix
#define GLUE(name, suffix) GLUED(name, suffix)
#define END GLUE(NAME, _end)
#define SIZE GLUE(NAME, _size)
    .section .rodata
    .global NAME
    .global SIZE
NAME:
    .incbin FILE
END:
    .byte 0
    .balign 8
SIZE:
#if __SIZEOF_POINTER__ == 8
    .quad END - NAME
#else
    .long END - NAME
#endif
    .section .note.GNU-stack, "", %progbits
