"""The bus between the core and the peripherals, and the alias regions in which a word is a bit.

This is not the bus of the core itself, nor the queue of accesses: peripherals are
reached here once the engine has found their region.

Source: RM0008 sections 3.1, 3.3.2 (bit-band) and 7.3 (clock gates).
Invariant: no access of the core ever raises; what nothing answers reads 0 and is warned of.
"""

import ctypes
from typing import Protocol

from bluepill_sim.fabric.fabric import FabricPorts
from bluepill_sim.fabric.registers import Peripheral
from bluepill_sim.peripherals.rcc import Rcc
from bluepill_sim.stm32f103 import CLOCK_GATES, PERIPHERAL_BASE, name_at
from simbase.state import Stateful
from simbase.timing import Nanos

#: What is mapped as peripherals: APB1, APB2 and AHB up to the end of CRC and reserved pages.
PERIPHERAL_BYTES = 0x2_4000
_PAGE_SHIFT = 10

#: Bit-band alias regions (RM0008 3.3.2) and how many alias bytes there are for each byte.
SRAM_ALIAS, PERIPHERAL_ALIAS = 0x2200_0000, 0x4200_0000
ALIAS_BYTES = 32

#: chosen: reading a peripheral without its clock for so long is no de-initialization that passes by.
UNCLOCKED_NS: Nanos = 1_000_000


class BusEngine(Protocol):
    """What the bus says to what runs the instructions."""

    def declare_zero(self, address: int) -> None:
        """Let a word be read as 0, and ignore what is written, without asking."""

    def declare_unclocked(self, address: int, *, is_write: bool, until_ns: Nanos | None = None) -> None:
        """Let a peripheral without its clock read 0 without asking up to a time, None for ever; or ignore writes."""

    def forget_unclocked(self) -> None:
        """Ask again at each access without a clock."""

    def declare_duplicated(self, address: int) -> None:
        """Let narrow writes to a register be duplicated over its word without asking."""


class BusPorts(FabricPorts, Protocol):
    """The chip as its bus sees it."""

    @property
    def engine(self) -> BusEngine:
        """What runs the instructions."""


class PeripheralBus(Stateful):
    """Reads and writes of the peripheral region; offsets count from PERIPHERAL_BASE.

    A peripheral sees an access only while its clock is on. Accesses without one are warned of where they matter: a
    write that sets what a reset would not leave, and reading on for a while; ST's de-initializations do neither.
    """

    STATE = ("read_unclocked_ns",)

    def __init__(self, parts: dict[str, Peripheral], rcc: Rcc, chip: BusPorts) -> None:
        self._pages = {
            (part.base - PERIPHERAL_BASE >> _PAGE_SHIFT) + page: part
            for part in parts.values()
            for page in range(part.place.size >> _PAGE_SHIFT)
        }
        self._rcc = rcc
        self._chip = chip
        #: When each peripheral was first read without its clock since that was last on, in ns.
        self.read_unclocked_ns: dict[str, Nanos] = {}
        rcc.on_gates = self._forget_clocked

    def read(self, offset: int, size: int) -> int:
        """Return what the core reads."""
        part = self._pages.get(offset >> _PAGE_SHIFT)
        if part is None:
            self._refuse(None, offset, "read of")
            return 0
        if not self._rcc.is_clocked(part.name):
            now_ns = self._chip.now_ns
            self._rcc.native.watches_gates = True
            quiet_ns: Nanos | None = self.read_unclocked_ns.setdefault(part.name, now_ns) + UNCLOCKED_NS
            if quiet_ns is not None and now_ns >= quiet_ns:
                self._refuse(part, offset, "read of")
                quiet_ns = None
            self._chip.engine.declare_unclocked(PERIPHERAL_BASE + offset, is_write=False, until_ns=quiet_ns)
            return 0
        at = PERIPHERAL_BASE + offset - part.base
        word = part.read(at, size)
        self._forget_warned(part, at)
        return word

    def write(self, offset: int, size: int, value: int) -> None:
        """Take what the core writes."""
        part = self._pages.get(offset >> _PAGE_SHIFT)
        if part is None:
            self._refuse(None, offset, f"write of {value:#x} to")
            return
        if not self._rcc.is_clocked(part.name):
            if part.changes_reset_value(PERIPHERAL_BASE + offset - part.base, value):
                self._refuse(part, offset, f"write of {value:#x} to")
                self._chip.engine.declare_unclocked(PERIPHERAL_BASE + offset, is_write=True)
            return
        at = PERIPHERAL_BASE + offset - part.base
        part.write(at, size, value)
        self._forget_warned(part, at)

    def reach(self, offset: int, size: int, written: int | None) -> int | None:
        """Make an access of a bus master: the word that is read, 0 after a write, None where nothing answers."""
        part = self._pages.get(offset >> _PAGE_SHIFT)
        if part is None or not self._rcc.is_clocked(part.name):
            return None
        if written is None:
            return part.read(PERIPHERAL_BASE + offset - part.base, size)
        part.write(PERIPHERAL_BASE + offset - part.base, size, written)
        return 0

    def read_bit(self, offset: int, size: int) -> int:
        """Return a bit through its alias; `offset` counts from the alias region."""
        del size  # a narrow access reads the same bit
        bit = offset >> 2 & 31
        return self.read(offset >> 5 & ~3, 4) >> bit & 1

    def write_bit(self, offset: int, size: int, value: int) -> None:
        """Set a bit through its alias: the bus matrix reads the word, changes the bit, writes the word."""
        del size
        bit = 1 << (offset >> 2 & 31)
        word = self.read(offset >> 5 & ~3, 4)
        self.write(offset >> 5 & ~3, 4, word | bit if value & 1 else word & ~bit)

    def _forget_warned(self, part: Peripheral, at: int) -> None:
        """Let the engine do alone what has now been warned of."""
        if not part.has_register(at):
            if type(part).write is Peripheral.write:  # else it judges each write itself
                self._chip.engine.declare_zero(part.base + at)
        elif at >> 2 in part.duplicated:
            self._chip.engine.declare_duplicated(part.base + at)

    def _forget_clocked(self) -> None:
        """Begin anew with what has its clock now: drivers look at a peripheral before they switch it on, each time."""
        clocked = [name for name in self.read_unclocked_ns if self._rcc.is_clocked(name)]
        for name in clocked:
            del self.read_unclocked_ns[name]
        self._chip.engine.forget_unclocked()
        self._rcc.native.watches_gates = bool(self.read_unclocked_ns)

    def _refuse(self, part: Peripheral | None, offset: int, what: str) -> None:
        """Warn of an access to nothing: it reads 0, and a write is lost."""
        address = PERIPHERAL_BASE + offset
        if part is None:
            name = name_at(address)
            text = f"{name} is not modelled" if name else "no peripheral is here"
            self._chip.warn(f"{text} ({what} {address:#010x})", once=f"unmodelled:{name or address & ~0x3FF:}")
            self._chip.engine.declare_zero(address)
            return
        gate = CLOCK_GATES[part.name]
        self._chip.warn(
            f"{part.name} has no clock: RCC_{gate.register} bit {gate.bit} is 0 ({what} {address:#010x})",
            once=f"clock:{part.name}",
        )


class SramBitBand:
    """The alias region of the SRAM's bits."""

    def __init__(self, sram: "ctypes.Array[ctypes.c_char]") -> None:
        self._bytes = (ctypes.c_ubyte * len(sram)).from_buffer(sram)

    def read_bit(self, offset: int, size: int) -> int:
        """Return a bit through its alias."""
        del size
        return self._bytes[offset >> 5] >> (offset >> 2 & 7) & 1

    def write_bit(self, offset: int, size: int, value: int) -> None:
        """Set a bit through its alias."""
        del size
        bit = 1 << (offset >> 2 & 7)
        at = offset >> 5
        self._bytes[at] = self._bytes[at] | bit if value & 1 else self._bytes[at] & ~bit
