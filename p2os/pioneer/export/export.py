"""Export a world, a robot, or a robot in a world: the files, and what they do not hold."""

from dataclasses import dataclass
from pathlib import PurePath

from p2os.pioneer.export.formats import FORMATS, losses
from p2os.pioneer.export.scenes import scene_of
from p2os.pioneer.world.model import World
from p2os.robots.parameters import RobotParameters
from simbase.errors import UsageError, shown


@dataclass(frozen=True, slots=True, kw_only=True)
class Export:
    """Files that are to be written into one folder, and what of the world or the robot they do not hold.

    Args:
        files: Name → content; the file that was asked for is the first.
        losses: A line for each kind of thing.
    """

    files: dict[str, bytes]
    losses: tuple[str, ...]


def export(name: str | PurePath, world: World | None = None, robot: RobotParameters | None = None) -> Export:
    """Return a world, a robot, or a robot at a world's start, as files for another program.

    Args:
        name: Of the file; its ending names the format (`FORMATS`).
        world: None for a robot alone.
        robot: None for a world alone.

    Raises:
        UsageError: No format has that ending.
        WorldError: There is neither a world nor a robot.
    """
    path = PurePath(name)
    made = FORMATS.get(path.suffix.lower())
    if made is None:
        raise UsageError(f"nothing can be exported to {shown(path.name)}", hint=f"endings: {', '.join(FORMATS)}")
    scene = scene_of(world, robot)
    files = made.write(scene, path.stem)
    # The ending as it was typed.
    own = next(iter(files))
    return Export(files={path.name: files.pop(own), **files}, losses=losses(scene, made))
