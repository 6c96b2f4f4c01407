"""`p2os mcu compare-cores`: runs a firmware on two cores and says where they differ first."""

import json
from collections.abc import Sequence
from dataclasses import asdict
from enum import Enum
from functools import partial
from typing import Annotated

import typer

from bluepill_sim.board import BluePill
from bluepill_sim.cli.driving import PinChange, parse_changes, print_status
from bluepill_sim.cli.quantities import Drive, Firmware, JsonOutput, time_option
from bluepill_sim.debug.cores.comparison import Acts, ComparedCores, CoreDifference, compare_boundaries
from bluepill_sim.debug.cores.judge import compare_instructions
from bluepill_sim.extension.encodings import FIRST_WIDE, find
from bluepill_sim.extension.library import core_chosen
from bluepill_sim.program.image import Image
from bluepill_sim.program.line_table import read_lines
from simbase.timing import NS_PER_MS, NS_PER_S, Nanos

HELP = """Run a firmware on two cores and show the first difference.

own and python are compared with the default core (Unicorn, native) at each
block: registers, memories, peripherals, cycles. With exact, Unicorn judges each
instruction, taking over the exact core's exceptions and peripheral accesses, at
some ten thousand instructions a second.

Exit code: 0 no difference, 1 a difference.

\b
Examples:
  {program} compare-cores mine.elf                       a second on the project's interpreter
  {program} compare-cores mine.elf --drive PA0=1@3ms     with an input
  {program} compare-cores mine.elf --core exact --for 5ms
"""

#: chosen: what takes a second or a few, by core.
_SPANS = {"own": NS_PER_S, "python": 100 * NS_PER_MS, "exact": 2 * NS_PER_MS}
#: Values that are printed; the others are counted.
_MOST_VALUES = 12


class ComparedCore(Enum):
    """What is held against Unicorn."""

    OWN = "own"
    EXACT = "exact"
    PYTHON = "python"


def compare_cores(
    firmware: Firmware,
    core: Annotated[ComparedCore, typer.Option(help="Which core.", metavar="own|exact|python")] = ComparedCore.OWN,
    span_ns: Annotated[
        Nanos | None, time_option("--for", purpose="How much virtual time.", shown="1s; exact 2ms; python 100ms")
    ] = None,
    drive: Drive = None,
    json_output: JsonOutput = False,
) -> None:
    """Compare two cores."""
    board = _board(firmware, core.value)
    changes = parse_changes(drive or [], board)
    end_ns = _SPANS[core.value] if span_ns is None else span_ns
    if core is ComparedCore.EXACT:
        compared = compare_instructions(board, end_ns, _acts(changes))
    else:
        compared = compare_boundaries((board, _board(board.image, "native")), end_ns, _acts(changes))
    if json_output:
        typer.echo(json.dumps({"core": core.value, **asdict(compared)}))
    else:
        _print(board, core.value, compared)
    if compared.difference is not None:
        raise typer.Exit(1)


def _board(firmware: "Firmware | Image", core: str) -> BluePill:
    with core_chosen(core):
        return BluePill(firmware)


def _acts(changes: Sequence[PinChange]) -> Acts:
    return [(change.at_ns, partial(_act, change)) for change in changes]


def _act(change: PinChange, board: BluePill) -> None:
    change.act(board)


def _print(board: BluePill, core: str, compared: ComparedCores) -> None:
    judged = f", {compared.instructions} instructions judged, {compared.passed_over} not" * (core == "exact")
    span = f"{compared.end_ns / NS_PER_S:.6f} s of virtual time, {compared.cycles} cycles{judged}"
    if compared.difference is None:
        typer.echo(f"{core} and unicorn: the same over {span}")
        return
    for line in lines_of(board, core, compared.difference):
        typer.echo(line)
    print_status(f"the same before it: {span}")


def lines_of(board: BluePill, core: str, difference: CoreDifference) -> list[str]:
    """Return a difference for a person: where, when, the instruction, and the values of both cores."""
    address = difference.address
    place = read_lines(board.image).place(address)
    what = "at" if difference.is_instruction else "in the block at"
    lines = [
        f"{core} and unicorn differ {what} {board.image.symbols.where(address)}{' ' * bool(place)}{place}",
        f"  cycle {difference.cycle}, {difference.at_ns / NS_PER_S:.9f} s: {_instruction(board, address)}",
    ]
    shown = difference.values[:_MOST_VALUES]
    width = max((len(value.name) for value in shown), default=0)
    lines += [f"  {value.name:<{width}}  {core} {value.one}  unicorn {value.other}" for value in shown]
    if len(difference.values) > len(shown):
        lines.append(f"  and {len(difference.values) - len(shown)} more (--json has all)")
    return lines


def _instruction(board: BluePill, address: int) -> str:
    """Return an instruction's bytes, and what it is by the table of encodings."""
    first, second = (int.from_bytes(board.read_memory(address + at, 2) or b"", "little") for at in (0, 2))
    is_wide = first >= FIRST_WIDE
    word = first << 16 | second if is_wide else first
    row = find(word, is_wide=is_wide)
    return f"{first:04x}{f' {second:04x}' if is_wide else ''}  {row.written(word) if row else 'undefined'}"
