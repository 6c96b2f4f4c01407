"""What installed packages offer by entry points. The current folder never counts.

Installed is what importlib.metadata finds in a folder for packages, an editable install included: its metadata stand
there, and say which folder its code is in. A folder that somebody sends may hold metadata too (`x.egg-info`), or a
module of a package's name; Python looks there where `python -m` or PYTHONPATH says so, and here it counts for nothing.
"""

import json
import os
import sys
from collections.abc import Iterator
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
    here = _here()
    for distribution in distributions():  # not entry_points(): there a package of that name hides the installed one
        home = _home_of(distribution)
        if home is None or home == here:
            continue
        for point in distribution.entry_points.select(group=group):
            if point.name not in found and all(_is_of(spec, home, distribution) for spec in _specs(point.module)):
                found[point.name] = point
    return found


def _home_of(distribution: Distribution) -> Path | None:
    """Return the folder that a distribution's metadata are in; None: one of a path that is no whole one."""
    place = Path(str(distribution.locate_file("")))
    return place.resolve() if place.is_absolute() else None


def _is_of(spec: ModuleSpec, home: Path, distribution: Distribution) -> bool:
    """Tell whether a module is where the packages of that folder are, or where an editable install has its code."""
    folders = [home, *_editable(distribution)]
    places = [spec.origin] if spec.origin not in {None, "built-in", "frozen"} else spec.submodule_search_locations or ()
    return all(any(Path(str(place)).resolve().is_relative_to(one) for one in folders) for place in places)


def _specs(module: str) -> Iterator[ModuleSpec]:
    """Yield how a module would be found: its package's, and in a namespace the next one's. Nothing is executed."""
    parts = module.split(".")
    for count in range(1, len(parts) + 1):
        name = ".".join(parts[:count])
        spec = None
        with suppress(ImportError, ValueError):  # half of it is loaded, or it is not there: loading it says so
            loaded = sys.modules.get(name)
            spec = getattr(loaded, "__spec__", None) or find_spec(name)
        if spec is None:
            return
        yield spec
        if spec.origin is not None:  # its __init__ decides where the rest is
            return


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
