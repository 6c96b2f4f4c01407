"""One table: the packets of one kind, a column a field."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from p2os.capture.columns.framing import Indexes
from p2os.capture.columns.walker import Column, Ragged, Spans


@dataclass(slots=True, kw_only=True)
class Table:
    """The packets of one kind.

    Args:
        name: What `decode` keeps it by.
        data: The capture.
        packets: The number of each row's packet in the capture.
        columns: Numbers, by the names that the packet's class gives them.
        texts: Texts and bytes, by their names, as places in the data.
        ragged: What each packet has a varying number of, by name.
    """

    name: str
    data: npt.NDArray[np.uint8]
    packets: Indexes
    columns: dict[str, Column]
    texts: dict[str, Spans] = field(default_factory=dict)
    ragged: dict[str, Ragged] = field(default_factory=dict)

    def __len__(self) -> int:
        return len(self.packets)

    def __getitem__(self, name: str) -> Column:
        """Return a column of numbers.

        Raises:
            KeyError: There is none of this name.
        """
        return self.columns[name]

    def bytes_of(self, name: str) -> list[bytes]:
        """Return a column of texts or bytes.

        Raises:
            KeyError: There is none of this name.
        """
        spans = self.texts[name]
        whole = self.data.data
        return [bytes(whole[start:end]) for start, end in zip(spans.starts.tolist(), spans.ends.tolist(), strict=True)]

    def structured(self) -> npt.NDArray[np.void]:
        """Return the columns of numbers as one structured array, `packet` (the number in the capture) first."""
        names = [("packet", np.dtype("<i8")), *((name, column.dtype) for name, column in self.columns.items())]
        array = np.zeros(len(self), np.dtype(names))
        array["packet"] = self.packets
        for name, column in self.columns.items():
            array[name] = column
        return array

    def row(self, number: int) -> dict[str, Any]:
        """Return a row as plain values: numbers, bytes, and tuples of what varies in number."""
        found = self._values(self.columns, self.texts, number)
        for name, ragged in self.ragged.items():
            first, last = ragged.offsets[number : number + 2].tolist()
            items = [self._values(ragged.columns, ragged.texts, place) for place in range(first, last)]
            # An array of plain numbers has the one column `value`.
            found[name] = tuple(item["value"] if list(item) == ["value"] else item for item in items)
        return found

    def _values(self, columns: Mapping[str, Column], texts: Mapping[str, Spans], number: int) -> dict[str, Any]:
        found: dict[str, Any] = {name: column[number].item() for name, column in columns.items()}
        for name, spans in texts.items():
            found[name] = bytes(self.data[spans.starts[number] : spans.ends[number]].data)
        return found
