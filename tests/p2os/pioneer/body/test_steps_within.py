"""For how many steps a body promises that no wheel turns farther: never too many, and none where it may be pushed."""

import random

import pytest

from p2os.pioneer.body.contract import RobotBody
from p2os.pioneer.body.factory import make_body
from p2os.pioneer.world import parse_world
from p2os.pioneer.world.model import Obstacle
from p2os.robots.parameters import load_parameters
from tests.p2os.pioneer.body.bodies import each_body

EMPTY = parse_world('name = "empty"\nextent_m = [-9, -9, 9, 9]', "empty")
RIM_MPS, ROUNDING_RAD = 0.25, 1e-9


def make(name: str, model: str = "p2dx") -> RobotBody:
    body = make_body(name, EMPTY, load_parameters(model))
    body.hold(0.0, 0.0, 5)
    return body


@pytest.mark.parametrize("model", ["p2dx", "p3at", "amigo"])
@pytest.mark.parametrize("name", each_body("mujoco"))
def test_no_wheel_turns_farther_however_its_set_points_jump(name: str, model: str) -> None:
    body, chance, promised = make(name, model), random.Random(model), 0
    for _ in range(120):
        turn_rad = chance.choice((0.005, 0.02, 0.1))
        steps = body.steps_within(turn_rad, RIM_MPS)
        promised += steps
        before, jumps = body.state, [(1, 1), (-1, 1), (1, -1), (0, 0), (-1, -1), (0.4, -0.7)]
        if chance.random() < 0.5:
            jumps = [chance.choice(jumps)]
        for _ in range(max(1, steps)):
            left, right = chance.choice(jumps)
            (wheels,) = body.hold(left * RIM_MPS, right * RIM_MPS, 1)
            if steps:
                assert abs(wheels.left_angle_rad - before.left_angle_rad) <= turn_rad + ROUNDING_RAD
                assert abs(wheels.right_angle_rad - before.right_angle_rad) <= turn_rad + ROUNDING_RAD
    assert promised > 100


def test_the_kinematic_body_promises_each_step_that_it_can() -> None:
    body = make("kinematic")
    rim_mps = load_parameters("p2dx").body.wheel_diameter_m / 2
    assert [body.steps_within(turn_rad, rim_mps) for turn_rad in (0.0, 0.0099, 0.01001, 0.0109)] == [0, 9, 10, 10]
    assert body.hold(rim_mps, rim_mps, 10)[-1].left_angle_rad == pytest.approx(0.01)


@pytest.mark.bullet
@pytest.mark.parametrize(
    "thing",
    [
        Obstacle(name="wall", x_m=0.35, y_m=0.0, length_m=0.2, width_m=2.0, height_m=1.0),
        Obstacle(name="box", x_m=3.0, y_m=0.0, length_m=0.2, width_m=0.2, height_m=0.5, mass_kg=2.0),
    ],
    ids=lambda thing: thing.name,
)
def test_bullet_promises_nothing_from_the_moment_that_something_is_placed_which_may_push_it(thing: Obstacle) -> None:
    pytest.importorskip("pybullet")
    body = make("bullet")
    assert body.steps_within(0.1, RIM_MPS) > 10
    body.place(thing)
    assert body.steps_within(0.1, RIM_MPS) == 0
    body.hold(0.0, 0.0, 100)
    assert body.steps_within(0.1, RIM_MPS) == 0
    body.remove(thing.name)
    body.hold(0.0, 0.0, 1)
    assert body.steps_within(0.1, RIM_MPS) > 10
