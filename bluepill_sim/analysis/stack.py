"""How deep the main stack goes: the free SRAM is painted, and looked at again.

The paint lies between the last variable and the top of the stack. What lies
above the widest stretch that is still painted has been stack; what lies below
it, heap. A real chip's SRAM holds anything at power-on, so no program may mind.

Not measured: threads' own stacks, which are variables, and a program whose stack
holds arrays that are wider than all the room that is left and never written.

Source: the method is that of every RTOS's stack check.
Invariant: the paint of a word depends on its address alone, and is no value that programs have.
"""

from dataclasses import dataclass

from bluepill_sim.board import BluePill
from bluepill_sim.program.elf_file import stack_top, variables_end

_WORD_BYTES = 4


@dataclass(frozen=True, slots=True)
class StackUse:
    """How much of the room between variables and the top of the stack was used, in bytes."""

    top: int
    room_bytes: int
    used_bytes: int

    @property
    def lowest(self) -> int:
        """The lowest address that has been stack."""
        return self.top - self.used_bytes

    def __str__(self) -> str:
        """Return one line for a person."""
        share = self.used_bytes / self.room_bytes if self.room_bytes else 1.0
        return f"stack: {self.used_bytes} of {self.room_bytes} bytes used ({share:.1%}), down to {self.lowest:#010x}"


class StackGauge:
    """Paints the stack's room of a board that stands at its reset."""

    def __init__(self, board: BluePill) -> None:
        self._board = board
        self._top = stack_top(board.image)
        self._bottom = -(-variables_end(board.image) // _WORD_BYTES) * _WORD_BYTES
        words = range(self._bottom, self._top, _WORD_BYTES)
        board.chip.memory.write(self._bottom, b"".join(_paint(address) for address in words))

    def measure(self) -> StackUse:
        """Return what has been used until now."""
        room = max(0, self._top - self._bottom)
        data = self._board.read_memory(self._bottom, room) or b""
        begin = widest_end = self._bottom
        widest = 0
        for address in range(self._bottom, self._top + 1, _WORD_BYTES):
            at = address - self._bottom
            if data[at : at + _WORD_BYTES] != _paint(address):
                if address - begin > widest:
                    widest, widest_end = address - begin, address
                begin = address + _WORD_BYTES
        return StackUse(self._top, room, self._top - widest_end if room else 0)


def _paint(address: int) -> bytes:
    return (address * 0x9E37_79B1 & 0xFFFF_FFFF ^ 0xA5A5_5A5A).to_bytes(_WORD_BYTES, "little")
