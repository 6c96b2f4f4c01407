"""Bags: recordings of ROS messages, written as rosbag2 and read as rosbag2, MCAP or ROS 1 (by rosbags, extra `ros`).

A bag that is written is a folder of `metadata.yaml` and one file, sqlite3 or MCAP, whose types carry their definitions
and hashes; the MCAP file is whole without the folder. The bytes of a message are those that a node sends (`codec`).
A bag that is read brings its own definitions; one without is taken as of Jazzy.

Source: rosbag2, docs/design; https://mcap.dev/spec/registry (profile ros2).

Invariant: whatever a file holds, reading it yields messages or raises one `FileError`.
"""

import sqlite3
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, fields, is_dataclass
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Literal, Self, cast

from p2os.ros.codec import Message, to_cdr
from p2os.ros.message_table import standard_types
from p2os.ros.transport import Topic
from simbase.errors import FileError, MissingDependencyError, UsageError, shown, shown_name
from simbase.files import MAKE_ROOM, writing
from simbase.timing import Nanos

if TYPE_CHECKING:
    from rosbags.interfaces import Connection, Qos

#: Storage of a bag → what rosbags calls it.
STORAGES: Mapping[str, str] = {"sqlite3": "SQLITE3", "mcap": "MCAP"}
#: What a rosbag2 has beside its files.
METADATA = "metadata.yaml"
#: Suffixes of bags that are one file.
SUFFIXES = frozenset({".mcap", ".db3", ".bag"})
#: chosen: the older of the two layouts that rosbags writes; Iron and all after it read it.
VERSION: Literal[8] = 8
_NO_LIBRARY = "bags need rosbags"


class BagFile:
    """A rosbag2 that is being written, a block's context; times are nanoseconds.

    Args:
        folder: Where; it must not be there.
        storage: `sqlite3`, ROS 2's own until Humble, or `mcap`.

    Raises:
        MissingDependencyError: rosbags or cyclonedds is not installed.
        UsageError: There is no such storage.
        FileError: The folder is there, or cannot be made.
    """

    def __init__(self, folder: Path, storage: str) -> None:
        if storage not in STORAGES:
            raise UsageError(f"there is no storage {shown(storage)}", hint=" or ".join(STORAGES))
        try:
            from rosbags.rosbag2 import StoragePlugin, Writer, WriterError
        except ImportError as error:
            raise MissingDependencyError(_NO_LIBRARY, extra="ros") from error
        self._folder = folder
        try:
            with self._writing():
                self._writer = Writer(folder, version=VERSION, storage_plugin=StoragePlugin[STORAGES[storage]])
                self._writer.open()
        except WriterError as error:
            raise FileError(f"{shown_name(folder)} is there already", hint="another name") from error
        self._topics: dict[Topic, Connection] = {}
        self.count = 0

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        with self._writing():
            self._writer.close()

    def write(self, topic: Topic, message: Message, at_ns: Nanos) -> None:
        """Add a message.

        Raises:
            FileError: The system refuses to write it.
        """
        data = to_cdr(topic.type, message)
        with self._writing():
            if topic not in self._topics:
                self._topics[topic] = self._writer.add_connection(
                    topic.name, topic.type, typestore=standard_types(), offered_qos_profiles=[_qos(topic)]
                )
            self._writer.write(self._topics[topic], at_ns, data)
        self.count += 1

    @contextmanager
    def _writing(self) -> Iterator[None]:
        """Raise what the system, or SQLite for it, has against writing."""
        try:
            with writing(self._folder, hint=MAKE_ROOM):
                yield
        except sqlite3.Error as error:
            raise FileError(f"cannot write {shown_name(self._folder)}: {error}", hint=MAKE_ROOM) from error


def _qos(topic: Topic) -> "Qos":
    """Return what the topic's publisher offers, so that a bag that is played is latched where the node is."""
    from rosbags.interfaces import Qos, QosDurability, QosHistory, QosLiveliness, QosReliability, QosTime

    endless = QosTime(0x7FFFFFFF, 0xFFFFFFFF)
    durability = QosDurability.TRANSIENT_LOCAL if topic.is_latched else QosDurability.VOLATILE
    return Qos(
        QosHistory.KEEP_LAST, topic.depth, QosReliability.RELIABLE, durability, endless, endless,
        QosLiveliness.AUTOMATIC, endless, avoid_ros_namespace_conventions=False,
    )  # fmt: skip


@dataclass(frozen=True, slots=True)
class BagMessage:
    """A message of a bag: nested messages are mappings, arrays sequences, octets bytes or NumPy arrays."""

    topic: str
    type: str
    at_ns: Nanos
    message: Message


def is_bag(path: Path) -> bool:
    """Return whether a path looks like a bag: a folder with `metadata.yaml`, or a file with one of `SUFFIXES`."""
    return (path / METADATA).is_file() if path.is_dir() else path.suffix.lower() in SUFFIXES


def read_bag(path: Path, types: frozenset[str]) -> Iterator[BagMessage]:
    """Yield the messages of some types, in order of their recording.

    Args:
        path: The folder of a rosbag2, an `.mcap` or `.db3` of one, or the `.bag` of ROS 1.
        types: Names such as `nav_msgs/msg/Odometry`.

    Raises:
        MissingDependencyError: rosbags is not installed.
        FileError: It is none, or damaged.
    """
    try:
        from rosbags.highlevel import AnyReader
    except ImportError as error:
        raise MissingDependencyError(_NO_LIBRARY, extra="ros") from error
    try:
        with AnyReader([path], default_typestore=standard_types()) as bag:
            chosen = [one for one in bag.connections if one.msgtype in types]
            # Without any chosen, all would be yielded.
            for connection, at_ns, data in bag.messages(chosen) if chosen else ():
                message = cast("Message", _plain(bag.deserialize(data, connection.msgtype)))
                yield BagMessage(connection.topic, connection.msgtype, at_ns, message)
    except GeneratorExit:
        raise
    except Exception as error:  # whatever the library makes of hostile bytes, such as a length of terabytes
        raise FileError(
            f"{shown_name(path)} is no bag that can be read: {shown(str(error) or type(error).__name__)}",
            hint="a rosbag2 folder, .mcap or .db3 of ROS 2 messages, or a .bag",
        ) from error


def _plain(value: object) -> object:
    if is_dataclass(value):
        return {field.name: _plain(getattr(value, field.name)) for field in fields(value)}
    return [_plain(one) for one in value] if isinstance(value, list) else value
