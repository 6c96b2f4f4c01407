"""Where the robots of one world begin: at their given places, or beside the world's start.

A robot without a place of its own gets the free one that is nearest to the world's start and
that a robot can drive to from there: level, clear of all things and of the other robots.
"""

import heapq
import math
from collections.abc import Iterator, Sequence

from p2os.errors import WorldError
from p2os.pioneer.world.geometry import Footprint, hull_polygon, placed
from p2os.pioneer.world.model import ObstacleKind, Pose, World
from p2os.pioneer.world.plan import Plan, StaticPlan
from p2os.robots.parameters import RobotParameters
from simbase.errors import FileError, UsageError, shown

#: chosen: finer than a hull is wide, so that the search passes no wall.
LATTICE_M = 0.2
#: chosen: free width about a hull where a robot begins, and where the search passes.
FREE_M, PASSED_M = 0.1, 0.02
#: chosen: free width between two robots that begin, whichever way they turn.
BETWEEN_M = 0.2
Standing = tuple[Pose, RobotParameters]


def start_places(world: World, models: Sequence[RobotParameters], given: Sequence[Pose | None]) -> tuple[Pose, ...]:
    """Return where each robot begins.

    Args:
        world: Where they are.
        models: What each robot is.
        given: Where each is to begin; None: wherever there is room. z_m is found here.

    Raises:
        UsageError: A given place is not free, or there is no room for all.
        WorldError: A robot could not stand at the world's own start.
    """
    plans = {id(model): Plan.of_world(world, model) for model in models}
    standing: dict[int, Standing] = {}
    for number, (pose, model) in enumerate(zip(given, models, strict=True)):
        if pose is not None:
            standing[number] = (_checked(number, pose, world, model, plans[id(model)], standing), model)
    places = {key: _free_places(world, plan) for key, plan in plans.items()}
    for number, model in enumerate(models):
        if number not in standing:
            refuse_start(world, model, world.start, world.start_at)
            pose = next((pose for pose in places[id(model)] if _is_apart(pose, model, standing)), None)
            if pose is None:
                raise UsageError(
                    f"no room for robot {number + 1} in {world.name!r}",
                    hint="take a larger world, fewer robots, or --apart: a copy of the world each",
                )
            standing[number] = (pose, model)
    return tuple(standing[number][0] for number in range(len(models)))


def refuse_start(
    world: World, model: RobotParameters, start: Pose, at: str, *, error: type[FileError] = WorldError
) -> None:
    """Refuse a start beyond the floor, or inside a thing.

    Args:
        world: Where it is.
        model: What would stand there.
        start: The place.
        at: What a message calls it: file, line and key.
        error: What to raise.

    Raises:
        FileError: One of `error`.
    """
    where, name = f"{at}: x {start.x_m:g}, y {start.y_m:g}", shown(world.name)
    if not world.contains(start.x_m, start.y_m):
        raise error(f"{where} is not in world {name}", hint=_extent_of(world))
    thing = thing_at(world, model, start)
    if thing is not None:
        raise error(f"{where} in world {name} is inside {shown(thing)}", hint="p2os world show FILE draws a world")


def thing_at(world: World, model: RobotParameters, pose: Pose) -> str | None:
    """Return the name of the thing that a robot would stand in, or None where the place is free.

    What walks is passed over, and so is a place above the level floor: of what it stands on nothing is known here.
    """
    if abs(pose.z_m) > PASSED_M:
        return None
    standing = (item for item in world.obstacles if not item.fixed and item.walk is None)
    plan = Plan(standing, model, StaticPlan(world, model))
    if plan.clearance(pose.x_m, pose.y_m, pose.heading_rad, no_more_than=FREE_M) > 0.0:
        return None
    return plan.touched(pose.x_m, pose.y_m, pose.heading_rad)[0] or "a low thing"


def _extent_of(world: World) -> str:
    """Return a world's extent in words, for a hint."""
    x0, y0, x1, y1 = world.extent
    return f"x is {x0:g} to {x1:g} m there, and y {y0:g} to {y1:g} m"


def _checked(
    number: int, pose: Pose, world: World, model: RobotParameters, plan: Plan, standing: dict[int, Standing]
) -> Pose:
    """Return a given place, with its floor's height."""
    where = f"robot {number + 1} at {pose.x_m:g}, {pose.y_m:g}"
    if not world.contains(pose.x_m, pose.y_m):
        raise UsageError(f"{where} is not in {world.name!r}", hint=_extent_of(world))
    if plan.clearance(pose.x_m, pose.y_m, pose.heading_rad) == 0.0:
        name = plan.touched(pose.x_m, pose.y_m, pose.heading_rad)[0]
        raise UsageError(f"{where} would stand in {name or 'a low thing'!r}", hint="p2os world show FILE draws a world")
    hull = placed(hull_polygon(model.body), pose.x_m, pose.y_m, pose.heading_rad)
    for other, (there, its_model) in standing.items():
        its_hull = placed(hull_polygon(its_model.body), there.x_m, there.y_m, there.heading_rad)
        if Footprint.of_polygon("", its_hull).overlaps(hull):
            raise UsageError(f"{where} would stand in robot {other + 1}", hint="its hull is 0.4 m wide")
    height = floor_height(world, pose.x_m, pose.y_m)
    if height is None:
        raise UsageError(f"{where} would begin on a slope", hint="take a level place")
    return Pose(pose.x_m, pose.y_m, pose.heading_rad, height)


def _free_places(world: World, plan: Plan) -> Iterator[Pose]:
    """Yield the start, then free places on a lattice about it, the nearest first."""
    start = world.start
    yield start
    x0, y0, x1, y1 = world.extent
    c, s = math.cos(start.heading_rad), math.sin(start.heading_rad)
    # Beside the start before ahead of it: (distance, ahead, left) orders what is equally far.
    ahead: list[tuple[float, int, int]] = [(0.0, 0, 0)]
    seen = {(0, 0)}
    while ahead:
        _, i, j = heapq.heappop(ahead)
        x, y = start.x_m + LATTICE_M * (i * c - j * s), start.y_m + LATTICE_M * (i * s + j * c)
        if not (x0 <= x <= x1 and y0 <= y <= y1):
            continue
        free = plan.clearance(x, y, start.heading_rad, no_more_than=2 * FREE_M)
        if free < PASSED_M and (i, j) != (0, 0):
            continue
        height = floor_height(world, x, y, plan.hull_reach_m)
        if free >= FREE_M and height is not None:
            yield Pose(x, y, start.heading_rad, height)
        for there in ((i + 1, j), (i - 1, j), (i, j + 1), (i, j - 1)):
            if there not in seen:
                seen.add(there)
                heapq.heappush(ahead, (math.hypot(*there), *there))


def _is_apart(pose: Pose, model: RobotParameters, standing: dict[int, Standing]) -> bool:
    """Tell whether a robot that begins there can turn without touching another that does."""
    reach = _reach(model)
    return all(
        math.hypot(pose.x_m - other.x_m, pose.y_m - other.y_m) >= reach + _reach(its_model) + BETWEEN_M
        for other, its_model in standing.values()
    )


def _reach(model: RobotParameters) -> float:
    return max(math.hypot(x, y) for x, y in hull_polygon(model.body))


def floor_height(world: World, x: float, y: float, reach: float = 0.0) -> float | None:
    """Return the height of the floor under a circle, metres; None where it is not level.

    Of a mesh's floors nothing is known: they count as the start's.
    """
    height = 0.0 if any(item.kind is ObstacleKind.FLOOR for item in world.obstacles) else world.start.z_m
    for item in world.obstacles:
        if not item.kind.is_driven_on:
            continue
        shape = Footprint(item)
        if shape.distance_to_point(x, y) > reach:
            continue
        inside = shape.contains(x, y) and all(
            (y - ay) * ex - (x - ax) * ey >= reach * math.hypot(ex, ey) for ax, ay, ex, ey in shape.edges
        )
        if item.kind is ObstacleKind.RAMP or not inside:
            return None
        height = max(height, item.base_m + item.height_m)
    return height
