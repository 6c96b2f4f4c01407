"""`p2os mcu compare-silicon`: lays the log of a real chip beside the model."""

from collections import Counter
from pathlib import Path
from typing import Annotated

import typer

from bluepill_sim.analysis.silicon.comparison import ComparedNumber, NumberVerdict, ask_model, compare
from bluepill_sim.analysis.silicon.log import KINDS, MOST_BYTES, read_log
from simbase.files import read_bytes

HELP = """Compare a real STM32F103C8's log with the model.

LOG is the output of the silicon kit on USART1 (115200 8N1, PA9): flash
bluepill_sim/analysis/silicon/kit.elf, press reset, record. The kit erases the
last page of the flash. The model runs the same program.

Exit code: 0 all within the allowed limits (docs/silicon.md), 1 something is not.

\b
Examples:
  {program} compare-silicon board.log          differences, and a count of equal values
  {program} compare-silicon board.log --all    every number
"""


def compare_silicon(
    log: Annotated[Path, typer.Argument(help="What the kit has printed.", metavar="LOG")],
    show_all: Annotated[bool, typer.Option("--all", help="Show what is the same too.")] = False,
) -> None:
    """Compare a log."""
    chip = read_log(read_bytes(log, most=MOST_BYTES), log.name)
    rows = compare(chip, ask_model())
    for row in rows:
        if show_all or row.verdict is not NumberVerdict.SAME:
            typer.echo(line_of(row))
    for kind, what in {"reg": "registers before anything was changed", **KINDS}.items():
        found = Counter(row.verdict for row in rows if row.kind == kind)
        counts = ", ".join(f"{found[verdict]} {verdict.value}" for verdict in NumberVerdict if found[verdict])
        typer.echo(f"{kind:7} {what}: {counts or 'none'}")
    if any(row.verdict in {NumberVerdict.DIFFERS, NumberVerdict.MISSING} for row in rows):
        raise typer.Exit(1)


def line_of(row: ComparedNumber) -> str:
    """Return a number of both as a line: registers and flags in hex, cycles as numbers with their difference."""
    is_word = row.kind in {"reg", "flag"}
    chip, model = (_written(value, is_word=is_word) for value in (row.chip, row.model))
    apart = ""
    if not is_word and row.chip is not None and row.model:
        apart = f" {100 * (row.chip - row.model) / row.model:+.1f} %"
    reason = f": {row.reason}" if row.reason else ""
    return f"{row.kind:7} {row.name}  chip {chip}  model {model}{apart}  {row.verdict.value}{reason}"


def _written(value: int | None, *, is_word: bool) -> str:
    return "none" if value is None else f"{value:#010x}" if is_word else str(value)
