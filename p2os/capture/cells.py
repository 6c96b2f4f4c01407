"""What stands in one cell of a table, and how it stands in CSV."""

from typing import TypeAlias

Cell: TypeAlias = "bool | int | float | str | None"


def cell_text(cell: Cell) -> str:
    """Return a cell as it stands in CSV."""
    return "" if cell is None else quoted(cell) if isinstance(cell, str) else str(cell)


def quoted(text: str) -> str:
    """Return a text as it stands in CSV."""
    if any(character in text for character in ',"\r\n'):
        return '"' + text.replace('"', '""') + '"'
    return text
