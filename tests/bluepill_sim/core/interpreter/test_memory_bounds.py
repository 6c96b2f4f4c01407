"""Every access, of every width and alignment, about every bound of memory, does what it does on Unicorn.

By each of the interpreter's ways to memory: at once, where accesses are watched, and where pages are asked for.
"""

import ctypes
from collections.abc import Callable

import pytest

from bluepill_sim.core.unicorn_core import GENERAL, Reg, UnicornCore
from bluepill_sim.extension.library import library
from bluepill_sim.native.interpreter_core import InterpreterCore

FLASH, BYTES = 0x0800_0000, 0x400
#: Two memories side by side, two peripherals behind them, nothing, memory that is only read, nothing.
FIRST, SECOND, IO, IO_BEHIND, NOTHING, READ_ONLY, END = (0x2000_0000 + BYTES * n for n in range(7))
#: What stands there: an instruction each, of R0, R3 at R1, or R2 behind it; R4 is 0.
ACCESSES = {
    "LDR": "0868", "LDRH": "0888", "LDRB": "0878", "LDRSH": "885e", "LDRSB": "8856", "STR": "0860",
    "STRH": "0880", "STRB": "0870", "LDM": "09c9", "STM": "09c1", "LDRD": "d1e90003", "STRD": "c1e90003",
    "LDREX": "51e8000f", "LDREXH": "d1e85f0f", "LDREXB": "d1e84f0f", "TBB": "d1e804f0", "TBH": "d1e814f0",
}  # fmt: skip
_BKPT = "00be"
SLOT = 16
_FAILED_FETCH = 21


class Board:
    """A bare core with all of these memories, and what it has asked its peripherals."""

    def __init__(self, core: UnicornCore) -> None:
        self.core = core
        self.happened: list[tuple[object, ...]] = []
        pattern = bytes(n * 7 & 0x3F | n & 0x80 for n in range(BYTES))
        self.pattern = pattern
        self.buffers = {
            address: ctypes.create_string_buffer(pattern, BYTES) for address in (FIRST, SECOND, READ_ONLY, FLASH)
        }
        for address, buffer in self.buffers.items():
            core.map_memory(address, buffer, "rwx" if address in {FIRST, SECOND} else "rx")
        for address in (IO, IO_BEHIND):
            core.map_io(address, BYTES, self._read(address), self._write(address))
        code = b"".join(
            bytes.fromhex(each + _BKPT * (SLOT // 2))[:SLOT]
            for each in (*ACCESSES.values(), *EXCLUSIVES.values(), *MIXED.values())
        )
        ctypes.memmove(self.buffers[FLASH], code, len(code))
        self._flash = self.buffers[FLASH].raw
        core.on_interrupt(self._interrupt)
        core.on_bad_access(self._bad_access)
        core.on_invalid(self._invalid)
        core.registers[Reg.CPSR] = core.registers[Reg.CPSR] | 0x20
        self._fresh = core.context
        self._general = core.registers.batch(*GENERAL[:15])

    def _read(self, base: int) -> Callable[[int, int, int, int], int]:
        def read(_uc: int, offset: int, size: int, _user: int) -> int:
            self.happened.append(("read", base + offset, size))
            return 0x1122_3344_5566_7788 >> 8 * (offset & 3) & (1 << 8 * size) - 1

        return read

    def _write(self, base: int) -> Callable[[int, int, int, int, int], None]:
        def write(_uc: int, offset: int, size: int, value: int, _user: int) -> None:
            self.happened.append(("write", base + offset, size, value))

        return write

    def _interrupt(self, number: int) -> None:
        self.happened.append(("interrupt", number, self.core.registers[Reg.PC]))
        self.core.stop()

    def _invalid(self) -> bool:
        self.happened.append(("undefined", self.core.registers[Reg.PC]))
        self.core.stop()
        return True

    def _bad_access(self, kind: int, address: int, size: int, value: int) -> bool:
        self.happened.append(("failed", kind, address, *(() if kind == _FAILED_FETCH else (size, value))))
        return False

    def run(self, place: int, address: int) -> tuple[object, ...]:
        """Run the instruction of a place with R1 there; return all that is to be compared."""
        self.happened.clear()
        for base in (FIRST, SECOND):
            ctypes.memmove(self.buffers[base], self.pattern, BYTES)
        self.core.context = self._fresh
        self._general.write((0x8182_8384, address, address & 3, 0x9192_9394, *(0,) * 9, FIRST + 0x200, 0))
        error = self.core.start(FLASH + SLOT * place | 1)
        memory = tuple(self.buffers[base].raw for base in (FIRST, SECOND))
        return (*self._general.read(), self.core.registers[Reg.PC], error, memory, tuple(self.happened))


#: Where the manual leaves it open, and Unicorn makes a store of one width after a load of another (docs/core.md).
MIXED = {"STREXH after LDREX": "51e8000f c1e8553f", "STREX after LDREXB": "d1e84f0f 41e80035"}
#: LDREX, then STREX of R3 to where R2 is added: R5 tells whether it was made. The same of halfwords and bytes.
EXCLUSIVES = {
    "STREX": "51e8000f 41e80035", "STREX of another": "51e8000f 41e80135", "STREXH": "d1e85f0f c1e8553f",
    "STREXB": "d1e84f0f c1e8453f", "STREX alone": "41e80035",
    "a store between": "51e8000f 0b60 41e80035",  # STR R3, [R1]
    "CLREX between": "51e8000f bff32f8f 41e80035",
}  # fmt: skip


def _raise(error: BaseException) -> None:
    raise error


@pytest.fixture(scope="module")
def boards() -> dict[str, Board]:
    """Unicorn, and the interpreter with each of its ways to memory."""
    made = {"unicorn": Board(UnicornCore(_raise))}
    made |= {name: Board(InterpreterCore(_raise)) for name in ("at once", "watched", "by pages")}
    core = made["watched"].core
    core.on_access(0, 0xFFFF_FFFF, lambda *_: True)
    core = made["by pages"].core
    core.on_page(lambda address, _kind: (address, 7))
    library().interpreter_find_pages(core.handle, True)
    return made


def is_late(expected: tuple[object, ...], seen: tuple[object, ...]) -> bool:
    """Tell whether Unicorn has gone on behind the first failed byte of a store, or made words before it found one."""
    late, here = expected[-1], seen[-1]
    assert isinstance(late, tuple)
    assert isinstance(here, tuple)
    return bool(here) and here[-1][0] == "failed" and late[: len(here)] == here and len(late) > len(here)


@pytest.mark.parametrize("bound", [FIRST, SECOND, IO, IO_BEHIND, NOTHING, READ_ONLY, END, FLASH, FLASH + BYTES])
def test_accesses_about_a_bound_of_memory_do_what_they_do_on_unicorn(boards: dict[str, Board], bound: int) -> None:
    unicorn = boards["unicorn"]
    wrong = []
    for place, name in enumerate((*ACCESSES, *EXCLUSIVES)):
        for address in range(bound - 8, bound + 8):
            expected = unicorn.run(place, address)
            for way in ("at once", "watched", "by pages"):
                seen = boards[way].run(place, address)
                if seen != expected and not is_late(expected, seen):
                    wrong.append(f"{name} at {address:#x}, {way}: {_difference(expected, seen)}")
    assert not wrong, f"{len(wrong)}\n" + "\n".join(wrong[:8])


@pytest.mark.parametrize("way", ["at once", "watched", "by pages"])
def test_a_store_of_another_width_than_the_load_is_not_made(boards: dict[str, Board], way: str) -> None:
    """Memory holds what the load has not read; and where it cannot be made so, the address is not aligned."""
    board, first = boards[way], len(ACCESSES) + len(EXCLUSIVES)
    for n, low in ((0, 0), (1, 0), (1, 1), (1, 2)):
        *registers, _, _, memory, happened = board.run(first + n, FIRST + 0x10 + low)
        assert memory == (board.pattern,) * 2
        assert registers[5] == (1 if low == 0 else 0)
        assert isinstance(happened, tuple)
        assert happened[0][:2] == ("interrupt", 7 if low == 0 else 4), "BKPT behind it, or at it"


def _difference(expected: tuple[object, ...], seen: tuple[object, ...]) -> str:
    names = [*(f"R{n}" for n in range(15)), "PC", "error", "memory", "happened"]
    return "; ".join(
        name if name == "memory" else f"{name}: {one}, here {other}"
        for name, one, other in zip(names, expected, seen, strict=True)
        if one != other
    )
