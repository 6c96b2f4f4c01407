"""What stands in one cell of a table, and how it stands in CSV."""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeAlias

Cell: TypeAlias = "bool | int | float | str | None"
#: What a text holds that has to be quoted in CSV.
_ODD = re.compile('[,"\r\n]').search


@dataclass(frozen=True, slots=True)
class Alike:
    """What stands in CSV of a column whose cells are all alike."""

    text: str


def cell_text(cell: Cell) -> str:
    """Return a cell as it stands in CSV."""
    return "" if cell is None else quoted(cell) if isinstance(cell, str) else str(cell)


def texts_of(cells: Sequence[Cell]) -> Sequence[str] | Alike:
    """Return the cells of a column as they stand in CSV."""
    kinds = set(map(type, cells))
    if kinds == {type(None)}:
        return Alike(cell_text(None))
    if len(kinds) == 1 and kinds <= {bool, int, float}:
        return list(map(repr, cells))
    if kinds == {str}:
        known = {cell: cell_text(cell) for cell in set(cells)}
        return [known[cell] for cell in cells]
    return [cell_text(cell) for cell in cells]


def quoted(text: str) -> str:
    """Return a text as it stands in CSV."""
    return '"' + text.replace('"', '""') + '"' if _ODD(text) else text
