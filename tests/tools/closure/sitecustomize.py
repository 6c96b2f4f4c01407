"""Hides packages from this Python and from those that it starts, as if they were not installed.

`HIDDEN_PACKAGES` names them, with commas: their modules cannot be imported, and what the installed metadata offers of
them (entry points) is not there. Python imports this file by itself where its folder is in PYTHONPATH.
"""

import importlib.metadata
import os
import sys
from collections.abc import Sequence
from importlib.machinery import ModuleSpec
from types import ModuleType

HIDDEN = tuple(filter(None, os.environ.get("HIDDEN_PACKAGES", "").split(",")))


def is_hidden(module: str) -> bool:
    """Tell whether a module is of a hidden package."""
    return any(module == name or module.startswith(f"{name}.") for name in HIDDEN)


class Hider:
    """Finds nothing of the hidden packages, before anybody else finds it."""

    def find_spec(
        self, name: str, _path: Sequence[str] | None = None, _target: ModuleType | None = None
    ) -> ModuleSpec | None:
        """Refuse a hidden module.

        Raises:
            ModuleNotFoundError: It is of a hidden package.
        """
        if is_hidden(name):
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)
        return None


def offered(distribution: importlib.metadata.Distribution) -> importlib.metadata.EntryPoints:
    """Return the entry points of a distribution but for those of what is hidden."""
    return importlib.metadata.EntryPoints(point for point in _all(distribution) if not is_hidden(point.module))


_all = importlib.metadata.Distribution.entry_points.fget
if HIDDEN:
    sys.meta_path.insert(0, Hider())
    importlib.metadata.Distribution.entry_points = property(offered)
