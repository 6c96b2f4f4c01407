"""Attributes that are fields of `self.shared`, the struct that C sees too: there is one copy of the state."""

import ctypes
from operator import attrgetter
from typing import Any

#: What stands for "never" and for "none" among times.
NO_TIME = (1 << 64) - 1

_HALF = 64
_LOW = (1 << _HALF) - 1


def field(name: str, doc: str) -> Any:
    """Return a property that is a field of `self.shared`."""

    def write(self: Any, value: int) -> None:
        setattr(self.shared, name, value)

    return property(attrgetter(f"shared.{name}"), write, doc=doc)


def flag(name: str, doc: str) -> Any:
    """Return a property that is a field of `self.shared`, as a bool."""

    def read(self: Any) -> bool:
        return getattr(self.shared, name) != 0  # type: ignore[no-any-return]  # a field of a ctypes struct

    return field(name, doc).getter(read)


def time(name: str, doc: str) -> Any:
    """Return a property that is a time in `self.shared`, or None."""

    def read(self: Any) -> int | None:
        value: int = getattr(self.shared, name)
        return None if value == NO_TIME else value

    def write(self: Any, value: int | None) -> None:
        setattr(self.shared, name, NO_TIME if value is None else value)

    return property(read, write, doc=doc)


def wide(name: str, doc: str) -> Any:
    """Return a property over two 64-bit fields: a mask over exception numbers."""

    def read(self: Any) -> int:
        low, high = getattr(self.shared, name)
        return low | high << _HALF  # type: ignore[no-any-return]  # ctypes

    def write(self: Any, value: int) -> None:
        words = getattr(self.shared, name)
        words[0], words[1] = value & _LOW, value >> _HALF & _LOW

    return property(read, write, doc=doc)


def packed(name: str, doc: str) -> Any:
    """Return a property that is a struct in `self.shared`, as bytes."""

    def read(self: Any) -> bytes:
        return bytes(getattr(self.shared, name))

    def write(self: Any, data: bytes) -> None:
        ctypes.memmove(ctypes.addressof(getattr(self.shared, name)), data, len(data))

    return property(read, write, doc=doc)
