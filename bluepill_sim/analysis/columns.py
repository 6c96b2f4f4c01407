"""Plain columns of text: no frames, no wrapping, the same on a terminal and in a file."""

from collections.abc import Iterable, Sequence


def in_columns(headers: Sequence[str], rows: Iterable[Sequence[str]], *, right: Sequence[int] = ()) -> list[str]:
    """Return lines with rows below their headers.

    Args:
        headers: one text a column.
        rows: as many texts each.
        right: numbers of the columns that are set to the right.
    """
    lines = [list(headers), *([str(cell) for cell in row] for row in rows)]
    widths = [max(len(line[n]) for line in lines) for n in range(len(headers))]
    return [
        "  ".join(
            cell.rjust(width) if n in right else cell.ljust(width)
            for n, (cell, width) in enumerate(zip(line, widths, strict=True))
        ).rstrip()
        for line in lines
    ]
