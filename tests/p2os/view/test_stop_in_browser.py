"""STOP on the page of a robot that a terminal drives, in Chromium: in sight at any width, by a click and by Escape.

Needs what `test_page_in_browser` needs.
"""

import contextlib
import json
import os
import re
import select
import subprocess
import time

import pytest

pytest.importorskip("uvicorn", reason="the extra view is not installed")

from tests.p2os.cli.driven import COMMAND, TIMEOUT_S, Driver, RecordingRobot
from tests.p2os.view.test_page_in_browser import SCRIPTS, tools


def heard(driver: Driver, pattern: str) -> re.Match[str]:
    """Return what a pattern finds in what a verb draws on its terminal."""
    drawn, ends = "", time.monotonic() + TIMEOUT_S
    while (found := re.search(pattern, drawn)) is None and time.monotonic() < ends:
        if select.select([driver.keyboard], [], [], 1.0)[0]:
            drawn += os.read(driver.keyboard, 4096).decode("utf-8", "replace")
    assert found is not None, drawn[-500:]
    return found


@pytest.mark.slow
def test_stop_is_in_sight_and_stops_by_a_click_and_by_escape() -> None:
    node, chromium = tools()
    with contextlib.closing(RecordingRobot()) as robot:
        words = [*COMMAND, "teleop", robot.url, "--view", "--no-browser"]
        with contextlib.closing(Driver(words, on_terminal=True)) as driver:
            link, watch = heard(driver, r"(?s)page: (\S+)\s.*to look on: (\S+)\s.*stand").groups()
            done = subprocess.run(
                [node, str(SCRIPTS / "stop.mjs"), chromium, link, watch, *os.environ.get("SHOTS", "").split()],
                capture_output=True, text=True, timeout=120, check=False,
            )  # fmt: skip
            driver.press("q")
            assert driver.end()[0] == 0
    assert done.returncode == 0, done.stderr[-3000:]
    found = json.loads(done.stdout)
    assert found["names"] == {"1400": True, "420": True}
    assert found["clicked"] == found["escaped"]
    assert "press anew" in found["clicked"]
    assert (found["drives"], found["watcher"], found["errors"]) == (0, 0, [])
