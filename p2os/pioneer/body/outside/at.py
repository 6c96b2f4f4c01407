"""What makes the body at an address: the entry points `tcp` and `unix` of the group `p2os.body_addresses`."""

from collections.abc import Sequence
from dataclasses import dataclass

from p2os.pioneer.body.contract import RobotScene
from p2os.pioneer.body.outside.address import Address
from p2os.pioneer.world.model import World
from p2os.robots.parameters import RobotParameters


@dataclass(frozen=True, slots=True)
class BodyAt:
    """Makes the body of the program that answers at an address; nothing is opened before."""

    address: Address

    def __call__(self, world: World, models: Sequence[RobotParameters]) -> RobotScene:
        """Connect, and return the scene.

        Raises:
            UsageError: There is more than one robot, or the world has what the other program cannot take.
            TransportError: Nobody answers.
        """
        from p2os.pioneer.body.outside.body import OutsideScene

        return OutsideScene(self.address, world, models)


def body_at(name: str) -> BodyAt:
    """Return what makes the body that a name such as `tcp:127.0.0.1:9000` means.

    Raises:
        UsageError: It names no address, or another machine without `anywhere`.
    """
    return BodyAt(Address.of(name))
