"""What runs, looked into from its page in Chromium: variables as plots, registers, the program's place, the board.

Needs what `tests/p2os/view/test_page_in_browser.py` needs.
"""

import json
import subprocess
from pathlib import Path

import pytest

pytest.importorskip("uvicorn", reason="the extra view is not installed")

from tests.p2os.view.test_page_in_browser import SCRIPTS, tools
from tests.tools.forked_python import forked_p2os

RUN = ["run", "dodge", "--mode", "direct", "--body", "kinematic", "--duration", "4s", "--realtime", "0.1", "--view"]


@pytest.mark.slow
def test_variables_registers_the_program_and_the_board_are_seen_from_the_page(tmp_path: Path) -> None:
    node, chromium = tools()
    with subprocess.Popen(forked_p2os(*RUN, "--no-browser", "--out", str(tmp_path / "run")), stderr=subprocess.PIPE,
                          stdout=subprocess.PIPE, text=True) as running:  # fmt: skip
        assert running.stderr is not None
        link = running.stderr.readline().partition(": ")[2].strip()
        done = subprocess.run([node, str(SCRIPTS / "inside.mjs"), chromium, link],
                              capture_output=True, text=True, timeout=120, check=False)  # fmt: skip
        if done.returncode:
            running.terminate()
        running.communicate(timeout=60)
    assert done.returncode == 0, done.stderr[-3000:]
    found = json.loads(done.stdout)
    assert (found["errors"], found["complaints"]) == ([], [])
    assert "main::dodge.state" in found["offered"]
    assert "there is no variable 'no_such'" in found["trouble"]
    assert {"ticks, without unit", "head, without unit"} <= set(found["plots"])
    assert found["clocks"] == "HSIinside, RC8 MHz"
    assert any(row.startswith("CR10x4001380c") and "RXNEIE" in row for row in found["registers"])
    assert "→" in found["program"]
    assert "Reset_Handler" in found["program"]
    assert any(row.startswith("main") and "%" in row for row in found["shares"])
    assert min(found["lines"]) > 0, "lines that ran, that did not, and with a branch that went one way"
    assert found["board"].startswith("BluePill: LED off; ")
    assert len(set(found["at"])) <= 2, "all of one halt but the clock tree, which was looked at first"
