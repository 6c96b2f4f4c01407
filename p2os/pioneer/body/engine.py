"""An engine that moves bodies, described without being imported: what it needs, and how good it is.

A package offers one as an entry point of the group `p2os.bodies` whose value ends in `:ENGINE`; by that the factory
knows that looking at it imports nothing heavy.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from importlib import import_module
from importlib.util import find_spec
from typing import cast

from p2os.pioneer.body.contract import RobotScene
from p2os.pioneer.world.model import Pose, World
from p2os.robots.parameters import RobotParameters
from simbase.errors import MissingDependencyError

#: What the value of such an entry point ends in.
ATTRIBUTE = "ENGINE"


@dataclass(frozen=True, slots=True, kw_only=True)
class Engine:
    """An engine, by its name.

    Args:
        name: As `--body` and a scenario name it.
        module, scene: Where its `RobotScene` is, which is made as (world, models, starts).
        packages: What it imports; the body can be made where all of them are installed.
        extra: That brings them.
        rank: Of the installed ones `best` takes that with the highest; 0 is the exact body's.
    """

    name: str
    module: str
    scene: str
    packages: tuple[str, ...] = ()
    extra: str = ""
    rank: int = 0

    def __call__(
        self, world: World, models: Sequence[RobotParameters], starts: Sequence[Pose] | None = None
    ) -> RobotScene:
        """Return a scene with a robot of each of these models.

        Raises:
            MissingDependencyError: The engine or NumPy is not installed.
            WorldError: The world has something that this body cannot take.
        """
        return cast("RobotScene", getattr(self.load(), self.scene)(world, models, starts))

    def load(self) -> object:
        """Import the engine and return its module.

        Raises:
            MissingDependencyError: The engine or NumPy is not installed.
        """
        try:
            return import_module(self.module)
        except ModuleNotFoundError as error:
            raise MissingDependencyError(
                f"the {self.name} body needs {error.name}", extra=self.extra, hint="--body best"
            ) from error

    def missing(self) -> list[str]:
        """Return which of its packages are not installed; looked up, not tried."""
        return [package for package in self.packages if not _is_installed(package)]


def _is_installed(package: str) -> bool:
    try:
        return find_spec(package) is not None
    except (ImportError, ValueError):  # someone forbids its import, or has half of it loaded
        return False
