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
  `snapshot` and `restore` is a part, such as a twin in another language that keeps its state itself;
- ctypes arrays and random generators, by their contents.

Containers and dataclasses that a part holds are filled anew in place, so that whoever
else refers to them sees what was restored.

Invariant: `part.restore(snapshot)` and then `part.snapshot()` gives an equal value.
"""

import ctypes
import dataclasses
import operator
import random
from collections import deque
from collections.abc import Callable, Iterable
from enum import Enum
from functools import cache
from itertools import zip_longest
from typing import Any, ClassVar, TypeAlias

#: Kept as they are. A frozen set or dataclass is taken at its word.
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
        return PartState((name, _saved(getattr(self, name), name)) for name in state_names(kind))

    def restore(self, snapshot: object) -> None:
        """Put back what `snapshot` returned.

        Raises:
            TypeError: it is no snapshot of a part built alike.
        """
        kind: Any = type(self)
        names = state_names(kind)
        if not isinstance(snapshot, PartState) or snapshot.keys() != set(names):
            raise TypeError(f"not a snapshot of {kind.__name__}")
        for name in names:
            current = getattr(self, name)
            if (value := _put_back(current, snapshot[name], name)) is not current:
                setattr(self, name, value)
        self._restored()

    def _restored(self) -> None:
        """Work out again what follows from the state."""


def _is_part(value: object) -> bool:
    """Tell whether an object saves and restores itself."""
    return hasattr(type(value), "snapshot") and hasattr(type(value), "restore")


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
    return tuple(field.name for field in dataclasses.fields(part))


class PartState(dict[str, object]):
    """A part's snapshot: the values of the attributes that it declares."""


def _saved(value: Any, path: str) -> object:
    """Return a value that shares nothing with `value`; a part gives its snapshot."""
    if isinstance(value, _LEAVES):
        return value
    if _is_part(value):
        return value.snapshot()
    return _rebuilt(value, path, _saved)


def _fresh(saved: Any, path: str) -> object:
    """Return a copy of a saved value, so that a snapshot can be restored again."""
    if isinstance(saved, PartState):
        raise TypeError(f"{path} has no part to restore this into")
    return saved if isinstance(saved, _LEAVES) else _rebuilt(saved, path, _fresh)


def _rebuilt(value: Any, path: str, inner: _Inner) -> object:
    """Return a container, dataclass, array or generator anew, with `inner` of all that it holds."""
    for kind, rebuild in _REBUILD:
        if isinstance(value, kind):
            return rebuild(value, lambda item: inner(item, path))
    if not dataclasses.is_dataclass(value) or isinstance(value, type):
        raise TypeError(f"{path} holds {type(value).__name__}, which is no state")
    own: Any = type(value)
    if _is_frozen(own):
        return value
    copy: Any = object.__new__(own)
    for name in _fields(own):
        setattr(copy, name, inner(getattr(value, name), f"{path}.{name}"))
    return copy


def _put_back(current: Any, saved: Any, path: str) -> object:
    """Return what stands here from now on: `current`, filled anew, wherever it can be."""
    if _is_part(current):
        current.restore(saved)
        return current
    for kind, refill in _IN_PLACE:
        if isinstance(current, kind):
            refill(current, saved)
            return current
    if type(current) is not type(saved) or isinstance(current, _LEAVES):
        return _fresh(saved, path)
    for container, fill in _FILL:
        if isinstance(current, container):
            return fill(current, saved, path)
    own: Any = type(current)
    if _is_frozen(own):
        return saved
    for name in _fields(own):
        setattr(current, name, _put_back(getattr(current, name), getattr(saved, name), f"{path}.{name}"))
    return current


def _fill_dict(current: dict[Any, Any], saved: dict[Any, Any], path: str) -> object:
    kept = {key: _put_back(current.pop(key, None), item, path) for key, item in saved.items()}
    _refuse_left_over(current.values(), path)
    current.clear()
    current.update(kept)
    return current


def _fill_sequence(current: Any, saved: Any, path: str) -> object:
    _refuse_left_over(list(current)[len(saved) :], path)
    items = [_put_back(here, item, path) for here, item in zip_longest(list(current)[: len(saved)], saved)]
    if isinstance(current, tuple):
        is_same = len(items) == len(current) and all(map(operator.is_, items, current))
        return current if is_same else _like(current, items)
    current.clear()
    current.extend(items)
    return current


def _fill_set(current: Any, saved: Any, path: str) -> object:  # noqa: ARG001  # one shape for all of the table
    current.clear()
    current.update(saved) if isinstance(current, set) else current.extend(saved)
    return current


def _refuse_left_over(items: Iterable[object], path: str) -> None:
    if any(map(_is_part, items)):
        raise TypeError(f"{path} holds more parts than were saved")


def _like_dict(value: dict[Any, Any], items: dict[Any, Any]) -> object:
    """Return a dict of the kind of `value`: a Counter stays one, a defaultdict keeps its factory."""
    fresh = value.copy()
    fresh.clear()
    fresh.update(items)
    return fresh


def _like(value: Any, items: Iterable[object]) -> object:
    """Return a tuple of the kind of `value`, named or not."""
    kind = type(value)
    return kind(*items) if hasattr(kind, "_fields") else tuple(items)


#: How a value is copied: of what kind, and how, with a function for what it holds.
_REBUILD: tuple[tuple[type, Callable[[Any, Callable[[Any], object]], object]], ...] = (
    (tuple, lambda value, inner: _like(value, map(inner, value))),
    (deque, lambda value, inner: deque(map(inner, value), value.maxlen)),
    (list, lambda value, inner: [inner(item) for item in value]),
    (dict, lambda value, inner: _like_dict(value, {key: inner(item) for key, item in value.items()})),
    (set, lambda value, _: value.copy()),
    (bytearray, lambda value, _: value.copy()),
    (ctypes.Array, lambda value, _: bytes(value)),
    (random.Random, lambda value, _: value.getstate()),
)

#: What is always restored in place, from a snapshot of another kind than itself.
_IN_PLACE: tuple[tuple[type, Callable[[Any, Any], object]], ...] = (
    (ctypes.Array, lambda array, saved: ctypes.memmove(array, saved, len(saved))),
    (random.Random, lambda source, saved: source.setstate(saved)),
)

#: What is filled anew from a copy of its own kind.
_FILL: tuple[tuple[type | tuple[type, ...], Callable[[Any, Any, str], object]], ...] = (
    (dict, _fill_dict),
    ((list, tuple, deque), _fill_sequence),
    ((set, bytearray), _fill_set),
)


def _is_frozen(kind: Any) -> bool:
    return bool(kind.__dataclass_params__.frozen)
