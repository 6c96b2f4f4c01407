/* Start on an ESP32 without a boot loader, and text into the FIFO of UART0. */
    .section .text.start, "ax"
    .literal_position
    .align 4
    .global _start
_start:
    movi a1, _stack_top
    call0 main
0:  j 0b

    .align 4
    .global write_text
write_text:
    movi a4, 0x3FF40000
    beqz a3, 1f
0:  l8ui a5, a2, 0
    s32i a5, a4, 0
    addi a2, a2, 1
    addi a3, a3, -1
    bnez a3, 0b
1:  ret
