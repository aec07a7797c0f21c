/* The script that the viewer loads when asked for more as bytes of the program: const unsigned char lathe_extras_js[]; const size_t lathe_extras_js_size. */
    .section .rodata
    .global lathe_extras_js
    .global lathe_extras_js_size
lathe_extras_js:
    .incbin PAGE
lathe_extras_js_end:
    .byte 0
    .balign 8
lathe_extras_js_size:
#if __SIZEOF_POINTER__ == 8
    .quad lathe_extras_js_end - lathe_extras_js
#else
    .long lathe_extras_js_end - lathe_extras_js
#endif
    .section .note.GNU-stack, "", %progbits
