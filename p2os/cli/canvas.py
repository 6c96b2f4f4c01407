"""A drawing of dots in a terminal: each character is a braille pattern of 2 by 4 dots.

Coordinates are dots from the upper left; what lies outside is left out.
"""

#: Bit of each dot of a braille character, by (column, row) (Unicode standard, block 2800).
_DOTS = ((0x01, 0x02, 0x04, 0x40), (0x08, 0x10, 0x20, 0x80))
_BLANK = 0x2800


class Canvas:
    """Dots, and a style for each character.

    Args:
        columns: Characters across.
        rows: Characters down.
    """

    def __init__(self, columns: int, rows: int) -> None:
        self.columns, self.rows = columns, rows
        self._bits = [[0] * columns for _ in range(rows)]
        self._styles = [[""] * columns for _ in range(rows)]
        self._texts: dict[tuple[int, int], str] = {}

    @property
    def width(self) -> int:
        """Dots across."""
        return self.columns * 2

    @property
    def height(self) -> int:
        """Dots down."""
        return self.rows * 4

    def dot(self, x: float, y: float, style: str = "") -> None:
        """Set a dot; its character takes the style."""
        column, row = round(x) // 2, round(y) // 4
        if 0 <= column < self.columns and 0 <= row < self.rows:
            self._bits[row][column] |= _DOTS[round(x) % 2][round(y) % 4]
            self._styles[row][column] = style or self._styles[row][column]

    def line(self, x0: float, y0: float, x1: float, y1: float, style: str = "") -> None:
        """Set the dots between two points, both included."""
        steps = max(1, round(max(abs(x1 - x0), abs(y1 - y0))))
        for step in range(steps + 1):
            self.dot(x0 + (x1 - x0) * step / steps, y0 + (y1 - y0) * step / steps, style)

    def text(self, x: float, y: float, words: str, style: str = "") -> None:
        """Write words over the dots, beginning at the character that holds a dot."""
        for place, letter in enumerate(words):
            column, row = round(x) // 2 + place, round(y) // 4
            if 0 <= column < self.columns and 0 <= row < self.rows:
                self._texts[column, row] = letter
                self._styles[row][column] = style

    def lines(self) -> list[list[tuple[str, str]]]:
        """Return the rows as runs of (text, style)."""
        return [self._runs(row) for row in range(self.rows)]

    def _runs(self, row: int) -> list[tuple[str, str]]:
        runs: list[tuple[str, str]] = []
        for column in range(self.columns):
            letter = self._texts.get((column, row)) or chr(_BLANK + self._bits[row][column])
            style = self._styles[row][column]
            if runs and runs[-1][1] == style:
                runs[-1] = (runs[-1][0] + letter, style)
            else:
                runs.append((letter, style))
        return runs
