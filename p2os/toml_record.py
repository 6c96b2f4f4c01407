"""Tables of TOML files as typed records: one class declares a table, and what is read of a file is one of it.

    class Circle(Record):
        x_m: Annotated[float, Key(least=-100, most=100, doc="its middle")]
        radius_m: Annotated[float, Key(above=0, most=10, doc="its radius")] = 0.5

A field with a `Key` is a key of the table, a field without is none. The type says what may stand there (`float` a
number, `int` a whole one, an enumeration or `Literal` its choices, another record a table of its own), the default
whether it may be left out, the name its unit. `from_` is the key `from`. An array of tables is kept as it was read,
for who reads each by its record. What a schema, a page or a shell says of a key is made of the same (`keys_of`).

Invariant: a record that was read has values of its fields' types, in their ranges; `__post_init__` may refuse more.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import MISSING, Field, dataclass, fields, replace
from enum import Enum
from functools import cache
from types import NoneType, UnionType
from typing import (
    Annotated,
    Any,
    ClassVar,
    Literal,
    TypeVar,
    Union,
    dataclass_transform,
    get_args,
    get_origin,
    get_type_hints,
)

from p2os.toml_schema import Key, Kind, Table, TablePlace, Where, check_table, placed, within


@dataclass_transform(frozen_default=True, kw_only_default=True)
class Record:
    """A table of a file: a subclass declares its keys, and is a frozen dataclass with keywords."""

    __dataclass_fields__: ClassVar[dict[str, Field[Any]]]

    def __init_subclass__(cls) -> None:
        super().__init_subclass__()
        dataclass(frozen=True, kw_only=True)(cls)


T = TypeVar("T", bound=Record)
_KINDS: Mapping[object, Kind] = {bool: "flag", int: "whole", float: "number", str: "text", object: "any"}


@dataclass(frozen=True, slots=True)
class _Column:
    """A field that is a key: its key, and the type that its value comes to."""

    field: str
    key: Key
    type: Any


def keys_of(record: type) -> tuple[Key, ...]:
    """Return the keys that a record declares, in its order."""
    return tuple(column.key for column in _columns(record))


def read(record: type[T], table: Table, where: Where) -> T:
    """Check a table, and return it as a record.

    Raises:
        FileError: As `check_table`; or the record refuses its values, for the reason that it gives.
    """
    check_table(table, keys_of(record), where)
    values = {
        column.field: _typed(table[column.key.name], column, where)
        for column in _columns(record) if column.key.name in table
    }  # fmt: skip
    with placed(where):
        return record(**values)


def read_part(record: type[T], table: Table, where: Where) -> tuple[T, Table]:
    """Return the keys of a table that a record declares as one, and the rest of the table.

    Raises:
        FileError: As `read`.
    """
    own = {key.name for key in keys_of(record)}
    rest = {name: value for name, value in table.items() if name not in own}
    return read(record, {name: value for name, value in table.items() if name in own}, where), rest


def given(record: Record) -> Iterator[tuple[str, Any]]:
    """Yield the keys of a record that are not None, with their values."""
    found = ((column.key.name, getattr(record, column.field)) for column in _columns(type(record)))
    return ((name, value) for name, value in found if value is not None)


def sections(record: type, name: str = "") -> Iterator[tuple[str, tuple[Key, ...]]]:
    """Yield the header of a record's table and of each within it (`[start]`, `[[fault]]`), with its keys."""
    yield name, keys_of(record)
    for key in keys_of(record):
        if key.record is not None:
            inner = f"{name.strip('[]')}.{key.name}".removeprefix(".")
            yield from sections(key.record, _header(key, inner))


def _header(key: Key, name: str) -> str:
    return f"[[{name}]]" if key.kind == "tables" else f"[{name}.NAME]" if key.is_named else f"[{name}]"


def _made_columns(record: type) -> tuple[_Column, ...]:
    hints = get_type_hints(record, include_extras=True)
    found = ((one, hints[one.name]) for one in fields(record))
    return tuple(_column(one, hint) for one, hint in found if get_origin(hint) is Annotated)


#: The fields of a record that are keys.
_columns: Callable[[type], tuple[_Column, ...]] = cache(_made_columns)


def _column(field: "Field[Any]", hint: object) -> _Column:
    said, *notes = get_args(hint)
    key = next(note for note in notes if isinstance(note, Key))
    is_union = isinstance(said, UnionType) or get_origin(said) is Union
    hint, *others = [one for one in get_args(said) if one is not NoneType] if is_union else [said]
    default = field.default if field.default_factory is MISSING else field.default_factory()
    values: dict[str, Any] = {"name": field.name.removesuffix("_"), "required": default is MISSING}
    if default is not MISSING:
        values["default"] = default
    # What the key itself says goes before what its type says.
    values |= {name: value for name, value in _said(hint) if getattr(key, name) in ("any", (), None, False)}
    return _Column(field.name, replace(key, **values), object if others else hint)


def _said(hint: Any) -> Iterator[tuple[str, object]]:
    """Yield what the type of a value says of its key."""
    origin, inner = get_origin(hint), get_args(hint)
    record = _record(inner[-1] if origin is Mapping else hint)
    if record is not None:
        yield from (("kind", "table"), ("record", record), ("is_named", origin is Mapping))
    elif origin is tuple:
        yield "kind", "tables" if get_origin(inner[0]) is Mapping else "texts" if inner[0] is str else "list"
    elif origin is Literal or (isinstance(hint, type) and issubclass(hint, Enum)):
        yield from (("kind", "text"), ("choices", inner or tuple(one.value for one in hint)))
    else:
        yield "kind", "table" if origin is Mapping else _KINDS[hint]


def _record(hint: object) -> type[Record] | None:
    return hint if isinstance(hint, type) and issubclass(hint, Record) else None


def _typed(value: Any, column: _Column, where: Where) -> object:
    """Return a checked value as the type of its field."""
    hint, key = column.type, column.key
    origin, record = get_origin(hint), _record(hint)
    if isinstance(hint, type) and (hint is float or issubclass(hint, Enum)):
        return hint(value)
    inner = f"{where.table}.{key.name}" if isinstance(where, TablePlace) and where.table else key.name
    if record is not None:
        return read(record, value, within(where, inner))
    if key.is_named:
        return {name: _named(get_args(hint)[1], name, part, inner, where) for name, part in value.items()}
    if origin is tuple:
        return (value,) if isinstance(value, str) else _frozen(value)
    return value


def _named(record: type[T], name: str, part: Table, above: str, where: Where) -> T:
    check_table({name: part}, (Key(name=name, kind="table"),), within(where, above))
    return read(record, part, within(where, f"{above}.{name}"))


def _frozen(value: object) -> object:
    """Return lists as tuples."""
    return tuple(map(_frozen, value)) if isinstance(value, (list, tuple)) else value


def tables_of(table: Table, key: str) -> Sequence[Table]:
    """Return the array of tables of a key, as it was read; none where something else stands there."""
    found = table.get(key)
    return [one for one in found if isinstance(one, Mapping)] if isinstance(found, (list, tuple)) else []


def table_of(table: Table, key: str) -> Table:
    """Return the table of a key, as it was read; an empty one where something else stands there."""
    found = table.get(key)
    return found if isinstance(found, Mapping) else {}


def number_of(table: Table, key: str, default: float = 0.0) -> float:
    """Return the number of a key, as it was read; the default where something else stands there."""
    found = table.get(key)
    return found if isinstance(found, (int, float)) else default
