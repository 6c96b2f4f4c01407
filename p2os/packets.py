"""What a robot sends beside its SIP: identity, CONFIGpac, and the rest as raw bytes.

Source: SYNC2 and CONFIGpac tables of the Pioneer 2/3 H8 and Pioneer 3 manuals.
A type that is not declared here comes through as a `RawPacket`, never lost.
"""

from dataclasses import dataclass

from p2os.config_packet import CONFIG_KIND, ConfigPacket
from p2os.errors import RemoteProtocolError
from p2os.profiles import Profile
from p2os.sip import SIP_KINDS, StandardSip
from p2os.wire import Frame

IDENTITY_KIND = 0x02
#: Sent by a controller that has just been reset.
RESET_KINDS = (0xFE, 0xFF)


@dataclass(frozen=True, slots=True)
class Identity:
    """Who a robot says it is, in its answer to SYNC2.

    Args:
        name: From FLASH, may be empty; clients keep 19 characters.
        robot_class: Normally "Pioneer".
        subclass: The model, such as "p2dx"; matched without regard to case.
    """

    name: str
    robot_class: str
    subclass: str

    def to_frame(self) -> Frame:
        """Return the single type-2 frame that answers SYNC2."""
        strings = (self.name, self.robot_class, self.subclass)
        return Frame(bytes((IDENTITY_KIND,)) + b"".join(text.encode("latin-1", "replace") + b"\0" for text in strings))

    @classmethod
    def from_frame(cls, frame: Frame) -> "Identity":
        """Read the strings; those that are missing are empty."""
        strings = [text.decode("latin-1") for text in frame.data.split(b"\0")]
        name, robot_class, subclass = [*strings, "", "", ""][:3]
        return cls(name, robot_class, subclass)


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


ServerPacket = StandardSip | ConfigPacket | Identity | RawPacket


def read_packet(frame: Frame, profile: Profile) -> ServerPacket:
    """Read a packet of an open session by its type.

    A packet whose type is known and whose inside is not sound comes through raw.
    """
    try:
        if frame.kind in SIP_KINDS:
            return StandardSip.from_frame(frame, profile)
        if frame.kind == CONFIG_KIND:
            return ConfigPacket.from_frame(frame)
    except RemoteProtocolError:
        pass
    return RawPacket(frame.kind, frame.data)


def packet_frame(packet: ServerPacket, profile: Profile) -> Frame:
    """Return the frame of a packet in a firmware family's layout.

    Raises:
        LocalProtocolError: A value does not fit its field.
    """
    if isinstance(packet, StandardSip):
        return packet.to_frame(profile)
    return packet.to_frame()
