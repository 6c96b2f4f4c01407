"""Parts to plug into a board, each a real one with its data sheet's numbers; docs/parts.md says what of them.

Not the chip and not the board: a part knows the interface of its bus (`fabric/bus_parts.py`) and what it gets when it
is attached (`attached.py`), and nothing else.
Invariant: a part is told the time; it has no clock.

"""

from bluepill_sim.fabric.bus_parts import CanFrame
from bluepill_sim.fabric.can_network import CanNetwork, CanNode
from bluepill_sim.fabric.surroundings import BoardMotion, Surroundings
from bluepill_sim.parts.attached import PartError, Socket, Use
from bluepill_sim.parts.can_talker import CanTalker
from bluepill_sim.parts.eeprom_24c02 import Eeprom24C02
from bluepill_sim.parts.gps import Gps
from bluepill_sim.parts.hc_sr04 import HcSr04
from bluepill_sim.parts.mpu6050 import Mpu6050
from bluepill_sim.parts.panel import Button, LedPanel, Potentiometer
from bluepill_sim.parts.picture import Picture
from bluepill_sim.parts.sd_card import SdCard
from bluepill_sim.parts.servo import Servo
from bluepill_sim.parts.spi_flash import SpiFlash
from bluepill_sim.parts.ssd1306 import Ssd1306
from bluepill_sim.parts.ws2812 import Ws2812

__all__ = [
    "BoardMotion",
    "Button",
    "CanFrame",
    "CanNetwork",
    "CanNode",
    "CanTalker",
    "Eeprom24C02",
    "Gps",
    "HcSr04",
    "LedPanel",
    "Mpu6050",
    "PartError",
    "Picture",
    "Potentiometer",
    "SdCard",
    "Servo",
    "Socket",
    "SpiFlash",
    "Ssd1306",
    "Surroundings",
    "Use",
    "Ws2812",
]
