"""Which type is which packet: the one table, and reading by it.

Source: the packet tables of the manuals and ARIA's list of types. A type whose
layout nobody has published (0x7B, 0x7C, 0x95, 0x9A, 0xD3, 0xD5, 0xDA) has a
name here and comes through raw.
"""

from collections.abc import Callable, Mapping

from p2os.config_packet import CONFIG_KIND, ConfigPacket
from p2os.errors import RemoteProtocolError
from p2os.packets.devices import (
    ArmInfoPacket,
    ArmPacket,
    BatteryPacket,
    GripperPacket,
    JoystickPacket,
    PlaylistPacket,
    ResetNotice,
    SerauxPacket,
)
from p2os.packets.identity import IDENTITY_KIND, Identity
from p2os.packets.raw import RawPacket
from p2os.packets.sensors import CompassPacket, EncoderPacket, GyroPacket, IoPacket
from p2os.packets.simulator import MapChangedPacket, SiminfoPacket, SimLaserPacket, SimstatPacket
from p2os.profiles import Profile
from p2os.sip import SIP_KINDS, StandardSip
from p2os.wire import Frame

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

#: Packet type → the manuals' word.
PACKET_NAMES: Mapping[int, str] = {
    0x00: "SYNC0", 0x01: "SYNC1", IDENTITY_KIND: "IDENTITY", CONFIG_KIND: "CONFIGpac",
    **dict.fromkeys(SIP_KINDS, "SIP"),
    0x60: "SIMLASER", 0x61: "SIMLASER2", 0x62: "SIMSTAT", 0x63: "SIMINFO", 0x66: "SIMMAPCHANGED",
    0x7B: "ACCELpac", 0x7C: "TORQUEpac", 0x90: "ENCODERpac", 0x95: "HEADINGpac", 0x98: "GYROpac", 0x9A: "IMUpac",
    0xA0: "ARMpac", 0xA1: "ARMINFOpac", 0xB0: "SERAUXpac", 0xB8: "SERAUX2pac", 0xC0: "TCM2pac", 0xC8: "SERAUX3pac",
    0xD0: "PLAYLISTpac", 0xD3: "MARCDEBUG", 0xD5: "MAXLIMITS", 0xDA: "WHEELINFO", 0xE0: "GRIPPERpac",
    0xF0: "IOpac", 0xF8: "JOYSTICKpac", 0xFA: "BATTERYpac", 0xFE: "RESET", 0xFF: "RESET",
}  # fmt: skip
#: An identity is three strings, each with its NUL.
_IDENTITY_STRINGS = 3


def packet_name(kind: int) -> str:
    """Return the manuals' word for a packet type, or its number."""
    return PACKET_NAMES.get(kind, f"packet 0x{kind:02X}")


def read_packet(frame: Frame, profile: Profile) -> ServerPacket:
    """Read a packet of an open session by its type.

    A packet of an unknown type, or whose inside is not sound, comes through raw:
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
