"""Blocks: where they end, which are kept, when they are forgotten, and where none may be."""

import ctypes
import struct
from collections.abc import Callable

import pytest

from bluepill_sim.core.unicorn_core import Reg, UnicornCore
from bluepill_sim.native.interpreter_core import InterpreterCore

FLASH, FAR, SRAM, BYTES = 0x0800_0000, 0x0802_0000, 0x2000_0000, 0x800
KILOBYTE = 0x400
#: chosen: where a run is ended that goes on and on.
MOST_BLOCKS = 12
NOP, BKPT, BX_LR, ISB, WIDE_NOP = 0xBF00, 0xBE00, 0x4770, 0xF3BF_8F6F, 0xF3AF_8000
CPSIE, MSR, MRS, IT_NE, ITT_NE = 0xB662, 0xF380_8810, 0xF3EF_8010, 0xBF18, 0xBF1C
ADD_ONE = 0x3001  # ADDS R0, #1
by_both = pytest.mark.parametrize("kind", [UnicornCore, InterpreterCore])


def _raise(error: BaseException) -> None:
    raise error


def code_of(*words: int) -> bytes:
    """Return instructions as they stand in memory."""
    return b"".join(
        struct.pack("<HH", word >> 16, word & 0xFFFF) if word >> 16 else struct.pack("<H", word) for word in words
    )


class Board:
    """A bare core with flash at two places, of which 0 shows the first again, and SRAM; full of BKPT."""

    def __init__(self, kind: type[UnicornCore]) -> None:
        self.core = core = kind(_raise)
        self.happened: list[tuple[object, ...]] = []
        self.memory = {
            at: ctypes.create_string_buffer(code_of(BKPT) * (BYTES // 2), BYTES) for at in (FLASH, FAR, SRAM)
        }
        for address, name, may in ((FLASH, FLASH, "rx"), (0, FLASH, "rx"), (FAR, FAR, "rx"), (SRAM, SRAM, "rwx")):
            core.map_memory(address, self.memory[name], may)
        core.on_block(self._block)
        core.on_interrupt(self._interrupt)
        core.on_bad_access(lambda what, address, *_: self.happened.append(("failed", what, address)) is not None)
        core.on_invalid(self._invalid)

    def _block(self, _uc: int, address: int, size: int, _user: int) -> None:
        self.happened.append(("block", address, size))
        if len(self.happened) > MOST_BLOCKS:
            self.core.stop()

    def _interrupt(self, number: int) -> None:
        self.happened.append(("interrupt", number))
        self.core.stop()

    def _invalid(self) -> bool:
        self.happened.append(("undefined", self.core.registers[Reg.PC]))
        self.core.stop()
        return True

    def put(self, address: int, *words: int, drops: bool = True) -> None:
        """Put instructions somewhere."""
        base = next(base for base in self.memory if base <= address < base + BYTES)
        code = code_of(*words)
        ctypes.memmove(ctypes.addressof(self.memory[base]) + address - base, code, len(code))
        if drops:
            self.core.drop_all_code()

    def run(self, address: int, thumb: int = 1, flags: int = 0) -> tuple[int, list[tuple[object, ...]]]:
        """Run from an address with R0 = 0; return R0 and what happened."""
        self.happened.clear()
        registers = self.core.registers
        registers[Reg.CPSR] = 0x20 | flags
        registers[Reg.R0] = 0
        registers[Reg.R1] = 0
        registers[Reg.LR] = FLASH + 0x11
        self.core.start(address | thumb)
        return registers[Reg.R0], [*self.happened]


@pytest.fixture
def own() -> Board:
    """One with the interpreter."""
    return Board(InterpreterCore)


#: What ends a block, or does not; what stands in IT blocks; and instructions of 16 and 32 bits.
ENDS = (
    (NOP, NOP, BKPT),
    (NOP, 0xE800_0000, BKPT), (NOP, 0xE7FF, ADD_ONE, BKPT),
    (NOP, ISB, ADD_ONE, BKPT), (CPSIE, ADD_ONE, BKPT), (MSR, ADD_ONE, BKPT), (MRS, ADD_ONE, BKPT),
    (IT_NE, ADD_ONE, ADD_ONE, BKPT), (ITT_NE, WIDE_NOP, ADD_ONE, ADD_ONE, BKPT), (0xBF0C, ADD_ONE, 0x3002, BKPT),
    (0xE000, ADD_ONE, ADD_ONE, BKPT), (0xD000, ADD_ONE, ADD_ONE, BKPT), (0xD100, ADD_ONE, ADD_ONE, BKPT),
    (0xB108, ADD_ONE, ADD_ONE, BKPT), (0xB908, ADD_ONE, ADD_ONE, BKPT), (0xF3BF_8F4F, ADD_ONE, BKPT),
    (WIDE_NOP, WIDE_NOP, WIDE_NOP, ADD_ONE, BKPT), (0xF000_B800, ADD_ONE, BKPT), (0xF000_F800, ADD_ONE, BKPT),
    (0xBF18, 0xE000, ADD_ONE, ADD_ONE, BKPT), (0xBF18, 0x4770, ADD_ONE, BKPT), (IT_NE, BKPT, ADD_ONE, BKPT),
    (0xBF4C, ADD_ONE, 0x3002, ADD_ONE, BKPT), (0xBF01, 0x3001, 0x3002, 0x3004, 0x3008, BKPT),
    (0xBF07, 0x3001, 0x3002, 0x3004, 0x3008, BKPT), (0xBF16, 0x3001, 0x3002, 0x3004, 0x3008, BKPT),
)  # fmt: skip


def assert_same_blocks(own: Board, unicorn: Board, at: int, words: tuple[int, ...]) -> None:
    """Hold the two to the same blocks and the same result of some code, with Z clear and set."""
    for board in (unicorn, own):
        board.put(FLASH, *(BKPT,) * (BYTES // 2))
        code = code_of(*words)[: FLASH + BYTES - at]
        board.put(at, *(int.from_bytes(code[n : n + 2], "little") for n in range(0, len(code), 2)))
    for flags in (0, 1 << 30):
        expected, seen = (board.run(at, flags=flags) for board in (unicorn, own))
        assert seen == expected, f"{[f'{word:x}' for word in words]} at {at:#x}, flags {flags:#x}"


def test_blocks_end_where_unicorns_do_about_the_end_of_a_kilobyte(own: Board) -> None:
    unicorn = Board(UnicornCore)
    for words in ENDS:
        for before in range(0, 14, 2):
            assert_same_blocks(own, unicorn, FLASH + KILOBYTE - before, words)


def test_blocks_end_where_unicorns_do_at_the_end_of_memory(own: Board) -> None:
    """The last of the instructions is the last of the memory, or its second half is not there any more."""
    unicorn = Board(UnicornCore)
    for words in ENDS:
        for count in range(1, len(words)):
            for missing in (0, 2) if words[count - 1] >> 16 else (0,):
                assert_same_blocks(own, unicorn, FLASH + BYTES + missing - len(code_of(*words[:count])), words[:count])


@pytest.mark.parametrize(
    ("target", "is_never"),
    [
        (0x3FFF_FFFE, False), (0x4000_0000, True), (0x5FFF_FFFE, True), (0x6000_0000, False), (0x9FFF_FBFE, False),
        (0xA000_0000, True), (0xDFFF_FFFE, True), (0xE000_0000, True), (0xFFFF_FFE0, True),
    ],
)  # fmt: skip
def test_nothing_executes_where_the_manual_says_so(own: Board, target: int, *, is_never: bool) -> None:
    """ARM B3.1, table B3-1: peripherals, devices and the system; elsewhere nothing is there to be fetched."""
    own.put(FLASH, 0x4700 | 2 << 3)  # BX R2
    own.core.registers[Reg.R2] = target | 1
    _, happened = own.run(FLASH)
    assert happened[1:] == [("interrupt", 3) if is_never else ("failed", 21, target)]


def test_code_in_flash_is_known_until_it_is_dropped(own: Board) -> None:
    """ADDS R0, #1 twice and BKPT, six bytes; then #2 twice: dropped by any byte of the block, and by no other."""
    for first, end, is_dropped in (
        (0, 0x100, False), (0, 0x101, True), (0x102, 0x103, True), (0x105, 0x200, True), (0x106, 0x200, False),
    ):  # fmt: skip
        own.put(FLASH + 0x100, ADD_ONE, ADD_ONE, BKPT)
        assert own.run(FLASH + 0x100)[0] == 2
        own.put(FLASH + 0x100, 0x3002, 0x3002, drops=False)
        assert own.run(FLASH + 0x100)[0] == 2, "what was decoded is not looked at again"
        own.core.drop_code(FLASH + first, end - first)
        assert own.run(FLASH + 0x100)[0] == (4 if is_dropped else 2), (first, end)


def test_code_in_writable_memory_is_compared_each_time(own: Board) -> None:
    """Two routines, called by turns; each is changed, in its first and in its last instruction, and back."""
    one, other = SRAM + 0x10, SRAM + 0x100
    for n, (first, last) in enumerate([(1, 1), (1, 1), (2, 1), (2, 3), (1, 1), (1, 3), (1, 3)]):
        own.put(one, 0x3000 | first, NOP, 0x3000 | last, BKPT, drops=False)
        assert own.run(one)[0] == first + last, n
        own.put(other, 0x3000 | last, 0x3000 | first, 0x3000 | last, BKPT, drops=False)
        assert own.run(other)[0] == first + 2 * last, n
        assert own.run(one)[0] == first + last, n
    own.core.drop_code(SRAM, BYTES)
    assert own.run(one)[0] == 4
    assert own.run(other)[0] == 7


def test_blocks_of_one_place_in_the_table_do_not_hide_each_other(own: Board) -> None:
    """0, where the flash is shown again, 0x08000000, and 128 KB on: one is dropped, and the others stay."""
    own.put(FLASH + 0x20, ADD_ONE, BKPT)
    own.put(FAR + 0x20, 0x3007, BKPT)
    for _ in range(3):
        for base, value in ((FLASH, 1), (0, 1), (FAR, 7)):
            result, happened = own.run(base + 0x20)
            assert (result, happened[0]) == (value, ("block", base + 0x20, 4))
    own.put(FLASH + 0x20, 0x3002, drops=False)
    own.core.drop_code(0, BYTES)
    own.core.drop_code(FLASH, BYTES)
    assert [own.run(base + 0x20)[0] for base in (FLASH, 0, FAR)] == [2, 2, 7]


def test_a_block_is_another_by_the_it_block_and_the_state_that_it_begins_in(own: Board) -> None:
    """ADDS R0, #1 twice, under ITT EQ, IT NE and none; and in ARM state nothing executes."""
    own.put(FLASH + 0x40, ADD_ONE, ADD_ONE, BKPT)
    for _ in range(2):
        for it_state, zero, value in ((0, 0, 2), (0x04, 0, 0), (0x04, 1, 2), (0x18, 0, 2), (0x18, 1, 1), (0x08, 0, 1)):
            flags = zero << 30 | (it_state & 3) << 25 | it_state >> 2 << 10
            assert own.run(FLASH + 0x40, flags=flags)[0] == value, (it_state, zero)
        result, happened = own.run(FLASH + 0x40, thumb=0)
        assert (result, happened[-1][0]) == (0, "undefined")


def test_where_pages_are_asked_for_code_is_fetched_from_where_they_are(own: Board) -> None:
    """The page of FLASH is found where FAR is; one that is denied ends the run."""
    asked: list[tuple[int, int]] = []
    places: dict[int, int | None] = {FLASH: FAR, FLASH + KILOBYTE: None}

    def page(address: int, kind: int) -> tuple[int, int] | None:
        asked.append((address, kind))
        place = places.get(address, address)
        return None if place is None else (place, 7)

    own.put(FLASH + 0x20, ADD_ONE, BKPT)
    own.put(FAR + 0x20, 0x3007, BKPT)
    own.core.on_page(page)
    assert own.run(FLASH + 0x20)[0] == 7
    assert asked[0] == (FLASH, 18)
    result, happened = own.run(FLASH + KILOBYTE + 0x20)
    assert (result, happened) == (0, [])
    assert own.core.start(FLASH + KILOBYTE | 1) == 21
    assert own.run(FAR + 0x20)[0] == 7


@by_both
def test_a_block_hook_that_moves_the_pc_has_the_run_go_on_there(kind: type[UnicornCore]) -> None:
    board = Board(kind)
    board.put(FLASH, ADD_ONE, BKPT)
    board.put(FLASH + 0x100, 0x3005, BKPT)
    moves: list[Callable[[], None]] = [lambda: board.core.registers.__setitem__(Reg.PC, FLASH + 0x101)]

    def hook(_uc: int, address: int, _size: int, _user: int) -> None:
        if address == FLASH and moves:
            moves.pop()()

    board.core.on_block(hook)
    result, happened = board.run(FLASH)
    assert result == 5
    assert [what for what in happened if what[0] == "block"] == [("block", FLASH, 4), ("block", FLASH + 0x100, 4)]
    assert board.run(FLASH)[0] == 1
