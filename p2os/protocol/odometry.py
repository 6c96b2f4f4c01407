"""Unwrap the counters of a SIP: positions of 15 bits, headings of 4096 counts.

Any step smaller than half of the modulus is exact, whatever the gap between
packets; a step of more than half looks like one the other way round. A robot's
counters begin at zero: a first value of the upper half lies below it.
"""

from p2os.protocol.sip import POSITION_MASK, StandardSip
from p2os.robots.parameters import RobotParameters
from simbase.state import Stateful

#: Positions are 15 bits wide in every firmware family (manuals, SIP table).
POSITION_MODULUS = POSITION_MASK + 1


class Unwrapper(Stateful):
    """Follow a counter that wraps.

    Args:
        modulus: How many values the counter has; 32768 for positions.
        last: What it has shown before; None: its first value is the beginning.
    """

    STATE = ("total", "_last")

    __slots__ = ("_last", "modulus", "total")

    def __init__(self, modulus: int, last: int | None = None) -> None:
        self.modulus = modulus
        #: Counts since the beginning, any size.
        self.total = 0
        self._last = last

    def update(self, raw: int) -> int:
        """Take a value; return the signed step since the last one, 0 for the beginning.

        The step lies in -modulus/2 (included) to modulus/2 (excluded).
        """
        half = self.modulus // 2
        last, self._last = self._last, raw
        step = 0 if last is None else (raw - last + half) % self.modulus - half
        self.total += step
        return step

    def forget(self) -> None:
        """Take the next value as a new beginning; the total stays."""
        self._last = None


class Odometry(Stateful):
    """Follow a robot's position and heading over any number of wraps.

    Whole counts are kept and nothing else: a heading of ten thousand turns is as
    exact as that of the first.

    Args:
        parameters: The robot's conversions.
    """

    STATE = ("_x", "_y", "_heading")

    def __init__(self, parameters: RobotParameters) -> None:
        self._parameters = parameters
        self._x, self._y = Unwrapper(POSITION_MODULUS, 0), Unwrapper(POSITION_MODULUS, 0)
        self._heading = Unwrapper(parameters.angle_counts_per_turn, 0)

    @property
    def x_m(self) -> float:
        """Metres along the odometry's x axis."""
        return self._x.total * self._parameters.distance_nm_per_count / 1e9

    @property
    def y_m(self) -> float:
        """Metres along the odometry's y axis."""
        return self._y.total * self._parameters.distance_nm_per_count / 1e9

    @property
    def heading_rad(self) -> float:
        """Radians, counter-clockwise; it does not wrap."""
        return self._heading.total * self._parameters.angle_conv_rad

    def update(self, sip: StandardSip) -> None:
        """Take a packet's counters."""
        self._x.update(sip.raw_x)
        self._y.update(sip.raw_y)
        self._heading.update(sip.raw_heading)
