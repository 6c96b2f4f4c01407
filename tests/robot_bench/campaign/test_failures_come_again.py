"""Every failure that a campaign reports fails again: from the files that it wrote, in a process that began later."""

import json
import subprocess
import sys
import time
from pathlib import Path

import pytest

from robot_bench.campaign.campaign_file import RunLimits
from robot_bench.campaign.conduct import PointFinding
from robot_bench.campaign.whole import begin, carry_out
from robot_bench.campaign.workers.processes import Processes

#: `dodge` that sees a hand's breadth, and a post on its way: it fails nearly everywhere, each time in another place.
FILE = """
scenario = "dodge"
search = "random"
near_misses = 0
[budget]
runs = 130
confirmations = 130
[cheap]
duration_s = 10
[full]
duration_s = 10
[vary]
threshold_m = 0.05
start.heading_deg = { from = 0, to = 359 }
[[draw]]
kind = "post"
ahead_m = { from = 0.7, to = 0.9 }
aside_m = { from = -0.15, to = 0.15 }
[[goal]]
kind = "no_collision"
ends_run = "missed"
"""
#: Prints what comes of each folder of failures: the hash of its run, and what was missed.
AGAIN = """
import json, sys
from pathlib import Path
from robot_bench.campaign.trial import run_trial, trial_of
for folder in map(Path, sys.argv[1:]):
    found = run_trial(trial_of(str(folder / "dodge.toml")))
    print(json.dumps([folder.name, found.verdict.value, found.sha256, list(found.failures)]))
"""
WANTED = 100


@pytest.mark.soak
def test_a_hundred_different_failures_fail_again_after_a_restart(tmp_path: Path) -> None:
    file, folder = tmp_path / "blind.toml", tmp_path / "blind"
    file.write_text(FILE, encoding="utf-8")
    campaign = begin(file, folder, firmware=None, overrides={})
    whole = carry_out(campaign, folder, Processes(2, RunLimits()), clock=time.monotonic_ns)
    findings = {row.finding for row in whole.progress.rows}
    assert not findings & {PointFinding.NOT_REPEATED, PointFinding.ERROR, PointFinding.UNCONFIRMED}
    told = {
        f"{row.number:04d}": (run.outcome.verdict.value, run.outcome.sha256, list(run.outcome.failures))
        for row in whole.failures
        if (run := row.failing) is not None
    }
    assert len({sha256 for _, sha256, _ in told.values()}) >= WANTED
    folders = sorted(str(path) for path in (folder / "failures").iterdir())
    again = subprocess.run([sys.executable, "-c", AGAIN, *folders], check=True, capture_output=True, text=True)
    found = {
        name: (verdict, sha256, failures)
        for name, verdict, sha256, failures in map(json.loads, again.stdout.splitlines())
    }
    assert found == told
