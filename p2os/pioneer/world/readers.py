"""Files of other programs as worlds: the reader of a file is an entry point, found by the file's ending."""

from collections.abc import Mapping
from dataclasses import replace
from functools import cache
from importlib.metadata import EntryPoint
from pathlib import Path
from typing import Protocol, cast

from p2os.errors import WorldError
from p2os.pioneer.world.model import World
from p2os.pioneer.world.placing import Placing, placed_world
from p2os.pioneer.world.text_file import sized
from simbase.entry_points import installed_points
from simbase.errors import MissingDependencyError, shown_name
from simbase.installation import way_to_plug_in
from simbase.user_classes import loaded

#: The entry points: the ending without its dot → `Reader`.
GROUP = "p2os.world_readers"


class Reader(Protocol):
    """What an entry point of `GROUP` is."""

    def __call__(self, path: Path, up: str) -> World:
        """Return what a file holds, in metres with Z up.

        Args:
            path: The file; it exists and is not too large.
            up: `auto`, or the axis that is up in the file; maps have none and refuse it.

        Raises:
            WorldError: The file is not what its ending names.
        """
        ...


@cache
def readers() -> Mapping[str, EntryPoint]:
    """Return what reads files of other programs, by their endings; looked up once a process."""
    return {f".{name}": point for name, point in installed_points(GROUP).items()}


def read_world(path: Path) -> World:
    """Return the world that a file of another program holds; the format is known by the ending.

    Raises:
        WorldError: No reader knows the ending, or the file is broken.
        MissingDependencyError: The reader needs a package that is not installed.
    """
    return read_placed(path, Placing())


def read_placed(path: Path, placing: Placing) -> World:
    """Return the world of a file, moved and scaled.

    Raises:
        WorldError: No reader knows the ending, or the file is broken.
        MissingDependencyError: The reader needs a package that is not installed.
    """
    point = readers().get(path.suffix.lower())
    if path.suffix.lower() == ".toml":
        raise WorldError(f"{shown_name(path)}: a world file, where a file of another program is taken", hint=_known())
    if point is None:
        raise WorldError(
            f"{shown_name(path)}: no reader for {shown_name(path.suffix) or 'a file without an ending'}",
            hint=_known(".toml"),
        )
    try:
        path.stat()
    except (OSError, ValueError) as error:  # ValueError: a NUL in the name
        raise WorldError(f"{shown_name(path)}: {getattr(error, 'strerror', None) or error}") from error
    if not path.is_file():
        raise WorldError(f"{path}: not a file")
    sized(path)
    reader = _load(point)
    try:
        world = reader(path, placing.up)
        return placed_world(replace(world, source=str(path)), placing)
    except WorldError as error:
        if str(path.parent) in str(error):
            raise
        raise WorldError(f"{path}: {error}", hint=error.hint) from error
    except OSError as error:
        raise WorldError(f"{path}: {error.strerror or error}") from error
    except (RecursionError, MemoryError, OverflowError) as error:
        raise WorldError(f"{path}: too large or too deep to read", hint="make it simpler first") from error


def _load(point: EntryPoint) -> Reader:
    """Import a reader, or name the package that it lacks."""
    try:
        return cast("Reader", loaded(point))
    except ModuleNotFoundError as error:
        raise MissingDependencyError(f"reading this file needs {error.name}", extra="worlds") from error


def _known(*more: str) -> str:
    absent = way_to_plug_in(GROUP)
    return f"readable: {', '.join((*more, *readers())) or 'none'}{absent and f'; {absent}'}"
