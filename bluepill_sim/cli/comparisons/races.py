"""`p2os mcu races`: whether what a firmware puts out hangs on a few cycles of its interrupts' latency."""

import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Annotated

import typer

from bluepill_sim.analysis.interrupts.races import InterruptOrder, Race, RaceReport, RaceSearch
from bluepill_sim.board import BluePill
from bluepill_sim.cli.driving import Schedule, parse_changes, parse_texts, print_fault, print_status
from bluepill_sim.cli.quantities import Drive, Firmware, Span
from bluepill_sim.extension.library import CORE_VARIABLE
from bluepill_sim.native.interrupt_latency import MOST_CYCLES
from bluepill_sim.program.image import load_image
from simbase.timing import NS_PER_MS, NS_PER_S, Nanos

HELP = """Search a firmware for races with its interrupts.

It runs the firmware unchanged, then with each interrupt delayed by a random 0 to
12 cycles. If pins or characters differ in number, value or order, the program
*depends*: both orders of interrupt and instruction are shown, with their output.
Times alone are not compared. The order silicon takes is not known, so this is no
fault; a program without races does not depend. The core is P2OS_CORE=exact. See
docs/debugging.md.

Exit code: 0 it does not depend, 1 it does.

\b
Examples:
  {program} races mine.elf                            twenty runs of one second
  {program} races mine.elf --for 5s --runs 100        more and longer runs
  {program} races mine.elf --drive PA6=1@500ms        with an input
  {program} races grbl.elf --send '$X\\nG1X1F99\\n@1s'   with input on USART1
"""
#: chosen: as many as can be awaited for a program that sleeps most of the time.
_RUNS = 20
#: Of EXC_RETURN: the interrupt came as another handler was left.
_FIRST_RETURN = 0xFFFF_FFE0


def races(
    firmware: Firmware,
    span_ns: Span = NS_PER_S,
    runs: Annotated[
        int, typer.Option("--runs", min=1, max=100_000, metavar="N", help="How many latencies are drawn.")
    ] = _RUNS,
    most: Annotated[
        int, typer.Option("--cycles", min=1, max=1000, metavar="N", help="By how many cycles an interrupt may be late.")
    ] = MOST_CYCLES,
    seed: Annotated[
        int, typer.Option("--seed", min=0, max=2**32, metavar="SEED", help="Of the first run; the others count on.")
    ] = 0,
    drive: Drive = None,
    send: Annotated[
        list[str] | None,
        typer.Option(
            help=r"Send text to USART1 at a time, \n and \r for its line ends; repeatable.", metavar="TEXT@TIME"
        ),
    ] = None,
) -> None:
    """Look for races."""
    image = load_image(firmware)
    with _exact_core():
        first = BluePill(image)
        changes, texts = parse_changes(drive or [], first), parse_texts(send or [])
        boards: list[BluePill] = []

        def play(board: BluePill) -> Callable[[Nanos], object]:
            boards.append(board)
            del boards[1:]
            return Schedule(board, changes, texts=texts).run_to

        report = RaceSearch(image, span_ns, play, most=most).search(range(seed, seed + runs))
    print_fault(boards[0])
    for number, race in enumerate(report.races, 1):
        for line in lines_of(number, race, report):
            typer.echo(line)
    print_status(
        f"{report.runs} runs of {span_ns / NS_PER_S:g} s, {report.interrupts} interrupts in each, "
        f"at most {report.stretch_ns / 1000:g} us of handlers in one go"
    )
    if not report.differing:
        typer.echo("it puts out the same, whatever the latency")
        return
    undecided = "" if report.races else "; no single interrupt of the last few before that decides it"
    typer.echo(f"depends: {report.differing} of {report.runs} runs put out something else{undecided}")
    raise typer.Exit(1)


def lines_of(number: int, race: Race, report: RaceReport) -> list[str]:
    """Return a race as a person reads it."""
    parting, late = race.parting, race.latencies
    against = _place(race.before, report)
    what = f"{parting.channel} and {parting.other}" if parting.other else parting.channel
    return [
        f"{number}. {race.name} against {against}: {what} from {parting.at / NS_PER_MS:.6f} ms on",
        *_order("before it", race.before, report),
        *_order("behind it", race.behind, report),
        f"   by latencies of seed {late.seed} up to interrupt {late.until}; that one is late by {late.last} (cycles)",
    ]


def _order(where: str, order: InterruptOrder, report: RaceReport) -> list[str]:
    return [
        f"   {where}, at cycle {order.cycle}, before {_place(order, report)}",
        *(f"     {text}" for text in order.puts_out or ("nothing more",)),
    ]


def _place(order: InterruptOrder, report: RaceReport) -> str:
    return "the return of another handler" if order.address >= _FIRST_RETURN else report.place(order.address)


@contextmanager
def _exact_core() -> Iterator[None]:
    """Choose the core for a block, where nobody has chosen another one."""
    if os.environ.get(CORE_VARIABLE):
        yield
        return
    os.environ[CORE_VARIABLE] = "exact"
    try:
        yield
    finally:
        del os.environ[CORE_VARIABLE]
