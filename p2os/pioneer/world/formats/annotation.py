"""What a thing of SDF or URDF is beside its geometry: its mass and friction, and what p2os wrote of it.

`p2os world convert` writes `<thing>` and `<world>` of our own namespace, for what these
formats have no words for: whether a box is a wall or a floor, where a robot begins.
Geometry, masses and frictions stand in the format's own words and are read from there.
"""

from dataclasses import dataclass
from pathlib import Path

from p2os.errors import WorldError
from p2os.pioneer.world.formats.xml_tree import Element, numbers
from p2os.pioneer.world.interchange.words import GROUND, ROBOT, THING, WORLD
from p2os.pioneer.world.model import LEAST_PUSHED_KG, MOST_PUSHED_KG, RANGES, ObstacleKind, Pose
from simbase.errors import shown

_KINDS = {kind.value: kind for kind in ObstacleKind}


@dataclass(frozen=True, slots=True, kw_only=True)
class Traits:
    """What a shape is to a world; as of a file that says nothing: it stands fast and is an obstacle."""

    kind: ObstacleKind = ObstacleKind.OBSTACLE
    fixed: bool = True
    floor_m: float = 0.0
    mass_kg: float = 0.0
    friction: float = 0.5


def is_no_thing(holder: Element) -> bool:
    """Tell whether p2os wrote it for other programs alone."""
    noted = holder.first(THING)
    return noted is not None and noted.get("kind") in {GROUND, ROBOT}


def noted_traits(holder: Element, path: Path) -> Traits | None:
    """Return what p2os wrote of a thing; None where it wrote nothing.

    Raises:
        WorldError: It is not what p2os writes.
    """
    noted = holder.first(THING)
    if noted is None:
        return None
    kind = _KINDS.get(noted.get("kind", ObstacleKind.OBSTACLE.value))
    if kind is None:
        raise WorldError(f"{path}:{noted.line}: kind {shown(noted.get('kind'))} is unknown")
    (floor_m,) = numbers(noted, noted.get("floor_m", "0"), path, 1)
    return Traits(kind=kind, fixed=noted.get("fixed", "true") == "true", floor_m=floor_m)


def pushed(traits: Traits, mass_kg: float, friction: float) -> Traits:
    """Return the traits of a thing that can be pushed, where a world has room for its mass."""
    least, most = RANGES["friction"]
    if not LEAST_PUSHED_KG <= mass_kg <= MOST_PUSHED_KG or traits.kind.is_driven_on:
        return traits
    return Traits(
        kind=traits.kind, fixed=False, floor_m=traits.floor_m, mass_kg=mass_kg,
        friction=min(max(friction, least), most),
    )  # fmt: skip


def noted_world(holder: Element, path: Path) -> tuple[Pose, tuple[float, float, float, float]] | None:
    """Return the start and the extent of a world that p2os wrote; None where it wrote none.

    Raises:
        WorldError: It is not what p2os writes.
    """
    noted = holder.first(WORLD)
    if noted is None or not noted.get("start"):
        return None
    x, y, z, heading = numbers(noted, noted.get("start"), path, 4)
    x0, y0, x1, y1 = numbers(noted, noted.get("extent_m"), path, 4)
    if not (x0 < x1 and y0 < y1):
        raise WorldError(f"{path}:{noted.line}: extent_m must be x0, y0, x1, y1 with x0 < x1 and y0 < y1")
    return Pose(x, y, heading, z), (x0, y0, x1, y1)
