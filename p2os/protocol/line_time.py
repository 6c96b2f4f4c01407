"""The time that characters take on a serial line, 8N1: one after the other, none before the last has gone.

Not the bytes themselves, nor who waits for them. `LineTime` is a value: sending gives another one, so
that a snapshot holds it as it is.

Invariant: `free_at` is computed from the start of a busy stretch and the number of characters in it,
never by adding rounded times.
"""

from dataclasses import dataclass, field

from simbase.timing import NS_PER_S, Nanos

#: Start bit, eight data bits, stop bit: 8N1.
BITS_PER_CHARACTER = 10


@dataclass(frozen=True, slots=True)
class LineTime:
    """How long one direction of a line is busy."""

    #: bit/s; None: a line that takes no time.
    baud: int | None
    busy_since: Nanos = 0
    #: Sent since the line became busy.
    characters: int = 0

    #: When the last character sent so far has gone, rounded up; it is asked for more often than anything is sent.
    free_at: Nanos = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        """Work out what follows from the others."""
        object.__setattr__(self, "free_at", self.busy_since + self.time_of(self.characters))

    def sent(self, size: int, now: Nanos) -> "LineTime":
        """Return the line after so many more characters, behind what is still going out."""
        if now >= self.free_at:
            return LineTime(self.baud, now, size)
        return LineTime(self.baud, self.busy_since, self.characters + size)

    def at_baud(self, baud: int) -> "LineTime":
        """Return the line at another speed; what is still going out goes at the old one."""
        return LineTime(baud, self.free_at)

    def time_of(self, characters: int) -> Nanos:
        """Return how long so many characters take, rounded up."""
        return 0 if self.baud is None else -(-characters * BITS_PER_CHARACTER * NS_PER_S // self.baud)
