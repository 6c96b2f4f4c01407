"""Hands put to a run from its page in Chromium: what is dragged, drawn, driven and saved, and what the saved tests say.

Needs what `tests/p2os/view/test_page_in_browser.py` needs.
"""

import json
import signal
import subprocess
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("uvicorn", reason="the extra view is not installed")

from tests.p2os.view.test_page_in_browser import SCRIPTS, tools
from tests.tools.forked_python import PYTEST, forked_p2os, forked_python

#: Dodge drives straight ahead from 3.5 s on, and is at x = 0.7 m by 7 s.
#: Long enough before it comes to what is dragged into its way that a browser is there in time.
WAY = """\
extends = "dodge"
body = "kinematic"
duration_s = 15.0

[start]
x_m = -1.2
y_m = 0.0

[[goal]]
kind = "reach"
x_m = 0.9
y_m = 0.0
radius_m = 0.2
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("hands")
    (folder / "way.toml").write_text(WAY, encoding="utf-8")
    return folder


@pytest.fixture(scope="module")
def found(folder: Path) -> dict[str, Any]:
    """Return what came of the run that hands were put to; all tests here look at it."""
    node, chromium = tools()
    with subprocess.Popen(forked_p2os("view", "way.toml", "--no-browser"), cwd=folder, text=True,
                          stderr=subprocess.PIPE, stdout=subprocess.PIPE) as running:  # fmt: skip
        assert running.stderr is not None
        link = running.stderr.readline().partition(": ")[2].strip()
        done = subprocess.run([node, str(SCRIPTS / "hands.mjs"), chromium, link],
                              capture_output=True, text=True, timeout=200, check=False)  # fmt: skip
        running.send_signal(signal.SIGINT)
        running.communicate(timeout=60)
    assert done.returncode == 0, done.stderr[-3000:]
    seen: dict[str, Any] = json.loads(done.stdout)
    return seen


def pytest_of(saved: str, folder: Path) -> subprocess.CompletedProcess[str]:
    program, *words = saved.removeprefix("saved: ").split()
    assert program == "pytest"
    words += ["-q", "-p", "no:cacheprovider", "--bench-record", "none"]
    return subprocess.run([forked_python(), "-c", PYTEST, *words], cwd=folder,
                          capture_output=True, text=True, timeout=100, check=False)  # fmt: skip


@pytest.mark.slow
def test_a_thing_dragged_into_the_way_makes_the_saved_test_fail(found: dict[str, Any], folder: Path) -> None:
    (hand,) = found["dragged"]["hands"]
    assert hand["words"].startswith("move crate to 1")
    assert found["drawn"]["hands"][1]["words"].startswith("place wall 1 box 1")
    assert found["over"]["why"] == "the end of the run"
    done = pytest_of(found["saved"], folder)
    assert done.returncode == 1
    assert "reach" in done.stdout or "came" in done.stdout, done.stdout


@pytest.mark.slow
def test_a_future_without_it_is_saved_as_a_test_that_passes(found: dict[str, Any], folder: Path) -> None:
    assert (found["fault"]["future"], found["fault"]["trouble"]) == ("fork 1", "")
    assert [one["words"] for one in found["fault"]["hands"]] == ["fault sonar-dead 1"]
    done = pytest_of(found["savedFork"], folder)
    assert done.returncode == 0, done.stdout


@pytest.mark.slow
def test_the_run_folder_replays_what_hands_did(found: dict[str, Any], folder: Path) -> None:
    run = folder / "runs" / "way-001"
    words = forked_p2os("run", str(run / "hands.toml"), "--out", "again", "--json")
    done = subprocess.run(words, cwd=folder, capture_output=True, text=True, timeout=100, check=False)
    live = json.loads((run / "summary.json").read_text())
    assert json.loads(done.stdout)["trace_sha256"] == live["trace_sha256"]


@pytest.mark.slow
def test_what_drives_stands_when_the_page_is_not_there_any_more(found: dict[str, Any]) -> None:
    assert found["afterBlur"]["is_running"] is True
    assert found["letGo"]["hands"][-1]["words"] == "let go wheels"
    assert found["errors"] == []


@pytest.mark.slow
def test_axe_and_a_narrow_screen_have_no_complaints_of_the_hands(found: dict[str, Any]) -> None:
    assert found["complaints"] == []
