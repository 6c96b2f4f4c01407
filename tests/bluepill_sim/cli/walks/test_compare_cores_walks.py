"""Differences of cores as a person reads them: few values, as many as are shown, and more; as approved."""

import random
from collections.abc import Iterator
from unittest.mock import patch

from bluepill_sim.cli.comparisons import compare_cores
from bluepill_sim.debug.cores.comparison import ComparedCores, CoreDifference, CoreValue
from bluepill_sim.program.line_table import LineRow, LineTable
from tests.bluepill_sim.machine import FLASH, Machine
from tests.tools.suite.approved import Trace, judge_of

LINES = LineTable((LineRow(FLASH, FLASH + 0x134, "main.c", 3),))


def differences(_: random.Random) -> Iterator[str]:
    """Yield what is printed of differences, at instructions of both widths, undefined ones and none."""
    board = Machine("b start\nudf\n.half 0xF7FF, 0xFFFF", {}).board
    for at, is_instruction in ((0x130, True), (0x134, False), (0x136, True), (0x138, True), (0x140, False), (-4, True)):
        for count in (0, 1, 12, 13, 15):
            values = tuple(CoreValue(name=f"R{n}", one=f"{n}", other="0") for n in range(count))
            made = CoreDifference(
                at_ns=7 + count, cycle=9, address=FLASH + at, is_instruction=is_instruction, values=values
            )
            with patch.object(compare_cores, "read_lines", lambda _image: LINES):
                lines = compare_cores.lines_of(board, "python", made)
                heard = list[str]()
                with (
                    patch.object(compare_cores, "print_status", heard.append),
                    patch.object(compare_cores.typer, "echo", heard.append),
                ):
                    for core, difference in (("exact", made), ("own", made), ("exact", None), ("own", None)):
                        compared = ComparedCores(
                            end_ns=1_234_567, cycles=5, difference=difference, instructions=3, passed_over=1
                        )
                        compare_cores._print(board, core, compared)
            yield "\n".join([*lines, *heard[-8:]])


TRACES: dict[str, Trace] = {"differences": differences}
test_a_walk_shows_what_was_approved = judge_of(__file__, TRACES)
