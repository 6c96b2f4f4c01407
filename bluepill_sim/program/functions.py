"""Which function an address is in.

Invariant: a function reaches to its size, or to the next symbol where the file does not say one.
"""

from bisect import bisect_right

from bluepill_sim.program.image import Image, Symbol
from bluepill_sim.stm32f103 import may_hold_code

#: chosen: so far the last symbol reaches, where the file does not say.
_LAST_REACH_BYTES = 0x1000
#: The name of code that no symbol covers.
UNKNOWN = "(unknown)"


class FunctionTable:
    """The functions of an image, by address."""

    def __init__(self, image: Image) -> None:
        code = [s for s in image.symbols.symbols if may_hold_code(s.address, image.linked_at)]
        self.functions: list[Symbol] = [s for s in code if s.is_function]
        self._symbols = code
        self._addresses = [symbol.address for symbol in code]

    def at(self, address: int) -> Symbol | None:
        """Return the function that an address is in."""
        index = bisect_right(self._addresses, address) - 1
        if index < 0:
            return None
        symbol = self._symbols[index]
        return symbol if address < self._end(index) else None

    def name(self, address: int) -> str:
        """Return the name of the function that an address is in."""
        symbol = self.at(address)
        return UNKNOWN if symbol is None else symbol.name

    def start_of(self, address: int) -> int:
        """Return where the function that an address is in begins; the address itself where none is known."""
        symbol = self.at(address)
        return address if symbol is None else symbol.address

    def end_of(self, address: int) -> int:
        """Return the address after the function that an address is in; 0 where none is known."""
        index = bisect_right(self._addresses, address) - 1
        return self._end(index) if index >= 0 and address < self._end(index) else 0

    def _end(self, index: int) -> int:
        symbol = self._symbols[index]
        if symbol.size:
            return symbol.address + symbol.size
        return self._addresses[index + 1] if index + 1 < len(self._addresses) else symbol.address + _LAST_REACH_BYTES
