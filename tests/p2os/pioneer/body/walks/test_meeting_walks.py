"""Robots of the exact body that face, push and block each other, and that stand and go on, as approved."""

import math
import random
from collections.abc import Iterator
from unittest.mock import patch

from p2os.pioneer.body.contacts import APART_STEPS
from p2os.pioneer.body.contract import BodyState
from p2os.pioneer.body.factory import make_body, make_scene
from p2os.pioneer.body.in_world import StandingPose, free_name
from p2os.pioneer.body.kinematic import KinematicBody
from p2os.pioneer.world.model import Obstacle, ObstacleKind, Pose, Walk, World
from p2os.robots.parameters import load_parameters
from tests.tools.suite.approved import Trace, judge_of, said, tried

P2DX, AT, AMIGO, PATROL = MODELS = tuple(map(load_parameters, ("p2dx", "p3at", "amigo", "patrolbot-sh")))


def world(*things: Obstacle) -> World:
    return World(name="w", source="w", description="", start=Pose(0, 0, 0), extent=(-6, -6, 6, 6), obstacles=things)


POST = Obstacle(name="post", x_m=0.8, y_m=0.0, radius_m=0.05)
CRATE = Obstacle(name="crate", x_m=2.6, y_m=0.0, length_m=0.3, width_m=0.4, mass_kg=2.0)
WALL = Obstacle(name="wall", x_m=2.9, y_m=0.0, length_m=0.1, width_m=4.0, fixed=True)


def faced(draw: random.Random) -> Iterator[str]:
    """Ask which sonar of two robots see each other, near and far, aside, turned, with something between."""
    for things in ((), (POST,)):
        for model in (P2DX, PATROL):
            for far_m in (0.3, 0.6, 1.5, 4.9, 5.3, 6.0):
                for aside, turn in ((0.0, math.pi), (0.0, 0.0), (0.3, math.pi), (-0.8, 2.5), (0.5, -2.0)):
                    here = Pose(-2.0, -0.5, draw.choice((0.0, 0.3)))
                    way = here.heading_rad + aside
                    there = Pose(here.x_m + far_m * math.cos(way), here.y_m + far_m * math.sin(way), turn)
                    one, other = make_scene("kinematic", world(*things), [P2DX, model], [here, there]).bodies
                    seen = [
                        (a, b, far) for a in range(8) for b in range(8) if (far := one.sees(a, other, b)) is not None
                    ]
                    yield said(
                        (far_m, aside, turn, seen, one.clearance(), one.who_stands_at_start(), one.ranges(range(8)))
                    )


def levels(draw: random.Random) -> Iterator[str]:
    """Ask of robots whose floors lie at several heights which of them is near, and which echoes."""
    plain = KinematicBody.standing_pose
    for model in (P2DX, PATROL):
        for there in (Pose(1.2, 0.0, math.pi), Pose(1.2, 0.6, 0.0)):
            one, other = make_scene("kinematic", world(), [P2DX, model], [Pose(0, 0, 0), there]).bodies
            for above_m in (0.0, 0.1, 0.15, 0.19, 0.2, 0.22, 0.24, 0.3, 0.5, 1.0):

                def raised(body: object, which: object = other, above_m: float = above_m) -> StandingPose:
                    x, y, turn, z = plain.fget(body)  # type: ignore[attr-defined]  # a property
                    return StandingPose(x, y, turn, z + above_m * (body is which))

                with patch.object(KinematicBody, "standing_pose", property(raised)):
                    yield said(
                        (above_m, one.clearance(), other.clearance(), one.ranges(range(8)), other.ranges((3, 4)))
                    )


def placed(draw: random.Random) -> Iterator[str]:
    """Put robots where they may stand, and where they may not."""
    slope = Obstacle(name="ramp", x_m=-3, y_m=0, length_m=1, width_m=1, height_m=0.2, kind=ObstacleKind.RAMP)
    stage = Obstacle(name="stage", x_m=-3, y_m=3, length_m=2, width_m=2, height_m=0.1, kind=ObstacleKind.FLOOR)
    low = Obstacle(name="low", x_m=0, y_m=3, radius_m=0.1, height_m=0.05)
    here = world(POST, slope, stage, low, Obstacle(name="robot 2", x_m=5, y_m=5, radius_m=0.1))
    scene = make_scene("kinematic", here, [P2DX, AT], [Pose(-1, -1, 0), Pose(1, -3, 0)])
    yield said([free_name(number, here) for number in (1, 2)] + [body.robot_name for body in scene.bodies])
    for x, y in (
        (7, 0),
        (0.8, 0),
        (-3, 0),
        (-3, 3),
        (1, -3),
        (1.3, -3),
        (0, 3),
        (2, 2),
        (-6, 0),
        (-6.01, 0),
        (0.41, 0),
        (0.3, 0),
    ):
        yield tried(scene.bodies[0].stand_at, x, y, 0.1)
        yield said(
            (scene.bodies[0].state, scene.bodies[0].who_stands_at_start(), scene.bodies[1].who_stands_at_start())
        )
    scene.bodies[1].stand_at(-1, -1, 0.5)
    yield said([body.who_stands_at_start() for body in scene.bodies])
    yield said(scene.bodies[0].who_stands_at_start(leaving=[scene.bodies[1]]))
    for act in (scene.bodies[0].step, scene.bodies[0].hold, scene.bodies[0].reset):
        yield tried(
            act,
            *(
                (0.1, 0.1, 3)
                if act == scene.bodies[0].hold
                else (0.1, 0.1)
                if act == scene.bodies[0].step
                else (Pose(0, 0, 0), 1)
            ),
        )


def pushed(draw: random.Random) -> Iterator[str]:
    """Let columns of robots push each other straight, askew and off their middles, against what stands behind."""
    for number in range(16):
        count = draw.choice((2, 2, 3, 4))
        things = draw.choice(((), (CRATE,), (WALL,), (CRATE, WALL)))
        models = [draw.choice((P2DX, P2DX, AT, AMIGO)) for _ in range(count)]
        gap_m, askew = draw.choice((0.45, 0.6)), draw.choice((0.0, 0.0, 0.1, 0.25))
        starts = [
            Pose(-0.5 + place * gap_m * 1.1, askew * draw.uniform(-1, 1), draw.choice((0.0, 0.0, math.pi, 0.4, -1.2)))
            for place in range(count)
        ]
        scene = make_scene("kinematic", world(*things), models, starts)
        for _ in range(4):
            for body in scene.bodies:
                body.is_powered = draw.random() < 0.8
            asked = [
                draw.choice(((0.3, 0.3), (0.3, 0.3), (0.0, 0.0), (-0.1, -0.1), (0.1, 0.3), (0.4, 0.0)))
                for _ in range(count)
            ]
            for steps in (1, 90, draw.choice((40, 120))):
                for _ in range(steps):
                    wheels = scene.step(asked)
                yield said((number, asked, [*wheels]))
                yield said([body.state for body in scene.bodies])
            yield said([(body.take_hits(), [item.x_m for item in body.take_moved()]) for body in scene.bodies])
            if draw.random() < 0.3:
                scene.restore(scene.snapshot())


def blocked(draw: random.Random) -> Iterator[str]:
    """Drive against a wall, stand for as long as makes a new contact, and go on; held, by ramps and by steps."""
    walk = Walk(points_m=((1.0, -1.0), (1.0, 1.0)), speed_mps=0.8)
    cat = Obstacle(name="cat", x_m=0, y_m=0, radius_m=0.1, walk=walk)
    for number in range(24):
        things = draw.choice(((WALL,), (WALL, cat), (CRATE,), (POST, CRATE)))
        start = Pose(draw.choice((1.9, 2.3, 0.2)), draw.choice((0.0, 0.1)), draw.choice((0.0, 0.5, -0.9)))
        body = make_body("kinematic", world(*things), draw.choice(MODELS), start=start)
        assert isinstance(body, KinematicBody)
        for _ in range(9):
            match draw.randrange(4):
                case 0:
                    body.hold(0.0, 0.0, draw.choice((1, 2, 9, 10, 11, APART_STEPS - 1, APART_STEPS, APART_STEPS + 1)))
                case 1:
                    left, right = draw.choice(((0.3, 0.3), (0.3, 0.2), (-0.2, -0.2)))
                    body.hold(left, right, draw.choice((5, 300, 900)))
                case 2:
                    body.ramp([(0.002 * step, draw.choice((0.002, 0.001)) * step) for step in range(120)])
                case _:
                    for _ in range(draw.choice((1, 30))):
                        body.step(0.2, draw.choice((0.2, 0.25)))
            if draw.random() < 0.1:
                body.stand_at(0.0, -3.0, 1.0)
            yield said((number, body.state, body.clearance(), body.clearance(no_more_than=0.05), body.take_hits()))
            yield said((body.steps_within(0.05, 0.3), body.take_moved()))
    yield said(
        BodyState(x_m=1, y_m=2, heading_rad=3, left_angle_rad=0, right_angle_rad=0, left_speed_mps=0, right_speed_mps=0)
    )


TRACES: dict[str, Trace] = {each.__name__: each for each in (faced, levels, placed, pushed, blocked)}
test_what_was_approved_is_shown = judge_of(__file__, TRACES)
