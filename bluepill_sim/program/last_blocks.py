"""What a program ran last, as lines for a person: the blocks that every core keeps, with symbol and source line.

Invariant: reading them changes nothing.
"""

from collections.abc import Iterable

from bluepill_sim.core import BLOCK, BlockRow
from bluepill_sim.core.nvic import exception_name
from bluepill_sim.program.image import SymbolTable
from bluepill_sim.program.line_table import LineTable

#: Returns to higher addresses are tail-chains.
_FIRST_EXCEPTION_RETURN = 0xFFFF_FFE0


def title_of(count: int) -> str:
    """Return what stands above so many lines."""
    return f"the last {f'{count} blocks' if count != 1 else 'block'}, by cycle:"


def lines_of(rows: Iterable[BlockRow], symbols: SymbolTable, table: LineTable) -> list[str]:
    """Return rows as a person reads them: cycle, place, source line."""
    found = []
    for cycle, address, kind in rows:
        place = symbols.where(address)
        line = table.place(address)
        if kind == BLOCK:
            what = f"{place}  {line}".rstrip()
        elif kind > 0:
            what = f"-> {exception_name(kind)}, interrupts {place}"
        else:
            what = f"<- back to {place}" if address < _FIRST_EXCEPTION_RETURN else "<- chains to the next exception"
        found.append(f"{cycle:>12}  {what}")
    return found
