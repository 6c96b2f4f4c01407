"""Declared layouts read and written: one construct, both directions.

A layout covers the bytes after the packet's type that are known; firmware only
ever appends, so what follows them is kept as `rest`. A packet that ends inside
its layout is not sound and is refused: `read_packet` then returns it raw.

Invariant: `build(kind, layout, **parse(layout, frame)) == frame` for every
frame of that kind that `parse` accepts.
"""

import io
from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields
from typing import Any, ClassVar, Self

from construct import Construct, ConstructError, ExprValidator, GreedyBytes, NullTerminated

from p2os.errors import LocalProtocolError, RemoteProtocolError
from p2os.protocol.frames import Frame

#: Ends with a NUL, and holds none.
TEXT = NullTerminated(ExprValidator(GreedyBytes, lambda text, _: b"\0" not in text))
Fields = dict[str, Any]


def parse(layout: Construct, frame: Frame) -> Fields:
    """Return the fields of a frame's data by their names, and what follows them as `rest`.

    Raises:
        RemoteProtocolError: The data is shorter than the layout.
    """
    stream = io.BytesIO(frame.data)
    try:
        values = layout.parse_stream(stream)
    except (ConstructError, OSError) as error:
        raise RemoteProtocolError(
            f"packet 0x{frame.kind:02X}: {len(frame.data)} bytes of data do not hold its fields"
        ) from error
    found = {name: value for name, value in values.items() if not name.startswith("_")}
    return {**found, "rest": stream.read()}


def build(kind: int, layout: Construct, fields: Fields) -> Frame:
    """Return the frame of a packet from its fields, `rest` at the end.

    Raises:
        LocalProtocolError: A value does not fit its field, or the packet does not fit a frame.
    """
    try:
        data: bytes = layout.build(fields)
    except ConstructError as error:
        raise LocalProtocolError(f"packet 0x{kind:02X}: a value does not fit its field: {error}") from error
    return Frame(bytes((kind,)) + data + fields.get("rest", b""))


@dataclass(frozen=True, slots=True, kw_only=True)
class LaidOutPacket:
    """A packet whose fields are those of its layout, by the same names."""

    #: In the manuals.
    NAME: ClassVar[str]
    KIND: ClassVar[int]
    LAYOUT: ClassVar[Construct]
    #: Fields that say how many rows a list has, and the list.
    COUNTS: ClassVar[Mapping[str, str]] = {}
    #: What a row of a list with fields of its own becomes.
    ITEM: ClassVar[type | None] = None

    def to_frame(self) -> Frame:
        """Return the frame.

        Raises:
            LocalProtocolError: A value does not fit its field.
        """
        values = asdict(self)
        counts = {count: len(values[name]) for count, name in self.COUNTS.items()}
        return build(self.KIND, self.LAYOUT, values | counts)

    @classmethod
    def from_frame(cls, frame: Frame) -> Self:
        """Read the packet.

        Raises:
            RemoteProtocolError: It is too short.
        """
        found = parse(cls.LAYOUT, frame)
        return cls(**{field.name: _plain(found[field.name], cls.ITEM) for field in fields(cls)})


def _plain(value: Any, item: type | None) -> Any:
    """Return a list as a tuple, and a row of one with fields of its own as what it becomes."""
    if isinstance(value, list):
        return tuple(_plain(row, item) for row in value)
    if isinstance(value, dict) and item is not None:
        return item(**{name: entry for name, entry in value.items() if not name.startswith("_")})
    return value
