"""Characters that have gone out of a serial port, in bulk: words, and when each had arrived.

Invariant: as a sequence its rows are (word, ns at the end of its stop bit), oldest first.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import overload

from simbase.timing import Nanos


@dataclass(frozen=True, slots=True, eq=False)
class Characters(Sequence[tuple[int, Nanos]]):
    """Characters of one speed, as many words as times; `bit_ns` is how long a bit of them takes, in ns.

    Where no word has a ninth bit the words are `bytes`.
    """

    words: Sequence[int]
    times: Sequence[Nanos]
    bit_ns: Nanos

    @property
    def data(self) -> bytes:
        """The low eight bits of each."""
        return self.words if isinstance(self.words, bytes) else bytes([word & 0xFF for word in self.words])

    def __len__(self) -> int:
        return len(self.words)

    @overload
    def __getitem__(self, place: int) -> tuple[int, Nanos]: ...
    @overload
    def __getitem__(self, place: slice) -> "Characters": ...
    def __getitem__(self, place: int | slice) -> "tuple[int, Nanos] | Characters":
        if isinstance(place, slice):
            return Characters(self.words[place], self.times[place], self.bit_ns)
        return self.words[place], self.times[place]

    def __iter__(self) -> Iterator[tuple[int, Nanos]]:
        return zip(self.words, self.times, strict=True)
