"""What a robot sends: one frozen dataclass a kind of packet, read and written by one declaration.

`read_packet(frame, profile)` reads any frame of an open session. A type that is
not declared, or a packet whose content is not sound, comes through as a
`RawPacket`: nothing is ever lost.
"""

from p2os.protocol.config_packet import ConfigPacket
from p2os.protocol.packets.devices import (
    ArmInfoPacket,
    ArmJoint,
    ArmPacket,
    BatteryPacket,
    GripperPacket,
    GripperState,
    JoystickPacket,
    PlaylistPacket,
    ResetNotice,
    SerauxPacket,
    Sound,
)
from p2os.protocol.packets.registry import (
    IDENTITY_KIND,
    PACKET_KINDS,
    PACKET_NAMES,
    READERS,
    Identity,
    PacketKind,
    PlainPacket,
    RawPacket,
    ServerPacket,
    packet_frame,
    packet_name,
    read_packet,
)
from p2os.protocol.packets.sensors import CompassPacket, EncoderPacket, GyroPacket, GyroReading, IoPacket
from p2os.protocol.packets.simulator import MapChangedPacket, SimDevice, SiminfoPacket, SimLaserPacket, SimstatPacket
from p2os.protocol.sip import SonarReading, StandardSip

#: Types of the notice that a controller sends when it has just been reset.
RESET_KINDS = ResetNotice.KINDS

__all__ = [
    "IDENTITY_KIND",
    "PACKET_KINDS",
    "PACKET_NAMES",
    "READERS",
    "RESET_KINDS",
    "ArmInfoPacket",
    "ArmJoint",
    "ArmPacket",
    "BatteryPacket",
    "CompassPacket",
    "ConfigPacket",
    "EncoderPacket",
    "GripperPacket",
    "GripperState",
    "GyroPacket",
    "GyroReading",
    "Identity",
    "IoPacket",
    "JoystickPacket",
    "MapChangedPacket",
    "PacketKind",
    "PlainPacket",
    "PlaylistPacket",
    "RawPacket",
    "ResetNotice",
    "SerauxPacket",
    "ServerPacket",
    "SimDevice",
    "SimLaserPacket",
    "SiminfoPacket",
    "SimstatPacket",
    "SonarReading",
    "Sound",
    "StandardSip",
    "packet_frame",
    "packet_name",
    "read_packet",
]
