"""Packets that a robot sends only when it is asked: what asks for each of them, once.

A robot without the device stays silent; `fetch` then ends with `NoAnswerError`.
"""

from collections.abc import Mapping
from typing import TypeVar

from p2os.commands import Command, CommandNumber
from p2os.errors import UsageError
from p2os.packets import (
    ArmInfoPacket,
    ArmPacket,
    BatteryPacket,
    CompassPacket,
    EncoderPacket,
    GripperPacket,
    GyroPacket,
    IoPacket,
    JoystickPacket,
    PlaylistPacket,
    ServerPacket,
)

#: Any type of packet, for calls that return the type that they were given.
PacketType = TypeVar("PacketType", bound=ServerPacket)

#: Type of packet → the command that makes the robot send one (manuals, client commands).
REQUESTS: Mapping[type, Command] = {
    ArmInfoPacket: Command(CommandNumber.ARM_INFO),
    ArmPacket: Command(CommandNumber.ARM_STATUS, 1),
    BatteryPacket: Command(CommandNumber.BATTERYINFO, 1),
    CompassPacket: Command(CommandNumber.TCM2, 2),
    EncoderPacket: Command(CommandNumber.ENCODER, 1),
    GripperPacket: Command(CommandNumber.GRIPREQUEST, 1),
    GyroPacket: Command(CommandNumber.GYRO, 1),
    IoPacket: Command(CommandNumber.IOREQUEST, 1),
    JoystickPacket: Command(CommandNumber.JOYREQUEST, 1),
    PlaylistPacket: Command(CommandNumber.PLAYLIST),
}


def request_for(kind: type) -> Command:
    """Return the command that asks for a type of packet.

    Raises:
        UsageError: Nothing asks for it.
    """
    if kind not in REQUESTS:
        names = ", ".join(sorted(known.__name__ for known in REQUESTS))
        raise UsageError(f"nothing asks for a {kind.__name__}", hint=f"one of {names}")
    return REQUESTS[kind]
