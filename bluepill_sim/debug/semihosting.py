"""Semihosting: a program that is debugged prints, and ends, through its debugger.

BKPT 0xAB asks for operation R0 with the parameter R1; the result comes back in
R0. Files are not offered but for `:tt`, the debugger's console: a program never
reads or writes the host's disk. There is no input: SYS_READC answers 0.

Source: "Semihosting for AArch32 and AArch64", Arm 2.0, chapters 4 and 6.
Invariant: any parameter, however wild, gives a result and no exception.
"""

import struct
from collections.abc import Callable
from dataclasses import dataclass

from bluepill_sim.board import BluePill
from bluepill_sim.core import Reg
from simbase.timing import NS_PER_S

#: The encoding of BKPT 0xAB.
SEMIHOSTING_BKPT = 0xBEAB
_OPEN, _CLOSE, _WRITEC, _WRITE0, _WRITE, _READ, _READC = 0x01, 0x02, 0x03, 0x04, 0x05, 0x06, 0x07
_ISTTY, _CLOCK, _TIME, _ERRNO, _EXIT, _EXIT_EXTENDED, _ELAPSED, _TICKFREQ = (
    0x09, 0x10, 0x11, 0x13, 0x18, 0x20, 0x30, 0x31,
)  # fmt: skip
#: ADP_Stopped_ApplicationExit: the program is content.
_APPLICATION_EXIT = 0x20026
_FAILED = 0xFFFF_FFFF
_CONSOLE_HANDLE = 1
#: chosen: longer than any line that a program prints.
_LONGEST_TEXT = 4096


@dataclass(frozen=True, slots=True)
class Ended:
    """The program has ended."""

    code: int


class Semihosting:
    """Serves the calls of one board.

    Args:
        board: whose program calls.
        write: takes what it prints.
    """

    def __init__(self, board: BluePill, write: Callable[[bytes], None]) -> None:
        self._board = board
        self._write = write

    def is_call(self, pc: int) -> bool:
        """Tell whether the instruction at an address is a call."""
        return self._board.read_memory(pc, 2) == SEMIHOSTING_BKPT.to_bytes(2, "little")

    def serve(self) -> Ended | None:
        """Carry out the call that the chip stands at, and go past it; tell whether the program has ended."""
        registers = self._board.chip.engine.registers
        operation, parameter = registers[Reg.R0], registers[Reg.R1]
        if operation in {_EXIT, _EXIT_EXTENDED}:
            return Ended(self._exit_code(operation, parameter))
        served = self._calls().get(operation)
        registers[Reg.R0] = (_FAILED if served is None else served(parameter)) & 0xFFFF_FFFF
        self._board.chip.engine.jump(self._board.pc + 2 | 1)
        return None

    def _calls(self) -> dict[int, Callable[[int], int]]:
        return {
            _OPEN: self._open,
            _CLOSE: lambda _: 0,
            _WRITEC: lambda at: self._put(self._bytes(at, 1)),
            _WRITE0: lambda at: self._put(self._text(at)),
            _WRITE: self._write_block,
            _READ: lambda at: self._words(at, 3)[2],  # nothing was read: what is left is all
            _READC: lambda _: 0,
            _ISTTY: lambda _: 1,
            _CLOCK: lambda _: self._board.now_ns * 100 // NS_PER_S,
            _TIME: lambda _: self._board.now_ns // NS_PER_S,
            _ERRNO: lambda _: 0,
            _ELAPSED: self._elapsed,
            _TICKFREQ: lambda _: self._board.hclk_hz,
        }

    def _exit_code(self, operation: int, parameter: int) -> int:
        if operation == _EXIT_EXTENDED:
            reason, code = self._words(parameter, 2)
            return code & 0xFF if reason == _APPLICATION_EXIT else 1
        return 0 if parameter == _APPLICATION_EXIT else 1

    def _open(self, at: int) -> int:
        name, _, length = self._words(at, 3)
        return _CONSOLE_HANDLE if self._bytes(name, min(length, _LONGEST_TEXT)) == b":tt" else _FAILED

    def _write_block(self, at: int) -> int:
        handle, data, length = self._words(at, 3)
        if handle not in {_CONSOLE_HANDLE, _CONSOLE_HANDLE + 1}:
            return length
        return length - len(self._put_bytes(self._bytes(data, min(length, _LONGEST_TEXT))))

    def _elapsed(self, at: int) -> int:
        is_written = self._board.chip.memory.write(at, self._board.cycle.to_bytes(8, "little"))
        return 0 if is_written else _FAILED

    def _put(self, data: bytes) -> int:
        self._put_bytes(data)
        return 0

    def _put_bytes(self, data: bytes) -> bytes:
        if data:
            self._write(data)
        return data

    def _words(self, at: int, count: int) -> tuple[int, ...]:
        data = self._bytes(at, 4 * count)
        return struct.unpack(f"<{count}I", data) if len(data) == 4 * count else (0,) * count

    def _bytes(self, at: int, count: int) -> bytes:
        return self._board.read_memory(at, count) or b""

    def _text(self, at: int) -> bytes:
        found = bytearray()
        while len(found) < _LONGEST_TEXT:
            byte = self._bytes(at + len(found), 1)
            if byte in {b"", b"\0"}:
                break
            found += byte
        return bytes(found)
