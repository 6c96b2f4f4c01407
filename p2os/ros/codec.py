"""Messages to bytes and back: the CDR of the wire, by cyclonedds' own serialiser, for both transports.

A message is a mapping of its fields' names; nested ones are mappings too, arrays are sequences. What is left out is
zero, empty or false. The bytes are XCDR version 1, little endian, with the four bytes of encapsulation before them, as
every rmw writes them.

Source: OMG DDS-XTypes 1.3, 7.4 (plain CDR); the rmw sources have the mapping of names.

Invariant: `from_cdr(name, to_cdr(name, message))` has every field of `message`.
"""

from collections.abc import Mapping, Sequence
from functools import cache
from typing import Protocol, Self, TypeAlias, cast

from p2os.errors import MissingDependencyError, RemoteProtocolError
from p2os.ros.message_table import MessageField, message_type

#: A message: what each field holds.
Message: TypeAlias = Mapping[str, object]

#: Primitive of ROS IDL → its type in cyclonedds, and its zero.
_PRIMITIVES: Mapping[str, tuple[str, object]] = {
    "bool": ("bool", False), "byte": ("uint8", 0), "char": ("uint8", 0), "uint8": ("uint8", 0),
    "int32": ("int32", 0), "uint32": ("uint32", 0), "float32": ("float32", 0.0), "float64": ("float64", 0.0),
    "string": ("str", ""),
}  # fmt: skip
#: Of these a sequence is bytes.
_OCTETS = frozenset({"byte", "char", "uint8"})


class MessageStruct(Protocol):
    """A message as cyclonedds has it."""

    def serialize(self) -> bytes:
        """Return its bytes."""
        ...

    @classmethod
    def deserialize(cls, data: bytes) -> Self:
        """Return the message of some bytes."""
        ...


def to_cdr(name: str, message: Message) -> bytes:
    """Return the bytes of a message.

    Raises:
        MissingDependencyError: cyclonedds or rosbags is not installed.
        KeyError: There is no such type, or the message has a field that the type has not.
    """
    return struct_of(name, message).serialize()


def from_cdr(name: str, data: bytes) -> Message:
    """Return the message of some bytes.

    Raises:
        MissingDependencyError: cyclonedds or rosbags is not installed.
        RemoteProtocolError: They are no such message.
    """
    try:
        return message_of(name, struct_class(name).deserialize(data))
    except MissingDependencyError:
        raise
    except Exception as error:  # whatever the serialiser makes of hostile bytes
        raise RemoteProtocolError(f"{len(data)} bytes are no {name}: {error}") from error


def struct_of(name: str, message: Message) -> MessageStruct:
    """Return a message as cyclonedds takes it.

    Raises:
        MissingDependencyError, KeyError: As `to_cdr`.
    """
    known = message_type(name).fields
    unknown = message.keys() - known.keys()
    if unknown:
        raise KeyError(f"{name} has no {', '.join(sorted(unknown))}")
    values = {
        field.name: _to_struct(field, message[field.name]) if field.name in message else _zero(field)
        for field in known.values()
    }
    return struct_class(name)(**values)


def message_of(name: str, struct: MessageStruct) -> Message:
    """Return what a struct holds."""
    return {
        field.name: _from_struct(field, getattr(struct, field.name)) for field in message_type(name).fields.values()
    }


@cache
def struct_class(name: str) -> type[MessageStruct]:
    """Return the class of cyclonedds for a type.

    Raises:
        MissingDependencyError: cyclonedds or rosbags is not installed.
        KeyError: There is no such type.
    """
    try:
        from cyclonedds.idl import make_idl_struct, types
    except ImportError as error:
        raise MissingDependencyError("ROS 2 messages need cyclonedds", extra="ros") from error
    row = message_type(name)
    arrays = vars(types)  # generic at run time only

    def kind_of(field: MessageField) -> object:
        primitive = _PRIMITIVES.get(field.kind)
        if primitive is None:
            kind: object = struct_class(field.kind)
        else:
            kind = {"bool": bool, "str": str}.get(primitive[0]) or getattr(types, primitive[0])
        if field.count is None:
            return kind
        return arrays["sequence"][kind] if field.count == 0 else arrays["array"][kind, field.count]

    fields = {field.name: kind_of(field) for field in row.fields.values()}
    return cast("type[MessageStruct]", make_idl_struct(name.rpartition("/")[2] + "_", row.dds_name, fields))


def _to_struct(field: MessageField, value: object) -> object:
    if field.kind in _PRIMITIVES:
        return value if field.count is None else list(cast("Sequence[object]", value))
    if field.count is None:
        return struct_of(field.kind, cast("Message", value))
    return [struct_of(field.kind, one) for one in cast("Sequence[Message]", value)]


def _from_struct(field: MessageField, value: object) -> object:
    if field.kind in _PRIMITIVES:
        if field.count is not None and field.kind in _OCTETS:
            return bytes(cast("Sequence[int]", value))
        return value if field.count is None else list(cast("Sequence[object]", value))
    if field.count is None:
        return message_of(field.kind, cast("MessageStruct", value))
    return [message_of(field.kind, one) for one in cast("Sequence[MessageStruct]", value)]


def _zero(field: MessageField) -> object:
    if field.count == 0:
        return []
    primitive = _PRIMITIVES.get(field.kind)
    zero = struct_of(field.kind, {}) if primitive is None else primitive[1]
    return zero if field.count is None else [zero] * field.count
