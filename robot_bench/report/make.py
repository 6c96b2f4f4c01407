"""Makes everything in a run folder that is not the trace itself, from the trace.

trace.jsonl    the single source, written while the run goes on
summary.json   figures and verdict
pins.vcd       all wires, exact to the nanosecond
pins.sr        all wires, sampled, for PulseView
wire.jsonl     P2OS bytes, one message a line
usart.txt      what the firmware printed
report.html    the report; where they are wanted PNG plots beside it

What `--coverage` and `--profile` leave is not made from the trace, but by `robot_bench.recording.measurement`
while the run is there; the trace keeps their summary.

Invariant: nothing but the trace is read; what is there already is written anew.
"""

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from robot_bench.events.codec import Json
from robot_bench.recording.run_record import RunRecord, read_run
from robot_bench.recording.summary import outcome_of_all, write_outcome
from robot_bench.recording.waveforms import write_sigrok, write_vcd
from robot_bench.report.page import page_data, render_page
from robot_bench.report.page_of_all import REPORT_NAME, write_report_of_all
from simbase.files import writing


@dataclass(frozen=True, slots=True, kw_only=True)
class ReportFiles:
    """Where the parts of a report were written."""

    page: Path
    #: Empty where they were not wanted, or Matplotlib is not installed.
    plots: tuple[Path, ...]


def make_report(folder: Path) -> ReportFiles:
    """Make the report of a run, with its plots, from its trace; what is there already is written anew.

    Without Matplotlib (the extra `sim`) the page is written and the plots are left out.

    Raises:
        TraceError: The folder holds no readable trace.
    """
    return _report_of(read_run(folder), folder, plots=True)


def make_scene(record: RunRecord, path: Path) -> None:
    """Write a picture of a run's world and path; nothing is written where Matplotlib is not installed."""
    try:
        from robot_bench.report.plots import write_scene
    except ModuleNotFoundError:
        return
    write_scene(page_data(record), path)


def _report_of(record: RunRecord, folder: Path, *, plots: bool) -> ReportFiles:
    page = folder / REPORT_NAME
    drawn = page_data(record)
    page.write_text(render_page(record, drawn), encoding="utf-8")
    if not plots:
        return ReportFiles(page=page, plots=())
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


def make_artefacts(folder: Path, *, plots: bool = False) -> Artefacts:
    """Write all that can be made from a run folder's trace, anew where it is there already.

    Args:
        folder: The run's.
        plots: The report's PNG plots, too, which take longer than all the rest.

    Raises:
        TraceError: The folder holds no readable trace.
        FileError: The disk is full, or the folder cannot be written.
    """
    return _artefacts_of(read_run(folder), folder, plots=plots)


def _artefacts_of(record: RunRecord, folder: Path, *, plots: bool) -> Artefacts:
    with writing(folder):
        outcome = write_outcome(record, folder)
        write_vcd(record, folder / "pins.vcd")
        write_sigrok(record, folder / "pins.sr")
        write_wire(record, folder / "wire.jsonl")
        (folder / "usart.txt").write_bytes(b"".join(data for _, data in record.usart))
        report = _report_of(record, folder, plots=plots)
    return Artefacts(outcome=outcome, report=report.page)


def make_artefacts_of_all(folder: Path, names: Sequence[str], scenario: str, *, plots: bool = False) -> Artefacts:
    """Write all that can be made from the traces of several robots: each one's, and the outcome and page of all.

    Raises:
        TraceError, FileError: As of `make_artefacts`.
    """
    records = {name: read_run(folder / name) for name in names}
    made = {name: _artefacts_of(record, folder / name, plots=plots) for name, record in records.items()}
    outcome = outcome_of_all(scenario, {name: one.outcome for name, one in made.items()})
    write_report_of_all(outcome, records, folder)
    return Artefacts(outcome=outcome, report=folder / REPORT_NAME)


def write_wire(record: RunRecord, path: Path) -> None:
    """Write the P2OS bytes: when they had arrived, which way, and what they are."""
    lines = [
        json.dumps({"t": chunk.t, "dir": chunk.direction, "hex": chunk.data.hex()}, sort_keys=True)
        for chunk in record.wire
    ]
    path.write_text("".join(line + "\n" for line in lines), encoding="utf-8")
