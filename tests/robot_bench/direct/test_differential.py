"""The differential robot on its wires: body, encoders, battery, sensors; the same however it is brought forward."""

import math
import pickle
from dataclasses import replace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bluepill_sim.fabric.subscriptions import Wave
from p2os.pioneer.body.factory import make_body
from p2os.pioneer.world import load_world
from p2os.pioneer.world.model import Obstacle, Pose
from robot_bench.bench.board import make_own_harness
from robot_bench.direct.differential.analog import GP2Y0A21, DischargingBattery, volts_at
from robot_bench.direct.differential.description import Differential, Off
from robot_bench.direct.differential.robot import DifferentialRobot
from robot_bench.wires.nets import Harness, Strength, WaveDrive
from tests.robot_bench.direct.robots import rover

MS = 1_000_000
PP = Strength.PUSH_PULL
PER_TURN = 1632


class Pin:
    """An analog pin that keeps what it was given."""

    def __init__(self) -> None:
        self.volts: float | None = None
        self.times = 0

    def set_volts(self, volts: float | None) -> None:
        self.volts = volts
        self.times += 1


class Rig:
    """A robot in the arena, and its wires in the test's hands."""

    def __init__(
        self, robot: Differential | None = None, *, body: str = "kinematic", world: str = "arena", x_m: float = 0.0
    ) -> None:  # fmt: skip
        robot = robot or rover()
        self.harness: Harness = make_own_harness(robot.signals)
        self.pins = {wire.name: Pin() for wire in robot.signals if wire.is_analog}
        self.body = make_body(body, load_world(world), robot.parameters, start=Pose(x_m, 0.0, 0.0))
        self.robot = DifferentialRobot(robot, self.body, self.harness, self.pins.__getitem__)

    def drive(self, side: str, duty: float, now: int = 0) -> None:
        """Drive forward or in reverse by PWM at 20 kHz."""
        for pin, level in (("in1", duty > 0), ("in2", duty < 0)):
            self.harness[f"{side}_{pin}"].drive("chip", level, PP, now)
        high, net = round(abs(duty) * 3600), self.harness[f"{side}_pwm"]
        if 0 < high < 3600:
            net.wave_from("chip", WaveDrive(Wave(now, 0, 3600, high, 72_000_000), PP.codes), now)
        else:
            net.drive("chip", high > 0, PP, now)

    def counts(self, side: str, until: int) -> int:
        """Count the edges of a wheel that turns one way only."""
        return sum(len(self.harness[f"{side}_{channel}"].edges_until(until)) for channel in "ab")


def test_it_drives_straight_at_the_steady_speed_and_its_edges_are_the_wheel_s_angle_of_a_step_before() -> None:
    rig = Rig()
    for side in ("left", "right"):
        rig.drive(side, 0.5)
    rig.robot.advance_to(499 * MS)
    angle = rig.body.state.left_angle_rad
    rig.robot.advance_to(500 * MS)
    state = rig.body.state
    # Half of the battery's 12.6 V less its sag, less friction, over K N: 0.44 m/s.
    assert state.left_speed_mps == pytest.approx(0.4587, rel=0.02)
    assert state.y_m == pytest.approx(0.0, abs=1e-12)
    assert rig.counts("left", 500 * MS) == math.floor(angle / (2 * math.pi) * PER_TURN)
    assert rig.counts("left", 501 * MS) + math.floor(angle / (2 * math.pi) * PER_TURN) == math.floor(
        state.left_angle_rad / (2 * math.pi) * PER_TURN
    )


def test_a_change_of_the_duty_within_a_step_acts_in_that_step() -> None:
    speeds = {}
    for at in (0, 250_000, 999_999, MS):
        rig = Rig()
        rig.drive("left", 0.0)
        rig.drive("left", 1.0, at)
        rig.robot.advance_to(MS)
        speeds[at] = rig.robot.train.left_radps
    assert speeds[0] > speeds[250_000] > speeds[999_999] == speeds[MS] == 0.0
    assert speeds[250_000] < 0.76 * speeds[0], "three quarters of the push, and friction takes its part of both"


def test_against_a_wall_the_motors_stall_the_battery_sags_and_the_encoders_stand() -> None:
    rig = Rig()
    rig.body.place(Obstacle(name="wall", x_m=0.25, y_m=0.0, length_m=0.1, width_m=2.0, height_m=0.3))
    said: list[tuple[int, str, str]] = []
    rig.robot.on_event = lambda *line: said.append(line)
    for side in ("left", "right"):
        rig.drive(side, 1.0)
    assert rig.harness["bumper_front"].level(0) is True
    rig.robot.advance_to(600 * MS)
    before = rig.counts("left", 550 * MS)
    rig.robot.advance_to(1000 * MS)
    assert before > 0
    assert rig.counts("left", 1000 * MS) == 0
    # Two motors of 2.9 ohm on 12.6 V behind 0.12 ohm: about 8 A, which takes 1 V off.
    assert rig.robot.cell.volts == pytest.approx((12.6 - 0.12 * 0.08) / (1 + 0.12 * 2 / 2.9), rel=0.005)
    assert rig.pins["battery"].volts == pytest.approx(rig.robot.cell.volts / 4, abs=2.01e-4)
    assert rig.harness["bumper_front"].level(1000 * MS) is False
    assert [what for _, what, _ in said] == ["stalled"]
    for side in ("left", "right"):
        rig.drive(side, -0.5, 1000 * MS)
    rig.robot.advance_to(1500 * MS)
    assert [what for _, what, _ in said] == ["stalled", "freed"]
    assert rig.harness["bumper_front"].level(1500 * MS) is True


def test_distance_sensors_see_what_stands_before_them_by_their_curve() -> None:
    rig = Rig()
    seen: list[tuple[int, list[float]]] = []
    rig.robot.on_ranges = lambda at, metres: seen.append((at, list(metres)))
    # The front sensor is 0.11 m ahead of the axle: a thing at 0.41 m is 0.3 m away.
    rig.body.place(Obstacle(name="thing", x_m=0.46, y_m=0.0, length_m=0.1, width_m=0.1, height_m=0.3))
    rig.robot.advance_to(120 * MS)
    assert rig.pins["distance_front"].volts == pytest.approx(0.92, abs=0.001)
    assert [at for at, _ in seen] == [39 * MS, 77 * MS, 115 * MS], "each 38.3 ms, at the end of a step"
    assert rig.pins["distance_left"].volts == pytest.approx(GP2Y0A21[-1][1]), "nothing within 0.8 m"


@pytest.mark.parametrize(
    ("metres", "volts"), [(-1, 0.3), (0.0, 0.3), (0.07, 3.1), (0.1, 2.3), (0.125, 1.975), (0.8, 0.4), (9, 0.4)]
)
def test_the_curve_is_a_line_between_its_points_and_flat_beyond(metres: float, volts: float) -> None:
    assert volts_at(GP2Y0A21, metres) == pytest.approx(volts)


def test_a_battery_falls_in_a_line_and_is_empty_when_its_charge_is_out() -> None:
    cell = DischargingBattery(rover().battery)
    cell.give(2.2, 1800)
    assert cell.source_v == pytest.approx((12.6 + 9.0) / 2)
    cell.give(2.2, 1799.9)
    assert cell.source_v == pytest.approx(9.0, abs=0.001)
    cell.give(2.2, 0.2)
    assert cell.source_v == 0.0
    cell.give(-100.0, 3600)
    assert cell.source_v == 12.6, "it takes no more than it holds"


@settings(max_examples=15)
@given(
    st.lists(
        st.tuples(st.integers(0, 60), st.sampled_from(["left", "right"]), st.sampled_from([-1, -0.3, 0, 0.2, 0.7, 1])),
        max_size=8,
    ),
    st.lists(st.integers(1, 80 * MS), max_size=6),
    st.integers(0, 80),
)
def test_it_is_the_same_in_any_slices_and_from_a_snapshot(
    script: list[tuple[int, str, float]], cuts: list[int], saved_at: int
) -> None:
    def run(stops: list[int], saved: int | None) -> tuple[object, list[object]]:
        rig = Rig()
        for at in sorted({*stops, *(step * MS for step, *_ in script), 80 * MS, *([saved * MS] if saved else [])}):
            rig.robot.advance_to(at)
            for step, side, duty in script:
                if step * MS == at:
                    rig.drive(side, duty, at)
            if saved is not None and at == saved * MS:
                state, nets = pickle.loads(pickle.dumps((rig.robot.snapshot(), rig.harness.snapshot())))  # noqa: S301
                rig = Rig()
                rig.harness.restore(nets)
                rig.robot.restore(state)
        edges = [list(net.edges_until(90 * MS)) for net in rig.harness]
        return rig.robot.snapshot(), edges

    assert run([], None) == run(cuts, saved_at or None)


@pytest.mark.bullet
def test_the_physical_body_follows_the_motors_too() -> None:
    rig = Rig(body="bullet")
    for side in ("left", "right"):
        rig.drive(side, 0.5)
    rig.robot.advance_to(1000 * MS)
    assert rig.body.state.left_speed_mps == pytest.approx(0.4587, rel=0.05)
    assert rig.body.state.x_m == pytest.approx(0.44, abs=0.05)


#: Each body, with what it needs.
BODIES = [
    pytest.param("kinematic"), pytest.param("bullet", marks=pytest.mark.bullet),
    pytest.param("mujoco", marks=pytest.mark.mujoco),
]  # fmt: skip


@pytest.mark.parametrize("body", BODIES)
def test_a_blocked_wheel_stands_and_draws_the_current_of_a_stalled_motor(body: str) -> None:
    """A duty of 0.12 makes 0.18 Nm less friction: no wheel slips, and it is 12.6 V * 0.12 over 2.9 ohm."""
    rig = Rig(body=body)
    rig.body.place(Obstacle(name="wall", x_m=0.25, y_m=0.0, length_m=0.1, width_m=2.0, height_m=0.3))
    for side in ("left", "right"):
        rig.drive(side, 0.12)
    rig.robot.advance_to(400 * MS)
    rolling_a = max(rig.robot.currents_a)
    rig.robot.advance_to(2000 * MS)
    for side in ("left", "right"):
        rig.counts(side, 2000 * MS)
    rig.robot.advance_to(3000 * MS)
    assert 0 < rolling_a < 0.15, "friction alone"
    # A sphere of bullet's creeps by a millimetre or two a second; free, it would make thousands of edges.
    assert [rig.counts(side, 3000 * MS) < 25 for side in ("left", "right")] == [True, True]
    assert rig.robot.currents_a == pytest.approx((0.52, 0.52), rel=0.03)
    assert rig.body.state.stalled_left


@pytest.mark.parametrize("body", BODIES)
def test_a_bridge_that_is_off_lets_the_robot_roll_or_brakes_it(body: str) -> None:
    """The brake's time constant is (J + m r^2 / 2) R / (K N)^2, 20 ms; friction alone takes off 1.1 m/s^2."""
    ends = {}
    for off in Off:
        rig = Rig(replace(rover(), bridge=replace(rover().bridge, off=off)), body=body)
        for side in ("left", "right"):
            rig.drive(side, 0.4)
        rig.robot.advance_to(500 * MS)
        before = rig.body.state.left_speed_mps
        for side in ("left", "right"):
            rig.drive(side, 0.0, 500 * MS)
        rig.robot.advance_to(505 * MS)
        assert (rig.robot.currents_a == (0.0, 0.0)) is (off is Off.COAST)
        rig.robot.advance_to(550 * MS)
        ends[off] = rig.body.state.left_speed_mps / before
    assert ends[Off.BRAKE] < 0.15
    assert ends[Off.COAST] > 0.8


@pytest.mark.slow
@pytest.mark.parametrize("body", BODIES[1:])
def test_a_slope_loads_the_motors_of_a_physical_robot(body: str) -> None:
    """Weight along the slope, times the wheel's radius, over two motors of K N each."""
    rig, current_a = Rig(body=body, world="ramp", x_m=1.4), {}
    for side in ("left", "right"):
        rig.drive(side, 0.3)
    for until_ms in (2000, 4500):
        rig.robot.advance_to(until_ms * MS)
        current_a[until_ms] = rig.robot.currents_a[0]
    motor, parameters, pitch = rover().motor, rover().body, abs(rig.body.state.pitch_rad)
    assert pitch == pytest.approx(math.atan(0.18 / 3.0), rel=0.02)
    weight_nm = parameters.mass_kg * 9.81 * math.sin(pitch) * parameters.wheel_diameter_m / 2
    load_a = weight_nm / (2 * motor.torque_constant * motor.gear_ratio)
    assert current_a[4500] - current_a[2000] == pytest.approx(load_a, rel=0.1)


def test_a_wheel_of_few_edges_and_one_on_the_wheel_itself_have_theirs() -> None:
    robot = replace(rover(), encoder=replace(rover().encoder, lines=5, is_on_motor=False))
    assert robot.encoder.edges_per_turn(robot.motor) == 20
