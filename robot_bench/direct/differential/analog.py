"""What a robot puts on analog pins: the battery's volts through a divider, and those of distance sensors.

Not modelled: noise, the colour of what is seen, and the time that a sensor needs after power-on.
"""

import ctypes
from bisect import bisect_right
from collections.abc import Sequence

from robot_bench.direct.differential.description import BatteryDescription
from robot_bench.direct.differential.native import BatteryStruct, functions, in_struct
from simbase.state import Stateful


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
    used_ah: float = in_struct("used_ah", "What is gone of its charge.")
    volts: float = in_struct("volts", "Its volts under the present load.")

    def __init__(self, settings: BatteryDescription) -> None:
        self.struct = BatteryStruct(
            settings.full_v, settings.empty_v, settings.capacity_ah, settings.resistance_ohm, settings.idle_current_a,
            (1 - settings.charge) * settings.capacity_ah,
        )  # fmt: skip
        self.address = ctypes.addressof(self.struct)
        self.volts = self.source_v

    @property
    def source_v(self) -> float:
        """Its volts without load; none once it is empty."""
        return float(functions().battery_source_v(self.address))

    def give(self, amperes: float, span_s: float) -> None:
        """Give a current for a while; below 0 it is charged, up to full."""
        functions().battery_give(self.address, amperes, span_s)
