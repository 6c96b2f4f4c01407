"""Each register of the private peripheral bus, swept and driven at random, against traces that were approved.

The core sleeps: SysTick, CYCCNT and what is pending move with the time, and nothing else does. A line has what was
read or written, and each field of the state that is otherwise than before.
"""

import ctypes
import random
import zlib
from collections.abc import Iterator
from typing import Any

from bluepill_sim.core.system_control import PPB_BASE
from bluepill_sim.extension.layout import SHARED
from tests.bluepill_sim.machine import Machine
from tests.tools.suite.approved import judge_of

STEPS = 1100
#: Where there is a register, or none: from, up to.
RANGES = (
    (0xE000_0000, 0xE000_0090), (0xE000_0DFC, 0xE000_0E48), (0xE000_0E7C, 0xE000_0E88), (0xE000_0FA8, 0xE000_1068),
    (0xE000_1FFC, 0xE000_202C), (0xE000_2FFC, 0xE000_3004), (0xE000_DFFC, 0xE000_E028), (0xE000_E0FC, 0xE000_E12C),
    (0xE000_E17C, 0xE000_E18C), (0xE000_E1FC, 0xE000_E20C), (0xE000_E27C, 0xE000_E28C), (0xE000_E2FC, 0xE000_E30C),
    (0xE000_E31C, 0xE000_E324), (0xE000_E37C, 0xE000_E384), (0xE000_E3FC, 0xE000_E434), (0xE000_E4EC, 0xE000_E4F8),
    (0xE000_ECFC, 0xE000_ED44), (0xE000_ED8C, 0xE000_EDC0), (0xE000_EDEC, 0xE000_EE04), (0xE000_EEFC, 0xE000_EF08),
    (0xE003_FFFC, 0xE004_0014), (0xE004_00EC, 0xE004_00F8), (0xE004_02FC, 0xE004_030C), (0xE004_0FC4, 0xE004_1008),
    (0xE004_1FFC, 0xE004_2010),
)  # fmt: skip
#: Read after each step, for they show the state by other bits than it is kept in, and reading them changes nothing.
_SHOWN = (
    0xE000_0000, 0xE000_007C, 0xE000_0E00, 0xE000_0E80, 0xE000_0FB4, 0xE000_1000, 0xE000_1004, 0xE000_2000, 0xE000_2004,
    0xE000_E100, 0xE000_E104, 0xE000_E180, 0xE000_E200, 0xE000_E204, 0xE000_E280, 0xE000_E300, 0xE000_E304,
    0xE000_E400, 0xE000_E428, 0xE000_ED04, 0xE000_ED08, 0xE000_ED0C, 0xE000_ED10, 0xE000_ED14, 0xE000_ED18,
    0xE000_ED20, 0xE000_ED24, 0xE000_ED28, 0xE000_EDFC, 0xE004_2004,
)  # fmt: skip
#: What threads without privilege may write, or not: at both ends of each eight stimulus ports, behind them, and STIR.
_OPEN = (*(offset + end for offset in range(0, 0x80, 0x20) for end in (0, 0x1C)), 0x80, 0xE400, 0xEF00)
#: Addresses of the host, and what only a run sets.
_OWN = {"sram", "flash", "scratch", "fault", "last", "logged", "exact_stops", "is_python"}
_AIRCR, _DEMCR, _LAR, _TCR, _TER, _STIR = 0xE000_ED0C, 0xE000_EDFC, 0xE000_0FB0, 0xE000_0E80, 0xE000_0E00, 0xE000_EF00
#: Written now and then, since much hangs on them.
_KEYS = (
    (0xE000_0E40, 5), (0xE000_0E40, 8), (0xE000_0E40, 2), (0xE000_ED14, 0x202),
    (_TCR, 0), (_TER, 0), (_TER, 2), (0xE000_0004, 3), (0xE000_0008, 4),
    (0xE000_0000, 0x1234_5678), (0xE000_0004, 0xFFFF_FFFF), (0xE000_007C, 1),
    (_LAR, 0xC5AC_CE55), (_LAR, 1), (_DEMCR, 0x0107_0000), (_DEMCR, 0), (_AIRCR, 0x05FA_0300),
    (_AIRCR, 0x05FA_0702), (_AIRCR, 0x05FA_0000), (_AIRCR, 0x1234_0700), (_TCR, 1), (_TER, 0xFFFF_FFFF),
    (0xE000_E010, 7), (0xE000_E010, 3), (0xE000_E014, 99), (0xE000_E014, 0), (0xE000_E018, 5),
    (0xE000_1000, 1), (0xE000_2000, 3), (0xE000_2000, 1), (0xE000_E100, 0xFFFF_FFFF), (0xE000_EF00, 42),
    (0xE000_EF00, 43), (0xE000_EF00, 0x22A), (0xE000_E280, 0xFFFF_FFFF), (0xE000_E284, 0xFFFF_FFFF),
    (0xE000_E280, 0xFFFF_FFFF), (0xE000_E200, 0x8000_0003), (0xE000_E204, 0x401), (0xE000_E180, 0x8000_0001),
)  # fmt: skip


class _Bus:
    """A board whose core sleeps, its registers, and what has become of its state."""

    def __init__(self) -> None:
        self.board = Machine("sleep: wfi\nb sleep", {}).deafen().board
        self.board.advance_to(10_000)
        self.system = self.board.chip.system
        self.heard: list[str] = []
        self.system.stimulus_sinks.append(lambda *row: self.heard.append(f"{row}"))
        self.board.chip.processor.on_unmodelled = self.heard.append
        self._before = self._fields()

    def _fields(self) -> dict[str, object]:
        shared = self.system.shared
        return {one.name: _plain(getattr(shared, one.name)) for one in SHARED.fields if one.name not in _OWN}

    def changed(self) -> str:
        """Return what is otherwise than when this was last asked."""
        now, before = self._fields(), self._before
        self._before = now
        heard, self.heard[:] = [*self.heard], []
        found = [f"{name}={value}" for name, value in now.items() if value != before[name]]
        return f"{' '.join(found)} {' '.join(heard)}"

    def read(self, address: int, size: int = 4) -> str:
        """Return what a read gives."""
        return f"{self.system.read(address - PPB_BASE, size):x}"

    def shown(self) -> str:
        """Return what reads give that change nothing."""
        is_open = "".join(f"{self.system.is_open_to_all(offset):d}" for offset in _OPEN)
        return f"{' '.join(map(self.read, _SHOWN))} {is_open}"

    def write(self, address: int, size: int, value: int) -> str:
        """Return whether a write is known."""
        return f"{self.system.write(address - PPB_BASE, size, value):d}"

    def line(self, dice: random.Random) -> str:
        """Set the line of an interrupt, which may be served then."""
        irq, level, nvic = dice.choice((0, 1, 31, 32, 42)), dice.random() < 0.5, self.board.chip.processor.nvic
        self.board.chip.fabric.set_line(irq, level)
        if level and dice.random() < 0.3:
            nvic.activate(16 + irq)
        elif not level:
            nvic.deactivate(16 + irq)
        return f"irq {irq} {level} {nvic.first_pending()} {nvic.active_priority()} {nvic.deliverable():x}"

    def serve(self, dice: random.Random) -> str:
        """Begin or end the handler of an exception of the core, or make it pending."""
        nvic, number = self.board.chip.processor.nvic, dice.choice((2, 3, 4, 5, 6, 11, 12, 14, 15))
        act = dice.choice((nvic.activate, nvic.activate, nvic.deactivate, nvic.pend))
        act(number)
        return f"{act.__name__} {number} {nvic.first_pending()} {nvic.active_priority()}"

    def wait(self, cycles: int) -> str:
        """Let time pass."""
        chip = self.board.chip
        chip.engine.cycle += cycles
        chip.processor.systick.advance_to(chip.engine.cycle)
        return f"+{cycles} {self.system.count_at(chip.engine.cycle)}"


def _plain(value: Any) -> object:
    if isinstance(value, ctypes.Structure):
        return bytes(value).hex()
    return value if isinstance(value, int) else [*value] if len(value) < 16 else f"{zlib.crc32(bytes(value)):x}"


def _sweep(_: random.Random) -> Iterator[str]:
    """Yield each word: what it is after a reset, and what writes make of it; once locked, once with trace on."""
    bus = _Bus()
    fresh, shared = bus.board.snapshot(), bus.system.shared
    for has_trace in (False, True):
        bus.board.restore(fresh)
        for first, end in RANGES:
            for address in range(first, end, 4):
                offset = address - PPB_BASE
                for key, word in ((_DEMCR, 0x0100_0000), (_LAR, 0xC5AC_CE55)) if has_trace else ():
                    bus.write(key, 4, word)
                shared.cfsr = shared.hfsr = shared.dfsr = 0xFFFF_FFFF
                known = "".join(
                    f"{bus.system.is_modelled(byte):d}{bus.system.is_open_to_all(byte):d}"
                    for byte in range(offset, offset + 4)
                )
                line = f"{address:x} {known} {bus.read(address)}"
                for word in (0xFFFF_FFFF, 0, 0xA5A5_A5A5, 0x5A5A_5A5A):
                    if address == _AIRCR and word >> 16 == 0x05FA:
                        continue
                    line += f" {bus.write(address, 4, word)}:{bus.read(address)} {bus.changed()}"
                yield line
    for number in range(50):
        yield f"STIR {number} {bus.write(_STIR, 4, number)} {bus.changed()}"
    yield "\n".join(map(str, bus.board.warnings))


def _walk(_: random.Random) -> Iterator[str]:
    dice, bus = random.Random("system control"), _Bus()
    words = [address for first, end in RANGES for address in range(first, end, 4)]
    for step in range(STEPS):
        kind, address = dice.randrange(10), dice.choice(words)
        size = dice.choice((4, 4, 4, 2, 1))
        address += dice.randrange(0, 4, size)
        if step % 40 == 0:
            bus.system.enable_trace()
        if step == STEPS // 2:
            saved = bus.board.snapshot()
            bus = _Bus()
            bus.board.restore(saved)
        if kind < 2:
            address, word = dice.choice(_KEYS)
            done = f"{address:x}={word:x} {bus.write(address, 4, word)}"
        elif kind < 5:
            word = dice.choice((dice.getrandbits(32), 1 << dice.randrange(32)))
            word = 0 if address & ~3 == _AIRCR else word
            done = f"{address:x}/{size}={word:x} {bus.write(address, size, word)}"
        elif kind < 8:
            done = f"{address:x}/{size} {bus.read(address, size)}"
        else:
            act = dice.choice((bus.line, bus.serve)) if kind < 9 else None
            done = act(dice) if act is not None else bus.wait(dice.choice((1, 7, 50, 100, 1_000)))
        yield f"{done} {bus.changed()}\n{bus.shown()} {bus.changed()}"
    for act in (bus.system.enable_trace, bus.system.reset, bus.system.lose_power):
        act()
        yield f"{act.__name__} {bus.changed()} {bus.shown()}"
    yield "\n".join(map(str, bus.board.warnings))


TRACES = {"sweep": _sweep, "walk": _walk}
test_a_walk_shows_what_was_approved = judge_of(__file__, TRACES)
