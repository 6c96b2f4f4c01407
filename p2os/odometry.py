"""Unwrap the counters of a SIP: positions of 15 bits, headings of 4096 counts.

Any step smaller than half of the modulus is exact, whatever the gap between
packets; a step of more than half cannot be told from one the other way round.
"""


class Unwrapper:
    """Follow a counter that wraps.

    Args:
        modulus: How many values the counter has; 32768 for positions (12-bit readers take 4096).
    """

    __slots__ = ("_last", "modulus", "total")

    def __init__(self, modulus: int) -> None:
        self.modulus = modulus
        #: Counts since the first value, any size.
        self.total = 0
        self._last: int | None = None

    def update(self, raw: int) -> int:
        """Take a value; return the signed step since the last one, 0 for the first.

        The step lies in -modulus/2 (included) to modulus/2 (excluded).
        """
        value = raw % self.modulus
        if self._last is None:
            self._last = value
            return 0
        half = self.modulus // 2
        step = (value - self._last + half) % self.modulus - half
        self._last = value
        self.total += step
        return step

    def forget(self) -> None:
        """Take the next value as a new beginning; the total stays."""
        self._last = None

    def snapshot(self) -> tuple[int, int | None]:
        """Return all that decides the future."""
        return self.total, self._last

    def restore(self, snapshot: tuple[int, int | None]) -> None:
        """Put back what `snapshot` returned."""
        self.total, self._last = snapshot
