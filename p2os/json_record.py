"""A record back out of the JSON that `dataclasses.asdict` makes of it: by the types of its fields."""

from collections.abc import Sequence
from dataclasses import MISSING, fields, is_dataclass
from functools import cache
from types import NoneType, UnionType
from typing import Any, Literal, Union, cast, get_args, get_origin, get_type_hints


def of_json(hint: object, value: object) -> object:
    """Return a value of a type as it was before it became JSON: of a record, with what its fields hold.

    Of a union of records the one is taken whose `kind` has that default.

    Raises:
        ValueError, TypeError, KeyError: It is none.
    """
    origin = get_origin(hint)
    if isinstance(hint, type) and is_dataclass(hint):
        hints = _hints(hint)
        return hint(**{name: of_json(hints[name], one) for name, one in cast("dict[str, object]", value).items()})
    if origin is Literal:
        if value not in get_args(hint):
            raise ValueError(f"{value!r} is none of {get_args(hint)}")
        return value
    if origin in {Union, UnionType}:
        return _one_of(get_args(hint), value)
    if origin is tuple and get_args(hint)[-1] is not Ellipsis:
        return tuple(of_json(one, cell) for one, cell in zip(get_args(hint), cast("list[object]", value), strict=True))
    if origin is not None:
        return tuple(of_json(get_args(hint)[0], cell) for cell in cast("list[object]", value))
    wanted = (int, float) if hint is float else hint
    if not isinstance(value, cast("type", wanted)):
        raise TypeError(f"{value!r} is no {hint}")
    return value


def _one_of(hints: Sequence[Any], value: object) -> object:
    if value is None and NoneType in hints:
        return None
    others = [one for one in hints if one is not NoneType]
    if len(others) == 1:
        return of_json(others[0], value)
    kind = cast("dict[str, object]", value)["kind"]
    return of_json(next(one for one in others if _kind_of(one) == kind), value)


@cache
def _hints(record: type) -> dict[str, object]:
    return get_type_hints(record)


@cache
def _kind_of(record: Any) -> object:
    found = {field.name: field.default for field in fields(record)}["kind"]
    return None if found is MISSING else found
