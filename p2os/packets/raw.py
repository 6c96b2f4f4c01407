"""A packet whose inside is not read: an unknown type, or one that is not sound."""

from dataclasses import dataclass

from p2os.wire import Frame


@dataclass(frozen=True, slots=True)
class RawPacket:
    """A packet whose inside is not read here.

    Args:
        kind: Packet type, 0 to 255.
        data: What follows the type.
    """

    kind: int
    data: bytes = b""

    def to_frame(self) -> Frame:
        """Return the frame that carries it."""
        return Frame(bytes((self.kind,)) + self.data)
