"""A run controlled from its page in Chromium: halted, stepped, set back, forked; and the hash of a run without page.

Needs what `tests/p2os/view/test_page_in_browser.py` needs.
"""

import json
import subprocess
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("uvicorn", reason="the extra view is not installed")

from robot_bench.recording.run_record import read_run
from tests.p2os.view.test_page_in_browser import SCRIPTS, tools
from tests.tools.forked_python import forked_p2os

S, MS = 1_000_000_000, 1_000_000
RUN = ["run", "motors", "--body", "kinematic", "--duration", "2s", "--out"]
#: chosen: slow enough that a browser is there before it is over.
SLOWLY = ["--realtime", "0.05", "--view", "--no-browser"]


@pytest.fixture(scope="module")
def folders(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("controlled")


@pytest.fixture(scope="module")
def found(folders: Path) -> dict[str, Any]:
    """Return what came of the run that was controlled in the browser; all tests here look at it."""
    node, chromium = tools()
    with subprocess.Popen(forked_p2os(*RUN, str(folders / "with"), *SLOWLY), stderr=subprocess.PIPE,
                          stdout=subprocess.PIPE, text=True) as running:  # fmt: skip
        assert running.stderr is not None
        links = [running.stderr.readline().partition(": ")[2].strip() for _ in range(2)]
        done = subprocess.run([node, str(SCRIPTS / "control.mjs"), chromium, *links],
                              capture_output=True, text=True, timeout=170, check=False)  # fmt: skip
        if done.returncode:
            running.terminate()
        running.communicate(timeout=60)
    assert done.returncode == 0, done.stderr[-3000:]
    assert running.returncode == 0
    seen: dict[str, Any] = json.loads(done.stdout)
    return seen


@pytest.mark.slow
def test_the_trace_is_that_of_a_run_without_page(found: dict[str, Any], folders: Path) -> None:
    subprocess.run(forked_p2os(*RUN, str(folders / "without")), capture_output=True, timeout=100, check=True)
    with_page, without = (read_run(folders / name).end["trace_sha256"] for name in ("with", "without"))
    assert with_page == without
    assert found["errors"] == []


@pytest.mark.slow
def test_it_stands_still_and_goes_back_over_edges_and_on(found: dict[str, Any]) -> None:
    paused, back, again, on = (found[name] for name in ("paused", "back", "backAgain", "on"))
    assert (paused["is_running"], paused["why"]) == (False, "paused")
    assert again["head_ns"] < back["head_ns"] <= paused["head_ns"]
    assert on["head_ns"] == back["head_ns"]
    assert on["now"] == on["head_ns"], "the page goes with it"


@pytest.mark.slow
def test_a_step_begins_where_one_looks(found: dict[str, Any]) -> None:
    scrubbed, stepped, back = (found[name] for name in ("scrubbed", "stepped", "steppedBack"))
    assert scrubbed["now"] != scrubbed["head_ns"]
    assert stepped["head_ns"] == scrubbed["now"] + MS
    assert back["head_ns"] == scrubbed["now"]


@pytest.mark.slow
def test_it_halts_at_a_pin_and_before_a_line_and_says_so(found: dict[str, Any]) -> None:
    assert [one["words"] for one in found["pinAdded"]["halts"]] == ["pin p2dx_con high"]
    assert "no source file" in found["noneAdded"]["trouble"]
    assert "no source file" in found["alert"]
    assert found["focused"].startswith("Halts")
    assert found["atPin"]["why"].startswith("pin p2dx_con high")
    assert found["atLine"]["why"] == f"line {found['line']}"
    assert found["atLine"]["place"].startswith(found["line"])
    assert found["atLine"]["head_ns"] > found["atPin"]["head_ns"]


@pytest.mark.slow
def test_a_fork_begins_there_and_parts_where_something_was_done(found: dict[str, Any]) -> None:
    forked, compared = found["forked"], found["compared"]
    assert (forked["future"], forked["trouble"]) == ("fork 1", "")
    assert forked["futures"][1]["at_ns"] == found["atLine"]["head_ns"]
    assert 0 < forked["head_ns"] - found["atLine"]["head_ns"] < MS, "what is done is done"
    assert found["forkMs"] < 20_000  # how soon, a busy machine decides
    assert compared["futures"][1]["parting"][0]["signal"] == "fault"
    assert "parts from run first by fault" in found["parting"]
    assert sorted(compared["sources"]) == ["", "fork 1"]
    assert sorted(found["rows"]) == ["fork 1", "run"]
    assert found["chosen"]["future"] == "run"


@pytest.mark.slow
def test_who_looks_on_controls_nothing(found: dict[str, Any]) -> None:
    assert any("stands still" in one for one in found["watched"])
    assert found["watcherNames"] == ["To the start", "Play", "Go with the run"]
    assert "looking on" in found["refused"]
    assert found["after"]["is_running"] is False


@pytest.mark.slow
def test_axe_and_a_narrow_screen_have_no_complaints_of_the_bar(found: dict[str, Any]) -> None:
    assert found["complaints"] == []
