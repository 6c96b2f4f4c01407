"""The robot's own end of its serial line: what fits, and how full it is.

A UART sends one character after the other, 8N1: 9600 bit/s carry 96 characters
in 100 ms. This counts when the last character will have left; what is sent
still goes out as whole frames, and whoever carries them spreads the characters.

Without a speed the line takes no time.

Invariant: `free_at` is computed from the start of a busy stretch and the number
of characters in it, never by adding rounded times.
"""

from dataclasses import dataclass, field

from p2os.timing import NS_PER_S, Nanos

#: Start bit, eight data bits, stop bit.
BITS_PER_CHARACTER = 10
#: chosen: the load is told over so many cycles, a second at the usual rate.
LOAD_CYCLES = 10


@dataclass(slots=True)
class TransmitLine:
    """The transmitter of one robot."""

    baud: int | None = None
    busy_since: Nanos = 0
    characters: int = 0
    #: Characters since the last cycle ended, and (characters, ns) of the cycles before.
    this_cycle: int = 0
    cycle_began: Nanos = 0
    cycles: tuple[tuple[int, Nanos], ...] = field(default=())

    @property
    def free_at(self) -> Nanos:
        """When the last character sent so far has left."""
        return self.busy_since + self._time_of(self.characters)

    def _time_of(self, characters: int) -> Nanos:
        return 0 if self.baud is None else -(-characters * BITS_PER_CHARACTER * NS_PER_S // self.baud)

    def put(self, size: int, now: Nanos) -> None:
        """Send so many characters, behind what is still going out."""
        if now >= self.free_at:
            self.busy_since, self.characters = now, 0
        self.characters += size
        self.this_cycle += size

    def fits(self, size: int, now: Nanos, until: Nanos) -> bool:
        """Tell whether so many more characters will have left by `until`."""
        return max(self.free_at, now) + self._time_of(size) <= until

    def set_baud(self, baud: int) -> None:
        """Change the speed (HOSTBAUD); what is still going out goes at the old one."""
        if self.baud is None:
            return
        self.busy_since, self.characters, self.baud = self.free_at, 0, baud

    def end_cycle(self, now: Nanos) -> None:
        """Begin a new cycle of the load."""
        self.cycles = (*self.cycles, (self.this_cycle, now - self.cycle_began))[-LOAD_CYCLES:]
        self.this_cycle, self.cycle_began = 0, now

    def begin_session(self, now: Nanos) -> None:
        """Forget the load of the session before."""
        self.cycles, self.this_cycle, self.cycle_began = (), 0, now

    @property
    def load_percent(self) -> int | None:
        """How much of the line the last cycles took; None without a speed or a cycle."""
        if self.baud is None:
            return None
        span = sum(ns for _, ns in self.cycles)
        return round(100 * self._time_of(sum(size for size, _ in self.cycles)) / span) if span else None
