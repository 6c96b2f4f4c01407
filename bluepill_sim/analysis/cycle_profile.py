"""Where a firmware spends its cycles: by function, alone and with what it calls.

Theory of operation. BL and BLX open a frame that remembers where the call
comes back to; a block that begins there closes it. A jump from one function
into another without a link is a tail call: the frame changes its name. An
exception opens a stack of its own, which also pays for its entry and exit.
Sleep is kept apart: the block of a WFI or WFE costs a cycle an instruction, and
the rest of its time is "(asleep)".

An operating system that switches stacks makes a thread come back on another
one's frames; where that shows, the stack begins anew. Inclusive cycles of a
recursive function count each cycle once.

Invariant: the exclusive cycles of all functions add up to the time that was watched.
"""

from collections import Counter
from dataclasses import dataclass, field

from bluepill_sim.core.nvic import exception_name
from bluepill_sim.core.processor import ENTRY_CYCLES, EXIT_CYCLES
from bluepill_sim.extension.encodings import Kind
from bluepill_sim.program.functions import FunctionTable
from bluepill_sim.program.static_code import StaticBlock, StaticCode

ASLEEP = "(asleep)"
_SLEEPS = frozenset({Kind.WAIT_INTERRUPT, Kind.WAIT_EVENT})
_LONGEST_EXCEPTION_CYCLES = max(ENTRY_CYCLES, EXIT_CYCLES)
#: chosen: deeper than any stack of 20 KiB allows.
_DEEPEST = 512


@dataclass(slots=True)
class FunctionCost:
    """What one function costs."""

    name: str
    calls: int = 0
    exclusive_cycles: int = 0
    inclusive_cycles: int = 0


@dataclass(slots=True)
class _Frame:
    name: str
    #: Where the call comes back to; None where nothing called it.
    comes_back_to: int | None


@dataclass(slots=True)
class _Stack:
    """Frames of one thread of execution, and what its last block announced."""

    root: tuple[str, ...]
    frames: list[_Frame] = field(default_factory=list)
    called_from: int | None = None
    #: Names of root and frames; None when the frames have changed since.
    known_names: tuple[str, ...] | None = None

    @property
    def names(self) -> tuple[str, ...]:
        if self.known_names is None:
            self.known_names = (*self.root, *(frame.name for frame in self.frames))
        return self.known_names


class CycleProfile:
    """Adds up cycles; a `BlockListener`."""

    def __init__(self, functions: FunctionTable, code: StaticCode) -> None:
        self._functions = functions
        self._code = code
        #: By where a block begins: its function's name, whether it is that one's first, and what stands there.
        self._places: dict[int, tuple[str, bool, StaticBlock]] = {}
        self._stacks = [_Stack(())]
        #: The cycle at which what was charged ends; None before the first block.
        self._end: int | None = None
        #: Who pays for what passes until the next block.
        self._gap_names: tuple[str, ...] = ()
        #: Cycles by the names of the frames, outermost first.
        self.stacks: Counter[tuple[str, ...]] = Counter()
        self.calls: Counter[str] = Counter()

    # As a `BlockListener`.

    def block(self, address: int, following: int | None, cycle: int, cycles: int) -> None:
        """Charge a block to the function that it is in."""
        self._charge_gap(cycle)
        self._end = cycle + cycles
        stack = self._stacks[-1]
        place = self._places.get(address) or self._look_at(address)
        self._arrive(stack, address, place[0], is_entry=place[1])
        block = place[2]
        if block.last.kind in _SLEEPS and not block.ends_before(following):
            awake = min(cycles, len(block.addresses))
            self.stacks[*stack.names, ASLEEP] += cycles - awake
            cycles = awake
        self.stacks[stack.names] += cycles
        is_call = block.is_call and following != block.end and not block.ends_before(following)
        stack.called_from = block.end if is_call else None

    def enter(self, number: int, cycle: int) -> None:
        """Open the stack of an exception."""
        self._charge_gap(cycle)
        below = self._stacks[-1].names if len(self._stacks) > 1 else ()
        self._stacks.append(_Stack((*below, f"<{exception_name(number)}>")))
        self._end, self._gap_names = cycle, self._stacks[-1].root

    def leave(self, cycle: int) -> None:
        """Close it."""
        self._end = cycle
        if len(self._stacks) > 1:
            self._gap_names = self._stacks.pop().root

    def reset(self, cycle: int) -> None:
        """Begin anew on an empty stack; what was charged stays."""
        self._charge_gap(cycle)
        self._stacks = [_Stack(())]
        self._end, self._gap_names = cycle, ()

    # The result.

    @property
    def total_cycles(self) -> int:
        """All cycles that were watched, sleep included."""
        return sum(self.stacks.values())

    def functions(self) -> list[FunctionCost]:
        """Return what each function costs, the costliest first."""
        found: dict[str, FunctionCost] = {}
        for names, cycles in self.stacks.items():
            if not names:
                continue
            found.setdefault(names[-1], FunctionCost(names[-1])).exclusive_cycles += cycles
            for name in set(names):
                found.setdefault(name, FunctionCost(name)).inclusive_cycles += cycles
        for name, calls in self.calls.items():
            found.setdefault(name, FunctionCost(name)).calls = calls
        shown = [cost for cost in found.values() if not cost.name.startswith("<")]
        return sorted(shown, key=lambda cost: (-cost.exclusive_cycles, cost.name))

    def folded(self) -> list[str]:
        """Return the stacks one a line, `a;b;c CYCLES`, as flame graph programs take them."""
        return [f"{';'.join(names)} {cycles}" for names, cycles in sorted(self.stacks.items()) if cycles and names]

    def _charge_gap(self, cycle: int) -> None:
        """Charge entry and exit of an exception to it; what is longer was sleep (SLEEPONEXIT)."""
        if self._end is not None and cycle > self._end:
            awake = min(cycle - self._end, _LONGEST_EXCEPTION_CYCLES)
            self.stacks[self._gap_names] += awake
            self.stacks[ASLEEP,] += cycle - self._end - awake

    def _look_at(self, address: int) -> tuple[str, bool, StaticBlock]:
        is_entry = self._functions.start_of(address) == address
        place = self._places[address] = self._functions.name(address), is_entry, self._code.block(address)
        return place

    def _arrive(self, stack: _Stack, address: int, name: str, *, is_entry: bool) -> None:
        """Bring the frames to the function that a block is in."""
        if stack.called_from is not None and len(stack.frames) < _DEEPEST:
            stack.frames.append(_Frame(name, stack.called_from))
            stack.known_names = None
            self.calls[name] += 1
            return
        for depth in range(len(stack.frames) - 1, -1, -1):
            frame = stack.frames[depth]
            if frame.comes_back_to == address and (depth == 0 or stack.frames[depth - 1].name == name):
                del stack.frames[depth:]
                stack.known_names = None
                break
        if not stack.frames:
            stack.known_names = None
            stack.frames.append(_Frame(name, None))
            self.calls[name] += is_entry
        elif stack.frames[-1].name != name:
            stack.known_names = None
            if is_entry:  # a tail call: what it returns to stays
                stack.frames[-1].name = name
                self.calls[name] += 1
            else:  # another thread's
                stack.frames = [_Frame(name, None)]
