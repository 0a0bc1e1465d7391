/* The packed network and the samples, as they lie in flash. */
    .section .rodata.image, "a"
    .balign 64
    .global network_begin, network_end, samples_begin, samples_end
network_begin:
    .incbin "network.bin"
network_end:
    .balign 8
samples_begin:
    .incbin "samples.bin"
samples_end:
