"""What a read-change-write of a register means, in code as compilers make it; nothing else is taken for one."""

import random

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


# Blocks of random code before the store, held against what Unicorn makes of them.

#: Registers that random code may write: neither the register's address, nor what is read, nor a pointer to SRAM.
FREE_LOW, FREE = (1, 2, 4, 5, 6), (1, 2, 4, 5, 6, 8, 9, 10, 11, 12)
SRAM, CODE = 0x2000_1000, 0x0800_0000


class Few(random.Random):
    """A generator with few of the registers, so that instructions go on with what the ones before have made."""

    def __init__(self, seed: int) -> None:
        super().__init__(seed)
        self.low = self.sample(FREE_LOW, 2)
        self.all = [*self.low, self.choice(FREE)]


def narrow(rng: Few) -> list[int]:
    """Return a 16-bit instruction whose meaning is known: shifts, sums, constants, pairs, copies and loads."""
    d, n, m, most = rng.choice(rng.low), rng.choice(rng.low), rng.choice(rng.low), rng.choice((1, 7, 31))
    five, byte = rng.randint(0, most), rng.choice((0, 1, 5, 255, rng.randrange(256)))
    high = rng.choice(rng.all)
    return [rng.choice((
        five << 6 | n << 3 | d, 0x0800 | five << 6 | n << 3 | d,
        rng.choice((0x1800, 0x1A00)) | m << 6 | n << 3 | d, rng.choice((0x1C00, 0x1E00)) | (five & 7) << 6 | n << 3 | d,
        rng.choice((0x2000, 0x3000, 0x3800)) | d << 8 | byte,
        0x4000 | rng.choice((0, 2, 3, 12, 14, 15)) << 6 | n << 3 | d,
        0x4280 | n << 3 | d, 0x2800 | d << 8 | byte,  # comparisons write nothing
        0x4600 | (high & 8) << 4 | rng.choice(rng.all) << 3 | high & 7,
        0x6800 | five << 6 | 7 << 3 | d, 0x9800 | d << 8 | five,
    ))]  # fmt: skip


def wide(rng: Few) -> list[int]:
    """Return a 32-bit instruction whose meaning is known."""
    d, n, m = (rng.choice(rng.all) for _ in range(3))
    constant = rng.randrange(2) << 26 | rng.randrange(8) << 12 | rng.randrange(1, 256)
    operation = rng.choice((0, 1, 2, 3, 8, 13)) << 21
    by = rng.randrange(8) << 12 | rng.randrange(4) << 6
    base = 15 if operation == 3 << 21 else rng.choice((n, 15)) if operation == 2 << 21 else n
    word = rng.choice((
        0xEA00_0000 | operation | base << 16 | d << 8 | m, 0xF000_0000 | operation | base << 16 | d << 8 | constant,
        0xEA4F_0000 | d << 8 | by | rng.randrange(2) << 4 | m, 0xF240_0000 | n << 16 | d << 8 | constant,
        0xFA00_F000 | rng.randrange(2) << 21 | n << 16 | d << 8 | m, 0xF8D7_0000 | d << 12 | 4 * rng.randrange(31),
    ))  # fmt: skip
    return [word >> 16, word & 0xFFFF]


def changing(rng: Few) -> list[int]:
    """Return what changes the value read, in R3: by a register, a constant, or bits put into it."""
    m, operation = rng.choice(rng.all), rng.choice((0, 1, 2)) << 21
    constant = rng.randrange(2) << 26 | rng.randrange(8) << 12 | rng.randrange(1, 256)
    low = rng.randrange(32)
    insert = (low >> 2) << 12 | (low & 3) << 6 | rng.randrange(low, 32)
    word = rng.choice((
        0xEA03_0300 | operation | m, 0xEA00_0303 | operation & ~(1 << 21) | m << 16, 0xF003_0300 | operation | constant,
        0xF360_0300 | rng.choice((*rng.all, 15)) << 16 | insert,
    ))  # fmt: skip
    return rng.choice(([0x4003 | rng.choice((0, 12, 14)) << 6 | rng.choice(rng.low) << 3], [word >> 16, word & 0xFFFF]))


def before_the_store(program: bytes, registers: list[int], held: int, memory: bytes) -> list[int]:
    """Return the registers that Unicorn comes to the last instruction with, where it has read `held`."""
    from unicorn import UC_ARCH_ARM, UC_MODE_MCLASS, UC_MODE_THUMB, Uc
    from unicorn.arm_const import UC_ARM_REG_R0, UC_ARM_REG_SP

    core = Uc(UC_ARCH_ARM, UC_MODE_THUMB | UC_MODE_MCLASS)
    for page, data in ((CODE, program), (SRAM, memory), (CRL & ~0xFFF, b"")):
        core.mem_map(page, 0x1000)
        core.mem_write(page, data)
    core.mem_write(CRL, held.to_bytes(4, "little"))
    for number, value in enumerate(registers[:13]):
        core.reg_write(UC_ARM_REG_R0 + number, value)
    core.reg_write(UC_ARM_REG_SP, registers[13])
    core.emu_start(CODE | 1, CODE + len(program))
    return [*(core.reg_read(UC_ARM_REG_R0 + number) for number in range(13)), registers[13], 0]


@pytest.mark.parametrize("seed", range(300))
def test_what_is_forced_does_not_depend_on_what_was_there_and_the_rest_does(seed: int) -> None:
    rng = Few(seed)
    # Constants first: what comes of them can be worked out, though their registers are gone when it is stored.
    halves = [half for one in rng.all for half in (0xF240 | rng.randrange(2) << 10 | rng.randrange(16),
                                                   rng.randrange(8) << 12 | one << 8 | rng.randrange(256))]  # fmt: skip
    halves += [half for _ in range(rng.randint(0, 4)) for half in rng.choice((narrow, wide))(rng)]
    halves += rng.choice(([0x6803], [0xF8D0, 0x3000]))  # ldr r3, [r0]
    for _ in range(rng.randint(1, 2)):
        halves += changing(rng)
        halves += [half for _ in range(rng.randint(0, 3)) for half in rng.choice((narrow, wide))(rng)]
    halves += rng.choice(([0x6003], [0xF8C0, 0x3000]))  # str r3, [r0]
    program = b"".join(half.to_bytes(2, "little") for half in halves)
    memory = rng.randbytes(0x1000)
    registers = [CRL, *(rng.getrandbits(rng.choice((5, 32))) for _ in range(6)), SRAM + 0x80]
    registers += [*(rng.getrandbits(32) for _ in range(5)), SRAM + 0x40, 0]

    def loaded(address: int, size: int) -> bytes:
        return memory[address - SRAM : address - SRAM + size]

    ones, zeros = (before_the_store(program, registers, held, memory) for held in (0xFFFF_FFFF, 0))
    bits, seen = forced_bits(program, ones.__getitem__, CRL, loaded)
    assert bits == ~(ones[3] ^ zeros[3]) & 0xFFFF_FFFF, program.hex()
    # It hangs on what is named, and on nothing else.
    others = [value if number in seen else value ^ 0x5A5A_5A5A for number, value in enumerate(ones)]

    def named(address: int, size: int) -> bytes:
        return seen[address].to_bytes(4, "little") if address in seen else bytes(size)

    assert all(seen[number] == ones[number] for number in seen if number < 16)
    assert forced_bits(program, others.__getitem__, CRL, named) == (bits, seen)


#: Instructions that write register d, at a place of their code, something that is not worked out; from R4.
UNKNOWN = {
    "asrs": ("1060", 0), "ldr literal": ("4801", 8), "ldrb": ("7820", 0), "ldrh": ("8820", 0), "adcs": ("4160", 0),
    "muls": ("4360", 0), "movt": ("F2C00005", 8), "ubfx": ("F3C40041", 8), "clz": ("FAB4F084", 8),
    "mul": ("FB04F005", 8), "ldrb.w": ("F8940000", 12), "ldrh.w": ("F8B40000", 12),
    "ror": ("EA4F0074", 8), "rsb": ("F1C40001", 8), "orn": ("F0640001", 8), "ldrb indexed": ("F8140001", 12),
}  # fmt: skip


@pytest.mark.parametrize("name", UNKNOWN)
def test_what_an_instruction_makes_that_is_not_understood_is_unknown_and_what_it_leaves_is_not(name: str) -> None:
    text, place = UNKNOWN[name]
    for target, bits in ((1, 0), (2, 0x41), (5, 0x41)):
        word = f"{int(text, 16) | target << place:0{len(text)}X}"
        # movs r1, #0x41; …; ldr r3, [r0]; orrs r3, r1; movs r1, #0; str r3, [r0]
        found = forced_bits(code(f"2141 {word[:4]} {word[4:]} 6803 430B 2100 6003"), REGISTERS.__getitem__, CRL, read)
        assert found[0] == bits, target


@pytest.mark.parametrize("text", ["4281", "2C01", "7021", "8021", "9401", "6021", "F1B40F01", "F8C41000", "EA940F05"])
def test_what_only_compares_or_stores_leaves_every_register(text: str) -> None:
    found = forced_bits(code(f"2141 {text[:4]} {text[4:]} 6803 430B 2100 6003"), REGISTERS.__getitem__, CRL, read)
    assert found[0] == 0x41


def test_a_store_through_the_stack_pointer_means_what_any_other_does() -> None:
    for register in range(1, 8):
        registers = [*[0] * 13, CRL - 12, 0]
        # ldr rn, [sp, #12]; orr.w rn, rn, #6; str rn, [sp, #12]
        text = (
            f"{0x9803 | register << 8:04X} {0xF040 | register:04X} {register << 8 | 6:04X} {0x9003 | register << 8:04X}"
        )
        assert forced_bits(code(text), registers.__getitem__, CRL, read) == (6, {13: CRL - 12})


def test_what_a_word_of_sram_holds_is_named_from_its_first_one_on_and_of_flash_not() -> None:
    registers = [CRL, *[0] * 6, 0x2000_0000, *[0] * 7]
    # ldr r1, [r7]; ldr r3, [r0]; orrs r3, r1; movs r1, #0; str r3, [r0]
    for base, seen in ((0x2000_0000, {7: 0x2000_0000, 0x2000_0000: 9}), (0x1FFF_FFFC, {7: 0x1FFF_FFFC})):
        registers[7] = base
        found = forced_bits(
            code("6839 6803 430B 2100 6003"), registers.__getitem__, CRL, lambda *_: (9).to_bytes(4, "little")
        )
        assert found == (9, {0: CRL, **seen})
