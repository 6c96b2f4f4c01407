"""Columns of cells as NumPy arrays, their values in tables of what a conversion has said of each raw value.

A cell of 16 bits or fewer is kept as its raw bits, the code: what it says, and how that stands in CSV, is looked up
for all rows at once, and asked of the conversion once.
"""

from collections.abc import Callable, Iterator, Sequence
from typing import Any, cast, overload

import numpy as np
import numpy.typing as npt

from p2os.capture.cells import Alike, Cell, cell_text, texts_of
from p2os.capture.columns.framing import Flags, Indexes

#: NumPy's letter for a kind of cells → its type, and what stands where one is absent.
_KINDS: dict[str, tuple[type, Cell]] = {"b": (np.bool_, False), "i": (np.int64, 0), "f": (np.float64, 0.0)}


class ArrayConversion:
    """What a field says of each raw value of 16 bits or fewer, as arrays that are indexed by its bits.

    Args:
        convert: The field.
        kind: Of its cells.
    """

    def __init__(self, convert: Callable[[int], Cell], kind: type) -> None:
        self._convert, self._kind = convert, kind
        self._known = np.zeros(0, np.bool_)
        self.values: npt.NDArray[Any] = np.zeros(0)
        self.texts: npt.NDArray[Any] = np.zeros(0)

    def codes(self, raw: npt.NDArray[Any]) -> npt.NDArray[np.uint16]:
        """Return the places of raw values in `values` and `texts`."""
        size = raw.dtype.itemsize
        codes: npt.NDArray[np.uint16] = raw.view(f"u{size}").astype(np.uint16)
        if not len(self._known):
            self._known = np.zeros(1 << 8 * size, np.bool_)
            self.values = np.full(len(self._known), self._kind(), object if self._kind is str else self._kind)
            self.texts = np.full(len(self._known), "", object)
        known = self._known.take(codes)
        if not known.all():
            for code in np.unique(codes[~known]).tolist():
                cell = self._convert(code - (raw.dtype.kind == "i" and code >> (8 * size - 1) and 1 << 8 * size))
                self._known[code], self.values[code], self.texts[code] = True, cell, cell_text(cell)
        return codes

    def column(self, raw: npt.NDArray[Any], present: Flags | None = None) -> "Column":
        """Return a raw column converted."""
        return Column(self.codes(raw), present, self)


class Column(Sequence[Cell]):
    """A column of one kind of cell, as an array; a cell that is absent is None.

    Args:
        codes: The cells themselves, or their places in what a conversion knows.
        present: Which cells there are; None for all.
        conversion: What the places are of.
    """

    def __init__(
        self, codes: npt.NDArray[Any], present: Flags | None = None,
        conversion: ArrayConversion | None = None,
    ) -> None:  # fmt: skip
        self.codes, self.present, self.conversion = codes, present, conversion

    @classmethod
    def joined(cls, first: Sequence[Cell], second: Sequence[Cell]) -> "Column":
        """Return two of one kind one behind the other; what is no `Column` has only None."""
        one = next(column for column in (first, second) if isinstance(column, cls))
        parts = [
            column if isinstance(column, cls)
            else cls(np.zeros(len(column), one.codes.dtype), np.zeros(len(column), np.bool_))
            for column in (first, second)
        ]  # fmt: skip
        present = [np.ones(len(part), np.bool_) if part.present is None else part.present for part in parts]
        return cls(np.concatenate([part.codes for part in parts]), np.concatenate(present), one.conversion)

    @classmethod
    def of(cls, cells: Sequence[Cell], kind: str) -> "Column":
        """Return cells of one kind as a column.

        Args:
            cells: None where one is absent.
            kind: NumPy's letter for their kind; what is of another becomes a text where it is `O`.
        """
        absent = cells.count(None)
        present = np.zeros(len(cells), np.bool_)
        if absent < len(cells):
            present[:] = [cell is not None for cell in cells]
        if kind == "O":
            words = np.full(len(cells), "", object)
            if absent < len(cells):
                words[present] = [cell if isinstance(cell, str) else str(cell) for cell in cells if cell is not None]
            return cls(words, present)
        dtype, zero = _KINDS[kind]
        return cls(np.array([zero if cell is None else cell for cell in cells], dtype), present)

    @property
    def values(self) -> npt.NDArray[Any]:
        """The cells; anything where one is absent."""
        return self.codes if self.conversion is None else self.conversion.values.take(self.codes)

    @property
    def kind(self) -> str:
        """NumPy's letter for the kind of the cells."""
        return str((self.codes if self.conversion is None else self.conversion.values).dtype.kind)

    def has_any(self) -> bool:
        """Tell whether there is a cell."""
        return self.present is None or bool(self.present.any())

    def texts(self) -> Sequence[str] | Alike:
        """Return each cell as it stands in CSV."""
        if self.conversion is None:
            return texts_of(self.tolist())
        texts = self.conversion.texts[self.codes]
        if self.present is not None:
            texts[~self.present] = ""
        return cast("list[str]", texts.tolist())

    def encoded(self) -> tuple[Indexes, bytes]:
        """Return how many bytes each text takes in UTF-8, and all of them joined; an absent one is empty."""
        if self.conversion is None:
            there = np.ones(len(self.codes), np.bool_) if self.present is None else self.present
            words = [text.encode() for text in self.codes[there].tolist()]
            sizes = np.zeros(len(self.codes), np.int64)
            sizes[there] = [len(word) for word in words]
            return sizes, b"".join(words)
        # Few different ones: all are taken out of one table, which has as much room for each as the longest needs.
        kinds = np.flatnonzero(np.bincount(self.codes))
        rows = np.zeros(int(kinds.max(initial=0)) + 1, np.int64)
        rows[kinds] = np.arange(len(kinds))
        words = [text.encode() for text in self.conversion.values[kinds].tolist()]
        chosen = rows[self.codes]
        sizes = np.array([len(word) for word in words], np.int64)[chosen]
        if self.present is not None:
            sizes[~self.present] = 0
        table = np.array(words, np.bytes_)
        width = table.itemsize
        spread = table[chosen].view(np.uint8).reshape(-1, width)
        return sizes, spread[np.arange(width) < sizes[:, np.newaxis]].tobytes()

    def tolist(self) -> list[Cell]:
        """Return the cells."""
        cells: list[Cell] = self.values.tolist()
        if self.present is not None:
            cells = [cell if there else None for cell, there in zip(cells, self.present.tolist(), strict=True)]
        return cells

    def __len__(self) -> int:
        return len(self.codes)

    def __iter__(self) -> Iterator[Cell]:
        return iter(self.tolist())

    @overload
    def __getitem__(self, place: int) -> Cell: ...
    @overload
    def __getitem__(self, place: slice) -> "Column": ...
    def __getitem__(self, place: int | slice) -> "Cell | Column":
        if isinstance(place, slice):
            return Column(self.codes[place], None if self.present is None else self.present[place], self.conversion)
        return self.tolist()[place]
