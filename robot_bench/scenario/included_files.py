"""A scenario's table, put together from the files that it names and from what a command line sets.

    extends = "base.toml"              a scenario that ships, or a file: what it says holds where this file says nothing
    include = ["posts.toml"]           files whose keys count as if they stood here

Tables are merged key by key; this file's own value counts, then that of the last file named. Of lists of tables
(`[[goal]]`, `[[obstacle]]`, …) those of included files and this file's own follow each other, and both together take
the place of the list of the file that is extended. `--set start.x_m=1.5` sets a key after all that; a table of a list
is named by its number, counted from 1, or by its `name`: `goal.2.least_m`, `robot.left.x_m`.

A file that is named in an included file is looked for beside that one.

Invariant: of each key that a message may name, the file and line are those where it was set.
"""

import json
import os
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from importlib.resources import as_file, files
from pathlib import Path
from typing import Annotated, TypeGuard

from p2os.errors import ScenarioError
from p2os.toml_file import TomlSource, is_file, read_toml, read_user_text
from p2os.toml_record import Record, read_part
from p2os.toml_schema import Key, Table, TablePlace
from simbase.errors import UsageError, nearest, shown, shown_name
from simbase.files import VersionedFormat

SCENARIO = VersionedFormat("a scenario")
#: chosen: what a person keeps in his head is less, and files that include each other twice each come to it soon.
MOST_FILES = 64
#: Keys whose value may be a file, by the table that they stand in; `robot` of a `[[robot]]` too.
FILES: Mapping[str, tuple[str, ...]] = {
    "": ("firmware", "world", "robot"), "controller": ("errors", "flash"), "robot": ("firmware", "model"),
}  # fmt: skip
#: Keys that name files, which are put together before any key is set.
NAMING = ("extends", "include")
#: Key and value, as of `--set`.
Setting = tuple[str, object]


class IncludeTable(Record):
    """What a file says of itself and of others; none that names another is left in the table that is put together."""

    version: Annotated[int, Key(
        least=1, most=SCENARIO.newest, doc="of these keys; a file for a later version is refused"
    )] = SCENARIO.newest  # fmt: skip
    extends: Annotated[str | None, Key(
        doc="a scenario that ships, or a file: [what it says](#files-of-files) holds where this one says nothing"
    )] = None  # fmt: skip
    include: Annotated[tuple[str, ...], Key(
        doc='files whose keys count as if they stood here: `"posts.toml"`, or a list'
    )] = ()  # fmt: skip


@dataclass(frozen=True, slots=True)
class _Part:
    """A file, and where the tables of its lists have come to."""

    source: TomlSource
    #: List → how many tables stand before the first of this file.
    shifts: Mapping[str, int] = field(default_factory=dict)
    #: Lists that do not count any more.
    hidden: frozenset[str] = frozenset()

    def shifted(self, by: Mapping[str, int]) -> "_Part":
        """Return the part behind so many tables more of some lists."""
        shifts = {**self.shifts, **{name: self.shifts.get(name, 0) + count for name, count in by.items()}}
        return _Part(self.source, shifts, self.hidden)

    def at(self, table: str, key: str, number: int, *, exactly: bool) -> str | None:
        """Return `file:line` of a key, or None where it is not this file's; else of what holds it."""
        own = number - self.shifts.get(table, 0)
        places = self.source.places
        if places is None or table in self.hidden or (not table and key in self.hidden):
            return None
        lines = places.lines
        found = (table, own, key) in lines or (f"{table}.{key}".removeprefix("."), 0, "") in lines
        if not exactly:
            parent, _, name = table.rpartition(".")
            found = found or (table, own, "") in lines or (bool(table) and (parent, 0, name) in lines)
        return self.source.at(table, key, own) if found else None


@dataclass(frozen=True, slots=True)
class MergedSource:
    """What a message calls the files of a scenario, and the places in them."""

    #: The file that was asked for last, its name alone where a key stands nowhere.
    parts: tuple[_Part, ...]
    #: (table, number, key) → what set it.
    settings: Mapping[tuple[str, int, str], str] = field(default_factory=dict)

    @classmethod
    def of(cls, source: TomlSource) -> "MergedSource":
        """Return what names the places of tables that come from one file, or from none."""
        return cls((_Part(source),))

    def at(self, table: str = "", key: str = "", number: int = 0) -> str:
        """Return `file:line` of a key, or of what holds it; or the option that set it."""
        set_by = self.settings.get((table, number, key))
        if set_by is not None:
            return set_by
        for exactly in (True, False):
            for part in reversed(self.parts):
                found = part.at(table, key, number, exactly=exactly)
                if found is not None:
                    return found
        return self.parts[-1].source.at()


@dataclass(frozen=True, slots=True, kw_only=True)
class ScenarioTable:
    """What a scenario's files say, all together."""

    table: Table
    source: MergedSource
    #: The text of each file, the one that was asked for last.
    text: str


@dataclass(slots=True, kw_only=True)
class _Read:
    """What was read of a file and all that it names."""

    table: dict[str, object]
    parts: tuple[_Part, ...]
    texts: tuple[str, ...]


def shipped_scenarios() -> tuple[str, ...]:
    """Return the names of the scenarios that ship."""
    folder = files("robot_bench.scenarios")
    return tuple(sorted(item.name.removesuffix(".toml") for item in folder.iterdir() if item.name.endswith(".toml")))


def shipped_file(name: str) -> Path:
    """Return the file of a scenario that ships."""
    with as_file(files("robot_bench.scenarios").joinpath(f"{name}.toml")) as path:
        return path


def read_tables(path: Path, settings: Sequence[Setting] = (), set_by: str = "--set") -> ScenarioTable:
    """Read a scenario's file and all that it names.

    Args:
        path: The file.
        settings: What is set beside, the later last.
        set_by: What a message calls that.

    Raises:
        ScenarioError: A file cannot be read or is no TOML, or files include each other in a circle.
        UsageError: A setting names a table of a list that is not there, or a file.
    """
    found = _read(path, path.parent, (), [0])
    places: dict[tuple[str, int, str], str] = {}
    for key, value in settings:
        places[set_key(found.table, key, value)] = f"{set_by} {key}"
    texts = [text.partition("\n")[2] for text in found.texts]
    if len(found.texts) > 1:
        texts = [f"# {text}" for text in found.texts]
    text = "\n".join([*texts, *(f"# {set_by} {key}={as_toml(value)}" for key, value in settings)])
    return ScenarioTable(table=found.table, source=MergedSource(found.parts, places), text=text)


def as_toml(value: object, *, is_inside: bool = False) -> str:
    """Return a value as one types it behind `--set KEY=`; within a list or a table texts have quotes."""
    if isinstance(value, list):
        return f"[{', '.join(as_toml(one, is_inside=True) for one in value)}]"
    if isinstance(value, dict):
        return f"{{{', '.join(' = '.join(as_toml(one, is_inside=True) for one in row) for row in value.items())}}}"
    if isinstance(value, bool) or (isinstance(value, str) and (is_inside or parsed(value.strip()) != value)):
        return json.dumps(value, ensure_ascii=False)
    return str(value)


def parsed(text: str) -> object:
    """Return the value that a person means: one of TOML's, or the text as it stands."""
    try:
        found = tomllib.loads(f"value = {text}")
    except (tomllib.TOMLDecodeError, ValueError, RecursionError):
        return text
    return found["value"] if len(found) == 1 else text


def read_setting(text: str) -> Setting:
    """Return key and value of `KEY=VALUE`.

    Raises:
        UsageError: There is no `=`, or no key before it.
    """
    key, equals, value = text.partition("=")
    if not equals or not all(part.strip() for part in key.split(".")):
        raise UsageError(f"--set {shown(text)} is no KEY=VALUE", hint="such as --set start.x_m=1.5")
    return key.strip(), parsed(value.strip())


def set_key(table: dict[str, object], key: str, value: object) -> tuple[str, int, str]:
    """Set a key of a scenario's tables, as `--set` does; return which it is: (table, number, key).

    Args:
        table: Changed in place.
        key: With dots: `start.x_m`, `goal.2.least_m`, `obstacle.post.x_m`.
        value: What TOML can hold.

    Raises:
        UsageError: It names a table of a list that is not there, goes through what is no table, or is of `NAMING`.
    """
    held, name, number = table, "", 0
    *path, last = key.split(".")
    if (first := key.partition(".")[0]) in NAMING:
        raise UsageError(f"--set {key}: files are named in the scenario's own file",
                         hint=f'a file of your own with {first} = "..."')  # fmt: skip
    while path:
        word = path.pop(0)
        inner = held.setdefault(word, {})
        name, number = f"{name}.{word}".removeprefix("."), 0
        if isinstance(inner, list) and path:
            number = _number(inner, path.pop(0), key)
            inner = inner[number]
        if not isinstance(inner, dict):
            raise UsageError(f"--set {key}: {shown(word)} is no table with keys", hint="docs/scenarios.md has the keys")
        held = inner
    held[last] = value
    return name, number, last


def _read(path: Path, folder: Path, above: tuple[Path, ...], count: list[int]) -> _Read:
    """Read a file and what it names; `above` are the files that led to it, `folder` that of the first."""
    count[0] += 1
    is_far = bool(above) and path != shipped_file(path.stem)
    name = shown_name(os.path.relpath(path, folder) if is_far else path.name)
    if count[0] > MOST_FILES:
        raise ScenarioError(f"{shown_name(above[0].name)} includes more than {MOST_FILES} files")
    text = read_user_text(path, "a scenario", ScenarioError)
    table, places = read_toml(text, name, SCENARIO, ScenarioError)
    place = TablePlace(TomlSource(name, places))
    own, _ = read_part(IncludeTable, table, place)
    table = {name: value for name, value in table.items() if name not in NAMING}
    seen_from(table, path.parent, folder)
    found = _Read(table=table, parts=(_Part(TomlSource(name, places)),), texts=(f"{name}:\n{text}",))
    here = (*above, path)
    for other in reversed(own.include):
        found = _merged(_read(_named(other, here, place.at("include"), "include"), folder, here, count), found)
    if own.extends is not None:
        base = _read(_named(own.extends, here, place.at("extends"), "extends"), folder, here, count)
        found = _merged(base, found, is_replaced=True)
    return found


def _named(name: str, here: tuple[Path, ...], at: str, key: str) -> Path:
    """Return the file that another one names.

    Raises:
        ScenarioError: There is none, or it is one of those that led here.
    """
    path = here[-1].parent / name
    if not is_file(path):
        if name not in shipped_scenarios():
            raise ScenarioError(
                f"{at}: {key}: there is no file {shown(name)} beside it, nor a scenario of that name that ships",
                hint=nearest(name, shipped_scenarios()),
            )
        path = shipped_file(name)
    same = next((number for number, other in enumerate(here) if other.resolve() == path.resolve()), None)
    if same is not None:
        circle = " includes ".join(shown_name(other.name) for other in (*here[same:], path))
        raise ScenarioError(f"{at}: {key}: {circle}", hint="a file cannot include itself")
    return path


def seen_from(table: dict[str, object], there: Path, folder: Path) -> None:
    """Name the files that a scenario's table names, and that stand beside it, as seen from another folder."""
    for name_of, keys in FILES.items():
        _look_beside(table, name_of, keys, there, folder)


def _look_beside(table: dict[str, object], own: str, keys: Sequence[str], there: Path, folder: Path) -> None:
    """Name the files that stand beside an included file as seen from the folder of the first."""
    held = table.get(own) if own else table
    for part in (part for part in (held if isinstance(held, list) else [held]) if isinstance(part, dict)):
        for key in keys:
            name = part.get(key)
            if isinstance(name, str) and there != folder and is_file(there / name):
                part[key] = os.path.relpath(there / name, folder)


def _merged(lower: _Read, upper: _Read, *, is_replaced: bool = False) -> _Read:
    """Return what two files say together; `is_replaced`: lists of the upper take the place of those of the lower."""
    lists = {name for name, value in upper.table.items() if _is_list_of_tables(value)}
    parts = lower.parts
    if is_replaced:
        table = {name: value for name, value in lower.table.items() if name not in lists}
        parts = tuple(_Part(part.source, part.shifts, part.hidden | lists) for part in parts)
        shifts: dict[str, int] = {}
    else:
        table = lower.table
        shifts = {name: len(held) for name in lists if _is_list_of_tables(held := table.get(name))}
    return _Read(
        table=_joined(table, upper.table), parts=(*parts, *(part.shifted(shifts) for part in upper.parts)),
        texts=(*lower.texts, *upper.texts),
    )  # fmt: skip


def _joined(lower: Mapping[str, object], upper: Mapping[str, object]) -> dict[str, object]:
    table = dict(lower)
    for name, value in upper.items():
        held = table.get(name)
        if isinstance(held, dict) and isinstance(value, dict):
            table[name] = _joined(held, value)
        elif _is_list_of_tables(held) and _is_list_of_tables(value):
            table[name] = [*held, *value]
        else:
            table[name] = value
    return table


def _is_list_of_tables(value: object) -> TypeGuard[list[dict[str, object]]]:
    return isinstance(value, list) and bool(value) and all(isinstance(item, dict) for item in value)


def _number(tables: Sequence[object], which: str, key: str) -> int:
    """Return the place of a table in a list, by its number or its name.

    Raises:
        UsageError: There is none.
    """
    names = list(_names(tables))
    if which in names:
        return names.index(which)
    if which.isdecimal() and 0 < int(which) <= len(tables):
        return int(which) - 1
    known = ", ".join(filter(None, names)) or f"1 to {len(tables)}"
    raise UsageError(f"--set {key}: there is no {shown(which)} in this list", hint=f"there are {known}")


def _names(tables: Sequence[object]) -> Iterator[str]:
    for table in tables:
        yield str(table.get("name", "")) if isinstance(table, dict) else ""
