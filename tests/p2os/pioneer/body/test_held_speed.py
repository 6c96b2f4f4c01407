"""A body makes many steps at once where nothing changes: each the very one that `step`, or its scene, would make."""

import pickle
from typing import TYPE_CHECKING, cast

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from p2os.pioneer.body.contacts import APART_STEPS
from p2os.pioneer.body.contract import RobotBody
from p2os.pioneer.body.factory import make_body
from p2os.pioneer.body.kinematic import WALK_STEPS
from p2os.pioneer.body.physical import BACK_DRIVE, UNPOWERED_SHARE
from p2os.pioneer.world import parse_world
from p2os.pioneer.world.model import Obstacle, Walk
from p2os.robots.parameters import load_parameters
from tests.p2os.pioneer.body.bodies import drive, each_body

if TYPE_CHECKING:
    from p2os.pioneer.body.engine_body import EngineBody
    from p2os.pioneer.body.mujoco import MujocoBody

SPEEDS = st.sampled_from((0.0, 0.1, 0.3, -0.2, 0.30000001))
COUNTS = st.sampled_from((0, 1, 2, WALK_STEPS - 1, WALK_STEPS, APART_STEPS - 1, APART_STEPS, APART_STEPS + 1, 350))
SCENES = {
    "free": (),
    "before a wall": (Obstacle(name="wall", x_m=0.33, y_m=0.0, length_m=0.2, width_m=2.0, height_m=1.0),),
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


@pytest.mark.slow
@example("before a wall", [(0.3, 0.3, 400), AWAY, (-0.2, -0.2, APART_STEPS - 3), (-0.2, -0.2, 1), (-0.2, -0.2, 1)])
@example("before a wall", [(0.3, 0.3, 400), AWAY, (0.3, 0.3, 2), (-0.2, -0.2, 400), (0.3, 0.3, 400)])
@example("free", [(0.1, 0.1 + 2e-7, 900)])
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


RAMPS = st.lists(st.tuples(SPEEDS, SPEEDS, st.sampled_from((1, 2, 8, APART_STEPS))), min_size=1, max_size=6)


@example("before a wall", [(0.3, 0.3, 400), (-0.2, -0.2, APART_STEPS + 3), (0.3, 0.3, 400), (0.3, 0.3, 2)])
@example("before a wall", [(0.3, 0.3, 400), (0.0, 0.0, APART_STEPS), (-0.01, -0.01, 2)])
@example("beside a walker", [(0.1, 0.3, 2 * WALK_STEPS), (0.0, 0.0, WALK_STEPS), (0.1, 0.1, 900)])
@example("free", [(0.1, 0.1, 2), (0.1, 0.1 + 2e-7, 2), (0.3, 0.3, 1), (0.3, 0.3, 2)])
@settings(max_examples=100)
@given(st.sampled_from(sorted(SCENES)), RAMPS)
def test_a_ramp_is_the_same_steps(scene: str, legs: list[tuple[float, float, int]]) -> None:
    ramped, stepped = make_kinematic(), make_kinematic()
    for body in (ramped, stepped):
        for thing in SCENES[scene]:
            body.place(thing)
    setpoints = [(left_mps, right_mps) for left_mps, right_mps, steps in legs for _ in range(steps)]
    assert ramped.ramp(setpoints) == [stepped.step(*asked) for asked in setpoints]
    assert ramped.state == stepped.state
    assert pickle.dumps(ramped.snapshot()) == pickle.dumps(stepped.snapshot())


def test_a_robot_that_has_backed_off_a_wall_drives_on_with_the_speed_that_it_stalled_at() -> None:
    body = make_kinematic()
    body.place(SCENES["before a wall"][0])
    assert body.hold(0.3, 0.3, 400)[-1].stalled_left
    before_m = body.state.x_m
    body.hold(-0.3, -0.3, 400)
    ends = body.hold(0.3, 0.3, 410)
    assert [wheels.stalled_left for wheels in ends].index(True) in range(399, 402)
    assert body.state.x_m == pytest.approx(before_m, abs=0.0004)
    assert body.state.collisions == 2


@pytest.mark.parametrize("engine", each_body("kinematic"))
@pytest.mark.parametrize("scene", ["free", "before a wall", "beside a walker"])
def test_a_robot_alone_on_an_engine_makes_the_steps_that_its_scene_makes(scene: str, engine: str) -> None:
    world = parse_world('name = "empty"\nextent_m = [-4, -4, 4, 4]', "empty")
    alone, in_scene = (cast("EngineBody", make_body(engine, world, load_parameters("p2dx"))) for _ in range(2))
    for body in (alone, in_scene):
        for thing in SCENES[scene]:
            body.place(thing)
    for left_mps, right_mps, is_powered, steps in (
        (0.5, 0.5, True, 500), (-0.2, -0.1, True, 1), (0, 0, True, 300), (0, 0, False, 60), (-0.3, 0.3, True, 7),
    ):  # fmt: skip
        alone.is_powered = in_scene.is_powered = is_powered
        made = alone.hold(left_mps, right_mps, steps)
        assert made == [in_scene.scene.step(((left_mps, right_mps),))[0] for _ in range(steps)]
        assert alone.state == in_scene.state
    setpoints = [(0.1 * share, 0.3) for share in (1, 1, 2, 3)]
    assert alone.ramp(setpoints) == [in_scene.scene.step((asked,))[0] for asked in setpoints]
    assert alone.state == in_scene.state
    alone.put_back()
    in_scene.put_back()
    assert alone.step(-0.3, 0.3) == in_scene.scene.step(((-0.3, 0.3),))[0]
    assert alone.state == in_scene.state
    saved = alone.snapshot()
    went_on = alone.hold(0.4, 0.4, 30)
    alone.restore(saved)
    assert alone.hold(0.4, 0.4, 30) == went_on, "what the motors were told before is forgotten"


@pytest.mark.parametrize("engine", each_body("kinematic"))
def test_a_wall_is_met_in_the_same_step_though_nobody_looks_for_it_while_it_is_far(engine: str) -> None:
    world = parse_world('name = "empty"\nextent_m = [-4, -4, 4, 4]', "empty")
    sparing, looking = (make_body(engine, world, load_parameters("p2dx")) for _ in range(2))
    for body in (sparing, looking):
        body.place(Obstacle(name="wall", x_m=2.0, y_m=0.0, length_m=0.2, width_m=2.0, height_m=1.0))
    # With a thing about that can be pushed, each step is looked at.
    looking.place(Obstacle(name="ball", x_m=-3.0, y_m=3.0, radius_m=0.1, height_m=0.2, mass_kg=1.0))

    def touches(body: RobotBody) -> list[tuple[int, bool]]:
        return [(state.collisions, state.in_contact) for state in (drive(body, 2.0, 2.0, 0.002) for _ in range(650))]

    met = [touches(body) for body in (sparing, looking)]
    assert met[0] == met[1]
    assert met[0][-1][0] > 0


@pytest.mark.mujoco
def test_mujocos_motors_hold_what_has_come_to_rest_through_a_rebuild_and_a_restore() -> None:
    pytest.importorskip("mujoco")
    world, parameters = parse_world('name = "empty"\nextent_m = [-4, -4, 4, 4]', "empty"), load_parameters("p2dx")
    body, other = (cast("MujocoBody", make_body("mujoco", world, parameters)) for _ in range(2))

    def shares_of(one: "MujocoBody") -> list[float]:
        return [float(most) / parameters.body.motor_torque_nm for most in one.scene.model.tendon_frictionloss]

    body.hold(0.2, 0.2, 50)
    assert shares_of(body) == pytest.approx([1.0, 1.0])
    body.hold(0.0, 0.0, 300)
    assert shares_of(body) == pytest.approx([BACK_DRIVE] * 2)
    body.place(Obstacle(name="post", x_m=1.0, y_m=0.0, radius_m=0.1, height_m=0.6))
    body.hold(0.0, 0.0, 1)
    assert shares_of(body) == pytest.approx([BACK_DRIVE] * 2), "in a model that was made anew"
    saved = body.snapshot()
    body.is_powered = False
    body.hold(0.0, 0.0, 1)
    assert shares_of(body) == pytest.approx([UNPOWERED_SHARE] * 2)
    for one in (body, other):
        one.restore(saved)
        one.hold(0.0, 0.0, 1)
        assert shares_of(one) == pytest.approx([BACK_DRIVE] * 2)


@pytest.mark.bullet
def test_bullets_motors_are_told_what_is_new_to_them_and_nothing_else(monkeypatch: pytest.MonkeyPatch) -> None:
    pybullet = pytest.importorskip("pybullet")
    world = parse_world('name = "empty"\nextent_m = [-4, -4, 4, 4]', "empty")
    body, reported = make_body("bullet", world, load_parameters("p2dx")), list[float]()
    tell = pybullet.setJointMotorControlArray

    def note(*words: object, forces: list[float], **more: object) -> None:
        reported.append(forces[0])
        tell(*words, forces=forces, **more)

    monkeypatch.setattr(pybullet, "setJointMotorControlArray", note)
    body.hold(0.2, 0.2, 50)
    assert len(reported) == 1
    body.hold(0.2, 0.2, 50)
    assert len(reported) == 1
    body.hold(0.0, 0.0, 300)
    assert len(reported) == 3, "the set-point, and that it has come to rest"
    body.is_powered = False
    body.hold(0.0, 0.0, 10)
    assert reported[3:] == [pytest.approx(reported[1] * UNPOWERED_SHARE)]
    body.is_powered = True
    body.hold(0.0, 0.0, 10)
    assert reported[4:] == [reported[2]]
