"""Two boards with one firmware and different cores, from block boundary to block boundary, and where they differ first.

All that decides a board's future is compared behind each slice. Where it differs, both go back to the slice's start,
and the time from which they differ is halved until one block is left; then both run its instructions one by one. What
makes no difference any more by the end of its slice is not seen.
Invariant: until one is found, neither board runs otherwise than it would alone.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass

from bluepill_sim.board import BluePill
from bluepill_sim.core import Reg
from simbase.timing import NS_PER_MS, Nanos, Reason

#: chosen: a slice; what two cores differ in is found within one.
SLICE_NS = NS_PER_MS
#: chosen: instructions of one block that are run one by one, at most; the longest block of flash has half as many.
MOST_STEPS = 1024
#: Of a snapshot, what each core keeps in its own way; registers are compared by their names.
_OWN = {"_core"}

Boards = tuple[BluePill, BluePill]
#: What is done to a board from outside, and when; by time.
Acts = Sequence[tuple[Nanos, Callable[[BluePill], None]]]


@dataclass(frozen=True, slots=True, kw_only=True)
class CoreValue:
    """What differs: a register, or a value of the chip, on both."""

    name: str
    one: str
    other: str


@dataclass(frozen=True, slots=True, kw_only=True)
class CoreDifference:
    """The first place where two cores differ: before it, all was the same."""

    #: When it began, in virtual time and in cycles.
    at_ns: Nanos
    cycle: int
    address: int
    #: Whether it is one instruction; else it is one of a block, which run one by one do not differ.
    is_instruction: bool
    values: tuple[CoreValue, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class ComparedCores:
    """How far two cores were compared, and where they differ."""

    end_ns: Nanos
    cycles: int
    difference: CoreDifference | None = None
    #: Where they were compared by instruction: how many were, and how many could not be.
    instructions: int = 0
    passed_over: int = 0


def compare_boundaries(boards: Boards, end_ns: Nanos, acts: Acts = ()) -> ComparedCores:
    """Run two boards of one firmware, fresh ones, up to a time, and compare them at block boundaries.

    Args:
        boards: with different cores.
        end_ns: up to when, in ns of virtual time; a lockup that nothing ends does it before.
        acts: what happens to both from outside.
    """
    waiting = list(acts)
    difference, is_over = None, False
    while difference is None and not is_over and (now_ns := boards[0].now_ns) < end_ns:
        while waiting and waiting[0][0] <= now_ns:
            _, act = waiting.pop(0)
            for board in boards:
                act(board)
        states = _Saved(boards)
        limit_ns = min(now_ns + SLICE_NS, end_ns, *(at for at, _ in waiting[:1]))
        is_over = not _advance(boards, limit_ns) and not waiting
        if values_apart(boards):
            difference = _narrowed(boards, states, limit_ns)
    return ComparedCores(end_ns=boards[0].now_ns, cycles=boards[0].cycle, difference=difference)


def values_apart(boards: Boards) -> tuple[CoreValue, ...]:
    """Return what differs of two boards now, registers first."""
    names = [name.name for name in Reg if name not in {Reg.CPSR, Reg.PC}]
    rows = [(name, boards[0].register(name), boards[1].register(name)) for name in names]
    rows += [("PC", boards[0].pc, boards[1].pc), ("cycle", boards[0].cycle, boards[1].cycle)]
    found = [core_value(name, one, other) for name, one, other in rows if one != other]
    seen = [_flat(board) for board in boards]
    for name in seen[0] | seen[1]:
        values = [each.get(name) for each in seen]
        if values[0] != values[1]:
            found.append(core_value(name, *values))
    return tuple(found)


def core_value(name: str, one: object, other: object) -> CoreValue:
    """Return two values as a person reads them: of memory the first word that differs."""
    if isinstance(one, bytes) and isinstance(other, bytes) and len(one) == len(other):
        at = next(n for n in range(len(one)) if one[n] != other[n]) & ~3
        words = [int.from_bytes(memory[at : at + 4], "little") for memory in (one, other)]
        return CoreValue(name=f"{name}+{at:#x}", one=f"{words[0]:#010x}", other=f"{words[1]:#010x}")
    return CoreValue(name=name, one=_written(one, name), other=_written(other, name))


class _Saved:
    """Where two boards stood."""

    def __init__(self, boards: Boards) -> None:
        self._boards, self._states = boards, tuple(board.snapshot() for board in boards)

    def restore(self) -> None:
        for board, state in zip(self._boards, self._states, strict=True):
            board.restore(state)


def _advance(boards: Boards, limit_ns: Nanos) -> bool:
    """Run both up to a time; return whether either can go on."""
    goes_on = False
    for board in boards:
        reached = board.advance_to(limit_ns)
        while board.now_ns < limit_ns and reached.reason is not Reason.HALT:
            reached = board.advance_to(limit_ns)
        goes_on |= reached.reason is not Reason.HALT
    return goes_on


def _narrowed(boards: Boards, saved: _Saved, high_ns: Nanos) -> CoreDifference:
    """Return the first difference between a state that was the same and a time at which it is not."""
    saved.restore()
    low_ns = boards[0].now_ns
    while high_ns - low_ns > 1:
        middle_ns = (low_ns + high_ns) // 2
        saved.restore()
        _advance(boards, middle_ns)
        if values_apart(boards):
            high_ns = middle_ns
        else:
            low_ns, saved = middle_ns, _Saved(boards)
    saved.restore()
    board = boards[0]
    at_ns, cycle, address = board.now_ns, board.cycle, board.pc
    _advance(boards, high_ns)
    values, ends = values_apart(boards), [each.cycle for each in boards]
    saved.restore()
    for _ in range(MOST_STEPS):
        if all(each.cycle >= end for each, end in zip(boards, ends, strict=True)):
            break
        before = board.now_ns, board.cycle, board.pc
        for each in boards:
            each.step(each.now_ns + SLICE_NS)
        apart = values_apart(boards)
        if apart:
            return CoreDifference(
                at_ns=before[0], cycle=before[1], address=before[2], is_instruction=True, values=apart
            )  # fmt: skip
    return CoreDifference(at_ns=at_ns, cycle=cycle, address=address, is_instruction=False, values=values)


def _flat(board: BluePill) -> dict[str, object]:
    """Return the state of a chip by dotted names, but for what a core keeps in its own way."""
    return dict(_leaves(board.chip.snapshot(), "")) | {"warnings": board.warnings, "fault": str(board.fault)}


def _leaves(value: object, name: str) -> Iterator[tuple[str, object]]:
    if isinstance(value, Mapping):
        for key, part in value.items():
            if key not in _OWN:
                yield from _leaves(part, f"{name}.{key}" if name else str(key))
    else:
        yield name, value


def _written(value: object, name: str) -> str:
    return f"{value:#010x}" if isinstance(value, int) and name.isupper() else str(value)
