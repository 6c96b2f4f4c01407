"""What the chip looks like to GDB: its registers and its memories, as XML.

Source: Debugging with GDB, appendix G.5.3 "ARM Features" (m-profile, m-system), E.18 "Memory Map Format".
Invariant: the number of a register is its place in `REGISTERS`.
"""

from dataclasses import dataclass

from bluepill_sim.stm32f103 import (
    FLASH_BASE,
    FLASH_BYTES_FITTED,
    PERIPHERAL_BASE,
    SRAM_BASE,
    SRAM_BYTES,
    SYSTEM_MEMORY_BASE,
)

#: Bytes of one page of flash (RM0008 3.3.3).
FLASH_PAGE_BYTES = 0x400
_SYSTEM_BYTES = 0xC00
_PPB_BASE = 0xE000_0000


@dataclass(frozen=True, slots=True)
class RegisterRow:
    """One register, as GDB knows it."""

    name: str
    bits: int
    type: str = "int"

    @property
    def size(self) -> int:
        """Bytes on the line."""
        return self.bits // 8


_GENERAL = tuple(RegisterRow(f"r{n}", 32) for n in range(13))
_SPECIAL = (
    RegisterRow("sp", 32, "data_ptr"),
    RegisterRow("lr", 32),
    RegisterRow("pc", 32, "code_ptr"),
    RegisterRow("xpsr", 32),
)
_SYSTEM = (
    RegisterRow("msp", 32, "data_ptr"),
    RegisterRow("psp", 32, "data_ptr"),
    RegisterRow("primask", 8, "int8"),
    RegisterRow("basepri", 8, "int8"),
    RegisterRow("faultmask", 8, "int8"),
    RegisterRow("control", 8, "int8"),
)
REGISTERS = (*_GENERAL, *_SPECIAL, *_SYSTEM)


def target_xml() -> str:
    """Return the registers."""

    def rows(registers: tuple[RegisterRow, ...], group: str) -> str:
        return "".join(
            f'    <reg name="{r.name}" bitsize="{r.bits}" type="{r.type}" group="{group}"/>\n' for r in registers
        )

    return (
        '<?xml version="1.0"?>\n<!DOCTYPE target SYSTEM "gdb-target.dtd">\n<target version="1.0">\n'
        "  <architecture>arm</architecture>\n"
        '  <feature name="org.gnu.gdb.arm.m-profile">\n' + rows((*_GENERAL, *_SPECIAL), "general") + "  </feature>\n"
        '  <feature name="org.gnu.gdb.arm.m-system">\n' + rows(_SYSTEM, "system") + "  </feature>\n</target>\n"
    )


def memory_map_xml() -> str:
    """Return the memories; what is not named GDB must not touch."""
    flash = f'<property name="blocksize">{FLASH_PAGE_BYTES:#x}</property>'
    rows = (
        ("flash", 0, FLASH_BYTES_FITTED, flash),
        ("flash", FLASH_BASE, FLASH_BYTES_FITTED, flash),
        ("rom", SYSTEM_MEMORY_BASE, _SYSTEM_BYTES, ""),
        ("ram", SRAM_BASE, SRAM_BYTES, ""),
        ("ram", PERIPHERAL_BASE, 0x2000_0000, ""),
        ("ram", _PPB_BASE, 0x10_0000, ""),
    )
    body = "".join(
        f'  <memory type="{kind}" start="{start:#x}" length="{length:#x}">{inner}</memory>\n'
        for kind, start, length, inner in rows
    )
    return (
        '<?xml version="1.0"?>\n<!DOCTYPE memory-map PUBLIC "+//IDN gnu.org//DTD GDB Memory Map V1.0//EN" '
        '"http://sourceware.org/gdb/gdb-memory-map.dtd">\n<memory-map>\n' + body + "</memory-map>\n"
    )
