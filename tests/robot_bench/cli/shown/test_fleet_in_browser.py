"""Robots of one world, looked at from their page in Chromium while they run.

Needs what `tests/p2os/view/test_page_in_browser.py` needs.
"""

import json
import subprocess
from pathlib import Path

import pytest

pytest.importorskip("uvicorn", reason="the extra view is not installed")

from tests.p2os.view.test_page_in_browser import SCRIPTS, tools
from tests.tools.forked_python import forked_p2os

RUN = ["run", "two-dodge", "--duration", "2s", "--realtime", "0.1", "--view"]


@pytest.mark.slow
def test_all_robots_are_seen_live_and_one_is_chosen(tmp_path: Path) -> None:
    node, chromium = tools()
    with subprocess.Popen(forked_p2os(*RUN, "--no-browser", "--out", str(tmp_path / "run")), stderr=subprocess.PIPE,
                          stdout=subprocess.PIPE, text=True) as running:  # fmt: skip
        assert running.stderr is not None
        link = running.stderr.readline().partition(": ")[2].strip()
        done = subprocess.run([node, str(SCRIPTS / "fleet.mjs"), chromium, link],
                              capture_output=True, text=True, timeout=120, check=False)  # fmt: skip
        if done.returncode:
            running.terminate()
        running.communicate(timeout=60)
    assert done.returncode == 0, done.stderr[-3000:]
    found = json.loads(done.stdout)
    assert (found["errors"], found["complaints"]) == ([], [])
    assert found["poses"] == found["all"] == found["posesThen"] == ["west", "east"]
    assert found["chosen"] == ["east"]
    assert 1_000_000 <= found["step"] < 1_100_000
    assert found["back"] == 0, "nothing is offered that robots of one world cannot do"
    assert found["shares"] > 20
    assert found["hands"] == ["west: press stop-button"]
    assert "press" in (tmp_path / "run" / "hands.toml").read_text(encoding="utf-8")
