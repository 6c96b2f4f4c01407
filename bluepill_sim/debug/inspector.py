"""Registers and memory of a chip that stands still, as a debugger reads and writes them.

Peripherals are read without the side effects that a program's read would have;
writes to them act as the program's would.

Invariant: reading changes nothing, not even a status flag.
"""

from collections.abc import Callable
from itertools import accumulate

from bluepill_sim.board import BluePill
from bluepill_sim.core import Reg
from bluepill_sim.core.system_control import PPB_BASE, PPB_BYTES
from bluepill_sim.debug.target_description import REGISTERS
from bluepill_sim.errors import BluePillError
from bluepill_sim.fabric.registers import Peripheral
from bluepill_sim.stm32f103 import BASES, FLASH_BASE, FLASH_BYTES_FITTED, name_at, without_alias

_HANDLER_IPSR = 3
_T_BIT = 1 << 24
_FLAGS = 0xF800_0000
_PC, _XPSR = "pc", "xpsr"
#: BASEPRI has its upper four bits; CONTROL has two.
_BYTE_MASKS = {"basepri": 0xF0, "control": 3, "primask": 1, "faultmask": 1}


class Inspector:
    """Reads and writes one board."""

    def __init__(self, board: BluePill) -> None:
        self._board = board
        ends = list(accumulate(row.size for row in REGISTERS))
        #: Where each register begins and ends among all of them, in bytes.
        self.layout = tuple(zip([0, *ends], ends, strict=False))

    # Registers.

    def read_registers(self) -> bytes:
        """Return every register, in the order of `description.REGISTERS`, little-endian."""
        return b"".join(self.read_register(number) for number in range(len(REGISTERS)))

    def read_register(self, number: int) -> bytes:
        """Return one register.

        Raises:
            IndexError: there is no such register.
        """
        row = REGISTERS[number]
        return (self.register(row.name) & (1 << row.bits) - 1).to_bytes(row.size, "little")

    def write_register(self, number: int, data: bytes) -> None:
        """Set one register.

        Raises:
            IndexError: there is no such register.
            BluePillError: it has another size.
        """
        row = REGISTERS[number]
        if len(data) != row.size:
            raise BluePillError(f"{row.name} has {row.size} bytes, got {len(data)}")
        self.set_register(row.name, int.from_bytes(data, "little"))

    def register(self, name: str) -> int:
        """Return a register by its name in lower case."""
        engine = self._board.chip.engine
        if name == _PC:
            return engine.pc
        if name == _XPSR:
            kept = engine.registers[Reg.XPSR] & ~(0x1FF | _T_BIT)
            return kept | self._board.chip.processor.exception_number | (_T_BIT if engine.is_thumb else 0)
        if name in {"msp", "psp", *_BYTE_MASKS}:
            value = self._privileged(lambda: engine.registers[Reg[name.upper()]])
            return value & _BYTE_MASKS.get(name, 0xFFFF_FFFF)
        return engine.registers[Reg[name.upper()]]

    def set_register(self, name: str, value: int) -> None:
        """Set a register by its name in lower case; of xPSR only the flags."""
        engine = self._board.chip.engine
        if name == _PC:
            engine.jump(value | 1)
        elif name == _XPSR:
            engine.registers[Reg.CPSR] = engine.registers[Reg.CPSR] & ~_FLAGS | value & _FLAGS
        else:
            engine.registers[Reg[name.upper()]] = value & _BYTE_MASKS.get(name, 0xFFFF_FFFF)

    def _privileged(self, read: Callable[[], int]) -> int:
        """Read what an unprivileged thread may not: the engine is taken into handler mode and back."""
        registers = self._board.chip.engine.registers
        if self._board.chip.processor.exception_number:
            return read()
        # The engine banks r13 by IPSR: put back exactly what was there.
        saved = registers[Reg.SP]
        registers[Reg.IPSR] = _HANDLER_IPSR
        try:
            return read()
        finally:
            registers[Reg.IPSR] = 0
            if registers[Reg.SP] != saved:
                registers[Reg.SP] = saved

    # Memory.

    def read_memory(self, address: int, size: int) -> bytes | None:
        """Return bytes; as many as can be read, None where none can."""
        whole = self._board.read_memory(address, size)
        if whole is not None:
            return whole
        result = bytearray()
        while len(result) < size:
            data = self._read_up_to_word(address + len(result))
            if data is None:
                break
            result += data
        return bytes(result[:size]) or None

    def write_memory(self, address: int, data: bytes) -> bool:
        """Write bytes to SRAM, to flash as a programmer would, or to a peripheral; False where nothing is."""
        memory = self._board.chip.memory
        if memory.write(address, data):
            self._board.chip.engine.drop_code(address, len(data))
            return True
        offset = without_alias(address) - FLASH_BASE
        if 0 <= offset <= FLASH_BYTES_FITTED - len(data):
            self.program_flash(offset, data)
            return True
        return self._write_peripheral(address, data)

    def program_flash(self, offset: int, data: bytes) -> None:
        """Put bytes into the flash array."""
        chip = self._board.chip
        chip.memory.load_flash(offset, data)
        for base in (0, FLASH_BASE):
            chip.engine.drop_code(base + offset, len(data))

    def _read_up_to_word(self, address: int) -> bytes | None:
        """Return a byte of a memory, or the rest of a register, of which a look at it may take long."""
        memory = self._board.read_memory(address, 1)
        if memory is not None:
            return memory
        word = self.peek_word(address & ~3)
        return None if word is None else word.to_bytes(4, "little")[address & 3 :]

    def peek_word(self, address: int) -> int | None:
        """Return a register of a peripheral or of the core without side effects; None where none is."""
        chip = self._board.chip
        if PPB_BASE <= address < PPB_BASE + PPB_BYTES:
            with self._board.without_warnings():
                saved = chip.system.snapshot(), chip.processor.systick.snapshot()
                value = chip.system.read(address - PPB_BASE, 4)
                chip.system.restore(saved[0])
                chip.processor.systick.restore(saved[1])
                return value
        part, offset = self._part_at(address)
        if part is None:
            return None
        return part.look(offset) if offset < part.place.size else 0

    def _part_at(self, address: int) -> tuple[Peripheral | None, int]:
        """Return the peripheral at an address and how far in it that is."""
        name = name_at(address)
        return self._board.chip.parts.by_name.get(name or ""), address - BASES.get(name or "", 0)

    def _write_peripheral(self, address: int, data: bytes) -> bool:
        is_core = PPB_BASE <= address < PPB_BASE + PPB_BYTES
        part, offset = (self._board.chip.system, address - PPB_BASE) if is_core else self._part_at(address)
        if part is None or len(data) not in {1, 2, 4}:
            return False
        part.write(offset, len(data), int.from_bytes(data, "little"))
        return True
