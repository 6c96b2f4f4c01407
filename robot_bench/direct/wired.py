"""What every robot on a firmware engineer's own pins has: wires to the chip, of levels or of volts."""

from dataclasses import dataclass
from typing import Protocol


@dataclass(frozen=True, slots=True, kw_only=True)
class RobotWire:
    """A wire of a robot to the chip."""

    name: str
    #: Of the chip, such as "PA8".
    pin: str
    #: A resistor of the robot's holds it so while nobody drives it; None: no resistor.
    pull: bool | None = None
    #: It carries volts, and no level.
    is_analog: bool = False


class AnalogPin(Protocol):
    """A pin of the chip that takes volts."""

    def set_volts(self, volts: float | None) -> None:
        """Put volts on the wire from outside; None lets go."""
