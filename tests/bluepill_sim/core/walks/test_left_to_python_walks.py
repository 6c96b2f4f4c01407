"""What C leaves to Python while programs run, as approved: each call with its numbers, and what C keeps of the core.

An access that C could answer and does not is as right as one that it answers, and a hundred times as slow.
"""

import random
import zlib
from collections import Counter
from collections.abc import Iterator
from functools import cache, partial
from unittest.mock import patch

from bluepill_sim import BluePill
from bluepill_sim.extension.layout import SHARED
from bluepill_sim.extension.library import core_chosen
from bluepill_sim.native.engine import NativeEngine
from bluepill_sim.program.image import Image
from tests.bluepill_sim.core.walks.counted_calls import counted_calls
from tests.bluepill_sim.core.walks.programs import assembled
from tests.bluepill_sim.core.walks.test_program_walks import PROGRAMS, image, lines_of
from tests.tools.suite.approved import judge_of

#: Programs of all kinds, and how many there are that make accesses alone.
COUNTED, OF_ACCESSES = range(0, PROGRAMS, 2), 14
#: What C calls Python for where the numbers matter: an access, a trap, an event, each at its time.
_NOTED = frozenset({
    "read", "write", "trapped", "bad_access", "write_at_once", "unknown_block", "event", "bus", "code_written",
})  # fmt: skip
#: What the host decides, or is shown itself.
_OF_THE_HOST = frozenset({"sram", "flash", "scratch", "fault", "last"})


@cache
def _accesses() -> tuple[Image, list[tuple[int, int]]]:
    return assembled(OF_ACCESSES, "accesses", makes_accesses=True)


def _shared(board: BluePill) -> str:
    """Return a checksum of all that C keeps of the core, but addresses of the host."""
    shared = board.chip.processor.shared
    values = (getattr(shared, one.name) for one in SHARED.fields if one.name not in _OF_THE_HOST)
    return f"{zlib.crc32(str([each if isinstance(each, int) else bytes(each) for each in values]).encode()):x}"


def _asked(core: str, _: random.Random, *, makes_accesses: bool = False) -> Iterator[str]:
    """Yield how often C calls Python, by what for, while programs run; rows of blocks, and the last access at its time.

    What it can answer itself it does; of a loop that waits it writes the last rows alone, however long it goes round.
    Of accesses and traps it is noted which they are, when, and by which instruction; and how often a run came back.
    """
    programs, places = _accesses() if makes_accesses else image()
    counts, notes, go_on = Counter[str](), list[str](), NativeEngine.go_on

    def run(engine: NativeEngine, limit: int) -> object:
        counts["run"] += 1
        return go_on(engine, limit)

    def note(name: str, arguments: tuple[int, ...]) -> None:
        if name in _NOTED:
            shared = board.chip.processor.shared
            at = f"{shared.access_cycle}/{shared.access_pc:x}" if shared.in_access else shared.cycle
            notes.append(f"{name} {' '.join(f'{each or 0:x}' for each in arguments)} @{at}")

    with counted_calls(counts, note), core_chosen(core):
        board = BluePill(programs)
    notes.clear()
    fresh = board.snapshot()
    assert isinstance(board.chip.engine, NativeEngine)
    with patch.object(NativeEngine, "go_on", run):
        for number in range(OF_ACCESSES) if makes_accesses else COUNTED:
            board.restore(fresh)
            lines = [f"program {number}"]
            for line in lines_of(board, number, *places[number], is_exact=False):
                shared = board.chip.engine.shared
                accesses = f"{shared.access_cycle} {shared.access_pc:x} {shared.exact_stops}"
                shown = f"{zlib.crc32(line.encode()):x} {_shared(board)}"
                lines.append(f"{shown} {shared.logged} {accesses} {sorted(counts.items())} {notes}")
                counts.clear()
                notes.clear()
            yield "\n".join(lines)


TRACES = {
    f"{core} {name}": partial(_asked, core, makes_accesses=name == "accesses")
    for core in ("native", "own") for name in ("asked", "accesses")
}  # fmt: skip
test_a_walk_shows_what_was_approved = judge_of(__file__, TRACES)
