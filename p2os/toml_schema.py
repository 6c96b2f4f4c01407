"""Checks a TOML table against a list of keys, and reports in one line what is wrong.

A message names the file, the place in it and the key; an unknown key comes with
the nearest key that exists. Units stand in the key (`threshold_m`), so a value
is a bare number: `"60 cm"` is refused with the unit that is wanted.
"""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, Literal, Protocol, cast, overload, runtime_checkable

from p2os.errors import ScenarioError
from simbase.entry_points import installed_points
from simbase.errors import FileError, MissingDependencyError, P2osError, nearest, shown

#: chosen: eleven days; a larger number of seconds is a mistake of the unit.
LONGEST_S = 1_000_000

#: A parsed TOML table.
Table = Mapping[str, object]

Kind = Literal[
    "any", "text", "texts", "line", "ascii", "number", "numbers", "points", "whole", "flag", "table", "tables", "list"
]  # fmt: skip

_MEANING = {
    "any": "a value",
    "text": "a text in quotes",
    "texts": "a text in quotes, or a list of them",
    "line": "a line of printable characters in quotes",
    "ascii": "a line of printable ASCII characters in quotes",
    "number": "a number",
    "numbers": "a list of numbers",
    "points": "a list of lists of numbers",
    "whole": "a whole number",
    "flag": "true or false",
    "table": "a table",
    "tables": "an array of tables",
    "list": "a list",
}

_TYPES: Mapping[Kind, tuple[type, ...]] = {
    "text": (str,),
    "line": (str,),
    "ascii": (str,),
    "number": (int, float),
    "whole": (int,),
    "table": (dict,),
    "list": (list,),
    "numbers": (list, tuple),
    "points": (list, tuple),
}

_UNITS = {
    "_m": "metres", "_mm": "millimetres", "_mm_s": "mm/s", "_mm_s2": "mm/s²", "_deg": "degrees", "_deg_s": "deg/s",
    "_s": "seconds", "_ms": "milliseconds", "_mps": "metres a second", "_kg": "kilograms",
}  # fmt: skip


@dataclass(frozen=True, slots=True, kw_only=True)
class Key:
    """One key that a table may have.

    `least` and `most` are inclusive; `above` is not; of a line, `most` is how long it may be. `count` is how many
    numbers stand in a list of them, each within the range. `default` is what `filled` puts where there is none.
    `group` names the entry points that may stand there beside the choices, as may FILE.py:CLASS; the loader looks
    for them.
    """

    name: str
    kind: Kind
    required: bool = False
    least: float | None = None
    above: float | None = None
    most: float | None = None
    count: int = 0
    choices: tuple[str, ...] = ()
    group: str = ""
    default: object = None


class KeyPlaces(Protocol):
    """What names the places of a file's keys, or of several files'."""

    def at(self, table: str = "", key: str = "", number: int = 0) -> str:
        """Return `file:line` of a key."""
        ...


@runtime_checkable
class PartSource(KeyPlaces, Protocol):
    """Names the places of a part of a file, whose lists hold some of the file's tables."""

    def number_of(self, table: str, number: int) -> int:
        """Return which of the file's tables of a list one of this part is."""
        ...


@dataclass(frozen=True, slots=True)
class TablePlace:
    """Where a table stands, for messages: `dodge.toml:12: [[obstacle]] 2`."""

    source: KeyPlaces
    table: str = ""
    number: int = 0
    title: str = ""
    #: What is raised.
    error: type[FileError] = ScenarioError

    def at(self, key: str = "") -> str:
        """Return the place with the line of a key, or of the table's header."""
        return self.source.at(self.table, key, self.number) + (f": {self.title}" if self.title else "")

    def __str__(self) -> str:
        """Return the place with the line of the table's header."""
        return self.at()


#: A place, or its words where there is no file.
Where = str | TablePlace


@overload
def within(where: TablePlace, table: str, number: int | None = None) -> TablePlace: ...
@overload
def within(where: Where, table: str, number: int | None = None) -> Where: ...
def within(where: Where, table: str, number: int | None = None) -> Where:
    """Return the place of a table of a file: `[table]`, or the number-th `[[table]]`, counted from 0."""
    listed = number or 0
    if isinstance(where, TablePlace) and isinstance(where.source, PartSource):
        listed = where.source.number_of(table, listed)
    title = f"[{table}]" if number is None else f"[[{table}]] {listed + 1}"
    if isinstance(where, str):
        return f"{where}: {title}"
    return TablePlace(where.source, table, number or 0, title, where.error)


def check_table(table: Table, keys: Sequence[Key], where: Where) -> None:
    """Check a table.

    Args:
        table: What was read.
        keys: What may stand in it.
        where: File and place, for the message.

    Raises:
        FileError: A key is unknown, missing or has a value of the wrong kind or range; of the kind that `where` has.
    """
    known, error = {key.name: key for key in keys}, ScenarioError if isinstance(where, str) else where.error
    for name in table:
        if name not in known:
            hint = nearest(name, known) if known else "the table has no keys"
            raise error(f"{_at(where, name)}: unknown key {shown(name)}", hint=hint)
    for key in keys:
        if key.name in table:
            _check_value(table[key.name], key, _at(where, key.name), error)
        elif key.required:
            raise error(f"{where}: key {key.name!r} is missing", hint=_wanted(key))


def filled(table: Table, keys: Sequence[Key], where: Where) -> dict[str, Any]:
    """Check a table, and return the value or the default of every key.

    Raises:
        FileError: As `check_table`.
    """
    check_table(table, keys, where)
    return {key.name: table.get(key.name, key.default) for key in keys}


@contextmanager
def placed(where: Where, key: str = "") -> Iterator[None]:
    """Put the place of a key, or of its table, before what is raised about its value.

    Raises:
        FileError: Instead of any error of ours but one of something that is not installed; of the kind of `where`.
    """
    try:
        yield
    except MissingDependencyError:
        raise
    except P2osError as error:
        made = ScenarioError if isinstance(where, str) else where.error
        raise made(f"{_at(where, key)}: {error}", hint=error.hint) from error


def _check_value(value: object, key: Key, where: str, error: type[FileError]) -> None:
    if not _fits(value, key):
        raise error(f"{where}: {key.name} = {_shown(value)} is not {_wanted(key)}", hint=_hint(value, key))
    if key.choices and not key.group and value not in key.choices:
        hint = nearest(str(value), key.choices)
        raise error(f"{where}: {key.name} = {_shown(value)} is none of {', '.join(key.choices)}", hint=hint)
    for number in _numbers(value):
        low = (key.least is not None and number < key.least) or (key.above is not None and number <= key.above)
        if low or (key.most is not None and number > key.most) or number != number:  # noqa: PLR0124 - not a number
            raise error(f"{where}: {key.name} = {_shown(number)} is out of range", hint=f"it is {_wanted(key)}")


def _fits(value: object, key: Key) -> bool:
    if key.kind in {"any", "flag"}:
        return key.kind == "any" or isinstance(value, bool)
    if isinstance(value, bool) or not isinstance(value, _TYPES.get(key.kind, (object,))):
        return False
    if key.kind in {"line", "ascii"}:
        text = str(value)
        return text.isprintable() and len(text) <= cast("float", key.most) and (key.kind == "line" or text.isascii())
    if key.kind == "texts":
        return isinstance(value, str) or (isinstance(value, list) and all(isinstance(item, str) for item in value))
    if key.kind == "tables":
        return isinstance(value, list) and all(isinstance(item, Mapping) for item in value)
    rows = [value] if key.kind == "numbers" else value if key.kind == "points" else ()
    return all(
        isinstance(row, (list, tuple))
        and len(row) == key.count
        and all(isinstance(item, (int, float)) and not isinstance(item, bool) for item in row)
        for row in cast("Sequence[object]", rows)
    )


def _numbers(value: object) -> Iterator[float]:
    """Yield the numbers of a value that fits."""
    if isinstance(value, (int, float)) and not isinstance(value, bool):
        yield value
    elif isinstance(value, (list, tuple)):
        for item in value:
            yield from _numbers(item)


def _wanted(key: Key) -> str:
    meaning = _MEANING[key.kind]
    unit = max((suffix for suffix in _UNITS if key.name.endswith(suffix)), key=len, default="")
    if key.count:
        meaning = meaning.replace("numbers", f"{key.count} numbers")
    if unit and "number" in meaning:
        meaning += f" of {_UNITS[unit]}"
    if key.above is not None:
        meaning += f" above {key.above:g}"
    if key.least is not None:
        meaning += f", at least {key.least:g}"
    if key.most is not None:
        meaning += f", at most {key.most:g}" + (" of them" if key.kind in {"line", "ascii"} else "")
    if key.choices:
        installed = [name for name in installed_points(key.group) if name not in key.choices] if key.group else []
        meaning = "one of " + ", ".join((*key.choices, *installed)) + (", or FILE.py:CLASS" if key.group else "")
    return meaning


def _hint(value: object, key: Key) -> str | None:
    if isinstance(value, str) and key.kind in {"number", "whole"}:
        return "the unit stands in the key; write the bare number"
    return f"it is written as [[{key.name}]]" if key.kind == "tables" else None


def _shown(value: object) -> str:
    """Return a value as it stands in TOML."""
    text = shown(value).lower() if isinstance(value, bool) else shown(value)
    return f'"{text[1:-1]}"' if isinstance(value, str) and text[-1] == "'" else text


def _at(where: Where, key: str) -> str:
    return where if isinstance(where, str) else where.at(key)
