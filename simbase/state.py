"""State that is declared once, and saved, restored and pickled generically.

A part derives from `Stateful` and names in `STATE` the attributes that decide its
future; what it is built from (settings, neighbours, callbacks) and what follows from
the state (`DERIVED`, worked out again by `_restored`) stand outside. A snapshot is a
value: it shares nothing with the part, can be compared, pickled, and restored into
any part that was built alike, as often as wanted.

What an attribute may hold:

- numbers, texts, bytes, None, enums and frozen dataclasses, which are kept as they are;
- lists, tuples, deques, dicts, sets and byte arrays of what may be held;
- dataclasses, which are copied field by field;
- other parts, alone or in a list, tuple or dict: they are restored in place, never replaced. Whatever has
  `snapshot` and `restore` is a part;
- many small parts of one class, as `Rows`;
- arrays of the module `array`, ctypes arrays and random generators, by their contents.

Containers and dataclasses that a part holds are filled anew in place, so that whoever
else refers to them sees what was restored.

Invariant: `part.restore(snapshot)` and then `part.snapshot()` gives an equal value.
"""

import ctypes
import dataclasses
import operator
import random
from array import array
from collections import deque
from collections.abc import Callable, Iterable
from enum import Enum
from functools import cache
from itertools import chain, zip_longest
from typing import Any, ClassVar, Protocol, TypeAlias, runtime_checkable

#: Kept as they are, as frozen dataclasses are. They and frozen sets are taken at their word.
_LEAVES = (int, float, complex, str, bytes, type(None), Enum, frozenset, range)

_Inner: TypeAlias = Callable[[Any, str], object]


class Stateful:
    """A part whose state is declared.

    `STATE` names the attributes that decide the future; those of base classes come first.
    A dataclass without `STATE` declares all its fields. `DERIVED` names attributes that change
    and are no state: `_restored` works them out again, or they decide nothing.
    """

    __slots__ = ()

    STATE: ClassVar[tuple[str, ...]] = ()
    DERIVED: ClassVar[tuple[str, ...]] = ()

    def snapshot(self) -> "PartState":
        """Return all that decides the future, as a value.

        Raises:
            TypeError: an attribute of `STATE` holds what is no state, such as a function.
        """
        kind: Any = type(self)
        names, values = _attributes(kind)
        held = values(self)
        state = PartState(zip(names, held))  # noqa: B905  # for each part of a board: strictness costs
        for name, value in state.items():
            if (rebuild := _REBUILDER[type(value)]) is not None:
                state[name] = rebuild(value, name, _saved)
        return state

    def restore(self, snapshot: object) -> None:
        """Put back what `snapshot` returned.

        Raises:
            TypeError: it is no snapshot of a part built alike.
        """
        kind: Any = type(self)
        names, values = _attributes(kind)
        if not isinstance(snapshot, PartState) or tuple(snapshot) != names:
            raise TypeError(f"not a snapshot of {kind.__name__}")
        held = values(self)
        if not all(map(operator.is_, held, snapshot.values())):
            for (name, saved), current in zip(snapshot.items(), held, strict=True):
                if saved is not current and (value := _put_back(current, saved, name)) is not current:
                    setattr(self, name, value)
        self._restored()

    def _restored(self) -> None:
        """Work out again what follows from the state."""


@runtime_checkable
class StatefulPart(Protocol):
    """Whatever saves and restores itself, such as a twin in another language that keeps its state itself."""

    def snapshot(self) -> object:
        """Return all that decides the future, as a value."""

    def restore(self, snapshot: Any) -> None:
        """Put back what `snapshot` returned."""


class _Rebuilders(dict[type, Callable[[Any, str, _Inner], object] | None]):
    """How values of a type are copied, None for those that are kept as they are; found out once a type."""

    def __missing__(self, kind: type) -> Callable[[Any, str, _Inner], object] | None:
        parameters = getattr(kind, "__dataclass_params__", None)
        is_frozen = parameters is not None and parameters.frozen and not issubclass(kind, StatefulPart)
        if issubclass(kind, _LEAVES) or is_frozen:
            self[kind] = None
        else:
            self[kind] = next((rebuild for base, rebuild in _REBUILD if issubclass(kind, base)), _rebuild_fields)
        return self[kind]


_REBUILDER = _Rebuilders()


@cache
def _fields(part: Any) -> tuple[str, ...]:
    return tuple(field.name for field in dataclasses.fields(part))


@cache
def state_names(part: Any) -> tuple[str, ...]:
    """Return the attributes that a class and its bases declare as state, each once."""
    names: dict[str, None] = {}
    for base in reversed(part.__mro__):
        if "STATE" in vars(base):
            names.update(dict.fromkeys(vars(base)["STATE"]))
    if names or not dataclasses.is_dataclass(part):
        return tuple(names)
    own: Any = part
    return _fields(own)


@cache
def _attributes(part: Any) -> tuple[tuple[str, ...], Callable[[object], Iterable[object]]]:
    """Return `state_names`, and a function of a part that returns the values of these attributes."""
    names = state_names(part)
    return names, operator.attrgetter(*names) if len(names) > 1 else lambda self: [getattr(self, n) for n in names]


class PartState(dict[str, object]):
    """A part's snapshot: the values of the attributes that it declares."""


class Rows:
    """Many parts of one class, such as pins, saved as one table: a row of values a part, in four fifths less time.

    Each attribute of their state must be kept as it is (a number, None, an enum, a frozen dataclass), and
    what is `DERIVED` follow from the part's own state alone: `_restored` is called where that has changed only.
    """

    __slots__ = ("_names", "_parts", "_values")

    def __init__(self, parts: Iterable[Stateful]) -> None:
        """Take one part or more, in the order of the rows."""
        self._parts = tuple(parts)
        kind: Any = type(self._parts[0])
        self._names, self._values = _attributes(kind)

    def snapshot(self) -> tuple[object, ...]:
        """Return a row a part.

        Raises:
            TypeError: an attribute holds what is not kept as it is.
        """
        rows = tuple(map(self._values, self._parts))
        for kind in set(map(type, chain.from_iterable(rows))):
            if _REBUILDER[kind] is not None:
                raise TypeError(f"a row holds {kind.__name__}, which is not kept as it is")
        return rows

    def restore(self, rows: Any) -> None:
        """Put back what `snapshot` returned.

        Raises:
            TypeError: it is no snapshot of as many parts with as many attributes.
        """
        is_alike = isinstance(rows, tuple) and len(rows) == len(self._parts)
        if not is_alike or set(map(len, rows)) != {len(self._names)}:
            raise TypeError("not a snapshot of these rows")
        for part, row, held in zip(self._parts, rows, map(self._values, self._parts), strict=True):
            if held != row:
                for name, value in zip(self._names, row, strict=True):
                    setattr(part, name, value)
                part._restored()  # noqa: SLF001  # a part's own, called as Stateful does


def _saved(value: Any, path: str) -> object:
    """Return a value that shares nothing with `value`; a part gives its snapshot."""
    rebuild = _REBUILDER[type(value)]
    return value if rebuild is None else rebuild(value, path, _saved)


def _fresh(saved: Any, path: str) -> object:
    """Return a copy of a saved value, so that a snapshot can be restored again."""
    if isinstance(saved, PartState):
        raise TypeError(f"{path} has no part to restore this into")
    rebuild = _REBUILDER[type(saved)]
    return saved if rebuild is None else rebuild(saved, path, _fresh)


def _rebuild_fields(value: Any, path: str, inner: _Inner) -> object:
    own: Any = type(value)
    if not hasattr(own, "__dataclass_fields__"):
        raise TypeError(f"{path} holds {own.__name__}, which is no state: derive it from Stateful (simbase.state)")
    copy: Any = object.__new__(own)
    for name in _fields(own):
        setattr(copy, name, inner(getattr(value, name), f"{path}.{name}"))
    return copy


def _put_back(current: Any, saved: Any, path: str) -> object:
    """Return what stands here from now on: `current`, filled anew, wherever it can be."""
    own: Any = type(current)
    if _REBUILDER[own] is None:
        return _fresh(saved, path)
    refill = _in_place_of(own)
    if refill is not None:
        refill(current, saved)
        return current
    if type(current) is not type(saved):
        return _fresh(saved, path)
    fill = _fill_of(own)
    if fill is not None:
        return fill(current, saved, path)
    for name in _fields(own):
        if (here := getattr(current, name)) is not (item := getattr(saved, name)):
            setattr(current, name, _put_back(here, item, f"{path}.{name}"))
    return current


def _fill_dict(current: dict[Any, Any], saved: dict[Any, Any], path: str) -> object:
    if list(current) == list(saved):
        for key, item in saved.items():
            if (here := current[key]) is not item:
                current[key] = _put_back(here, item, path)
        return current
    kept = {key: _put_back(current.pop(key, None), item, path) for key, item in saved.items()}
    _refuse_left_over(current.values(), path)
    current.clear()
    current.update(kept)
    return current


def _fill_sequence(current: Any, saved: Any, path: str) -> object:
    items: Iterable[object]
    if all(_REBUILDER[kind] is None for kind in set(map(type, chain(current, saved)))):  # many bytes of a line
        items = saved
    elif isinstance(current, tuple) and _saved(current, path) is current:  # nothing in it could be filled anew
        return _fresh(saved, path)
    else:
        _refuse_left_over(list(current)[len(saved) :], path)
        items = [_put_back(here, item, path) for here, item in zip_longest(list(current)[: len(saved)], saved)]
    if isinstance(current, tuple):
        items = tuple(items)
        is_same = len(items) == len(current) and all(map(operator.is_, items, current))
        return current if is_same else _like(current, items)
    current.clear()
    current.extend(items)
    return current


def _fill_same(current: Any, saved: Any, path: str) -> object:  # noqa: ARG001  # one shape for all of the table
    current.clear()
    current.update(saved) if isinstance(current, set) else current.extend(saved)
    return current


def _fill_array(current: Any, saved: Any, path: str) -> object:  # noqa: ARG001  # as above
    current[:] = saved
    return current


def _refuse_left_over(items: Iterable[object], path: str) -> None:
    if any(map(_is_part, map(type, items))):
        raise TypeError(f"{path} holds more parts than were saved")


@cache
def _is_part(kind: type) -> bool:
    """Tell whether what is of a type is a part; found out once a type, for a protocol's check takes 20 µs."""
    return issubclass(kind, StatefulPart)


def _like_dict(value: dict[Any, Any], items: dict[Any, Any]) -> object:
    """Return a dict of the kind of `value`: a Counter stays one, a defaultdict keeps its factory."""
    if type(value) is dict:
        return items
    fresh = value.copy()
    fresh.clear()
    fresh.update(items)
    return fresh


def _like(value: Any, items: Iterable[object]) -> object:
    """Return a tuple of the kind of `value`, named or not."""
    kind = type(value)
    return kind(*items) if hasattr(kind, "_fields") else tuple(items)


def _rebuild_tuple(value: Any, path: str, inner: _Inner) -> object:
    items = [inner(item, path) for item in value]
    return value if all(map(operator.is_, items, value)) else _like(value, items)


class _Generator(tuple[object, ...]):
    """The saved state of a random generator, from which one is made where none stands yet."""

    __slots__ = ()

    def made(self) -> random.Random:
        source = random.Random()
        source.setstate(self)
        return source


#: How a value is copied: of what kind, and how, with a function for what it holds.
_REBUILD: tuple[tuple[type, Callable[[Any, str, _Inner], object]], ...] = (
    (StatefulPart, lambda part, _path, _inner: part.snapshot()),
    (_Generator, lambda saved, _path, _inner: saved.made()),
    (tuple, _rebuild_tuple),
    (deque, lambda value, path, inner: deque([inner(item, path) for item in value], value.maxlen)),
    (list, lambda value, path, inner: [inner(item, path) for item in value]),
    (dict, lambda value, path, inner: _like_dict(value, {key: inner(item, path) for key, item in value.items()})),
    (set, lambda value, _path, _inner: value.copy()),
    (bytearray, lambda value, _path, _inner: value.copy()),
    (array, lambda value, _path, _inner: value[:]),
    (ctypes.Array, lambda value, _path, _inner: bytes(value)),
    (random.Random, lambda value, _path, _inner: _Generator(value.getstate())),
)

#: What is always restored in place, from a snapshot of another kind than itself.
_IN_PLACE: tuple[tuple[type, Callable[[Any, Any], object]], ...] = (
    (StatefulPart, lambda part, saved: part.restore(saved)),
    (ctypes.Array, lambda words, saved: ctypes.memmove(words, saved, len(saved))),
    (random.Random, lambda source, saved: source.setstate(saved)),
)

#: What is filled anew from a copy of its own kind.
_FILL: tuple[tuple[type | tuple[type, ...], Callable[[Any, Any, str], object]], ...] = (
    (dict, _fill_dict),
    ((list, tuple, deque), _fill_sequence),
    ((set, bytearray), _fill_same),
    (array, _fill_array),
)


def _by_type(table: Iterable[tuple[Any, Any]]) -> Callable[[Any], Any]:
    """Return a function of a type that finds its row in a table; None where it has none."""
    return cache(lambda kind: next((way for base, way in table if issubclass(kind, base)), None))


_in_place_of, _fill_of = _by_type(_IN_PLACE), _by_type(_FILL)
