"""The bodies against each other: the same set-points lead to the same place, the same echoes and the same stall.

The plan view is exact, so that what is measured here is what slips and lags in an
engine. Measured over 100 random sequences as below, on the floor of an empty
world: bullet ends at most 0.48 mm and 0.0003 degrees off, mujoco 1.33 mm and 0.0007
degrees. An engine's step moves along the heading that it began or ended with, which
in a turn is an error of the first order. About twice is allowed.
"""

import math
from collections.abc import Iterable

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from p2os.pioneer.body.contract import BodyState, RobotBody
from p2os.pioneer.body.factory import make_body
from p2os.pioneer.world import load_world
from p2os.pioneer.world.model import Pose, World
from p2os.robots.parameters import load_parameters
from tests.p2os.pioneer.body.bodies import drive, each_body, ramped

P2DX = load_parameters("p2dx")
TRACK_M = P2DX.track_mm / 1000
EMPTY = World(name="e", source="e", description="", start=Pose(0, 0, 0), extent=(-8, -8, 8, 8), obstacles=())
#: How far an engine may end from the exact pose after a few metres and turns: metres, radians.
ALLOWED = {"bullet": (0.001, math.radians(0.001)), "mujoco": (0.003, math.radians(0.002))}
#: Rim speed that changes by so much in a second is within what the motors' torque can do, m/s².
RAMP_MPS2 = 0.5

#: Left and right rim speed in m/s, and for how long they are held, s.
Leg = tuple[float, float, float]
#: Rim speed of a turn by 90 degrees in a ramped leg of 2 s, whose mean is three quarters of it.
QUARTER = math.pi / 2 / 1.5 * TRACK_M / 2
SIDE: Leg = (0.4, 0.4, 3.0)
SCRIPTED: dict[str, list[Leg]] = {
    "line back": [(-0.4, -0.4, 3.0)],
    "arc": [(0.3, 0.45, 4.0)],
    "square": [SIDE, (-QUARTER, QUARTER, 2.0)] * 4,
    "about one wheel": [(0.0, 0.4, 3.0)],
}


def through(body: RobotBody, legs: Iterable[Leg]) -> BodyState:
    """Drive from leg to leg with ramps, and stop at the end."""
    left = right = 0.0
    for to_left, to_right, held_s in (*legs, (0.0, 0.0, 0.3)):
        steps = math.ceil(max(abs(to_left - left), abs(to_right - right)) / RAMP_MPS2 * 1000)
        shares = [(step + 0.5) / steps for step in range(steps)]
        body.ramp([(left + (to_left - left) * share, right + (to_right - right) * share) for share in shares])
        drive(body, to_left, to_right, held_s)
        left, right = to_left, to_right
    return body.state


def assert_agree(engine: str, state: BodyState, exact: BodyState) -> None:
    """Compare two poses."""
    apart_m, turned_rad = ALLOWED[engine]
    assert math.hypot(state.x_m - exact.x_m, state.y_m - exact.y_m) < apart_m
    assert abs(math.remainder(state.heading_rad - exact.heading_rad, 2 * math.pi)) < turned_rad


@pytest.mark.parametrize("engine", each_body("kinematic"))
@pytest.mark.parametrize("script", SCRIPTED)
def test_a_scripted_way_ends_where_the_exact_one_does(script: str, engine: str) -> None:
    exact, body = (make_body(name, EMPTY, P2DX) for name in ("kinematic", engine))
    for leg in SCRIPTED[script]:
        ramped(exact, *leg)
        ramped(body, *leg)
    assert_agree(engine, body.state, exact.state)
    assert body.state.left_angle_rad == pytest.approx(exact.state.left_angle_rad, abs=0.002)
    assert (body.state.forward_mps, body.state.turn_radps) == pytest.approx((0.0, 0.0), abs=1e-3)
    assert body.state.collisions == exact.state.collisions == 0
    if script == "square":
        for end in (body.state, exact.state):
            assert math.hypot(end.x_m, end.y_m) < 0.001


@pytest.mark.parametrize("engine", each_body("kinematic"))
def test_any_short_way_ends_where_the_exact_one_does(engine: str) -> None:
    exact, body = (make_body(name, EMPTY, P2DX) for name in ("kinematic", engine))
    rims = st.floats(-0.5, 0.5, width=16)

    @settings(max_examples=5)
    @given(st.lists(st.tuples(rims, rims, st.floats(0.0, 0.5, width=16)), min_size=1, max_size=3))
    @example([(0.5, -0.5, 1.0), (-0.5, 0.5, 1.0)])
    @example([(0.5, 0.0, 1.0), (0.0, 0.5, 1.0), (-0.5, 0.0, 1.0)])
    def agrees(legs: list[Leg]) -> None:
        for each in (exact, body):
            each.reset(Pose(0, 0, 0), 0)
        assert_agree(engine, through(body, legs), through(exact, legs))

    agrees()


@pytest.mark.parametrize("engine", each_body("kinematic"))
def test_a_stop_at_once_takes_what_the_torque_needs(engine: str) -> None:
    body = make_body(engine, EMPTY, P2DX)
    begin = drive(body, 0.4, 0.4, 1.0)
    state = drive(body, 0.0, 0.0, 1.0)
    # Two motors of 1 Nm on wheels of 82.5 mm give 24.2 N; the robot is 9 kg, and its wheels turn with it (2/5 m each).
    slowing_mps2 = 2 * 1.0 / 0.0825 / (9.0 + 2 * 0.4 * 0.5)
    # It rocks on its wheels while it brakes, which takes or gives a few millimetres.
    assert state.x_m - begin.x_m == pytest.approx(0.4**2 / 2 / slowing_mps2, rel=0.15)
    assert state.forward_mps == pytest.approx(0.0, abs=1e-3)


@pytest.mark.parametrize("engine", each_body("kinematic"))
def test_the_same_wall_stalls_it_at_the_same_place(engine: str) -> None:
    exact, body = (make_body(name, load_world("room"), P2DX) for name in ("kinematic", engine))
    for each in (exact, body):
        each.reset(Pose(2.6, 0.3, 0.0), 0)
        drive(each, 0.2, 0.2, 2.0)
    assert body.state.x_m == pytest.approx(exact.state.x_m, abs=0.002)
    assert body.state.y_m == pytest.approx(exact.state.y_m, abs=0.002)
    assert body.clearance() == pytest.approx(exact.clearance(), abs=0.001)
    for state in (exact.state, body.state):
        assert (state.stalled_left, state.stalled_right, state.collisions, state.in_contact) == (True, True, 1, True)
    for each in (exact, body):
        drive(each, -0.2, -0.2, 1.0)
    for state in (exact.state, body.state):
        assert (state.stalled_left, state.stalled_right, state.collisions, state.in_contact) == (False, False, 1, False)


@pytest.mark.parametrize("engine", each_body("kinematic"))
def test_the_sonar_measure_the_same_after_a_way_through_the_room(engine: str) -> None:
    exact, body = (make_body(name, load_world("room"), P2DX) for name in ("kinematic", engine))
    for each in (exact, body):
        each.reset(Pose(-1.0, 0.0, 0.4), 0)
    for leg in ((0.3, 0.3, 1.5), (-0.3, 0.3, 1.2), (0.3, 0.2, 1.5), (0.2, -0.2, 1.2)):
        ramped(exact, *leg)
        ramped(body, *leg)
        # A pose that is 2 mm off sees a slanted wall some more off; a corner that one ray just misses would be far off.
        assert body.ranges(range(8)) == pytest.approx(exact.ranges(range(8)), abs=0.01)
        assert body.clearance() == pytest.approx(exact.clearance(), abs=0.003)
