"""A trace of which one value is wrong: every reader of it works, or refuses it in one line that names the line."""

import copy
import json
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from random import Random

import pytest

from robot_bench.bench import Bench, run_of
from robot_bench.drives.metrics import metrics
from robot_bench.drives.of_run import drive_of_record
from robot_bench.events.codec import line_of
from robot_bench.events.kinds import (
    CanTransfer,
    Clearance,
    Contact,
    Event,
    Fault,
    I2cTransfer,
    Note,
    Packet,
    PinEdge,
    Pose,
    Ranges,
    SpiTransfer,
    Text,
    Verdict,
    Wave,
    WorldChange,
)
from robot_bench.events.words import what_of
from robot_bench.recording.divergence import differences
from robot_bench.recording.event_files import write_named_events
from robot_bench.recording.run_record import RunRecord, read_events, read_run
from robot_bench.recording.summary import figures, outcome_of
from robot_bench.recording.waveforms import write_vcd
from robot_bench.report.drawn import drawn_of
from robot_bench.report.run_page import render_run
from robot_bench.ros.run_bag import RunMessages
from robot_bench.run import meta_of
from simbase.errors import P2osError
from tests.tools.each_row import each_row

#: One of each kind, for a second of a run.
EVENTS: tuple[Event, ...] = (
    PinEdge(t=5, wire="DD1", level=True), Wave(t=6, wire="DD1", at=0, period=20, high=5, ticks_hz=1000),
    Text(t=7, data=b"ready\n"), Text(t=8, data=b"x", port="usart2"),
    SpiTransfer(t=9, bus="SPI1", begun=1, ended=2, from_master=b"a", from_slave=b"b"),
    I2cTransfer(t=10, bus="I2C1", begun=1, address=60, is_read=True, data=b"a", answered=True, acknowledged=1,
                end="stop"),
    CanTransfer(t=11, bus="CAN", begun=1, identifier=5, is_extended=False, is_remote=False, dlc=1, data=b"a",
                is_own=True),
    WorldChange(t=12, op="place", name="box", fields={"x": 1.0, "y": 2.0, "length": 0.5, "width": 0.5, "shape": "box"}),
    WorldChange(t=13, op="move", name="box", fields={"x": 1.0, "y": 2.0, "heading": 0.5}),
    WorldChange(t=14, op="remove", name="box"), Fault(t=15, op="sonar", words="sonar 1 blind"),
    Packet(t=16, direction="c2r", data=bytes.fromhex("fafb03000000")),
    Packet(t=17, direction="r2c", data=bytes.fromhex("fafb03000000")),
    Note(t=18, who="p2os", what="motors", detail="on"),
    Ranges(t=19, mm=(1000,) * 8), Clearance(t=20, um=5000), Contact(t=21, what="a box", x_m=1.0, y_m=2.0, part="front"),
    *(Pose(t=22 + at, x=at, y=0, z=0, heading=0, pitch=0, left=1, right=1, left_angle=0, right_angle=0, collisions=0,
           work=3) for at in range(3)),
    Verdict(t=30, goal="drives", met=False, says="it did not", robustness=-1.0, unit="m"),
)  # fmt: skip
#: What stands in a value's place: each kind of JSON, and the ends of what numbers may be.
VALUES: tuple[object, ...] = (
    None, True, -1, 0, 1, 2, 1.5, 2**31, 2**63, -(2**63), 10**400, float("nan"), float("inf"), "", "x", "zz", "\u202e",
    [], [1], ["x"], [[]], [None], {}, {"a": 1}, {"name": "x"},
)  # fmt: skip
GONE = object()


def lines() -> list[dict[str, object]]:
    """Return the lines of a trace that has all kinds."""
    bench = Bench.from_scenario("motors", body="kinematic")
    bench.run_until("50 ms")
    world = bench.parts.world
    levels = [json.loads(line) for line in run_of(bench).recorder.lines() if '"nets"' in line or '"d":' in line][:3]
    meta = {"k": "meta", "trace": 2, **meta_of(bench.scenario, world, "", is_at_port=False)}
    table = {"files": ["coverage.txt"], "table": ["a 1"]}
    end = {
        "k": "end", "virtual_s": 1.0, "wall_s": 0.1, "real_time_factor": 10.0, "distance_m": 0.1, "collisions": 0,
        "usart_baud": 115200, "min_clearance_m": 0.5, "trace_sha256": "ab", "passed": False, "failures": ["drives: no"],
        "goals_met": ["stands"], "goals_not_judged": ["later"], "notes": ["n"], "last_blocks": ["b"],
        "parts": [{"name": "oled", "words": "8 dots", "png": "AA=="}], "coverage": table, "profile": table,
        "explained": "because", "worst_lag_ms": 1.0,
    }  # fmt: skip
    return [meta, *levels, *(json.loads(line_of(event)) for event in EVENTS), end]


def mutations(value: object) -> Iterator[tuple[str, object]]:
    """Yield a value with one of those in it changed or gone, each with what was changed; the first of a list's."""
    items = value.items() if isinstance(value, dict) else enumerate(value[:1]) if isinstance(value, list) else ()
    for key, inner in items:
        inside = ((f".{how}", changed) for how, changed in mutations(inner))
        for how, changed in [*((f"={wrong!r}"[:20], wrong) for wrong in (*VALUES, GONE)), *inside]:
            other = copy.copy(value)
            if changed is GONE:
                del other[key]  # type: ignore[attr-defined]  # a dict or a list
            else:
                other[key] = changed  # type: ignore[index]  # as above
            yield f"{key}{how}", other


def _page(record: RunRecord, _folder: Path) -> None:
    drawn_of(record)
    render_run(record)
    figures(record)
    json.dumps(outcome_of(record))


def _events(_record: RunRecord, folder: Path) -> None:
    list(map(what_of, read_events(folder)))
    differences(read_events(folder), read_events(folder))
    write_named_events((("", event) for event in read_events(folder)), folder / "e.jsonl")


def _bag(record: RunRecord, folder: Path) -> None:
    list(RunMessages(record.meta).of(read_events(folder)))


READERS: Mapping[str, Callable[[RunRecord, Path], object]] = {
    "page": _page,
    "events": _events,
    "vcd": lambda record, folder: write_vcd(record, folder / "pins.vcd"),
    "scene": lambda record, folder: write_named_events(
        (("", event) for event in read_events(folder)), folder / "e.mcap", record.meta
    ),
    "parquet": lambda record, folder: write_named_events(
        (("", event) for event in read_events(folder)), folder / "e.parquet", record.meta
    ),
    "bag": _bag,
    "metrics": lambda record, _folder: metrics(drive_of_record("it", record)),
}


def rows() -> list[tuple[int, str, object]]:
    return [(number, how, changed) for number, line in enumerate(WHOLE) for how, changed in mutations(line)]


WHOLE = lines()
ROWS = rows()
SAMPLE = Random(36).sample(ROWS, 60)


def look(folder: Path, number: int, changed: object) -> None:
    """Have every reader read the trace with one line changed."""
    text = [json.dumps(changed if place == number else line) for place, line in enumerate(WHOLE)]
    (folder / "trace.jsonl").write_text("\n".join(text) + "\n", encoding="utf-8")
    try:
        record = read_run(folder)
    except P2osError:
        record = None
    for read in READERS.values():
        try:
            read(record, folder) if record is not None else list(read_events(folder))
        except P2osError as error:
            assert "bug" not in str(error)  # noqa: PT017 - any other exception is the failure


def test_the_trace_that_is_changed_is_read_by_all(tmp_path: Path) -> None:
    text = "".join(json.dumps(line) + "\n" for line in WHOLE)
    (tmp_path / "trace.jsonl").write_text(text, encoding="utf-8")
    record = read_run(tmp_path)
    for read in READERS.values():
        read(record, tmp_path)


@each_row("row", SAMPLE, ids=lambda row: f"line {row[0] + 1}: {row[1]}")
def test_a_trace_with_a_wrong_value_is_read_or_refused(tmp_path: Path, row: tuple[int, str, object]) -> None:
    look(tmp_path, row[0], row[2])


@pytest.mark.soak
@each_row("row", ROWS, ids=lambda row: f"line {row[0] + 1}: {row[1]}")
def test_every_value_that_is_wrong_is_read_or_refused(tmp_path: Path, row: tuple[int, str, object]) -> None:
    look(tmp_path, row[0], row[2])
