"""The PC program drives AMRISim, a simulator that is not ours, for ten real minutes.

AMRISim is built on the side by whoever wants this run; the environment variable
P2OS_AMRISIM names a command that serves a Pioneer 3-DX on this machine, for
example `AMRISim --nomap --no-gui -r p3dx:one -p 8101`, and P2OS_AMRISIM_PORT its port
if it is another. Without it the test is skipped.
"""

import os
import random
import re
import shlex
import signal
import subprocess
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.adapter_fw.builds import built
from tests.adapter_fw.program import CONNECT, Lines, motors, running

COMMAND = os.environ.get("P2OS_AMRISIM", "")
ADDRESS = ("127.0.0.1", int(os.environ.get("P2OS_AMRISIM_PORT", "8101")))
SPAN_S = float(os.environ.get("P2OS_AMRISIM_SECONDS", "600"))

pytestmark = [
    pytest.mark.soak,
    pytest.mark.skipif(not COMMAND, reason="P2OS_AMRISIM names no command that runs AMRISim"),
]


@pytest.fixture
def simulator(tmp_path: Path) -> Iterator[str]:
    process = subprocess.Popen(
        shlex.split(COMMAND), cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
        errors="replace", start_new_session=True,
    )  # fmt: skip
    assert process.stdout is not None
    try:
        # A connection that only looked would be its one client for some time.
        Lines(process.stdout).wait(lambda line: "ready for a client" in line)
        yield f"tcp:{ADDRESS[0]}:{ADDRESS[1]}"
    finally:
        os.killpg(process.pid, signal.SIGKILL)  # its wrapper, too
        process.wait()


def test_ten_minutes_with_amrisim_lose_nothing(simulator: str, tmp_path: Path) -> None:
    stored = tmp_path / "settings"
    stored.write_text("stop_unknown_robot 0\n", encoding="utf-8")  # its default build takes its first packet for a SYNC
    adapter, _ = built("program", tmp_path)
    random_source = random.Random(6)
    with running(adapter, simulator, "--robot", "p3dx", "--settings", str(stored)) as program:
        program.wires(CONNECT)
        program.event("driving")
        end = time.monotonic() + SPAN_S
        while time.monotonic() < end:
            program.wires(CONNECT | motors(random_source.randint(-4, 3), random_source.randint(-4, 3)))
            time.sleep(random_source.uniform(0.3, 3.0))
            assert not [line for line in program.events.lines if "lost" in line or "implausible" in line]
        program.wires(CONNECT)
        program.type("status")
        counters = program.answer("SIPs ")
        sips = int(re.search(r"SIPs (\d+)", counters)[1])
        assert sips > SPAN_S * 8
        assert re.search(r"bad_checksums 0  bad_counts 0  noise_bytes 0  losses 0", counters), counters
        assert program.end() == 130
