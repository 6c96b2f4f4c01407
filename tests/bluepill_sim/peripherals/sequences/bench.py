"""A chip as it comes out of reset, driven by its registers: what a row of the tables is checked on.

No program runs: a check writes and reads registers by name, through the bus, at a time that it moves itself. What only
a core does (exceptions, sleep) is checked by a program: `program`.

    chip = Bench()
    chip.clock("GPIOC")                      its clock; without, it reads 0 and takes nothing
    chip["GPIOC.CRH.MODE13"] = 2             a field: read, changed, written
    chip["GPIOC.BSRR"] = 1 << 13             a register
    chip.run(2_000_000)                      nanoseconds

Invariant: an access goes through clock gates and byte lanes, as one of the core does.
"""

import ctypes
from typing import Any

from bluepill_sim.fabric.registers import BitField, Register, fields_of
from bluepill_sim.memory.bus import PeripheralBus
from bluepill_sim.peripherals.flash import DELIVERED
from bluepill_sim.stm32f103 import CLOCK_GATES, FLASH_BASE, PERIPHERAL_BASE, SRAM_BASE, SRAM_BYTES
from tests.bluepill_sim.conftest import FakeChip
from tests.bluepill_sim.machine import Machine

#: HCLK after a reset is 8 MHz: one cycle, in nanoseconds.
CYCLE_NS = 125
#: Bytes of flash that a bus master reads: 0, 1, 2 ...
FLASH_SAMPLE = bytes(range(0x100))


class Bench(FakeChip):
    """A chip in the state after power-on, with its bus."""

    def __init__(self) -> None:
        super().__init__()
        self.engine = _NoCore()
        self._bus = PeripheralBus(self.parts.by_name, self.parts.rcc, self)
        self.sram, self._flash = (ctypes.c_char * SRAM_BYTES)(), (ctypes.c_char * len(FLASH_SAMPLE))(*FLASH_SAMPLE)
        self.pins.fabric.add_memory(SRAM_BASE, self.sram, is_writable=True)
        self.pins.fabric.add_memory(FLASH_BASE, self._flash, is_writable=False)
        #: What the flash's controller erases and programs.
        self.array = FlashArray()
        self.parts.flash.memory = self.array

    def __getitem__(self, name: str) -> int:
        """Read "USART1.SR", or a field of it: "USART1.SR.TXE"."""
        part, register, field = self._found(name)
        word = self._bus.read(part.base - PERIPHERAL_BASE + register.offset, 4)
        return word if field is None else word >> field.low & (1 << field.high - field.low + 1) - 1

    def __setitem__(self, name: str, value: int) -> None:
        """Write a register, or read it and write it with one field changed."""
        part, register, field = self._found(name)
        at = part.base - PERIPHERAL_BASE + register.offset
        if field is not None:
            mask = (1 << field.high - field.low + 1) - 1 << field.low
            value = self._bus.read(at, 4) & ~mask | value << field.low & mask
        self._bus.write(at, 4, value)

    def store(self, name: str, value: int, size: int, byte: int = 0) -> None:
        """Write a byte or a halfword of a register."""
        part, register, _ = self._found(name)
        self._bus.write(part.base - PERIPHERAL_BASE + register.offset + byte, size, value)

    def word(self, base: str, offset: int, value: int | None = None) -> int:
        """Read, or write, a word at an offset of a peripheral that no register names, such as a packet's memory."""
        at = self.parts.by_name[base].base - PERIPHERAL_BASE + offset
        if value is None:
            return self._bus.read(at, 4)
        self._bus.write(at, 4, value)
        return value

    def clock(self, *names: str) -> None:
        """Switch on the clocks of peripherals."""
        for name in names:
            gate = CLOCK_GATES[name]
            self[f"RCC.{gate.register}"] |= 1 << gate.bit

    def run(self, ns: int) -> None:
        """Let time pass."""
        self.advance(self.now_ns + ns)

    def level(self, pin: str) -> bool:
        """Return the level of a pin's wire."""
        return bool(self.pins[pin].level)

    def drive(self, pin: str, level: bool | None) -> None:
        """Hold a pin from outside, or let it go."""
        self.pins[pin].drive(level)
        self.deliver()

    def put(self, address: int, data: bytes) -> None:
        """Write SRAM."""
        self.sram[address - SRAM_BASE : address - SRAM_BASE + len(data)] = data

    def got(self, address: int, size: int) -> bytes:
        """Read SRAM."""
        return bytes(self.sram[address - SRAM_BASE : address - SRAM_BASE + size])

    def reach_registers(self, address: int, size: int, written: int | None) -> int | None:
        return self._bus.reach(address - PERIPHERAL_BASE, size, written)

    def _found(self, name: str) -> tuple[Any, Register, BitField | None]:
        base, register, *field = name.split(".")
        part = self.parts.by_name[base]
        found = next((each for each in part.REGISTERS if each.name == register), None)
        if found is None:
            raise KeyError(name)
        if not field:
            return part, found, None
        fields = fields_of(part.fields_now(found, part.words[found.offset // 4]))
        for each in fields:
            if each.name == field[0]:
                return part, found, each
        raise KeyError(name)


class FlashArray:
    """Sixteen pages of flash, and the option bytes."""

    size = 16 * 1024

    def __init__(self) -> None:
        self.data = bytearray(b"\xff" * self.size)
        self.options = DELIVERED

    def read(self, offset: int, size: int) -> bytes:
        return bytes(self.data[offset : offset + size])

    def write(self, offset: int, data: bytes) -> None:
        self.data[offset : offset + len(data)] = data

    def write_options(self, options: bytes) -> None:
        self.options = options


class _NoCore:
    """What the bus tells a core that is not there."""

    def declare_zero(self, address: int) -> None: ...

    def declare_unclocked(self, address: int, *, is_write: bool, until_ns: int | None = None) -> None: ...

    def forget_unclocked(self) -> None: ...

    def declare_duplicated(self, address: int) -> None: ...


def program(source: str, vectors: dict[int, str | int] | None = None, us: float = 1000) -> Machine:
    """Run an assembled program from reset to its end, and return its machine: `log` is what it noted."""
    machine = Machine(source, vectors or {}).run(us)
    assert machine.is_done, f"the program stands at {machine.board.where()}: {machine.board.fault}"
    return machine


def store(address: int, value: int) -> str:
    """Return the instructions that write a word."""
    return f"mov32 r1, #{address}\nmov32 r2, #{value}\nstr r2, [r1, #0]\n"


def load(address: int) -> str:
    """Return the instructions that read a word into the log."""
    return f"mov32 r1, #{address}\nldr r0, [r1, #0]\nlog r0\n"
