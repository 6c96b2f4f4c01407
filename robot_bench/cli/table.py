"""The summary of a run for a person: a table, what ran last where it helps, the notes, and at the end the verdict.

Why a run failed stands right above its last line, where a person looks first.
"""

from collections.abc import Mapping, Sequence
from typing import cast

from rich.table import Table

from bluepill_sim.program.last_blocks import TITLE
from p2os.cli.console import ReadableConsole
from robot_bench.recording.summary import EXPLAINED, LISTED_HITS, verdict_of
from robot_bench.run import RunResult
from simbase.errors import shown

#: What coverage counts, and its name for a person.
_COUNTED = (("lines", "lines"), ("branch_ways", "ways of branches"))

#: What stands before a goal, the goals' place in the outcome, and how many are listed; what failed is last.
LABELS = (
    ("met     ", "green", "goals_met", 6), ("open    ", "yellow", "goals_not_judged", 6),
    ("failed  ", "red", "failures", None),
)  # fmt: skip


def print_result(result: RunResult) -> None:
    """Print what a run came to, on stdout."""
    console = ReadableConsole()
    outcome = result.outcome
    table = Table(show_header=False, box=None, pad_edge=False)
    for name, value in rows(outcome):
        table.add_row(name, value)
    console.print(table)
    blocks = cast("Sequence[str]", outcome["last_blocks"] or ())
    for line in (TITLE, *blocks) if blocks else ():
        console.print(line, soft_wrap=True)
    for note in cast("Sequence[str]", outcome["notes"]):
        console.print(f"note    {note}", soft_wrap=True)
    for line in _hits(outcome):
        console.print(f"hit     {line}", soft_wrap=True)
    if outcome.get(EXPLAINED):
        console.print(f"why     {outcome[EXPLAINED]} (p2os explain {result.folder})", soft_wrap=True)
    for label, colour, key, listed in LABELS:
        # What interrupted a run is no goal, and stands in the last line.
        goals = cast("Sequence[str]", outcome[key] or ())[key == "failures" and result.was_interrupted :]
        for goal in _first(goals, listed, "in the report"):
            console.print(label, style=colour, end="")
            console.print(goal, soft_wrap=True)
    verdict = verdict_of(outcome)
    console.print(f"{verdict if result.passed else verdict.upper()}; report: {result.report}", soft_wrap=True)


def _hits(outcome: Mapping[str, object]) -> list[str]:
    """Return what was hit, the first few; nothing where a failed goal names it."""
    hits = cast("Sequence[Mapping[str, object]]", outcome["hits"])
    lines = [
        f"{hit['what']} at {hit['t_s']:.3f} s, x {hit['x_m']:.2f} m, y {hit['y_m']:.2f} m"
        + (f", by the robot's {hit['part']}" if hit["part"] else "")
        for hit in hits
    ]
    if any(lines[0] in failure for failure in cast("Sequence[str]", outcome["failures"]) if lines):
        return []
    return _first(lines, LISTED_HITS, "in the state log")


def _first(lines: Sequence[str], listed: int | None, place: str) -> list[str]:
    """Return the first so many (None: all), and where the others stand."""
    left = 0 if listed is None else len(lines) - listed
    return [*lines[:listed], *([f"{left} more, {place}"] if left > 0 else [])]


def rows(outcome: Mapping[str, object]) -> list[tuple[str, str]]:
    """Return the table's rows: name, and value with its unit."""
    mode = f"{outcome['mode']}" if "robots" in outcome else f"mode {outcome['mode']}"
    what = f"{outcome['scenario']} in {outcome['world']}, {mode}, body {outcome['body']}"
    robots = cast("Mapping[str, Mapping[str, object]]", outcome.get("robots", {}))
    found = [
        ("scenario", f"{what}, seed {outcome['seed']}"),
        ("virtual time", _with_unit(outcome["virtual_s"], ".1f", "s")),
        ("speed", _with_unit(outcome["real_time_factor"], ".1f", "× real time")),
        ("distance", _with_unit(outcome["distance_m"], ".2f", "m")),
        ("collisions", _with_unit(outcome["collisions"], "d", "")),
        ("least clearance", _with_unit(outcome["min_clearance_m"], ".3f", "m")),
        ("USART1", _with_unit(outcome.get("usart_baud"), "d", "bit/s")),
        ("printed", _printed(outcome)),
        ("coverage", _coverage(outcome.get("coverage"))),
        ("trace", str(outcome["trace_sha256"] or "")[:16]),
        *((name, _robot(one)) for name, one in robots.items()),
    ]  # fmt: skip
    return [(name, value) for name, value in found if value]


def _robot(outcome: Mapping[str, object]) -> str:
    """Return the figures of one of several robots."""
    figures = (("distance_m", "drove {:.2f} m"), ("min_clearance_m", "clear of {:.3f} m"))
    found = [form.format(outcome[key]) for key, form in figures if outcome[key] is not None]
    return ", ".join([*found, f"trace {str(outcome['trace_sha256'] or '')[:8]}"])


def _printed(outcome: Mapping[str, object]) -> str:
    lines = cast("int", outcome.get("usart_lines") or 0)
    return f"{lines} line{'s' * (lines != 1)}, the last: {shown(outcome['usart_last'])}" if lines else ""


def _coverage(facts: object) -> str:
    if not isinstance(facts, Mapping):
        return ""
    pairs = [(f"{facts[f'{key}_hit']} of {facts[key]} {word}", facts[key]) for key, word in _COUNTED]
    return ", ".join(text for text, whole in pairs if whole)


def _with_unit(value: object, form: str, unit: str) -> str:
    return "" if value is None else f"{value:{form}} {unit}".strip()
