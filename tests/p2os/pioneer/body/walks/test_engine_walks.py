"""Robots of the physical engines among things of each sort: what they showed when it was approved, about.

`python -m tests.p2os.pioneer.body.walks.test_engine_walks` takes what they show now for right (`engines.json`).
"""

import json
import math
import sys
from collections.abc import Iterable, Sequence
from dataclasses import astuple
from functools import cache
from pathlib import Path

import pytest

from p2os.pioneer.body.contract import BodyState, RobotBody
from p2os.pioneer.body.factory import engines, make_body
from p2os.pioneer.sonar.ring import Cone
from p2os.pioneer.world.model import Mesh, Obstacle, ObstacleKind, Pose, Walk, World
from p2os.robots.parameters import load_parameters
from tests.p2os.pioneer.body.bodies import each_body

APPROVED = Path(__file__).with_name("engines.json")
#: m, rad, m/s, J by turns, at the start and later: what has touched something differs so much between machines, since
#: not all round a sine alike (seen: 0.011 with the C library's other sine).
NEAR, LATER = 2e-3, 0.05
HEADINGS = tuple(step / 4 - 1.0 for step in range(9))
FAN = Cone(0.05, -0.02, HEADINGS, tuple((math.cos(heading), math.sin(heading)) for heading in HEADINGS))
RAMP = {"kind": ObstacleKind.RAMP, "length_m": 1.0, "width_m": 1.2}
THINGS: dict[str, tuple[Obstacle, ...]] = {
    "wall": (Obstacle(name="wall", x_m=0.5, y_m=0.1, heading_rad=0.4, length_m=0.2, width_m=2.0, fixed=True),),
    "post": (Obstacle(name="post", x_m=0.45, y_m=0.05, radius_m=0.1, height_m=1.0),),
    "sill": (Obstacle(name="sill", x_m=0.5, y_m=0.0, length_m=0.05, width_m=2.0, height_m=0.03),),
    "carton": (Obstacle(name="carton", x_m=0.42, y_m=0.05, length_m=0.3, width_m=0.4, mass_kg=1.5, friction=0.3),),
    "can": (Obstacle(name="can", x_m=0.4, y_m=-0.05, radius_m=0.12, height_m=0.3, mass_kg=1.0),),
    "ramp": (Obstacle(name="ramp", x_m=0.8, y_m=0.0, height_m=0.08, **RAMP),),
    "stage": (
        Obstacle(name="stage", x_m=0.0, y_m=0.0, length_m=3.0, width_m=3.0, height_m=0.1, kind=ObstacleKind.FLOOR),
    ),
    "visitor": (
        Obstacle(name="visitor", x_m=1.0, y_m=0.6, radius_m=0.2, height_m=1.7,
                 walk=Walk(points_m=((1.0, 0.6), (0.6, -0.6)), speed_mps=1.0)),
    ),
    "crowd": tuple(
        Obstacle(name=f"stone {n}", x_m=2 * math.cos(n / 2), y_m=2 * math.sin(n / 2), heading_rad=n / 3, length_m=0.3,
                 width_m=0.2, fixed=True) for n in range(13)
    ),
}  # fmt: skip
MESH = Mesh(
    name="tent", vertices=((0.6, -1.0, 0.0), (0.6, 1.0, 0.0), (0.7, 0.0, 1.0), (2.0, 0.5, 0.0)),
    triangles=((0, 1, 2), (1, 3, 2)),
)  # fmt: skip
CASES = (*THINGS, "mesh")


def numbers_of(value: object) -> list[float]:
    """Return all numbers in a value, in order; words are left out."""
    if isinstance(value, int | float):
        return [99.0 if math.isinf(value) else float(value)]
    if isinstance(value, BodyState | Obstacle):
        return numbers_of(astuple(value))
    return (
        [each for item in value for each in numbers_of(item)]
        if isinstance(value, Sequence | Iterable) and not isinstance(value, str)
        else []
    )


def looks(body: RobotBody) -> list[float]:
    return numbers_of([
        body.state, body.ranges(range(8)), body.echoes([3, 4])[0][::4], body.scan(FAN, 3.0), body.clearance(),
        body.clearance(no_more_than=0.2), [[hit.x_m, hit.y_m, len(hit.name)] for hit in body.take_hits()],
        [[item.x_m, item.y_m, item.heading_rad] for item in body.take_moved()],
    ])  # fmt: skip


def shown(engine: str, case: str, model: str = "p2dx") -> list[list[float]]:
    """Return the numbers that a robot shows as it drives into, over or past something, backs off and is put back."""
    things, meshes = THINGS.get(case, ()), (MESH,) if case == "mesh" else ()
    start = Pose(0.0, 0.0, 0.1, 0.1 if case == "stage" else 0.0)
    world = World(name=case, source=case, description="", start=start, extent=(-4.0, -4.0, 4.0, 4.0),
                  obstacles=things, meshes=meshes)  # fmt: skip
    body = make_body(engine, world, load_parameters(model), start=start)
    seen = [looks(body)]
    body.ramp([(0.3 * step / 200, 0.25 * step / 200) for step in range(200)])
    for left, right, steps in ((0.3, 0.25, 300), (0.3, 0.3, 350), (-0.2, -0.1, 150), (0.0, 0.0, 60)):
        body.hold(left, right, steps)
        seen.append(looks(body))
    body.place(Obstacle(name="late", x_m=-1.0, y_m=0.5, radius_m=0.1, height_m=0.6))
    body.is_powered = False
    body.hold(0.0, 0.0, 20)
    seen.append(looks(body))
    body.move("late", -0.8, 0.2, 0.0)
    body.stand_at(-0.2, -0.3, 2.0)
    body.is_powered = True
    body.step(0.1, -0.1)
    seen.append(looks(body))
    body.remove("late")
    body.put_back()
    seen.append(looks(body))
    return seen


@cache
def approved() -> dict[str, list[list[float]]]:
    found: dict[str, list[list[float]]] = json.loads(APPROVED.read_text(encoding="utf-8"))
    return found


@pytest.mark.parametrize("engine", each_body("kinematic"))
@pytest.mark.parametrize("case", CASES)
def test_an_engine_shows_what_was_approved(engine: str, case: str) -> None:
    for number, (now, right) in enumerate(zip(shown(engine, case), approved()[f"{engine}, {case}"], strict=True)):
        assert now == pytest.approx(right, abs=LATER if number else NEAR), f"{engine}, {case}: look {number}"


def main() -> int:
    """Take what the engines show now for right."""
    found = {
        f"{engine}, {case}": [[round(each, 4) for each in look] for look in shown(engine, case)]
        for engine in engines() if engine != "kinematic" for case in CASES
    }  # fmt: skip
    APPROVED.write_text(
        json.dumps(found, indent=0).replace("\n", " ").replace("] ],", "] ],\n") + "\n", encoding="utf-8"
    )
    return 0


if __name__ == "__main__":
    sys.exit(main())
