"""An absolute wheel encoder: a few wires that show which sector of a turn the wheel is in.

The sector is taken by floor, so that −1 degree is the last sector. All wires
change at one instant; a real disc's wires do not, which is not modelled.
"""

import math
from collections.abc import Sequence

from adapter_sim.codec import encoder_code
from robot_bench.direct.distance import OWNER
from robot_bench.wires.nets import Net, Strength, Unconnected
from simbase.timing import Nanos

#: One turn in units of a nanoradian: the sectors' boundaries are off by less than 1e-9 rad.
NRAD_PER_TURN = round(2 * math.pi * 1e9)

#: More than the rounding of angles in floats adds up to.
SAFETY_NRAD = 1_000


class WheelEncoder:
    """One wheel's encoder; `nets` are its wires, least significant first."""

    def __init__(self, nets: Sequence[Net | Unconnected]) -> None:
        self._nets = tuple(nets)
        #: What the wires show; None where that is not known.
        self._shown: int | None = None

    def forget(self) -> None:
        """Set the wires the next time, whatever they show."""
        self._shown = None

    def margin_rad(self, angle_rad: float) -> float:
        """Return how far the wheel turns at least, either way, before the wires change; 0 where that is not known."""
        if self._shown is None:
            return 0.0
        within = (round(angle_rad * 1e9) << len(self._nets)) % NRAD_PER_TURN
        nearest = min(within, NRAD_PER_TURN - within) >> len(self._nets)
        return max(0, nearest - SAFETY_NRAD) / 1e9

    def show(self, angle_rad: float, now: Nanos) -> None:
        """Set the wires to the wheel's angle since the start."""
        code = encoder_code(round(angle_rad * 1e9), NRAD_PER_TURN, len(self._nets))
        if code == self._shown:
            return
        self._shown = code
        for bit, net in enumerate(self._nets):
            net.drive(OWNER, bool(code >> bit & 1), Strength.PUSH_PULL, now)
