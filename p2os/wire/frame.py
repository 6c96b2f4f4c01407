"""A P2OS frame: header, count, payload, checksum.

Source: Pioneer 3 manual, page 32; P2OS manual, page 36.
Invariant: a `Frame` that exists can be sent; `from_bytes` and `to_bytes` are inverses.
"""

from dataclasses import dataclass

from p2os.errors import LocalProtocolError
from p2os.wire.checksum import checksum

HEADER = b"\xfa\xfb"
#: Header and count.
PREFIX_BYTES = 3
CHECKSUM_BYTES = 2
#: The count covers the payload and the checksum. Smallest: one command byte.
MIN_COUNT = 3
#: Largest count that an ARCOS robot accepts (Pioneer 3 manual, page 32).
MAX_COUNT = 204
MAX_PAYLOAD_BYTES = MAX_COUNT - CHECKSUM_BYTES


@dataclass(frozen=True, slots=True)
class Frame:
    """One frame, without header, count and checksum.

    Args:
        payload: Command or type byte and arguments, 1 to 202 bytes.

    Raises:
        LocalProtocolError: The payload is empty or too long to be framed.
    """

    payload: bytes

    def __post_init__(self) -> None:
        if not 1 <= len(self.payload) <= MAX_PAYLOAD_BYTES:
            raise LocalProtocolError(
                f"a payload of {len(self.payload)} bytes cannot be framed (1 to {MAX_PAYLOAD_BYTES})",
                hint="split the data over several packets",
            )

    @property
    def kind(self) -> int:
        """The command number (client) or packet type (robot)."""
        return self.payload[0]

    @property
    def data(self) -> bytes:
        """What follows the command number or packet type."""
        return self.payload[1:]

    def to_bytes(self) -> bytes:
        """Return the frame as it goes over the wire."""
        count = len(self.payload) + CHECKSUM_BYTES
        return HEADER + bytes((count,)) + self.payload + checksum(self.payload).to_bytes(CHECKSUM_BYTES, "big")

    @classmethod
    def from_bytes(cls, data: bytes) -> "Frame":
        """Read exactly one frame.

        Raises:
            LocalProtocolError: `data` is not one whole and sound frame.
        """
        if data[:2] != HEADER or len(data) < PREFIX_BYTES + MIN_COUNT or len(data) != data[2] + PREFIX_BYTES:
            raise LocalProtocolError(f"not one whole frame: {data.hex(' ')}")
        payload, stated = data[PREFIX_BYTES:-CHECKSUM_BYTES], int.from_bytes(data[-CHECKSUM_BYTES:], "big")
        if stated != checksum(payload):
            raise LocalProtocolError(f"checksum: expected 0x{checksum(payload):04X}, got 0x{stated:04X}")
        return cls(payload)
