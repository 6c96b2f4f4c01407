"""Mode A's plug-ins: motor, encoder and distance sensor on wires, and the plant under them."""

import math
import pickle
from collections.abc import Sequence

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from adapter_sim.codec import BitOrder, motor_code
from p2os.errors import LocalProtocolError
from p2os.pioneer.body.factory import make_body
from p2os.pioneer.world import load_world
from p2os.robots.parameters import load_parameters
from robot_bench.direct import DirectRobot, DirectSettings, DistanceSensors, JointMotor, WheelEncoder
from robot_bench.wires.nets import Net, Strength
from simbase.errors import UsageError

MS = 1_000_000


def set_value(nets: Sequence[Net], value: int, now: int) -> None:
    code = motor_code(value, len(nets))
    for bit, net in enumerate(nets):
        net.drive("chip", bool(code >> bit & 1), Strength.PUSH_PULL, now)


def nets(width: int = 3) -> list[Net]:
    return [Net(f"wire {bit}") for bit in range(width)]


@pytest.mark.parametrize("width", [3, 4])
def test_every_value_becomes_its_speed(width: int) -> None:
    wires = nets(width)
    motor = JointMotor(wires, step_um_per_s=62_500, ramp_um_per_s2=None, dt_ns=MS)
    for at, value in enumerate(range(-(1 << width - 1), 1 << width - 1)):
        set_value(wires, value, at)
        assert motor.value(at) == value
        assert motor.step(at) == value * 62_500


def test_the_other_bit_order_reads_the_wires_from_their_other_end() -> None:
    wires = nets()
    set_value(wires, 1, 0)
    motor = JointMotor(wires, step_um_per_s=1, ramp_um_per_s2=None, dt_ns=MS, bit_order=BitOrder.COMM1_MSB)
    assert motor.value(0) == -4


def test_a_ramp_of_300_mm_s2_takes_625_steps_to_three_motor_steps() -> None:
    wires = nets()
    motor = JointMotor(wires, step_um_per_s=62_500, ramp_um_per_s2=300_000, dt_ns=MS)
    set_value(wires, 3, 0)
    speeds = [motor.step(0) for _ in range(626)]
    assert speeds[0] == 300
    assert (speeds[623], speeds[624], speeds[625]) == (187_200, 187_500, 187_500)
    set_value(wires, -4, 1)
    assert motor.step(1) == 187_200


@pytest.mark.parametrize("ramp", [0, 1_500, -300_000])
def test_a_ramp_that_is_no_whole_number_a_step_is_refused(ramp: int) -> None:
    with pytest.raises(LocalProtocolError, match="no whole number"):
        JointMotor(nets(), step_um_per_s=1, ramp_um_per_s2=ramp, dt_ns=MS)


def test_a_wheel_a_little_behind_its_start_shows_the_last_sector() -> None:
    wires = nets()
    encoder = WheelEncoder(wires)
    for number, (angle_deg, code) in enumerate([(0, 0), (44.9, 0), (45.1, 1), (359, 7), (361, 0), (-1, 7), (-361, 7)]):
        encoder.show(math.radians(angle_deg), number)
        assert sum(net.level(number) << bit for bit, net in enumerate(wires)) == code, angle_deg


def test_at_the_threshold_is_not_nearer() -> None:
    wires = nets(3)
    reported: list[tuple[int, list[float]]] = []
    sensors = DistanceSensors(wires, threshold_um=600_000, period_ns=50 * MS)
    sensors.on_sample = lambda at, metres: reported.append((at, list(metres)))
    sensors.sample([0.599_999, 0.6, 5.0], 7)
    assert [net.level(7) for net in wires] == [True, False, False]
    assert sensors.next_deadline() == 7 + 50 * MS
    assert reported == [(7, [0.599_999, 0.6, 5.0])]


def robot(encoder_nets: list[Net] | None = None) -> tuple[DirectRobot, list[Net], list[Net], list[Net]]:
    parameters = load_parameters("p2dx")
    world = load_world("room")
    body = make_body("kinematic", world, parameters)
    body.reset(world.start, 0)
    left, right, distances = nets(), nets(), nets(8)
    for name, motor_nets in (("l", left), ("r", right)):
        for net in motor_nets:
            net.name = name + net.name
    made = DirectRobot(
        body,
        left=JointMotor(left, step_um_per_s=62_500, ramp_um_per_s2=300_000, dt_ns=body.dt_ns),
        right=JointMotor(right, step_um_per_s=62_500, ramp_um_per_s2=300_000, dt_ns=body.dt_ns),
        encoders=(WheelEncoder(encoder_nets or nets()), WheelEncoder(nets())),
        sensors=DistanceSensors(distances, threshold_um=600_000, period_ns=50 * MS),
        sonar_numbers=range(8),
        encoder_period_ns=5 * MS,
    )
    return made, left, right, distances


def test_three_steps_for_two_seconds_is_three_steps_of_way() -> None:
    made, left, right, _ = robot()
    set_value(left, 3, 0)
    set_value(right, 3, 0)
    made.advance_to(2_000 * MS)
    # 187.5 mm/s less the ramp's triangle: half of 0.625 s at 187.5 mm/s, and half a step of 0.3 mm/s.
    assert made.body.state.x_m == pytest.approx(0.1875 * 2 - 0.1875 * 0.625 / 2, abs=1e-3)


@pytest.mark.parametrize(
    ("ramp", "steps", "fastest"),
    [(300_000, 1, 600), (300_000, 50, 15_300), (300_000, 2000, 250_000), (None, 1, 250_000)],
)
def test_the_fastest_of_the_next_steps_is_what_the_ramp_allows(ramp: int | None, steps: int, fastest: int) -> None:
    made = nets()
    motor = JointMotor(made, step_um_per_s=62_500, ramp_um_per_s2=ramp, dt_ns=MS)
    set_value(made, 3, 0)
    motor.step(0)
    set_value(made, -4, MS)
    assert motor.fastest_um_per_s(steps) == fastest


@given(st.integers(0, 2_000), st.sampled_from([-4, 3]), st.sampled_from([-1, 1, 3]))
@settings(max_examples=15)
def test_no_encoder_changes_before_the_deadline_whatever_the_wires_come_to_say(at: int, later: int, value: int) -> None:
    shown = nets()
    made, left, right, _ = robot(shown)
    for motor_nets in (left, right):
        set_value(motor_nets, value, 0)
    made.advance_to(at * MS)
    due = made.next_deadline()
    before = [net.level(at * MS) for net in shown]
    for motor_nets in (left, right):
        set_value(motor_nets, later, at * MS)
    made.advance_to(due - 1)
    assert [net.level(due - 1) for net in shown] == before


def test_a_robot_that_creeps_is_not_looked_at_as_if_it_raced() -> None:
    made, left, right, _ = robot()
    for motor_nets in (left, right):
        set_value(motor_nets, 1, 0)
    made.advance_to(1_000 * MS)
    looks = 0
    while (due := made.next_deadline()) <= 2_000 * MS:
        made.advance_to(due)
        looks += 1
    # 20 of the sensors, and a few before each sector of 65 mm; by the greatest speed that there is, 39 in all.
    assert 20 <= looks <= 28


@given(st.lists(st.integers(1, 300 * MS), max_size=8))
@settings(max_examples=15)
def test_how_often_it_is_brought_forward_changes_nothing(cuts: list[int]) -> None:
    ends = []
    for times in ([], sorted(cuts)):
        made, left, right, distances = robot()
        set_value(left, 3, 0)
        set_value(right, 3, 0)
        set_value(right, -4, 120 * MS + 1)
        for at in [*times, 301 * MS]:
            made.advance_to(at)
        ends.append((made.body.state, [net.edges_until(301 * MS) for net in distances], made.next_deadline()))
    assert ends[0] == ends[1]


@pytest.mark.parametrize("step_ns", [5 * MS - 1, 5 * MS, 5 * MS + 1, 17 * MS, 1_000 * MS])
def test_an_encoder_shows_the_step_that_ended_at_its_instant_however_many_are_made_at_once(
    step_ns: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    shown: list[tuple[float, int]] = []
    monkeypatch.setattr(WheelEncoder, "show", lambda _encoder, angle_rad, now: shown.append((angle_rad, now)))

    def shows(every_ns: int) -> list[tuple[float, int]]:
        made, left, right, _ = robot()
        for wires in (left, right):
            set_value(wires, 3, 0)
        shown.clear()
        for at in (*range(every_ns, 1_000 * MS, every_ns), 1_000 * MS):
            made.advance_to(at)
        return [*shown]

    made, *_ = robot()
    made.advance_to(0)
    assert shown == [(0.0, 0)] * 2
    each = shows(MS)
    assert [at for _, at in each[::2]] == list(range(0, 1_001 * MS, 5 * MS))
    assert each[-1][0] > each[-3][0] > each[-5][0] > 0.0
    assert shows(step_ns) == each


def test_a_step_reads_the_wires_at_its_start() -> None:
    for change_at, steps in ((10 * MS, 10), (10 * MS + 1, 11)):
        made, left, _, _ = robot()
        set_value(left, 0, 0)
        set_value(left, 1, change_at)
        made.advance_to(20 * MS)
        assert made.body.state.left_speed_mps == pytest.approx((20 - steps) * 300 / 1e6)


def test_a_restored_robot_goes_on_alike() -> None:
    first, left, right, _ = robot()
    set_value(left, 2, 0)
    set_value(right, 3, 0)
    first.advance_to(333 * MS)
    second, left, right, _ = robot()
    set_value(left, 2, 0)
    set_value(right, 3, 0)
    second.restore(pickle.loads(pickle.dumps(first.snapshot())))  # noqa: S301 - our own bytes
    for made in (first, second):
        made.advance_to(700 * MS)
    assert second.body.state == first.body.state
    assert second.snapshot() == first.snapshot()


@pytest.mark.parametrize("name", ["step_um_per_s", "sensor_period_ns", "encoder_period_ns"])
def test_settings_of_zero_are_refused(name: str) -> None:
    with pytest.raises(UsageError, match=name):
        DirectSettings(**{name: 0})  # type: ignore[arg-type]
