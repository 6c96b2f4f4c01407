"""Loops that poll: which blocks are such, and the steps that C gets of them, as approved."""

import random
from collections.abc import Iterator, Sequence

from bluepill_sim.native.polling import loop_of
from tests.tools.suite.approved import Trace, judge_of, said

BASE = 0x0800_0100
#: LDR, LDRH and others that load; what computes, with the value in r3 or not; what does neither.
LOADS = (0x6833, 0x6873, 0x8833, 0x8873, 0x88B3, 0x7833, 0x681B, 0x9B01, 0x6C33)
STEPS = (
    0x42A3,
    0x429C,
    0x2B05,
    0x2C05,
    0x3B01,
    0x3301,
    0x07DB,
    0x0A5B,
    0x07D9,
    0x001B,
    0x1B1B,
    0x191B,
    0x18E4,
    0x1E5A,
    0x1C5B,
    0x1EDC,
    0xB29B,
    0xB29A,
    0xB2A3,
    0x4023,
    0x401C,
    0x4223,
    0x421C,
    0x4323,
    0x4063,
    0x0F1B,
    0x191A,
    0x1AE2,
    0x3A01,
    0x2A00,
    0xBF00,
    0x4618,
    0x111B,
    0x2300,
    0x429B,
    0x42B3,
)


def words(code: Sequence[int]) -> bytes:
    return b"".join(word.to_bytes(2, "little") for word in code)


def shown(code: Sequence[int]) -> str:
    cycles = {BASE + 2 * n: 10 + 3 * n for n in range(len(code))}
    loop = loop_of(words(code), cycles, BASE)
    if loop is None:
        return "none"
    steps = [(one.operation, one.operand, one.is_register, one.is_flags_only) for one in [*loop.steps][: loop.count]]
    return said([loop.read_cycle, loop.offset, loop.base, loop.condition, loop.count, steps])


def back(code: Sequence[int], condition: int, by: int = 0) -> list[int]:
    """Return a block with a branch to its start behind it."""
    return [*code, 0xD000 | condition << 8 | (0xFE - len(code) + by) & 0xFF]


def loops(draw: random.Random) -> Iterator[str]:
    for load in LOADS:
        for step in STEPS:
            yield " / ".join(shown(back([load, step], condition)) for condition in (0, 5, 8, 10, 13, 14))
    for _ in range(500):
        code = [draw.choice(LOADS[:5]), *draw.choices(STEPS[:24], k=draw.choice((0, 1, 2, 2, 3, 4)))]
        for _ in range(draw.choice((0, 0, 1))):
            code.insert(draw.randrange(len(code) + 1), 0xBF00)
        block = back(code, draw.choice((0, 1, 2, 4, 5, 8, 13)), draw.choice((0, 0, 0, 0, 0, 1, -1)))
        yield f"{words(code).hex()} {shown(block)}"
    for count in (4, 5, 6, 7, 8):
        for load in (0x6833, 0x8833):
            yield shown(back([load, *[0x3B01] * count], 1)) + shown(back([load, *[0x3B01] * (count - 1), 0x07DB], 1))
    for high in range(0x40):  # every operation, with the value as either operand and as the result
        yield " / ".join(
            shown(back([0x6833, high << 10 | low], 1)) for low in (0x01B, 0x0DB, 0x123, 0x29C, 0x31A, 0x3DB, 0x2A3)
        )
    for word in (0xE7FC, 0xD1FC, 0xD1FD, 0xD1FB, 0xD9FC, 0x4770):
        yield shown([0x6833, 0x2B05, word]) + shown([word])


TRACES: dict[str, Trace] = {"loops": loops}
test_a_walk_shows_what_was_approved = judge_of(__file__, TRACES)
