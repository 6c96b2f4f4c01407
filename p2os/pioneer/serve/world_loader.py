"""Loads another world when a client wants it (LOADWORLD, SIM_CTRL 1): what a client may name, and who goes there.

A client may name a world that ships, the world with which the robots began, and files in the folder that the
operator allows (`p2os serve --worlds`), by their path in it. Any other path is refused, also one that a link leads to
outside: who reaches the port could else read any file.

All robots that share the world go, each to a free place at the new world's start; robots that are apart go alone.
The robots' time stands still while a world is loaded.

Invariant: where it refuses, nothing has changed.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from p2os.errors import WorldError
from p2os.pioneer.body.factory import make_scene
from p2os.pioneer.controller import Pioneer
from p2os.pioneer.serve.multi_robot_world import MultiRobotWorld
from p2os.pioneer.world import known_worlds, load_world
from p2os.pioneer.world.start_places import start_places
from simbase.errors import shown
from simbase.timing import Nanos


@dataclass(frozen=True, slots=True, kw_only=True)
class WorldLoader:
    """Puts some robots into other worlds, all at once.

    Args:
        robots: Those that share a world, in its order; or one.
        multi_robot_world: Brings them through time; None for one that is alone.
        first: Name or file of the world with which they began.
        folder: Where files may be loaded from; None: no other file.
        body: Name of an engine.
        seed: For a scattered world.
    """

    robots: Sequence[Pioneer]
    multi_robot_world: MultiRobotWorld | None
    first: str
    folder: Path | None
    body: str
    seed: int

    def load(self, name: str, now: Nanos) -> None:
        """Load a world and put the robots into it.

        Args:
            name: As a client sent it.
            now: The time to which the robots were brought, nanoseconds.

        Raises:
            WorldError: It may not be loaded, is unknown or broken, or a robot cannot stand at its start.
            UsageError: There is no room for all.
            MissingDependencyError: The file's reader is not installed.
        """
        world = load_world(self._allowed(name), seed=self.seed)
        models = [robot.parameters for robot in self.robots]
        starts = start_places(world, models, [None] * len(models))
        scene = make_scene(self.body, world, models, starts, self.seed, trust=False)
        raw_name = name.encode("utf-8", "surrogateescape")
        if self.multi_robot_world is not None:
            self.multi_robot_world.enter_world(scene, raw_name, now)
        else:
            for robot, body in zip(self.robots, scene.bodies, strict=True):
                robot.enter_world(body, raw_name, now)

    def _allowed(self, name: str) -> str | Path:
        """Return the world that a name means.

        Raises:
            WorldError: A client may not load it.
        """
        if name == self.first or name in known_worlds():
            return name
        if self.folder is None:
            raise WorldError(f"{shown(name)} does not ship; serve --worlds DIR allows the files of a folder")
        try:
            folder = self.folder.resolve(strict=True)
            path = (folder / name).resolve(strict=True)
        except (OSError, ValueError, RuntimeError):  # also a loop of links, and what no path can be
            path = None
        # What is outside and what is not there get one answer: a client learns nothing of other folders.
        if path is None or not path.is_relative_to(folder):
            raise WorldError(f"there is no {shown(name)} in the folder of --worlds")
        return path
