"""What a read-change-write of a register means, in code as compilers make it; nothing else is taken for one."""

import pytest

from bluepill_sim.core.forced_bits import forced_bits

CRL = 0x4001_0800
#: At the store: R0 points to the register, R1 is a pin's place, R2 its mode, R12 its mask; R7 is where -O0 keeps them.
REGISTERS = [CRL, 20, 4 << 20, CRL, CRL, 15, 0, 0x2000_1000, 0, 0, 0, 0, 0xF << 20, 0, 0]
STACK = {0x2000_1000 + 12: CRL, 0x2000_1000 + 8: 5, 0x2000_1000 + 4: 20}

PROGRAMS = [
    # ldr r3, [r0]; bic r3, r3, #0xF000000; orr r3, r3, #0x4000000; str r3, [r0]
    ("6803 F023 6370 F043 6380 6003", 0x0F00_0000),
    # ldr r2, [r3]; bic r2, r2, #0xF0000; str r2, [r3]
    ("681A F422 2270 601A", 0x000F_0000),
    # ldr r3, [r0]; orr r3, r3, #0x40; str r3, [r0]: the lower bit of a pin's CNF
    ("6803 F043 0340 6003", 0x0000_0040),
    # movs r5, #15; lsl r12, r5, r1; ldr r3, [r0]; bic r3, r3, r12; orrs r3, r2; str r3, [r0]
    ("250F FA05 FC01 6803 EA23 030C 4313 6003", 0x00F0_0000),
    # -O0: ldr r3, [r7, #12]; ldr r2, [r3]; ldr r3, [r7, #8]; lsls r3, #2; movs r1, #15; lsl r3, r1, r3; mvns r3, r3;
    # ands r2, r3; ldr r3, [r7, #8]; lsls r3, #2; ldr r1, [r7, #4]; lsl r3, r1, r3; orrs r2, r3; ldr r3, [r7, #12];
    # str r2, [r3]; the mode is 20 = 0b10100, a bit too many
    ("68FB 681A 68BB 009B 210F FA01 F303 43DB 401A 68BB 009B 6879 FA01 F303 431A 68FB 601A", 0x01F0_0000),
    # ldr r3, [r0]; ands r3, r1; str r3, [r0]: keeps 20 = 0b10100
    ("6803 400B 6003", 0xFFFF_FFEB),
    # ldr r3, [r0]; movs r5, #4; bfi r3, r5, #8, #4; str r3, [r0]
    ("6803 2504 F365 230B 6003", 0x0000_0F00),
    # ldr.w r3, [r0]; mov r5, r3; bics r5, r1; str.w r5, [r0]
    ("F8D0 3000 461D 438D F8C0 5000", 20),
    # ldr r3, [r0]; and r5, r3, r1, written back: either operand may be the one read
    ("6803 EA01 0503 6005", 0xFFFF_FFEB),
]
#: Nothing is known to be meant.
OTHERS = [
    "",  # no code
    "4770",  # no store
    "F04F 3244 6002",  # mov r2, #0x44444444; str r2, [r0]: never read
    "6843 F023 6370 6003",  # read from the next register
    "6803 F023 6370 6043",  # written to the next one
    "6803 6003",  # unchanged
    "6803 F023 6370 BF08 4613 6003",  # an IT block
    "6803 3301 6003",  # a sum
    "6803 F023 6370 4798 6003",  # a call between
    "6803 EA23 0329 6003",  # bic r3, r3, r9, asr: a shift that is not understood
    "6803 680C 43A3 2400 6003",  # a mask from nowhere, and gone
]


def code(text: str) -> bytes:
    return b"".join(int(word, 16).to_bytes(2, "little") for word in text.split())


def read(address: int, size: int) -> bytes | None:
    value = STACK.get(address)
    return None if value is None else value.to_bytes(size, "little")


@pytest.mark.parametrize(("text", "bits"), PROGRAMS)
def test_the_bits_that_a_store_means_are_found(text: str, bits: int) -> None:
    assert forced_bits(code(text), REGISTERS.__getitem__, CRL, read)[0] == bits


@pytest.mark.parametrize("text", OTHERS)
def test_what_is_not_understood_means_nothing(text: str) -> None:
    assert forced_bits(code(text), REGISTERS.__getitem__, CRL, read)[0] == 0
