"""An emulated STM32F103 on its BluePill board; knows nothing of robots or P2OS.

    from bluepill_sim import BluePill

    board = BluePill("firmware.elf")
    board.usart1.expect(b"ready", within="5 s")

Names are fetched on first use: importing the package loads no emulator.
"""

from typing import TYPE_CHECKING

from simbase.lazy import lazily

if TYPE_CHECKING:
    from bluepill_sim.board import BluePill, BoardSnapshot, WaitError
    from bluepill_sim.core.faults import FaultKind, FaultReport
    from bluepill_sim.errors import BluePillError, ImageError, UnmodelledError
    from bluepill_sim.fabric.pins import Pin, PinDrive
    from bluepill_sim.parts.serial_port import SerialPort
    from bluepill_sim.program.image import Image, load_image
    from simbase.errors import MissingDependencyError

    __version__: str

__all__ = [
    "BluePill",
    "BluePillError",
    "BoardSnapshot",
    "FaultKind",
    "FaultReport",
    "Image",
    "ImageError",
    "MissingDependencyError",
    "Pin",
    "PinDrive",
    "SerialPort",
    "UnmodelledError",
    "WaitError",
    "load_image",
]

if not TYPE_CHECKING:
    __getattr__, __dir__ = lazily(
        __name__,
        {
            "bluepill_sim.board": ("BluePill", "BoardSnapshot", "WaitError"),
            "bluepill_sim.core.faults": ("FaultKind", "FaultReport"),
            "bluepill_sim.errors": ("BluePillError", "ImageError", "UnmodelledError"),
            "bluepill_sim.fabric.pins": ("Pin", "PinDrive"),
            "bluepill_sim.program.image": ("Image", "load_image"),
            "bluepill_sim.parts.serial_port": ("SerialPort",),
            "simbase.errors": ("MissingDependencyError",),
        },
    )
