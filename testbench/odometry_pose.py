"""The pose of a real robot as far as its own odometry tells, for the recording of mode C.

Integers of the trace: micrometres, microradians, µm/s. Wheel angles are not in
a standard packet and stay 0; collisions cannot be told.
"""

import math

from p2os.odometry import Unwrapper
from p2os.parameters import RobotParameters
from p2os.sip import POSITION_MASK, StandardSip

NM_PER_UM = 1_000


class OdometryPose:
    """Follows the standard packets of one session."""

    def __init__(self, parameters: RobotParameters) -> None:
        self._parameters = parameters
        self._x, self._y = Unwrapper(POSITION_MASK + 1), Unwrapper(POSITION_MASK + 1)
        #: Path over ground, metres.
        self.distance_m = 0.0

    def take(self, sip: StandardSip) -> dict[str, int]:
        """Return the pose entry of a packet."""
        per_count_um = self._parameters.distance_nm_per_count / NM_PER_UM
        step = math.hypot(self._x.update(sip.raw_x), self._y.update(sip.raw_y))
        self.distance_m += step * per_count_um / 1e6
        turn = sip.raw_heading / self._parameters.angle_counts_per_turn * 2 * math.pi
        speed_um = self._parameters.velocity_um_s_per_count
        return {
            "x": round(self._x.total * per_count_um),
            "y": round(self._y.total * per_count_um),
            "z": 0,
            "h": round(turn * 1e6),
            "p": 0,
            "l": sip.raw_left_velocity * speed_um,
            "r": sip.raw_right_velocity * speed_um,
            "la": 0,
            "ra": 0,
            "c": 0,
        }
