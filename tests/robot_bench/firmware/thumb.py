"""Firmware of a few instructions, put together by hand: vector table and Thumb code."""

import struct

FLASH = 0x0800_0000
TOP_OF_STACK = 0x2000_5000


def image(code: bytes, *, stack: int = TOP_OF_STACK) -> bytes:
    """A BIN for the start of flash: every exception but reset ends in an endless loop."""
    first = FLASH + 16 * 4
    vectors = [stack, (first + 2) | 1, *([first | 1] * 14)]
    return struct.pack("<16I", *vectors) + bytes.fromhex("fee7") + code


#: b .
SPIN = image(bytes.fromhex("fee7"))
#: nop; ldr r0, [pc, #0]; bx r0; .word 0x60000001
NOWHERE = image(bytes.fromhex("00bf00480047") + struct.pack("<I", 0x6000_0001))
#: ldr r0, =0xE000ED14 (CCR); movs r1, #0x10 (DIV_0_TRP); str r1, [r0]; movs r2, #0; sdiv r1, r1, r2; b .
DIVIDE = image(bytes.fromhex("034810210160002291fbf2f1fee7") + struct.pack("<I", 0xE000_ED14))
#: push {r0-r7}; b .-2, with a stack of 64 bytes
OVERFLOW = image(bytes.fromhex("ffb4fde7"), stack=0x2000_0040)
#: wfi; b .-2
SLEEP = image(bytes.fromhex("30bffde7"))
