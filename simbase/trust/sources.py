"""Loads Python files of users from what was hashed: their sources, whatever stands in `__pycache__`.

Python takes a module from `__pycache__` where time and size of its source are those that are written there, and such
a file travels with a folder as well as a source does.
"""

import sys
from importlib.machinery import (
    BYTECODE_SUFFIXES,
    EXTENSION_SUFFIXES,
    SOURCE_SUFFIXES,
    ExtensionFileLoader,
    FileFinder,
    SourceFileLoader,
    SourcelessFileLoader,
)
from pathlib import Path
from types import CodeType

from simbase.trust.fingerprint import is_package_name


class SourceLoader(SourceFileLoader):
    """Compiles a module each time, and writes no bytecode."""

    def get_code(self, fullname: str) -> CodeType:
        """Return the module's code, from its source."""
        path = self.get_filename(fullname)
        code: CodeType = self.source_to_code(self.get_data(path), path)
        return code


class _SourcesOf:
    """Finds what is imported from a folder and from packages below it: an entry of `sys.path_hooks`."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def holds(self, path: str) -> bool:
        """Tell whether a folder is this one or a package below it."""
        try:
            below = Path(path).resolve().relative_to(self.folder).parts
        except (ValueError, OSError):
            return False
        return all(map(is_package_name, below))

    def __call__(self, path: str) -> FileFinder:
        if not self.holds(path):
            raise ImportError(path)
        return FileFinder(
            path, (ExtensionFileLoader, EXTENSION_SUFFIXES), (SourceLoader, SOURCE_SUFFIXES),
            (SourcelessFileLoader, BYTECODE_SUFFIXES),
        )  # fmt: skip


def read_sources_of(folder: Path) -> None:
    """Have all that is imported from a folder from now on be compiled from its sources."""
    real = folder.resolve()
    if any(isinstance(hook, _SourcesOf) and hook.folder == real for hook in sys.path_hooks):
        return
    found = _SourcesOf(real)
    sys.path_hooks.insert(0, found)
    for path in [path for path in sys.path_importer_cache if found.holds(path)]:
        del sys.path_importer_cache[path]
