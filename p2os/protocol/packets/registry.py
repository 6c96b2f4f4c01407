"""Which type is which packet: the one table, reading by it, and the two packets that are not in it.

The answer to SYNC2 (`Identity`) is read by its type alone; a type that is unknown, or
a packet whose content is not sound, stays a `RawPacket`.

Source: the packet tables of the manuals and ARIA's list of types; Pioneer 3
manual, page 33, for the identity: every client takes a single type-2 frame. A
type whose layout nobody has published (0x7B, 0x7C, 0x95, 0x9A, 0xD3, 0xD5, 0xDA)
has a name here and comes through raw.

Invariant: `packet_frame(read_packet(frame, profile), profile) == frame` for every frame.
"""

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import ClassVar, Protocol

from construct import Construct

from p2os.errors import RemoteProtocolError
from p2os.protocol.command_table import SYNC_NAMES
from p2os.protocol.config_packet import CONFIG_KIND, ConfigPacket
from p2os.protocol.frames import Frame
from p2os.protocol.packets.devices import (
    ArmInfoPacket,
    ArmPacket,
    BatteryPacket,
    GripperPacket,
    JoystickPacket,
    PlaylistPacket,
    ResetNotice,
    SerauxPacket,
)
from p2os.protocol.packets.sensors import CompassPacket, EncoderPacket, GyroPacket, IoPacket
from p2os.protocol.packets.simulator import MapChangedPacket, SiminfoPacket, SimLaserPacket, SimstatPacket
from p2os.protocol.profiles import Profile
from p2os.protocol.sip import SIP_KINDS, StandardSip

IDENTITY_KIND = 0x02
#: An identity is three strings, each with its NUL.
_IDENTITY_STRINGS = 3


@dataclass(frozen=True, slots=True)
class RawPacket:
    """A packet whose content is not read here.

    Args:
        kind: Packet type, 0 to 255.
        data: What follows the type.
    """

    kind: int
    data: bytes = b""

    def to_frame(self) -> Frame:
        """Return the frame that carries it."""
        return Frame(bytes((self.kind,)) + self.data)


@dataclass(frozen=True, slots=True)
class Identity:
    """What a robot identifies itself as, in its answer to SYNC2.

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


#: Packets that look the same in every firmware family.
PlainPacket = (
    ConfigPacket
    | EncoderPacket
    | GyroPacket
    | CompassPacket
    | IoPacket
    | SerauxPacket
    | GripperPacket
    | JoystickPacket
    | PlaylistPacket
    | ArmPacket
    | ArmInfoPacket
    | BatteryPacket
    | ResetNotice
    | SimstatPacket
    | SiminfoPacket
    | SimLaserPacket
    | MapChangedPacket
)
ServerPacket = StandardSip | Identity | PlainPacket | RawPacket


class Declared(Protocol):
    """A packet that one class says: its name, its type, its fields, and how it is read."""

    NAME: ClassVar[str]
    KIND: ClassVar[int]
    LAYOUT: ClassVar[Construct]

    @classmethod
    def from_frame(cls, frame: Frame) -> PlainPacket:
        """Read the packet."""


@dataclass(frozen=True, slots=True)
class PacketKind:
    """A type of packet.

    Args:
        kind: Packet type, 0 to 255.
        name: Its name in the manuals.
        read: How it is read; None: it comes through raw, or stands apart (the SIP, the identity).
        layout: Its fields, each with what it means; None where it is no layout of fixed fields.
        table: What a table of such packets is called; empty where it comes through raw.
    """

    kind: int
    name: str
    read: Callable[[Frame], PlainPacket] | None = None
    layout: Construct | None = None
    table: str = ""


def _of(packet: type[Declared]) -> PacketKind:
    table = re.sub(r"(?<=[a-z])(?=[A-Z])", "_", packet.__name__.removesuffix("Packet")).lower()
    return PacketKind(packet.KIND, packet.NAME, packet.from_frame, packet.LAYOUT, table)


#: Every type that has a name.
PACKET_KINDS = (
    PacketKind(0x00, SYNC_NAMES[0]),
    PacketKind(0x01, SYNC_NAMES[1]),
    PacketKind(IDENTITY_KIND, "IDENTITY", table="identity"),
    PacketKind(CONFIG_KIND, "CONFIGpac", ConfigPacket.from_frame, table="config"),
    *(PacketKind(kind, "SIP", table="sip") for kind in SIP_KINDS),
    PacketKind(SimLaserPacket.KINDS[0], "SIMLASER", SimLaserPacket.from_frame, SimLaserPacket.LAYOUT, "sim_laser"),
    PacketKind(
        SimLaserPacket.KINDS[1],
        "SIMLASER2",
        SimLaserPacket.from_frame,
        SimLaserPacket.EXTENDED_LAYOUT,
        "sim_laser_extended",
    ),
    _of(SimstatPacket),
    _of(SiminfoPacket),
    _of(MapChangedPacket),
    PacketKind(0x7B, "ACCELpac"),
    PacketKind(0x7C, "TORQUEpac"),
    _of(EncoderPacket),
    PacketKind(0x95, "HEADINGpac"),
    _of(GyroPacket),
    PacketKind(0x9A, "IMUpac"),
    _of(ArmPacket),
    _of(ArmInfoPacket),
    *(PacketKind(kind, name, SerauxPacket.from_frame, table="seraux") for kind, name in SerauxPacket.NAMES.items()),
    _of(CompassPacket),
    _of(PlaylistPacket),
    PacketKind(0xD3, "MARCDEBUG"),
    PacketKind(0xD5, "MAXLIMITS"),
    PacketKind(0xDA, "WHEELINFO"),
    _of(GripperPacket),
    _of(IoPacket),
    _of(JoystickPacket),
    _of(BatteryPacket),
    *(PacketKind(kind, "RESET", ResetNotice.from_frame, table="reset") for kind in ResetNotice.KINDS),
)
#: Packet type → how it is read; the SIP and the identity stand apart.
READERS: Mapping[int, Callable[[Frame], PlainPacket]] = {
    row.kind: row.read for row in PACKET_KINDS if row.read is not None
}
#: Packet type → its name in the manuals.
PACKET_NAMES: Mapping[int, str] = {row.kind: row.name for row in PACKET_KINDS}


def packet_name(kind: int) -> str:
    """Return the name of a packet type in the manuals, or its number."""
    return PACKET_NAMES.get(kind, f"packet 0x{kind:02X}")


def read_packet(frame: Frame, profile: Profile) -> ServerPacket:
    """Read a packet of an open session by its type.

    A packet of an unknown type, or whose content is not sound, comes through raw:
    `packet_frame(read_packet(frame, profile), profile) == frame` for every frame.
    """
    try:
        if frame.kind in SIP_KINDS:
            return StandardSip.from_frame(frame, profile)
        if frame.kind == IDENTITY_KIND and frame.data.count(b"\0") == _IDENTITY_STRINGS and frame.data.endswith(b"\0"):
            return Identity.from_frame(frame)
        reader = READERS.get(frame.kind)
        if reader is not None:
            return reader(frame)
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
