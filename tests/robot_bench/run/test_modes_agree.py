"""Mode A and mode B do the same with the same pins: same edges, and wheels within a derived bound.

How far apart the wheels may be. Both modes approach the speed that the pins ask
for, by different ways:

- A change of the pins reaches the wheels of mode A within one step of the body.
  In mode B it waits for the sampling (three of five samples, 2 ms apart, show
  it), for the pair before it (25 ms apart), for the characters of VEL and RVEL
  (9 each at 9600 baud, 18.75 ms), and for a step. While it waits, an ideal wheel
  moves on by the waiting time times the acceleration of what has changed.
- Mode A ramps each wheel; the controller ramps forward speed and turn rate. Two
  ideal ramps, computed here, say how far that sets the wheels apart.
- Commands are whole mm/s and whole deg/s: half of each, the turn at half a track.
- Waiting times differ from change to change, so every change that has not died
  away yet counts.
"""

import math
from dataclasses import dataclass, replace
from pathlib import Path

import pytest

from adapter_sim.pinout import WireDirection, load_pinout
from p2os.pioneer.world.model import Pose
from p2os.robots.parameters import RobotParameters
from robot_bench.bench import Bench
from robot_bench.events.kinds import PinEdge
from robot_bench.recording.run_record import RunRecord, read_run
from robot_bench.recording.signals import motor_steps
from robot_bench.recording.trace import TraceWriter
from robot_bench.scenario.goals.signals import SKEW_NS
from robot_bench.scenario.scenario import Scenario, load_scenario
from tests.robot_bench.firmware.hurried import hurried_scenario
from tests.robot_bench.wires.fake_chip import FakeChip, PinDrive

S, MS = 10**9, 10**6
STEP_MM_S = 62.5
RAMP_MM_S2 = 300.0
WAIT_S = 3 * 0.002 + 0.025 + 0.01875 + 0.001
#: A second: the adapter's link stands when a program goes on.
LINKED_TICKS = 100
#: PyBullet's wheels follow their set-point with a torque limit and a sphere's slip: measured below 6 mm/s in a ramp.
BULLET_MM_S = 10.0
BODIES = [("kinematic", 0.0), pytest.param(("bullet", BULLET_MM_S), marks=pytest.mark.bullet)]


def recorded(scenario: Scenario, folder: Path, chip: FakeChip | None = None) -> RunRecord:
    folder.mkdir()
    trace = TraceWriter(folder / "trace.jsonl")
    bench = Bench(scenario, trace=trace, chip=chip)
    trace.meta({"mode": scenario.mode})
    bench.run_until(scenario.duration_ns)
    bench.finish()
    trace.end({})
    return read_run(folder)


def chip_edges(record: RunRecord) -> dict[str, list[tuple[int, int]]]:
    return {
        wire.name: record.pins[wire.name] for wire in load_pinout().wires if wire.direction is WireDirection.TO_ADAPTER
    }


def motor_pairs(record: RunRecord) -> list[tuple[int, tuple[int, int]]]:
    """Return the values of both motors' pins over time; changes within a millisecond are one."""
    steps = [(at, side, value) for side in (0, 1) for at, value in motor_steps(record.pins, side + 1)]
    result: list[tuple[int, tuple[int, int]]] = []
    values = [0, 0]
    for at, side, value in sorted(steps):
        values[side] = value
        begin = result.pop()[0] if result and at - result[-1][0] < SKEW_NS else at
        if not result or result[-1][1] != (values[0], values[1]):
            result.append((begin, (values[0], values[1])))
    return result


@dataclass
class Ramp:
    """A value that approaches its target at a fixed rate a second, in steps of a millisecond."""

    rate: float
    value: float = 0.0

    def step(self, target: float) -> float:
        change = self.rate / 1000
        self.value += min(max(target - self.value, -change), change)
        return self.value


def ideal(record: RunRecord, parameters: RobotParameters) -> dict[int, tuple[tuple[float, float], float]]:
    """Return for each ms ((how far apart two ideal robots' wheels are), how much the waiting may add), mm/s."""
    half_track_mm = parameters.track_mm / 2
    turn_mm_s2 = math.radians(parameters.motion.rot_accel_deg_s2) * half_track_mm
    left, right, forward, turn = Ramp(RAMP_MM_S2), Ramp(RAMP_MM_S2), Ramp(RAMP_MM_S2), Ramp(turn_mm_s2)
    changes, targets, recent = motor_pairs(record), (0.0, 0.0), []
    result = {}
    for ms in range(record.last_ns // MS + 1):
        while changes and changes[0][0] <= ms * MS:
            before, targets = targets, tuple(STEP_MM_S * value for value in changes.pop(0)[1])
            cost = RAMP_MM_S2 * (sum(targets) != sum(before)) + turn_mm_s2 * (
                targets[1] - targets[0] != before[1] - before[0]
            )
            longest = max(abs(after - was) for after, was in zip(targets, before, strict=True)) / RAMP_MM_S2
            recent.append((ms + 1000 * (WAIT_S + longest), WAIT_S * cost))
        recent = [(until, add) for until, add in recent if until >= ms]
        speeds = left.step(targets[0]), right.step(targets[1])
        v, w = forward.step(sum(targets) / 2), turn.step((targets[1] - targets[0]) / 2)
        result[ms] = ((abs(speeds[0] - (v - w)), abs(speeds[1] - (v + w))), sum(add for _, add in recent))
    return result


def compare(direct: RunRecord, adapter: RunRecord, parameters: RobotParameters, extra_mm_s: float) -> float:
    """Check every pose of both records; return the largest difference in mm/s."""
    rounding = 0.5 + math.radians(0.5) * parameters.track_mm / 2 + RAMP_MM_S2 / 1000
    bounds = ideal(direct, parameters)
    assert direct.poses[-1].collisions == adapter.poses[-1].collisions == 0
    largest = 0.0
    for a, b in zip(direct.poses, adapter.poses, strict=True):
        assert a.t == b.t
        apart, waiting = bounds[a.t // MS]
        for side, difference in enumerate((abs(a.left - b.left) / 1000, abs(a.right - b.right) / 1000)):
            bound = apart[side] + waiting + rounding + extra_mm_s
            assert difference <= bound, f"{difference:.1f} mm/s apart at {a.t / S} s, {bound:.1f} allowed"
            largest = max(largest, difference)
    return largest


@pytest.mark.slow
@pytest.mark.parametrize("body", BODIES)
def test_motors_sets_the_same_pins_and_the_wheels_agree(body: tuple[str, float], tmp_path: Path) -> None:
    name, extra = body
    scenario = hurried_scenario("motors", LINKED_TICKS, body=name, duration_s=7.2)
    direct = recorded(replace(scenario, mode="direct"), tmp_path / "a")
    adapter = recorded(replace(scenario, mode="adapter"), tmp_path / "b")
    assert chip_edges(direct) == chip_edges(adapter)
    assert [values for _, values in motor_pairs(direct)] == [(0, 0), (3, 3), (-4, -4), (0, 0)]
    assert direct.poses[-1].left == adapter.poses[-1].left == 0, "it stands again"
    largest = compare(direct, adapter, scenario.parameters, extra)
    # Only the forward speed changes here: 50.75 ms at 300 mm/s², and the rounding.
    assert largest <= WAIT_S * RAMP_MM_S2 + 2.4 + extra


@pytest.mark.slow
@pytest.mark.parametrize(("program", "duration_s"), [("sensors", 11.5), ("encoders", 12.0), ("dodge", 28.0)])
def test_pins_of_mode_a_replayed_into_the_adapter_drive_alike(program: str, duration_s: float, tmp_path: Path) -> None:
    scenario = hurried_scenario(program, LINKED_TICKS, body="kinematic", duration_s=duration_s)
    if program == "dodge":  # nearer to what it turns away from
        scenario = replace(scenario, start=Pose(1.5, 0.0, 0.0))
    direct = recorded(replace(scenario, mode="direct"), tmp_path / "a")
    pin_of = {wire.name: wire.bluepill for wire in load_pinout().wires}
    script = [
        (at, pin_of[net], PinDrive.HIGH if level else PinDrive.LOW)
        for net, edges in chip_edges(direct).items()
        for at, level in edges
    ]
    adapter = recorded(
        replace(scenario, mode="adapter"), tmp_path / "b", FakeChip(sorted(script, key=lambda edge: edge[0]))
    )
    assert chip_edges(adapter) == chip_edges(direct)
    assert len(motor_pairs(direct)) >= {"sensors": 5, "encoders": 5, "dodge": 16}[program]
    assert compare(direct, adapter, scenario.parameters, 0.0) > 0


def test_a_wheel_that_is_too_far_off_is_seen(tmp_path: Path) -> None:
    scenario = load_scenario("motors").with_options(body="kinematic", mode="direct", duration_s=1)
    script = [(S // 10, pin, PinDrive.HIGH) for pin in ("PB7", "PA1")]
    still, moving = (recorded(scenario, tmp_path / name, FakeChip(chip)) for name, chip in (("a", []), ("b", script)))
    with pytest.raises(AssertionError, match="allowed"):
        compare(still, moving, scenario.parameters, 0.0)


@pytest.mark.parametrize("core", ["model", "firmware"])
def test_no_encoder_moves_in_mode_adapter_before_the_robot_does(core: str) -> None:
    bench = Bench(load_scenario("encoders").with_options(mode="adapter", body="kinematic", adapter_core=core))
    edges: list[PinEdge] = []
    bench.events.subscribe(edges.append, PinEdge)
    bench.run_until("3.1 s")  # its program drives after 3 s, and a code of its wheels takes half a second
    moved = [(edge.t, edge.wire) for edge in edges if edge.wire.startswith("encoder") and edge.t]
    assert any(edge.t for edge in edges), "others do"
    assert moved == []
