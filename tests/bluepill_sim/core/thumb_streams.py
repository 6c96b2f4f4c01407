"""Random Thumb-2 programs that no reading of the manual leaves open: what any Cortex-M3 runs alike.

A program is a number of cases. Each sets all registers and flags, runs a
stream of random instructions with branches, loops, IT blocks and accesses to a
scratch area, and pushes its registers and flags. What the SRAM holds in the
end is the result. Nothing UNPREDICTABLE is made, nothing that faults, and
nothing that only other cores have.

R7 is the middle of the scratch area and R11 counts loops; neither is written
by the stream. It runs at address 0, where both an STM32F103 and an LM3S6965
have their flash.

Source of the encodings: ARMv7-M Architecture Reference Manual, chapters A5 and A7.
"""

import random
import struct
from collections.abc import Callable
from dataclasses import dataclass

SRAM, SRAM_BYTES = 0x2000_0000, 0x5000
SCRATCH = SRAM + 0x200
#: 14 words a case must fit under the stack's start.
CASES = 250
#: Registers that a stream may write.
LOW, ANY = (0, 1, 2, 3, 4, 5, 6), (0, 1, 2, 3, 4, 5, 6, 8, 9, 10, 12)
#: Behind the vectors of the core.
_CODE = 0x40
_SEMIHOSTING = 0xBEAB
_OPEN, _WRITE, _EXIT, _STOPPED = 1, 5, 0x18, 0x20026

Halves = list[int]


def mov32(rd: int, value: int) -> Halves:
    """MOVW and MOVT."""
    made: Halves = []
    for opcode, part in ((0xF240, value & 0xFFFF), (0xF2C0, value >> 16)):
        made += [opcode | part >> 12 | (part >> 11 & 1) << 10, (part >> 8 & 7) << 12 | rd << 8 | part & 0xFF]
    return made


class Stream:
    """Makes random instructions."""

    def __init__(self, rng: random.Random) -> None:
        self.rng = rng
        #: What may stand anywhere, in an IT block too: each call makes one instruction.
        self.single: tuple[Callable[[], Halves], ...] = (
            self.shift, self.add_sub, self.immediate8, self.data16, self.data16, self.high, self.extend16,
            self.memory16, self.modified_immediate, self.modified_immediate, self.shifted_register,
            self.shifted_register, self.plain_immediate, self.bit_field, self.saturate, self.register_shift,
            self.extend32, self.reverse, self.multiply, self.multiply_long, self.divide, self.memory32,
            self.dual, self.adr, self.literal, self.flags,
        )  # fmt: skip
        #: What takes several instructions, outside IT blocks.
        self.several: tuple[Callable[[], Halves], ...] = (
            self.it_block, self.it_block, self.it_block, self.indexed, self.write_back, self.write_back, self.multiple,
            self.push_pop, self.exclusive, self.table_branch, self.skip, self.skip, self.skip_on_zero,
        )  # fmt: skip

    def low(self) -> int:
        return self.rng.choice(LOW)

    def any(self) -> int:
        return self.rng.choice(ANY)

    def read(self) -> int:
        """A register to read: any but SP, LR and PC."""
        return self.rng.randrange(13)

    def two(self) -> tuple[int, int]:
        """Two different registers to write."""
        first, second = self.rng.sample(ANY, 2)
        return first, second

    # 16 bits.

    def shift(self) -> Halves:
        opcode = self.rng.randrange(3)
        return [opcode << 11 | self.rng.randrange(opcode == 0, 32) << 6 | self.low() << 3 | self.low()]

    def add_sub(self) -> Halves:
        return [0x1800 | self.rng.randrange(4) << 9 | self.rng.randrange(8) << 6 | self.low() << 3 | self.low()]

    def immediate8(self) -> Halves:
        return [0x2000 | self.rng.randrange(4) << 11 | self.low() << 8 | self.rng.randrange(256)]

    def data16(self) -> Halves:
        return [0x4000 | self.rng.randrange(16) << 6 | self.low() << 3 | self.low()]

    def high(self) -> Halves:
        opcode = self.rng.choice((0x4400, 0x4500, 0x4600))
        rd, rm = self.any(), self.read()
        if opcode == 0x4500 and rd < 8 and rm < 8:
            rm = 8  # CMP of two low registers is another encoding
        return [opcode | (rd >> 3) << 7 | rm << 3 | rd & 7]

    def extend16(self) -> Halves:
        opcode = self.rng.choice((0xB200, 0xB240, 0xB280, 0xB2C0, 0xBA00, 0xBA40, 0xBAC0))
        return [opcode | self.low() << 3 | self.low()]

    def memory16(self) -> Halves:
        return [0x6000 | self.rng.randrange(6) << 11 | self.rng.randrange(32) << 6 | 7 << 3 | self.low()]

    # 32 bits.

    def operands(self) -> tuple[int, int, int]:
        """Opcode with S, Rn and Rd of a data-processing instruction."""
        opcode, sets_flags = self.rng.choice((0, 1, 2, 3, 4, 8, 10, 11, 13, 14)), self.rng.randrange(2)
        rn, rd = self.read(), self.any()
        if opcode in {0, 4, 8, 13} and self.rng.random() < 0.2:
            sets_flags, rd = 1, 15  # TST, TEQ, CMN, CMP
        elif opcode in {2, 3} and self.rng.random() < 0.3:
            rn = 15  # MOV, MVN
        return opcode << 5 | sets_flags << 4, rn, rd

    def modified_immediate(self) -> Halves:
        opcode, rn, rd = self.operands()
        high = self.rng.randrange(16)
        return [0xF000 | (high >> 3) << 10 | opcode | rn, (high & 7) << 12 | rd << 8 | self.rng.randrange(1, 256)]

    def shifted_register(self) -> Halves:
        opcode, rn, rd = self.operands()
        amount = self.rng.randrange(32)
        kind = self.rng.randrange(4) << 4
        return [0xEA00 | opcode | rn, (amount >> 2) << 12 | rd << 8 | (amount & 3) << 6 | kind | self.read()]

    def plain_immediate(self) -> Halves:
        opcode = self.rng.choice((0xF200, 0xF2A0, 0xF240, 0xF2C0))
        immediate = self.rng.randrange(1 << 12)
        rn = self.read() if opcode in {0xF200, 0xF2A0} else self.rng.randrange(16)
        return [opcode | (immediate >> 11) << 10 | rn, (immediate >> 8 & 7) << 12 | self.any() << 8 | immediate & 0xFF]

    def bit_field(self) -> Halves:
        opcode = self.rng.choice((0xF340, 0xF3C0, 0xF360, 0xF36F))
        low = self.rng.randrange(32)
        last = self.rng.randrange(32 - low) if opcode in {0xF340, 0xF3C0} else self.rng.randrange(low, 32)
        rn = 0 if opcode == 0xF36F else self.read()
        return [opcode | rn, (low >> 2) << 12 | self.any() << 8 | (low & 3) << 6 | last]

    def saturate(self) -> Halves:
        opcode, amount = self.rng.choice((0xF300, 0xF320, 0xF380, 0xF3A0)), self.rng.randrange(1, 32)
        return [
            opcode | self.read(),
            (amount >> 2) << 12 | self.any() << 8 | (amount & 3) << 6 | self.rng.randrange(32),
        ]

    def register_shift(self) -> Halves:
        return [0xFA00 | self.rng.randrange(8) << 4 | self.read(), 0xF000 | self.any() << 8 | self.read()]

    def extend32(self) -> Halves:
        opcode = self.rng.choice((0xFA0F, 0xFA1F, 0xFA4F, 0xFA5F))
        return [opcode, 0xF080 | self.any() << 8 | self.rng.randrange(4) << 4 | self.read()]

    def reverse(self) -> Halves:
        rm = self.read()
        opcode, kind = self.rng.choice(((0xFA90, 0x80), (0xFA90, 0x90), (0xFA90, 0xA0), (0xFA90, 0xB0), (0xFAB0, 0x80)))
        return [opcode | rm, 0xF000 | self.any() << 8 | kind | rm]

    def multiply(self) -> Halves:
        addend, kind = self.rng.choice(((15, 0), (self.read(), 0), (self.read(), 0x10)))
        return [0xFB00 | self.read(), addend << 12 | self.any() << 8 | kind | self.read()]

    def multiply_long(self) -> Halves:
        low, high = self.two()
        opcode = self.rng.choice((0xFB80, 0xFBA0, 0xFBC0, 0xFBE0))
        return [opcode | self.read(), low << 12 | high << 8 | self.read()]

    def divide(self) -> Halves:
        return [self.rng.choice((0xFB90, 0xFBB0)) | self.read(), 0xF0F0 | self.any() << 8 | self.read()]

    def memory32(self) -> Halves:
        """Loads and stores with an offset, aligned or not."""
        opcode = self.rng.choice((0xF8D0, 0xF890, 0xF8B0, 0xF990, 0xF9B0, 0xF8C0, 0xF880, 0xF8A0))
        return [opcode | 7, self.any() << 12 | self.rng.randrange(250)]

    def dual(self) -> Halves:
        first, second = self.two()
        opcode = self.rng.choice((0xE9D0, 0xE9C0, 0xE950, 0xE940))
        return [opcode | 7, first << 12 | second << 8 | self.rng.randrange(60)]

    def adr(self) -> Halves:
        return [self.rng.choice((0xA000, 0xA800)) | self.low() << 8 | self.rng.randrange(256)]

    def literal(self) -> Halves:
        return [0x4800 | self.low() << 8 | self.rng.randrange(64)]

    def flags(self) -> Halves:
        if self.rng.randrange(2):
            return [0xF380 | self.read(), 0x8800]  # MSR APSR_nzcvq
        return [0xF3EF, 0x8000 | self.any() << 8]  # MRS APSR

    # Several.

    def it_block(self) -> Halves:
        mask = self.rng.randrange(1, 16)
        count = 4 - (mask & -mask).bit_length() + 1
        made = [0xBF00 | self.rng.randrange(14) << 4 | mask]
        for _ in range(count):
            made += self.rng.choice(self.single)()
        return made

    def indexed(self) -> Halves:
        index, offset = self.low(), self.rng.randrange(0, 240)
        return [0x2000 | index << 8 | offset, 0x5000 | self.rng.randrange(8) << 9 | index << 6 | 7 << 3 | self.low()]

    def write_back(self) -> Halves:
        base, target = self.two()
        opcode = self.rng.choice((0xF850, 0xF810, 0xF830, 0xF910, 0xF930, 0xF840, 0xF800, 0xF820))
        pre_up_back = self.rng.choice((0x900, 0xB00, 0xD00, 0xF00, 0xC00))
        copy = 0x4600 | (base >> 3) << 7 | 7 << 3 | base & 7
        return [copy, opcode | base, target << 12 | 0x800 | pre_up_back | self.rng.randrange(240)]

    def multiple(self) -> Halves:
        base, *others = self.rng.sample(ANY, self.rng.randrange(3, 9))
        opcode = self.rng.choice((0xE890, 0xE880, 0xE910, 0xE900)) | self.rng.randrange(2) << 5
        copy = 0x4600 | (base >> 3) << 7 | 7 << 3 | base & 7
        return [copy, opcode | base, sum(1 << number for number in others)]

    def push_pop(self) -> Halves:
        pushed = self.rng.sample(LOW, self.rng.randrange(1, 6))
        popped = self.rng.sample(LOW, len(pushed))
        inside = [half for _ in range(2) for half in self.rng.choice(self.single)()]
        return [0xB400 | sum(1 << n for n in pushed), *inside, 0xBC00 | sum(1 << n for n in popped)]

    def exclusive(self) -> Halves:
        loaded, status = self.two()
        offset = self.rng.randrange(60)
        inside = [0xF3BF, 0x8F2F] if self.rng.random() < 0.3 else [0xBF00]  # CLREX or NOP
        return [0xE857, loaded << 12 | 0xF00 | offset, *inside, 0xE847, loaded << 12 | status << 8 | offset]

    def table_branch(self) -> Halves:
        index = self.low()
        cases = [self.rng.choice(self.single)() for _ in range(2)]
        # Two bytes of table, in halfwords from its start: the first case, the second.
        table = 1 | 1 + len(cases[0]) << 8
        return [0x2000 | index << 8 | self.rng.randrange(2), 0xE8DF, 0xF000 | index, table, *cases[0], *cases[1]]

    def skip(self) -> Halves:
        """A conditional branch over some instructions, narrow or wide."""
        inside = [half for _ in range(self.rng.randrange(1, 4)) for half in self.rng.choice(self.single)()]
        condition = self.rng.randrange(14)
        if self.rng.randrange(2):
            return [0xD000 | condition << 8 | len(inside) - 1, *inside]
        return [0xF000 | condition << 6, 0x8000 | len(inside), *inside]

    def skip_on_zero(self) -> Halves:
        inside = [half for _ in range(self.rng.randrange(1, 4)) for half in self.rng.choice(self.single)()]
        return [self.rng.choice((0xB100, 0xB900)) | len(inside) - 1 << 3 | self.low(), *inside]

    def loop(self) -> Halves:
        body = [half for _ in range(self.rng.randrange(1, 4)) for half in self.rng.choice(self.single)()]
        count = [0xF04F, 0x0B00 | self.rng.randrange(1, 5)]  # MOV.W R11
        again = [0xF1BB, 0x0B01, 0xD100 | (-(len(body) + 4) & 0xFF)]  # SUBS.W R11, #1; BNE
        return [*count, *body, *again]

    def case(self, length: int) -> Halves:
        """Return one case: set up, run, push registers and flags."""
        interesting = (0, 1, 2, 0x7FFF_FFFF, 0x8000_0000, 0xFFFF_FFFF, 0x8000, 0xFFFF, 31, 32, 33, 255)
        made = [*mov32(0, self.rng.randrange(32) << 27), 0xF380, 0x8800]
        for number in range(13):
            value = self.rng.choice(interesting) if self.rng.random() < 0.4 else self.rng.getrandbits(32)
            made += mov32(number, SCRATCH + 0x100 if number == 7 else value)
        for _ in range(length):
            kinds = self.single if self.rng.random() < 0.7 else self.several
            made += self.loop() if self.rng.random() < 0.04 else self.rng.choice(kinds)()
        return [*made, 0xE92D, 0x1FFF, 0xF3EF, 0x8000, 0xB401]  # PUSH {R0-R12}; MRS R0, APSR; PUSH {R0}


@dataclass(frozen=True, slots=True)
class Program:
    """An image for address 0 and where its cases are done."""

    image: bytes
    end: int


#: Counts in SRAM, and returns.
_HANDLER = [*mov32(0, SRAM + 0x100), 0x6801, 0x3101, 0x6001, 0x4770]


def program(seed: int, cases: int = CASES, length: int = 16, tick: int | None = None) -> Program:
    """Return a program; after `end` it writes its SRAM to standard output by semihosting.

    Args:
        seed: of all that is random.
        cases: how many.
        length: instructions of a case, about.
        tick: reload value of a SysTick that interrupts; None for none.
    """
    stream = Stream(random.Random(seed))
    code = list(_HANDLER)
    if tick is not None:
        code += [*mov32(1, 0xE000_E010), *mov32(2, tick), 0x604A, 0x608A, 0x2207, 0x600A]
    code += [half for _ in range(cases) for half in stream.case(length)]
    end = _CODE + 2 * len(code)
    # What SYS_OPEN(":tt", "w"), SYS_WRITE(handle, SRAM, all of it) and SYS_EXIT take lies above what is written out.
    block, name = SRAM + SRAM_BYTES, SRAM + SRAM_BYTES + 16
    code += [*mov32(1, block), *mov32(2, name), *mov32(3, int.from_bytes(b":tt", "little"))]
    code += [0x6013, 0x600A, 0x2304, 0x604B, 0x2303, 0x608B, 0x2000 | _OPEN, _SEMIHOSTING]
    code += [0x6008, *mov32(2, SRAM), 0x604A, *mov32(2, SRAM_BYTES), 0x608A, 0x2000 | _WRITE, _SEMIHOSTING]
    code += [*mov32(1, _STOPPED), 0x2000 | _EXIT, _SEMIHOSTING, 0xE7FE]
    code += [0xBF00] * 200  # as far as literals reach
    start = _CODE + 2 * len(_HANDLER)
    vectors = struct.pack("<16I", SRAM + SRAM_BYTES, start | 1, *([end | 1] * 13), _CODE | 1)
    return Program(vectors + struct.pack(f"<{len(code)}H", *code), end)
