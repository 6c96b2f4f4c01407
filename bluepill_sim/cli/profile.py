"""`p2os mcu profile`: where a firmware spends its cycles, its stack, and how long interrupts wait."""

import json
from pathlib import Path
from typing import Annotated

import typer

from bluepill_sim.analysis.cycle_profile import CycleProfile, FunctionCost
from bluepill_sim.analysis.flame_graph import flame_svg
from bluepill_sim.analysis.interrupts.latency import ExceptionCost, LatencyProbe
from bluepill_sim.analysis.observation import Observation
from bluepill_sim.analysis.profile_text import exception_lines, function_lines
from bluepill_sim.analysis.stack import StackGauge
from bluepill_sim.board import BluePill
from bluepill_sim.cli.driving import parse_changes, print_fault, print_status, run_driven, summary, warn_on_stderr
from bluepill_sim.cli.quantities import Drive, Firmware, JsonOutput, Span
from bluepill_sim.core.nvic import exception_name
from bluepill_sim.program.functions import FunctionTable
from bluepill_sim.program.static_code import StaticCode
from simbase.files import write_text
from simbase.timing import NS_PER_S

HELP = """Profile a firmware: show where its cycles go.

By function: calls, own cycles, cycles with callees. Then stack depth, each
interrupt's wait and run time, and unmodelled accesses.

\b
Examples:
  {program} profile mine.elf --for 5s             a table, the costliest first
  {program} profile mine.elf --flame mine.svg     a flame graph, for any browser
  {program} profile mine.elf --folded mine.txt    stacks for other flame graph programs
"""

#: chosen: how many functions a person wants to see.
_SHOWN_FUNCTIONS = 20


def profile(
    firmware: Firmware,
    span_ns: Span = NS_PER_S,
    drive: Drive = None,
    flame: Annotated[Path | None, typer.Option(help="Write a flame graph (.svg).", metavar="FILE")] = None,
    folded: Annotated[Path | None, typer.Option(help="Write folded stacks.", metavar="FILE")] = None,
    every: Annotated[bool, typer.Option("--all", help="Every function that ran.")] = False,
    json_output: JsonOutput = False,
) -> None:
    """Measure where the cycles go."""
    board = BluePill(firmware)
    changes = parse_changes(drive or [], board)
    warn_on_stderr(board)
    stack = StackGauge(board)
    costs = CycleProfile(FunctionTable(board.image), StaticCode(board.chip.memory))
    latency = LatencyProbe(board)
    with Observation(board, [costs, latency]):
        run_driven(board, span_ns, changes)
    use = stack.measure()
    if flame is not None:
        title = f"{firmware.name}: {board.now_ns / 1e9:g} s"
        write_text(flame, flame_svg(costs.stacks, title=title, hz=board.hclk_hz))
    if folded is not None:
        write_text(folded, "\n".join(costs.folded()) + "\n")
    if json_output:
        facts = {
            "cycles": costs.total_cycles,
            "functions": [_function_facts(f) for f in costs.functions()],
            "stack": {"top": use.top, "room_bytes": use.room_bytes, "used_bytes": use.used_bytes},
            "exceptions": [_exception_facts(cost) for cost in latency.by_name],
            "warnings": board.warnings,
        }
        typer.echo(json.dumps(facts, sort_keys=True))
    else:
        lines = function_lines(costs, most=None if every else _SHOWN_FUNCTIONS)
        lines += [*exception_lines(latency.by_name, board.hclk_hz), "", str(use)]
        typer.echo("\n".join(lines))
        for warning in board.warnings:
            typer.echo(f"not modelled, or odd: {warning}")
    print_status(summary(board))
    if print_fault(board):
        raise typer.Exit(1)


def _function_facts(cost: FunctionCost) -> dict[str, object]:
    return {
        "name": cost.name,
        "calls": cost.calls,
        "cycles": cost.exclusive_cycles,
        "cycles_with_callees": cost.inclusive_cycles,
    }


def _exception_facts(cost: ExceptionCost) -> dict[str, object]:
    return {
        "number": cost.number,
        "name": exception_name(cost.number),
        "entries": cost.entries,
        "waits_known": len(cost.waits),
        "least_wait_cycles": cost.least_wait,
        "mean_wait_cycles": cost.mean_wait,
        "worst_wait_cycles": cost.worst_wait,
        "worst_duration_cycles": cost.worst_duration,
    }
