"""The bodies' contract for every robot model: its own wheels, track, hull and ring."""

import math
import pickle

import pytest

from p2os.pioneer.body.contract import RobotBody
from p2os.pioneer.body.factory import engines, make_body
from p2os.pioneer.world.model import Obstacle, Pose, World
from p2os.robots.parameters import RobotParameters, known_robots, load_parameters
from tests.p2os.pioneer.body.bodies import Maker, drive, each_body, marks_of, ramped

EMPTY = World(name="e", source="e", description="", start=Pose(0, 0, 0), extent=(-4, -4, 4, 4), obstacles=())


def build_of(parameters: RobotParameters) -> tuple[object, ...]:
    """Return what a body takes from a model."""
    ring = (parameters.sonar, parameters.sonar_fitted, parameters.sonar_cone_deg, parameters.sonar_height_m,
            parameters.sonar_range_m, parameters.sonar_min_range_m)  # fmt: skip
    return parameters.body, parameters.track_mm, parameters.rotor_inertia_kg_m2, ring


#: The models of each build, by the first of them.
BUILDS: dict[str, list[str]] = {}
for _model in known_robots():
    _build = build_of(load_parameters(_model))
    BUILDS.setdefault(next((name for name in BUILDS if build_of(load_parameters(name)) == _build), _model), []).append(
        _model
    )


#: Of the two engines, which take long, each build has one in turn; the other one in `make soak`.
ENGINES = ("bullet", "mujoco")


def marks_of_build(engine: str, place: int) -> list[pytest.MarkDecorator]:
    is_others_turn = engine in ENGINES and ENGINES[place % 2] != engine
    return [*marks_of(engine), *([pytest.mark.soak] if is_others_turn else [])]


@pytest.fixture(
    params=[
        pytest.param((engine, model), id=f"{engine}-{model}", marks=marks_of_build(engine, place))
        for place, model in enumerate(BUILDS)
        for engine in engines()
    ]
)
def robot(request: pytest.FixtureRequest) -> tuple[RobotParameters, Maker]:
    engine, model = request.param
    parameters = load_parameters(model)
    return parameters, lambda world=EMPTY: make_body(engine, world, parameters)


@pytest.mark.parametrize("engine", each_body())
@pytest.mark.parametrize("models", [models for models in BUILDS.values() if len(models) > 1], ids="-".join)
def test_models_of_one_build_are_one_body(models: list[str], engine: str) -> None:
    def life(model: str) -> list[object]:
        body = make_body(engine, EMPTY, load_parameters(model))
        body.place(Obstacle(name="post", x_m=1.2, y_m=0.3, radius_m=0.1, height_m=0.6))
        return [drive(body, 0.3, 0.2, 0.05), body.ranges(range(8)), body.clearance(), pickle.dumps(body.snapshot())]

    assert [life(model) for model in models[1:]] == [life(models[0])] * (len(models) - 1)


def test_it_drives_straight_turns_as_its_wheels_say_stops_and_goes_on_from_a_restore_with_the_same_bits(
    robot: tuple[RobotParameters, Maker],
) -> None:
    parameters, make = robot
    body, track, front_m = make(), parameters.track_mm / 1000, parameters.body.hull_front_m
    still = drive(body, 0.0, 0.0, 0.1)
    assert math.hypot(still.x_m, still.y_m) < 1e-4
    assert abs(still.pitch_rad) < math.radians(0.5)
    assert abs(still.z_m) < 0.003
    # With ramps, as its firmware drives: a PatrolBot that stops at once from 0.2 m/s tips forward onto its nose.
    line = ramped(body, 0.2, 0.2, 1.2)
    assert math.hypot(line.x_m - 0.14, line.y_m) < 0.0005
    assert line.left_angle_rad * parameters.body.wheel_diameter_m / 2 == pytest.approx(0.14, abs=5e-4)
    # 0.5 rad: the rims differ by half a track.
    turned = ramped(body, -track * 0.5 / 1.4, track * 0.5 / 1.4, 1.2)
    assert turned.heading_rad == pytest.approx(0.5, abs=math.radians(0.1))
    assert turned.collisions == 0
    later = drive(body, 0.0, 0.0, 0.2)
    assert math.hypot(later.x_m - turned.x_m, later.y_m - turned.y_m) < 1e-4
    c, s, ahead_m = math.cos(later.heading_rad), math.sin(later.heading_rad), front_m + 0.2
    numbers = range(parameters.sonar_fitted)
    body.place(Obstacle(name="wall", x_m=later.x_m + ahead_m * c, y_m=later.y_m + ahead_m * s,
                        heading_rad=later.heading_rad, length_m=0.2, width_m=4.0, height_m=1.0))  # fmt: skip
    drive(body, 0.2, 0.2, 0.3)
    saved = pickle.loads(pickle.dumps(body.snapshot()))  # noqa: S301  # our own bytes

    def end_of(one: RobotBody) -> list[object]:
        return [drive(one, 0.2, 0.2, 0.4), one.ranges(numbers), one.clearance()]

    here, stuck = end_of(body), body.state
    way_m = (stuck.x_m - later.x_m) * c + (stuck.y_m - later.y_m) * s
    assert way_m == pytest.approx(0.1, abs=0.004)
    assert stuck.collisions == 1
    other = make()
    other.restore(saved)
    assert end_of(other) == here
