"""`p2os shrink`: the folder that it leaves runs, fails and explains itself; and what cannot be shrunk."""

import errno
import json
import subprocess
from importlib.metadata import EntryPoint
from pathlib import Path

import pytest

from p2os.cli import main as cli
from robot_bench.campaign.trial import run_trial, trial_of
from robot_bench.campaign.variants.shrinking.failure import FailureMode
from robot_bench.campaign.variants.shrinking.kept import keep, trial_of_run
from robot_bench.campaign.variants.shrinking.kept import test_text as text_of_test
from robot_bench.recording.run_folder import TRACE_NAME
from robot_bench.report.make import Files
from robot_bench.run import run_scenario
from robot_bench.scenario.loading import load_scenario
from simbase.errors import FileError, P2osError
from simbase.files import MAKE_ROOM
from tests.robot_bench.firmware.hurried import hurried
from tests.tools.forked_python import PYTEST, forked_p2os, forked_python

#: A quarter of a metre before a wall, with sensors that see a hand's breadth: it touches it 2 s after its start.
BLIND = """
extends = "dodge"
firmware = "dodge.elf"
mode = "direct"
body = "kinematic"
duration_s = 3.0
threshold_m = 0.05
start = { x_m = 2.513, y_m = 0.117, heading_deg = 3.0 }
[[obstacle]]
name = "far"
shape = "cylinder"
x_m = -1.0
y_m = 0.0
radius_m = 0.1
height_m = 0.5
at_s = 1.0
[[goal]]
kind = "no_collision"
[[goal]]
kind = "usart_contains"
text = "never said"
"""


@pytest.fixture(autouse=True)
def _in_an_empty_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("blind.toml").write_text(BLIND, encoding="utf-8")
    Path("dodge.elf").write_bytes(hurried("dodge").read_bytes())
    here = EntryPoint("shrink", "robot_bench.cli.campaigns.shrink", cli.GROUP)
    found = [entry for entry in cli.verbs() if entry.name != "shrink"]
    monkeypatch.setattr(cli, "verbs", lambda: [*found, here])


@pytest.mark.slow
def test_a_run_folder_is_shrunk_to_a_folder_whose_scenario_and_test_fail_in_the_same_way(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("robot_bench.campaign.variants.shrinking.kept._COMMAND", forked_p2os())
    scenario = load_scenario("blind.toml").with_options(seed=3)
    assert not run_scenario(scenario, Path("there"), files=Files.SUMMARY).passed
    assert cli.run(["shrink", "there", "--out", "small", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert (found["things_before"], found["things_after"], found["is_confirmed"]) == (10, 1, True)
    assert found["failure"] == "not met: touches nothing (front)"
    names = {path.name for path in Path("small").iterdir()}
    assert names == {"blind.toml", "dodge.elf", "world.toml", "test_blind.py", "explained.txt", "scene.png", "run"}
    assert "east wall" in Path("small/explained.txt").read_text(encoding="utf-8")
    assert cli.run(["shrink", "small/blind.toml", "--out", "small"]) == 2, "nothing is written over"
    options = ["-q", "-p", "no:cacheprovider", "--bench-record", "none"]
    pytest_here = [forked_python(), "-c", PYTEST, *options, "small"]
    ran = subprocess.run(pytest_here, capture_output=True, text=True, timeout=120, check=False)
    assert ran.returncode == 1
    assert "test_blind_touches_nothing" in ran.stdout
    text = Path("small/blind.toml").read_text(encoding="utf-8")
    Path("small/blind.toml").write_text(text.replace("0.05", "0.6"), encoding="utf-8")
    ran = subprocess.run(pytest_here, capture_output=True, text=True, timeout=120, check=False)
    assert ran.returncode == 0, "mended, it passes"


def test_a_run_folder_gives_the_trial_that_it_is_of_with_its_options() -> None:
    options = ["--seed", "3", "--duration", "1s", "--set", "start.x_m=1.5", "--world", "arena"]
    assert cli.run(["run", "blind.toml", "--out", "there", *options]) in {0, 1}
    summary = json.loads(Path("there/summary.json").read_text(encoding="utf-8"))
    assert run_trial(trial_of_run(Path("there"))).sha256 == summary["trace_sha256"]


@pytest.mark.parametrize(
    ("words", "says", "code"),
    [
        (["nowhere.toml"], "no scenario file nowhere.toml", 2),
        (["blind.toml", "--firmware", "no.elf"], "no firmware file no.elf", 2),
        (["blind.toml", "--goal", "cells_of_mine"], "no goal 'cells_of_mine'", 2),
        (["."], "is no run folder", 2),
        (["blind.toml", "--set", "threshold_m=0.6", "--goal", "no_collision"], "does not fail", 1),
    ],
)
def test_what_cannot_be_shrunk_is_refused_in_one_line(
    words: list[str], says: str, code: int, capsys: pytest.CaptureFixture[str]
) -> None:
    assert cli.run(["shrink", *words]) == code
    said = capsys.readouterr().err
    assert says in said
    assert len(said.splitlines()) <= 2, "a line, and its hint"


def test_a_run_whose_scenario_or_program_is_gone_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    program = trial_of("dodge").files["dodge.elf"]
    Path("mine.elf").write_bytes(program)
    assert cli.run(["run", "blind.toml", "--out", "there", "--duration", "100ms", "--firmware", "mine.elf"]) in {0, 1}
    capsys.readouterr()
    Path("mine.elf").write_bytes(program[:-1] + b"!")
    assert cli.run(["shrink", "there"]) == 2
    assert "built anew since" in capsys.readouterr().err
    Path("mine.elf").unlink()
    assert cli.run(["shrink", "there"]) == 2
    assert "the program of there is not here any more" in capsys.readouterr().err
    Path("blind.toml").unlink()
    assert cli.run(["shrink", "there"]) == 2
    assert "the scenario of there is not here any more" in capsys.readouterr().err


def test_the_test_of_a_fault_asks_whether_the_program_died() -> None:
    trial = trial_of("dodge").set(("duration_s", 2.5))
    text = text_of_test(trial, FailureMode(what="firmware fault: BusFault: write to nothing", is_fault=True))
    compile(text, "test.py", "exec")
    assert "assert not bench.chip.has_died" in text
    assert 'bench.run_until("2.5 s")' in text
    assert "judge" not in text


@pytest.mark.parametrize(
    ("refused", "says", "hint"),
    [
        (PermissionError(errno.EACCES, "Permission denied"), "permission denied", "name a place that you may write to"),
        (OSError(errno.ENOSPC, "No space left on device"), "no space left on device", MAKE_ROOM),
    ],
)
def test_a_file_of_a_kept_failure_that_cannot_be_written_is_named_with_a_hint(
    refused: OSError, says: str, hint: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Found as the N-th call of `shrink` failed: its line had the number of the error, and no hint."""
    trial, way = trial_of("dodge"), FailureMode(what="touches nothing")

    def refuse(*_: object) -> None:
        raise refused

    monkeypatch.setattr("robot_bench.campaign.variants.shrinking.kept._COMMAND", ("true",))
    monkeypatch.setattr("robot_bench.campaign.variants.shrinking.kept.read_run", lambda _: None)
    monkeypatch.setattr("robot_bench.campaign.variants.shrinking.kept.make_scene", refuse)
    Path("small/run").mkdir(parents=True)
    Path("small/run", TRACE_NAME).touch()
    with pytest.raises(FileError) as failed:
        keep(trial, way, Path("small"))
    assert (str(failed.value), failed.value.hint) == (f"cannot write small/scene.png: {says}", hint)
    Path("small/test_dodge.py").unlink()
    Path("small/test_dodge.py").mkdir()
    with pytest.raises(FileError, match=r"cannot write small/test_dodge\.py: is a directory"):
        keep(trial, way, Path("small"))


def test_a_run_of_a_kept_failure_that_cannot_be_begun_is_a_failure(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("robot_bench.campaign.variants.shrinking.kept._COMMAND", ("./nothing",))
    with pytest.raises(P2osError) as failed:
        keep(trial_of("dodge"), FailureMode(what="touches nothing"), Path("small"))
    assert str(failed.value) == "cannot run small/dodge.toml: [Errno 2] No such file or directory: './nothing'"
    assert failed.value.hint == "end other programs"
