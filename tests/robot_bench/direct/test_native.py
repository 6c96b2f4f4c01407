"""The robot's step in C runs under the address and undefined-behaviour sanitizers, and with every warning an error."""

from pathlib import Path

import pytest

from tests.tools.suite.sanitized import built_sanitized, needs_compiler, printed_under_sanitizers

BENCH = Path(__file__).parents[3] / "robot_bench"
SOURCES = (*sorted((BENCH / "direct" / "differential").glob("*.c")), BENCH / "wires" / "edges.c")
#: A rover on waves, levels and against a wall, an encoder of thousands of edges a step, and a bridge whose pins have
#: waves of all kinds, for hours.
PROGRAM = """
import sys
from random import Random
from robot_bench.direct.differential import native
from robot_bench.wires import edges
native.built = edges.built = lambda part: sys.argv[1]
from bluepill_sim.fabric.subscriptions import Wave
from robot_bench.direct.differential.bridge import HBridge
from robot_bench.direct.differential.description import BridgeDescription, BridgeKind
from robot_bench.direct.differential.quadrature import Quadrature
from robot_bench.wires.nets import Net, Strength, WaveDrive
from tests.robot_bench.direct.test_differential import MS, Rig
rig = Rig(x_m=1.5)
for step, duty in enumerate((1.0, 0.3, -0.7, 0.0)):
    for side in ("left", "right"):
        rig.drive(side, duty, step * 400 * MS)
    rig.robot.advance_to((step + 1) * 400 * MS)
a, b = Net("a"), Net("b")
encoder = Quadrature(a, b, 4000.0)
encoder.turn_to(9.0, 0, MS)
encoder.turn_to(-9.0, MS, MS)
random, hours, shares = Random(1), 3600 * 1000 * MS, []
for kind in BridgeKind:
    nets = [Net(name) for name in kind.pins]
    made = HBridge(nets, BridgeDescription(kind=kind, dead_time_us=random.choice((0, 100))))
    for step in range(40):
        begin = step * hours
        for net in nets:
            period = random.choice((900, 65536, 65536 * 65536))
            wave = Wave(begin, random.randrange(period), period, random.randrange(1, period), 72_000_000)
            net.wave_from("chip", WaveDrive(wave, Strength.PUSH_PULL.codes), begin)
        for after in (begin, begin + hours // 2):
            shares.append(sum(made.shares(after, after + MS)))
print(len(a.edges_until(9 * MS)) + len(b.edges_until(9 * MS)), all(0 <= one <= 1 + 1e-9 for one in shares))
"""

pytestmark = [pytest.mark.slow, needs_compiler]


def test_no_warning_and_no_finding(tmp_path: Path) -> None:
    library = built_sanitized(tmp_path / "edges.so", SOURCES, "-ffp-contract=off")
    printed = printed_under_sanitizers(PROGRAM, str(library))
    # 9 rad are 5729.6 edges: 5729 on, and 5729 + 5730 back.
    assert printed.split() == ["17188", "True"]
