"""Checks a TOML table against a list of keys, and reports in one line what is wrong.

A message names the file, the place in it and the key; an unknown key comes with
the nearest key that exists. Units stand in the key (`threshold_m`), so a value
is a bare number: `"60 cm"` is refused with the unit that is wanted.
"""

import difflib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal, Protocol, runtime_checkable

from p2os.errors import ScenarioError
from p2os.pioneer.world.model import RANGES
from simbase.errors import shown

#: chosen: eleven days; a larger number of seconds is a mistake of the unit.
LONGEST_S = 1_000_000

#: A parsed TOML table.
Table = Mapping[str, object]

Kind = Literal["text", "texts", "number", "whole", "flag", "table", "tables", "list"]

_MEANING = {
    "text": "a text in quotes",
    "texts": "a text in quotes, or a list of them",
    "number": "a number",
    "whole": "a whole number",
    "flag": "true or false",
    "table": "a table",
    "tables": "an array of tables",
    "list": "a list",
}

_TYPES: Mapping[Kind, tuple[type, ...]] = {
    "text": (str,),
    "number": (int, float),
    "whole": (int,),
    "flag": (bool,),
    "table": (dict,),
    "list": (list,),
}

_UNITS = {
    "_m": "metres", "_mm": "millimetres", "_mm_s": "mm/s", "_mm_s2": "mm/s²", "_deg": "degrees", "_deg_s": "deg/s",
    "_s": "seconds", "_ms": "milliseconds",
}  # fmt: skip


@dataclass(frozen=True, slots=True, kw_only=True)
class Key:
    """One key that a table may have.

    `least` and `most` are inclusive; `above` is not. `group` names the entry points that may stand there
    beside the choices, as may FILE.py:CLASS; the loader looks for them.
    """

    name: str
    kind: Kind
    required: bool = False
    least: float | None = None
    above: float | None = None
    most: float | None = None
    choices: tuple[str, ...] = ()
    group: str = ""


class Source(Protocol):
    """What names the places of a file's keys, or of several files'."""

    def at(self, table: str = "", key: str = "", number: int = 0) -> str:
        """Return `file:line` of a key."""
        ...


@runtime_checkable
class PartSource(Source, Protocol):
    """Names the places of a part of a file, whose lists hold some of the file's tables."""

    def number_of(self, table: str, number: int) -> int:
        """Return which of the file's tables of a list one of this part is."""
        ...


@dataclass(frozen=True, slots=True)
class Place:
    """Where a table stands, for messages: `dodge.toml:12: [[obstacle]] 2`."""

    source: Source
    table: str = ""
    number: int = 0
    title: str = ""

    def at(self, key: str = "") -> str:
        """Return the place with the line of a key, or of the table's header."""
        return self.source.at(self.table, key, self.number) + (f": {self.title}" if self.title else "")

    def __str__(self) -> str:
        """Return the place with the line of the table's header."""
        return self.at()


#: A place, or its words where there is no file.
Where = str | Place


def within(where: Where, table: str, number: int | None = None) -> Where:
    """Return the place of a table of a file: `[table]`, or the number-th `[[table]]`, counted from 0."""
    listed = number or 0
    if isinstance(where, Place) and isinstance(where.source, PartSource):
        listed = where.source.number_of(table, listed)
    title = f"[{table}]" if number is None else f"[[{table}]] {listed + 1}"
    if isinstance(where, str):
        return f"{where}: {title}"
    return Place(where.source, table, number or 0, title)


def in_range(name: str, *, required: bool = False) -> Key:
    """Return the key for a number that has the same name and range in a world file."""
    least, most = RANGES[name]
    return Key(name=name, kind="number", required=required, least=least, most=most)


def check_table(table: Table, keys: Sequence[Key], where: Where) -> None:
    """Check a table.

    Args:
        table: What was read.
        keys: What may stand in it.
        where: File and place, for the message.

    Raises:
        ScenarioError: A key is unknown, missing or has a value of the wrong kind or range.
    """
    known = {key.name: key for key in keys}
    for name in table:
        if name not in known:
            raise ScenarioError(f"{_at(where, name)}: unknown key {shown(name)}", hint=nearest(name, known))
    for key in keys:
        if key.name in table:
            _check_value(table[key.name], key, _at(where, key.name))
        elif key.required:
            raise ScenarioError(f"{where}: key {key.name!r} is missing", hint=_wanted(key))


def nearest(word: str, known: Mapping[str, object] | Sequence[str]) -> str:
    """Return a hint: the nearest of the known words, or all of them."""
    close = difflib.get_close_matches(word, list(known), n=1, cutoff=0.5)
    return f"did you mean {close[0]!r}?" if close else f"known are {', '.join(sorted(known))}"


def _check_value(value: object, key: Key, where: str) -> None:
    if not _fits(value, key):
        raise ScenarioError(f"{where}: {key.name} = {_shown(value)} is not {_wanted(key)}", hint=_hint(value, key))
    if key.choices and not key.group and value not in key.choices:
        hint = nearest(str(value), key.choices)
        raise ScenarioError(f"{where}: {key.name} = {_shown(value)} is none of {', '.join(key.choices)}", hint=hint)
    if isinstance(value, (int, float)) and not isinstance(value, bool):
        low = (key.least is not None and value < key.least) or (key.above is not None and value <= key.above)
        if low or (key.most is not None and value > key.most) or value != value:  # noqa: PLR0124 - not a number
            raise ScenarioError(f"{where}: {key.name} = {_shown(value)} is out of range", hint=f"it is {_wanted(key)}")


def _fits(value: object, key: Key) -> bool:
    if key.kind == "tables":
        return isinstance(value, list) and all(isinstance(item, Mapping) for item in value)
    if key.kind == "texts":
        return isinstance(value, str) or (isinstance(value, list) and all(isinstance(item, str) for item in value))
    if isinstance(value, bool):
        return key.kind == "flag"
    return isinstance(value, _TYPES[key.kind])


def _wanted(key: Key) -> str:
    meaning = _MEANING[key.kind]
    unit = max((suffix for suffix in _UNITS if key.name.endswith(suffix)), key=len, default="")
    if unit and key.kind in {"number", "whole"}:
        meaning += f" of {_UNITS[unit]}"
    if key.above is not None:
        meaning += f" above {key.above:g}"
    if key.least is not None:
        meaning += f", at least {key.least:g}"
    if key.most is not None:
        meaning += f", at most {key.most:g}"
    if key.choices:
        meaning = "one of " + ", ".join(key.choices) + (", or FILE.py:CLASS" if key.group else "")
    return meaning


def _hint(value: object, key: Key) -> str | None:
    if isinstance(value, str) and key.kind in {"number", "whole"}:
        return "the unit stands in the key; write the bare number"
    return None


def _shown(value: object) -> str:
    text = shown(value)
    return f'"{text[1:-1]}"' if isinstance(value, str) and text[-1] == "'" else text


def _at(where: Where, key: str) -> str:
    return where if isinstance(where, str) else where.at(key)
