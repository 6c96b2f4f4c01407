"""The events of a run as files for other programs: JSON lines, a Parquet table, or MCAP (extra `export`).

A line of JSON is an object with `kind` and the fields of its event, and of several robots with `robot`; bytes are
hex. The table has a row an event, and a column for each field of any kind, null where a kind has it not. The MCAP
holds the messages of `scene_messages`, of one robot.

Invariant: the events are those of `robot_bench.events.codec.events_of`, in their order.
"""

import dataclasses
import json
from collections.abc import Callable, Iterable, Mapping
from itertools import islice
from pathlib import Path
from typing import Any

from p2os.capture.formats.mcap_files import McapFile
from robot_bench.events.codec import Json
from robot_bench.events.kinds import KINDS, Event
from robot_bench.recording.scene_messages import SceneMessages
from simbase.errors import MissingDependencyError, UsageError
from simbase.files import open_to_write, open_to_write_text

#: chosen: rows of a group of a Parquet file.
GROUP = 65_536


def write_named_events(events: Iterable[tuple[str, Event]], path: Path, meta: Json | None = None) -> int:
    """Write events to a file whose suffix says how, `.jsonl`, `.parquet` or `.mcap`; return how many.

    Args:
        events: In order of time, each with the robot that tells it; "" where there is one alone.
        path: Where.
        meta: The first entry of the run's trace, for a scene; None: nothing is known of world and robot.

    Raises:
        UsageError: It has another suffix, or a scene is of several robots.
        MissingDependencyError: pyarrow is not installed.
        FileError: It cannot be written.
    """
    write = WRITERS.get(path.suffix)
    if write is None:
        raise UsageError(f"cannot write events as {path.suffix or path.name}", hint=" or ".join(WRITERS))
    return write(events, path, meta or {})


def _plain(robot: str, event: Event) -> dict[str, object]:
    values: dict[str, object] = {"robot": robot} if robot else {}
    values["kind"] = type(event).__name__
    for field in dataclasses.fields(event):
        value = getattr(event, field.name)
        values[field.name] = value.hex() if isinstance(value, bytes) else value
    return values


def _write_json(events: Iterable[tuple[str, Event]], path: Path, _meta: Json) -> int:
    count = 0
    with open_to_write_text(path) as file:
        for robot, event in events:
            file.write(json.dumps(_plain(robot, event), separators=(",", ":")) + "\n")
            count += 1
    return count


def _write_parquet(events: Iterable[tuple[str, Event]], path: Path, _meta: Json) -> int:
    try:
        import pyarrow as pa
        from pyarrow import parquet
    except ImportError as error:
        raise MissingDependencyError(".parquet files need pyarrow", extra="export", hint="write .jsonl") from error
    types = {
        "int": pa.int64(), "bool": pa.bool_(), "float": pa.float64(), "str": pa.string(), "bytes": pa.binary(),
        "Nanos": pa.int64(), "tuple": pa.list_(pa.int64()), "Mapping": pa.string(),
    }  # fmt: skip
    named = {field.name: field.type for kind in KINDS for field in dataclasses.fields(kind)}
    columns = {"robot": pa.string(), "kind": pa.string()} | {name: _type(types, hint) for name, hint in named.items()}
    schema, count = pa.schema(list(columns.items())), 0
    with open_to_write(path) as file, parquet.ParquetWriter(file, schema) as writer:
        every = iter(events)
        while group := list(islice(every, GROUP)):
            rows = [_row(robot, event) for robot, event in group]
            writer.write_table(pa.Table.from_pylist(rows, schema=schema))
            count += len(rows)
    return count


def _write_mcap(events: Iterable[tuple[str, Event]], path: Path, meta: Json) -> int:
    messages, count = SceneMessages(meta), 0
    with McapFile(path, instead="write .jsonl") as file:
        for message in messages.anew(0):
            file.write(message.topic, message.schema, message.data, message.t)
        for robot, event in events:
            if robot:
                raise UsageError("a scene is of one robot", hint=f"p2os report FOLDER/{robot} --events {path.name}")
            count += 1
            for message in messages.of(event):
                file.write(message.topic, message.schema, message.data, message.t)
    return count


def _type(types: Mapping[str, Any], hint: Any) -> Any:
    name = getattr(hint, "__name__", str(hint))
    return types[name.partition("[")[0].partition(" |")[0]]


def _row(robot: str, event: Event) -> dict[str, object]:
    row: dict[str, object] = {"robot": robot or None, "kind": type(event).__name__}
    for field in dataclasses.fields(event):
        value = getattr(event, field.name)
        row[field.name] = json.dumps(value, sort_keys=True) if isinstance(value, Mapping) else value
    return row


#: Suffix → what writes it.
WRITERS: Mapping[str, Callable[[Iterable[tuple[str, Event]], Path, Json], int]] = {
    ".jsonl": _write_json, ".parquet": _write_parquet, ".mcap": _write_mcap,
}  # fmt: skip
