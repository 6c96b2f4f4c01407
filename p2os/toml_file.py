"""TOML files of users: read within bounds, with the line of each key, so that an error can name it; and written.

`tomllib` gives values without places. `find_places` reads a text that `tomllib` has
accepted, so it need not check anything: it only tells tables, keys and the ends
of values that run over several lines apart. A byte order mark is passed over.

Not found: keys inside inline tables, and quoted keys with dots or escapes in them; they get
the line of what holds them.
"""

import re
import tomllib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from simbase.errors import FileError
from simbase.files import VersionedFormat, read_text

_HEADER = re.compile(r"\s*(\[\[?)\s*([^\]]+?)\s*\]\]?\s*(?:#.*)?$")
_KEY = re.compile(r"\s*([A-Za-z0-9_.\-\"']+)\s*=")
#: A part of a name in quotes.
_QUOTED = re.compile(r"\"([^\"]*)\"|'([^']*)'")
#: A key that needs no quotes.
_BARE = re.compile(r"[A-Za-z0-9_-]+")
#: What can begin or end inside a value: strings, comments, brackets.
_TOKEN = re.compile(r'"""|\'\'\'|"(?:\\.|[^"\\\n])*"|\'[^\'\n]*\'|#[^\n]*|[\[\]{}]')
#: `tomllib` ends its messages so.
_AT = re.compile(r"^(?P<what>.*) \(at (?:line (?P<line>\d+), column \d+|end of document)\)$", re.DOTALL)


@dataclass(slots=True)
class TomlPlaces:
    """The lines of a TOML text's tables and keys, counted from 1."""

    #: (table, number of the table among those of its name, key or "") → line.
    lines: dict[tuple[str, int, str], int] = field(default_factory=dict)

    def line(self, table: str = "", number: int = 0, key: str = "") -> int:
        """Return the line of a key, or of what holds it: its table's header, or the key of an inline table; or 1.

        The line of a key that is a table itself is that of its header.
        """
        header = (f"{table}.{key}".removeprefix("."), 0, "")
        line = self.lines.get((table, number, key)) or self.lines.get(header) or self.lines.get((table, number, ""))
        if line or not table:
            return line or 1
        parent, _, name = table.rpartition(".")
        return self.line(parent, 0, name)


def read_user_text(path: Path, what: str, error_type: type[FileError], *, hint: str | None = None) -> str:
    """Return the text of a file that a user names, without a byte order mark.

    Args:
        path: The file.
        what: What it should be, such as "a world".
        error_type: What to raise.
        hint: What to try where there is no such file.

    Raises:
        FileError: One of `error_type`: the file cannot be read, is too large or is no text.
    """
    return read_text(path, error_type, hint=hint or f"{what} is a TOML file")


def is_file(path: Path) -> bool:
    """Tell whether a file is there; a name that no file can have is not."""
    try:
        return path.is_file()
    except (OSError, ValueError):  # longer than the system allows, or with a NUL in it
        return False


def is_folder(path: Path) -> bool:
    """Tell whether a folder is there; a name that no folder can have is not."""
    try:
        return path.is_dir()
    except (OSError, ValueError):  # as above
        return False


def find_places(text: str) -> TomlPlaces:
    """Return the places of a text that is valid TOML."""
    found = TomlPlaces()
    table, number, depth, closing = "", 0, 0, ""
    counts: dict[str, int] = {}
    for line_number, line in enumerate(text.split("\n"), start=1):
        rest = line
        if not depth and not closing:
            header = _HEADER.match(line)
            if header is not None and "=" not in header[2]:
                table = _QUOTED.sub(r"\1\2", header[2])
                number = counts.get(table, -1) + 1 if header[1] == "[[" else 0
                counts[table] = number
                found.lines[table, number, ""] = line_number
                continue
            key = _KEY.match(line)
            if key is None:
                continue
            name = _QUOTED.sub(r"\1\2", key[1])
            found.lines[table, number, name] = line_number
            found.lines.setdefault((table, number, name.split(".")[0]), line_number)
            rest = line[key.end() :]
        depth, closing = _after(rest, depth, closing)
    return found


@dataclass(frozen=True, slots=True)
class TomlSource:
    """What a message calls a file, and the places in it; None where it was never a file."""

    name: str
    places: TomlPlaces | None = None

    def at(self, table: str = "", key: str = "", number: int = 0) -> str:
        """Return `file:line` of a key, or the name alone where there are no lines."""
        return self.name if self.places is None else f"{self.name}:{self.places.line(table, number, key)}"


def read_toml(
    text: str, source: str, what: str | VersionedFormat, error_type: type[FileError]
) -> tuple[dict[str, Any], TomlPlaces]:  # fmt: skip
    """Return a text's table and the places of its keys.

    Args:
        text: The file's text.
        source: What to call it in messages.
        what: What it should be, such as "a pin-out"; a format has its key `version` checked before any other.
        error_type: What to raise.

    Raises:
        FileError: One of `error_type`: the text is no TOML, or of a later version; the message names the source and
            the line.
    """
    table, places = _parsed(
        text.removeprefix("\ufeff"), source, what if isinstance(what, str) else what.name, error_type
    )
    if isinstance(what, VersionedFormat):
        what.version_of(table.get("version"), f"{source}:{places.line(key='version')}", error_type)
    return table, places


def _parsed(text: str, source: str, what: str, error_type: type[FileError]) -> tuple[dict[str, Any], TomlPlaces]:
    try:
        return tomllib.loads(text), find_places(text)
    except tomllib.TOMLDecodeError as error:
        complaint, line = line_of_error(str(error), text)
        raise error_type(f"{source}:{line}: {complaint}", hint="the file is not TOML") from error
    except ValueError as error:  # a number of more digits than Python reads
        raise error_type(f"{source}:1: {error}", hint=f"the file is not {what}") from error
    except RecursionError as error:
        raise error_type(f"{source}:1: nested too deeply", hint=f"the file is not {what}") from error


def line_of_error(message: str, text: str) -> tuple[str, int]:
    """Return what `tomllib` complains of, and the line."""
    match = _AT.match(message)
    if match is None:
        return message, 1
    return match["what"], int(match["line"]) if match["line"] else text.count("\n") + 1


def toml_text(table: Mapping[str, object]) -> str:
    """Return the text of a TOML file that is read back as an equal table.

    Args:
        table: Texts, numbers, flags, lists and tables; no None.

    Raises:
        TypeError: It holds something else.
    """
    return "".join(_tables(table, ""))


def toml_value(value: object) -> str:
    """Return a value as it stands behind `KEY =`, a table within braces; numbers with every digit.

    Raises:
        TypeError: TOML has no such value.
    """
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return _quoted(value)
    if isinstance(value, (int, float)):
        return repr(value)
    if isinstance(value, (list, tuple)):
        return f"[{', '.join(map(toml_value, value))}]"
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{_key(key)} = {toml_value(item)}" for key, item in value.items()) + "}"
    raise TypeError(f"TOML has no {type(value).__name__}")


def _tables(table: Mapping[str, object], above: str) -> Iterator[str]:
    """Yield the lines of a table: what is no table first, since a header ends what stands before it."""
    inner = {key: value for key, value in table.items() if isinstance(value, Mapping) or _is_tables(value)}
    for key, value in table.items():
        if key not in inner:
            yield f"{_key(key)} = {toml_value(value)}\n"
    for key, value in inner.items():
        name = f"{above}.{_key(key)}".removeprefix(".")
        if isinstance(value, Mapping):
            yield f"\n[{name}]\n"
            yield from _tables(value, name)
        elif isinstance(value, (list, tuple)):
            for item in value:
                yield f"\n[[{name}]]\n"
                yield from _tables(item, name)


def _is_tables(value: object) -> bool:
    return isinstance(value, (list, tuple)) and bool(value) and all(isinstance(item, Mapping) for item in value)


def _key(key: str) -> str:
    return key if _BARE.fullmatch(key) else _quoted(key)


def _quoted(value: str) -> str:
    """Return a text in quotes, with what TOML does not take as it is escaped."""
    escaped = value.replace("\\", "\\\\").replace('"', '\\"')
    return '"' + "".join(c if c >= " " and c != "\x7f" else f"\\u{ord(c):04x}" for c in escaped) + '"'


def _after(text: str, depth: int, closing: str) -> tuple[int, str]:
    """Return how deep in brackets, and in which long string, a value is at the end of a line."""
    place = 0
    while True:
        if closing:
            end = text.find(closing, place)
            if end < 0:
                return depth, closing
            place, closing = end + 3, ""
        token = _TOKEN.search(text, place)
        if token is None:
            return depth, closing
        place = token.end()
        if token[0] in {'"""', "'''"}:
            closing = token[0]
        elif token[0] in "[{":
            depth += 1
        elif token[0] in "]}":
            depth -= 1
