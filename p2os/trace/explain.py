"""Every byte of a frame in words.

The parts of an explanation follow each other without gap or overlap, so that
joined they are the frame again. The layouts come from the declarations of the
packets themselves (`p2os.sip`, `p2os.config_packet`, `p2os.packets`).

Invariant: the parts of any bytes, sound or damaged, partition them.
"""

from collections.abc import Iterator
from dataclasses import dataclass

from p2os.packets import packet_name
from p2os.trace.capture import Direction
from p2os.trace.explain_command import command_parts
from p2os.trace.explain_packet import packet_parts
from p2os.trace.listing import Reading, Row
from p2os.wire import Frame, checksum
from p2os.wire.frame import CHECKSUM_BYTES, HEADER, MAX_COUNT, MIN_COUNT, PREFIX_BYTES


@dataclass(frozen=True, slots=True)
class Part:
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


def explain(row: Row, reading: Reading) -> list[Part]:
    """Return the parts of a row's bytes, in order."""
    return list(_placed(_sound(row, reading) if row.valid else _damaged(row.data)))


def lines_of(parts: list[Part]) -> list[str]:
    """Return an explanation as aligned lines: offset, bytes, name, meaning."""
    lines = []
    for part in parts:
        for start in range(0, len(part.data), 8):
            shown = part.data[start : start + 8].hex(" ")
            words = f"{part.name}: {part.meaning}" if part.meaning else part.name
            lines.append(f"  {part.offset + start:3d}  {shown:<23}  {words if start == 0 else ''}".rstrip())
    return lines


#: (bytes, name, meaning); offsets are counted when the parts are placed.
Span = tuple[bytes, str, str]


def _placed(spans: Iterator[Span]) -> Iterator[Part]:
    offset = 0
    for data, name, meaning in spans:
        if data:
            yield Part(offset, data, name, meaning)
            offset += len(data)


def _sound(row: Row, reading: Reading) -> Iterator[Span]:
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
    """Say how far damaged bytes look like a frame."""
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
