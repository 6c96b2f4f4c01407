"""What several commands do alike: load a firmware, drive its pins by a list, run it.

Invariant: the same list gives the same run, whatever the slices.
"""

import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from bluepill_sim.board import BluePill
from bluepill_sim.durations import to_nanos
from bluepill_sim.errors import BluePillError
from bluepill_sim.timing import NS_PER_S, Nanos, Reached, Reason

_LEVELS = {"0": False, "1": True, "low": False, "high": True, "z": None}
_HINT = "PIN=LEVEL@TIME with a level of 0, 1 or z, such as PA6=1@3.5s"


@dataclass(frozen=True, slots=True, order=True)
class Change:
    """A level put on a pin from outside, at a time."""

    at_ns: Nanos
    pin: str
    level: bool | None


def parse_changes(texts: Sequence[str], board: BluePill) -> list[Change]:
    """Return what `--drive` asks for, by time.

    Raises:
        BluePillError: one is not understood, or names a pin that has no leg.
    """
    changes = []
    for text in texts:
        name, _, rest = text.partition("=")
        level, _, at = rest.partition("@")
        if level.lower() not in _LEVELS:
            raise BluePillError(f"--drive {text!r} is not understood", hint=_HINT)
        try:
            is_bonded = board.pin(name.upper()).is_bonded
        except KeyError:
            is_bonded = False
        if not is_bonded:
            raise BluePillError(f"--drive {text!r}: the chip has no leg {name.upper()}", hint=_HINT)
        changes.append(Change(to_nanos(at) if at else 0, name.upper(), _LEVELS[level.lower()]))
    return sorted(changes, key=lambda change: change.at_ns)


def run_driven(
    board: BluePill, end_ns: Nanos, changes: Sequence[Change], advance: Callable[[Nanos], Reached] | None = None
) -> Reached:
    """Run to a time and put the changes on the pins at theirs; a halt for good ends it."""
    advance = advance or board.advance_to
    for change in (*changes, None):
        limit = end_ns if change is None else min(change.at_ns, end_ns)
        while board.now_ns < limit:
            reached = advance(limit)
            if reached.reason is Reason.HALT:
                return reached
        if change is not None and change.at_ns <= end_ns:
            board.pin(change.pin).drive(change.level)
    return Reached(board.now_ns)


def say(line: str) -> None:
    """Tell a person something that is not the result."""
    sys.stderr.write(f"{line}\n")
    sys.stderr.flush()


def warn_on_stderr(board: BluePill) -> None:
    """Have each warning told as it comes."""
    board.on_warning = lambda text: say(f"warning: {text} (t = {board.now_ns / NS_PER_S:.6f} s)")


def summary(board: BluePill) -> str:
    """Return where a run has come to, in one line."""
    doing = "asleep at" if board.is_asleep else "at"
    count = len(board.warnings)
    warned = f", {count} warning{'s' if count != 1 else ''}" if count else ""
    return f"{board.now_ns / NS_PER_S:.6f} s of virtual time, {board.cycle} cycles, {doing} {board.where()}{warned}"


def tell_fault(board: BluePill) -> bool:
    """Tell of a fault, if there is one, with the registers; return whether there is."""
    if board.fault is None:
        return False
    say(f"fault: {board.fault}")
    for line in board.fault.register_dump.splitlines():
        say(f"  {line}")
    return True
