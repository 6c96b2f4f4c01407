"""The two modules: which pin stands where, and what a pin can bear.

Sources: the silkscreen of the boards as sold (memory, both orders cross-checked
with the thesis's schematic), the STM32F103x8 data sheet's pin table and the
ESP32 data sheet's list of straps.

Invariant: forty pins each, numbered 1 to 40, no GPIO twice.
"""

from types import MappingProxyType

#: BluePill from above, USB at the top: left row from the top (1..20), right row from the bottom (21..40).
BLUEPILL_PINS: tuple[str, ...] = (
    "PB12", "PB13", "PB14", "PB15", "PA8", "PA9", "PA10", "PA11", "PA12", "PA15",
    "PB3", "PB4", "PB5", "PB6", "PB7", "PB8", "PB9", "5V", "GND", "3V3",
    "VBAT", "PC13", "PC14", "PC15", "PA0", "PA1", "PA2", "PA3", "PA4", "PA5",
    "PA6", "PA7", "PB0", "PB1", "PB10", "PB11", "NRST", "3V3", "GND", "GND",
)  # fmt: skip

#: ESP32 D1 mini from above, antenna at the top: outer left, inner left, inner right, outer right, from the top.
ESP32_PINS: tuple[str, ...] = (
    "GND", "NC", "IO39", "IO35", "IO33", "IO34", "IO14", "NC", "IO9", "IO11",
    "EN", "IO36", "IO26", "IO18", "IO19", "IO23", "IO5", "3V3", "IO13", "IO10",
    "IO1", "IO3", "IO22", "IO21", "IO17", "IO16", "GND", "5V", "IO15", "IO7",
    "GND", "IO27", "IO25", "IO32", "IO12", "IO4", "IO0", "IO2", "IO8", "IO6",
)  # fmt: skip

#: What the module's silkscreen calls its pins, where that is not the GPIO's name.
ESP32_SILKSCREEN = MappingProxyType({
    "EN": "RST", "IO36": "SVP", "IO39": "SVN", "IO13": "TCK", "IO14": "TMS", "IO12": "TDI", "IO15": "TDO",
    "IO10": "SD3", "IO9": "SD2", "IO11": "CMD", "IO6": "CLK", "IO7": "SD0", "IO8": "SD1", "IO1": "TXD", "IO3": "RXD",
})  # fmt: skip

#: Pins of the STM32F103 that bear no more than VDD + 0.3 V (no FT mark in the data sheet's pin table).
NOT_5V_TOLERANT = frozenset({
    "PA0", "PA1", "PA2", "PA3", "PA4", "PA5", "PA6", "PA7", "PB0", "PB1", "PB5", "PC13", "PC14", "PC15",
})  # fmt: skip

#: Debug pins after reset. PB3 and PB4 become GPIO when the program sets AFIO SWJ_CFG; SWD must stay free.
JTAG_ONLY = frozenset({"PA15", "PB3", "PB4"})
SWD = frozenset({"PA13", "PA14"})

#: Level that each strap needs at reset for a normal boot from flash (ESP32 data sheet, "Strapping Pins").
STRAP_LEVEL = MappingProxyType({"IO0": True, "IO2": False, "IO5": True, "IO12": False, "IO15": True})
