"""Makes everything in a run folder that is not the trace itself, from the trace.

trace.jsonl    the single source, written while the run goes on
summary.json   figures and verdict
pins.vcd       all wires, exact to the nanosecond
pins.sr        all wires, sampled, for PulseView
wire.jsonl     P2OS bytes, one message a line
usart.txt      what the firmware printed
report.html    the report, and PNG plots beside it

What `--coverage` and `--profile` leave is not made from the trace, but by `robot_bench.recording.measurement`
while the run is there; the trace keeps their summary.

Invariant: nothing but the trace is read; what is there already is written anew.
"""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from html import escape
from pathlib import Path
from typing import cast

from robot_bench.events.codec import Json
from robot_bench.recording.run_record import RunRecord, read_run
from robot_bench.recording.summary import SUMMARY_NAME, verdict_of, write_outcome
from robot_bench.recording.waveforms import write_sigrok, write_vcd
from robot_bench.report.page import page_data, render_page
from simbase.errors import FileError

REPORT_NAME = "report.html"


@dataclass(frozen=True, slots=True, kw_only=True)
class ReportFiles:
    """Where the parts of a report were written."""

    page: Path
    #: Empty where Matplotlib is not installed.
    plots: tuple[Path, ...]


def make_report(folder: Path) -> ReportFiles:
    """Make the report of a run from its trace; what is there already is written anew.

    Without Matplotlib (the extra `sim`) the page is written and the plots are left out.

    Raises:
        TraceError: The folder holds no readable trace.
    """
    return _report_of(read_run(folder), folder)


def _report_of(record: RunRecord, folder: Path) -> ReportFiles:
    page = folder / REPORT_NAME
    drawn = page_data(record)
    page.write_text(render_page(record, drawn), encoding="utf-8")
    try:
        from robot_bench.report.plots import write_plots
    except ModuleNotFoundError:
        return ReportFiles(page=page, plots=())
    return ReportFiles(page=page, plots=write_plots(drawn, folder))


@dataclass(frozen=True, slots=True, kw_only=True)
class Artefacts:
    """What was made of a run."""

    outcome: Json
    report: Path


def make_artefacts(folder: Path) -> Artefacts:
    """Write all that can be made from a run folder's trace, anew where it is there already.

    Raises:
        TraceError: The folder holds no readable trace.
        FileError: The disk is full, or the folder cannot be written.
    """
    record = read_run(folder)
    try:
        outcome = write_outcome(record, folder)
        write_vcd(record, folder / "pins.vcd")
        write_sigrok(record, folder / "pins.sr")
        write_wire(record, folder / "wire.jsonl")
        (folder / "usart.txt").write_bytes(b"".join(data for _, data in record.usart))
        report = _report_of(record, folder)
    except OSError as error:
        raise FileError(f"cannot write into {folder}: {error.strerror or error}") from error
    return Artefacts(outcome=outcome, report=report.page)


_PAGE_OF_ALL = """\
<!doctype html>
<html lang="en"><meta charset="utf-8"><meta name="viewport" content="width=device-width">
<title>{title}</title>
<style>body {{ font: 16px/1.5 system-ui, sans-serif; margin: 2rem auto; max-width: 60rem; padding: 0 1rem }}
td, th {{ padding: .2rem 1rem .2rem 0; text-align: left; vertical-align: top }} img {{ max-width: 100% }}</style>
<h1>{title}</h1>
<p>{verdict}</p>
<table><tr><th>robot<th>way<th>clear of<th>collisions<th>what came of it</tr>
{rows}
</table>
{pictures}
</html>
"""


def write_report_of_all(outcome: Json, folder: Path) -> None:
    """Write what came of a run with several robots, and a page that leads to the report of each.

    Raises:
        FileError: The disk is full, or the folder cannot be written.
    """
    robots = cast("Mapping[str, Mapping[str, object]]", outcome["robots"])
    rows, pictures = [], []
    for name, one in robots.items():
        failures = [*cast("Sequence[str]", one["failures"]), *cast("Sequence[str]", one["goals_not_judged"] or ())]
        lines = "<br>".join(escape(line) for line in failures) or "passed"
        rows.append(
            f'<tr><td><a href="{name}/{REPORT_NAME}">{name}</a><td>{_metres(one["distance_m"])}'
            f"<td>{_metres(one['min_clearance_m'])}<td>{one['collisions']}<td>{lines}</tr>"
        )
        if (folder / name / "path.png").is_file():
            pictures.append(
                f'<h2>{name}</h2><a href="{name}/{REPORT_NAME}"><img src="{name}/path.png" alt="{name}"></a>'
            )
    title = escape(f"{outcome['scenario']} in {outcome['world']}")
    verdict = escape(f"{verdict_of(outcome)}; {outcome['virtual_s']} s, body {outcome['body']}, seed {outcome['seed']}")
    page = _PAGE_OF_ALL.format(title=title, verdict=verdict, rows="\n".join(rows), pictures="\n".join(pictures))
    try:
        (folder / REPORT_NAME).write_text(page, encoding="utf-8")
        (folder / SUMMARY_NAME).write_text(json.dumps(outcome, indent=2, sort_keys=True) + "\n", encoding="utf-8")
    except OSError as error:
        raise FileError(f"cannot write into {folder}: {error.strerror or error}") from error


def _metres(value: object) -> str:
    return f"{value:.3f} m" if isinstance(value, (int, float)) else ""


def write_wire(record: RunRecord, path: Path) -> None:
    """Write the P2OS bytes: when they had arrived, which way, and what they are."""
    lines = [
        json.dumps({"t": chunk.t, "dir": chunk.direction, "hex": chunk.data.hex()}, sort_keys=True)
        for chunk in record.wire
    ]
    path.write_text("".join(line + "\n" for line in lines), encoding="utf-8")
