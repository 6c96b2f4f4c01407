"""What is known of a block before it runs, of every encoding and of blocks at random, against what was approved.

That is what it costs and when each instruction begins (`measure.c`), which memory each reaches for, which registers
each may write, and which bits of a register a program means that reads, changes and writes it.
"""

import random
import struct
from collections.abc import Callable, Iterator

from bluepill_sim.core.accesses import accesses_of, is_ambiguous, may_end_in_it, may_write
from bluepill_sim.core.block_cost import measure_block
from bluepill_sim.core.forced_bits import forced_bits
from bluepill_sim.core.thumb import decode_all
from tests.bluepill_sim.core.interpreter.lockstep import ROWS, filled
from tests.tools.suite.approved import judge_of

FLASH, SRAM, REGISTER = 0x0800_0400, 0x2000_0400, 0x4001_0800
BLOCKS, STORES = 250, 1500
#: Wait states, and whether the flash fetches ahead.
_FLASHES = ((0, False), (1, False), (2, False), (1, True), (2, True))
_WORD = 0xFFFF_FFFF


def _code(*words: int) -> bytes:
    return b"".join(
        struct.pack("<HH", word >> 16, word & 0xFFFF) if word >> 16 else struct.pack("<H", word) for word in words
    )


def _shown(code: bytes, start: int) -> str:
    """Return all that is known of a block."""
    costs = []
    for wait_states, has_prefetch in _FLASHES:
        block = measure_block(code, start, wait_states, has_prefetch=has_prefetch)
        costs.append(f"{block.straight}/{block.taken}/{[*block.offsets.values()]}")
    kinds = (
        block.divides, block.late_divides, block.aligned, sorted(block.given_up), block.it_states, block.last.name,
        block.changes_masks, block.sends_event, block.has_exclusive, block.has_it, block.is_self_loop,
    )  # fmt: skip
    middle = start + len(code) // 2
    asked = (
        block.cycles_until(middle),
        block.it_state_at(middle),
        block.it_state_at(middle, 0x0D),
        block.rest(start).taken,
    )
    reached = [
        f"{one.address:x} {one.is_load:d} {one.bytes} {one.base} {one.offset} {one.index} {one.shift} {one.count}"
        for one in accesses_of(code, start)
    ]
    parts = [repr(each)[12:-1] for each in decode_all(code, start)]
    written = [f"{may_write(code, at):x}" for at in range(0, len(code) - 1, 2)]
    ends = f"{may_end_in_it(code):d}{is_ambiguous(code, start):d}"
    return f"{code.hex()} {costs} {kinds} {parts} {asked} {reached} {written} {ends}"


def _encodings(_: random.Random) -> Iterator[str]:
    """Yield each row of the table, filled in some ways, behind a load and in front of a load."""
    dice = random.Random("encodings")
    for row in ROWS:
        lines = [row.operation]
        for load, following in ((0x6811, 0x684B), (0xF8D2_1004, 0xF851_0022), (0x4901, 0x5888)):
            word = filled(row, dice)
            lines += [
                _shown(_code(load, word), FLASH),
                _shown(_code(word, following), FLASH + 6),
                _shown(_code(word), SRAM),
            ]
        yield "\n".join(lines)


def _branches(_: random.Random) -> Iterator[str]:
    """Yield branches to all places near by, and to some far away."""
    for halfwords in (*range(-8, 9), -128, 127, -1024, 1023):
        lines = []
        for start in (FLASH, FLASH + 2, FLASH + 4):
            lines.append(_shown(_code(0xBF00, 0xE000 | halfwords & 0x7FF), start))
            lines.append(_shown(_code(0xBF08, 0xE000 | halfwords & 0x7FF), start))
            lines.append(_shown(_code(0xD000 | halfwords & 0xFF), start))
            lines.append(_shown(_code(0xB100 | (halfwords & 0x1F) << 3 | (halfwords & 0x20) << 4), start))
            sign, low = halfwords < 0, halfwords & 0x7FF
            for j1, j2 in ((0, 0), (1, 1), (1, 0), (0, 1)):
                joined = sign << 26 | (low >> 3 & 0x3FF) << 16 | j1 << 13 | j2 << 11 | low
                lines += [_shown(_code(opcode | joined), start) for opcode in (0xF000_9000, 0xF000_D000)]
                joined = sign << 26 | (low & 0x3F) << 16 | j1 << 13 | j2 << 11 | low
                lines.append(_shown(_code(0xF000_8000 | joined), start))
        yield "\n".join(lines)


def _blocks(_: random.Random) -> Iterator[str]:
    dice = random.Random("blocks")
    for _number in range(BLOCKS):
        rows = [dice.choice(ROWS) for _ in range(dice.randrange(1, 8))]
        yield _shown(_code(*(filled(row, dice) for row in rows)), dice.choice((FLASH, FLASH + 2, FLASH + 4, FLASH + 6)))


def _its(_: random.Random) -> Iterator[str]:
    """Yield whether code may end inside each IT block: some instructions behind it, short, long or half of one."""
    dice = random.Random("IT")
    for mask in range(16):
        found = []
        for count in range(6):
            for _number in range(8):
                behind = [dice.choice((0x1C49, 0xE7FE, 0x18E8, 0xF8D1_2004, 0xEA41_01E8)) for _ in range(count)]
                code = _code(0xBF00 | dice.randrange(14) << 4 | mask, *behind)
                found += [may_end_in_it(code), may_end_in_it(code[:-2]), may_end_in_it(_code(0xBF00) + code)]
        yield f"{mask:x} {''.join(f'{one:d}' for one in found)}"


def _instruction(dice: random.Random) -> int:  # noqa: C901, PLR0911 - one return a kind
    """Return an instruction on a few registers, such as programs change registers with."""
    target, first, second = (dice.choice((1, 2, 2, 3)) for _ in range(3))
    low3, imm5, imm8 = (
        dice.randrange(8),
        dice.randrange(32),
        dice.choice((0, 1, 3, 0x0F, 0xF0, 0xFF, dice.randrange(256))),
    )
    wide = dice.choice((0x000, 0x020, 0x040, 0x060, 0x080, 0x100, 0x140, 0x1A0, 0x1C0))
    base = dice.choice((first, first, first, 15))
    d8, shift = dice.choice((target, target, target, target, 15)) << 8, dice.choice((0, 0, 1, 4, 31))
    shifted = (shift >> 2) << 12 | (shift & 3) << 6 | dice.randrange(4) << 4
    match dice.randrange(17):
        case 0:
            return dice.choice((0x0000, 0x0800, 0x1000)) | dice.choice((0, 0, imm5)) << 6 | first << 3 | target
        case 1:
            return 0x1800 | dice.randrange(4) << 9 | dice.choice((second, low3)) << 6 | first << 3 | target
        case 2:
            return dice.choice((0x2000, 0x2000, 0x2800, 0x3000, 0x3800)) | target << 8 | imm8
        case 3 | 4 | 5:
            return 0x4000 | dice.choice((0, 1, 2, 3, 4, 8, 10, 11, 12, 12, 14, 14, 15)) << 6 | first << 3 | target
        case 6:
            moved = 0x4600 | first << 3 | target | dice.choice((0, 0, 0x80, 0x40))
            return dice.choice((moved, moved, moved, 0xE7FF))  # the last that is narrow
        case 7:
            return dice.choice((0x4800, 0x9800, 0x9000)) | target << 8 | dice.randrange(4)
        case 8:
            return (
                dice.choice((0x6000, 0x6800, 0x7000, 0x7800, 0x8000, 0x8800)) | dice.randrange(3) << 6 | 5 << 3 | target
            )
        case 9 | 10 | 11:
            code = dice.randrange(16)
            return 0xF000_0000 | (code >> 3) << 26 | wide << 16 | base << 16 | (code & 7) << 12 | d8 | imm8
        case 12:
            return 0xEA00_0000 | wide << 16 | dice.randrange(2) << 20 | base << 16 | shifted | d8 | second
        case 13:
            return dice.choice((0xF240_0000, 0xF2C0_0000)) | dice.randrange(16) << 16 | low3 << 12 | target << 8 | imm8
        case 14:
            low = dice.choice((0, 4, 8, imm5))
            top = dice.randrange(low, 32)
            kind = dice.choice((0xF36F_0000, 0xF360_0000 | first << 16, 0xF3C0_0000 | first << 16))
            return kind | (low >> 2) << 12 | target << 8 | (low & 3) << 6 | top
        case 15:
            shift_by = dice.choice((0xFA00_F000, 0xFA20_F000, 0xFA40_F000, 0xFAB0_F080, 0xFB00_F000))
            return shift_by | first << 16 | target << 8 | second
    return dice.choice((0xF8D5_0000, 0xF8C5_0000, 0xF895_0000, 0xF815_0000)) | target << 12 | 4 * dice.randrange(3)


def _change(dice: random.Random) -> list[int]:
    """Return some instructions that change R2, as programs do, by a constant or by what R3 gets first."""
    imm8, code, imm5 = dice.choice((1, 3, 0x0F, 0x44, 0xF0, 0xFF)), dice.randrange(16), dice.randrange(32)
    operation = dice.choice((0x000, 0x020, 0x040))  # AND, BIC, ORR
    constant = 0xF002_0200 | operation << 16 | (code >> 3) << 26 | (code & 7) << 12 | imm8
    made: list[int] = dice.choice(
        (
            [0x2300 | imm8], [0x2300 | imm8, imm5 << 6 | 0x1B], [0x2300 | imm8, 0x0800 | imm5 << 6 | 0x1B],
            [0x2300 | imm8, 0x43DB], [0xF240_0300 | imm8 | 3 << 12], [0xF06F_0300 | imm8], [0x682B], [0x686B], [0x9B01],
            [0x2100 | imm5, 0x2300 | imm8, 0x408B], [0x2100 | imm5, 0x2300 | imm8, 0x40CB], [0x2300 | imm8, 0x33F0],
            [0x2300 | imm8, 0x3B01], [0x2300 | imm8, 0x18DB], [0xF103_0300 | imm8], [0xF1A3_0300 | imm8], [0xEA4F_0341],
            [0xEA4F_1391], [0xEA6F_0301], [0xFA01_F303], [0xFA21_F303],
            [0x1C4B], [0x1E8B], [0x4603], [0x460B], [0xF8D5_3004],
        )
    )  # fmt: skip
    by_register = dice.choice((0x401A, 0x439A, 0x431A, 0xEA02_0203, 0xEA22_0203, 0xEA42_0203, 0xEA03_0202, 0xEA43_0202))
    low = dice.choice((0, 4, imm5))
    field = (low >> 2) << 12 | (low & 3) << 6 | dice.randrange(low, 32)
    return dice.choice(
        (
            [constant], [constant, constant ^ imm5], [*made, by_register], [*made, by_register], [*made, by_register],
            [0xF36F_0200 | field], [0xF363_0200 | field], [0x4613, 0x461A], [0xEA4F_0302, 0xEA4F_0203],
            [0x4053], [0x1812],
        )
    )  # fmt: skip


def _stores(_: random.Random) -> Iterator[str]:
    """Yield what stores to a register force: at the end of a load, some changes of what was loaded, and the store."""
    dice = random.Random("stores")
    memory = {FLASH + 4 * n: dice.getrandbits(32) for n in range(-40, 40)} | {
        SRAM + 4 * n: REGISTER + n for n in range(-4, 8)
    }

    def read(address: int, size: int) -> bytes | None:
        word = memory.get(address)
        return None if word is None else word.to_bytes(4, "little")[:size]

    for _number in range(STORES):
        registers = [dice.getrandbits(32) if n not in {0, 5, 13} else REGISTER if n == 0 else SRAM for n in range(15)]
        offset = dice.choice((0, 0, 4))
        load = dice.choice((*[0x6802 | offset << 4] * 4, *[0xF8D0_2000 | offset] * 2, 0x9A00 + offset, 0xBF00))
        store = dice.choice((*[0x6002 | offset << 4] * 4, *[0xF8C0_2000 | offset] * 2, 0x6003, 0x9200, 0xBF00))
        changes = [word for _ in range(dice.randrange(4)) for word in _change(dice)]
        changes += [_instruction(dice) for _ in range(dice.choice((0, 0, 0, 1, 3)))]
        code = _code(load, *changes, store)
        asked: Callable[[int], int] = registers.__getitem__
        bits, seen = forced_bits(code, asked, REGISTER + offset, read)
        others = forced_bits(code, asked, REGISTER + 8, read)
        yield f"{code.hex()} {bits:x} { ({f'{place:x}': f'{value:x}' for place, value in seen.items()}) } {others}"


TRACES = {"encodings": _encodings, "branches": _branches, "blocks": _blocks, "ITs": _its, "stores": _stores}
test_a_walk_shows_what_was_approved = judge_of(__file__, TRACES)
