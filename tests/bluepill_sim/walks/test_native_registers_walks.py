"""What the native core leaves to Python: accesses to each register, and words of the system's; as approved.

An access that C could answer and does not is as right as one that it answers, and a hundred times as slow.
"""

import random
import struct
from collections.abc import Iterator
from unittest.mock import patch

from bluepill_sim.analysis import edge_log
from bluepill_sim.board import BluePill
from bluepill_sim.core.unicorn_core import Reg
from bluepill_sim.extension.library import core_chosen, library
from bluepill_sim.fabric import fabric
from bluepill_sim.native import engine, interpreter_core
from tests.bluepill_sim.machine import Machine
from tests.bluepill_sim.native.test_native_registers import asked
from tests.tools.suite.approved import Trace, judge_of, said, tried

#: ldr r2, [r1]; str r2, [r1]; and the same of halfwords and bytes; each with its way to sleep.
ACCESSES = {4: (0x680A, 0x600A), 2: (0x880A, 0x800A), 1: (0x780A, 0x700A)}
#: RCC's offsets of AHBENR, APB2ENR and APB1ENR, and what has every clock on.
CLOCKS_ON = ((0x14, 0x55), (0x18, 0x7FFD), (0x1C, 0x1AE6_4807))
ENTRY, NEXT, SPAN_NS = 0x2000_0800, 16, 4_000


def _accessed(board: BluePill, width: int, address: int) -> None:
    """Have a program load and store what stands at an address, and sleep."""
    chip = board.chip
    chip.engine.registers[Reg.R1] = address
    chip.engine.jump(ENTRY + NEXT * width | 1)
    chip.processor.wake()
    board.advance_to(board.now_ns + SPAN_NS)


def left(_: random.Random) -> Iterator[str]:
    """Yield, by kind of part, which registers' loads and stores C asks Python about, the first time and later."""
    with core_chosen("native"):
        board = Machine("sleep: wfi\nb sleep", {}).deafen().board
    for width, (load, store) in ACCESSES.items():
        board.chip.memory.write(ENTRY + NEXT * width, struct.pack("<4H", load, store, 0xBF30, 0xE7FD))
    for register, word in CLOCKS_ON:
        board.chip.parts.rcc.write(register, 4, word)
    board.run_for("9 us")
    fresh, counts = board.snapshot(), asked(board)
    kinds = {type(part): part for part in reversed(board.chip.parts.by_name.values())}
    for part in reversed(kinds.values()):
        rows: list[str] = []
        for register in part.REGISTERS:
            if register.name.startswith("PMA_") and register.offset % 0x80:
                continue  # one word of the packets' memory is as good as another
            board.restore(fresh)
            rows.append(register.name)
            for width in (4, 4, 2, 1):
                _accessed(board, width, part.base + register.offset)
                row = "".join(f"{kind[0]}{count}" for (kind, _address), count in counts.items())
                rows.append(row or ("-" if board.is_asleep else "never"))
                counts.clear()
        yield f"{part.name}: {' '.join(rows)}"


#: What asks for memory in C, by who calls it: what it returns where there is none.
WITHOUT_MEMORY = {
    "core_new": None, "fabric_new": None, "interpreter_new": None, "core_start_recording": False, "core_add_row": False,
    "core_set_loop": False, "edge_log_new": None, "edge_log_put": False, "edge_log_take": False,
}  # fmt: skip


def starved(_: random.Random) -> Iterator[str]:
    """Yield what is said where the memory of C has run out, at each place that asks for some."""
    for name, nothing in WITHOUT_MEMORY.items():
        calls = library()
        proxy = _Starved(calls, name, nothing)
        for core in ("native", "own"):
            with (
                core_chosen(core),
                patch.object(engine, "library", lambda proxy=proxy: proxy),
                patch.object(fabric, "library", lambda proxy=proxy: proxy),
                patch.object(interpreter_core, "library", lambda proxy=proxy: proxy),
                patch.object(edge_log, "library", lambda proxy=proxy: proxy),
            ):
                yield f"{name} {core}: {_said_by(_lives)}"


class _Starved:
    """The library in C, one function of which finds no memory."""

    def __init__(self, calls: object, name: str, nothing: object) -> None:
        self._calls, self._name, self._nothing = calls, name, nothing

    def __getattr__(self, name: str) -> object:
        return (lambda *_: self._nothing) if name == self._name else getattr(self._calls, name)


def _said_by(act: object) -> str:
    try:
        return tried(act)  # type: ignore[arg-type]  # it is called without arguments
    except MemoryError as error:
        return f"MemoryError: {error}"


def _lives() -> object:
    """Make a board, run a loop that polls, record its blocks and log its edges."""
    board = Machine("mov32 r0, #0x40021000\npoll: ldr r1, [r0, #0]\ncmp r1, #0\nbne poll", {}).deafen().board
    board.run_for("5 us")
    rows: list[object] = []
    board.chip.record_blocks(10, rows.append)
    log = edge_log.EdgeLog([0], [0])
    log.put(1, 0, 1)
    log.take(b"")
    return said([board.now_ns, len(rows)])


TRACES: dict[str, Trace] = {"left": left, "starved": starved}
test_a_walk_shows_what_was_approved = judge_of(__file__, TRACES)
