"""The kinematic body makes many steps at once where nothing changes: each the very one that `step` would make."""

import pickle

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from p2os.pioneer.body.contacts import APART_STEPS
from p2os.pioneer.body.contract import RobotBody
from p2os.pioneer.body.factory import make_body
from p2os.pioneer.body.kinematic import WALK_STEPS
from p2os.pioneer.world import parse_world
from p2os.pioneer.world.model import Obstacle, Walk
from p2os.robots.parameters import load_parameters

SPEEDS = st.sampled_from((0.0, 0.1, 0.3, -0.2, 0.30000001))
COUNTS = st.sampled_from((0, 1, 2, WALK_STEPS - 1, WALK_STEPS, APART_STEPS - 1, APART_STEPS, APART_STEPS + 1, 900))
SCENES = {
    "free": (),
    "before a wall": (Obstacle(name="wall", x_m=0.5, y_m=0.0, length_m=0.2, width_m=2.0, height_m=1.0),),
    "inside a thing": (Obstacle(name="post", x_m=0.1, y_m=0.0, radius_m=0.1, height_m=0.6),),
    "beside a walker": (
        Obstacle(
            name="walker", x_m=1.0, y_m=0.0, radius_m=0.2, height_m=1.0,
            walk=Walk(points_m=((1.0, 0.0), (-1.0, 0.0)), speed_mps=1.0),
        ),
    ),
}  # fmt: skip


def make_kinematic() -> RobotBody:
    world = parse_world('name = "empty"\nextent_m = [-4, -4, 4, 4]', "empty")
    return make_body("kinematic", world, load_parameters("p2dx"))


AWAY = (-0.2, -0.2, 2)


@example("before a wall", [(0.3, 0.3, 900), AWAY, (-0.2, -0.2, APART_STEPS - 3), (-0.2, -0.2, 1), (-0.2, -0.2, 1)])
@example("before a wall", [(0.3, 0.3, 900), AWAY, (0.3, 0.3, 2), (-0.2, -0.2, 900), (0.3, 0.3, 900)])
@example("free", [(0.1, 0.1 + 2e-7, 900)])
@settings(max_examples=150, deadline=None)
@given(st.sampled_from(sorted(SCENES)), st.lists(st.tuples(SPEEDS, SPEEDS, COUNTS), min_size=1, max_size=5))
def test_many_steps_at_once_are_the_same_steps(scene: str, legs: list[tuple[float, float, int]]) -> None:
    held, stepped = make_kinematic(), make_kinematic()
    for body in (held, stepped):
        for thing in SCENES[scene]:
            body.place(thing)
    for left_mps, right_mps, steps in legs:
        assert held.hold(left_mps, right_mps, steps) == [stepped.step(left_mps, right_mps) for _ in range(steps)]
        assert held.state == stepped.state
        assert pickle.dumps(held.snapshot()) == pickle.dumps(stepped.snapshot())


def test_a_robot_that_has_backed_off_a_wall_drives_on_with_the_speed_that_it_stalled_at() -> None:
    body = make_kinematic()
    body.place(SCENES["before a wall"][0])
    assert body.hold(0.3, 0.3, 900)[-1].stalled_left
    before_m = body.state.x_m
    body.hold(-0.3, -0.3, 400)
    ends = body.hold(0.3, 0.3, 410)
    assert [wheels.stalled_left for wheels in ends].index(True) in range(399, 402)
    assert body.state.x_m == pytest.approx(before_m, abs=0.0004)
    assert body.state.collisions == 2
