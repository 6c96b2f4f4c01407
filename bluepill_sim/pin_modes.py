"""What a pin can do to its wire, and what GPIO can make of a pin.

Source: RM0008 9.1, table 20.
Invariant: these are plain values; `pins.py` has the pins.
"""

from enum import Enum
from typing import Self


class PinDrive(Enum):
    """What the chip itself puts on a wire."""

    #: The level that it makes when nobody stronger drives; None: none.
    level: bool | None
    #: Whether it is stronger than any pull.
    is_strong: bool

    def __new__(cls, label: str, level: bool | None, is_strong: bool) -> Self:
        """Make a member whose value is its label."""
        member = object.__new__(cls)
        member._value_ = label
        member.level, member.is_strong = level, is_strong
        return member

    #: Nothing: the chip listens, or has the pin in analog mode.
    NONE = "none", None, False
    #: Strong 0.
    LOW = "low", False, True
    #: Strong 1.
    HIGH = "high", True, True
    #: Weak 1 (about 40 kΩ).
    PULL_UP = "pull-up", True, False
    #: Weak 0 (about 40 kΩ).
    PULL_DOWN = "pull-down", False, False


class PinMode(Enum):
    """What GPIOx_CRL/CRH make of a pin."""

    #: What the chip drives for a 0 and for a 1: the ODR bit, or the level of the alternate function.
    drives: tuple[PinDrive, PinDrive]

    def __new__(cls, label: str, low: PinDrive, high: PinDrive) -> Self:
        """Make a member whose value is its label."""
        member = object.__new__(cls)
        member._value_ = label
        member.drives = (low, high)
        return member

    #: Schmitt trigger off: reads 0.
    ANALOG = "analog", PinDrive.NONE, PinDrive.NONE
    FLOATING = "floating input", PinDrive.NONE, PinDrive.NONE
    #: Input with the pull that the ODR bit chooses.
    PULLED = "pulled input", PinDrive.PULL_DOWN, PinDrive.PULL_UP
    PUSH_PULL = "output", PinDrive.LOW, PinDrive.HIGH
    OPEN_DRAIN = "open-drain output", PinDrive.LOW, PinDrive.NONE
    ALTERNATE_PUSH_PULL = "alternate function", PinDrive.LOW, PinDrive.HIGH
    ALTERNATE_OPEN_DRAIN = "open-drain alternate function", PinDrive.LOW, PinDrive.NONE


ALTERNATE_MODES = (PinMode.ALTERNATE_PUSH_PULL, PinMode.ALTERNATE_OPEN_DRAIN)
INPUT_MODES = (PinMode.FLOATING, PinMode.PULLED)
DRIVES_BY_VALUE = {drive.value: drive for drive in PinDrive}
MODES_BY_VALUE = {mode.value: mode for mode in PinMode}
