"""Every figure that a board and its parts hold: out of reset, after a while, and after a reset, as approved."""

import random
from collections.abc import Iterator
from enum import Enum

from bluepill_sim.extension.library import core_chosen
from tests.bluepill_sim.board.walks.test_board_walks import SPEAKS
from tests.bluepill_sim.machine import Machine
from tests.tools.suite.approved import Trace, judge_of, said

#: A number above it is an address of the host's.
ADDRESS = 1 << 40


def held(thing: object, name: str, seen: set[int]) -> Iterator[str]:
    """Yield each figure that an object of the emulator holds, and what the objects in it hold."""
    if id(thing) in seen:
        return
    seen.add(id(thing))
    for key, value in sorted(getattr(thing, "__dict__", {}).items()):
        place = f"{name}.{key}"
        if isinstance(value, bool | int | float | str | Enum | None):
            is_address = isinstance(value, int) and not isinstance(value, Enum) and value > ADDRESS
            yield f"{place}={'address' if is_address else said(value)}"
        elif isinstance(value, dict | list | tuple):
            parts = list(value.items() if isinstance(value, dict) else enumerate(value))
            yield f"{place} has {len(parts)}"
            for number, part in parts:
                if type(part).__module__.startswith("bluepill_sim"):
                    yield from held(part, f"{place}[{said(number)}]", seen)
        elif type(value).__module__.startswith("bluepill_sim"):
            yield from held(value, place, seen)


def figures(_draw: random.Random) -> Iterator[str]:
    """Yield all figures that a board holds out of reset, and each that is otherwise after a while and a reset."""
    for core in ("native", "python", "exact"):
        with core_chosen(core):
            board = Machine(SPEAKS, {}).deafen().board
        before = list(held(board, core, set()))
        yield "\n".join(before)
        for act in (lambda board=board: board.run_for("700 us"), board.reset):
            act()
            now = list(held(board, core, set()))
            yield "\n".join(line for line in now if line not in {*before})
            before = now


TRACES: dict[str, Trace] = {"figures": figures}
test_a_walk_shows_what_was_approved = judge_of(__file__, TRACES)
