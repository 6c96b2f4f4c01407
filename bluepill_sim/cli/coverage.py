"""`p2os mcu coverage`: which lines and branches of a firmware ran."""

import json
from pathlib import Path
from typing import Annotated

import typer

from bluepill_sim.analysis.coverage import Coverage, FileCoverage
from bluepill_sim.analysis.lcov import write_lcov
from bluepill_sim.analysis.observation import Observation
from bluepill_sim.board import BluePill
from bluepill_sim.cli.columns import print_columns
from bluepill_sim.cli.driving import parse_changes, print_fault, print_status, run_driven, summary, warn_on_stderr
from bluepill_sim.cli.quantities import percent_option, time_option
from bluepill_sim.errors import BluePillError
from bluepill_sim.program.line_table import read_lines
from bluepill_sim.program.static_code import StaticCode
from bluepill_sim.timing import NS_PER_S, Nanos

HELP = """Show which lines and branches of a firmware run.

The ELF must have debug information (gcc -g). With --lcov the result is also
written as an lcov tracefile, which genhtml, editors and CI services read.

\b
Examples:
  p2os mcu coverage mine.elf --for 5s                     a summary by file
  p2os mcu coverage mine.elf --lcov mine.info             for genhtml mine.info -o html
  p2os mcu coverage mine.elf --drive PA6=1@3.5s --missed  the lines that nothing reached
  p2os mcu coverage mine.elf --fail-under 80              exit code 1 below 80 % of the lines
"""


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command("coverage", help=HELP)(coverage)


def coverage(
    firmware: Annotated[Path, typer.Argument(help="ELF with debug information.", metavar="FIRMWARE")],
    span_ns: Annotated[Nanos, time_option("--for", purpose="How much virtual time.", shown="1s")] = NS_PER_S,
    drive: Annotated[
        list[str] | None, typer.Option(help="Put a level on a pin at a time; repeatable.", metavar="PIN=LEVEL@TIME")
    ] = None,
    lcov: Annotated[Path | None, typer.Option(help="Write an lcov tracefile.", metavar="FILE")] = None,
    sources: Annotated[
        Path | None, typer.Option(help="Where relative names of source files start from.", metavar="FOLDER")
    ] = None,
    missed: Annotated[bool, typer.Option("--missed", help="Name the lines that did not run.")] = False,
    fail_under: Annotated[float, percent_option("--fail-under", purpose="Least share of lines.", shown="0%")] = 0.0,
    json_output: Annotated[bool, typer.Option("--json", help="Print one JSON object.")] = False,
) -> None:
    """Measure coverage."""
    board = BluePill(firmware)
    table = read_lines(board.image)
    if not table.rows:
        raise BluePillError(f"{firmware}: no debug information in it", hint="build with -g, and give the ELF itself")
    changes = parse_changes(drive or [], board)
    warn_on_stderr(board)
    listener = Coverage(board.image, table, StaticCode(board.chip.memory))
    with Observation(board, [listener]):
        run_driven(board, span_ns, changes)
    files = listener.files()
    if lcov is not None:
        write_lcov(files, lcov, sources=sources)
    if json_output:
        typer.echo(json.dumps([_facts(file) for file in files], sort_keys=True))
    else:
        _print(files, missed=missed)
    print_status(summary(board))
    has_died = print_fault(board)
    share = 100 * sum(f.lines_hit for f in files) / sum(len(f.lines) for f in files)
    if share < fail_under:
        print_status(f"coverage: {share:.1f} % of the lines are less than {fail_under:g} %")
    if has_died or share < fail_under:
        raise typer.Exit(1)


def _facts(file: FileCoverage) -> dict[str, object]:
    ways = file.ways
    return {
        "file": file.name,
        "lines": len(file.lines),
        "lines_hit": file.lines_hit,
        "branches": len(ways),
        "branches_hit": sum(1 for count in ways if count),
        "functions": len(file.functions),
        "functions_hit": sum(1 for _, _, calls in file.functions if calls),
        "missed_lines": file.missed_lines,
    }


def _print(files: list[FileCoverage], *, missed: bool) -> None:
    facts = [_facts(file) for file in files]
    pairs = (("lines_hit", "lines"), ("branches_hit", "branches"), ("functions_hit", "functions"))

    def row(name: str, counts: list[tuple[int, int]]) -> list[str]:
        cells = [name]
        for hit, whole in counts:
            cells += [f"{hit}/{whole}", f"{hit / whole:.1%}" if whole else ""]
        return cells

    rows = [
        row(_short(str(fact["file"])), [(int(str(fact[a])), int(str(fact[b]))) for a, b in pairs]) for fact in facts
    ]
    sums = [(sum(int(str(fact[a])) for fact in facts), sum(int(str(fact[b])) for fact in facts)) for a, b in pairs]
    print_columns(
        ("file", "lines", "", "branch ways", "", "functions", ""), [*rows, row("all", sums)], right=(1, 2, 3, 4, 5, 6)
    )
    if missed:
        for file in files:
            if file.missed_lines:
                typer.echo(f"{_short(file.name)}: {_ranges(file.missed_lines)}")


def _short(name: str) -> str:
    return name.rsplit("/", 1)[-1]


def _ranges(lines: list[int]) -> str:
    """Return "3-5, 9"."""
    found: list[list[int]] = []
    for line in lines:
        if found and line == found[-1][1] + 1:
            found[-1][1] = line
        else:
            found.append([line, line])
    return ", ".join(str(a) if a == b else f"{a}-{b}" for a, b in found)
