"""What a robot puts on analog pins: the battery's volts through a divider, and those of distance sensors.

Not modelled: noise, the colour of what is seen, and the time that a sensor needs after power-on.
"""

from bisect import bisect_right
from collections.abc import Sequence

from robot_bench.direct.differential.description import BatteryDescription
from simbase.state import Stateful

SECONDS_PER_HOUR = 3600.0


def volts_at(curve: Sequence[tuple[float, float]], distance_m: float) -> float:
    """Return a sensor's volts: those of the curve's ends beyond them, a straight line between its points."""
    place = bisect_right(curve, distance_m, key=lambda point: point[0])
    if place == 0:
        return curve[0][1]
    if place == len(curve):
        return curve[-1][1]
    (x0, y0), (x1, y1) = curve[place - 1 : place + 1]
    return y0 + (y1 - y0) * (distance_m - x0) / (x1 - x0)


class DischargingBattery(Stateful):
    """A battery that is emptied: its volts without load fall in a straight line, its resistance stays."""

    STATE = ("used_ah", "volts")

    def __init__(self, settings: BatteryDescription) -> None:
        self._settings = settings
        self.used_ah = (1 - settings.charge) * settings.capacity_ah
        #: Under the present load.
        self.volts = self.source_v

    @property
    def source_v(self) -> float:
        """Its volts without load; none once it is empty."""
        settings = self._settings
        left = 1 - self.used_ah / settings.capacity_ah
        return settings.empty_v + (settings.full_v - settings.empty_v) * left if left > 0.0 else 0.0

    def give(self, amperes: float, span_s: float) -> None:
        """Give a current for a while; below 0 it is charged, up to full."""
        self.used_ah = max(0.0, self.used_ah + amperes * span_s / SECONDS_PER_HOUR)
