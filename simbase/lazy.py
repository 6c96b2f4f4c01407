"""Public names of a package that are imported on first use (PEP 562).

A package's `__init__` names what it offers in `__all__`, imports it under
`TYPE_CHECKING` for tools that read the source, and leaves the import itself to
`lazily`: `import p2os` then loads neither a port nor a table of packets.
"""

import sys
from collections.abc import Callable, Mapping, Sequence
from importlib import import_module


def lazily(package: str, homes: Mapping[str, Sequence[str]]) -> tuple[Callable[[str], object], Callable[[], list[str]]]:
    """Return `__getattr__` and `__dir__` of a package.

    Args:
        package: Its `__name__`.
        homes: Module → the public names that are fetched from it.
    """
    home_of = {name: home for home, names in homes.items() for name in names}

    def fetch(name: str) -> object:
        if name not in home_of:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        found: object = getattr(import_module(home_of[name]), name)
        vars(sys.modules[package])[name] = found
        return found

    def names() -> list[str]:
        return sorted({*vars(sys.modules[package]), *home_of})

    return fetch, names
