"""Subscriptions: who wants to see edges of pins gets them in bulk, with their times; nobody subscribed, nothing spent.

A subscription names pins and a sink. The sink is called with whole rows of `EDGE`, oldest first, at the latest before
`advance_to` returns; never in the middle of an instruction. An edge of a pin of `ends_slice` ends the chip's slice at
the boundary of the running block.

A pin may show a wave (PWM). A subscription gets its edges like any others, made in bulk; one that asks for `waves`
gets one row where a wave begins, changes or ends instead, and reads the stream with `read_rows`. A wave's time is in
ticks of the clock that makes it, not in ns: 20 kHz of 72 MHz are 3600 ticks, and 3601 are no whole number of ns.

Invariant: every edge of a subscribed pin reaches each sink once, in order of time, and the run is the same with and
without subscribers, but for the slices that they end.
"""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from enum import Enum
from typing import Protocol

from bluepill_sim.extension import layout
from bluepill_sim.extension.layout import packing
from simbase.timing import NS_PER_S, Nanos

#: A row: ns, number of the pin (16 times the port, A = 0, and the pin's number in it), what the chip itself puts on the
#: wire (index in `PinDrive`), what the wire is then (`LOW`, `HIGH`, `FLOATING`), 0 for an edge or `WAVE_ROW`
#: (drive and wire are then those of the low phase, and above them by 4 bits those of the high one), and 0.
EDGE = packing(layout.EDGE)
#: The third of them.
LOW, HIGH, FLOATING = range(3)
WAVE_ROW = 1
#: What follows a row of a wave: the first five fields are those of `Wave`.
_WAVE = packing(layout.WAVE)

#: Takes whole rows of `EDGE`.
EdgeSink = Callable[[bytes], None]


class Of(Enum):
    """Which changes of a pin make a row."""

    #: What the chip itself puts on the wire.
    DRIVE = "drive"
    #: The level on the wire, whoever makes it, and whether it floats.
    WIRE = "wire"


@dataclass(frozen=True, slots=True)
class Wave:
    """A level that goes up every `period` ticks, and down `high` ticks later."""

    #: When tick 0 begins; tick n begins floor(n * 10**9 / ticks_hz) ns later.
    ns: Nanos
    #: Ticks from a rising edge to tick 0.
    at: int
    period: int
    high: int
    ticks_hz: int

    @property
    def frequency_hz(self) -> float:
        """Rising edges a second."""
        return self.ticks_hz / self.period

    @property
    def duty(self) -> float:
        """The share of the time at level 1, between 0 and 1."""
        return self.high / self.period

    def level(self, at_ns: Nanos) -> bool:
        """Return the level at a time, which is at or after `ns`."""
        ticks = ((at_ns - self.ns + 1) * self.ticks_hz - 1) // NS_PER_S
        return (self.at + ticks) % self.period < self.high


#: ns, number of the pin, what the chip puts on the wire and what the wire is (of a wave: in its low phase), the wave.
Row = tuple[Nanos, int, int, int, Wave | None]


def read_wave(rows: bytes, at: int) -> tuple[Wave, int]:
    """Return the wave that follows a `WAVE_ROW` which ends at a place in the rows, and the place behind it."""
    return Wave(*_WAVE.unpack_from(rows, at)[:5]), at + _WAVE.size


def read_rows(rows: bytes) -> Iterator[Row]:
    """Iterate over the rows of a subscription that takes waves."""
    at = 0
    while at < len(rows):
        ns, pin, drive, wire, kind, _ = EDGE.unpack_from(rows, at)
        at += EDGE.size
        if kind == WAVE_ROW:
            wave, at = read_wave(rows, at)
            yield ns, pin, drive & 15, wire & 15, wave
        else:
            yield ns, pin, drive, wire, None


class PinSubscription(Protocol):
    """One subscriber's pins."""

    #: Names of the pins whose edges end the chip's slice; set it whenever the chip does not run.
    ends_slice: frozenset[str]

    def close(self) -> None:
        """Deliver what waits, and get nothing more."""


class PinSubscriptions(Protocol):
    """What can be subscribed to: the pins of a chip, or of a board."""

    def subscribe_pins(
        self, pins: Iterable[str], sink: EdgeSink, *, of: Of = Of.DRIVE, ends_slice: Iterable[str] = (),
        waves: bool = False,
    ) -> PinSubscription:  # fmt: skip
        """Have `sink` called with each change of these pins from now on.

        With `waves` it gets waves as they are (`read_rows`), else their edges.

        Raises:
            KeyError: The chip has no such pin.
        """
