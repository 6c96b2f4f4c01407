"""The registers of the engine, read and written in batches without allocating.

A Python call into the library costs a microsecond whatever it carries, so
that exception entry and return move all they need in one call each.

Invariant: a `Batch` refers to the same C arrays for its whole life.
"""

import ctypes
from enum import Enum

from bluepill_sim.cpu.binding import Library


class Register(Enum):
    """A register, by the number that the library gives it (arm.h of Unicorn 2.1)."""

    R0 = 66
    R1 = 67
    R2 = 68
    R3 = 69
    R4 = 70
    R5 = 71
    R6 = 72
    R7 = 73
    R8 = 74
    R9 = 75
    R10 = 76
    R11 = 77
    R12 = 78
    SP = 12
    LR = 10
    PC = 11
    #: Flags, T bit, ITSTATE; writing it also rebuilds the engine's idea of mode and privilege.
    CPSR = 3
    #: Flags, T bit, ITSTATE and IPSR; writing it sets the flags only.
    XPSR = 120
    IPSR = 114
    MSP = 115
    PSP = 116
    CONTROL = 117
    BASEPRI = 124
    FAULTMASK = 126
    PRIMASK = 123


class Batch:
    """A fixed list of registers, moved together."""

    def __init__(self, library: Library, handle: int, registers: tuple[Register, ...]) -> None:
        count = len(registers)
        self.values = (ctypes.c_uint32 * count)()
        self._numbers = (ctypes.c_int * count)(*(r.value for r in registers))
        base = ctypes.addressof(self.values)
        self._pointers = (ctypes.c_void_p * count)(*(base + 4 * n for n in range(count)))
        self._count = count
        self._handle = handle
        self._read = library.read_registers
        self._write = library.write_registers
        self._at = (ctypes.addressof(self._numbers), ctypes.addressof(self._pointers))

    def read(self) -> tuple[int, ...]:
        """Return the registers' values, in order."""
        self._read(self._handle, *self._at, self._count)
        return tuple(self.values)

    def write(self, values: tuple[int, ...]) -> None:
        """Set the registers, in order."""
        self.values[:] = list(values)
        self._write(self._handle, *self._at, self._count)


class RegisterFile:
    """All registers, one at a time."""

    def __init__(self, library: Library, handle: int) -> None:
        self._handle = handle
        self._library = library
        self._value = ctypes.c_uint32()
        self._at = ctypes.addressof(self._value)
        self._read = library.read_register
        self._write = library.write_register

    def __getitem__(self, register: Register) -> int:
        """Return one register."""
        self._read(self._handle, register.value, self._at)
        return self._value.value

    def __setitem__(self, register: Register, value: int) -> None:
        """Set one register."""
        self._value.value = value
        self._write(self._handle, register.value, self._at)

    def general(self, number: int) -> int:
        """Return R0 to R15 by number."""
        return self[GENERAL[number]]

    def batch(self, *registers: Register) -> Batch:
        """Return a list of registers to be moved together."""
        return Batch(self._library, self._handle, registers)


#: R0 to R15 in order.
GENERAL = (
    Register.R0, Register.R1, Register.R2, Register.R3, Register.R4, Register.R5, Register.R6, Register.R7,
    Register.R8, Register.R9, Register.R10, Register.R11, Register.R12, Register.SP, Register.LR, Register.PC,
)  # fmt: skip
