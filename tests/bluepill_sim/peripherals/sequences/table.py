"""Every row, in the order of the page."""

from tests.bluepill_sim.peripherals.sequences.buses.can import CAN
from tests.bluepill_sim.peripherals.sequences.buses.i2c import I2C
from tests.bluepill_sim.peripherals.sequences.buses.spi import SPI
from tests.bluepill_sim.peripherals.sequences.buses.usart import USART
from tests.bluepill_sim.peripherals.sequences.buses.usb import USB
from tests.bluepill_sim.peripherals.sequences.clocks.backup import BKP, RTC
from tests.bluepill_sim.peripherals.sequences.clocks.flash import FLASH
from tests.bluepill_sim.peripherals.sequences.clocks.pwr import PWR
from tests.bluepill_sim.peripherals.sequences.clocks.rcc import RCC
from tests.bluepill_sim.peripherals.sequences.clocks.watchdogs import IWDG, WWDG
from tests.bluepill_sim.peripherals.sequences.core.crc import CRC
from tests.bluepill_sim.peripherals.sequences.core.dma import DMA
from tests.bluepill_sim.peripherals.sequences.core.system import NVIC, SCB, SYSTICK
from tests.bluepill_sim.peripherals.sequences.pins.adc import ADC
from tests.bluepill_sim.peripherals.sequences.pins.exti import EXTI
from tests.bluepill_sim.peripherals.sequences.pins.gpio import AFIO, GPIO
from tests.bluepill_sim.peripherals.sequences.pins.tim import TIM
from tests.bluepill_sim.peripherals.sequences.row import SequenceRow

TABLES = (
    RCC,
    FLASH,
    GPIO,
    AFIO,
    EXTI,
    USART,
    SPI,
    I2C,
    DMA,
    ADC,
    TIM,
    CAN,
    USB,
    IWDG,
    WWDG,
    RTC,
    BKP,
    PWR,
    CRC,
    NVIC,
    SYSTICK,
    SCB,
)
ROWS: tuple[SequenceRow, ...] = tuple(row for table in TABLES for row in table.rows)
