"""The bytes of a client command in words: number, type byte, argument."""

from collections.abc import Iterator

from p2os.commands import NEGATIVE, POSITIVE, STRING, Command
from p2os.trace.describe import printable
from p2os.wire import Frame

Span = tuple[bytes, str, str]
_TYPES = {
    POSITIVE: "integer, to be taken as it is",
    NEGATIVE: "integer, to be taken negative",
    STRING: "string, its length first",
}


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
