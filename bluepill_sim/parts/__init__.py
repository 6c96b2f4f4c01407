"""Parts to hang on the chip's buses, each a real one with its data sheet's numbers; docs/parts.md says what of them.

Not the chip and not the board: a part knows the interface of its bus (`fabric/bus_parts.py`) and nothing else.
Invariant: a part is told the time; it has no clock.
"""

from bluepill_sim.fabric.bus_parts import CanFrame
from bluepill_sim.fabric.can_network import CanNetwork, CanNode
from bluepill_sim.parts.eeprom_24c02 import Eeprom24C02
from bluepill_sim.parts.spi_flash import SpiFlash

__all__ = ["CanFrame", "CanNetwork", "CanNode", "Eeprom24C02", "SpiFlash"]
