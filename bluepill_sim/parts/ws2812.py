"""A string of WS2812B: each LED takes the first 24 bits that it hears and passes the rest on.

Theory of operation. A bit is a pulse: short is 0, long is 1. A low for as long as the reset ends a frame: what was
shifted in is shown. Pulses come from a pin (PWM by DMA, bits by a program), or as the bits of an SPI's bytes.

Modelled: 24 bits a LED, green first, the upper bit first; the reset; LEDs that get fewer keep their colour; what goes
beyond the last one. *Chosen*: a pulse is a 1 from 600 ns on, as chips of the kind take it, also where it is outside
the data sheet's limits: those are counted in `out_of_limits`, with the worst. Between bytes of an SPI the line keeps
its last level.
Not modelled: the delay and the reshaping from LED to LED, currents.
Source: WS2812B data sheet (Worldsemi), "Data transfer time": 0.4 and 0.8 µs high, 0.85 and 0.45 µs low, each ±0.15
µs; reset above 50 µs.
Invariant: what is shown follows from the edges alone.

"""

from collections.abc import Sequence
from typing import ClassVar

from bluepill_sim.parts.attached import Change, Socket, Use
from bluepill_sim.parts.picture import Colour, Picture
from simbase.state import Stateful
from simbase.timing import NS_PER_S, Nanos

#: High and low of a 0 and of a 1: the least and the most, ns.
HIGH_LIMITS_NS = ((250, 550), (650, 950))
LOW_LIMITS_NS = ((700, 1000), (300, 600))
#: chosen: from here on a pulse is a 1.
ONE_NS: Nanos = 600
#: chosen: a shorter pulse is none.
HEARD_NS: Nanos = 50
BITS = 24
MOST_LEDS = 1024
_DOTS, _GAP = 6, (0, 0, 0)


class Ws2812(Stateful):
    """A string of LEDs on a pin, `din`, or on an SPI's MOSI."""

    PINS: ClassVar = {"din": Use.HEARD}
    STATE = ("shown", "frames", "out_of_limits", "worst", "_shifted", "_word", "_count", "_rise_ns", "_fall_ns", "_bit")
    DERIVED = ("_socket",)

    spi_modes = frozenset(range(4))
    max_hz = 36_000_000

    def __init__(self, *, leds: int = 8, reset_us: float = 50.0) -> None:
        """Make a dark string.

        Args:
            leds: How many, 1 to 1024.
            reset_us: How long a low shows what was sent; 280 for newer ones.

        Raises:
            ValueError: There is no such string.
        """
        if not 1 <= leds <= MOST_LEDS or not reset_us >= 1:
            raise ValueError(f"a string of {leds} with a reset of {reset_us} us: 1 to {MOST_LEDS}, and 1 us or more")
        self._reset_ns = round(reset_us * 1000)
        #: The colour of each LED: red, green, blue.
        self.shown: list[Colour] = [(0, 0, 0)] * leds
        #: How often something was shown.
        self.frames = 0
        #: Pulses and pauses beyond the data sheet's limits, and the one that was farthest beyond, in words.
        self.out_of_limits = 0
        self.worst: tuple[Nanos, str] = (0, "")
        #: What was shifted in since the last reset, as 24 bits a LED, and the bits of the next one.
        self._shifted: list[int] = []
        self._word = self._count = 0
        self._rise_ns: Nanos | None = None
        #: When the last pulse has ended; None: nothing since the last reset.
        self._fall_ns: Nanos | None = None
        self._bit = 0
        self._socket: Socket | None = None

    def plug(self, socket: Socket) -> None:
        """Listen to the pin, unless it hangs on an SPI."""
        self._socket = socket

    def changed(self, rows: Sequence[Change]) -> None:
        """Take the line's edges."""
        for ns, _pin, level in rows:
            self._edge(ns, level)

    def select(self, at_ns: Nanos) -> None:
        """Nothing selects it."""

    def deselect(self, at_ns: Nanos) -> None:
        """Nothing selects it."""

    def exchange(self, byte: int, at_ns: Nanos) -> int:
        """Take the bits of a byte as levels of the line."""
        hz = self._socket.spi.bit_hz if self._socket is not None and self._socket.spi is not None else 0
        for n in range(8):
            self._edge(at_ns - (8 - n) * NS_PER_S // hz, bool(byte >> 7 - n & 1))
        return 0xFF

    def next_deadline(self) -> Nanos | None:
        """Return when the reset will have been long enough, as far as is known."""
        return None if self._fall_ns is None or self._rise_ns is not None else self._fall_ns + self._reset_ns

    def advance_to(self, now_ns: Nanos) -> None:
        """Show what was shifted in."""
        self._show(now_ns)

    def words(self) -> str:
        """Return what it shows."""
        lit = " ".join(f"#{red:02x}{green:02x}{blue:02x}" for red, green, blue in self.shown[:4])
        more = " ..." if len(self.shown) > 4 else ""
        bad = f", {self.out_of_limits} times beyond its limits ({self.worst[1]})" if self.out_of_limits else ""
        return f"{lit}{more} after {self.frames} frames{bad}"

    def picture(self) -> Picture:
        """Return a row of squares."""
        row: list[Colour] = []
        for colour in self.shown:
            row += [colour] * _DOTS + [_GAP]
        return Picture((tuple(row[:-1]),) * _DOTS)

    def _edge(self, ns: Nanos, level: bool) -> None:
        if level is (self._rise_ns is not None):
            return
        if level:
            if self._fall_ns is not None:
                pause_ns = ns - self._fall_ns
                if pause_ns >= self._reset_ns:
                    self._show(self._fall_ns + self._reset_ns)
                else:
                    self._judge(f"low of a {self._bit}", pause_ns, LOW_LIMITS_NS[self._bit])
            self._rise_ns = ns
        elif self._rise_ns is not None:
            width_ns, self._rise_ns = ns - self._rise_ns, None
            if width_ns < HEARD_NS:
                return
            self._bit = int(width_ns >= ONE_NS)
            self._judge(f"high of a {self._bit}", width_ns, HIGH_LIMITS_NS[self._bit])
            self._fall_ns = ns
            self._word, self._count = self._word << 1 | self._bit, self._count + 1
            if self._count == BITS:
                if len(self._shifted) < len(self.shown):
                    self._shifted.append(self._word)
                self._word = self._count = 0

    def _judge(self, what: str, span_ns: Nanos, limits: tuple[int, int]) -> None:
        beyond_ns = max(limits[0] - span_ns, span_ns - limits[1])
        if beyond_ns > 0:
            self.out_of_limits += 1
            if beyond_ns > self.worst[0]:
                self.worst = (beyond_ns, f"{what} of {span_ns} ns, not {limits[0]} to {limits[1]}")

    def _show(self, at_ns: Nanos) -> None:
        for place, word in enumerate(self._shifted):
            self.shown[place] = (word >> 8 & 0xFF, word >> 16, word & 0xFF)
        if self._socket is not None and self._shifted:
            first = "#{:02x}{:02x}{:02x}".format(*self.shown[0])
            self._socket.note(at_ns, "shown", f"{len(self._shifted)} LEDs, the first {first}")
        self.frames += bool(self._shifted)
        self._shifted.clear()
        self._word = self._count = 0
        self._fall_ns = None
