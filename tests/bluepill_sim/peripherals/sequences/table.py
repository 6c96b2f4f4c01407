"""Every row, in the order of the page."""

from tests.bluepill_sim.peripherals.sequences.clocks.flash import FLASH
from tests.bluepill_sim.peripherals.sequences.clocks.rcc import RCC
from tests.bluepill_sim.peripherals.sequences.pins.exti import EXTI
from tests.bluepill_sim.peripherals.sequences.pins.gpio import AFIO, GPIO
from tests.bluepill_sim.peripherals.sequences.row import SequenceRow

TABLES = (RCC, FLASH, GPIO, AFIO, EXTI)
ROWS: tuple[SequenceRow, ...] = tuple(row for table in TABLES for row in table.rows)
