"""Print the speed of each part and of the whole chain, as ratios to real time.

Each figure is the median of several runs in this process; run it on an idle
machine. Usage: python tools/bench_speed.py [--quick]
"""

import math
import statistics
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

from p2os.parameters import load_parameters
from p2os.pioneer.body import make_body
from p2os.pioneer.scenery import Pose
from p2os.pioneer.world import load_world, parse_world
from p2os.profiles import Profile
from p2os.sip import SonarReading, StandardSip
from p2os.wire import Decoder

P2DX = load_parameters("p2dx")
EMPTY = parse_world('name = "empty"\nextent_m = [-4, -4, 4, 4]', "empty")
RUNS = 1 if "--quick" in sys.argv else 3


def median_seconds(work: Callable[[], object]) -> float:
    """Return the median wall time of a piece of work."""
    times = []
    for _ in range(RUNS):
        begin = time.perf_counter()
        work()
        times.append(time.perf_counter() - begin)
    return statistics.median(times)


def row(name: str, figure: str, note: str = "") -> None:
    """Print one line of the table."""
    print(f"{name:<44} {figure:>18}  {note}")


def bodies() -> None:
    """Stepping with two sonar every 100 ms, and the errors of three ideal paths."""
    for name in ("kinematic", "bullet"):
        body = make_body(name, load_world("room"), P2DX)

        def drive(body=body) -> None:  # noqa: ANN001
            for step in range(5000):
                body.step(0.1 + 0.1 * math.sin(step / 700), 0.12)
                if step % 100 == 0:
                    body.ranges([step // 100 % 8, (step // 100 + 1) % 8])

        row(f"{name} body, 1 kHz, two sonar in 100 ms", f"{5 / median_seconds(drive):.0f} x real")
        row(f"{name} body: line, turn, square", *errors(name))


def errors(name: str) -> tuple[str, str]:
    """Return the errors of a 1 m line, a full turn and a 1 m square against the ideal."""
    body, track = make_body(name, EMPTY, P2DX), P2DX.track_mm / 1000
    rim = math.pi / 2.5 * track / 2

    def ramped(left: float, right: float) -> None:
        for step in range(3000):
            share = min(1.0, (step + 0.5) / 500, (2999.5 - step) / 500)
            body.step(left * share, right * share)
        for _ in range(300):
            body.step(0, 0)

    ramped(0.4, 0.4)
    line = math.hypot(body.state.x_m - 1, body.state.y_m)
    body.reset(Pose(0, 0, 0), 0)
    for _ in range(2):
        ramped(-rim, rim)
    turn = abs(math.degrees(math.remainder(body.state.heading_rad, 2 * math.pi)))
    body.reset(Pose(0, 0, 0), 0)
    for _ in range(4):
        ramped(0.4, 0.4)
        ramped(-rim / 2, rim / 2)
    square = math.hypot(body.state.x_m, body.state.y_m)
    return f"{line * 1e3:.3f} mm", f"turn {turn:.4f} deg, square {square * 1e3:.3f} mm"


def wire() -> None:
    """Decode a stream of SIPs, with every field."""
    sip = StandardSip(sonar=(SonarReading(1, 2000), SonarReading(2, 3000)))
    stream = sip.to_frame(Profile.P2OS).to_bytes() * 2000

    def decode() -> None:
        decoder = Decoder()
        decoder.receive(stream, 0)
        while (frame := decoder.next_item()) is not None:
            StandardSip.from_frame(frame, Profile.P2OS)

    rate = 2000 / median_seconds(decode)
    row("SIPs decoded, every field", f"{rate:.0f} a second", f"{rate / 10:.0f} robots' worth (one sends 10 a second)")


def chain() -> None:
    """The whole chain: dodge in room, 30 s."""
    import json
    import subprocess

    command = [str(Path(sys.executable).parent / "p2os"), "run", "dodge", "--duration", "30", "--json"]
    for mode in ("direct", "adapter"):
        for body in ("kinematic", "bullet"):
            factors = []
            for _ in range(RUNS):
                with tempfile.TemporaryDirectory() as folder:
                    options = ["--mode", mode, "--body", body, "--out", str(Path(folder) / "run")]
                    done = subprocess.run([*command, *options], capture_output=True, text=True, check=False)
                    factors.append(json.loads(done.stdout)["real_time_factor"])
            row(f"dodge in room, {mode}, {body}", f"{statistics.median(factors):.1f} x real", f"of {factors}")


if __name__ == "__main__":
    for part in (wire, bodies, chain):
        part()
