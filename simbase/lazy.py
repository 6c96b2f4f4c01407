"""Public names of a package that are imported on first use (PEP 562).

A package's `__init__` names what it offers in `__all__`, imports it under
`TYPE_CHECKING` for tools that read the source, and leaves the import itself to
`lazily`: `import p2os` then loads neither a port nor a table of packets. It has
`__version__` too, read from the metadata of what is installed.
"""

import sys
import warnings
from collections.abc import Callable, Mapping, Sequence
from importlib import import_module
from typing import NamedTuple


class DeprecatedName(NamedTuple):
    """A public name that is on its way out: it works as before for a release, with a warning."""

    #: Where it is: `module:name`.
    home: str
    #: What to write in its place.
    use: str
    #: The first version without it.
    gone_in: str


def lazily(
    package: str, homes: Mapping[str, Sequence[str]], deprecated: Mapping[str, DeprecatedName] | None = None
) -> tuple[Callable[[str], object], Callable[[], list[str]]]:  # fmt: skip
    """Return `__getattr__` and `__dir__` of a package.

    Args:
        package: Its `__name__`.
        homes: Module → the public names that are fetched from it.
        deprecated: Public names that warn; they are not among those of `homes`, nor in `__all__`.
    """
    home_of = {name: home for home, names in homes.items() for name in names}
    old = deprecated or {}

    def fetch(name: str) -> object:
        if name in old:
            module, _, inner = old[name].home.partition(":")
            warn_deprecated(f"{package}.{name}", use=old[name].use, gone_in=old[name].gone_in, stacklevel=3)
            return getattr(import_module(module), inner)
        if name == "__version__":
            from simbase.installation import package_version  # reads the installed metadata, which takes time

            return package_version(package)
        if name not in home_of:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        found: object = getattr(import_module(home_of[name]), name)
        vars(sys.modules[package])[name] = found
        return found

    def names() -> list[str]:
        return sorted({*vars(sys.modules[package]), *home_of, "__version__"})

    return fetch, names


def warn_deprecated(what: str, *, use: str, gone_in: str, stacklevel: int = 2) -> None:
    """Warn whoever uses what the next release but one does not have (docs/releases.md).

    Args:
        what: A public name, as one writes it.
        use: What to write in its place.
        gone_in: The first version without it.
        stacklevel: As of `warnings.warn`: 2 is who called the caller.
    """
    warnings.warn(f"{what} is deprecated, and gone in {gone_in}: use {use}", DeprecationWarning, stacklevel=stacklevel)
