"""What parts sense of the world around the board: how it moves, and how far away things are.

The board knows no world. Whoever has one (the bench) gives it; without one the board stands still in an empty place.
The robot's frame: x forward, y left, z up, the origin on the floor in the middle of the axle.
Invariant: an answer depends on the time that the world has been brought to, and on the arguments.
"""

from dataclasses import dataclass
from typing import Protocol

#: Standard gravity, m/s².
GRAVITY_MPS2 = 9.80665


@dataclass(frozen=True, slots=True, kw_only=True)
class BoardMotion:
    """Where the board is and how it moves."""

    #: In the world's plan; the heading is counter-clockwise from its x axis.
    x_m: float = 0.0
    y_m: float = 0.0
    z_m: float = 0.0
    heading_rad: float = 0.0
    #: Nose up is positive.
    pitch_rad: float = 0.0
    forward_mps: float = 0.0
    #: About x, y and z of the robot's frame.
    rates_radps: tuple[float, float, float] = (0.0, 0.0, 0.0)
    #: What an accelerometer measures along x, y and z, gravity included: one that lies still has +9.8 along z.
    force_mps2: tuple[float, float, float] = (0.0, 0.0, GRAVITY_MPS2)


class Surroundings(Protocol):
    """A world, as a part on the board senses it."""

    def motion(self) -> BoardMotion:
        """Return how the board moves now."""

    def range_m(self, x_m: float, y_m: float, heading_rad: float, cone_rad: float, longest_m: float) -> float:
        """Return how far away the nearest thing is that a cone meets; `longest_m` where it meets none.

        Args:
            x_m: Where the sensor sits, forward of the origin.
            y_m: The same, to the left.
            heading_rad: Where it looks, counter-clockwise from ahead.
            cone_rad: From one side of the cone to the other.
            longest_m: How far it looks.
        """


class Nowhere:
    """An empty place, in which the board stands still."""

    def motion(self) -> BoardMotion:
        """Return no motion."""
        return BoardMotion()

    def range_m(self, x_m: float, y_m: float, heading_rad: float, cone_rad: float, longest_m: float) -> float:  # noqa: ARG002 - the interface's
        """Return that nothing is there."""
        return longest_m
