"""What stands in a frame, as a name and plain values in SI units.

Values are what JSON can hold: numbers, text, booleans, None, lists and objects
of those. Names of fields end in their unit where they have one.
"""

import math
from collections.abc import Callable
from dataclasses import fields, is_dataclass
from enum import Enum
from typing import Any, TypeAlias, TypeVar, cast

from p2os.protocol.commands import Command
from p2os.protocol.config_packet import FIELDS, ConfigPacket
from p2os.protocol.frames import CHECKSUM_BYTES, PREFIX_BYTES, Frame
from p2os.protocol.packets import READERS, Identity, RawPacket, packet_name, read_packet
from p2os.protocol.profiles import Profile
from p2os.protocol.sip import (
    HEAD_BYTES,
    POSITION_MASK,
    READING_BYTES,
    SIP_KINDS,
    TAIL,
    SonarReading,
    StandardSip,
    unpack_head,
    unpack_tail,
)
from p2os.protocol.units import in_units
from p2os.robots.parameters import RobotParameters

Plain: TypeAlias = "bool | int | float | str | list[Plain] | dict[str, Plain] | None"

Value = TypeVar("Value")

#: A field of a SIP in SI units → the raw field that alone decides it.
RAW_OF = {
    "moving": "kind", "x_m": "raw_x", "y_m": "raw_y",
    "heading_rad": "raw_heading", "left_mps": "raw_left_velocity", "right_mps": "raw_right_velocity",
    "battery_v": "raw_battery", "stall_left": "stall_left", "stall_right": "stall_right",
    "front_bumpers": "front_bumpers", "rear_bumpers": "rear_bumpers", "control_rad": "raw_control",
    "flags": "raw_flags", "servo_pulse": "raw_flags", "compass_deg": "raw_compass",
    "gripper_state": "gripper_state", "analog_port": "analog_port", "analog": "raw_analog",
    "digital_in": "digital_in", "digital_out": "digital_out",
}  # fmt: skip

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
        "stall_left": bool(sip.stall_left),
        "stall_right": bool(sip.stall_right),
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


class SipFields:
    """What `sip_fields` says, many times a second: each raw value that occurs is converted once.

    Args:
        profile: Layout of the last fields.
        parameters: The robot's units.
    """

    def __init__(self, profile: Profile, parameters: RobotParameters) -> None:
        self._profile, self._parameters = profile, parameters
        #: Of each field, in their order; None stands for the sonar readings.
        self.memos = {name: None if name == "sonar_m" else self.memo(name) for name in self._described(StandardSip())}
        self.sonar: Memo[Plain] = Memo(self._range)
        #: As a tail's fields are called here.
        self.tail = tuple(name.removeprefix("raw_") for name, _, _ in TAIL)

    def memo(self, name: str) -> "Memo[Plain]":
        """Return what a field says of the raw value that alone decides it."""
        raw = RAW_OF[name]

        def convert(value: int) -> Plain:
            one: dict[str, Any] = {raw: value}
            return self._described(StandardSip(**one))[name]

        return Memo(convert)

    def of(self, payload: bytes) -> dict[str, Plain] | None:
        """Return a SIP's fields, or None where it is no sound SIP inside."""
        head = unpack_head(payload)
        if head is None:
            return None
        x, y, heading, left_velocity, right_velocity, battery, left, right, control, flags, compass, count = head[:12]
        behind = 12 + 2 * count
        first, second, analog, digital_in, digital_out = head[behind:]
        gripper, port = (first, second) if self._profile.has_gripper_first else (second, first)
        numbers = map(str, head[12:behind:2])
        ranges: Plain = dict(zip(numbers, map(self.sonar.__getitem__, head[13:behind:2]), strict=True))
        raw = iter((
            payload[0], x, y, heading, left_velocity, right_velocity, battery, left & 1, right & 1, right >> 1,
            left >> 1, control, flags, compass, gripper, port, analog, digital_in, digital_out,
        ))  # fmt: skip
        found: dict[str, Plain] = {
            name: ranges if memo is None else memo[next(raw)] for name, memo in self.memos.items()
        }
        size = HEAD_BYTES + READING_BYTES * count
        if size < len(payload):
            tail, place = unpack_tail(payload, size)
            found.update(zip(self.tail, tail, strict=False))
            if place < len(payload):
                found["rest"] = payload[place:].hex(" ")
        return found

    def _described(self, sip: StandardSip) -> dict[str, Plain]:
        return sip_fields(sip, self._profile, self._parameters)

    def range_m(self, raw_range: int) -> float:
        """Return a sonar reading in metres."""
        return cast("float", self.sonar[raw_range])

    def _range(self, raw_range: int) -> Plain:
        sonar = self._described(StandardSip(sonar=(SonarReading(0, raw_range),)))["sonar_m"]
        return cast("dict[str, Plain]", sonar)["0"]


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


def _round(value: float) -> float:
    rounded = round(value, _DECIMALS)
    return rounded or 0.0  # no -0.0


def _signed(raw: int) -> int:
    """Return a position of 15 bits either side of the origin."""
    half = (POSITION_MASK + 1) // 2
    return ((raw & POSITION_MASK) + half) % (2 * half) - half
