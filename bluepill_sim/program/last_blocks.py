"""What a program ran last, as lines for a person: the blocks that every core keeps, with symbol and source line.

A loop is one line: how often, how many blocks, and where it begins.

Invariant: reading them changes nothing.
"""

from collections.abc import Iterable, Sequence

from bluepill_sim.core import BLOCK, BlockRow
from bluepill_sim.core.nvic import exception_name
from bluepill_sim.program.image import SymbolTable
from bluepill_sim.program.line_table import LineTable

#: Returns to higher addresses are tail-chains.
_FIRST_EXCEPTION_RETURN = 0xFFFF_FFE0
CYCLE_WIDTH = 12


#: What stands above such lines.
TITLE = "what ran last, by cycle:"


def shortened(rows: Sequence[BlockRow], symbols: SymbolTable, table: LineTable) -> list[str]:
    """Return rows as a person reads them, each loop as one line with a count."""
    found, place, steps = [], 0, [row[1:] for row in rows]
    while place < len(rows):
        period, turns = _loop_at(steps, place)
        (line,) = lines_of([rows[place]], symbols, table)
        if turns > 1:
            cycle, what = line[:CYCLE_WIDTH], line[CYCLE_WIDTH:].strip()
            line = f"{cycle}  {turns} x {f'{period} blocks from ' if period > 1 else ''}{what}"
        found.append(line)
        place += period * turns
    return found


def _loop_at(steps: Sequence[tuple[int, int]], place: int) -> tuple[int, int]:
    """Return (blocks a turn, turns) of the loop that covers most from here on, the shortest of those; (1, 1): none."""
    best = (1, 1)
    for period in range(1, (len(steps) - place) // 2 + 1):
        turn, turns = steps[place : place + period], 1
        while steps[place + period * turns : place + period * (turns + 1)] == turn:
            turns += 1
        if turns > 1 and period * turns > best[0] * best[1]:
            best = period, turns
    return best


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
        found.append(f"{cycle:>{CYCLE_WIDTH}}  {what}")
    return found
