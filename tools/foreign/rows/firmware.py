"""Firmware of others on the emulated BluePill."""

from tools.foreign.row import Row
from tools.foreign.rows.instruments import INSTRUMENTS
from tools.foreign.rows.printers import PRINTERS
from tools.foreign.rows.systems import SYSTEMS
from tools.foreign.rows.usb import USB

FIRMWARE: tuple[Row, ...] = (*PRINTERS, *INSTRUMENTS, *SYSTEMS, *USB)
