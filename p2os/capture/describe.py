"""What stands in a frame, as a name and plain values in SI units.

Values are what JSON can hold: numbers, text, booleans, None, lists and objects
of those. Names of fields end in their unit where they have one.
"""

import math
from collections.abc import Callable
from dataclasses import fields, is_dataclass
from enum import Enum
from functools import partial
from operator import getitem
from typing import TypeAlias, TypeVar

from p2os.protocol.commands import Command
from p2os.protocol.config_packet import FIELDS, ConfigPacket
from p2os.protocol.frames import CHECKSUM_BYTES, PREFIX_BYTES, Frame
from p2os.protocol.packets import READERS, Identity, RawPacket, packet_name, read_packet
from p2os.protocol.profiles import Profile
from p2os.protocol.sip import (
    HEAD_BYTES,
    MOVING,
    POSITION_MASK,
    READING_BYTES,
    SIP_KINDS,
    TAIL,
    unpack_head,
    unpack_tail,
)
from p2os.protocol.units import battery_v, heading_rad, range_m, rim_mps
from p2os.robots.parameters import RobotParameters

Plain: TypeAlias = "bool | int | float | str | list[Plain] | dict[str, Plain] | None"

Value = TypeVar("Value")

#: A micrometre or a microradian: what is finer is an artefact of floating point.
_DECIMALS = 6


def command_name(kind: int) -> str:
    """Return a command's name in the manuals."""
    return Command(kind).name


def command_fields(data: bytes) -> dict[str, Plain]:
    """Return a command's argument, out of its bytes on the wire."""
    command = Command.from_frame(_frame(data))
    argument = command.argument
    if argument is None:
        return {}
    if isinstance(argument, bytes):
        return {"argument": argument.hex(" "), "text": printable(argument)}
    found: dict[str, Plain] = {"argument": argument}
    row = command.row
    if row is not None and row.unit:
        found["unit"] = row.unit
    if row is not None and row.two_bytes is not None:
        low, high = command.signed_bytes if row.two_bytes.is_signed else command.two_bytes
        found |= {row.two_bytes.low: low, row.two_bytes.high: high}
    return found


def describe_packet(frame: Frame, profile: Profile, parameters: RobotParameters) -> tuple[str, dict[str, Plain]]:
    """Return a packet's name and fields; what cannot be read stands in `data` as hex."""
    return packet_name(frame.kind), PacketFields(profile, parameters).fields_of(frame.to_bytes())


class PacketFields:
    """What stands in the packets of one robot.

    Args:
        profile: Its firmware family, for layouts.
        parameters: Its units.
    """

    def __init__(self, profile: Profile, parameters: RobotParameters) -> None:
        self._profile = profile
        self._sips = SipFields(profile, parameters)

    def fields_of(self, data: bytes) -> dict[str, Plain]:
        """Return a packet's fields, out of its bytes on the wire; what cannot be read stands in `data` as hex."""
        if data[PREFIX_BYTES] in SIP_KINDS:
            found = self._sips.of(data[PREFIX_BYTES:-CHECKSUM_BYTES])
            if found is not None:
                return found
        frame = _frame(data)
        packet = read_packet(frame, self._profile)
        if isinstance(packet, Identity):
            return {"name": packet.name, "class": packet.robot_class, "subclass": packet.subclass}
        if isinstance(packet, ConfigPacket):
            return {field: plain(getattr(packet, field)) for field, _ in FIELDS[: packet.fields_sent]}
        if isinstance(packet, RawPacket):
            if frame.kind in SIP_KINDS or frame.kind in READERS:
                return {"problem": "its inside does not follow its layout", "data": packet.data.hex(" ")}
            return {"data": packet.data.hex(" ")} if packet.data else {}
        return {
            field.name: plain(getattr(packet, field.name))
            for field in fields(packet)
            if field.name not in {"kind", "rest"} or getattr(packet, field.name)
        }


def _frame(data: bytes) -> Frame:
    return Frame(data[PREFIX_BYTES:-CHECKSUM_BYTES])


def _round(value: float) -> float:
    rounded = round(value, _DECIMALS)
    return rounded or 0.0  # no -0.0


def _position(robot: RobotParameters, raw: int) -> float:
    """Return a position of 15 bits either side of the origin, metres."""
    half = (POSITION_MASK + 1) // 2
    return _round((((raw & POSITION_MASK) + half) % (2 * half) - half) * robot.distance_conv_mm / 1000)


def _speed(robot: RobotParameters, raw: int) -> float:
    return _round(rim_mps(raw, robot))


def _as_it_is(robot: RobotParameters, raw: int) -> int:
    del robot
    return raw


#: The fields of a SIP in SI units, in their order: name, the raw field that alone decides it, and how. Word 16 is read
#: as the profile says; of the sonar readings each is a value of its own.
_SIP_FIELDS: tuple[tuple[str, str, Callable[[RobotParameters, int], Plain]], ...] = (
    ("moving", "kind", lambda _, raw: raw == MOVING),
    ("x_m", "raw_x", _position),
    ("y_m", "raw_y", _position),
    ("heading_rad", "raw_heading", lambda robot, raw: _round(heading_rad(raw, robot))),
    ("left_mps", "raw_left_velocity", _speed),
    ("right_mps", "raw_right_velocity", _speed),
    ("battery_v", "raw_battery", lambda _, raw: battery_v(raw)),
    ("stall_left", "stall_left", lambda _, raw: bool(raw)),
    ("stall_right", "stall_right", lambda _, raw: bool(raw)),
    ("front_bumpers", "front_bumpers", _as_it_is),
    ("rear_bumpers", "rear_bumpers", _as_it_is),
    ("control_rad", "raw_control", lambda robot, raw: _round(raw * robot.angle_conv_rad)),
    ("flags", "raw_flags", _as_it_is),
    ("servo_pulse", "raw_flags", _as_it_is),
    ("compass_deg", "raw_compass", lambda _, raw: raw * 2),
    ("sonar_m", "raw_range", lambda robot, raw: _round(range_m(raw, robot))),
    ("gripper_state", "gripper_state", _as_it_is),
    ("analog_port", "analog_port", _as_it_is),
    ("analog", "raw_analog", _as_it_is),
    ("digital_in", "digital_in", _as_it_is),
    ("digital_out", "digital_out", _as_it_is),
)
#: A field of a SIP in SI units → the raw field that alone decides it.
RAW_OF = {name: raw for name, raw, _ in _SIP_FIELDS}
#: What word 16 is not, by whether a profile has flags there.
_NOT_WORD_16 = {True: "servo_pulse", False: "flags"}


class SipFields:
    """A SIP in SI units: positions either side of 0, the profile's reading of word 16; each raw value converted once.

    Args:
        profile: Layout of the last fields.
        parameters: The robot's units.
    """

    def __init__(self, profile: Profile, parameters: RobotParameters) -> None:
        self._profile = profile
        #: Of each field, in their order; of `sonar_m`, of each reading.
        self.memos = {
            name: Memo(partial(convert, parameters))
            for name, _, convert in _SIP_FIELDS if name != _NOT_WORD_16[profile.has_flags]
        }  # fmt: skip
        #: As a tail's fields are called here.
        self.tail = tuple(name.removeprefix("raw_") for name, _, _ in TAIL)

    def of(self, payload: bytes) -> dict[str, Plain] | None:
        """Return a SIP's fields, or None where it is no sound SIP inside."""
        head = unpack_head(payload)
        if head is None:
            return None
        x, y, heading, left_velocity, right_velocity, battery, left, right, control, flags, compass, count = head[:12]
        behind = 12 + 2 * count
        first, second, analog, digital_in, digital_out = head[behind:]
        gripper, port = (first, second) if self._profile.has_gripper_first else (second, first)
        memos = self.memos
        ranges = map(memos["sonar_m"].__getitem__, head[13:behind:2])
        found: dict[str, Plain] = dict(zip(memos, map(getitem, memos.values(), (
            payload[0], x, y, heading, left_velocity, right_velocity, battery, left & 1, right & 1, right >> 1,
            left >> 1, control, flags, compass, 0, gripper, port, analog, digital_in, digital_out,
        )), strict=True))  # fmt: skip
        found["sonar_m"] = dict(zip(map(str, head[12:behind:2]), ranges, strict=True))
        size = HEAD_BYTES + READING_BYTES * count
        if size < len(payload):
            tail, place = unpack_tail(payload, size)
            found.update(zip(self.tail, tail, strict=False))
            if place < len(payload):
                found["rest"] = payload[place:].hex(" ")
        return found


class Memo(dict[int, Value]):
    """What a function says of each value that it was asked for.

    Args:
        convert: The function.
    """

    def __init__(self, convert: Callable[[int], Value]) -> None:
        super().__init__()
        self._convert = convert

    def __missing__(self, key: int) -> Value:
        value = self[key] = self._convert(key)
        return value


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
