"""The parts of the controller that know nothing of a connection: odometer and sonar schedule."""

import math
from dataclasses import replace
from types import SimpleNamespace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from p2os.pioneer.body.contract import BodyState, Turned
from p2os.pioneer.body.factory import make_body
from p2os.pioneer.controller import ControllerSettings, Pioneer, bumper_watch
from p2os.pioneer.controller.dead_reckoning import POSITION_MODULUS, DeadReckoning, raw_angle
from p2os.pioneer.controller.reporter import _standard_packet
from p2os.pioneer.sonar.schedule import LARGEST_COUNTS, NO_ECHO_COUNTS, SonarSchedule, raw_range
from p2os.pioneer.world import load_world
from p2os.protocol.odometry import Odometry
from p2os.protocol.profiles import Profile
from p2os.robots.parameters import known_robots, load_parameters

#: A wheel whose rim moves 1 mm per milliradian.
DIAMETER_M = 2.0
TRACK_MM = 400
NM_PER_COUNT = 840_000


def reckoning() -> DeadReckoning:
    return DeadReckoning(wheel_diameter_m=DIAMETER_M, track_mm=TRACK_MM)


def test_driving_straight_counts_along_the_heading() -> None:
    odometer = reckoning()
    odometer.begin(5.0, -3.0)  # wherever the wheels stand
    odometer.follow([Turned(5.84, -2.16)])
    assert odometer.x_mm == pytest.approx(840)
    assert odometer.raw_position(NM_PER_COUNT) == (1000, 0)
    assert odometer.travel_mm == pytest.approx(840)


def test_turning_on_the_spot_turns_by_the_track() -> None:
    odometer = reckoning()
    half_turn = math.pi * TRACK_MM / 2 / 1000
    odometer.follow([Turned(-half_turn, half_turn)])
    assert odometer.heading_rad == pytest.approx(math.pi)
    assert odometer.x_mm == 0
    assert odometer.y_mm == 0


def test_an_arc_in_small_steps_ends_on_its_circle() -> None:
    odometer = reckoning()
    for step in range(1, 1001):
        odometer.follow([Turned(step * 0.8 * math.pi / 2 / 1000, step * 1.2 * math.pi / 2 / 1000)])
    # A quarter of a circle of 1 m radius, anticlockwise.
    assert odometer.heading_rad == pytest.approx(math.pi / 2)
    assert odometer.x_mm == pytest.approx(1000, abs=0.01)
    assert odometer.y_mm == pytest.approx(1000, abs=0.01)


@given(st.lists(st.tuples(st.floats(-50, 50), st.floats(-50, 50)), min_size=1, max_size=20), st.integers(0, 20))
def test_what_is_counted_is_the_way_of_each_rim_however_it_comes(
    angles: list[tuple[float, float]], together: int
) -> None:
    """Of wheels of 2 m across, so that a radian is a metre; the sum of all ways, and the turn by the track."""
    odometer, steps = reckoning(), [Turned(*pair) for pair in angles]
    odometer.follow(steps[:together])
    odometer.follow(steps[together:])
    left_mm, right_mm = (angle * 1000 for angle in angles[-1])
    assert (odometer.left_mm, odometer.right_mm) == pytest.approx((left_mm, right_mm), abs=1e-6)
    assert odometer.travel_mm == pytest.approx((left_mm + right_mm) / 2, abs=1e-6)
    assert odometer.turned_rad == pytest.approx((right_mm - left_mm) / TRACK_MM, abs=1e-6)


def test_a_new_origin_moves_the_pose_but_not_the_odometer() -> None:
    odometer = reckoning()
    odometer.follow([Turned(0.1, 0.3)])
    turned, travelled = odometer.turned_rad, odometer.travel_mm
    odometer.set_origin()
    assert (odometer.x_mm, odometer.y_mm, odometer.heading_rad) == (0, 0, 0)
    assert (odometer.turned_rad, odometer.travel_mm, odometer.zero_rad) == (turned, travelled, turned)
    odometer.follow([Turned(1.1, 1.3)])
    assert odometer.x_mm == pytest.approx(1000)
    assert odometer.y_mm == pytest.approx(0)


def test_positions_are_counted_modulo_fifteen_bits() -> None:
    odometer = reckoning()
    odometer.follow([Turned(-0.00084, -0.00084)])
    assert odometer.raw_position(NM_PER_COUNT) == (POSITION_MODULUS - 1, 0)


@given(st.lists(st.tuples(st.floats(-50, 50), st.floats(-50, 50)), max_size=20))
def test_an_odometer_can_be_saved_and_restored(angles: list[tuple[float, float]]) -> None:
    odometer, twin = reckoning(), reckoning()
    for left, right in angles:
        odometer.follow([Turned(left, right)])
    twin.restore(odometer.snapshot())
    for each in (odometer, twin):
        each.follow([Turned(1.0, 2.0)])
    assert twin.snapshot() == odometer.snapshot()


@pytest.mark.parametrize(
    ("angle", "raw"),
    [(0.0, 0), (math.pi / 2, 1024), (math.pi, -2048), (-math.pi, -2048), (math.pi - 0.001, 2047), (20 * math.pi, 0)],
)
def test_an_angle_is_sent_in_4096ths_of_a_turn(angle: float, raw: int) -> None:
    assert raw_angle(angle, 4096) == raw


@pytest.mark.parametrize("model", known_robots())
@pytest.mark.parametrize("degrees", [90, -90, 179])
def test_a_model_counts_its_headings_as_its_clients_read_them(model: str, degrees: int) -> None:
    """A Pioneer 1 has 1024 counts a turn; ARIA's and player's tables of models agree on it."""
    parameters = load_parameters(model)
    body = make_body("kinematic", load_world("room"), parameters)
    context = Pioneer(parameters=parameters, body=body, settings=ControllerSettings())._context
    context.reckoning.drift(math.radians(degrees))
    sip = _standard_packet(context, BodyState(), parameters, (False, False), (0, 0), 0)
    odometry = Odometry(parameters)
    odometry.update(sip)
    assert math.degrees(odometry.heading_rad) == pytest.approx(degrees, abs=180 / parameters.angle_counts_per_turn)
    assert sip.raw_control == sip.raw_heading


# Sonar -------------------------------------------------------------------------------

CYCLE = 100


def cycle(schedule: SonarSchedule, start: int) -> list[tuple[int, tuple[int, ...]]]:
    """Live through one cycle; returns (time, numbers) of each ping."""
    schedule.start_cycle(start)
    pings = []
    while (ping := schedule.next_ping()) is not None:
        pings.append((ping.at, ping.numbers))
        schedule.take_ping([(number, 1000 + number) for number in ping.numbers])
    return pings


def test_two_sonar_fire_a_cycle_in_ring_order() -> None:
    schedule = SonarSchedule(8, pings_per_cycle=2, cycle_ns=CYCLE)
    assert cycle(schedule, 0) == [(50, (0,)), (100, (1,))]
    assert schedule.take_readings() == ((0, 1000), (1, 1001))
    assert schedule.take_readings() == ()
    numbers = [number for start in range(100, 500, 100) for _, pinged in cycle(schedule, start) for number in pinged]
    assert numbers == [2, 3, 4, 5, 6, 7, 0, 1]


def test_all_sonar_fire_at_the_end_of_the_cycle() -> None:
    schedule = SonarSchedule(8, pings_per_cycle=None, cycle_ns=CYCLE)
    assert cycle(schedule, 0) == [(100, tuple(range(8)))]
    assert len(schedule.take_readings()) == 8


def test_a_bank_that_is_off_neither_fires_nor_reports() -> None:
    schedule = SonarSchedule(8, pings_per_cycle=2, cycle_ns=CYCLE)
    cycle(schedule, 0)
    schedule.switch(on=False, now=100)
    assert schedule.take_readings() == ()
    assert cycle(schedule, 100) == []


def test_a_bank_switched_on_in_a_cycle_fires_what_is_still_to_come() -> None:
    schedule = SonarSchedule(8, pings_per_cycle=2, cycle_ns=CYCLE)
    schedule.switch(on=False, now=0)
    schedule.start_cycle(0)
    schedule.switch(on=True, now=50)
    ping = schedule.next_ping()
    assert ping is not None
    assert (ping.at, ping.numbers) == (100, (0,))
    schedule.switch(on=True, now=99)
    assert schedule.next_ping() == ping


def test_the_firing_order_can_be_set_repeated_and_emptied() -> None:
    schedule = SonarSchedule(8, pings_per_cycle=2, cycle_ns=CYCLE)
    schedule.poll([3, 3, 99, -1, 5], now=0)
    numbers = [number for start in (0, 100) for _, pinged in cycle(schedule, start) for number in pinged]
    assert numbers == [3, 3, 5, 3]
    schedule.poll([], now=200)
    assert cycle(schedule, 200) == []
    schedule.poll([1], now=260)
    ping = schedule.next_ping()
    assert ping is not None
    assert (ping.at, ping.numbers) == (300, (1,))


def test_a_schedule_can_be_saved_and_restored_between_pings() -> None:
    schedule, twin = (SonarSchedule(8, pings_per_cycle=2, cycle_ns=CYCLE) for _ in range(2))
    cycle(schedule, 0)
    schedule.start_cycle(100)
    schedule.take_ping([(2, 5)])
    twin.restore(schedule.snapshot())
    assert twin.next_ping() == schedule.next_ping()
    assert twin.take_readings() == schedule.take_readings()


@pytest.mark.parametrize(
    ("range_m", "counts", "profile"),
    [
        (0.268, 1000, Profile.P2OS),
        (1.0, 3731, Profile.P2OS),
        (4.999, 18653, Profile.P2OS),
        (5.0, NO_ECHO_COUNTS, Profile.P2OS),
        (9.0, NO_ECHO_COUNTS, Profile.P2OS),
        (0.0, 373, Profile.P2OS),  # 0.1 m is the shortest
        (5.0, 18657, Profile.AROS),
        (9.0, 18657, Profile.ARCOS),
    ],
)
def test_a_range_is_sent_in_counts_and_no_echo_in_its_own(range_m: float, counts: int, profile: Profile) -> None:
    assert raw_range(range_m, load_parameters("p2dx"), profile) == counts


def test_a_range_never_overflows_its_field() -> None:
    far = replace(load_parameters("p2dx"), sonar_range_m=100.0)
    assert raw_range(99.0, far, Profile.P2OS) == LARGEST_COUNTS


@pytest.mark.parametrize("segments", [1, 5, 6, 7])
def test_a_bumper_is_pressed_at_the_segment_of_its_bearing_and_none_beside_its_ring(segments: int) -> None:
    """Segment 1, the lowest bit, is the leftmost of the ring."""
    half, wide = bumper_watch.RING_RAD / 2, bumper_watch.RING_RAD / segments
    for number in range(segments):
        for share in (0.01, 0.5, 0.99):
            assert bumper_watch._touched(segments, half - (number + share) * wide) == 1 << number
    assert bumper_watch._touched(segments, half) == 1
    assert bumper_watch._touched(segments, -half) == 1 << segments - 1
    for bearing in (math.nextafter(half, 9.0), math.nextafter(-half, -9.0), math.pi):
        assert bumper_watch._touched(segments, bearing) == 0
    assert bumper_watch._touched(0, 0.0) == bumper_watch._middle(0) == 0
    assert bumper_watch._middle(segments) == {1: 1, 5: 0b100, 6: 0b1000, 7: 0b1000}[segments]


@pytest.mark.parametrize(
    ("wheels_mps", "at"),
    [((0.01, -0.009), "front"), ((0.01, -0.011), "rear"), ((0.4, -0.4), "front rear"), ((0.0, 0.0), "front rear")],
)
def test_a_contact_that_nobody_tells_the_bearing_of_is_where_the_robot_drives(
    wheels_mps: tuple[float, float], at: str
) -> None:
    context = SimpleNamespace(
        devices=SimpleNamespace(pins=SimpleNamespace(front_pressed=0, rear_pressed=0)),
        motion=SimpleNamespace(wheels_mps=wheels_mps),
    )
    body = SimpleNamespace(in_contact=True, contact_rad=None)
    flash = SimpleNamespace(number={"frontbumps": 5, "rearbumps": 5}.__getitem__)
    found = bumper_watch.pressed(context, body, flash)  # type: ignore[arg-type]  # what is asked of them
    assert found == tuple(bumper_watch._middle(5) * (side in at) for side in ("front", "rear"))
