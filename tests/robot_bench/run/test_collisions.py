"""A failed run says what was hit, where and when: on the command line, in summary, trace, state log, page and plan."""

import contextlib
import io
import json
from collections.abc import Callable
from functools import cache
from pathlib import Path

import pytest

from p2os.cli.main import run as p2os
from robot_bench.recording.run_record import read_run
from robot_bench.report import make
from tests.p2os.view.pages import ReadPage
from tests.robot_bench.firmware.hurried import hurried
from tests.robot_bench.modes_and_bodies import modes_and_bodies

#: A program whose sensors see a hand's breadth, so that it drives straight on, and a crate in its way.
SCENARIO = """
firmware = "{firmware}"
world = "room"
duration_s = 3.4
threshold_m = 0.05
start = {{ x_m = -1.5, y_m = 0.0, heading_deg = 0.0 }}
[[obstacle]]
at_s = 0.5
name = "red box"
shape = "box"
x_m = -0.9
y_m = 0.0
length_m = 0.2
width_m = 0.8
height_m = 0.4
[[goal]]
kind = "no_collision"
"""


@pytest.fixture(autouse=True)
def _in_an_empty_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def crashed(folder: Path, body: str, mode: str) -> str:
    """Return what a run into a folder prints; it fails, for it hits the crate."""
    scenario, out = folder.with_name("crash.toml"), io.StringIO()
    scenario.write_text(SCENARIO.format(firmware=hurried("dodge")), encoding="utf-8")
    with contextlib.redirect_stdout(out):
        assert p2os(["run", str(scenario), "--body", body, "--mode", mode, "--out", str(folder)]) == 1
    return out.getvalue()


@pytest.fixture(scope="module")
def crash(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str, str], tuple[Path, str]]:
    """Return a function that runs into the crate on a body, in a mode: the folder of that run and what it printed."""

    @cache
    def run(body: str, mode: str) -> tuple[Path, str]:
        folder = tmp_path_factory.mktemp("crash") / "run"
        return folder, crashed(folder, body, mode)

    return run


@pytest.mark.parametrize(("mode", "body"), modes_and_bodies())
def test_what_was_hit_is_named_everywhere(mode: str, body: str, crash: Callable[[str, str], tuple[Path, str]]) -> None:
    folder, out = crash(body, mode)
    record = read_run(folder)
    (hit, *_) = record.contacts
    assert hit.what == "'red box'"
    assert hit.x_m == pytest.approx(-1.0, abs=0.02)
    first = next(pose.t for pose in record.poses if pose.collisions)
    assert first - 50_000_000 <= hit.t <= first
    assert out.count(str(hit)) == 1, "the goal that it fails names it"
    assert f"failed  no_collision: {len(record.contacts)} collision(s): {hit}" in out
    summary = json.loads((folder / "summary.json").read_text(encoding="utf-8"))
    assert summary["hits"][0] == {
        "t_s": hit.t / 1e9, "what": "'red box'", "x_m": hit.x_m, "y_m": hit.y_m, "part": hit.part,
    }  # fmt: skip
    assert hit.part.startswith("front")
    rows = ReadPage((folder / "report.html").read_text(encoding="utf-8")).rows("events")
    log = [(who, what) for _, _, who, what, *_ in rows]
    assert ("body", "collision") in log
    place = next(row[5:] for row in rows if row[3] == "collision" and row[0] == hit.t)
    assert place == pytest.approx((hit.x_m, hit.y_m), abs=1e-6)
    assert ("direct" if mode == "direct" else "adapter", "command") in log


def test_what_no_goal_forbids_is_named_all_the_same(capsys: pytest.CaptureFixture[str]) -> None:
    without_goal = SCENARIO.format(firmware=hurried("dodge")).partition("[[goal]]")[0]
    Path("crash.toml").write_text(without_goal, encoding="utf-8")
    assert p2os(["run", "crash.toml", "--body", "kinematic", "--mode", "direct", "--out", "crash"]) == 0
    (hit, *_) = read_run(Path("crash")).contacts
    assert capsys.readouterr().out.count(f"hit     {hit}\n") == 1


def test_a_run_that_hits_something_has_the_same_hash_each_time_and_logs_commands_and_stalls_in_mode_direct(
    tmp_path: Path,
    crash: Callable[[str, str], tuple[Path, str]],
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    again = tmp_path / "again"
    crashed(again, "kinematic", "direct")
    one, two = (read_run(folder) for folder in (crash("kinematic", "direct")[0], again))
    assert one.end["trace_sha256"] == two.end["trace_sha256"]
    log = [(event.what, event.detail) for event in one.events if event.who == "direct"]
    assert ("command", "motors 3, 3") in log
    assert ("stalled", "both wheels") in log
    monkeypatch.setattr(make, "_plots", lambda: None)  # no plot is looked at
    assert p2os(["report", str(again)]) == 0
    assert "red box" in capsys.readouterr().out
