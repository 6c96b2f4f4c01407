"""What verbs print of small files, whole, as it is kept: comparisons of drives and pins, figures of a run."""

import json
import math
import re
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import pytest

from p2os.cli.main import run as p2os
from robot_bench.cli import sweep
from robot_bench.events.codec import Json, line_of
from robot_bench.events.kinds import PinEdge
from tests.bluepill_sim.analysis.waveforms.captures import Analyser, random_run, seen, with_edges
from tests.robot_bench.cli.test_compare_pins import vcd
from tests.robot_bench.recording.kept_lines import is_as_kept
from tests.robot_bench.recording.long_run import META, MORE, long_run

LONG = re.compile(r"-?\d+\.\d{9,}(e-?\d+)?")


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "80")
    return tmp_path


def said(capsys: pytest.CaptureFixture[str], *lines: str) -> list[str]:
    """What verbs print, and their exit codes; numbers to six digits."""
    found = []
    for line in lines:
        code = p2os(line.split())
        shown = capsys.readouterr()
        found += [f"$ {line}: {code}", *shown.out.splitlines(), *(f"! {one}" for one in shown.err.splitlines())]
    return [LONG.sub(lambda number: f"{float(number[0]):.6g}", one) for one in found]


def way(name: str, bend: float, late_s: float = 0.0) -> None:
    rows = []
    for n in range(121):
        t = n / 20
        turn = bend * max(0.0, t - 3.0)
        rows.append(f"{t + late_s:.3f},{0.3 * t:.5f},{0.5 * turn * turn:.5f},{turn:.5f}\n")
    Path(name).write_text("t_s,x_m,y_m,heading_rad\n" + "".join(rows), encoding="utf-8")


def test_two_ways_compared(capsys: pytest.CaptureFixture[str]) -> None:
    way("a.csv", 0.4)
    way("b.csv", 0.5, 0.25)
    way("c.csv", 0.4)
    lines = said(
        capsys, "compare a.csv b.csv", "compare a.csv b.csv --align least-squares --shift 0s --delta 0.5s",
        "compare a.csv b.csv --at moves --align none", "compare a.csv c.csv --json",
        "compare a.csv b.csv --poses truth",
    )  # fmt: skip
    assert is_as_kept(lines, "outputs_of_compare")


def test_figures_of_a_run(capsys: pytest.CaptureFixture[str]) -> None:
    events = sorted([*MORE, *long_run(5)], key=lambda event: event.t)
    Path("run").mkdir()
    meta = {"k": "meta", "scenario": "mine", "mode": "adapter", **META}
    body = [line_of(event) for event in events if not isinstance(event, PinEdge) or event.wire != "led"]
    end = {"k": "end", "passed": False, "goals_met": ["a"], "failures": ["b: missed"], "min_clearance_m": 0.3}
    Path("run/trace.jsonl").write_text("\n".join([json.dumps(meta), *body, json.dumps(end), ""]), encoding="utf-8")
    lines = said(capsys, "metrics run", "metrics run run", "explain run", "explain run --json")
    assert is_as_kept(lines, "outputs_of_a_run")


def test_pins_compared(capsys: pytest.CaptureFixture[str]) -> None:
    run = random_run(5, edges=60)
    vcd(Path("model.vcd"), run)
    capture = seen(run, Analyser(offset_ns=-3e6, ppm=40.0))
    vcd(Path("board.vcd"), capture)
    edges = list(capture.signals["PA2"].edges)
    longest = max(range(len(edges) - 1), key=lambda n: edges[n + 1][0] - edges[n][0])
    at, level = math.floor(edges[longest][0]) + 5_000.0, edges[longest][1]
    edges[longest + 1 : longest + 1] = [(at, level ^ 1), (at + 500.0, level)]
    vcd(Path("pulse.vcd"), with_edges(capture, {"PA2": edges}))
    swapped = {"PA0": capture.signals["PA1"].edges, "PA1": capture.signals["PA0"].edges}
    vcd(Path("swapped.vcd"), with_edges(capture, swapped))
    vcd(Path("late.vcd"), with_edges(capture, {"PA3": [(one + 700.0, to) for one, to in capture.signals["PA3"].edges]}))
    vcd(Path("less.vcd"), replace(capture, signals={"PA0": capture.signals["PA0"]}))
    lines = said(capsys, *(
        f"compare-pins model.vcd {words}" for words in (
            "board.vcd --rate 24MHz", "pulse.vcd --rate 24MHz", "swapped.vcd --rate 24MHz", "late.vcd --rate 24MHz",
            "less.vcd --rate 24MHz", "late.vcd --rate 24MHz --json", "board.vcd --wire PA9=PA0", "missing.vcd",
        )
    ))  # fmt: skip
    assert is_as_kept(lines, "outputs_of_pins")


def swept(count: int, seeds: int) -> sweep.SweepResult:
    """Runs with all that may come of one, at some rows of two parameters."""
    rows, outcomes = [], list[Json]()
    for number in range(count):
        settings = (("start.x_m", 0.5 * (number // seeds)), ("robot.start.y_m", f"<{number // seeds}>"))
        scenario = SimpleNamespace(name="mine", seed=number % seeds)
        replay = sweep.command("mine.toml", ["--force"], settings, number % seeds)
        rows.append(sweep.SweepRow(scenario=scenario, settings=settings, replay=replay))  # type: ignore[arg-type]
        came = ([], ["it hit\x01 it", "and more"], ["not run"], ["interrupted (SIGINT)"], [])[number % 5]
        outcomes.append({
            "passed": not came, "failures": came, "virtual_s": 12.345, "distance_m": number * 1.005, "wall_s": number,
            "min_clearance_m": None if number % 2 else 0.1239, "trace_sha256": f"{number // seeds:09x}", "body": "best",
            "folder": f"runs/{number}" if number % 3 else None,
        })  # fmt: skip
    return sweep.SweepResult(rows, outcomes, count > 5, Path("runs"))


def test_what_a_sweep_prints(capsys: pytest.CaptureFixture[str]) -> None:
    lines = []
    for count, seeds in ((1, 1), (5, 5), (12, 2), (120, 6)):
        done = swept(count, seeds)
        sweep.print_sweep(done)
        sweep.write_junit(done, Path("junit.xml"))
        lines += [f"{count} runs, {seeds} seeds", *capsys.readouterr().out.splitlines()]
        if count <= 12:
            lines += [*Path("junit.xml").read_text(encoding="utf-8").replace("><", ">\n<").splitlines(),
                      json.dumps(sweep.as_json(done)), *sweep._places(done.rows)]  # fmt: skip
    assert is_as_kept(lines, "outputs_of_a_sweep")
