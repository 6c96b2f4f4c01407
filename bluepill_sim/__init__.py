"""An emulated STM32F103 on its BluePill board; knows nothing of robots or P2OS."""

from bluepill_sim.board import BluePill, BoardSnapshot, WaitError
from bluepill_sim.core.faults import FaultKind, FaultReport
from bluepill_sim.errors import BluePillError, ImageError, UnmodelledError
from bluepill_sim.fabric.pins import Pin, PinDrive
from bluepill_sim.program.image import Image, Symbol, SymbolTable, load_image
from bluepill_sim.serial_port import Activity, SerialPort
from bluepill_sim.timing import ChipReached
from simbase.errors import MissingDependencyError
from simbase.timing import Nanos, Reason

__all__ = [
    "Activity",
    "BluePill",
    "BluePillError",
    "BoardSnapshot",
    "ChipReached",
    "FaultKind",
    "FaultReport",
    "Image",
    "ImageError",
    "MissingDependencyError",
    "Nanos",
    "Pin",
    "PinDrive",
    "Reason",
    "SerialPort",
    "Symbol",
    "SymbolTable",
    "UnmodelledError",
    "WaitError",
    "load_image",
]
