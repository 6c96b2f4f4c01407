"""Makes everything in a run folder that is not the trace itself, from the trace.

trace.jsonl    the single source, written while the run goes on
summary.json   figures and verdict
pins.vcd       all wires, exact to the nanosecond
pins.sr        all wires, sampled, for PulseView
wire.jsonl     P2OS bytes, one message a line
usart.txt      what the firmware printed
page.p2vf      of a long run: its page's rows (`robot_bench.view.kept_recording`)
report.html    the report; where they are wanted PNG plots beside it

What `--coverage` and `--profile` leave is not made from the trace, but by `robot_bench.recording.measurement`
while the run is there; the trace keeps their summary.

Invariant: nothing but the trace is read; what is there already is written anew.
"""

import json
from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum
from pathlib import Path
from types import ModuleType

from p2os.view.page import page_of
from robot_bench.events.codec import Json
from robot_bench.recording.run_folder import TRACE_NAME
from robot_bench.recording.run_record import RunRecord, read_run
from robot_bench.recording.summary import outcome_of_all, write_outcome
from robot_bench.recording.waveforms import write_sigrok, write_vcd
from robot_bench.report.drawn import drawn_of
from robot_bench.report.page_of_all import REPORT_NAME, write_report_of_all
from robot_bench.report.run_page import run_report
from robot_bench.view.kept_recording import is_long, keep
from simbase.files import replace_text, replacing, writing


class Files(IntEnum):
    """How much is made of a run; each holds what stands before it."""

    #: summary.json beside the trace: for who reads runs by a program, or makes the rest of some by `p2os report`.
    SUMMARY = 0
    #: Waveforms, bytes, text, and the report.
    REPORT = 1
    #: The report's PNG plots, which take longer than all the rest.
    PLOTS = 2


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
    return _report_of(read_run(folder), folder, Files.PLOTS)


def make_scene(record: RunRecord, path: Path) -> None:
    """Write a picture of a run's world and path; nothing is written where Matplotlib is not installed."""
    if (plots := _plots()) is not None:
        plots.write_scene(drawn_of(record), path)


def _plots() -> ModuleType | None:
    try:
        from robot_bench.report import plots
    except ModuleNotFoundError:  # no Matplotlib
        return None
    return plots


def _report_of(record: RunRecord, folder: Path, files: Files) -> ReportFiles:
    page = folder / REPORT_NAME
    recording = run_report(record)
    replace_text(page, page_of(recording, all_is_in=TRACE_NAME))
    if is_long(folder):
        keep(recording, folder)
    plots = _plots() if files >= Files.PLOTS else None
    return ReportFiles(page=page, plots=() if plots is None else plots.write_plots(drawn_of(record), folder))


@dataclass(frozen=True, slots=True, kw_only=True)
class Artefacts:
    """What was made of a run."""

    outcome: Json
    #: The page; the trace where no page was wanted.
    report: Path


def make_artefacts(folder: Path, files: Files = Files.REPORT) -> Artefacts:
    """Write what is made from a run folder's trace, anew where it is there already.

    Args:
        folder: The run's.
        files: How much.

    Raises:
        TraceError: The folder holds no readable trace.
        FileError: The disk is full, or the folder cannot be written.
    """
    return _artefacts_of(read_run(folder), folder, files)


def _artefacts_of(record: RunRecord, folder: Path, files: Files) -> Artefacts:
    with writing(folder):
        outcome = write_outcome(record, folder)
        if files < Files.REPORT:
            return Artefacts(outcome=outcome, report=folder / TRACE_NAME)
        for name, write in (("pins.vcd", write_vcd), ("pins.sr", write_sigrok), ("wire.jsonl", write_wire)):
            with replacing(folder / name) as part:
                write(record, part)
        with replacing(folder / "usart.txt") as part:
            part.write_bytes(b"".join(data for _, data in record.usart))
        report = _report_of(record, folder, files)
    return Artefacts(outcome=outcome, report=report.page)


def make_artefacts_of_all(
    folder: Path, names: Sequence[str], scenario: str, files: Files = Files.REPORT
) -> Artefacts:  # fmt: skip
    """Write what is made from the traces of several robots: so much of each one's, and the outcome and page of all.

    Raises:
        TraceError, FileError: As of `make_artefacts`.
    """
    records = {name: read_run(folder / name) for name in names}
    made = {name: _artefacts_of(record, folder / name, files) for name, record in records.items()}
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
