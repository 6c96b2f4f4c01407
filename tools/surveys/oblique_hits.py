"""The three bodies on the same oblique hits: where they agree, where they do not, and by how much.

    python -m tools.surveys.oblique_hits                        # a table of every hit, and the bounds
    python -m tools.surveys.oblique_hits --model p3at --speed 0.5

A robot drives straight, both rims at one speed, against a long wall at an angle, or against a post beside its middle,
and the same command goes on. What is told is 4 s after the first touch: whether it goes on or stands, how far it has
come since, and how far it has turned. No published measurement of a real Pioneer's oblique contact was found; so the
bodies judge each other, and `DISPUTED_DEG` and `DISPUTED_BESIDE_M` of p2os.pioneer.body.contacts say which hits leave
a run hanging on its body: all others have to be agreed on, in what goes on and in the heading, within `AGREED_DEG`.
"""

import argparse
import math
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from p2os.pioneer.body.contacts import DISPUTED_BESIDE_M, DISPUTED_DEG
from p2os.pioneer.body.factory import engines, make_body
from p2os.pioneer.world import parse_world
from p2os.pioneer.world.model import Pose, World
from p2os.robots.parameters import RobotParameters, load_parameters

#: Angles to the wall, degrees; where a post is beside the robot's middle, m.
WALL_DEG = (5, 15, 25, 30, 35, 40, 45, 55, 65, 75, 80, 85, 90)
POST_M = (0.0, 0.05, 0.10, 0.15, 0.20)
SPEED_MPS = 0.3
#: Looked at so long after the first touch, s; slower then is a stand, m/s, as a mean over the last second.
AFTER_S, STANDING_MPS = 4.0, 0.02
LONGEST_WAY_S = 20.0
#: chosen: headings that differ by less are one, degrees.
AGREED_DEG = 12.0
WALL = parse_world(
    """
    name = "wall"
    extent_m = [-9, -9, 9, 9]
    [[box]]
    name = "wall"
    x_m = 0.0
    y_m = 1.05
    length_m = 17.0
    width_m = 0.1
    height_m = 0.5
    """,
    "wall",
)


@dataclass(frozen=True, kw_only=True)
class ObliqueHit:
    """What a body makes of a hit.

    Args:
        thing: The wall with its angle, or the post with its place.
        is_disputed: Whether the bodies need not agree on it.
        body: Which.
        goes_on: Whether it still moves 4 s after the first touch.
        way_m: How far its middle has come from the place of the touch by then.
        turned_deg: How far it has turned since.
    """

    thing: str
    is_disputed: bool
    body: str
    goes_on: bool
    way_m: float
    turned_deg: float

    def __str__(self) -> str:
        return f"{'goes on' if self.goes_on else 'stands'}, {self.way_m:.2f} m, {self.turned_deg:+.0f}°"


def post(beside_m: float) -> World:
    """Return a world with a post ahead, so far to the left of the robot's middle."""
    return parse_world(
        f"""
        name = "post"
        extent_m = [-9, -9, 9, 9]
        [[cylinder]]
        name = "post"
        x_m = 1.0
        y_m = {beside_m}
        radius_m = 0.05
        height_m = 0.5
        """,
        "post",
    )


def before_the_wall(angle_deg: float, model: RobotParameters) -> Pose:
    """Return where a corner of a robot's front is 5 cm before the wall."""
    angle, own = math.radians(angle_deg), model.body
    reach = own.hull_front_m * math.sin(angle) + own.hull_width_m / 2 * math.cos(angle)
    return Pose(-4.0, 1.0 - reach - 0.05, angle)


@dataclass(frozen=True, kw_only=True)
class Approach:
    """A robot before the only thing of a world."""

    thing: str
    world: World
    start: Pose
    is_disputed: bool


def approaches(
    model: RobotParameters, walls: Sequence[float] = WALL_DEG, posts: Sequence[float] = POST_M
) -> Iterator[Approach]:
    """Yield the hits to be."""
    for angle in walls:
        is_disputed = DISPUTED_DEG[0] < angle < DISPUTED_DEG[1]
        yield Approach(
            thing=f"wall at {angle:g}°", world=WALL, start=before_the_wall(angle, model), is_disputed=is_disputed
        )
    for beside in posts:
        is_disputed = beside > DISPUTED_BESIDE_M
        start = Pose(0.0, 0.0, 0.0)
        yield Approach(thing=f"post {beside:.2f} m left", world=post(beside), start=start, is_disputed=is_disputed)


def hit(name: str, approach: Approach, model: RobotParameters, speed_mps: float) -> ObliqueHit:
    """Drive against the thing, and on."""
    body = make_body(name, approach.world, model)
    body.reset(approach.start, 0)
    for _ in range(round(LONGEST_WAY_S * 1000)):
        body.step(speed_mps, speed_mps)
        if body.state.collisions:
            break
    else:
        raise ValueError(f"{approach.thing}: nothing was met")
    touched = body.state
    body.hold(speed_mps, speed_mps, round((AFTER_S - 1.0) * 1000))
    late = body.state
    body.hold(speed_mps, speed_mps, 1000)
    end = body.state
    return ObliqueHit(
        thing=approach.thing, is_disputed=approach.is_disputed, body=name,
        goes_on=math.dist((late.x_m, late.y_m), (end.x_m, end.y_m)) > STANDING_MPS,
        way_m=math.dist((touched.x_m, touched.y_m), (end.x_m, end.y_m)),
        turned_deg=math.degrees(math.remainder(end.heading_rad - touched.heading_rad, math.tau)),
    )  # fmt: skip


def survey(bodies: Sequence[str], model: RobotParameters, speed_mps: float) -> Iterator[list[ObliqueHit]]:
    """Yield what each body makes of each hit."""
    for approach in approaches(model):
        yield [hit(name, approach, model, speed_mps) for name in bodies]


def are_agreed(hits: Sequence[ObliqueHit]) -> bool:
    """Tell whether all bodies go on, or all stand, and in one direction."""
    turns = [one.turned_deg for one in hits]
    return len({one.goes_on for one in hits}) == 1 and max(turns) - min(turns) < AGREED_DEG


def row(hits: Sequence[ObliqueHit]) -> str:
    """Return a line of the page's table."""
    ways, turns = [one.way_m for one in hits], [one.turned_deg for one in hits]
    spread = f"{max(ways) - min(ways):.2f} m, {max(turns) - min(turns):.0f}°"
    words = ("agreed" if are_agreed(hits) else "**not agreed**") + (", disputed" if hits[0].is_disputed else "")
    return f"| {hits[0].thing} | {' | '.join(map(str, hits))} | {spread}: {words} |"


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the table; 1 where the bodies contradict each other beyond what is disputed."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--model", default="p2dx", help="default: p2dx")
    parser.add_argument("--speed", type=float, default=SPEED_MPS, help="m/s; default: 0.3")
    chosen = parser.parse_args(arguments)
    bodies = engines()
    print(f"| hit | {' | '.join(f'`{name}`' for name in bodies)} | apart |\n|---|{'---|' * len(bodies)}---|")
    beyond = []
    for hits in survey(bodies, load_parameters(chosen.model), chosen.speed):
        print(row(hits), flush=True)
        if not are_agreed(hits) and not hits[0].is_disputed:
            beyond.append(hits[0].thing)
    print(f"not agreed, and not among the disputed: {', '.join(beyond) or 'none'}")
    return int(bool(beyond))


if __name__ == "__main__":
    sys.exit(main())
