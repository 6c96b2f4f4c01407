"""The table of `tools/surveys/measure_stops.py`, a few rows of it: real processes, a real line, a suspend."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from p2os.protocol.times import WATCHDOG_NS
from simbase.timing import NS_PER_MS

ROOT = Path(__file__).resolve().parent.parent
EVENTS = ("SIGTERM", "SIGINT x 20", "SIGKILL", "suspend 1 s", "suspend 3 s", "line cut 3 s", "output blocked, SIGINT")


#: Each event starts processes, a run's an emulator: these in `make test`, all in `make soak`. What signals do to verbs
#: and clients is tested beside them, by tests/p2os/cli/test_signals.py and tests/p2os/client/test_closing.py.
FEW = ("SIGTERM", "suspend 1 s", "output blocked, SIGINT")


@pytest.mark.slow
@pytest.mark.skipif(os.name != "posix", reason="signals are Unix's")
@pytest.mark.parametrize(
    ("way", "events"),
    [
        ("Robot", FEW),
        *(pytest.param(way, EVENTS, marks=pytest.mark.soak)
          for way in ("Robot", "asyncio Robot", "drive --vel", "run --port")),
    ],
)  # fmt: skip
def test_a_robot_stands_whatever_happens_to_its_driver(way: str, events: tuple[str, ...]) -> None:
    words = ["--way", way]
    words += [word for event in events for word in ("--event", event)]
    done = subprocess.run(
        [sys.executable, "tools/surveys/measure_stops.py", "--json", *words],
        cwd=ROOT, capture_output=True, text=True, timeout=300, check=False,
    )  # fmt: skip
    rows = [json.loads(line) for line in done.stdout.splitlines()]
    assert len(rows) == len(events), done.stderr
    wrong = [row for row in rows if row["problem"] or row["moves_again"]]
    assert not wrong, "\n".join(json.dumps(row) for row in wrong)
    reported = [row["stop_ms"] for row in rows if row["event"] in {"SIGTERM", "suspend 1 s", "output blocked, SIGINT"}]
    assert max(reported) < WATCHDOG_NS / NS_PER_MS, "the robot's own watchdog came first"
    assert done.returncode == 0
