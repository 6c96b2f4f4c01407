"""A client's row: our own passes, one that never drives fails, nothing that one has started is left."""

import os
import subprocess
import sys
import time
from pathlib import Path

import pytest

from tests.tools.forked_python import forked_python
from tools.foreign.isolation import nothing_left
from tools.foreign.judges.drives import Drives
from tools.foreign.row import RowError, RowPlace
from tools.foreign.rows.table import ROWS

pytestmark = pytest.mark.skipif(os.name != "posix", reason="signals and terminals are Unix's")


@pytest.fixture
def place(tmp_path: Path) -> RowPlace:
    return RowPlace(cache=tmp_path, scratch=tmp_path)


@pytest.fixture
def python(monkeypatch: pytest.MonkeyPatch) -> str:
    """Fork what is started by Python's own name."""
    monkeypatch.setattr(sys, "executable", forked_python())
    return sys.executable


@pytest.mark.slow
def test_our_own_client_drives_is_killed_and_drives_again(place: RowPlace, python: str) -> None:
    words = (python, "-m", "p2os", "drive", "{url}", "--vel", "0.2m/s", "--for", "60s")
    steps = Drives(program=python, commands=(words,)).run(place).split("; ")
    drives, second, stands, following, again = steps
    assert drives.startswith("drives after")
    assert second == "a second is told busy"
    assert 2.0 < float(stands.split()[1]) < 5.0  # the watchdog, and 0.2 m/s at 0.3 m/s2
    assert following.startswith("next client in")
    assert again.startswith("again after")


@pytest.mark.slow
def test_a_client_that_never_drives_fails(place: RowPlace, python: str) -> None:
    with pytest.raises(RowError, match="never drove: it ended with code 0"):
        Drives(program=python, commands=((python, "-c", "pass"),)).run(place)


#: As roscore does with rosmaster and rosout: another session, and whoever started it is gone.
DAEMON = """import os, sys
if os.fork():
    os._exit(0)
os.setsid()
if os.fork():
    os._exit(0)
import pathlib, time
pathlib.Path("daemon").write_text(str(os.getpid()))
time.sleep(60)
"""


def test_nothing_that_was_started_is_left(tmp_path: Path) -> None:
    beside = subprocess.Popen(["sleep", "60"])
    try:
        with nothing_left():
            started = subprocess.Popen([sys.executable, "-c", DAEMON], cwd=tmp_path)
            started.wait()
            file, end = tmp_path / "daemon", time.monotonic() + 10
            while not (file.is_file() and file.read_text()) and time.monotonic() < end:
                time.sleep(0.01)
            pid = int(file.read_text())
            assert Path(f"/proc/{pid}").exists()
        assert not Path(f"/proc/{pid}").exists()
        assert beside.poll() is None
    finally:
        beside.kill()
        beside.wait()


def test_every_client_talks_to_the_robot_over_one_line() -> None:
    for row in ROWS:
        judge = row.judge
        if isinstance(judge, Drives):
            words = [word for command in judge.commands for word in command] + [text for _, text in judge.files]
            assert any("{line}" in word or "{url}" in word or "{port}" in word for word in words), row.name
            assert 0 <= judge.killed < len(judge.commands), row.name
