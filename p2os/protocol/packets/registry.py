"""Which type is which packet: the one table, reading by it, and the two packets that are not in it.

The answer to SYNC2 (`Identity`) is read by its type alone; a type that is unknown, or
a packet whose content is not sound, stays a `RawPacket`.

Source: the packet tables of the manuals and ARIA's list of types; Pioneer 3
manual, page 33, for the identity: every client takes a single type-2 frame. A
type whose layout nobody has published (0x7B, 0x7C, 0x95, 0x9A, 0xD3, 0xD5, 0xDA)
has a name here and comes through raw.

Invariant: `packet_frame(read_packet(frame, profile), profile) == frame` for every frame.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from p2os.errors import RemoteProtocolError
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

#: Packet type → how it is read; the SIP and the identity stand apart.
READERS: Mapping[int, Callable[[Frame], PlainPacket]] = {
    CONFIG_KIND: ConfigPacket.from_frame,
    **dict.fromkeys(SimLaserPacket.KINDS, SimLaserPacket.from_frame),
    SimstatPacket.KIND: SimstatPacket.from_frame,
    SiminfoPacket.KIND: SiminfoPacket.from_frame,
    MapChangedPacket.KIND: MapChangedPacket.from_frame,
    EncoderPacket.KIND: EncoderPacket.from_frame,
    GyroPacket.KIND: GyroPacket.from_frame,
    ArmPacket.KIND: ArmPacket.from_frame,
    ArmInfoPacket.KIND: ArmInfoPacket.from_frame,
    **dict.fromkeys(SerauxPacket.KINDS.values(), SerauxPacket.from_frame),
    CompassPacket.KIND: CompassPacket.from_frame,
    PlaylistPacket.KIND: PlaylistPacket.from_frame,
    GripperPacket.KIND: GripperPacket.from_frame,
    IoPacket.KIND: IoPacket.from_frame,
    JoystickPacket.KIND: JoystickPacket.from_frame,
    BatteryPacket.KIND: BatteryPacket.from_frame,
    **dict.fromkeys(ResetNotice.KINDS, ResetNotice.from_frame),
}

#: Packet type → its name in the manuals.
PACKET_NAMES: Mapping[int, str] = {
    0x00: "SYNC0", 0x01: "SYNC1", IDENTITY_KIND: "IDENTITY", CONFIG_KIND: "CONFIGpac",
    **dict.fromkeys(SIP_KINDS, "SIP"),
    0x60: "SIMLASER", 0x61: "SIMLASER2", 0x62: "SIMSTAT", 0x63: "SIMINFO", 0x66: "SIMMAPCHANGED",
    0x7B: "ACCELpac", 0x7C: "TORQUEpac", 0x90: "ENCODERpac", 0x95: "HEADINGpac", 0x98: "GYROpac", 0x9A: "IMUpac",
    0xA0: "ARMpac", 0xA1: "ARMINFOpac", 0xB0: "SERAUXpac", 0xB8: "SERAUX2pac", 0xC0: "TCM2pac", 0xC8: "SERAUX3pac",
    0xD0: "PLAYLISTpac", 0xD3: "MARCDEBUG", 0xD5: "MAXLIMITS", 0xDA: "WHEELINFO", 0xE0: "GRIPPERpac",
    0xF0: "IOpac", 0xF8: "JOYSTICKpac", 0xFA: "BATTERYpac", 0xFE: "RESET", 0xFF: "RESET",
}  # fmt: skip


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
