"""Subscriptions: who wants to see edges of pins gets them in bulk, with their times; nobody subscribed, nothing spent.

A subscription names pins and a sink. The sink is called with whole rows of `EDGE`, oldest first, at the latest before
`advance_to` returns; never in the middle of an instruction. An edge of a pin of `ends_slice` ends the chip's slice at
the boundary of the running block.

Invariant: every edge of a subscribed pin reaches each sink once, in order of time, and the run is the same with and
without subscribers, but for the slices that they end.
"""

import struct
from collections.abc import Callable, Iterable
from enum import Enum
from typing import Protocol

#: A row: ns, number of the pin (16 times the port, A = 0, and the pin's number in it), what the chip itself puts on the
#: wire (index in `PinDrive`), what the wire is then (`LOW`, `HIGH`, `FLOATING`), two bytes to fill up, and 0.
EDGE = struct.Struct("<QBBBBI")
#: The third of them.
LOW, HIGH, FLOATING = range(3)

#: Takes whole rows of `EDGE`.
EdgeSink = Callable[[bytes], None]


class Of(Enum):
    """Which changes of a pin make a row."""

    #: What the chip itself puts on the wire.
    DRIVE = "drive"
    #: The level on the wire, whoever makes it, and whether it floats.
    WIRE = "wire"


class PinSubscription(Protocol):
    """One subscriber's pins."""

    #: Names of the pins whose edges end the chip's slice; set it whenever the chip does not run.
    ends_slice: frozenset[str]

    def close(self) -> None:
        """Deliver what waits, and get nothing more."""
        ...


class PinSubscriptions(Protocol):
    """What can be subscribed to: the pins of a chip, or of a board."""

    def subscribe_pins(
        self, pins: Iterable[str], sink: EdgeSink, *, of: Of = Of.DRIVE, ends_slice: Iterable[str] = ()
    ) -> PinSubscription:
        """Have `sink` called with each change of these pins from now on.

        Raises:
            KeyError: The chip has no such pin.
        """
        ...
