"""`p2os diff`: where two runs of one scenario part, by signal."""

from dataclasses import replace
from pathlib import Path
from typing import Annotated

import typer

from p2os.cli.groups import BENCH
from robot_bench.events.kinds import Event
from robot_bench.events.words import distinguishing_words, last_words, what_of
from robot_bench.recording.divergence import differences
from robot_bench.recording.together import named_events
from simbase.timing import NS_PER_S

#: chosen: so many signals are listed, the first that part.
MOST_SIGNALS = 8
HELP = """Compare two runs and show each signal's first difference.

With several robots, each difference names its robot.

Exit code: 0 they are alike, 1 they differ.

\b
Examples:
  p2os diff runs/dodge-001 runs/dodge-002     first differences, times, and events before them
"""


def register(app: typer.Typer) -> None:
    """Add the verb."""
    app.command("diff", help=HELP, rich_help_panel=BENCH)(diff)


def diff(
    one: Annotated[Path, typer.Argument(help="A run folder.", metavar="RUN")],
    other: Annotated[Path, typer.Argument(help="Another one.", metavar="RUN")],
) -> None:
    """Compare two runs."""
    ours, theirs = list(named_events(one)), list(named_events(other))
    found = sorted(
        (replace(part, signal=f"{robot}: {part.signal}") if robot else part
         for robot in {robot: None for robot, _ in (*ours, *theirs)}
         for part in differences(*([event for name, event in run if name == robot] for run in (ours, theirs)))),
        key=lambda part: (part.at, part.signal),
    )  # fmt: skip
    if not found:
        typer.echo(f"alike: {len(ours)} events")
        return
    first = found[0]
    typer.echo(f"alike until {first.at / NS_PER_S:.6f} s; {first.signal} differs first")
    for line in last_words((event for _, event in ours if event.t < first.at), 4):
        typer.echo(f"   {line}")
    for difference in found[:MOST_SIGNALS]:
        typer.echo(f"{difference.signal}:")
        for folder, reported in zip((one, other), _reported(difference.one, difference.other), strict=True):
            typer.echo(f"   {reported}   {folder.name}")
    if len(found) > MOST_SIGNALS:
        typer.echo(f"and {len(found) - MOST_SIGNALS} more signals, later")
    raise typer.Exit(1)


def _reported(one: Event | None, other: Event | None) -> tuple[str, str]:
    """Return two events that differ, each with its time, so that it is seen in what."""
    words, others = distinguishing_words(one, other) if one is not None and other is not None else ("", "")
    return _at(one, words), _at(other, others)


def _at(event: Event | None, words: str) -> str:
    return "nothing more" if event is None else f"{event.t} ns  {words or what_of(event)}"
