"""What hangs on a bus of the chip, as the bus sees it: parts on SPI and on I2C, nodes on CAN.

A part is a class of the user's with these methods and nothing to derive from; one that derives from
`simbase.state.Stateful` and names its state goes into the board's snapshots. Time is an argument, in ns since power-on:
a part that is busy for a while keeps when it began, and answers by the time that it is given.

Invariant: what a part answers depends on its state and the arguments alone.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol, TypeVar

from simbase.timing import Nanos


class SpiDevice(Protocol):
    """A part on an SPI. Words of 16 bits are two bytes, the upper first.

    A byte is as its bits are on the wire, first bit on top.
    """

    #: The modes that it understands: 2 * CPOL + CPHA.
    spi_modes: frozenset[int]
    #: The fastest clock that it bears, in Hz.
    max_hz: int

    def select(self, at_ns: Nanos) -> None:
        """Take that its select pin has gone low."""

    def deselect(self, at_ns: Nanos) -> None:
        """Take that its select pin has gone high: the command ends."""

    def exchange(self, byte: int, at_ns: Nanos) -> int:
        """Take a byte, and return the one that it sent meanwhile; called when its last bit has ended."""


class AheadDevice(Protocol):
    """What a part on an SPI may have besides, so that long reads are fast: it is not called for each byte then."""

    def ahead(self, count: int) -> tuple[bytes, int | None]:
        """Return what it sends next, up to `count` bytes, and the byte that it must be sent meanwhile; None: any.

        They go over while it alone is selected; another byte, another mode or the deselect ends that.
        """

    def went(self, count: int) -> None:
        """Take that so many of them have gone over: as if `exchange` had been called for each."""


class I2cDevice(Protocol):
    """A part on an I2C: called behind the eight bits of what it is sent, before its acknowledge."""

    def start(self, address: int, is_read: bool, at_ns: Nanos) -> bool:
        """Take a START, or a repeated one, and its address; return whether it acknowledges.

        An address above 0x7F has 10 bits; 0 is the general call.
        """

    def write(self, byte: int, at_ns: Nanos) -> bool:
        """Take a byte; return whether it acknowledges."""

    def read(self, at_ns: Nanos) -> int:
        """Return the next byte, whose first bit begins."""

    def stop(self, at_ns: Nanos) -> None:
        """Take a STOP."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CanFrame:
    """A frame on a CAN.

    Raises:
        ValueError: It cannot be sent.
    """

    #: 11 bits, or 29 of an extended one.
    identifier: int
    data: bytes = b""
    is_extended: bool = False
    #: A request for a frame, without data.
    is_remote: bool = False
    #: How many bytes a remote one asks for; that of others follows from the data.
    remote_bytes: int = 0

    def __post_init__(self) -> None:
        """Refuse what no controller sends."""
        if not 0 <= self.identifier < 1 << (29 if self.is_extended else 11):
            raise ValueError(f"CAN identifier {self.identifier:#x} has more than {29 if self.is_extended else 11} bits")
        if len(self.data) > 8 or (self.is_remote and self.data) or not 0 <= self.remote_bytes <= 8:
            raise ValueError(f"a CAN frame has 0 to 8 bytes, and a remote one none: {len(self.data)} were given")

    @property
    def dlc(self) -> int:
        """The data length code."""
        return self.remote_bytes if self.is_remote else len(self.data)


class WordsFlag(Protocol):
    """The part of a bus's state in C that says whether its words are kept for anybody."""

    wants_words: int


class TellingBus(Protocol):
    """A bus that keeps what is on it, for who has subscribed."""

    @property
    def native(self) -> WordsFlag:
        """Its state in C."""

    def deliver(self) -> None:
        """Hand what was kept to the sinks."""


Sink = TypeVar("Sink")


def subscribe_words(bus: TellingBus, sinks: list[Sink], sink: Sink) -> Callable[[], None]:
    """Add a sink to those of a bus, for what is on it from now on; return a function that takes it away."""

    def keep() -> None:
        bus.native.wants_words = bool(sinks)

    def end() -> None:
        bus.deliver()
        sinks.remove(sink)
        keep()

    bus.deliver()
    sinks.append(sink)
    keep()
    return end
