"""Print the speed of the wire's decoder and of the whole chain, as ratios to real time; `bodies.py` has the bodies.

Each figure is the median of several runs in this process; run it on an idle
machine. Usage: python tools/bench/speed.py [--quick]
"""

import statistics
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

from p2os.protocol.frames import Decoder
from p2os.protocol.profiles import Profile
from p2os.protocol.sip import SonarReading, StandardSip

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

    command = [str(Path(sys.executable).parent / "p2os"), "run", "dodge", "--duration", "30s", "--json"]
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
    for part in (wire, chain):
        part()
