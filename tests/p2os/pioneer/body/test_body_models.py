"""The bodies' contract for every robot model: its own wheels, track, hull and ring."""

import math
import pickle

import pytest

from p2os.pioneer.body.factory import BODY_NAMES, make_body
from p2os.pioneer.world.model import Obstacle, Pose, World
from p2os.robots.parameters import RobotParameters, known_robots, load_parameters
from tests.p2os.pioneer.body.bodies import Maker, drive, marks_of, ramped

#: The quick ones: one of each build (two wheels and a caster, four wheels, small, large).
QUICK = {"p2dx", "p3at", "amigo", "powerbot"}
EMPTY = World(name="e", source="e", description="", start=Pose(0, 0, 0), extent=(-4, -4, 4, 4), obstacles=())


@pytest.fixture(
    params=[
        pytest.param(
            (engine, model),
            id=f"{engine}-{model}",
            marks=[*marks_of(engine), *([] if model in QUICK else [pytest.mark.slow])],
        )
        for model in known_robots()
        for engine in BODY_NAMES
    ]
)
def robot(request: pytest.FixtureRequest) -> tuple[RobotParameters, Maker]:
    engine, model = request.param
    parameters = load_parameters(model)
    return parameters, lambda world=EMPTY: make_body(engine, world, parameters)


def test_it_stands_level_drives_straight_and_turns_as_its_wheels_say(robot: tuple[RobotParameters, Maker]) -> None:
    parameters, make = robot
    body, track = make(), parameters.track_mm / 1000
    still = drive(body, 0.0, 0.0, 0.5)
    assert math.hypot(still.x_m, still.y_m) < 1e-4
    assert abs(still.pitch_rad) < math.radians(0.5)
    assert abs(still.z_m) < 0.003
    line = ramped(body, 0.2, 0.2, 1.5)
    assert math.hypot(line.x_m - 0.2, line.y_m) < 0.0005
    assert line.left_angle_rad * parameters.body.wheel_diameter_m / 2 == pytest.approx(0.2, abs=5e-4)
    # 0.5 rad each way: the rims differ by half a track.
    turned = ramped(body, -track / 4, track / 4, 1.5)
    assert turned.heading_rad == pytest.approx(0.5, abs=math.radians(0.1))
    assert turned.collisions == 0


def test_the_same_calls_and_a_restore_give_the_same_bits(robot: tuple[RobotParameters, Maker]) -> None:
    parameters, make = robot
    body = make()
    body.place(Obstacle(name="post", x_m=1.2, y_m=0.0, radius_m=0.1, height_m=0.6))
    drive(body, 0.3, 0.28, 0.5)
    saved = pickle.loads(pickle.dumps(body.snapshot()))  # noqa: S301  # our own bytes
    numbers = range(parameters.sonar_fitted)
    here = [drive(body, 0.2, 0.25, 0.2), body.ranges(numbers), body.clearance()]
    for other in (body, make()):
        other.restore(saved)
        assert [drive(other, 0.2, 0.25, 0.2), other.ranges(numbers), other.clearance()] == here


def test_stop_is_stop_and_a_wall_stops_it(robot: tuple[RobotParameters, Maker]) -> None:
    parameters, make = robot
    body = make()
    # With ramps, as its firmware drives: a PatrolBot that stops at once from 0.2 m/s tips forward onto its nose.
    ramped(body, 0.2, 0.2, 1.0)
    stopped = drive(body, 0.0, 0.0, 1.0)
    later = drive(body, 0.0, 0.0, 0.5)
    assert math.hypot(later.x_m - stopped.x_m, later.y_m - stopped.y_m) < 1e-4
    front = stopped.x_m + parameters.body.hull_front_m
    body.place(Obstacle(name="wall", x_m=front + 0.2, y_m=0.0, length_m=0.2, width_m=4.0, height_m=1.0))
    drive(body, 0.2, 0.2, 1.5)
    stuck = body.state
    assert stuck.x_m + parameters.body.hull_front_m == pytest.approx(front + 0.1, abs=0.004)
    assert stuck.collisions == 1
