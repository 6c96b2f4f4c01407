"""Robots of the exact body, driven at random among things that come, go, walk and are pushed, as approved."""

import math
import random
from collections.abc import Iterator

from p2os.pioneer.body.factory import make_scene
from p2os.pioneer.body.in_world import BodyInWorld
from p2os.pioneer.sonar.ring import Cone
from p2os.pioneer.world.loader import load_world
from p2os.pioneer.world.model import Pose, World
from p2os.robots.parameters import load_parameters
from tests.p2os.pioneer.world.walks.things import drawn_thing, drawn_world
from tests.tools.suite.approved import Trace, judge_of, said, tried

MODELS = tuple(map(load_parameters, ("p2dx", "p3at", "amigo", "patrolbot-sh")))
SPEEDS = (0.0, 0.1, 0.3, 0.3, 0.75, -0.2, -0.4)
HEADINGS = tuple(step / 10 - 1.5 for step in range(31))
FAN = Cone(0.05, -0.02, HEADINGS, tuple((math.cos(heading), math.sin(heading)) for heading in HEADINGS))


def looks(body: BodyInWorld) -> Iterator[str]:
    """Say all that a body tells."""
    yield said((body.state, body.clearance(), body.clearance(no_more_than=0.3)))
    yield said((body.ranges(range(8)), body.echoes([2])))
    yield said((body.scan(FAN, 4.0), body.take_moved(), body.take_hits(), body.steps_within(0.05, 0.3)))
    yield said((body.note, body.footprint.polygon, body.is_powered))


def something_near(draw: random.Random, body: BodyInWorld, number: int) -> Iterator[str]:
    """Put a thing where the robot is about to drive, or beside it."""
    state, way = body.state, draw.choice((0.0, 0.0, 0.4, -0.4, math.pi))
    away_m, heading = draw.choice((0.3, 0.45, 0.8)), state.heading_rad + way
    item = drawn_thing(draw, f"near {number}")
    there = state.x_m + away_m * math.cos(heading), state.y_m + away_m * math.sin(heading)
    if item.reach_m < 0.8 and item.walk is None:
        yield tried(body.place, item.standing_at(*there, item.heading_rad))


def changes(draw: random.Random, body: BodyInWorld, number: int) -> Iterator[str]:
    """Change the world of a body, or put the body elsewhere."""
    x, y, turn = (round(draw.uniform(-3, 3), 2) for _ in range(3))
    name = f"thing {draw.randrange(7)}"
    match draw.randrange(9):
        case 0:
            yield tried(body.place, drawn_thing(draw, draw.choice((name, f"new {number}"))))
        case 1:
            yield tried(body.move, name, x, y, turn)
        case 2:
            yield tried(body.remove, name)
        case 3:
            yield tried(body.stand_at, x, y, turn)
        case 4:
            body.is_powered = not body.is_powered
        case 5:
            body.restore(body.snapshot())
        case 6 if number % 3 == 0:
            body.put_back()


def alone(draw: random.Random, world: World, model: int, steps: int) -> Iterator[str]:
    """Drive one robot: at steady speeds, by ramps, and step by step."""
    (body,) = make_scene("kinematic", world, [MODELS[model]], [world.start]).bodies
    for number in range(steps):
        left = draw.choice(SPEEDS)
        right = draw.choice((left, left, draw.choice(SPEEDS)))
        match draw.randrange(3):
            case 0:
                body.hold(left, right, draw.choice((3, 90, 700)))
            case 1:
                body.ramp([(left * share / 200, right * share / 200) for share in range(201)])
            case _:
                yield said([body.step(left, right) for _ in range(draw.choice((1, 40)))][-1])
        yield from looks(body)
        yield from something_near(draw, body, number) if draw.random() < 0.6 else changes(draw, body, number)


def shipped(draw: random.Random) -> Iterator[str]:
    for number, name in enumerate(("room", "office", "ramp", "slalom")):
        yield from alone(draw, load_world(name, 3), number, 14)


def drawn(draw: random.Random) -> Iterator[str]:
    for number in range(8):
        yield from alone(draw, drawn_world(draw), number % len(MODELS), 14)


def together(draw: random.Random) -> Iterator[str]:
    """Let robots meet, push each other and what stands between them."""
    for count in (2, 3, 3, 4):
        world = drawn_world(draw)
        starts = [Pose(0.7 * number - 1.0, round(draw.uniform(-0.5, 0.5), 2), draw.choice((0.0, 3.14, 1.0)))
                  for number in range(count)]  # fmt: skip
        scene = make_scene("kinematic", world, MODELS[:count], starts)
        for number in range(16):
            asked = [
                draw.choice(((draw.choice(SPEEDS),) * 2, (0.1, 0.3), (0.0, 0.2), (0.3, 0.3))) for _ in range(count)
            ]
            for _ in range(draw.choice((10, 250))):
                wheels = scene.step(asked)
            yield said([*wheels])
            for body in scene.bodies:
                yield said((body.state, body.clearance(no_more_than=1.0), body.ranges([1, 6])))
                yield said((body.take_moved(), body.take_hits(), body.steps_within(0.05, 0.3), body.footprint.polygon))
            yield said((scene.bodies[0].sees(3, scene.bodies[1], 4), scene.bodies[0].who_stands_at_start()))
            one = draw.choice(scene.bodies)
            yield from something_near(draw, one, number) if draw.random() < 0.3 else changes(draw, one, number)
        scene.restore(scene.snapshot())
        yield said([body.state for body in scene.bodies])


TRACES: dict[str, Trace] = {each.__name__: each for each in (shipped, drawn, together)}
test_what_was_approved_is_shown = judge_of(__file__, TRACES)
