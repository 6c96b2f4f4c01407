"""What installed packages offer by entry points. The current folder never counts.

Installed is what importlib.metadata finds in a folder for packages, an editable install included: its metadata stand
there, and say which folder its code is in. A folder that somebody sends may hold metadata too (`x.egg-info`), or a
module of a package's name; Python looks there where `python -m` or PYTHONPATH says so, and here it counts for nothing.
"""

import json
import os
import sys
from collections.abc import Iterator, Sequence
from contextlib import suppress
from importlib.machinery import ModuleSpec
from importlib.metadata import Distribution, EntryPoint, distributions
from importlib.util import find_spec
from pathlib import Path
from urllib.parse import unquote, urlsplit

_DIRECT_URL = "direct_url.json"


def installed_points(group: str) -> dict[str, EntryPoint]:
    """Return the entry points of a group that installed packages offer, by name; of two of a name the first found."""
    found: dict[str, EntryPoint] = {}
    for point in every_installed_point(group):
        found.setdefault(point.name, point)
    return found


def every_installed_point(group: str) -> Iterator[EntryPoint]:
    """Yield the entry points of a group that installed packages offer, also those of one name."""
    here = _here()
    for distribution in distributions():  # not entry_points(): there a package of that name hides the installed one
        points = distribution.entry_points.select(group=group)
        home = _home_of(distribution) if points else None
        if home is None or home == here:
            continue
        folders = [home, *_editable(distribution)]
        packages = {module: _is_in(module, folders) for module in {_package(point.module) for point in points}}
        yield from (point for point in points if packages[_package(point.module)])


def _home_of(distribution: Distribution) -> Path | None:
    """Return the folder that a distribution's metadata are in; None: one of a path that is no whole one."""
    place = Path(str(distribution.locate_file("")))
    return place.resolve() if place.is_absolute() else None


def _package(module: str) -> str:
    """Return the package whose `__init__` decides where a module is; of one in a namespace the module itself."""
    top = module.partition(".")[0]
    spec = _spec(top)
    return module if spec is not None and spec.origin is None else top


def _is_in(module: str, folders: Sequence[Path]) -> bool:
    """Tell whether a module would be found in these folders, or nowhere, as loading it says. Nothing is executed."""
    parts = module.split(".")
    for count in range(1, len(parts) + 1):
        spec = _spec(".".join(parts[:count]))
        if spec is None:
            return True
        is_file = spec.origin not in {None, "built-in", "frozen"}
        places = [str(spec.origin)] if is_file else [str(place) for place in spec.submodule_search_locations or ()]
        if not all(any(Path(place).resolve().is_relative_to(one) for one in folders) for place in places):
            return False
        if spec.origin is not None:
            return True
    return True


def _spec(module: str) -> ModuleSpec | None:
    with suppress(ImportError, ValueError):  # half of it is loaded, or it is not there
        return getattr(sys.modules.get(module), "__spec__", None) or find_spec(module)
    return None


def _editable(distribution: Distribution) -> Iterator[Path]:
    """Yield the folder of an editable install."""
    with suppress(ValueError, TypeError, KeyError, AttributeError):
        said = json.loads(distribution.read_text(_DIRECT_URL) or "{}")
        if said.get("dir_info", {}).get("editable"):
            yield Path(unquote(urlsplit(str(said["url"])).path)).resolve()


def _here() -> Path | None:
    try:
        return Path(os.getcwd()).resolve()  # noqa: PTH109 - Path.cwd() is the same
    except OSError:  # it was removed
        return None
