"""A game pad as the adapter's other master: `p2os.gamepad`, with the adapter's settings."""

from enum import StrEnum

from adapter_sim.settings import AdapterSettings
from p2os.gamepad import STICK_FULL, TRIGGER_FULL, GamepadSnapshot, PadReport
from p2os.gamepad import Gamepad as AnyGamepad

__all__ = ["STICK_FULL", "TRIGGER_FULL", "Gamepad", "GamepadSnapshot", "Master", "PadReport"]


class Master(StrEnum):
    """Who commands the robot; never both."""

    BLUEPILL = "bluepill"
    PAD = "pad"


class Gamepad(AnyGamepad):
    """What the newest report asks for."""

    def __init__(self, settings: AdapterSettings) -> None:
        super().__init__(
            trigger_dead=settings.pad_trigger_dead,
            stick_dead=settings.pad_stick_dead,
            loss_ns=settings.pad_loss_ns,
        )
