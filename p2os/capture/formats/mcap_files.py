"""Captures as MCAP files, for Foxglove and its like; needs the extra `export`.

One channel a direction and packet name, such as `/robot/SIP` and `/client/VEL`;
messages are JSON with a schema of the fields that the first one has.
"""

import json
from collections.abc import Iterable
from pathlib import Path

from p2os.capture.chunks import Direction
from p2os.capture.describe import Plain
from p2os.capture.listing import ListingRow
from simbase.errors import MissingDependencyError
from simbase.timing import Nanos

#: Type of a plain value → its name in JSON Schema.
_SCHEMA_TYPES = {bool: "boolean", int: "number", float: "number", str: "string", dict: "object", list: "array"}


def write_mcap(rows: Iterable[ListingRow], path: Path, base_ns: Nanos = 0) -> int:
    """Write rows as an MCAP file; return how many.

    Args:
        rows: In order of time.
        path: Where.
        base_ns: The capture's start, in nanoseconds since 1970.

    Raises:
        MissingDependencyError: mcap is not installed.
        OSError: The file cannot be written.
    """
    try:
        from mcap.writer import CompressionType, Writer
    except ImportError as error:
        raise MissingDependencyError(".mcap files need mcap", extra="export", hint="export to .csv") from error
    channels: dict[str, int] = {}
    count = 0
    with path.open("wb") as file:
        writer = Writer(file, compression=CompressionType.NONE)
        writer.start(profile="", library="p2os")
        for row in rows:
            topic = _topic(row)
            message: dict[str, Plain] = {**row.fields, "valid": row.valid}
            if topic not in channels:
                schema = writer.register_schema(
                    name=f"p2os.{row.name}", encoding="jsonschema", data=json.dumps(_schema(message)).encode()
                )
                channels[topic] = writer.register_channel(topic=topic, message_encoding="json", schema_id=schema)
            at_ns = base_ns + row.at_ns
            writer.add_message(
                channel_id=channels[topic], log_time=at_ns, publish_time=at_ns, data=json.dumps(message).encode()
            )
            count += 1
        writer.finish()  # type: ignore[no-untyped-call]  # mcap declares no return type
    return count


def _topic(row: ListingRow) -> str:
    who = "line" if row.direction is None else "client" if row.direction is Direction.TO_ROBOT else "robot"
    return f"/{who}/{row.name.replace(' ', '_')}"


def _schema(message: dict[str, Plain]) -> dict[str, object]:
    properties = {
        name: {"type": _SCHEMA_TYPES[type(value)]} for name, value in message.items() if type(value) in _SCHEMA_TYPES
    }
    return {"type": "object", "properties": properties}
