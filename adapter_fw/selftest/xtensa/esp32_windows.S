/* As esp32.S, with register windows: their handlers at VECBASE, and a start that switches them on.
 * The handlers are those that the Xtensa instruction set's summary prescribes for windows of 4, 8 and 12 registers. The
 * one for MOVSP, which raises an exception where the caller's window has been spilled, is missing: LLVM uses MOVSP before
 * calls with arguments on the stack. So this links, and does not run. */
    .section .vector, "ax"
    .global _vectors
_vectors:
    s32e a0, a5, -16
    s32e a1, a5, -12
    s32e a2, a5, -8
    s32e a3, a5, -4
    rfwo
    .org 0x40
    l32e a0, a5, -16
    l32e a1, a5, -12
    l32e a2, a5, -8
    l32e a3, a5, -4
    rfwu
    .org 0x80
    s32e a0, a9, -16
    l32e a0, a1, -12
    s32e a1, a9, -12
    s32e a2, a9, -8
    s32e a3, a9, -4
    s32e a4, a0, -32
    s32e a5, a0, -28
    s32e a6, a0, -24
    s32e a7, a0, -20
    rfwo
    .org 0xC0
    l32e a0, a9, -16
    l32e a1, a9, -12
    l32e a2, a9, -8
    l32e a7, a1, -12
    l32e a3, a9, -4
    l32e a4, a7, -32
    l32e a5, a7, -28
    l32e a6, a7, -24
    l32e a7, a7, -20
    rfwu
    .org 0x100
    s32e a0, a13, -16
    l32e a0, a1, -12
    s32e a1, a13, -12
    s32e a2, a13, -8
    s32e a3, a13, -4
    s32e a4, a0, -48
    s32e a5, a0, -44
    s32e a6, a0, -40
    s32e a7, a0, -36
    s32e a8, a0, -32
    s32e a9, a0, -28
    s32e a10, a0, -24
    s32e a11, a0, -20
    rfwo
    .org 0x140
    l32e a0, a13, -16
    l32e a1, a13, -12
    l32e a2, a13, -8
    l32e a11, a1, -12
    l32e a3, a13, -4
    l32e a4, a11, -48
    l32e a5, a11, -44
    l32e a6, a11, -40
    l32e a7, a11, -36
    l32e a8, a11, -32
    l32e a9, a11, -28
    l32e a10, a11, -24
    l32e a11, a11, -20
    rfwu
    .org 0x180

    .section .literal, "ax"
    .p2align 2
.Lvectors: .4byte _vectors
.Lstack: .4byte _stack_top
.Lmain: .4byte main
.Luart: .4byte 0x3FF40000
/* PS: window overflow on, calls by 8, no exceptions under way. */
.Lps: .4byte 0x00060020

    .section .text.start, "ax"
    .p2align 2
    .global _start
_start:
    l32r a2, .Lvectors
    wsr a2, vecbase
    movi a2, 0
    wsr a2, windowbase
    rsync
    movi a2, 1
    wsr a2, windowstart
    rsync
    movi a0, 0
    l32r a3, .Lstack
    addi a1, a3, -64
    addi a2, a1, -12
    s32i a3, a2, 0
    l32r a2, .Lps
    wsr a2, ps
    rsync
    l32r a8, .Lmain
    callx8 a8
0:  j 0b

    .p2align 2
    .global write_text
write_text:
    entry a1, 32
    l32r a4, .Luart
    beqz a3, 1f
0:  l8ui a5, a2, 0
    s32i a5, a4, 0
    addi a2, a2, 1
    addi a3, a3, -1
    bnez a3, 0b
1:  retw
