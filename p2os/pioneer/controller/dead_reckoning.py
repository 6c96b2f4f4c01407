"""Dead reckoning: the robot's estimate of its own pose, from its wheels alone.

It uses the track of the robot's parameters, so a body with another track, a
wheel that slips or a push shows as the odometry error that it is. The encoders'
own grain (a fraction of a millimetre) is not modelled.

Invariant: `turned_rad` and `travel_mm` never jump; SETO moves only the origin.
"""

import math
from collections.abc import Sequence

from p2os.pioneer.body.contract import Wheels
from p2os.protocol.odometry import POSITION_MODULUS
from simbase.state import Stateful

NM_PER_MM = 1_000_000


class DeadReckoning(Stateful):
    """The robot's odometer."""

    STATE = ("x_mm", "y_mm", "turned_rad", "travel_mm", "_zero_rad", "_left_rad", "_right_rad", "left_mm", "right_mm")

    def __init__(
        self, *, wheel_diameter_m: float, track_mm: int, left_wheel: float = 1.0, right_wheel: float = 1.0,
        track: float = 1.0,
    ) -> None:  # fmt: skip
        """Start at the origin.

        Args:
            wheel_diameter_m: What the body's wheels measure.
            track_mm: The body's.
            left_wheel: True size of the left wheel over what the firmware assumes; the right one alike.
            right_wheel: The same.
            track: True track over what the firmware assumes.
        """
        self._left_radius_mm = wheel_diameter_m * 500 / left_wheel
        self._right_radius_mm = wheel_diameter_m * 500 / right_wheel
        self._track_mm = track_mm / track
        self._left_rad = 0.0
        self._right_rad = 0.0
        self._zero_rad = 0.0
        self.x_mm = 0.0
        self.y_mm = 0.0
        #: Turned since the start, counter-clockwise positive, any number of turns.
        self.turned_rad = 0.0
        #: Driven along the path since the start, forward positive.
        self.travel_mm = 0.0
        #: Way of each rim since the start, as the encoders count it.
        self.left_mm = 0.0
        self.right_mm = 0.0

    @property
    def heading_rad(self) -> float:
        """Return the heading since the last SETO, in radians, any number of turns."""
        return self.turned_rad - self._zero_rad

    @property
    def zero_rad(self) -> float:
        """Return `turned_rad` at the last SETO."""
        return self._zero_rad

    def begin(self, left_rad: float, right_rad: float) -> None:
        """Take these wheel angles as those from which to count."""
        self._left_rad, self._right_rad = left_rad, right_rad

    def follow(self, steps: Sequence[Wheels]) -> None:
        """Count on to where the wheels are after each of some steps."""
        left_was, right_was, left_all, right_all = self._left_rad, self._right_rad, self.left_mm, self.right_mm
        x, y, turned, travel = self.x_mm, self.y_mm, self.turned_rad, self.travel_mm
        left_radius_mm, right_radius_mm, track_mm = self._left_radius_mm, self._right_radius_mm, self._track_mm
        zero, cos, sin = self._zero_rad, math.cos, math.sin
        for wheels in steps:
            left_rad, right_rad = wheels.left_angle_rad, wheels.right_angle_rad
            left_mm = (left_rad - left_was) * left_radius_mm
            right_mm = (right_rad - right_was) * right_radius_mm
            if not left_mm and not right_mm:
                continue
            left_was, right_was = left_rad, right_rad
            turn = (right_mm - left_mm) / track_mm
            along = (left_mm + right_mm) / 2
            middle = turned - zero + turn / 2  # exact for an arc to second order
            x += along * cos(middle)
            y += along * sin(middle)
            turned += turn
            travel += along
            left_all += left_mm
            right_all += right_mm
        self._left_rad, self._right_rad, self.left_mm, self.right_mm = left_was, right_was, left_all, right_all
        self.x_mm, self.y_mm, self.turned_rad, self.travel_mm = x, y, turned, travel

    def drift(self, turn_rad: float) -> None:
        """Turn the estimate by a little more than the wheels have turned."""
        self.turned_rad += turn_rad

    def set_origin(self) -> None:
        """Make this pose the origin (SETO)."""
        self.x_mm = self.y_mm = 0.0
        self._zero_rad = self.turned_rad

    def raw_position(self, distance_nm_per_count: int) -> tuple[int, int]:
        """Return x and y as the packet carries them: counts modulo 2^15."""
        return (
            round(self.x_mm * NM_PER_MM / distance_nm_per_count) % POSITION_MODULUS,
            round(self.y_mm * NM_PER_MM / distance_nm_per_count) % POSITION_MODULUS,
        )


def raw_angle(angle_rad: float, counts_per_turn: int) -> int:
    """Return an angle in a model's counts, as the packet carries it: of 4096 a turn −2048 to 2047."""
    half = counts_per_turn // 2
    return (round(angle_rad * counts_per_turn / math.tau) + half) % counts_per_turn - half
