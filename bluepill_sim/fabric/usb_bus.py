"""USB at full speed between a host and a device: who may say what, and how long it takes.

A transaction is a token, data in one direction, and a handshake. The host begins it, and the device answers by the
state that it is in then (`begin`); what follows from it happens when its last bit has gone (`end`). The signals that
are no packets are states of the bus.

Not modelled: single bits on D+ and D-, stuff bits, low speed, hubs.
Source: USB 2.0 specification, sections 7.1 and 8.
Invariant: times follow from the bits at 12 Mbit/s alone.
"""

from dataclasses import dataclass
from enum import Enum
from typing import Protocol

from simbase.timing import NS_PER_MS, Nanos

#: Full speed, and a frame.
BITS_PER_US = 12
FRAME_NS: Nanos = NS_PER_MS
FRAME_NUMBERS = 2048
#: SYNC, PID, address, endpoint, CRC5 and EOP; SYNC, PID, CRC16 and EOP around data; SYNC, PID and EOP.
TOKEN_BITS, AROUND_DATA_BITS, HANDSHAKE_BITS = 35, 35, 19
#: From one packet to the next (chosen: 2 to 7.5 bits are allowed); so long a host waits for an answer (16 to 18).
BETWEEN_BITS, TIMEOUT_BITS = 4, 18


class Token(Enum):
    """How a transaction begins."""

    SETUP = "SETUP"
    OUT = "OUT"
    IN = "IN"


class Handshake(Enum):
    """How one ends."""

    ACK = "ACK"
    NAK = "NAK"
    STALL = "STALL"


class BusState(Enum):
    """What is on the bus besides packets."""

    #: J, and no frames: nobody is there, or the host has suspended the device.
    IDLE = "idle"
    #: A frame each millisecond.
    FRAMES = "frames"
    #: Both lines low.
    RESET = "reset"
    #: K.
    RESUME = "resume"


@dataclass(frozen=True, slots=True)
class Transaction:
    """What the host sends."""

    token: Token
    address: int
    endpoint: int
    #: DATA0 or DATA1, and the data; not of IN.
    pid: int = 0
    data: bytes = b""
    #: Whether the device cannot read it.
    is_damaged: bool = False


@dataclass(frozen=True, slots=True)
class UsbResponse:
    """What the device sends: a handshake, or data in answer to IN."""

    #: None: data, which the host acknowledges unless they are isochronous; or nothing in answer to isochronous data.
    handshake: Handshake | None
    pid: int = 0
    data: bytes = b""


class UsbMaster(Protocol):
    """A host, as the device sees it; a device has it in its snapshots."""

    @property
    def next_ns(self) -> Nanos | None:
        """When it acts next; None for never."""

    def advance_to(self, now_ns: Nanos) -> None:
        """Act on what is due."""

    def device_changed(self, now_ns: Nanos) -> None:
        """Take that the device answers otherwise, or that its pull-up has come or gone."""

    def wake(self, now_ns: Nanos) -> None:
        """Take that a suspended device signals a resume."""


def span_ns(bits: int) -> Nanos:
    """Return how long so many bits take."""
    return -(-bits * 1000 // BITS_PER_US)


def transaction_ns(
    data_bytes: int, *, has_data: bool = True, is_answered: bool = True, has_handshake: bool = True
) -> Nanos:
    """Return how long a transaction takes, up to where the next may begin.

    Args:
        data_bytes: how many bytes of data it has.
        has_data: whether there is a packet of data.
        is_answered: whether anybody answers; else the host waits until it gives up.
        has_handshake: whether one ends it.
    """
    bits = TOKEN_BITS + BETWEEN_BITS
    if has_data:
        bits += AROUND_DATA_BITS + 8 * data_bytes + BETWEEN_BITS
    if not is_answered:
        bits += TIMEOUT_BITS
    elif has_handshake:
        bits += HANDSHAKE_BITS + BETWEEN_BITS
    return span_ns(bits)
