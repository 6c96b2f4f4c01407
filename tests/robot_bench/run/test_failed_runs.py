"""However a run ends, its folder says so, and a report can be made of it."""

import json
import resource
import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest

from bluepill_sim.errors import UnmodelledError
from p2os.cli.main import run as p2os
from robot_bench import run
from robot_bench.bench import Bench, robot_run
from robot_bench.events.kinds import Pose
from robot_bench.recording.run_record import read_run
from robot_bench.recording.summary import outcome_of, verdict
from robot_bench.report import make
from robot_bench.report.make import make_artefacts
from robot_bench.scenario.loading import load_scenario
from robot_bench.scenario.scenario import Scenario
from simbase.errors import MissingDependencyError, P2osError
from tests.tools.forked_python import forked_python


def wanted(duration_s: float = 0.5) -> Scenario:
    return load_scenario("motors").with_options(mode="direct", body="kinematic", duration_s=duration_s)


def raising(error: BaseException) -> Callable[..., object]:
    """A part that cannot be made."""

    def make(*_: object, **__: object) -> object:
        raise error

    return make


def reported(folder: Path) -> list[object]:
    """Return the failures that a folder tells of, the same from trace, summary and a report made anew."""
    record = read_run(folder)
    assert verdict(record) in {"failed", "interrupted"}
    assert (folder / "report.html").is_file()
    summary = json.loads((folder / "summary.json").read_text(encoding="utf-8"))
    assert summary == outcome_of(record) == make_artefacts(folder).outcome
    failures = summary["failures"]
    assert isinstance(failures, list)
    assert failures[0] in (folder / "report.html").read_text(encoding="utf-8")
    return failures


@pytest.mark.parametrize(
    ("part", "error"),
    [
        ("boot", MissingDependencyError("the emulator needs unicorn", hint="pip install unicorn")),
        ("make_body", MissingDependencyError("the bullet body needs PyBullet", extra="bullet")),
        ("load_world", ModuleNotFoundError("No module named numpy", name="numpy")),
        ("boot", KeyboardInterrupt()),
        ("boot", ZeroDivisionError("integer modulo by zero")),
    ],
    ids=["chip", "extra", "module", "ctrl-c", "bug"],
)
def test_a_run_that_cannot_begin_leaves_a_folder_that_says_why(
    part: str, error: BaseException, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(robot_run, part, raising(error))
    with pytest.raises(type(error)) as caught:
        run.run_scenario(wanted(), tmp_path / "run")
    assert caught.value is error
    says = {"KeyboardInterrupt": "interrupted", "ZeroDivisionError": "this is a bug: ZeroDivisionError: integer modulo"}
    assert str(reported(tmp_path / "run")[0]).startswith(says.get(type(error).__name__, str(error)))


@pytest.mark.parametrize(
    "error",
    [UnmodelledError("USB at 0x40005c00 is not modelled (PC 0x08000123)"), P2osError("time stands still")],
    ids=["chip", "bench"],
)
def test_a_run_that_breaks_off_is_judged_and_says_why(error: Exception, tmp_path: Path) -> None:
    def drive(made: Bench) -> None:
        made.run_until(10_000_000)
        raise error

    result = run.run_scenario(wanted(), tmp_path / "run", drive=drive)
    assert not result.passed
    assert reported(tmp_path / "run")[0] == str(error)
    assert result.outcome["virtual_s"] == pytest.approx(0.01, abs=0.001)


def test_a_bug_in_the_midst_of_a_run_is_raised_and_its_folder_says_so(tmp_path: Path) -> None:
    def drive(made: Bench) -> None:
        made.run_until(10_000_000)
        raise ZeroDivisionError("integer modulo by zero")

    with pytest.raises(ZeroDivisionError):
        run.run_scenario(wanted(), tmp_path / "run", drive=drive)
    assert reported(tmp_path / "run") == ["this is a bug: ZeroDivisionError: integer modulo by zero"]
    assert read_run(tmp_path / "run").pins, "what was seen before stays"


def test_ctrl_c_in_the_midst_of_the_chips_work_is_an_end_in_good_order(tmp_path: Path) -> None:
    def drive(made: Bench) -> None:
        made.run_until(10_000_000)
        raise KeyboardInterrupt

    result = run.run_scenario(wanted(), tmp_path / "run", drive=drive)
    assert result.was_interrupted
    assert reported(tmp_path / "run")[0] == "interrupted"


LIMITED = """
import resource, sys
sys.dont_write_bytecode = True  # Python would leave cut files in the cache
resource.setrlimit(resource.RLIMIT_FSIZE, (30_000, 30_000))
from p2os.cli.main import main
main(["run", "dodge", "--mode", "adapter", "--body", "kinematic", "--duration", "9s", "--out", sys.argv[1]])
"""


@pytest.mark.skipif(not hasattr(resource, "RLIMIT_FSIZE"), reason="no limit of file size to be had")
def test_a_disk_that_is_full_in_the_midst_is_one_line_and_the_rest_can_be_reported_on(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = tmp_path / "run"
    done = subprocess.run(
        [forked_python(), "-c", LIMITED, str(folder)], capture_output=True, text=True, timeout=60, check=False
    )
    assert done.returncode == 1, done.stderr
    lines = done.stderr.splitlines()
    assert lines[0].startswith(f"p2os: cannot write {folder / 'trace.jsonl'}: File too large")
    assert lines[1].startswith("hint: p2os report")
    assert len(lines) == 2
    monkeypatch.setattr(make, "_plots", lambda: None)  # no plot is looked at
    assert p2os(["report", str(folder)]) == 0
    assert verdict(read_run(folder)).startswith("cut at ")


def test_a_report_that_cannot_be_written_is_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    run.run_scenario(wanted(0.01), tmp_path)
    monkeypatch.setattr(Path, "write_text", raising(OSError(28, "No space left on device")))
    assert p2os(["report", str(tmp_path)]) == 2
    line, hint = capsys.readouterr().err.splitlines()
    assert line == f"p2os: cannot write {tmp_path}: no space left on device"
    assert hint == "hint: make room, or name another place"


def test_goals_are_judged_from_all_of_the_run(tmp_path: Path) -> None:
    seen: list[int] = []

    def drive(made: Bench) -> None:
        made.events.subscribe(lambda pose: seen.append(pose.t), Pose)
        made.run_until(made.end)

    run.run_scenario(wanted(1.95), tmp_path / "run", drive=drive)
    assert seen[-1] == 1_950_000_000
