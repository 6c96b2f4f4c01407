"""Every byte of a frame in words: header, count, number or type, fields, checksum.

The layouts come from the declarations of the packets themselves (`p2os.protocol.sip`,
`p2os.protocol.config_packet`, `p2os.protocol.packets`). A packet whose content does not
fit its own counts is shown as plain bytes, as `read_packet` does.

Invariant: the parts of any bytes, sound or damaged, partition them: joined they are
the frame again.
"""

import io
import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from construct import Array, Construct, ConstructError, Container, Renamed, Struct

from p2os.capture.chunks import Direction
from p2os.capture.describe import printable
from p2os.capture.listing import ListingRow
from p2os.capture.reading import Reading
from p2os.protocol.commands import NEGATIVE, POSITIVE, STRING, Command
from p2os.protocol.config_packet import FIELDS, ConfigPacket
from p2os.protocol.frames import CHECKSUM_BYTES, HEADER, MAX_COUNT, MIN_COUNT, PREFIX_BYTES, Frame, checksum
from p2os.protocol.packets import (
    CompassPacket,
    Identity,
    RawPacket,
    SerauxPacket,
    ServerPacket,
    SimLaserPacket,
    packet_name,
    read_packet,
)
from p2os.protocol.profiles import Profile
from p2os.protocol.sip import HEAD, HEAD_BYTES, READING_BYTES, TAIL, StandardSip
from p2os.robots.parameters import RobotParameters

Span = tuple[bytes, str, str]
_TYPES = {
    POSITIVE: "integer, to be taken as it is",
    NEGATIVE: "integer, to be taken negative",
    STRING: "string, its length first",
}
#: Bits of the flags of AROS and ARCOS robots.
FLAG_BITS = (
    "motors on", "sonar array 1 on", "sonar array 2 on", "sonar array 3 on", "sonar array 4 on", "STOP button",
    "E_stall", "far ledge", "near ledge", "joystick button", "charger power good",
)  # fmt: skip
#: Packets without fields of their own → what their bytes are.
_DATA_MEANINGS: Mapping[type, str] = {
    RawPacket: "a packet that is not read here",
    SerauxPacket: "bytes that came in at the AUX port",
}
#: Fields of the ARCOS tail that have a unit.
_TAIL_MEANINGS: Mapping[str, Callable[[int], str]] = {
    "raw_battery_x10": lambda raw: f"{raw / 10:.1f} V",
    "charge_state": lambda raw: {-1: "unknown", 0: "not charging", 1: "bulk", 2: "overcharge", 3: "float",
                                 4: "balance"}.get(raw, str(raw)),
    "raw_rotation_velocity": lambda raw: f"{raw / 10:.1f} deg/s",
    "raw_lateral_velocity": lambda raw: f"{raw} mm/s",
    "raw_temperature": lambda raw: "no sensor" if raw == -127 else f"{raw} deg C",
    "state_of_charge": lambda raw: f"{raw} %",
    "controller_time_us": lambda raw: f"{raw} us",
}  # fmt: skip


@dataclass(frozen=True, slots=True)
class FramePart:
    """Some bytes of a frame and what they mean.

    Args:
        offset: Of the first byte, from the frame's header.
        data: The bytes.
        name: What they are, as the manuals call it.
        meaning: Their value in words, with its unit.
    """

    offset: int
    data: bytes
    name: str
    meaning: str = ""


def explain(row: ListingRow, reading: Reading) -> list[FramePart]:
    """Return the parts of a row's bytes, in order."""
    return list(_placed(_sound(row, reading) if row.valid else _damaged(row.data)))


def lines_of(parts: list[FramePart]) -> list[str]:
    """Return an explanation as aligned lines: offset, bytes, name, meaning."""
    lines = []
    for part in parts:
        for start in range(0, len(part.data), 8):
            shown = part.data[start : start + 8].hex(" ")
            words = f"{part.name}: {part.meaning}" if part.meaning else part.name
            lines.append(f"  {part.offset + start:3d}  {shown:<23}  {words if start == 0 else ''}".rstrip())
    return lines


def _placed(spans: Iterator[Span]) -> Iterator[FramePart]:
    offset = 0
    for data, name, meaning in spans:
        if data:
            yield FramePart(offset, data, name, meaning)
            offset += len(data)


def _sound(row: ListingRow, reading: Reading) -> Iterator[Span]:
    frame = Frame.from_bytes(row.data)
    yield HEADER, "header", ""
    yield row.data[2:3], "count", f"{row.data[2]} bytes follow, checksum included"
    if row.direction is Direction.FROM_ROBOT:
        kind = packet_name(frame.kind)
        yield frame.payload[:1], "type", f"0x{frame.kind:02X}, {row.name if row.name != kind else kind}"
        yield from packet_parts(frame, reading.profile, reading.parameters)
    else:
        yield from command_parts(frame, row.name)
    yield row.data[-CHECKSUM_BYTES:], "checksum", f"0x{checksum(frame.payload):04X}, high byte first; right"


def _damaged(data: bytes) -> Iterator[Span]:
    """Yield how far damaged bytes look like a frame."""
    if data[:2] != HEADER or len(data) < PREFIX_BYTES:
        yield data, "noise", "no header, so no frame"
        return
    count = data[2]
    yield HEADER, "header", ""
    if not MIN_COUNT <= count <= MAX_COUNT:
        yield data[2:3], "count", f"{count} is none: frames have {MIN_COUNT} to {MAX_COUNT}"
        yield data[3:], "bytes", "looked at again for another header"
        return
    missing = count + PREFIX_BYTES - len(data)
    yield data[2:3], "count", f"{count} bytes should follow" + (f", {missing} never came" if missing > 0 else "")
    if missing > 0:
        yield data[3:], "bytes", "looked at again for another header"
        return
    payload, stated = data[PREFIX_BYTES:-CHECKSUM_BYTES], int.from_bytes(data[-CHECKSUM_BYTES:], "big")
    yield payload[:1], "number or type", f"{payload[0]} (0x{payload[0]:02X}), if it is sound"
    yield payload[1:], "bytes", "not to be trusted"
    yield data[-CHECKSUM_BYTES:], "checksum", f"0x{stated:04X}, but these bytes give 0x{checksum(payload):04X}"


def command_parts(frame: Frame, name: str) -> Iterator[Span]:
    """Yield (bytes, name, meaning) from the command number to the last argument."""
    row = Command(frame.kind).row
    yield frame.payload[:1], "command", f"{frame.kind}, {name}" + (f": {row.meaning}" if row else "")
    data = frame.data
    if not data:
        return
    if data[0] not in _TYPES:
        yield data, "bytes", "an argument of a type that no manual names"
        return
    yield data[:1], "argument type", _TYPES[data[0]]
    if data[0] == STRING:
        yield from _string(data[1:])
    elif len(data) < 3:
        yield data[1:], "bytes", "half an integer; robots ignore it"
    else:
        yield from _integer(Command.from_frame(frame), data[1:3])
        yield data[3:], "bytes", "after the argument; robots ignore them"


def _string(data: bytes) -> Iterator[Span]:
    if not data:
        return
    length = data[0]
    text, rest = data[1 : 1 + length], data[1 + length :]
    short = "" if len(text) == length else f", of which {length - len(text)} are missing"
    yield data[:1], "length", f"{length} bytes{short}"
    yield text, "string", f'"{printable(text)}"'
    yield rest, "bytes", "a NUL that the length does not count" if rest == b"\0" else "after the string; ignored"


def _integer(command: Command, data: bytes) -> Iterator[Span]:
    value, row = command.integer, command.row
    if row is None or row.two_bytes is None:
        unit = f" {row.unit}" if row is not None and row.unit else ""
        yield data, "argument", f"{value}{unit}, low byte first"
        return
    low, high = command.signed_bytes if row.two_bytes.is_signed else command.two_bytes
    yield data, "argument", f"{value}: {row.two_bytes.high} {high}, {row.two_bytes.low} {low}"


def packet_parts(frame: Frame, profile: Profile, parameters: RobotParameters) -> Iterator[Span]:
    """Yield (bytes, name, meaning) from the byte after the type to the last one before the checksum."""
    data = frame.data
    packet = read_packet(frame, profile)
    if isinstance(packet, Identity):
        yield from _strings(data, ("name", "class", "subclass"))
    elif isinstance(packet, StandardSip):
        yield from _sip(packet, frame, profile, parameters)
    elif isinstance(packet, ConfigPacket):
        yield from _config(packet, data)
    elif (layout := _layout_of(packet, frame)) is not None:
        yield from walk(layout, data)
    else:
        yield data, "data", _DATA_MEANINGS.get(type(packet), "nothing more")


def _layout_of(packet: ServerPacket, frame: Frame) -> Construct | None:
    """Return the declaration by which a packet was read, or None where it has none."""
    if isinstance(packet, CompassPacket) and packet.raw_size is None:
        return packet.READING
    if isinstance(packet, SimLaserPacket) and frame.kind != packet.KINDS[0]:
        return packet.EXTENDED_LAYOUT
    return getattr(packet, "LAYOUT", None)


def walk(layout: Construct, data: bytes) -> Iterator[Span]:
    """Yield (bytes, name, value) of each leaf of a declared layout, then what follows it or does not fit it."""
    stream, covered = io.BytesIO(data), 0
    try:
        for span in _walk(layout, stream, _context(), ""):
            covered += len(span[0])
            yield span
    except ConstructError:
        yield data[covered:], "bytes", "too few for the next field"
        return
    yield data[covered:], "rest", "after the last known field"


def _walk(layout: Construct, stream: io.BytesIO, context: Any, name: str) -> Iterator[Span]:
    bare = layout
    while isinstance(bare, Renamed):
        name = name or bare.name
        bare = bare.subcon
    if isinstance(bare, Struct):
        inner = _context(context)
        for sub in bare.subcons:
            yield from _walk(sub, stream, inner, f"{name}.{sub.name}" if name else str(sub.name))
        context[name] = inner
    elif isinstance(bare, Array):
        count = bare.count(context) if callable(bare.count) else bare.count
        for number in range(count):
            yield from _walk(bare.subcon, stream, context, f"{name}[{number}]")
    else:
        start = stream.tell()
        value = layout._parsereport(stream, context, "")  # noqa: SLF001 - construct offers no public step-wise parsing
        context[name.rsplit(".", maxsplit=1)[-1]] = value
        yield stream.getvalue()[start : stream.tell()], name, str(value)


def _context(parent: Any = None) -> Any:
    context = Container(_parsing=True, _building=False, _sizing=False, _params=Container())
    context._ = parent
    context._root = context if parent is None else parent._root  # noqa: SLF001 - as construct itself sets it
    return context


def _sip(sip: StandardSip, frame: Frame, profile: Profile, parameters: RobotParameters) -> Iterator[Span]:
    data, meanings = frame.data, _sip_meanings(sip, profile, parameters)
    size = HEAD_BYTES - 1 + READING_BYTES * len(sip.sonar)
    first, second = ("gripper state", "analog port") if profile.has_gripper_first else ("analog port", "gripper state")
    for span, name, text in walk(HEAD, data[:size]):
        if name.startswith("sonar["):
            place = int(name[6:].split("]")[0])
            yield span, *_sonar(name, sip.sonar[place].raw_range, text, parameters)
        else:
            title, meaning = meanings.get(name, ({"first": first, "second": second}.get(name, name), text))
            yield span, title, meaning
    place = size
    for (name, width, _), value in zip(TAIL, sip.tail, strict=False):
        meaning = _TAIL_MEANINGS[name](value) if name in _TAIL_MEANINGS else f"0x{value:X}"
        yield data[place : place + width], name.removeprefix("raw_").replace("_", " "), meaning
        place += width
    yield data[place:], "rest", "after the last known field"


def _sonar(name: str, raw_range: int, value: str, parameters: RobotParameters) -> tuple[str, str]:
    if name.endswith("number"):
        return "sonar number", value
    return "sonar range", f"{raw_range} counts = {raw_range * parameters.range_conv_mm / 1000:.3f} m"


def _sip_meanings(sip: StandardSip, profile: Profile, parameters: RobotParameters) -> dict[str, tuple[str, str]]:
    mm, speed = parameters.distance_conv_mm, parameters.velocity_conv
    degrees = math.degrees(parameters.angle_conv_rad)

    def position(raw: int) -> str:
        masked = raw & 0x7FFF
        note = ", bit 15 is not part of it" if masked != raw else ""
        return f"{masked} counts of {mm:g} mm = {masked * mm / 1000:.3f} m (15 bits{note})"

    def heading(raw: int) -> str:
        return f"{raw} of {parameters.angle_counts_per_turn} a turn = {raw * degrees:.1f} deg"

    flags = [text for bit, text in enumerate(FLAG_BITS) if sip.raw_flags >> bit & 1]
    return {
        "raw_x": ("XPOS", position(sip.raw_x)),
        "raw_y": ("YPOS", position(sip.raw_y)),
        "raw_heading": ("THPOS", heading(sip.raw_heading)),
        "raw_left_velocity": ("L VEL", f"left wheel {sip.raw_left_velocity * speed:.0f} mm/s"),
        "raw_right_velocity": ("R VEL", f"right wheel {sip.raw_right_velocity * speed:.0f} mm/s"),
        "raw_battery": ("BATTERY", f"{sip.raw_battery / 10:.1f} V"),
        "left": ("STALL, BUMPERS", f"left wheel {_stall(sip.stall_left)}, rear bumpers {_bits(sip.rear_bumpers)}"),
        "right": ("STALL, BUMPERS", f"right wheel {_stall(sip.stall_right)}, front bumpers {_bits(sip.front_bumpers)}"),
        "raw_control": ("CONTROL", f"heading set-point {heading(sip.raw_control)}"),
        "raw_flags": ("FLAGS", ", ".join(flags) or "none set") if profile.has_flags
        else ("PTU", f"pulse width {sip.raw_flags} of servo 1"),
        "raw_compass": ("COMPASS", f"{sip.raw_compass * 2} deg"),
        "count": ("SONAR COUNT", f"{len(sip.sonar)} readings follow"),
        "raw_analog": ("ANALOG", f"{sip.raw_analog} of 255 = {sip.raw_analog / 51:.2f} V"),
        "digital_in": ("DIGIN", _bits(sip.digital_in, 8)),
        "digital_out": ("DIGOUT", _bits(sip.digital_out, 8)),
    }  # fmt: skip


def _stall(is_stalled: bool) -> str:
    return "stalled" if is_stalled else "free"


def _bits(value: int, width: int = 7) -> str:
    return f"0b{value:0{width}b}"


def _config(packet: ConfigPacket, data: bytes) -> Iterator[Span]:
    place = 0
    for name, kind in FIELDS[: packet.fields_sent]:
        value = getattr(packet, name)
        size = len(value.encode("latin-1")) + 1 if isinstance(value, str) else kind.sizeof()
        yield data[place : place + size], name.upper(), f'"{value}"' if isinstance(value, str) else str(value)
        place += size
    yield data[place:], "rest", "after the last known field"


def _strings(data: bytes, names: tuple[str, ...]) -> Iterator[Span]:
    texts = data.split(b"\0", len(names))
    for name, text in zip(names, texts, strict=False):
        yield data[: len(text) + 1], name, f'"{printable(text)}"'
        data = data[len(text) + 1 :]
    yield data, "rest", "after the last string"
