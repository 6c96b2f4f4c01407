"""MCAP files of JSON messages, for Foxglove and its like; needs the extra `export`.

A capture has one channel a direction and packet name, such as `/robot/SIP` and `/client/VEL`. The schema of a channel
is that of the fields of its first message.
"""

import json
from collections.abc import Iterable, Mapping
from pathlib import Path
from types import TracebackType
from typing import Self

from p2os.capture.chunks import Direction
from p2os.capture.describe import Plain
from p2os.capture.listing import ListingRow
from simbase.errors import MissingDependencyError
from simbase.files import open_to_write
from simbase.timing import Nanos

#: Type of a plain value → its name in JSON Schema.
_SCHEMA_TYPES = {
    bool: "boolean", int: "number", float: "number", str: "string", dict: "object", list: "array", tuple: "array",
}  # fmt: skip


class McapFile:
    """An MCAP file being written, a block's context; times are nanoseconds.

    Args:
        path: Where.
        instead: What can be done without the library, for its error.

    Raises:
        MissingDependencyError: mcap is not installed.
        FileError: The file cannot be written.
    """

    def __init__(self, path: Path, *, instead: str) -> None:
        try:
            from mcap.writer import CompressionType, Writer
        except ImportError as error:
            raise MissingDependencyError(".mcap files need mcap", extra="export", hint=instead) from error
        self.count = 0
        self._channels: dict[str, int] = {}
        self._file = open_to_write(path)
        self._writer = Writer(self._file, compression=CompressionType.NONE)
        self._writer.start(profile="", library="p2os")

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._writer.finish()  # type: ignore[no-untyped-call]  # mcap declares no return type
        self._file.close()

    def write(self, topic: str, schema: str, message: Mapping[str, object], at_ns: Nanos) -> None:
        """Add a message; the first one of a topic decides the schema that the file states for it."""
        if topic not in self._channels:
            number = self._writer.register_schema(
                name=schema, encoding="jsonschema", data=json.dumps(json_schema(message)).encode()
            )
            self._channels[topic] = self._writer.register_channel(
                topic=topic, message_encoding="json", schema_id=number
            )
        self._writer.add_message(
            channel_id=self._channels[topic], log_time=at_ns, publish_time=at_ns, data=json.dumps(message).encode()
        )
        self.count += 1


def json_schema(message: Mapping[str, object]) -> dict[str, object]:
    """Return the JSON Schema of messages like this one, its own fields only."""
    properties = {
        name: {"type": _SCHEMA_TYPES[type(value)]} for name, value in message.items() if type(value) in _SCHEMA_TYPES
    }
    return {"type": "object", "properties": properties}


def write_mcap(rows: Iterable[ListingRow], path: Path, base_ns: Nanos = 0) -> int:
    """Write rows as an MCAP file; return how many.

    Args:
        rows: In order of time.
        path: Where.
        base_ns: The capture's start, in nanoseconds since 1970.

    Raises:
        MissingDependencyError: mcap is not installed.
        FileError: The file cannot be written.
    """
    with McapFile(path, instead="export to .csv") as file:
        for row in rows:
            message: dict[str, Plain] = {**row.fields, "valid": row.valid}
            file.write(_topic(row), f"p2os.{row.name}", message, base_ns + row.at_ns)
    return file.count


def _topic(row: ListingRow) -> str:
    who = "line" if row.direction is None else "client" if row.direction is Direction.TO_ROBOT else "robot"
    return f"/{who}/{row.name.replace(' ', '_')}"
