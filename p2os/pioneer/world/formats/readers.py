"""Which reader reads which file."""

from collections.abc import Mapping
from dataclasses import replace
from importlib import import_module
from pathlib import Path
from typing import Protocol, cast

from p2os.errors import WorldError
from p2os.pioneer.world.formats.local_file import sized
from p2os.pioneer.world.formats.placing import Placing, placed_world
from p2os.pioneer.world.model import World
from simbase.errors import MissingDependencyError, shown_name

#: Ending → module of this package that reads such files.
FORMATS: Mapping[str, str] = {
    ".map": "aria_map",
    ".yaml": "occupancy",
    ".yml": "occupancy",
    ".sdf": "sdf",
    ".world": "sdf",
    ".urdf": "urdf",
    ".obj": "meshes.mesh_file",
    ".stl": "meshes.mesh_file",
    ".dae": "meshes.mesh_file",
    ".gltf": "meshes.mesh_file",
    ".glb": "meshes.mesh_file",
}


class Reader(Protocol):
    """What a module of `FORMATS` has."""

    def read(self, path: Path, up: str) -> World:
        """Return what a file holds, in metres with Z up.

        Args:
            path: The file; it exists and is not too large.
            up: `auto`, or the axis that is up in the file; maps have none and refuse it.

        Raises:
            WorldError: The file is not what its ending names.
        """
        ...


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
    module = FORMATS.get(path.suffix.lower())
    if path.suffix.lower() == ".toml":
        raise WorldError(f"{shown_name(path)}: a world file, where a file of another program is taken", hint=_known())
    if module is None:
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
    reader = cast("Reader", _load(module))
    try:
        world = reader.read(path, placing.up)
        return placed_world(replace(world, source=str(path)), placing)
    except WorldError as error:
        if str(path.parent) in str(error):
            raise
        raise WorldError(f"{path}: {error}", hint=error.hint) from error
    except OSError as error:
        raise WorldError(f"{path}: {error.strerror or error}") from error
    except (RecursionError, MemoryError, OverflowError) as error:
        raise WorldError(f"{path}: too large or too deep to read", hint="make it simpler first") from error


def _load(module: str) -> object:
    """Import a reader, or name the package that it lacks."""
    try:
        return import_module(f"p2os.pioneer.world.formats.{module}")
    except ModuleNotFoundError as error:
        raise MissingDependencyError(f"reading this file needs {error.name}", extra="worlds") from error


def _known(*more: str) -> str:
    return f"readable: {', '.join((*more, *FORMATS))}"
