"""The ESP32 adapter as a model: pins of a BluePill on one side, P2OS on the other.

It knows the pin-out (pinout.toml), the robot's parameters and the protocol, but
neither the chip nor the world: it meets them at wires.
"""

from typing import TYPE_CHECKING

from simbase.lazy import lazily

if TYPE_CHECKING:
    from adapter_sim.adapter import Adapter, AdapterState, AdapterStatus
    from adapter_sim.codec import BitOrder
    from adapter_sim.pinout import Pinout, PinoutError, load_pinout, parse_pinout
    from adapter_sim.pins import AdapterPins
    from adapter_sim.settings import AdapterSettings, EncoderAtOpen, MotorCommand, MotorMeaning

    __version__: str

__all__ = [
    "Adapter",
    "AdapterPins",
    "AdapterSettings",
    "AdapterState",
    "AdapterStatus",
    "BitOrder",
    "EncoderAtOpen",
    "MotorCommand",
    "MotorMeaning",
    "Pinout",
    "PinoutError",
    "load_pinout",
    "parse_pinout",
]

if not TYPE_CHECKING:
    __getattr__, __dir__ = lazily(
        __name__,
        {
            "adapter_sim.adapter": ("Adapter", "AdapterState", "AdapterStatus"),
            "adapter_sim.codec": ("BitOrder",),
            "adapter_sim.pinout": ("Pinout", "PinoutError", "load_pinout", "parse_pinout"),
            "adapter_sim.pins": ("AdapterPins",),
            "adapter_sim.settings": ("AdapterSettings", "EncoderAtOpen", "MotorCommand", "MotorMeaning"),
        },
    )
