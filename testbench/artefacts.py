"""Makes everything in a run folder that is not the trace itself, from the trace.

trace.jsonl    the single source, written while the run goes on
summary.json   figures and verdict
pins.vcd       all wires, exact to the nanosecond
pins.sr        all wires, sampled, for PulseView
wire.jsonl     P2OS bytes, one message a line
usart.txt      what the firmware printed
report.html    the report, and PNG plots beside it
"""

import json
from dataclasses import dataclass
from pathlib import Path

from testbench.outcome import write_outcome
from testbench.report import make_report
from testbench.report.run_record import Json, RunRecord, read_run
from testbench.sigrok import write_sigrok
from testbench.vcd import write_vcd


@dataclass(frozen=True, slots=True, kw_only=True)
class Artefacts:
    """What was made of a run."""

    outcome: Json
    report: Path


def make_artefacts(folder: Path) -> Artefacts:
    """Write all that can be made from a run folder's trace, anew where it is there already.

    Raises:
        TraceError: The folder holds no readable trace.
    """
    record = read_run(folder)
    outcome = write_outcome(record, folder)
    write_vcd(record, folder / "pins.vcd")
    write_sigrok(record, folder / "pins.sr")
    write_wire(record, folder / "wire.jsonl")
    (folder / "usart.txt").write_bytes(b"".join(data for _, data in record.usart))
    report = make_report(folder)
    return Artefacts(outcome=outcome, report=report.page)


def write_wire(record: RunRecord, path: Path) -> None:
    """Write the P2OS bytes: when they had arrived, which way, and what they are."""
    lines = [
        json.dumps({"t": chunk.t, "dir": chunk.direction, "hex": chunk.data.hex()}, sort_keys=True)
        for chunk in record.wire
    ]
    path.write_text("".join(line + "\n" for line in lines), encoding="utf-8")
