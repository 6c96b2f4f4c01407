"""Reports are made from a trace alone, whole or cut at any byte."""

import errno
import json
import os
from pathlib import Path
from typing import cast

import pytest

from p2os.view.header import PageHeader
from p2os.view.page import page_of
from robot_bench.events.codec import TraceError
from robot_bench.events.kinds import Note, WorldChange
from robot_bench.recording.run_record import read_run
from robot_bench.recording.signals import grouped, motor_steps
from robot_bench.recording.summary import (
    cells_entered,
    distance_m,
    figures,
    outcome_of,
    outcome_of_all,
    verdict,
)
from robot_bench.report import make_report
from robot_bench.report.make import Files, make_artefacts
from robot_bench.report.page_of_all import report_of_all
from robot_bench.report.run_page import render_run
from robot_bench.view.run_recording import recording_of_all
from simbase.errors import FileError
from tests.p2os.view.pages import ReadPage


def entries() -> list[dict[str, object]]:
    """A short run: two poses a metre apart, a few edges, a line of text, a packet."""
    world = {
        "name": "room",
        "extent": [-3.0, -3.0, 3.0, 3.0],
        "obstacles": [
            {"name": "north", "shape": "box", "kind": "wall", "x": 0, "y": 3, "heading": 0, "length": 6, "width": 0.1},
            {"name": "post", "shape": "cylinder", "kind": "obstacle", "x": 1, "y": 1, "radius": 0.2},
        ],
    }
    robot = {"front_m": 0.18, "rear_m": 0.26, "width_m": 0.38, "sonar": [[0.069, 0.136, 1.57]], "sonar_cone_rad": 0.5}
    pose = {"k": "pose", "y": 0, "z": 0, "p": 0, "l": 187500, "r": 187500, "la": 0, "ra": 0, "c": 0}
    return [
        {"k": "meta", "scenario": "motors", "mode": "adapter", "world": world, "robot": robot, "threshold_m": 0.6},
        {**pose, "t": 0, "x": 0, "h": 0},
        {"t": 0, "k": "pin", "net": "motor1_comm1", "v": 0},
        {"t": 0, "k": "pin", "net": "motor1_comm2", "v": 0},
        {"t": 0, "k": "pin", "net": "motor1_comm3", "v": 0},
        {"t": 10, "k": "pin", "net": "motor1_comm1", "v": 1},
        {"t": 10, "k": "pin", "net": "motor1_comm2", "v": 1},
        {"t": 20, "k": "pin", "net": "motor1_comm1", "v": 0},
        {"t": 20, "k": "pin", "net": "motor1_comm2", "v": 0},
        {"t": 20, "k": "pin", "net": "motor1_comm3", "v": 1},
        {"t": 30, "k": "sonar", "mm": [540, 3000, 3000, 3000, 3000, 3000, 3000, 3000]},
        {"t": 40, "k": "usart", "hex": b"hello </script> w".hex()},
        {"t": 50, "k": "usart", "hex": b"orld\nrest".hex()},
        {"t": 60, "k": "wire", "dir": "c2r", "hex": "fafb060b3bc800d33b"},
        {"t": 60, "k": "wire", "dir": "r2c", "hex": "00fafb03000000"},
        {"t": 70, "k": "event", "who": "adapter", "what": "connected", "detail": "p2dx_con"},
        {"t": 80, "k": "obstacle", "op": "move", "name": "post", "x": 2, "y": 2},
        {"t": 81, "k": "obstacle", "op": "remove", "name": "north"},
        {**pose, "t": 1_000_000_000, "x": 1_000_000, "h": 100, "c": 1},
        {
            "k": "end",
            "passed": True,
            "goals_met": ["1 m"],
            "failures": [],
            "trace_sha256": "ab",
            "min_clearance_m": 0.3,
        },
    ]


@pytest.fixture
def run(tmp_path: Path) -> Path:
    lines = [json.dumps(entry) + "\n" for entry in entries()]
    (tmp_path / "trace.jsonl").write_text("".join(lines), encoding="utf-8")
    return tmp_path


def test_each_file_that_is_made_of_a_run_takes_the_old_one_s_place_once_it_is_whole(
    run: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    make_artefacts(run)
    files = [path for path in run.iterdir() if path.name != "trace.jsonl"]
    assert len(files) == 6
    replace, calls = Path.replace, 0

    def full(part: Path, path: Path) -> Path:
        nonlocal calls
        calls += 1
        if calls > done:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        return replace(part, path)

    monkeypatch.setattr(Path, "replace", full)
    for done in range(len(files)):
        for path in files:
            path.write_bytes(b"old")
        calls = 0
        with pytest.raises(FileError, match="no space left"):
            make_artefacts(run)
        assert sum(path.read_bytes() != b"old" for path in files) == done
        assert len(list(run.iterdir())) == len(files) + 1


def test_a_whole_run_is_read_back(run: Path) -> None:
    record = read_run(run)
    assert verdict(record) == "passed"
    assert distance_m(record) == pytest.approx(1.0)
    assert cells_entered(record) == 2
    assert record.usart_lines() == [(50, "hello </script> world"), (50, "rest")]
    assert ("collisions", "1") in figures(record)


def test_so_much_is_made_of_a_run_as_is_wanted_and_the_rest_later(run: Path) -> None:
    names = set[str]()
    for files, more in (
        (Files.SUMMARY, {"trace.jsonl", "summary.json"}),
        (Files.REPORT, {"report.html", "pins.vcd", "pins.sr", "wire.jsonl", "usart.txt"}),
        (Files.PLOTS, {"path.png", "speeds.png", "pins.png"}),
    ):
        made = make_artefacts(run, files)
        assert {path.name for path in run.iterdir()} == (names := names | more)
        assert made.report == run / ("trace.jsonl" if files is Files.SUMMARY else "report.html")
        assert made.outcome == json.loads((run / "summary.json").read_text(encoding="utf-8"))


@pytest.mark.parametrize(
    ("end", "said"),
    [
        ({"passed": True, "goals_met": ["1 m"]}, "passed"),
        ({"passed": True, "goals_met": ["1 m"], "goals_not_judged": ["2 m"]}, "passed, 1 goal not judged"),
        ({"passed": True, "goals_met": []}, "ended well, no goals were set"),
        ({"passed": False}, "failed"),
        ({"passed": False, "failures": ["interrupted (SIGINT)"]}, "interrupted (SIGINT)"),
    ],
)
def test_the_page_says_of_a_run_what_the_screen_says(end: dict[str, object], said: str, run: Path) -> None:
    lines = (run / "trace.jsonl").read_text(encoding="utf-8").splitlines()
    (run / "trace.jsonl").write_text("\n".join([*lines[:-1], json.dumps({"k": "end", **end}), ""]), encoding="utf-8")
    record = read_run(run)
    assert verdict(record) == said
    page = ReadPage(make_artefacts(run, Files.REPORT).report.read_text(encoding="utf-8"))
    assert page.header["verdict"] == said
    assert f"<title>motors · {said}</title>" in page.text
    standings = {"passed": "passed", "ended": "open", "failed": "failed", "interrupted": "failed"}
    assert page.header["standing"] == standings[said.split(maxsplit=1)[0].strip(",")]


def test_the_motor_pins_read_as_twos_complement(run: Path) -> None:
    assert motor_steps(read_run(run).pins, 1) == [(0, 0), (10, 3), (20, -4)]
    assert motor_steps(read_run(run).pins, 2) == []


def test_nets_that_the_pin_out_does_not_know_come_last() -> None:
    assert grouped(["spare", "DD1"]) == [("distance", ["DD1"]), ("other", ["spare"])]


def test_the_page_is_one_file_that_no_text_of_the_run_can_break(run: Path) -> None:
    files = make_report(run)
    page = ReadPage(files.page.read_text(encoding="utf-8"))
    assert "hello </script>" not in page.text
    assert page.text.count("</script>") == 4  # header, frames, the script of the 3D view, that of the page
    assert [row[2] for row in page.rows("usart1")] == ["hello </script> w", "orld", "rest"]
    for plot in files.plots:
        assert plot.read_bytes().startswith(b"\x89PNG")


def test_the_page_holds_the_rows_of_the_trace(run: Path) -> None:
    page = ReadPage(make_report(run).page.read_text(encoding="utf-8"))
    assert page.rows("PB7 comm1") == [(0, 0, 1), (10, 1, 1), (20, 0, 1)]
    assert [row[0] for row in page.rows("pose")] == [0, 1_000_000_000]
    assert page.rows("left asked") == [(0, 0.0), (10, 3 * 0.0625), (20, -4 * 0.0625)]
    assert page.rows("nearest echo") == [(30, 0.54)]
    assert next(row[1:4] for row in page.rows("P2OS")) == (1, bytes.fromhex("fafb060b3bc800d33b"), "VEL")
    assert page.rows("things") == [(80, 1, 1, 2.0, 2.0, 0.0), (81, 0, 0, 0.0, 3.0, 0.0)]
    assert [(row[2], row[3]) for row in page.rows("events")] == [("adapter", "connected")]
    assert [row[1] for row in page.rows("1 m")] == [0, 1]
    assert page.header["left_out"] == []
    assert [thing["name"] for thing in page.header["world"]["things"]] == ["north", "post"]


def test_robots_are_no_things_of_one_another_and_their_events_are_one_list(run: Path) -> None:
    records = {name: read_run(run) for name in "ab"}
    for name, other, t in (("a", "b", 90), ("b", "a", 80)):
        records[name].changes.append(WorldChange(t=95, op="place", name=other, fields={"x": 1.0, "y": 1.0}))
        records[name].events = [Note(t=t, who="adapter", what="booted")]
    page = ReadPage(page_of(recording_of_all(records, PageHeader(title="both"))))
    assert {one["name"] for one in page.header["world"]["things"]} == {"north", "post"}
    assert [(row[0], row[2]) for row in page.rows("events")] == [(80, "b adapter"), (90, "a adapter")]
    assert page.rows("a pose") == page.rows("b pose") != []
    assert [one["name"] for one in page.header["robots"]] == ["a", "b"]


def test_the_page_of_several_says_of_each_line_how_it_came_out(run: Path) -> None:
    records = {name: read_run(run) for name in "ab"}
    outcome = outcome_of_all("x", {name: outcome_of(record) for name, record in records.items()})
    robots = cast("dict[str, dict[str, object]]", outcome["robots"])
    robots["a"] |= {"failures": ["hits"], "goals_not_judged": ["far"], "passed": False}
    rows = report_of_all(outcome, records).header.sections[0].blocks[0].rows  # type: ignore[union-attr]  # a table
    assert [(row[-1].text, row[-1].standing) for row in rows] == [
        ("hits", "failed"), ("far", "open"), ("passed", "passed"),
    ]  # fmt: skip
    assert [row[0].href for row in rows] == ["a/report.html", "", "b/report.html"]


def test_a_trace_cut_at_any_byte_still_has_its_report(run: Path) -> None:
    path = run / "trace.jsonl"
    whole = path.read_bytes()
    first_line = whole.index(b"\n") + 1
    for cut in range(first_line, len(whole), 31):
        path.write_bytes(whole[:cut])
        record = read_run(run)
        assert verdict(record).startswith("cut at")
        make_page_only(run)
    path.write_bytes(whole[: first_line - 2])
    with pytest.raises(TraceError):
        read_run(run)


def make_page_only(folder: Path) -> None:
    assert ReadPage(render_run(read_run(folder))).header["verdict"].startswith("cut at")


def test_a_folder_without_a_trace_is_refused_with_a_hint(tmp_path: Path) -> None:
    with pytest.raises(TraceError) as caught:
        make_report(tmp_path)
    assert caught.value.hint is not None
