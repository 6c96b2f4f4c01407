"""`p2os mcu coverage`: which lines and branches of a firmware ran."""

import json
from pathlib import Path
from typing import Annotated

import typer

from bluepill_sim.analysis.coverage import Coverage, FileCoverage
from bluepill_sim.analysis.coverage_text import coverage_lines, refuse_without_lines, shortfall
from bluepill_sim.analysis.lcov import write_lcov
from bluepill_sim.analysis.observation import Observation
from bluepill_sim.board import BluePill
from bluepill_sim.cli.driving import parse_changes, print_fault, print_status, run_driven, summary, warn_on_stderr
from bluepill_sim.cli.quantities import Drive, JsonOutput, Span, option
from bluepill_sim.program.line_table import read_lines
from bluepill_sim.program.static_code import StaticCode
from simbase.timing import NS_PER_S
from simbase.units import PERCENT

HELP = """Show which lines and branches of a firmware run.

Compile with -Og -g: lines come from the ELF's debug information. Without it the
table is by function; without symbols, by address. --lcov also writes an lcov
tracefile for genhtml, editors and CI services.

\b
Examples:
  {program} coverage mine.elf --for 5s                     a summary by file
  {program} coverage mine.elf --lcov mine.info             for genhtml mine.info -o html
  {program} coverage mine.elf --drive PA6=1@3.5s --missed  code that did not run
  {program} coverage mine.elf --fail-under 80              exit code 1 below 80 % of the lines
"""


def coverage(
    firmware: Annotated[Path, typer.Argument(help="ELF with debug information.", metavar="FIRMWARE")],
    span_ns: Span = NS_PER_S,
    drive: Drive = None,
    lcov: Annotated[Path | None, typer.Option(help="Write an lcov tracefile.", metavar="FILE")] = None,
    sources: Annotated[
        Path | None, typer.Option(help="Where relative names of source files start from.", metavar="FOLDER")
    ] = None,
    missed: Annotated[
        bool, typer.Option("--missed", help="Name lines that did not run, and branches that went one way.")
    ] = False,
    fail_under: Annotated[
        float, option(PERCENT, "--fail-under", purpose="Least share of lines.", shown="0%", least="0%", most="100%")
    ] = 0.0,
    json_output: JsonOutput = False,
) -> None:
    """Measure coverage."""
    board = BluePill(firmware)
    listener = Coverage(board.image, read_lines(board.image), StaticCode(board.chip.memory))
    if lcov is not None or fail_under or json_output:
        refuse_without_lines(listener, firmware)
    changes = parse_changes(drive or [], board)
    warn_on_stderr(board)
    with Observation(board, [listener]):
        run_driven(board, span_ns, changes)
    files = listener.files()
    if lcov is not None:
        write_lcov(files, lcov, sources=sources)
    if json_output:
        typer.echo(json.dumps([_facts(file) for file in files], sort_keys=True))
    else:
        typer.echo("\n".join(coverage_lines(listener, missed=missed)))
    print_status(summary(board))
    has_died = print_fault(board)
    if (too_few := shortfall(listener, fail_under)) is not None:
        print_status(too_few)
    if has_died or too_few is not None:
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
        "one_way_branches": [
            {"line": line, "address": row.address, "taken": row.taken, "not_taken": row.not_taken}
            for line, row in file.one_way
        ],
    }
