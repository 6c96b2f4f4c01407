"""The page of a run with several robots: what came of each, all of them in one world, and what happened as one list.

Each robot's own report has the rest.

Invariant: it is made from the traces and the outcome alone.
"""

import json
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import cast

from p2os.view.header import PageCell, PageHeader, PageSection, PageTable, Standing
from p2os.view.page import page_of
from p2os.view.recording import ViewRecording
from robot_bench.events.codec import Json
from robot_bench.recording.run_folder import SUMMARY_NAME, TRACE_NAME
from robot_bench.recording.run_record import RunRecord
from robot_bench.recording.summary import verdict_of
from robot_bench.view.run_recording import recording_of_all, standing_of
from simbase.files import replace_text, writing

REPORT_NAME = "report.html"
_HEAD = ("robot", "way", "clear of", "collisions", "what came of it")


def write_report_of_all(outcome: Json, records: Mapping[str, RunRecord], folder: Path) -> None:
    """Write what came of a run with several robots, and the page of all.

    Args:
        outcome: What came of it.
        records: Each robot's trace by its name, as read.
        folder: The run's.

    Raises:
        FileError: The disk is full, or the folder cannot be written.
    """
    page = page_of(report_of_all(outcome, records), all_is_in=f"each robot's {TRACE_NAME}")
    with writing(folder):
        replace_text(folder / REPORT_NAME, page)
        replace_text(folder / SUMMARY_NAME, json.dumps(outcome, indent=2, sort_keys=True) + "\n")


def report_of_all(outcome: Json, records: Mapping[str, RunRecord]) -> ViewRecording:
    """Return a run with several robots as the page shows it."""
    result = verdict_of(outcome)
    robots = cast("Mapping[str, Mapping[str, object]]", outcome["robots"])
    rows = [cell for name, one in robots.items() for cell in _rows(name, one)]
    header = PageHeader(
        title=f"{outcome['scenario']} in {outcome['world']}", verdict=result, standing=standing_of(result),
        lead=f"{outcome['virtual_s']} s · {outcome['body']} body · seed {outcome['seed']}",
        sections=[PageSection(title="Robots", blocks=[PageTable(head=_HEAD, rows=rows)])],
    )  # fmt: skip
    return recording_of_all(records, header)


def _rows(name: str, one: Mapping[str, object]) -> Iterator[list[PageCell]]:
    """Yield a robot's row, and one more for each further line of what came of it."""
    words: tuple[tuple[str, Standing], ...] = (("failures", "failed"), ("goals_not_judged", "open"))
    lines = [
        PageCell(text=line, standing=standing)
        for key, standing in words for line in cast("Sequence[str]", one[key] or ())
    ]  # fmt: skip
    first = [
        PageCell(text=name, href=f"{name}/{REPORT_NAME}"), PageCell(text=_metres(one["distance_m"]), is_number=True),
        PageCell(text=_metres(one["min_clearance_m"]), is_number=True),
        PageCell(text=str(one["collisions"]), is_number=True),
    ]  # fmt: skip
    for number, line in enumerate(lines or [PageCell(text="passed", standing="passed")]):
        yield [*(first if number == 0 else [PageCell(text="")] * len(first)), line]


def _metres(value: object) -> str:
    return f"{value:.3f} m" if isinstance(value, (int, float)) else ""
