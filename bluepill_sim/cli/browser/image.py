"""A chip as it stands before the first instruction, as the calls that make it: what a page without Python replays.

Theory of operation. Python makes a chip by some thousand calls of the emulator's library, and by writing to memory that
C reads (words of registers, structs, memories). Both are recorded while a chip is made: each call with its arguments,
and before it what has changed in memory since the last one. Replayed on the same C elsewhere they make the same chip,
so no table of the chip is declared a second time. A pointer is recorded as what it points to: a place in one of
Python's buffers, the result of an earlier call, or a function by its name.

What C asks Python meanwhile is not answered in a replay; the calls that Python makes then are recorded behind the one
that asked.

Invariant: a recording depends on the library alone, not on where things lie in memory.
"""

import ctypes
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from bluepill_sim.extension import library as emulator
from bluepill_sim.extension.layout import SHARED, structure

#: A step: ["call", name, argument…], ["poke", buffer, offset, bytes in hex], ["fill", buffer, offset, count, byte], or
#: ["point", buffer, offset, pointer]. A pointer is a text: "b" and a buffer, "r" and the number of a call whose result
#: it is, "+" and an offset; "f" and a function; "d" and bytes; "n": none.
Step = list[Any]

#: Functions of the page's own that stand for those that take tables of Python's callbacks, and how many arguments of
#: the latter they take, from which place on.
_REPLACED = {"core_new": ("page_core_new", slice(0, 1)), "fabric_new": ("page_fabric_new", slice(1, 3))}
#: What is Python's business alone: its host, and what only asks.
_LEFT_OUT = frozenset({
    "fabric_set_host", "fabric_due", "fabric_event_ns", "fabric_next_ns", "fabric_has_news", "fabric_line",
    "fabric_take_stop", "fabric_look", "fabric_channel_uv", "core_block_start", "core_block_from", "core_block_around",
    "core_shared_bytes", "core_next_event", "interpreter_reg_read", "interpreter_context_bytes", "interpreter_save",
    "system_has", "fabric_is_watched", "fabric_last_output", "core_free", "fabric_free", "interpreter_free",
})  # fmt: skip
#: Pointers in `struct shared`.
_POINTERS = ("sram", "flash")
_WORD = 8
#: So many equal bytes are a "fill".
_LEAST_FILL = 32
#: Where a "poke" has its bytes.
_BYTES_AT = 3


class Recording:
    """What was recorded: steps, and the sizes of the buffers."""

    def __init__(self) -> None:
        self.steps: list[Step] = []
        #: Bytes of each buffer of Python's.
        self.sizes: list[int] = []
        self._buffers: list[tuple[int, int, str]] = []
        self._seen: list[bytes] = []
        self._kept: list[object] = []
        self._functions: dict[int, str] = {}
        self._calls = 0

    # Memory.

    def add_buffer(self, at: int, size: int, kept: object) -> None:
        """Take a buffer of Python's, unless it is part of a known one."""
        if self._place(at) is None and size:
            self._kept.append(kept)
            self._buffers.append((at, size, f"b{len(self.sizes)}"))
            self.sizes.append(size)
            self._seen.append(bytes(size))

    def _place(self, at: int) -> str | None:
        for first, size, name in self._buffers:
            if first <= at < first + size:
                return f"{name}+{at - first}"
        return None

    def note_changes(self) -> None:
        """Record what has changed in memory since it was looked at last."""
        for number, (at, size, name) in enumerate(self._buffers):
            now = ctypes.string_at(at, size)
            if now != self._seen[number]:
                self._record_changes(name, self._seen[number], now)
                self._seen[number] = now

    def forget_changes(self) -> None:
        """Take what has changed since for C's own doing, which a replay does too."""
        self._seen = [ctypes.string_at(at, size) for at, size, _ in self._buffers]

    def _record_changes(self, name: str, before: bytes, now: bytes) -> None:
        for first, end in _changed(before, now):
            place = self._place(int.from_bytes(now[first:end], "little")) if end - first == _WORD else None
            if place is not None and name.startswith("r"):
                self.steps.append(["point", name, first, place])
                continue
            for start, stop in _runs(now, first, end):
                if stop - start >= _LEAST_FILL and len(set(now[start:stop])) == 1:
                    self.steps.append(["fill", name, start, stop - start, now[start]])
                else:
                    self.steps.append(["poke", name, start, now[start:stop].hex()])

    # Calls.

    def wrap(self, name: str, signature: str, function: Callable[..., Any]) -> Callable[..., Any]:
        """Return a function of the library that is recorded when it is called."""

        def call(*arguments: Any) -> Any:
            if name in _LEFT_OUT:
                return function(*arguments)
            self.note_changes()
            number = self._record(name, signature, arguments)
            result = function(*arguments)
            self.forget_changes()
            if signature[0] == "p" and result:
                size = ctypes.sizeof(structure(SHARED)) if name == "core_new" else 1
                self._buffers.append((result, size, f"r{number}"))
                self._seen.append(ctypes.string_at(result, size))
            return result

        call._as_parameter_ = ctypes.cast(function, ctypes.c_void_p)  # type: ignore[attr-defined, arg-type]  # for tables in C
        return call

    def _record(self, name: str, signature: str, arguments: tuple[Any, ...]) -> int:
        shown, taken = _REPLACED.get(name, (name, slice(None)))
        letters = signature[1:][taken]
        found = [
            self._pointer(name, argument) if letter in "ps" else int(argument)
            for letter, argument in zip(letters, arguments[taken], strict=True)
        ]
        self.steps.append(["call", shown, *found])
        self._calls += 1
        return self._calls - 1

    def _pointer(self, name: str, argument: Any) -> str:
        if isinstance(argument, bytes):
            return f"d{argument.hex()}00"
        if isinstance(argument, ctypes.Array | ctypes.Structure):
            return f"d{bytes(argument).hex()}"
        inner = getattr(argument, "_obj", None)
        if inner is not None and name.startswith("interpreter_"):
            return f"d{bytes(inner).hex()}"
        if inner is not None:
            self.add_buffer(ctypes.addressof(inner), ctypes.sizeof(inner), inner)
            self.note_changes()
        at = ctypes.cast(argument, ctypes.c_void_p).value if inner is not None else argument
        at = getattr(at, "value", at)
        if not at:
            return "n"
        place = self._place(at) or self._function(at)
        if place is None:
            raise ValueError(f"{name}: nobody knows what is at {at:#x}")
        return place

    def _function(self, at: int) -> str | None:
        if not self._functions:
            for function in FUNCTIONS:
                self._functions[emulator.address_of(function).value or 0] = f"f{function}"
        return self._functions.get(at, "f")  # a callback of Python's, which is taken back before the chip runs

    def leave_out_unused(self) -> None:
        """Forget buffers that no call got, such as tables of callbacks, and number the others anew."""
        used = {text.partition("+")[0] for step in self.steps for text in _pointers(step) if text[0] == "b"}
        numbers = {name: f"b{number}" for number, name in enumerate(sorted(used, key=lambda name: int(name[1:])))}
        self.sizes = [self.sizes[int(name[1:])] for name in numbers]
        self.steps = [
            [part if (step[0], n) == ("poke", _BYTES_AT) else _renamed(part, numbers) for n, part in enumerate(step)]
            for step in self.steps
            if step[0] == "call" or step[1][0] == "r" or step[1] in numbers
        ]


def _pointers(step: Step) -> list[str]:
    """Return the pointers that a step hands to C."""
    handed = step[2:] if step[0] == "call" else step[3:] if step[0] == "point" else []
    return [part for part in handed if isinstance(part, str)]


def _renamed(part: Any, numbers: dict[str, str]) -> Any:
    """Return a part of a step with its buffer's number."""
    if not isinstance(part, str):
        return part
    name, plus, offset = part.partition("+")
    return f"{numbers[name]}{plus}{offset}" if name in numbers else part


#: The functions of the library that Python hands to C by their addresses; `page_function` of `source/page.c` has them.
FUNCTIONS = (
    "core_on_known_block", "core_on_interrupt", "core_on_invalid", "core_on_bad_access", "core_on_tlb_fill",
    "core_read_io", "core_write_io",
)  # fmt: skip


def _changed(before: bytes, now: bytes) -> Iterator[tuple[int, int]]:
    """Yield where bytes have changed, in whole words."""
    first = None
    for at in range(0, len(now), _WORD):
        is_same = before[at : at + _WORD] == now[at : at + _WORD]
        if first is not None and is_same:
            yield first, at
            first = None
        elif first is None and not is_same:
            first = at
    if first is not None:
        yield first, len(now)


def _runs(data: bytes, first: int, end: int) -> Iterator[tuple[int, int]]:
    """Yield the parts of a stretch: of equal bytes where there are many, and what is between."""
    start = at = first
    while at < end:
        stop = at + 1
        while stop < end and data[stop] == data[at]:
            stop += 1
        if stop - at >= _LEAST_FILL:
            if start < at:
                yield start, at
            yield at, stop
            start = stop
        at = stop
    if start < end:
        yield start, end


@contextmanager
def recorded() -> Iterator[Recording]:
    """Record what is called of the library, and what is written to memory that it knows, meanwhile."""
    recording, found, address_of = Recording(), emulator.library(), ctypes.addressof
    functions = {name: getattr(found, name) for name in emulator.FUNCTION_TYPES}

    def addressof(thing: Any) -> int:
        at = address_of(thing)
        recording.add_buffer(at, ctypes.sizeof(thing), thing)
        return at

    try:
        ctypes.addressof = addressof
        for name, function in functions.items():
            setattr(found, name, recording.wrap(name, emulator.FUNCTION_TYPES[name], function))
        yield recording
        recording.note_changes()
        recording.leave_out_unused()
    finally:
        ctypes.addressof = address_of
        for name, function in functions.items():
            setattr(found, name, function)
