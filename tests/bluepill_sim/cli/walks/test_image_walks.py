"""What the recorder of a page makes of calls and of memory that changes between them, at random, as approved."""

import ctypes
import os
import random
from collections.abc import Callable, Iterator
from typing import Any

from bluepill_sim.cli.browser.document import chip_data
from bluepill_sim.cli.browser.image import FUNCTIONS, Recording, _changed, _pointers, _renamed, _runs
from bluepill_sim.extension import library as emulator
from bluepill_sim.extension.library import CORE_VARIABLE
from tests.tools.suite.approved import Trace, judge_of, said, tried

BYTES = 160
#: Of the buffers of Python's.
_SIZES = (64, 1, 32, BYTES)


def _stretches(_: random.Random) -> Iterator[str]:
    """Yield which words have changed, and which parts of them are of equal bytes."""
    dice = random.Random("stretches")
    for number in range(60):
        before = bytes(BYTES - number % 3)
        now = bytearray(before)
        for _change in range(dice.randrange(4)):
            at, size = dice.randrange(BYTES), dice.choice((1, 7, 8, 9, 31, 32, 33, 64))
            now[at : at + size] = (bytes([dice.choice((0, 1, 255))]) * size)[: len(now[at : at + size])]
        places = [*_changed(before, bytes(now))]
        yield said([places, [[*_runs(bytes(now), first, end)] for first, end in places]])
    for size in (31, 32, 33):
        for data in (bytes(size), b"\1" + bytes(size), bytes(size) + b"\1", bytes(size) + b"\1" * size):
            yield said([[*_runs(data, first, len(data))] for first in (0, 1)])
    numbers = {"b3": "b0", "b5": "b1"}
    yield said([_renamed(part, numbers) for part in ("b3+4", "b5", "b4+1", "n", "b3", 7, "b3+4+5")])
    steps: list[list[Any]] = [["call", "f", "b1+0", 3, "n"], ["point", "r0", 8, "b2+4"], ["poke", "b0", 1, "00"]]
    yield said([_pointers(step) for step in steps])


class _Calls:
    """A recorder, some buffers, and functions that it has wrapped."""

    def __init__(self, dice: random.Random) -> None:
        self.dice, self.recording = dice, Recording()
        self.buffers = [ctypes.create_string_buffer(size) for size in _SIZES]
        self.other = ctypes.create_string_buffer(8)
        self.words = (ctypes.c_uint64 * 4)()
        self.made = ctypes.create_string_buffer(4096 * 16)

    def wrapped(self, name: str, signature: str, does: Callable[..., Any]) -> Callable[..., Any]:
        function = ctypes.CFUNCTYPE(ctypes.c_uint64)(lambda: 0)
        found = self.recording.wrap(name, signature, function)
        held = dict(zip(found.__code__.co_freevars, found.__closure__ or (), strict=True))
        held["function"].cell_contents = does
        return found

    def know(self) -> str:
        buffer = self.dice.choice(self.buffers)
        self.recording.add_buffer(ctypes.addressof(buffer), ctypes.sizeof(buffer), buffer)
        self.recording.add_buffer(ctypes.addressof(buffer), 0, buffer)
        return said(self.recording.sizes)

    def change(self) -> str:
        buffer = self.dice.choice(self.buffers)
        at, size = self.dice.randrange(len(buffer)), self.dice.choice((1, 3, 8, 40))
        data = (bytes([self.dice.choice((0, 5))]) * size)[: len(buffer) - at]
        ctypes.memmove(ctypes.addressof(buffer) + at, data, len(data))
        return f"{at} {len(data)}"

    def point(self) -> str:
        """Have what C has made hold the address of a buffer, as tables do."""
        target, at = self.dice.choice(self.buffers), 8 * self.dice.randrange(6)
        self.recording.add_buffer(ctypes.addressof(target), ctypes.sizeof(target), target)
        self.recording.note_changes()
        place = (ctypes.addressof(target) + self.dice.randrange(min(2, len(target)))).to_bytes(8, "little")
        ctypes.memmove(ctypes.addressof(self.made) + at, place, len(place))
        self.recording.note_changes()
        return f"{at}"

    def call(self) -> str:
        dice, buffer = self.dice, self.dice.choice(self.buffers)
        at = ctypes.addressof(buffer)
        name, signature, arguments = dice.choice(
            (
                ("core_run", "upq", (at, 5)), ("core_run", "upu", (ctypes.c_void_p(at + 1), 0)),
                ("core_new", "pppp", (None, None, at, 0)), ("fabric_command", "iupu", (3, at, 1)),
                ("system_init", "vs", (b"ab",)), ("core_block_start", "up", (at,)), ("core_run", "vp", (self.words,)),
                ("interpreter_x", "vp", (ctypes.byref(self.other),)), ("core_run", "vp", (ctypes.byref(self.words),)),
                ("core_run", "vp", (emulator.address_of(dice.choice(FUNCTIONS)),)), ("core_run", "vp", (12345,)),
            )
        )  # fmt: skip
        result = ctypes.addressof(self.made) if signature[0] == "p" else 1

        def does(*_: Any) -> int:
            ctypes.memmove(ctypes.addressof(buffer), b"\7", 1)  # C's own doing
            return result

        return f"{name} {tried(lambda: self.wrapped(name, signature, does)(*arguments) == result)}"


def _recordings(_: random.Random) -> Iterator[str]:
    """Yield what is done and what is recorded of it; at the end what is left out, and the numbers of the rest."""
    for number in range(14):
        calls, done = _Calls(random.Random(f"recording {number}")), list[str]()
        recording = calls.recording
        for _step in range(24):
            act = calls.dice.choice((calls.know, calls.change, calls.change, calls.point, calls.call, calls.call))
            seen = len(recording.steps)
            text = act().replace(f"{12345:#x}", "…")
            done.append(f"{act.__name__} {text} {said(recording.steps[seen:])[:400]}")
        recording.note_changes()
        recording.leave_out_unused()
        yield "\n".join([*done, said(recording.sizes), said(recording.steps)])


def _page(_: random.Random) -> Iterator[str]:
    """Yield what a page is given to make a chip of: which functions are called, each name, and where it stands.

    What stands in the memory of C changes with each structure of it, and is left out.
    """
    data = chip_data()
    called = [step[1] for step in data["steps"] if step[0] == "call"]
    for name, value in sorted((data | {"sizes": len(data["sizes"]), "steps": called}).items()):
        rows = value.items() if isinstance(value, dict) else value if isinstance(value, list) else [value]
        yield "\n".join([f"{name} {len(rows)}", *map(said, rows)])
    yield said([chip_data() == data, os.environ.get(CORE_VARIABLE, "none")])


TRACES: dict[str, Trace] = {"stretches": _stretches, "recordings": _recordings, "page": _page}
test_a_walk_shows_what_was_approved = judge_of(__file__, TRACES)
