"""What a host keeps of an endpoint, and of a control transfer.

Source: USB 2.0 specification, sections 5.5 to 5.8, 8.5 and 9.3.
Invariant: `toggle` is the PID of the next packet of data.
"""

from collections import deque
from dataclasses import dataclass, field
from enum import Enum

from bluepill_sim.parts.usb.descriptors import EndpointKind
from simbase.timing import Nanos

#: bmRequestType: the data stage is IN.
TO_HOST = 0x80


@dataclass(frozen=True, slots=True)
class UsbPacket:
    """Data that an endpoint has sent."""

    #: When its last bit had gone.
    at_ns: Nanos
    data: bytes


@dataclass(slots=True)
class Pipe:
    """The host's end of an endpoint."""

    address: int
    kind: EndpointKind
    packet_bytes: int
    interval_frames: int = 1
    toggle: int = 0
    #: Whether data are asked for (IN).
    is_listening: bool = False
    #: Packets to send.
    to_send: deque[bytes] = field(default_factory=deque)
    #: When it said NAK last, and has said nothing else since.
    nak_ns: Nanos | None = None
    #: From then on it is asked again.
    not_before_ns: Nanos = 0
    #: The first frame, from the start of frames, in which a periodic one is polled again.
    next_frame: int = 0
    #: Transactions in a row that nobody answered.
    errors: int = 0
    #: Why there are no more transactions: a STALL, or silence.
    halted: str = ""

    @property
    def is_in(self) -> bool:
        """Whether the device sends."""
        return bool(self.address & 0x80)

    @property
    def is_periodic(self) -> bool:
        """Whether it has its frames."""
        return self.kind in {EndpointKind.INTERRUPT, EndpointKind.ISOCHRONOUS}

    @property
    def wants(self) -> bool:
        """Whether the host has a transaction for it."""
        return not self.halted and (self.is_listening if self.is_in else bool(self.to_send))


@dataclass(frozen=True, slots=True)
class Request:
    """A control transfer."""

    kind: int
    request: int
    value: int = 0
    index: int = 0
    #: Bytes to send, or how many are asked for.
    data: bytes = b""
    length: int = 0
    #: What the host does with the answer: a name of its table, or "" of one by hand.
    purpose: str = ""
    #: That of one by hand.
    number: int = 0

    @property
    def is_in(self) -> bool:
        """Whether the data stage is IN."""
        return bool(self.kind & TO_HOST) and self.length > 0

    def to_bytes(self) -> bytes:
        """Return the data of SETUP."""
        words = (self.value, self.index, self.length if self.is_in else len(self.data))
        return bytes((self.kind, self.request)) + b"".join(word.to_bytes(2, "little") for word in words)


class TransferStage(Enum):
    """Stages of a control transfer."""

    SETUP = "setup"
    DATA = "data"
    STATUS = "status"
