"""Print the speed of the wire's decoder and of the whole chain, as ratios to real time; `bodies.py` has the bodies.

Each figure is the median of several runs in this process; run it on an idle
machine. Usage: python tools/bench/speed.py [--quick]
"""

import json
import subprocess
import sys
import tempfile
from pathlib import Path

from measuring import cpu_s, print_tables, row, several

from p2os.protocol.frames import Decoder
from p2os.protocol.profiles import Profile
from p2os.protocol.sip import SonarReading, StandardSip


def wire(_folder: Path) -> None:
    """Decode a stream of SIPs, with every field."""
    sip = StandardSip(sonar=(SonarReading(1, 2000), SonarReading(2, 3000)))
    stream = sip.to_frame(Profile.P2OS).to_bytes() * 2000

    def decode() -> None:
        decoder = Decoder()
        decoder.receive(stream, 0)
        while (frame := decoder.next_item()) is not None:
            StandardSip.from_frame(frame, Profile.P2OS)

    rates = several(lambda: 2000 / cpu_s(decode))
    row("SIPs decoded, every field", rates, "{:.0f} a second", "a robot sends 10 a second")


def chain(_folder: Path) -> None:
    """The whole chain: dodge in room, 30 s."""
    command = [str(Path(sys.executable).parent / "p2os"), "run", "dodge", "--duration", "30s", "--json"]

    def factor(mode: str, body: str) -> float:
        with tempfile.TemporaryDirectory() as folder:
            options = ["--mode", mode, "--body", body, "--out", str(Path(folder) / "run")]
            done = subprocess.run([*command, *options], capture_output=True, text=True, check=False)
            return float(json.loads(done.stdout)["real_time_factor"])

    for mode in ("direct", "adapter"):
        for body in ("kinematic", "bullet"):
            row(f"dodge in room, {mode}, {body}", several(factor, mode, body), "{:.1f} x real")


if __name__ == "__main__":
    print_tables(wire, chain)
