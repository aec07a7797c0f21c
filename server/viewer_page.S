/* The viewer page as bytes of the program: const unsigned char lathe_viewer_html[]; const size_t lathe_viewer_html_size. */
    .section .rodata
    .global lathe_viewer_html
    .global lathe_viewer_html_size
lathe_viewer_html:
    .incbin PAGE
lathe_viewer_html_end:
    .byte 0
    .balign 8
lathe_viewer_html_size:
#if __SIZEOF_POINTER__ == 8
    .quad lathe_viewer_html_end - lathe_viewer_html
#else
    .long lathe_viewer_html_end - lathe_viewer_html
#endif
    .section .note.GNU-stack, "", %progbits
