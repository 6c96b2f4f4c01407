"""What stands in a frame, as a name and plain values in SI units.

Values are what JSON can hold: numbers, text, booleans, None, lists and objects
of those. Names of fields end in their unit where they have one.
"""

import math
from dataclasses import fields, is_dataclass
from enum import Enum
from typing import TypeAlias

from p2os.protocol.commands import Command
from p2os.protocol.config_packet import FIELDS, ConfigPacket
from p2os.protocol.frames import Frame
from p2os.protocol.packets import READERS, Identity, RawPacket, packet_name, read_packet
from p2os.protocol.profiles import Profile
from p2os.protocol.sip import POSITION_MASK, SIP_KINDS, TAIL, StandardSip
from p2os.protocol.units import in_units
from p2os.robots.parameters import RobotParameters

Plain: TypeAlias = "bool | int | float | str | list[Plain] | dict[str, Plain] | None"

#: A micrometre or a microradian: what is finer is an artefact of floating point.
_DECIMALS = 6


def describe_command(frame: Frame) -> tuple[str, dict[str, Plain]]:
    """Return a command's name and argument."""
    command = Command.from_frame(frame)
    argument = command.argument
    if argument is None:
        return command.name, {}
    if isinstance(argument, bytes):
        return command.name, {"argument": argument.hex(" "), "text": printable(argument)}
    found: dict[str, Plain] = {"argument": argument}
    row = command.row
    if row is not None and row.unit:
        found["unit"] = row.unit
    if row is not None and row.two_bytes is not None:
        low, high = command.signed_bytes if row.two_bytes.is_signed else command.two_bytes
        found |= {row.two_bytes.low: low, row.two_bytes.high: high}
    return command.name, found


def describe_packet(frame: Frame, profile: Profile, parameters: RobotParameters) -> tuple[str, dict[str, Plain]]:
    """Return a packet's name and fields; what cannot be read stands in `data` as hex."""
    name = packet_name(frame.kind)
    packet = read_packet(frame, profile)
    if isinstance(packet, Identity):
        return name, {"name": packet.name, "class": packet.robot_class, "subclass": packet.subclass}
    if isinstance(packet, StandardSip):
        return name, sip_fields(packet, profile, parameters)
    if isinstance(packet, ConfigPacket):
        return name, {field: plain(getattr(packet, field)) for field, _ in FIELDS[: packet.fields_sent]}
    if isinstance(packet, RawPacket):
        if frame.kind in SIP_KINDS or frame.kind in READERS:
            return name, {"problem": "its inside does not follow its layout", "data": packet.data.hex(" ")}
        return name, {"data": packet.data.hex(" ")} if packet.data else {}
    return name, {
        field.name: plain(getattr(packet, field.name))
        for field in fields(packet)
        if field.name not in {"kind", "rest"} or getattr(packet, field.name)
    }


def sip_fields(sip: StandardSip, profile: Profile, parameters: RobotParameters) -> dict[str, Plain]:
    """Return a SIP in SI units: positions either side of 0, the profile's reading of word 16."""
    sensed = in_units(sip, parameters)
    mm = parameters.distance_conv_mm
    found: dict[str, Plain] = {
        "moving": sensed.is_moving,
        "x_m": _round(_signed(sip.raw_x) * mm / 1000),
        "y_m": _round(_signed(sip.raw_y) * mm / 1000),
        "heading_rad": _round(sensed.heading_rad),
        "left_mps": _round(sensed.left_mps),
        "right_mps": _round(sensed.right_mps),
        "battery_v": sensed.battery_v,
        "stall_left": sip.stall_left,
        "stall_right": sip.stall_right,
        "front_bumpers": sip.front_bumpers,
        "rear_bumpers": sip.rear_bumpers,
        "control_rad": _round(sip.raw_control * parameters.angle_conv_rad),
        "flags" if profile.has_flags else "servo_pulse": sip.raw_flags,
        "compass_deg": sip.raw_compass * 2,
        "sonar_m": {str(number): _round(range_m) for number, range_m in sensed.sonar_m},
        "gripper_state": sip.gripper_state,
        "analog_port": sip.analog_port,
        "analog": sip.raw_analog,
        "digital_in": sip.digital_in,
        "digital_out": sip.digital_out,
    }
    for (field, _, _), value in zip(TAIL, sip.tail, strict=False):
        found[field.removeprefix("raw_")] = value
    if sip.rest:
        found["rest"] = sip.rest.hex(" ")
    return found


def plain(value: object) -> Plain:
    """Return a value as JSON can hold it: bytes as hex, enumerations by name, dataclasses as objects."""
    if isinstance(value, float):
        return _round(value) if math.isfinite(value) else None
    if isinstance(value, (list, tuple)):
        return [plain(item) for item in value]
    if isinstance(value, dict):
        return {str(key): plain(item) for key, item in value.items()}
    if is_dataclass(value):
        return {field.name: plain(getattr(value, field.name)) for field in fields(value)}
    return _plain_leaf(value)


def _plain_leaf(value: object) -> Plain:
    if isinstance(value, Enum):
        return value.name
    if value is None or isinstance(value, (bool, int)):
        return value
    return value.hex(" ") if isinstance(value, (bytes, bytearray)) else str(value)


def printable(data: bytes) -> str:
    """Return bytes as text, `.` for what cannot be shown."""
    return "".join(chr(byte) if 32 <= byte < 127 else "." for byte in data)


def _round(value: float) -> float:
    rounded = round(value, _DECIMALS)
    return rounded or 0.0  # no -0.0


def _signed(raw: int) -> int:
    """Return a position of 15 bits either side of the origin."""
    half = (POSITION_MASK + 1) // 2
    return ((raw & POSITION_MASK) + half) % (2 * half) - half
