"""The slow way to the same rows, one object a packet: the measure that the columns are held to."""

from collections.abc import Iterator, Mapping
from dataclasses import fields, is_dataclass
from typing import Any

from p2os.capture.columns.tables import table_name
from p2os.protocol.frames import GIVE_UP_NS, Decoder, Frame
from p2os.protocol.packets import (
    BatteryPacket,
    CompassPacket,
    PlaylistPacket,
    RawPacket,
    SerauxPacket,
    ServerPacket,
    SimLaserPacket,
    StandardSip,
    read_packet,
)
from p2os.protocol.profiles import Profile
from p2os.protocol.sip import TAIL

Row = tuple[str, Mapping[str, Any]]


def rows_by_objects(data: bytes, profile: Profile) -> Iterator[Row]:
    """Yield each packet's table and row, as `Columns.rows` does."""
    decoder = Decoder()
    decoder.receive(data, 0)
    decoder.advance_to(GIVE_UP_NS)
    while (item := decoder.next_item()) is not None:
        if isinstance(item, Frame):
            yield row_of(read_packet(item, profile), item)


def row_of(packet: ServerPacket, frame: Frame) -> Row:
    """Return a packet's table, and its fields by the names of the table's columns."""
    row = {field.name: _plain(getattr(packet, field.name)) for field in fields(packet)}
    if isinstance(packet, RawPacket):
        return "raw", row
    if isinstance(packet, StandardSip):
        tail = row.pop("tail")
        padded = (*tail, *(0,) * (len(TAIL) - len(tail)))
        row |= {name: value for (name, _, _), value in zip(TAIL, padded, strict=True)}
        row["tail_count"] = len(tail)
    elif isinstance(packet, SerauxPacket):
        row["kind"] = packet.KINDS[row.pop("port")]
    elif isinstance(packet, PlaylistPacket):
        sound = row.pop("sound")
        none = {"number": 0, "toggle": 0, "raw_name": b"", "offset": 0, "length": 0}
        row |= {"has_sound": packet.sound is not None, **(sound or none)}
    elif isinstance(packet, BatteryPacket):
        row["count"] = len(packet.batteries)
        row["batteries"] = tuple(value for battery in packet.batteries for value in battery)
    elif isinstance(packet, SimLaserPacket):
        row = _laser(packet, row)
    elif isinstance(packet, CompassPacket) and packet.raw_size is None:
        del row["raw_size"]
    return table_name(frame.payload), row


def _laser(packet: SimLaserPacket, row: dict[str, Any]) -> dict[str, Any]:
    shared = {name: row[name] for name in ("total", "first", "rest")}
    if not packet.is_extended:
        return {**shared, "raw_pose": row["raw_pose"], "ranges_mm": row["ranges_mm"]}
    readings = zip(packet.ranges_mm, packet.reflectances, packet.flags_of_readings, strict=True)
    names = ("range_mm", "reflectance", "flags")
    found = tuple(dict(zip(names, reading, strict=True)) for reading in readings)
    return {**shared, "laser": packet.laser, "flags": packet.flags, "readings": found}


def _plain(value: object) -> Any:
    if is_dataclass(value):
        return {field.name: _plain(getattr(value, field.name)) for field in fields(value)}
    if isinstance(value, tuple):
        return tuple(_plain(item) for item in value)
    return value.encode("latin-1") if isinstance(value, str) else value
