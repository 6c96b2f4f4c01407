"""Many runs by one command: rows, table, JUnit, folders, signals; nothing depends on how many run at a time."""

import json
import os
import re
import shlex
import signal
import subprocess
import sys
import time
from pathlib import Path
from xml.etree import ElementTree as ET

import pytest

from p2os.cli.main import run as p2os
from p2os.pioneer.body.engine import Engine
from robot_bench.cli.run import sweep_rows
from robot_bench.cli.sweep import SweepResult, print_sweep
from robot_bench.cli.workers import run_in_processes
from robot_bench.scenario.loading import load_scenario
from simbase.trust import Trust
from tests.robot_bench.firmware import thumb
from tests.robot_bench.firmware.hurried import hurried

LEAST = 'firmware = "x.bin"\nworld = "room"\nduration_s = 0.2\nbody = "kinematic"\nmode = "direct"\n'
#: Met from 0 s on where the robot begins right of the y axis.
RIGHT = '[start]\nx_m = 0.5\ny_m = 0.0\n[[goal]]\nkind = "stay_within"\narea_m = [0.0, -5.0, 5.0, 5.0]\n'
COMMAND = [sys.executable, "-m", "p2os"]


@pytest.fixture(autouse=True)
def _in_an_empty_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def make(text: str = LEAST, firmware: bytes = thumb.SLEEP) -> str:
    Path("x.bin").write_bytes(firmware)
    Path("mine.toml").write_text(text, encoding="utf-8")
    return "mine.toml"


def found_of(capsys: pytest.CaptureFixture[str]) -> dict[str, object]:
    found: dict[str, object] = json.loads(capsys.readouterr().out)
    return found


def test_a_row_for_each_seed_and_nothing_is_left_of_what_passed(capsys: pytest.CaptureFixture[str]) -> None:
    assert p2os(["run", make(), "--seeds", "0-2", "-j", "2"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line.split()[:2] for line in lines[1:4]] == [["0", "passed"], ["1", "passed"], ["2", "passed"]]
    assert lines[-1] == "3 passed, 0 failed of 3, body kinematic"
    assert all(len(line) <= 80 for line in lines[:4])
    assert list(Path("runs").iterdir()) == []


def test_lists_are_swept_and_typed_again(capsys: pytest.CaptureFixture[str]) -> None:
    """The summary compares the seeds of each row, and the command sets the list again, not a text."""
    name = make(f'{LEAST}[sweep]\nrecord = [["spi1"], ["can", "usb"]]\n')
    assert p2os(["run", name, "-j", "2"]) == 0
    out = capsys.readouterr().out
    assert "2 passed, 0 failed of 2" in out
    again = next(line for line in out.splitlines() if line.startswith("one of them again: "))
    assert p2os(shlex.split(again.partition(": p2os ")[2])) == 0


def test_a_sweep_fails_with_1_and_says_which_row_and_how_to_see_it_again(capsys: pytest.CaptureFixture[str]) -> None:
    name = make(f"{LEAST}{RIGHT}[sweep]\nstart.x_m = {{ from = -0.5, to = 0.5, step = 0.5 }}\n")
    assert p2os(["run", name, "-j", "2", "--junit", "r.xml", "--out", "there"]) == 1
    out = capsys.readouterr().out
    assert "2 passed, 1 failed of 3" in out
    assert "failed  start.x_m -0.5, seed 0: stay_within: " in out
    replay = next(line.strip() for line in out.splitlines() if line.strip().startswith("p2os run"))
    assert replay == "p2os run mine.toml --set start.x_m=-0.5 --seed 0"
    assert [item.name for item in Path("there").iterdir()] == ["start.x_m--0.5-seed-0"]
    assert Path("there/start.x_m--0.5-seed-0/report.html").is_file()
    cases = ET.parse("r.xml").getroot().findall("testcase")  # noqa: S314  # our own file
    assert [case.find("failure") is not None for case in cases] == [True, False, False]
    swept = json.loads(Path("there/start.x_m--0.5-seed-0/summary.json").read_text(encoding="utf-8"))
    assert p2os([*shlex.split(replay)[1:], "--json"]) == 1
    assert found_of(capsys)["trace_sha256"] == swept["trace_sha256"]


def test_what_comes_of_a_sweep_does_not_depend_on_how_many_run_at_a_time(capsys: pytest.CaptureFixture[str]) -> None:
    text = LEAST.replace("direct", "adapter").replace("x.bin", str(hurried("dodge"))).replace("0.2", "1.2")
    name = make(f'{text}seeds = "3,0-1"\n[controller]\nerrors = "realistic"\n')
    found = []
    for jobs in ("1", "3"):
        assert p2os(["run", name, "-j", jobs, "--json", "--keep", "none"]) == 0
        found.append(found_of(capsys))
    assert found[0] == found[1]
    assert [run["seed"] for run in found[0]["runs"]] == [3, 0, 1]  # type: ignore[attr-defined] # JSON
    assert len({run["trace_sha256"] for run in found[0]["runs"]}) == 3  # type: ignore[attr-defined] # JSON


def test_seeds_that_make_no_difference_are_reported(capsys: pytest.CaptureFixture[str]) -> None:
    assert p2os(["run", make(), "--seeds", "0-1"]) == 0
    assert "note    the seeds made no difference: nothing random acts here" in capsys.readouterr().out
    assert p2os(["run", make(), "--seeds", "0-1", "--json", "--junit", "r.xml"]) == 0
    assert found_of(capsys)["seeds_are_alike"] is True
    (note,) = ET.parse("r.xml").getroot().findall("properties/property")  # noqa: S314  # our own file
    assert note.get("value", "").startswith("the seeds made no difference")
    assert p2os(["run", make(), "--seeds", "0", "--json"]) == 0
    assert not found_of(capsys)["seeds_are_alike"]
    assert p2os(["run", make(), "--seeds", "0"]) == 0
    assert "made no difference" not in capsys.readouterr().out


def test_of_runs_of_which_none_is_kept_no_folder_is_left(capsys: pytest.CaptureFixture[str]) -> None:
    name = make(LEAST.replace("0.2", "0.001") + RIGHT + "[sweep]\nstart.x_m = [-0.5, 0.5]\n")
    assert p2os(["run", name, "--keep", "none", "-j", "2"]) == 1
    assert capsys.readouterr().out.splitlines()[-1] == "1 passed, 1 failed of 2, body kinematic"
    assert not any(Path("runs").iterdir())


def printed(seeds: str, capsys: pytest.CaptureFixture[str]) -> list[str]:
    """Return what is printed of a sweep whose runs have failed where they began left of the y axis."""
    name = make(LEAST + RIGHT + "[sweep]\nstart.x_m = [-0.5, 0.5]\n")
    rows = sweep_rows(name, load_scenario(name), {}, seeds, Trust())
    passed = [dict(row.settings)["start.x_m"] == 0.5 for row in rows]
    outcomes = [{"passed": one, "failures": [] if one else ["stay_within: it did not"]} for one in passed]
    print_sweep(SweepResult(rows, outcomes, was_interrupted=False, folder=Path("runs")))
    return capsys.readouterr().out.splitlines()


@pytest.mark.parametrize(("lacking", "body"), [("", "bullet"), ("bullet", "mujoco"), ("bullet mujoco", "kinematic")])
def test_the_command_that_runs_a_row_again_names_the_best_body(
    lacking: str, body: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(Engine, "missing", lambda engine: [engine.name] if engine.name in lacking.split() else [])
    name = make(LEAST.replace('body = "kinematic"\n', ""))

    def again(**options: str) -> str:
        return sweep_rows(name, load_scenario(name), options, "7", Trust())[0].replay

    assert again() == again(body="best") == f"p2os run mine.toml --body {body} --seed 7"
    assert again(body="mujoco", mode="direct") == "p2os run mine.toml --body mujoco --mode direct --seed 7"
    named = make()
    assert sweep_rows(named, load_scenario(named), {}, "7", Trust())[0].replay == "p2os run mine.toml --seed 7"


def test_of_many_runs_the_table_has_a_line_for_all_seeds_of_a_row(capsys: pytest.CaptureFixture[str]) -> None:
    out = printed("0-18,30,40", capsys)
    assert [line.split() for line in out[1:3]] == [["-0.5", "0", "21", "0-18,", "30,", "40"], ["0.5", "21", "21"]]
    assert "and 9 more; --json and --junit have all" in out
    assert out[-1] == "21 passed, 21 failed of 42"
    assert [line.split()[:3] for line in printed("0-19", capsys)[1:41:20]] == [
        ["-0.5", "0", "failed"], ["0.5", "0", "passed"],
    ], "forty have a line each"  # fmt: skip


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--seeds", "3-1"], "'3-1' names no seeds"),
        (["--seeds", "0-200000"], "more than 100000 seeds"),
        (["--seeds", "0-1", "--seed", "3"], "--seeds cannot stand beside --seed"),
        (["--seeds", "0-1", "--coverage"], "--coverage cannot stand beside a sweep"),
        (["--seeds", "0-1", "--port", "loop:"], "--port cannot stand beside a sweep"),
        (["--seeds", "0-1", "--keep", "some"], "there is no --keep 'some'"),
        (["--seeds", "0-1", "--junit", "no/where.xml"], "cannot write no/where.xml: no such file or directory"),
        (["-j", "2"], "--jobs goes with many runs only"),
        (["--set", "threshold_m"], "--set 'threshold_m' is no KEY=VALUE"),
        (["--set", "start.x=1"], "--set start.x: [start]: unknown key 'x'"),
        (["--set", "goal.3.least_m=1"], "--set goal.3.least_m: there is no '3' in this list"),
        (["--set", 'sweep.mode=["direct", "wrong"]'], '[sweep] mode: mode = "wrong" is none of direct, adapter'),
        (["--set", 'sweep.mode=["direct"]', "--mode", "direct"], "the scenario sweeps mode, and an option sets it"),
    ],
)  # fmt: skip
def test_what_cannot_be_is_refused_in_one_line_before_anything_runs(
    options: list[str], said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert p2os(["run", make(f'{LEAST}[[goal]]\nkind = "no_collision"\n'), *options]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert said in err.splitlines()[0]
    assert len(err.splitlines()) == 2


def test_a_process_that_is_killed_is_a_failed_run_and_the_others_go_on() -> None:
    found: dict[int, dict[str, object]] = {}

    def job(number: int, look: object) -> dict[str, object]:
        if number == 1:
            os.kill(os.getpid(), signal.SIGKILL)
        return {"passed": True, "failures": [], "number": number}

    assert run_in_processes(job, 3, at_once=2, on_done=found.__setitem__, raise_if_interrupted=lambda: None)
    assert [found[number]["passed"] for number in range(3)] == [True, False, True]
    assert found[1]["failures"] == ["its process ended by SIGKILL"]


def test_a_bug_in_one_piece_is_reported_by_its_name() -> None:
    found: dict[int, dict[str, object]] = {}

    def job(number: int, look: object) -> dict[str, object]:
        raise ZeroDivisionError(f"piece {number}")

    assert run_in_processes(job, 1, at_once=1, on_done=found.__setitem__, raise_if_interrupted=lambda: None)
    assert found[0]["failures"] == ["this is a bug: ZeroDivisionError: piece 0"]


@pytest.mark.slow
def test_a_signal_ends_all_runs_in_good_order_with_130(tmp_path: Path) -> None:
    name = make(LEAST.replace("0.2", "100000"), thumb.SPIN)
    process = subprocess.Popen(
        [*COMMAND, "run", name, "--seeds", "0-3", "-j", "2"], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    deadline = time.monotonic() + 60
    while len(list(tmp_path.glob("runs/*/*/trace.jsonl"))) < 2:
        assert time.monotonic() < deadline
        time.sleep(0.05)
    children = _children(process.pid)
    process.send_signal(signal.SIGINT)
    out, err = process.communicate(timeout=60)
    assert process.returncode == 130, err
    assert out.splitlines()[-1] == "0 passed, 0 failed, 2 interrupted, 2 not run of 4, body kinematic"
    assert len(list(tmp_path.glob("runs/*/*/report.html"))) == 2
    assert len(children) == 2
    assert not [pid for pid in children if Path(f"/proc/{pid}").exists()]


@pytest.mark.slow
def test_forks_end_by_themselves_when_their_parent_is_killed(tmp_path: Path) -> None:
    name = make(LEAST.replace("0.2", "100000"), thumb.SPIN)
    process = subprocess.Popen([*COMMAND, "run", name, "--seeds", "0-3", "-j", "2"], stdout=subprocess.DEVNULL)
    deadline = time.monotonic() + 60
    while len(children := _children(process.pid)) < 2 or len(list(tmp_path.glob("runs/*/*/trace.jsonl"))) < 2:
        assert time.monotonic() < deadline
        time.sleep(0.05)
    process.kill()
    process.wait(timeout=60)
    while [pid for pid in children if _is_running(pid)]:
        assert time.monotonic() < deadline
        time.sleep(0.05)


def _children(pid: int) -> list[int]:
    return [int(word) for word in Path(f"/proc/{pid}/task/{pid}/children").read_text(encoding="ascii").split()]


def _is_running(pid: int) -> bool:
    try:
        state = re.search(r"^State:\s+(\w)", Path(f"/proc/{pid}/status").read_text(encoding="ascii"), re.MULTILINE)
    except OSError:
        return False
    return state is not None and state[1] != "Z"
