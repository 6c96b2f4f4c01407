"""A run folder belongs to one run at a time, and a finished run is overwritten only where that is asked for."""

import contextlib
import os
import signal
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from robot_bench.recording import run_folder
from robot_bench.recording.run_folder import FILES, TRACE_NAME, VARIABLES_NAME, make_next_folder, reserved
from robot_bench.report.page_of_all import REPORT_NAME
from simbase.errors import UsageError

HOLDER = """
import sys
from pathlib import Path
from robot_bench.recording.run_folder import reserved
with reserved(Path(sys.argv[1])):
    print("held", flush=True)
    sys.stdin.read()
"""


def holder(folder: Path) -> subprocess.Popen[str]:
    """A process that has reserved a folder and holds it."""
    process = subprocess.Popen(
        [sys.executable, "-c", HOLDER, str(folder)], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    )
    assert process.stdout is not None
    assert process.stdout.readline() == "held\n"
    return process


def test_a_folder_that_another_run_writes_is_refused_with_a_hint(tmp_path: Path) -> None:
    process = holder(tmp_path / "run")
    try:
        for force in (False, True):
            with (
                pytest.raises(UsageError, match="another run is writing") as caught,
                reserved(tmp_path / "run", force=force),
            ):
                pass
            assert "--out" in str(caught.value.hint)
    finally:
        process.communicate(timeout=20)
    with reserved(tmp_path / "run"):
        pass


def contents(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.iterdir()}


@pytest.mark.parametrize("force", [False, True])
@pytest.mark.parametrize("why", ["another run", "no run"])
def test_a_folder_that_is_refused_is_as_it_was(why: str, force: bool, tmp_path: Path) -> None:
    run = tmp_path / "run"
    with contextlib.ExitStack() as stack:
        if why == "another run":
            stack.enter_context(reserved(run))
            (run / TRACE_NAME).write_text("what the other run has written so far\n", encoding="utf-8")
        else:
            run.mkdir()
            (run / VARIABLES_NAME).write_text("no trace beside it\n", encoding="utf-8")
        before = contents(run)
        with pytest.raises(UsageError, match=why), reserved(run, force=force):
            pass
        assert contents(run) == before


def test_nothing_that_a_run_may_write_outlives_it(tmp_path: Path) -> None:
    named = {name for key, name in vars(run_folder).items() if key.endswith("_NAME")}
    assert {"trace.jsonl", "variables.jsonl", "page.p2vf"} <= named
    for name in (*named, REPORT_NAME, *FILES):
        (tmp_path / name).touch()
    with reserved(tmp_path, force=True):
        assert contents(tmp_path) == {}


def test_a_run_that_was_killed_leaves_its_folder_free(tmp_path: Path) -> None:
    process = holder(tmp_path / "run")
    os.kill(process.pid, signal.SIGKILL)
    process.communicate(timeout=20)
    with reserved(tmp_path / "run"):
        pass


def test_a_finished_run_is_kept_unless_force_says_otherwise(tmp_path: Path) -> None:
    trace = tmp_path / "trace.jsonl"
    trace.write_text("an hour's work\n", encoding="utf-8")
    with pytest.raises(UsageError, match="holds a run already") as caught, reserved(tmp_path):
        pass
    assert caught.value.exit_code == 2
    assert "--force" in str(caught.value.hint)
    assert trace.read_text(encoding="utf-8") == "an hour's work\n"
    (tmp_path / "speeds.png").write_bytes(b"of the run before")
    (tmp_path / "my notes.txt").touch()
    with reserved(tmp_path, force=True):
        assert [path.name for path in tmp_path.iterdir()] == ["my notes.txt"]


def test_a_folder_that_holds_something_else_is_never_taken(tmp_path: Path) -> None:
    (tmp_path / "thesis.tex").touch()
    for force in (False, True):
        with pytest.raises(UsageError, match="holds something that is no run"), reserved(tmp_path, force=force):
            pass


def test_a_file_in_the_folders_place_is_refused(tmp_path: Path) -> None:
    (tmp_path / "run").touch()
    with pytest.raises(UsageError, match="cannot make the run folder"), reserved(tmp_path / "run"):
        pass


def test_numbers_that_are_given_out_at_the_same_time_are_all_different(tmp_path: Path) -> None:
    with ThreadPoolExecutor(8) as pool:
        folders = list(pool.map(lambda _: make_next_folder("dodge", tmp_path / "runs"), range(24)))
    assert sorted(folder.name for folder in folders) == [f"dodge-{number:03d}" for number in range(1, 25)]
    assert all(folder.is_dir() for folder in folders)
