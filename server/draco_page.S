/* The page of the Draco deltas as bytes of the program: const unsigned char lathe_draco_html[]; const size_t lathe_draco_html_size. */
    .section .rodata
    .global lathe_draco_html
    .global lathe_draco_html_size
lathe_draco_html:
    .incbin PAGE
lathe_draco_html_end:
    .byte 0
    .balign 8
lathe_draco_html_size:
#if __SIZEOF_POINTER__ == 8
    .quad lathe_draco_html_end - lathe_draco_html
#else
    .long lathe_draco_html_end - lathe_draco_html
#endif
    .section .note.GNU-stack, "", %progbits
