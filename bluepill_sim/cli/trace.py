"""`p2os mcu trace`: what a firmware executes, block by block or call by call."""

import json
import sys
from contextlib import ExitStack
from pathlib import Path
from typing import Annotated, TextIO

import typer

from bluepill_sim.board import BluePill
from bluepill_sim.cli.driving import parse_changes, print_fault, print_status, run_driven, summary, warn_on_stderr
from bluepill_sim.cli.quantities import Drive, Firmware, time_option
from bluepill_sim.core import BlockRecorder
from bluepill_sim.program.functions import FunctionTable
from bluepill_sim.program.last_blocks import lines_of
from bluepill_sim.program.line_table import read_lines
from simbase.files import open_to_write_text
from simbase.timing import NS_PER_MS, Nanos

HELP = """Trace the instructions that a firmware executes.

Each line is a basic block, or an exception's entry or return, with cycle,
symbol and source line. --calls prints only changes of function. A loop to
itself is one line.

\b
Examples:
  {program} trace mine.elf --for 1ms                    on the screen
  {program} trace mine.elf --from 2s --for 1ms          the millisecond after two seconds
  {program} trace mine.elf --for 10ms --out trace.txt   into a file
  {program} trace mine.elf --for 1ms --json             a JSON object a line
"""

_CAPACITY = 1 << 12


def trace(
    firmware: Firmware,
    span_ns: Annotated[Nanos, time_option("--for", purpose="How long it is traced.", shown="1ms")] = NS_PER_MS,
    begin_ns: Annotated[Nanos, time_option("--from", purpose="When the trace begins.", shown="0s")] = 0,
    drive: Drive = None,
    out: Annotated[Path | None, typer.Option(help="Write to a file.", metavar="FILE")] = None,
    calls: Annotated[bool, typer.Option("--calls", help="Only where another function begins.")] = False,
    json_output: Annotated[bool, typer.Option("--json", help="A JSON object a line.")] = False,
) -> None:
    """Trace the execution."""
    board = BluePill(firmware)
    table = read_lines(board.image)
    functions = FunctionTable(board.image)
    changes = parse_changes(drive or [], board)
    warn_on_stderr(board)
    end_ns = begin_ns + span_ns
    run_driven(board, begin_ns, [change for change in changes if change.at_ns < begin_ns])
    count, last = 0, ""
    with ExitStack() as stack:
        stream: TextIO = sys.stdout if out is None else stack.enter_context(open_to_write_text(out))

        def write(recorder: BlockRecorder) -> None:
            nonlocal count, last
            for row in recorder.drain():
                name = functions.name(row[1]) if not row[2] else ""
                if calls and name == last:
                    continue
                last = name
                count += 1
                if json_output:
                    fields = {"cycle": row[0], "address": row[1], "kind": row[2], "function": name}
                    stream.write(json.dumps(fields | {"line": table.place(row[1])}) + "\n")
                else:
                    stream.write(lines_of([row], board.image.symbols, table)[0] + "\n")

        recorder = board.chip.record_blocks(_CAPACITY, write)
        run_driven(board, end_ns, [change for change in changes if change.at_ns >= begin_ns])
        write(recorder)
    print_status(f"{count} lines; {summary(board)}")
    if print_fault(board):
        raise typer.Exit(1)
