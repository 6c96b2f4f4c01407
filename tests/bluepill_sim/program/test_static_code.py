"""Blocks cut out of bytes: where one ends, who may go on behind it, and which of it ran."""

import pytest

from bluepill_sim.core.thumb import Instruction, Kind
from bluepill_sim.program.static_code import StaticBlock, StaticCode

BASE = 0x0800_0000
NOP, BX_LR, BLX_R3, IT_EQ, BEQ, B, CBZ, WFI = 0xBF00, 0x4770, 0x4798, 0xBF08, 0xD001, 0xE001, 0xB108, 0xBF30


class Words:
    """Memory of halfwords, and nothing behind them."""

    def __init__(self, *words: int) -> None:
        self._bytes = b"".join(word.to_bytes(2, "little") for word in words)

    def read(self, address: int, size: int) -> bytes | None:
        part = self._bytes[address - BASE : address - BASE + size]
        return part if len(part) == size else None


@pytest.mark.parametrize(
    ("words", "end", "is_conditional", "is_call", "goes_on"),
    [
        ((NOP, BX_LR, NOP), 4, False, False, False),
        ((IT_EQ, BX_LR, NOP), 4, True, False, True),  # the last of an IT block has its condition
        ((IT_EQ, NOP, BX_LR, NOP), 6, False, False, False),  # one behind it has none
        ((NOP, BEQ, NOP), 4, True, False, True),
        ((NOP, B, NOP), 4, False, False, False),
        ((CBZ, NOP), 2, True, False, True),
        ((BLX_R3, NOP), 2, False, True, False),
        ((WFI, NOP), 2, False, False, True),
        ((IT_EQ, WFI, NOP), 4, False, False, True),  # no branch: it goes on in any case
        ((NOP, NOP), 4, False, False, True),  # where the memory ends
    ],
)
def test_a_block_ends_at_what_may_leave_it(
    words: tuple[int, ...], end: int, is_conditional: bool, is_call: bool, goes_on: bool
) -> None:
    block = StaticCode(Words(*words)).block(BASE)
    assert block.end == BASE + end
    assert block.addresses == tuple(range(BASE, BASE + end, 2))
    assert (block.is_conditional, block.is_call, block.can_fall_through) == (is_conditional, is_call, goes_on)


def block_with(last: Instruction) -> StaticBlock:
    return StaticBlock(BASE, BASE + 6, (BASE, BASE + 2, BASE + 4), last, False, False)


@pytest.mark.parametrize(
    ("last", "following", "is_cut"),
    [
        (Instruction(BASE + 4, 2, Kind.PLAIN), BASE + 2, True),
        (Instruction(BASE + 4, 2, Kind.PLAIN), BASE, True),
        (Instruction(BASE + 4, 2, Kind.PLAIN), BASE + 6, False),  # as far as it goes
        (Instruction(BASE + 4, 2, Kind.PLAIN), None, False),
        (Instruction(BASE + 4, 2, Kind.BRANCH, destination=BASE + 2), BASE + 2, False),  # it has gone there itself
        (Instruction(BASE + 4, 2, Kind.BRANCH, destination=BASE + 2), BASE, True),
        (Instruction(BASE + 4, 2, Kind.BRANCH_REGISTER), BASE, False),  # may be where the register says
        (Instruction(BASE + 4, 2, Kind.BRANCH_REGISTER), BASE + 2, True),
        (Instruction(BASE + 4, 2, Kind.PLAIN, loads_pc=True), BASE, False),
    ],
)
def test_what_ran_ends_before_the_next_one_where_the_block_could_not_go_there(
    last: Instruction, following: int | None, is_cut: bool
) -> None:
    block = block_with(last)
    assert block.ends_before(following) is is_cut
    ran = block.addresses[: (following - BASE) // 2] if is_cut and following is not None else block.addresses
    assert block.executed(following) == ran
