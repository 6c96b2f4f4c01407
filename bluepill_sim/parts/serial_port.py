"""A USART of the board, seen from outside: what it has sent, and characters for it.

Not the line itself: characters go at the speed that the USART is set to.
Invariant: `unread` holds what was sent and no `expect` or `read` has taken yet, at most twice `KEPT_BYTES`.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import ClassVar, TypeAlias

from bluepill_sim.errors import BluePillError
from bluepill_sim.fabric.characters import Characters
from bluepill_sim.peripherals.usart import CR1, PINS, RE, UE, Usart
from bluepill_sim.spans import Span
from simbase.state import Stateful
from simbase.timing import Nanos

#: chosen: six seconds of a line at 115200; older ones are forgotten.
KEPT_BYTES = 64 * 1024

#: chosen: nothing seen of a firmware for so long means that it computes, spins or hangs.
QUIET_NS: Nanos = 1_000_000_000

#: RM0008 27.3.4: PCLK2 / 16.
HIGHEST_BAUD = 4_500_000


@dataclass(slots=True)
class Activity:
    """When the firmware last did something that shows outside, in ns; 0 before the first time."""

    #: The last change of what the chip puts on any pin.
    last_pin_ns: Nanos = 0
    #: The end of the last character sent on any USART.
    last_usart_ns: Nanos = 0
    #: The last time the core went to sleep.
    last_wfi_ns: Nanos = 0

    def is_quiet(self, now_ns: Nanos) -> bool:
        """Tell whether nothing was seen for so long that the program spins or hangs."""
        return now_ns - max(self.last_pin_ns, self.last_usart_ns, self.last_wfi_ns) >= QUIET_NS


#: Takes rows (word, ns at the end of its stop bit), oldest first.
WordSink = Callable[[Sequence[tuple[int, Nanos]]], None]


#: Runs the board until a pattern is in what has come over a line and nobody has taken, or for so long; a `WaitError`
#: where it does not come.
WaitForBytes: TypeAlias = Callable[["BoardSerialLine", bytes, Span], None]


class BoardSerialLine(Stateful):
    """A serial line of the board, seen from its far end."""

    STATE: ClassVar[tuple[str, ...]] = ("unread",)

    def __init__(self, name: str, wait: WaitForBytes) -> None:
        self.name, self._wait = name, wait
        #: What was sent and not yet taken.
        self.unread = bytearray()

    def read(self) -> bytes:
        """Return what was sent and not yet taken, and take it."""
        data = bytes(self.unread)
        self.unread.clear()
        return data

    def expect(self, pattern: bytes, *, within: Span = "1 s") -> bytes:
        """Run the board until the firmware has sent `pattern`; return what it sent, up to and with it.

        What was already sent and not taken counts, so that nothing is missed between two calls.

        Args:
            pattern: what to wait for, at least one byte.
            within: the longest wait, in virtual time.

        Raises:
            WaitError: it did not come in time, or the core is locked up.
        """
        if not pattern:
            raise BluePillError("an empty pattern is always there", hint="expect at least one byte")
        if pattern not in self.unread:
            self._wait(self, pattern, within)
        end = self.unread.index(pattern) + len(pattern)
        taken = bytes(self.unread[:end])
        del self.unread[:end]
        return taken

    def subscribe(self, sink: WordSink, *, ends_slice: bool = False) -> Callable[[], None]:
        """Have `sink` called with what comes from now on, in bulk; return a function that ends it.

        Args:
            sink: called with rows (word, ns at its end), oldest first.
            ends_slice: whether each character or packet ends the chip's slice.
        """
        raise NotImplementedError

    def _keep(self, data: bytes) -> None:
        self.unread += data
        if len(self.unread) > 2 * KEPT_BYTES:
            del self.unread[:-KEPT_BYTES]


class SerialPort(BoardSerialLine):
    """A USART of the board, seen from outside."""

    #: Who listens.
    DERIVED = ("_sinks", "_waiting")

    def __init__(self, usart: Usart, activity: Activity, wait: WaitForBytes) -> None:
        super().__init__(usart.name, wait)
        self._usart = usart
        self._activity = activity
        self._sinks: list[WordSink] = []
        self._waiting = 0
        usart.sinks.append(self._take)

    def receive(self, data: bytes) -> None:
        """Send characters to the RX pin, at the speed of the line."""
        self._usart.receive(data)

    def subscribe(self, sink: WordSink, *, ends_slice: bool = False) -> Callable[[], None]:
        """Have `sink` called with the characters that go out from now on, in bulk, before `advance_to` returns."""
        usart = self._usart
        usart.deliver()
        self._sinks.append(sink)
        self._waiting += ends_slice
        usart.fabric.stop_at_words(usart.slot, self._waiting > 0)

        def close() -> None:
            usart.deliver()
            self._sinks.remove(sink)
            self._waiting -= ends_slice
            usart.fabric.stop_at_words(usart.slot, self._waiting > 0)

        return close

    def receives_at(self, pin: str) -> bool:
        """Tell whether the receiver is on and takes its characters from a pin: those of `receive`, or its level."""
        usart = self._usart
        is_on = usart.words[CR1] & (UE | RE) == UE | RE
        pins = PINS[usart.name].get(usart.chip.pins.remaps.get(usart.name, 0))
        return is_on and pins is not None and pins[1] == pin

    @property
    def far_baud(self) -> int | None:
        """The far end's speed in bit/s; None, the default, follows whatever the firmware sets."""
        return self._usart.far_baud

    @far_baud.setter
    def far_baud(self, baud: int | None) -> None:
        if baud is not None and not 1 <= baud <= HIGHEST_BAUD:
            raise BluePillError(f"a line of {baud} bit/s cannot be", hint=f"1 to {HIGHEST_BAUD}, such as 115200")
        self._usart.far_baud = baud

    @property
    def measured_baud(self) -> int | None:
        """The speed at which most characters were sent, in bit/s; None before the first."""
        most = self._usart.sent_at.most_common(1)
        return round(most[0][0][0] / most[0][0][1]) if most else None

    @property
    def speeds(self) -> dict[int, int]:
        """How many characters were sent at each speed in bit/s."""
        found: dict[int, int] = {}
        for (clock_hz, brr), count in self._usart.sent_at.items():
            baud = round(clock_hz / brr)
            found[baud] = found.get(baud, 0) + count
        return found

    def _take(self, sent: Characters) -> None:
        self._activity.last_usart_ns = sent.times[-1] if sent else self._activity.last_usart_ns
        self._keep(sent.data)
        for sink in self._sinks:
            sink(sent)
